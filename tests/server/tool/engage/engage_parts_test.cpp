// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <iterator>

#include "emit/physics/constants.hpp"
#include "tool/engage/jsbsim_host.hpp"
#include "tool/engage/json_line.hpp"
#include "tool/engage/line_pipe.hpp"
#include "tool/engage/seeker_process.hpp"
#include "tool/engage/study_pictures.hpp"

namespace emit::tool {
namespace {

using ::testing::HasSubstr;

TEST(SeekerAnswer, HasTheValuesOfItsLine) {
  const auto answer = parse_answer(
      R"({"frame_number": 12, "host_frame_number": 11, "sim_time_ns": 1, "found": true, )"
      R"("x_px": 160.5, "y_px": 100.25, "azimuth_rad": 0.01, "elevation_rad": -0.02, )"
      R"("quality": 33.5, "other": [1]})");
  ASSERT_TRUE(answer) << answer.error().text;
  EXPECT_EQ(answer->frame_number, 12U);
  EXPECT_EQ(answer->host_frame_number, 11U);
  EXPECT_TRUE(answer->found);
  EXPECT_DOUBLE_EQ(answer->x_px, 160.5);
  EXPECT_DOUBLE_EQ(answer->y_px, 100.25);
  EXPECT_DOUBLE_EQ(answer->azimuth_rad, 0.01);
  EXPECT_DOUBLE_EQ(answer->elevation_rad, -0.02);
  EXPECT_DOUBLE_EQ(answer->quality, 33.5);
}

TEST(SeekerAnswer, WithoutATargetNeedsNoAngles) {
  const auto answer = parse_answer(R"({"frame_number":1,"host_frame_number":1,"found":false})");
  ASSERT_TRUE(answer) << answer.error().text;
  EXPECT_FALSE(answer->found);
}

TEST(SeekerAnswer, IsRefusedWithTheKeyAtFault) {
  const std::pair<const char*, const char*> cases[] = {
      {"found", "no JSON object"},
      {"[1, 2]", "no JSON object"},
      {R"({"host_frame_number":1,"found":false})", "'frame_number' is missing"},
      {R"({"frame_number":1.5,"host_frame_number":1,"found":false})", "'frame_number' is 1.5"},
      {R"({"frame_number":-1,"host_frame_number":1,"found":false})", "'frame_number' is -1"},
      {R"({"frame_number":1,"host_frame_number":1,"found":"yes"})", "'found' is missing"},
      {R"({"frame_number":1,"host_frame_number":1,"found":true,"x_px":1,"y_px":1,)"
       R"("elevation_rad":0,"quality":1})",
       "'azimuth_rad' is missing"},
      {R"({"frame_number":1,"host_frame_number":1,"found":true,"x_px":1,"y_px":1,)"
       R"("azimuth_rad":4,"elevation_rad":0,"quality":1})",
       "more than half a turn"}};
  for (const auto& [line, text] : cases) {
    const auto answer = parse_answer(line);
    ASSERT_FALSE(answer) << line;
    EXPECT_THAT(answer.error().text, HasSubstr(text)) << line;
  }
}

TEST(SeekerAnswer, PointsRightAndUpFromTheOpticalAxis) {
  SeekerAnswer answer;
  physics::Pose north;
  north.world_from_body = physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0);
  EXPECT_LT(glm::length(direction_of(answer, north) - glm::dvec3(0, 1, 0)), 1e-12);
  answer.azimuth_rad = 0.1;
  EXPECT_NEAR(direction_of(answer, north).x, std::sin(0.1), 1e-12);
  answer.elevation_rad = 0.2;
  const glm::dvec3 seen = direction_of(answer, north);
  EXPECT_NEAR(seen.z, std::sin(0.2), 1e-12);
  EXPECT_NEAR(std::atan2(seen.x, seen.y), 0.1, 1e-12);
  EXPECT_NEAR(glm::length(seen), 1.0, 1e-12);
}

TEST(LinePipe, GivesWholeLinesAndTheEnd) {
  auto pipe = LinePipe::open();
  ASSERT_TRUE(pipe);
  const auto write = [&pipe](const std::string& text) {
    ASSERT_EQ(::write(pipe->write_end(), text.data(), text.size()),
              static_cast<ssize_t>(text.size()));
  };
  const auto none = pipe->next(std::chrono::milliseconds(0));
  ASSERT_TRUE(none);
  EXPECT_FALSE(*none);
  write("one\ntw");
  EXPECT_EQ(**pipe->next(std::chrono::milliseconds(0)), "one");
  EXPECT_FALSE(*pipe->next(std::chrono::milliseconds(0)));
  write("o\n\nlast\n");
  EXPECT_EQ(**pipe->next(std::chrono::milliseconds(0)), "two");
  EXPECT_EQ(**pipe->next(std::chrono::milliseconds(0)), "");
  pipe->close_write_end();
  EXPECT_EQ(**pipe->next(std::chrono::milliseconds(0)), "last");
  const auto end = pipe->next(std::chrono::milliseconds(0));
  ASSERT_FALSE(end);
  EXPECT_THAT(end.error().text, HasSubstr("ended"));
}

TEST(JsbsimRow, HasTheValuesInTheOrderOfTheProperties) {
  EXPECT_EQ(jsbsim_properties().size(), 9U);
  const auto state = parse_jsbsim_row("1.5,0.8,0.2,1200.25,0.1,-0.2,3,10,20,-5e-1");
  ASSERT_TRUE(state) << state.error().text;
  EXPECT_DOUBLE_EQ(state->time_s, 1.5);
  EXPECT_DOUBLE_EQ(state->latitude_rad, 0.8);
  EXPECT_DOUBLE_EQ(state->height_m, 1200.25);
  EXPECT_DOUBLE_EQ(state->heading_rad, 3.0);
  EXPECT_DOUBLE_EQ(state->down_ft_s, -0.5);
  for (const char* row :
       {"", "1,2,3", "1,2,3,4,5,6,7,8,9,10,11", "1,2,3,4,5,6,7,8,9,x", "1,2,3,4,5,6,7,8,9,nan"}) {
    EXPECT_FALSE(parse_jsbsim_row(row)) << row;
  }
}

TEST(JsbsimPose, IsInTheScenariosFrame) {
  const physics::GeoPlace origin{physics::Radians(0.0), physics::Radians(0.0),
                                 physics::Metres(100.0)};
  JsbsimState state;
  state.height_m = 350.0;
  state.heading_rad = physics::kPi / 2;
  const physics::Pose above = pose_of(state, origin);
  EXPECT_LT(glm::length(above.position_world_m - glm::dvec3(0, 0, 250)), 1e-6);
  EXPECT_LT(glm::length(above.world_from_body * glm::dvec3(1, 0, 0) - glm::dvec3(1, 0, 0)), 1e-12);
  // A quarter of the equator away, east and down have become what up and west were.
  state.longitude_rad = physics::kPi / 2;
  state.height_m = 0.0;
  const physics::Pose far = pose_of(state, origin);
  EXPECT_LT(glm::length(far.position_world_m - glm::dvec3(6378137.0, 0.0, -6378237.0)), 1e-6);
  EXPECT_LT(glm::length(far.world_from_body * glm::dvec3(1, 0, 0) - glm::dvec3(0, 0, -1)), 1e-12);
  state.pitch_rad = physics::kPi / 2;
  EXPECT_LT(glm::length(pose_of(state, origin).world_from_body * glm::dvec3(1, 0, 0) -
                        glm::dvec3(1, 0, 0)),
            1e-12);
}

TEST(StudyPicture, IsWrittenAsNumpyReadsIt) {
  const auto file = std::filesystem::temp_directory_path() /
                    ("emit_study_" + std::to_string(::getpid()) + ".npy");
  ASSERT_TRUE(write_npy(file, {3, 2, {1.0F, 2.0F, 3.0F, 4.0F, 5.0F, 6.5F}}));
  std::ifstream stream(file, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  std::filesystem::remove(file);
  ASSERT_GT(bytes.size(), 24U);
  EXPECT_EQ(bytes.substr(0, 6), "\x93NUMPY");
  EXPECT_EQ((bytes.size() - 24) % 64, 0U);
  EXPECT_THAT(bytes, HasSubstr("'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }"));
  EXPECT_EQ(bytes[bytes.size() - 25], '\n');
  float last = 0.0F;
  std::memcpy(&last, bytes.data() + bytes.size() - 4, 4);
  EXPECT_EQ(last, 6.5F);
}

}  // namespace
}  // namespace emit::tool
