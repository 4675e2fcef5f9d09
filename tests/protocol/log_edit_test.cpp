// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/log_edit.hpp"

#include <gmock/gmock.h>

#include <random>

#include "emit/protocol/record/mcap_summary.hpp"
#include "emit/protocol/record/mcap_writer.hpp"
#include "protocol/journals.hpp"

namespace emit::protocol {
namespace {

using physics::ErrorCode;
using test::bytes_of;
using test::JournalMaker;
using test::LogFolder;
using test::messages_of;
using test::set_bytes;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Files = std::vector<std::filesystem::path>;
using test::kWallNs;
constexpr std::int64_t kLaterNs = kWallNs + 1'000'000'000;

/// Two runs of one daemon, with 6 and 8 frames at 10 ms.
void write_two_runs(const std::filesystem::path& file) {
  JournalMaker journal(file, kWallNs);
  journal.run_start(1);
  journal.frames(1, 6);
  journal.command(v1::Command::KIND_RESET);
  journal.run_start(2);
  journal.frames(1, 8);
}

void expect_complete(const std::filesystem::path& file) {
  const auto summary = read_mcap_summary(file);
  ASSERT_TRUE(summary) << summary.error().text;
  EXPECT_EQ(summary->state, McapSummary::State::complete) << summary->problem;
  for (const auto& [id, channel] : summary->channels) {
    ASSERT_TRUE(summary->schemas.contains(channel.schema_id));
    EXPECT_FALSE(summary->schemas.at(channel.schema_id).data.empty());
  }
}

TEST(LogCut, KeepsEveryEntryFromTheStartOfTheDaemonToTheEndOfTheRange) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  const auto out = folder.file("out.mcap");
  write_two_runs(in);
  const auto cut = cut_log(in, out, {.from_ns = 30'000'000, .to_ns = 52'000'000, .run_id = 2});
  ASSERT_TRUE(cut) << cut.error().text;
  EXPECT_TRUE(cut->journal);
  EXPECT_EQ(cut->run_id, 2U);
  EXPECT_EQ(cut->frames, 3U);
  EXPECT_EQ(cut->frames_before, 2U);
  EXPECT_EQ(cut->earlier_runs, 1U);
  expect_complete(out);
  const auto whole = messages_of(in);
  auto expected = whole;
  // The entries of run 1, the start of run 2, its host frames and frames 1 to 5, and host frame 6.
  expected.resize(14 + 1 + 10 + 1);
  EXPECT_EQ(messages_of(out), expected);
  EXPECT_EQ(folder.files(), 2) << "no temporary file is left";
}

TEST(LogCut, ARunAloneIsKeptOnDemand) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  const auto out = folder.file("out.mcap");
  write_two_runs(in);
  const auto cut = cut_log(in, out, {.run_id = 2, .only_run = true});
  ASSERT_TRUE(cut) << cut.error().text;
  EXPECT_EQ(cut->earlier_runs, 0U);
  EXPECT_EQ(cut->left_out_runs, 1U);
  EXPECT_EQ(cut->frames, 8U);
  const auto outline = outline_log(out);
  ASSERT_TRUE(outline);
  ASSERT_EQ(outline->runs.size(), 1U);
  EXPECT_EQ(outline->runs[0].first_sequence, 15U) << "entries keep their numbers";
  auto reader = McapReader::open(out);
  ASSERT_TRUE(reader && reader->next().value());
  EXPECT_EQ(reader->message().sequence, 1U) << "messages are numbered anew";
}

TEST(LogCut, TheRunMustBeClear) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  const auto out = folder.file("out.mcap");
  write_two_runs(in);
  const auto both = cut_log(in, out, {.from_ns = 30'000'000});
  ASSERT_FALSE(both);
  EXPECT_EQ(both.error().code, ErrorCode::invalid_argument);
  EXPECT_THAT(both.error().text, HasSubstr("2 runs have frames from 0.03 s on"));
  EXPECT_THAT(both.error().text, HasSubstr("1 (0.01 s to 0.06 s), 2 (0.01 s to 0.08 s)"));
  const auto one = cut_log(in, out, {.from_ns = 70'000'000});
  ASSERT_TRUE(one) << one.error().text;
  EXPECT_EQ(one->run_id, 2U);
  const auto none = cut_log(in, out, {.from_ns = 90'000'000});
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().text, HasSubstr("no frame from 0.09 s on; runs: 1 ("));
  const auto between = cut_log(in, out, {.from_ns = 31'000'000, .to_ns = 39'000'000, .run_id = 1});
  ASSERT_FALSE(between);
  EXPECT_THAT(between.error().text, HasSubstr("run 1 has no frame from 0.031 s to 0.039 s"));
  const auto unknown = cut_log(in, out, {.run_id = 3});
  ASSERT_FALSE(unknown);
  EXPECT_THAT(unknown.error().text, HasSubstr("in run 3"));
  EXPECT_FALSE(cut_log(in, out, {.from_ns = 2, .to_ns = 1}));
}

TEST(LogCut, WhatDoesNotReplayIsRefused) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  const auto out = folder.file("out.mcap");
  {
    JournalMaker journal(in, kWallNs, 10);
    journal.frames(1, 3);
    journal.run_start(2);
    journal.frames(1, 3);
    journal.lose(2);
    journal.frames(5, 6);
  }
  const auto middle = cut_log(in, out, {.to_ns = 20'000'000, .run_id = 2});
  ASSERT_FALSE(middle);
  EXPECT_THAT(middle.error().text, HasSubstr("begins in the middle of a run, at entry 11"));
  const auto gap = cut_log(in, out, {.run_id = 2, .only_run = true});
  ASSERT_FALSE(gap);
  EXPECT_THAT(gap.error().text, HasSubstr("in.mcap: offset "));
  EXPECT_THAT(gap.error().text, HasSubstr("entry 26 follows 23"));
  EXPECT_FALSE(std::filesystem::exists(out));
  const auto before = cut_log(in, out, {.to_ns = 30'000'000, .run_id = 2, .only_run = true});
  EXPECT_FALSE(before) << "the entry behind the gap tells that the range is over";
  const auto early = cut_log(in, out, {.to_ns = 20'000'000, .run_id = 2, .only_run = true});
  EXPECT_TRUE(early) << early.error().text;
}

TEST(LogCut, ACutOffLogIsCutAndADamagedOneIsNot) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  const auto out = folder.file("out.mcap");
  {
    JournalMaker journal(in, kWallNs);
    journal.run_start(1);
    journal.frames(1, 60);
  }
  const std::string whole = bytes_of(in);
  set_bytes(in, std::string_view(whole).substr(0, whole.size() / 2));
  const auto cut = cut_log(in, out, {.to_ns = 30'000'000});
  ASSERT_TRUE(cut) << cut.error().text;
  EXPECT_EQ(cut->frames, 3U);
  ASSERT_TRUE(cut->truncation);
  EXPECT_THAT(*cut->truncation, HasSubstr("offset "));
  expect_complete(out);

  std::string damaged = whole;
  damaged[whole.find("llvmpipe")] ^= 1;
  set_bytes(in, damaged);
  const std::string kept = bytes_of(out);
  const auto refused = cut_log(in, out, {.to_ns = 30'000'000});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr(in.string() + ": offset "));
  EXPECT_EQ(bytes_of(out), kept) << "an older result survives";
  EXPECT_EQ(folder.files(), 2);
}

TEST(LogCut, TheInputIsNotWrittenOverUnderAnyName) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  write_two_runs(in);
  const std::string whole = bytes_of(in);
  const auto link = folder.file("link.mcap");
  std::filesystem::create_symlink(in, link);
  for (const auto& out : {in, link}) {
    const auto cut = cut_log(in, out, {.run_id = 1});
    ASSERT_FALSE(cut);
    EXPECT_EQ(cut.error().code, ErrorCode::invalid_argument);
    EXPECT_THAT(cut.error().text, HasSubstr(out.string() + ": is an input"));
  }
  EXPECT_EQ(bytes_of(in), whole);
  const auto device = cut_log(in, "/dev/null", {.run_id = 1});
  ASSERT_FALSE(device);
  EXPECT_THAT(device.error().text, HasSubstr("/dev/null: cannot write: "));
  const auto nowhere = cut_log(in, folder.file("none/out.mcap"), {.run_id = 1});
  ASSERT_FALSE(nowhere);
  EXPECT_EQ(nowhere.error().code, ErrorCode::io);
}

TEST(LogCut, ADamagedByteIsAnErrorWithItsOffsetOrChangesNothing) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  const auto other = folder.file("other.mcap");
  const auto out = folder.file("out.mcap");
  write_two_runs(in);
  {
    JournalMaker journal(other, kLaterNs);
    journal.run_start(3);
  }
  const Files inputs{in, other};
  const std::string whole = bytes_of(in);
  std::mt19937 random(4);
  int errors = 0;
  for (int i = 0; i < 300; ++i) {
    std::string bytes = whole;
    bytes[random() % bytes.size()] ^= static_cast<char>(1 + random() % 255);
    set_bytes(in, bytes);
    const auto cut = cut_log(in, out, {.to_ns = 40'000'000, .run_id = 2});
    const auto merged = merge_logs(inputs, out, {});
    EXPECT_EQ(cut.has_value(), merged.has_value());
    if (cut && merged) continue;
    ++errors;
    EXPECT_THAT(cut.error().text, HasSubstr(in.string() + ": offset "));
    EXPECT_THAT(merged.error().text, HasSubstr(in.string() + ": offset "));
  }
  EXPECT_GT(errors, 40);
  EXPECT_LE(folder.files(), 3) << "no temporary file is left";
}

/// Writes frames 1 to 9 at 10 ms. The first has weather and two entities; frame 2 moves entity 1
/// and hides entity 2; the others have no entity but frame 6, which shows entity 2 again.
void write_pose_log(const std::filesystem::path& file) {
  auto writer = LogWriter::create(file);
  ASSERT_TRUE(writer);
  for (std::uint64_t i = 1; i <= 9; ++i) {
    auto frame = test::make_host_frame(0);
    if (i != 1) frame->environment.reset();
    frame->frame_number = i;
    frame->sim_time_ns = static_cast<std::int64_t>(i) * 10'000'000;
    frame->part_count = 0;
    const auto drive = [&](std::uint32_t part_id, double throttle) {
      frame->parts[frame->part_count++] = {1, part_id, PartCommandData::Kind::throttle, throttle};
    };
    if (i == 1) drive(1, 0.25);
    if (i == 2) drive(1, 0.5);
    if (i == 3) drive(2, 1.0);
    if (i == 6) drive(2, 0.0);
    if (i == 2) frame->fov_h_rad = 0.125;
    if (i == 3) frame->gimbal_rad = glm::dvec3(0.1, 0.2, 0.3);
    const auto add = [&](std::uint32_t id, double x, bool has_pose, bool on) {
      EntityStateData& state = frame->entities[frame->entity_count++];
      state.entity_id = id;
      state.has_pose = has_pose;
      state.pose.position_world_m.x = x;
      state.on = on;
      if (has_pose) state.rates = PoseRates{{9.0, 0.0, 0.0}, {}};
    };
    if (i == 1) {
      add(1, 10.0, true, true);
      add(2, 20.0, true, true);
    } else if (i == 2) {
      add(1, 11.0, true, true);
      add(2, 0.0, false, false);
    } else if (i == 6) {
      add(2, 0.0, false, true);
    }
    ASSERT_TRUE(writer->write_host(*frame, frame->sim_time_ns));
  }
}

TEST(LogCut, TheFirstFrameOfAPoseLogCarriesWhatEarlierOnesSet) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  const auto out = folder.file("out.mcap");
  write_pose_log(in);
  const auto cut = cut_log(in, out, {.from_ns = 55'000'000, .to_ns = 80'000'000});
  ASSERT_TRUE(cut) << cut.error().text;
  EXPECT_FALSE(cut->journal);
  EXPECT_EQ(cut->frames, 3U);
  EXPECT_EQ(cut->carried_entities, 2U);
  EXPECT_TRUE(cut->carried_weather);
  EXPECT_EQ(cut->carried_parts, 1U);
  EXPECT_TRUE(cut->carried_view);
  auto log = LogReader::open(out);
  ASSERT_TRUE(log && log->next().value());
  const HostFrameData first = log->host();
  EXPECT_EQ(first.frame_number, 6U);
  ASSERT_TRUE(first.environment);
  EXPECT_EQ(first.environment->air_k, 288.5);
  ASSERT_EQ(first.entity_count, 2U);
  EXPECT_EQ(first.entities[0].entity_id, 2U);
  EXPECT_TRUE(first.entities[0].on) << "the frame's own state counts";
  EXPECT_EQ(first.entities[0].pose.position_world_m.x, 20.0);
  EXPECT_EQ(first.entities[1].entity_id, 1U);
  EXPECT_EQ(first.entities[1].pose.position_world_m.x, 11.0);
  EXPECT_TRUE(first.entities[1].teleport);
  EXPECT_FALSE(first.entities[1].rates);
  ASSERT_EQ(first.part_count, 2U);
  EXPECT_EQ(first.parts[0].part_id, 2U);
  EXPECT_EQ(first.parts[0].value, 0.0) << "the frame's own command counts";
  EXPECT_EQ(first.parts[1].part_id, 1U);
  EXPECT_EQ(first.parts[1].value, 0.5);
  EXPECT_EQ(first.fov_h_rad, 0.125);
  EXPECT_EQ(first.gimbal_rad, glm::dvec3(0.1, 0.2, 0.3));
  const auto whole = messages_of(in);
  const auto kept = messages_of(out);
  ASSERT_EQ(kept.size(), 3U);
  EXPECT_EQ(kept[1], whole[6]);
  EXPECT_EQ(kept[2], whole[7]);
  const auto begin = cut_log(in, out, {.to_ns = 30'000'000});
  ASSERT_TRUE(begin);
  EXPECT_EQ(messages_of(out)[0], whole[0]) << "nothing is carried, nothing changes";
}

TEST(LogMerge, JournalsOfSuccessiveDaemonsAreJoinedByTime) {
  const LogFolder folder;
  const auto old = folder.file("old.mcap");
  const auto young = folder.file("young.mcap");
  const auto out = folder.file("out.mcap");
  write_two_runs(old);
  {
    JournalMaker journal(young, kLaterNs);
    journal.run_start(3);
    journal.frames(1, 2);
  }
  const Files inputs{young, old};
  const auto merged = merge_logs(inputs, out, {.software = "test 1"});
  ASSERT_TRUE(merged) << merged.error().text;
  EXPECT_EQ(merged->runs, 3U);
  EXPECT_EQ(merged->frames, 16U);
  EXPECT_THAT(merged->order, ElementsAre(old, young));
  EXPECT_TRUE(merged->notes.empty());
  auto expected = messages_of(old);
  for (const std::string& message : messages_of(young)) expected.push_back(message);
  EXPECT_EQ(messages_of(out), expected);
  expect_complete(out);
  const auto outline = outline_log(out);
  ASSERT_TRUE(outline);
  EXPECT_EQ(outline->facts.library, "test 1");
  EXPECT_EQ(outline->gap_count, 0U);
  EXPECT_EQ(outline->schemas.size(), 2U);
  EXPECT_EQ(outline->topics.size(), 2U);
  ASSERT_EQ(outline->runs.size(), 3U);
  EXPECT_TRUE(outline->runs[2].begins_process);
  // The part that a daemon recorded can be cut out again.
  const auto again = folder.file("again.mcap");
  const auto cut = cut_log(out, again, {.run_id = 3});
  ASSERT_TRUE(cut) << cut.error().text;
  EXPECT_EQ(messages_of(again), messages_of(young));
}

TEST(LogMerge, PartsOfOneRunAreJoinedWhereTheNumbersGoOn) {
  const LogFolder folder;
  const auto first = folder.file("1.mcap");
  const auto second = folder.file("2.mcap");
  const auto third = folder.file("3.mcap");
  const auto out = folder.file("out.mcap");
  std::uint64_t sequence = 0;
  {
    JournalMaker journal(first, kWallNs);
    journal.run_start(1);
    journal.frames(1, 3);
    sequence = journal.sequence();
  }
  {
    JournalMaker journal(second, kLaterNs, sequence);
    journal.frames(4, 5);
  }
  {
    JournalMaker journal(third, kLaterNs, sequence + 1);
    journal.frames(4, 5);
  }
  const Files follows{second, first};
  const auto merged = merge_logs(follows, out, {});
  ASSERT_TRUE(merged) << merged.error().text;
  const auto outline = outline_log(out);
  ASSERT_TRUE(outline);
  ASSERT_EQ(outline->runs.size(), 1U);
  EXPECT_EQ(outline->runs[0].frames, 5U);
  const Files jumps{first, third};
  const auto refused = merge_logs(jumps, folder.file("no.mcap"), {});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("begins in the middle of a run, at entry 9"));
  EXPECT_FALSE(std::filesystem::exists(folder.file("no.mcap")));
}

TEST(LogMerge, WhatIsNotOneJournalIsRefusedByFileAndReason) {
  const LogFolder folder;
  const auto a = folder.file("a.mcap");
  const auto out = folder.file("out.mcap");
  {
    JournalMaker journal(a, kWallNs);
    journal.run_start(1);
    journal.frames(1, 2);
  }
  const auto refusal = [&](std::int64_t wall_ns, std::uint64_t run_id, const std::string& sha256,
                           std::uint64_t sequence) {
    const auto b = folder.file("b.mcap");
    {
      JournalMaker journal(b, wall_ns, sequence);
      journal.run_start(run_id, sha256);
      journal.frames(1, 2);
    }
    const Files inputs{a, b};
    const auto merged = merge_logs(inputs, out, {});
    EXPECT_FALSE(merged);
    EXPECT_FALSE(std::filesystem::exists(out));
    if (merged) return std::string();
    EXPECT_EQ(merged.error().code, ErrorCode::unsupported);
    EXPECT_THAT(merged.error().text, HasSubstr("a.mcap"));
    EXPECT_THAT(merged.error().text, HasSubstr("b.mcap cannot be merged: "));
    return merged.error().text;
  };
  EXPECT_THAT(refusal(kLaterNs, 1, "aa", 0), HasSubstr("both hold run 1"));
  EXPECT_THAT(refusal(kLaterNs, 2, "bb", 0), HasSubstr("different scenarios (SHA-256 aa and bb)"));
  EXPECT_THAT(refusal(kWallNs + 2'000'000, 2, "aa", 0), HasSubstr("their runs overlap"));
  EXPECT_THAT(refusal(kLaterNs, 2, "aa", 20), HasSubstr("entries 6 to 20 are missing"));
  const Files twice{a, a};
  EXPECT_THAT(merge_logs(twice, out, {}).error().text, HasSubstr("more than once"));
  const Files one{a};
  EXPECT_EQ(merge_logs(one, out, {}).error().code, ErrorCode::invalid_argument);
}

TEST(LogMerge, PoseLogsFollowEachOtherOrAreOfOtherRuns) {
  const LogFolder folder;
  const auto a = folder.file("a.mcap");
  const auto b = folder.file("b.mcap");
  const auto out = folder.file("out.mcap");
  const auto write = [](const std::filesystem::path& file, std::uint64_t run_id,
                        std::uint64_t first) {
    auto writer = LogWriter::create(file);
    auto frame = test::make_host_frame(1);
    frame->run_id = run_id;
    for (std::uint64_t i = first; i < first + 3; ++i) {
      frame->frame_number = i;
      frame->sim_time_ns = static_cast<std::int64_t>(i);
      ASSERT_TRUE(writer->write_host(*frame, frame->sim_time_ns));
    }
  };
  const Files inputs{a, b};
  write(a, 1, 1);
  write(b, 1, 4);
  ASSERT_TRUE(merge_logs(inputs, out, {}));
  EXPECT_EQ(outline_log(out)->host_runs.at(0).frames, 6U);
  write(b, 1, 2);
  EXPECT_THAT(merge_logs(inputs, out, {}).error().text,
              HasSubstr("host frames of run 1 for the same simulation time"));
}

TEST(LogMerge, OtherTopicsKeepTheirNumbersAndSchemas) {
  const LogFolder folder;
  const auto a = folder.file("a.mcap");
  const auto b = folder.file("b.mcap");
  const auto out = folder.file("out.mcap");
  for (const auto& [file, offset] : {std::pair{a, 0}, std::pair{b, 5}}) {
    auto mcap = McapWriter::create(file, {.profile = "ros2"});
    ASSERT_TRUE(mcap);
    const auto schema = mcap->add_schema("pkg.Other", "protobuf", "x");
    const auto camera = mcap->add_channel(*schema, "camera", "protobuf");
    ASSERT_TRUE(camera);
    for (std::uint32_t i = 0; i < 3; ++i) {
      ASSERT_TRUE(mcap->write(*camera, 100 + i, std::int64_t{10} * i + offset, 0, {}));
    }
  }
  const Files inputs{b, a};
  const auto merged = merge_logs(inputs, out, {});
  ASSERT_TRUE(merged) << merged.error().text;
  auto reader = McapReader::open(out);
  ASSERT_TRUE(reader);
  std::vector<std::uint64_t> times;
  std::vector<std::uint32_t> sequences;
  while (reader->next().value()) {
    times.push_back(reader->message().log_time_ns);
    sequences.push_back(reader->message().sequence);
  }
  EXPECT_THAT(times, ElementsAre(0, 5, 10, 15, 20, 25));
  EXPECT_THAT(sequences, ElementsAre(100, 100, 101, 101, 102, 102));
  EXPECT_EQ(reader->schemas().size(), 1U);
  EXPECT_EQ(reader->channels().size(), 1U);
  EXPECT_EQ(reader->facts().profile, "ros2");
}

TEST(LogMerge, CutOffPartsAreJoinedWithANoteAndDamagedOnesAreNot) {
  const LogFolder folder;
  const auto a = folder.file("a.mcap");
  const auto b = folder.file("b.mcap");
  const auto out = folder.file("out.mcap");
  write_two_runs(a);
  {
    JournalMaker journal(b, kLaterNs);
    journal.run_start(3);
    journal.frames(1, 2);
  }
  const std::string whole = bytes_of(a);
  set_bytes(a, std::string_view(whole).substr(0, whole.size() / 2));
  const Files inputs{a, b};
  const auto merged = merge_logs(inputs, out, {});
  ASSERT_TRUE(merged) << merged.error().text;
  ASSERT_EQ(merged->notes.size(), 1U);
  EXPECT_THAT(merged->notes[0], HasSubstr(a.string() + ": offset "));
  expect_complete(out);
  std::filesystem::remove(out);
  std::string damaged = whole;
  damaged[whole.find("llvmpipe")] ^= 1;
  set_bytes(a, damaged);
  const auto refused = merge_logs(inputs, out, {});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr(a.string() + ": offset "));
  EXPECT_EQ(folder.files(), 2);
}

}  // namespace
}  // namespace emit::protocol
