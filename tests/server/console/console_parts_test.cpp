// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <bit>
#include <cstring>

#include "agents/sender/sender.hpp"
#include "console/console_access.hpp"
#include "console/console_files.hpp"
#include "console/console_message.hpp"
#include "console/console_state.hpp"
#include "console/console_tap.hpp"
#include "emit/image/temperature_table.hpp"
#include "support/fake_clock.hpp"
#include "support/scripted_source.hpp"

namespace emit::server {
namespace {

TEST(ConsoleAccess, TakesRequestsThatNameThisHostAlone) {
  const std::vector<std::string> names{"rig7"};
  for (const char* host : {"localhost", "localhost:7003", "127.0.0.1:7003", "[::1]:7003", "RIG7:80",
                           "192.0.2.4:7003"}) {
    EXPECT_TRUE(is_own_host(host, names)) << host;
  }
  for (const char* host : {"", ":7003", "example.org", "localhost.example.org:7003", "[rig7]:7003",
                           "127.0.0.1.example.org:7003", "[::1"}) {
    EXPECT_FALSE(is_own_host(host, names)) << host;
  }
}

TEST(ConsoleAccess, TakesWebSocketsOfItsOwnPageAlone) {
  EXPECT_TRUE(is_own_origin("http://127.0.0.1:7003", "127.0.0.1:7003"));
  EXPECT_FALSE(is_own_origin("http://127.0.0.1:7004", "127.0.0.1:7003"));
  EXPECT_FALSE(is_own_origin("https://127.0.0.1:7003", "127.0.0.1:7003"));
  EXPECT_FALSE(is_own_origin("http://example.org", "127.0.0.1:7003"));
  EXPECT_FALSE(is_own_origin("", "127.0.0.1:7003")) << "browsers always state it";
  EXPECT_FALSE(is_own_origin("http://", ""));
}

template <class T>
T at(const std::array<std::byte, kConsoleHeaderBytes>& bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof(value));
  return value;
}

TEST(ConsoleMessage, LiesAsThePageReadsIt) {
  protocol::FrameHeader header;
  header.run_id = 0x1122334455667788;
  header.frame_number = 42;
  header.sim_time_ns = -5;
  header.width_px = 640;
  header.height_px = 512;
  header.channel_index = 3;
  header.flags = protocol::kFlagLate | protocol::kFlagCanned;
  header.band_lo_um = 3.5F;
  header.payload_crc32c = 0xDEADBEEF;
  const auto bytes = console_header(header, 7);
  EXPECT_EQ(std::memcmp(bytes.data(), "EMCF", 4), 0);
  EXPECT_EQ(at<std::uint16_t>(bytes, 4), kConsoleVersion);
  EXPECT_EQ(at<std::uint16_t>(bytes, 6), 128);
  EXPECT_EQ(at<std::uint64_t>(bytes, 8), 7U);
  EXPECT_EQ(at<std::uint64_t>(bytes, 16), header.run_id);
  EXPECT_EQ(at<std::uint64_t>(bytes, 24), 42U);
  EXPECT_EQ(at<std::int64_t>(bytes, 40), -5);
  EXPECT_EQ(at<std::uint32_t>(bytes, 48), 640U);
  EXPECT_EQ(at<std::uint32_t>(bytes, 52), 512U);
  EXPECT_EQ(at<std::uint16_t>(bytes, 56), 3);
  EXPECT_EQ(at<std::uint8_t>(bytes, 58), 1);
  EXPECT_EQ(at<std::uint32_t>(bytes, 60), header.flags);
  EXPECT_EQ(at<float>(bytes, 64), 3.5F);
  EXPECT_EQ(at<std::uint32_t>(bytes, 104), 0xDEADBEEF);
}

TEST(ConsoleMessage, TextOfPeersCannotLeaveItsQuotes) {
  EXPECT_EQ(json_string("a\"b\\c\n\x7F\xC3"), R"("a\"b\\c???")");
}

TEST(ConsoleFiles, ThePageIsInTheProgramAndAsksForNothingElse) {
  ASSERT_NE(find_console_file("/"), nullptr);
  EXPECT_EQ(find_console_file("/"), find_console_file("/index.html"));
  EXPECT_EQ(find_console_file("/../console.js"), nullptr);
  EXPECT_EQ(find_console_file("console.js"), nullptr);
  for (const ConsoleFile& file : console_files()) {
    EXPECT_NE(media_type(file.name), "application/octet-stream") << file.name;
    // The name of SVG's vocabulary looks like an address, but nobody asks there.
    EXPECT_EQ(file.text.find("https://"), std::string_view::npos) << file.name;
    EXPECT_EQ(file.text.find("@import"), std::string_view::npos) << file.name;
  }
}

constexpr std::uint32_t kWidthPx = 300;
constexpr std::uint32_t kHeightPx = 200;

/// A sender whose one client is the console; the test plays conductor, source and console.
class TapRig {
 public:
  TapRig() : context_(clock_, 1u << 20, 8), source_(script_, kWidthPx, kHeightPx, 7) {
    Channel channel;
    channel.width_px = kWidthPx;
    channel.height_px = kHeightPx;
    context_.channels.push_back(channel);
    tap_.emplace(context_);
    sender_.emplace(context_, 4, 8, false, std::vector<SenderClient*>{&*tap_});
    EXPECT_TRUE(sender_->on_start());
  }
  ~TapRig() { sender_->on_stop(); }

  bool publish() {
    renderer::FrameRequest request;
    request.frame_number = ++number_;
    const int slot = source_.submit(request);
    if (slot < 0) return false;
    const auto& view = source_.collect(static_cast<std::uint32_t>(slot));
    PublishFrame frame;
    frame.image.source = &source_;
    frame.image.slot = static_cast<std::uint32_t>(slot);
    frame.image.pictures[0] = view.radiance_w_m2_sr[0];
    frame.header.frame_number = number_;
    newest_.assign(frame.image.pictures[0].begin(), frame.image.pictures[0].end());
    EXPECT_TRUE(context_.published.push(frame));
    return true;
  }
  /// Turns the sender until it has nothing to do. Returns the number of turns with work.
  int settle() {
    int turns = 0;
    while (sender_->do_work(clock_.tai_ns()) > 0 && turns < 1000) ++turns;
    return turns;
  }

  ConsoleTap& tap() { return *tap_; }
  Context& context() { return context_; }
  test::FakeClock& clock() { return clock_; }
  [[nodiscard]] int held() const { return script_.held.load(); }
  [[nodiscard]] const std::vector<float>& newest() const { return newest_; }

 private:
  test::FakeClock clock_;
  test::SourceScript script_;
  Context context_;
  test::ScriptedSource source_;
  std::optional<ConsoleTap> tap_;
  std::optional<Sender> sender_;
  std::uint64_t number_ = 0;
  std::vector<float> newest_;
};

TEST(ConsoleTap, TakesTheFrameAfterTheQuestionToTheFloat) {
  TapRig rig;
  ASSERT_TRUE(rig.publish());
  rig.settle();
  EXPECT_EQ(rig.tap().taken().header, nullptr) << "nobody has asked";
  ASSERT_TRUE(rig.tap().ask(0));
  EXPECT_FALSE(rig.tap().ask(0)) << "one at a time";
  ASSERT_TRUE(rig.publish());
  EXPECT_GT(rig.settle(), 2) << "it is copied piece by piece";
  const auto taken = rig.tap().taken();
  ASSERT_NE(taken.header, nullptr);
  EXPECT_EQ(taken.header->frame_number, 2U);
  EXPECT_EQ(taken.header->flags, 0U) << "what it did not ask for is no gap";
  ASSERT_EQ(taken.pixels.size(), rig.newest().size());
  EXPECT_TRUE(std::ranges::equal(taken.pixels, rig.newest()));
  EXPECT_EQ(rig.held(), 0);
}

TEST(ConsoleTap, AConsoleThatNeverTakesItsFrameHoldsNoSlotAndCountsAsNobody) {
  TapRig rig;
  ASSERT_TRUE(rig.tap().ask(0));
  for (int i = 0; i < 40; ++i) {
    ASSERT_TRUE(rig.publish()) << i;
    rig.settle();
  }
  EXPECT_EQ(rig.held(), 0);
  ASSERT_NE(rig.tap().taken().header, nullptr);
  EXPECT_EQ(rig.tap().taken().header->frame_number, 1U) << "it is not written over";
  for (const Counter counter :
       {Counter::frames_sent, Counter::frames_skipped, Counter::frames_left_out,
        Counter::frames_unread, Counter::frames_spilled}) {
    EXPECT_EQ(rig.context().counters.get(counter), 0U);
  }
  rig.tap().give_back();
  EXPECT_TRUE(rig.tap().ask(0));
}

TEST(ConsoleTap, AFrameThatLeavesTheWindowIsCopiedAtOnce) {
  TapRig rig;
  ASSERT_TRUE(rig.tap().ask(0));
  ASSERT_TRUE(rig.publish());
  const std::vector<float> first = rig.newest();
  // All in one turn of the sender: the frame is still being copied when five others push it out.
  for (int i = 0; i < 5; ++i) ASSERT_TRUE(rig.publish());
  rig.settle();
  const auto taken = rig.tap().taken();
  ASSERT_NE(taken.header, nullptr);
  EXPECT_EQ(taken.header->frame_number, 1U);
  EXPECT_TRUE(std::ranges::equal(taken.pixels, first));
  EXPECT_EQ(rig.held(), 0);
}

TEST(ConsoleTap, NotesTheTimesOfFramesOnlyWhileSomebodyLooks) {
  TapRig rig;
  ASSERT_TRUE(rig.publish());
  rig.settle();
  EXPECT_EQ(rig.tap().ticks().front(), nullptr);
  rig.tap().open(true);
  ASSERT_TRUE(rig.publish());
  rig.settle();
  const FrameTick* tick = rig.tap().ticks().front();
  ASSERT_NE(tick, nullptr);
  EXPECT_EQ(tick->frame_number, 2U);
  EXPECT_EQ(tick->published_ns, rig.clock().tai_ns());
}

TEST(ConsoleState, SendsTheTemperatureTableOfTheProduct) {
  Channel channel;
  channel.band_lo_um = 3.0;
  channel.band_hi_um = 5.0;
  const std::string bytes = console_temperatures(channel);
  const image::TemperatureTable table(3.0, 5.0);
  ASSERT_EQ(bytes.size(), table.radiances_w_m2_sr().size_bytes());
  EXPECT_EQ(std::memcmp(bytes.data(), table.radiances_w_m2_sr().data(), bytes.size()), 0);
  channel.quantity = protocol::PixelQuantity::drive;
  EXPECT_TRUE(console_temperatures(channel).empty()) << "drive is no radiance";
  EXPECT_TRUE(console_temperatures(Channel{}).empty()) << "no band";
}

TEST(ConsoleState, TellsTheTimesOfAFrameAndItsDeadlines) {
  TapRig rig;
  rig.tap().open(true);
  FrameTick* tick = rig.tap().ticks().claim();
  ASSERT_NE(tick, nullptr);
  *tick = {};
  tick->frame_number = 9;
  tick->host_received_ns = 1'000'000;
  tick->render_start_ns = 1'500'000;
  tick->readback_end_ns = 3'000'000;
  tick->published_ns = 3'250'000;
  tick->deadline_ns = 6'000'000;
  rig.tap().ticks().commit();
  rig.clock().set(4'250'000);
  const StatusBoard board;
  const std::string status = console_status(rig.context(), rig.tap(), board, {}, {true, 0, 1});
  EXPECT_NE(status.find("\"ticks\":[[9,0,1.0,1500.0,4500.0,2250.0,5000.0]]"), std::string::npos)
      << status;
  EXPECT_NE(status.find("\"running\":true,\"held\":false"), std::string::npos) << status;
  EXPECT_NE(status.find("\"picture\":null"), std::string::npos) << status;
}

TEST(ConsoleState, TellsWhatAHostWantsPeopleToSee) {
  TapRig rig;
  const auto status = [&] {
    return console_status(rig.context(), rig.tap(), StatusBoard(), {}, {true, 0, 1});
  };
  rig.context().picture.set({true, true, false, 281.5F, 310.25F});
  EXPECT_NE(status().find("\"picture\":{\"on\":true,\"black_hot\":true,\"automatic_gain\":false,"
                          "\"low_k\":281.5000,\"high_k\":310.2500}"),
            std::string::npos)
      << status();
  rig.context().picture.set({false, false, true, 0.0F, 0.0F});
  EXPECT_NE(status().find("\"on\":false,\"black_hot\":false,\"automatic_gain\":true"),
            std::string::npos);
  rig.context().picture.clear();
  EXPECT_NE(status().find("\"picture\":null"), std::string::npos);
}

}  // namespace
}  // namespace emit::server
