// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "support/emit_process.hpp"
#include "support/peers.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;
/// A flight and a study take minutes where other tests run beside them.
constexpr std::chrono::seconds kEngageLimit{880};

/// The scene is coarse, its history is short, and the image is a part of the usual one, which keeps
/// llvmpipe quick.
std::vector<std::string> coarse(std::vector<std::string> arguments) {
  for (const char* set :
       {"thermal.max_samples=20000", "thermal.tolerance_k=30", "thermal.shadow_map_px=256",
        "thermal.history_start_s=-600", "thermal.steps=5", "thermal.spin_up_s=3600",
        "sensor.width_px=160", "sensor.height_px=128", "sensor.fov_h_deg=4"}) {
    arguments.emplace_back("--set");
    arguments.emplace_back(set);
  }
  return arguments;
}

bool has_python() {
  return run_process({"/usr/bin/python3", "-c", "import numpy, google.protobuf"}).exit_code == 0;
}

/// Returns the text of a member of a JSON text with two blanks of indent, up to its closing brace.
std::string member(const std::string& json, const std::string& key) {
  const std::size_t begin = json.find("\n  \"" + key + "\": {");
  if (begin == std::string::npos) return "";
  return json.substr(begin, json.find("\n  }", begin) - begin);
}

using Table = std::vector<std::map<std::string, double>>;

/// Reads a CSV of numbers with a header.
Table read_table(const std::string& file) {
  std::istringstream text(read_text(file));
  std::string line;
  std::vector<std::string> names;
  Table out;
  while (std::getline(text, line)) {
    std::istringstream cells(line);
    std::string cell;
    std::vector<std::string> row;
    while (std::getline(cells, cell, ',')) row.push_back(cell);
    if (names.empty()) {
      names = row;
      continue;
    }
    out.emplace_back();
    for (std::size_t i = 0; i < std::min(row.size(), names.size()); ++i) {
      out.back()[names[i]] = std::strtod(row[i].c_str(), nullptr);
    }
  }
  return out;
}

TEST(CliEngage, HitsTheTargetInStepsAndRepeatsItself) {
  if (!has_python()) GTEST_SKIP() << "python3-numpy or python3-protobuf is missing";
  const TemporaryFolder folder;
  std::array<std::string, 2> flights;
  for (std::size_t run = 0; run < flights.size(); ++run) {
    const std::string out = folder.file("out" + std::to_string(run));
    const ProcessResult result =
        run_emit(coarse({"engage", "--rate-hz", "50", "--out", out}), kEngageLimit);
    ASSERT_EQ(result.exit_code, 0) << result.out << result.err;
    flights[run] = member(read_text(out + "/report.json"), "flight");
    EXPECT_LT(std::stod(json_value(flights[run], "miss_m")), 0.5) << flights[run];
    EXPECT_EQ(json_value(flights[run], "pose_difference_max_m"), "0");
    EXPECT_EQ(json_value(flights[run], "pose_difference_max_rad"), "0");
    const std::string html = read_text(out + "/report.html");
    EXPECT_THAT(html, HasSubstr("miss distance"));
    EXPECT_THAT(html, HasSubstr("data:image/png;base64,iVBORw0KGgo"));
    EXPECT_EQ(html.find("src=\"http"), std::string::npos);
    EXPECT_THAT(read_text(out + "/flight.nmea"), HasSubstr("$GPGGA,083000.00,"));
    EXPECT_EQ(read_table(out + "/frames.csv").size(),
              std::stoul(json_value(flights[run], "frames")));
  }
  EXPECT_EQ(flights[0], flights[1]);
}

TEST(CliEngage, SaysWhatIsWrongWithASeeker) {
  const TemporaryFolder folder;
  const std::pair<const char*, const char*> cases[] = {
      {"echo this is no seeker; true", "no JSON object: this is no seeker"},
      {"echo cannot see >&2; false", "cannot see"},
      {R"(echo '{"ready": true}'; cat /dev/null; true)", "seeker: the program has ended"}};
  for (const auto& [seeker, text] : cases) {
    // The daemon is warm before it has a seeker, and one warm-up serves all.
    const ProcessResult result =
        run_emit(coarse({"engage", "--seeker", seeker, "--out", folder.file("out"), "--set",
                         "thermal.state_file=" + folder.file("surface.state")}),
                 kEngageLimit);
    EXPECT_EQ(result.exit_code, 1) << result.out;
    EXPECT_THAT(result.err, HasSubstr(text));
  }
}

TEST(CliEngage, ChecksItsArguments) {
  const TemporaryFolder folder;
  const std::pair<std::vector<std::string>, const char*> cases[] = {
      {{"--aim-m", "1"}, "three numbers"},
      {{"--host", "jsbsim"}, "--jsbsim-root"},
      {{"--host", "jsbsim", "--jsbsim-root", "/nowhere", "--real-time"}, "--real-time"}};
  for (const auto& [arguments, text] : cases) {
    std::vector<std::string> all{"engage", "--out", folder.file("out")};
    all.insert(all.end(), arguments.begin(), arguments.end());
    const ProcessResult result = run_emit(all);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_THAT(result.err, HasSubstr(text));
  }
  const ProcessResult target = run_emit({"engage", "--target", "77", "--out", folder.file("out")});
  EXPECT_EQ(target.exit_code, 78) << target.err;
  EXPECT_THAT(target.err, HasSubstr("no object has the entity_id 77"));
}

TEST(CliEngage, TheMotionSimulatorFollowsInRealTime) {
  if (!has_python()) GTEST_SKIP() << "python3-numpy or python3-protobuf is missing";
  const TemporaryFolder folder;
  const ProcessResult result = run_emit(coarse({"engage", "--real-time", "--rate-hz", "10",
                                                "--duration-s", "4", "--out", folder.file("out")}),
                                        kEngageLimit);
  ASSERT_EQ(result.exit_code, 0) << result.out << result.err;
  const std::string json = read_text(folder.file("out/report.json"));
  EXPECT_GT(std::stoi(json_value(member(json, "motion"), "pointing_frames")), 10) << json;
  EXPECT_GT(std::stoi(json_value(member(json, "flight"), "target_found_frames")), 10) << json;
}

TEST(CliEngage, TheTrackerStudyMatchesBestWithThermalShadows) {
  if (!has_python()) GTEST_SKIP() << "python3-numpy or python3-protobuf is missing";
  const TemporaryFolder folder;
  const ProcessResult result =
      run_emit({"engage", "--only-tracker-study", "--study-length-s", "1200", "--study-step-s",
                "1200", "--set", "thermal.max_samples=30000", "--set", "thermal.tolerance_k=10",
                "--set", "thermal.shadow_map_px=512", "--set", "thermal.spin_up_s=36000", "--out",
                folder.file("out")},
               kEngageLimit);
  ASSERT_EQ(result.exit_code, 0) << result.out << result.err;
  const std::string json = read_text(folder.file("out/report.json"));
  const auto last = [&json](const std::string& model, const std::string& key) {
    const std::size_t at = json.find("\"time_s\": 1200", json.find("\"" + model + "\": {"));
    return std::stod(json_value(json.substr(at), key));
  };
  // Templates that fit worse than perfectly, and those that are lost. A single lost one of these 75
  // is more than a pixel of RMS, so that the RMS says little here.
  for (const char* const other : {"plain", "none"}) {
    EXPECT_LT(1.0 - last("thermal", "correlation"), 0.25 * (1.0 - last(other, "correlation")))
        << json;
    EXPECT_LE(last("thermal", "lost_frac"), last(other, "lost_frac")) << json;
    EXPECT_LT(last("thermal", "median_px"), last(other, "median_px")) << json;
  }
  EXPECT_THAT(read_text(folder.file("out/tracker_study.svg")), HasSubstr("no shadows"));
}

/// Returns JSBSim's program; "" where there is none.
std::string jsbsim_program() {
  if (const char* const given = std::getenv("TEST_JSBSIM")) return given;
  for (const std::filesystem::path& program :
       {std::filesystem::path("/usr/games/JSBSim"), peers_folder() / "JSBSim"}) {
    if (std::filesystem::exists(program)) return program;
  }
  return "";
}

using Vector = std::array<double, 3>;

/// WGS-84 position of a place, by the textbook formula.
Vector earth_point(double lat, double lon, double height) {
  const double e2 = 6.69437999014e-3;
  const double n = 6378137.0 / std::sqrt(1.0 - e2 * std::sin(lat) * std::sin(lat));
  return {(n + height) * std::cos(lat) * std::cos(lon),
          (n + height) * std::cos(lat) * std::sin(lon), (n * (1.0 - e2) + height) * std::sin(lat)};
}

/// East, north and up at a place, as rows.
std::array<Vector, 3> east_north_up(double lat, double lon) {
  return {Vector{-std::sin(lon), std::cos(lon), 0.0},
          Vector{-std::sin(lat) * std::cos(lon), -std::sin(lat) * std::sin(lon), std::cos(lat)},
          Vector{std::cos(lat) * std::cos(lon), std::cos(lat) * std::sin(lon), std::sin(lat)}};
}

double dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// Axis of a body in east, north and up, from a quaternion.
Vector rotated(const std::map<std::string, double>& row, const Vector& v) {
  const double w = row.at("qw");
  const Vector q{row.at("qx"), row.at("qy"), row.at("qz")};
  const auto cross = [](const Vector& a, const Vector& b) {
    return Vector{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  };
  const Vector t = cross(q, v);
  const Vector u = cross(q, t);
  return {v[0] + 2.0 * (w * t[0] + u[0]), v[1] + 2.0 * (w * t[1] + u[1]),
          v[2] + 2.0 * (w * t[2] + u[2])};
}

TEST(CliEngage, FramesShowThePosesOfJsbsim) {
  const std::string program = jsbsim_program();
  if (program.empty()) GTEST_SKIP() << "JSBSim is missing: install_deps.sh --with-peers brings it";
  if (!has_python()) GTEST_SKIP() << "python3-numpy or python3-protobuf is missing";
  const TemporaryFolder folder;
  const ProcessResult result =
      run_emit(coarse({"engage", "--host", "jsbsim", "--jsbsim", program, "--jsbsim-root",
                       std::string(EMIT_TEST_SOURCE_DIR) + "/data/jsbsim", "--aircraft", "stone",
                       "--duration-s", "5", "--out", folder.file("out"), "--keep"}),
               kEngageLimit);
  ASSERT_EQ(result.exit_code, 0) << result.out << result.err;
  // The frames show the poses of the host exactly, and those are JSBSim's own.
  const std::string json = read_text(folder.file("out/report.json"));
  EXPECT_EQ(json_value(json, "pose_difference_max_m"), "0");
  EXPECT_EQ(json_value(json, "pose_difference_max_rad"), "0");
  const Table frames = read_table(folder.file("out/frames.csv"));
  ASSERT_EQ(frames.size(), 501U);
  std::string truth_file;
  for (const auto& entry : std::filesystem::directory_iterator(folder.file("out"))) {
    if (entry.is_directory()) truth_file = entry.path().string() + "/jsbsim/truth.csv";
  }
  std::map<long, std::map<std::string, double>> truth;
  for (const auto& row : read_table(truth_file)) truth[std::lround(100.0 * row.at("Time"))] = row;
  ASSERT_GT(truth.size(), 500U) << truth_file;

  constexpr double kDegree = 3.14159265358979323846 / 180.0;
  const double lat0 = 48.56 * kDegree;
  const double lon0 = 11.26 * kDegree;
  const Vector origin = earth_point(lat0, lon0, 490.0);
  const auto axes = east_north_up(lat0, lon0);
  const std::string p = "/fdm/jsbsim/";
  // The flight begins at JSBSim's first or second step.
  const long first = std::lround(100.0 * (truth.begin()->second.at("Time"))) + 1;
  double worst_m = 0.0;
  double worst_rad = 0.0;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const auto& own = truth.at(first + static_cast<long>(k));
    const double lat = own.at(p + "position/lat-geod-rad");
    const double lon = own.at(p + "position/long-gc-rad");
    const Vector at = earth_point(lat, lon, own.at(p + "position/h-sl-meters"));
    const Vector way{at[0] - origin[0], at[1] - origin[1], at[2] - origin[2]};
    const Vector shown{frames[k].at("east_m"), frames[k].at("north_m"), frames[k].at("up_m")};
    for (std::size_t i = 0; i < 3; ++i) {
      worst_m = std::max(worst_m, std::abs(dot(axes[i], way) - shown[i]));
    }
    // The x axis of the body in north, east and down at its own place.
    const double roll = own.at(p + "attitude/phi-rad");
    const double pitch = own.at(p + "attitude/theta-rad");
    const double heading = own.at(p + "attitude/psi-rad");
    const Vector nose{std::cos(pitch) * std::cos(heading), std::cos(pitch) * std::sin(heading),
                      -std::sin(pitch)};
    const Vector right{
        std::sin(roll) * std::sin(pitch) * std::cos(heading) - std::cos(roll) * std::sin(heading),
        std::sin(roll) * std::sin(pitch) * std::sin(heading) + std::cos(roll) * std::cos(heading),
        std::sin(roll) * std::cos(pitch)};
    const auto local = east_north_up(lat, lon);
    for (const auto& [axis, body] : {std::pair(nose, Vector{1, 0, 0}), {right, Vector{0, 1, 0}}}) {
      Vector earth{};
      for (std::size_t i = 0; i < 3; ++i) {
        earth[i] = axis[1] * local[0][i] + axis[0] * local[1][i] - axis[2] * local[2][i];
      }
      const Vector seen = rotated(frames[k], body);
      for (std::size_t i = 0; i < 3; ++i) {
        worst_rad = std::max(worst_rad, std::abs(dot(axes[i], earth) - seen[i]));
      }
    }
  }
  EXPECT_LT(worst_m, 1e-3);
  EXPECT_LT(worst_rad, 1e-6);
  // It does move and turn.
  EXPECT_GT(std::abs(frames.back().at("up_m") - frames.front().at("up_m")), 10.0);
  EXPECT_GT(std::abs(frames.back().at("qx") - frames.front().at("qx")), 0.01);
}

}  // namespace
}  // namespace emit::test
