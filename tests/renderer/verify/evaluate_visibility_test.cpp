// SPDX-License-Identifier: Apache-2.0
// Tests of the visibility models against tables computed with 60 digits, through the evaluator as a
// user runs it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "emit/physics/constants.hpp"
#include "emit/reference/sun_disc.hpp"
#include "support/oracle_check.hpp"

namespace emit {
namespace {

using test::oracle_file;
using verify::EvaluateRequest;

test::OracleRun run(const std::string& model, const std::string& table,
                    std::optional<std::uint32_t> rays = std::nullopt) {
  EvaluateRequest request;
  request.model = model;
  request.table = oracle_file(table);
  request.rays = rays;
  auto result = verify::evaluate(request);
  EXPECT_TRUE(result.has_value()) << result.error().text;
  auto expected = physics::CsvTable::read(request.table);
  auto got = physics::CsvTable::parse(result.value_or("empty\n"), "result");
  EXPECT_TRUE(expected.has_value() && got.has_value());
  return {std::move(*expected), std::move(*got)};
}

std::vector<double> errors(const test::OracleRun& run, const std::string& got,
                           const std::string& expected) {
  const auto g = run.got.numbers(got);
  const auto e = run.expected.numbers(expected);
  EXPECT_TRUE(g.has_value() && e.has_value());
  std::vector<double> out;
  for (std::size_t i = 0; i < e->size(); ++i) {
    EXPECT_EQ(std::isnan((*g)[i]), std::isnan((*e)[i])) << "row " << i;
    if (!std::isnan((*e)[i])) out.push_back(std::abs((*g)[i] - (*e)[i]));
  }
  return out;
}

double rms(const std::vector<double>& values) {
  double sum2 = 0.0;
  for (const double v : values) sum2 += v * v;
  return std::sqrt(sum2 / static_cast<double>(values.size()));
}
double largest(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end());
}

TEST(EvaluateVisibility, SunDiscIsExactOnTheSphere) {
  const auto e = errors(run("sun-disc", "sun_disc_edge.csv"), "f", "f_spherical");
  EXPECT_EQ(e.size(), 121U);
  EXPECT_LT(largest(e), 1e-12);
}

TEST(EvaluateVisibility, LimbDarkenedDiscMatchesThePlanarTable) {
  const auto table = physics::CsvTable::read(oracle_file("sun_disc_edge.csv"));
  ASSERT_TRUE(table.has_value());
  const auto delta_deg = *table->numbers("delta_deg");
  const auto expected = *table->numbers("f_limb0.6");
  for (std::size_t i = 0; i < delta_deg.size(); ++i) {
    // The wall is below the horizon, seen from the height of its foot.
    const double e = delta_deg[i] * physics::kDegree;
    const reference::SunDisc disc{.to_centre = {std::cos(e), 0.0, std::sin(e)},
                                  .semi_angle_rad = physics::kSunSemiAngleRad,
                                  .limb_darkening_frac = 0.6};
    const std::array<std::array<glm::dvec3, 3>, 2> wall = {
        {{glm::dvec3(1.0, -9.0, -9.0), glm::dvec3(1.0, 9.0, -9.0), glm::dvec3(1.0, 9.0, 0.0)},
         {glm::dvec3(1.0, -9.0, -9.0), glm::dvec3(1.0, 9.0, 0.0), glm::dvec3(1.0, -9.0, 0.0)}}};
    EXPECT_NEAR(reference::visible_disc_share(wall, glm::dvec3(0.0), disc).visible_frac,
                expected[i], 1e-6)
        << "row " << i;
  }
}

TEST(EvaluateVisibility, WallShadowByRaysWithin2e3AndFallingWithTheirNumber) {
  const auto e = errors(run("wall-shadow", "wall_penumbra.csv"), "f", "f_spherical");
  EXPECT_EQ(e.size(), 150U);
  EXPECT_LT(largest(e), 2e-3);
  double last = 1.0;
  for (const std::uint32_t rays : {64U, 512U, 4096U}) {
    const double now =
        rms(errors(run("wall-shadow", "wall_penumbra.csv", rays), "f", "f_spherical"));
    EXPECT_LT(now, 0.4 * last) << rays;
    last = now;
  }
}

TEST(EvaluateVisibility, SkyViewByRaysWithin2e3AndFallingWithTheirNumber) {
  const auto at_default = run("sky-view", "sky_view.csv");
  EXPECT_LT(largest(errors(at_default, "svf", "svf")), 2e-3);
  EXPECT_LT(largest(errors(at_default, "f_uni", "f_uni")), 2e-3);
  double last_svf = 1.0;
  double last_uni = 1.0;
  for (const std::uint32_t rays : {64U, 512U, 4096U}) {
    const auto result = run("sky-view", "sky_view.csv", rays);
    const double svf = rms(errors(result, "svf", "svf"));
    const double uni = rms(errors(result, "f_uni", "f_uni"));
    EXPECT_LT(svf, 0.4 * last_svf) << rays;
    EXPECT_LT(uni, 0.4 * last_uni) << rays;
    last_svf = svf;
    last_uni = uni;
  }
}

TEST(EvaluateVisibility, BadOptionsAndRowsAreNamed) {
  EvaluateRequest request;
  request.model = "sky-view";
  request.table = oracle_file("sky_view.csv");
  request.precision = verify::Precision::float32;
  auto result = verify::evaluate(request);
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().code, physics::ErrorCode::invalid_argument);
  request.precision = verify::Precision::float64;
  request.method = "per-frame";
  EXPECT_FALSE(verify::evaluate(request).has_value());
}

}  // namespace
}  // namespace emit
