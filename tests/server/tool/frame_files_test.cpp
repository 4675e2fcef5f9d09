// SPDX-License-Identifier: Apache-2.0
#include "tool/support/frame_files.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <vector>

#include "emit/physics/planck.hpp"
#include "emit/protocol/frame_header.hpp"
#include "tool/support/scene_options.hpp"

namespace emit::tool {
namespace {

class TemporaryFolder {
 public:
  TemporaryFolder()
      : path_(std::filesystem::temp_directory_path() /
              ("emit_cli_test_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(path_);
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

TEST(CliFrameFiles, a_partial_frame_says_which_pixels_never_arrived) {
  const TemporaryFolder folder;
  const std::vector<float> pixels{1.0F, 2.0F, 0.0F, 4.0F};
  const std::vector<float> valid{1.0F, 1.0F, 0.0F, 1.0F};
  FramePlanes frame;
  frame.width_px = frame.height_px = 2;
  frame.radiance_w_m2_sr = pixels;
  const auto whole_file = folder.path() / "whole.exr";
  ASSERT_TRUE(write_frame_exr(whole_file, frame).has_value());
  frame.valid = valid;
  const auto partial_file = folder.path() / "partial.exr";
  ASSERT_TRUE(write_frame_exr(partial_file, frame).has_value());
  const auto whole = image::read_exr(whole_file);
  const auto partial = image::read_exr(partial_file);
  ASSERT_TRUE(whole.has_value() && partial.has_value());
  EXPECT_EQ(whole->find(image::kValidChannel), nullptr);
  EXPECT_FALSE(whole->attributes.contains("missingPx"));
  const image::ExrChannel* channel = partial->find(image::kValidChannel);
  ASSERT_NE(channel, nullptr);
  EXPECT_EQ(channel->pixels, valid);
  EXPECT_TRUE(partial->attributes.contains("missingPx"));
}

TEST(CliFrameFiles, a_frame_of_drive_is_no_radiance_and_says_what_was_done) {
  const TemporaryFolder folder;
  const std::vector<float> pixels{100.0F, 200.0F, 300.0F, 4095.0F};
  FramePlanes frame;
  frame.width_px = frame.height_px = 2;
  frame.drive = pixels;
  frame.output_steps = protocol::kOutputMirroredVertically | protocol::kOutputRotated90 |
                       protocol::kOutputRotated180 | protocol::kOutputShifted |
                       protocol::kOutputDriven;
  frame.applied_shift_x_px = 0.25F;
  frame.applied_shift_y_px = -0.5F;
  ASSERT_TRUE(write_frame_files(folder.path(), frame, {280.0, 330.0}).has_value());
  const auto read = image::read_exr(folder.path() / "frame_000000.exr");
  ASSERT_TRUE(read.has_value()) << read.error().text;
  EXPECT_EQ(read->find(image::kRadianceChannel), nullptr);
  ASSERT_NE(read->find(image::kDriveChannel), nullptr);
  EXPECT_EQ(read->find(image::kDriveChannel)->pixels, pixels);
  EXPECT_EQ(std::get<std::string>(read->attributes.at("outputSteps")),
            "mirror vertical, rotate 270, shift, drive table");
  EXPECT_EQ(std::get<double>(read->attributes.at("appliedShiftXPx")), 0.25);
  EXPECT_EQ(std::get<double>(read->attributes.at("appliedShiftYPx")), -0.5);
}

TEST(CliApparentTemperature, inverts_the_band_integral_to_a_millikelvin) {
  for (const auto& [lo_um, hi_um] : {std::pair{3.0, 5.0}, std::pair{8.0, 12.0}}) {
    const ApparentTemperature table(lo_um, hi_um);
    for (const double t_k : {200.0, 273.15, 300.003, 350.0, 900.0}) {
      const double radiance =
          physics::band_radiance({lo_um, hi_um, {}}, physics::Kelvin{t_k}).radiance_w_m2_sr;
      EXPECT_NEAR(table.kelvin(radiance), t_k, 1e-3) << lo_um << "-" << hi_um << " um";
    }
  }
}

TEST(CliApparentTemperature, slope_is_the_inverse_of_the_derivative) {
  const ApparentTemperature table(8.0, 12.0);
  const auto exact = physics::band_radiance({8.0, 12.0, {}}, physics::Kelvin{300.0});
  // The tolerance of 0.1 % covers the chord of a 0.05 K table interval against the tangent.
  EXPECT_NEAR(table.kelvin_per_radiance(exact.radiance_w_m2_sr) * exact.derivative_w_m2_sr_k, 1.0,
              1e-3);
}

TEST(CliApparentTemperature, takes_the_response_into_account) {
  const scene::SpectralBand band{"det", 8.0, 12.0, {{8.0, 0.0}, {10.0, 1.0}, {12.0, 0.0}}};
  const ApparentTemperature table(spectral_band(band));
  const double radiance =
      physics::band_radiance(spectral_band(band), physics::Kelvin{305.0}).radiance_w_m2_sr;
  EXPECT_NEAR(table.kelvin(radiance), 305.0, 1e-3);
  EXPECT_LT(ApparentTemperature(8.0, 12.0).kelvin(radiance), 280.0);
}

TEST(CliApparentTemperature, radiances_outside_the_table_end_at_its_limits) {
  const ApparentTemperature table(8.0, 12.0);
  EXPECT_DOUBLE_EQ(table.kelvin(0.0), 150.0);
  EXPECT_NEAR(table.kelvin(1e9), 1500.0, 0.06);
  EXPECT_TRUE(std::isnan(table.kelvin(std::numeric_limits<double>::quiet_NaN())));
}

TEST(CliFrameFiles, a_frame_comes_back_from_disk_bit_for_bit) {
  const TemporaryFolder folder;
  const std::vector<float> radiance{1.0F, 2.5F, 1e-7F, 40.0F, 0.0F, 33.25F};
  FramePlanes planes;
  planes.width_px = 3;
  planes.height_px = 2;
  planes.radiance_w_m2_sr = radiance;
  planes.metadata.sim_time_ns = 1234567890123456789;
  planes.metadata.frame_number = 42;
  planes.metadata.band_name = "8-12";
  planes.metadata.band_lo_um = 8.0;
  planes.metadata.band_hi_um = 12.0;
  ASSERT_TRUE(write_frame_files(folder.path(), planes, {280.0, 330.0}).has_value());

  const auto exr = image::read_exr(folder.path() / "frame_000042.exr");
  ASSERT_TRUE(exr.has_value()) << exr.error().text;
  ASSERT_NE(exr->find(image::kRadianceChannel), nullptr);
  EXPECT_EQ(exr->find(image::kRadianceChannel)->pixels, radiance);
  EXPECT_EQ(exr->find(image::kTemperatureChannel), nullptr);
  const auto metadata = image::frame_metadata(*exr);
  ASSERT_TRUE(metadata.has_value()) << metadata.error().text;
  EXPECT_EQ(metadata->sim_time_ns, planes.metadata.sim_time_ns);
  EXPECT_EQ(metadata->frame_number, 42U);
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "frame_000042.png"));
}

/// Frame of blackbodies at these temperatures; `emissivity` scales what they radiate.
struct BlackbodyFrame {
  explicit BlackbodyFrame(double emissivity) {
    const physics::Band band{8.0, 12.0, {}};
    for (const float t_k : temperature_k) {
      radiance.push_back(static_cast<float>(
          emissivity * physics::band_radiance(band, physics::Kelvin{static_cast<double>(t_k)})
                           .radiance_w_m2_sr));
    }
    planes.width_px = 4;
    planes.height_px = 1;
    planes.radiance_w_m2_sr = radiance;
    planes.temperature_k = temperature_k;
    planes.metadata.band_name = "8-12";
    planes.metadata.band_lo_um = 8.0;
    planes.metadata.band_hi_um = 12.0;
  }
  std::vector<float> temperature_k{285.02F, 297.52F, 312.51F, 325.03F};
  std::vector<float> radiance;
  FramePlanes planes;
};

std::string png_of(const FramePlanes& planes, PngQuantity quantity) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "x.png";
  EXPECT_TRUE(write_frame_png(file, planes, {280.0, 330.0, quantity}).has_value());
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

TEST(CliPng, of_blackbodies_shows_one_temperature_as_apparent_and_of_the_surface) {
  const BlackbodyFrame frame(1.0);
  EXPECT_EQ(png_of(frame.planes, PngQuantity::apparent),
            png_of(frame.planes, PngQuantity::temperature));
}

TEST(CliPng, of_grey_surfaces_shows_what_the_sensor_sees_unless_asked_otherwise) {
  const BlackbodyFrame black(1.0);
  const BlackbodyFrame grey(0.8);
  EXPECT_EQ(png_of(grey.planes, PngQuantity::temperature),
            png_of(black.planes, PngQuantity::temperature));
  EXPECT_NE(png_of(grey.planes, PngQuantity::apparent),
            png_of(black.planes, PngQuantity::apparent));
  FramePlanes shown = grey.planes;
  const TemporaryFolder folder;
  ASSERT_TRUE(write_frame_files(folder.path(), shown, {280.0, 330.0}).has_value());
  std::ifstream stream(folder.path() / "frame_000000.png", std::ios::binary);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(stream), {}),
            png_of(grey.planes, PngQuantity::apparent));
}

TEST(CliPng, of_radiance_does_not_depend_on_the_limits_in_kelvin) {
  const BlackbodyFrame frame(1.0);
  const TemporaryFolder folder;
  const auto other = folder.path() / "other.png";
  ASSERT_TRUE(write_frame_png(other, frame.planes, {1.0, 2.0, PngQuantity::radiance}).has_value());
  std::ifstream stream(other, std::ios::binary);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(stream), {}),
            png_of(frame.planes, PngQuantity::radiance));
}

TEST(CliPng, of_what_the_frame_lacks_is_an_error_that_names_it) {
  BlackbodyFrame frame(1.0);
  frame.planes.temperature_k = {};
  const TemporaryFolder folder;
  const auto file = folder.path() / "x.png";
  const auto written =
      write_frame_png(file, frame.planes, {280.0, 330.0, PngQuantity::temperature});
  ASSERT_FALSE(written.has_value());
  EXPECT_NE(written.error().text.find("temperature"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(file));
}

TEST(CliPng, of_a_frame_of_temperatures_shows_them) {
  BlackbodyFrame frame(1.0);
  const std::string surface = png_of(frame.planes, PngQuantity::temperature);
  frame.planes.radiance_w_m2_sr = {};
  EXPECT_EQ(png_of(frame.planes, PngQuantity::apparent), surface);
}

TEST(CliFrameFileNames, one_frame_has_the_name_that_was_given) {
  EXPECT_EQ(FrameFileNames("a/road.exr", false, false).file(41400.0, "8-12"), "a/road.exr");
}

TEST(CliFrameFileNames, several_frames_differ_by_what_varies) {
  EXPECT_EQ(FrameFileNames("a/road.exr", true, false).file(41400.0, "8-12"), "a/road_t41400.exr");
  EXPECT_EQ(FrameFileNames("a/road.exr", false, true).file(41400.0, "8-12"), "a/road_8-12.exr");
  EXPECT_EQ(FrameFileNames("a/road.exr", true, true).file(12.5, "8-12"), "a/road_t12.5_8-12.exr");
  EXPECT_EQ(FrameFileNames("road", true, true).file(-3.0, "a/b"), "road_t-3_a_b");
}

TEST(CliFrameFileNames, places_in_the_name_are_filled) {
  EXPECT_EQ(FrameFileNames("{band}/f{time}.exr", true, true).file(12.5, "8-12"), "8-12/f12.5.exr");
  EXPECT_EQ(FrameFileNames("{band}_f.exr", true, true).file(12.5, "8-12"), "8-12_f_t12.5.exr");
  EXPECT_EQ(FrameFileNames("f{time}.exr", false, false).file(12.5, "8-12"), "f12.5.exr");
}

TEST(CliSceneOptions, block_size_sets_all_three_edges_and_single_ones_override_it) {
  scenegen::GenerateOptions options;
  options.kind = scenegen::SceneKind::block_on_road;
  const std::vector<std::string> set{"block_size_m=1.5", "block_up_m=0.5"};
  ASSERT_TRUE(apply_scene_options(options, set).has_value());
  EXPECT_EQ(options.block_on_road.block_east_m, 1.5);
  EXPECT_EQ(options.block_on_road.block_north_m, 1.5);
  EXPECT_EQ(options.block_on_road.block_up_m, 0.5);
}

TEST(CliSceneOptions, are_applied_by_name) {
  scenegen::GenerateOptions options;
  options.kind = scenegen::SceneKind::block_on_road;
  const std::vector<std::string> set{"block_east_m=3.5", "wall_thickness_m=0"};
  ASSERT_TRUE(apply_scene_options(options, set).has_value());
  EXPECT_EQ(options.block_on_road.block_east_m, 3.5);
  EXPECT_EQ(options.block_on_road.wall_thickness_m, 0.0);
}

TEST(CliSceneOptions, an_unknown_key_is_refused_with_the_keys_there_are) {
  scenegen::GenerateOptions options;
  options.kind = scenegen::SceneKind::box;
  const std::vector<std::string> set{"sise_m=3"};
  const auto result = apply_scene_options(options, set);
  ASSERT_FALSE(result.has_value());
  EXPECT_NE(result.error().text.find("size_m"), std::string::npos);
}

TEST(CliSceneOptions, a_value_that_is_no_number_is_refused) {
  scenegen::GenerateOptions options;
  options.kind = scenegen::SceneKind::ribbed;
  for (const char* text : {"ribs=many", "ribs=", "ribs=-1", "ribs=3x"}) {
    const std::vector<std::string> set{text};
    EXPECT_FALSE(apply_scene_options(options, set).has_value()) << text;
  }
}

}  // namespace
}  // namespace emit::tool
