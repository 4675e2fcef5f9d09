// SPDX-License-Identifier: Apache-2.0
// Tests of the visibility of the two thermal methods, by itself, on geometry built from rows: the
// frame's soft shadow and obscurance, with limits a little above the values measured over the whole
// tables, and the rays of the method `cached` against every row.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "emit/physics/csv.hpp"
#include "emit/verify/evaluate.hpp"
#include "support/oracle_check.hpp"

namespace emit {
namespace {

verify::EvaluateRequest gpu_request(const std::string& model, const std::filesystem::path& table,
                                    const std::string& method) {
  verify::EvaluateRequest request;
  request.model = model;
  request.table = table;
  request.device = verify::Device::gpu;
  request.precision = verify::Precision::float32;
  request.method = method;
  return request;
}

std::vector<double> on_gpu(const std::string& model, const std::string& text,
                           const std::string& column) {
  const auto file = std::filesystem::path(testing::TempDir()) / (model + "_gpu.csv");
  std::ofstream(file) << text;
  const auto result = verify::evaluate(gpu_request(model, file, "per-frame"));
  if (!result) {
    ADD_FAILURE() << result.error().text;
    return {};
  }
  const auto table = physics::CsvTable::parse(*result, "result");
  return table ? table->numbers(column).value_or(std::vector<double>{}) : std::vector<double>{};
}

TEST(EvaluateVisibilityGpu, ShadowEdgeFollowsTheDisc) {
  const auto f = on_gpu("sun-disc", "delta_deg\n-0.4\n-0.15\n0\n0.15\n0.4\n", "f");
  ASSERT_EQ(f.size(), 5U);
  EXPECT_EQ(f[0], 0.0);
  EXPECT_EQ(f[4], 1.0);
  const auto exact = [](double delta_deg) {
    const double v = delta_deg / 0.2666;
    return 0.5 + (std::asin(v) + v * std::sqrt(1.0 - v * v)) / 3.14159265358979323846;
  };
  EXPECT_NEAR(f[1], exact(-0.15), 0.08);
  EXPECT_NEAR(f[2], 0.5, 0.08);
  EXPECT_NEAR(f[3], exact(0.15), 0.08);
}

TEST(EvaluateVisibilityGpu, WallShadowIsNearTheExactShare) {
  // The rows are core shadow, penumbra and full sun.
  const auto f = on_gpu("wall-shadow",
                        "H,e_deg,x\n1,45,0.8\n0.48371750116348267,31.859729766845703,"
                        "0.7844818234443665\n1,45,1.2\n",
                        "f");
  ASSERT_EQ(f.size(), 3U);
  EXPECT_EQ(f[0], 0.0);
  EXPECT_NEAR(f[1], 0.93018, 0.1);
  EXPECT_EQ(f[2], 1.0);
}

TEST(EvaluateVisibilityGpu, ObscuranceKnowsFlatConcaveAndConvex) {
  const auto f = on_gpu("sky-view",
                        "kind,p1,p2,p3,p4,p5,p6,p7\nflat,0,0,0,0,0,0,0\nwall,1,0.2,0,0,0,0,0\n"
                        "edge,90,0,0,0,0,0,0\ncube_corner,0,0,0,0,0,0,0\n",
                        "f_uni");
  ASSERT_EQ(f.size(), 4U);
  EXPECT_NEAR(f[0], 0.5, 1e-3);
  EXPECT_LT(f[1], 0.42);
  EXPECT_NEAR(f[2], 0.75, 0.05);
  EXPECT_NEAR(f[3], 0.875, 0.05);
}

/// Expects that every row of a column is near the exact value, and that rows without one have none.
void expect_all_near(const std::string& model, const std::string& table, const std::string& column,
                     const std::string& exact, double bar) {
  const auto file = test::oracle_file(table);
  const auto result = verify::evaluate(gpu_request(model, file, "cached"));
  ASSERT_TRUE(result.has_value()) << result.error().text;
  const auto rows = physics::CsvTable::read(file);
  const auto found = physics::CsvTable::parse(*result, "result");
  ASSERT_TRUE(rows.has_value() && found.has_value());
  const auto expected = rows->numbers(exact);
  const auto got = found->numbers(column);
  ASSERT_TRUE(expected.has_value() && got.has_value());
  ASSERT_EQ(got->size(), expected->size());
  ASSERT_GT(got->size(), 100U);
  for (std::size_t i = 0; i < got->size(); ++i) {
    if (std::isnan((*expected)[i])) {
      EXPECT_TRUE(std::isnan((*got)[i])) << table << ":" << rows->line_of(i);
    } else {
      EXPECT_NEAR((*got)[i], (*expected)[i], bar) << table << ":" << rows->line_of(i);
    }
  }
}

TEST(EvaluateVisibilityGpu, RaysOfSamplesSeeTheSunBehindEveryWall) {
  expect_all_near("wall-shadow", "wall_penumbra.csv", "f", "f_spherical", 0.05);
  expect_all_near("sun-disc", "sun_disc_edge.csv", "f", "f_spherical", 0.05);
}

TEST(EvaluateVisibilityGpu, RaysOfSamplesSeeTheSkyOfEveryRow) {
  expect_all_near("sky-view", "sky_view.csv", "svf", "svf", 0.03);
  expect_all_near("sky-view", "sky_view.csv", "f_uni", "f_uni", 0.03);
}

TEST(EvaluateVisibilityGpu, UnknownMethodIsBadUsage) {
  const auto result =
      verify::evaluate(gpu_request("sky-view", test::oracle_file("sky_view.csv"), "by-guess"));
  ASSERT_FALSE(result.has_value());
  EXPECT_EQ(result.error().code, physics::ErrorCode::invalid_argument);
}

}  // namespace
}  // namespace emit
