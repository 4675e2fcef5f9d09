// SPDX-License-Identifier: Apache-2.0
#include "telemetry/log.hpp"

#include <fmt/format.h>
#include <spdlog/async.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <array>
#include <chrono>
#include <future>
#include <thread>
#include <utility>

#include "emit/protocol/control.hpp"
#include "rt/connection_key.hpp"
#include "rt/error_text.hpp"

namespace emit::server {
namespace {

constexpr std::size_t kQueueLines = 8192;

class SpdLog final : public Log {
 public:
  /// Throws where there is no memory or thread for it.
  SpdLog(spdlog::sink_ptr sink, const std::string& level)
      : pool_(std::make_shared<spdlog::details::thread_pool>(kQueueLines, 1)),
        logger_(std::make_shared<spdlog::async_logger>(
            "emitd", std::move(sink), pool_, spdlog::async_overflow_policy::overrun_oldest)) {
    logger_->set_level(spdlog::level::from_str(level));
    logger_->set_pattern("%Y-%m-%dT%H:%M:%S.%f%z %l %v");
    logger_->flush_on(spdlog::level::info);
  }
  // The pool's thread ends, its queue written; only then does the logger its lines refer to.
  ~SpdLog() override { pool_.reset(); }

  void write(LogLevel level, const std::string& text) override {
    static constexpr std::array kLevels{spdlog::level::err, spdlog::level::warn,
                                        spdlog::level::info, spdlog::level::debug};
    logger_->log(kLevels[static_cast<std::size_t>(level)], text);
  }
  // Lines are written by the pool's thread, and asking the logger only queues one more; ending the
  // pool waits until they are. A thread of its own waits, because a terminal or pipe that nobody
  // reads lets it wait for ever.
  bool finish(std::int64_t limit_ns) override {
    logger_->set_level(spdlog::level::off);
    if (!pool_) {
      return true;
    }
    const auto pool = std::make_shared<decltype(pool_)>(std::move(pool_));
    try {
      auto written = std::make_shared<std::promise<void>>();
      const auto end = written->get_future();
      std::thread([pool, written] {
        pool->reset();
        written->set_value();
      }).detach();
      return end.wait_for(std::chrono::nanoseconds(limit_ns)) == std::future_status::ready;
    } catch (const std::exception&) {
      pool_ = std::move(*pool);  // no thread: the destructor waits
      return false;
    }
  }

 private:
  std::shared_ptr<spdlog::details::thread_pool> pool_;  ///< the logger refers to it weakly
  std::shared_ptr<spdlog::async_logger> logger_;
};

class FunctionLog final : public Log {
 public:
  explicit FunctionLog(std::function<void(const std::string&)> sink) : sink_(std::move(sink)) {}
  void write(LogLevel /*level*/, const std::string& text) override { sink_(text); }
  bool finish(std::int64_t /*limit_ns*/) override { return true; }

 private:
  std::function<void(const std::string&)> sink_;
};

}  // namespace

physics::Result<std::unique_ptr<Log>> make_log(const config::LogConfig& config) {
  try {
    spdlog::sink_ptr sink;
    if (config.file.empty()) {
      sink = std::make_shared<spdlog::sinks::stderr_sink_mt>();
    } else {
      sink = std::make_shared<spdlog::sinks::basic_file_sink_mt>(config.file.string());
    }
    return std::make_unique<SpdLog>(std::move(sink), config.level);
  } catch (const std::exception& error) {
    return physics::make_error(physics::ErrorCode::io,
                               fmt::format("log {}: {}", config.file.string(), error.what()));
  }
}

std::unique_ptr<Log> make_log(std::function<void(const std::string&)> sink) {
  return std::make_unique<FunctionLog>(std::move(sink));
}

std::string DistinctTable::note(const std::string& text, std::int64_t now_ns) {
  // Peers choose part of the text: once the table is full, what is new shares one entry.
  const bool fits = entries_.size() < kMaxEntries || entries_.find(text) != entries_.end();
  const std::string line = fits ? text : std::string(kOverflowText);
  Entry& entry = entries_[line];
  if (entry.count == 0) {
    entry.first_ns = now_ns;
  }
  entry.last_ns = now_ns;
  ++entry.count;
  std::uint64_t power = 1;
  while (power < entry.count) {
    power *= 10;
  }
  if (power != entry.count) {
    return {};
  }
  return entry.count > 1 ? fmt::format("{} repeats={}", line, entry.count) : line;
}

std::string printable_text(const Event& event) {
  std::string text(event.text.data());
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F || c == '"') {
      c = '?';
    }
  }
  return text;
}

std::string_view role_name(std::uint64_t role) noexcept {
  static constexpr std::array<std::string_view, 4> kRoles{"none", "host", "client", "recorder"};
  return role < kRoles.size() ? kRoles[role] : "?";
}

EventText describe(const Event& event) {
  const std::string text = printable_text(event);
  const auto connection = [&] { return connection_name(event.a); };
  switch (event.kind) {
    case EventKind::run_started:
      return {LogLevel::info, fmt::format("event=run_started run_id={}", event.a), false};
    case EventKind::host_restarted:
      return {LogLevel::info, fmt::format("event=host_restarted host_run_id={}", event.a), false};
    case EventKind::command: {
      static constexpr std::array kNames{"unspecified", "start", "stop", "hold", "step", "reset"};
      return {LogLevel::info,
              fmt::format("event=command kind={}", event.a < kNames.size() ? kNames[event.a] : "?"),
              false};
    }
    case EventKind::refused:
      return {LogLevel::warn,
              fmt::format("event=refused status={} text=\"{}\"", event.a,
                          text.empty()
                              ? protocol::status_text(static_cast<protocol::StatusCode>(event.a), 0)
                              : text),
              true};
    case EventKind::connected:
      return {LogLevel::info,
              fmt::format("event=connected connection={} peer={}", connection(), text), false};
    case EventKind::disconnected:
      return {LogLevel::info,
              fmt::format("event=disconnected connection={} why=\"{}\"", connection(), text),
              false};
    case EventKind::hello:
      return {LogLevel::info,
              fmt::format("event=hello connection={} role={} software=\"{}\"", connection(),
                          role_name(event.b), text),
              false};
    case EventKind::subscribed:
      return {LogLevel::info,
              fmt::format("event=subscribed connection={} channel={} transport={}", connection(),
                          event.b, text),
              false};
    case EventKind::client_failed:
      return {LogLevel::warn,
              fmt::format("event=client_failed connection={} why=\"{}\"", connection(),
                          error_text(static_cast<int>(event.b))),
              false};
    case EventKind::disconnected_slow:
      return {
          LogLevel::warn,
          fmt::format("event=disconnected_slow connection={} why=\"fell behind\"", connection()),
          false};
    case EventKind::no_segmentation_offload:
      return {LogLevel::warn,
              fmt::format("event=no_segmentation_offload connection={} why=\"{}\"", connection(),
                          error_text(static_cast<int>(event.b))),
              false};
    case EventKind::source_failed:
      return {LogLevel::error, fmt::format("event=source_failed why=\"{}\"", text), true};
    case EventKind::device_lost:
      return {
          LogLevel::error,
          fmt::format("event=device_lost why=\"{}\" effect=\"no more frames: emitd ends\"", text),
          false};
    case EventKind::journal_failed:
      return {
          LogLevel::error,
          fmt::format("event=journal_failed why=\"{}\" effect=\"journal file ends here\"", text),
          true};
    case EventKind::journal_overrun:
      return {LogLevel::error,
              fmt::format("event=journal_overrun sequence={} effect=\"journal cannot be replayed\"",
                          event.a),
              false};
    case EventKind::slots_missed:
      return {LogLevel::warn, fmt::format("event=slots_missed count={}", event.a), true};
    case EventKind::trigger_silent:
      return {LogLevel::warn,
              "event=trigger_silent effect=\"no frames until the next trigger\" remedy=\"the sync "
              "source, its link, trigger.peer\"",
              true};
    case EventKind::weather_lost:
      return {LogLevel::error,
              fmt::format("event=weather_lost sim_time_ns={} effect=\"the host's weather no longer "
                          "changes in this run\" remedy=\"reset the run, or send weather less "
                          "often\"",
                          static_cast<std::int64_t>(event.a)),
              false};
    case EventKind::poses_dropped:
      return {LogLevel::warn,
              fmt::format("event=poses_dropped count={} effect=\"oldest motion of this run is kept "
                          "coarser, frames are flagged degraded\" remedy=\"reset the run\"",
                          event.a),
              false};
    case EventKind::warmed_up_again:
      return {LogLevel::warn,
              fmt::format("event=warmed_up_again took_s={:.3f} jump_s={:.3f} effect=\"no frame "
                          "meanwhile, this frame is flagged degraded\" remedy=\"move simulation "
                          "time on in steps, or start at that time\"",
                          static_cast<double>(event.a) * 1e-9,
                          static_cast<double>(static_cast<std::int64_t>(event.b)) * 1e-9),
              false};
    case EventKind::peer_refused: {
      static constexpr std::array kWhy{"not in access.allow", "TLS handshake failed",
                                       "host datagram without a valid MAC",
                                       "trigger without a valid MAC"};
      return {LogLevel::warn,
              fmt::format("event=peer_refused why=\"{}\" peer=\"{}\"",
                          event.a < kWhy.size() ? kWhy[event.a] : "?", text),
              true};
    }
    case EventKind::secured:
      return {LogLevel::info,
              fmt::format("event=secured connection={} names=\"{}\"", connection(), text), false};
    case EventKind::host_session:
      return {LogLevel::info, fmt::format("event=host_session peer={}", text), false};
  }
  return {LogLevel::error, "event=unknown", true};
}

}  // namespace emit::server
