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

namespace {

EventText info(std::string text) {
  return {LogLevel::info, std::move(text), false};
}
EventText warn(std::string text) {
  return {LogLevel::warn, std::move(text), false};
}
EventText distinct_warn(std::string text) {
  return {LogLevel::warn, std::move(text), true};
}
EventText error(std::string text) {
  return {LogLevel::error, std::move(text), false};
}
EventText distinct_error(std::string text) {
  return {LogLevel::error, std::move(text), true};
}
EventText unknown() {
  return distinct_error("event=unknown");
}

EventText describe_command(const Event& event) {
  return info(fmt::format("event=command kind={}", protocol::command_name(event.a)));
}

/// Returns the text of an event about one connection.
EventText describe_connection(const Event& event, const std::string& text) {
  const std::string connection = connection_name(event.a);
  switch (event.kind) {
    case EventKind::connected:
      return info(fmt::format("event=connected connection={} peer={}", connection, text));
    case EventKind::disconnected:
      return info(fmt::format("event=disconnected connection={} why=\"{}\"", connection, text));
    case EventKind::hello:
      return info(fmt::format("event=hello connection={} role={} software=\"{}\"", connection,
                              role_name(event.b), text));
    case EventKind::subscribed:
      return info(fmt::format("event=subscribed connection={} channel={} transport={}", connection,
                              event.b, text));
    case EventKind::client_failed:
      return warn(fmt::format("event=client_failed connection={} why=\"{}\"", connection,
                              error_text(static_cast<int>(event.b))));
    case EventKind::disconnected_slow:
      return warn(
          fmt::format("event=disconnected_slow connection={} why=\"fell behind\"", connection));
    case EventKind::no_segmentation_offload:
      return warn(fmt::format("event=no_segmentation_offload connection={} why=\"{}\"", connection,
                              error_text(static_cast<int>(event.b))));
    case EventKind::secured:
      return info(fmt::format("event=secured connection={} names=\"{}\"", connection, text));
    default:
      return unknown();
  }
}

/// Returns the text of an event about a request or a peer that was refused.
EventText describe_refusal(const Event& event, const std::string& text) {
  if (event.kind == EventKind::refused) {
    return distinct_warn(fmt::format(
        "event=refused status={} text=\"{}\"", event.a,
        text.empty() ? protocol::status_text(static_cast<protocol::StatusCode>(event.a), 0)
                     : text));
  }
  static constexpr std::array kWhy{"not in access.allow", "TLS handshake failed",
                                   "host datagram without a valid MAC",
                                   "trigger without a valid MAC"};
  return distinct_warn(fmt::format("event=peer_refused why=\"{}\" peer=\"{}\"",
                                   event.a < kWhy.size() ? kWhy[event.a] : "?", text));
}

/// Returns the text of an event of the connection to a motion simulator.
EventText describe_axes(const Event& event, const std::string& text) {
  switch (event.kind) {
    case EventKind::axes_connected:
      return info(fmt::format("event=axes_connected controller={}", text));
    case EventKind::axes_lost:
      return distinct_warn(
          fmt::format("event=axes_lost why=\"{}\" effect=\"no measurements until it is connected "
                      "again\"",
                      text));
    case EventKind::axes_refused:
      return distinct_warn(
          fmt::format("event=axes_refused axis={} answer=\"{}\" effect=\"all motors are switched "
                      "off\" remedy=\"the controller, then the command RESET\"",
                      event.a, text));
    default:
      return unknown();
  }
}

/// Returns the text of a change of what the motion simulator does.
EventText describe_motion(const Event& event) {
  static constexpr std::array kStates{"none",      "waiting",   "parked", "parking",
                                      "capturing", "following", "fault"};
  static constexpr std::array kFaults{"no_feedback", "no_host", "interlock",        "limit",
                                      "lock",        "clock",   "controller_clock", "ignored"};
  std::string faults;
  for (std::size_t i = 0; i < kFaults.size(); ++i) {
    if ((event.b >> i & 1U) != 0) faults += (faults.empty() ? "" : ",") + std::string(kFaults[i]);
  }
  const std::string text = fmt::format("event=motion state={} faults={}",
                                       event.a < kStates.size() ? kStates[event.a] : "?",
                                       faults.empty() ? "none" : faults);
  return faults.empty() ? info(text) : distinct_warn(text);
}

/// Returns the text of an event after which frames, journal or weather lack something.
EventText describe_loss(const Event& event, const std::string& text) {
  switch (event.kind) {
    case EventKind::source_failed:
      return distinct_error(fmt::format("event=source_failed why=\"{}\"", text));
    case EventKind::device_lost:
      return error(
          fmt::format("event=device_lost why=\"{}\" effect=\"no more frames: emitd ends\"", text));
    case EventKind::journal_failed:
      return distinct_error(
          fmt::format("event=journal_failed why=\"{}\" effect=\"journal file ends here\"", text));
    case EventKind::journal_overrun:
      return error(fmt::format(
          "event=journal_overrun sequence={} effect=\"journal cannot be replayed\"", event.a));
    case EventKind::weather_lost:
      return error(
          fmt::format("event=weather_lost sim_time_ns={} effect=\"the host's weather no longer "
                      "changes in this run\" remedy=\"reset the run, or send weather less "
                      "often\"",
                      static_cast<std::int64_t>(event.a)));
    case EventKind::poses_dropped:
      return warn(
          fmt::format("event=poses_dropped count={} effect=\"oldest motion of this run is kept "
                      "coarser, frames are flagged degraded\" remedy=\"reset the run\"",
                      event.a));
    case EventKind::heat_limit:
      return distinct_warn(
          fmt::format("event=heat_limit why=\"{}\" effect=\"frames are flagged degraded\"", text));
    case EventKind::coarse:
      return distinct_warn(
          fmt::format("event=coarse why=\"{}\" effect=\"frames are flagged degraded\"", text));
    case EventKind::warmed_up_again:
      return warn(fmt::format(
          "event=warmed_up_again took_s={:.3f} jump_s={:.3f} effect=\"no frame "
          "meanwhile, this frame is flagged degraded\" remedy=\"move simulation "
          "time on in steps, or set source.first_time_s to the time of the first pose\"",
          static_cast<double>(event.a) * 1e-9,
          static_cast<double>(static_cast<std::int64_t>(event.b)) * 1e-9));
    default:
      return unknown();
  }
}

}  // namespace

EventText describe(const Event& event) {
  const std::string text = printable_text(event);
  // The switch has no default, so that the compiler reports a kind without a text.
  switch (event.kind) {
    case EventKind::run_started:
      return info(fmt::format("event=run_started run_id={}", event.a));
    case EventKind::host_restarted:
      return info(fmt::format("event=host_restarted host_run_id={}", event.a));
    case EventKind::command:
      return describe_command(event);
    case EventKind::refused:
    case EventKind::peer_refused:
      return describe_refusal(event, text);
    case EventKind::connected:
    case EventKind::disconnected:
    case EventKind::hello:
    case EventKind::subscribed:
    case EventKind::client_failed:
    case EventKind::disconnected_slow:
    case EventKind::no_segmentation_offload:
    case EventKind::secured:
      return describe_connection(event, text);
    case EventKind::source_failed:
    case EventKind::device_lost:
    case EventKind::journal_failed:
    case EventKind::journal_overrun:
    case EventKind::weather_lost:
    case EventKind::poses_dropped:
    case EventKind::heat_limit:
    case EventKind::coarse:
    case EventKind::warmed_up_again:
      return describe_loss(event, text);
    case EventKind::slots_missed:
      return distinct_warn(fmt::format("event=slots_missed count={}", event.a));
    case EventKind::trigger_silent:
      return distinct_warn(
          "event=trigger_silent effect=\"no frames until the next trigger\" remedy=\"the sync "
          "source, its link, trigger.peer\"");
    case EventKind::motion_changed:
      return describe_motion(event);
    case EventKind::axes_connected:
    case EventKind::axes_lost:
    case EventKind::axes_refused:
      return describe_axes(event, text);
    case EventKind::gateway_mode: {
      static constexpr std::array kModes{"standby", "operate", "debug"};
      return info(fmt::format("event=gateway_mode mode={}",
                              event.a < kModes.size() ? kModes[event.a] : "?"));
    }
    case EventKind::gateway_time:
      return info(fmt::format("event=gateway_time sim_time_s={:.3f} effect=\"a new run\"",
                              1e-9 * static_cast<double>(static_cast<std::int64_t>(event.a))));
    case EventKind::gateway_refused:
      return distinct_warn(fmt::format("event=gateway_refused why=\"{}\"", text));
    case EventKind::host_session:
      return info(fmt::format("event=host_session peer={}", text));
  }
  return unknown();
}

}  // namespace emit::server
