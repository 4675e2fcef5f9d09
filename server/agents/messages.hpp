// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "agents/frame_source.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/host_frame.hpp"
#include "pacing/run_control.hpp"

/// Plain structs on the rings between agents; docs/threading.md shows who sends what to whom.
namespace emit::server {

inline constexpr std::size_t kMaxPlanes = 16;
inline constexpr std::size_t kMaxSlots = 16;
inline constexpr std::size_t kMaxPictures = 16;

/// Bit k: channel k.
using ChannelSet = std::uint64_t;
inline constexpr std::size_t kMaxChannels = 64;
inline constexpr ChannelSet kAllChannels = ~ChannelSet{0};

/// Connections are named by their place in the receiver's table and how often it was used.
inline constexpr std::uint32_t kConnectionPlaceBits = 10;
inline constexpr std::uint32_t kMaxConnections = 1u << kConnectionPlaceBits;
[[nodiscard]] constexpr std::uint32_t connection_place(std::uint64_t key) noexcept {
  return static_cast<std::uint32_t>(key) & (kMaxConnections - 1);
}

/// "PLACE.USE", as the log names a connection.
[[nodiscard]] inline std::string connection_name(std::uint64_t key) {
  return std::to_string(connection_place(key)) + "." + std::to_string(key >> kConnectionPlaceBits);
}

/// Values of emit.v1.Status.Code.
enum class StatusCode : std::uint8_t {
  ok = 1,
  wrong_version = 2,
  oversize = 3,
  malformed = 4,
  unknown_entity = 5,
  invalid_pose = 6,
  time_backwards = 7,
  duplicate_frame = 8,
  unknown_channel = 9,
  not_allowed = 10,
  overloaded = 11,
  internal = 12,
  invalid_environment = 13,
};

/// Whom an answer goes to.
struct Origin {
  enum class Kind : std::uint8_t { none, udp, tcp };
  Kind kind = Kind::none;
  std::uint32_t connection = 0;  ///< tcp: index and generation in the receiver's table
  std::uint32_t generation = 0;
  std::uint32_t address_bytes = 0;  ///< udp: sockaddr of the sender
  alignas(8) std::array<std::byte, 32> address{};
};

/// receiver -> conductor, in order of arrival.
struct HostInput {
  enum class Kind : std::uint8_t { frame, command };
  Kind kind = Kind::frame;
  CommandKind command = CommandKind::start;
  Origin origin;
  protocol::HostFrameData frame;
};

/// StatusReply::detail of not_allowed: a host frame of a run that another one has replaced.
inline constexpr std::uint64_t kDetailOldRun = 1u << 16;

/// conductor -> receiver: an answer to send.
struct StatusReply {
  Origin origin;
  StatusCode code = StatusCode::ok;
  std::uint64_t host_frame_number = 0;
  std::uint64_t count = 0;
  std::uint64_t detail = 0;  ///< unknown_entity: its id; ok: the command's kind; kDetailOldRun
};

/// Weather changes that come with one frame; further ones replace the newest.
inline constexpr std::size_t kMaxWeatherPerFrame = 32;

/// conductor -> render agent, in the order in which the source must see it. Of a frame, weather is
/// applied first, then entities.
struct RenderJob {
  enum class Kind : std::uint8_t { frame, reset };
  Kind kind = Kind::frame;
  renderer::FrameRequest request;      ///< its rung is the render agent's choice
  std::int64_t deadline_ns = 0;        ///< when the pixels are due; 0: whenever
  ChannelSet channels = kAllChannels;  ///< that the frame is for
  std::uint32_t weather_count = 0;
  std::array<scene::WeatherSample, kMaxWeatherPerFrame> weather;
  std::uint32_t entity_count = 0;
  std::array<renderer::EntityUpdate, protocol::kMaxEntitiesPerFrame> entities;
};

/// Pixels of one image, in memory of the source or that of the pictures for the same slot.
struct Image {
  FrameSource* source = nullptr;
  renderer::SlotIndex slot = 0;
  ChannelSet channels = kAllChannels;  ///< that show it; the pictures of others are not there
  std::array<std::span<const float>, kMaxPictures> pictures;
  std::array<std::uint32_t, kMaxPictures> crc32c{};
};

/// render agent -> conductor, in order of submission.
struct RenderDone {
  Image image;
  std::uint32_t nonfinite_px = 0;
  std::uint32_t clamped_px = 0;
  std::uint64_t dropped_poses = 0;  ///< of the histories, in this run
  bool coarse = false;              ///< the surface was not prepared for this camera
  std::uint8_t rung = 0;            ///< of the quality ladder
  float estimated_error_k = 0.0F;   ///< of that rung; NaN: not known
  bool device_failed = false;  ///< the driver reported an error: the pixels are not to be trusted
  std::int64_t render_start_ns = 0;
  std::int64_t render_end_ns = 0;
  std::int64_t readback_end_ns = 0;
};

/// conductor -> sender. The header lacks what depends on channel and client.
struct PublishFrame {
  /// The image published last, again, for those of image.channels that it has pictures for; else
  /// `image` is not set.
  bool repeat = false;
  Image image;
  protocol::FrameHeader header;
};

enum class EventKind : std::uint8_t {
  run_started,      ///< a = run id
  host_epoch,       ///< a = host's run id
  command,          ///< a = CommandKind
  refused,          ///< a = StatusCode, b = count
  connected,        ///< a = connection, text = peer
  disconnected,     ///< a = connection, text = why
  hello,            ///< a = connection, b = role, text = software
  subscribed,       ///< a = connection, b = channel, text = transport
  client_failed,    ///< a = connection, text = why
  client_slow,      ///< a = connection
  no_gso,           ///< a = connection, text = why
  source_failed,    ///< text = why
  device_lost,      ///< text = why; the daemon ends
  journal_failed,   ///< text = why
  journal_overrun,  ///< a = first sequence lost
  slots_missed,     ///< a = how many
  weather_lost,     ///< a = sim time of the sample, ns
  poses_dropped,    ///< a = how many
  trigger_silent,   ///< a = number of the last one
  peer_refused,     ///< text = address, a = PeerRefusal
  secured,          ///< a = connection, text = names in the peer's certificate
  host_session,     ///< text = address
};

/// Why a peer is turned away before anything it says is looked at.
enum class PeerRefusal : std::uint8_t { not_allowed, handshake, mac, trigger_mac };

/// any agent -> housekeeping: what happened, as numbers; the text is put together there.
struct Event {
  EventKind kind = EventKind::run_started;
  std::uint64_t a = 0;
  std::uint64_t b = 0;
  std::array<char, 104> text{};
};

}  // namespace emit::server
