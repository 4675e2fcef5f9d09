// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/ip_address.hpp"

/// What emitd reads from --config; keys are documented in config/README.md. Plain data.
namespace emit::config {

enum class SourceKind : std::uint8_t { renderer, canned };
enum class PacingMode : std::uint8_t { host_step, ig_clock, trigger };
enum class SchedulerKind : std::uint8_t { other, fifo };

struct SourceConfig {
  SourceKind kind = SourceKind::renderer;
  /// canned: folder of frame_*.exr with a `radiance` channel, shown in name order, again and again.
  /// Empty: a moving test pattern of canned_width_px x canned_height_px.
  std::filesystem::path canned_dir;
  std::uint32_t canned_width_px = 640;
  std::uint32_t canned_height_px = 512;
  std::uint32_t canned_frames = 16;  ///< length of the test pattern
};

struct PacingConfig {
  PacingMode mode = PacingMode::host_step;
  double rate_hz = 200.0;      ///< ig_clock: own period; trigger: what the triggers come at
  std::int64_t budget_ns = 0;  ///< host_step: deadline after the pose arrived; 0 = none
  std::int64_t horizon_ns =
      50'000'000;                     ///< extrapolation is clamped here and the frame flagged stale
  std::int64_t display_delay_ns = 0;  ///< not host_step: pose is predicted to slot start + this
};

/// Where the datagrams of pacing mode trigger arrive.
struct TriggerConfig {
  std::string udp = "127.0.0.1:7003";
  std::string peer;  ///< the only address triggers are taken from; empty: any, on loopback only
};

/// What the agents ask of the host; everything is off by default.
struct RealtimeConfig {
  SchedulerKind scheduler = SchedulerKind::other;
  std::uint32_t priority = 50;  ///< fifo: of the conductor; the others lie just below
  std::string cpus;             ///< see parse_agent_cpus(); empty = wherever the kernel likes
  bool lock_memory = false;
  std::uint32_t heap_touch_mib = 64;  ///< lock_memory: heap touched at start and kept
  bool required = false;              ///< what the host refuses ends the start
};

/// Cores of one agent.
struct AgentCpus {
  std::string agent;
  std::vector<std::uint32_t> cpus;  ///< ascending, not empty
};
/// "conductor=2, receiver=2, render=4-7": agents of receiver, conductor, render, sender, recorder,
/// each at most once; cores below kMaxCpus. Errors (config) name the part at fault.
[[nodiscard]] physics::Result<std::vector<AgentCpus>> parse_agent_cpus(std::string_view text);
inline constexpr std::uint32_t kMaxCpus = 1024;

struct ClockConfig {
  std::filesystem::path ptp_socket;  ///< of linuxptp's ptp4l; empty = off
  std::uint32_t ptp_domain = 0;
};

struct HostConfig {
  std::string udp = "127.0.0.1:7001";  ///< host frames as datagrams; empty = off
  /// Pre-shared keys of authenticated sessions; empty: none.
  std::filesystem::path key_file;
};

/// Control, host and stream connections all start on this TCP port (Hello names the role).
struct ControlConfig {
  std::string tcp = "127.0.0.1:7000";
  std::uint32_t max_clients = 16;
  std::uint32_t max_record_bytes = 1u << 20;
};

struct StreamConfig {
  std::uint32_t queue_frames = 4;  ///< per client, bounded; slots = queue + 3
  std::uint32_t udp_fragment_payload_bytes = 8900;
  std::uint32_t tcp_send_buffer_bytes = 512u << 10;  ///< 0 = the system's choice
  std::uint32_t udp_send_buffer_bytes = 8u << 20;
  std::uint8_t multicast_ttl = 1;
  std::uint32_t fec_data_fragments = 48;   ///< of a group, for clients that do not say
  std::uint32_t fec_parity_fragments = 0;  ///< likewise; 0 = no error correction
  double fec_max_parity_frac = 0.5;        ///< parity per data fragment that a client may ask for
  double resend_max_frac = 0.25;  ///< of a client's bytes, sent again on request; 0 = never
  bool compression = true;        ///< for clients that ask for it
  std::string shm;                ///< frames in shared memory under this name; empty = off
  std::uint32_t shm_slots = 8;    ///< a reader in place has slots - 1 frame periods for a frame
  std::uint32_t shm_mode = 0600;
};

struct MetricsConfig {
  std::string listen;  ///< /metrics, /healthz and /readyz over HTTP; empty = off
};

/// Who may connect beside programs on this host.
struct AccessConfig {
  std::vector<protocol::Network> allow;  ///< empty: whoever reaches the port
  /// Groups that a client may ask for: site-local scopes (RFC 2365, RFC 4291).
  std::vector<protocol::Network> multicast_groups = default_multicast_groups();
  std::uint32_t max_connections_per_peer = 8;  ///< peers on this host are not counted
  std::uint32_t max_host_frames_hz = 20'000;   ///< per peer address
  std::uint32_t max_control_records_hz = 1000;

  [[nodiscard]] static std::vector<protocol::Network> default_multicast_groups();
};

/// Mutual TLS 1.3 on the control port.
struct TlsConfig {
  std::filesystem::path certificate;  ///< PEM, with the chain behind it
  std::filesystem::path key;
  std::filesystem::path client_ca;
  std::vector<std::string> allow_names;  ///< of client certificates; empty: any of the CA's
  std::uint32_t max_handshakes = 8;      ///< at a time

  [[nodiscard]] bool enabled() const noexcept { return !certificate.empty(); }
};

struct JournalConfig {
  std::filesystem::path file;  ///< written while running; empty = only on request of a recorder
  std::uint32_t ring_entries = 4096;
  std::uint32_t memory_mib = 64;  ///< entries of the run kept for recorders that connect later
  bool required = false;          ///< a start without room for the file fails
};

struct DeviceConfig {
  int gpu_index = -1;
};

struct LogConfig {
  std::string level = "info";  ///< error, warn, info, debug
  std::filesystem::path file;  ///< empty = standard error
};

struct DaemonConfig {
  std::filesystem::path file;      ///< where it came from
  std::filesystem::path scenario;  ///< resolved; empty only for a canned source
  SourceConfig source;
  PacingConfig pacing;
  TriggerConfig trigger;
  ClockConfig clock;
  RealtimeConfig realtime;
  HostConfig host;
  ControlConfig control;
  StreamConfig stream;
  MetricsConfig metrics;
  AccessConfig access;
  TlsConfig tls;
  JournalConfig journal;
  DeviceConfig device;
  LogConfig log;

  /// Host datagrams have to belong to an authenticated session.
  [[nodiscard]] bool authenticated_host() const noexcept {
    return !host.key_file.empty() || tls.enabled();
  }
};

/// A listening port of the daemon.
enum class Port : std::uint8_t { control, host, metrics };
/// Something keeps strangers from this port, so that it may be reached from other hosts.
[[nodiscard]] bool is_protected(const DaemonConfig& daemon, Port port) noexcept;
/// What such a port asks for, for messages.
[[nodiscard]] std::string_view protections_of(Port port) noexcept;

}  // namespace emit::config
