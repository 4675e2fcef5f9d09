// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstring>
#include <initializer_list>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "agents/sender/sender.hpp"
#include "agents/sender/shm_client.hpp"
#include "emit/client/client.hpp"
#include "emit/protocol/version.hpp"
#include "emit/v1/control.pb.h"
#include "rt/futex.hpp"
#include "support/fake_clock.hpp"
#include "support/scripted_source.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

constexpr std::uint32_t kWidthPx = 64;
constexpr std::uint32_t kHeightPx = 48;
using emit::test::kLongNs;

std::string own_name() {
  static int count = 0;
  return "test-" + std::to_string(::getpid()) + "-" + std::to_string(count++);
}

std::vector<std::byte> welcome_of(std::uint32_t width_px, std::uint32_t height_px,
                                  std::initializer_list<const char*> bands = {"lwir", "mwir"}) {
  v1::Welcome welcome;
  welcome.set_protocol_version(protocol::kProtocolVersion);
  welcome.set_software("test");
  for (const char* band : bands) {
    v1::ChannelInfo& channel = *welcome.add_channels();
    channel.set_kind("injection");
    channel.set_band(band);
    channel.set_width_px(width_px);
    channel.set_height_px(height_px);
  }
  std::vector<std::byte> out(welcome.ByteSizeLong());
  welcome.SerializeToArray(out.data(), static_cast<int>(out.size()));
  return out;
}

/// A ring as the daemon has one, with two channels; the test is the sender.
class Ring {
 public:
  explicit Ring(const std::string& name, std::uint32_t slots = 4, std::uint32_t width_px = kWidthPx,
                std::uint32_t height_px = kHeightPx)
      : context_(clock_, 1u << 20, 4), pixels_(std::size_t{width_px} * height_px) {
    for (std::size_t i = 0; i < 2; ++i) {
      Channel channel;
      channel.index = static_cast<std::uint16_t>(i);
      channel.width_px = width_px;
      channel.height_px = height_px;
      channel.picture = i;
      context_.channels.push_back(channel);
    }
    config::StreamConfig config;
    config.shm = name;
    config.shm_slots = slots;
    auto made = ShmClient::create(config, context_.channels, welcome_of(width_px, height_px), 1);
    EXPECT_TRUE(made.has_value()) << made.error().text;
    if (made) {
      client_ = std::move(*made);
    }
  }
  /// Begins the next frame. Every pixel of channel c holds number + c / 2.
  void begin() {
    ++number_;
    for (std::size_t i = 0; i < 2; ++i) {
      pixels_by_plane_[i].assign(pixels_.size(),
                                 static_cast<float>(number_) + 0.5F * static_cast<float>(i));
      image_.pictures[i] = pixels_by_plane_[i];
      image_.crc32c[i] = protocol::crc32c(std::as_bytes(image_.pictures[i]));
    }
    protocol::FrameHeader header;
    header.frame_number = number_;
    header.flags = protocol::kReceiverFlags;  // not a sender's to say: readers drop them
    client_->begin(header, image_, clock_.tai_ns());
  }
  [[nodiscard]] SenderClient::Progress send(SenderClient::Turn turn = SenderClient::Turn::full) {
    return client_->send(batch_, context_, turn);
  }
  void publish() {
    begin();
    while (send() != SenderClient::Progress::finished) {
    }
    client_->complete(clock_.tai_ns());
  }
  [[nodiscard]] ShmClient& client() { return *client_; }

 private:
  test::FakeClock clock_;
  Context context_;
  std::vector<float> pixels_;
  std::array<std::vector<float>, 2> pixels_by_plane_;
  Image image_;
  UdpBatch batch_;
  std::unique_ptr<ShmClient> client_;
  std::uint64_t number_ = 0;
};

std::unique_ptr<client::FrameClient> open_reader(const std::string& name,
                                                 client::SubscribeOptions options = {}) {
  auto client = client::FrameClient::connect("shm://" + name);
  EXPECT_TRUE(client.has_value()) << client.error().text;
  if (!client) {
    return nullptr;
  }
  EXPECT_TRUE((*client)->subscribe(options).has_value());
  return std::move(*client);
}

client::SubscribeOptions in_place() {
  client::SubscribeOptions options;
  options.in_place = true;
  return options;
}

/// Returns the frame that is there now; null when there is none.
const client::ReceivedFrame* take(client::FrameClient& reader) {
  const auto frame = reader.receive(0);
  EXPECT_TRUE(frame.has_value()) << frame.error().text;
  return frame ? *frame : nullptr;
}

TEST(Shm, ReadersGetTheirChannelInPlaceFrameByFrame) {
  const std::string name = own_name();
  Ring ring(name);
  client::SubscribeOptions options = in_place();
  options.band = "mwir";
  const auto reader = open_reader(name, options);
  ASSERT_NE(reader, nullptr);
  EXPECT_EQ(take(*reader), nullptr);
  for (std::uint64_t number = 1; number <= 10; ++number) {
    ring.publish();
    const client::ReceivedFrame* frame = take(*reader);
    ASSERT_NE(frame, nullptr);
    EXPECT_EQ(frame->header.frame_number, number);
    EXPECT_EQ(frame->header.flags, 0U);
    EXPECT_EQ(frame->header.channel_index, 1U);
    EXPECT_EQ(frame->header.width_px, kWidthPx);
    ASSERT_EQ(frame->pixels.size(), std::size_t{kWidthPx} * kHeightPx);
    EXPECT_EQ(frame->pixels.front(), static_cast<float>(number) + 0.5F);
    EXPECT_EQ(frame->pixels.back(), static_cast<float>(number) + 0.5F);
    EXPECT_TRUE(reader->intact());
    EXPECT_EQ(take(*reader), nullptr) << "once each";
  }
  EXPECT_EQ(reader->counters().received, 10U);
  EXPECT_EQ(reader->counters().crc_errors, 0U);
  EXPECT_EQ(reader->counters().lost, 0U);
}

TEST(Shm, AReaderThatWasOverrunSkipsToTheNewestAndSaysSo) {
  const std::string name = own_name();
  Ring ring(name, 4);
  const auto slow = open_reader(name, in_place());
  const auto quick = open_reader(name, in_place());
  ASSERT_TRUE(slow && quick);
  for (std::uint64_t number = 1; number <= 20; ++number) {
    ring.publish();
    const client::ReceivedFrame* frame = take(*quick);
    ASSERT_NE(frame, nullptr);
    EXPECT_EQ(frame->header.frame_number, number);
    if (number == 1) {
      ASSERT_NE(take(*slow), nullptr);
    }
  }
  const client::ReceivedFrame* frame = take(*slow);
  ASSERT_NE(frame, nullptr);
  EXPECT_EQ(frame->header.frame_number, 20U);
  EXPECT_EQ(frame->header.flags, protocol::kFlagGapBefore);
  EXPECT_EQ(slow->counters().gaps, 1U);
  EXPECT_EQ(slow->counters().skipped, 18U);
  EXPECT_EQ(slow->counters().lost, 0U);
  EXPECT_EQ(quick->counters().gaps, 0U);
  EXPECT_EQ(quick->counters().received, 20U);
  ring.publish();
  frame = take(*slow);
  ASSERT_NE(frame, nullptr);
  EXPECT_EQ(frame->header.flags, 0U);
}

TEST(Shm, AnEveryFrameReaderEndsRatherThanSkips) {
  const std::string name = own_name();
  Ring ring(name, 4);
  client::SubscribeOptions options;
  options.every_frame = true;
  const auto reader = open_reader(name, options);
  ASSERT_NE(reader, nullptr);
  for (int i = 0; i < 3; ++i) {
    ring.publish();
  }
  for (int i = 0; i < 3; ++i) {
    ASSERT_NE(take(*reader), nullptr);
  }
  for (int i = 0; i < 5; ++i) {
    ring.publish();
  }
  EXPECT_FALSE(reader->receive(0).has_value());
}

TEST(Shm, PixelsInPlaceAreCalledVoidOnceOverwrittenAndCopiesStay) {
  const std::string name = own_name();
  Ring ring(name, 4);
  const auto reader = open_reader(name, in_place());
  const auto keeper = open_reader(name);
  ASSERT_TRUE(reader && keeper);
  ring.publish();
  const client::ReceivedFrame* frame = take(*reader);
  const client::ReceivedFrame* kept = take(*keeper);
  ASSERT_TRUE(frame != nullptr && kept != nullptr);
  for (int i = 0; i < 3; ++i) {
    ring.publish();
    EXPECT_TRUE(reader->intact());
  }
  ring.begin();
  EXPECT_FALSE(reader->intact());
  while (ring.send() != SenderClient::Progress::finished) {
  }
  EXPECT_FALSE(reader->intact());
  EXPECT_EQ(frame->pixels.front(), 5.0F) << "the memory is the daemon's";
  EXPECT_TRUE(keeper->intact());
  EXPECT_EQ(kept->pixels.front(), 1.0F);
}

TEST(Shm, ABriefTurnWritesLittle) {
  Ring ring(own_name(), 3, 256, 80);  // 80 KiB a channel
  ring.begin();
  EXPECT_EQ(ring.send(SenderClient::Turn::brief), SenderClient::Progress::more);
  EXPECT_EQ(ring.send(), SenderClient::Progress::finished);
}

TEST(Shm, ALargeFrameIsWrittenInTurnsAndShowsWhenItIsWhole) {
  const std::string name = own_name();
  Ring ring(name, 3, 1024, 1024);
  const auto reader = open_reader(name, in_place());
  ASSERT_NE(reader, nullptr);
  ring.begin();
  EXPECT_EQ(ring.send(), SenderClient::Progress::more);
  EXPECT_EQ(take(*reader), nullptr);
  ring.client().spill();
  EXPECT_EQ(ring.send(), SenderClient::Progress::finished) << "a spilled frame is complete";
  const client::ReceivedFrame* frame = take(*reader);
  ASSERT_NE(frame, nullptr);
  EXPECT_EQ(frame->pixels.back(), 1.0F);
  EXPECT_EQ(reader->counters().crc_errors, 0U);
}

TEST(Shm, ReadersNoticeTheEndAndTheNextDaemonHasARingOfItsOwn) {
  const std::string name = own_name();
  auto ring = std::make_unique<Ring>(name);
  const auto old = open_reader(name);
  ASSERT_NE(old, nullptr);
  ring->publish();
  ring.reset();
  EXPECT_NE(take(*old), nullptr) << "what was published before the end is still handed out";
  const auto ended = old->receive(kLongNs);
  ASSERT_FALSE(ended.has_value());
  EXPECT_NE(ended.error().text.find("closed"), std::string::npos) << ended.error().text;
  EXPECT_FALSE(client::FrameClient::connect("shm://" + name).has_value());
  ring = std::make_unique<Ring>(name);
  const auto reader = open_reader(name);
  ring->publish();
  EXPECT_NE(take(*reader), nullptr);
  EXPECT_FALSE(old->receive(0).has_value());
}

TEST(Shm, ASleepingReaderIsWokenByTheFrame) {
  const std::string name = own_name();
  Ring ring(name);
  const auto reader = open_reader(name);
  ASSERT_NE(reader, nullptr);
  std::thread publisher([&] { ring.publish(); });
  const auto frame = reader->receive(kLongNs);
  publisher.join();
  ASSERT_TRUE(frame.has_value() && *frame != nullptr);
  EXPECT_EQ((*frame)->header.frame_number, 1U);
}

/// Writes very little per frame, so that frames change faster than anybody can sum their pixels.
class QuickRing {
 public:
  explicit QuickRing(const std::string& name) {
    protocol::RingParams params;
    const std::vector<std::byte> welcome = welcome_of(kSidePx, kSidePx, {"lwir"});
    params.slots = 3;
    params.plane_bytes = {kPixelBytes};
    params.plane_of_channel = {0};
    params.welcome = welcome;
    auto object = ShmObject::create(protocol::ring_bytes(params), 0600);
    EXPECT_TRUE(object.has_value()) << object.error().text;
    object_ = std::move(*object);
    writer_.emplace(object_.writable(), params);
    EXPECT_TRUE(object_.publish(name).has_value());
    std::vector<float> pixels(std::size_t{kSidePx} * kSidePx);
    for (std::size_t i = 0; i < crc32c_.size(); ++i) {
      pixels.back() = static_cast<float>(i);
      crc32c_[i] = protocol::crc32c(std::as_bytes(std::span<const float>(pixels)));
    }
  }
  void publish() {
    ++header_.frame_number;
    const std::size_t image = header_.frame_number % crc32c_.size();
    const auto last = static_cast<float>(image);
    header_.width_px = header_.height_px = kSidePx;
    header_.payload_bytes = kPixelBytes;
    header_.payload_crc32c = crc32c_[image];
    writer_->begin();
    protocol::encode(header_, writer_->header(0));
    std::memcpy(&writer_->plane(0).back() + 1 - sizeof(last), &last, sizeof(last));
    writer_->commit();
    futex_wake_all(writer_->signal());
  }

 private:
  static constexpr std::uint32_t kSidePx = 1024;
  static constexpr std::uint64_t kPixelBytes = std::uint64_t{kSidePx} * kSidePx * sizeof(float);
  ShmObject object_;
  std::optional<protocol::RingWriter> writer_;
  protocol::FrameHeader header_;
  std::array<std::uint32_t, 7> crc32c_{};
};

TEST(Shm, TornFramesNeverGetThroughHoweverFastTheDaemon) {
  const std::string name = own_name();
  QuickRing ring(name);
  const auto reader = open_reader(name, in_place());
  ASSERT_NE(reader, nullptr);
  std::atomic<bool> stop{false};
  std::thread publisher([&] {
    // Bursts overwrite every slot, at any time of a reader's work.
    std::mt19937 random(3);
    while (!stop.load()) {
      for (int i = 0; i < 3; ++i) {
        ring.publish();
      }
      std::this_thread::sleep_for(std::chrono::microseconds(random() % 2000));
    }
  });
  std::uint64_t last = 0;
  for (int i = 0; i < 300; ++i) {
    const auto frame = reader->receive(kLongNs);
    if (!frame || *frame == nullptr) {
      ADD_FAILURE() << "the stream stood still";
      break;
    }
    const auto& header = (*frame)->header;
    if (last != 0) {
      EXPECT_EQ((header.flags & protocol::kFlagGapBefore) != 0, header.frame_number != last + 1);
    }
    EXPECT_GT(header.frame_number, last);
    last = header.frame_number;
    // Pixels used in place are either those of this frame, or the reader reports that they are not.
    const float pixel = (*frame)->pixels.back();
    EXPECT_TRUE(pixel == static_cast<float>(header.frame_number % 7) || !reader->intact());
  }
  stop.store(true);
  publisher.join();
  EXPECT_EQ(reader->counters().crc_errors, 0U);
  EXPECT_EQ(reader->counters().lost, 0U);
}

/// A process that has a ring and, on request, ends as a crash does.
class RingProcess {
 public:
  explicit RingProcess(const std::string& name) {
    int pair[2] = {-1, -1};
    EXPECT_EQ(::pipe2(pair, O_CLOEXEC), 0);
    pid_ = ::fork();
    if (pid_ == 0) {
      Ring ring(name);
      ring.publish();
      [[maybe_unused]] const auto told = ::write(pair[1], "r", 1);
      for (;;) {
        ::pause();
      }
    }
    ::close(pair[1]);
    char ready = 0;
    EXPECT_EQ(::read(pair[0], &ready, 1), 1);
    ::close(pair[0]);
  }
  ~RingProcess() { kill(); }
  void kill() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
      pid_ = -1;
    }
  }

 private:
  pid_t pid_ = -1;
};

TEST(Shm, ACrashedDaemonIsNoticedAndWhatItLeftIsReplaced) {
  const std::string name = own_name();
  RingProcess process(name);
  const auto reader = open_reader(name);
  ASSERT_NE(reader, nullptr);
  EXPECT_FALSE(check_shm_name_free(name).has_value());
  auto second = ShmObject::create(4096, 0600);
  ASSERT_TRUE(second.has_value());
  EXPECT_FALSE(second->publish(name).has_value()) << "the name belongs to a living process";

  process.kill();
  const auto gone = reader->receive(kLongNs);
  ASSERT_FALSE(gone.has_value());
  EXPECT_NE(gone.error().text.find("gone"), std::string::npos) << gone.error().text;
  EXPECT_FALSE(client::FrameClient::connect("shm://" + name).has_value()) << "nobody writes there";
  EXPECT_TRUE(check_shm_name_free(name).has_value());

  Ring ring(name);
  const auto next = open_reader(name);
  ring.publish();
  ASSERT_NE(next, nullptr);
  EXPECT_NE(take(*next), nullptr);
}

TEST(Shm, IsTheOwnersAloneUnlessConfiguredOtherwise) {
  const std::string name = own_name();
  struct stat status {};
  {
    const Ring ring(name);
    ASSERT_EQ(::stat(("/dev/shm/emitd-" + name).c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 07777U, 0600U);
  }
  EXPECT_NE(::stat(("/dev/shm/emitd-" + name).c_str(), &status), 0) << "removed at the end";
  auto object = ShmObject::create(4096, 0644);
  ASSERT_TRUE(object.has_value());
  ASSERT_TRUE(object->publish(name).has_value());
  ASSERT_EQ(::stat(("/dev/shm/emitd-" + name).c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 07777U, 0644U) << "whatever the umask says";
}

TEST(Shm, NamesThatCouldBePathsAreRefused) {
  for (const char* url : {"shm://", "shm://a/b", "shm://../a", "shm://.a", "shm://-a", "shm://a b",
                          "shm://a\n", "http://a", "shm:/a"}) {
    EXPECT_FALSE(client::parse_frame_url(url).has_value()) << url;
  }
  EXPECT_FALSE(client::parse_frame_url("shm://" + std::string(65, 'a')).has_value());
  EXPECT_TRUE(client::parse_frame_url("shm://" + std::string(64, 'a')).has_value());
  EXPECT_EQ(client::parse_frame_url("shm://rig-1_a.b")->host, "rig-1_a.b");
  EXPECT_FALSE(client::parse_url("shm://rig").has_value()) << "frames only";
  EXPECT_FALSE(client::HostClient::connect("shm://rig").has_value());
}

TEST(Shm, ReadersAreKnownAsLongAsTheyLive) {
  const std::string name = own_name();
  auto object = ShmObject::create(4096, 0600);
  ASSERT_TRUE(object.has_value());
  ASSERT_TRUE(object->publish(name).has_value());
  EXPECT_FALSE(object->has_readers());
  {
    const auto first = ShmObject::open(name);
    ASSERT_TRUE(first.has_value()) << first.error().text;
    EXPECT_TRUE(object->has_readers());
    {
      const auto second = ShmObject::open(name);
      ASSERT_TRUE(second.has_value()) << "readers do not shut each other out";
      EXPECT_TRUE(second->alive());
    }
    EXPECT_TRUE(object->has_readers());
  }
  EXPECT_FALSE(object->has_readers());
  const pid_t reader = ::fork();
  if (reader == 0) {
    const auto opened = ShmObject::open(name);
    ::raise(opened ? SIGSTOP : SIGKILL);
    ::_exit(1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(reader, &status, WUNTRACED), reader);
  ASSERT_TRUE(WIFSTOPPED(status));
  EXPECT_TRUE(object->has_readers()) << "a stopped reader is one";
  ::kill(reader, SIGKILL);
  ASSERT_EQ(::waitpid(reader, &status, 0), reader);
  EXPECT_FALSE(object->has_readers()) << "a killed one is none";
}

TEST(Shm, TheSenderServesItAndKeepsItToItself) {
  const std::string name = own_name();
  const test::FakeClock clock;
  Context context(clock, 1u << 20, 4);
  Channel channel;
  channel.width_px = kWidthPx;
  channel.height_px = kHeightPx;
  context.channels.push_back(channel);
  config::StreamConfig config;
  config.shm = name;
  v1::Welcome welcome;
  welcome.set_protocol_version(protocol::kProtocolVersion);
  welcome.add_channels()->set_kind("injection");
  std::vector<std::byte> bytes(welcome.ByteSizeLong());
  welcome.SerializeToArray(bytes.data(), static_cast<int>(bytes.size()));
  auto shm = ShmClient::create(config, context.channels, bytes, 1);
  ASSERT_TRUE(shm.has_value()) << shm.error().text;
  test::SourceScript script;
  constexpr std::uint32_t kQueue = 4;
  test::ScriptedSource source(script, kWidthPx, kHeightPx, kQueue + 3);
  Sender sender(context, kQueue, 4, false, {shm->get()});
  ASSERT_TRUE(sender.on_start());
  std::unique_ptr<client::FrameClient> reader;
  constexpr std::uint64_t kUnread = 10;  // nobody reads so long
  for (std::uint64_t number = 1; number <= 30; ++number) {
    if (number == kUnread + 1) {
      reader = open_reader(name, in_place());
      ASSERT_NE(reader, nullptr);
    }
    renderer::FrameRequest request;
    request.frame_number = number;
    const int slot = source.submit(request);
    ASSERT_GE(slot, 0);
    const auto& view = source.collect(static_cast<std::uint32_t>(slot));
    PublishFrame frame;
    frame.image.source = &source;
    frame.image.slot = static_cast<std::uint32_t>(slot);
    frame.image.pictures[0] = view.radiance_w_m2_sr[0];
    frame.image.crc32c[0] = protocol::crc32c(std::as_bytes(view.radiance_w_m2_sr[0]));
    frame.header.frame_number = number;
    ASSERT_TRUE(context.published.push(frame));
    while (sender.do_work(clock.tai_ns()) > 0) {
    }
    EXPECT_EQ(script.held.load(), 0) << "the source has its slot back";
    if (number <= kUnread) {
      continue;
    }
    const client::ReceivedFrame* received = take(*reader);
    ASSERT_NE(received, nullptr);
    EXPECT_EQ(received->header.frame_number, number);
  }
  EXPECT_EQ(reader->counters().crc_errors, 0U);
  EXPECT_EQ(context.counters.get(Counter::frames_shared), 20U);
  EXPECT_EQ(context.counters.get(Counter::frames_unread), kUnread);
  EXPECT_EQ(reader->counters().lost + reader->counters().gaps, 0U);
  sender.on_stop();
  EXPECT_EQ(context.from_sender.front(), nullptr) << "it belongs to no connection";
}

}  // namespace
}  // namespace emit::server
