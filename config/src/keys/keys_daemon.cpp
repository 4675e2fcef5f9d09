// SPDX-License-Identifier: Apache-2.0
#include "keys.hpp"

/// Keys of the daemon's configuration.
namespace emit::config {

const KeyTable<DaemonHead>& daemon_head_keys() {
  static const KeyTable<DaemonHead> keys = {
      text<DaemonHead>(
          "scenario", EMIT_FIELD(scenario),
          "Scenario file, or the name of a shipped scenario. Only a canned source goes without."),
  };
  return keys;
}

const KeyTable<SourceConfig>& source_keys() {
  static const KeyTable<SourceConfig> keys = {
      choice<SourceConfig>("kind",
                           std::vector<std::pair<std::string, SourceKind>>{
                               {"renderer", SourceKind::renderer}, {"canned", SourceKind::canned}},
                           EMIT_FIELD(kind),
                           "renderer: frames are rendered. canned: frames are read or made "
                           "beforehand, to test a rig."),
      nanoseconds<SourceConfig>(
          "first_time_s", "s", 1e9, between(-limits::kMaxSimTimeS, limits::kMaxSimTimeS),
          EMIT_FIELD(first_time_ns),
          "renderer: simulation time of the first pose, for which the "
          "surface is warmed up at start. At other times the first frame waits."),
      path<SourceConfig>(
          "canned_dir", EMIT_FIELD(canned_dir),
          "canned: folder of `frame_*.exr` with a `radiance` channel. They are shown in the order "
          "of names, again and again. Without it a test pattern moves."),
      integer<SourceConfig>("canned_width_px", "px", limits::kCannedPx, EMIT_FIELD(canned_width_px),
                            "Columns of the test pattern."),
      integer<SourceConfig>("canned_height_px", "px", limits::kCannedPx,
                            EMIT_FIELD(canned_height_px), "Rows of the test pattern."),
      integer<SourceConfig>("canned_frames", "", 1, 1024, EMIT_FIELD(canned_frames),
                            "Length of the test pattern in frames."),
  };
  return keys;
}

const KeyTable<PacingConfig>& pacing_keys() {
  static const KeyTable<PacingConfig> keys = {
      choice<PacingConfig>(
          "mode",
          std::vector<std::pair<std::string, PacingMode>>{{"host-step", PacingMode::host_step},
                                                          {"ig-clock", PacingMode::ig_clock},
                                                          {"trigger", PacingMode::trigger}},
          EMIT_FIELD(mode),
          "host-step: pose k starts frame k. ig-clock: frames start at a fixed rate with the "
          "newest pose. trigger: a sync source's datagram starts them."),
      number<PacingConfig>("rate_hz", "Hz", between(0.1, 2000), EMIT_FIELD(rate_hz),
                           "ig-clock: frame rate. trigger: rate of the source, by which late and "
                           "spurious triggers are found."),
      nanoseconds<PacingConfig>(
          "budget_ms", "ms", 1e6, between(0, 60000), EMIT_FIELD(budget_ns),
          "Deadline of a frame after its pose (host-step) or trigger. 0 means none, or one "
          "period with trigger. Frames lose quality to meet it (cached)."),
      nanoseconds<PacingConfig>(
          "horizon_ms", "ms", 1e6, between(0, 60000), EMIT_FIELD(horizon_ns),
          "Poses are extrapolated at most this far. Beyond it the frame is flagged stale."),
      nanoseconds<PacingConfig>("display_delay_ms", "ms", 1e6, between(0, 60000),
                                EMIT_FIELD(display_delay_ns),
                                "Poses (ig-clock, trigger) and axes of `[motion]` are predicted "
                                "to this time after the slot begins or the pose comes. It is "
                                "at most `horizon_ms`."),
  };
  return keys;
}

const KeyTable<TriggerConfig>& trigger_keys() {
  static const KeyTable<TriggerConfig> keys = {
      text<TriggerConfig>("udp", EMIT_FIELD(udp),
                          "`address:port` for trigger datagrams. Only `pacing.mode = \"trigger\"` "
                          "opens it. Beyond loopback it needs `peer`."),
      text<TriggerConfig>("peer", EMIT_FIELD(peer),
                          "Numeric address of the sync source. Triggers of others are refused. "
                          "When it is empty, any source on loopback counts."),
  };
  return keys;
}

const KeyTable<ClockConfig>& clock_keys() {
  static const KeyTable<ClockConfig> keys = {
      path<ClockConfig>("ptp_socket", EMIT_FIELD(ptp_socket),
                        "Management socket of ptp4l (linuxptp), such as `/var/run/ptp4lro`. Its "
                        "state then shows in /metrics."),
      integer<ClockConfig>("ptp_domain", "", 0, 127, EMIT_FIELD(ptp_domain),
                           "PTP domain of that ptp4l."),
  };
  return keys;
}

const KeyTable<RealtimeConfig>& realtime_keys() {
  static const KeyTable<RealtimeConfig> keys = {
      choice<RealtimeConfig>("scheduler",
                             std::vector<std::pair<std::string, SchedulerKind>>{
                                 {"other", SchedulerKind::other}, {"fifo", SchedulerKind::fifo}},
                             EMIT_FIELD(scheduler),
                             "fifo: conductor, motion, receiver, sender and render run as "
                             "real-time threads (SCHED_FIFO). It needs LimitRTPRIO."),
      integer<RealtimeConfig>("priority", "", 4, 99, EMIT_FIELD(priority),
                              "fifo: priority of conductor and motion. Receiver, sender and render "
                              "have 1, 2 and 3 less."),
      text<RealtimeConfig>("cpus", EMIT_FIELD(cpus),
                           "Cores of agents, such as `conductor=2, motion=2, receiver=2, "
                           "sender=3, render=4-7`. The others run on any core."),
      boolean<RealtimeConfig>(
          "lock_memory", EMIT_FIELD(lock_memory),
          "With `true` all memory is locked, and stacks and heap are touched at start, so that no "
          "page faults come later. It needs LimitMEMLOCK=infinity."),
      integer<RealtimeConfig>("heap_touch_mib", "MiB", 0, 65536, EMIT_FIELD(heap_touch_mib),
                              "lock_memory: size of the heap that is touched at start and kept."),
      boolean<RealtimeConfig>("required", EMIT_FIELD(required),
                              "With `true` emitd does not start when the host refuses something of "
                              "this section. With `false` a warning says so."),
  };
  return keys;
}

const KeyTable<HostConfig>& host_keys() {
  static const KeyTable<HostConfig> keys = {
      text<HostConfig>(
          "udp", EMIT_FIELD(udp),
          "`address:port` for host frames as datagrams. When it is empty, none are received."),
      path<HostConfig>(
          "key_file", EMIT_FIELD(key_file),
          "File of pre-shared keys, 64 hexadecimal digits per line, unreadable for others. Host "
          "datagrams and triggers without a MAC by such a key are dropped."),
  };
  return keys;
}

const KeyTable<ControlConfig>& control_keys() {
  static const KeyTable<ControlConfig> keys = {
      text<ControlConfig>(
          "tcp", EMIT_FIELD(tcp),
          "`address:port` of control, host and stream connections. Port 0 takes any free one."),
      integer<ControlConfig>("max_clients", "", 1, 1024, EMIT_FIELD(max_clients),
                             "Largest number of connections at a time."),
      integer<ControlConfig>(
          "max_record_bytes", "bytes", 1024, 268435456, EMIT_FIELD(max_record_bytes),
          "Longest message that a client may send. A longer one closes the connection."),
  };
  return keys;
}

const KeyTable<StreamConfig>& stream_keys() {
  static const KeyTable<StreamConfig> keys = {
      integer<StreamConfig>(
          "queue_frames", "", 1, 13, EMIT_FIELD(queue_frames),
          "Number of frames that wait for a slow client. Then the oldest is dropped."),
      integer<StreamConfig>("udp_fragment_payload_bytes", "bytes", limits::kFragmentPayloadBytes,
                            EMIT_FIELD(udp_fragment_payload_bytes),
                            "Pixel bytes per datagram. Beyond loopback 8900 needs jumbo frames, "
                            "1400 fits any Ethernet."),
      integer<StreamConfig>(
          "tcp_send_buffer_bytes", "bytes", 0, 1073741824, EMIT_FIELD(tcp_send_buffer_bytes),
          "Send buffer of a TCP client, at most net.core.wmem_max. Long links need rate times "
          "round trip. With 0 the system chooses; megabytes may be late."),
      integer<StreamConfig>("udp_send_buffer_bytes", "bytes", 65536, 1073741824,
                            EMIT_FIELD(udp_send_buffer_bytes),
                            "Socket send buffer of a UDP client."),
      integer<StreamConfig>("fec_data_fragments", "", 1, limits::kMaxFecData,
                            EMIT_FIELD(fec_data_fragments),
                            "UDP: largest number of fragments in a group of the error correction, "
                            "for clients that do not ask for another."),
      integer<StreamConfig>("fec_parity_fragments", "", 0, limits::kMaxFecParity,
                            EMIT_FIELD(fec_parity_fragments),
                            "UDP: parity fragments of such a group. As many lost fragments come "
                            "back: 5 for 48 suit 1 % loss. 0 means no error correction."),
      number<StreamConfig>("fec_max_parity_frac", "", between(0, limits::kMaxFecParity),
                           EMIT_FIELD(fec_max_parity_frac),
                           "UDP: largest number of parity fragments per data fragment that a "
                           "client may ask for. With 0 no client gets error correction."),
      number<StreamConfig>("resend_max_frac", "", between(0, 10), EMIT_FIELD(resend_max_frac),
                           "UDP with host-step: missing fragments are sent again on request, up to "
                           "this part of the bytes sent. With 0 they never are."),
      boolean<StreamConfig>("compression", EMIT_FIELD(compression),
                            "TCP: clients that ask for it get frames compressed without loss. It "
                            "costs CPU time, once for all clients."),
      integer<StreamConfig>(
          "multicast_ttl", "", 0, 255, EMIT_FIELD(multicast_ttl),
          "Number of routers that multicast frames may pass. With 0 they stay on this host."),
      text<StreamConfig>("shm", EMIT_FIELD(shm),
                         "Name under which clients on this host read frames from shared memory "
                         "(`shm://name`). It holds letters, digits, `_`, `-` and `.`."),
      integer<StreamConfig>("shm_slots", "", limits::kRingSlots, EMIT_FIELD(shm_slots),
                            "Number of frames in the shared memory. A client that reads in place "
                            "has one period less than this for a frame."),
      choice<StreamConfig>("shm_mode",
                           std::vector<std::pair<std::string, std::uint32_t>>{
                               {"0600", 0600}, {"0640", 0640}, {"0644", 0644}},
                           EMIT_FIELD(shm_mode),
                           "Permissions of the shared memory: 0600 for the user of emitd, 0640 for "
                           "its group too, 0644 for everybody."),
  };
  return keys;
}

const KeyTable<MetricsConfig>& metrics_keys() {
  static const KeyTable<MetricsConfig> keys = {
      text<MetricsConfig>(
          "listen", EMIT_FIELD(listen),
          "`address:port` for HTTP: /metrics (Prometheus text), /healthz and /readyz. Beyond "
          "loopback it needs `access.allow`. When it is empty, there is none."),
  };
  return keys;
}

const KeyTable<ConsoleConfig>& console_keys() {
  static const KeyTable<ConsoleConfig> keys = {
      text<ConsoleConfig>("listen", EMIT_FIELD(listen),
                          "`address:port` for HTTP, where a browser opens the console. Beyond "
                          "loopback it needs `access.allow`. When it is empty, there is none."),
      choice<ConsoleConfig>("commands",
                            std::vector<std::pair<std::string, ConsoleCommands>>{
                                {"none", ConsoleCommands::none},
                                {"loopback", ConsoleCommands::loopback},
                                {"all", ConsoleCommands::all}},
                            EMIT_FIELD(commands),
                            "Consoles that may start, stop, hold, step and reset the run: `none`, "
                            "those on this host, or all."),
      number<ConsoleConfig>("rate_hz", "Hz", between(0.1, 60), EMIT_FIELD(rate_hz),
                            "Most images a second, all consoles together."),
  };
  return keys;
}

const KeyTable<JournalConfig>& journal_keys() {
  static const KeyTable<JournalConfig> keys = {
      path<JournalConfig>("file", EMIT_FIELD(file),
                          "Journal that emitd writes while it runs. One of an earlier process is "
                          "kept under another name. Without it only recorders get the journal."),
      integer<JournalConfig>(
          "ring_entries", "", 64, 1048576, EMIT_FIELD(ring_entries),
          "Number of entries between the frame loop and the writer of the journal."),
      integer<JournalConfig>("memory_mib", "MiB", 1, 65536, EMIT_FIELD(memory_mib),
                             "Memory for the entries of the run, for recorders that connect later. "
                             "The oldest entries go first."),
      boolean<JournalConfig>("required", EMIT_FIELD(required),
                             "true: a start fails when the disk has no room for `file`; false: "
                             "emitd warns and writes no journal."),
  };
  return keys;
}

const KeyTable<DeviceConfig>& device_keys() {
  static const KeyTable<DeviceConfig> keys = {
      integer<DeviceConfig>(
          "gpu_index", "", -1, 63, EMIT_FIELD(gpu_index),
          "Number of the EGL device. -1 takes the first hardware device, else software."),
  };
  return keys;
}

const KeyTable<LogConfig>& log_keys() {
  static const KeyTable<LogConfig> keys = {
      choice<LogConfig>(
          "level",
          std::vector<std::pair<std::string, std::string>>{
              {"error", "error"}, {"warn", "warn"}, {"info", "info"}, {"debug", "debug"}},
          EMIT_FIELD(level), "Lowest severity that is logged."),
      path<LogConfig>("file", EMIT_FIELD(file),
                      "Log file. Without it the log goes to standard error."),
  };
  return keys;
}

}  // namespace emit::config
