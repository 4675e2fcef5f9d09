// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

/// Rows without conduction and convection: the equilibrium is Ta itself, whatever the emissivity.
constexpr char kRows[] =
    "lambda,d,eps,Ta,Tc,hc,Tair\n0,0.1,0.9,300,280,0,290\n1.5,0.2,0.9,320,290,5,295\n";

TEST(CliEvaluate, prints_a_header_and_one_row_per_input_row_and_nothing_else) {
  const TemporaryFolder folder;
  write_text(folder.file("in.csv"), std::string("# comment\n") + kRows);
  const ProcessResult result = run_emit({"evaluate", "equilibrium", folder.file("in.csv")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto lines = lines_of(result.out);
  ASSERT_EQ(lines.size(), 3U) << result.out;
  EXPECT_EQ(lines[0], "Ts");
  EXPECT_NEAR(std::stod(lines[1]), 300.0, 1e-9);  // K; the quartic is solved to double precision
}

TEST(CliEvaluate, column_order_extra_columns_and_line_ends_do_not_matter) {
  const TemporaryFolder folder;
  write_text(folder.file("a.csv"), kRows);
  write_text(folder.file("b.csv"),
             "Tair,hc,note,Tc,Ta,eps,d,lambda\r\n290,0,x,280,300,0.9,0.1,0\r\n"
             "295,5,y,290,320,0.9,0.2,1.5\r\n");
  const ProcessResult a = run_emit({"evaluate", "equilibrium", folder.file("a.csv")});
  const ProcessResult b = run_emit({"evaluate", "equilibrium", folder.file("b.csv")});
  ASSERT_EQ(a.exit_code, 0) << a.err;
  ASSERT_EQ(b.exit_code, 0) << b.err;
  EXPECT_EQ(a.out, b.out);
}

TEST(CliEvaluate, a_missing_column_exits_with_2_and_is_named) {
  const TemporaryFolder folder;
  write_text(folder.file("in.csv"), "lambda,d,eps,Ta,Tc,hc\n0,0.1,0.9,300,280,0\n");
  const ProcessResult result = run_emit({"evaluate", "equilibrium", folder.file("in.csv")});
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_NE(result.err.find("Tair"), std::string::npos) << result.err;
  EXPECT_TRUE(result.out.empty());
}

TEST(CliEvaluate, an_unknown_model_exits_with_2) {
  const TemporaryFolder folder;
  write_text(folder.file("in.csv"), kRows);
  EXPECT_EQ(run_emit({"evaluate", "phlogiston", folder.file("in.csv")}).exit_code, 2);
}

TEST(CliEvaluate, double_precision_on_the_gpu_exits_with_2) {
  const TemporaryFolder folder;
  write_text(folder.file("in.csv"), kRows);
  EXPECT_EQ(
      run_emit({"evaluate", "equilibrium", folder.file("in.csv"), "--device", "gpu"}).exit_code, 2);
}

TEST(CliEvaluate, the_shader_agrees_with_double_to_a_millikelvin) {
  const TemporaryFolder folder;
  write_text(folder.file("in.csv"), kRows);
  const ProcessResult cpu = run_emit({"evaluate", "equilibrium", folder.file("in.csv")});
  const ProcessResult gpu = run_emit({"evaluate", "equilibrium", folder.file("in.csv"),
                                      "--precision", "float32", "--device", "gpu"});
  ASSERT_EQ(cpu.exit_code, 0) << cpu.err;
  ASSERT_EQ(gpu.exit_code, 0) << gpu.err;
  const auto exact = lines_of(cpu.out);
  const auto shader = lines_of(gpu.out);
  ASSERT_EQ(exact.size(), shader.size());
  for (std::size_t i = 1; i < exact.size(); ++i) {
    EXPECT_NEAR(std::stod(shader[i]), std::stod(exact[i]), 1e-3) << "row " << i;
  }
}

}  // namespace
}  // namespace emit::test
