// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>
#include <vector>

#include "system/cli_process.hpp"

namespace emit::test {
namespace {

std::vector<double> numbers_of(const std::string& json, const std::string& key) {
  std::vector<double> out;
  const std::string name = "\"" + key + "\": ";
  for (std::size_t at = json.find(name); at != std::string::npos; at = json.find(name, at + 1)) {
    const char* text = json.c_str() + at + name.size();
    char* end = nullptr;
    const double value = std::strtod(text, &end);
    if (end != text) out.push_back(value);  // null is no number
  }
  return out;
}

TEST(CliBench, TheReferenceSolversConvergeWithSecondOrder) {
  const TemporaryFolder folder;
  const ProcessResult run = run_emit(
      {"bench", "convergence", "--plot", folder.file("c.svg"), "--json", folder.file("c.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string json = read_text(folder.file("c.json"));
  EXPECT_EQ(json_value(json, "suite"), "\"convergence\"");
  const std::vector<double> orders = numbers_of(json, "order");
  EXPECT_EQ(orders.size(), 15U);
  for (const double order : orders) EXPECT_GT(order, 1.8);
  const std::vector<double> errors = numbers_of(json, "max_error_k");
  ASSERT_EQ(errors.size(), 19U);
  for (const double error : errors) EXPECT_GT(error, 0.0);
  const std::string svg = read_text(folder.file("c.svg"));
  EXPECT_NE(svg.find("second order"), std::string::npos);
  EXPECT_NE(svg.find("3 dimensions, space"), std::string::npos);
}

}  // namespace
}  // namespace emit::test
