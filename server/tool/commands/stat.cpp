// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <thread>

#include "client/http_get.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/streams/metrics_parse.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"

namespace emit::tool {
namespace {

struct StatOptions {
  std::string url;
  bool once = false;
  double interval_s = 1.0;
  std::optional<std::filesystem::path> json;  ///< one reading, then the end
};

using Clock = std::chrono::steady_clock;
using Samples = std::vector<MetricSample>;

constexpr std::int64_t kTimeoutNs = 5'000'000'000;
constexpr std::string_view kPrefix = "emitd_";

struct Reading {
  Samples samples;
  Clock::time_point at;
};

physics::Result<Reading> read(const std::string& url) {
  auto answer = client::http_get(url, kTimeoutNs);
  if (!answer) return tl::unexpected(answer.error());
  if (answer->status != 200) {
    return physics::make_error(physics::ErrorCode::protocol,
                               fmt::format("{}: HTTP status {}", url, answer->status));
  }
  auto samples = parse_metrics(answer->body);
  if (!samples) {
    return tl::unexpected(physics::Error(samples.error()).with_context(url));
  }
  return Reading{std::move(*samples), Clock::now()};
}

const MetricSample* find(const Samples& samples, std::string_view name,
                         const std::map<std::string, std::string>* labels = nullptr) {
  for (const MetricSample& sample : samples) {
    if (sample.name == name && (labels == nullptr || sample.labels == *labels)) return &sample;
  }
  return nullptr;
}

std::string label_of(const Samples& samples, std::string_view name, const std::string& label) {
  const MetricSample* sample = find(samples, name);
  return sample != nullptr ? sample->label(label) : std::string();
}

void print_head(const Samples& samples) {
  const auto build = [&](const char* label) {
    return label_of(samples, "emitd_build_info", label);
  };
  const MetricSample* ready = find(samples, "emitd_ready");
  const MetricSample* uptime = find(samples, "emitd_uptime_seconds");
  fmt::print("emitd {}  scenario {}  pacing {}  device {}\n", build("version"), build("scenario"),
             build("pacing"), build("device"));
  fmt::print("run {}  {}  up {:.0f} s\n\n", label_of(samples, "emitd_run_info", "run_id"),
             ready != nullptr && ready->value == 1.0 ? "ready" : "NOT READY",
             uptime != nullptr ? uptime->value : 0.0);
}

/// Counters that are not 0, and how fast they go up since the reading before.
void print_counters(const Reading& now, const std::optional<Reading>& before) {
  TextTable table({"counter", "total", "per second"});
  constexpr std::string_view kSuffix = "_total";
  for (const MetricSample& sample : now.samples) {
    if (!sample.labels.empty() || !sample.name.ends_with(kSuffix) || sample.value == 0.0) continue;
    std::string rate;
    if (before) {
      const MetricSample* old = find(before->samples, sample.name);
      const double seconds = std::chrono::duration<double>(now.at - before->at).count();
      if (old != nullptr && seconds > 0.0) {
        rate = fmt::format("{:.1f}", (sample.value - old->value) / seconds);
      }
    }
    table.add(
        {sample.name.substr(kPrefix.size(), sample.name.size() - kPrefix.size() - kSuffix.size()),
         fmt::format("{:.0f}", sample.value), rate});
  }
  fmt::print("{}\n", table.to_string());
}

std::string milliseconds(double seconds) {
  return std::isinf(seconds) ? "more" : fmt::format("{:g}", seconds * 1e3);
}

/// One row per histogram: bounds of its quantiles.
void print_times(const Samples& samples) {
  TextTable table({"time, ms (upper bounds)", "frames", "mean", "p50", "p99", "p99.9"});
  for (const MetricSample& count : samples) {
    constexpr std::string_view kSuffix = "_seconds_count";
    if (!count.name.ends_with(kSuffix) || count.value == 0.0) continue;
    const std::string base = count.name.substr(0, count.name.size() - std::string("_count").size());
    std::vector<std::pair<double, double>> buckets;
    for (const MetricSample& sample : samples) {
      auto labels = sample.labels;
      labels.erase("le");
      if (sample.name != base + "_bucket" || labels != count.labels) continue;
      const std::string bound = sample.label("le");
      buckets.emplace_back(bound == "+Inf" ? HUGE_VAL : std::strtod(bound.c_str(), nullptr),
                           sample.value);
    }
    const MetricSample* sum = find(samples, base + "_sum", &count.labels);
    const std::string stage = count.label("stage");
    table.add(
        {stage.empty() ? base.substr(kPrefix.size(), base.size() - kPrefix.size() - 8) : stage,
         fmt::format("{:.0f}", count.value),
         sum != nullptr ? fmt::format("{:.3g}", sum->value / count.value * 1e3) : "",
         milliseconds(quantile_bound(buckets, 0.5)), milliseconds(quantile_bound(buckets, 0.99)),
         milliseconds(quantile_bound(buckets, 0.999))});
  }
  fmt::print("{}\n", table.to_string());
}

void print_clients(const Samples& samples) {
  TextTable table(
      {"connection", "peer", "role", "channel", "transport", "frames", "skipped", "delay ms"});
  for (const MetricSample& frames : samples) {
    if (frames.name != "emitd_client_frames_total") continue;
    const MetricSample* skipped = find(samples, "emitd_client_skipped_total", &frames.labels);
    const MetricSample* delay = find(samples, "emitd_client_delay_seconds", &frames.labels);
    table.add({frames.label("connection"), frames.label("peer"), frames.label("role"),
               frames.label("channel"), frames.label("transport"),
               fmt::format("{:.0f}", frames.value),
               fmt::format("{:.0f}", skipped != nullptr ? skipped->value : 0.0),
               fmt::format("{:.3f}", delay != nullptr ? delay->value * 1e3 : 0.0)});
  }
  fmt::print("{}\n", table.to_string());
}

void print_warnings(const Samples& samples) {
  for (const MetricSample& warning : samples) {
    if (warning.name != "emitd_warnings_total") continue;
    fmt::print("{:>8.0f} x {} {}\n", warning.value, warning.label("level"), warning.label("text"));
  }
}

Json to_json(const Samples& samples) {
  Json list = Json::array();
  for (const MetricSample& sample : samples) {
    Json labels = Json::object();
    for (const auto& [name, value] : sample.labels) labels.set(name, value);
    Json item = Json::object();
    item.set("name", sample.name).set("labels", std::move(labels)).set("value", sample.value);
    list.push(std::move(item));
  }
  Json document = Json::object();
  document.set("samples", std::move(list));
  return document;
}

void print(const Reading& now, const std::optional<Reading>& before) {
  print_head(now.samples);
  print_counters(now, before);
  print_times(now.samples);
  print_clients(now.samples);
  print_warnings(now.samples);
  std::fflush(stdout);
}

int run(const StatOptions& command) {
  std::optional<Reading> before;
  const InterruptGuard interrupt;
  const bool live = ::isatty(STDOUT_FILENO) != 0 && !command.once;
  while (!InterruptGuard::interrupted()) {
    auto now = read(command.url);
    if (!now) return fail_call(now.error());
    if (command.json) {
      if (auto written = write_json(*command.json, to_json(now->samples)); !written) {
        return fail(written.error());
      }
    }
    if (!command.json || *command.json != "-") {
      if (live) fmt::print("\x1b[H\x1b[2J");
      print(*now, before);
    }
    if (command.once || command.json) break;
    before = std::move(*now);
    std::this_thread::sleep_for(std::chrono::duration<double>(command.interval_s));
  }
  return kExitOk;
}

void add_options(CommandLine& line, StatOptions& options) {
  line.option("url", options.url, "http://host:port of metrics.listen").required().type_name("URL");
  line.flag("--once", options.once, "One table, then the end");
  line.seconds("--interval-s", options.interval_s, "Time between two tables")
      .in_range(0.1, 3600.0)
      .show_default();
  add_json(line, options.json);
}

}  // namespace

void add_stat(CommandLine& tool) {
  tool.command<StatOptions>(
      {.name = "stat",
       .text =
           "Counters, times, clients and warnings of a daemon with metrics.listen, again and again",
       .example = "emit stat http://127.0.0.1:7002"},
      add_options, run);
}

}  // namespace emit::tool
