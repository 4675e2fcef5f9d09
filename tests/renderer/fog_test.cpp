// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "emit/physics/clear_sky.hpp"
#include "emit/physics/planck.hpp"
#include "emit/physics/sky/fog.hpp"
#include "emit/reference/solve.hpp"
#include "emit/scene/mesh.hpp"
#include "support/cached_session.hpp"

/// Fog in the picture, against closed forms without air and against the reference with air.
namespace emit {
namespace {

using test::kHeight;
using test::kHourNs;
using test::kWidth;

constexpr double kAirK = 285.0;
constexpr double kGroundK = 292.0;
constexpr std::int64_t kDayNs = 3 * kHourNs;
constexpr std::int64_t kNightNs = 16 * kHourNs;
const std::array<physics::Band, 2> kBands{{{3.0, 5.0, {}}, {8.0, 12.0, {}}}};

double black(std::size_t band, double kelvin) {
  return physics::band_radiance(kBands.at(band), physics::Kelvin(kelvin)).radiance_w_m2_sr;
}

/// Ground that is black unless stated, with a box on it, and no air.
scene::ScenarioDesc foggy(const std::optional<physics::Fog>& fog, double emissivity_frac = 1.0) {
  std::vector<test::Quad> quads = test::box({-3.0, 60.0, 0.0}, {3.0, 66.0, 5.0});
  quads.push_back(test::ground(6000.0, 6000.0));
  scene::ScenarioDesc s = test::cached_scenario(test::write_quads("foggy", quads));
  s.bands = {{"3-5", 3.0, 5.0, {}}, {"8-12", 8.0, 12.0, {}}};
  s.weather = {test::weather(600.0, 100.0, 300.0, kAirK)};
  s.materials[0].prescribed_k = kGroundK;
  s.materials[0].emissivity_frac = emissivity_frac;
  s.materials[0].band_emissivity = {{"3-5", emissivity_frac}, {"8-12", emissivity_frac}};
  s.atmosphere.enabled = true;
  s.atmosphere.fog = fog;
  return s;
}

/// The same with the built-in air below a clear sky.
scene::ScenarioDesc foggy_air(const std::optional<physics::Fog>& fog, double emissivity_frac) {
  scene::ScenarioDesc s = foggy(fog, emissivity_frac);
  for (const auto& band : s.bands) {
    scene::BandAtmosphere air;
    air.band = band.name;
    air.model = physics::AirSpec{physics::AirClimate::us_standard, 23.0, 1.0};
    s.atmosphere.bands.push_back(air);
  }
  s.weather.clear();
  s.clear_sky.air_mean_k = kAirK;
  s.clear_sky.air_amplitude_k = 0.0;
  s.clear_sky.dew_point_k = 278.0;
  if (fog) s.clear_sky.fog = physics::fog_shade(*fog);
  return s;
}

struct Frame {
  std::array<std::vector<float>, 2> radiance;
  std::vector<float> depth_m;
  double worst_terms = 0.0;  ///< largest relative difference of a pixel from its terms
};

class Eye {
 public:
  explicit Eye(const scene::ScenarioDesc& scenario) : sensor_(scenario.sensor) {
    renderer::OutputOptions output;
    output.temperature = output.depth = output.sun = output.sky = output.terms = true;
    auto made = renderer::Renderer::create(scenario, {}, output);
    if (made) {
      renderer_ = std::move(*made);
    } else {
      ADD_FAILURE() << made.error().text;
    }
  }
  Frame show(const physics::Pose& pose, std::int64_t time_ns) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = time_ns;
    request.sensor_pose = pose;
    const int slot = renderer_->submit(request);
    const auto& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot));
    EXPECT_FALSE(view.device_failed);
    EXPECT_EQ(view.stats.nonfinite_px, 0U);
    Frame out;
    for (std::size_t b = 0; b < out.radiance.size(); ++b) {
      out.radiance[b].assign(view.radiance_w_m2_sr[b].begin(), view.radiance_w_m2_sr[b].end());
    }
    out.depth_m.assign(view.depth_m.begin(), view.depth_m.end());
    for (std::uint32_t y = 1; y < kHeight; y += 6) {
      for (std::uint32_t x = 1; x < kWidth; x += 6) {
        const auto terms = renderer_->radiance_terms(view, {x, y}, 1.0);
        for (std::size_t b = 0; b < terms.size(); ++b) {
          const double shown = out.radiance[b][y * kWidth + x];
          out.worst_terms =
              std::max(out.worst_terms, std::abs(terms[b].sum_w_m2_sr() / shown - 1.0));
        }
      }
    }
    renderer_->release(static_cast<renderer::SlotIndex>(slot));
    return out;
  }
  /// Vector from the camera to what a pixel shows; of length 1 for the sky.
  [[nodiscard]] glm::dvec3 ray(const physics::Pose& pose, const Frame& frame,
                               std::size_t pixel) const {
    const double depth_m = frame.depth_m[pixel];
    const glm::dvec3 to =
        test::world_point(sensor_, pose, static_cast<std::uint32_t>(pixel % kWidth),
                          static_cast<std::uint32_t>(pixel / kWidth),
                          std::isinf(depth_m) ? 1.0 : depth_m) -
        pose.position_world_m;
    return std::isinf(depth_m) ? glm::normalize(to) : to;
  }

 private:
  scene::SensorDesc sensor_;
  std::unique_ptr<renderer::Renderer> renderer_;
};

/// Cameras in the fog, above it, and below a level that a target rises through.
std::vector<physics::Pose> cameras() {
  return {test::looking({0.0, 0.0, 3.0}, {0.0, 100.0, 6.0}),
          test::looking({0.0, -80.0, 120.0}, {0.0, 100.0, 0.0}),
          test::looking({0.0, -200.0, 300.0}, {0.0, 3000.0, 250.0})};
}

TEST(FogPicture, EveryPixelWithoutAirIsItsClosedForm) {
  const physics::Fog fog{physics::FogKind::heavy_radiation, 250.0, 40.0};
  Eye eye(foggy(fog));
  for (const physics::Pose& pose : cameras()) {
    const Frame frame = eye.show(pose, kNightNs);
    EXPECT_LT(frame.worst_terms, 1e-5);
    for (std::size_t b = 0; b < kBands.size(); ++b) {
      // There is no sky without air, and no sun at night.
      const auto light =
          physics::fog_light(physics::fog_optics(fog, kBands.at(b)), fog.top_m,
                             {.black_w_m2_sr = black(b, kAirK), .ground_w_m2_sr = black(b, kAirK)});
      double worst = 0.0;
      for (std::size_t i = 0; i < frame.depth_m.size(); i += 7) {
        const bool sky = std::isinf(frame.depth_m[i]);
        const glm::dvec3 ray = eye.ray(pose, frame, i);
        const double range_m = sky ? physics::kFogFarM : glm::length(ray);
        const double sine = ray.z / glm::length(ray);
        const double above_m = fog.top_m - pose.position_world_m.z;
        const auto in = physics::fog_stretch(above_m, sine, range_m);
        const double per_m = sky ? light.wide_per_m : light.extinction_per_m;
        const double expected =
            (sky ? 0.0 : std::exp(-per_m * in.length_m) * black(b, kGroundK)) +
            physics::fog_glow_w_m2_sr(light, per_m, std::max(above_m, 0.0), sine, in.length_m);
        worst = std::max(worst, std::abs(frame.radiance[b][i] - expected) / black(b, kAirK));
      }
      EXPECT_LT(worst, 1e-4) << b << ' ' << pose.position_world_m.z;
    }
  }
}

TEST(FogPicture, ThickFogIsABlackbodyAndThinFogIsNothing) {
  // Amid deep fog everything has the radiance of the air's temperature, also by day.
  {
    Eye eye(foggy_air(physics::Fog{physics::FogKind::heavy_advection, 20.0, 800.0}, 0.8));
    const Frame frame = eye.show(test::looking({0.0, 0.0, 400.0}, {0.0, 100.0, 380.0}), kNightNs);
    for (std::size_t b = 0; b < kBands.size(); ++b) {
      for (std::size_t i = 0; i < frame.radiance[b].size(); i += 11) {
        ASSERT_NEAR(frame.radiance[b][i] / black(b, kAirK), 1.0, 1e-4) << b;
      }
    }
  }
  std::array<std::vector<Frame>, 2> frames;
  for (const bool fog : {false, true}) {
    Eye eye(foggy_air(fog ? std::optional(physics::Fog{physics::FogKind::maritime_haze, 1e12, 40.0})
                          : std::nullopt,
                      0.8));
    for (const physics::Pose& pose : cameras()) frames.at(fog).push_back(eye.show(pose, kDayNs));
  }
  for (std::size_t c = 0; c < frames[0].size(); ++c) {
    for (std::size_t b = 0; b < kBands.size(); ++b) {
      for (std::size_t i = 0; i < frames[0][c].radiance[b].size(); i += 5) {
        // A ray that just misses the horizon stays in the fog for long.
        const double clear = frames[0][c].radiance[b][i];
        ASSERT_NEAR(frames[1][c].radiance[b][i], clear, 2e-4 * clear) << c << ' ' << b << ' ' << i;
      }
    }
  }
}

TEST(FogPicture, IsThatOfTheReferenceByDayAndNight) {
  for (const auto& [fog, time_ns] :
       {std::pair{physics::Fog{physics::FogKind::moderate_radiation, 400.0, 30.0}, kDayNs},
        std::pair{physics::Fog{physics::FogKind::heavy_advection, 150.0, 100.0}, kNightNs}}) {
    const scene::ScenarioDesc scenario = foggy_air(fog, 0.85);
    const auto geometry = scene::load_scene(scenario);
    ASSERT_TRUE(geometry) << geometry.error().text;
    std::vector<reference::SolveView> views;
    for (const physics::Pose& pose : cameras()) {
      views.push_back({time_ns, pose, kWidth, kHeight, scenario.sensor.fov_h_rad});
    }
    reference::SolveOptions options;
    options.dimension = reference::SolveDimension::one;
    options.rays = 16;
    options.pixels = 400;
    const auto solved = reference::solve(scenario, *geometry, views, options);
    ASSERT_TRUE(solved) << solved.error().text;
    Eye eye(scenario);
    for (std::size_t c = 0; c < views.size(); ++c) {
      const Frame frame = eye.show(views[c].sensor_pose, time_ns);
      EXPECT_LT(frame.worst_terms, 1e-5) << c;
      for (std::size_t b = 0; b < kBands.size(); ++b) {
        double sum = 0.0;
        double count = 0.0;
        for (std::size_t i = 0; i < frame.radiance[b].size(); ++i) {
          const double truth = (*solved)[c].radiance_w_m2_sr[b][i];
          if (!std::isfinite(truth)) continue;
          if (std::isinf(frame.depth_m[i]) != std::isinf((*solved)[c].depth_m[i])) continue;
          sum += std::pow(frame.radiance[b][i] / truth - 1.0, 2);
          count += 1.0;
        }
        ASSERT_GT(count, 100.0);
        EXPECT_LT(std::sqrt(sum / count), 0.006) << c << ' ' << b << ' ' << time_ns;
      }
    }
  }
}

TEST(FogPicture, WeakensSmallTargetsAndFlaresAsItDoesSurfaces) {
  constexpr double kEyeUpM = 1000.0;
  constexpr double kPlateUpM = 300.0;
  const physics::Fog fog{physics::FogKind::moderate_radiation, 3000.0, 700.0};
  const physics::Pose pose{
      {0.0, 0.0, kEyeUpM},
      physics::world_from_body_heading_pitch_roll(0.0, -0.5 * physics::kPi, 0)};
  // Sum up what a hot plate or a flare adds to the picture.
  const auto added = [&](const std::optional<physics::Fog>& layer, bool flare, double limit_px) {
    std::array<double, 2> sums{};
    std::array<Frame, 2> frames;
    for (const bool hot : {false, true}) {
      scene::ScenarioDesc s = foggy(layer);
      s.sensor.fov_h_rad = 0.05;
      s.sensor.small_target_px = limit_px;
      scene::Material plate = s.materials[0];
      plate.name = "plate";
      plate.prescribed_k = hot && !flare ? 450.0 : kGroundK;
      s.materials.push_back(plate);
      scene::ObjectDesc object = s.objects.front();
      object.name = object.material = "plate";
      object.gltf = test::write_quads("plate", {test::ground(0.5, 0.5)}, true);
      object.entity_id = 7;
      object.scale = flare ? 0.001 : 2.0;
      object.instances.front().position_world_m = {0.3, 0.2, kPlateUpM};
      s.objects.push_back(object);
      if (flare && hot) {
        scene::FlareDesc burning;
        burning.object = "plate";
        burning.intensity_w_sr = {{"3-5", 100.0}, {"8-12", 300.0}};
        burning.radius_m = 1.0;
        burning.rise_s = 0.0;
        burning.burn_s = 1e5;
        s.gas.flares.push_back(burning);
      }
      frames.at(hot) = Eye(s).show(pose, kNightNs);
      EXPECT_LT(frames.at(hot).worst_terms, 1e-5);
    }
    for (std::size_t b = 0; b < sums.size(); ++b) {
      for (std::size_t i = 0; i < frames[0].radiance[b].size(); ++i) {
        sums.at(b) += frames[1].radiance[b][i] - frames[0].radiance[b][i];
      }
    }
    return sums;
  };
  for (const auto& [flare, limit_px] : {std::pair{false, 0.0}, {false, 32.0}, {true, 32.0}}) {
    const auto clear = added(std::nullopt, flare, limit_px);
    const auto hazy = added(fog, flare, limit_px);
    for (std::size_t b = 0; b < kBands.size(); ++b) {
      const double per_m = physics::fog_optics(fog, kBands.at(b)).extinction_per_m;
      EXPECT_NEAR(hazy.at(b) / clear.at(b), std::exp(-per_m * (fog.top_m - kPlateUpM)), 3e-3)
          << flare << ' ' << limit_px << ' ' << b;
    }
  }
}

}  // namespace
}  // namespace emit
