// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <filesystem>
#include <numbers>
#include <string>
#include <vector>

#include "emit/physics/planck.hpp"
#include "history/foster_setup.hpp"
#include "support/cached_session.hpp"

/// Materials that vary from place to place, against solves of their own materials, closed forms and
/// pictures of finer pixels.
namespace emit {
namespace {

using test::kHeight;
using test::kHourNs;
using test::kReferenceK;
using test::kSecondNs;
using test::kWidth;

double radiance(double kelvin) {
  return physics::band_radiance({8.0, 12.0, {}}, physics::Kelvin(kelvin)).radiance_w_m2_sr;
}

/// Variation of 0.05 in absorptance and a factor of sqrt 2 in inertia per standard deviation.
scene::Clutter both() {
  scene::Clutter out;
  out.shortest_m = 1.0;
  out.longest_m = 8.0;
  out.solar_absorptance_sd_frac = 0.05;
  out.inertia_sd_ln = 0.5 * std::log(2.0);
  return out;
}

scene::ScenarioDesc varied_ground(const scene::Clutter& clutter, double half_m = 40.0) {
  scene::ScenarioDesc s =
      test::cached_scenario(test::write_quads("varied", {test::ground(half_m, half_m)}));
  s.materials[0].clutter = clutter;
  s.sensor.fov_h_rad = 0.02;
  return s;
}

physics::Pose from_above(double x_m, double y_m, double up_m) {
  return {{x_m, y_m, up_m},
          physics::world_from_body_heading_pitch_roll(0.0, -0.5 * physics::kPi, 0.0)};
}

/// A frame with what its clutter adds.
struct Picture {
  std::vector<float> kelvin;
  std::vector<float> radiance_w_m2_sr;
  std::vector<float> sd;
  std::vector<float> shift_k;
  std::vector<float> variance_k2;
  double terms_w_m2_sr = 0.0;  ///< sum of the terms of the pixel in the middle
};

class Eye {
 public:
  explicit Eye(const scene::ScenarioDesc& scenario) {
    renderer::OutputOptions output;
    output.temperature = output.depth = output.sun = output.sky = output.terms = true;
    output.ladder = renderer::Ladder::replayed;
    auto made = renderer::Renderer::create(scenario, {}, output);
    if (made) {
      renderer_ = std::move(*made);
    } else {
      ADD_FAILURE() << made.error().text;
    }
  }
  Picture show(std::int64_t time_ns, const physics::Pose& pose, std::uint8_t level = 0) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = time_ns;
    request.sensor_pose = pose;
    request.quality_level = level;
    const int slot = renderer_->submit(request);
    const auto& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot));
    EXPECT_FALSE(view.device_failed);
    EXPECT_EQ(view.stats.nonfinite_px, 0U);
    const auto copy = [](std::span<const float> plane) {
      return std::vector<float>(plane.begin(), plane.end());
    };
    Picture out{copy(view.temperature_k), copy(view.radiance_w_m2_sr[0]), copy(view.clutter_sd),
                copy(view.clutter_k), copy(view.clutter_variance_k2)};
    const glm::uvec2 px(kWidth / 2, kHeight / 2);
    for (const renderer::RadianceTerms& terms : renderer_->radiance_terms(view, px, 1.0)) {
      out.terms_w_m2_sr = terms.sum_w_m2_sr();
    }
    renderer_->release(static_cast<renderer::SlotIndex>(slot));
    return out;
  }
  [[nodiscard]] renderer::Renderer& renderer() { return *renderer_; }

 private:
  std::unique_ptr<renderer::Renderer> renderer_;
};

double mean(const std::vector<float>& values) {
  double sum = 0.0;
  for (const float value : values) sum += value;
  return sum / static_cast<double>(values.size());
}
double rms_about_mean(const std::vector<float>& values) {
  const double middle = mean(values);
  double sum = 0.0;
  for (const float value : values) sum += std::pow(value - middle, 2);
  return std::sqrt(sum / static_cast<double>(values.size()));
}

TEST(Clutter, TexelsHaveTheTemperatureThatASolveOfTheirOwnMaterialGives) {
  const scene::ScenarioDesc s = varied_ground(both());
  // Solve 13 materials over a day.
  std::vector<std::vector<double>> solved_k;
  constexpr int kMaterials = 13;
  constexpr double kMostSd = 3.2;
  const auto sd_of = [](int m) { return kMostSd * (2.0 * m / (kMaterials - 1) - 1.0); };
  std::vector<std::int64_t> times_ns;
  for (int hour = 2; hour <= 24; hour += 4) times_ns.push_back(hour * kHourNs);
  for (int m = 0; m < kMaterials; ++m) {
    scene::ScenarioDesc own = s;
    own.materials[0] = renderer::material_at(s.materials[0], sd_of(m));
    std::vector<double> course_k;
    for (const std::int64_t time_ns : times_ns) {
      course_k.push_back(test::open_ground_k(own, time_ns));
    }
    solved_k.push_back(course_k);
  }
  std::vector<double> errors_k;
  double most_spread_k = 0.0;
  Eye eye(s);
  for (std::size_t t = 0; t < times_ns.size(); ++t) {
    const Picture seen = eye.show(times_ns[t], from_above(3.0, -2.0, 400.0));
    for (std::size_t i = 0; i < seen.kelvin.size(); ++i) {
      const double place = (seen.sd[i] / kMostSd + 1.0) * 0.5 * (kMaterials - 1);
      const int m = std::clamp(static_cast<int>(place), 0, kMaterials - 2);
      const double own_k = std::lerp(solved_k[static_cast<std::size_t>(m)][t],
                                     solved_k[static_cast<std::size_t>(m) + 1][t], place - m);
      errors_k.push_back(std::abs(seen.kelvin[i] - own_k));
      most_spread_k = std::max(most_spread_k, std::abs(double{seen.shift_k[i]}));
    }
  }
  std::ranges::sort(errors_k);
  const double p95_k = errors_k[errors_k.size() * 95 / 100];
  RecordProperty("p95_k", std::to_string(p95_k));
  RecordProperty("max_k", std::to_string(errors_k.back()));
  RecordProperty("most_spread_k", std::to_string(most_spread_k));
  EXPECT_LT(p95_k, 0.3);
  EXPECT_LT(errors_k.back(), 2.0);
  EXPECT_GT(most_spread_k, 4.0);
}

TEST(Clutter, PicturesShowAFieldOfVarianceOneThatStaysOnTheGround) {
  scene::Clutter clutter = both();
  clutter.longest_m = 4.0;
  Eye eye(varied_ground(clutter, 60.0));
  // 1000 m above, a picture is 20 m wide.
  const Picture here = eye.show(2 * kHourNs, from_above(0.0, 0.0, 2000.0));
  EXPECT_NEAR(mean(here.sd), 0.0, 0.25);
  EXPECT_NEAR(rms_about_mean(here.sd), 0.9, 0.2);
  // A camera that has moved by ten pixels to the north shows the same places ten rows lower.
  const double pixel_m = 2000.0 * 2.0 * std::tan(0.01) / kWidth;
  const Picture there = eye.show(2 * kHourNs, from_above(0.0, 10.0 * pixel_m, 2000.0));
  double most = 0.0;
  for (std::size_t y = 0; y + 10 < kHeight; ++y) {
    for (std::size_t x = 0; x < kWidth; ++x) {
      const double off = here.kelvin[y * kWidth + x] - there.kelvin[(y + 10) * kWidth + x];
      most = std::max(most, std::abs(off));
    }
  }
  EXPECT_LT(most, 0.05);
}

/// RMS of the field in the largest circle of a picture. A roll of the camera about the middle keeps
/// the ground in it.
double rms_in_circle(const std::vector<float>& values) {
  std::vector<float> within;
  for (std::size_t y = 0; y < kHeight; ++y) {
    for (std::size_t x = 0; x < kWidth; ++x) {
      const double right = static_cast<double>(x) + 0.5 - 0.5 * kWidth;
      const double down = static_cast<double>(y) + 0.5 - 0.5 * kHeight;
      if (std::hypot(right, down) < 0.5 * kHeight) within.push_back(values[y * kWidth + x]);
    }
  }
  return rms_about_mean(within);
}

TEST(Clutter, KeepsItsContrastHoweverTheSensorRolls) {
  scene::Clutter clutter = both();
  clutter.shortest_m = 0.05;
  clutter.longest_m = 0.8;
  Eye eye(varied_ground(clutter, 400.0));
  // A pixel at 7 degrees is eight times as long as it is wide.
  const auto rolled = [&](double roll_deg) {
    const physics::Pose pose{{0.0, -245.0, 30.0},
                             physics::world_from_body_heading_pitch_roll(
                                 0.0, -7.0 * physics::kDegree, roll_deg * physics::kDegree)};
    return rms_in_circle(eye.show(2 * kHourNs, pose).sd);
  };
  const double upright = rolled(0.0);
  EXPECT_GT(upright, 0.1);
  for (const double roll_deg : {20.0, 45.0, 70.0, 90.0, 135.0}) {
    EXPECT_NEAR(rolled(roll_deg) / upright, 1.0, 0.05) << roll_deg;
  }
}

TEST(Clutter, WithoutSunOnlyTheEmissivityMatters) {
  scene::Clutter clutter = both();
  clutter.inertia_sd_ln = 0.0;
  scene::ScenarioDesc s = varied_ground(clutter);
  s.weather = {test::weather(0.0, 0.0, 300.0, 285.0)};
  {
    const Picture seen = Eye(s).show(2 * kHourNs, from_above(0.0, 0.0, 400.0));
    const auto [low, high] = std::ranges::minmax(seen.kelvin);
    EXPECT_LT(high - low, 2e-3F);
  }
  s.materials[0].clutter->solar_absorptance_sd_frac = 0.0;
  s.materials[0].clutter->emissivity_sd_frac = 0.01;
  const Picture seen = Eye(s).show(2 * kHourNs, from_above(0.0, 0.0, 400.0));
  const auto [low, high] = std::ranges::minmax(seen.kelvin);
  EXPECT_GT(high - low, 0.1F);
}

TEST(Clutter, AClosedFurnaceShowsNone) {
  // Air, sky, ground and its base have one temperature, so emissivity and inertia do not show.
  constexpr double kOvenK = 300.0;
  scene::Clutter clutter = both();
  clutter.solar_absorptance_sd_frac = 0.0;
  clutter.emissivity_sd_frac = 0.01;
  scene::ScenarioDesc s = varied_ground(clutter);
  s.weather = {test::weather(0.0, 0.0, 5.670374419e-8 * std::pow(kOvenK, 4), kOvenK)};
  s.weather[0].air_k = kOvenK;
  s.materials[0].base_k = kOvenK;
  s.materials[0].initial_k = kOvenK;
  const Picture seen = Eye(s).show(2 * kHourNs, from_above(0.0, 0.0, 400.0));
  for (const float kelvin : seen.kelvin) ASSERT_NEAR(kelvin, kOvenK, 5e-3);
}

TEST(Clutter, PixelsAverageRadianceAndNotTemperature) {
  scene::Clutter clutter = both();
  clutter.solar_absorptance_sd_frac = 0.1;
  clutter.inertia_sd_ln = 0.0;
  clutter.shortest_m = 0.05;
  clutter.longest_m = 0.8;
  // Each pixel of the far picture covers some 2.5 m, and 150 of the near one a wavelength.
  scene::ScenarioDesc s = varied_ground(clutter, 150.0);
  s.sensor.fov_h_rad = 0.02;
  Eye eye(s);
  const Picture far = eye.show(2 * kHourNs, from_above(0.0, 0.0, 10000.0));
  double near_w_m2_sr = 0.0;
  double near_k = 0.0;
  double near_variance_k2 = 0.0;
  int pictures = 0;
  for (double x_m = -4.0; x_m <= 4.0; x_m += 2.0) {
    for (double y_m = -4.0; y_m <= 4.0; y_m += 2.0) {
      const Picture near = eye.show(2 * kHourNs, from_above(x_m, y_m, 95.0));
      near_w_m2_sr += mean(near.radiance_w_m2_sr);
      near_k += mean(near.kelvin);
      near_variance_k2 += std::pow(rms_about_mean(near.kelvin), 2);
      ++pictures;
    }
  }
  near_w_m2_sr /= pictures;
  near_k /= pictures;
  near_variance_k2 /= pictures;
  EXPECT_GT(near_variance_k2, 4.0);
  EXPECT_NEAR(mean(far.variance_k2), near_variance_k2, 0.15 * near_variance_k2);
  EXPECT_NEAR(mean(far.kelvin), near_k, 0.1);
  // A kelvin squared of variance raises the mean radiance by L'' / 2 L, some 1.1e-4 in 8 to 12 um.
  const double of_mean_k = radiance(near_k);
  const double excess = near_w_m2_sr / of_mean_k;
  const double far_excess = mean(far.radiance_w_m2_sr) / radiance(mean(far.kelvin));
  // Both share emissivity and reflection, so their difference is that of the averaging alone, which
  // is 4e-4 at least.
  EXPECT_NEAR(far_excess, excess, 1e-4);
}

TEST(Clutter, MovesWithTheCameraWithoutTwinkling) {
  // Take a row of the picture at shifts of an eighth of a pixel: together they are the row of a
  // camera that moves. What varies faster than once per pixel is twinkling.
  for (const auto& [up_m, pitch_deg] : {std::pair{2000.0, 90.0}, {20000.0, 90.0}, {400.0, 8.0}}) {
    scene::Clutter clutter = both();
    clutter.shortest_m = 0.5;
    scene::ScenarioDesc s = varied_ground(clutter, 4000.0);
    s.sensor.fov_h_rad = 0.02;
    Eye eye(s);
    const double pitch = pitch_deg * physics::kPi / 180.0;
    const double range_m = up_m / std::sin(pitch);
    const double pixel_m = range_m * 2.0 * std::tan(0.01) / kWidth;
    constexpr int kShifts = 8;
    std::vector<double> fine(kWidth * kShifts);
    for (int shift = 0; shift < kShifts; ++shift) {
      // The camera looks to the north; east is right.
      const glm::dvec3 from_m(pixel_m * shift / kShifts, -range_m * std::cos(pitch), up_m);
      const Picture seen = eye.show(
          2 * kHourNs, {from_m, physics::world_from_body_heading_pitch_roll(0.0, -pitch, 0.0)});
      for (std::size_t x = 0; x < kWidth; ++x) {
        fine[x * kShifts + static_cast<std::size_t>(shift)] = seen.kelvin[kHeight / 2 * kWidth + x];
      }
    }
    // The contrast is that of a picture from near by.
    const double contrast_k =
        rms_about_mean(eye.show(2 * kHourNs, from_above(0.0, 0.0, 500.0)).shift_k);
    EXPECT_GT(contrast_k, 0.3);
    // Window the row, and take its power above one wave per pixel.
    const std::size_t n = fine.size();
    double middle = 0.0;
    for (const double value : fine) middle += value / static_cast<double>(n);
    double fast = 0.0;
    for (std::size_t k = kWidth; k < n / 2; ++k) {
      std::complex<double> sum = 0.0;
      for (std::size_t i = 0; i < n; ++i) {
        const double turn =
            2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n);
        const double window = 0.5 - 0.5 * std::cos(turn);
        sum += window * (fine[i] - middle) * std::polar(1.0, -turn * static_cast<double>(k));
      }
      fast += 2.0 * std::norm(sum / static_cast<double>(n));
    }
    constexpr double kOfWindow = 3.0 / 8.0;  // mean square
    const double twinkle = std::sqrt(fast / kOfWindow) / contrast_k;
    RecordProperty("twinkle_" + std::to_string(static_cast<int>(up_m)), std::to_string(twinkle));
    EXPECT_LT(twinkle, 0.01) << up_m;
  }
}

TEST(Clutter, TermsAddUpToThePixel) {
  scene::Clutter clutter = both();
  clutter.shortest_m = 0.05;
  clutter.longest_m = 1.0;
  clutter.band_emissivity_sd_frac = {{"8-12", 0.01}};
  const Picture seen = Eye(varied_ground(clutter)).show(2 * kHourNs, from_above(0.0, 0.0, 2000.0));
  const std::size_t i = std::size_t{kHeight / 2} * kWidth + kWidth / 2;
  EXPECT_GT(seen.variance_k2[i], 0.1F);
  EXPECT_NEAR(seen.terms_w_m2_sr, seen.radiance_w_m2_sr[i], 1e-5 * seen.radiance_w_m2_sr[i]);
}

TEST(Clutter, StateFileGivesTheSamePicture) {
  scene::ScenarioDesc s = varied_ground(both());
  s.thermal.state_file = std::filesystem::path(::testing::TempDir()) / "clutter.state";
  std::filesystem::remove(s.thermal.state_file);
  const physics::Pose pose = from_above(0.0, 0.0, 400.0);
  const Picture first = Eye(s).show(2 * kHourNs, pose);
  ASSERT_TRUE(std::filesystem::exists(s.thermal.state_file));
  const Picture second = Eye(s).show(2 * kHourNs, pose);
  EXPECT_EQ(first.kelvin, second.kelvin);
  // Another variation is another surface.
  s.materials[0].clutter->inertia_sd_ln = 0.1;
  Eye other(s);
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = 2 * kHourNs;
  request.sensor_pose = pose;
  const auto warm = other.renderer().warm_up(request, [](double) { return true; });
  ASSERT_FALSE(warm);
  EXPECT_NE(warm.error().text.find("materials"), std::string::npos) << warm.error().text;
  std::filesystem::remove(s.thermal.state_file);
}

TEST(Clutter, MaterialsOfOneFieldShareItAndTooManyFieldsAreRefused) {
  scene::ScenarioDesc s = varied_ground(both(), 2.0);
  constexpr std::size_t kMaterials = 12;
  while (s.materials.size() < kMaterials) {
    const auto number = static_cast<double>(s.materials.size());
    s.materials.push_back(s.materials.front());
    s.materials.back().name = "varied " + std::to_string(s.materials.size());
    s.materials.back().clutter->inertia_sd_ln = 0.01 * number;
    s.objects.push_back(s.objects.front());
    s.objects.back().name = s.objects.back().material = s.materials.back().name;
    s.objects.back().instances.front().position_world_m = {10.0 * number, 0.0, 0.0};
  }
  {
    const auto shared = renderer::Renderer::create(s, {}, {});
    EXPECT_TRUE(shared) << shared.error().text;
  }
  for (std::size_t m = 0; m < kMaterials; ++m) s.materials[m].clutter->seed = 100 + m;
  const auto refused = renderer::Renderer::create(s, {}, {});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().text.find("12 different fields: 8 are possible"), std::string::npos)
      << refused.error().text;
}

TEST(Clutter, ShadeThatCameAndWentLeavesWhatAWarmUpLeaves) {
  // A vehicle leaves; the clutter of its print goes on in short steps.
  scene::Clutter clutter = both();
  clutter.shortest_m = 0.25;
  clutter.longest_m = 4.0;
  scene::ScenarioDesc s = test::parking_lot(2 * kHourNs + 30 * kSecondNs);
  s.materials[0].clutter = clutter;
  const physics::Pose pose = test::looking({6.0, -8.0, 7.0}, {0.0, 0.0, 0.0});
  const std::int64_t end_ns = 2 * kHourNs + 400 * kSecondNs;
  std::vector<float> went_on_k;
  {
    Eye eye(s);
    for (std::int64_t at_ns = 2 * kHourNs; at_ns <= end_ns; at_ns += 4 * kSecondNs) {
      went_on_k = eye.show(at_ns, pose).kelvin;
    }
  }
  const Picture anew = Eye(s).show(end_ns, pose);
  const test::Difference off = test::difference(went_on_k, anew.kelvin);
  EXPECT_LT(off.p99_k, 0.3);
  double most = 0.0;
  for (const float shift_k : anew.shift_k) most = std::max(most, std::abs(double{shift_k}));
  EXPECT_GT(most, 2.0);
}

}  // namespace
}  // namespace emit
