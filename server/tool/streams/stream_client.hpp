// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "emit/client/client.hpp"
#include "emit/physics/error.hpp"
#include "emit/protocol/frame_header.hpp"
#include "tool/streams/stream_report.hpp"

namespace emit::tool {

/// A subscribed client that receives on a thread of its own, for `demo` and `bench stream`. Only
/// the thread that made it calls its member functions.
class StreamClient {
 public:
  struct Options {
    std::string url;
    client::SubscribeOptions subscribe;
    client::Security security;
    bool keep_pixels = false;  ///< keep those of the newest frame, for last_frame()
    /// Called on the client's thread after each frame, with the number of frames so far.
    std::function<void(std::uint64_t)> on_frame;
  };
  [[nodiscard]] static physics::Result<std::unique_ptr<StreamClient>> start(const Options& options);
  ~StreamClient();
  StreamClient(const StreamClient&) = delete;
  StreamClient& operator=(const StreamClient&) = delete;

  /// Waits for a frame made from this host frame or a later one. False: timeout or stream ended.
  [[nodiscard]] bool wait_for_host_frame(std::uint64_t host_frame_number,
                                         std::chrono::milliseconds timeout);
  /// Waits until this many frames have come. False: timeout or stream ended.
  [[nodiscard]] bool wait_for_frames(std::uint64_t frames, std::chrono::milliseconds timeout);

  /// Returns the number of frames that have come so far.
  [[nodiscard]] std::uint64_t frames();

  struct Snapshot {
    protocol::FrameHeader header;
    std::vector<float> pixels;
  };
  /// Returns the newest frame; header.width_px is 0 before the first.
  [[nodiscard]] Snapshot last_frame();

  /// Stops or resumes reading from the socket, as a client does that stands still.
  void pause(bool paused) noexcept { paused_.store(paused); }
  /// Ends the thread. The reports below are complete after it.
  void stop();

  [[nodiscard]] const client::ChannelDescription& channel() const noexcept { return channel_; }
  [[nodiscard]] const client::ServerInfo& server() const noexcept { return client_->server(); }
  [[nodiscard]] std::string advice() const { return client_->receive_buffer_advice(); }
  [[nodiscard]] const StreamReport& report() const noexcept { return report_; }
  [[nodiscard]] const client::ReceiveCounters& counters() const noexcept {
    return client_->counters();
  }
  /// CRC of the pixels by frame number: computed here when pixels are kept, else taken from the
  /// header.
  [[nodiscard]] const std::map<std::uint64_t, std::uint32_t>& crcs() const noexcept {
    return crcs_;
  }
  /// Returns the reason why the stream ended; empty while it has not ended.
  [[nodiscard]] std::string error();

 private:
  StreamClient(std::unique_ptr<client::FrameClient> client, client::ChannelDescription channel,
               const Options& options);
  void run();

  std::unique_ptr<client::FrameClient> client_;
  client::ChannelDescription channel_;
  bool keep_pixels_;
  std::function<void(std::uint64_t)> on_frame_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> paused_{false};

  std::mutex mutex_;
  std::condition_variable arrived_;
  Snapshot last_;
  std::uint64_t count_ = 0;
  std::uint64_t wanted_ = 0;  // who waits is not woken before as many have come
  bool ended_ = false;
  std::string error_;

  // The thread owns these until stop().
  StreamReport report_;
  std::map<std::uint64_t, std::uint32_t> crcs_;
  std::thread thread_;
};

}  // namespace emit::tool
