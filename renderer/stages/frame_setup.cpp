// SPDX-License-Identifier: Apache-2.0
#include "stages/frame_setup.hpp"

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

#include "emit/physics/relaxation.hpp"
#include "emit/physics/surface_balance.hpp"

namespace emit::renderer {
namespace {

// Frusta never widen by more than this for filter taps: with the sun near the horizon shadows of
// tall casters blur over hundreds of metres, and their flux is next to nothing.
constexpr double kMaxMarginM = 50.0;

glm::vec4 vec4_from(const glm::dvec3& v, double w) noexcept {
  return glm::vec4(static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z),
                   static_cast<float>(w));
}

glm::vec4 sun_vector(const physics::SunPosition& sun, const physics::Forcing& forcing) noexcept {
  const double flux_w_m2 =
      sun.elevation.value() > 0.0 ? forcing.direct_normal_w_m2 * (1.0 - forcing.cloud_frac) : 0.0;
  return vec4_from(sun.direction_enu, flux_w_m2);
}

glm::vec4 flux_vector(const physics::Forcing& forcing) noexcept {
  return glm::vec4(static_cast<float>(physics::diffuse_input_w_m2(forcing.diffuse_horizontal_w_m2)),
                   static_cast<float>(physics::longwave_input_w_m2(forcing.longwave_down_w_m2,
                                                                   forcing.environment_k)),
                   static_cast<float>(physics::environment_input_w_m2(1.0, forcing.environment_k)),
                   0.0F);
}

}  // namespace

LightFrusta set_step(const HistoryInterval& interval, const CameraSetup& camera,
                     const scene::ThermalOptions& options, bool first, bool last,
                     std::uint32_t relaxation_offset, gpu::StepParams& params) noexcept {
  params.sun_start = sun_vector(interval.sun_begin, interval.forcing_begin);
  params.sun_end = sun_vector(interval.sun_end, interval.forcing_end);
  params.flux_start = flux_vector(interval.forcing_begin);
  params.flux_end = flux_vector(interval.forcing_end);
  std::uint32_t flags = 0;
  if (first) flags |= EMIT_STEP_FIRST;
  if (last) flags |= EMIT_STEP_SUN_NOW;
  params.info = glm::uvec4(0, relaxation_offset, flags, 0);
  params.casters = glm::vec4(0.0F);

  LightFrusta frusta;
  if (!interval.sun_up) return frusta;
  const glm::dvec3 to_sun = interval.sun_sample.direction_enu;
  const glm::dvec3 drift = interval.sun_end.direction_enu - interval.sun_begin.direction_enu;
  const double top_m = std::max(camera.view.scene_max_m.z, camera.view.casters_max_m.z);
  const double height_m = top_m - camera.view.scene_min_m.z;
  const double margin_m =
      std::min(kMaxMarginM, height_m / to_sun.z *
                                (std::tan(physics::kSunSemiAngleRad) + 0.5 * glm::length(drift)));
  // Without frusta (nothing in view) the sun shines unobstructed.
  params.info.z |= EMIT_STEP_SUN_UP;
  frusta = fit_light(camera.view, to_sun, options.shadow_map_px, options.max_cascades, margin_m,
                     camera.pixel_rad);
  if (frusta.count == 0) return frusta;

  for (std::uint32_t c = 0; c < frusta.count; ++c) {
    const LightFrustum& frustum = frusta.cascades[c];
    gpu::CascadeParams& cascade = params.cascades[c];
    cascade.light_row0 = vec4_from(frustum.axes[0], frustum.offset_m.x);
    cascade.light_row1 = vec4_from(frustum.axes[1], frustum.offset_m.y);
    cascade.light_row2 = vec4_from(frustum.axes[2], frustum.offset_m.z);
    cascade.scale = vec4_from(1.0 / frustum.extent_m, frustum.end_boresight_m);
    cascade.drift = glm::vec4(static_cast<float>(glm::dot(drift, frustum.axes[0])),
                              static_cast<float>(glm::dot(drift, frustum.axes[1])), 0.0F, 0.0F);
  }
  params.casters = glm::vec4(static_cast<float>(top_m), static_cast<float>(to_sun.z), 0.0F, 0.0F);
  params.info.x = frusta.count;
  return frusta;
}

HistoryInterval instant_interval(const StepPlan& plan, std::int64_t sim_time_ns) noexcept {
  HistoryInterval now;
  now.begin_ns = now.end_ns = now.sample_ns = sim_time_ns;
  now.sun_begin = now.sun_sample = now.sun_end = plan.sun_now();
  now.forcing_begin = now.forcing_end = plan.forcing_now();
  now.sun_up = plan.sun_now().elevation.value() > StepPlan::kMinSunElevationRad;
  return now;
}

gpu::TapParams shadow_taps(std::uint32_t blocker_taps, std::uint32_t filter_taps) noexcept {
  constexpr double kGoldenAngleRad = 2.399963229728653;
  constexpr double kGoldenFrac = 0.6180339887498949;
  gpu::TapParams params{};
  const auto fill = [](glm::vec4* out, std::uint32_t count) {
    for (std::uint32_t i = 0; i < count && i < EMIT_MAX_TAPS; ++i) {
      const double radius = std::sqrt((i + 0.5) / count);
      const double place = (i + 0.5) * kGoldenFrac;
      out[i] = glm::vec4(static_cast<float>(radius * std::cos(kGoldenAngleRad * i)),
                         static_cast<float>(radius * std::sin(kGoldenAngleRad * i)),
                         static_cast<float>(place - std::floor(place) - 0.5),
                         static_cast<float>(std::pow((i + 0.5) / count, 2)));
    }
  };
  fill(params.blocker, blocker_taps);
  fill(params.filter_, filter_taps);
  return params;
}

void set_foster_forcing(const IntervalForcing& forcing, double reference_k,
                        gpu::StepParams& params) noexcept {
  const auto sun = [](const SurfaceForcing& f) {
    const double flux_w_m2 = glm::length(f.sun_w_m2);
    const glm::dvec3 up(0.0, 0.0, 1.0);
    return vec4_from(flux_w_m2 > 0.0 ? f.sun_w_m2 / flux_w_m2 : up, flux_w_m2);
  };
  const auto flux = [](const SurfaceForcing& f) {
    return glm::vec4(static_cast<float>(f.diffuse_w_m2), static_cast<float>(f.longwave_w_m2),
                     static_cast<float>(f.reflected_w_m2), static_cast<float>(f.environment_w_m2));
  };
  params.sun_start = sun(forcing.begin);
  params.sun_end = sun(forcing.end);
  params.flux_start = flux(forcing.begin);
  params.flux_end = flux(forcing.end);
  params.film_air = glm::vec4(static_cast<float>(forcing.begin.film_w_m2_k),
                              static_cast<float>(forcing.begin.air_k - reference_k),
                              static_cast<float>(forcing.end.film_w_m2_k),
                              static_cast<float>(forcing.end.air_k - reference_k));
}

void set_foster_gains(double dt_s, std::span<const FosterMaterial> materials,
                      std::span<gpu::RelaxationParams> params) noexcept {
  static_assert(EMIT_FOSTER_LEVELS == physics::kMaxFosterLevel);
  const auto narrow = [](const physics::FosterState<double>& x) {
    return glm::vec4(static_cast<float>(x[0]), static_cast<float>(x[1]), static_cast<float>(x[2]),
                     static_cast<float>(x[3]));
  };
  for (std::size_t m = 0; m < materials.size(); ++m) {
    const physics::FosterLadder ladder = physics::foster_ladder(dt_s, materials[m].network);
    for (std::size_t level = 0; level < ladder.level.size(); ++level) {
      params[m * ladder.level.size() + level] = {narrow(ladder.level[level].start_frac),
                                                 narrow(ladder.level[level].end_frac)};
    }
  }
}

void set_relaxation(const HistoryInterval& interval, std::span<const scene::Material> materials,
                    std::span<gpu::RelaxationParams> params) noexcept {
  const double dt_s = static_cast<double>(interval.end_ns - interval.begin_ns) * 1e-9;
  for (std::size_t m = 0; m < materials.size(); ++m) {
    glm::vec4 modes[EMIT_MAX_MODES] = {glm::vec4(0.0F), glm::vec4(0.0F)};
    const auto& source = materials[m].modes;
    for (std::size_t i = 0; i < source.size() && i < EMIT_MAX_MODES; ++i) {
      const auto gains = physics::relaxation_gains(dt_s, source[i].tau_s);
      modes[i] = glm::vec4(static_cast<float>(gains.start_frac), static_cast<float>(gains.end_frac),
                           static_cast<float>(source[i].weight_frac), 0.0F);
    }
    params[m] = {modes[0], modes[1]};
  }
}

}  // namespace emit::renderer
