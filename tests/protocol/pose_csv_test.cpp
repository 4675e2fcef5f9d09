// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/pose_csv.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace emit::protocol {
namespace {

using ::testing::HasSubstr;

class PoseCsv : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    path_ = std::filesystem::path(EMIT_TEST_BINARY_DIR) /
            (std::string("pose_csv_test_") + info->name() + ".csv");
  }
  void TearDown() override { std::filesystem::remove(path_); }

  /// Text of the first error, or "N rows".
  [[nodiscard]] std::string outcome(std::string_view text) const {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << text;
    auto reader = PoseCsvReader::open(path_);
    if (!reader) return reader.error().text;
    for (int rows = 0;; ++rows) {
      const auto more = reader->next();
      if (!more) return more.error().text;
      if (!*more) return std::to_string(rows) + " rows";
    }
  }

  std::filesystem::path path_;
};

TEST_F(PoseCsv, ReadsColumnsInAnyOrderWithCommentsAndEitherLineEnd) {
  std::ofstream(path_, std::ios::binary)
      << "# approach\r\nqw,qx,qy,qz,note,up_m,north_m,east_m,sim_time_s\r\n"
         "1,0,0,0,hello,30,20,10,0.005\n"
         "\n# pause\n 0.5 , 0.5,0.5,-0.5,,3e1,-2.5,1,0.010";
  auto reader = PoseCsvReader::open(path_);
  ASSERT_TRUE(reader) << reader.error().text;
  ASSERT_TRUE(reader->next().value());
  EXPECT_EQ(reader->host().frame_number, 1u);
  EXPECT_EQ(reader->host().sim_time_ns, 5'000'000);
  EXPECT_EQ(reader->host().seeker.position_world_m, glm::dvec3(10.0, 20.0, 30.0));
  ASSERT_TRUE(reader->next().value());
  EXPECT_EQ(reader->host().frame_number, 2u);
  EXPECT_EQ(reader->host().sim_time_ns, 10'000'000);
  EXPECT_EQ(reader->host().seeker.position_world_m, glm::dvec3(1.0, -2.5, 30.0));
  EXPECT_EQ(reader->host().seeker.world_from_body, glm::dquat(0.5, 0.5, 0.5, -0.5));
  EXPECT_FALSE(reader->next().value());
}

TEST_F(PoseCsv, ErrorsNameFileLineAndColumn) {
  const std::string head = "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz,frame_number\n";
  EXPECT_EQ(outcome(head + "0,0,0,0,1,0,0,0,7\n"), "1 rows");
  EXPECT_THAT(outcome(""), HasSubstr(": the file has no header row"));
  EXPECT_THAT(outcome("sim_time_s,east_m\n"), HasSubstr(":1: column 'north_m' is missing"));
  EXPECT_THAT(outcome("sim_time_s,east_m,north_m,up_m,qw,qw,qx,qy,qz\n"),
              HasSubstr(":1: column 'qw' appears twice"));
  EXPECT_THAT(outcome("frame_number," + head), HasSubstr("column 'frame_number' appears twice"));
  EXPECT_THAT(outcome(head + "\n0,0,x,0,1,0,0,0,7\n"),
              HasSubstr(":3:5: column 'north_m': 'x' is not a number"));
  EXPECT_THAT(outcome(head + "0,0,0\n"), HasSubstr(":2:1: 3 values, the header has 9"));
  EXPECT_THAT(outcome(head + "0,0,0,,1,0,0,0,7\n"), HasSubstr(":2:7: column 'up_m': no value"));
  EXPECT_THAT(outcome(head + "0,0,0,0,1,0,0,0,-7\n"), HasSubstr("'frame_number': '-7' is not"));
  EXPECT_THAT(outcome(head + "0,0,0,0,1,1,0,0,7\n"),
              HasSubstr(":2:1: invalid pose: position 0, 0, 0 m"));
  EXPECT_THAT(outcome(head + "0,nan,0,0,1,0,0,0,7\n"), HasSubstr(":2:1: invalid pose"));
  EXPECT_THAT(outcome(head + "1e300,0,0,0,1,0,0,0,7\n"), HasSubstr("1e300 is out of range"));
  // A value that a host may not send in a datagram is refused in a file too.
  EXPECT_EQ(outcome(head + "1e9,0,0,0,1,0,0,0,7\n"), "1 rows");
  EXPECT_THAT(outcome(head + "1000000001,0,0,0,1,0,0,0,7\n"), HasSubstr("is out of range"));
  EXPECT_THAT(outcome(head + "1,0,0,0,1,0,0,0,7\n0,0,0,0,1,0,0,0,8\n"),
              HasSubstr(":3:1: column 'sim_time_s': goes back from 1 to 0"));
}

TEST_F(PoseCsv, ColumnsOfPartsDriveThem) {
  using Kind = PartCommandData::Kind;
  std::ofstream(path_) << "sim_time_s,entity_7.part_1.temperature_k,east_m,north_m,up_m,qw,qx,qy,"
                          "qz,entity_12.part_3.throttle\n"
                          "0,450.5,0,0,0,1,0,0,0,\n"
                          "1,,0,0,0,1,0,0,0,\n"
                          "2,off,0,0,0,1,0,0,0,0.25\n";
  auto reader = PoseCsvReader::open(path_);
  ASSERT_TRUE(reader) << reader.error().text;
  ASSERT_TRUE(reader->next().value());
  ASSERT_EQ(reader->host().part_count, 1U);
  EXPECT_EQ(reader->host().parts[0].entity_id, 7U);
  EXPECT_EQ(reader->host().parts[0].part_id, 1U);
  EXPECT_EQ(reader->host().parts[0].kind, Kind::temperature);
  EXPECT_EQ(reader->host().parts[0].value, 450.5);
  ASSERT_TRUE(reader->next().value());
  EXPECT_EQ(reader->host().part_count, 0U);
  ASSERT_TRUE(reader->next().value());
  ASSERT_EQ(reader->host().part_count, 2U);
  EXPECT_EQ(reader->host().parts[0].kind, Kind::off);
  EXPECT_EQ(reader->host().parts[1].entity_id, 12U);
  EXPECT_EQ(reader->host().parts[1].part_id, 3U);
  EXPECT_EQ(reader->host().parts[1].kind, Kind::throttle);
  EXPECT_EQ(reader->host().parts[1].value, 0.25);
}

TEST_F(PoseCsv, ColumnsOfTheViewSetZoomAndGimbalWhereTheyAreNotEmpty) {
  std::ofstream(path_) << "fov_h_rad,sim_time_s,gimbal_roll_rad,gimbal_yaw_rad,gimbal_pitch_rad,"
                          "east_m,north_m,up_m,qw,qx,qy,qz\n"
                          "0.10000000000000001,0,0.3,-0.1,0.2,0,0,0,1,0,0,0\n"
                          ",1,,,,0,0,0,1,0,0,0\n"
                          "0.25,2,,,,0,0,0,1,0,0,0\n"
                          ",3,0,3.1415926535897931,0,0,0,0,1,0,0,0\n";
  auto reader = PoseCsvReader::open(path_);
  ASSERT_TRUE(reader) << reader.error().text;
  ASSERT_TRUE(reader->next().value());
  EXPECT_EQ(reader->host().fov_h_rad, 0.1);
  EXPECT_EQ(reader->host().gimbal_rad, glm::dvec3(-0.1, 0.2, 0.3));
  ASSERT_TRUE(reader->next().value());
  EXPECT_FALSE(reader->host().fov_h_rad);
  EXPECT_FALSE(reader->host().gimbal_rad);
  ASSERT_TRUE(reader->next().value());
  EXPECT_EQ(reader->host().fov_h_rad, 0.25);
  EXPECT_FALSE(reader->host().gimbal_rad);
  ASSERT_TRUE(reader->next().value());
  EXPECT_FALSE(reader->host().fov_h_rad);
  EXPECT_EQ(reader->host().gimbal_rad, glm::dvec3(3.1415926535897931, 0.0, 0.0));
}

TEST_F(PoseCsv, ColumnsOfRatesAreThoseOfTheSeekerWhereTheyAreNotEmpty) {
  const std::string poses = "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz";
  const std::string rates =
      ",velocity_east_m_s,velocity_north_m_s,velocity_up_m_s,rate_x_rad_s,rate_y_rad_s,"
      "rate_z_rad_s\n";
  std::ofstream(path_) << poses << rates << "0,0,0,0,1,0,0,0,10,-20.5,30,0.1,-0.2,0.3\n"
                       << "1,0,0,0,1,0,0,0,,,,,,\n";
  auto reader = PoseCsvReader::open(path_);
  ASSERT_TRUE(reader) << reader.error().text;
  ASSERT_TRUE(reader->next().value());
  ASSERT_TRUE(reader->host().seeker_rates);
  EXPECT_EQ(reader->host().seeker_rates->velocity_world_m_s, glm::dvec3(10.0, -20.5, 30.0));
  EXPECT_EQ(reader->host().seeker_rates->angular_rate_body_rad_s, glm::dvec3(0.1, -0.2, 0.3));
  ASSERT_TRUE(reader->next().value());
  EXPECT_FALSE(reader->host().seeker_rates);
  const std::string row = poses + rates + "0,0,0,0,1,0,0,0,";
  EXPECT_THAT(outcome(row + "1,2,3,4,,6\n"), HasSubstr(":2:25: column 'rate_y_rad_s': no value"));
  EXPECT_THAT(outcome(row + "1,2e9,3,4,5,6\n"),
              HasSubstr(":2:19: column 'velocity_north_m_s': 2e9 is out of range, must be -"));
  EXPECT_THAT(outcome(row + "1,2,3,4,5,nan\n"), HasSubstr("column 'rate_z_rad_s': nan is out"));
  EXPECT_THAT(outcome(poses + ",rate_x_rad_s\n"),
              HasSubstr(":1:44: column 'velocity_east_m_s' is missing: it belongs to "
                        "'rate_x_rad_s'"));
}

TEST_F(PoseCsv, ErrorsOfTheViewNameLineAndColumn) {
  const std::string poses = "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz";
  const std::string head =
      poses + ",fov_h_rad,gimbal_yaw_rad,gimbal_pitch_rad,gimbal_roll_rad\n0,0,0,0,1,0,0,0,";
  EXPECT_EQ(outcome(head + "1,0,0,0\n"), "1 rows");
  EXPECT_THAT(outcome(head + "wide,0,0,0\n"),
              HasSubstr(":2:17: column 'fov_h_rad': 'wide' is not a number"));
  EXPECT_THAT(outcome(head + "3,0,0,0\n"),
              HasSubstr(":2:17: column 'fov_h_rad': 3 is out of range, must be 0.000174"));
  EXPECT_THAT(outcome(head + "nan,0,0,0\n"), HasSubstr("column 'fov_h_rad': nan is out of"));
  EXPECT_THAT(outcome(head + ",0,3.2,0\n"),
              HasSubstr(":2:20: column 'gimbal_pitch_rad': 3.2 is out of range, must be -3.14159"));
  EXPECT_THAT(outcome(head + ",0,0,-inf\n"), HasSubstr("column 'gimbal_roll_rad': -inf is out"));
  EXPECT_THAT(outcome(head + ",0,,0\n"), HasSubstr(":2:20: column 'gimbal_pitch_rad': no value"));
  EXPECT_THAT(outcome(poses + ",gimbal_pitch_rad\n"),
              HasSubstr(":1:44: column 'gimbal_yaw_rad' is missing: it belongs to "
                        "'gimbal_pitch_rad'"));
  EXPECT_THAT(outcome(poses + ",fov_h_rad,fov_h_rad\n"),
              HasSubstr("column 'fov_h_rad' appears twice"));
}

TEST_F(PoseCsv, ErrorsOfPartsNameLineAndColumn) {
  const std::string head = "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz,entity_7.part_1.power_w_m2";
  EXPECT_THAT(outcome(head + "\n0,0,0,0,1,0,0,0,hot\n"),
              HasSubstr(":2:17: column 'entity_7.part_1.power_w_m2': 'hot' is not a number"));
  EXPECT_THAT(outcome(head + "\n0,0,0,0,1,0,0,0,-1\n"),
              HasSubstr("power_w_m2 is -1, must be 0 to 1000000"));
  EXPECT_THAT(outcome(head + ",entity_7.part_1.throttle\n"),
              HasSubstr("column 'entity_7.part_1.throttle': another column drives this part"));
  EXPECT_EQ(outcome(head + ",entity_7.part_x.throttle\n0,0,0,0,1,0,0,0,,x\n"), "1 rows")
      << "another name";
}

/// Logs as spreadsheets write them are read like plain ones.
TEST_F(PoseCsv, SpreadsheetDialectsAreReadAlike) {
  const std::string head = "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz";
  for (const std::string& text : std::initializer_list<std::string>{
           "\xEF\xBB\xBF" + head + "\r\n0.5,1,2,3,0,0.6,0.8,0\r\n",
           "\"sim_time_s\",\"east_m\",\"north_m\",\"up_m\",\"qw\",\"qx\",\"qy\",\"qz\"\n"
           "\"0.5\",\"1\",2,3,0,0.6,0.8,0\n",
           head + ",frame_number\n+0.5,+1,+2.0,+3e0,+0,+.6,+0.8,0,+1\n",
           head + "\r0.5,1,2,3,0,0.6,0.8,0\r", head + ",,\n0.5,1,2,3,0,0.6,0.8,0,,\n,,,,,,,,,\n"}) {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << text;
    auto reader = PoseCsvReader::open(path_);
    ASSERT_TRUE(reader) << reader.error().text;
    const auto more = reader->next();
    ASSERT_TRUE(more) << more.error().text;
    EXPECT_EQ(reader->host().sim_time_ns, 500'000'000) << text;
    EXPECT_EQ(reader->host().frame_number, 1U);
    EXPECT_EQ(reader->host().seeker.position_world_m, glm::dvec3(1.0, 2.0, 3.0));
    EXPECT_FALSE(reader->next().value());
  }
}

TEST_F(PoseCsv, UnixTimesAreNamedWithTheRange) {
  const std::string head = "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz\n";
  const std::string seconds = outcome(head + "1764115200.05,0,0,0,1,0,0,0\n");
  EXPECT_THAT(seconds,
              HasSubstr(":2:1: column 'sim_time_s': 1764115200.05 is out of range, must be "
                        "-1000000000 .. 1000000000"));
  EXPECT_THAT(seconds, HasSubstr("looks like UNIX time in seconds (2025-11-26)"));
  EXPECT_THAT(outcome(head + "1764115200050,0,0,0,1,0,0,0\n"), HasSubstr("in milliseconds"));
}

TEST_F(PoseCsv, AMissingFileIsNamed) {
  const auto reader = PoseCsvReader::open(path_);
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error().code, physics::ErrorCode::not_found);
  EXPECT_THAT(reader.error().text, HasSubstr(path_.string()));
}

}  // namespace
}  // namespace emit::protocol
