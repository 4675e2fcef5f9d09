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
#include "emit/config/daemon_config.hpp"
#include "emit/protocol/record/log.hpp"
#include "rt/fd.hpp"

namespace emit::server {

/// Writes the journal to a file and to the recorders connected. Not a real-time agent: it encodes,
/// allocates and writes files, on a ring of its own that never holds the others up.
///
/// The lines of the current run stay in memory up to a limit, so that a recorder that connects in
/// the middle gets the run from its start.
class Recorder final : public Agent {
 public:
  /// What RunStart says beside the run id.
  struct Identity {
    std::string scenario_name;
    std::string scenario_sha256;
    std::string software;
    std::string device;
    std::string pacing;
  };
  Recorder(Context& context, config::JournalConfig config, std::size_t max_peers);

  /// Before start.
  void set_identity(Identity identity) { identity_ = std::move(identity); }
  /// Opens the journal file, if one is configured. Before start. Returns the name under which that
  /// of an earlier process is kept, if there was one. Errors (io).
  [[nodiscard]] physics::Result<std::filesystem::path> open();

  [[nodiscard]] std::string_view name() const noexcept override { return "recorder"; }
  [[nodiscard]] bool on_start() noexcept override;
  int do_work(std::int64_t now_ns) noexcept override;
  void on_stop() noexcept override;
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override { return wake_at_ns_; }
  /// A frame's line is worth no wake-up of its own.
  [[nodiscard]] std::int64_t rest_ns() const noexcept override { return 2'000'000; }
  [[nodiscard]] int wait_fd() const noexcept override { return epoll_.get(); }

  /// Any thread; true when every line that the conductor handed over reached file and peers.
  [[nodiscard]] bool idle() const noexcept {
    return finished_.load(std::memory_order_acquire) ==
           context_.journal_handed_over.load(std::memory_order_acquire);
  }

 private:
  /// Bytes of the current run kept for recorders that come later.
  static constexpr std::size_t kKeptBytes = 64u << 20;
  /// A line waits no longer than this before the kernel has it: a killed process loses no more.
  /// Half of what is promised, the other half is for threads that wait for their core.
  static constexpr std::int64_t kFlushAfterNs = 50'000'000;

  struct Peer {
    std::uint32_t connection = 0;
    int fd = -1;
    TcpSocket* socket = nullptr;  // the receiver's
    std::uint64_t next = 0;       // index of the record being sent
    std::size_t offset = 0;       // bytes of it sent
    bool blocked = false;
    bool registered = false;
  };

  int take_commands();
  int take_lines();
  int take_writable() noexcept;
  int send_all() noexcept;
  bool send_some(Peer& peer, bool& failed) noexcept;
  void add_record(std::span<const std::byte> line);
  void discard_old();
  void remove(std::size_t index) noexcept;
  void file_failed(const physics::Error& error) noexcept;
  void flush_when_due(std::int64_t now_ns);

  Context& context_;
  config::JournalConfig config_;
  Identity identity_;
  Fd epoll_;
  std::optional<protocol::LogWriter> file_;
  std::vector<Peer> peers_;
  std::deque<std::vector<std::byte>> kept_;  // framed records, ready to send
  std::uint64_t kept_first_ = 0;             // index of kept_.front()
  std::uint64_t run_first_ = 0;              // index of the run's first record
  std::size_t kept_bytes_ = 0;
  std::int64_t unflushed_since_ns_ = 0;  // monotonic; 0: the kernel has everything
  std::int64_t wake_at_ns_ = kNeverNs;
  std::uint64_t taken_ = 0;                 // lines taken so far
  std::atomic<std::uint64_t> finished_{0};  // taken_ when peers had everything; else the last such
};

}  // namespace emit::server
