// SPDX-License-Identifier: Apache-2.0
// Images in a recorded log, against what a client of the same daemon received.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/record/frame_log.hpp"
#include "emit/v1/frame.pb.h"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;

constexpr std::size_t kRecordedFrames = 6;

class RecordFrames : public ::testing::Test {
 protected:
  /// Records a run of canned frames with their images, while a client receives them.
  void SetUp() override {
    std::string poses = "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz\n";
    for (std::size_t i = 0; i < kRecordedFrames; ++i)
      poses += fmt::format("0.{}0,{},0,10,1,0,0,0\n", i, i);
    const std::string sent = folder_.write("poses.csv", poses);
    DaemonProcess daemon(
        folder_,
        {"--config", folder_.write("emitd.toml", canned_config(64, 48, "mode = \"host-step\""))});
    ASSERT_TRUE(daemon.wait_ready()) << folder_.read("stderr");
    const std::string url = "tcp://" + daemon.control();
    ToolProcess client(folder_, "receive",
                       {"receive", url, "--frames", fmt::format("{}", kRecordedFrames), "--out",
                        folder_.file("received")});
    ASSERT_TRUE(client.says("emit: emitd "));
    ToolProcess recorder(
        folder_, "record",
        {"record", "--from", url, "--out", log_, "--with-frames", "--frames",
         fmt::format("{}", kRecordedFrames), "--json", folder_.file("record.json")});
    // The recorder subscribes before it creates the log.
    while (!std::filesystem::exists(log_) && !recorder.ended()) std::this_thread::yield();
    const ProcessResult played = run_emit({"send", sent, "--to", url, "--step"});
    ASSERT_EQ(played.exit_code, 0) << played.err;
    ASSERT_EQ(client.wait(), 0) << client.err();
    ASSERT_EQ(recorder.wait(), 0) << recorder.err();
  }
  ScratchFolder folder_;
  std::string log_ = folder_.file("run.mcap");
};

TEST_F(RecordFrames, are_the_images_that_a_client_received) {
  const std::string json = folder_.read("record.json");
  EXPECT_EQ(json_value(json, "images"), fmt::format("{}", kRecordedFrames));
  EXPECT_EQ(json_value(json, "images_compared"), fmt::format("{}", kRecordedFrames));
  EXPECT_EQ(json_value(json, "images_differ"), "0");
  EXPECT_EQ(json_value(json, "images_lost"), "0");
  EXPECT_LT(std::stoull(json_value(json, "stored_image_bytes")),
            std::stoull(json_value(json, "image_bytes")));
  const ProcessResult info = run_emit({"log", "info", log_});
  EXPECT_THAT(info.out, HasSubstr("schema      emit.v1.RecordedFrame, protobuf, "));

  const ProcessResult exported =
      run_emit({"log", "export", "exr", log_, "--out", folder_.file("exported")});
  EXPECT_EQ(exported.exit_code, 0) << exported.err;
  EXPECT_THAT(exported.out, HasSubstr("6 images, 6 compared with the journal, 0 differ"));
  for (std::size_t i = 1; i <= kRecordedFrames; ++i) {
    const std::string name = fmt::format("frame_{:06}.exr", i);
    const ProcessResult same =
        run_emit({"compare", folder_.file("received/" + name), folder_.file("exported/" + name),
                  "--json", folder_.file("compare.json")});
    EXPECT_EQ(same.exit_code, 0) << same.err;
    EXPECT_EQ(json_value(folder_.read("compare.json"), "identical"), "true") << name;
  }
}

TEST_F(RecordFrames, a_range_of_them_is_exported) {
  const ProcessResult exported = run_emit({"log", "export", "exr", log_, "--from-s", "0.2",
                                           "--to-s", "0.3", "--out", folder_.file("exported")});
  EXPECT_EQ(exported.exit_code, 0) << exported.err;
  EXPECT_TRUE(std::filesystem::exists(folder_.file("exported/frame_000003.exr")));
  EXPECT_TRUE(std::filesystem::exists(folder_.file("exported/frame_000004.exr")));
  EXPECT_FALSE(std::filesystem::exists(folder_.file("exported/frame_000002.exr")));
  EXPECT_FALSE(std::filesystem::exists(folder_.file("exported/frame_000005.exr")));
  const ProcessResult none =
      run_emit({"log", "export", "exr", log_, "--from-s", "9", "--out", folder_.file("exported")});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.err, HasSubstr("no frame from 9 s on"));
}

TEST_F(RecordFrames, describe_themselves) {
  auto reader = protocol::FrameLogReader::open(log_);
  ASSERT_TRUE(reader) << reader.error().text;
  std::uint64_t number = 0;
  for (auto more = reader->next(); more && *more; more = reader->next()) {
    const v1::RecordedFrame& frame = reader->frame();
    EXPECT_EQ(frame.frame_number(), ++number);
    EXPECT_EQ(frame.channel().name(), "canned");
    EXPECT_EQ(frame.width_px(), 64U);
    EXPECT_EQ(frame.compression(), v1::COMPRESSION_SHUFFLED_LZ4);
    EXPECT_EQ(protocol::crc32c(std::as_bytes(reader->pixels())), frame.crc32c());
    const auto header = protocol::decode_frame_header(std::as_bytes(std::span(frame.header())));
    ASSERT_TRUE(header) << header.error().text;
    EXPECT_EQ(header->payload_crc32c, frame.crc32c());
    EXPECT_EQ(header->sim_time_ns, frame.sim_time_ns());
  }
  EXPECT_EQ(number, kRecordedFrames);
}

TEST(ExportFrames, a_log_without_images_says_how_to_get_them) {
  const ScratchFolder folder;
  ASSERT_EQ(run_emit({"make-log", "box", "--rate-hz", "10", "--duration-s", "1", "--out",
                      folder.file("poses.mcap")})
                .exit_code,
            0);
  const ProcessResult result =
      run_emit({"log", "export", "exr", folder.file("poses.mcap"), "--out", folder.file("frames")});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("emit record --with-frames"));
}

}  // namespace
}  // namespace emit::test
