// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/surface_forcing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>

#include "emit/physics/climate/rain.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"
#include "emit/reference/surface_water.hpp"
#include "emit/scene/base.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::int64_t kNsPerS = 1'000'000'000;

/// Weather of a scenario in the form that the shared input models take.
struct Weather {
  physics::GeoPlace place;
  std::int64_t epoch_utc_ns = 0;
  physics::ClearSky clear_sky;
  std::vector<physics::WeatherSample> rows;
  physics::RainDepth rain;
  double usual_dew_point_k = 0.0;
  double film_factor = 1.0;

  explicit Weather(const scene::ScenarioDesc& scenario)
      : place{physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
              physics::Metres(scenario.place.height_m)},
        epoch_utc_ns(scenario.epoch_utc_ns),
        clear_sky(scenario.clear_sky),
        rows(scenario.weather),
        rain(scenario.weather),
        usual_dew_point_k(scene::usual_dew_point_k(scenario)),
        film_factor(scenario.thermal.film_factor) {}

  /// Returns the climate at a time. `before` gives the limit from earlier times at a jump of the
  /// table. `stated` returns whether the weather gives the temperature of the surroundings.
  [[nodiscard]] ClimateNode at(std::int64_t time_ns, bool before, bool& stated) const {
    // Evaluate the input models.
    const physics::SunPosition sun = physics::sun_position(epoch_utc_ns + time_ns, place);
    physics::Forcing forcing =
        rows.empty()
            ? physics::forcing_from_clear_sky(clear_sky, place, sun, epoch_utc_ns + time_ns)
            : physics::at_place(physics::forcing_from_rows(rows, before ? time_ns - 1 : time_ns),
                                place, sun);
    forcing.film_factor = film_factor;
    ClimateNode node;
    node.time_ns = time_ns;
    node.to_sun = sun.direction_enu;
    // Apply the clouds, and remove the sun below the horizon.
    node.direct_normal_w_m2 =
        node.to_sun.z > 0.0 ? forcing.direct_normal_w_m2 * (1.0 - forcing.cloud_frac) : 0.0;
    node.diffuse_horizontal_w_m2 = forcing.diffuse_horizontal_w_m2;
    node.longwave_down_w_m2 = forcing.longwave_down_w_m2;
    node.air_k = forcing.air_k;
    node.flow = physics::air_flow(forcing);
    node.surroundings_k = forcing.environment_k;
    node.rain_mm = rain.at_mm(time_ns);
    node.vapour_pa = physics::with_vapour(forcing, usual_dew_point_k).vapour_pa;
    stated = forcing.environment_stated;
    return node;
  }
};

/// Returns the times of the nodes: all times at which the forcing bends or jumps within the run,
/// and at most one step apart between them, or ten before `fine_from_ns`.
std::vector<std::int64_t> node_times(const Weather& weather, std::int64_t start_ns,
                                     std::int64_t history_ns, std::int64_t end_ns,
                                     std::int64_t step_ns, std::int64_t fine_from_ns) {
  constexpr std::int64_t kEarlySteps = 10;
  // Collect the times that must have a node.
  std::vector<std::int64_t> marks{start_ns, history_ns, std::clamp(fine_from_ns, start_ns, end_ns),
                                  end_ns};
  for (const physics::WeatherSample& row : weather.rows) {
    if (row.sim_time_ns > start_ns && row.sim_time_ns < end_ns) marks.push_back(row.sim_time_ns);
  }
  std::sort(marks.begin(), marks.end());
  marks.erase(std::unique(marks.begin(), marks.end()), marks.end());
  std::vector<std::int64_t> times;
  for (std::size_t i = 0; i + 1 < marks.size(); ++i) {
    const std::int64_t length_ns = marks[i + 1] - marks[i];
    const std::int64_t longest_ns = marks[i] < fine_from_ns ? kEarlySteps * step_ns : step_ns;
    const std::int64_t parts = std::max<std::int64_t>(1, (length_ns + longest_ns - 1) / longest_ns);
    for (std::int64_t part = 0; part < parts; ++part) {
      // Take whole steps first: with equal lengths the solver meets its matrices again.
      times.push_back(marks[i] + part * longest_ns);
    }
  }
  times.push_back(marks.back());
  return times;
}

/// Returns the material of that name, or nullptr.
const scene::Material* find_material(const scene::ScenarioDesc& scenario, const std::string& name) {
  const auto found = std::find_if(scenario.materials.begin(), scenario.materials.end(),
                                  [&](const scene::Material& m) { return m.name == name; });
  return found == scenario.materials.end() ? nullptr : &*found;
}

}  // namespace

FaceState face_state(const ClimateNode& climate, const SurfaceOptics& surface,
                     const ViewSample& view, double surroundings_reflectance_frac) noexcept {
  // Sum short-wave and long-wave fluxes, physics.md eq. 16.
  const double facing = std::max(0.0, glm::dot(surface.normal, climate.to_sun));
  const double direct = climate.direct_normal_w_m2;
  const double global = direct * std::max(0.0, climate.to_sun.z) + climate.diffuse_horizontal_w_m2;
  const double ground_frac = std::max(0.0, 1.0 - view.sky_frac - view.scene_frac);
  const double env2 = climate.surroundings_k * climate.surroundings_k;
  const double shortwave =
      direct * view.sun_frac * facing + view.sky_frac * climate.diffuse_horizontal_w_m2 +
      view.scene_shortwave_w_m2 + ground_frac * surroundings_reflectance_frac * global;
  const double longwave = view.sky_frac * climate.longwave_down_w_m2 + view.scene_longwave_w_m2 +
                          ground_frac * physics::kStefanBoltzmannWPerM2K4 * env2 * env2;
  FaceState out{surface.solar_absorptance_frac * shortwave + surface.emissivity_frac * longwave,
                0.0, climate.air_k,
                FaceFilm{physics::air_film(climate.flow, surface.film_body), surface.normal,
                         surface.skin, surface.both_sides}};
  if (!surface.moisture.dry() || surface.holds_water) {
    out.moisture =
        FaceMoisture{.vapour_pa = climate.vapour_pa,
                     .pressure_pa = climate.flow.pressure_pa,
                     .wetness_frac = surface.moisture.wetness_frac,
                     .resistance_s_m = light_resistance_s_m(surface.moisture, shortwave)};
    out.moisture->film_frac = climate.wet_frac;
  }
  return out;
}

ClimateNode climate_past(const ClimateNode& open, const MotionSample& motion) noexcept {
  ClimateNode out = open;
  out.flow = physics::raised_flow(open.flow, motion.up_m);
  out.flow.flow_m_s -= motion.velocity_m_s;
  out.air_k = physics::felt_air_k(out.flow);
  const double humidity_frac = open.vapour_pa / physics::saturation_over_water_pa(open.flow.air_k);
  out.vapour_pa = humidity_frac * physics::saturation_over_water_pa(out.flow.air_k);
  return out;
}

double light_resistance_s_m(const physics::MoistSurface& moisture, double shortwave_w_m2) noexcept {
  constexpr double kOpenWM2 = 100.0;
  const double day_s_m = moisture.resistance_s_m;
  if (!(day_s_m > 0.0)) return 0.0;
  const double dark_frac = 1.0 - std::clamp(shortwave_w_m2 / kOpenWM2, 0.0, 1.0);
  const double slower = 1.0 - day_s_m / moisture.night_resistance_s_m;
  return day_s_m / (1.0 - dark_frac * slower);
}

ViewSample open_view(const glm::dvec3& normal) noexcept {
  ViewSample view;
  view.sun_frac = 1.0;
  view.sky_frac = 0.5 * (1.0 + std::clamp(normal.z, -1.0, 1.0));
  return view;
}

Result<LayerMesh> material_mesh(const scene::Material& material, const MeshOptions& options) {
  const auto layers = solid_layers(material.layers);
  const BaseKind base = material.sheet ? BaseKind::adiabatic : BaseKind::fixed_temperature;
  auto mesh = LayerMesh::build(layers, {base, material.base_k}, options);
  if (!mesh) {
    return tl::unexpected(physics::Error{
        ErrorCode::config, fmt::format("material '{}': {}", material.name, mesh.error().text)});
  }
  return mesh;
}

ClimateNode SurfaceClimate::at(std::int64_t time_ns) const noexcept {
  const auto after =
      std::upper_bound(nodes_.begin(), nodes_.end(), time_ns,
                       [](std::int64_t t, const ClimateNode& node) { return t < node.time_ns; });
  if (after == nodes_.begin()) return nodes_.front();
  if (after == nodes_.end()) return nodes_.back();
  // Interpolate between the nodes.
  const ClimateNode& a = *(after - 1);
  const ClimateNode& b = *after;
  const double f =
      static_cast<double>(time_ns - a.time_ns) / static_cast<double>(b.time_ns - a.time_ns);
  const auto mix = [f](double x, double y) { return x + f * (y - x); };
  return {time_ns,
          a.to_sun + f * (b.to_sun - a.to_sun),
          mix(a.direct_normal_w_m2, b.direct_normal_w_m2),
          mix(a.diffuse_horizontal_w_m2, b.diffuse_horizontal_w_m2),
          mix(a.longwave_down_w_m2, b.longwave_down_w_m2),
          mix(a.air_k, b.air_k),
          physics::between_flows(a.flow, b.flow, f),
          mix(a.surroundings_k, b.surroundings_k),
          mix(a.vapour_pa, b.vapour_pa),
          mix(a.rain_mm, b.rain_mm),
          mix(a.wet_frac, b.wet_frac)};
}

std::optional<double> SurfaceClimate::stated_start_k(const scene::Material& material,
                                                     double initial_k) const noexcept {
  if (starts_balanced_ && !material.initial_k && !material.prescribed_k && !material.sheet) {
    return std::nullopt;
  }
  return material.initial_k.value_or(initial_k);
}

double SurfaceClimate::cloud_sun(const ClimateNode& now, const glm::dvec3& point_m) const noexcept {
  if (clouds_ == nullptr) return 1.0;
  return clouds_->by_mean(point_m, glm::normalize(now.to_sun), now.direct_normal_w_m2, now.time_ns);
}

Result<SurfaceClimate> SurfaceClimate::create(const scene::ScenarioDesc& scenario,
                                              const ClimateOptions& options) {
  SurfaceClimate climate;
  if (scenario.clouds) climate.clouds_ = std::make_shared<const CloudSun>(scenario);
  climate.history_start_ns_ = scenario.thermal.history_start_ns;
  const std::int64_t spin_up_ns = options.spin_up_ns.value_or(scenario.thermal.spin_up_ns);
  scene::ThermalOptions start = scenario.thermal;
  start.spin_up_ns = spin_up_ns;
  climate.starts_balanced_ = scene::starts_balanced(start);
  const std::int64_t start_ns = climate.history_start_ns_ - std::max<std::int64_t>(0, spin_up_ns);
  const std::int64_t end_ns = std::max(options.end_ns, climate.history_start_ns_);
  const double step_ns = options.step_s * static_cast<double>(kNsPerS);
  if (!(step_ns >= 1.0) || !(static_cast<double>(end_ns - start_ns) / step_ns < 1e7)) {
    return make_error(ErrorCode::invalid_argument,
                      "the climate's step must be positive and give less than 10 million nodes");
  }

  // Add a node for every time, and two nodes at a jump.
  const Weather weather(scenario);
  bool all_stated = true;
  std::vector<bool> node_stated;
  const auto add = [&](std::int64_t time_ns, bool before) {
    bool stated = false;
    climate.nodes_.push_back(weather.at(time_ns, before, stated));
    node_stated.push_back(stated);
    all_stated = all_stated && stated;
  };
  for (const std::int64_t time_ns : node_times(weather, start_ns, climate.history_start_ns_, end_ns,
                                               static_cast<std::int64_t>(std::min(step_ns, 9e17)),
                                               options.fine_from_ns.value_or(start_ns))) {
    const auto rows_here = std::count_if(
        weather.rows.begin(), weather.rows.end(),
        [time_ns](const physics::WeatherSample& row) { return row.sim_time_ns == time_ns; });
    if (rows_here > 1 && time_ns > start_ns) add(time_ns, true);
    add(time_ns, false);
  }

  // Find the material of the surroundings.
  const std::string& name = scenario.thermal.surroundings_material.empty()
                                ? scenario.default_material
                                : scenario.thermal.surroundings_material;
  const scene::Material* ground = find_material(scenario, name);
  if (ground == nullptr) {
    return make_error(ErrorCode::config,
                      fmt::format("thermal.surroundings_material: no material '{}'", name));
  }
  climate.reflectance_frac_ = 1.0 - ground->solar_absorptance_frac;
  if (all_stated) return climate;

  // Solve for the surroundings where the weather does not give them. A level, open surface sees
  // none itself.
  auto mesh =
      ground->prescribed_k ? Result<LayerMesh>(LayerMesh()) : material_mesh(*ground, options.mesh);
  if (!mesh) return tl::unexpected(std::move(mesh.error()));
  std::vector<double> ground_k(climate.nodes_.size(), ground->prescribed_k.value_or(0.0));
  double initial_k = ground->initial_k.value_or(scenario.thermal.initial_k);
  if (!climate.stated_start_k(*ground, initial_k)) {
    // The surroundings do not see themselves: they may be balanced without what they send.
    initial_k = PointSolver(climate, *mesh, *ground, initial_k, options.steps)
                    .balanced_mean_k({0.0, 0.0, 1.0});
  }
  const WaterCourse water = ground->prescribed_k
                                ? WaterCourse{}
                                : water_course(climate.nodes_, *ground, initial_k,
                                               climate.reflectance_frac_, *mesh, options.steps);
  if (!water.empty()) {
    ground_k = water.face_k;
  } else if (!ground->prescribed_k) {
    const SurfaceOptics surface{{0.0, 0.0, 1.0},
                                ground->solar_absorptance_frac,
                                ground->emissivity_frac,
                                scene::film_skin(*ground),
                                false,
                                scene::moisture_of(*ground)};
    std::vector<ForcingRow> rows;
    std::vector<double> times_s;
    for (const ClimateNode& node : climate.nodes_) {
      times_s.push_back(static_cast<double>(node.time_ns - start_ns) * 1e-9);
      rows.push_back({times_s.back(), face_state(node, surface, open_view(surface.normal),
                                                 climate.reflectance_frac_)});
    }
    LayerSolver solver(*mesh, options.steps);
    const auto profile = steady_profile(solid_layers(ground->layers), initial_k, ground->base_k);
    face_history(solver, profile, rows, surface.emissivity_frac, times_s, ground_k);
  }
  for (std::size_t i = 0; i < climate.nodes_.size(); ++i) {
    if (!node_stated[i]) climate.nodes_[i].surroundings_k = ground_k[i];
  }
  return climate;
}

}  // namespace emit::reference
