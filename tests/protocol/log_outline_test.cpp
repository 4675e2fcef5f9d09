// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/log_outline.hpp"

#include <gmock/gmock.h>

#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/record/mcap_summary.hpp"
#include "emit/protocol/record/mcap_writer.hpp"
#include "protocol/journals.hpp"

namespace emit::protocol {
namespace {

using test::bytes_of;
using test::JournalMaker;
using test::kWallNs;
using test::LogFolder;
using test::set_bytes;
using ::testing::HasSubstr;

std::uint64_t with_flag(const LogOutline& outline, FrameFlags flag) {
  for (std::size_t bit = 0; bit < outline.frames_with_flag.size(); ++bit) {
    if (std::uint32_t{flag} == 1U << bit) return outline.frames_with_flag[bit];
  }
  return 0;
}

TEST(LogOutlineOf, AJournalHasItsRunsFramesFlagsAndTimes) {
  const LogFolder folder;
  const auto file = folder.file("a.mcap");
  {
    JournalMaker journal(file, kWallNs);
    journal.run_start(9);
    journal.frames(1, 4);
    journal.frame(5, kFlagLate | kFlagRepeated, false);
    journal.command(v1::Command::KIND_RESET);
    journal.run_start(10);
    journal.frames(1, 2);
  }
  const auto outline = outline_log(file);
  ASSERT_TRUE(outline) << outline.error().text;
  EXPECT_FALSE(outline->damage);
  EXPECT_FALSE(outline->truncation);
  EXPECT_EQ(outline->facts.library, "emitd test");
  EXPECT_EQ(outline->facts.file_bytes, bytes_of(file).size());
  EXPECT_GT(outline->facts.chunks, 1U);
  ASSERT_EQ(outline->topics.size(), 2U);
  EXPECT_EQ(outline->topics[0].topic, "journal");
  EXPECT_EQ(outline->topics[0].messages, 17U);
  EXPECT_EQ(outline->topics[0].log_time->first_ns, kWallNs);
  EXPECT_EQ(outline->topics[0].log_time->last_ns, kWallNs + 16'000'000);
  EXPECT_EQ(outline->topics[0].sim_time->last_ns, 50'000'000);
  EXPECT_EQ(outline->topics[1].topic, "host");
  EXPECT_EQ(outline->topics[1].messages, 0U);
  EXPECT_EQ(outline->schemas.size(), 2U);
  ASSERT_EQ(outline->runs.size(), 2U);
  const LogRunOutline& first = outline->runs[0];
  EXPECT_TRUE(first.has_start);
  EXPECT_TRUE(first.begins_process);
  EXPECT_EQ(first.run_id, 9U);
  EXPECT_EQ(first.scenario_name, "world, \"new\"");
  EXPECT_EQ(first.scenario_sha256, "aa");
  EXPECT_EQ(first.device, "llvmpipe");
  EXPECT_EQ(first.first_time_ns, 1'500'000'000);
  EXPECT_EQ(first.first_sequence, 1U);
  EXPECT_EQ(first.last_sequence, 12U);
  EXPECT_EQ(first.host_frames, 5U);
  EXPECT_EQ(first.commands, 1U);
  EXPECT_EQ(first.frames, 5U);
  EXPECT_EQ(first.rendered, 4U);
  EXPECT_EQ(first.last_frame, 5U);
  EXPECT_EQ(first.sim_time->first_ns, 10'000'000);
  EXPECT_EQ(first.sim_time->last_ns, 50'000'000);
  EXPECT_FALSE(outline->runs[1].begins_process) << "the same daemon goes on";
  EXPECT_EQ(outline->frames, 7U);
  EXPECT_EQ(outline->rendered, 6U);
  EXPECT_EQ(with_flag(*outline, kFlagLate), 1U);
  EXPECT_EQ(with_flag(*outline, kFlagRepeated), 1U);
  EXPECT_EQ(with_flag(*outline, kFlagStale), 0U);
  EXPECT_EQ(outline->gap_count, 0U);
}

TEST(LogOutlineOf, GapsAreListedAndARestartIsNone) {
  const LogFolder folder;
  const auto file = folder.file("a.mcap");
  {
    JournalMaker journal(file, kWallNs, 40);
    journal.frames(1, 1);
    journal.lose(3);
    journal.frames(3, 3);
    journal.run_start(5);
    journal.lose(1);
    journal.frames(1, 1);
  }
  const auto outline = outline_log(file);
  ASSERT_TRUE(outline) << outline.error().text;
  ASSERT_EQ(outline->runs.size(), 2U);
  EXPECT_FALSE(outline->runs[0].has_start);
  EXPECT_EQ(outline->runs[0].first_sequence, 41U);
  EXPECT_EQ(outline->gap_count, 2U);
  EXPECT_EQ(outline->missing_entries, 4U);
  ASSERT_EQ(outline->gaps.size(), 2U);
  EXPECT_EQ(outline->gaps[0].first_missing, 43U);
  EXPECT_EQ(outline->gaps[0].last_missing, 45U);
}

TEST(LogOutlineOf, HostFramesAreListedByRun) {
  const LogFolder folder;
  const auto file = folder.file("a.mcap");
  {
    auto writer = LogWriter::create(file);
    auto frame = test::make_host_frame(2);
    for (std::uint64_t i = 1; i <= 5; ++i) {
      frame->run_id = i < 4 ? 1 : 2;
      frame->frame_number = i;
      frame->sim_time_ns = static_cast<std::int64_t>(i) * 1'000'000;
      ASSERT_TRUE(writer->write_host(*frame, frame->sim_time_ns));
    }
  }
  const auto outline = outline_log(file);
  ASSERT_TRUE(outline) << outline.error().text;
  ASSERT_EQ(outline->host_runs.size(), 2U);
  EXPECT_EQ(outline->host_runs[0].frames, 3U);
  EXPECT_EQ(outline->host_runs[1].first_frame, 4U);
  EXPECT_EQ(outline->host_runs[1].sim_time->last_ns, 5'000'000);
  EXPECT_TRUE(outline->runs.empty());
}

TEST(LogOutlineOf, ADamagedFileIsDescribedUpToTheOffsetOfTheDamage) {
  const LogFolder folder;
  const auto file = folder.file("a.mcap");
  {
    JournalMaker journal(file, kWallNs);
    journal.run_start(1);
    journal.frames(1, 40);
  }
  std::string bytes = bytes_of(file);
  bytes[bytes.size() / 2] ^= 1;
  set_bytes(file, bytes);
  const auto outline = outline_log(file);
  ASSERT_TRUE(outline) << outline.error().text;
  ASSERT_TRUE(outline->damage);
  EXPECT_THAT(outline->damage->text, HasSubstr(file.string() + ": offset "));
  EXPECT_GT(outline->frames, 0U);
  EXPECT_LT(outline->frames, 40U);
}

TEST(LogOutlineOf, AReaderThatWasToldToStopStops) {
  const LogFolder folder;
  const auto file = folder.file("a.mcap");
  {
    JournalMaker journal(file, kWallNs);
    journal.run_start(1);
  }
  const auto outline = outline_log(file, [](std::uint64_t) { return false; });
  ASSERT_FALSE(outline);
  EXPECT_THAT(outline.error().text, HasSubstr("stopped"));
}

TEST(McapSummaryOf, AClosedLogHasOneAndACutOffLogHasNone) {
  const LogFolder folder;
  const auto file = folder.file("a.mcap");
  {
    JournalMaker journal(file, kWallNs);
    journal.run_start(1);
    journal.frames(1, 9);
  }
  const auto summary = read_mcap_summary(file);
  ASSERT_TRUE(summary) << summary.error().text;
  EXPECT_EQ(summary->state, McapSummary::State::complete) << summary->problem;
  ASSERT_TRUE(summary->statistics);
  EXPECT_EQ(summary->statistics->messages, 19U);
  EXPECT_EQ(summary->statistics->first_ns, static_cast<std::uint64_t>(kWallNs));
  EXPECT_EQ(summary->channels.size(), 2U);
  EXPECT_EQ(summary->schemas.size(), 2U);
  EXPECT_EQ(summary->chunks_of_compression.size(), 1U);
  EXPECT_GT(summary->chunks_of_compression.at(""), 1U);

  const std::string whole = bytes_of(file);
  set_bytes(file, std::string_view(whole).substr(0, whole.size() - 3));
  const auto cut = read_mcap_summary(file);
  ASSERT_TRUE(cut);
  EXPECT_EQ(cut->state, McapSummary::State::none);
  EXPECT_THAT(cut->problem, HasSubstr("without a footer"));
}

TEST(McapSummaryOf, EveryDamagedByteIsFound) {
  const LogFolder folder;
  const auto file = folder.file("a.mcap");
  {
    JournalMaker journal(file, kWallNs);
    journal.run_start(1);
  }
  const std::string whole = bytes_of(file);
  constexpr std::size_t kFooterBytes = 29 + 8;
  const std::size_t summary =
      static_cast<unsigned char>(whole[whole.size() - kFooterBytes + 9]) +
      256U * static_cast<unsigned char>(whole[whole.size() - kFooterBytes + 10]);
  for (std::size_t at = summary; at < whole.size(); at += 7) {
    std::string bytes = whole;
    bytes[at] ^= 0x10;
    set_bytes(file, bytes);
    const auto read = read_mcap_summary(file);
    ASSERT_TRUE(read);
    EXPECT_NE(read->state, McapSummary::State::complete) << at;
    EXPECT_THAT(read->problem, HasSubstr(": offset ")) << at;
  }
}

}  // namespace
}  // namespace emit::protocol
