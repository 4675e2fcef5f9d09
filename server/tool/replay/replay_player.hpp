// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "tool/replay/recording_timeline.hpp"

namespace emit::tool {

/// Decides which frame of a recording comes next, and when, by the words of whoever commands it.
/// It neither waits nor reads a clock. Thread: one at a time, the caller locks.
///
/// Words: `play`, `hold`, `step` and `begin`; `seek S` to a position in s; `move N` by so many
/// frames; `rate X` as a multiple of the recorded pace, or `rate max`; `loop FROM TO` between two
/// positions in s, and `loop off`.
class ReplayPlayer {
 public:
  /// The timeline outlives the player. It has frames.
  /// @param rate  multiple of the recorded pace; 0: as fast as it goes
  /// @param playing  false: the first frame is shown, and then a word is waited for
  ReplayPlayer(const RecordingTimeline& timeline, double rate, bool playing)
      : timeline_(timeline), rate_(rate), playing_(playing) {
    target_ = 0;
  }

  struct Answer {
    bool ok = false;
    std::string text;
  };
  /// Takes words. A refusal changes nothing.
  Answer take(std::string_view words);

  /// Order about the next frame of the recording.
  struct Order {
    enum class Kind : std::uint8_t {
      show,  ///< render and show it
      pass,  ///< render it for the state of the scene alone
      anew,  ///< begin again with the first frame
      wait,  ///< ask again at `at_ns`, or after a word
    };
    Kind kind = Kind::wait;
    std::optional<std::int64_t> at_ns = std::nullopt;
  };
  /// Returns the order for a frame; for the number of frames, behind the last one.
  /// @param now_ns  of a clock that never steps
  [[nodiscard]] Order next(std::size_t frame, std::int64_t now_ns);
  /// Notes that a frame that was to be shown is there.
  void shown(std::size_t frame) noexcept { shown_ = frame; }

  /// Returns the frame shown last; empty: none yet.
  [[nodiscard]] std::optional<std::size_t> shown() const noexcept { return shown_; }
  [[nodiscard]] bool playing() const noexcept { return playing_; }
  /// Returns the state as JSON; `reached` is the frame that is worked on.
  [[nodiscard]] std::string json(std::size_t reached) const;

 private:
  Answer seek(std::size_t frame);
  Answer take_rate(std::string_view text);
  Answer take_loop(std::string_view text);
  [[nodiscard]] Order show(std::size_t frame, std::int64_t now_ns, bool anchor);

  const RecordingTimeline& timeline_;
  double rate_;
  bool playing_;
  std::optional<std::size_t> target_;  ///< frame on the way to
  std::size_t steps_ = 0;              ///< frames that are to come one by one
  std::optional<std::size_t> shown_;
  struct Loop {
    std::size_t from = 0;
    std::size_t to = 0;
  };
  std::optional<Loop> loop_;
  /// Frame and instant that the pace counts from; empty: the next frame is due at once.
  struct Anchor {
    std::int64_t position_ns = 0;
    std::int64_t clock_ns = 0;
  };
  std::optional<Anchor> anchor_;
};

}  // namespace emit::tool
