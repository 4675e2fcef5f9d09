// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "telemetry/event.hpp"

namespace emit::server {

enum class LogLevel : std::uint8_t {
  error,  ///< the operator must act
  warn,   ///< the result is degraded
  info,   ///< a change of state
  debug,  ///< for developers
};

/// Log lines as key=value text. Never blocks the writer: the queue is preallocated and drops its
/// oldest line when the disk or terminal cannot keep up.
/// Thread: any. Not for agents on the frame path, which push Events instead.
class Log {
 public:
  Log(const Log&) = delete;
  Log& operator=(const Log&) = delete;
  virtual ~Log() = default;
  virtual void write(LogLevel level, const std::string& text) = 0;
  /// Waits, within the limit, until everything is written; for the end of the program. Lines of
  /// later write() calls are lost. No thread may call write() meanwhile.
  /// @return false: nobody took the lines, as with a stopped terminal
  virtual bool finish(std::int64_t limit_ns) = 0;

 protected:
  Log() = default;
};

/// spdlog, asynchronous. Errors (io): the log file.
[[nodiscard]] physics::Result<std::unique_ptr<Log>> make_log(const config::LogConfig& config);
/// Hands lines to a function.
[[nodiscard]] std::unique_ptr<Log> make_log(std::function<void(const std::string&)> sink);

/// Keeps each distinct warning once with a count, so that a storm of bad datagrams is two lines in
/// the log and not a million: one is written when it first happens, again at 10, 100, 1000, ...
/// Holds kMaxEntries; further ones count as one warning, kOverflowText.
class DistinctTable {
 public:
  struct Entry {
    std::uint64_t count = 0;
    std::int64_t first_ns = 0;
    std::int64_t last_ns = 0;
  };
  static constexpr std::size_t kMaxEntries = 256;
  static constexpr std::string_view kOverflowText =
      "event=warnings_not_written effect=\"too many distinct ones; see the counters\"";

  /// The line to write for this occurrence; empty: none.
  [[nodiscard]] std::string note(const std::string& text, std::int64_t now_ns);
  [[nodiscard]] const std::map<std::string, Entry>& entries() const noexcept { return entries_; }

 private:
  std::map<std::string, Entry> entries_;
};

/// The event's text without what would break a line or a quote: peers choose some of it.
[[nodiscard]] std::string printable_text(const Event& event);
/// Returns the name of a value of emit.v1.Hello.Role.
[[nodiscard]] std::string_view role_name(std::uint64_t role) noexcept;

struct EventText {
  LogLevel level = LogLevel::info;
  std::string text;
  bool distinct = false;  ///< repeats collapse in the DistinctTable
};
[[nodiscard]] EventText describe(const Event& event);

}  // namespace emit::server
