// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <memory>
#include <vector>

#include "agents/sender.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/protocol/reassembler.hpp"
#include "io/socket.hpp"
#include "rt/fd.hpp"
#include "support/fake_clock.hpp"
#include "support/scripted_source.hpp"

namespace emit::server {
namespace {

constexpr std::uint32_t kWidthPx = 256;
constexpr std::uint32_t kHeightPx = 128;
constexpr std::uint32_t kQueue = 4;

/// The sender with clients over socket pairs; the test plays conductor, source and clients.
class Rig {
 public:
  Rig()
      : context_(clock_, 1u << 20, 8),
        source_(script_, kWidthPx, kHeightPx, kQueue + 3),
        sender_(context_, kQueue, 8, false) {
    Channel channel;
    channel.width_px = kWidthPx;
    channel.height_px = kHeightPx;
    context_.channels.push_back(channel);
    EXPECT_TRUE(sender_.on_start());
  }
  ~Rig() { sender_.on_stop(); }

  struct Peer {
    TcpSocket near;
    Fd far;
    std::unique_ptr<SenderClient> client;
    protocol::RecordParser parser{
        {1u << 16,
         static_cast<std::uint32_t>(protocol::kFrameHeaderBytes) + kWidthPx* kHeightPx * 4}};
    std::vector<protocol::FrameHeader> frames;
    std::uint64_t bad_crc = 0;
    std::uint64_t bytes = 0;

    /// Takes what has arrived.
    void read() {
      for (;;) {
        const auto space = parser.writable();
        const ssize_t got = ::recv(far.get(), space.data(), space.size(), MSG_DONTWAIT);
        if (got <= 0) {
          return;
        }
        bytes += static_cast<std::uint64_t>(got);
        parser.commit(static_cast<std::size_t>(got));
        protocol::Record record;
        while (parser.next(record) == protocol::ParseStatus::record) {
          if (record.kind == protocol::RecordKind::frame) {
            const auto view = protocol::decode_frame_record(record.body);
            ASSERT_TRUE(view.has_value()) << view.error().text;
            bad_crc += protocol::payload_crc_matches(*view) ? 0U : 1U;
            frames.push_back(view->header);
          }
        }
      }
    }
  };

  Peer* connect(bool every_frame = false) {
    Peer* peer = peers_.emplace_back(std::make_unique<Peer>()).get();
    int pair[2] = {-1, -1};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair), 0);
    peer->far = Fd(pair[1]);
    auto near = TcpSocket::adopt(sockets_, pair[0]);
    EXPECT_TRUE(near.has_value());
    peer->near = std::move(*near);
    // Less than a frame, so that a client that does not read stops in the middle of one.
    const int send_bytes = 32 << 10;
    EXPECT_EQ(::setsockopt(pair[0], SOL_SOCKET, SO_SNDBUF, &send_bytes, sizeof(send_bytes)), 0);
    SenderClient::Params params;
    params.connection = next_connection_++;
    params.channel = &context_.channels.front();
    params.every_frame = every_frame;
    params.tcp_socket = &peer->near;
    peer->client = std::make_unique<SenderClient>(std::move(params));
    EXPECT_TRUE(context_.to_sender.push(
        {ClientCommand::Kind::add, peer->client->params().connection, peer->client.get()}));
    sender_.do_work(clock_.tai_ns());
    return peer;
  }

  /// False: every slot is held.
  bool publish() {
    renderer::FrameRequest request;
    request.frame_number = ++number_;
    const int slot = source_.submit(request);
    if (slot < 0) {
      return false;
    }
    const auto& view = source_.collect(static_cast<std::uint32_t>(slot));
    PublishFrame frame;
    frame.image.source = &source_;
    frame.image.slot = static_cast<std::uint32_t>(slot);
    frame.image.plane_count = 1;
    frame.image.planes[0] = view.radiance_w_m2_sr[0];
    frame.image.crc32c[0] = protocol::crc32c(std::as_bytes(view.radiance_w_m2_sr[0]));
    frame.header.frame_number = number_;
    EXPECT_TRUE(context_.published.push(frame));
    return true;
  }
  void settle(std::vector<Peer*> readers) {
    for (int turn = 0; turn < 10'000; ++turn) {
      const int work = sender_.do_work(clock_.tai_ns());
      std::uint64_t before = 0;
      std::uint64_t after = 0;
      for (Peer* peer : readers) {
        before += peer->bytes;
        peer->read();
        after += peer->bytes;
      }
      if (work == 0 && before == after) {
        return;
      }
    }
    FAIL() << "never idle";
  }
  Context& context() { return context_; }
  test::SourceScript& script() { return script_; }
  Sender& sender() { return sender_; }

 private:
  test::FakeClock clock_;
  test::SourceScript script_;
  SocketContext sockets_;
  std::vector<std::unique_ptr<Peer>> peers_;
  Context context_;
  test::ScriptedSource source_;
  Sender sender_;
  std::uint32_t next_connection_ = 1;
  std::uint64_t number_ = 0;
};

TEST(Sender, AStoppedClientDelaysNobodyAndItsGapIsFlagged) {
  Rig rig;
  Rig::Peer* good = rig.connect();
  Rig::Peer* stopped = rig.connect();
  for (int i = 0; i < 40; ++i) {
    ASSERT_TRUE(rig.publish()) << "a stopped client must not hold every slot, frame " << i;
    rig.settle({good});
  }
  ASSERT_EQ(good->frames.size(), 40U);
  EXPECT_EQ(good->bad_crc, 0U);
  for (std::size_t i = 0; i < good->frames.size(); ++i) {
    EXPECT_EQ(good->frames[i].frame_number, i + 1);
    EXPECT_EQ(good->frames[i].flags, 0U);
  }

  rig.settle({good, stopped});
  ASSERT_GE(stopped->frames.size(), 2U);
  EXPECT_EQ(stopped->bad_crc, 0U) << "the frame that was half sent is finished from its own copy";
  EXPECT_EQ(stopped->frames.back().frame_number, 40U) << "the newest frames win";
  std::uint64_t expected = 1;
  std::uint64_t missing = 0;
  for (const auto& header : stopped->frames) {
    if (header.frame_number != expected) {
      EXPECT_NE(header.flags & protocol::kFlagGapBefore, 0U) << header.frame_number;
      missing += header.frame_number - expected;
    } else {
      EXPECT_EQ(header.flags & protocol::kFlagGapBefore, 0U) << header.frame_number;
    }
    expected = header.frame_number + 1;
  }
  EXPECT_EQ(rig.context().counters.get(Counter::frames_skipped), missing);
  EXPECT_EQ(rig.script().held.load(), 0) << "slots go back when everybody has the frame";
}

TEST(Sender, DisconnectsAnEveryFrameClientThatFallsBehind) {
  Rig rig;
  Rig::Peer* client = rig.connect(true);
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(rig.publish());
    rig.settle({});
  }
  const auto* released = rig.context().from_sender.front();
  ASSERT_NE(released, nullptr);
  EXPECT_EQ(released->client, client->client.get());
  EXPECT_EQ(rig.context().counters.get(Counter::clients_disconnected_slow), 1U);
  EXPECT_EQ(rig.script().held.load(), 0);
}

TEST(Sender, GivesAClientBackWhenItsSocketFailsOrItIsAskedTo) {
  Rig rig;
  Rig::Peer* gone = rig.connect();
  Rig::Peer* left = rig.connect();
  gone->far.reset();
  ASSERT_TRUE(rig.publish());
  rig.settle({left});
  const auto* released = rig.context().from_sender.front();
  ASSERT_NE(released, nullptr);
  EXPECT_EQ(released->client, gone->client.get());
  rig.context().from_sender.pop();
  ASSERT_TRUE(rig.context().to_sender.push(
      {ClientCommand::Kind::remove, left->client->params().connection, nullptr}));
  rig.settle({});
  released = rig.context().from_sender.front();
  ASSERT_NE(released, nullptr);
  EXPECT_EQ(released->client, left->client.get());
  EXPECT_EQ(left->frames.size(), 1U);
  EXPECT_EQ(rig.script().held.load(), 0);
}

TEST(UdpBatch, DeliversEveryFragmentWithAndWithoutSegmentation) {
  const auto address = numeric_address("127.0.0.1", 0);
  const SocketContext sockets;
  auto receiver = UdpSocket::open_bound(sockets, address);
  ASSERT_TRUE(receiver.has_value());
  EXPECT_GT(receiver->set_receive_buffer(4u << 20), 0U);
  auto sender = UdpSocket::open(sockets, address);
  ASSERT_TRUE(sender.has_value());
  ASSERT_TRUE(sender->connect(receiver->local_address()).has_value());

  std::vector<float> pixels(kWidthPx * kHeightPx);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    pixels[i] = static_cast<float>(i);
  }
  protocol::FrameHeader header;
  header.width_px = kWidthPx;
  header.height_px = kHeightPx;
  header.payload_bytes = pixels.size() * sizeof(float);
  header.payload_crc32c = protocol::crc32c(std::as_bytes(std::span<const float>(pixels)));
  protocol::Reassembler reassembler(
      {static_cast<std::uint32_t>(header.payload_bytes), 4, 2, 2, true});
  UdpBatch batch;
  std::uint32_t id = 0;
  for (const bool segmentation : {true, false}) {
    header.frame_number = ++id;
    std::array<std::byte, protocol::kFrameHeaderBytes> head{};
    protocol::encode(header, head);
    const protocol::Fragmenter fragments({1, id, 0, kWidthPx * 4, 1440}, head,
                                         std::as_bytes(std::span<const float>(pixels)));
    bool use_segmentation = segmentation && udp_segmentation_supported(sender->fd());
    std::array<std::byte, 65536> datagram;
    for (std::uint32_t next = 0; next < fragments.fragment_count();) {
      const auto result = batch.send(sender->fd(), fragments, next, use_segmentation);
      if (result.status == UdpBatch::Status::no_segmentation) {
        use_segmentation = false;
        continue;
      }
      ASSERT_EQ(result.status, UdpBatch::Status::sent) << result.error;
      next += result.fragments;
      for (IoResult got; (got = receiver->receive(datagram)).status == IoStatus::done;) {
        EXPECT_EQ(reassembler.push(std::span(datagram).first(got.bytes)),
                  protocol::FragmentStatus::accepted);
      }
    }
    const auto* frame = reassembler.pop();
    ASSERT_NE(frame, nullptr);
    EXPECT_TRUE(frame->complete);
    EXPECT_TRUE(frame->crc_ok);
    EXPECT_EQ(frame->header.frame_number, id);
    reassembler.release(frame);
  }
}

}  // namespace
}  // namespace emit::server
