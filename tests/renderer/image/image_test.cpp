// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>
#include <string_view>

#include "emit/image/exr_image.hpp"
#include "emit/image/false_color.hpp"
#include "emit/image/image_diff.hpp"
#include "emit/image/png_image.hpp"
#include "support/failed_check.hpp"

namespace emit::image {
namespace {

using physics::ErrorCode;
using testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

std::filesystem::path scratch(const std::string& name) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "emit_image";
  std::filesystem::create_directories(folder);
  return folder / name;
}

ExrImage sample_image() {
  ExrImage image;
  image.width_px = 5;
  image.height_px = 3;
  std::vector<float> radiance(15);
  std::vector<float> depth(15, kInf);
  for (std::size_t i = 0; i < radiance.size(); ++i) {
    radiance[i] = 1.0F / (static_cast<float>(i) + 3.0F);
  }
  depth[7] = 2512.062F;
  std::vector<float> temperature(15, kNan);
  temperature[4] = 301.25F;
  image.add(kRadianceChannel, radiance);
  image.add(kDepthChannel, depth);
  image.add(kTemperatureChannel, temperature);
  return image;
}

TEST(ExrImage, every_bit_survives_writing_and_reading) {
  const ExrImage image = sample_image();
  const auto file = scratch("round_trip.exr");
  ASSERT_TRUE(write_exr(file, image));
  const physics::Result<ExrImage> back = read_exr(file);
  ASSERT_TRUE(back) << back.error().text;
  EXPECT_EQ(back->width_px, 5U);
  EXPECT_EQ(back->height_px, 3U);
  ASSERT_EQ(back->channels.size(), 3U);
  for (const ExrChannel& channel : image.channels) {
    const ExrChannel* read = back->find(channel.name);
    ASSERT_NE(read, nullptr) << channel.name;
    for (std::size_t i = 0; i < channel.pixels.size(); ++i) {
      const bool both_nan = std::isnan(channel.pixels[i]) && std::isnan(read->pixels[i]);
      EXPECT_TRUE(both_nan || channel.pixels[i] == read->pixels[i]) << channel.name << " " << i;
    }
  }
}

TEST(ExrImage, frame_metadata_survives_exactly) {
  ExrImage image = sample_image();
  FrameMetadata metadata;
  // The number needs more than the 53 bits of a double.
  metadata.sim_time_ns = -9'007'199'254'740'993;
  metadata.frame_number = 18'446'744'073'709'551'615U;
  metadata.sensor_pose.position_world_m = {1.0 / 3.0, -2.5e6, 17.0};
  metadata.sensor_pose.world_from_body = {0.5, -0.5, 0.5, 0.5};
  metadata.band_name = "8-12";
  metadata.band_lo_um = 8.0;
  metadata.band_hi_um = 12.0;
  metadata.fov_h_rad = 0.625;
  set_frame_metadata(image, metadata);
  const auto file = scratch("metadata.exr");
  ASSERT_TRUE(write_exr(file, image));
  const physics::Result<ExrImage> back = read_exr(file);
  ASSERT_TRUE(back);
  const physics::Result<FrameMetadata> read = frame_metadata(*back);
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_EQ(read->sim_time_ns, metadata.sim_time_ns);
  EXPECT_EQ(read->frame_number, metadata.frame_number);
  EXPECT_EQ(read->sensor_pose.position_world_m, metadata.sensor_pose.position_world_m);
  EXPECT_EQ(read->sensor_pose.world_from_body, metadata.sensor_pose.world_from_body);
  EXPECT_EQ(read->band_name, "8-12");
  EXPECT_EQ(read->band_hi_um, 12.0);
  ASSERT_TRUE(read->fov_h_rad.has_value());
  EXPECT_NEAR(*read->fov_h_rad, 0.625, 1e-15);
  EXPECT_EQ(read->units, "W m-2 sr-1");
}

TEST(ExrImage, the_band_response_survives_exactly_or_is_known_to_be_unknown) {
  FrameMetadata metadata;
  metadata.band_name = "det";
  metadata.band_lo_um = 3.0;
  metadata.band_hi_um = 5.5;
  const auto through_file = [&] {
    ExrImage image = sample_image();
    set_frame_metadata(image, metadata);
    const auto file = scratch("response.exr");
    EXPECT_TRUE(write_exr(file, image));
    const auto back = read_exr(file);
    EXPECT_TRUE(back);
    const auto read = frame_metadata(*back);
    EXPECT_TRUE(read) << read.error().text;
    return read->band_response;
  };
  EXPECT_FALSE(through_file().has_value());
  metadata.band_response.emplace();
  ASSERT_TRUE(through_file().has_value());
  EXPECT_TRUE(through_file()->empty()) << "a rectangle";
  metadata.band_response = {{3.0, 0.0}, {4.1, 1.0 / 3.0}, {5.5, 1e-7}};
  const auto response = through_file();
  ASSERT_TRUE(response.has_value());
  ASSERT_EQ(response->size(), 3U);
  EXPECT_EQ((*response)[1].wavelength_um, 4.1);
  EXPECT_EQ((*response)[1].response_frac, 1.0 / 3.0);
  EXPECT_EQ((*response)[2].response_frac, 1e-7);
  ExrImage image = sample_image();
  for (const char* text : {"", "3:0,4:1", "3", "3:", "3:0 ", "x"}) {
    set_frame_metadata(image, metadata);
    image.attributes["bandResponse"] = std::string(text);
    const auto read = frame_metadata(image);
    ASSERT_FALSE(read) << text;
    EXPECT_THAT(read.error().text, HasSubstr("bandResponse"));
  }
}

TEST(ExrImage, missing_metadata_is_named) {
  const physics::Result<FrameMetadata> metadata = frame_metadata(sample_image());
  ASSERT_FALSE(metadata);
  EXPECT_THAT(metadata.error().text, HasSubstr("simTimeNs"));
}

TEST(ExrImage, wrong_plane_sizes_and_double_names_are_refused) {
  ExrImage image = sample_image();
  image.channels[1].pixels.pop_back();
  EXPECT_THAT(write_exr(scratch("bad.exr"), image).error().text, HasSubstr("'depth'"));
  image = sample_image();
  image.channels[1].name = "radiance";
  EXPECT_THAT(write_exr(scratch("bad.exr"), image).error().text, HasSubstr("used twice"));
}

TEST(ExrImage, unreadable_files_are_errors_that_name_them) {
  EXPECT_EQ(read_exr("/nowhere/ghost.exr").error().code, ErrorCode::not_found);
  const auto file = scratch("garbage.exr");
  std::ofstream(file) << "not an image at all, just some text";
  const physics::Result<ExrImage> image = read_exr(file);
  ASSERT_FALSE(image);
  EXPECT_EQ(image.error().code, ErrorCode::parse);
  EXPECT_THAT(image.error().text, HasSubstr("garbage.exr"));
  const auto whole = scratch("whole.exr");
  ASSERT_TRUE(write_exr(whole, sample_image()));
  std::filesystem::resize_file(whole, std::filesystem::file_size(whole) - 40);
  EXPECT_FALSE(read_exr(whole));
  EXPECT_EQ(write_exr("/nowhere/at/all.exr", sample_image()).error().code, ErrorCode::io);
}

/// Writes a file by write_exr() and replaces some bytes after `mark`. Returns the error of reading
/// it.
std::string error_after_damage(std::string_view mark, std::size_t skip, std::string_view bytes) {
  const auto file = scratch("damaged.exr");
  ExrImage image = sample_image();
  image.attributes["scale"] = 1.5;
  EXPECT_TRUE(write_exr(file, image));
  std::ifstream in(file, std::ios::binary);
  std::string whole{std::istreambuf_iterator<char>(in), {}};
  const auto at = whole.find(mark);
  EXPECT_NE(at, std::string::npos) << mark;
  whole.replace(at + mark.size() + skip, bytes.size(), bytes);
  std::ofstream(file, std::ios::binary) << whole;
  const auto read = read_exr(file);
  return read ? std::string() : read.error().text;
}

TEST(ExrImage, headers_that_ask_for_more_memory_than_the_file_has_bytes_are_refused) {
  using namespace std::string_literals;
  const std::string huge = "\xFF\xFF\xFF\x7F"s;
  EXPECT_EQ(error_after_damage("scale\0double\0"s, 4, ""), "") << "undamaged";
  EXPECT_THAT(error_after_damage("scale\0double\0"s, 0, huge),
              HasSubstr("damaged.exr: attribute 'scale' of 2147483647 bytes"));
  EXPECT_THAT(error_after_damage("scale\0double\0"s, 0, "\x09"s),
              HasSubstr("attribute 'scale': 9 bytes are no double"));
  EXPECT_THAT(error_after_damage("dataWindow\0box2i\0"s, 4 + 12, huge),
              HasSubstr("pixels is out of range"));
  EXPECT_THAT(error_after_damage("dataWindow\0box2i\0"s, 4 + 12, "\xFF\xFF\0\0"s),
              HasSubstr("a table of 4096 pieces"));
  EXPECT_THAT(error_after_damage("compression\0compression\0"s, 4, "\x63"s),
              HasSubstr("attribute 'compression'"));
}

TEST(PngImage, file_carries_signature_and_size) {
  RgbImage image{3, 2, std::vector<std::uint8_t>(18, 200)};
  const auto file = scratch("small.png");
  ASSERT_TRUE(write_png(file, image));
  std::ifstream stream(file, std::ios::binary);
  std::array<unsigned char, 24> head{};
  stream.read(reinterpret_cast<char*>(head.data()), head.size());
  EXPECT_EQ(head[0], 0x89);
  EXPECT_EQ(head[1], 'P');
  EXPECT_EQ(head[19], 3);
  EXPECT_EQ(head[23], 2);
  image.rgb.pop_back();
  EXPECT_EQ(write_png(file, image).error().code, ErrorCode::invalid_argument);
  image.rgb.push_back(0);
  EXPECT_EQ(write_png("/nowhere/at/all.png", image).error().code, ErrorCode::io);
}

double luma(const Rgb& c) {
  return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
}

TEST(FalseColor, lightness_never_falls_along_a_map) {
  for (const ColorMap map : {ColorMap::thermal, ColorMap::grey}) {
    const auto& table = color_table(map);
    for (std::size_t i = 1; i < table.size(); ++i) {
      // Allow one count of rounding per component. Two entries apart the lightness must rise.
      EXPECT_GE(luma(table[i]) + 1.0, luma(table[i - 1])) << i;
      if (i >= 8) {
        EXPECT_GT(luma(table[i]), luma(table[i - 8])) << i;
      }
    }
    EXPECT_LT(luma(table.front()), 10.0);
    EXPECT_GT(luma(table.back()), 245.0);
  }
}

TEST(FalseColor, differences_are_dark_in_the_middle_and_blue_or_orange_outside) {
  const auto& table = color_table(ColorMap::difference);
  for (std::size_t i = 1; i < 128; ++i) {
    EXPECT_LE(luma(table[i]), luma(table[i - 1]) + 1.0) << i;
    EXPECT_GE(luma(table[128 + i]) + 1.0, luma(table[127 + i])) << i;
    EXPECT_NEAR(luma(table[i]), luma(table[255 - i]), 8.0) << "no side looks larger: " << i;
  }
  EXPECT_GT(table[0][2], table[0][0] + 60);
  EXPECT_GT(table[255][0], table[255][2] + 60);
  EXPECT_LT(luma(table[128]), 25.0);
}

TEST(FalseColor, values_map_to_their_place_and_nan_to_its_own_colour) {
  const std::vector<float> values{280.0F, 330.0F, 305.125F, 100.0F, kInf, kNan};
  const physics::Result<RgbImage> image = false_color(values, 6, 1, {});
  ASSERT_TRUE(image);
  const auto& table = color_table(ColorMap::thermal);
  const auto pixel = [&](std::size_t i) {
    return Rgb{image->rgb[3 * i], image->rgb[3 * i + 1], image->rgb[3 * i + 2]};
  };
  EXPECT_EQ(pixel(0), table[0]);
  EXPECT_EQ(pixel(1), table[255]);
  EXPECT_EQ(pixel(2), table[128]);
  EXPECT_EQ(pixel(3), table[0]);
  EXPECT_EQ(pixel(4), table[255]);
  EXPECT_EQ(pixel(5), kNanColor);
  for (const Rgb& color : table) {
    EXPECT_NE(color, kNanColor);
  }
}

TEST(FalseColor, colour_bar_widens_the_picture_and_prints_the_limits) {
  const std::vector<float> values(64 * 100, 300.0F);
  FalseColorOptions options;
  options.color_bar = true;
  const physics::Result<RgbImage> image = false_color(values, 64, 100, options);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->width_px, 64U + kColorBarWidthPx);
  int text_pixels = 0;
  for (std::size_t i = 0; i < image->rgb.size(); i += 3) {
    text_pixels += image->rgb[i] == 235 && image->rgb[i + 1] == 235 ? 1 : 0;
  }
  EXPECT_GT(text_pixels, 100);
}

TEST(FalseColor, limits_that_do_not_ascend_are_refused) {
  const std::vector<float> values(4, 300.0F);
  FalseColorOptions options;
  options.min_value = 330.0;
  EXPECT_FALSE(false_color(values, 2, 2, options));
  options.min_value = std::nan("");
  EXPECT_FALSE(false_color(values, 2, 2, options));
  EXPECT_FALSE(false_color(values, 3, 2, {}));
}

TEST(FalseColor, percentiles_leave_out_what_is_not_finite) {
  std::vector<float> values{kNan, kInf};
  EXPECT_FALSE(percentile_range(values, 0, 100));
  for (int i = 0; i <= 100; ++i) {
    values.push_back(static_cast<float>(i));
  }
  const auto range = percentile_range(values, 1, 99);
  ASSERT_TRUE(range);
  EXPECT_EQ(range->min_value, 1.0);
  EXPECT_EQ(range->max_value, 99.0);
}

TEST(ImageDiff, statistics_of_a_known_difference) {
  std::vector<float> a(1000);
  std::vector<float> b(1000, 0.0F);
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i] = (i % 2 == 0 ? 1.0F : -1.0F) * static_cast<float>(i + 1);
  }
  const DiffStats stats = diff_values(a, b, 100);
  EXPECT_EQ(stats.pixels_compared, 1000U);
  EXPECT_EQ(stats.max_abs, 1000.0);
  EXPECT_EQ(stats.max_x_px, 99U);
  EXPECT_EQ(stats.max_y_px, 9U);
  EXPECT_DOUBLE_EQ(stats.mean, -0.5);
  EXPECT_DOUBLE_EQ(stats.mean_abs, 500.5);
  EXPECT_NEAR(stats.rms, std::sqrt(1001.0 * 2001.0 / 6.0), 1e-9);
  EXPECT_EQ(stats.p50, 500.0);
  EXPECT_EQ(stats.p95, 950.0);
  EXPECT_EQ(stats.p99, 990.0);
  EXPECT_EQ(stats.p999, 999.0);
}

TEST(ImageDiff, pixels_not_finite_on_one_side_are_counted) {
  const std::vector<float> a{kNan, kNan, 1.0F, kInf, kInf, -kInf};
  const std::vector<float> b{kNan, 2.0F, kNan, kInf, 3.0F, kInf};
  const DiffStats stats = diff_values(a, b, 6);
  EXPECT_EQ(stats.one_sided_nan, 4U);
  EXPECT_EQ(stats.pixels_compared, 0U);
}

TEST(ImageDiff, sizes_that_do_not_fit_stop_the_program) {
  const std::vector<float> six(6, 1.0F);
  const std::vector<float> four(4, 1.0F);
  EXPECT_THAT(test::failed_check([&] { (void)diff_values(six, four, 2); }), HasSubstr("(6 == 4)"));
  EXPECT_THAT(test::failed_check([&] { (void)diff_values(six, six, 0); }), HasSubstr("(0 > 0)"));
  EXPECT_THAT(test::failed_check([&] { (void)diff_values(six, six, 4); }), HasSubstr("(2 == 0)"));
}

TEST(ImageDiff, radiance_is_reported_in_per_cent_and_kelvin) {
  ExrImage a = sample_image();
  ExrImage b = sample_image();
  a.channels[0].pixels.assign(15, 2.0F);
  b.channels[0].pixels.assign(15, 2.0F);
  a.channels[0].pixels[7] = 2.5F;
  a.channels[2].pixels[4] = 303.25F;
  const auto diff = compare_images(a, b, [](double radiance) { return 10.0 * radiance; });
  ASSERT_TRUE(diff);
  EXPECT_FALSE(diff->identical());
  for (const ChannelDiff& channel : diff->channels) {
    if (channel.channel == "radiance") {
      EXPECT_DOUBLE_EQ(channel.absolute.max_abs, 0.5);
      EXPECT_DOUBLE_EQ(channel.percent.max_abs, 25.0);
      EXPECT_DOUBLE_EQ(channel.kelvin_equivalent.max_abs, 10.0);
      EXPECT_EQ(channel.absolute.max_x_px, 2U);
      EXPECT_EQ(channel.absolute.max_y_px, 1U);
    } else if (channel.channel == "temperature") {
      EXPECT_EQ(channel.unit, "K");
      EXPECT_DOUBLE_EQ(channel.absolute.max_abs, 2.0);
      EXPECT_EQ(channel.absolute.pixels_compared, 1U);
    }
  }
}

TEST(ImageDiff, pixels_without_a_surface_are_apart) {
  ExrImage a = sample_image();
  ExrImage b = sample_image();
  a.channels[0].pixels[7] += 0.5F;  // the one pixel with a depth in both
  const auto diff = compare_images(a, b);
  ASSERT_TRUE(diff);
  const ChannelDiff& radiance = diff->channels[0];
  EXPECT_EQ(radiance.channel, "radiance");
  EXPECT_EQ(radiance.absolute.pixels_compared, 1U);
  EXPECT_DOUBLE_EQ(radiance.absolute.rms, radiance.absolute.max_abs);
  EXPECT_EQ(radiance.no_surface_absolute.pixels_compared, 14U);
  EXPECT_EQ(radiance.no_surface_absolute.max_abs, 0.0);

  // A surface in one of the images counts, and a difference of the sky is still one.
  b.channels[1].pixels[3] = 10.0F;
  a.channels[0].pixels[0] += 0.25F;
  const auto sky = compare_images(a, b);
  EXPECT_EQ(sky->channels[0].absolute.pixels_compared, 2U);
  EXPECT_NEAR(sky->channels[0].no_surface_absolute.max_abs, 0.25, 1e-6);
  ExrImage only_sky = sample_image();
  only_sky.channels[0].pixels[0] += 0.25F;
  EXPECT_FALSE(compare_images(only_sky, sample_image())->identical());
}

TEST(ImageDiff, without_a_channel_that_tells_every_pixel_counts) {
  ExrImage image = sample_image();
  image.channels.resize(1);
  const auto diff = compare_images(image, image);
  EXPECT_EQ(diff->channels[0].absolute.pixels_compared, 15U);
  EXPECT_EQ(diff->channels[0].no_surface_absolute.pixels_compared, 0U);
}

TEST(ImageDiff, equal_images_are_identical_and_missing_channels_are_listed) {
  const ExrImage a = sample_image();
  ExrImage b = sample_image();
  EXPECT_TRUE(compare_images(a, b)->identical());
  b.channels.pop_back();
  b.add("object", std::vector<float>(15, 0.0F));
  const auto diff = compare_images(a, b);
  ASSERT_TRUE(diff);
  EXPECT_THAT(diff->only_in_a, testing::ElementsAre("temperature"));
  EXPECT_THAT(diff->only_in_b, testing::ElementsAre("object"));
  EXPECT_FALSE(diff->identical());
  b.width_px = 3;
  b.height_px = 5;
  EXPECT_FALSE(compare_images(a, b));
}

}  // namespace
}  // namespace emit::image
