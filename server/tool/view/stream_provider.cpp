// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <atomic>
#include <optional>
#include <thread>

#include "emit/client/client.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/view/frame_provider.hpp"

namespace emit::tool::view {
namespace {

class StreamProvider final : public FrameProvider {
 public:
  StreamProvider(std::unique_ptr<client::FrameClient> client, client::ChannelDescription channel)
      : client_(std::move(client)), channel_(std::move(channel)) {
    // Canned streams may name no band. They have a radiance alone.
    constexpr auto kRadiance = protocol::PixelQuantity::radiance_w_m2_sr;
    const bool radiance = channel_.quantity.value_or(kRadiance) == kRadiance;
    if (const auto band = channel_.spectral_band(); band && radiance) {
      apparent_.emplace(*band);
      fmt::print(stderr, "emit: apparent temperature, {}\n",
                 conversion_text(*band, channel_.response.has_value()));
    }
    thread_ = std::thread([this] { run(); });
  }
  ~StreamProvider() override {
    stop_.store(true);
    thread_.join();
  }

  bool take(ViewFrame& frame) override { return slot_.take(frame); }
  void control(const ViewControl&) override {}
  std::optional<ViewEnd> ended() override { return slot_.ended(); }
  std::string title() const override {
    return fmt::format("{} {} {}", client_->server().scenario, channel_.kind, channel_.sensor);
  }
  std::string band() const override { return channel_.band; }
  void limits(double& min_k, double& max_k) const override {
    min_k = 280.0;
    max_k = 330.0;
  }

 private:
  void run() {
    ViewFrame frame;
    while (!stop_.load()) {
      const auto received = client_->receive(100'000'000);
      if (!received) {
        slot_.end(received.error().text, false);
        return;
      }
      if (*received == nullptr) continue;
      const client::ReceivedFrame& newest = **received;
      const protocol::FrameHeader& header = newest.header;
      const std::span<const float> pixels = newest.pixels;
      frame.width_px = header.width_px;
      frame.height_px = header.height_px;
      frame.radiance_w_m2_sr.assign(pixels.begin(), pixels.end());
      const bool radiance = header.quantity == protocol::PixelQuantity::radiance_w_m2_sr;
      frame.unit = radiance ? std::string_view() : pixel_unit(header.quantity);
      if (apparent_ && radiance) frame.temperature_k = apparent_->kelvin(pixels);
      frame.apparent_temperature = true;
      frame.frame_number = header.frame_number;
      frame.sim_time_ns = header.sim_time_ns;
      frame.flags = header.flags;
      frame.frame_ms =
          header.host_received_ns > 0
              ? 1e-6 * static_cast<double>(newest.last_byte_ns - header.host_received_ns)
              : 1e-6 * static_cast<double>(newest.last_byte_ns - newest.first_byte_ns);
      slot_.put(frame);
    }
  }

  std::unique_ptr<client::FrameClient> client_;
  client::ChannelDescription channel_;
  std::optional<ApparentTemperature> apparent_;
  FrameSlot slot_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace

physics::Result<std::unique_ptr<FrameProvider>> make_stream_provider(const SourceOptions& source) {
  auto client =
      client::FrameClient::connect(source.source, client::kConnectTimeoutNs, source.security);
  if (!client) return tl::unexpected(client.error());
  client::SubscribeOptions options;
  options.channel_name = source.channel_name;
  options.channel_kind = source.channel_kind;
  options.band = source.band;
  auto channel = (*client)->subscribe(options);
  if (!channel) return tl::unexpected(channel.error());
  if (const std::string advice = (*client)->receive_buffer_advice(); !advice.empty()) warn(advice);
  return std::unique_ptr<FrameProvider>(
      std::make_unique<StreamProvider>(std::move(*client), std::move(*channel)));
}

}  // namespace emit::tool::view
