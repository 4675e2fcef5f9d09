// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <sstream>
#include <utility>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

/// Mid-morning of the scenario. The image is small, which keeps llvmpipe quick.
std::vector<std::string> render(const std::string& out, std::vector<std::string> more = {}) {
  std::vector<std::string> arguments{"render",   "box",
                                     "--time-s", "12600",
                                     "--out",    out,
                                     "--set",    "sensor.width_px=80",
                                     "--set",    "sensor.height_px=60",
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

/// Figure of the difference of temperatures that `emit compare` finds, K: "max" or "rms".
double difference_k(const TemporaryFolder& folder, const std::string& a, const std::string& b,
                    const std::string& figure) {
  const ProcessResult diff =
      run_emit({"compare", folder.file(a), folder.file(b), "--json", folder.file("diff.json")});
  EXPECT_EQ(diff.exit_code, 0) << diff.err;
  const std::string json = read_text(folder.file("diff.json"));
  return std::stod(json_value(json.substr(json.find("\"temperature\"")), figure));
}

/// Several times after one warm-up are the images of as many runs.
class CliRenderSeveral : public testing::TestWithParam<const char*> {};

TEST_P(CliRenderSeveral, times_and_bands_give_the_images_of_single_runs) {
  const TemporaryFolder folder;
  const std::vector<std::string> method{"--set", std::string("thermal.method=") + GetParam(),
                                        "--set", "thermal.steps=27"};
  auto all = render(folder.file("all.exr"), method);
  // The later time comes first: the order on the command line does not matter.
  all[3] = "16200";
  for (const char* word : {"--time-s", "12600", "--band", "3-5", "--band", "8-12"}) {
    all.emplace_back(word);
  }
  all.insert(all.end(), {"--png", folder.file("{band}.png"), "--json", folder.file("all.json")});
  const ProcessResult result = run_emit(all);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_LT(result.out.find("all_t12600_3-5.exr"), result.out.find("all_t16200_3-5.exr"));
  for (const char* png :
       {"3-5_t12600.png", "3-5_t16200.png", "8-12_t12600.png", "8-12_t16200.png"}) {
    EXPECT_TRUE(std::filesystem::exists(folder.file(png))) << png;
  }
  for (const char* time : {"12600", "16200"}) {
    for (const char* band : {"3-5", "8-12"}) {
      auto one = render(folder.file("one.exr"), method);
      one[3] = time;
      one.insert(one.end(), {"--band", band});
      ASSERT_EQ(run_emit(one).exit_code, 0);
      const std::string name = std::string("all_t") + time + "_" + band + ".exr";
      if (std::string(GetParam()) == "per-frame") {
        EXPECT_EQ(difference_k(folder, name, "one.exr", "max"), 0.0) << name;
      } else {
        // Only edges of shadows that moved since the warm-up are coarser than in a run of its own.
        EXPECT_LT(difference_k(folder, name, "one.exr", "rms"), 0.4) << name;
      }
    }
  }
  EXPECT_GT(difference_k(folder, "all_t12600_8-12.exr", "all_t16200_8-12.exr", "rms"), 1.0);
  const std::string json = read_text(folder.file("all.json"));
  std::size_t frames = 0;
  for (std::size_t at = json.find("\"sim_time_s\""); at != std::string::npos;
       at = json.find("\"sim_time_s\"", at + 1)) {
    ++frames;
  }
  EXPECT_EQ(frames, 4U) << json;
  EXPECT_FALSE(json_value(json, "warm_up_ms").empty());
}
INSTANTIATE_TEST_SUITE_P(Methods, CliRenderSeveral, testing::Values("per-frame", "cached"));

TEST(CliRender, json_of_one_frame_keeps_its_keys) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_emit(render(folder.file("a.exr"), {"--json", folder.file("a.json")})).exit_code, 0);
  const std::string json = read_text(folder.file("a.json"));
  const std::string top = json.substr(0, json.find("\"frames\""));
  for (const char* key :
       {"device", "scenario", "sim_time_s", "band", "width", "height", "triangles", "setup_ms",
        "warm_up_ms", "frame_ms", "samples", "sample_bytes", "nonfinite_px", "clamped_px",
        "radiance", "surface_px", "temperature"}) {
    EXPECT_FALSE(json_value(top, key).empty()) << key << "\n" << json;
  }
}

TEST(CliRender, png_of_chooses_what_the_colours_stand_for) {
  const TemporaryFolder folder;
  const auto png = [&](const std::string& name, std::vector<std::string> more) {
    more.insert(more.end(), {"--png", folder.file(name)});
    const ProcessResult result = run_emit(render(folder.file(name + ".exr"), more));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return read_text(folder.file(name));
  };
  const std::string without = png("d.png", {});
  EXPECT_EQ(without, png("a.png", {"--png-of", "apparent"})) << "the default";
  EXPECT_NE(without, png("t.png", {"--png-of", "temperature"}));
  EXPECT_NE(without, png("r.png", {"--png-of", "radiance"}));
  // The picture does not change what the frame holds.
  EXPECT_EQ(difference_k(folder, "d.png.exr", "t.png.exr", "max"), 0.0);
}

TEST(CliRender, preview_says_what_it_leaves_out_and_set_counts_more) {
  const TemporaryFolder folder;
  const ProcessResult preview = run_emit(
      render(folder.file("a.exr"), {"--quality", "preview", "--json", folder.file("a.json")}));
  ASSERT_EQ(preview.exit_code, 0) << preview.err;
  EXPECT_NE(preview.out.find("preview: leaves out "), std::string::npos) << preview.out;
  EXPECT_EQ(json_value(read_text(folder.file("a.json")), "quality"), "\"preview\"");
  // The method of --set wins: per frame there are no samples.
  const ProcessResult set = run_emit(
      render(folder.file("b.exr"), {"--quality", "preview", "--set", "thermal.method=per-frame",
                                    "--json", folder.file("b.json")}));
  ASSERT_EQ(set.exit_code, 0) << set.err;
  EXPECT_GT(std::stod(json_value(read_text(folder.file("a.json")), "samples")), 0.0);
  EXPECT_EQ(json_value(read_text(folder.file("b.json")), "samples"), "0");
}

TEST(CliRender, preview_of_an_own_scene_of_50000_triangles_takes_seconds) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_emit({"generate", "statue", "--out", folder.path().string(), "--set",
                      "min_triangles=50000"})
                .exit_code,
            0);
  const auto start = std::chrono::steady_clock::now();
  const ProcessResult result =
      run_emit({"render", "statue", "--time-s", "12600", "--quality", "preview", "--out",
                folder.file("a.exr"), "--json", folder.file("a.json"), "--set",
                "object[statue].gltf=\"" + folder.file("statue.glb") + "\""});
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GE(std::stod(json_value(read_text(folder.file("a.json")), "triangles")), 50'000.0);
  // 20 s on two idle cores; the machine of a test may be busy.
  EXPECT_LT(took.count(), 60.0) << result.out;
}

TEST(CliSolve, a_few_pixels_by_layers_alone) {
  const TemporaryFolder folder;
  const ProcessResult result = run_emit({"solve",       "box",
                                         "--time-s",    "3600",
                                         "--dimension", "1",
                                         "--pixels",    "40",
                                         "--rays",      "64",
                                         "--set",       "sensor.width_px=80",
                                         "--set",       "sensor.height_px=60",
                                         "--set",       "thermal.model=foster",
                                         "--out",       folder.file("truth.exr"),
                                         "--json",      folder.file("truth.json")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(std::filesystem::exists(folder.file("truth.exr")));
  EXPECT_NE(result.out.find("40 of"), std::string::npos) << result.out;
}

/// Command of a quick solution in one dimension with two instants.
std::vector<std::string> quick_solve(std::vector<std::string> more) {
  std::vector<std::string> arguments{"solve",       "box",
                                     "--time-s",    "7200",
                                     "--time-s",    "3600",
                                     "--pixels",    "10",
                                     "--rays",      "16",
                                     "--set",       "sensor.width_px=32",
                                     "--set",       "sensor.height_px=24",
                                     "--set",       "thermal.model=foster",
                                     "--dimension", "1"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST(CliSolve, points_of_a_table_have_temperatures_at_every_instant) {
  const TemporaryFolder folder;
  write_text(folder.file("at.csv"),
             "# One point of the ground and one of the air\nx_m,y_m,z_m,nx,ny,nz\n"
             "15,15,0.001,0,0,1\n0,0,500,,,\n");
  const ProcessResult result =
      run_emit(quick_solve({"--at", folder.file("at.csv"), "--json", folder.file("a.json")}));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.err.find("1 of 2 points"), std::string::npos) << result.err;
  std::istringstream lines(result.out);
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "time_s,x_m,y_m,z_m,nx,ny,nz,object,temperature_k");
  std::getline(lines, line);
  EXPECT_EQ(line.rfind("3600,15,15,0,0,0,1,", 0), 0U) << line;
  std::getline(lines, line);
  EXPECT_EQ(line, "3600,0,0,500,,,,,nan");
  std::getline(lines, line);
  EXPECT_EQ(line.rfind("7200,15,15,0,0,0,1,", 0), 0U) << line;
  EXPECT_NE(json_value(read_text(folder.file("a.json")), "reason").find("asked for"),
            std::string::npos);
  for (const char* table : {"x_m,y_m\n1,2\n", "x_m,y_m,z_m\n1,2,up\n", "x_m,y_m,z_m\n",
                            "x_m,y_m,z_m,object\n1,2,3,nobody\n"}) {
    write_text(folder.file("bad.csv"), table);
    const ProcessResult bad = run_emit(quick_solve({"--at", folder.file("bad.csv")}));
    EXPECT_EQ(bad.exit_code, 2) << table << bad.err;
    EXPECT_NE(bad.err.find("bad.csv"), std::string::npos) << bad.err;
  }
}

TEST(CliSolve, one_run_gives_the_pictures_of_all_cameras_instants_and_bands) {
  const TemporaryFolder folder;
  const ProcessResult result =
      run_emit(quick_solve({"--out", folder.file("a.exr"), "--camera", "up=0,0,50,0,0,100",
                            "--camera", "down=0,0,50,0,1,0,40", "--band", "8-12", "--band", "3-5",
                            "--json", folder.file("a.json")}));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.err.find("camera up: the view shows nothing but sky"), std::string::npos)
      << result.err;
  std::size_t pictures = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.file("."))) {
    pictures += entry.path().extension() == ".exr" ? 1U : 0U;
  }
  EXPECT_EQ(pictures, 8U) << result.out;
  const ProcessResult bad =
      run_emit(quick_solve({"--out", folder.file("a.exr"), "--camera", "up=0,0,50"}));
  EXPECT_EQ(bad.exit_code, 2);
  EXPECT_NE(bad.err.find("six or seven numbers"), std::string::npos) << bad.err;
}

TEST(CliRender, a_view_of_nothing_warns) {
  const TemporaryFolder folder;
  const ProcessResult result =
      run_emit(render(folder.file("a.exr"), {"--set", "sensor.trajectory[0].look_at_m=[0,0,1e6]"}));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.err.find("nothing but sky"), std::string::npos) << result.err;
}

TEST(CliRender, dry_surfaces_after_rain_are_put_down_to_what_they_are_due_to) {
  const TemporaryFolder folder;
  write_text(folder.file("w.csv"),
             "time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,wind_m_s,rain_mm_h\n"
             "-200000,0,100,330,290,2,0\n0,0,100,330,290,2,0\n"
             "3600,0,100,330,290,2,4\n20000,0,100,330,290,2,0\n");
  write_text(folder.file("s.toml"), R"(
    epoch_utc = 2014-06-21T06:00:00Z
    [weather]
    file = "w.csv"
    [thermal]
    history_start_s = 0.0
    steps = 5
    [sensor]
    width_px = 160
    height_px = 120
    [[sensor.trajectory]]
    time_s = 7200.0
    position_m = [-6.4, -3.6, 5.0]
    look_at_m = [-0.6, 0.3, 0.4]
    [[object]]
    gltf = "share:scenes/box.glb"
    material = "painted_metal"
  )");
  const auto warnings = [&](const std::string& model) {
    const ProcessResult result =
        run_emit({"render", folder.file("s.toml"), "--time-s", "7200", "--out",
                  folder.file("a.exr"), "--set", "thermal.model=" + model});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.err;
  };
  const auto count = [](const std::string& text, const std::string& part) {
    std::size_t found = 0;
    for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++found;
    return found;
  };
  // The scene and the frame have a warning each.
  const std::string published = warnings("emit2014");
  EXPECT_EQ(count(published, "thermal.model \"emit2014\" has no rain"), 2U) << published;
  EXPECT_EQ(count(published, "store"), 0U) << published;
  const std::string extended = warnings("foster");
  EXPECT_EQ(count(extended, "emit2014"), 0U) << extended;
  EXPECT_EQ(count(extended, "'painted_metal' states no 'water_store_mm'"), 1U) << extended;
  EXPECT_EQ(count(extended, "rain_unknown: it rained on materials that state no store"), 1U)
      << extended;
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

TEST(CliCompare, an_image_without_radiance_is_one_clear_error) {
  const TemporaryFolder folder;
  // The channel gets another name; names are in alphabetical order.
  ASSERT_EQ(run_emit(render(folder.file("a.exr"))).exit_code, 0);
  std::string bytes = read_text(folder.file("a.exr"));
  for (std::size_t at = bytes.find("radiance"); at != std::string::npos;
       at = bytes.find("radiance", at)) {
    bytes.replace(at, 8, "rbdiance");
  }
  write_text(folder.file("b.exr"), bytes);
  for (const auto& [first, second] : {std::pair{"a.exr", "b.exr"}, std::pair{"b.exr", "a.exr"}}) {
    const ProcessResult result = run_emit({"compare", folder.file(first), folder.file(second)});
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(result.out, "");
    EXPECT_EQ(result.err.find('\n'), result.err.size() - 1) << result.err;
    EXPECT_NE(result.err.find("b.exr: there is no channel 'radiance'"), std::string::npos)
        << result.err;
  }
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
      run_emit({"bench", "paper", "--scene", "box", "--steps", "5", "--width", "80", "--height",
                "60", "--pixels", "500", "--json", folder.file("paper.json")},
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
  EXPECT_EQ(json_value(json, "pixels_compared"), "1000");  // two images
  EXPECT_EQ(json_value(json, "not_finite_px"), "0");
  const double rms_k = std::stod(json_value(json, "rms_error_k"));
  EXPECT_GT(rms_k, 0.01);  // five steps are not enough
  EXPECT_LT(rms_k, 5.0);
  EXPECT_GE(std::stod(json_value(json, "max_error_k")), std::stod(json_value(json, "p99_error_k")));
  EXPECT_NE(json_value(json, "reference").find("1440 uniform history steps"), std::string::npos);
  EXPECT_GT(std::stod(json_value(json, "embree_ratio")), 0.0);
  EXPECT_NE(result.err.find("errors of 500 pixels, the rule is 20000"), std::string::npos);
  const double serial_ms = std::stod(json_value(json, "frame_serial_ms"));
  EXPECT_GT(serial_ms, 0.0);
  EXPECT_NEAR(sum, serial_ms, 1e-9 * serial_ms);  // the same numbers in another order of rounding
}

TEST(CliBench, paper_meets_no_rules_with_small_pictures) {
  const TemporaryFolder folder;
  const ProcessResult result =
      run_emit({"bench", "paper", "--scene", "box", "--steps", "14", "--width", "80", "--height",
                "60", "--method", "cached", "--no-errors", "--json", folder.file("paper.json")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(json_value(read_text(folder.file("paper.json")), "rules_met"), "false");
  // A slow machine has lines of progress beside it.
  const std::string warning = "emit: warning: pictures of 80x60, the rule is 1024x768 at least\n";
  const std::size_t at = result.err.find(warning);
  ASSERT_NE(at, std::string::npos) << result.err;
  EXPECT_EQ(result.err.find("emit: ", at + 1), std::string::npos) << "nothing else is wrong";
  EXPECT_EQ(result.err.find("emit: "), at) << "nothing else is wrong";
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
