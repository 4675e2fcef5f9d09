// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "bench/stream/stream_benches.hpp"
#include "bench/stream/stream_loss.hpp"
#include "bench/stream/stream_throughput.hpp"
#include "bench/stream/stream_yardstick.hpp"
#include "emit/version.hpp"
#include "net/socket.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/streams/stream_client.hpp"
#include "tool/streams/stream_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/daemon_process.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {
namespace {

struct StreamOptions {
  std::optional<std::filesystem::path> json;
  std::uint64_t frames = 1000;
  double rate_hz = 200.0;
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  std::uint32_t clients = 4;
  std::vector<std::string> transports{"tcp", "udp", "shm", "mixed"};
  std::uint32_t repeats = 5;      ///< of the throughput measurements; 0: none
  std::vector<std::string> only;  ///< of the throughput measurements; empty: all
  std::string cpus;               ///< realtime.cpus of the daemons
  /// Shares of datagrams that the network loses. If it is not empty, only lossy networks are
  /// measured.
  std::vector<double> losses;
  double burst_mean = 1.0;  ///< datagrams lost in a row
  protocol::FecParams fec{protocol::kDefaultFecData, protocol::kDefaultFecParity};
  std::uint32_t payload_bytes = 1400;  ///< of a fragment on lossy networks
  std::uint64_t seed = 1;
};

using physics::Result;

/// One row of the results, with the keys that every result has.
struct Row {
  std::string transport;
  std::uint32_t clients = 1;
  std::optional<double> rate_hz;  ///< none: as fast as it goes
  std::uint64_t frames = 0;
  std::uint64_t lost = 0;
  std::uint64_t late = 0;
  Samples delay_us;
  Samples own_us;  ///< paced: the daemon's share of it
  std::optional<double> gbit_s;
  std::optional<double> cpu_frac;
  std::vector<std::string> ratios;  ///< to its yardsticks, to be read
  Json more = Json::object();       ///< beyond the common keys
  bool lossy = false;               ///< lost frames were the question
  bool wrong = false;               ///< lossy: something came that was not as it said
};

struct Contender;
struct Series;

class StreamBench {
 public:
  StreamBench(const StreamOptions& command, std::filesystem::path work)
      : command_(command), work_(std::move(work)) {
    yardstick_.frame_bytes =
        sizeof(float) * static_cast<std::size_t>(command.width_px) * command.height_px;
  }

  Result<void> run();
  [[nodiscard]] const std::string& device() const { return device_; }
  [[nodiscard]] Json json() const;
  void print(std::FILE* out) const;
  /// Returns true when nothing was lost or torn.
  [[nodiscard]] bool sound() const {
    return std::all_of(rows_.begin(), rows_.end(),
                       [](const Row& row) { return row.lossy ? !row.wrong : row.lost == 0; });
  }

 private:
  Result<Row> paced(const std::string& transport);
  Result<Row> bare_paced();
  Result<void> lossy();
  Result<void> throughput();
  struct Daemons;
  /// Starts the daemons. Errors: those of StreamThroughput::start().
  [[nodiscard]] Result<Daemons> start_daemons() const;
  /// Makes one measurement of one contender.
  Result<YardstickResult> measure(const std::string& name, Daemons& daemons) const;
  /// Makes one measurement of each contender; `progress` gets the index of the one that is next.
  Result<void> measure_round(const std::vector<Contender>& contenders, Daemons& daemons,
                             std::map<std::string, Series>& series,
                             const std::function<void(std::size_t)>& progress) const;

  const StreamOptions& command_;
  std::filesystem::path work_;
  YardstickOptions yardstick_;
  std::string device_;
  std::vector<Row> rows_;
};

Result<void> StreamBench::run() {
  if (!command_.losses.empty()) return lossy();
  if (!command_.only.empty()) return throughput();
  for (const std::string& transport : command_.transports) {
    auto row = paced(transport);
    if (!row) return tl::unexpected(row.error());
    rows_.push_back(std::move(*row));
  }
  if (!command_.transports.empty()) {
    auto row = bare_paced();
    if (!row) return tl::unexpected(row.error());
    rows_.push_back(std::move(*row));
  }
  return command_.repeats > 0 ? throughput() : Result<void>();
}

/// Sums over clients of the paced results beside delays.
struct PacedCounts {
  std::uint64_t partial = 0;
  std::uint64_t gaps = 0;
  std::uint64_t skipped = 0;
  std::uint64_t crc_errors = 0;
  std::uint64_t unflagged_gaps = 0;
  std::uint64_t os_drops = 0;
  std::uint64_t repeated = 0;
  std::uint64_t pixel_bytes = 0;
  std::uint64_t sent_pixel_bytes = 0;
};

void add_delays(const Samples& from_ms, Samples& to_us) {
  for (const double value : from_ms.values()) to_us.add(1e3 * value);
}

Result<Row> StreamBench::paced(const std::string& transport) {
  const bool mixed = transport == "mixed";
  const bool compressed = transport == "tcp-lz4";
  const std::string shm = mixed || transport == "shm" ? own_shm_name() : "";
  config::DaemonConfig config = canned_daemon(command_.width_px, command_.height_px, shm);
  config.realtime.cpus = command_.cpus;
  config.pacing.mode = config::PacingMode::ig_clock;
  config.pacing.rate_hz = command_.rate_hz;
  auto daemon = DaemonProcess::start(config, {}, work_, std::chrono::seconds(60));
  if (!daemon) return tl::unexpected(daemon.error());
  constexpr std::array<const char*, 3> kInTurn{"tcp", "udp", "shm"};
  std::vector<std::unique_ptr<StreamClient>> clients;
  for (std::uint32_t i = 0; i < command_.clients; ++i) {
    const std::string scheme = mixed ? kInTurn[i % kInTurn.size()] : compressed ? "tcp" : transport;
    StreamClient::Options options;
    options.url = scheme + "://" + (scheme == "shm" ? shm : daemon->control_address());
    options.subscribe.in_place = true;
    options.subscribe.compression = compressed;
    auto client = StreamClient::start(options);
    if (!client) return tl::unexpected(client.error());
    clients.push_back(std::move(*client));
  }
  Row row;
  row.transport = transport;
  row.clients = command_.clients;
  row.rate_hz = command_.rate_hz;
  const double cpu_before_s = daemon->cpu_seconds();
  const auto start = std::chrono::steady_clock::now();
  const auto timeout = std::chrono::milliseconds(
      static_cast<std::int64_t>(3e3 * static_cast<double>(command_.frames) / command_.rate_hz) +
      10'000);
  bool complete = true;
  for (const auto& client : clients) {
    complete = client->wait_for_frames(command_.frames, timeout) && complete;
  }
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  row.cpu_frac = (daemon->cpu_seconds() - cpu_before_s) / seconds;

  PacedCounts counts;
  std::uint64_t fewest_frames = command_.frames;
  std::string reason;
  std::string advice;
  for (const auto& client : clients) {
    client->stop();
    device_ = client->server().device;
    const auto& counters = client->counters();
    row.frames += client->report().frames();
    fewest_frames = std::min(fewest_frames, client->report().frames());
    row.lost += counters.lost + counters.crc_errors + counters.partial;
    row.late += client->report().flagged(protocol::kFlagLate);
    counts.partial += counters.partial;
    counts.gaps += counters.gaps;
    counts.skipped += counters.skipped;
    counts.crc_errors += counters.crc_errors;
    counts.os_drops += counters.os_drops;
    counts.repeated += counters.repeated;
    counts.pixel_bytes += client->report().pixel_bytes();
    counts.sent_pixel_bytes += client->report().sent_pixel_bytes();
    counts.unflagged_gaps += client->report().unflagged_gaps();
    add_delays(client->report().ready_to_received_ms(), row.delay_us);
    add_delays(client->report().ready_to_send_ms(), row.own_us);
    if (advice.empty()) advice = client->advice();
    if (reason.empty()) reason = client->error();
  }
  clients.clear();
  if (auto stopped = daemon->stop(std::chrono::seconds(20)); !stopped) {
    return tl::unexpected(stopped.error());
  }
  if (!complete) {
    return physics::make_error(
        physics::ErrorCode::io,
        fmt::format("{}: only {} of {} frames came to one of the clients{}{}", transport,
                    fewest_frames, command_.frames, reason.empty() ? "" : ": ", reason));
  }
  if (!advice.empty()) warn(advice);
  row.gbit_s = 8e-9 * static_cast<double>(yardstick_.frame_bytes * row.frames) / seconds;
  row.more.set("partial", counts.partial).set("gaps", counts.gaps).set("skipped", counts.skipped);
  row.more.set("unflagged_gaps", counts.unflagged_gaps).set("crc_errors", counts.crc_errors);
  row.more.set("os_drops", counts.os_drops).set("repeated", counts.repeated);
  row.more.set("sent_frac",
               static_cast<double>(counts.sent_pixel_bytes) /
                   static_cast<double>(std::max<std::uint64_t>(counts.pixel_bytes, 1)));
  row.more.set("delay", "pixels ready in the daemon to last byte at the client");
  row.more.set("own", "pixels ready in the daemon to this client's first byte given away");
  return row;
}

/// Measures each share of losses without help, with resend and with error correction.
Result<void> StreamBench::lossy() {
  for (const double loss : command_.losses) {
    for (const bool fec : {false, true}) {
      for (const bool resend : {false, true}) {
        if (fec && resend) continue;
        LossyStream::Options options;
        options.width_px = command_.width_px;
        options.height_px = command_.height_px;
        options.frames = command_.frames;
        options.faults.seed = command_.seed;
        options.faults.loss_frac = loss;
        options.faults.burst_mean = command_.burst_mean;
        options.payload_bytes = command_.payload_bytes;
        if (fec) options.fec = command_.fec;
        options.resend = resend;
        auto result = LossyStream::measure(options, work_);
        if (!result) return tl::unexpected(result.error());
        device_ = result->device;
        Row row;
        row.transport = fec ? "udp-fec" : resend ? "udp-resend" : "udp";
        row.frames = result->frames;
        row.lost = result->lost;
        row.late = result->late;
        row.lossy = true;
        row.wrong = result->unflagged > 0 || result->wrong_px > 0;
        row.gbit_s =
            8e-9 * static_cast<double>(yardstick_.frame_bytes * result->frames) / result->seconds;
        row.cpu_frac = result->cpu_s / result->seconds;
        add_delays(result->ready_to_received_ms, row.delay_us);
        row.more = loss_json(options, *result);
        rows_.push_back(std::move(row));
      }
    }
  }
  return {};
}

Result<Row> StreamBench::bare_paced() {
  YardstickOptions options = yardstick_;
  options.frames = command_.frames;
  auto delays = measure_bare_delays(options, command_.clients, command_.rate_hz);
  if (!delays) return tl::unexpected(delays.error());
  Row row;
  row.transport = "bare-tcp-paced";
  row.clients = command_.clients;
  row.rate_hz = command_.rate_hz;
  row.frames = delays->delay_us.count();
  row.delay_us = std::move(delays->delay_us);
  row.own_us = std::move(delays->own_us);
  row.gbit_s = 8e-9 * static_cast<double>(options.frame_bytes) * row.clients * command_.rate_hz;
  row.more.set("delay", "ready to last byte at the client: a thread that sends, no service");
  row.more.set("own", "ready to this client's first byte given away by the thread that sends");
  return row;
}

/// Contender of the measurements, and the yardsticks it is compared with.
struct Contender {
  const char* name;
  /// Yardsticks to compare with; the first is "the" yardstick. It is empty for a yardstick itself.
  std::vector<const char*> yardsticks;
};

/// Returns the contenders. TCP and its yardsticks follow each other, because the speed of the
/// machine changes within seconds.
const std::vector<Contender>& contenders() {
  static const std::vector<Contender> all{
      {"iperf3", {}},
      {"bare-tcp", {}},
      {"bare-tcp-crc", {}},
      {"tcp", {"bare-tcp", "bare-tcp-crc", "iperf3", "zeromq", "zeromq-crc"}},
      {"zeromq", {}},
      {"zeromq-crc", {}},
      {"tls", {"tcp"}},
      {"bare-udp", {}},
      {"udp", {"bare-udp"}},
      {"shm", {"bare-tcp", "iceoryx", "iceoryx-crc"}},
      {"iceoryx", {}},
      {"iceoryx-crc", {}}};
  return all;
}

std::vector<Contender> contenders_of(const StreamOptions& command) {
  std::vector<Contender> out = contenders();
  if (!command.only.empty()) {
    std::erase_if(out, [&](const Contender& contender) {
      return std::ranges::find(command.only, contender.name) == command.only.end();
    });
  }
  return out;
}

/// All measurements of one contender.
struct Series {
  Samples gbit_s;
  Samples cpu_frac;
  Samples cpu_s_per_gbit;  ///< holds still where other work on the machine takes its share
  std::map<std::string, Samples> ratios;  ///< to the yardsticks of the same round
  std::uint64_t frames = 0;
  std::uint64_t lost = 0;
  std::string missing;  ///< why there is none
};

/// Daemons of the throughput measurements. A ring in shared memory costs only the daemon that has
/// one.
struct StreamBench::Daemons {
  Result<StreamThroughput> plain;
  Result<StreamThroughput> shared;
  Result<StreamThroughput> secured;  ///< an error where no certificate can be made
};

Result<StreamBench::Daemons> StreamBench::start_daemons() const {
  const auto start = [&](const std::string& shm,
                         const client::Security& security) -> Result<StreamThroughput> {
    const auto directory = work_ / (shm + (security.tls() ? "-tls" : "-plain"));
    if (auto made = make_directory(directory); !made) return tl::unexpected(made.error());
    auto config = canned_daemon(command_.width_px, command_.height_px, shm);
    config.realtime.cpus = command_.cpus;
    config.tls.certificate = security.tls_certificate;
    config.tls.key = security.tls_key;
    config.tls.client_ca = security.tls_ca;
    return StreamThroughput::start(config, directory, security);
  };
  auto plain = start("", {});
  if (!plain) return tl::unexpected(plain.error());
  auto shared = start(own_shm_name(), {});
  if (!shared) return tl::unexpected(shared.error());
  const auto certificate = make_certificate(work_);
  auto secured = certificate ? start("", *certificate)
                             : Result<StreamThroughput>(tl::unexpected(certificate.error()));
  if (certificate && !secured) return tl::unexpected(secured.error());
  return Daemons{std::move(plain), std::move(shared), std::move(secured)};
}

Result<YardstickResult> StreamBench::measure(const std::string& name, Daemons& daemons) const {
  if (name == "bare-tcp") return measure_bare_tcp(yardstick_, false);
  if (name == "bare-tcp-crc") return measure_bare_tcp(yardstick_, true);
  if (name == "bare-udp") return measure_bare_udp(yardstick_);
  if (name == "zeromq") return measure_zeromq(yardstick_, false);
  if (name == "zeromq-crc") return measure_zeromq(yardstick_, true);
  if (name == "iceoryx") return measure_iceoryx(yardstick_, work_, false);
  if (name == "iceoryx-crc") return measure_iceoryx(yardstick_, work_, true);
  if (name == "iperf3") {
    constexpr int kSeconds = 1;
    const auto gbit_s = measure_iperf3_gbit_s(work_, kSeconds);
    if (!gbit_s) return tl::unexpected(gbit_s.error());
    YardstickResult result;
    result.seconds = kSeconds;
    result.frames = static_cast<std::uint64_t>(*gbit_s * 1e9 / 8.0 /
                                               static_cast<double>(yardstick_.frame_bytes));
    return result;
  }
  if (name == "tls" && !daemons.secured) return tl::unexpected(daemons.secured.error());
  return (name == "shm"   ? *daemons.shared
          : name == "tls" ? *daemons.secured
                          : *daemons.plain)
      .measure(name, yardstick_.frames, yardstick_.window);
}

Result<void> StreamBench::measure_round(const std::vector<Contender>& contenders, Daemons& daemons,
                                        std::map<std::string, Series>& series,
                                        const std::function<void(std::size_t)>& progress) const {
  std::map<std::string, double> of_round;
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    const Contender& contender = contenders[i];
    Series& own = series[contender.name];
    progress(i);
    if (!own.missing.empty()) continue;
    const auto result = measure(contender.name, daemons);
    if (!result) {
      const auto code = result.error().code;
      if (code != physics::ErrorCode::not_found && code != physics::ErrorCode::unsupported) {
        return tl::unexpected(result.error());
      }
      own.missing = result.error().text;
      continue;
    }
    const double gbit_s =
        8e-9 * static_cast<double>(result->frames * yardstick_.frame_bytes) / result->seconds;
    of_round[contender.name] = gbit_s;
    own.gbit_s.add(gbit_s);
    if (result->cpu_s > 0.0) {
      own.cpu_frac.add(result->cpu_s / result->seconds);
      own.cpu_s_per_gbit.add(result->cpu_s / (gbit_s * result->seconds));
    }
    own.frames += result->frames;
    own.lost += result->lost;
  }
  for (const Contender& contender : contenders) {
    for (const char* yardstick : contender.yardsticks) {
      if (of_round.count(contender.name) == 0 || of_round.count(yardstick) == 0) continue;
      series[contender.name].ratios[yardstick].add(of_round[contender.name] / of_round[yardstick]);
    }
  }
  return {};
}

Row throughput_row(const Contender& contender, const Series& own) {
  Row row;
  row.transport = contender.name;
  row.frames = own.frames;
  row.lost = own.lost;
  row.more.set("repeats", own.gbit_s.count());
  if (own.missing.empty()) {
    row.gbit_s = own.gbit_s.median();
    if (!own.cpu_frac.empty()) {
      row.cpu_frac = own.cpu_frac.median();
      row.more.set("cpu_s_per_gbit", own.cpu_s_per_gbit.median());
    }
    row.more.set("min_gbit_s", own.gbit_s.percentile(0.0)).set("max_gbit_s", own.gbit_s.max());
  } else {
    row.more.set("reason", own.missing);
  }
  Json ratios = Json::object();
  for (const char* yardstick : contender.yardsticks) {
    const auto found = own.ratios.find(yardstick);
    if (found == own.ratios.end()) continue;
    const double ratio = found->second.median();
    row.ratios.push_back(fmt::format("{:.2f} of {}", ratio, yardstick));
    ratios.set(yardstick, ratio);
    if (yardstick == contender.yardsticks.front()) {
      row.more.set("yardstick", yardstick).set("ratio", ratio);
    }
  }
  if (!row.ratios.empty()) row.more.set("ratios", std::move(ratios));
  row.more.set("cpu", "daemon and client, or sender and receiver; cores");
  return row;
}

Result<void> StreamBench::throughput() {
  // The run is long enough to hide the time of starting up.
  constexpr double kBytes = 2e9;
  constexpr std::uint64_t kMinFrames = 200;
  constexpr std::uint64_t kMaxFrames = 4000;
  yardstick_.frames =
      std::clamp(static_cast<std::uint64_t>(kBytes / static_cast<double>(yardstick_.frame_bytes)),
                 kMinFrames, kMaxFrames);
  auto daemons = start_daemons();
  if (!daemons) return tl::unexpected(daemons.error());
  const std::vector<Contender> contenders = contenders_of(command_);
  std::map<std::string, Series> series;
  Progress progress("throughput", command_.repeats * contenders.size());
  for (std::uint32_t round = 0; round < command_.repeats; ++round) {
    const auto measured = measure_round(contenders, *daemons, series, [&](std::size_t i) {
      progress.advance_to(round * contenders.size() + i);
    });
    if (!measured) return measured;
  }
  progress.finish();
  for (auto* daemon : {&daemons->plain, &daemons->shared, &daemons->secured}) {
    if (!*daemon) continue;
    if (device_.empty()) device_ = (*daemon)->device();
    if (auto stopped = (*daemon)->stop(); !stopped) return stopped;
  }
  for (const Contender& contender : contenders) {
    rows_.push_back(throughput_row(contender, series[contender.name]));
  }
  return {};
}

Json optional_json(const std::optional<double>& value) {
  return value ? Json(*value) : Json();
}

Json StreamBench::json() const {
  Json results = Json::array();
  for (const Row& row : rows_) {
    Json json = Json::object();
    json.set("transport", row.transport).set("clients", row.clients);
    json.set("width", command_.width_px).set("height", command_.height_px);
    json.set("rate_hz", optional_json(row.rate_hz)).set("frames", row.frames);
    json.set("lost", row.lost).set("late", row.late);
    const auto us = [&](double frac) {
      return row.delay_us.empty() ? Json() : Json(row.delay_us.percentile(frac));
    };
    json.set("p50_us", us(0.5)).set("p99_us", us(0.99)).set("p999_us", us(0.999));
    json.set("max_us", us(1.0)).set("gbit_s", optional_json(row.gbit_s));
    json.set("cpu_frac", optional_json(row.cpu_frac));
    if (!row.own_us.empty()) {
      json.set("own_p50_us", row.own_us.percentile(0.5));
      json.set("own_p99_us", row.own_us.percentile(0.99));
      json.set("own_p999_us", row.own_us.percentile(0.999));
      json.set("own_max_us", row.own_us.percentile(1.0));
    }
    json.merge(row.more);
    results.push(std::move(json));
  }
  return results;
}

std::string yardstick_congestion_control() {
  const std::string name = server::system_congestion_control();
  return name.empty() ? "unknown" : name;
}

void StreamBench::print(std::FILE* out) const {
  TextTable table({"transport", "clients", "rate Hz", "frames", "lost", "late", "p50 us", "p99 us",
                   "p99.9 us", "max us", "own p99.9", "Gbit/s", "CPU"});
  for (const Row& row : rows_) {
    const auto count = [](std::uint64_t value) { return fmt::format("{}", value); };
    const auto us_of = [](const Samples& samples, double frac) {
      return samples.empty() ? "-" : fmt::format("{:.0f}", samples.percentile(frac));
    };
    const auto us = [&](double frac) { return us_of(row.delay_us, frac); };
    const auto number = [](const std::optional<double>& value, int digits) {
      return value ? fmt::format("{:.{}f}", *value, digits) : "-";
    };
    table.add({row.transport, count(row.clients), row.rate_hz ? number(row.rate_hz, 0) : "max",
               count(row.frames), count(row.lost), count(row.late), us(0.5), us(0.99), us(0.999),
               us(1.0), us_of(row.own_us, 0.999), number(row.gbit_s, 2), number(row.cpu_frac, 2)});
  }
  fmt::print(out, "{}x{}, loopback; congestion control of the yardsticks: {}\n{}",
             command_.width_px, command_.height_px, yardstick_congestion_control(),
             table.to_string());
  for (const Row& row : rows_) {
    if (row.ratios.empty()) continue;
    fmt::print(out, "{}: {} (medians of ratios of the same round)\n", row.transport,
               fmt::join(row.ratios, ", "));
  }
}

std::vector<std::string> stream_contenders() {
  std::vector<std::string> names;
  for (const Contender& contender : contenders()) names.emplace_back(contender.name);
  return names;
}

int run(const StreamOptions& command) {
  if (!command.only.empty() && command.repeats == 0) {
    return fail(kExitUsage, "--only names what --repeats 0 leaves out");
  }
  std::error_code error;
  const auto work =
      std::filesystem::temp_directory_path(error) /
      fmt::format("emit-bench-{}", std::chrono::steady_clock::now().time_since_epoch().count());
  if (auto made = make_directory(work); !made) return fail(made.error());
  StreamBench bench(command, work);
  const auto done = bench.run();
  std::filesystem::remove_all(work, error);
  if (!done) return fail(done.error());
  bench.print(text_stream(command.json));
  if (command.json) {
    Json json = Json::object();
    json.set("device", bench.device().empty() ? Json() : Json(bench.device()))
        .set("commit", kCommit)
        .set("suite", "stream");
    json.set("cores", std::thread::hardware_concurrency()).set("cpus", command.cpus);
    json.set("yardstick_congestion_control", yardstick_congestion_control());
    json.set("results", bench.json());
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return bench.sound() ? kExitOk : kExitFailure;
}

void add_options(CommandLine& line, StreamOptions& options) {
  line.count("--frames", options.frames, "Frames per client at the fixed rate")
      .positive()
      .show_default();
  line.option("--rate", options.rate_hz, "Frames a second").positive().show_default();
  add_image_size(line, options.width_px, options.height_px);
  line.option("--clients", options.clients, "Clients at the fixed rate")
      .in_range(1U, 8U)
      .show_default();
  const Option transport =
      line.option("--transport", options.transports,
                  "Transport at the fixed rate; repeatable; mixed: tcp, udp, shm in turn; tcp-lz4: "
                  "compressed")
          .repeatable()
          .one_of({"tcp", "tcp-lz4", "udp", "shm", "mixed"})
          .show_default();
  line.option("--repeats", options.repeats,
              "Interleaved measurements of throughput, medians of which count; 0: none")
      .in_range(0U, 1000U)
      .show_default();
  const Option only =
      line.option("--only", options.only,
                  "Of the throughput measurements only this one, e.g. tcp, and nothing at a "
                  "fixed rate; repeatable; default: all")
          .repeatable()
          .one_of(stream_contenders())
          .type_name("NAME")
          .excludes(transport);
  line.option("--cpus", options.cpus,
              "Cores of the daemon's agents, as realtime.cpus has them, e.g. \"sender=0, "
              "render=1\"; default: wherever the kernel likes, like all yardsticks");
  line.option("--loss", options.losses,
              "Nothing but this: frames over UDP through a network that loses this share of "
              "the datagrams: without help, with resend, with error correction; repeatable")
      .repeatable()
      .in_range(0.0, 0.9)
      .type_name("FRAC")
      .excludes(only);
  line.option("--burst", options.burst_mean, "--loss: datagrams lost in a row, mean")
      .in_range(1.0, 1000.0)
      .show_default();
  add_error_correction(line, options.fec);
  line.option("--payload", options.payload_bytes, "--loss: bytes of a fragment")
      .in_range(320U, 65000U)
      .show_default();
  line.option("--seed", options.seed, "--loss: loses other datagrams")
      .type_name("N")
      .show_default();
  add_json(line, options.json);
}

}  // namespace

void add_bench_stream(CommandLine& bench) {
  bench.command<StreamOptions>(
      {.name = "stream",
       .text =
           "Transport alone: canned frames over loopback and shared memory, first at a fixed rate, "
           "then as fast as they go, beside bare sockets in the same run",
       .example = "emit bench stream --json stream.json --frames 1000 --rate 200"},
      add_options, run);
}

}  // namespace emit::tool
