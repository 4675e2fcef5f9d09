// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>

#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "agents/sender/sender.hpp"
#include "agents/sender/socket_client.hpp"
#include "client/udp_frame_receiver.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/protocol/reassembler.hpp"
#include "net/socket.hpp"
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
    std::unique_ptr<SocketClient> client;
    protocol::RecordParser parser{
        {1u << 16,
         static_cast<std::uint32_t>(protocol::kFrameHeaderBytes) + kWidthPx* kHeightPx * 4}};
    std::vector<protocol::FrameHeader> frames;
    std::uint64_t bad_crc = 0;
    std::uint64_t bytes = 0;

    /// Takes the frames that have arrived.
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

  Peer* connect(bool every_frame = false, std::uint32_t every_nth = 1) {
    Peer* peer = peers_.emplace_back(std::make_unique<Peer>()).get();
    int pair[2] = {-1, -1};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair), 0);
    peer->far = Fd(pair[1]);
    auto near = TcpSocket::adopt(sockets_, pair[0]);
    EXPECT_TRUE(near.has_value());
    peer->near = std::move(*near);
    // The buffer is smaller than a frame, so that a client that does not read stops in the middle
    // of one.
    const int send_bytes = 32 << 10;
    EXPECT_EQ(::setsockopt(pair[0], SOL_SOCKET, SO_SNDBUF, &send_bytes, sizeof(send_bytes)), 0);
    SocketClient::Params params;
    params.connection = next_connection_++;
    params.channel = &context_.channels.front();
    params.every_frame = every_frame;
    params.every_nth = every_nth;
    params.tcp_socket = &peer->near;
    peer->client = std::make_unique<SocketClient>(std::move(params));
    EXPECT_TRUE(context_.to_sender.push(
        {ClientCommand::Kind::add, peer->client->connection(), peer->client.get()}));
    sender_.do_work(clock_.tai_ns());
    return peer;
  }

  /// Publishes a frame. It returns false when every slot is in use.
  bool publish(ChannelSet channels = kAllChannels) {
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
    frame.image.channels = channels;
    frame.image.pictures[0] = view.radiance_w_m2_sr[0];
    frame.image.crc32c[0] = protocol::crc32c(std::as_bytes(view.radiance_w_m2_sr[0]));
    frame.header.frame_number = number_;
    if (edit) edit(frame);
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
  void add(SenderClient& client) {
    EXPECT_TRUE(context_.to_sender.push({ClientCommand::Kind::add, client.connection(), &client}));
    sender_.do_work(clock_.tai_ns());
  }
  Context& context() { return context_; }
  test::SourceScript& script() { return script_; }
  Sender& sender() { return sender_; }

  std::function<void(PublishFrame&)> edit;  ///< what the next frames have besides their pixels

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

TEST(Sender, AChannelThatLooksAheadHasTheInstantAndTheShiftOfItsImages) {
  Rig rig;
  Channel& channel = rig.context().channels.front();
  channel.kind = scene::ChannelKind::projector;
  channel.look_ahead_frames = 1;
  channel.output_steps = protocol::kOutputShifted;
  rig.edit = [](PublishFrame& frame) {
    frame.header.sim_time_ns = 1'000;
    frame.header.display_ns = 5'000;
    frame.header.flags = protocol::kFlagHold;
    frame.header.shift_x_px = 9.0F;
    frame.image.shift_px = {8.0F, 8.0F};
    frame.image.ahead = {.sim_time_ns = 11'000,
                         .display_ns = 15'000,
                         .flags = protocol::kFlagExtrapolated,
                         .wanted_shift_px = {1.5F, -2.0F},
                         .shift_px = {1.25F, -2.0F}};
  };
  Rig::Peer* peer = rig.connect();
  ASSERT_TRUE(rig.publish());
  rig.settle({peer});
  ASSERT_EQ(peer->frames.size(), 1U);
  const protocol::FrameHeader& ahead = peer->frames[0];
  EXPECT_EQ(ahead.sim_time_ns, 11'000);
  EXPECT_EQ(ahead.display_ns, 15'000);
  EXPECT_EQ(ahead.flags, protocol::kFlagHold | protocol::kFlagExtrapolated);
  EXPECT_EQ(ahead.applied_shift_x_px, 1.25F);
  EXPECT_EQ(ahead.shift_x_px, 0.25F) << "what is left to be done";
  EXPECT_EQ(ahead.shift_y_px, 0.0F);
  // The same frame on a channel of its own instant.
  channel.look_ahead_frames = 0;
  ASSERT_TRUE(rig.publish());
  rig.settle({peer});
  ASSERT_EQ(peer->frames.size(), 2U);
  EXPECT_EQ(peer->frames[1].sim_time_ns, 1'000);
  EXPECT_EQ(peer->frames[1].display_ns, 5'000);
  EXPECT_EQ(peer->frames[1].flags, std::uint32_t{protocol::kFlagHold});
  EXPECT_EQ(peer->frames[1].applied_shift_x_px, 8.0F);
}

TEST(Sender, APictureThatItsShiftCutsIsFlagged) {
  Rig rig;
  Rig::Peer* peer = rig.connect();
  for (const bool cut : {true, false}) {
    rig.edit = [cut](PublishFrame& frame) { frame.image.cut[0] = cut; };
    ASSERT_TRUE(rig.publish());
    rig.settle({peer});
  }
  ASSERT_EQ(peer->frames.size(), 2U);
  EXPECT_EQ(peer->frames[0].flags, std::uint32_t{protocol::kFlagMotionFault});
  EXPECT_EQ(peer->frames[1].flags, 0U);
}

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

using Turns = std::vector<std::pair<std::uint32_t, SenderClient::Turn>>;

/// Client that needs two turns for a frame and notes which kind each was.
class TwoTurnClient final : public SenderClient {
 public:
  TwoTurnClient(std::uint32_t connection, Turns& turns) : connection_(connection), turns_(turns) {}
  void begin(const protocol::FrameHeader& header, const Image& /*image*/,
             std::int64_t now_ns) noexcept override {
    start(header, now_ns);
    left_ = 2;
  }
  Progress send(UdpBatch& /*batch*/, Context& /*context*/, Turn turn) noexcept override {
    if (left_ == 0) return Progress::idle;
    turns_.emplace_back(connection_, turn);
    return --left_ == 0 ? Progress::finished : Progress::more;
  }
  void spill() noexcept override {}
  [[nodiscard]] std::uint32_t connection() const noexcept override { return connection_; }

 private:
  std::uint32_t connection_;
  Turns& turns_;
  int left_ = 0;
};

TEST(Sender, NobodysFirstByteWaitsForAnothersFrame) {
  using enum SenderClient::Turn;
  Turns turns;
  TwoTurnClient first(11, turns);
  TwoTurnClient second(12, turns);
  Rig rig;
  rig.add(first);
  ASSERT_TRUE(rig.publish());
  rig.settle({});
  EXPECT_EQ(turns, (Turns{{11, full}, {11, full}})) << "nobody else waits";
  turns.clear();
  rig.add(second);
  ASSERT_TRUE(rig.publish());
  rig.settle({});
  EXPECT_EQ(turns, (Turns{{12, brief}, {11, brief}, {12, full}, {11, full}}));
}

TEST(Sender, ABriefTurnOfASocketIsShort) {
  int pair[2] = {-1, -1};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair), 0);
  const Fd far(pair[1]);
  const int send_bytes = 4 << 20;
  ::setsockopt(pair[0], SOL_SOCKET, SO_SNDBUF, &send_bytes, sizeof(send_bytes));
  const SocketContext sockets;
  auto near = TcpSocket::adopt(sockets, pair[0]);
  ASSERT_TRUE(near.has_value());
  auto out = UdpSocket::open_bound(sockets, numeric_address("127.0.0.1", 0));
  ASSERT_TRUE(out.has_value());
  ASSERT_TRUE(out->connect(out->local_address()).has_value());
  const test::FakeClock clock;
  Context context(clock, 1u << 16, 4);
  Channel channel;
  channel.width_px = kWidthPx;
  channel.height_px = kHeightPx;
  const std::vector<float> pixels(kWidthPx * kHeightPx);
  Image image;
  image.pictures[0] = pixels;
  UdpBatch batch;
  for (const bool udp : {false, true}) {
    SocketClient::Params params;
    params.channel = &channel;
    params.udp = udp;
    params.tcp_socket = &*near;
    params.fragment_payload_bytes = 1440;
    if (udp) params.udp_socket = std::move(*out);
    SocketClient client(std::move(params));
    client.begin({}, image, 0);
    const std::uint64_t before = context.counters.get(Counter::bytes_sent);
    EXPECT_EQ(client.send(batch, context, SenderClient::Turn::brief), SenderClient::Progress::more);
    const std::uint64_t sent = context.counters.get(Counter::bytes_sent) - before;
    EXPECT_GT(sent, 0U);
    EXPECT_LE(sent, 96u << 10) << "of 128 KiB";
  }
}

TEST(Sender, WakesConductorAndRenderOnlyWhereTheyWaitForIt) {
  Rig rig;
  Rig::Peer* peer = rig.connect();
  Doorbells& bells = rig.context().bells;
  const auto rung = [&](Doorbell& bell) {
    pollfd wait{bell.fd(), POLLIN, 0};
    const bool out = ::poll(&wait, 1, 0) != 0;
    bell.disarm();
    return out;
  };
  const auto nothing = [] { return false; };
  for (const bool waited_for : {false, true, false}) {
    if (waited_for) {
      EXPECT_FALSE(rig.context().of_room.look(nothing));
      EXPECT_FALSE(rig.context().of_slots.look(nothing));
    }
    bells.conductor.arm();
    bells.render.arm();
    ASSERT_TRUE(rig.publish());
    rig.settle({peer});
    EXPECT_EQ(rig.script().held.load(), 0);
    EXPECT_EQ(rung(bells.conductor), waited_for);
    EXPECT_EQ(rung(bells.render), waited_for);
  }
}

TEST(Sender, WhatAClientDoesNotWantIsNeitherSentNorWaitedForNorAGap) {
  Rig rig;
  Rig::Peer* all = rig.connect();
  Rig::Peer* thirds = rig.connect(false, 3);
  Rig::Peer* strict_tenths = rig.connect(true, 10);
  for (int i = 0; i < 40; ++i) {
    ASSERT_TRUE(rig.publish());
    rig.settle({all, thirds});
    if (i % 10 == 5) {
      rig.settle({strict_tenths});  // too slow for every frame, quick enough for its own
    }
  }
  EXPECT_EQ(strict_tenths->frames.size(), 4U);
  EXPECT_EQ(rig.context().counters.get(Counter::clients_disconnected_slow), 0U);
  EXPECT_EQ(all->frames.size(), 40U);
  ASSERT_EQ(thirds->frames.size(), 14U);
  for (std::size_t i = 0; i < thirds->frames.size(); ++i) {
    EXPECT_EQ(thirds->frames[i].frame_number, 1 + 3 * i);
    EXPECT_EQ(thirds->frames[i].flags, 0U) << "its own wish";
  }
  EXPECT_EQ(thirds->frames.back().previous_frame_number, 37U);
  EXPECT_EQ(rig.context().counters.get(Counter::frames_left_out), 26U + 36U);
  EXPECT_EQ(rig.script().held.load(), 0) << "nobody waits for what nobody wants";
}

TEST(Sender, AGapIsToldByTheFrameBehindItHoweverFarBehindTheClientIs) {
  for (const bool stopped : {false, true}) {
    SCOPED_TRACE(stopped);
    Rig rig;
    Rig::Peer* peer = rig.connect();
    for (int i = 1; i <= 4; ++i) {
      // The third frame shows nothing for this channel, which would have wanted it.
      ASSERT_TRUE(rig.publish(i == 3 ? ChannelSet{0} : kAllChannels));
      rig.settle(stopped ? std::vector<Rig::Peer*>{} : std::vector{peer});
    }
    rig.settle({peer});
    ASSERT_GE(peer->frames.size(), 2U);
    for (const auto& frame : peer->frames) {
      EXPECT_EQ((frame.flags & protocol::kFlagGapBefore) != 0, frame.frame_number == 4)
          << frame.frame_number;
    }
  }
}

TEST(Sender, AStoppedClientThatWantsEveryThirdFrameSkipsOnlyWhatItWanted) {
  Rig rig;
  Rig::Peer* stopped = rig.connect(false, 3);
  for (int i = 0; i < 40; ++i) {
    ASSERT_TRUE(rig.publish()) << i;
    rig.settle({});
  }
  rig.settle({stopped});
  ASSERT_GE(stopped->frames.size(), 2U);
  EXPECT_EQ(stopped->frames.back().frame_number, 40U);
  std::uint64_t expected = 1;
  std::uint64_t missing = 0;
  for (const auto& header : stopped->frames) {
    EXPECT_EQ(header.frame_number % 3, 1U);
    EXPECT_EQ((header.flags & protocol::kFlagGapBefore) != 0, header.frame_number != expected);
    missing += (header.frame_number - expected) / 3;
    expected = header.frame_number + 3;
  }
  EXPECT_GT(missing, 0U);
  EXPECT_EQ(rig.context().counters.get(Counter::frames_skipped), missing);
  EXPECT_EQ(rig.script().held.load(), 0);
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
      {ClientCommand::Kind::remove, left->client->connection(), nullptr}));
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

/// Sends the datagrams of a frame through a real socket into a receiver that has the kernel write
/// payloads to their place. `order` gives their order.
class UdpInPlace : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto any = numeric_address("127.0.0.1", 0);
    auto receiver = client::UdpFrameReceiver::open(sockets_, any, any, {});
    ASSERT_TRUE(receiver.has_value()) << receiver.error().text;
    receiver_.emplace(std::move(*receiver));
    receiver_->size_buffer(4u << 20);
    receiver_->expect_stream(1);
    auto sender = UdpSocket::open(sockets_, any);
    ASSERT_TRUE(sender.has_value());
    sender_ = std::move(*sender);
    ASSERT_TRUE(sender_.connect(numeric_address("127.0.0.1", receiver_->port())).has_value());
  }
  /// Returns the datagrams of frame `id`, whose pixels are all different.
  static std::vector<std::vector<std::byte>> datagrams(std::uint32_t id,
                                                       std::uint32_t payload_bytes,
                                                       std::uint16_t stream_id = 1,
                                                       std::uint32_t more = 0) {
    std::vector<float> pixels(kWidthPx * kHeightPx);
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      pixels[i] = static_cast<float>(i + 1 + id + more);
    }
    protocol::FrameHeader header;
    header.frame_number = id;
    header.width_px = kWidthPx;
    header.height_px = kHeightPx;
    header.payload_bytes = pixels.size() * sizeof(float);
    header.payload_crc32c = protocol::crc32c(std::as_bytes(std::span<const float>(pixels)));
    std::array<std::byte, protocol::kFrameHeaderBytes> head{};
    protocol::encode(header, head);
    const protocol::Fragmenter fragments({stream_id, id, 0, kWidthPx * 4, payload_bytes}, head,
                                         std::as_bytes(std::span<const float>(pixels)));
    std::vector<std::vector<std::byte>> out;
    for (std::uint32_t i = 0; i < fragments.fragment_count(); ++i) {
      std::array<std::byte, protocol::kFragmentHeaderBytes> memory{};
      const auto pieces = fragments.pieces(i, memory);
      auto& datagram = out.emplace_back();
      for (std::uint32_t k = 0; k < pieces.count; ++k) {
        datagram.insert(datagram.end(), pieces.piece[k].begin(), pieces.piece[k].end());
      }
    }
    return out;
  }
  void send(const std::vector<std::byte>& datagram) {
    ASSERT_EQ(sender_.send(datagram).status, IoStatus::done);
  }
  void take() {
    while (receiver_->take(reassembler_, counters_) > 0) {
    }
  }
  void expect_frame(std::uint32_t id) {
    const auto* frame = reassembler_.pop();
    ASSERT_NE(frame, nullptr);
    EXPECT_TRUE(frame->complete);
    EXPECT_TRUE(frame->crc_ok);
    EXPECT_EQ(frame->header.frame_number, id);
    EXPECT_EQ(frame->pixels.front(), static_cast<float>(1 + id));
    EXPECT_EQ(frame->pixels.back(), static_cast<float>(frame->pixels.size() + id));
    reassembler_.release(frame);
  }

  SocketContext sockets_;
  std::optional<client::UdpFrameReceiver> receiver_;
  UdpSocket sender_;
  client::ReceiveCounters counters_;
  protocol::Reassembler reassembler_{
      {static_cast<std::uint32_t>(kWidthPx * kHeightPx * sizeof(float)), 4, 2, 2, true}};
};

TEST_F(UdpInPlace, FramesInOrderAreWholeWhateverTheFragments) {
  std::uint32_t id = 0;
  for (const std::uint32_t payload_bytes : {1440U, 8900U, 320U, 65000U}) {
    for (int frame = 0; frame < 3; ++frame) {
      for (const auto& datagram : datagrams(++id, payload_bytes)) {
        send(datagram);
      }
      take();
      expect_frame(id);
    }
  }
  EXPECT_EQ(counters_.bad_datagrams, 0U);
}

TEST_F(UdpInPlace, OfJoinedDatagramsNothingButAFramesBeginningIsMisplaced) {
  if (!udp_segmentation_supported(sender_.fd())) GTEST_SKIP() << "the kernel joins nothing";
  constexpr std::uint32_t kFrames = 6;
  constexpr std::size_t kJoined = 7;
  for (std::uint32_t id = 1; id <= kFrames; ++id) {
    const auto all = datagrams(id, 1440);
    ASSERT_EQ(all.size() % kJoined, 1U) << "the last one comes alone";
    for (std::size_t i = 0; i < all.size(); i += kJoined) {
      std::vector<std::byte> joined;
      for (std::size_t k = i; k < std::min(i + kJoined, all.size()); ++k) {
        joined.insert(joined.end(), all[k].begin(), all[k].end());
      }
      UdpBatch batch;
      const auto bytes = static_cast<std::uint32_t>(all.front().size());
      if (joined.size() > bytes) {
        ASSERT_EQ(batch.send_datagrams(sender_.fd(), joined, bytes, true).fragments, kJoined);
      } else {
        send(joined);
      }
    }
  }
  for (std::uint32_t id = 1; id <= kFrames; ++id) {
    while (reassembler_.counters().frames_complete < id) {
      ASSERT_GT(receiver_->take(reassembler_, counters_), 0);
    }
    expect_frame(id);
  }
  // The receiver does not know before the first message that datagrams come joined.
  EXPECT_LE(receiver_->misplaced(), 16U + kFrames - 1);
}

TEST_F(UdpInPlace, WhatWasNotExpectedComesOutRightAllTheSame) {
  std::mt19937 random(9);
  for (std::uint32_t id = 1; id <= 30; ++id) {
    auto order = datagrams(id, id % 2 == 0 ? 1440 : 8900);
    const std::size_t count = order.size();
    // Neighbours change places, some datagrams come twice, and other senders' come between.
    for (int swap = 0; swap < 6; ++swap) {
      std::swap(order[random() % count], order[random() % count]);
    }
    for (int twice = 0; twice < 3; ++twice) {
      order.insert(order.begin() + static_cast<std::ptrdiff_t>(random() % count),
                   order[random() % count]);
    }
    order.insert(order.begin() + static_cast<std::ptrdiff_t>(random() % count),
                 std::vector<std::byte>(random() % 9000 + 1, std::byte{7}));
    std::size_t sent = 0;
    for (const auto& datagram : order) {
      send(datagram);
      if (++sent % (random() % 40 + 1) == 0) {
        take();
      }
    }
    take();
    expect_frame(id);
  }
  EXPECT_EQ(counters_.bad_datagrams, 30U) << "the strangers";
}

TEST_F(UdpInPlace, OtherStreamsAndOtherMachinesTakeNobodysPlace) {
  UdpSocket stranger;
  {
    const auto elsewhere = numeric_address("127.0.0.2", 0);
    auto opened = UdpSocket::open_bound(sockets_, elsewhere);
    ASSERT_TRUE(opened.has_value()) << opened.error().text;
    stranger = std::move(*opened);
    ASSERT_TRUE(stranger.connect(numeric_address("127.0.0.1", receiver_->port())).has_value());
  }
  std::uint64_t strange = 0;
  for (const std::uint16_t stream : {std::uint16_t{7}, std::uint16_t{8}, std::uint16_t{9}}) {
    for (const auto& datagram : datagrams(50, 8900, stream)) {
      send(datagram);
      ++strange;
    }
    take();
  }
  for (std::uint32_t id = 1; id <= 4; ++id) {
    // Datagrams before and between carry the same stream and frame from another machine, and other
    // pixels.
    const auto wanted = datagrams(id, 1440);
    const auto forged = datagrams(id, 1440, 1, 1000);
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      ASSERT_EQ(stranger.send(forged[i]).status, IoStatus::done);
      ++strange;
      send(wanted[i]);
      if (i % 7 == 0) {
        take();
      }
    }
    take();
    expect_frame(id);
  }
  EXPECT_EQ(counters_.foreign_datagrams, strange);
  EXPECT_EQ(counters_.bad_datagrams, 0U);
  EXPECT_EQ(reassembler_.pop(), nullptr);
}

TEST_F(UdpInPlace, PixelsOfALostDatagramAreZero) {
  for (std::uint32_t id = 1; id <= 4; ++id) {
    const auto order = datagrams(id, 1440);
    for (std::size_t i = 0; i < order.size(); ++i) {
      if (i != 20) {
        send(order[i]);
      }
      if (i == 10) {
        take();
      }
    }
    take();
    reassembler_.flush();
    const auto* frame = reassembler_.pop();
    ASSERT_NE(frame, nullptr);
    EXPECT_EQ(frame->missing_px, 1440U / 4);
    const std::size_t first = (20 * 1440 - protocol::kFrameHeaderBytes) / 4;
    for (std::size_t i = first - 1; i <= first + 360; ++i) {
      const bool missing = i >= first && i < first + 360;
      ASSERT_EQ(frame->pixels[i], missing ? 0.0F : static_cast<float>(i + 1 + id)) << i;
    }
    reassembler_.release(frame);
  }
}

}  // namespace
}  // namespace emit::server
