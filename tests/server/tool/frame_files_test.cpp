// SPDX-License-Identifier: Apache-2.0
#include "tool/support/frame_files.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "emit/physics/planck.hpp"
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
