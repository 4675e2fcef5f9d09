// SPDX-License-Identifier: Apache-2.0
// The MCAP library of its authors reads a journal by its index and decodes it with its schemas.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <vector>

#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"
#include "support/peers.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;

/// Returns the text without spaces and line ends.
std::string packed(std::string text) {
  std::erase_if(text, [](char c) { return c == ' ' || c == '\n'; });
  return text;
}

TEST(PeerReader, another_program_reads_a_journal_by_its_index) {
  const std::string modules = node_peers({"@mcap/core", "@mcap/support", "protobufjs"});
  if (modules.empty()) {
    GTEST_SKIP() << "node with @mcap/core is missing: deploy/scripts/install_deps.sh --with-peers";
  }
  const ScratchFolder folder;
  constexpr int kReadFrames = 4000;  // several chunks of 256 KiB
  std::string poses = "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz\n";
  for (int i = 0; i < kReadFrames; ++i)
    poses += fmt::format("{:.3f},{},0,10,1,0,0,0\n", 0.005 * i, i);
  const std::string log = folder.write("poses.csv", poses);
  {
    DaemonProcess daemon(
        folder,
        {"--config", folder.write("emitd.toml", canned_config(64, 48, "mode = \"host-step\"",
                                                              "[journal]\nfile = "
                                                              "\"journal.mcap\"\n"))});
    ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
    const ProcessResult sent =
        run_emit({"send", log, "--to", "tcp://" + daemon.control(), "--step"});
    ASSERT_EQ(sent.exit_code, 0) << sent.err;
    daemon.signal(SIGTERM);
    ASSERT_EQ(daemon.wait(), 0);
  }
  const std::string journal = folder.file("journal.mcap");
  const ProcessResult peer =
      run_process({"env", "NODE_PATH=" + modules, "node",
                   EMIT_TEST_SOURCE_DIR "/server/tool/peers/read_journal.js", journal});
  ASSERT_EQ(peer.exit_code, 0) << peer.err;

  std::string run_id;
  std::vector<std::string> frames;
  std::vector<std::string> crcs;
  std::uint64_t messages = 0;
  auto reader = protocol::LogReader::open(journal);
  ASSERT_TRUE(reader) << reader.error().text;
  for (auto more = reader->next(); more && *more; more = reader->next()) {
    ++messages;
    const v1::JournalEntry& entry = reader->journal();
    if (entry.has_run_start()) run_id = std::to_string(entry.run_start().run_id());
    if (!entry.has_frame()) continue;
    frames.push_back(std::to_string(entry.frame().frame_number()));
    crcs.push_back(std::to_string(entry.frame().radiance_crc32c()));
  }
  ASSERT_EQ(frames.size(), static_cast<std::size_t>(kReadFrames));
  const std::string seen = packed(peer.out);
  EXPECT_THAT(seen, HasSubstr("\"topics\":[\"host\",\"journal\"]"));
  EXPECT_THAT(seen, HasSubstr(fmt::format("\"messages\":\"{}\"", messages)));
  EXPECT_THAT(seen, HasSubstr(fmt::format("\"read\":{},", messages)));
  EXPECT_THAT(seen, HasSubstr(fmt::format("\"frames\":[{}]", fmt::join(frames, ","))));
  EXPECT_THAT(seen, HasSubstr(fmt::format("\"crcs\":[{}]", fmt::join(crcs, ","))));
  EXPECT_THAT(seen, HasSubstr(fmt::format("\"run\":\"{}\"", run_id)));
  EXPECT_THAT(seen, HasSubstr(R"("pacing.mode":"\"host-step\"")"));
  EXPECT_THAT(seen, HasSubstr("\"channels\":[\"canned\"]"));
  // The last frames were found by their log times, without reading the whole file.
  const std::string late = json_value(peer.out, "late_bytes");
  ASSERT_FALSE(late.empty());
  EXPECT_LT(std::stoull(late), 3 * std::filesystem::file_size(journal) / 4);
  EXPECT_THAT(seen, HasSubstr(fmt::format(",{}],\"late_bytes\"", kReadFrames)));
}

}  // namespace
}  // namespace emit::test
