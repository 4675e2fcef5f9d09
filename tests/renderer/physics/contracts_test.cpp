// SPDX-License-Identifier: Apache-2.0
// Every precondition of the physics functions stops the program, with the operands in the message.
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "emit/physics/apparent_temperature.hpp"
#include "emit/physics/frames.hpp"
#include "emit/physics/nnls.hpp"
#include "emit/physics/relaxation.hpp"
#include "emit/physics/step_nodes.hpp"
#include "emit/physics/weather.hpp"
#include "support/failed_check.hpp"

namespace emit::physics {
namespace {

TEST(Contracts, StepNodesNeedTwoNodesAndAPositiveStep) {
  std::array<std::int64_t, 1> one{};
  std::array<std::int64_t, 4> four{};
  EXPECT_DEATH(uniform_step_nodes(0, 100, one), "nodes.size\\(\\) >= 2U \\(1 >= 2\\)");
  EXPECT_DEATH(geometric_step_nodes(0, 100, 1.0, one), "nodes.size\\(\\) >= 2U \\(1 >= 2\\)");
  EXPECT_DEATH(geometric_step_nodes(0, 100, 0.0, four), "first_step_s > 0.0 \\(0 > 0\\)");
  EXPECT_DEATH((void)geometric_step_ratio(100.0, -1.0, 4), "first_step_s > 0.0 \\(-1 > 0\\)");
}

TEST(Contracts, WeatherNeedsARow) {
  EXPECT_DEATH((void)forcing_from_rows({}, 0), "!rows.empty\\(\\)");
}

TEST(Contracts, LookingNeedsADirection) {
  EXPECT_DEATH((void)world_from_body_look_at({1.0, 2.0, 3.0}, {1.0, 2.0, 3.0}),
               "eye_world_m != target_world_m");
}

TEST(Contracts, ImagesToCompareAreOfEqualSizeAndNotEmpty) {
  const ApparentTemperature apparent(Band{8.0, 12.0, {}});
  const std::vector<float> two(2, 30.0F);
  const std::vector<float> three(3, 30.0F);
  EXPECT_DEATH((void)apparent.rms_difference_k(two, three), "\\(2 == 3\\)");
  EXPECT_DEATH((void)apparent.rms_difference_k({}, {}), "!a_w_m2_sr.empty\\(\\)");
}

TEST(Contracts, LeastSquaresNeedAWholeMatrix) {
  const std::vector<double> matrix(5, 1.0);
  const std::vector<double> rhs(3, 1.0);
  const std::string message = test::failed_check([&] { (void)solve_nnls(matrix, rhs, 2); });
  EXPECT_NE(message.find("(5 == 6)"), std::string::npos) << message;
}

#if defined(EMIT_DCHECKS) || !defined(NDEBUG)
TEST(Contracts, InnerLoopsAreCheckedInDebugBuilds) {
  EXPECT_DEATH((void)relaxation_gains(-1.0, 10.0), "dt_s >= 0.0 \\(-1 >= 0\\)");
  EXPECT_DEATH((void)relaxation_gains(1.0, 0.0), "tau_s > 0.0 \\(0 > 0\\)");
  std::vector<WeatherSample> rows(2);
  rows[0].sim_time_ns = 10;
  EXPECT_DEATH((void)forcing_from_rows(rows, 0), "is_sorted");
}
#endif

}  // namespace
}  // namespace emit::physics
