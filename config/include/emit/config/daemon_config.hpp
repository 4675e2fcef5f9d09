// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <glm/ext/vector_double3.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/ip_address.hpp"

/// Configuration that emitd reads from --config, as plain data. config/README.md documents the
/// keys.
namespace emit::config {

enum class SourceKind : std::uint8_t { renderer, canned };
enum class PacingMode : std::uint8_t { host_step, ig_clock, trigger };
enum class SchedulerKind : std::uint8_t { other, fifo };

struct SourceConfig {
  SourceKind kind = SourceKind::renderer;
  std::int64_t first_time_ns = 0;  ///< renderer: simulation time that the surface is warmed up for
  /// canned: folder of frame_*.exr with a `radiance` channel. They are shown in the order of names,
  /// again and again. When it is empty, a test pattern moves.
  std::filesystem::path canned_dir;
  std::uint32_t canned_width_px = 640;
  std::uint32_t canned_height_px = 512;
  std::uint32_t canned_frames = 16;  ///< frames after which the test pattern repeats
};

struct PacingConfig {
  PacingMode mode = PacingMode::host_step;
  double rate_hz = 200.0;      ///< ig_clock: rate of frames; trigger: rate of the sync source
  std::int64_t budget_ns = 0;  ///< deadline after pose or trigger; 0: none, or one period
  std::int64_t horizon_ns = 50'000'000;  ///< longest extrapolation; later frames are flagged stale
  /// ig_clock, trigger: poses are predicted to this time after the start of the slot. With a motion
  /// simulator its axes are too; host_step counts from the arrival of the pose.
  std::int64_t display_delay_ns = 0;
};

/// Port of the trigger datagrams of pacing mode trigger.
struct TriggerConfig {
  std::string udp = "127.0.0.1:7003";
  std::string peer;  ///< address of the sync source; empty: any on loopback
};

/// Rings about the target: none, or two with the one named first outermost.
enum class TargetRings : std::uint8_t { none, azimuth_elevation, elevation_azimuth };

/// Travel, rate and acceleration of an axis of a motion simulator.
struct MotionAxisConfig {
  double min_rad = 0.0;
  double max_rad = 0.0;
  double rate_rad_s = 0.0;
  double acceleration_rad_s2 = 0.0;
  double park_rad = 0.0;
};

/// The flight motion simulator.
struct MotionConfig {
  std::string controller;  ///< parse_motion_controller() reads it; empty: there is none
  double rate_hz = 1000.0;
  std::string unit_rings = "yaw-pitch-roll";  ///< outermost first
  TargetRings target_rings = TargetRings::none;
  std::uint32_t target_entity = 0;     ///< that the target rings point to; 0: none
  std::vector<MotionAxisConfig> axes;  ///< rings of the unit, outermost first; azimuth, elevation
  // Rotations as yaw, pitch and roll, rad (server/docs/motion.md).
  std::array<double, 3> lab_rad{};
  std::array<double, 3> unit_base_rad{};
  std::array<double, 3> unit_mount_rad{};
  std::array<double, 3> target_base_rad{};
  std::array<double, 3> target_mount_rad{};
  std::int64_t feedback_timeout_ns = 20'000'000;
  std::int64_t host_timeout_ns = 200'000'000;
  std::uint32_t controller_timeout_ms = 100;
  double soft_frac = 0.2;  ///< share of rate and acceleration with which the axes set off

  [[nodiscard]] bool enabled() const noexcept { return !controller.empty(); }
};

/// An entity of a CIGI host.
struct CigiEntityConfig {
  std::uint32_t id = 0;      ///< number that the host has for it
  std::uint32_t entity = 0;  ///< number in the scenario
};

/// An articulated part of an entity of a CIGI host, which is an entity of its own in the scenario.
struct CigiPartConfig {
  std::uint32_t id = 0;       ///< number that the host has for the entity that it is part of
  std::uint32_t part = 0;     ///< number that the host has for the part
  std::uint32_t entity = 0;   ///< number in the scenario
  std::int32_t on_part = -1;  ///< part that carries it; -1: the entity does
  glm::dvec3 joint_m{0.0};    ///< place of its origin in the axes of what carries it
  glm::dvec3 joint_yaw_pitch_roll_deg{0.0};  ///< its axes at rest against those
};

/// A host that speaks CIGI.
struct CigiConfig {
  std::string listen;          ///< address:port for its messages; empty: there is none
  std::string host;            ///< address:port where it listens
  double rate_hz = 60.0;       ///< host_step: Start Of Frame a second
  std::uint32_t seeker = 0;    ///< entity that carries the sensor
  std::uint32_t view = 0;      ///< view that is the sensor
  std::uint32_t database = 1;  ///< number of the scenario among the host's databases; 0: none
  std::vector<CigiEntityConfig> entities;
  std::vector<CigiPartConfig> parts;

  [[nodiscard]] bool enabled() const noexcept { return !listen.empty(); }
};

/// An entity of a DIS exercise.
struct DisEntityConfig {
  std::string id;            ///< site:application:entity
  std::uint32_t entity = 0;  ///< number in the scenario
};

/// A DIS exercise that emitd listens to.
struct DisConfig {
  std::string listen;          ///< address:port for its datagrams; empty: there is none
  std::string group;           ///< multicast group; empty: none
  std::uint32_t exercise = 0;  ///< number of the exercise; 0: any
  std::string seeker;          ///< site:application:entity of what carries the sensor
  double rate_hz = 100.0;      ///< rate of the poses that are predicted
  double timeout_s = 12.0;     ///< after so long without a PDU an entity is hidden
  std::vector<DisEntityConfig> entities;

  [[nodiscard]] bool enabled() const noexcept { return !listen.empty(); }
};

/// Reads "site:application:entity", each 0 to 65535; none: the text is no such id.
[[nodiscard]] std::optional<std::array<std::uint16_t, 3>> parse_dis_id(std::string_view text);

/// A flight dynamics model that sends FlightGear's native FDM datagrams.
struct NetFdmConfig {
  std::string listen;  ///< address:port for its datagrams; empty: there is none

  [[nodiscard]] bool enabled() const noexcept { return !listen.empty(); }
};

/// Real-time settings of the agents. Everything is off by default.
struct RealtimeConfig {
  SchedulerKind scheduler = SchedulerKind::other;
  std::uint32_t priority = 50;  ///< fifo: priority of the conductor; others have less
  std::string cpus;             ///< see parse_agent_cpus(); empty: any core
  bool lock_memory = false;
  std::uint32_t heap_touch_mib = 64;  ///< lock_memory: heap that is touched at start and kept
  bool required = false;              ///< emitd does not start when the host refuses something
};

/// Cores of one agent.
struct AgentCpus {
  std::string agent;
  std::vector<std::uint32_t> cpus;  ///< ascending, not empty
};
/// Reads a text such as "conductor=2, receiver=2, render=4-7". Agents are receiver, conductor,
/// render, sender, recorder, motion and gateway, each at most once. Cores are below kMaxCpus.
/// Errors (config) name the part at fault.
[[nodiscard]] physics::Result<std::vector<AgentCpus>> parse_agent_cpus(std::string_view text);
inline constexpr std::uint32_t kMaxCpus = 1024;

struct ClockConfig {
  std::filesystem::path ptp_socket;  ///< socket of ptp4l (linuxptp); empty: off
  std::uint32_t ptp_domain = 0;
};

struct HostConfig {
  std::string udp = "127.0.0.1:7001";  ///< address:port for host frames; empty: off
  /// File of pre-shared keys of authenticated sessions. Empty: there is none.
  std::filesystem::path key_file;
};

/// Port on which control, host and stream connections start. The Hello message names the role.
struct ControlConfig {
  std::string tcp = "127.0.0.1:7000";
  std::uint32_t max_clients = 16;
  std::uint32_t max_record_bytes = 1u << 20;
};

struct StreamConfig {
  std::uint32_t queue_frames = 4;  ///< per client; a frame has 3 slots more than this
  std::uint32_t udp_fragment_payload_bytes = 8900;
  std::uint32_t tcp_send_buffer_bytes = 512u << 10;  ///< 0: the system chooses
  std::uint32_t udp_send_buffer_bytes = 8u << 20;
  std::uint8_t multicast_ttl = 1;
  std::uint32_t fec_data_fragments = 48;   ///< fragments of a group, by default
  std::uint32_t fec_parity_fragments = 0;  ///< parity of a group, by default; 0: none
  double fec_max_parity_frac = 0.5;        ///< largest parity per data fragment
  double resend_max_frac = 0.25;           ///< part of the bytes that is sent again; 0: none
  bool compression = true;                 ///< only for clients that ask for it
  std::string shm;                         ///< name of the shared memory; empty: off
  std::uint32_t shm_slots = 8;             ///< a reader has shm_slots - 1 periods per frame
  std::uint32_t shm_mode = 0600;
};

struct MetricsConfig {
  std::string listen;  ///< address:port of the HTTP server; empty: off
};

/// Peers whose consoles may start, stop, hold, step and reset the run.
enum class ConsoleCommands : std::uint8_t { none, loopback, all };

/// Console of the operator: a page in a browser.
struct ConsoleConfig {
  std::string listen;  ///< address:port of its HTTP server; empty: off
  ConsoleCommands commands = ConsoleCommands::loopback;
  double rate_hz = 10.0;  ///< most images a second, all consoles together
};

/// Hosts that may connect, beside this one.
struct AccessConfig {
  std::vector<protocol::Network> allow;  ///< empty: every host
  /// Multicast groups that a client may ask for: the site-local scopes (RFC 2365, RFC 4291).
  std::vector<protocol::Network> multicast_groups = default_multicast_groups();
  std::uint32_t max_connections_per_peer = 8;  ///< this host is not limited
  std::uint32_t max_host_frames_hz = 20'000;   ///< per peer address
  std::uint32_t max_control_records_hz = 1000;

  [[nodiscard]] static std::vector<protocol::Network> default_multicast_groups();
};

/// Mutual TLS 1.3 on the control port.
struct TlsConfig {
  std::filesystem::path certificate;  ///< PEM with the chain; empty: no TLS
  std::filesystem::path key;
  std::filesystem::path client_ca;
  std::vector<std::string> allow_names;  ///< names of clients; empty: any
  std::uint32_t max_handshakes = 8;      ///< handshakes at a time

  [[nodiscard]] bool enabled() const noexcept { return !certificate.empty(); }
};

struct JournalConfig {
  std::filesystem::path file;  ///< empty: only recorders get the journal
  std::uint32_t ring_entries = 4096;
  std::uint32_t memory_mib = 64;  ///< entries of the run kept for recorders that connect later
  bool required = false;          ///< a start without room for the file fails
};

struct DeviceConfig {
  int gpu_index = -1;
};

struct LogConfig {
  std::string level = "info";  ///< error, warn, info, debug
  std::filesystem::path file;  ///< empty: standard error
};

struct DaemonConfig {
  std::filesystem::path file;      ///< file that it was read from
  std::filesystem::path scenario;  ///< path; empty only for a canned source
  SourceConfig source;
  PacingConfig pacing;
  TriggerConfig trigger;
  MotionConfig motion;
  CigiConfig cigi;
  DisConfig dis;
  NetFdmConfig net_fdm;
  ClockConfig clock;
  RealtimeConfig realtime;
  HostConfig host;
  ControlConfig control;
  StreamConfig stream;
  MetricsConfig metrics;
  ConsoleConfig console;
  AccessConfig access;
  TlsConfig tls;
  JournalConfig journal;
  DeviceConfig device;
  LogConfig log;

  /// True when the host speaks another protocol than emitd's own.
  [[nodiscard]] bool has_gateway() const noexcept {
    return cigi.enabled() || dis.enabled() || net_fdm.enabled();
  }
  /// True when host datagrams have to belong to an authenticated session.
  [[nodiscard]] bool authenticated_host() const noexcept {
    return !host.key_file.empty() || tls.enabled();
  }
};

/// A listening port of the daemon.
enum class Port : std::uint8_t { control, host, metrics, console, gateway };
/// True when something protects this port, so that other hosts may reach it.
[[nodiscard]] bool is_protected(const DaemonConfig& daemon, Port port) noexcept;
/// Keys that protect such a port, for messages.
[[nodiscard]] std::string_view protections_of(Port port) noexcept;

}  // namespace emit::config
