// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/log_csv.hpp"

#include <gmock/gmock.h>

#include <sstream>

#include "emit/physics/csv.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/record/pose_csv.hpp"
#include "protocol/journals.hpp"

namespace emit::protocol {
namespace {

using test::bytes_of;
using test::JournalMaker;
using test::kWallNs;
using test::LogFolder;
using test::set_bytes;
using ::testing::HasSubstr;

void write_journal(const std::filesystem::path& file) {
  JournalMaker journal(file, kWallNs);
  journal.run_start(9);
  journal.frames(1, 3);
  journal.frame(4, kFlagLate | kFlagClamped, false);
  journal.command(v1::Command::KIND_HOLD);
  journal.lose(2);
  journal.frames(6, 6);
}

/// Cells of a table by the names of their columns.
std::vector<std::map<std::string, std::string>> rows_of(const std::filesystem::path& file) {
  std::vector<std::map<std::string, std::string>> rows;
  auto csv = physics::CsvReader::open(file);
  EXPECT_TRUE(csv) << csv.error().text;
  if (!csv) return rows;
  for (auto more = csv->next(); more && *more; more = csv->next()) {
    auto& row = rows.emplace_back();
    for (std::size_t i = 0; i < csv->header().size(); ++i) {
      row[std::string(csv->header()[i].text)] = std::string(csv->row()[i].text);
    }
  }
  return rows;
}

TEST(LogCsv, AJournalBecomesATableOfEachKind) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  write_journal(in);
  const auto out = folder.file("deep/tables");
  const auto done = export_log_csv(in, out, {});
  ASSERT_TRUE(done) << done.error().text;
  EXPECT_FALSE(done->notes);
  const auto frames = rows_of(out / "frames.csv");
  ASSERT_EQ(frames.size(), 5U);
  EXPECT_EQ(done->rows[static_cast<std::size_t>(LogTable::frames)], 5U);
  EXPECT_EQ(frames[3].at("run_id"), "9");
  EXPECT_EQ(frames[3].at("sequence"), "9");
  EXPECT_EQ(frames[3].at("log_time_ns"), "1800000000008000000");
  EXPECT_EQ(frames[3].at("frame_number"), "4");
  EXPECT_EQ(frames[3].at("sim_time_s"), "0.040000000");
  EXPECT_EQ(frames[3].at("rendered"), "0");
  EXPECT_EQ(frames[3].at("late"), "1");
  EXPECT_EQ(frames[3].at("clamped"), "1");
  EXPECT_EQ(frames[3].at("stale"), "0");
  EXPECT_EQ(frames[3].at("radiance_crc32c"), "00000134");
  EXPECT_EQ(frames[3].at("entities"), "1");
  EXPECT_EQ(rows_of(out / "frame_entities.csv").at(0).at("entity_id"), "5");
  const auto weather = rows_of(out / "weather.csv");
  ASSERT_EQ(weather.size(), 2U);
  EXPECT_EQ(weather[0].at("frame_number"), "3");
  EXPECT_EQ(weather[0].at("air_k"), "280.33333333333331");
  EXPECT_EQ(weather[0].at("film_w_m2_k"), "");
  const auto events = rows_of(out / "events.csv");
  ASSERT_EQ(events.size(), 3U);
  EXPECT_EQ(events[0].at("event"), "run_start");
  EXPECT_EQ(events[0].at("scenario"), "world, \"new\"");
  EXPECT_EQ(events[0].at("first_time_s"), "1.500000000");
  EXPECT_EQ(events[1].at("command"), "hold");
  EXPECT_EQ(events[2].at("event"), "missing");
  EXPECT_EQ(events[2].at("sequence"), "11");
  EXPECT_EQ(events[2].at("missing_entries"), "2");
  EXPECT_TRUE(rows_of(out / "entities.csv").empty());
}

TEST(LogCsv, CommandsToPartsStandInATableOfTheirOwn) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  const auto out = folder.file("parts.csv");
  {
    auto writer = LogWriter::create(in);
    ASSERT_TRUE(writer->write_host(*test::make_host_frame(0), 0));
  }
  const auto done = export_log_csv(in, out, {.table = LogTable::parts});
  ASSERT_TRUE(done) << done.error().text;
  const auto rows = rows_of(out);
  ASSERT_EQ(rows.size(), 4U);
  EXPECT_EQ(rows[0].at("entity_id"), "7");
  EXPECT_EQ(rows[0].at("part_id"), "1");
  EXPECT_EQ(rows[0].at("temperature_k"), "612.5");
  EXPECT_EQ(rows[0].at("throttle"), "");
  EXPECT_EQ(rows[1].at("power_w_m2"), "0.10000000000000001");
  EXPECT_EQ(rows[2].at("throttle"), "0.75");
  EXPECT_EQ(rows[3].at("temperature_k") + rows[3].at("power_w_m2") + rows[3].at("throttle"), "")
      << "off";
}

TEST(LogCsv, TheTableOfTheSeekerIsAPoseLogWithTheSamePoses) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  const auto out = folder.file("seeker.csv");
  std::vector<HostFrameData> sent;
  {
    auto writer = LogWriter::create(in);
    for (std::uint64_t i = 1; i <= 4; ++i) {
      auto frame = test::make_host_frame(3);
      frame->frame_number = 10 + i;
      frame->sim_time_ns = -3 + static_cast<std::int64_t>(i * i * 123'456'789);
      frame->seeker.position_world_m.x = 1.0 / static_cast<double>(i) - 1e-9;
      if (i == 3) frame->seeker_rates.reset();
      if (i != 2) frame->fov_h_rad = 0.3 / static_cast<double>(i);
      if (i > 2) frame->gimbal_rad = glm::dvec3(-0.1, 1.0 / 3.0, 0.7 * static_cast<double>(i));
      ASSERT_TRUE(writer->write_host(*frame, 0));
      sent.push_back(*frame);
    }
  }
  const auto done = export_log_csv(in, out, {.table = LogTable::seeker});
  ASSERT_TRUE(done) << done.error().text;
  EXPECT_EQ(folder.files(), 2) << "one table alone";
  auto poses = PoseCsvReader::open(out);
  ASSERT_TRUE(poses) << poses.error().text;
  for (const HostFrameData& frame : sent) {
    const auto more = poses->next();
    ASSERT_TRUE(more) << more.error().text;
    ASSERT_TRUE(*more);
    EXPECT_EQ(poses->host().frame_number, frame.frame_number);
    EXPECT_EQ(poses->host().sim_time_ns, frame.sim_time_ns);
    EXPECT_EQ(poses->host().seeker.position_world_m, frame.seeker.position_world_m);
    EXPECT_EQ(poses->host().seeker.world_from_body, frame.seeker.world_from_body);
    ASSERT_EQ(poses->host().seeker_rates.has_value(), frame.seeker_rates.has_value());
    if (frame.seeker_rates) {
      EXPECT_EQ(poses->host().seeker_rates->velocity_world_m_s,
                frame.seeker_rates->velocity_world_m_s);
      EXPECT_EQ(poses->host().seeker_rates->angular_rate_body_rad_s,
                frame.seeker_rates->angular_rate_body_rad_s);
    }
    EXPECT_EQ(poses->host().fov_h_rad, frame.fov_h_rad);
    EXPECT_EQ(poses->host().gimbal_rad, frame.gimbal_rad);
  }
  EXPECT_FALSE(*poses->next());
  const auto entities = export_log_csv(in, folder.file("e.csv"), {.table = LogTable::entities});
  ASSERT_TRUE(entities);
  const auto rows = rows_of(folder.file("e.csv"));
  ASSERT_EQ(rows.size(), 12U);
  EXPECT_EQ(rows[1].at("entity_id"), "7");
  EXPECT_EQ(rows[1].at("east_m"), "") << "it stays where it is";
  EXPECT_EQ(rows[2].at("velocity_north_m_s"), "2");
}

TEST(LogCsv, TheCutOfACrashIsAnEventAndDamageIsAnError) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  const auto out = folder.file("events.csv");
  write_journal(in);
  const std::string whole = bytes_of(in);
  set_bytes(in, std::string_view(whole).substr(0, whole.size() - 100));
  const auto done = export_log_csv(in, out, {.table = LogTable::events});
  ASSERT_TRUE(done) << done.error().text;
  ASSERT_TRUE(done->notes);
  const auto events = rows_of(out);
  EXPECT_EQ(events.back().at("event"), "cut_off");
  EXPECT_EQ(events.back().at("text"), *done->notes);

  std::filesystem::remove(out);
  std::string damaged = whole;
  damaged[damaged.find("llvmpipe")] ^= 1;
  set_bytes(in, damaged);
  const auto refused = export_log_csv(in, out, {.table = LogTable::events});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr(in.string() + ": offset "));
  EXPECT_EQ(folder.files(), 1) << "nothing is left";
}

TEST(LogCsv, AFileWithoutMessagesOfEmitdIsRefused) {
  const LogFolder folder;
  const auto in = folder.file("in.mcap");
  { ASSERT_TRUE(LogWriter::create(in)); }
  const auto done = export_log_csv(in, folder.file("out"), {});
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, physics::ErrorCode::unsupported);
  const auto over = export_log_csv(in, in, {.table = LogTable::frames});
  ASSERT_FALSE(over);
  EXPECT_THAT(over.error().text, HasSubstr("is an input"));
}

}  // namespace
}  // namespace emit::protocol
