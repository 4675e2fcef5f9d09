// SPDX-License-Identifier: Apache-2.0
#include "bench/stream/stream_loss.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "agents/frame_source.hpp"
#include "bench/stream/stream_throughput.hpp"
#include "client/fault_relay.hpp"
#include "tool/streams/error_correction.hpp"
#include "tool/streams/stream_report.hpp"
#include "tool/support/console.hpp"
#include "tool/support/daemon_process.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

using Clock = std::chrono::steady_clock;

/// Client that receives on a thread of its own and checks every pixel.
class LossClient {
 public:
  LossClient(client::FrameClient& client, std::vector<std::vector<float>> images)
      : client_(client), images_(std::move(images)), thread_([this] { run(); }) {}
  ~LossClient() { stop(); }
  LossClient(const LossClient&) = delete;
  LossClient& operator=(const LossClient&) = delete;

  void stop() {
    stop_.store(true);
    if (thread_.joinable()) thread_.join();
  }
  /// Waits for a frame of this host frame or a later one.
  bool wait_for(std::uint64_t host_frame, std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    arrived_.wait_for(lock, timeout, [&] { return newest_ >= host_frame || ended_; });
    return newest_ >= host_frame;
  }

  // Valid after stop().
  LossyStream::Result counted;
  StreamReport report;
  std::uint64_t frames = 0;

 private:
  void run() {
    constexpr std::int64_t kPollNs = 20'000'000;
    while (!stop_.load()) {
      const auto received = client_.receive(kPollNs);
      if (received && *received == nullptr) continue;
      if (received) judge(**received);
      const std::lock_guard lock(mutex_);
      if (!received) {
        ended_ = true;
        arrived_.notify_all();
        return;
      }
      newest_ = std::max(newest_, (*received)->header.host_frame_number);
      arrived_.notify_all();
    }
  }

  void judge(const client::ReceivedFrame& frame) {
    ++frames;
    const bool partial = (frame.header.flags & protocol::kFlagPartial) != 0;
    const bool corrupt = (frame.header.flags & protocol::kFlagCorrupt) != 0;
    if (frame.header_known) report.add(frame);
    counted.corrupt += corrupt ? 1 : 0;
    counted.whole += partial || corrupt ? 0 : 1;
    counted.unflagged += (frame.missing_px > 0) != partial ? 1 : 0;
    if (corrupt) return;
    if (frame.header_known) {
      const std::size_t shown = (frame.header.frame_number + images_.size() - 1) % images_.size();
      counted.wrong_px += wrong_px(frame, partial, images_[shown]);
      return;
    }
    // A frame without its number may be any of the images, so the closest one counts.
    std::uint64_t least = ~std::uint64_t{0};
    for (const auto& image : images_) least = std::min(least, wrong_px(frame, partial, image));
    counted.wrong_px += least;
  }

  static std::uint64_t wrong_px(const client::ReceivedFrame& frame, bool partial,
                                const std::vector<float>& image) {
    if (frame.pixels.size() != image.size()) return std::max(frame.pixels.size(), image.size());
    if (!partial &&
        std::memcmp(frame.pixels.data(), image.data(), frame.pixels.size_bytes()) == 0) {
      return 0;
    }
    std::uint64_t wrong = 0;
    for (std::size_t i = 0; i < image.size(); ++i) {
      const bool valid = !partial || frame.validity.pixel(i);
      wrong += frame.pixels[i] != (valid ? image[i] : 0.0F) ? 1U : 0U;
    }
    return wrong;
  }

  client::FrameClient& client_;
  std::vector<std::vector<float>> images_;
  std::atomic<bool> stop_{false};
  std::mutex mutex_;
  std::condition_variable arrived_;
  std::uint64_t newest_ = 0;
  bool ended_ = false;
  std::thread thread_;  // last: it uses the others
};

}  // namespace

physics::Result<LossyStream::Result> LossyStream::measure(const Options& options,
                                                          const std::filesystem::path& directory) {
  config::DaemonConfig config = canned_daemon(options.width_px, options.height_px, "");
  config.stream.fec_max_parity_frac = protocol::kMaxFecParity;
  // The queue is longer than the frames under way here, so that requested fragments are still
  // available.
  config.stream.queue_frames = 8;
  auto daemon = DaemonProcess::start(config, {}, directory, std::chrono::seconds(60));
  if (!daemon) return tl::unexpected(daemon.error());
  auto host = client::HostClient::connect("udp://" + daemon->host_udp_address());
  if (!host) return tl::unexpected(host.error());
  auto relay = client::FaultRelay::start(options.faults);
  if (!relay) return tl::unexpected(relay.error());
  auto client = client::FrameClient::connect("udp://" + daemon->control_address());
  if (!client) return tl::unexpected(client.error());
  client::SubscribeOptions subscription;
  subscription.fragment_payload_bytes = options.payload_bytes;
  subscription.announced_udp_port = (*relay)->port();
  subscription.fec = options.fec;
  subscription.resend = options.resend;
  const auto channel = (*client)->subscribe(subscription);
  if (!channel) return tl::unexpected(channel.error());
  if ((*client)->terms().fec != options.fec || (*client)->terms().resend != options.resend) {
    return physics::make_error(physics::ErrorCode::protocol, "the daemon granted other terms");
  }
  (*relay)->forward_to((*client)->terms().udp_port);
  if (const std::string advice = (*client)->receive_buffer_advice(); !advice.empty()) warn(advice);

  LossClient receiver(**client, server::canned_pattern(config.source));
  // A partial frame is delivered when the second frame after it begins.
  constexpr std::uint64_t kWindow = 4;
  // A frame may be lost altogether, but frames must not pile up where the machine is slow.
  constexpr auto kPatience = std::chrono::seconds(2);
  const double cpu_before_s = daemon->cpu_seconds();
  const auto start = Clock::now();
  Progress progress("lossy frames", options.frames);
  for (std::uint64_t number = 1; number <= options.frames; ++number) {
    if (number > kWindow) static_cast<void>(receiver.wait_for(number - kWindow, kPatience));
    protocol::HostFrameData frame;
    frame.run_id = 1;
    frame.frame_number = number;
    frame.sim_time_ns = static_cast<std::int64_t>(number) * 1'000'000;
    if (auto sent = (*host)->send(frame); !sent) return tl::unexpected(sent.error());
    progress.advance_to(number);
  }
  static_cast<void>(receiver.wait_for(options.frames, kPatience));
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  progress.finish();
  receiver.stop();
  (*relay)->stop();

  Result result = std::move(receiver.counted);
  result.device = (*client)->server().device;
  result.frames = options.frames;
  result.lost = options.frames - std::min(options.frames, receiver.frames);
  result.late = receiver.report.flagged(protocol::kFlagLate);
  result.counters = (*client)->counters();
  result.network = (*relay)->counts();
  result.relay_drops = (*relay)->own_losses();
  result.seconds = seconds;
  result.cpu_s = daemon->cpu_seconds() - cpu_before_s;
  result.ready_to_received_ms = receiver.report.ready_to_received_ms();
  client->reset();
  if (auto stopped = daemon->stop(std::chrono::seconds(20)); !stopped) {
    return tl::unexpected(stopped.error());
  }
  if (receiver.frames == 0) return physics::make_error(physics::ErrorCode::io, "no frame came");
  return result;
}

Json loss_json(const LossyStream::Options& options, const LossyStream::Result& result) {
  const auto frames = static_cast<double>(result.frames);
  const auto taken = static_cast<double>(std::max<std::uint64_t>(result.network.taken, 1));
  Json json = Json::object();
  json.set("loss_frac", options.faults.loss_frac).set("burst", options.faults.burst_mean);
  json.set("seed", options.faults.seed).set("payload_bytes", options.payload_bytes);
  json.set("fec", to_string(options.fec)).set("resend", options.resend);
  json.set("whole_frac", static_cast<double>(result.whole) / frames);
  json.set("repaired", result.counters.repaired);
  json.set("repaired_frames", result.counters.repaired_frames);
  json.set("unrepairable_groups", result.counters.unrepairable);
  json.set("resent", result.counters.resent);
  json.set("resend_requests", result.counters.resend_requests);
  json.set("partial", result.counters.partial).set("corrupt", result.corrupt);
  json.set("unflagged", result.unflagged).set("wrong_px", result.wrong_px);
  json.set("datagrams", result.network.taken).set("datagrams_lost", result.network.lost);
  json.set("lost_frac_drawn", static_cast<double>(result.network.lost) / taken);
  json.set("relay_drops", result.relay_drops).set("os_drops", result.counters.os_drops);
  json.set("delay", "pixels ready in the daemon to last byte at the client, relay included");
  return json;
}

}  // namespace emit::tool
