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

  /// Returns the text of the first error, or "N rows".
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
  EXPECT_THAT(outcome(""), HasSubstr(":0: no header row"));
  EXPECT_THAT(outcome("sim_time_s,east_m\n"), HasSubstr(":1: column 'north_m' is missing"));
  EXPECT_THAT(outcome("qw,qw\n"), HasSubstr(":1: column 'qw' twice"));
  EXPECT_THAT(outcome(head + "\n0,0,x,0,1,0,0,0,7\n"),
              HasSubstr(":3: column 'north_m': 'x' is not"));
  EXPECT_THAT(outcome(head + "0,0,0\n"), HasSubstr(":2: column 'up_m': no value"));
  EXPECT_THAT(outcome(head + "0,0,0,0,1,0,0,0,-7\n"), HasSubstr("'frame_number': '-7' is not"));
  EXPECT_THAT(outcome(head + "0,0,0,0,1,1,0,0,7\n"), HasSubstr(":2: invalid pose"));
  EXPECT_THAT(outcome(head + "0,nan,0,0,1,0,0,0,7\n"), HasSubstr(":2: invalid pose"));
  EXPECT_THAT(outcome(head + "1e300,0,0,0,1,0,0,0,7\n"), HasSubstr("'sim_time_s': out of range"));
  // A value that a host may not send in a datagram is refused in a file too.
  EXPECT_EQ(outcome(head + "1e9,0,0,0,1,0,0,0,7\n"), "1 rows");
  EXPECT_THAT(outcome(head + "1000000001,0,0,0,1,0,0,0,7\n"),
              HasSubstr("'sim_time_s': out of range"));
  EXPECT_THAT(outcome(head + "1,0,0,0,1,0,0,0,7\n0,0,0,0,1,0,0,0,8\n"),
              HasSubstr(":3: column 'sim_time_s': goes back"));
}

TEST_F(PoseCsv, AMissingFileIsNamed) {
  const auto reader = PoseCsvReader::open(path_);
  ASSERT_FALSE(reader);
  EXPECT_EQ(reader.error().code, physics::ErrorCode::not_found);
  EXPECT_THAT(reader.error().text, HasSubstr(path_.string()));
}

}  // namespace
}  // namespace emit::protocol
