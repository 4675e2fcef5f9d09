// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/types.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "agents/journal_tap.hpp"
#include "emit/physics/error.hpp"

namespace emit::server {

/// Question of a page about a pixel of a frame.
struct ExplainRequest {
  std::uint32_t page = 0;
  std::size_t channel = 0;
  std::uint32_t x_px = 0;  ///< in the image of the channel
  std::uint32_t y_px = 0;
  std::uint64_t frame_number = 0;
  // The same pixel in the sensor's image.
  std::uint32_t sensor_x_px = 0;
  std::uint32_t sensor_y_px = 0;
};

/// Answer to it.
struct Explained {
  std::uint32_t page = 0;
  std::string json;
};

/// Explains pixels of the run beside it, one at a time. The work is done by another process,
/// `emit explain --background`, from the run's own journal. It has threads, memory and a software
/// renderer of its own and lets all other programs go first, so that no agent waits for it or
/// shares a lock, a thread pool or the graphics processor with it.
///
/// Threads: its own, with the lowest claim to the processor, does all that waits. The functions are
/// the console's.
class Explainer {
 public:
  /// Questions that may wait. A newer one of the same page replaces an older one.
  static constexpr std::size_t kMaxWaiting = 16;

  /// @param command  program and its arguments up to those that say which pixel
  /// @param on_done  called on the own thread when take() has something
  Explainer(std::vector<std::string> command, JournalTap& journal, std::function<void()> on_done);
  /// Ends a process that is under way.
  ~Explainer();
  Explainer(const Explainer&) = delete;
  Explainer& operator=(const Explainer&) = delete;

  /// Puts a question. Returns false when too many wait.
  [[nodiscard]] bool ask(const ExplainRequest& request);
  [[nodiscard]] std::optional<Explained> take();

 private:
  void run();
  [[nodiscard]] std::string answer(const ExplainRequest& request);
  [[nodiscard]] physics::Result<void> write_journal(const std::filesystem::path& file);
  /// Runs the process to its end. Returns what it wrote to standard output.
  [[nodiscard]] physics::Result<std::string> explain(const ExplainRequest& request,
                                                     const std::filesystem::path& journal,
                                                     std::vector<std::string>& warnings);
  /// Waits a little. Returns false when the explainer ends.
  [[nodiscard]] bool pause();

  const std::vector<std::string> command_;
  JournalTap& journal_;
  const std::function<void()> on_done_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<ExplainRequest> waiting_;  ///< guarded by mutex_, like the next two
  std::deque<Explained> done_;
  bool stop_ = false;
  std::thread thread_;
};

}  // namespace emit::server
