// SPDX-License-Identifier: Apache-2.0
#include "output/spot.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

#include "output/spot_filter.hpp"
#include "support/output_files.hpp"

namespace emit::server {
namespace {

using protocol::ImageSize;
using scene::ChannelOptics;
using scene::SpotKind;

Spot spot_of(const ChannelOptics& settings) {
  auto spot = make_spot(settings);
  EXPECT_TRUE(spot.has_value());
  return *spot;
}

double sum_of(const Spot& spot) {
  return std::accumulate(spot.share_frac.begin(), spot.share_frac.end(), 0.0);
}

TEST(Spot, AGaussianHasItsVarianceAndThatOfAPixel) {
  for (const double sigma_px : {0.7, 1.5, 5.0}) {
    const Spot spot = spot_of({.spot = SpotKind::gaussian, .sigma_px = sigma_px});
    EXPECT_NEAR(sum_of(spot), 1.0, 1e-12);
    EXPECT_EQ(spot.veil_frac, 0.0);
    double variance = 0.0;
    for (std::size_t i = 0; i < spot.share_frac.size(); ++i) {
      const double x = static_cast<double>(i % spot.side()) - spot.radius_px;
      variance += spot.share_frac[i] * x * x;
    }
    EXPECT_NEAR(variance, sigma_px * sigma_px + 1.0 / 12.0, 2e-3 * variance) << sigma_px;
  }
}

/// Light of an Airy pattern within a distance (Rayleigh, 1881).
double encircled(double distance_px, double airy_px) {
  const double x = std::numbers::pi * distance_px / airy_px;
  const double j0 = std::cyl_bessel_j(0.0, x);
  const double j1 = std::cyl_bessel_j(1.0, x);
  return 1.0 - j0 * j0 - j1 * j1;
}

TEST(Spot, AnAiryPatternHoldsRayleighsShareOfLight) {
  const double airy_px = 4.0;
  const Spot spot = spot_of({.spot = SpotKind::airy, .airy_px = airy_px});
  for (const double distance_px : {4.88, 8.93, 16.0, 22.0}) {
    double inside = 0.0;
    constexpr int kParts = 16;
    for (std::size_t i = 0; i < spot.share_frac.size(); ++i) {
      int within = 0;
      for (int k = 0; k < kParts * kParts; ++k) {
        const double x = static_cast<double>(i % spot.side()) - spot.radius_px - 0.5 +
                         (k % kParts + 0.5) / kParts;
        const double y = static_cast<double>(i / spot.side()) - spot.radius_px - 0.5 +
                         (static_cast<double>(k / kParts) + 0.5) / kParts;
        within += std::hypot(x, y) < distance_px ? 1 : 0;
      }
      inside += spot.share_frac[i] * within / (kParts * kParts);
    }
    EXPECT_NEAR(inside, encircled(distance_px, airy_px), 0.004) << distance_px;
  }
}

TEST(Spot, TheVeilIsTheLightBeyondTheSquare) {
  for (const double airy_px : {0.3, 0.6, 1.0, 2.0, 4.0}) {
    const Spot spot = spot_of({.spot = SpotKind::airy, .airy_px = airy_px});
    EXPECT_NEAR(sum_of(spot) + spot.veil_frac, 1.0, 1e-12);
    const double reach_px = spot.radius_px + 0.5;
    EXPECT_LT(spot.veil_frac, 1.0 - encircled(reach_px, airy_px)) << airy_px;
    EXPECT_GT(spot.veil_frac, 1.0 - encircled(std::numbers::sqrt2 * reach_px, airy_px)) << airy_px;
  }
}

TEST(Spot, AnAiryPatternWhoseLightLiesBeyondTheReachIsRefused) {
  const auto wide = make_spot({.spot = SpotKind::airy, .airy_px = 4.0, .obscuration_frac = 0.9});
  ASSERT_FALSE(wide.has_value());
  EXPECT_NE(wide.error().text.find(" % of the light lies beyond 24 px"), std::string::npos)
      << wide.error().text;
  const Spot half = spot_of({.spot = SpotKind::airy, .airy_px = 4.0, .obscuration_frac = 0.5});
  // Beyond a circle of 24.5 px lie 6.4 % (by numerical integration), and the square holds more.
  EXPECT_LT(half.veil_frac, 0.064);
  EXPECT_GT(half.veil_frac, 0.045);
}

TEST(Spot, AnObscurationDrawsTheFirstRingInwards) {
  // The first zero of jinc(x) = e^2 jinc(e x) is at x = 3.8317 without obscuration and 3.1444 for
  // e = 0.5.
  for (const auto& [obscuration_frac, zero] : {std::pair{0.0, 3.8317}, std::pair{0.5, 3.1444}}) {
    const double airy_px = 4.0;
    const Spot spot =
        spot_of({.spot = SpotKind::airy, .airy_px = airy_px, .obscuration_frac = obscuration_frac});
    std::size_t darkest = 1;
    const auto at = [&](std::size_t x) {
      return spot.share_frac[spot.radius_px * spot.side() + spot.radius_px + x];
    };
    while (at(darkest + 1) < at(darkest)) ++darkest;
    EXPECT_NEAR(static_cast<double>(darkest), zero * airy_px / std::numbers::pi, 0.6);
  }
}

TEST(Spot, FaultsOfAFileAreNamed) {
  test::OutputFiles folder;
  const auto one = [](double x, double y) { return 1.0 + 0.0 * x * y; };
  ChannelOptics settings{.spot = SpotKind::file};
  settings.spot_file = folder.exr("even.exr", {4, 4}, {{"spot", one}});
  ASSERT_FALSE(make_spot(settings).has_value());
  EXPECT_NE(make_spot(settings).error().text.find("even.exr: a spot has as many"),
            std::string::npos);
  settings.spot_file = folder.exr("name.exr", {3, 3}, {{"psf", one}});
  EXPECT_NE(make_spot(settings).error().text.find("channel 'spot' is missing"), std::string::npos);
  settings.spot_file =
      folder.exr("minus.exr", {3, 3}, {{"spot", [](double x, double y) { return x - y - 1.0; }}});
  EXPECT_NE(make_spot(settings).error().text.find("column 0, row 0"), std::string::npos);
  settings.spot_file =
      folder.exr("dark.exr", {3, 3}, {{"spot", [](double x, double y) { return 0.0 * x * y; }}});
  EXPECT_NE(make_spot(settings).error().text.find("0 everywhere"), std::string::npos);
  settings.spot_file = folder.exr("good.exr", {3, 3}, {{"spot", one}});
  EXPECT_NEAR(spot_of(settings).share_frac[4], 1.0 / 9.0, 1e-12);
}

/// Convolution by its definition, in double, without a veil; borders repeat.
std::vector<double> convolved(const Spot& spot, const std::vector<float>& image,
                              const ImageSize& size) {
  std::vector<double> out(image.size());
  const int radius = static_cast<int>(spot.radius_px);
  const int width = static_cast<int>(size.width_px);
  const int height = static_cast<int>(size.height_px);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double sum = 0.0;
      for (int v = -radius; v <= radius; ++v) {
        for (int u = -radius; u <= radius; ++u) {
          const int sx = std::clamp(x - u, 0, width - 1);
          const int sy = std::clamp(y - v, 0, height - 1);
          sum += spot.share_frac[static_cast<std::size_t>(v + radius) * spot.side() +
                                 static_cast<std::size_t>(u + radius)] *
                 static_cast<double>(image[static_cast<std::size_t>(sy * width + sx)]);
        }
      }
      out[static_cast<std::size_t>(y * width + x)] = sum;
    }
  }
  return out;
}

TEST(SpotFilter, ProductsOfRowsAndColumnsAreTheConvolution) {
  test::OutputFiles folder;
  const ImageSize size{90, 70};
  const std::vector<float> image = test::image_of(size, [](double x, double y) {
    return 5.0 + std::sin(0.9 * x) * std::cos(0.7 * y) + (std::hypot(x - 30, y - 20) < 4 ? 80 : 0);
  });
  // The last spot has no symmetry.
  const std::vector<ChannelOptics> all = {
      {.spot = SpotKind::gaussian, .sigma_px = 0.4},
      {.spot = SpotKind::gaussian, .sigma_px = 2.0},
      {.spot = SpotKind::airy, .airy_px = 0.5},
      {.spot = SpotKind::airy, .airy_px = 1.0},
      {.spot = SpotKind::airy, .airy_px = 1.7, .obscuration_frac = 0.4},
      {.spot = SpotKind::file,
       .spot_file = folder.exr("comet.exr", {7, 7}, {{"spot", [](double x, double y) {
                                                        return x * x / (1.0 + y) + 3.0 * (y > 5);
                                                      }}})}};
  for (std::size_t i = 0; i < all.size(); ++i) {
    Spot spot = spot_of(all[i]);
    // The veil is left out here, so that the definition is short.
    for (double& share : spot.share_frac) share /= 1.0 - spot.veil_frac;
    spot.veil_frac = 0.0;
    SpotFilter filter(spot, {0, 0, size.width_px, size.height_px}, size);
    const auto made = filter.apply(image);
    const std::vector<double> expected = convolved(spot, image, size);
    for (std::size_t p = 0; p < image.size(); ++p) {
      ASSERT_NEAR(made[p], expected[p], 5e-6 * 80.0) << "spot " << i << " pixel " << p;
    }
  }
}

TEST(SpotFilter, KeepsTheLightOfAPointAndAnEvenImage) {
  const ImageSize size{220, 200};
  for (const ChannelOptics& settings :
       {ChannelOptics{.spot = SpotKind::gaussian, .sigma_px = 0.7},
        ChannelOptics{.spot = SpotKind::airy, .airy_px = 0.3},
        ChannelOptics{.spot = SpotKind::airy, .airy_px = 1.0},
        ChannelOptics{.spot = SpotKind::airy, .airy_px = 1.5, .obscuration_frac = 0.3}}) {
    SpotFilter filter(spot_of(settings), {0, 0, size.width_px, size.height_px}, size);
    std::vector<float> point(std::size_t{size.width_px} * size.height_px, 0.0F);
    point[100 * 220 + 110] = 1000.0F;
    double sum = 0.0;
    for (const float value : filter.apply(point)) sum += static_cast<double>(value);
    EXPECT_NEAR(sum / 1000.0, 1.0, 1e-5);
    const std::vector<float> even(point.size(), 37.5F);
    for (const float value : filter.apply(even)) ASSERT_NEAR(value, 37.5F, 37.5F * 2e-6F);
  }
}

TEST(SpotFilter, APartOfTheImageIsWhatTheWholeWouldBe) {
  const ImageSize size{80, 60};
  const std::vector<float> image = test::image_of(
      size, [](double x, double y) { return 3.0 + std::sin(x * 0.8) + std::cos(y * 1.1); });
  const Spot spot = spot_of({.spot = SpotKind::gaussian, .sigma_px = 1.2});
  SpotFilter whole(spot, {0, 0, 80, 60}, size);
  const scene::PixelRect part{2, 30, 40, 30};
  SpotFilter some(spot, part, size);
  EXPECT_EQ(some.reads_px(),
            (scene::PixelRect{0, 30 - spot.radius_px, 42 + spot.radius_px, 30 + spot.radius_px}));
  const auto all = whole.apply(image);
  const auto made = some.apply(image);
  for (std::size_t y = 30; y < 60; ++y) {
    for (std::size_t x = 2; x < 42; ++x) ASSERT_EQ(made[y * 80 + x], all[y * 80 + x]);
  }
}

}  // namespace
}  // namespace emit::server
