// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "emit/image/exr_image.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using Row = std::map<std::string, std::string>;

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  bool inside = false;
  for (const char c : line) {
    if (c == '"') {
      inside = !inside;
    } else if (c == ',' && !inside) {
      cells.emplace_back();
    } else {
      cells.back() += c;
    }
  }
  return cells;
}

std::vector<Row> rows_of(const std::string& text) {
  std::istringstream in(text);
  std::string line;
  std::getline(in, line);
  const std::vector<std::string> header = cells_of(line);
  std::vector<Row> rows;
  while (std::getline(in, line)) {
    const std::vector<std::string> cells = cells_of(line);
    EXPECT_EQ(cells.size(), header.size()) << line;
    Row row;
    for (std::size_t i = 0; i < std::min(cells.size(), header.size()); ++i) {
      row[header[i]] = cells[i];
    }
    rows.push_back(row);
  }
  return rows;
}

double number(const Row& row, const std::string& column) {
  return row.contains(column) ? std::stod(row.at(column)) : NAN;
}

std::vector<std::string> probe(std::vector<std::string> more) {
  std::vector<std::string> arguments{"probe", "block-on-road",      "--set", "sensor.width_px=80",
                                     "--set", "sensor.height_px=64"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST(CliProbe, a_pixel_has_the_floats_of_the_picture) {
  const TemporaryFolder folder;
  const ProcessResult probed = run_emit(
      probe({"--at", "px:40,32", "--at", "px:10,50", "--at", "px:75,35", "--times",
             "08:00..09:30/45min", "--out", folder.file("p.csv"), "--plot", folder.file("p.svg")}));
  ASSERT_EQ(probed.exit_code, 0) << probed.err;
  EXPECT_NE(read_text(folder.file("p.svg")).find("<svg"), std::string::npos);
  ASSERT_EQ(run_emit({"render", "block-on-road", "--set", "sensor.width_px=80", "--set",
                      "sensor.height_px=64", "--times", "08:00..09:30/45min", "--out",
                      folder.file("f.exr")})
                .exit_code,
            0);
  const std::vector<Row> rows = rows_of(read_text(folder.file("p.csv")));
  ASSERT_EQ(rows.size(), 9U);
  for (const Row& row : rows) {
    const auto frame = image::read_exr(folder.file("f_t" + row.at("time_s") + ".exr"));
    ASSERT_TRUE(frame.has_value()) << frame.error().text;
    const std::string name = row.at("point");
    const std::size_t comma = name.find(',');
    const std::size_t px = static_cast<std::size_t>(std::stoi(name.substr(3, comma - 3))) +
                           80U * static_cast<std::size_t>(std::stoi(name.substr(comma + 1)));
    EXPECT_EQ(std::stof(row.at("temperature_k")), frame->find("temperature")->pixels[px]) << name;
    EXPECT_EQ(std::stof(row.at("radiance_8-12_w_m2_sr")), frame->find("radiance")->pixels[px])
        << name;
  }
}

TEST(CliProbe, temperatures_are_those_of_the_reference_solution) {
  const TemporaryFolder folder;
  // The roof of the block, open road in the sun, and road behind the block where nothing changes.
  write_text(folder.file("at.csv"), "x_m,y_m,z_m\n0,0,1\n4,1,0\n3,-4,0\n");
  const ProcessResult probed = run_emit(probe(
      {"--at", folder.file("at.csv"), "--times", "08:00,09:30", "--out", folder.file("p.csv")}));
  ASSERT_EQ(probed.exit_code, 0) << probed.err;
  const ProcessResult solved =
      run_emit({"solve", "block-on-road", "--times", "08:00,09:30", "--at", folder.file("at.csv"),
                "--at-out", folder.file("s.csv"), "--refine", "0.3", "--rays", "64"},
               std::chrono::seconds(300));
  ASSERT_EQ(solved.exit_code, 0) << solved.err;
  const std::vector<Row> ours = rows_of(read_text(folder.file("p.csv")));
  const std::vector<Row> truth = rows_of(read_text(folder.file("s.csv")));
  ASSERT_EQ(ours.size(), 6U);
  ASSERT_EQ(truth.size(), 6U);
  for (std::size_t i = 0; i < ours.size(); ++i) {
    EXPECT_EQ(ours[i].at("time_s"), truth[i].at("time_s"));
    // The budget of the real-time path against the reference in the sun and on top.
    EXPECT_NEAR(number(ours[i], "temperature_k"), number(truth[i], "temperature_k"), 0.5)
        << ours[i].at("point") << " at " << ours[i].at("time_s");
    EXPECT_EQ(number(ours[i], "sun_frac") > 0.99, true);
  }
}

TEST(CliProbe, fluxes_close_the_balance_of_the_open_road) {
  const TemporaryFolder folder;
  const ProcessResult probed = run_emit(
      probe({"--at", "block_on_road:asphalt", "--times", "09:00", "--out", folder.file("p.csv")}));
  ASSERT_EQ(probed.exit_code, 0) << probed.err;
  const Row row = rows_of(read_text(folder.file("p.csv"))).at(0);
  EXPECT_EQ(row.at("object"), "block_on_road");
  EXPECT_NEAR(number(row, "nz"), 1.0, 1e-9) << "the largest triangle of the road looks up";
  EXPECT_NEAR(number(row, "sky_frac"), 1.0, 0.02);
  // The level face takes the direct flux times the sine of the elevation. At the solstice the
  // declination is 23.44 degrees; the sun is 34.2 degrees before the meridian of 11.26 E.
  constexpr double kDegree = 0.017453292519943295;
  const double sine =
      std::sin(48.56 * kDegree) * std::sin(23.44 * kDegree) +
      std::cos(48.56 * kDegree) * std::cos(23.44 * kDegree) * std::cos(34.2 * kDegree);
  EXPECT_NEAR(number(row, "sun_w_m2") / number(row, "sun_direct_w_m2"), sine, 0.005);
  // The net flux into the solid is what is absorbed less what leaves; the film is the only unknown,
  // and lies between still air and a strong wind.
  constexpr double kSigma = 5.670374419e-8;
  constexpr double kAbsorptance = 0.75;
  constexpr double kEmissivity = 0.93;
  const double t_k = number(row, "temperature_k");
  const double net = kAbsorptance * (number(row, "sun_w_m2") + number(row, "sky_diffuse_w_m2")) +
                     kEmissivity * (number(row, "sky_longwave_w_m2") - kSigma * std::pow(t_k, 4));
  const double film = (net - number(row, "flux_w_m2")) / (t_k - number(row, "air_k"));
  EXPECT_GT(film, 4.0);
  EXPECT_LT(film, 25.0);
}

TEST(CliProbe, what_is_not_there_is_named) {
  const TemporaryFolder folder;
  for (const auto& [at, text] :
       {std::pair{"block_on_rod", "did you mean 'block_on_road'"},
        std::pair{"block_on_road:wood", "has no part 'wood'; it has asphalt, concrete"},
        std::pair{"px:80,0", "to 79,63"}, std::pair{"1,2", "none of x,y,z"}}) {
    const ProcessResult result = run_emit(probe({"--at", at, "--times", "09:00"}));
    EXPECT_EQ(result.exit_code, 2) << at;
    EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
  }
  const ProcessResult air = run_emit(probe({"--at", "0,0,3", "--times", "09:00"}));
  EXPECT_EQ(air.exit_code, 0) << air.err;
  EXPECT_NE(air.err.find("no surface is within 0.02 m"), std::string::npos) << air.err;
  EXPECT_NE(air.out.find(",nan,nan,"), std::string::npos) << air.out;
}

}  // namespace
}  // namespace emit::test
