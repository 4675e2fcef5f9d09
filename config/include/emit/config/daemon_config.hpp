// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "emit/config/network.hpp"

/// What emitd reads from --config; keys are documented in config/README.md. Plain data.
namespace emit::config {

enum class SourceKind : std::uint8_t { renderer, canned };
enum class PacingMode : std::uint8_t { host_step, ig_clock };

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
  double rate_hz = 200.0;      ///< ig_clock: own period
  std::int64_t budget_ns = 0;  ///< host_step: deadline after the pose arrived; 0 = none
  std::int64_t horizon_ns =
      50'000'000;                     ///< extrapolation is clamped here and the frame flagged stale
  std::int64_t display_delay_ns = 0;  ///< ig_clock: pose is predicted to slot start + this
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
  std::uint32_t tcp_send_buffer_bytes = 256u << 10;  ///< 0 = the system's choice
  std::uint32_t udp_send_buffer_bytes = 8u << 20;
  std::uint8_t multicast_ttl = 1;
  std::string shm;              ///< frames in shared memory under this name; empty = off
  std::uint32_t shm_slots = 8;  ///< a reader in place has slots - 1 frame periods for a frame
  std::uint32_t shm_mode = 0600;
};

/// 1 to 64 letters, digits, `_`, `-` and `.`, the first a letter or digit: no path can come of it.
[[nodiscard]] bool is_shm_name(std::string_view text) noexcept;

struct MetricsConfig {
  std::string listen;  ///< /metrics, /healthz and /readyz over HTTP; empty = off
};

/// Who may connect beside programs on this host.
struct AccessConfig {
  std::vector<Network> allow;  ///< empty: whoever reaches the port
  /// Groups that a client may ask for: site-local scopes (RFC 2365, RFC 4291).
  std::vector<Network> multicast_groups = default_multicast_groups();
  std::uint32_t max_connections_per_peer = 8;  ///< peers on this host are not counted
  std::uint32_t max_host_frames_hz = 20'000;   ///< per peer address
  std::uint32_t max_control_records_hz = 1000;

  [[nodiscard]] static std::vector<Network> default_multicast_groups();
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
