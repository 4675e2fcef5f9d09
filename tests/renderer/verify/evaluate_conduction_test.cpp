// SPDX-License-Identifier: Apache-2.0
// Tests of the conduction models against exact tables, every row, through the evaluator as a user
// runs it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/oracle_check.hpp"

namespace emit {
namespace {

test::OracleRun run(const std::string& model, const std::string& table, std::uint32_t refine,
                    verify::HistoryModel history_model = verify::HistoryModel::reference) {
  verify::EvaluateRequest request;
  request.model = model;
  request.table = test::oracle_file(table);
  request.refine = refine;
  request.history.layers = {{0.15, 0.7, 1.9504e6}, {0.3, 1.5, 1.9e6}, {1.55, 1.2, 2.2e6}};
  request.history.base_k = 286.15;
  request.history.emissivity_frac = 0.93;
  request.history.film_w_m2_k = 13.3;
  request.history.initial = {{0.0, 291.0}, {0.15, 291.5}, {0.45, 289.0}, {2.0, 286.15}};
  request.history.model = history_model;
  request.history.modes = {{2181.0, 0.357}, {9438.0, 0.643}};
  const auto result = verify::evaluate(request);
  EXPECT_TRUE(result.has_value()) << result.error().text;
  auto expected = physics::CsvTable::read(request.table);
  auto got = physics::CsvTable::parse(result.value_or("empty\n"), "result");
  EXPECT_TRUE(expected.has_value() && got.has_value());
  return {std::move(*expected), std::move(*got)};
}

/// Returns the largest error of a column; `scale` divides row by row.
double worst(const test::OracleRun& run, const std::string& column,
             const std::vector<double>& scale = {}) {
  const auto values = run.column(column);
  double largest = 0.0;
  for (std::size_t i = 0; i < values.got.size(); ++i) {
    EXPECT_FALSE(std::isnan(values.got[i])) << "row " << i;
    const double error = std::abs(values.got[i] - values.expected[i]);
    largest = std::max(largest, scale.empty() ? error : error / scale[i]);
  }
  return largest;
}

class ConductionBodies : public testing::TestWithParam<std::pair<const char*, const char*>> {};
INSTANTIATE_TEST_SUITE_P(
    All, ConductionBodies,
    testing::Values(std::pair{"conduction-slab", "cond_slab.csv"},
                    std::pair{"conduction-semi-infinite", "cond_semi_infinite.csv"}),
    [](const auto& body) { return body.index == 0 ? "slab" : "semi_infinite"; });

TEST_P(ConductionBodies, MeetTheBarAndConvergeUnderRefinement) {
  const auto [model, table] = GetParam();
  const double coarse = worst(run(model, table, 1), "T");
  const double fine = worst(run(model, table, 2), "T");
  EXPECT_LT(coarse, 1e-3);  // a tenth of the limit of 10 mK
  EXPECT_LT(fine, coarse / 3.0);
  RecordProperty("max_error_k", std::to_string(coarse));
}

TEST(ConductionLayered, ImpedanceOfEveryRowConverges) {
  const auto coarse = run("conduction-layered", "cond_layered_periodic.csv", 1);
  const auto modulus = *coarse.expected.numbers("absZ");
  const double coarse_frac = worst(coarse, "absZ", modulus);
  EXPECT_LT(coarse_frac, 1e-4);  // the limit is 1e-3
  EXPECT_LT(worst(coarse, "argZ"), 1e-4);
  const auto fine = run("conduction-layered", "cond_layered_periodic.csv", 2);
  EXPECT_LT(worst(fine, "absZ", modulus), coarse_frac / 3.5);
}

TEST(SurfaceHistory, ReferenceFollowsEveryRowOfTheTable) {
  for (const std::uint32_t refine : {1U, 2U}) {
    const auto history = run("surface-history", "fv_reference.csv", refine);
    for (const char* name : {"Ts0", "Ts1", "Ts2", "Ts3"}) {
      const auto column = history.column(name);
      EXPECT_TRUE(std::isnan(column.got[0]));
      for (std::size_t i = 1; i < column.got.size(); ++i) {
        // The table's own error is about 0.5 mK.
        EXPECT_NEAR(column.got[i], column.expected[i], 1e-3) << name << " row " << i;
      }
    }
  }
}

TEST(SurfaceHistory, ModelsOfTheFastPathStayWithinTheirKnownError) {
  // These are the model errors in kelvin over the four scenarios. The single layer without
  // convection is far off; four states of the stack follow within a kelvin.
  const auto worst_k = [](verify::HistoryModel model) {
    const auto history = run("surface-history", "fv_reference.csv", 1, model);
    double largest = 0.0;
    for (const char* name : {"Ts0", "Ts1", "Ts2", "Ts3"}) {
      const auto column = history.column(name);
      for (std::size_t i = 1; i < column.got.size(); ++i) {
        largest = std::max(largest, std::abs(column.got[i] - column.expected[i]));
      }
    }
    return largest;
  };
  const double foster = worst_k(verify::HistoryModel::foster);
  const double emit2014 = worst_k(verify::HistoryModel::emit2014);
  EXPECT_LT(foster, 1.5);
  EXPECT_GT(emit2014, 2.0 * foster);
  EXPECT_LT(emit2014, 40.0);
}

TEST(SurfaceHistory, MissingOptionsAreNamed) {
  verify::EvaluateRequest request;
  request.model = "surface-history";
  request.table = test::oracle_file("fv_reference.csv");
  const auto expect = [&](const char* option) {
    const auto result = verify::evaluate(request);
    ASSERT_FALSE(result.has_value());
    EXPECT_EQ(result.error().code, physics::ErrorCode::invalid_argument);
    EXPECT_NE(result.error().text.find(option), std::string::npos) << result.error().text;
  };
  expect("--layers");
  request.history.layers = {{0.1, 1.0, 2e6}};
  expect("--base-k");
  request.history.base_k = 280.0;
  expect("--emissivity");
  request.history.emissivity_frac = 0.9;
  expect("--film-w-m2-k");
  request.history.film_w_m2_k = 10.0;
  expect("--initial");
  request.history.initial = {{0.0, 290.0}};
  request.refine = 3;
  expect("--refine");
  request.refine = 1;
  request.history.layers = {{0.1, -1.0, 2e6}};
  expect("--layers");
}

}  // namespace
}  // namespace emit
