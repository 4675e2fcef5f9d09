// SPDX-License-Identifier: Apache-2.0
#include "output/output_chain.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "emit/image/exr_image.hpp"
#include "support/output_files.hpp"

namespace emit::server {
namespace {

using protocol::ImagePoint;
using protocol::ImageSize;
using scene::PictureMirror;
using test::image_of;
using test::made;
using test::OutputFiles;

constexpr ImageSize kImage{11, 9};
const scene::PixelRect kWindow{2, 3, 5, 4};

/// Pixel of a window that a pixel of the mirrored and rotated frame shows, by the index formulas of
/// the picture's rotations: a table of its own.
std::pair<std::uint32_t, std::uint32_t> shown_pixel(PictureMirror mirror, std::uint32_t rotate_deg,
                                                    std::uint32_t x, std::uint32_t y) {
  const std::uint32_t w = kWindow.width_px;
  const std::uint32_t h = kWindow.height_px;
  std::uint32_t mx = x;
  std::uint32_t my = y;
  if (rotate_deg == 90) {
    mx = y;
    my = h - 1 - x;
  } else if (rotate_deg == 180) {
    mx = w - 1 - x;
    my = h - 1 - y;
  } else if (rotate_deg == 270) {
    mx = w - 1 - y;
    my = x;
  }
  if (mirror == PictureMirror::horizontal || mirror == PictureMirror::both) mx = w - 1 - mx;
  if (mirror == PictureMirror::vertical || mirror == PictureMirror::both) my = h - 1 - my;
  return {mx, my};
}

constexpr PictureMirror kMirrors[] = {PictureMirror::none, PictureMirror::horizontal,
                                      PictureMirror::vertical, PictureMirror::both};
constexpr std::uint32_t kRotations_deg[] = {0, 90, 180, 270};

TEST(OutputChain, AllSixteenMirrorsAndRotationsMoveEveryPixelToItsPlace) {
  const auto image = image_of(kImage, [](double x, double y) { return 100.0 * y + x; });
  int combinations = 0;
  for (const PictureMirror mirror : kMirrors) {
    for (const std::uint32_t rotate_deg : kRotations_deg) {
      scene::ChannelOutput settings;
      settings.mirror = mirror;
      settings.rotate_deg = rotate_deg;
      auto chain = OutputChain::make(settings, {kImage, kWindow, 0.0});
      ASSERT_TRUE(chain.has_value()) << chain.error().text;
      const bool lies = rotate_deg == 90 || rotate_deg == 270;
      const ImageSize frame{lies ? 4U : 5U, lies ? 5U : 4U};
      ASSERT_EQ(chain->frame(), frame);
      EXPECT_EQ(chain->source_px(), kWindow);
      const std::vector<float> out = made(*chain, image);
      for (std::uint32_t y = 0; y < frame.height_px; ++y) {
        for (std::uint32_t x = 0; x < frame.width_px; ++x) {
          const auto [column, row] = shown_pixel(mirror, rotate_deg, x, y);
          ASSERT_EQ(out[y * frame.width_px + x],
                    image[(kWindow.y_px + row) * kImage.width_px + kWindow.x_px + column])
              << "mirror " << static_cast<int>(mirror) << ", " << rotate_deg << " degrees, " << x
              << ", " << y;
          // Clients map back by the same rule.
          const ImagePoint back =
              protocol::window_point(chain->steps(), {5, 4}, {x + 0.5, y + 0.5});
          ASSERT_EQ(back, (ImagePoint{column + 0.5, row + 0.5}));
        }
      }
      ++combinations;
    }
  }
  EXPECT_EQ(combinations, 16);
}

TEST(OutputChain, ARotatedPictureLargerThanABlockIsWhole) {
  const ImageSize size{70, 45};
  const auto image = image_of(size, [](double x, double y) { return 100.0 * y + x; });
  scene::ChannelOutput settings;
  settings.rotate_deg = 90;
  auto chain = OutputChain::make(settings, {size, {0, 0, 70, 45}, 0.0});
  ASSERT_TRUE(chain.has_value());
  const std::vector<float> out = made(*chain, image);
  for (std::uint32_t y = 0; y < 70; ++y) {
    for (std::uint32_t x = 0; x < 45; ++x) {
      ASSERT_EQ(out[y * 45 + x], image[(44 - x) * 70 + y]);
    }
  }
}

TEST(OutputChain, AMapOfWholePixelsCopiesBitsInEveryOrientation) {
  OutputFiles folder;
  // Values whose products round: only a copy keeps their bits.
  const auto image = image_of(kImage, [](double x, double y) {
    return std::exp(1.37 * std::sin(12.9898 * x + 78.233 * y));
  });
  for (const PictureMirror mirror : kMirrors) {
    for (const std::uint32_t rotate_deg : kRotations_deg) {
      scene::ChannelOutput settings;
      settings.mirror = mirror;
      settings.rotate_deg = rotate_deg;
      auto turned = OutputChain::make(settings, {kImage, kWindow, 0.0});
      ASSERT_TRUE(turned.has_value());
      settings.distortion_file =
          folder.map("identity.exr", turned->frame(), [](double x, double y) {
            return ImagePoint{x, y};
          });
      auto mapped = OutputChain::make(settings, {kImage, kWindow, 0.0});
      ASSERT_TRUE(mapped.has_value()) << mapped.error().text;
      EXPECT_EQ(mapped->outside_px(), 0U);
      EXPECT_EQ(mapped->steps(), turned->steps() | protocol::kOutputDistorted);
      EXPECT_EQ(made(*mapped, image), made(*turned, image))
          << static_cast<int>(mirror) << ", " << rotate_deg;
    }
  }
}

TEST(OutputChain, AKnownWarpOfASmoothPictureIsWithinTheErrorOfBilinearSampling) {
  const ImageSize size{96, 64};
  const double period_px = 24.0;
  const double k = 2.0 * std::numbers::pi / period_px;
  const auto scene_at = [&](double x, double y) {
    return 30.0 + 10.0 * std::sin(k * x) * std::cos(k * y);
  };
  const auto image = image_of(size, scene_at);
  // A rotation by 7 degrees about the centre, scaled by 0.8.
  const double angle = 7.0 * std::numbers::pi / 180.0;
  const auto warp = [&](double x, double y) {
    const double dx = 0.8 * (x - 48.0);
    const double dy = 0.8 * (y - 32.0);
    return ImagePoint{48.0 + std::cos(angle) * dx - std::sin(angle) * dy,
                      32.0 + std::sin(angle) * dx + std::cos(angle) * dy};
  };
  OutputFiles folder;
  scene::ChannelOutput settings;
  settings.distortion_file =
      folder.map("warp.exr", {80, 50}, [&](double x, double y) { return warp(x + 8.0, y + 7.0); });
  auto chain = OutputChain::make(settings, {size, {0, 0, 96, 64}, 0.0});
  ASSERT_TRUE(chain.has_value()) << chain.error().text;
  ASSERT_EQ(chain->frame(), (ImageSize{80, 50})) << "the frame has the size of the map";
  EXPECT_EQ(chain->outside_px(), 0U);
  const std::vector<float> out = made(*chain, image);
  // Linear interpolation over a pixel is off by at most an eighth of the second derivative; here
  // that is 10 k^2 along either axis.
  const double bound = 2.0 * 10.0 * k * k / 8.0;
  double worst = 0.0;
  for (std::uint32_t y = 0; y < 50; ++y) {
    for (std::uint32_t x = 0; x < 80; ++x) {
      const ImagePoint at = warp(x + 8.5, y + 7.5);
      const double error = std::abs(out[y * 80 + x] - scene_at(at.x_px, at.y_px));
      worst = std::max(worst, error);
    }
  }
  EXPECT_LT(worst, bound + 1e-5);
  EXPECT_GT(worst, 0.3 * bound) << "the bound is not much too wide";
}

TEST(OutputChain, APlaneSurvivesResamplingExactly) {
  const auto plane = [](double x, double y) { return 4.0 + 0.5 * x - 0.25 * y; };
  const auto image = image_of(kImage, plane);
  OutputFiles folder;
  scene::ChannelOutput settings;
  settings.mirror = PictureMirror::horizontal;
  settings.rotate_deg = 90;
  settings.distortion_file = folder.map("plane.exr", {3, 4}, [](double x, double y) {
    return ImagePoint{x + 0.125, y + 0.25};
  });
  auto chain = OutputChain::make(settings, {kImage, kWindow, 0.0});
  ASSERT_TRUE(chain.has_value()) << chain.error().text;
  const std::vector<float> out = made(*chain, image);
  for (std::uint32_t y = 0; y < 4; ++y) {
    for (std::uint32_t x = 0; x < 3; ++x) {
      // A frame of 4 x 5: rotated clockwise, (x, y) shows the mirrored picture at (y, 4 - x).
      const double mirrored_x = y + 0.75;
      const double window_y = 4.0 - (x + 0.625);
      EXPECT_NEAR(out[y * 3 + x], plane(2.0 + 5.0 - mirrored_x, 3.0 + window_y), 1e-6);
    }
  }
}

TEST(OutputChain, PixelsThatPointNowhereGetTheirValueAndAreCounted) {
  const auto image = image_of(kImage, [](double, double) { return 7.0; });
  OutputFiles folder;
  scene::ChannelOutput settings;
  settings.outside_w_m2_sr = 2.5;
  // Columns 0 and 6 of 7 lie beyond the window of 5; one position in row 0 is no number.
  settings.distortion_file = folder.map("wide.exr", {7, 4}, [](double x, double y) {
    return ImagePoint{x == 3.5 && y == 0.5 ? NAN : x - 1.0, y};
  });
  auto chain = OutputChain::make(settings, {kImage, kWindow, 0.0});
  ASSERT_TRUE(chain.has_value()) << chain.error().text;
  EXPECT_EQ(chain->outside_px(), 9U);
  const std::vector<float> out = made(*chain, image);
  for (std::uint32_t i = 0; i < 28; ++i) {
    const bool outside = i % 7 == 0 || i % 7 == 6 || i == 3;
    EXPECT_EQ(out[i], outside ? 2.5F : 7.0F) << i;
  }
}

TEST(OutputChain, AShiftMovesThePictureAndShowsTheSceneBesideTheWindow) {
  const ImageSize size{60, 50};
  const auto plane = [](double x, double y) { return 10.0 + 0.5 * x + 0.25 * y; };
  const auto image = image_of(size, plane);
  scene::ChannelOutput settings;
  settings.apply_shift = true;
  auto chain = OutputChain::make(settings, {size, {20, 20, 10, 8}, 0.0});
  ASSERT_TRUE(chain.has_value());
  EXPECT_EQ(chain->source_px(), (scene::PixelRect{4, 4, 42, 40}));
  for (const glm::vec2 shift_px :
       {glm::vec2(0.0F), glm::vec2(1.25F, -2.5F), glm::vec2(-15.5F, 9)}) {
    const std::vector<float> out = made(*chain, image, shift_px);
    for (std::uint32_t y = 0; y < 8; ++y) {
      for (std::uint32_t x = 0; x < 10; ++x) {
        // A scene that moves right shows further left.
        EXPECT_NEAR(out[y * 10 + x], plane(20.5 + x - shift_px.x, 20.5 + y - shift_px.y), 1e-5);
      }
    }
  }
  const std::vector<float> still = made(*chain, image, glm::vec2(0.0F));
  EXPECT_EQ(still[0], image[20 * 60 + 20]) << "no shift copies bits";
}

TEST(OutputChain, AShiftIsThatOfTheSensorsImageHoweverThePictureLies) {
  const ImageSize size{60, 50};
  const auto image = image_of(size, [](double x, double y) { return 100.0 * y + x; });
  for (const PictureMirror mirror : kMirrors) {
    for (const std::uint32_t rotate_deg : kRotations_deg) {
      scene::ChannelOutput settings;
      settings.mirror = mirror;
      settings.rotate_deg = rotate_deg;
      const scene::PixelRect moved{20 - 3, 20 + 2, 10, 8};
      auto turned = OutputChain::make(settings, {size, moved, 0.0});
      settings.apply_shift = true;
      auto chain = OutputChain::make(settings, {size, {20, 20, 10, 8}, 0.0});
      ASSERT_TRUE(chain.has_value() && turned.has_value());
      EXPECT_EQ(made(*chain, image, {3.0F, -2.0F}), made(*turned, image))
          << static_cast<int>(mirror) << ", " << rotate_deg;
    }
  }
}

TEST(OutputChain, AShiftLeavesAloneWhatDoesNotAskForIt) {
  const auto image = image_of(kImage, [](double x, double y) { return 10.0 * y + x; });
  OutputFiles folder;
  scene::ChannelOutput settings;
  settings.distortion_file = folder.map("same.exr", {5, 4}, [](double x, double y) {
    return ImagePoint{x, y};
  });
  auto chain = OutputChain::make(settings, {kImage, kWindow, 0.0});
  ASSERT_TRUE(chain.has_value());
  EXPECT_EQ(made(*chain, image, {1.5F, -0.5F}), made(*chain, image));
}

TEST(OutputChain, AShiftBeyondTheImageShowsTheOutsideValue) {
  const auto image = image_of(kImage, [](double, double) { return 7.0; });
  scene::ChannelOutput settings;
  settings.apply_shift = true;
  settings.outside_w_m2_sr = 1.0;
  auto chain = OutputChain::make(settings, {kImage, {0, 0, 11, 9}, 0.0});
  ASSERT_TRUE(chain.has_value());
  const std::vector<float> out = made(*chain, image, {2.0F, 0.0F});
  for (std::uint32_t i = 0; i < 99; ++i) EXPECT_EQ(out[i], i % 11 < 2 ? 1.0F : 7.0F) << i;
  const std::vector<float> edge = made(*chain, image, {0.5F, -0.5F});
  for (const float value : edge) EXPECT_EQ(value, 7.0F) << "half a pixel is within the edge";
}

TEST(OutputChain, AShiftCutsThePictureWhereAPixelShowsNothing) {
  const ImageSize size{60, 50};
  const auto image = image_of(size, [](double, double) { return 7.0; });
  scene::ChannelOutput settings;
  settings.apply_shift = true;
  settings.outside_w_m2_sr = 1.0;
  // One window has all its room, and one lies near two edges of the image.
  for (const scene::PixelRect& window :
       {scene::PixelRect{20, 20, 10, 8}, scene::PixelRect{3, 38, 50, 7}}) {
    auto chain = OutputChain::make(settings, {size, window, 0.0});
    ASSERT_TRUE(chain.has_value());
    std::size_t cut = 0;
    std::size_t whole = 0;
    for (float x = -18.0F; x <= 18.0F; x += 0.75F) {
      for (float y = -18.0F; y <= 18.0F; y += 0.75F) {
        const std::vector<float> out = made(*chain, image, {x, y});
        const bool empty = std::ranges::count(out, 1.0F) > 0;
        ASSERT_EQ(chain->cuts({glm::vec2(x, y), 0}), empty) << x << ", " << y;
        (empty ? cut : whole) += 1;
      }
    }
    EXPECT_GT(cut, 100U);
    EXPECT_GT(whole, 100U);
  }
}

TEST(OutputChain, BrownsPolynomialMovesPixelsAsItsEquationSays) {
  const ImageSize size{40, 30};
  const auto source = PositionMap::brown(size, 50.0, {0.1, -0.02, 0.003}, {0.004, -0.005});
  ASSERT_EQ(source.points.size(), 1200U);
  // Pixel (33, 4): x = (33.5 - 20) / 50 = 0.27, y = (4.5 - 15) / 50 = -0.21, r^2 = 0.117.
  const double scale = 1.0 + 0.1 * 0.117 - 0.02 * 0.013689 + 0.003 * 0.001601613;
  const double x = 0.27 * scale + 2 * 0.004 * 0.27 * -0.21 - 0.005 * (0.117 + 2 * 0.0729);
  const double y = -0.21 * scale + 0.004 * (0.117 + 2 * 0.0441) - 2 * 0.005 * 0.27 * -0.21;
  EXPECT_NEAR(source.points[4 * 40 + 33].x_px, 20.0 + 50.0 * x, 1e-12);
  EXPECT_NEAR(source.points[4 * 40 + 33].y_px, 15.0 + 50.0 * y, 1e-12);
}

TEST(OutputChain, APolynomialIsAppliedToThePicture) {
  const ImageSize size{64, 48};
  const auto plane = [](double x, double y) { return 10.0 + 0.5 * x - 0.25 * y; };
  const auto image = image_of(size, plane);
  scene::ChannelOutput settings;
  settings.distortion_radial = {-0.3, 0.0, 0.0};
  auto chain = OutputChain::make(settings, {size, {0, 0, 64, 48}, 80.0});
  ASSERT_TRUE(chain.has_value()) << chain.error().text;
  EXPECT_EQ(chain->outside_px(), 0U) << "a barrel draws its source from within";
  const std::vector<float> out = made(*chain, image);
  const double r2 = (15.5 * 15.5 + 10.5 * 10.5) / 6400.0;
  const double scale = 1.0 - 0.3 * r2;
  EXPECT_NEAR(out[34 * 64 + 47], plane(32.0 + 15.5 * scale, 24.0 + 10.5 * scale), 1e-5);
  settings.distortion_radial = {0.3, 0.0, 0.0};
  auto cushion = OutputChain::make(settings, {size, {0, 0, 64, 48}, 80.0});
  ASSERT_TRUE(cushion.has_value());
  EXPECT_GT(cushion->outside_px(), 0U);
  EXPECT_FALSE(OutputChain::make(settings, {size, {0, 0, 64, 48}, 0.0}).has_value())
      << "without a focal length there is no polynomial";
}

TEST(OutputChain, GainAndOffsetThenTheDriveTableComeLast) {
  const auto image = image_of(kImage, [](double x, double y) { return 10.0 * y + x; });
  OutputFiles folder;
  scene::ChannelOutput settings;
  settings.rotate_deg = 180;
  settings.nuc_file =
      folder.exr("nuc.exr", {5, 4},
                 {{"gain", [](double x, double y) { return 1.0 + 0.125 * x + 0.0 * y; }},
                  {"offset", [](double x, double y) { return -0.5 * y + 0.0 * x; }}});
  auto corrected = OutputChain::make(settings, {kImage, kWindow, 0.0});
  ASSERT_TRUE(corrected.has_value()) << corrected.error().text;
  EXPECT_EQ(corrected->steps(), protocol::kOutputRotated180 | protocol::kOutputCorrected);
  settings.drive_table_file =
      folder.text("drive.csv", "radiance_w_m2_sr,drive\n40,0\n60,1000\n90,4000\n");
  auto driven = OutputChain::make(settings, {kImage, kWindow, 0.0});
  ASSERT_TRUE(driven.has_value()) << driven.error().text;
  EXPECT_EQ(driven->steps(), corrected->steps() | protocol::kOutputDriven);
  const std::vector<float> commands = made(*corrected, image);
  std::vector<float> drives(20);
  const std::uint32_t clamped = driven->apply(image, {}, drives);
  std::uint32_t expected_clamped = 0;
  for (std::uint32_t y = 0; y < 4; ++y) {
    for (std::uint32_t x = 0; x < 5; ++x) {
      const double radiance = 10.0 * (3 + 3 - y + 0.5) + (2 + 4 - x + 0.5);
      const double command = (1.0 + 0.125 * (x + 0.5)) * radiance - 0.5 * (y + 0.5);
      EXPECT_NEAR(commands[y * 5 + x], command, 1e-4);
      const double drive =
          command < 60.0 ? (command - 40.0) * 50.0 : 1000.0 + (command - 60.0) * 100.0;
      EXPECT_NEAR(drives[y * 5 + x], std::clamp(drive, 0.0, 4000.0), 0.02);
      expected_clamped += command < 40.0 || command > 90.0 ? 1U : 0U;
    }
  }
  EXPECT_GT(expected_clamped, 0U);
  EXPECT_LT(expected_clamped, 20U);
  EXPECT_EQ(clamped, expected_clamped);
}

TEST(OutputChain, OpticsAndDetectorComeBeforeCorrectionInTheirOrder) {
  const ImageSize size{64, 48};
  const auto image =
      image_of(size, [](double x, double y) { return 20.0 + std::hypot(x - 20.0, y - 30.0); });
  const OutputChain::Origin origin{
      size, {10, 8, 30, 30}, 50.0, scene::SpectralBand{"8-12", 8.0, 12.0, {}}};
  scene::ChannelOutput settings;
  settings.optics = {.spot = scene::SpotKind::gaussian, .sigma_px = 1.0};
  auto blurred = OutputChain::make(settings, origin);
  ASSERT_TRUE(blurred.has_value()) << blurred.error().text;
  EXPECT_EQ(blurred->steps(), protocol::kOutputBlurred);
  EXPECT_EQ(blurred->source_px(), (scene::PixelRect{5, 3, 40, 40}))
      << "the renderer draws what the spot reaches";
  // The cone has no curvature but at its tip, so that a spot leaves it alone elsewhere, about.
  const std::vector<float> soft = made(*blurred, image);
  EXPECT_NEAR(soft[2 * 30 + 25], image[10 * 64 + 35], 0.03);
  EXPECT_GT(soft[22 * 30 + 10], image[30 * 64 + 20] + 0.5F) << "the tip is filled";
  settings.optics.vignetting = true;
  auto dimmed = OutputChain::make(settings, origin);
  ASSERT_TRUE(dimmed.has_value());
  const std::vector<float> dim = made(*dimmed, image);
  // Pixel (0, 0) of the window lies at 10.5, 8.5, 21.5 and 15.5 px from the axis at 32, 24.
  const double cos2 = 1.0 / (1.0 + (21.5 * 21.5 + 15.5 * 15.5) / 2500.0);
  EXPECT_NEAR(dim[0], static_cast<double>(soft[0]) * cos2 * cos2, 1e-5);
  EXPECT_FALSE(OutputChain::make(settings, {size, origin.window_px, 0.0}).has_value());
  // A map of half the size shows the middle of every four pixels, with their angle.
  const OutputFiles folder;
  scene::ChannelOutput mapped = settings;
  mapped.optics.spot = scene::SpotKind::none;
  mapped.distortion_file = folder.map("half.exr", {15, 15}, [](double x, double y) {
    return ImagePoint{2.0 * x, 2.0 * y};
  });
  auto halved = OutputChain::make(mapped, origin);
  ASSERT_TRUE(halved.has_value()) << halved.error().text;
  const std::vector<float> even(image.size(), 1.0F);
  const std::vector<float> quarter = made(*halved, even);
  const double last2 = 1.0 / (1.0 + (7.0 * 7.0 + 13.0 * 13.0) / 2500.0);  // 39, 37 from 32, 24
  EXPECT_NEAR(quarter[14 * 15 + 14], last2 * last2, 1e-5);
  settings.detector.netd_k = 0.2;
  auto noisy = OutputChain::make(settings, origin);
  ASSERT_TRUE(noisy.has_value());
  EXPECT_EQ(noisy->steps(), protocol::kOutputBlurred | protocol::kOutputDetected);
  std::vector<float> one(900);
  std::vector<float> again(900);
  std::vector<float> next(900);
  static_cast<void>(noisy->apply(image, {{}, 5}, one));
  static_cast<void>(noisy->apply(image, {{}, 6}, next));
  static_cast<void>(noisy->apply(image, {{}, 5}, again));
  EXPECT_EQ(one, again);
  EXPECT_NE(one, next);
  double squares = 0.0;
  for (std::size_t i = 0; i < one.size(); ++i) {
    squares += std::pow(static_cast<double>(one[i]) - static_cast<double>(dim[i]), 2) / 900.0;
  }
  EXPECT_NEAR(std::sqrt(squares), 0.2 * 0.645, 0.1 * 0.2 * 0.645);
  EXPECT_FALSE(OutputChain::make(settings, {size, origin.window_px, 50.0}).has_value())
      << "kelvin need a band";
}

TEST(OutputChain, TheQuantityIsMadeLast) {
  const ImageSize size{8, 4};
  scene::SpectralBand band{"3-5", 3.0, 5.0, {}};
  const OutputChain::Origin origin{size, {0, 0, 8, 4}, 0.0, band};
  // A picture of blackbodies.
  const std::vector<double> kelvin{160.0, 230.0, 300.0, 310.5, 400.0, 900.0, 2500.0, 2999.0};
  std::vector<float> image;
  for (int row = 0; row < 4; ++row) {
    for (const double one : kelvin) {
      image.push_back(static_cast<float>(
          physics::band_radiance({3.0, 5.0, {}}, physics::Kelvin(one)).radiance_w_m2_sr));
    }
  }
  image[8] = 0.0F;
  image[9] = 1e6F;
  scene::ChannelOutput settings;
  settings.quantity = scene::PictureQuantity::apparent_temperature;
  auto chain = OutputChain::make(settings, origin);
  ASSERT_TRUE(chain.has_value());
  EXPECT_EQ(chain->quantity(), protocol::PixelQuantity::temperature_k);
  EXPECT_EQ(chain->steps(), 0);
  std::vector<float> out(image.size());
  EXPECT_EQ(chain->apply(image, {}, out), 2U) << "nothing is colder than the table, or hotter";
  for (std::size_t i = 0; i < kelvin.size(); ++i) EXPECT_NEAR(out[i], kelvin[i], 0.02);
  settings.quantity = scene::PictureQuantity::photon_radiance;
  auto photons = OutputChain::make(settings, origin);
  ASSERT_TRUE(photons.has_value());
  EXPECT_EQ(photons->quantity(), protocol::PixelQuantity::photon_radiance);
  EXPECT_EQ(photons->apply(image, {}, out), 0U);
  // A photon of 5 um has 3.9729e-20 J.
  EXPECT_NEAR(out[2] / (image[2] / 3.9728917e-20F), 1.0F, 1e-6F);
  EXPECT_FALSE(OutputChain::make(settings, {size, {0, 0, 8, 4}, 0.0}).has_value());
}

TEST(OutputChain, FaultsOfFilesAreNamed) {
  OutputFiles folder;
  const auto error_of = [](const scene::ChannelOutput& settings) {
    auto chain = OutputChain::make(settings, {kImage, kWindow, 0.0});
    return chain ? std::string("none") : chain.error().text;
  };
  const auto constant = [](double value) { return [value](double, double) { return value; }; };
  scene::ChannelOutput map;
  map.distortion_file = folder.exr("x_only.exr", {5, 4}, {{"x", constant(1.0)}});
  EXPECT_NE(error_of(map).find("x_only.exr: channel 'y' is missing"), std::string::npos)
      << error_of(map);
  map.distortion_file =
      folder.exr("nowhere.exr", {5, 4}, {{"x", constant(-1.0)}, {"y", constant(1.0)}});
  EXPECT_NE(error_of(map).find("nowhere.exr: no pixel points into the picture of 5 x 4"),
            std::string::npos)
      << error_of(map);
  map.distortion_file = folder.folder().path() / "missing.exr";
  EXPECT_NE(error_of(map).find("distortion_file: "), std::string::npos) << error_of(map);
  scene::ChannelOutput nuc;
  nuc.nuc_file =
      folder.exr("small.exr", {4, 4}, {{"gain", constant(1.0)}, {"offset", constant(0.0)}});
  EXPECT_NE(error_of(nuc).find("small.exr: 4 x 4 pixels, but the frames of the channel have 5 x 4"),
            std::string::npos)
      << error_of(nuc);
  nuc.nuc_file = folder.exr("gain.exr", {5, 4}, {{"gain", constant(1.0)}});
  EXPECT_NE(error_of(nuc).find("gain.exr: channel 'offset' is missing"), std::string::npos);
  nuc.nuc_file =
      folder.exr("negative.exr", {5, 4},
                 {{"gain", [](double x, double y) { return x == 3.5 && y == 2.5 ? -1.0 : 1.0; }},
                  {"offset", constant(0.0)}});
  EXPECT_NE(error_of(nuc).find("'gain' is -1 at column 3, row 2; it must be 0 or more"),
            std::string::npos)
      << error_of(nuc);
  nuc.nuc_file =
      folder.exr("inf.exr", {5, 4}, {{"gain", constant(1.0)}, {"offset", constant(INFINITY)}});
  EXPECT_NE(error_of(nuc).find("'offset' is inf at column 0, row 0; it must be finite"),
            std::string::npos)
      << error_of(nuc);
}

}  // namespace
}  // namespace emit::server
