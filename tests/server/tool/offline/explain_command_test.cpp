// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "emit/image/exr_image.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using Arguments = std::vector<std::string>;

constexpr std::size_t kWidth = 80;
const Arguments kScene{"block-on-road", "--set", "sensor.width_px=80", "--set",
                       "sensor.height_px=64"};

ProcessResult explain(const std::string& px, const Arguments& more) {
  Arguments arguments{"explain", "--time-s", "12600", "--px", px};
  arguments.insert(arguments.end(), kScene.begin(), kScene.end());
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_emit(arguments);
}

/// The parts of a document that describe one band each.
std::vector<std::string> bands_of(const std::string& json) {
  std::vector<std::string> out;
  for (std::size_t at = json.find("\"band\":"); at != std::string::npos;) {
    const std::size_t next = json.find("\"band\":", at + 1);
    out.push_back(json.substr(at, next - at));
    at = next;
  }
  return out;
}

double number(const std::string& json, const std::string& key) {
  const std::string text = json_value(json, key);
  return text.empty() || text == "null" ? NAN : std::stod(text);
}

TEST(CliExplain, the_terms_add_up_to_the_pixel_through_air_of_every_kind_and_over_clutter) {
  const TemporaryFolder folder;
  const std::string terms =
      "atmosphere.band=[{band=\"8-12\",terms=[[0.7,0.1],[0.3,2.0]],vertical_transmittance_frac=0.6}"
      ","
      "{band=\"3-5\",terms=[[1.0,0.3]],vertical_transmittance_frac=0.5}]";
  const std::vector<Arguments> airs{
      {},
      {"--set", "atmosphere.file=\"share:atmospheres/midlatitude_summer_ground.csv\""},
      {"--set", "atmosphere.enabled=false"},
      {"--set", terms},
      {"--set",
       "clutter=[{material=\"asphalt\",shortest_m=0.05,longest_m=1.5,solar_absorptance_sd_frac=0."
       "02,"
       "emissivity_sd_frac=0.005}]"},
      {"--set", "thermal.method=\"per-frame\""}};
  for (std::size_t a = 0; a < airs.size(); ++a) {
    // A lit roof, a wall, the road and its shadow; without built-in air one pixel suffices.
    const std::vector<std::string> pixels =
        a == 0 ? std::vector<std::string>{"40,32", "10,50", "75,35", "50,15"}
               : std::vector<std::string>{"10,50"};
    for (const std::string& px : pixels) {
      SCOPED_TRACE(std::to_string(a) + " at " + px);
      // A coarse history is quick, and the terms are those of any temperature.
      Arguments more{"--hours", "0",
                     "--json",  folder.file("e.json"),
                     "--set",   "thermal.tolerance_k=20",
                     "--set",   "thermal.spin_up_s=3600",
                     "--set",   "thermal.first_step_s=120"};
      more.insert(more.end(), airs[a].begin(), airs[a].end());
      const ProcessResult result = explain(px, more);
      ASSERT_EQ(result.exit_code, 0) << result.err;
      EXPECT_EQ(result.err.find("add up"), std::string::npos) << result.err;
      const std::vector<std::string> bands = bands_of(read_text(folder.file("e.json")));
      ASSERT_EQ(bands.size(), 2U);
      for (const std::string& band : bands) {
        const double pixel = number(band, "pixel_w_m2_sr");
        double sum = 0.0;
        for (const char* term : {"emission_w_m2_sr", "sky_w_m2_sr", "neighbours_w_m2_sr",
                                 "sun_w_m2_sr", "path_w_m2_sr", "scattered_w_m2_sr"}) {
          EXPECT_GE(number(band, term), -1e-6 * pixel) << term;
          sum += number(band, term);
        }
        EXPECT_NEAR(sum / pixel, 1.0, 1e-5) << band;
      }
    }
  }
}

TEST(CliExplain, the_pixel_is_that_of_the_picture_and_its_surface_has_a_history) {
  const TemporaryFolder folder;
  const ProcessResult result =
      explain("75,35", {"--json", folder.file("e.json"), "--html", folder.file("e.html")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string json = read_text(folder.file("e.json"));
  Arguments render{"render", "--time-s", "12600", "--out", folder.file("f.exr")};
  render.insert(render.end(), kScene.begin(), kScene.end());
  ASSERT_EQ(run_emit(render).exit_code, 0);
  const auto frame = image::read_exr(folder.file("f.exr"));
  ASSERT_TRUE(frame.has_value()) << frame.error().text;
  const std::size_t px = 35U * kWidth + 75U;
  EXPECT_EQ(static_cast<float>(number(bands_of(json).at(0), "pixel_w_m2_sr")),
            frame->find("radiance")->pixels[px]);
  EXPECT_EQ(static_cast<float>(number(json, "temperature_k")),
            frame->find("temperature")->pixels[px]);
  EXPECT_EQ(json_value(json, "object"), "\"block_on_road\"");
  // The scenario's history begins 3.5 hours before; the last entry is the pixel itself.
  const std::size_t last = json.rfind("\"sim_time_s\"");
  EXPECT_EQ(number(json.substr(last), "sim_time_s"), 12600.0);
  EXPECT_NEAR(number(json.substr(last), "temperature_k"), number(json, "temperature_k"), 0.3);
  EXPECT_EQ(number(json.substr(json.find("\"history\"")), "sim_time_s"), 0.0);
  // The history of the surface begins where that of the scenario does, which is no fault of it.
  EXPECT_TRUE(result.err.empty()) << result.err;
  EXPECT_NE(result.out.find("last 3.5 h"), std::string::npos) << result.out;
  const std::string page = read_text(folder.file("e.html"));
  EXPECT_NE(page.find("<svg"), std::string::npos);
  EXPECT_NE(page.find("reflected neighbours"), std::string::npos);
}

TEST(CliExplain, only_a_pixel_with_a_small_target_is_told_to_be_drawn_otherwise) {
  const TemporaryFolder folder;
  const Arguments scene{"decoys",
                        "--time-s",
                        "6",
                        "--set",
                        "sensor.width_px=80",
                        "--set",
                        "sensor.height_px=64",
                        "--set",
                        "thermal.tolerance_k=8",
                        "--set",
                        "thermal.state_file=" + folder.file("surface.state")};
  Arguments render{"render", "--channel", "coverage", "--out", folder.file("f.exr")};
  render.insert(render.end(), scene.begin(), scene.end());
  ASSERT_EQ(run_emit(render).exit_code, 0);
  const auto frame = image::read_exr(folder.file("f.exr"));
  ASSERT_TRUE(frame.has_value()) << frame.error().text;
  const auto& coverage = frame->find("coverage")->pixels;
  const auto most = std::max_element(coverage.begin(), coverage.end());
  ASSERT_GT(*most, 0.0F);
  const auto least = std::min_element(coverage.begin(), coverage.end());
  ASSERT_EQ(*least, 0.0F);
  for (const auto& at : {most, least}) {
    const auto px = static_cast<std::size_t>(at - coverage.begin());
    Arguments call{"explain", "--hours", "0", "--px",
                   std::to_string(px % kWidth) + "," + std::to_string(px / kWidth)};
    call.insert(call.end(), scene.begin(), scene.end());
    const ProcessResult result = run_emit(call);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.err.find("the pixel shows a small target") != std::string::npos, at == most)
        << result.err;
  }
}

TEST(CliExplain, the_sky_is_a_path_without_a_surface) {
  const TemporaryFolder folder;
  const ProcessResult result = explain("40,0", {"--set", "sensor.look_at_m=[-0.7,0.2,20]",
                                                "--hours", "0", "--json", folder.file("e.json")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string json = read_text(folder.file("e.json"));
  EXPECT_NE(json.find("\"surface\": null"), std::string::npos) << json;
  for (const std::string& band : bands_of(json)) {
    const double sky = number(band, "path_w_m2_sr") + number(band, "scattered_w_m2_sr");
    EXPECT_NEAR(sky / number(band, "pixel_w_m2_sr"), 1.0, 1e-5);
    if (number(band, "scattered_w_m2_sr") > 0.0) {
      EXPECT_NE(result.out.find("scattered sun"), std::string::npos) << result.out;
    }
    EXPECT_EQ(number(band, "emission_w_m2_sr"), 0.0);
  }
}

TEST(CliExplain, a_pixel_outside_the_image_is_refused) {
  const ProcessResult result = explain("80,0", {});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("--px"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("79,63"), std::string::npos) << result.err;
}

TEST(CliExplain, a_time_out_of_range_is_refused) {
  for (const char* time_s : {"nan", "1e30"}) {
    const ProcessResult result =
        run_emit({"explain", "box", "--time-s", time_s, "--px", "0,0", "--hours", "0"});
    EXPECT_EQ(result.exit_code, 2) << time_s;
    EXPECT_NE(result.err.find("--time-s"), std::string::npos) << result.err;
  }
}

}  // namespace
}  // namespace emit::test
