// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>

#include "agents/context.hpp"
#include "agents/journal_ring.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/host_frame.hpp"

namespace emit::server {

/// The conductor's end of the journal: makes the lines, wakes the recorder, and counts the lines
/// that found no room on the ring. Thread: the conductor's. Real time: RT-safe.
class ConductorJournal {
 public:
  explicit ConductorJournal(Context& context)
      : context_(context), writer_(context.journal, context.journal_handed_over) {}

  void run_start(std::uint64_t run_id, std::int64_t now_ns) noexcept;
  void command(CommandKind command, std::int64_t now_ns) noexcept;
  void host_frame(const protocol::HostFrameData& frame, std::int64_t now_ns) noexcept;
  /// Content of a frame that its header does not state.
  struct Shown {
    std::int64_t thermal_time_ns = 0;
    double fov_h_rad = 0.0;
    std::uint32_t crc32c = 0;        ///< of the pixels of `channel`
    std::uint32_t channel = 0;       ///< index of the first channel that shows the image
    glm::vec2 shift_px{0.0F};        ///< shift of the pictures that shift
    glm::vec2 ahead_shift_px{0.0F};  ///< of those that look ahead
    std::int64_t ahead_time_ns = 0;  ///< instant that these show
    std::uint32_t more_shot_count = 0;
    std::array<JournalShot, kMaxCameras - 1> more_shots;
  };
  /// @param rendered  false: the previous frame is repeated
  void frame(const protocol::FrameHeader& header, const Shown& shown, bool rendered,
             std::span<const renderer::EntityUpdate> entities,
             std::span<const renderer::EntityUpdate> ahead_entities, std::int64_t now_ns) noexcept;

 private:
  /// Counts a line that found no room, and wakes the recorder.
  void written(bool found_room) noexcept;

  Context& context_;
  JournalWriter writer_;
  bool lossy_ = false;  // a line was lost, and the log says so
};

}  // namespace emit::server
