// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "agents/channel_table.hpp"
#include "agents/frame_source.hpp"
#include "emit/physics/error.hpp"

namespace emit::v1 {
class FrameDecision;
class JournalEntry;
}  // namespace emit::v1

namespace emit::server {

/// One frame of a replay.
struct ReplayedFrame {
  std::uint64_t run_id = 0;
  std::uint64_t frame_number = 0;  ///< as in the live stream
  std::uint64_t host_frame_number = 0;
  std::int64_t sim_time_ns = 0;
  std::int64_t pose_sim_time_ns = 0;
  std::uint32_t flags = 0;  ///< protocol::FrameFlags of the live frame
  bool repeated = false;    ///< the previous image is shown again: nothing was rendered
  /// Image of the frame, valid until the next apply(). A repeated frame has the image shown before
  /// it.
  const renderer::FrameView* view = nullptr;
  std::uint32_t crc32c = 0;          ///< CRC of the first channel that showed it, computed here
  std::uint32_t journal_crc32c = 0;  ///< CRC that the live run sent
  bool matches = false;              ///< crc32c == journal_crc32c, and so for its further cameras
};

/// Re-renders a journal: hands the inputs to a FrameSource as the live run did, in the same order.
///
///   auto player = JournalPlayer(*source, *make_channels(scenario, source->info()));
///   while (read(entry)) {
///     auto frame = player.apply(entry);   // Result<optional<ReplayedFrame>>
///     if (frame && *frame) use(**frame);
///   }
///
/// Thread: the one that owns the source. Real time: no.
class JournalPlayer {
 public:
  /// Creates a player. `channels` are those of the live run. Frames are rendered whole, whatever
  /// windows were due.
  JournalPlayer(FrameSource& source, ChannelTable channels);
  ~JournalPlayer();
  JournalPlayer(const JournalPlayer&) = delete;
  JournalPlayer& operator=(const JournalPlayer&) = delete;

  /// Applies an entry. The result is empty when the entry changed state but is no frame. Errors
  /// (protocol): the sequence has a gap (the live journal lost entries), a frame comes before any
  /// run start, a repeated frame comes before any image, an entry has no body; (internal): no free
  /// slot.
  [[nodiscard]] physics::Result<std::optional<ReplayedFrame>> apply(const v1::JournalEntry& entry);

  [[nodiscard]] const std::vector<Channel>& channels() const noexcept { return channels_.channels; }
  [[nodiscard]] const std::vector<Picture>& pictures() const noexcept { return channels_.pictures; }
  /// Image of a channel in the latest frame.
  struct Shown {
    const renderer::FrameView* view = nullptr;  ///< null: the channel does not show the frame
    std::span<const float> pixels;
  };
  /// Returns what a channel shows, valid until the next apply().
  /// @pre channel < channels().size()
  [[nodiscard]] Shown shown_by(std::size_t channel);

  [[nodiscard]] std::uint64_t frames() const noexcept { return frames_; }
  [[nodiscard]] std::uint64_t mismatches() const noexcept { return mismatches_; }

 private:
  struct PendingWeather;
  struct PendingPart;
  /// Renders what one camera showed. `shot` is the decision, for the first one, or one of its
  /// CameraDecision. `ahead`: it shows the later instant of the decision.
  template <class Shot>
  [[nodiscard]] physics::Result<void> play_shot(const v1::FrameDecision& decision, const Shot& shot,
                                                bool ahead, std::uint64_t sequence);
  void release_shown() noexcept;
  [[nodiscard]] physics::Result<std::optional<ReplayedFrame>> play(
      const v1::FrameDecision& decision, std::uint64_t sequence);

  FrameSource& source_;
  ChannelTable channels_;
  std::uint64_t run_id_ = 0;
  std::uint64_t last_sequence_ = 0;
  bool started_ = false;
  std::vector<renderer::SlotIndex> shown_;  ///< slots of the last frame, kept for repeats
  /// Camera, view and moment of the images in these slots.
  struct ShownShot {
    std::size_t camera = 0;
    const renderer::FrameView* view = nullptr;
    OutputChain::Moment moment;
  };
  std::vector<ShownShot> shots_;
  bool crcs_match_ = false;  ///< of all its cameras
  const renderer::FrameView* view_ = nullptr;
  std::uint32_t view_crc_ = 0;
  std::vector<PendingWeather> weather_;  ///< accepted, but not used by a frame yet
  std::vector<PendingPart> parts_;       ///< likewise
  std::uint64_t render_number_ = 0;      // of the latest image
  std::uint64_t rendered_number_ = 0;    // of its frame
  std::uint64_t frames_ = 0;
  std::uint64_t mismatches_ = 0;
};

}  // namespace emit::server
