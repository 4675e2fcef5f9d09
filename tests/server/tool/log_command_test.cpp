// SPDX-License-Identifier: Apache-2.0
// Command emit log: what it prints, writes and refuses. The formats are tested in tests/protocol.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "emit/protocol/frame_header.hpp"
#include "protocol/journals.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr const char* kPoses =
    "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz,frame_number\n"
    "0.5,0,0,10,0,0.7071067811865476,0.7071067811865476,0,7\n"
    "0.505,1,0,10,0,0.7071067811865476,0.7071067811865476,0,8\n";

class CliLog : public testing::Test {
 protected:
  void SetUp() override {
    JournalMaker journal(log_, kWallNs);
    journal.run_start(9, "0123abcd");
    journal.frames(1, 3);
    journal.frame(4, protocol::kFlagLate | protocol::kFlagNonFinite, false);
  }
  [[nodiscard]] std::string file(const std::string& name) const { return folder_.file(name); }
  /// Runs `emit log` with these arguments.
  static ProcessResult log(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "log");
    return run_emit(arguments);
  }

  TemporaryFolder folder_;
  const std::string log_ = folder_.file("run.mcap");
};

TEST_F(CliLog, info_describes_a_journal) {
  const ProcessResult text = log({"info", log_});
  EXPECT_EQ(text.exit_code, 0) << text.err;
  for (const char* expected :
       {"run.mcap: journal of emitd\n", "complete, with index and footer", "compression none",
        "emit.v1.JournalEntry, protobuf, ", "2027-01-15T08:00:00.000000 TAI",
        "run 9, from 2027-01-15T08:00:00.000000 TAI, the first of a daemon", "SHA-256 0123abcd",
        "emitd test on llvmpipe, pacing host-step, warmed up for 1.500000 s",
        "4 (3 rendered), numbers 1 to 4, 0.010000 s to 0.040000 s", "flags: late 1, non_finite 1\n",
        "sequence    no gap", "setup       not recorded: the daemon was an older one"}) {
    EXPECT_THAT(text.out, HasSubstr(expected));
  }
  const ProcessResult json = log({"info", log_, "--json", "-"});
  EXPECT_EQ(json.exit_code, 0) << json.err;
  EXPECT_EQ(json_value(json.out, "kind"), "\"journal\"");
  EXPECT_EQ(json_value(json.out, "end"), "\"complete\"");
  EXPECT_EQ(json_value(json.out, "run_id"), "9");
  EXPECT_EQ(json_value(json.out, "scenario_sha256"), "\"0123abcd\"");
  EXPECT_EQ(json_value(json.out, "first_log_time_ns"), "1800000000000000000");
  EXPECT_EQ(json_value(json.out, "last_sim_time_ns"), "40000000");
  EXPECT_EQ(json_value(json.out, "non_finite"), "1");
  EXPECT_EQ(json_value(json.out, "gap_count"), "0");
  EXPECT_EQ(json_value(json.out, "error"), "null");
  EXPECT_EQ(json_value(json.out, "setup"), "null");
}

TEST_F(CliLog, info_tells_a_crash_from_damage) {
  const std::string whole = read_text(log_);
  write_text(log_, whole.substr(0, whole.size() - 40));
  const ProcessResult cut = log({"info", log_, "--json", file("cut.json")});
  EXPECT_EQ(cut.exit_code, 0) << cut.err;
  EXPECT_THAT(cut.out, HasSubstr("cut off by a crash, or not closed yet: " + log_ + ": offset "));
  EXPECT_EQ(json_value(read_text(file("cut.json")), "end"), "\"cut_off\"");

  std::string damaged = whole;
  damaged[damaged.find("llvmpipe")] ^= 1;  // within the first chunk
  write_text(log_, damaged);
  const ProcessResult bad = log({"info", log_});
  EXPECT_EQ(bad.exit_code, 1);
  EXPECT_THAT(bad.err, HasSubstr("emit: error: " + log_ + ": offset "));
  EXPECT_THAT(bad.err, HasSubstr("chunk CRC"));
  EXPECT_THAT(bad.out, HasSubstr("emit.v1.JournalEntry, protobuf")) << "what was read is described";
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"cut", log_, "--out", file("out.mcap")},
        std::vector<std::string>{"export", "csv", log_, "--table", "frames", "--out",
                                 file("out.csv")}}) {
    const ProcessResult refused = log(command);
    EXPECT_EQ(refused.exit_code, 1);
    EXPECT_THAT(refused.err, HasSubstr(log_ + ": offset "));
  }
  EXPECT_FALSE(std::filesystem::exists(file("out.mcap")));
  EXPECT_FALSE(std::filesystem::exists(file("out.csv")));
}

/// Returns a file of other software with one compressed chunk, as its index describes it.
std::string compressed_file() {
  const auto le = [](std::uint64_t value, int bytes) {
    std::string out;
    for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i) & 0xFF);
    return out;
  };
  const auto text = [&](const std::string& value) { return le(value.size(), 4) + value; };
  const auto record = [&](char opcode, const std::string& content) {
    return std::string(1, opcode) + le(content.size(), 8) + content;
  };
  const std::string magic = "\x89MCAP0\r\n";
  std::string out = magic + record(1, text("ros2") + text("other 1"));
  out += record(6, le(5, 8) + le(6, 8) + le(100, 8) + le(0, 4) + text("zstd") + le(3, 8) + "abc");
  out += record(15, le(0, 4));
  const std::size_t summary = out.size();
  out += record(3, le(1, 2) + text("pkg.Image") + text("protobuf") + text("desc"));
  out += record(4, le(1, 2) + le(1, 2) + text("camera") + text("protobuf") + le(0, 4));
  out += record(11, le(42, 8) + le(1, 2) + le(1, 4) + le(0, 4) + le(0, 4) + le(1, 4) + le(5, 8) +
                        le(6, 8) + le(10, 4) + le(1, 2) + le(42, 8));
  out += record(8, le(5, 8) + le(6, 8) + le(30, 8) + le(60, 8) + le(0, 4) + le(0, 8) +
                       text("zstd") + le(3, 8) + le(100, 8));
  out += record(2, le(summary, 8) + le(0, 8) + le(0, 4));
  return out + magic;
}

TEST_F(CliLog, info_describes_other_files) {
  write_text(file("other.mcap"), compressed_file());
  const ProcessResult other = log({"info", file("other.mcap")});
  EXPECT_EQ(other.exit_code, 0) << other.err;
  EXPECT_THAT(other.out, HasSubstr("MCAP file of other software"));
  EXPECT_THAT(other.out, HasSubstr("chunks      1, compression zstd"));
  EXPECT_THAT(other.out, HasSubstr("camera"));
  EXPECT_THAT(other.out, HasSubstr("42"));
  EXPECT_THAT(other.err, HasSubstr("the counts come from the index"));

  write_text(file("poses.csv"), kPoses);
  const ProcessResult csv = log({"info", file("poses.csv"), "--json", "-"});
  EXPECT_EQ(csv.exit_code, 0) << csv.err;
  EXPECT_EQ(json_value(csv.out, "kind"), "\"csv\"");
  EXPECT_EQ(json_value(csv.out, "host_frames"), "2");
  EXPECT_EQ(json_value(csv.out, "last_sim_time_ns"), "505000000");

  write_text(file("text.mcap"), "hello, world");
  const ProcessResult text = log({"info", file("text.mcap")});
  EXPECT_EQ(text.exit_code, 1);
  EXPECT_THAT(text.err, HasSubstr("offset 0: not an MCAP file"));
  EXPECT_EQ(log({"info", file("none.mcap")}).exit_code, 1);
}

TEST_F(CliLog, cut_says_what_it_kept) {
  const ProcessResult cut = log({"cut", log_, "--from-s", "0.02", "--to-s", "0.03", "--out",
                                 file("out.mcap"), "--json", file("out.json")});
  EXPECT_EQ(cut.exit_code, 0) << cut.err;
  EXPECT_THAT(cut.out, HasSubstr("2 frames of run 9; kept for the state of the scene: 1 frame "
                                 "before them and 0 earlier runs"));
  const std::string json = read_text(file("out.json"));
  EXPECT_EQ(json_value(json, "frames"), "2");
  EXPECT_EQ(json_value(json, "frames_before"), "1");
  EXPECT_EQ(messages_of(file("out.mcap")).size(), 8U);

  const std::string kept = read_text(log_);
  const ProcessResult over = log({"cut", log_, "--out", log_});
  EXPECT_EQ(over.exit_code, 2);
  EXPECT_THAT(over.err, HasSubstr("is an input"));
  EXPECT_EQ(read_text(log_), kept);
  EXPECT_EQ(log({"cut", log_, "--from-s", "5", "--out", file("x.mcap")}).exit_code, 2);
  EXPECT_EQ(log({"cut", log_, "--from-s", "nan", "--out", file("x.mcap")}).exit_code, 2);
  EXPECT_EQ(log({"cut", log_}).exit_code, 2);
}

TEST_F(CliLog, merge_joins_journals_and_refuses_pose_files) {
  const std::string later = file("later.mcap");
  {
    JournalMaker journal(later, kWallNs + 1'000'000'000);
    journal.run_start(10, "0123abcd");
    journal.frames(1, 2);
  }
  const ProcessResult merged = log({"merge", later, log_, "--out", file("all.mcap")});
  EXPECT_EQ(merged.exit_code, 0) << merged.err;
  EXPECT_THAT(merged.out, HasSubstr("14 messages of 2 logs, 2 runs with 6 frames"));
  EXPECT_EQ(messages_of(file("all.mcap")).size(), 14U);

  write_text(file("poses.csv"), kPoses);
  const ProcessResult refused =
      log({"merge", log_, file("poses.csv"), "--out", file("never.mcap")});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("poses.csv: a CSV pose log, not an MCAP log; send it"));
  EXPECT_FALSE(std::filesystem::exists(file("never.mcap")));
  const ProcessResult again = log({"merge", log_, file("all.mcap"), "--out", file("never.mcap")});
  EXPECT_EQ(again.exit_code, 1);
  EXPECT_THAT(again.err, HasSubstr("cannot be merged: both hold run 9"));
}

TEST_F(CliLog, export_writes_a_folder_or_one_table) {
  const ProcessResult all = log({"export", "csv", log_, "--out", file("tables")});
  EXPECT_EQ(all.exit_code, 0) << all.err;
  for (const char* table :
       {"seeker", "entities", "frames", "frame_entities", "weather", "parts", "events"}) {
    EXPECT_THAT(all.out, HasSubstr(std::string("tables/") + table + ".csv: "));
    EXPECT_TRUE(std::filesystem::exists(file("tables") + "/" + table + ".csv")) << table;
  }
  const ProcessResult one =
      log({"export", "csv", log_, "--table", "frames", "--out", file("f.csv"), "--json", "-"});
  EXPECT_EQ(one.exit_code, 0) << one.err;
  EXPECT_EQ(json_value(one.out, "frames"), "4");
  EXPECT_THAT(one.out, Not(HasSubstr("events")));
  EXPECT_EQ(read_text(file("f.csv")), read_text(file("tables/frames.csv")));
  const ProcessResult which = log({"export", "csv", log_, "--out", file("g.csv")});
  EXPECT_EQ(which.exit_code, 2);
  EXPECT_THAT(which.err, HasSubstr("g.csv: names one file; --table says which of them"));
  EXPECT_FALSE(std::filesystem::exists(file("g.csv")));
  write_text(file("poses.csv"), kPoses);
  EXPECT_EQ(log({"export", "csv", file("poses.csv"), "--out", file("t")}).exit_code, 2);
  EXPECT_EQ(log({"export", "csv", log_, "--table", "frame", "--out", file("t")}).exit_code, 2);
}

TEST_F(CliLog, a_network_capture_is_described_and_exported) {
  const std::string capture = EMIT_TEST_SOURCE_DIR "/fuzz/corpus/pose_pcap/raw.pcap";
  const ProcessResult info = log({"info", capture, "--json", "-"});
  EXPECT_EQ(info.exit_code, 0) << info.err;
  EXPECT_EQ(json_value(info.out, "kind"), "\"capture\"");
  EXPECT_EQ(json_value(info.out, "host_frames"), "1");
  EXPECT_EQ(json_value(info.out, "first_sim_time_ns"), "-1500000000");
  EXPECT_THAT(info.err, HasSubstr("stand there twice"));
  const ProcessResult exported =
      log({"export", "csv", capture, "--table", "seeker", "--out", file("seeker.csv")});
  EXPECT_EQ(exported.exit_code, 0) << exported.err;
  EXPECT_THAT(read_text(file("seeker.csv")), HasSubstr("\ncapture,,"));
  EXPECT_THAT(read_text(file("seeker.csv")), HasSubstr(",42,-1.500000000,"));
  EXPECT_EQ(log({"cut", capture, "--out", file("out.mcap")}).exit_code, 2);
}

TEST_F(CliLog, the_help_of_every_command_has_an_example) {
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{}, std::vector<std::string>{"info"},
        std::vector<std::string>{"cut"}, std::vector<std::string>{"merge"},
        std::vector<std::string>{"export"}, std::vector<std::string>{"export", "csv"}}) {
    std::vector<std::string> arguments = command;
    arguments.emplace_back("--help");
    const ProcessResult result = log(arguments);
    EXPECT_EQ(result.exit_code, 0);
    EXPECT_THAT(result.out, HasSubstr("Example: emit log "));
  }
}

}  // namespace
}  // namespace emit::test
