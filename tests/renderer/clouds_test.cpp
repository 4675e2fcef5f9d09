// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "emit/physics/planck.hpp"
#include "emit/physics/sky_state.hpp"
#include "emit/reference/cloud_sun.hpp"
#include "emit/reference/solve.hpp"
#include "emit/reference/surface_forcing.hpp"
#include "emit/scene/mesh.hpp"
#include "history/cloud_shade.hpp"
#include "support/cached_session.hpp"
#include "surface/state/state_file.hpp"

/// Broken clouds against closed forms, fine solves with the same sun, and the uniform sky of the
/// same cover.
namespace emit {
namespace {

using test::kHeight;
using test::kHourNs;
using test::kSecondNs;
using test::kWidth;

constexpr glm::dvec3 kUpward{0.0, 0.0, 1.0};

/// Open ground under clouds that drift at 10 m/s, with a history of two hours.
scene::ScenarioDesc clouded_ground(double cover_frac = 0.5) {
  scene::ScenarioDesc s =
      test::cached_scenario(test::write_quads("clouded", {test::ground(20.0, 20.0)}));
  physics::Clouds clouds;
  clouds.cover_frac = cover_frac;
  clouds.base_m = 1000.0;
  clouds.transmission_frac = 0.1;
  clouds.shortest_m = 150.0;
  clouds.longest_m = 1500.0;
  clouds.drift_m_s = 10.0;
  clouds.drift_from_rad = 1.5 * physics::kPi;
  s.clouds = clouds;
  s.clear_sky.cloud_frac = clouds.cover_frac;
  s.clear_sky.cloud_transmission_frac = clouds.transmission_frac;
  s.clear_sky.cloud_base.height_m = clouds.base_m;
  s.thermal.history_start_ns = 0;
  s.thermal.steps = 40;
  s.thermal.first_step_s = 5.0;
  return s;
}

/// Direct sun at a place of the ground by the mean, in closed form but for the texels of the field.
double sun_by_mean(const renderer::Environment& environment, const glm::dvec2& at_m,
                   std::int64_t time_ns) {
  const physics::CloudField& field = *environment.clouds();
  const physics::SunPosition sun = environment.sun_at(time_ns);
  const glm::dvec2 away_m =
      field.clouds().base_m / sun.direction_enu.z * glm::dvec2(sun.direction_enu);
  // They come from the west.
  const glm::dvec2 drift_m(1e-9 * static_cast<double>(time_ns) * field.clouds().drift_m_s, 0.0);
  const double opacity = field.opacity_frac(field.tile_at(at_m + away_m - drift_m, 0), 0.0);
  return environment.cloud_light(environment.forcing_at(time_ns, sun), sun).by_mean(opacity);
}

class SkyEye {
 public:
  explicit SkyEye(const scene::ScenarioDesc& scenario) {
    renderer::OutputOptions output;
    output.temperature = output.depth = output.sun = output.sky = output.terms = true;
    auto made = renderer::Renderer::create(scenario, {}, output);
    if (made) {
      renderer_ = std::move(*made);
    } else {
      ADD_FAILURE() << made.error().text;
    }
  }
  struct Shown {
    std::vector<float> kelvin;
    std::vector<float> sun_cosine;
    std::vector<float> clouds;
    std::vector<float> depth_m;
    std::vector<float> radiance_w_m2_sr;
    double terms_w_m2_sr = 0.0;  ///< sum of the terms of the pixel in the middle
  };
  Shown show(std::int64_t time_ns, const physics::Pose& pose) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = time_ns;
    request.sensor_pose = pose;
    const int slot = renderer_->submit(request);
    const auto& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot));
    EXPECT_FALSE(view.device_failed);
    EXPECT_EQ(view.stats.nonfinite_px, 0U);
    const auto copy = [](std::span<const float> plane) {
      return std::vector<float>(plane.begin(), plane.end());
    };
    Shown out{copy(view.temperature_k), copy(view.sun_cosine), copy(view.clouds),
              copy(view.depth_m), copy(view.radiance_w_m2_sr[0])};
    out.terms_w_m2_sr =
        renderer_->radiance_terms(view, {kWidth / 2, kHeight / 2}, 1.0)[0].sum_w_m2_sr();
    renderer_->release(static_cast<renderer::SlotIndex>(slot));
    return out;
  }

 private:
  std::unique_ptr<renderer::Renderer> renderer_;
};

constexpr std::size_t kMiddlePx = kHeight / 2 * kWidth + kWidth / 2;

double mean_of(const std::vector<float>& values) {
  double sum = 0.0;
  for (const float value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

TEST(CloudShade, OfAShortIntervalIsTheFieldWhereTheSunsRayMeetsTheLayer) {
  const scene::ScenarioDesc s = clouded_ground();
  const renderer::Environment environment(s);
  renderer::CloudShade shade;
  double least = 2.0;
  double most = 0.0;
  for (int k = 0; k < 200; ++k) {
    const std::int64_t at_ns = kHourNs + k * 7 * kSecondNs;
    shade.update(at_ns, at_ns, environment, {100.0, -50.0, 0.0});
    const glm::vec3 place(3.0F * static_cast<float>(k), 40.0F, 0.0F);
    const double wanted =
        sun_by_mean(environment, glm::dvec2(place) + glm::dvec2(100.0, -50.0), at_ns);
    // The round Earth shifts the crossing by less than a metre here.
    EXPECT_NEAR(shade.by_mean(place), wanted, 0.08) << k;
    least = std::min(least, wanted);
    most = std::max(most, wanted);
  }
  EXPECT_LT(least, 0.3);
  EXPECT_GT(most, 1.5);
  // Above the layer nothing shades.
  shade.update(kHourNs, kHourNs, environment, {0.0, 0.0, 0.0});
  EXPECT_NEAR(shade.by_mean({0.0F, 0.0F, 1200.0F}), most, 0.02);
}

TEST(CloudShade, OfALongIntervalIsTheMeanOverIt) {
  const scene::ScenarioDesc s = clouded_ground();
  const renderer::Environment environment(s);
  renderer::CloudShade shade;
  double most_off = 0.0;
  double instants_off = 0.0;
  for (const std::int64_t length_s : {30, 300, 1200, 3600}) {
    for (int k = 0; k < 12; ++k) {
      const std::int64_t begin_ns = kHourNs / 2 + k * 400 * kSecondNs;
      const std::int64_t end_ns = begin_ns + length_s * kSecondNs;
      shade.update(begin_ns, end_ns, environment, glm::dvec3(0.0));
      const glm::dvec2 at_m(25.0 * k, -60.0 * k);
      double mean = 0.0;
      constexpr int kInstants = 4000;
      for (int i = 0; i < kInstants; ++i) {
        const double way = (i + 0.5) / kInstants;
        mean += sun_by_mean(environment, at_m,
                            begin_ns + std::llround(way * static_cast<double>(end_ns - begin_ns))) /
                kInstants;
      }
      const double off = std::abs(shade.by_mean({glm::vec2(at_m), 0.0F}) - mean);
      most_off = std::max(most_off, off);
      instants_off = std::max(
          instants_off, std::abs(sun_by_mean(environment, at_m, (begin_ns + end_ns) / 2) - mean));
    }
  }
  RecordProperty("most_off", std::to_string(most_off));
  std::printf("mean of an interval: off by %.4f, its middle instant by %.4f\n", most_off,
              instants_off);
  EXPECT_LT(most_off, 0.04);
  EXPECT_GT(instants_off, 0.5);
}

TEST(CloudShade, OfTheReferenceIsThatOfTheFieldToo) {
  const scene::ScenarioDesc s = clouded_ground();
  const renderer::Environment environment(s);
  const reference::CloudSun reference(s);
  for (int k = 0; k < 100; ++k) {
    const std::int64_t at_ns = kHourNs + k * 31 * kSecondNs;
    const physics::SunPosition sun = environment.sun_at(at_ns);
    const physics::Forcing forcing = environment.forcing_at(at_ns, sun);
    EXPECT_NEAR(reference.by_mean({20.0 * k, 5.0 * k, 0.0}, sun.direction_enu,
                                  forcing.direct_normal_w_m2 * (1.0 - forcing.cloud_frac), at_ns),
                sun_by_mean(environment, {20.0 * k, 5.0 * k}, at_ns), 0.08)
        << k;
  }
}

TEST(Clouds, ASampleUnderThemIsAsWarmAsAFineSolveWithTheSameSunSays) {
  const scene::ScenarioDesc s = clouded_ground();
  const renderer::Environment environment(s);
  const auto pose = test::looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0});
  // Follow the history in steps of 5 s, from the same start.
  test::OpenGround fine(s, {}, 60 * kSecondNs);
  const auto fine_k = [&](std::int64_t until_ns) {
    while (fine.at_ns() < until_ns) {
      const std::int64_t next_ns = std::min(until_ns, fine.at_ns() + 5 * kSecondNs);
      double sun = 0.0;
      for (int i = 0; i < 5; ++i) {
        sun += 0.2 * sun_by_mean(environment, {0.0, 0.0},
                                 fine.at_ns() + (next_ns - fine.at_ns()) * (2 * i + 1) / 10);
      }
      fine.go_on(next_ns, [sun](renderer::SurfaceForcing& f) { f.sun_w_m2 *= sun; });
    }
    return fine.temperature_k();
  };
  test::Session run(s);
  double most_off_k = 0.0;
  double most_step_k = 0.0;
  double low_k = 1e9;
  double high_k = 0.0;
  double last_k = 0.0;
  for (std::int64_t now_ns = 2 * kHourNs; now_ns <= 2 * kHourNs + 600 * kSecondNs;
       now_ns += kSecondNs) {
    const double is_k = run.frame_k(now_ns, pose)[kMiddlePx];
    if (last_k > 0.0) most_step_k = std::max(most_step_k, std::abs(is_k - last_k));
    last_k = is_k;
    low_k = std::min(low_k, is_k);
    high_k = std::max(high_k, is_k);
    if ((now_ns / kSecondNs) % 10 == 0) {
      most_off_k = std::max(most_off_k, std::abs(is_k - fine_k(now_ns)));
    }
  }
  std::printf("under clouds: %.2f K of change, off by %.3f K, %.3f K between frames of a second\n",
              high_k - low_k, most_off_k, most_step_k);
  EXPECT_GT(high_k - low_k, 1.0);
  EXPECT_LT(most_off_k, 0.02);
  EXPECT_LT(most_step_k, 0.13);
}

/// The same with modes that were fitted to the layers.
scene::ScenarioDesc clouded_asphalt() {
  scene::ScenarioDesc s = clouded_ground();
  s.materials[0].foster_modes = {{19.3031, 0.00463643411}, {224.801, 0.0080299192},
                                 {1442.54, 0.0187879342},  {8691.61, 0.0429072841},
                                 {51066.2, 0.153045271},   {1.6917e+06, 1.47854554}};
  return s;
}

TEST(Clouds, TheSunOfTheReferenceHeatsTheGroundAsMuch) {
  const scene::ScenarioDesc s = clouded_asphalt();
  scene::ScenarioDesc even = s;
  even.clouds.reset();
  const auto climate = reference::SurfaceClimate::create(
      s, {.end_ns = 2 * kHourNs, .step_s = 30.0, .spin_up_ns = {}, .mesh = {}, .steps = {}});
  ASSERT_TRUE(climate.has_value());
  const auto reference_sun = [&](std::int64_t time_ns) {
    return climate->cloud_sun(climate->at(time_ns), glm::dvec3(0.0));
  };
  const std::vector<std::int64_t> times_ns{kHourNs / 2, kHourNs, 3 * kHourNs / 2, 2 * kHourNs};
  // Drive the renderer's network by the sun of the reference, in steps of 2 s.
  test::OpenGround fine(even, {}, kSecondNs);
  std::vector<double> network_k;
  for (const std::int64_t until_ns : times_ns) {
    while (fine.at_ns() < until_ns) {
      const std::int64_t next_ns = std::min(until_ns, fine.at_ns() + 2 * kSecondNs);
      const double sun = reference_sun((fine.at_ns() + next_ns) / 2);
      fine.go_on(next_ns, [sun](renderer::SurfaceForcing& f) { f.sun_w_m2 *= sun; });
    }
    network_k.push_back(fine.temperature_k());
  }
  // Drive the layers themselves by it.
  std::vector<reference::ViewSample> views;
  for (std::int64_t t = 0; t <= 2 * kHourNs; t += 2 * kSecondNs) {
    reference::ViewSample view = reference::open_view(kUpward);
    view.time_ns = t;
    view.sun_frac = reference_sun(t);
    views.push_back(view);
  }
  const auto layers_k = reference::point_history(*climate, s.materials[0], s.thermal.initial_k,
                                                 kUpward, views, times_ns);
  ASSERT_TRUE(layers_k.has_value());
  double most_off_k = 0.0;
  double layers_square_k2 = 0.0;
  for (std::size_t i = 0; i < times_ns.size(); ++i) {
    test::Session run(s);
    const double is_k =
        run.frame_k(times_ns[i], test::looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0}))[kMiddlePx];
    std::printf("under clouds: %.3f K, network %.3f K, layers %.3f K\n", is_k, network_k[i],
                (*layers_k)[i]);
    most_off_k = std::max(most_off_k, std::abs(is_k - network_k[i]));
    layers_square_k2 += std::pow(is_k - (*layers_k)[i], 2.0) / static_cast<double>(times_ns.size());
  }
  EXPECT_LT(most_off_k, 0.012);
  // Six modes stand for the layers.
  EXPECT_LT(std::sqrt(layers_square_k2), 0.2);
}

TEST(Clouds, TheirShadeLiesInThePictureWhereTheReferenceHasIt) {
  scene::ScenarioDesc s = clouded_ground();
  s.objects[0].gltf = test::write_quads("wide", {test::ground(2000.0, 2000.0)});
  s.sensor.fov_h_rad = 0.8;
  const renderer::Environment environment(s);
  const reference::CloudSun reference(s);
  SkyEye eye(s);
  const physics::Pose pose = test::looking({150.0, -300.0, 600.0}, {0.0, 0.0, 0.0});
  const std::int64_t begin_ns = 2 * kHourNs;
  for (const std::int64_t passed_s : {0, 60, 150}) {
    const std::int64_t at_ns = begin_ns + passed_s * kSecondNs;
    const auto shown = eye.show(at_ns, pose);
    const physics::SunPosition sun = environment.sun_at(at_ns);
    const physics::Forcing forcing = environment.forcing_at(at_ns, sun);
    const double mean_w_m2 = forcing.direct_normal_w_m2 * (1.0 - forcing.cloud_frac);
    // Shift the points to all sides as well: the errors say where the shade lies.
    constexpr double kShiftM = 20.0;
    const std::array<glm::dvec2, 5> shifts_m{glm::dvec2(0.0), glm::dvec2(kShiftM, 0.0),
                                             glm::dvec2(-kShiftM, 0.0), glm::dvec2(0.0, kShiftM),
                                             glm::dvec2(0.0, -kShiftM)};
    std::array<double, 5> square{};
    int count = 0;
    for (std::uint32_t y = 0; y < kHeight; ++y) {
      for (std::uint32_t x = 0; x < kWidth; ++x) {
        const std::size_t px = std::size_t{y} * kWidth + x;
        const double depth_m = static_cast<double>(shown.depth_m[px]);
        if (!std::isfinite(depth_m)) continue;
        const glm::dvec3 point_m = test::world_point(s.sensor, pose, x, y, depth_m);
        ++count;
        for (std::size_t k = 0; k < shifts_m.size(); ++k) {
          const double wanted = reference.by_mean(point_m + glm::dvec3(shifts_m[k], 0.0),
                                                  sun.direction_enu, mean_w_m2, at_ns);
          square[k] += std::pow(static_cast<double>(shown.clouds[px]) - wanted, 2.0);
        }
      }
    }
    ASSERT_GT(count, 3000);
    const auto rms = [&](std::size_t k) { return std::sqrt(square[k] / count); };
    // The lowest point of the parabola through three errors is the place of the best fit.
    const auto best_m = [&](std::size_t plus, std::size_t minus) {
      return 0.5 * kShiftM * (square[minus] - square[plus]) /
             (square[minus] + square[plus] - 2.0 * square[0]);
    };
    std::printf("shade in the picture: off by %.4f of the mean sun, and by %.2f m, %.2f m\n",
                rms(0), best_m(1, 2), best_m(3, 4));
    EXPECT_LT(rms(0), 1e-3);
    EXPECT_NEAR(best_m(1, 2), 0.0, 0.5);
    EXPECT_NEAR(best_m(3, 4), 0.0, 0.5);
    for (std::size_t k = 1; k < shifts_m.size(); ++k) EXPECT_GT(rms(k), 0.1) << k;
  }
}

TEST(Clouds, ReflectedSunlightHasTheShadeOfTheInstant) {
  const scene::ScenarioDesc s = clouded_ground();
  const renderer::Environment environment(s);
  SkyEye eye(s);
  const auto pose = test::looking({0.0, -0.01, 12.0}, {0.0, 0.0, 0.0});
  for (int k = 0; k < 20; ++k) {
    const std::int64_t at_ns = 2 * kHourNs + k * 9 * kSecondNs;
    const auto shown = eye.show(at_ns, pose);
    const double wanted = sun_by_mean(environment, {0.0, 0.0}, at_ns);
    EXPECT_NEAR(shown.clouds[kMiddlePx], wanted, 0.1);
    EXPECT_NEAR(shown.sun_cosine[kMiddlePx],
                shown.clouds[kMiddlePx] * environment.sun_at(at_ns).direction_enu.z, 2e-3);
    EXPECT_NEAR(shown.terms_w_m2_sr, shown.radiance_w_m2_sr[kMiddlePx], 1e-4 * shown.terms_w_m2_sr);
  }
}

/// Clouds of the built-in air, and the same sky without structure.
scene::ScenarioDesc clouded_air(double cover_frac) {
  scene::ScenarioDesc s = clouded_ground(cover_frac);
  scene::BandAtmosphere air;
  air.band = s.bands[0].name;
  air.model = physics::AirSpec{};
  s.atmosphere.enabled = true;
  s.atmosphere.bands = {air};
  return s;
}

TEST(Clouds, TheSkyOverheadIsCoveredAsMuchAsAsked) {
  scene::ScenarioDesc s = clouded_air(0.35);
  s.sensor.fov_h_rad = 2.0;
  SkyEye eye(s);
  // Look up, while many clouds pass.
  const physics::Pose up{{0.0, 0.0, 2.0},
                         physics::world_from_body_heading_pitch_roll(0.0, 0.5 * physics::kPi, 0.0)};
  double cover = 0.0;
  constexpr int kSkies = 24;
  for (int k = 0; k < kSkies; ++k) {
    const auto shown = eye.show(2 * kHourNs + k * 500 * kSecondNs, up);
    cover += mean_of(shown.clouds) / kSkies;
    EXPECT_NEAR(shown.terms_w_m2_sr, shown.radiance_w_m2_sr[kMiddlePx], 1e-4 * shown.terms_w_m2_sr);
    for (const float value : shown.kelvin) ASSERT_TRUE(std::isnan(value));
  }
  EXPECT_NEAR(cover, 0.35, 0.05);
}

TEST(Clouds, TheMeanOfTheSkyIsThatOfAnEvenSkyOfTheSameCover) {
  // A field so fine that every pixel shows its mean leaves the even sky of the picture.
  scene::ScenarioDesc s = clouded_air(0.4);
  s.clouds->shortest_m = 20.0;
  s.clouds->longest_m = 40.0;
  s.clouds->base_m = 3000.0;
  s.clear_sky.cloud_base.height_m = 3000.0;
  s.sensor.fov_h_rad = 2.9;
  SkyEye eye(s);
  const physics::Pose up{{0.0, 0.0, 2.0},
                         physics::world_from_body_heading_pitch_roll(0.0, 0.5 * physics::kPi, 0.0)};
  const auto shown = eye.show(2 * kHourNs, up);
  scene::ScenarioDesc even = s;
  even.clouds.reset();
  SkyEye even_eye(even);
  const auto flat = even_eye.show(2 * kHourNs, up);
  // Compare means over the hemisphere that the picture holds, by the projected solid angle.
  double sum = 0.0;
  double even_sum = 0.0;
  double weights = 0.0;
  const double per_px = 2.0 * std::tan(1.45) / kWidth;
  for (std::uint32_t y = 0; y < kHeight; ++y) {
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      const double tan_x = (x + 0.5 - 0.5 * kWidth) * per_px;
      const double tan_y = (y + 0.5 - 0.5 * kHeight) * per_px;
      const double weight = std::pow(1.0 + tan_x * tan_x + tan_y * tan_y, -2.0);
      sum += weight * shown.radiance_w_m2_sr[y * kWidth + x];
      even_sum += weight * flat.radiance_w_m2_sr[y * kWidth + x];
      weights += weight;
    }
  }
  std::printf("mean of the sky: %.4f, of the even one %.4f W m-2 sr-1\n", sum / weights,
              even_sum / weights);
  EXPECT_NEAR(sum / even_sum, 1.0, 0.015);
}

TEST(Clouds, TheSkyOfTheReferenceIsTheSameWithAndWithoutThem) {
  for (const bool structure : {true, false}) {
    scene::ScenarioDesc s = clouded_air(0.4);
    s.bands = {{"3-5", 3.0, 5.0, {}}};
    s.atmosphere.bands[0].band = "3-5";
    if (!structure) s.clouds.reset();
    s.sensor.fov_h_rad = 0.6;
    const physics::Pose up{
        {0.0, 0.0, 2.0}, physics::world_from_body_heading_pitch_roll(0.0, 0.5 * physics::kPi, 0.0)};
    const auto shown = SkyEye(s).show(2 * kHourNs, up);
    const auto geometry = scene::load_scene(s);
    ASSERT_TRUE(geometry.has_value()) << geometry.error().text;
    const reference::SolveView view{.sim_time_ns = 2 * kHourNs,
                                    .sensor_pose = up,
                                    .width_px = kWidth,
                                    .height_px = kHeight,
                                    .fov_h_rad = s.sensor.fov_h_rad};
    reference::SolveOptions options;
    options.dimension = reference::SolveDimension::one;
    options.rays = 16;
    const auto solved = reference::solve(s, *geometry, std::span(&view, 1), options);
    ASSERT_TRUE(solved.has_value()) << solved.error().text;
    const std::vector<float>& wanted = solved->front().radiance_w_m2_sr[0];
    ASSERT_EQ(wanted.size(), shown.radiance_w_m2_sr.size());
    double most_off_frac = 0.0;
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      const auto w = static_cast<double>(wanted[i]);
      most_off_frac =
          std::max(most_off_frac, std::abs(static_cast<double>(shown.radiance_w_m2_sr[i]) - w) / w);
    }
    std::printf("sky %s: off by %.2f %% of the reference\n",
                structure ? "of clouds" : "of even cover", 100.0 * most_off_frac);
    // Pixels along edges of clouds show a mean, rays of the reference a point.
    EXPECT_LT(most_off_frac, structure ? 0.026 : 1e-3);
  }
}

TEST(Clouds, ChangeTheKeyOfAStateFile) {
  const scene::ScenarioDesc s = clouded_ground();
  const scene::SceneGeometry geometry;
  const renderer::StateKey key = renderer::scenario_key(s, geometry);
  scene::ScenarioDesc other = s;
  other.clouds->seed = 5;
  EXPECT_NE(renderer::scenario_key(other, geometry), key);
  other = s;
  other.clouds->drift_m_s += 0.1;
  EXPECT_NE(renderer::scenario_key(other, geometry), key);
  other.clouds.reset();
  EXPECT_NE(renderer::scenario_key(other, geometry), key);
}

TEST(Clouds, ALateStartShowsTheSameCloudsBitByBit) {
  const scene::ScenarioDesc s = clouded_air(0.4);
  const physics::Pose pose = test::looking({0.0, -30.0, 2.0}, {0.0, 0.0, 12.0});
  std::vector<float> first;
  {
    SkyEye eye(s);
    (void)eye.show(2 * kHourNs, pose);
    first = eye.show(2 * kHourNs + 40 * kSecondNs, pose).clouds;
  }
  SkyEye late(s);
  const std::vector<float> again = late.show(2 * kHourNs + 40 * kSecondNs, pose).clouds;
  ASSERT_EQ(first.size(), again.size());
  EXPECT_EQ(std::memcmp(first.data(), again.data(), first.size() * sizeof(float)), 0);
}

}  // namespace
}  // namespace emit
