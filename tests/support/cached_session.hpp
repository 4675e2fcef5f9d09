// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/physics/foster.hpp"
#include "emit/renderer/renderer.hpp"
#include "history/foster_history.hpp"
#include "support/renderer_scene.hpp"
#include "support/times.hpp"

/// Scenarios of the thermal method "cached" with the extended model, and a renderer that shows
/// them.
namespace emit::test {

inline constexpr std::int64_t kHourNs = 3600 * kSecondNs;
using physics::kReferenceK;
inline constexpr std::uint32_t kWidth = 96;
inline constexpr std::uint32_t kHeight = 80;

inline physics::Pose looking(const glm::dvec3& from, const glm::dvec3& at) {
  return {from, physics::world_from_body_look_at(from, at)};
}

/// Scenario around one static file with the method "cached", the extended model and layered ground.
inline scene::ScenarioDesc cached_scenario(const std::filesystem::path& gltf) {
  scene::ScenarioDesc s = instant_scenario(gltf);
  s.weather.clear();
  s.materials[0].layers = {{0.15, 0.7, 2120, 920}, {0.3, 1.5, 2000, 950}, {1.55, 1.2, 1900, 1158}};
  s.materials[0].base_k = 286.15;
  s.sensor.width_px = kWidth;
  s.sensor.height_px = kHeight;
  s.thermal.method = scene::ThermalMethod::cached;
  s.thermal.model = scene::ThermalModel::foster;
  s.thermal.spin_up_ns = 48 * kHourNs;
  s.thermal.steps = 27;
  s.thermal.spacing = scene::StepSpacing::geometric;
  s.thermal.lateral = false;
  return s;
}

/// Unit vector towards the sun at a sim time in seconds.
inline glm::dvec3 to_sun(const scene::ScenarioDesc& scenario, double seconds) {
  return renderer::Environment(scenario).sun_at(std::llround(seconds * 1e9)).direction_enu;
}

/// Renderer of one scenario. Only one session may exist at a time, because each has a context of
/// its own that is current in this thread.
class Session {
 public:
  explicit Session(const scene::ScenarioDesc& scenario, renderer::OutputOptions output = {}) {
    output.temperature = true;
    auto made = renderer::Renderer::create(scenario, {}, output);
    if (made) {
      renderer_ = std::move(*made);
    } else {
      ADD_FAILURE() << made.error().text;
    }
  }
  /// Renders a frame at a quality level and returns its temperatures by pixel, K; NaN for sky.
  [[nodiscard]] std::vector<float> frame_k(std::int64_t sim_time_ns, const physics::Pose& pose,
                                           std::uint8_t quality_level = 0) {
    renderer::FrameRequest request;
    request.quality_level = quality_level;
    request.sim_time_ns = request.thermal_time_ns = sim_time_ns;
    request.sensor_pose = pose;
    const int slot = renderer_->submit(request);
    const auto& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot));
    EXPECT_FALSE(view.device_failed);
    EXPECT_EQ(view.stats.nonfinite_px, 0U);
    std::vector<float> out(view.temperature_k.begin(), view.temperature_k.end());
    objects_.assign(view.object_id.begin(), view.object_id.end());
    coarse_ = view.stats.coarse.any();
    renderer_->release(static_cast<renderer::SlotIndex>(slot));
    return out;
  }
  /// Objects of the latest frame by pixel: 1 + index of the object, 0 for sky.
  [[nodiscard]] const std::vector<float>& objects() const { return objects_; }
  /// True when the latest frame is flagged as coarse.
  [[nodiscard]] bool coarse() const { return coarse_; }
  [[nodiscard]] renderer::Renderer& renderer() { return *renderer_; }

 private:
  std::unique_ptr<renderer::Renderer> renderer_;
  std::vector<float> objects_;
  bool coarse_ = false;
};

/// Interval in which the sun does not shine, sim time.
struct Shade {
  double begin_s = 0.0;
  double end_s = 0.0;
};

/// Function that changes the forcing of the ground from the start of the history on.
using Screen = std::function<void(renderer::SurfaceForcing&)>;

/// Thermal model in double for level ground that sees the whole sky and the sun, in steps that are
/// short compared with every change. The constructor integrates up to `begin_ns`, with `screen`
/// applied.
class OpenGround {
 public:
  OpenGround(scene::ScenarioDesc s, std::span<const scene::WeatherSample> told,
             std::int64_t begin_ns, const Screen& screen = {})
      : scenario_(finely(std::move(s))), environment_(scenario_), at_ns_(begin_ns) {
    for (const scene::WeatherSample& sample : told) EXPECT_TRUE(environment_.append(sample));
    renderer::StepPlan plan(scenario_.thermal);
    plan.update(begin_ns, environment_, {});
    history_.update(plan, environment_);
    x_ = history_.spun_up(0, kUp);
    for (const renderer::IntervalForcing& interval : history_.tail()) advance(interval);
    for (renderer::IntervalForcing interval : history_.intervals()) {
      if (screen) screen(interval.begin);
      if (screen) screen(interval.end);
      advance(interval);
    }
  }

  /// Integrates up to `until_ns` in one interval.
  void go_on(std::int64_t until_ns, const Screen& screen = {}) {
    renderer::IntervalForcing interval = history_.extend(at_ns_, until_ns, environment_);
    if (screen) screen(interval.begin);
    if (screen) screen(interval.end);
    advance(interval);
    at_ns_ = until_ns;
  }
  [[nodiscard]] std::int64_t at_ns() const { return at_ns_; }
  [[nodiscard]] double temperature_k() const {
    return kReferenceK + physics::foster_offset_k(x_, surface_);
  }

 private:
  static constexpr glm::dvec3 kUp{0.0, 0.0, 1.0};

  static scene::ScenarioDesc finely(scene::ScenarioDesc s) {
    s.thermal.tolerance_k = 1e-3;
    s.thermal.steps = 512;
    return s;
  }
  void advance(const renderer::IntervalForcing& interval) {
    const double offset_k = physics::foster_offset_k(x_, surface_);
    physics::foster_advance(
        x_, unshadowed_drive(interval.begin, material_, kUp, kReferenceK, offset_k),
        unshadowed_drive(interval.end, material_, kUp, kReferenceK, offset_k),
        physics::foster_ladder(interval.dt_s, material_.network), surface_, 1e-3);
  }

  scene::ScenarioDesc scenario_;
  renderer::Environment environment_;
  std::vector<renderer::FosterMaterial> materials_ =
      *renderer::foster_materials(scenario_.materials, scenario_.thermal);
  renderer::FosterMaterial material_ = materials_.front();
  renderer::FosterHistory history_{scenario_, materials_, material_, environment_, kReferenceK};
  physics::FosterSurface<double> surface_ = physics::foster_surface(
      material_.network, material_.emissivity_frac, material_.base_k, kReferenceK);
  physics::FosterState<double> x_;
  std::int64_t at_ns_ = 0;
};

/// Temperature of open ground at `now_ns` under the scenario's weather, changed by `shade` and
/// `screen`.
inline double open_ground_k(const scene::ScenarioDesc& s, std::int64_t now_ns,
                            std::optional<Shade> shade = std::nullopt, const Screen& screen = {}) {
  OpenGround ground(s, {}, shade ? std::llround(shade->begin_s * 1e9) : now_ns, screen);
  if (shade) {
    ground.go_on(std::llround(shade->end_s * 1e9),
                 [](renderer::SurfaceForcing& forcing) { forcing.sun_w_m2 = glm::dvec3(0.0); });
    ground.go_on(now_ns);
  }
  return ground.temperature_k();
}

/// Largest difference between two images and its 99th percentile, K. A pixel that is sky in only
/// one of them counts as 1e9.
struct Difference {
  double max_k = 0.0;
  double p99_k = 0.0;
};
inline Difference difference(const std::vector<float>& a, const std::vector<float>& b) {
  std::vector<double> errors;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (std::isnan(a[i]) != std::isnan(b[i])) {
      errors.push_back(1e9);
    } else if (!std::isnan(a[i])) {
      errors.push_back(std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
    }
  }
  std::ranges::sort(errors);
  if (errors.empty()) return {1e9, 1e9};
  return {errors[errors.size() - 1], errors[errors.size() * 99 / 100]};
}

/// Ground that consists of squares. Small squares provide samples for shade that comes after the
/// warm-up.
inline std::vector<Quad> fine_ground(double half_m, double square_m) {
  std::vector<Quad> quads;
  const int squares = static_cast<int>(std::lround(2.0 * half_m / square_m));
  const glm::dvec3 x(square_m, 0.0, 0.0);
  const glm::dvec3 y(0.0, square_m, 0.0);
  for (int i = 0; i < squares; ++i) {
    for (int j = 0; j < squares; ++j) {
      const glm::dvec3 low(square_m * i - half_m, square_m * j - half_m, 0.0);
      quads.push_back({low, low + x, low + x + y, low + y});
    }
  }
  return quads;
}

/// File with a box on the ground.
inline std::filesystem::path box_on_ground() {
  auto quads = box({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0});
  quads.push_back(ground(12.0, 12.0));
  return write_quads("box", quads);
}

/// Scenario of ground and a box that stands on it until `leaves_ns`.
inline scene::ScenarioDesc parking_lot(std::int64_t leaves_ns) {
  scene::ScenarioDesc s = cached_scenario(write_quads("lot", {ground(14.0, 14.0)}));
  park_vehicle(s, leaves_ns);
  return s;
}

}  // namespace emit::test
