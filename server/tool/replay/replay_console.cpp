// SPDX-License-Identifier: Apache-2.0
#include "tool/replay/replay_console.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "app/recording.hpp"
#include "net/ip_address.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"

namespace emit::tool {
namespace {

using physics::Result;
using server::CommandKind;

/// Images a second, as with emitd.
constexpr double kImageRateHz = 10.0;
/// Longest wait before the replay looks whether a page wants an image or the user interrupts.
constexpr std::int64_t kSliceNs = 40'000'000;
/// A frame that stands is handed over again for pages that open, this often.
constexpr std::int64_t kAgainNs = 500'000'000;

std::string_view words_of(CommandKind command) noexcept {
  switch (command) {
    case CommandKind::start:
      return "play";
    case CommandKind::stop:
    case CommandKind::hold:
      return "hold";
    case CommandKind::step:
      return "step";
    case CommandKind::reset:
      break;
  }
  return "begin";
}

}  // namespace

Result<std::unique_ptr<ReplayConsole>> ReplayConsole::create(const ReplayBench& bench,
                                                             const std::filesystem::path& log,
                                                             Options options) {
  const auto where = server::parse_host_port(options.listen);
  if (!where) return tl::unexpected(physics::Error(where.error()).with_context("--console"));
  const auto address = server::resolve(*where, server::Transport::tcp, true);
  if (!address) return tl::unexpected(physics::Error(address.error()).with_context("--console"));
  if (!server::ip_of(*address).is_loopback()) {
    return physics::make_error(
        physics::ErrorCode::invalid_argument,
        fmt::format("--console: {}: other hosts may reach it: take 127.0.0.1, and ssh -L from "
                    "another host",
                    server::to_string(*address)));
  }
  return std::unique_ptr<ReplayConsole>(
      new ReplayConsole(bench, log, *address, std::move(options)));
}

ReplayConsole::ReplayConsole(const ReplayBench& bench, std::filesystem::path log,
                             server::SocketAddress address, Options options)
    : bench_(bench), log_(std::move(log)), address_(address), options_(std::move(options)) {}

ReplayConsole::~ReplayConsole() = default;

void ReplayConsole::attach(ReplayHooks& hooks) {
  hooks.on_plan = [this](std::size_t first_run, std::size_t last_run) {
    return open(first_run, last_run);
  };
  hooks.on_start = [this](server::JournalPlayer& player) { journal_ = &player; };
  hooks.order = [this](std::uint64_t frame) { return order_of(frame); };
  hooks.at_end = [this](std::uint64_t frames) { return order_of(frames); };
  hooks.on_frame = [this, also = std::move(hooks.on_frame)](const server::ReplayedFrame& frame,
                                                            std::uint64_t pass) -> Result<void> {
    take_frame(frame);
    return also ? also(frame, pass) : Result<void>();
  };
}

Result<void> ReplayConsole::open(std::size_t first_run, std::size_t last_run) {
  auto timeline = RecordingTimeline::read(log_, first_run, last_run);
  if (!timeline) return tl::unexpected(timeline.error());
  timeline_ = std::move(*timeline);
  auto channels = server::make_channels(bench_.scenario, bench_.expected);
  if (!channels) return tl::unexpected(channels.error());
  context_.channels = std::move(channels->channels);
  player_.emplace(timeline_, options_.rate, true);
  facts_.software = server::build_text("emit");
  facts_.scenario = options_.scenario;
  facts_.pacing = "replay of " + log_.filename().string();
  facts_.image_rate_hz = kImageRateHz;
  facts_.no_explanation = "emit explain --run explains the pixels of a recorded run";
  facts_.recording = timeline_.json();
  opened_ns_ = clock_.monotonic_ns();
  tap_ = std::make_unique<server::ConsoleTap>(context_);
  auto started =
      server::ConsoleServer::start(address_, context_, *tap_, answers(), {kImageRateHz, {}});
  if (!started) return tl::unexpected(physics::Error(started.error()).with_context("--console"));
  server_ = std::move(*started);
  fmt::print(stderr, "emit: console=http://{}/\n", server::to_string(server_->address()));
  return {};
}

server::ConsoleServer::Answers ReplayConsole::answers() {
  server::ConsoleServer::Answers answers;
  answers.admits = [](const server::SocketAddress& peer) {
    return server::ip_of(peer).is_loopback();
  };
  answers.hello = [this](bool) { return server::console_hello(facts_, context_, true); };
  answers.status = [this](std::size_t pages) { return status(pages); };
  answers.temperatures = [this](std::size_t channel) {
    return server::console_temperatures(context_.channels[channel]);
  };
  answers.command = [this](CommandKind command, bool, std::uint32_t page) {
    return take_command(command, page);
  };
  answers.explain = [this](const server::ExplainRequest&) { return facts_.no_explanation; };
  answers.explained = [] { return std::optional<server::Explained>(); };
  answers.replay = [this](std::string_view words) { return take(words); };
  return answers;
}

server::ConsoleServer::Answers::Replayed ReplayConsole::take(std::string_view words) {
  ReplayPlayer::Answer answer;
  {
    const std::scoped_lock lock(mutex_);
    answer = player_->take(words);
    ++words_;
  }
  word_came_.notify_all();
  fmt::print(stderr, "emit: console: {}: {}{}\n", words, answer.ok ? "" : "refused: ", answer.text);
  return {answer.ok, std::move(answer.text)};
}

std::string ReplayConsole::take_command(CommandKind command, std::uint32_t page) {
  const auto answer = take(words_of(command));
  if (!answer.ok) return answer.text;
  server::StatusReply reply;
  reply.origin.kind = server::Origin::Kind::console;
  reply.origin.connection = page;
  reply.detail = static_cast<std::uint64_t>(command);
  // The page misses an answer that there is no room for; the state tells it the same.
  static_cast<void>(context_.console_replies.push(reply));
  context_.bells.console.ring();
  return {};
}

std::string ReplayConsole::status(std::size_t pages) {
  std::string replay;
  {
    const std::scoped_lock lock(mutex_);
    replay = player_->json(reached_);
    context_.run.held.store(!player_->playing(), std::memory_order_relaxed);
  }
  return server::console_status(context_, *tap_, board_, no_agents_,
                                {true, clock_.monotonic_ns() - opened_ns_, pages, replay});
}

ReplayOrder ReplayConsole::order_of(std::uint64_t frame) {
  using Kind = ReplayPlayer::Order::Kind;
  while (!InterruptGuard::interrupted()) {
    hand_over();
    const std::int64_t now_ns = clock_.monotonic_ns();
    std::unique_lock lock(mutex_);
    reached_ = frame;
    const ReplayPlayer::Order order = player_->next(frame, now_ns);
    switch (order.kind) {
      case Kind::show:
        showing_ = frame;
        render_start_ns_ = clock_.tai_ns();
        return ReplayOrder::show;
      case Kind::pass:
        return ReplayOrder::pass;
      case Kind::anew:
        return ReplayOrder::anew;
      case Kind::wait:
        break;
    }
    const std::int64_t wait_ns =
        std::min(order.at_ns.value_or(now_ns + kSliceNs) - now_ns, kSliceNs);
    word_came_.wait_for(lock, std::chrono::nanoseconds(wait_ns),
                        [this, before = words_] { return words_ != before; });
  }
  return ReplayOrder::end;
}

void ReplayConsole::take_frame(const server::ReplayedFrame& frame) {
  header_ = {};
  header_.run_id = frame.run_id;
  header_.frame_number = frame.frame_number;
  header_.host_frame_number = frame.host_frame_number;
  header_.sim_time_ns = frame.sim_time_ns;
  header_.pose_sim_time_ns = frame.pose_sim_time_ns;
  header_.flags = frame.flags;
  header_.render_start_ns = render_start_ns_;
  header_.readback_end_ns = clock_.tai_ns();
  context_.run_id.store(frame.run_id, std::memory_order_relaxed);
  tap_->see(header_);
  {
    const std::scoped_lock lock(mutex_);
    player_->shown(showing_);
  }
  ++since_hand_over_;
  hand_over();
}

void ReplayConsole::hand_over() {
  if (header_.frame_number == 0 || journal_ == nullptr) return;
  const std::int64_t now_ns = clock_.monotonic_ns();
  if (since_hand_over_ == 0 && now_ns - handed_over_ns_ < kAgainNs) return;
  for (const server::Channel& channel : context_.channels) {
    if (!tap_->wants(header_, server::ChannelSet{1} << channel.index)) continue;
    const auto shown = journal_->shown_by(channel.index);
    if (shown.view == nullptr) return;
    protocol::FrameHeader header = header_;
    header.quality_rung = shown.view->quality_level;
    header.estimated_error_k = shown.view->estimated_error_k;
    header.nonfinite_px = shown.view->stats.nonfinite_px;
    header.clamped_px = shown.view->stats.clamped_px;
    header.pose = shown.view->sensor_pose;
    header.fov_h_rad = static_cast<float>(shown.view->fov_h_rad);
    server::Image image;
    image.pictures[channel.picture] = shown.pixels;
    image.crc32c[channel.picture] = protocol::crc32c(std::as_bytes(shown.pixels));
    tap_->begin(header, image, clock_.tai_ns());
    tap_->spill();
    static_cast<void>(tap_->send(no_batch_, context_, server::SenderClient::Turn::full));
    tap_->complete(clock_.tai_ns());
    since_hand_over_ = 0;
    handed_over_ns_ = now_ns;
    return;
  }
}

}  // namespace emit::tool
