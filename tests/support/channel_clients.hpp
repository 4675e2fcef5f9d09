// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <memory>
#include <utility>
#include <vector>

#include "agents/sender/sender.hpp"
#include "agents/sender/socket_client.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/protocol/pixel_codec.hpp"
#include "rt/fd.hpp"
#include "support/fake_clock.hpp"
#include "support/scripted_source.hpp"

namespace emit::test {

inline constexpr std::uint32_t kWidthPx = 8;  // of the rig's source
inline constexpr std::uint32_t kHeightPx = 4;

/// Channels: a whole field of view at a quarter of the rate, and two windows of it.
inline scene::ScenarioDesc seeker_channels() {
  scene::ScenarioDesc scenario;
  scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  using enum scene::ChannelKind;
  scenario.channels = {{"field", injection, "8-12", {}, 4},
                       {"gate", injection, "8-12", {2, 1, 3, 2}, 1},
                       {"lines", projector, "8-12", {0, 2, kWidthPx, 2}, 2}};
  return scenario;
}

inline server::ChannelTable table_of(const scene::ScenarioDesc& scenario, std::uint32_t slots = 7) {
  server::SourceInfo info;
  info.width_px = kWidthPx;
  info.height_px = kHeightPx;
  info.planes = 1;
  info.slots = slots;
  auto table = server::make_channels(scenario, info);
  EXPECT_TRUE(table.has_value()) << table.error().text;
  return std::move(*table);
}

/// Sender with TCP clients over socket pairs; the test publishes.
class ChannelClients {
 public:
  explicit ChannelClients(const scene::ScenarioDesc& scenario = seeker_channels())
      : context_(clock_, 1u << 16, 8), sender_(context_, 4, 8, true) {
    auto table = table_of(scenario);
    context_.channels = std::move(table.channels);
    context_.pictures = std::move(table.pictures);
    EXPECT_TRUE(sender_.on_start());
  }
  ~ChannelClients() { sender_.on_stop(); }

  struct Peer {
    server::TcpSocket near;
    server::Fd far;
    std::unique_ptr<server::SocketClient> client;
    protocol::RecordParser parser{{1u << 16, 4096}};
    std::vector<std::uint64_t> numbers;
    std::vector<std::uint64_t> gaps;     ///< numbers of frames with kFlagGapBefore
    std::vector<std::uint64_t> encoded;  ///< numbers of frames that came so
    std::vector<std::byte> pixels;       ///< of the newest, decoded
    protocol::FrameHeader header;        ///< likewise
  };
  Peer& connect(std::size_t channel, std::uint32_t every_nth = 1, bool compression = false) {
    Peer& peer = *peers_.emplace_back(std::make_unique<Peer>());
    int pair[2] = {-1, -1};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair), 0);
    peer.far = server::Fd(pair[1]);
    peer.near = std::move(*server::TcpSocket::adopt(sockets_, pair[0]));
    server::SocketClient::Params params;
    params.connection = static_cast<std::uint32_t>(peers_.size());
    params.channel = &context_.channels[channel];
    params.every_nth = every_nth;
    params.compression = compression;
    params.tcp_socket = &peer.near;
    peer.client = std::make_unique<server::SocketClient>(std::move(params));
    EXPECT_TRUE(context_.to_sender.push(
        {server::ClientCommand::Kind::add, peer.client->connection(), peer.client.get()}));
    sender_.do_work(clock_.tai_ns());
    return peer;
  }
  void add(server::SenderClient& client) {
    EXPECT_TRUE(
        context_.to_sender.push({server::ClientCommand::Kind::add, client.connection(), &client}));
    sender_.do_work(clock_.tai_ns());
  }
  /// Publishes a frame. `channels` have pixels in it. With `repeat` the previous image is shown
  /// again, as far as it has their pixels.
  void publish(server::ChannelSet channels, bool repeat = false, server::PublishFrame frame = {}) {
    frame.repeat = repeat;
    frame.image.source = &source_;
    frame.image.channels = channels;
    for (std::size_t i = 0; i < context_.pictures.size(); ++i) {
      frame.image.pictures[i] =
          std::span<const float>(pixels_).first(context_.pictures[i].pixels());
      frame.image.crc32c[i] = protocol::crc32c(std::as_bytes(frame.image.pictures[i]));
    }
    frame.header.frame_number = ++number_;
    EXPECT_TRUE(context_.published.push(frame));
  }
  void settle() {
    while (turn() > 0) {
    }
  }
  int turn() {
    const int work = sender_.do_work(clock_.tai_ns());
    read();
    return work;
  }
  /// Publishes every frame that is due, as the conductor does.
  void publish_due() {
    publish(server::due_channels(context_.channels, number_ + 1));
    settle();
  }
  std::vector<float>& pixels() { return pixels_; }
  server::Sender& sender() { return sender_; }
  server::Context& context() { return context_; }

 private:
  void read() {
    for (auto& peer : peers_) {
      for (;;) {
        const auto space = peer->parser.writable();
        const ssize_t got = ::recv(peer->far.get(), space.data(), space.size(), MSG_DONTWAIT);
        if (got <= 0) break;
        peer->parser.commit(static_cast<std::size_t>(got));
        protocol::Record record;
        while (peer->parser.next(record) == protocol::ParseStatus::record) {
          const auto view = protocol::decode_frame_record(record.body);
          ASSERT_TRUE(view.has_value()) << view.error().text;
          peer->numbers.push_back(view->header.frame_number);
          peer->header = view->header;
          peer->pixels.assign(view->pixels.begin(), view->pixels.end());
          if (view->header.encoding != protocol::PixelEncoding::raw) {
            peer->encoded.push_back(view->header.frame_number);
            peer->pixels.resize(view->header.payload_bytes);
            ASSERT_TRUE(protocol::PixelDecoder().decode(view->pixels, peer->pixels));
          }
          EXPECT_EQ(protocol::crc32c(peer->pixels), view->header.payload_crc32c);
          if ((view->header.flags & protocol::kFlagGapBefore) != 0) {
            peer->gaps.push_back(view->header.frame_number);
          }
        }
      }
    }
  }

  FakeClock clock_;
  SourceScript script_;
  ScriptedSource source_{script_, kWidthPx, kHeightPx, 7};
  server::SocketContext sockets_;
  server::Context context_;
  std::vector<std::unique_ptr<Peer>> peers_;
  server::Sender sender_;
  std::vector<float> pixels_ = std::vector<float>(kWidthPx * kHeightPx, 1.0F);
  std::uint64_t number_ = 0;
};

}  // namespace emit::test
