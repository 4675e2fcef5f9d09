// SPDX-License-Identifier: Apache-2.0
#include "keys.hpp"

/// Keys of the daemon's configuration.
namespace emit::config {

const KeyTable<DaemonHead>& daemon_head_keys() {
  static const KeyTable<DaemonHead> keys = {
      text<DaemonHead>("scenario", EMIT_FIELD(scenario),
                       "Scenario file, or the name of a shipped one. May be absent only with a "
                       "canned source."),
  };
  return keys;
}

const KeyTable<SourceConfig>& source_keys() {
  static const KeyTable<SourceConfig> keys = {
      choice<SourceConfig>("kind",
                           std::vector<std::pair<std::string, SourceKind>>{
                               {"renderer", SourceKind::renderer}, {"canned", SourceKind::canned}},
                           EMIT_FIELD(kind),
                           "Where frames come from: rendered, or pre-rendered (to test a rig)."),
      path<SourceConfig>("canned_dir", EMIT_FIELD(canned_dir),
                         "Folder of `frame_*.exr` with a `radiance` channel, shown in name order, "
                         "again and again. Absent: a moving test pattern."),
      integer<SourceConfig>("canned_width_px", "px", 1, 16384, EMIT_FIELD(canned_width_px),
                            "Columns of the test pattern."),
      integer<SourceConfig>("canned_height_px", "px", 1, 16384, EMIT_FIELD(canned_height_px),
                            "Rows of the test pattern."),
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
          "host-step: pose k triggers frame k. ig-clock: own period, newest pose. trigger: a "
          "datagram of a sync source starts the frame, newest pose."),
      number<PacingConfig>(
          "rate_hz", "Hz", between(0.1, 2000), EMIT_FIELD(rate_hz),
          "ig-clock: frame rate. trigger: the rate that the source is set to, for telling "
          "late and spurious triggers."),
      nanoseconds<PacingConfig>(
          "budget_ms", "ms", 1e6, between(0, 60000), EMIT_FIELD(budget_ns),
          "host-step: deadline after the pose arrived; 0: none. trigger: after "
          "the trigger; 0: one period. Frames shed "
          "quality to meet it (thermal.method cached)."),
      nanoseconds<PacingConfig>("horizon_ms", "ms", 1e6, between(0, 60000), EMIT_FIELD(horizon_ns),
                                "Poses are extrapolated this far at most; then the frame is "
                                "flagged stale."),
      nanoseconds<PacingConfig>(
          "display_delay_ms", "ms", 1e6, between(0, 60000), EMIT_FIELD(display_delay_ns),
          "ig-clock, trigger: poses are predicted to the start of the slot plus this; "
          "at most horizon_ms."),
  };
  return keys;
}

const KeyTable<TriggerConfig>& trigger_keys() {
  static const KeyTable<TriggerConfig> keys = {
      text<TriggerConfig>("udp", EMIT_FIELD(udp),
                          "`address:port` for trigger datagrams; opened by `pacing.mode = "
                          "\"trigger\"` alone. Beyond loopback it needs `peer`."),
      text<TriggerConfig>("peer", EMIT_FIELD(peer),
                          "Numeric address of the sync source: triggers of others are refused. "
                          "Empty: any, on loopback only."),
  };
  return keys;
}

const KeyTable<ClockConfig>& clock_keys() {
  static const KeyTable<ClockConfig> keys = {
      path<ClockConfig>("ptp_socket", EMIT_FIELD(ptp_socket),
                        "Management socket of linuxptp's ptp4l, whose state then shows in "
                        "/metrics: `/var/run/ptp4lro`; absent: off."),
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
                             "fifo: conductor, receiver, sender and render run as real-time "
                             "threads (SCHED_FIFO). Needs LimitRTPRIO."),
      integer<RealtimeConfig>("priority", "", 4, 99, EMIT_FIELD(priority),
                              "fifo: priority of the conductor; receiver, sender and render have "
                              "1, 2 and 3 less."),
      text<RealtimeConfig>("cpus", EMIT_FIELD(cpus),
                           "Cores of agents, such as `conductor=2, receiver=2, sender=3, "
                           "render=4-7`; those not named run anywhere."),
      boolean<RealtimeConfig>("lock_memory", EMIT_FIELD(lock_memory),
                              "Lock all memory and touch stacks and heap at start: no page faults "
                              "later. Needs LimitMEMLOCK=infinity."),
      integer<RealtimeConfig>("heap_touch_mib", "MiB", 0, 65536, EMIT_FIELD(heap_touch_mib),
                              "lock_memory: heap touched at start and kept."),
      boolean<RealtimeConfig>("required", EMIT_FIELD(required),
                              "true: what the host refuses of this section ends the start with an "
                              "error; false: it is warned of and shows in /metrics."),
  };
  return keys;
}

const KeyTable<HostConfig>& host_keys() {
  static const KeyTable<HostConfig> keys = {
      text<HostConfig>("udp", EMIT_FIELD(udp),
                       "`address:port` for host frames as datagrams; empty: off."),
      path<HostConfig>(
          "key_file", EMIT_FIELD(key_file),
          "Pre-shared keys, one per line as 64 hexadecimal digits, not readable by "
          "others. Datagrams must then carry a MAC by one of them, or by a key agreed "
          "over TLS (see `[tls]`); bare ones are dropped. Triggers (`trigger.udp`) must "
          "carry one by a key of this file and say their instant, a second old at most."),
  };
  return keys;
}

const KeyTable<ControlConfig>& control_keys() {
  static const KeyTable<ControlConfig> keys = {
      text<ControlConfig>(
          "tcp", EMIT_FIELD(tcp),
          "`address:port` of control, host and stream connections; port 0: any free "
          "one."),
      integer<ControlConfig>("max_clients", "", 1, 1024, EMIT_FIELD(max_clients),
                             "Connections at a time."),
      integer<ControlConfig>("max_record_bytes", "bytes", 1024, 268435456,
                             EMIT_FIELD(max_record_bytes),
                             "Longest message a client may send; longer ones close the "
                             "connection."),
  };
  return keys;
}

const KeyTable<StreamConfig>& stream_keys() {
  static const KeyTable<StreamConfig> keys = {
      integer<StreamConfig>("queue_frames", "", 1, 13, EMIT_FIELD(queue_frames),
                            "Frames that wait for a slow client before the oldest goes."),
      integer<StreamConfig>("udp_fragment_payload_bytes", "bytes", 256, 65000,
                            EMIT_FIELD(udp_fragment_payload_bytes),
                            "Pixel bytes per datagram; 8900 needs jumbo frames beyond loopback, "
                            "1400 fits any Ethernet."),
      integer<StreamConfig>("tcp_send_buffer_bytes", "bytes", 0, 1073741824,
                            EMIT_FIELD(tcp_send_buffer_bytes),
                            "What a TCP client may leave in its socket, at most "
                            "net.core.wmem_max: what waits there is late, and skipped no more. "
                            "Over long links at least rate x round trip; 0: the system's choice, "
                            "up to megabytes."),
      integer<StreamConfig>("udp_send_buffer_bytes", "bytes", 65536, 1073741824,
                            EMIT_FIELD(udp_send_buffer_bytes), "Socket send buffer."),
      integer<StreamConfig>("fec_data_fragments", "", 1, 128, EMIT_FIELD(fec_data_fragments),
                            "UDP: fragments of a group of the error correction, at most, for "
                            "clients that do not say what they want."),
      integer<StreamConfig>("fec_parity_fragments", "", 0, 32, EMIT_FIELD(fec_parity_fragments),
                            "UDP: parity fragments of such a group: so many lost ones come back; "
                            "5 of 48 for 1 % loss; 0: none, for clients that do not say."),
      number<StreamConfig>("fec_max_parity_frac", "", between(0, 32),
                           EMIT_FIELD(fec_max_parity_frac),
                           "UDP: parity per data fragment that a client may ask for; 0: no client "
                           "gets error correction."),
      number<StreamConfig>("resend_max_frac", "", between(0, 10), EMIT_FIELD(resend_max_frac),
                           "UDP, host-step: missing fragments are sent again on request, at most "
                           "this part of the bytes sent, and up to a frame at once; 0: never."),
      boolean<StreamConfig>("compression", EMIT_FIELD(compression),
                            "TCP: clients that ask for it get frames losslessly compressed, once "
                            "for all of them, at the cost of CPU time."),
      integer<StreamConfig>("multicast_ttl", "", 0, 255, EMIT_FIELD(multicast_ttl),
                            "Routers that multicast frames may pass; 0: this host only."),
      text<StreamConfig>("shm", EMIT_FIELD(shm),
                         "Name under which clients on this host read frames from shared memory "
                         "(`shm://name`): letters, digits, `_`, `-`, `.`; empty: off."),
      integer<StreamConfig>("shm_slots", "", 3, 64, EMIT_FIELD(shm_slots),
                            "Frames in the shared memory: a client that reads them in place has "
                            "one period less than this before a frame is overwritten."),
      choice<StreamConfig>(
          "shm_mode",
          std::vector<std::pair<std::string, std::uint32_t>>{
              {"0600", 0600}, {"0640", 0640}, {"0644", 0644}},
          EMIT_FIELD(shm_mode),
          "Who may read the shared memory: emitd's user, its group too, or everybody."),
  };
  return keys;
}

const KeyTable<MetricsConfig>& metrics_keys() {
  static const KeyTable<MetricsConfig> keys = {
      text<MetricsConfig>("listen", EMIT_FIELD(listen),
                          "`address:port` for HTTP: /metrics (Prometheus text), /healthz, /readyz; "
                          "empty: off. Beyond loopback only with `access.allow`."),
  };
  return keys;
}

const KeyTable<JournalConfig>& journal_keys() {
  static const KeyTable<JournalConfig> keys = {
      path<JournalConfig>(
          "file", EMIT_FIELD(file),
          "Journal written while running; one of an earlier process is kept under another name. "
          "Absent: only for a recorder that asks."),
      integer<JournalConfig>("ring_entries", "", 64, 1048576, EMIT_FIELD(ring_entries),
                             "Entries between the frame loop and the journal's writer."),
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
      integer<DeviceConfig>("gpu_index", "", -1, 63, EMIT_FIELD(gpu_index),
                            "EGL device; -1: the first hardware device, else software."),
  };
  return keys;
}

const KeyTable<LogConfig>& log_keys() {
  static const KeyTable<LogConfig> keys = {
      choice<LogConfig>(
          "level",
          std::vector<std::pair<std::string, std::string>>{
              {"error", "error"}, {"warn", "warn"}, {"info", "info"}, {"debug", "debug"}},
          EMIT_FIELD(level), "Least severity that is logged."),
      path<LogConfig>("file", EMIT_FIELD(file), "Log file; absent: standard error."),
  };
  return keys;
}

}  // namespace emit::config
