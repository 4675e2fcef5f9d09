// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

/// Mid-morning of the scenario. The image is small, which keeps llvmpipe quick.
std::vector<std::string> render(const std::string& out, std::vector<std::string> more = {}) {
  std::vector<std::string> arguments{"render",   "box",
                                     "--time-s", "12600",
                                     "--out",    out,
                                     "--set",    "sensor.width_px=160",
                                     "--set",    "sensor.height_px=120",
                                     "--set",    "thermal.steps=5"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST(CliRender, two_runs_give_the_same_pixels) {
  const TemporaryFolder folder;
  const ProcessResult a = run_emit(render(folder.file("a.exr"), {"--png", folder.file("a.png")}));
  ASSERT_EQ(a.exit_code, 0) << a.err;
  const ProcessResult b = run_emit(render(folder.file("b.exr")));
  ASSERT_EQ(b.exit_code, 0) << b.err;
  EXPECT_GT(std::filesystem::file_size(folder.file("a.png")), 1000U);

  const ProcessResult diff = run_emit({"compare", folder.file("a.exr"), folder.file("b.exr"),
                                       "--json", folder.file("diff.json"), "--max-error-k", "0"});
  EXPECT_EQ(diff.exit_code, 0) << diff.out << diff.err;
  EXPECT_EQ(json_value(read_text(folder.file("diff.json")), "identical"), "true");
  EXPECT_NE(diff.out.find("temperature"), std::string::npos);
  EXPECT_NE(diff.out.find("depth"), std::string::npos);
  EXPECT_NE(diff.out.find("K equivalent"), std::string::npos);
}

TEST(CliRender, another_time_gives_other_temperatures_and_compare_says_so) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_emit(render(folder.file("a.exr"))).exit_code, 0);
  auto later = render(folder.file("b.exr"));
  later[3] = "14400";
  ASSERT_EQ(run_emit(later).exit_code, 0);
  const ProcessResult diff =
      run_emit({"compare", folder.file("a.exr"), folder.file("b.exr"), "--max-error-k", "0.001"});
  EXPECT_EQ(diff.exit_code, 1) << diff.out;
  EXPECT_NE(diff.out.find("different"), std::string::npos);
}

TEST(CliRender, only_the_channels_asked_for_are_written) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_emit(render(folder.file("a.exr"), {"--channel", "temperature"})).exit_code, 0);
  ASSERT_EQ(run_emit(render(folder.file("b.exr"), {"--channel", "depth"})).exit_code, 0);
  const ProcessResult diff = run_emit({"compare", folder.file("a.exr"), folder.file("b.exr")});
  EXPECT_EQ(diff.exit_code, 0) << diff.err;
  EXPECT_NE(diff.out.find("only in a: temperature"), std::string::npos) << diff.out;
  EXPECT_NE(diff.out.find("only in b: depth"), std::string::npos) << diff.out;
}

TEST(CliRender, the_cached_method_says_how_many_samples_it_has) {
  const TemporaryFolder folder;
  const ProcessResult result = run_emit(
      render(folder.file("a.exr"), {"--set", "thermal.method=cached", "--set",
                                    "thermal.model=foster", "--json", folder.file("a.json")}));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("thermal samples"), std::string::npos) << result.out;
  const std::string json = read_text(folder.file("a.json"));
  EXPECT_GT(std::stod(json_value(json, "samples")), 45.0);
  EXPECT_EQ(json_value(json, "nonfinite_px"), "0");
}

TEST(CliSolve, a_few_pixels_by_layers_alone) {
  const TemporaryFolder folder;
  const ProcessResult result = run_emit({"solve",       "box",
                                         "--time-s",    "3600",
                                         "--dimension", "1",
                                         "--pixels",    "40",
                                         "--rays",      "64",
                                         "--set",       "sensor.width_px=160",
                                         "--set",       "sensor.height_px=120",
                                         "--set",       "thermal.model=foster",
                                         "--out",       folder.file("truth.exr"),
                                         "--json",      folder.file("truth.json")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(std::filesystem::exists(folder.file("truth.exr")));
  EXPECT_NE(result.out.find("40 of"), std::string::npos) << result.out;
}

TEST(CliRender, an_unknown_band_exits_with_2_and_lists_the_bands) {
  const TemporaryFolder folder;
  const ProcessResult result = run_emit(render(folder.file("a.exr"), {"--band", "ultraviolet"}));
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_NE(result.err.find("8-12"), std::string::npos) << result.err;
}

TEST(CliCompare, a_file_that_is_no_exr_exits_with_1_and_is_named) {
  const TemporaryFolder folder;
  write_text(folder.file("a.exr"), "not an image");
  const ProcessResult result = run_emit({"compare", folder.file("a.exr"), folder.file("a.exr")});
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_NE(result.err.find("a.exr"), std::string::npos);
}

TEST(CliInspect, shows_a_generated_scene) {
  const TemporaryFolder folder;
  const ProcessResult made = run_emit({"generate", "box", "--out", folder.path().string()});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const ProcessResult result =
      run_emit({"inspect", folder.file("box.glb"), "--json", folder.file("box.json")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("concrete"), std::string::npos) << result.out;
  EXPECT_EQ(json_value(read_text(folder.file("box.json")), "triangles"), "45");
}

TEST(CliInspect, a_broken_file_exits_with_1_and_is_named) {
  const TemporaryFolder folder;
  write_text(folder.file("broken.glb"), std::string("glTF\x02\0\0\0\xff\xff\xff\xff", 12));
  const ProcessResult result = run_emit({"inspect", folder.file("broken.glb")});
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_NE(result.err.find("broken.glb"), std::string::npos) << result.err;
}

TEST(CliGenerate, the_same_options_give_the_same_bytes) {
  const TemporaryFolder folder;
  for (const char* name : {"a", "b"}) {
    ASSERT_EQ(run_emit({"generate", "block-on-road", "--out", folder.file(name), "--set",
                        "wall_thickness_m=0.2"})
                  .exit_code,
              0);
  }
  EXPECT_EQ(read_text(folder.file("a/block-on-road.glb")),
            read_text(folder.file("b/block-on-road.glb")));
  EXPECT_FALSE(read_text(folder.file("a/block-on-road.glb")).empty());
}

TEST(CliGenerate, the_example_of_its_help_works) {
  const std::string help = run_emit({"generate", "--help"}).out;
  const std::string lead = "Example: emit ";
  const std::size_t at = help.find(lead);
  ASSERT_NE(at, std::string::npos) << help;
  std::istringstream words(help.substr(at + lead.size(), help.find('\n', at) - at - lead.size()));
  const TemporaryFolder folder;
  std::vector<std::string> arguments;
  for (std::string word; words >> word;) {
    arguments.push_back(!arguments.empty() && arguments.back() == "--out" ? folder.file("scenes")
                                                                          : word);
  }
  const ProcessResult result = run_emit(arguments);
  EXPECT_EQ(result.exit_code, 0) << result.err;
}

TEST(CliBench, paper_fills_every_key) {
  const TemporaryFolder folder;
  const ProcessResult result =
      run_emit({"bench", "paper", "--scene", "box", "--steps", "5", "--width", "160", "--height",
                "120", "--pixels", "2000", "--json", folder.file("paper.json")},
               std::chrono::seconds(280));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string json = read_text(folder.file("paper.json"));
  for (const char* key : {"device",
                          "commit",
                          "suite",
                          "scene",
                          "steps",
                          "method",
                          "frame_ms_median",
                          "frame_ms_mean",
                          "frame_ms_p99",
                          "frame_ms_max",
                          "geometry",
                          "occlusion",
                          "shadow",
                          "thermal",
                          "radiance",
                          "readback",
                          "frame_serial_ms",
                          "time_scale",
                          "max_error_k",
                          "rms_error_k",
                          "p99_error_k",
                          "edge_p99_k",
                          "pixels_compared",
                          "reference",
                          "surface_fill_frac",
                          "statue_fill_frac",
                          "swept_ground_frac",
                          "model",
                          "mean_error_k",
                          "edge_pixels",
                          "not_finite_px",
                          "embree_step_ms_median",
                          "embree_ratio",
                          "rules_met"}) {
    EXPECT_FALSE(json_value(json, key).empty()) << key << "\n" << json;
  }
  double sum = 0.0;
  for (const char* stage : {"geometry", "occlusion", "shadow", "thermal", "radiance", "readback"}) {
    sum += std::stod(json_value(json, stage));
  }
  EXPECT_EQ(json_value(json, "pixels_compared"), "4000");  // two images
  EXPECT_EQ(json_value(json, "not_finite_px"), "0");
  const double rms_k = std::stod(json_value(json, "rms_error_k"));
  EXPECT_GT(rms_k, 0.01);  // five steps are not enough
  EXPECT_LT(rms_k, 5.0);
  EXPECT_GE(std::stod(json_value(json, "max_error_k")), std::stod(json_value(json, "p99_error_k")));
  EXPECT_NE(json_value(json, "reference").find("1440 uniform history steps"), std::string::npos);
  EXPECT_GT(std::stod(json_value(json, "embree_ratio")), 0.0);
  EXPECT_NE(result.err.find("errors of 2000 pixels, the rule is 20000"), std::string::npos);
  const double serial_ms = std::stod(json_value(json, "frame_serial_ms"));
  EXPECT_GT(serial_ms, 0.0);
  EXPECT_NEAR(sum, serial_ms, 1e-9 * serial_ms);  // the same numbers in another order of rounding
}

TEST(CliBench, paper_meets_no_rules_with_small_pictures) {
  const TemporaryFolder folder;
  const ProcessResult result =
      run_emit({"bench", "paper", "--scene", "box", "--steps", "14", "--width", "160", "--height",
                "120", "--method", "cached", "--no-errors", "--json", folder.file("paper.json")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(json_value(read_text(folder.file("paper.json")), "rules_met"), "false");
  EXPECT_EQ(result.err, "emit: warning: pictures of 160x120, the rule is 1024x768 at least\n")
      << "nothing else is wrong with them";
}

TEST(CliBench, paper_without_errors_leaves_them_null) {
  const TemporaryFolder folder;
  const ProcessResult result =
      run_emit({"bench", "paper", "--scene", "box", "--steps", "3", "--width", "80", "--height",
                "60", "--model", "foster", "--no-errors", "--json", folder.file("paper.json")},
               std::chrono::seconds(280));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string json = read_text(folder.file("paper.json"));
  EXPECT_EQ(json_value(json, "model"), "\"foster\"");
  for (const char* key : {"max_error_k", "p99_error_k", "edge_p99_k", "reference"}) {
    EXPECT_EQ(json_value(json, key), "null") << key;
  }
}

}  // namespace
}  // namespace emit::test
