// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

constexpr const char* kTable =
    "time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,wind_m_s,cloud_frac\n"
    "0,500,50,300,290,3,0\n3600,500,50,300,291,4,0\n7200,500,50,300,292,5,0\n";

TEST(CliWeather, shows_a_table_and_writes_json_and_diagrams) {
  const TemporaryFolder folder;
  write_text(folder.file("w.csv"), kTable);
  const ProcessResult result =
      run_emit({"weather", folder.file("w.csv"), "--scenario", "block-on-road", "--plot",
                folder.file("w.svg"), "--json", folder.file("w.json")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("CSV, 3 records, usually one every 3600 s"), std::string::npos)
      << result.out;
  const std::string json = read_text(folder.file("w.json"));
  EXPECT_EQ(json_value(json, "records"), "3");
  EXPECT_EQ(json_value(json, "spacing_s"), "3600");
  // The scenario lacks weather before the table, which its warning says.
  EXPECT_NE(json.find("the weather covers 0 s to 7200 s"), std::string::npos) << json;
  const std::string plot = read_text(folder.file("w.svg"));
  EXPECT_NE(plot.find("<svg"), std::string::npos);
  EXPECT_NE(plot.find("direct sun over the height of the sun"), std::string::npos);
}

TEST(CliWeather, says_where_the_height_of_the_sun_is_not_known) {
  const TemporaryFolder folder;
  write_text(folder.file("w.csv"), kTable);
  const ProcessResult result = run_emit({"weather", folder.file("w.csv"), "--json", "-"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(json_value(result.out, "beam_below_horizon_records"), "null");
  EXPECT_NE(result.err.find("with --scenario"), std::string::npos) << result.err;
}

TEST(CliWeather, refuses_what_it_cannot_read) {
  const TemporaryFolder folder;
  write_text(folder.file("w.csv"), "time_s,air_k\n0,1\n");
  const ProcessResult result = run_emit({"weather", folder.file("w.csv")});
  EXPECT_EQ(result.exit_code, 78) << result.err;
  EXPECT_NE(result.err.find("w.csv"), std::string::npos) << result.err;
}

TEST(CliWeather, light_on_planes_is_no_report) {
  const TemporaryFolder folder;
  write_text(folder.file("w.csv"), kTable);
  const std::vector<std::string> planes{"weather",       folder.file("w.csv"), "--scenario",
                                        "block-on-road", "--planes",           "0:0,180:90"};
  ProcessResult result = run_emit(planes);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  // The sky of the table brings 50 W/m2 for two hours to level ground and half of it to the wall.
  EXPECT_NE(result.out.find("180, 90 deg"), std::string::npos) << result.out;
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{"--plot", "p.svg"}, {"--json", "-"}, {"--every", "7200"}}) {
    std::vector<std::string> line = planes;
    line.insert(line.end(), more.begin(), more.end());
    result = run_emit(line);
    EXPECT_EQ(result.exit_code, 2) << more[0] << ": " << result.err;
    EXPECT_NE(result.err.find(more[0]), std::string::npos) << result.err;
  }
}

}  // namespace
}  // namespace emit::test
