// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>
#include <string>

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

/// Material of a scenario with the name of one of the library, but with other layers.
const std::string kInline =
    "[[material]]\nname = \"asphalt\"\nsolar_absorptance_frac = 0.9\nemissivity_frac = 0.9\n"
    "base_k = 290\nlayers = [{ thickness_m = 0.02, conductivity_w_m_k = 0.7, density_kg_m3 = "
    "2000, specific_heat_j_kg_k = 900 }]\n[[material]]\nname = 'odd \"name\" \\ [x]'\n"
    "solar_absorptance_frac = 0.9\nemissivity_frac = 0.9\nbase_k = 290\nlayers = [{ thickness_m = "
    "0.05, conductivity_w_m_k = 0.7, density_kg_m3 = 2000, specific_heat_j_kg_k = 900 }]\n";

std::vector<std::string> quick_fit(const std::string& scenario, std::vector<std::string> more) {
  std::vector<std::string> arguments{"fit",         scenario, "--modes",     "2",
                                     "--spin-up-s", "7200",   "--history-s", "12600"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST(CliFit, tables_to_paste_bring_the_fitted_modes_back_for_any_name) {
  const TemporaryFolder folder;
  const std::string scenario = folder.file("s.toml");
  write_text(scenario,
             "epoch_utc = 2014-06-21T06:00:00Z\n[place]\nlat_deg = 48\nlon_deg = 11\n" + kInline);
  const std::string odd = "odd \"name\" \\ [x]";
  const ProcessResult fit = run_emit(quick_fit(scenario, {"--material", odd, "--toml", "-"}));
  ASSERT_EQ(fit.exit_code, 0) << fit.err;
  EXPECT_NE(fit.out.find("foster_fit"), std::string::npos) << fit.out;
  EXPECT_EQ(fit.out.find("rms K"), std::string::npos) << fit.out;
  // The table takes the place of the scenario's own and gives the same modes again.
  write_text(folder.file("lib.toml"), fit.out);
  const ProcessResult again = run_emit(
      quick_fit(scenario, {"--material", odd, "--library", folder.file("lib.toml"), "--out",
                           folder.file("out.toml"), "--toml", folder.file("again.toml")}));
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(read_text(folder.file("again.toml")), fit.out);
  EXPECT_NE(read_text(folder.file("out.toml")).find("foster_fit"), std::string::npos);
}

TEST(CliFit, modes_of_another_material_of_the_name_stay_out_of_the_library) {
  const TemporaryFolder folder;
  const std::string scenario = folder.file("s.toml");
  write_text(scenario,
             "epoch_utc = 2014-06-21T06:00:00Z\n[place]\nlat_deg = 48\nlon_deg = 11\n" + kInline);
  const ProcessResult fit =
      run_emit(quick_fit(scenario, {"--material", "asphalt", "--out", folder.file("out.toml")}));
  EXPECT_EQ(fit.exit_code, 2) << fit.err;
  EXPECT_NE(fit.err.find("'asphalt'"), std::string::npos) << fit.err;
  EXPECT_NE(fit.err.find("--toml"), std::string::npos) << fit.err;
  const ProcessResult missing = run_emit(
      quick_fit(scenario, {"--material", "odd \"name\" \\ [x]", "--out", folder.file("out.toml")}));
  EXPECT_EQ(missing.exit_code, 2) << missing.err;
  EXPECT_NE(missing.err.find("is not in"), std::string::npos) << missing.err;
  const ProcessResult good = run_emit(
      quick_fit("block-on-road", {"--material", "asphalt", "--out", folder.file("out.toml")}));
  EXPECT_EQ(good.exit_code, 0) << good.err;
}

TEST(CliFit, a_curve_takes_its_material_from_the_library_that_is_given) {
  const TemporaryFolder folder;
  write_text(folder.file("lib.toml"), kInline);
  std::string curve = "time_s,absorbed_w_m2,film_w_m2_k,air_k,temperature_k\n";
  for (int i = 0; i <= 60; ++i) {
    curve += std::to_string(i * 120) + ",700,15,290," + std::to_string(290.0 + 0.2 * i) + "\n";
  }
  write_text(folder.file("c.csv"), curve);
  const ProcessResult fit =
      run_emit({"fit", folder.file("c.csv"), "--material", "odd \"name\" \\ [x]", "--library",
                folder.file("lib.toml"), "--modes", "2"});
  EXPECT_EQ(fit.exit_code, 0) << fit.err;
  const ProcessResult shipped =
      run_emit({"fit", folder.file("c.csv"), "--material", "odd \"name\" \\ [x]"});
  EXPECT_EQ(shipped.exit_code, 2) << shipped.err;
}

}  // namespace
}  // namespace emit::test
