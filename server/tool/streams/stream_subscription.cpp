// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/stream_subscription.hpp"

#include <chrono>
#include <thread>
#include <utility>

namespace emit::tool {

using physics::Result;

Result<StreamSubscription> StreamSubscription::open(const std::string& url,
                                                    const client::SubscribeOptions& options,
                                                    const client::Security& security) {
  StreamSubscription out(url, options, security);
  constexpr std::int64_t kTimeoutNs = 5'000'000'000;
  if (auto connected = out.connect(kTimeoutNs); !connected) {
    return tl::unexpected<physics::Error>(std::move(connected.error()));
  }
  return out;
}

Result<void> StreamSubscription::connect(std::int64_t timeout_ns) {
  auto client = client::FrameClient::connect(url_, timeout_ns, security_);
  if (!client) return tl::unexpected<physics::Error>(std::move(client.error()));
  auto channel = (*client)->subscribe(options_);
  if (!channel) return tl::unexpected<physics::Error>(std::move(channel.error()));
  if (client_) before_ += client_->counters();
  client_ = std::move(*client);
  channel_ = std::move(*channel);
  return {};
}

Result<void> StreamSubscription::reopen(const std::function<bool()>& go_on) {
  constexpr std::int64_t kTimeoutNs = 1'000'000'000;
  constexpr auto kPause = std::chrono::milliseconds(100);
  for (;;) {
    auto connected = connect(kTimeoutNs);
    if (connected) {
      ++reconnects_;
      return connected;
    }
    if (!go_on()) return connected;
    std::this_thread::sleep_for(kPause);
  }
}

client::ReceiveCounters StreamSubscription::counters() const noexcept {
  client::ReceiveCounters all = before_;
  all += client_->counters();
  return all;
}

}  // namespace emit::tool
