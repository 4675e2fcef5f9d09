// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "agents/context.hpp"
#include "app/replay.hpp"
#include "console/console_server.hpp"
#include "console/console_state.hpp"
#include "console/console_tap.hpp"
#include "emit/physics/error.hpp"
#include "net/udp_batch.hpp"
#include "telemetry/status_board.hpp"
#include "tool/replay/recording_timeline.hpp"
#include "tool/replay/replay_player.hpp"
#include "tool/streams/journal_replay.hpp"

namespace emit::tool {

/// The operator's console of a replay: the page of emitd with the frames of the recording, and a
/// bar of its time. Whoever opens it says which frame comes next.
///
/// Threads: the caller's replays, renders and hands frames over; the console's takes words and
/// tells pages the state. They meet in the player, under a lock that neither holds for long.
class ReplayConsole {
 public:
  struct Options {
    std::string listen;    ///< address:port of this host
    double rate = 1.0;     ///< ReplayPlayer
    std::string scenario;  ///< name, for the page
  };
  /// Resolves the address. Errors: config (no address, or one that other hosts reach), io.
  [[nodiscard]] static physics::Result<std::unique_ptr<ReplayConsole>> create(
      const ReplayBench& bench, const std::filesystem::path& log, Options options);
  ~ReplayConsole();
  ReplayConsole(const ReplayConsole&) = delete;
  ReplayConsole& operator=(const ReplayConsole&) = delete;

  /// Takes over what comes when in a replay; its on_frame is called as well. The hooks and the
  /// bench outlive the console.
  void attach(ReplayHooks& hooks);

 private:
  ReplayConsole(const ReplayBench& bench, std::filesystem::path log, server::SocketAddress address,
                Options options);
  /// Reads the recording and opens the port. It says the address on standard error.
  [[nodiscard]] physics::Result<void> open(std::size_t first_run, std::size_t last_run);
  [[nodiscard]] server::ConsoleServer::Answers answers();
  [[nodiscard]] server::ConsoleServer::Answers::Replayed take(std::string_view words);
  [[nodiscard]] std::string take_command(server::CommandKind command, std::uint32_t page);
  [[nodiscard]] std::string status(std::size_t pages);
  [[nodiscard]] ReplayOrder order_of(std::uint64_t frame);
  void take_frame(const server::ReplayedFrame& frame);
  /// Gives the frame shown last to pages that have asked for an image.
  void hand_over();

  const ReplayBench& bench_;
  const std::filesystem::path log_;
  const server::SocketAddress address_;
  const Options options_;
  server::SystemClock clock_;
  server::Context context_{clock_, 1u << 16, 1};
  server::StatusBoard board_;
  server::NamedDutyCycles no_agents_;
  server::UdpBatch no_batch_;  ///< the tap sends nothing
  server::ConsoleFacts facts_;
  std::int64_t opened_ns_ = 0;
  RecordingTimeline timeline_;
  std::mutex mutex_;
  std::condition_variable word_came_;
  std::uint64_t words_ = 0;             ///< guarded by mutex_, like the next two
  std::optional<ReplayPlayer> player_;  ///< empty before open()
  std::uint64_t reached_ = 0;           ///< frame that is worked on
  server::JournalPlayer* journal_ = nullptr;
  std::uint64_t showing_ = 0;          ///< frame that order_of() let through
  std::int64_t render_start_ns_ = 0;   ///< of that frame
  protocol::FrameHeader header_;       ///< of the frame shown last
  std::uint64_t since_hand_over_ = 0;  ///< frames shown since one was handed over
  std::int64_t handed_over_ns_ = 0;    ///< monotonic
  std::unique_ptr<server::ConsoleTap> tap_;
  std::unique_ptr<server::ConsoleServer> server_;  ///< its thread reads all of the above
};

}  // namespace emit::tool
