// SPDX-License-Identifier: Apache-2.0
#include "bench/stream/stream_throughput.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>

#include "tool/streams/stream_client.hpp"
#include "tool/support/subprocess.hpp"

namespace emit::tool {

using physics::Result;

config::DaemonConfig canned_daemon(std::uint32_t width_px, std::uint32_t height_px,
                                   const std::string& shm) {
  config::DaemonConfig daemon;
  daemon.source.kind = config::SourceKind::canned;
  daemon.source.canned_width_px = width_px;
  daemon.source.canned_height_px = height_px;
  daemon.host.udp = "127.0.0.1:0";
  daemon.control.tcp = "127.0.0.1:0";
  daemon.stream.shm = shm;
  return daemon;
}

std::string own_shm_name() {
  static std::atomic<int> count{0};
  return fmt::format("bench-{}-{}", ::getpid(), count++);
}

Result<client::Security> make_certificate(const std::filesystem::path& directory) {
  client::Security out;
  out.tls_certificate = out.tls_ca = directory / "bench.pem";
  out.tls_key = directory / "bench.key";
  auto openssl =
      Subprocess::start({"/usr/bin/env", "openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt",
                         "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2", "-subj",
                         "/CN=emit bench", "-addext", "subjectAltName=IP:127.0.0.1", "-keyout",
                         out.tls_key.string(), "-out", out.tls_certificate.string()},
                        directory / "openssl.log");
  if (!openssl) return tl::unexpected(openssl.error());
  const auto status = openssl->wait(std::chrono::seconds(30));
  constexpr int kNotFound = 127;  // of env
  if (status == kNotFound) {
    return physics::make_error(physics::ErrorCode::not_found, "openssl is not installed");
  }
  if (status != 0) {
    return physics::make_error(physics::ErrorCode::io, "openssl made no certificate");
  }
  return out;
}

Result<StreamThroughput> StreamThroughput::start(const config::DaemonConfig& config,
                                                 const std::filesystem::path& directory,
                                                 const client::Security& security) {
  auto daemon = DaemonProcess::start(config, {}, directory, std::chrono::seconds(60));
  if (!daemon) return tl::unexpected(daemon.error());
  client::Security of_host = security;
  of_host.control = "tcp://" + daemon->control_address();
  auto host = client::HostClient::connect("udp://" + daemon->host_udp_address(),
                                          client::kConnectTimeoutNs, of_host);
  if (!host) return tl::unexpected(host.error());
  return StreamThroughput(std::move(*daemon), std::move(*host), config.stream.shm, security);
}

Result<YardstickResult> StreamThroughput::measure(const std::string& scheme, std::uint64_t frames,
                                                  std::uint32_t window) {
  std::mutex mutex;  // of what follows: asked for by this thread and by the client's
  bool measuring = false;
  std::uint64_t asked = 0;
  std::uint64_t before = 0;  // frames taken when the measurement began
  std::uint64_t taken = 0;   // since
  Result<void> sent;
  const auto ask = [&] {
    protocol::HostFrameData frame;
    frame.run_id = 1;
    frame.frame_number = ++last_host_frame_;
    frame.sim_time_ns = static_cast<std::int64_t>(last_host_frame_) * 1'000'000;
    ++asked;
    if (auto result = host_->send(frame); !result) sent = std::move(result);
  };
  // Frames are requested by half a window. The yardsticks need no requests, and the cost of a
  // request, a wake-up at every stage, is not part of a transport.
  const std::uint64_t at_once = std::max(window / 2, 1U);
  const auto ask_ahead = [&] {
    if (asked > 0 && asked + at_once > taken + window) return;
    while (sent && asked < std::min(frames, taken + window)) ask();
  };
  StreamClient::Options options;
  options.url = (scheme == "tls" ? "tcp" : scheme) + "://" +
                (scheme == "shm" ? shm_ : daemon_.control_address());
  options.security = security_;
  options.subscribe.in_place = true;
  // The next frames are requested on the thread that takes them, because another thread in between
  // is not part of a stream.
  options.on_frame = [&](std::uint64_t count) {
    const std::lock_guard lock(mutex);
    if (!measuring || count <= before) return;
    taken = count - before;
    ask_ahead();
  };
  auto client = StreamClient::start(options);
  if (!client) return tl::unexpected(client.error());
  device_ = (*client)->server().device;
  // The first frame shows that the subscription has reached the sender.
  do {
    const std::lock_guard lock(mutex);
    ask();
    constexpr std::uint64_t kPatience = 100;
    if (asked > kPatience) return physics::make_error(physics::ErrorCode::io, "no frame came");
    if (!sent) return tl::unexpected(sent.error());
  } while (!(*client)->wait_for_frames(1, std::chrono::milliseconds(50)));
  constexpr auto kTimeout = std::chrono::seconds(20);
  YardstickResult result;
  const double cpu_before_s = daemon_.cpu_seconds() + process_cpu_s();
  const auto start = std::chrono::steady_clock::now();
  {
    const std::lock_guard lock(mutex);
    before = (*client)->frames();
    measuring = true;
    asked = 0;
    ask_ahead();
  }
  bool complete = false;
  for (std::uint64_t seen = before, last = 0; !complete && seen != last;) {
    last = seen;
    complete = (*client)->wait_for_frames(before + frames, kTimeout);
    seen = (*client)->frames();
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  result.cpu_s = daemon_.cpu_seconds() + process_cpu_s() - cpu_before_s;
  (*client)->stop();
  const auto& counters = (*client)->counters();
  result.frames = (*client)->frames() - before;
  result.lost = counters.lost + counters.skipped + counters.partial + counters.crc_errors;
  if (!complete) {
    return physics::make_error(physics::ErrorCode::io,
                               fmt::format("{}: {} of {} frames came. {}", scheme, result.frames,
                                           frames, sent ? (*client)->error() : sent.error().text));
  }
  return result;
}

Result<void> StreamThroughput::stop() {
  return daemon_.stop(std::chrono::seconds(20));
}

}  // namespace emit::tool
