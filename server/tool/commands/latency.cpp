// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>

#include "agents/render/canned_marker.hpp"
#include "client/client_connection.hpp"
#include "emit/client/client.hpp"
#include "rt/clock.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/streams/latency_marker.hpp"
#include "tool/streams/latency_report.hpp"
#include "tool/streams/pose_log.hpp"
#include "tool/streams/stream_options.hpp"
#include "tool/streams/stream_report.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

struct LatencyOptions {
  std::string url;  ///< frames
  std::string to;   ///< poses; empty: TCP to where the frames come from
  std::uint64_t frames = 1000;
  double rate_hz = 20.0;
  std::optional<std::uint32_t> entity;       ///< what is switched; absent: see --help
  std::optional<std::filesystem::path> log;  ///< its first pose is held
  double time_s = 0.0;
  double timeout_s = 10.0;
  std::uint32_t seed = 1;
  client::Security security;
  std::optional<std::filesystem::path> json;
};

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::int64_t kSecondNs = 1'000'000'000;

std::string url_text(const char* scheme, const client::Url& url) {
  const bool v6 = url.host.find(':') != std::string::npos;
  return fmt::format("{}://{}{}{}:{}", scheme, v6 ? "[" : "", url.host, v6 ? "]" : "", url.port);
}

/// Host and client at once: switches something with a pose and waits for the first frame that shows
/// it. One thread: a pose at a time is on its way.
class LatencyProbe {
 public:
  LatencyProbe(const LatencyOptions& command, client::FrameClient& client, client::HostClient& host)
      : command_(command), client_(client), host_(host), random_(command.seed) {
    frame_->run_id = static_cast<std::uint64_t>(clock_.tai_ns());
  }

  /// The pose that is held: of the log, else as the daemon shows it now, else 10 m above the origin
  /// with a view to the north.
  Result<void> choose_pose();
  Result<void> run(Progress& progress);

  [[nodiscard]] const LatencyReport& report() const noexcept { return report_; }
  [[nodiscard]] bool by_picture() const noexcept { return entity_.has_value(); }
  [[nodiscard]] std::size_t marker_pixels() const noexcept { return marker_.pixels(); }
  [[nodiscard]] std::uint64_t missed() const noexcept { return missed_; }
  [[nodiscard]] std::uint64_t disagreed() const noexcept { return disagreed_; }

 private:
  /// Sends the next pose, with the marker as it stands; the instant before it went.
  Result<std::int64_t> send();
  /// Waits until `wanted` says yes to a frame; it returns null when the time is over.
  template <class Wanted>
  Result<const client::ReceivedFrame*> wait(std::int64_t end_ns, Wanted wanted);
  Result<void> learn_marker();
  Result<void> sample(bool counts);
  [[nodiscard]] std::int64_t timeout_ns() const {
    return static_cast<std::int64_t>(command_.timeout_s * 1e9);
  }

  const LatencyOptions& command_;
  client::FrameClient& client_;
  client::HostClient& host_;
  server::SystemClock clock_;
  std::mt19937 random_;
  std::unique_ptr<protocol::HostFrameData> frame_ = std::make_unique<protocol::HostFrameData>();
  std::int64_t first_sim_ns_ = 0;
  std::int64_t started_ns_ = 0;
  std::optional<std::uint32_t> entity_;
  bool on_ = false;
  PictureMarker marker_;
  LatencyReport report_;
  std::uint64_t missed_ = 0;
  std::uint64_t disagreed_ = 0;  // frames whose pixels and number tell different things
};

Result<void> LatencyProbe::choose_pose() {
  frame_->seeker.position_world_m = {0.0, 0.0, 10.0};
  frame_->seeker.world_from_body = glm::dquat{0.0, 0.7071067811865476, 0.7071067811865476, 0.0};
  first_sim_ns_ = static_cast<std::int64_t>(command_.time_s * 1e9);
  if (command_.log) {
    auto log = PoseLog::open(*command_.log);
    if (!log) return tl::unexpected(log.error());
    const auto more = log->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) return make_error(ErrorCode::parse, command_.log->string() + ": no host frame");
    frame_->seeker = log->host().seeker;
    first_sim_ns_ = log->host().sim_time_ns;
    return {};
  }
  // Where frames come without a host, the daemon's own view is the one to measure.
  constexpr std::int64_t kListenNs = 300'000'000;
  const auto shown = client_.receive(kListenNs);
  if (!shown) return tl::unexpected(shown.error());
  if (*shown != nullptr) frame_->seeker = (*shown)->header.pose;
  return {};
}

Result<std::int64_t> LatencyProbe::send() {
  ++frame_->frame_number;
  const std::int64_t elapsed_ns = client::monotonic_now_ns() - started_ns_;
  frame_->sim_time_ns = first_sim_ns_ + elapsed_ns;
  frame_->entity_count = entity_ ? 1 : 0;
  if (entity_) {
    frame_->entities[0] = {};
    frame_->entities[0].entity_id = *entity_;
    frame_->entities[0].on = on_;
  }
  const std::int64_t sent_ns = clock_.tai_ns();
  if (auto done = host_.send(*frame_); !done) return tl::unexpected(done.error());
  return sent_ns;
}

template <class Wanted>
Result<const client::ReceivedFrame*> LatencyProbe::wait(std::int64_t end_ns, Wanted wanted) {
  while (!InterruptGuard::interrupted()) {
    const std::int64_t left_ns = end_ns - client::monotonic_now_ns();
    if (left_ns <= 0) break;
    const auto received = client_.receive(std::min(left_ns, kSecondNs / 5));
    if (!received) return tl::unexpected(received.error());
    if (*received != nullptr && wanted(**received)) return *received;
    const auto status = host_.receive_status(0);
    if (!status) return tl::unexpected(status.error());
    if (*status && !(*status)->ok()) {
      return make_error(ErrorCode::protocol,
                        fmt::format("the daemon refused a pose: {}", (*status)->text));
    }
  }
  return nullptr;
}

Result<void> LatencyProbe::learn_marker() {
  // Several of each, so that what moves by itself is not taken for the marker.
  constexpr int kPictures = 12;
  for (int i = 0; i < 2 * kPictures && !InterruptGuard::interrupted(); ++i) {
    on_ = !on_;
    const auto sent = send();
    if (!sent) return tl::unexpected(sent.error());
    const std::uint64_t number = frame_->frame_number;
    const auto shown = wait(client::monotonic_now_ns() + timeout_ns(), [&](const auto& frame) {
      return frame.header.host_frame_number == number && frame.missing_px == 0;
    });
    if (!shown) return tl::unexpected(shown.error());
    if (*shown == nullptr) return make_error(ErrorCode::io, "no frame while learning the marker");
    marker_.learn((*shown)->pixels, on_);
  }
  if (!marker_.ready()) {
    return make_error(ErrorCode::not_found,
                      fmt::format("entity {} cannot be seen from the pose that is held (--log "
                                  "chooses one); without --entity frames are told by their number",
                                  *entity_));
  }
  return {};
}

Result<void> LatencyProbe::sample(bool counts) {
  on_ = !on_;
  const auto sent = send();
  if (!sent) return tl::unexpected(sent.error());
  const std::uint64_t number = frame_->frame_number;
  const auto shown = wait(client::monotonic_now_ns() + timeout_ns(), [&](const auto& frame) {
    const bool by_number = frame.header.host_frame_number == number;
    if (!entity_) return by_number;
    const std::optional<bool> seen = marker_.shows(frame.pixels);
    const bool by_picture = seen.has_value() && *seen == on_;
    if (counts && by_picture != by_number) ++disagreed_;
    return by_picture;
  });
  if (!shown) return tl::unexpected(shown.error());
  if (*shown == nullptr) {
    if (!InterruptGuard::interrupted()) ++missed_;
    return {};
  }
  if (counts) report_.add((*shown)->header, *sent, (*shown)->last_byte_ns);
  return {};
}

Result<void> LatencyProbe::run(Progress& progress) {
  started_ns_ = client::monotonic_now_ns();
  entity_ = command_.entity;
  if (!entity_ && client_.server().device == "canned: test pattern") {
    entity_ = server::kCannedMarkerEntity;
  }
  // The first poses start a run of their own; what they meet is not what later ones meet.
  constexpr int kFirst = 5;
  const auto entity = std::exchange(entity_, std::nullopt);
  for (int i = 0; i < kFirst; ++i) {
    if (auto done = sample(false); !done) return done;
  }
  entity_ = entity;
  if (missed_ > 0) return make_error(ErrorCode::io, "no frame shows the first poses");
  if (entity_) {
    if (auto done = learn_marker(); !done) return done;
  }
  std::uniform_real_distribution<double> spread(0.5, 1.5);
  auto next_ns = static_cast<double>(client::monotonic_now_ns());
  for (std::uint64_t i = 0; i < command_.frames && !InterruptGuard::interrupted(); ++i) {
    // The pose has no fixed phase to any clock of the daemon, so that waits for a slot are even.
    next_ns = std::max(next_ns, static_cast<double>(client::monotonic_now_ns()) - 1e9) +
              spread(random_) * 1e9 / command_.rate_hz;
    const auto idle = wait(static_cast<std::int64_t>(next_ns), [](const auto&) { return false; });
    if (!idle) return tl::unexpected(idle.error());
    if (auto done = sample(true); !done) return done;
    progress.advance_to(i + 1);
  }
  return {};
}

int run(const LatencyOptions& command) {
  const auto url = client::parse_frame_url(command.url);
  if (!url) return fail(kExitUsage, url.error().text);
  std::string to = command.to;
  if (to.empty()) {
    if (url->scheme == client::Url::Scheme::shm) {
      return fail(kExitUsage, "shm:// needs --to tcp://host:port or udp://host:port for the poses");
    }
    to = url_text("tcp", *url);
  }
  const auto to_url = client::parse_url(to);
  if (!to_url) return fail(kExitUsage, to_url.error().text);

  client::Security security = command.security;
  if (url->scheme != client::Url::Scheme::shm) security.control = url_text("tcp", *url);
  auto connected =
      client::FrameClient::connect(command.url, client::kConnectTimeoutNs, command.security);
  if (!connected) return fail_call(connected.error());
  client::FrameClient& client = **connected;
  if (const auto channel = client.subscribe({}); !channel) return fail(channel.error());
  if (client.server().tai_offset_unset) {
    warn("the daemon's kernel has no TAI offset: across machines instants may differ by it");
  }
  auto host = client::HostClient::connect(to, client::kConnectTimeoutNs, security);
  if (!host) return fail(host.error());

  const InterruptGuard interrupt;
  LatencyProbe probe(command, client, **host);
  if (auto done = probe.choose_pose(); !done) return fail(done.error());
  Progress progress("toggles", command.frames);
  const auto done = probe.run(progress);
  progress.finish();
  if (!done) return fail(done.error());

  const LatencyReport& report = probe.report();
  const client::ServerInfo& server = client.server();
  const auto scheme = [](const client::Url& each) {
    return each.scheme == client::Url::Scheme::tcp   ? "tcp"
           : each.scheme == client::Url::Scheme::udp ? "udp"
                                                     : "shm";
  };
  std::FILE* const out = text_stream(command.json);
  fmt::print(out, "{}: {}, {}, poses by {}, frames by {}, told by {}\n{}{}", server.software,
             server.device, server.pacing, scheme(*to_url), scheme(*url),
             probe.by_picture() ? fmt::format("{} pixels", probe.marker_pixels())
                                : std::string("the frames' host frame number"),
             report.table(), histogram_text(report.total_us(), "us"));
  fmt::print(out, "{} toggles measured, {} never shown, {} frames whose pixels and number differ\n",
             report.total_us().count(), probe.missed(), probe.disagreed());
  if (command.json) {
    Json json = LatencyReport::figures(report.total_us());
    json.set("frames", report.total_us().count()).set("transport", scheme(*url));
    json.set("host_transport", scheme(*to_url)).set("pacing", server.pacing);
    json.set("device", server.device).set("scenario", server.scenario);
    json.set("marker", probe.by_picture() ? "picture" : "number");
    json.set("marker_pixels", probe.marker_pixels()).set("missed", probe.missed());
    json.set("disagreed", probe.disagreed()).set("rate_hz", command.rate_hz);
    json.set("tai_offset_unset", server.tai_offset_unset);
    json.set("counters", counters_json(client.counters())).set("stages", report.stages_json());
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  if (report.total_us().empty()) return fail(kExitFailure, "nothing was measured");
  return probe.missed() > 0 ? kExitFailure : kExitOk;
}

void add_options(CommandLine& line, LatencyOptions& options) {
  line.footer(
      "Takes the host's place: a run of its own begins. The marker: --entity is switched on and "
      "off and found\nin the pictures by itself; the canned test pattern has a marker of its "
      "own; otherwise a frame shows\na pose when it carries its number. Delays across machines "
      "hold as far as their clocks agree.\n"
      "Example: emit latency udp://127.0.0.1:7000 --to udp://127.0.0.1:7001 --frames 1000");
  line.option("url", options.url, "Frames: tcp://host:port, udp://host:port or shm://name")
      .required()
      .type_name("URL");
  line.option("--to", options.to,
              "Poses: udp://host:port (host port) or tcp://host:port (control port); "
              "default: TCP to where the frames come from")
      .type_name("URL");
  line.count("--frames", options.frames, "Poses to measure").positive();
  line.option("--rate", options.rate_hz,
              "Poses a second at most, at random distances; the next one waits for the frame "
              "of the last")
      .type_name("HZ")
      .in_range(0.01, 10'000.0)
      .show_default();
  line.option("--entity", options.entity, "Entity of the scenario to switch on and off")
      .type_name("ID");
  line.path("--log", options.log, "Pose log whose first pose is held; default: the daemon's view");
  line.seconds("--time-s", options.time_s, "Simulated time of the first pose").show_default();
  line.seconds("--timeout-s", options.timeout_s, "A pose not shown for this long is missed")
      .positive()
      .show_default();
  line.option("--seed", options.seed, "Of the distances between poses").show_default();
  line.path("--key-file", options.security.key_file,
            "Poses by udp: pre-shared key, as in the daemon's host.key_file");
  add_security(line, options.security);
  add_json(line, options.json);
}

}  // namespace

void add_latency(CommandLine& tool) {
  tool.command<LatencyOptions>(
      {.name = "latency",
       .text =
           "Transport delay end to end: sends poses as the host, switches a marker with each, and "
           "waits for the first frame that shows it; exits 1 when one was never shown",
       .example = "emit latency udp://127.0.0.1:7000 --to udp://127.0.0.1:7001 --frames 1000"},
      add_options, run);
}

}  // namespace emit::tool
