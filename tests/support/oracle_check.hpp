// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "emit/physics/csv.hpp"
#include "emit/verify/evaluate.hpp"

/// Runs a model over a table of exact values and hands back both, column by column.
namespace emit::test {

inline std::filesystem::path oracle_file(const std::string& name) {
  return std::filesystem::path(EMIT_TEST_SOURCE_DIR) / "data" / "oracles" / name;
}

struct OracleRun {
  physics::CsvTable expected;
  physics::CsvTable got;

  struct Pair {
    std::vector<double> expected;
    std::vector<double> got;
  };
  [[nodiscard]] Pair column(const std::string& name) const {
    auto e = expected.numbers(name);
    auto g = got.numbers(name);
    EXPECT_TRUE(e.has_value() && g.has_value()) << name;
    EXPECT_EQ(e->size(), g->size());
    EXPECT_GT(e->size(), 0U);
    return {std::move(*e), std::move(*g)};
  }
};

inline OracleRun run_oracle(const std::string& model, const std::string& table,
                            verify::Precision precision, verify::Device device) {
  verify::EvaluateRequest request;
  request.model = model;
  request.table = oracle_file(table);
  request.cases = oracle_file("relax_cases.csv");
  request.nodes = oracle_file("relax_nodes.csv");
  request.precision = precision;
  request.device = device;
  auto result = verify::evaluate(request);
  EXPECT_TRUE(result.has_value()) << result.error().text;
  auto expected = physics::CsvTable::read(request.table);
  auto got = physics::CsvTable::parse(result.value_or("empty\n"), "result");
  EXPECT_TRUE(expected.has_value() && got.has_value());
  return {std::move(*expected), std::move(*got)};
}

}  // namespace emit::test
