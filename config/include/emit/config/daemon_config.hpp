// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

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
  std::uint32_t fec_data_fragments = 48;   ///< of a group, for clients that do not say
  std::uint32_t fec_parity_fragments = 0;  ///< likewise; 0 = no error correction
  double fec_max_parity_frac = 0.5;        ///< parity per data fragment that a client may ask for
  double resend_max_frac = 0.25;  ///< of a client's bytes, sent again on request; 0 = never
  std::string shm;                ///< frames in shared memory under this name; empty = off
  std::uint32_t shm_slots = 8;    ///< a reader in place has slots - 1 frame periods for a frame
  std::uint32_t shm_mode = 0600;
};

/// 1 to 64 letters, digits, `_`, `-` and `.`, the first a letter or digit: no path can come of it.
[[nodiscard]] bool is_shm_name(std::string_view text) noexcept;

struct MetricsConfig {
  std::string listen;  ///< /metrics, /healthz and /readyz over HTTP; empty = off
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
  JournalConfig journal;
  DeviceConfig device;
  LogConfig log;
};

}  // namespace emit::config
