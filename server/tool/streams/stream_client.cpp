// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/stream_client.hpp"

#include <span>

namespace emit::tool {

physics::Result<std::unique_ptr<StreamClient>> StreamClient::start(const Options& options) {
  auto connected =
      client::FrameClient::connect(options.url, client::kConnectTimeoutNs, options.security);
  if (!connected) return tl::unexpected(connected.error());
  auto channel = (*connected)->subscribe(options.subscribe);
  if (!channel) return tl::unexpected(channel.error());
  std::unique_ptr<StreamClient> client(
      new StreamClient(std::move(*connected), std::move(*channel), options));
  return client;
}

StreamClient::StreamClient(std::unique_ptr<client::FrameClient> client,
                           client::ChannelDescription channel, const Options& options)
    : client_(std::move(client)),
      channel_(std::move(channel)),
      keep_pixels_(options.keep_pixels),
      on_frame_(options.on_frame),
      report_(client_->terms().every_nth) {
  thread_ = std::thread([this] { run(); });
}

StreamClient::~StreamClient() {
  stop();
}

void StreamClient::stop() {
  stop_.store(true);
  if (thread_.joinable()) thread_.join();
}

void StreamClient::run() {
  constexpr std::int64_t kPollNs = 50'000'000;
  while (!stop_.load()) {
    if (paused_.load()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      continue;
    }
    const auto received = client_->receive(kPollNs);
    if (received && *received == nullptr) continue;
    if (received) {
      const client::ReceivedFrame& frame = **received;
      report_.add(frame);
      // The client has checked the header's CRC against the pixels; here they are few enough to
      // trust nothing but the pixels.
      crcs_[frame.header.frame_number] = keep_pixels_
                                             ? protocol::crc32c(std::as_bytes(frame.pixels))
                                             : frame.header.payload_crc32c;
    }
    std::unique_lock lock(mutex_);
    if (!received) {
      ended_ = true;
      error_ = received.error().text;
      arrived_.notify_all();
      return;
    }
    last_.header = (*received)->header;
    if (keep_pixels_) last_.pixels.assign((*received)->pixels.begin(), (*received)->pixels.end());
    ++count_;
    if (count_ >= wanted_) arrived_.notify_all();
    const std::uint64_t count = count_;
    lock.unlock();
    if (on_frame_) on_frame_(count);
  }
}

bool StreamClient::wait_for_host_frame(std::uint64_t host_frame_number,
                                       std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  wanted_ = 0;
  const auto here = [&] {
    return count_ > 0 && last_.header.host_frame_number >= host_frame_number;
  };
  arrived_.wait_for(lock, timeout, [&] { return ended_ || here(); });
  return here();
}

bool StreamClient::wait_for_frames(std::uint64_t frames, std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  wanted_ = frames;
  arrived_.wait_for(lock, timeout, [&] { return ended_ || count_ >= frames; });
  return count_ >= frames;
}

std::uint64_t StreamClient::frames() {
  const std::lock_guard lock(mutex_);
  return count_;
}

StreamClient::Snapshot StreamClient::last_frame() {
  const std::lock_guard lock(mutex_);
  return last_;
}

std::string StreamClient::error() {
  const std::lock_guard lock(mutex_);
  return error_;
}

}  // namespace emit::tool
