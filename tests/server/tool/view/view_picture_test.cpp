// SPDX-License-Identifier: Apache-2.0
// Pictures, bar of the day and reference of the viewer, without a window.
#include "tool/view/view_picture.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <numbers>
#include <set>

#include "support/emit_process.hpp"
#include "tool/view/time_bar.hpp"

namespace emit::test {
namespace {

using namespace tool::view;
using ::testing::HasSubstr;

constexpr float kSky = std::numeric_limits<float>::quiet_NaN();

/// Two rows of three pixels: sky, then surfaces of the materials 1, 1, 4, 4, 4.
ViewFrame small_frame() {
  ViewFrame frame;
  frame.width_px = 3;
  frame.height_px = 2;
  frame.radiance_w_m2_sr = {10.0F, 20.0F, 21.0F, 22.0F, 23.0F, 24.0F};
  frame.temperature_k = {kSky, 300.0F, 302.0F, 304.0F, 306.0F, 308.0F};
  frame.material = {0.0F, 1.0F, 1.0F, 4.0F, 4.0F, 4.0F};
  frame.sun_cosine = {kSky, 0.0F, 0.25F, 0.5F, 0.75F, 1.0F};
  frame.sky_frac = {kSky, 1.0F, 0.8F, 0.6F, 0.4F, 0.2F};
  frame.sample_px = {1, 5};
  frame.sim_time_ns = 5'000'000'000;
  frame.sensor_pose.position_world_m = {1.0, 2.0, 3.0};
  return frame;
}

image::Rgb pixel(const image::RgbImage& picture, std::uint32_t x, std::uint32_t y) {
  const std::size_t at = 3 * (std::size_t{y} * picture.width_px + x);
  return {picture.rgb[at], picture.rgb[at + 1], picture.rgb[at + 2]};
}

image::RgbImage drawn(const ViewFrame& frame, Overlay overlay, const PictureError* error = nullptr,
                      double low = 300.0, double high = 308.0) {
  auto picture = draw_picture(frame, {.overlay = overlay, .low = low, .high = high}, error);
  EXPECT_TRUE(picture) << (picture ? "" : picture.error().text);
  return picture ? std::move(*picture) : image::RgbImage{};
}

TEST(ViewPicture, every_overlay_has_a_name_and_an_unknown_name_has_none) {
  std::set<std::string> names;
  for (std::uint8_t o = 0; o < kOverlays; ++o) {
    const auto overlay = static_cast<Overlay>(o);
    names.insert(name_of(overlay));
    EXPECT_EQ(overlay_of(name_of(overlay)), overlay);
  }
  EXPECT_EQ(names.size(), kOverlays);
  EXPECT_FALSE(overlay_of("heat"));
}

TEST(ViewPicture, the_picture_has_the_colours_of_the_console) {
  const image::RgbImage picture = drawn(small_frame(), Overlay::picture);
  ASSERT_EQ(picture.width_px, 3 + image::kColorBarWidthPx);
  const auto& table = image::color_table(image::ColorMap::thermal);
  EXPECT_EQ(pixel(picture, 1, 0), table[0]);
  EXPECT_EQ(pixel(picture, 2, 1), table[255]);
  EXPECT_EQ(pixel(picture, 0, 0), image::kNanColor);
}

TEST(ViewPicture, a_material_keeps_its_hue_and_shows_the_brightness_of_the_picture) {
  const ViewFrame frame = small_frame();
  const image::RgbImage picture = drawn(frame, Overlay::materials);
  EXPECT_EQ(pixel(picture, 0, 0), image::kNanColor);
  EXPECT_EQ(pixel(picture, 1, 0), material_color(1, 0.0));
  EXPECT_EQ(pixel(picture, 2, 0), material_color(1, 0.25));
  EXPECT_EQ(pixel(picture, 2, 1), material_color(4, 1.0));
  // Any two of the first materials differ visibly.
  for (std::size_t a = 0; a < 24; ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const image::Rgb left = material_color(a, 1.0);
      const image::Rgb right = material_color(b, 1.0);
      int difference = 0;
      for (std::size_t c = 0; c < 3; ++c) difference += std::abs(left[c] - right[c]);
      EXPECT_GT(difference, 12) << a << " " << b;
    }
  }
  const std::vector<MaterialShare> shares = material_shares(frame);
  ASSERT_EQ(shares.size(), 2U);
  EXPECT_EQ(shares[0].material, 4U);
  EXPECT_DOUBLE_EQ(shares[0].frac, 0.6);
  EXPECT_EQ(shares[1].material, 1U);
}

TEST(ViewPicture, sun_and_sky_are_shares_and_samples_are_marked) {
  const ViewFrame frame = small_frame();
  const auto& table = image::color_table(image::ColorMap::thermal);
  EXPECT_EQ(pixel(drawn(frame, Overlay::sun), 2, 1), table[255]);
  EXPECT_EQ(pixel(drawn(frame, Overlay::sun), 1, 0), table[0]);
  EXPECT_EQ(pixel(drawn(frame, Overlay::sky), 1, 0), table[255]);
  const image::RgbImage samples = drawn(frame, Overlay::samples);
  const auto& grey = image::color_table(image::ColorMap::grey);
  EXPECT_NE(pixel(samples, 1, 0), grey[0]);
  EXPECT_EQ(pixel(samples, 1, 0), pixel(samples, 2, 1));
  EXPECT_EQ(pixel(samples, 0, 1), grey[128]);
}

TEST(ViewPicture, a_source_without_the_plane_is_refused) {
  ViewFrame frame = small_frame();
  frame.material.clear();
  frame.sun_cosine.clear();
  for (const Overlay overlay : {Overlay::materials, Overlay::sun, Overlay::error}) {
    EXPECT_FALSE(draw_picture(frame, {.overlay = overlay}, nullptr)) << name_of(overlay);
  }
}

class ViewReference : public testing::Test {
 protected:
  /// Writes a reference whose temperatures are `colder_k` below those of the frame.
  std::filesystem::path write(const ViewFrame& frame, float colder_k, const std::string& band) {
    image::ExrImage exr;
    exr.width_px = frame.width_px;
    exr.height_px = frame.height_px;
    std::vector<float> temperature_k = frame.temperature_k;
    for (float& k : temperature_k) k -= colder_k;
    exr.add(image::kTemperatureChannel, temperature_k);
    exr.add(image::kRadianceChannel, frame.radiance_w_m2_sr);
    image::set_frame_metadata(exr, {.sim_time_ns = frame.sim_time_ns,
                                    .sensor_pose = frame.sensor_pose,
                                    .band_name = band,
                                    .band_lo_um = 8.0,
                                    .band_hi_um = 12.0});
    const std::filesystem::path file = folder_.file("reference.exr");
    EXPECT_TRUE(image::write_exr(file, exr));
    return file;
  }
  const TemporaryFolder folder_;
};

TEST_F(ViewReference, the_error_is_frame_less_reference_and_knows_another_view) {
  const ViewFrame frame = small_frame();
  const auto reference = read_reference(write(frame, 2.0F, "8-12"), "");
  ASSERT_TRUE(reference) << reference.error().text;
  const auto error = picture_error(frame, *reference, false);
  ASSERT_TRUE(error);
  EXPECT_NEAR(error->stats.mean, 2.0, 1e-6);
  EXPECT_EQ(error->stats.pixels_compared, 5U);
  EXPECT_TRUE(error->same_view);
  EXPECT_EQ(picture_error(frame, *reference, true)->stats.max_abs, 0.0);
  // Colours go to both sides of zero.
  const auto& table = image::color_table(image::ColorMap::difference);
  EXPECT_EQ(pixel(drawn(frame, Overlay::error, &*error, -2.0, 2.0), 1, 0), table[255]);

  ViewFrame later = frame;
  later.sim_time_ns += 1'000'000'000;
  EXPECT_FALSE(picture_error(later, *reference, false)->same_view);
  ViewFrame moved = frame;
  moved.sensor_pose.position_world_m.x += 0.1;
  EXPECT_FALSE(picture_error(moved, *reference, false)->same_view);
  ViewFrame turned = frame;
  turned.sensor_pose.world_from_body = glm::angleAxis(0.01, glm::dvec3(0.0, 0.0, 1.0));
  EXPECT_FALSE(picture_error(turned, *reference, false)->same_view);
}

TEST_F(ViewReference, what_does_not_fit_is_refused_with_the_reason) {
  const ViewFrame frame = small_frame();
  const std::filesystem::path file = write(frame, 0.0F, "3-5");
  const auto other_band = read_reference(file, "8-12");
  ASSERT_TRUE(other_band);
  EXPECT_TRUE(other_band->radiance_w_m2_sr.empty());
  EXPECT_THAT(picture_error(frame, *other_band, true).error().text, HasSubstr("no radiance"));
  ViewFrame wide = frame;
  wide.width_px = 6;
  wide.height_px = 1;
  EXPECT_THAT(picture_error(wide, *other_band, false).error().text, HasSubstr("3x2"));
  EXPECT_FALSE(read_reference(folder_.file("none.exr"), ""));
}

TEST(ViewTimeBar, hours_are_those_of_the_sun_and_a_press_finds_them_again) {
  constexpr std::int64_t kHourNs = 3'600'000'000'000;
  // 1970-01-01T06:00Z stands 6 h before noon at longitude 0, and at noon at 90 degrees east.
  EXPECT_NEAR(solar_hour(6 * kHourNs, 0, 0.0), 6.0, 1e-9);
  EXPECT_NEAR(solar_hour(6 * kHourNs, kHourNs, 0.5 * std::numbers::pi), 13.0, 1e-9);
  EXPECT_NEAR(solar_hour(0, 0, -0.5 * std::numbers::pi), 18.0, 1e-9);
  EXPECT_NEAR(solar_hour(0, -kHourNs, 0.0), 23.0, 1e-9);

  image::RgbImage picture{240, 40, std::vector<std::uint8_t>(3 * 240 * 40, 0)};
  draw_time_bar(picture, 200, 15.0, 6.0);
  const image::Rgb now = pixel(picture, 125, 39);
  EXPECT_GT(now[0], now[2]) << "the mark of now is amber";
  EXPECT_NEAR(*bar_hour(125, 39, 200, 40), 15.0, 0.1);
  EXPECT_EQ(pixel(picture, 50, 30), (image::Rgb{255, 255, 255}));
  EXPECT_EQ(pixel(picture, 210, 39), (image::Rgb{0, 0, 0})) << "the colour bar stays";
  EXPECT_EQ(pixel(picture, 100, 10), (image::Rgb{0, 0, 0})) << "the picture stays";
  EXPECT_FALSE(bar_hour(125, 40 - kTimeBarPx - 1, 200, 40));
  EXPECT_FALSE(bar_hour(200, 39, 200, 40));
}

}  // namespace
}  // namespace emit::test
