// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "emit/client/client.hpp"
#include "emit/client/security.hpp"

namespace emit::tool {

/// A subscription that can be resumed after the daemon or the network failed. Thread: one owner.
class StreamSubscription {
 public:
  /// Errors: those of FrameClient::connect() and subscribe().
  [[nodiscard]] static physics::Result<StreamSubscription> open(
      const std::string& url, const client::SubscribeOptions& options,
      const client::Security& security = {});

  /// Reconnects after an error of client(): tries every 100 ms while `go_on` returns true. The
  /// channel may be another one then, because the daemon may have started with another scenario.
  /// Errors: that of the last attempt.
  [[nodiscard]] physics::Result<void> reopen(const std::function<bool()>& go_on);

  [[nodiscard]] client::FrameClient& client() noexcept { return *client_; }
  [[nodiscard]] const client::ChannelDescription& channel() const noexcept { return channel_; }
  /// Returns the counters of all connections so far.
  [[nodiscard]] client::ReceiveCounters counters() const noexcept;
  [[nodiscard]] std::uint64_t reconnects() const noexcept { return reconnects_; }

 private:
  StreamSubscription(std::string url, client::SubscribeOptions options, client::Security security)
      : url_(std::move(url)), options_(std::move(options)), security_(std::move(security)) {}
  [[nodiscard]] physics::Result<void> connect(std::int64_t timeout_ns);

  std::string url_;
  client::SubscribeOptions options_;
  client::Security security_;
  std::unique_ptr<client::FrameClient> client_;
  client::ChannelDescription channel_;
  client::ReceiveCounters before_;  // of the connections before this one
  std::uint64_t reconnects_ = 0;
};

}  // namespace emit::tool
