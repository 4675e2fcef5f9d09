// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::v1 {
class JournalEntry;
}

namespace emit::tool {

/// Returns a time in s, for texts.
[[nodiscard]] inline double in_seconds(std::int64_t ns) noexcept {
  return 1e-9 * static_cast<double>(ns);
}

/// Frames and events of a recording along one axis: the time that they take at the recorded pace.
/// Wall times of one daemon follow each other as they were; another daemon of a merged log follows
/// at once, as it does in a replay.
class RecordingTimeline {
 public:
  struct Frame {
    std::int64_t position_ns = 0;  ///< never less than that of the frame before
    std::int64_t sim_time_ns = 0;
    std::uint64_t frame_number = 0;
    std::uint32_t run = 0;  ///< index into runs()
  };
  struct Run {
    std::uint64_t run_id = 0;
    std::size_t first_frame = 0;  ///< index into frames()
  };
  /// An event, at the frame that follows it or that it describes.
  struct Mark {
    std::size_t frame = 0;
    std::string_view kind;  ///< "run", "command", "weather", "part" or "late"
    std::string text;
  };
  /// Largest number of marks; of late frames, which may be many, the first ones are kept.
  static constexpr std::size_t kMaxMarks = 2000;

  /// Reads the frames of a log, first to last. Errors: those of protocol::LogReader; internal (the
  /// user interrupts).
  /// @param first_run, last_run  runs that are replayed, by their place in the log
  [[nodiscard]] static physics::Result<RecordingTimeline> read(const std::filesystem::path& log,
                                                               std::size_t first_run,
                                                               std::size_t last_run);

  /// Takes the next entry of the log.
  void add(const v1::JournalEntry& entry);

  [[nodiscard]] const std::vector<Frame>& frames() const noexcept { return frames_; }
  [[nodiscard]] const std::vector<Run>& runs() const noexcept { return runs_; }
  [[nodiscard]] const std::vector<Mark>& marks() const noexcept { return marks_; }
  /// Returns the first frame at a position or behind it; the last frame where there is none.
  /// @pre there are frames
  [[nodiscard]] std::size_t frame_at(std::int64_t position_ns) const noexcept;
  /// Returns runs, marks and at most 1000 points of position and simulation time as JSON.
  [[nodiscard]] std::string json() const;

 private:
  void mark(std::string_view kind, std::string text);

  std::vector<Frame> frames_;
  std::vector<Run> runs_;
  std::vector<Mark> marks_;
  std::uint64_t last_sequence_ = 0;
  std::int64_t offset_ns_ = 0;  ///< of the wall times of the present daemon
  bool new_daemon_ = true;
};

}  // namespace emit::tool
