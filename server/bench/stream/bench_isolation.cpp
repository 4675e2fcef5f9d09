// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <system_error>
#include <thread>
#include <vector>

#include "bench/stream/stream_benches.hpp"
#include "bench/stream/stream_throughput.hpp"
#include "client/client_connection.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/streams/stream_client.hpp"
#include "tool/support/console.hpp"
#include "tool/support/daemon_process.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {
namespace {

struct IsolationOptions {
  std::optional<std::filesystem::path> json;
  std::uint64_t frames = 400;  ///< per client and run
  double rate_hz = 200.0;
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  std::uint32_t clients = 4;  ///< of mixed transports; the disturbing ones are beside them
  std::uint32_t pairs = 15;
};

using physics::Result;

/// Client that sends records without an answer as fast as the daemon takes them. It reconnects at
/// once after the daemon closes the connection.
class FloodingClient {
 public:
  explicit FloodingClient(const std::string& url) : url_(url) {
    // An emit.v1.ControlRecord with a Status that says nothing: a client may send one.
    constexpr std::array<std::byte, 2> kBody{std::byte{0x3A}, std::byte{0}};
    for (std::size_t i = 0; i < kRecords; ++i) {
      const std::size_t at = records_.size();
      records_.resize(at + protocol::kRecordHeaderBytes);
      protocol::encode_record_header(
          protocol::RecordKind::control, static_cast<std::uint32_t>(kBody.size()),
          std::span(records_).subspan(at).first<protocol::kRecordHeaderBytes>());
      records_.insert(records_.end(), kBody.begin(), kBody.end());
    }
    thread_ = std::thread([this] { run(); });
  }
  ~FloodingClient() {
    stop_.store(true);
    thread_.join();
  }
  FloodingClient(const FloodingClient&) = delete;
  FloodingClient& operator=(const FloodingClient&) = delete;

  [[nodiscard]] std::uint64_t records() const noexcept { return kRecords * batches_.load(); }
  [[nodiscard]] std::uint64_t connections() const noexcept { return connections_.load(); }

 private:
  static constexpr std::size_t kRecords = 2048;
  static constexpr std::int64_t kPatienceNs = 100'000'000;

  void run() {
    const auto url = client::parse_url(url_);
    while (url && !stop_.load()) {
      auto connection =
          client::ClientConnection::open(*url, protocol::PeerRole::client, kPatienceNs);
      if (!connection) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        continue;
      }
      connections_.fetch_add(1);
      // A daemon that reads slowly is what the flood meets; that is no reason to reconnect.
      std::span<const std::byte> rest;
      while (!stop_.load()) {
        if (rest.empty()) rest = records_;
        const std::size_t piece = std::min<std::size_t>(rest.size(), 4096);
        if (!connection->send(rest.first(piece), client::monotonic_now_ns() + kStallNs)) break;
        rest = rest.subspan(piece);
        if (rest.empty()) batches_.fetch_add(1);
      }
    }
  }

  static constexpr std::int64_t kStallNs = 5'000'000'000;
  std::string url_;
  std::vector<std::byte> records_;
  std::atomic<bool> stop_{false};
  std::atomic<std::uint64_t> batches_{0};
  std::atomic<std::uint64_t> connections_{0};
  std::thread thread_;
};

/// Results of the watched clients of one run.
struct RunResult {
  double p99_ms = 0.0;
  std::uint64_t frames = 0;
  std::uint64_t lost = 0;
  std::uint64_t skipped = 0;
  std::uint64_t unflagged_gaps = 0;
  std::uint64_t flood_records = 0;
  std::uint64_t flood_connections = 0;
};

class IsolationBench {
 public:
  explicit IsolationBench(const IsolationOptions& command)
      : command_(command), shm_(own_shm_name()) {}

  Result<void> run(const std::filesystem::path& work);
  [[nodiscard]] Json json() const;
  [[nodiscard]] const std::string& device() const { return device_; }
  void print(std::FILE* out) const;
  [[nodiscard]] bool sound() const { return sum_.lost == 0 && sum_.unflagged_gaps == 0; }

 private:
  Result<RunResult> measure(bool disturbed);
  void add(const RunResult& run);
  /// Half the distance between the 16th and the 84th percentile. It is the spread of a run against
  /// itself.
  [[nodiscard]] static double spread(const Samples& ratios) {
    return 0.5 * (ratios.percentile(0.84) - ratios.percentile(0.16));
  }
  /// Returns an empty result where there are too few pairs to know the spread.
  [[nodiscard]] std::optional<bool> met() const {
    if (command_.pairs < kMinPairs) return std::nullopt;
    return std::abs(ratio_.median() - 1.0) <= std::max(kLimit, spread(self_ratio_));
  }

  static constexpr double kLimit = 0.05;
  static constexpr std::uint32_t kMinPairs = 15;
  const IsolationOptions& command_;
  std::string shm_;
  std::string control_;
  std::string device_;
  Samples quiet_ms_;
  Samples disturbed_ms_;
  Samples ratio_;
  Samples self_ratio_;
  RunResult sum_;
};

Result<void> IsolationBench::run(const std::filesystem::path& work) {
  config::DaemonConfig config = canned_daemon(command_.width_px, command_.height_px, shm_);
  config.pacing.mode = config::PacingMode::ig_clock;
  config.pacing.rate_hz = command_.rate_hz;
  auto daemon = DaemonProcess::start(config, {}, work, std::chrono::seconds(60));
  if (!daemon) return tl::unexpected(daemon.error());
  control_ = "tcp://" + daemon->control_address();
  // The first run is not counted, because it pays for work that is done once.
  if (auto first = measure(true); !first) return tl::unexpected(first.error());
  Progress progress("pairs", command_.pairs);
  for (std::uint32_t pair = 0; pair < command_.pairs; ++pair) {
    // The order changes, so that a drift of the machine favours neither.
    std::array<double, 3> p99_ms{};
    constexpr std::size_t kQuiet = 0;
    constexpr std::size_t kDisturbed = 1;
    constexpr std::size_t kQuietAgain = 2;
    const std::array<std::size_t, 3> order = pair % 2 == 0
                                                 ? std::array{kQuiet, kDisturbed, kQuietAgain}
                                                 : std::array{kDisturbed, kQuiet, kQuietAgain};
    for (const std::size_t which : order) {
      const auto result = measure(which == kDisturbed);
      if (!result) return tl::unexpected(result.error());
      p99_ms[which] = result->p99_ms;
      add(*result);
    }
    quiet_ms_.add(p99_ms[kQuiet]);
    disturbed_ms_.add(p99_ms[kDisturbed]);
    ratio_.add(p99_ms[kDisturbed] / p99_ms[kQuiet]);
    self_ratio_.add(p99_ms[kQuietAgain] / p99_ms[kQuiet]);
    progress.advance_to(pair + 1);
  }
  progress.finish();
  return daemon->stop(std::chrono::seconds(20));
}

Result<RunResult> IsolationBench::measure(bool disturbed) {
  std::unique_ptr<FloodingClient> flood;
  std::unique_ptr<client::FrameClient> stopped;
  if (disturbed) {
    auto connected = client::FrameClient::connect(control_);
    if (!connected) return tl::unexpected(connected.error());
    stopped = std::move(*connected);  // subscribes and never reads
    if (auto channel = stopped->subscribe({}); !channel) return tl::unexpected(channel.error());
    flood = std::make_unique<FloodingClient>(control_);
  }
  constexpr std::array<const char*, 3> kInTurn{"tcp", "udp", "shm"};
  std::vector<std::unique_ptr<StreamClient>> clients;
  for (std::uint32_t i = 0; i < command_.clients; ++i) {
    const std::string scheme = kInTurn[i % kInTurn.size()];
    StreamClient::Options options;
    options.url = scheme == "shm" ? "shm://" + shm_ : scheme + control_.substr(3);
    options.subscribe.in_place = true;
    auto client = StreamClient::start(options);
    if (!client) return tl::unexpected(client.error());
    clients.push_back(std::move(*client));
  }
  const auto timeout = std::chrono::milliseconds(
      static_cast<std::int64_t>(10e3 * static_cast<double>(command_.frames) / command_.rate_hz) +
      20'000);
  RunResult out;
  Samples interval_ms;
  for (const auto& client : clients) {
    if (!client->wait_for_frames(command_.frames, timeout)) {
      return physics::make_error(physics::ErrorCode::io,
                                 fmt::format("only {} of {} frames came: {}", client->frames(),
                                             command_.frames, client->error()));
    }
  }
  if (flood) {
    out.flood_records = flood->records();
    out.flood_connections = flood->connections();
  }
  for (const auto& client : clients) {
    client->stop();
    device_ = client->server().device;
    const auto& counters = client->counters();
    out.frames += client->report().frames();
    out.lost += counters.lost + counters.crc_errors + counters.partial;
    out.skipped += counters.skipped;
    out.unflagged_gaps += client->report().unflagged_gaps();
    for (const double ms : client->report().interval_ms().values()) interval_ms.add(ms);
  }
  out.p99_ms = interval_ms.percentile(0.99);
  return out;
}

void IsolationBench::add(const RunResult& run) {
  sum_.frames += run.frames;
  sum_.lost += run.lost;
  sum_.skipped += run.skipped;
  sum_.unflagged_gaps += run.unflagged_gaps;
  sum_.flood_records += run.flood_records;
  sum_.flood_connections += run.flood_connections;
}

Json IsolationBench::json() const {
  Json result = Json::object();
  result.set("test", "stopped-and-flooding").set("transport", "mixed");
  result.set("clients", command_.clients).set("width", command_.width_px);
  result.set("height", command_.height_px).set("rate_hz", command_.rate_hz);
  result.set("pairs", command_.pairs).set("frames", sum_.frames).set("lost", sum_.lost);
  result.set("skipped", sum_.skipped).set("unflagged_gaps", sum_.unflagged_gaps);
  result.set("quiet_p99_us", 1e3 * quiet_ms_.median());
  result.set("disturbed_p99_us", 1e3 * disturbed_ms_.median());
  result.set("ratio", ratio_.median()).set("ratio_p16", ratio_.percentile(0.16));
  result.set("ratio_p84", ratio_.percentile(0.84));
  result.set("self_ratio", self_ratio_.median()).set("self_spread", spread(self_ratio_));
  result.set("limit", kLimit).set("met", met() ? Json(*met()) : Json(nullptr));
  result.set("flood_records", sum_.flood_records);
  result.set("flood_connections", sum_.flood_connections);
  Json results = Json::array();
  results.push(std::move(result));
  return results;
}

void IsolationBench::print(std::FILE* out) const {
  const std::string judged = !met() ? fmt::format("not judged with fewer than {} pairs", kMinPairs)
                             : *met() ? "met"
                                      : "not met";
  fmt::print(out,
             "{}x{} at {:g} Hz, {} clients of mixed transports, {} pairs of runs\n"
             "p99 interval: quiet {:.3f} ms, beside a stopped and a flooding client {:.3f} ms\n"
             "ratio: median {:.3f} ({:.3f} to {:.3f}); a run against itself {:.3f} +- {:.3f}; "
             "limit {:.2f}: {}\n"
             "{} frames, {} lost, {} skipped, {} gaps not flagged; {} records of the flood over {} "
             "connections\n",
             command_.width_px, command_.height_px, command_.rate_hz, command_.clients,
             command_.pairs, quiet_ms_.median(), disturbed_ms_.median(), ratio_.median(),
             ratio_.percentile(0.16), ratio_.percentile(0.84), self_ratio_.median(),
             spread(self_ratio_), kLimit, judged, sum_.frames, sum_.lost, sum_.skipped,
             sum_.unflagged_gaps, sum_.flood_records, sum_.flood_connections);
}

int run(const IsolationOptions& command) {
  std::error_code error;
  const auto work =
      std::filesystem::temp_directory_path(error) /
      fmt::format("emit-bench-{}", std::chrono::steady_clock::now().time_since_epoch().count());
  if (auto made = make_directory(work); !made) return fail(made.error());
  IsolationBench bench(command);
  const auto done = bench.run(work);
  std::filesystem::remove_all(work, error);
  if (!done) return fail(done.error());
  bench.print(text_stream(command.json));
  if (command.json) {
    Json json = Json::object();
    json.set("device", bench.device()).set("commit", kCommit).set("suite", "isolation");
    json.set("cores", std::thread::hardware_concurrency());
    json.set("results", bench.json());
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return bench.sound() ? kExitOk : kExitFailure;
}

void add_options(CommandLine& line, IsolationOptions& options) {
  line.count("--frames", options.frames, "Frames per client and run")
      .in_range(10U, 1'000'000U)
      .show_default();
  line.option("--rate", options.rate_hz, "Frames a second").positive().show_default();
  add_image_size(line, options.width_px, options.height_px);
  line.option("--clients", options.clients, "Clients that are watched: tcp, udp, shm in turn")
      .in_range(1U, 8U)
      .show_default();
  line.option("--pairs", options.pairs,
              "Pairs of runs; medians count; fewer than 15 are not judged")
      .in_range(1U, 1000U)
      .show_default();
  add_json(line, options.json);
}

}  // namespace

void add_bench_isolation(CommandLine& bench) {
  bench.command<IsolationOptions>(
      {.name = "isolation",
       .text =
           "What a stopped and a flooding client cost the others: p99 of their intervals between "
           "frames, in interleaved pairs of runs with and without, beside a run against itself",
       .example = "emit bench isolation --json isolation.json"},
      add_options, run);
}

}  // namespace emit::tool
