// SPDX-License-Identifier: Apache-2.0
#include "history/foster_history.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double4.hpp>
#include <glm/geometric.hpp>

#include "emit/physics/check.hpp"
#include "emit/physics/step_nodes.hpp"
#include "emit/scene/base.hpp"
#include "emit/scene/melting.hpp"
#include "emit/threads/parallel.hpp"

namespace emit::renderer {
namespace {

using physics::ErrorCode;
using physics::FosterDrive;
using physics::FosterState;

// Steps of the spin-up, 15 minutes at most. The sun's input is linear between their ends. The same
// holds for the tail, which also sets the fast modes.
constexpr std::size_t kSpinUpSteps = 288;
constexpr double kFirstSpinUpStepS = 300.0;
constexpr double kFirstTailStepS = 300.0;
// The day whose balance surfaces begin in has steps of half an hour.
constexpr std::size_t kDaySteps = 48;
constexpr std::int64_t kDayStepNs = scene::kBalancedDayNs / static_cast<std::int64_t>(kDaySteps);
// Tolerance of the surroundings' temperature, K.
constexpr double kSurroundingsToleranceK = 0.01;
/// Thermal resistance behind the middle of a sheet, m2 K/W: a difference of 50 K gives 0.05 W/m2.
constexpr double kInsulationM2kW = 1e3;

double seconds(std::int64_t begin_ns, std::int64_t end_ns) noexcept {
  return static_cast<double>(end_ns - begin_ns) * 1e-9;
}

/// Returns the unit vector of octahedral coordinates.
glm::dvec3 unit_from_octahedral(double u, double v) noexcept {
  glm::dvec3 n(u, v, 1.0 - std::abs(u) - std::abs(v));
  const double t = std::max(-n.z, 0.0);
  n.x += n.x >= 0.0 ? -t : t;
  n.y += n.y >= 0.0 ? -t : t;
  return glm::normalize(n);
}

/// Returns the octahedral coordinates of a unit vector.
glm::dvec2 octahedral_from_unit(const glm::dvec3& n) noexcept {
  const double scale = 1.0 / (std::abs(n.x) + std::abs(n.y) + std::abs(n.z));
  glm::dvec2 p(n.x * scale, n.y * scale);
  if (n.z < 0.0) {
    p = {(1.0 - std::abs(p.y)) * (p.x >= 0.0 ? 1.0 : -1.0),
         (1.0 - std::abs(p.x)) * (p.y >= 0.0 ? 1.0 : -1.0)};
  }
  return p;
}

/// Replaces weather that changes within the interval by a line of least squares. The line keeps the
/// mean, and its slope is limited so that its ends stay among the values that occurred.
void fit_changes(HistoryInterval& interval, const Environment& environment) noexcept {
  const auto changes_ns = environment.changes_ns();
  const auto first = std::ranges::upper_bound(changes_ns, interval.begin_ns);
  if (first == changes_ns.end() || *first >= interval.end_ns) return;
  constexpr std::size_t kParts = 32;
  std::array<physics::Forcing, kParts> parts;
  for (std::size_t i = 0; i < kParts; ++i) {
    const double way = (static_cast<double>(i) + 0.5) / kParts;
    const auto at_ns = interval.begin_ns +
                       std::llround(way * static_cast<double>(interval.end_ns - interval.begin_ns));
    parts[i] = environment.forcing_at(at_ns, environment.sun_at(at_ns));
  }
  for (double physics::Forcing::*value :
       {&physics::Forcing::direct_normal_w_m2, &physics::Forcing::diffuse_horizontal_w_m2,
        &physics::Forcing::longwave_down_w_m2, &physics::Forcing::air_k,
        &physics::Forcing::environment_k, &physics::Forcing::stated_film_w_m2_k,
        &physics::Forcing::stated_film_frac, &physics::Forcing::wind_m_s,
        &physics::Forcing::wind_to_east, &physics::Forcing::wind_to_north,
        &physics::Forcing::gust_m_s, &physics::Forcing::cloud_frac, &physics::Forcing::vapour_pa}) {
    double mean = 0.0;
    double moment = 0.0;
    double low = parts[0].*value;
    double high = low;
    for (std::size_t i = 0; i < kParts; ++i) {
      mean += parts[i].*value / kParts;
      moment += parts[i].*value * ((static_cast<double>(i) + 0.5) / kParts - 0.5) / kParts;
      low = std::min(low, parts[i].*value);
      high = std::max(high, parts[i].*value);
    }
    const double max_half = std::max(0.0, std::min(mean - low, high - mean));
    const double half = std::clamp(6.0 * moment, -max_half, max_half);
    interval.forcing_begin.*value = mean - half;
    interval.forcing_end.*value = mean + half;
  }
}

}  // namespace

StateTexels texels_of(const FosterState<double>& x) noexcept {
  StateTexels texels{};
  for (std::size_t i = 0; i < x.size(); ++i) {
    texels[i / 4][static_cast<glm::length_t>(i % 4)] = static_cast<float>(x[i]);
  }
  return texels;
}

FosterState<double> foster_initial_states(const FosterMaterial& material) noexcept {
  FosterState<double> x{};
  const double flux_w_m2 =
      (material.initial_k - material.base_k) / material.network.resistance_m2k_w();
  for (std::size_t i = 0; i < material.network.count; ++i) {
    x[i] = material.network.modes[i].resistance_m2k_w * flux_w_m2;
  }
  return x;
}

physics::FosterSurface<double> foster_surface_of(const FosterMaterial& material,
                                                 double reference_k) noexcept {
  return physics::foster_surface(material.network, material.emissivity_frac, material.base_k,
                                 reference_k);
}

HistoryInterval interval_between(std::int64_t begin_ns, std::int64_t end_ns,
                                 const Environment& environment) noexcept {
  HistoryInterval interval;
  interval.begin_ns = begin_ns;
  interval.end_ns = end_ns;
  interval.sun_begin = environment.sun_at(begin_ns);
  interval.sun_end = environment.sun_at(end_ns);
  interval.forcing_begin = environment.forcing_at(begin_ns, interval.sun_begin);
  // Weather that changes at the end of the interval has not acted in it.
  interval.forcing_end =
      environment.forcing_at(end_ns > begin_ns ? end_ns - 1 : end_ns, interval.sun_end);
  fit_changes(interval, environment);
  interval.rain_mm = environment.rain_mm(begin_ns, end_ns);
  return interval;
}

SurfaceForcing open_forcing(const physics::SunPosition& sun,
                            const physics::Forcing& weather) noexcept {
  SurfaceForcing out;
  const double direct_w_m2 = std::sin(sun.elevation.value()) > 0.0
                                 ? weather.direct_normal_w_m2 * (1.0 - weather.cloud_frac)
                                 : 0.0;
  out.sun_w_m2 = direct_w_m2 * sun.direction_enu;
  out.diffuse_w_m2 = weather.diffuse_horizontal_w_m2;
  out.longwave_w_m2 = weather.longwave_down_w_m2;
  out.flow = physics::air_flow(weather);
  out.film = physics::air_film(out.flow);
  out.air_k = weather.air_k;
  out.moist = physics::moist_air(weather.air_k, out.flow.pressure_pa, weather.vapour_pa);
  return out;
}

FosterDrive<double> unshadowed_drive(const SurfaceForcing& f, const FosterMaterial& material,
                                     const glm::dvec3& normal, double reference_k,
                                     double offset_k) noexcept {
  const double sky_frac = 0.5 * (1.0 + normal.z);
  const double short_wave_w_m2 = std::max(0.0, glm::dot(normal, f.sun_w_m2)) +
                                 sky_frac * f.diffuse_w_m2 + (1.0 - sky_frac) * f.reflected_w_m2;
  const double long_wave_w_m2 = sky_frac * f.longwave_w_m2 + (1.0 - sky_frac) * f.environment_w_m2;
  FosterDrive<double> drive{.absorbed_w_m2 = material.solar_absorptance_frac * short_wave_w_m2 +
                                             material.emissivity_frac * long_wave_w_m2,
                            .film_w_m2_k = physics::film_w_m2_k(f.film, normal, material.skin,
                                                                reference_k + offset_k - f.air_k),
                            .air_offset_k = f.air_k - reference_k};
  physics::add_moisture(moisture_at(material, f, rain_by_tilt_frac(normal.z)), f.moist,
                        short_wave_w_m2, drive);
  return drive;
}

physics::Result<std::vector<FosterMaterial>> foster_materials(
    std::span<const scene::Material> materials, const scene::ThermalOptions& options) {
  std::vector<FosterMaterial> out;
  for (const scene::Material& material : materials) {
    FosterMaterial entry;
    entry.solar_absorptance_frac = material.solar_absorptance_frac;
    entry.emissivity_frac = material.emissivity_frac;
    entry.skin = scene::film_skin(material);
    entry.moisture = scene::moisture_of(material);
    entry.store = scene::water_store_of(material);
    entry.snow_or_ice = scene::is_snow_or_ice(material);
    entry.base_k = material.base_k;
    entry.initial_k = material.initial_k.value_or(options.initial_k);
    entry.starts_balanced = scene::starts_balanced(options) && !material.initial_k &&
                            !material.prescribed_k && !material.sheet;
    if (material.prescribed_k) {
      entry.prescribed_k = *material.prescribed_k;
      out.push_back(entry);
      continue;
    }
    if (material.sheet) {
      entry.sheet = true;
      double capacity_j_m2_k = 0.0;
      for (const scene::Layer& layer : material.layers) {
        capacity_j_m2_k += layer.thickness_m * layer.density_kg_m3 * layer.specific_heat_j_kg_k;
      }
      entry.network.modes[entry.network.count++] = {kInsulationM2kW * capacity_j_m2_k,
                                                    kInsulationM2kW};
      out.push_back(entry);
      continue;
    }
    std::vector<physics::StackLayer> layers;
    for (const scene::Layer& layer : material.layers) {
      layers.push_back({layer.thickness_m, layer.conductivity_w_m_k,
                        layer.density_kg_m3 * layer.specific_heat_j_kg_k});
    }
    if (options.foster_modes == 0 && !material.foster_modes.empty()) {
      for (const scene::FosterMode& mode : material.foster_modes) {
        if (entry.network.count == physics::kMaxFosterModes) break;
        entry.network.modes[entry.network.count++] = {mode.tau_s, mode.resistance_m2k_w};
      }
    } else {
      const std::size_t modes =
          options.foster_modes == 0 ? physics::kMaxFosterModes : std::size_t{options.foster_modes};
      auto network = physics::network_of_stack(layers, {.modes = modes});
      if (!network) {
        return physics::make_error(
            ErrorCode::config,
            fmt::format("material '{}': {}", material.name, network.error().text));
      }
      entry.network = *network;
    }
    entry.body = material.rests_on_body();
    if (entry.body) entry.base_shares = physics::base_shares(layers, entry.network);
    entry.layers = std::move(layers);
    out.push_back(std::move(entry));
  }
  number_water(out);
  return out;
}

namespace {

std::vector<FosterMaterial> with_surroundings(std::vector<FosterMaterial> materials,
                                              const FosterMaterial& surroundings) {
  materials.push_back(surroundings);
  return materials;
}

}  // namespace

FosterHistory::FosterHistory(const scene::ScenarioDesc& scenario,
                             std::vector<FosterMaterial> materials, FosterMaterial surroundings,
                             const Environment& environment, double reference_k,
                             DryGrounds dry_grounds, StartNodes start_nodes)
    : materials_(std::move(materials)),
      surroundings_(surroundings),
      reference_k_(reference_k),
      tolerance_k_(std::min(scenario.thermal.tolerance_k, kSurroundingsToleranceK)),
      history_start_ns_(scenario.thermal.history_start_ns),
      spin_up_ns_(std::max<std::int64_t>(scenario.thermal.spin_up_ns, 0)),
      surroundings_surface_(foster_surface_of(surroundings_, reference_k)),
      grounds_(with_surroundings(materials_, surroundings_), reference_k, tolerance_k_),
      dry_grounds_(dry_grounds),
      start_nodes_(start_nodes),
      intervals_(scenario.thermal.steps) {
  if (spin_up_ns_ > 0) tail_.resize(kTailSteps);
  if (spin_up_ns_ > kTailNs) {
    grid_nodes_ = kGridNodes;
    spin_up_.resize(kSpinUpSteps);
  }
  if (balances()) {
    grid_nodes_ = kGridNodes;
    day_.resize(kDaySteps);
    openings_.resize(materials_.size() + 1);
  }
  nodes_ns_.resize(kSpinUpSteps + 1);
  table_.resize(materials_.size() * grid_nodes_ * grid_nodes_);
  spin_up_gains_.resize(materials_.size());
  spin_up(environment, [](std::size_t rows, const auto& fill) {
    threads::parallel_parts(rows, 1, [&fill](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; ++row) fill(row);
    });
  });
}

SurfaceForcing FosterHistory::forcing(const physics::SunPosition& sun,
                                      const physics::Forcing& weather) const noexcept {
  SurfaceForcing out = open_forcing(sun, weather);
  const double level_w_m2 =
      glm::length(out.sun_w_m2) * std::max(std::sin(sun.elevation.value()), 0.0);
  out.reflected_w_m2 =
      (1.0 - surroundings_.solar_absorptance_frac) * (level_w_m2 + weather.diffuse_horizontal_w_m2);
  return out;
}

void FosterHistory::carry(const HistoryInterval& interval, double tolerance_k,
                          IntervalForcing& out) noexcept {
  out.begin = forcing(interval.sun_begin, interval.forcing_begin);
  out.end = forcing(interval.sun_end, interval.forcing_end);
  out.dt_s = seconds(interval.begin_ns, interval.end_ns);
  out.rain_mm = interval.rain_mm;
  if (follow_) grounds_.carry(interval, out, ground_);
  grounds_.note_weather(interval, ground_);
  const glm::dvec3 up(0.0, 0.0, 1.0);
  double begin_k = surroundings_.prescribed_k;
  double end_k = surroundings_.prescribed_k;
  if (!surroundings_.prescribed()) {
    const double offset_k = physics::foster_offset_k(ground_.surroundings, surroundings_surface_);
    begin_k = reference_k_ + offset_k;
    const auto ladder = physics::foster_ladder(out.dt_s, surroundings_.network);
    physics::foster_advance(ground_.surroundings,
                            unshadowed_drive(out.begin, surroundings_, up, reference_k_, offset_k),
                            unshadowed_drive(out.end, surroundings_, up, reference_k_, offset_k),
                            ladder, surroundings_surface_, tolerance_k);
    end_k = reference_k_ + physics::foster_offset_k(ground_.surroundings, surroundings_surface_);
  }
  const auto exitance_w_m2 = [](double t_k) {
    const double t2 = t_k * t_k;
    return physics::kStefanBoltzmannWPerM2K4 * t2 * t2;
  };
  const auto environment_k = [](const physics::Forcing& weather, double model_k) {
    return weather.environment_stated ? weather.environment_k : model_k;
  };
  out.begin.environment_w_m2 = exitance_w_m2(environment_k(interval.forcing_begin, begin_k));
  out.end.environment_w_m2 = exitance_w_m2(environment_k(interval.forcing_end, end_k));
  surroundings_now_k_ = environment_k(interval.forcing_end, end_k);
}

void FosterHistory::forcing_over(std::span<const std::int64_t> nodes_ns,
                                 const Environment& environment,
                                 std::span<IntervalForcing> out) noexcept {
  EMIT_CHECK_OP(out.size() + 1, ==, nodes_ns.size());
  EMIT_DCHECK(std::ranges::is_sorted(nodes_ns));
  ground_ = ground_at_start_;
  follow_ = dry_grounds_ == DryGrounds::followed || grounds_.needed(environment, {});
  for (std::size_t i = 0; i < out.size(); ++i) {
    carry(interval_between(nodes_ns[i], nodes_ns[i + 1], environment), tolerance_k_, out[i]);
  }
}

bool FosterHistory::balances() const noexcept {
  return surroundings_.starts_balanced ||
         std::ranges::any_of(materials_, &FosterMaterial::starts_balanced);
}

void FosterHistory::take_day(const Environment& environment) noexcept {
  const std::int64_t begin_ns = history_start_ns_ - spin_up_ns_;
  const auto carry_day = [&](const FosterState<double>& surroundings) {
    ground_ = {};
    grounds_.start(ground_);
    follow_ = true;
    ground_.surroundings = surroundings;
    const auto node_ns = [&](std::size_t i) {
      return begin_ns + static_cast<std::int64_t>(i) * kDayStepNs;
    };
    for (std::size_t i = 0; i < kDaySteps; ++i) {
      carry(interval_between(node_ns(i), node_ns(i + 1), environment), tolerance_k_, day_[i]);
    }
  };
  // The surroundings do not see themselves, so that their own day comes first.
  carry_day(surroundings_start_);
  if (!surroundings_.starts_balanced) return;
  const std::size_t last = materials_.size();
  openings_.fill(last, surroundings_, day_, {}, reference_k_);
  const glm::dvec3 up(0.0, 0.0, 1.0);
  surroundings_start_ = openings_.at_start(last, 1.0, mean_sun_w_m2(day_, up), 1.0);
  carry_day(surroundings_start_);
}

void FosterHistory::spin_up_surroundings(const Environment& environment) noexcept {
  surroundings_start_ =
      surroundings_.prescribed() ? FosterState<double>{} : foster_initial_states(surroundings_);
  if (!day_.empty()) take_day(environment);
  ground_ = {};
  grounds_.start(ground_);
  follow_ = true;
  ground_.surroundings = surroundings_start_;
  const std::int64_t table_ns =
      history_start_ns_ - std::min(spin_up_ns_, tail_.empty() ? 0 : kTailNs);
  if (!spin_up_.empty()) {
    physics::geometric_step_nodes(history_start_ns_ - spin_up_ns_, table_ns, kFirstSpinUpStepS,
                                  std::span(nodes_ns_).first(kSpinUpSteps + 1));
    for (std::size_t i = 0; i < kSpinUpSteps; ++i) {
      carry(interval_between(nodes_ns_[i], nodes_ns_[i + 1], environment), tolerance_k_,
            spin_up_[i]);
    }
  }
  if (!tail_.empty()) {
    physics::geometric_step_nodes(table_ns, history_start_ns_, kFirstTailStepS,
                                  std::span(nodes_ns_).first(kTailSteps + 1));
    for (std::size_t i = 0; i < kTailSteps; ++i) {
      carry(interval_between(nodes_ns_[i], nodes_ns_[i + 1], environment), tolerance_k_, tail_[i]);
    }
  }
  ground_at_start_ = ground_;
}

FosterState<double> FosterHistory::start_states(std::size_t material,
                                                const glm::dvec3& normal) const noexcept {
  EMIT_DCHECK_OP(material, <, materials_.size());
  const glm::dvec2 place =
      (octahedral_from_unit(normal) * 0.5 + 0.5) * static_cast<double>(grid_nodes_ - 1);
  const glm::dvec2 low = glm::clamp(glm::floor(place), glm::dvec2(0.0),
                                    glm::dvec2(static_cast<double>(grid_nodes_ - 2)));
  const glm::dvec2 weight = place - low;
  const auto row = static_cast<std::size_t>(low.y);
  const auto column = static_cast<std::size_t>(low.x);
  const std::array<StateTexels, 2> south{node(material, row, column),
                                         node(material, row, column + 1)};
  const std::array<StateTexels, 2> north{node(material, row + 1, column),
                                         node(material, row + 1, column + 1)};
  FosterState<double> x{};
  for (std::size_t i = 0; i < x.size(); ++i) {
    const auto between = [&](const std::array<StateTexels, 2>& nodes) {
      const auto state = [i](const StateTexels& texels) {
        return static_cast<double>(texels[i / 4][static_cast<glm::length_t>(i % 4)]);
      };
      return glm::mix(state(nodes[0]), state(nodes[1]), weight.x);
    };
    x[i] = glm::mix(between(south), between(north), weight.y);
  }
  return x;
}

StateTexels FosterHistory::node(std::size_t material, std::size_t row,
                                std::size_t column) const noexcept {
  return table_.at((material * grid_nodes_ + row) * grid_nodes_ + column, [&] {
    if (materials_[material].prescribed()) return StateTexels{};
    const double scale = 2.0 / (grid_nodes_ - 1);
    return texels_of(
        spun_up(material, unit_from_octahedral(scale * static_cast<double>(column) - 1.0,
                                               scale * static_cast<double>(row) - 1.0)));
  });
}

FosterState<double> FosterHistory::first_states(std::size_t material,
                                                const glm::dvec3& normal) const noexcept {
  if (!materials_[material].starts_balanced) return foster_initial_states(materials_[material]);
  return openings_.at_start(material, normal.z, mean_sun_w_m2(day_, normal),
                            FaceOpening::unshadowed(normal).sky_frac);
}

FosterState<double> FosterHistory::hidden_states(std::size_t material,
                                                 const FaceOpening& face) const noexcept {
  EMIT_DCHECK_OP(material, <, materials_.size());
  if (!materials_[material].starts_balanced) return {};
  const double open_w_m2 = mean_sun_w_m2(day_, face.normal);
  const FosterState<double> open = openings_.later(material, face.normal.z, open_w_m2,
                                                   FaceOpening::unshadowed(face.normal).sky_frac);
  FosterState<double> out =
      openings_.later(material, face.normal.z, face.sun_frac * open_w_m2, face.sky_frac);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] -= open[i];
  return out;
}

double FosterHistory::day_sun_j_m2(const glm::dvec3& normal) const noexcept {
  return static_cast<double>(scene::kBalancedDayNs) * 1e-9 * mean_sun_w_m2(day_, normal);
}

IntervalForcing FosterHistory::extend(std::int64_t begin_ns, std::int64_t end_ns,
                                      const Environment& environment) noexcept {
  IntervalForcing out;
  carry(interval_between(begin_ns, end_ns, environment), tolerance_k_, out);
  return out;
}

FosterState<double> FosterHistory::spun_up(std::size_t index,
                                           const glm::dvec3& normal) const noexcept {
  EMIT_DCHECK_OP(index, <, materials_.size());
  const FosterMaterial& material = materials_[index];
  FosterState<double> x = first_states(index, normal);
  if (spin_up_.empty()) return x;
  const auto surface = foster_surface_of(material, reference_k_);
  for (std::size_t i = 0; i < spin_up_.size(); ++i) {
    // The film follows the temperature at the start of the step.
    const double offset_k = physics::foster_offset_k(x, surface);
    const auto drive = [&](const SurfaceForcing& f) {
      return unshadowed_drive(f, material, normal, reference_k_, offset_k);
    };
    physics::foster_step(x, drive(spin_up_[i].begin), drive(spin_up_[i].end),
                         spin_up_gains_[index][i], surface);
  }
  return x;
}

template <class Loop>
void FosterHistory::spin_up(const Environment& environment, const Loop& each) {
  spin_up_surroundings(environment);
  for (std::size_t m = 0; m < materials_.size(); ++m) {
    const FosterMaterial& material = materials_[m];
    if (material.prescribed()) continue;
    std::vector<physics::FosterGains<double>>& gains = spin_up_gains_[m];
    gains.resize(spin_up_.size());
    for (std::size_t i = 0; i < spin_up_.size(); ++i) {
      gains[i] = physics::foster_gains(spin_up_[i].dt_s, material.network);
    }
  }
  if (!day_.empty()) {
    each(materials_.size(), [this](std::size_t m) {
      if (!materials_[m].starts_balanced) return;
      openings_.fill(m, materials_[m], day_, spin_up_, reference_k_);
    });
  }
  table_.clear();
  if (start_nodes_ == StartNodes::all) {
    // Fill the table row by row.
    each(materials_.size() * grid_nodes_, [this](std::size_t row) {
      for (std::size_t column = 0; column < grid_nodes_; ++column) {
        (void)node(row / grid_nodes_, row % grid_nodes_, column);
      }
    });
  }
  revision_ = environment.revision();
  const auto changes_ns = environment.changes_ns();
  weather_before_start_ = !changes_ns.empty() && changes_ns.front() < history_start_ns_;
}

bool FosterHistory::update(const StepPlan& plan, const Environment& environment) noexcept {
  bool changed = false;
  if (revision_ != environment.revision()) {
    revision_ = environment.revision();
    const auto changes_ns = environment.changes_ns();
    const bool before_start = !changes_ns.empty() && changes_ns.front() < history_start_ns_;
    if (before_start != weather_before_start_ ||
        (before_start && changes_ns.back() < history_start_ns_)) {
      // Fill the rows one by one: frames may ask for this, and threads would take memory.
      spin_up(environment, [](std::size_t rows, const auto& fill) {
        for (std::size_t row = 0; row < rows; ++row) fill(row);
      });
      changed = true;
    }
  }
  ground_ = ground_at_start_;
  const auto intervals = plan.intervals();
  follow_ = dry_grounds_ == DryGrounds::followed || grounds_.needed(environment, intervals);
  for (std::size_t i = 0; i < intervals.size() && i < intervals_.size(); ++i) {
    carry(intervals[i], tolerance_k_, intervals_[i]);
  }
  return changed;
}

}  // namespace emit::renderer
