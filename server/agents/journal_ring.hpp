// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <type_traits>

#include "agents/messages.hpp"
#include "rt/byte_ring.hpp"

/// Journal lines on the way from conductor to recorder. A line is a head, then the elements it
/// counts, all copied byte by byte. The recorder turns them into emit.v1.JournalEntry.
namespace emit::server {

enum class JournalKind : std::uint32_t { run_start, host_frame, command, frame };

struct JournalHead {
  std::uint64_t sequence = 0;
  std::int64_t wall_time_ns = 0;
  JournalKind kind = JournalKind::run_start;
};

struct JournalRunStart {
  JournalHead head;
  std::uint64_t run_id = 0;
};

struct JournalCommand {
  JournalHead head;
  CommandKind command = CommandKind::start;
};

/// Head of a line with a host frame. entity_count EntityStateData follow, then part_count
/// PartCommandData.
struct JournalHostFrame {
  JournalHead head;
  std::uint64_t frame_number = 0;
  std::int64_t sim_time_ns = 0;
  std::uint64_t run_id = 0;
  std::int64_t received_ns = 0;
  physics::Pose seeker;
  std::optional<protocol::PoseRates> seeker_rates;
  std::optional<protocol::EnvironmentData> environment;
  std::optional<double> fov_h_rad;
  std::optional<glm::dvec3> gimbal_rad;
  std::uint32_t entity_count = 0;
  std::uint32_t part_count = 0;
};

/// Image of a further camera of a frame.
struct JournalShot {
  physics::Pose pose;
  double fov_h_rad = 0.0;
  std::uint32_t channel = 0;  ///< index of the first channel that shows it
  std::uint32_t crc32c = 0;   ///< of the pixels of that channel
  bool ahead = false;         ///< it shows JournalFrame::ahead_time_ns
};

/// Head of a line with a frame. entity_count renderer::EntityUpdate follow, then
/// ahead_entity_count.
struct JournalFrame {
  JournalHead head;
  std::uint64_t frame_number = 0;
  std::uint64_t host_frame_number = 0;
  std::int64_t sim_time_ns = 0;
  std::int64_t pose_sim_time_ns = 0;
  std::int64_t thermal_time_ns = 0;
  physics::Pose sensor_pose;
  double fov_h_rad = 0.0;
  std::uint32_t flags = 0;
  std::uint32_t quality_rung = 0;
  std::uint32_t radiance_crc32c = 0;
  std::uint32_t radiance_channel = 0;
  bool rendered = false;
  std::uint64_t trigger_number = 0;
  std::int64_t slot_begin_ns = 0;
  glm::vec2 shift_px{0.0F};
  glm::vec2 ahead_shift_px{0.0F};
  std::int64_t ahead_time_ns = 0;
  std::uint32_t more_shot_count = 0;
  std::array<JournalShot, kMaxCameras - 1> more_shots;
  std::uint32_t entity_count = 0;
  std::uint32_t ahead_entity_count = 0;
};

/// Conductor's end of the ring. A line that finds no room is lost and counted. Its sequence number
/// stays unused, so that a reader sees the gap. RT-safe.
class JournalWriter {
 public:
  /// `written` counts the lines that found room.
  JournalWriter(ByteRing& ring, std::atomic<std::uint64_t>& written)
      : ring_(ring), written_(written) {}

  /// Fills in the head's sequence and writes the line. It returns false when the line was lost.
  template <class Line, class... Element>
  bool write(Line& line, std::span<const Element>... elements) noexcept {
    static_assert(std::is_trivially_copyable_v<Line> &&
                  (std::is_trivially_copyable_v<Element> && ...));
    line.head.sequence = ++sequence_;
    std::span<std::byte> memory = ring_.claim((sizeof(Line) + ... + elements.size_bytes()));
    if (memory.empty()) {
      return false;
    }
    const auto put = [&memory](std::span<const std::byte> bytes) {
      if (!bytes.empty()) std::memcpy(memory.data(), bytes.data(), bytes.size());
      memory = memory.subspan(bytes.size());
    };
    put(std::as_bytes(std::span(&line, 1)));
    (put(std::as_bytes(elements)), ...);
    ring_.commit();
    written_.fetch_add(1, std::memory_order_release);
    return true;
  }
  [[nodiscard]] std::uint64_t sequence() const noexcept { return sequence_; }

 private:
  ByteRing& ring_;
  std::atomic<std::uint64_t>& written_;
  std::uint64_t sequence_ = 0;
};

}  // namespace emit::server
