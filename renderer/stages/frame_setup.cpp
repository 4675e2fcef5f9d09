// SPDX-License-Identifier: Apache-2.0
#include "stages/frame_setup.hpp"

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"
#include "emit/physics/relaxation.hpp"
#include "emit/physics/surface_balance.hpp"

namespace emit::renderer {
namespace {

/// Largest width by which a frustum grows for filter taps. With the sun near the horizon the
/// shadows of tall casters blur over hundreds of metres, but their flux is negligible.
constexpr double kMaxMarginM = 50.0;

/// Vector of three components and a fourth, in float32.
glm::vec4 vec4_from(const glm::dvec3& v, double w) noexcept {
  return glm::vec4(static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z),
                   static_cast<float>(w));
}

/// Vector in float32.
glm::vec3 vec3_from(const glm::dvec3& v) noexcept {
  return glm::vec3(static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z));
}

/// Direct normal flux below the clouds, W m-2; 0 while the sun is down.
float sun_w_m2(const physics::SunPosition& sun, const physics::Forcing& forcing) noexcept {
  const double flux_w_m2 =
      sun.elevation.value() > 0.0 ? forcing.direct_normal_w_m2 * (1.0 - forcing.cloud_frac) : 0.0;
  return static_cast<float>(flux_w_m2);
}

/// Indirect fluxes at one end of an interval, W m-2, as StepParams holds them.
struct Fluxes {
  float diffuse = 0.0F;
  float longwave = 0.0F;
  float reflected = 0.0F;
  float environment = 0.0F;
};

/// Indirect fluxes of the published model (S_i, R_LW and R_e / emissivity of
/// physics.md eq. 1).
Fluxes fluxes(const physics::Forcing& forcing) noexcept {
  return {
      .diffuse = static_cast<float>(physics::diffuse_input_w_m2(forcing.diffuse_horizontal_w_m2)),
      .longwave = static_cast<float>(
          physics::longwave_input_w_m2(forcing.longwave_down_w_m2, forcing.environment_k)),
      .reflected = 0.0F,
      .environment =
          static_cast<float>(physics::environment_input_w_m2(1.0, forcing.environment_k))};
}

/// Indirect fluxes of the extended model (physics.md eq. 16).
Fluxes fluxes(const SurfaceForcing& forcing) noexcept {
  return {.diffuse = static_cast<float>(forcing.diffuse_w_m2),
          .longwave = static_cast<float>(forcing.longwave_w_m2),
          .reflected = static_cast<float>(forcing.reflected_w_m2),
          .environment = static_cast<float>(forcing.environment_w_m2)};
}

/// Writes the indirect fluxes at both ends of an interval.
void set_fluxes(const Fluxes& start, const Fluxes& end, gpu::StepParams& params) noexcept {
  params.diffuse_start_w_m2 = start.diffuse;
  params.longwave_start_w_m2 = start.longwave;
  params.reflected_start_w_m2 = start.reflected;
  params.environment_start_w_m2 = start.environment;
  params.diffuse_end_w_m2 = end.diffuse;
  params.longwave_end_w_m2 = end.longwave;
  params.reflected_end_w_m2 = end.reflected;
  params.environment_end_w_m2 = end.environment;
}

/// Returns a film in float32.
gpu::FilmParams film_params(const physics::AirFilm& film) noexcept {
  gpu::FilmParams params{};
  params.upwind = vec3_from(film.upwind);
  params.directed_frac = static_cast<float>(film.directed_frac);
  params.windward_w_m2_k = static_cast<float>(film.windward_w_m2_k);
  params.leeward_w_m2_k = static_cast<float>(film.leeward_w_m2_k);
  params.vertical_root = static_cast<float>(film.vertical_root);
  params.vertical_rise = static_cast<float>(film.vertical_rise);
  params.unstable_quarter = static_cast<float>(film.unstable_quarter);
  params.unstable_third = static_cast<float>(film.unstable_third);
  params.stable_quarter = static_cast<float>(film.stable_quarter);
  params.rough_frac = static_cast<float>(film.rough_frac);
  params.stated_w_m2_k = static_cast<float>(film.stated_w_m2_k);
  params.model_frac = static_cast<float>(film.model_frac);
  params.leaf_forced = static_cast<float>(film.leaf_forced);
  params.leaf_quarter = static_cast<float>(film.leaf_quarter);
  return params;
}

/// Returns the moisture of the air in float32.
gpu::MoistAirParams moist_params(const physics::MoistAir& air) noexcept {
  return {.vapour_pa = static_cast<float>(air.vapour_pa),
          .psychrometric_pa_k = static_cast<float>(air.psychrometric_pa_k),
          .heat_j_m3_k = static_cast<float>(air.heat_j_m3_k),
          .stomata_w_m2 = static_cast<float>(physics::kOpenStomataWM2)};
}

}  // namespace

LightFrusta set_step(const HistoryInterval& interval, const CameraSetup& camera,
                     const scene::ThermalOptions& options, bool first, bool last,
                     std::uint32_t relaxation_offset, gpu::StepParams& params) noexcept {
  EMIT_CHECK_OP(options.shadow_map_px, >=, 1U);
  const auto is_unit = [](const glm::dvec3& v) { return std::abs(glm::dot(v, v) - 1.0) < 1e-6; };
  EMIT_CHECK(is_unit(interval.sun_begin.direction_enu));
  EMIT_CHECK(is_unit(interval.sun_sample.direction_enu));
  EMIT_CHECK(is_unit(interval.sun_end.direction_enu));
  // Write sun and fluxes at both ends.
  params.to_sun_start = vec3_from(interval.sun_begin.direction_enu);
  params.sun_start_w_m2 = sun_w_m2(interval.sun_begin, interval.forcing_begin);
  params.to_sun_end = vec3_from(interval.sun_end.direction_enu);
  params.sun_end_w_m2 = sun_w_m2(interval.sun_end, interval.forcing_end);
  set_fluxes(fluxes(interval.forcing_begin), fluxes(interval.forcing_end), params);
  // Start without shadow maps.
  std::uint32_t flags = 0;
  if (first) flags |= EMIT_STEP_FIRST;
  if (last) flags |= EMIT_STEP_SUN_NOW;
  params.cascade_count = 0;
  params.relaxation_offset = relaxation_offset;
  params.flags = flags;
  params.casters_top_m = 0.0F;
  params.casters_sun_sine = 0.0F;

  LightFrusta frusta;
  if (!interval.sun_up) return frusta;
  const glm::dvec3 to_sun = interval.sun_sample.direction_enu;
  const glm::dvec3 drift = interval.sun_end.direction_enu - interval.sun_begin.direction_enu;
  // Compute how far filter taps reach beyond the receivers: the width of the penumbra and half the
  // drift.
  const double top_m = std::max(camera.view.scene_max_m.z, camera.view.casters_max_m.z);
  const double height_m = top_m - camera.view.scene_min_m.z;
  const double margin_m =
      std::min(kMaxMarginM, height_m / to_sun.z *
                                (std::tan(physics::kSunSemiAngleRad) + 0.5 * glm::length(drift)));
  // Fit the frusta. Without one (nothing is in view) the sun shines unobstructed.
  params.flags |= EMIT_STEP_SUN_UP;
  frusta = fit_light(camera.view, to_sun, options.shadow_map_px, options.max_cascades, margin_m,
                     camera.pixel_rad);
  if (frusta.count == 0) return frusta;

  // Write the frusta in the form of the shaders.
  for (std::uint32_t c = 0; c < frusta.count; ++c) {
    const LightFrustum& frustum = frusta.cascades[c];
    gpu::CascadeParams& cascade = params.cascades[c];
    cascade.light_row0 = vec4_from(frustum.axes[0], frustum.offset_m.x);
    cascade.light_row1 = vec4_from(frustum.axes[1], frustum.offset_m.y);
    cascade.light_row2 = vec4_from(frustum.axes[2], frustum.offset_m.z);
    cascade.scale_per_m = vec3_from(1.0 / frustum.extent_m);
    cascade.end_boresight_m = static_cast<float>(frustum.end_boresight_m);
    cascade.drift_frac = glm::vec2(static_cast<float>(glm::dot(drift, frustum.axes[0])),
                                   static_cast<float>(glm::dot(drift, frustum.axes[1])));
  }
  params.casters_top_m = static_cast<float>(top_m);
  params.casters_sun_sine = static_cast<float>(to_sun.z);
  params.cascade_count = frusta.count;
  return frusta;
}

HistoryInterval instant_interval(const StepPlan& plan, std::int64_t sim_time_ns) noexcept {
  // Use the present sun and weather at both ends.
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
  EMIT_CHECK(blocker_taps >= 1 && blocker_taps <= EMIT_MAX_TAPS);
  EMIT_CHECK(filter_taps >= 1 && filter_taps <= EMIT_MAX_TAPS);
  gpu::TapParams params{};
  const auto fill = [](glm::vec4* out, std::uint32_t count) {
    for (std::uint32_t i = 0; i < count; ++i) {
      // Place the sample on the disc and along the drift, and spread blocker distances towards
      // small ones.
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
  // Split the vector of the direct sun into direction and flux. Without sun the direction is up.
  const auto set_sun = [](const SurfaceForcing& f, glm::vec3& to_sun, float& sun_w_m2) {
    const double flux_w_m2 = glm::length(f.sun_w_m2);
    const glm::dvec3 up(0.0, 0.0, 1.0);
    to_sun = vec3_from(flux_w_m2 > 0.0 ? f.sun_w_m2 / flux_w_m2 : up);
    sun_w_m2 = static_cast<float>(flux_w_m2);
  };
  set_sun(forcing.begin, params.to_sun_start, params.sun_start_w_m2);
  set_sun(forcing.end, params.to_sun_end, params.sun_end_w_m2);
  // Write fluxes, film and air at both ends.
  set_fluxes(fluxes(forcing.begin), fluxes(forcing.end), params);
  params.film_start = film_params(forcing.begin.film);
  params.film_end = film_params(forcing.end.film);
  params.moist_start = moist_params(forcing.begin.moist);
  params.moist_end = moist_params(forcing.end.moist);
  params.air_start_offset_k = static_cast<float>(forcing.begin.air_k - reference_k);
  params.air_end_offset_k = static_cast<float>(forcing.end.air_k - reference_k);
}

void set_foster_gains(const IntervalForcing& forcing, std::span<const FosterMaterial> materials,
                      std::span<gpu::RelaxationParams> params) noexcept {
  static_assert(EMIT_FOSTER_LEVELS == physics::kMaxFosterLevel);
  EMIT_CHECK_OP(forcing.dt_s, >=, 0.0);
  EMIT_CHECK_OP(params.size(), ==, materials.size() * EMIT_FOSTER_ENTRIES);
  for (std::size_t m = 0; m < materials.size(); ++m) {
    // Compute the gains of all splits of one material.
    const physics::FosterLadder ladder = physics::foster_ladder(forcing.dt_s, materials[m].network);
    const auto entries = params.subspan(m * EMIT_FOSTER_ENTRIES, EMIT_FOSTER_ENTRIES);
    for (std::size_t level = 0; level < ladder.level.size(); ++level) {
      const StateTexels start = texels_of(ladder.level[level].start_frac);
      const StateTexels end = texels_of(ladder.level[level].end_frac);
      for (std::size_t texel = 0; texel < start.size(); ++texel) {
        entries[level * EMIT_FOSTER_TEXELS + texel] = {start[texel], end[texel]};
      }
    }
    const int slot = materials[m].water_slot;
    const auto wet = [slot](const SurfaceForcing& f) {
      if (slot < 0) return glm::vec4(0.0F);
      const auto s = static_cast<std::size_t>(slot);
      return glm::vec4(static_cast<float>(f.wet_frac[s]), static_cast<float>(f.half_wet_frac[s]),
                       static_cast<float>(f.sheltered_wet_frac[s]), 0.0F);
    };
    entries.back() = {wet(forcing.begin), wet(forcing.end)};
  }
}

void set_relaxation(const HistoryInterval& interval, std::span<const scene::Material> materials,
                    std::span<gpu::RelaxationParams> params) noexcept {
  EMIT_CHECK_OP(params.size(), ==, materials.size());
  EMIT_CHECK_OP(interval.begin_ns, <=, interval.end_ns);
  const double dt_s = static_cast<double>(interval.end_ns - interval.begin_ns) * 1e-9;
  for (std::size_t m = 0; m < materials.size(); ++m) {
    // Compute the gains of both modes of one material. A mode that is missing has the weight 0.
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
