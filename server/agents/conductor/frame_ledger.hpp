// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "agents/conductor/conductor_journal.hpp"
#include "agents/context.hpp"
#include "emit/protocol/frame_header.hpp"

namespace emit::server {

/// Numbers of runs and frames, the frames in work, and the frame published last, which a slot
/// without a new frame repeats. Thread: the conductor's. Real time: RT-safe after construction.
class FrameLedger {
 public:
  /// Decisions made when a frame was issued, kept until its image comes back.
  struct Issued {
    protocol::FrameHeader header;
    std::int64_t thermal_time_ns = 0;
    double fov_h_rad = 0.0;
    bool entities_behind = false;  ///< more entities moved than a frame takes
    /// Attitudes of a frame with a motion simulator, and what was wrong when it was issued.
    struct Motion {
      ShownAttitude attitude;
      std::uint8_t faults = 0;  ///< protocol::MotionFaults
    };
    Motion motion;
    /// Later instant that the images that look ahead show.
    struct Ahead {
      AheadImage image;
      Motion motion;
      std::uint32_t entity_count = 0;
      std::array<renderer::EntityUpdate, protocol::kMaxEntitiesPerFrame> entities;
      [[nodiscard]] std::span<const renderer::EntityUpdate> entity_span() const noexcept {
        return {entities.data(), entity_count};
      }
    };
    Ahead ahead;
    std::uint32_t entity_count = 0;
    std::array<renderer::EntityUpdate, protocol::kMaxEntitiesPerFrame> entities;
    [[nodiscard]] std::span<const renderer::EntityUpdate> entity_span() const noexcept {
      return {entities.data(), entity_count};
    }
  };
  static constexpr std::size_t kMaxInWork = 8;

  explicit FrameLedger(Context& context) : context_(context), issued_(kMaxInWork) {}

  /// Begins a run and returns its id. Frames in work are not touched.
  std::uint64_t begin_run(std::int64_t now_ns) noexcept;

  [[nodiscard]] bool idle() const noexcept { return in_work_ == 0; }
  [[nodiscard]] bool full() const noexcept { return in_work_ == kMaxInWork; }
  /// Returns the number under which the next frame goes out if it is in time.
  [[nodiscard]] std::uint64_t next_number() const noexcept { return frame_number_ + in_work_ + 1; }
  /// Returns a cleared place for the next frame.
  /// @pre !full()
  [[nodiscard]] Issued& next() noexcept;
  /// Takes the frame of next() into work: gives it a render number and fills in the job's fields.
  /// @pre !full()
  void issue(RenderJob& job, Issued& issued) noexcept;
  /// Returns the frame whose image comes next.
  /// @pre !idle()
  [[nodiscard]] Issued& oldest() noexcept;

  /// Writes the frame of oldest() with its image, and keeps it for repetition. Each camera has
  /// flags of its own.
  /// @pre !idle()
  void fill_image(PublishFrame& out, const RenderDone& done, bool late_for_slot,
                  bool has_deadline) noexcept;
  /// Removes the frame of oldest(), which is published.
  /// @pre !idle()
  void pop_oldest() noexcept;
  /// Writes the frame published last once more, under a number of its own. The caller fills in the
  /// fields of the slot.
  void fill_repeat(PublishFrame& out) noexcept;

  /// Returns the header of the image published last.
  [[nodiscard]] const protocol::FrameHeader& shown() const noexcept { return shown_; }
  [[nodiscard]] const ConductorJournal::Shown& shown_for_journal() const noexcept {
    return shown_for_journal_;
  }

 private:
  /// Quality of an image or of a frame.
  struct Quality {
    std::uint8_t level = 0;
    float estimated_error_k = 0.0F;
    bool unknown_error = false;
    bool device_failed = false;
  };
  /// Writes the flags and the estimated error of a frame that has less than full quality.
  static void note_quality(protocol::FrameHeader& header, const Quality& quality) noexcept;
  /// Keeps what the cameras of an image showed for the journal.
  void note_shots(const Image& image) noexcept;

  Context& context_;
  std::uint64_t run_id_ = 0;
  std::uint64_t frame_number_ = 0;     // of the newest frame published
  std::uint64_t rendered_number_ = 0;  // of the newest frame issued; repeated ones do not count
  std::uint64_t render_number_ = 0;    // of its last image
  std::vector<Issued> issued_;         // ring of kMaxInWork
  std::size_t first_ = 0;
  std::size_t in_work_ = 0;
  protocol::FrameHeader shown_;
  AheadImage shown_ahead_;
  ConductorJournal::Shown shown_for_journal_;
};

}  // namespace emit::server
