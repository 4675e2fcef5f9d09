// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <system_error>
#include <thread>

#include "commands.hpp"
#include "console.hpp"
#include "daemon_process.hpp"
#include "emit/version.hpp"
#include "frame_files.hpp"
#include "json.hpp"
#include "statistics.hpp"
#include "stream_client.hpp"

namespace emit::cli {
namespace {

using physics::Result;

struct StreamResult {
  std::uint64_t frames = 0;
  std::uint64_t lost = 0;
  std::uint64_t late = 0;
  std::uint64_t partial = 0;
  std::uint64_t gaps = 0;
  Samples delay_ms;
  double seconds = 0.0;
  double cpu_frac = 0.0;
  std::string device;
  std::string advice;
};

config::DaemonConfig canned_config(const BenchStreamCommand& command) {
  config::DaemonConfig daemon;
  daemon.source.kind = config::SourceKind::canned;
  daemon.source.canned_width_px = command.width_px;
  daemon.source.canned_height_px = command.height_px;
  daemon.pacing.mode = config::PacingMode::ig_clock;
  daemon.pacing.rate_hz = command.rate_hz;
  daemon.host.udp = "";
  daemon.control.tcp = "127.0.0.1:0";
  return daemon;
}

Result<StreamResult> run_transport(const BenchStreamCommand& command, const std::string& scheme,
                                   const std::filesystem::path& work) {
  auto daemon = DaemonProcess::start(canned_config(command), {}, work, std::chrono::seconds(60));
  if (!daemon) return tl::unexpected(daemon.error());
  std::vector<std::unique_ptr<StreamClient>> clients;
  for (std::uint32_t i = 0; i < command.clients; ++i) {
    StreamClient::Options options;
    options.url = scheme + "://" + daemon->control_address();
    auto client = StreamClient::start(options);
    if (!client) return tl::unexpected(client.error());
    clients.push_back(std::move(*client));
  }
  StreamResult result;
  const double cpu_before_s = daemon->cpu_seconds();
  const auto start = std::chrono::steady_clock::now();
  const auto timeout = std::chrono::milliseconds(
      static_cast<std::int64_t>(3e3 * static_cast<double>(command.frames) / command.rate_hz) +
      10'000);
  bool complete = true;
  std::string reason;
  for (const auto& client : clients) {
    result.device = client->server().device;
    complete = client->wait_for_frames(command.frames, timeout) && complete;
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.cpu_frac = (daemon->cpu_seconds() - cpu_before_s) / result.seconds;
  for (const auto& client : clients) {
    client->stop();
    const auto& counters = client->counters();
    result.frames += client->report().frames();
    result.lost += counters.lost;
    result.partial += counters.partial;
    result.gaps += counters.gaps;
    result.late += client->report().flagged(protocol::kFlagLate);
    for (const double value : client->report().ready_to_received_ms().values()) {
      result.delay_ms.add(value);
    }
    if (result.advice.empty()) result.advice = client->advice();
    if (reason.empty()) reason = client->error();
  }
  clients.clear();
  if (auto stopped = daemon->stop(std::chrono::seconds(20)); !stopped) {
    return tl::unexpected(stopped.error());
  }
  if (!complete) {
    return physics::make_error(
        physics::ErrorCode::io,
        fmt::format("{}: only {} of {} frames came{}{}", scheme, result.frames,
                    command.frames * command.clients, reason.empty() ? "" : ": ", reason));
  }
  return result;
}

}  // namespace

int run_bench_stream(const BenchStreamCommand& command) {
  std::error_code error;
  const auto work =
      std::filesystem::temp_directory_path(error) /
      fmt::format("emit-bench-{}", std::chrono::steady_clock::now().time_since_epoch().count());
  if (auto made = make_directory(work); !made) return fail(made.error());
  Json results = Json::array();
  TextTable table({"transport", "clients", "frames", "lost", "partial", "gaps", "late", "p50 us",
                   "p99 us", "p99.9 us", "max us", "Gbit/s", "CPU"});
  std::string device;
  int exit_code = kExitOk;
  for (const std::string scheme : {"tcp", "udp"}) {
    const auto result = run_transport(command, scheme, work);
    if (!result) {
      std::filesystem::remove_all(work, error);
      return fail(result.error());
    }
    device = result->device;
    const double bits = 32.0 * command.width_px * command.height_px;
    const double gbit_s = 1e-9 * bits * static_cast<double>(result->frames) / result->seconds;
    const auto us = [&](double frac) { return 1e3 * result->delay_ms.percentile(frac); };
    Json json = Json::object();
    json.set("transport", scheme).set("clients", command.clients);
    json.set("width", command.width_px).set("height", command.height_px);
    json.set("rate_hz", command.rate_hz).set("frames", result->frames);
    json.set("lost", result->lost).set("late", result->late);
    json.set("p50_us", us(0.5)).set("p99_us", us(0.99)).set("p999_us", us(0.999));
    json.set("max_us", us(1.0)).set("gbit_s", gbit_s).set("cpu_frac", result->cpu_frac);
    json.set("partial", result->partial).set("gaps", result->gaps);
    json.set("delay", "pixels ready in the daemon to last byte at the client");
    results.push(std::move(json));
    const auto whole = [](double value) { return fmt::format("{:.0f}", value); };
    const auto count = [](std::uint64_t value) { return fmt::format("{}", value); };
    table.add({scheme, count(command.clients), count(result->frames), count(result->lost),
               count(result->partial), count(result->gaps), count(result->late), whole(us(0.5)),
               whole(us(0.99)), whole(us(0.999)), whole(us(1.0)), fmt::format("{:.2f}", gbit_s),
               fmt::format("{:.2f}", result->cpu_frac)});
    if (!result->advice.empty()) warn(result->advice);
    if (result->lost > 0 || result->partial > 0) exit_code = kExitFailure;
  }
  std::filesystem::remove_all(work, error);
  if (command.json != std::filesystem::path("-")) {
    fmt::print("{}x{} at {:g} Hz, loopback\n{}", command.width_px, command.height_px,
               command.rate_hz, table.to_string());
  }
  if (command.json) {
    Json json = Json::object();
    json.set("device", device).set("commit", kCommit).set("suite", "stream");
    json.set("results", std::move(results));
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return exit_code;
}

}  // namespace emit::cli
