// SPDX-License-Identifier: Apache-2.0
#include "history/first_frame_warnings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "emit/physics/climate/rain.hpp"

namespace emit::renderer {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::int64_t kHourNs = 3'600'000'000'000;

scene::ScenarioDesc scenario() {
  scene::ScenarioDesc s;
  s.file = "s.toml";
  s.thermal.model = scene::ThermalModel::foster;
  s.thermal.spin_up_ns = 48 * kHourNs;
  return s;
}

TEST(FirstFrameWarnings, AFrameHoursAfterTheStartLacksNothing) {
  EXPECT_THAT(first_frame_warnings(scenario(), 3 * kHourNs), IsEmpty());
}

TEST(FirstFrameWarnings, AFrameAtTheStartHasNoHistory) {
  auto s = scenario();
  EXPECT_THAT(first_frame_warnings(s, 0),
              ElementsAre(AllOf(HasSubstr("s.toml: the thermal history begins at 0 s"),
                                HasSubstr("surfaces bear no marks of shadows"))));
  s.thermal.spin_up_ns = 0;
  EXPECT_THAT(first_frame_warnings(s, 0), ElementsAre(HasSubstr("thermal.initial_k, 290 K")));
  s.thermal.model = scene::ThermalModel::emit2014;
  s.thermal.history_start_ns = 5 * kHourNs;
  EXPECT_THAT(first_frame_warnings(s, 4 * kHourNs), ElementsAre(HasSubstr("begins at 18000 s")));
}

TEST(FirstFrameWarnings, AWeatherTableThatEndsBeforeTheFrameIsNamed) {
  auto s = scenario();
  s.weather.resize(2);
  s.weather[0].sim_time_ns = -48 * kHourNs;
  s.weather[1].sim_time_ns = 2 * kHourNs;
  EXPECT_THAT(first_frame_warnings(s, 2 * kHourNs), IsEmpty());
  EXPECT_THAT(
      first_frame_warnings(s, 12 * kHourNs),
      ElementsAre(HasSubstr("the weather covers -172800 s to 7200 s, but the frame at 43200 "
                            "s needs it from -172800 s to 43200 s")));
  EXPECT_THAT(first_frame_warnings(s, 12 * kHourNs)[0], EndsWith("holds from 7200 s on"));
  // Rain ends with the row that states it.
  s.weather[0].rain_mm_h = 3.0;
  EXPECT_THAT(first_frame_warnings(s, 12 * kHourNs)[0], EndsWith("holds from 7200 s on"));
  s.weather[1].rain_mm_h = 3.0;
  EXPECT_EQ(physics::RainDepth(s.weather).at_mm(12 * kHourNs), 3.0 * 50.0);
  EXPECT_THAT(first_frame_warnings(s, 12 * kHourNs)[0],
              EndsWith("holds from 7200 s on, but for its rain, which ends there"));
  EXPECT_THAT(first_frame_warnings(s, 2 * kHourNs), IsEmpty());
  s.weather.resize(1);  // constant weather, at all times
  EXPECT_THAT(first_frame_warnings(s, 12 * kHourNs), IsEmpty());
}

}  // namespace
}  // namespace emit::renderer
