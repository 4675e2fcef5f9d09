// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "agents/agent.hpp"
#include "agents/context.hpp"
#include "agents/journal_tap.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/protocol/record/log.hpp"
#include "rt/fd.hpp"

namespace emit::server {

/// Writes the journal to a file and to the recorders connected. Not a real-time agent: it encodes,
/// allocates and writes files, on a ring of its own that never holds the others up.
///
/// The entries of the current run stay in memory up to journal.memory_mib, so that a recorder that
/// connects in the middle gets the run from its start. When the memory is full the oldest entries
/// go; a recorder that connects later is sent the sequence numbers that it lacks.
class Recorder final : public Agent {
 public:
  /// Members of RunStart beside the run id.
  struct Identity {
    std::string scenario_name;
    std::string scenario_sha256;
    std::string software;
    std::string device;
    std::string pacing;
    std::int64_t first_time_ns = 0;
    std::string recording;  ///< encoded v1::Recording; empty: none
  };
  Recorder(Context& context, config::JournalConfig config, std::size_t max_peers);

  /// Sets the members of RunStart. Call it before start.
  void set_identity(Identity identity) { identity_ = std::move(identity); }
  /// Sets who may ask for the entries that are kept in memory. Call it before start; null: nobody.
  void set_tap(JournalTap* tap) { tap_ = tap; }
  /// State of the journal file after open().
  struct Opened {
    std::filesystem::path older;  ///< new name of an earlier process's journal; empty: none
    std::string
        off;  ///< why no journal is written: the disk is full or takes no writes; else empty
  };
  /// Opens the journal file, if one is configured. Call it before start.
  /// Errors: config (the disk leaves no room and journal.required is set), io (anything else that
  /// keeps the file from being written).
  [[nodiscard]] physics::Result<Opened> open();

  [[nodiscard]] std::string_view name() const noexcept override { return "recorder"; }
  [[nodiscard]] bool on_start() noexcept override;
  int do_work(std::int64_t now_ns) noexcept override;
  void on_stop() noexcept override;
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override { return wake_at_ns_; }
  /// The recorder waits for several lines of frames; none wakes it by itself.
  [[nodiscard]] std::int64_t rest_ns() const noexcept override { return 2'000'000; }
  [[nodiscard]] int wait_fd() const noexcept override { return epoll_.get(); }

  /// Returns true when every line that the conductor handed over reached file and peers. Thread:
  /// any.
  [[nodiscard]] bool idle() const noexcept {
    return finished_.load(std::memory_order_acquire) ==
           context_.journal_handed_over.load(std::memory_order_acquire);
  }

 private:
  /// Memory of a kept entry beside its bytes: the element of the deque and the allocator's share.
  static constexpr std::size_t kOverheadBytes = 48;
  /// Longest time until the kernel has a line. A killed process loses no more than that. It is half
  /// of the promised time; the other half is for threads that wait for their core.
  static constexpr std::int64_t kFlushAfterNs = 50'000'000;

  struct Peer {
    std::uint32_t connection = 0;
    int fd = -1;
    TcpSocket* socket = nullptr;   // the receiver's
    std::uint64_t next = 0;        // index of the record being sent
    std::size_t offset = 0;        // bytes of it sent
    std::vector<std::byte> first;  // goes out in front of the records: what is no longer held
    std::size_t first_sent = 0;
    bool blocked = false;
    bool registered = false;
  };

  int take_commands();
  int take_lines();
  int take_writable() noexcept;
  int send_all() noexcept;
  bool send_some(Peer& peer, bool& failed) noexcept;
  void add_record(std::span<const std::byte> line);
  void add_peer(const RecorderCommand& command);
  void end_stream(Peer& peer) noexcept;
  void discard_old();
  /// Hands what is kept of the run to whoever has asked for it.
  void answer_tap();
  void remove(std::size_t index) noexcept;
  void file_failed(const physics::Error& error) noexcept;
  void flush_when_due(std::int64_t now_ns);
  /// Counts the entries that reached the file since the last call.
  void count_written() noexcept;

  Context& context_;
  config::JournalConfig config_;
  Identity identity_;
  JournalTap* tap_ = nullptr;
  Fd epoll_;
  std::optional<protocol::LogWriter> file_;
  std::uint64_t handed_to_file_ = 0;  // entries of this process
  std::uint64_t in_file_ = 0;         // entries of them that are counted as written
  std::vector<Peer> peers_;
  /// An entry as a framed record, ready to send.
  struct Kept {
    std::uint64_t sequence = 0;
    std::vector<std::byte> bytes;
  };
  std::deque<Kept> kept_;
  std::uint64_t kept_first_ = 0;          // index of kept_.front()
  std::uint64_t run_first_ = 0;           // index of the run's first record
  std::uint64_t run_first_sequence_ = 0;  // its sequence number
  std::uint64_t last_sequence_ = 0;       // of the newest entry
  std::size_t kept_bytes_ = 0;            // memory of kept_, overhead included
  std::int64_t unflushed_since_ns_ = 0;   // monotonic; 0: the kernel has everything
  std::int64_t wake_at_ns_ = kNeverNs;
  std::uint64_t taken_ = 0;                 // lines taken so far
  std::atomic<std::uint64_t> finished_{0};  // taken_ when peers had everything; else the last such
};

}  // namespace emit::server
