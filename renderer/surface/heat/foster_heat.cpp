// SPDX-License-Identifier: Apache-2.0
#include "surface/heat/foster_heat.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::renderer {
namespace {

using physics::FosterDrive;
using physics::FosterState;
using physics::FosterSurface;

/// Returns the exitance of a black surface.
double exitance_w_m2(double temperature_k) noexcept {
  const double t2 = temperature_k * temperature_k;
  return physics::kStefanBoltzmannWPerM2K4 * t2 * t2;
}

/// Lets states decay without any flux (physics.md eq. 6).
void relax(FosterState<double>& x, const physics::FosterGains<double>& gains) noexcept {
  for (std::size_t i = 0; i < physics::kMaxFosterModes; ++i) {
    x[i] -= x[i] * (gains.start_frac[i] + gains.end_frac[i]);
  }
}

}  // namespace

FosterHeat::FosterHeat(std::span<const FosterMaterial> materials, double reference_k,
                       double tolerance_k)
    : materials_(materials.begin(), materials.end()),
      reference_k_(reference_k),
      tolerance_k_(tolerance_k) {
  for (const FosterMaterial& material : materials_) {
    surfaces_.push_back(physics::foster_surface(material.network, material.emissivity_frac,
                                                material.base_k, reference_k));
    cells_.push_back(material.layers.empty() ? physics::ColumnCells{}
                                             : physics::column_cells(material.layers));
  }
}

void FosterHeat::prepare(HeatInterval& interval) const noexcept {
  for (std::size_t m = 0; m < materials_.size(); ++m) {
    if (materials_[m].prescribed()) continue;
    interval.ladders[m] = physics::foster_ladder(interval.forcing.dt_s, materials_[m].network);
  }
}

SampleState FosterHeat::start_state(const SurfaceSample& sample, const glm::vec3& normal,
                                    const FosterState<double>& before_k,
                                    std::span<const HeatInterval> tail) const noexcept {
  SampleState state;
  state.modes_k = before_k;
  for (const HeatInterval& interval : tail) {
    advance_unshadowed(sample.material, normal, interval, state.modes_k);
  }
  return state;
}

FosterHeat::Incoming FosterHeat::incoming(const SurfaceSample& sample, const glm::vec3& normal,
                                          const SurfaceForcing& forcing, const SampleDrive& drive,
                                          double longwave_seen_w_m2) const noexcept {
  // Split the sky into an open part and the part behind entities. The latter counts as
  // surroundings, unless the radiation of the entities is in `longwave_seen_w_m2`.
  const double open_frac = sample.sky_frac * (1.0 - drive.hidden_sky_frac);
  const double hidden_frac = drive.hidden_is_seen ? 0.0 : sample.sky_frac * drive.hidden_sky_frac;
  const double sun_w_m2 = std::max(0.0, glm::dot(glm::dvec3(normal), forcing.sun_w_m2));
  return {drive.sun_frac * sun_w_m2 + open_frac * forcing.diffuse_w_m2 +
              sample.far_frac * forcing.reflected_w_m2 + drive.shortwave_w_m2,
          open_frac * forcing.longwave_w_m2 +
              (hidden_frac + sample.far_frac) * forcing.environment_w_m2 + longwave_seen_w_m2};
}

FosterHeat::Incoming FosterHeat::into_body(const Incoming& own, bool own_covered,
                                           const glm::vec3& normal, const SurfaceForcing& forcing,
                                           const SheetBack* back,
                                           double SampleDrive::*longwave_w_m2) const noexcept {
  // Leave out a covered face: it keeps its heat, so the open one alone decides.
  if (back == nullptr || back->sample.covered) return own;
  const Incoming other =
      incoming(back->sample, -normal, forcing, back->drive, back->drive.*longwave_w_m2);
  if (own_covered) return other;
  return {0.5 * (own.shortwave_w_m2 + other.shortwave_w_m2),
          0.5 * (own.longwave_w_m2 + other.longwave_w_m2)};
}

FosterHeat::FilmSpan FosterHeat::film_over(const SampleAdvance& each,
                                           const IntervalForcing& forcing) const noexcept {
  const SurfaceSample& sample = *each.sample;
  const EntityAir* air = each.drive.air;
  const physics::AirFilm& begin = air != nullptr ? air->begin : forcing.begin.film;
  const physics::AirFilm& end = air != nullptr ? air->end : forcing.end.film;
  FilmSpan out;
  out.begin.air_k = air != nullptr ? air->begin_air_k : forcing.begin.air_k;
  out.end.air_k = air != nullptr ? air->end_air_k : forcing.end.air_k;
  out.begin.moist = air != nullptr ? air->begin_moist : forcing.begin.moist;
  out.end.moist = air != nullptr ? air->end_moist : forcing.end.moist;
  const double excess_k = reference_k_ + offset_k(sample.material, *each.state) - out.begin.air_k;
  const physics::FilmSkin& skin = materials_[sample.material].skin;
  const int slot = materials_[sample.material].water_slot;
  const auto add_face = [&](const glm::dvec3& normal, double open_rain_frac, double share_frac) {
    if (slot >= 0) {
      const auto s = static_cast<std::size_t>(slot);
      const double rain_frac = open_rain_frac * rain_by_tilt_frac(normal.z);
      out.begin.wet_frac += share_frac * forcing.begin.wet_frac_at(s, rain_frac);
      out.end.wet_frac += share_frac * forcing.end.wet_frac_at(s, rain_frac);
    }
    const double natural = physics::natural_film_w_m2_k(begin, skin, normal.z, excess_k);
    out.begin.film_w_m2_k +=
        share_frac * physics::joined_film_w_m2_k(begin, skin, natural,
                                                 physics::forced_film_w_m2_k(begin, skin, normal));
    out.end.film_w_m2_k +=
        share_frac * physics::joined_film_w_m2_k(end, skin, natural,
                                                 physics::forced_film_w_m2_k(end, skin, normal));
  };
  // Take the mean of both faces of a sheet. A covered face has no film, so the open one counts.
  const glm::dvec3 normal(each.normal);
  if (each.back == nullptr || each.back->sample.covered) {
    add_face(normal, sample.rain_frac, 1.0);
  } else if (sample.covered) {
    add_face(-normal, each.back->sample.rain_frac, 1.0);
  } else {
    add_face(normal, sample.rain_frac, 0.5);
    add_face(-normal, each.back->sample.rain_frac, 0.5);
  }
  return out;
}

FosterDrive<double> FosterHeat::absorbed(std::uint32_t material, const FilmDrive& film,
                                         const Incoming& in, const PartHeat& part) const noexcept {
  FosterDrive<double> drive{
      .absorbed_w_m2 = materials_[material].solar_absorptance_frac * in.shortwave_w_m2 +
                       materials_[material].emissivity_frac * in.longwave_w_m2 + part.power_w_m2,
      .film_w_m2_k = film.film_w_m2_k,
      .air_offset_k = film.air_k - reference_k_};
  physics::MoistSurface moisture = materials_[material].moisture;
  moisture.film_frac = film.wet_frac;
  physics::add_moisture(moisture, film.moist, in.shortwave_w_m2, drive);
  if (part.contact_w_m2_k > 0.0) {
    // Join film and contact to one conductance, to the mean temperature of their far ends.
    const double film_w_m2 = drive.film_w_m2_k * drive.air_offset_k;
    const double contact_w_m2 = part.contact_w_m2_k * (part.behind_k - reference_k_);
    drive.film_w_m2_k += part.contact_w_m2_k;
    drive.air_offset_k = (film_w_m2 + contact_w_m2) / drive.film_w_m2_k;
  }
  return drive;
}

SampleOutput FosterHeat::output_of(const SurfaceSample& sample, const Incoming& in,
                                   const SampleDrive& drive, double offset_k) const noexcept {
  const FosterMaterial& m = materials_[sample.material];
  SampleOutput out;
  out.offset_k = static_cast<float>(offset_k);
  out.sun_frac = drive.sun_frac;
  // Send out emission and the reflected rest of the incoming radiation.
  out.longwave_out_w_m2 =
      static_cast<float>(m.emissivity_frac * exitance_w_m2(reference_k_ + offset_k) +
                         (1.0 - m.emissivity_frac) * in.longwave_w_m2);
  out.shortwave_out_w_m2 = static_cast<float>((1.0 - m.solar_absorptance_frac) * in.shortwave_w_m2);
  return out;
}

double FosterHeat::offset_k(std::uint32_t material, const SampleState& state) const noexcept {
  if (materials_[material].prescribed()) return materials_[material].prescribed_k - reference_k_;
  return physics::foster_offset_k(state.modes_k, surfaces_[material]) +
         static_cast<double>(state.aside_k);
}

SampleOutput FosterHeat::output(const SurfaceSample& sample, const glm::vec3& normal,
                                const SurfaceForcing& forcing, const SampleDrive& drive,
                                const SampleState& state) const noexcept {
  const Incoming in = incoming(sample, normal, forcing, drive, drive.longwave_begin_w_m2);
  return output_of(sample, in, drive, offset_k(sample.material, state));
}

void FosterHeat::show_state(std::uint32_t material, const SampleState& state,
                            SampleOutput& output) const noexcept {
  const double before_k = reference_k_ + static_cast<double>(output.offset_k);
  const double offset_k = this->offset_k(material, state);
  output.offset_k = static_cast<float>(offset_k);
  output.longwave_out_w_m2 +=
      static_cast<float>(materials_[material].emissivity_frac *
                         (exitance_w_m2(reference_k_ + offset_k) - exitance_w_m2(before_k)));
}

void FosterHeat::begin_column(const SurfaceSample& sample, SampleState& state) const noexcept {
  const physics::ColumnCells& cells = cells_[sample.material];
  const physics::FosterNetwork& network = materials_[sample.material].network;
  // Take the slowest mode for the mean flux of the time before, whose profile is a line.
  const std::size_t slowest = network.count - 1;
  const double flux_w_m2 = state.modes_k[slowest] / network.modes[slowest].resistance_m2k_w;
  const double base_k = surfaces_[sample.material].base_offset_k;
  double below_m2k_w = 0.0;
  for (std::size_t l = cells.count; l-- > 0;) {
    const double rise_k = flux_w_m2 * (below_m2k_w + 0.5 * cells.resistance_m2k_w[l]);
    state.cells_k[l] = static_cast<float>(base_k + sample.before_frac * rise_k);
    state.alone_k[l] = static_cast<float>(sample.covered ? base_k : base_k + rise_k);
    below_m2k_w += cells.resistance_m2k_w[l];
  }
  // A surface that nothing reaches has no flux of its own: all of its heat comes from beside it.
  if (sample.covered) {
    state.modes_k = {};
    state.aside_k = static_cast<float>(static_cast<double>(state.cells_k[0]) - base_k);
  } else {
    state.aside_k = static_cast<float>(-(1.0 - sample.before_frac) * flux_w_m2 * below_m2k_w);
  }
}

ColumnEquations FosterHeat::column_equations(const SampleAdvance& each,
                                             const HeatInterval& interval,
                                             const FosterDrive<double>& end) const noexcept {
  const SurfaceSample& sample = *each.sample;
  const SampleColumn& column = *each.drive.aside.column;
  const physics::ColumnCells& cells = cells_[sample.material];
  // An interval without length, as at the start of the history, leaves the cells as they are.
  constexpr double kShortestS = 1e-3;
  const double per_s = 1.0 / std::max(interval.forcing.dt_s, kShortestS);
  const double base_k =
      sample.body >= 0 ? each.drive.body_k : surfaces_[sample.material].base_offset_k;
  ColumnEquations out;
  out.count = cells.count;
  // Advance the cells as they are alone: their surface has the temperature of the modes.
  physics::CellState<double> diagonal{};
  physics::CellState<double> right{};
  for (std::size_t l = 0; l < cells.count; ++l) {
    const double below = cells.below_w_m2_k(l);
    diagonal[l] += cells.heat_j_m2_k[l] * per_s + below;
    right[l] += cells.heat_j_m2_k[l] * per_s * each.state->alone_k[l];
    out.below_w_m2_k[l] = below;
    if (l + 1 < cells.count) {
      diagonal[l + 1] += below;
    } else {
      right[l] += below * base_k;
    }
  }
  if (!sample.covered) {
    diagonal[0] += cells.surface_w_m2_k();
    right[0] += cells.surface_w_m2_k() *
                physics::foster_offset_k(each.state->modes_k, surfaces_[sample.material]);
  }
  out.alone_k = solve_column(cells.count, diagonal, out.below_w_m2_k, right);
  double into_w_m2 = 0.0;
  if (!sample.covered) {
    const double next_k = cells.count > 1 ? out.alone_k[1] : base_k;
    into_w_m2 = cells.heat_j_m2_k[0] * per_s * (out.alone_k[0] - each.state->alone_k[0]) +
                cells.below_w_m2_k(0) * (out.alone_k[0] - next_k);
  }
  // Give the cells with neighbours what their own surface takes up (physics.md eq. 80): the flux
  // into the cells alone, and what the balance of the surface gains or loses at another temperature
  // than the one at which the modes are driven.
  const double alone_surface_k =
      physics::foster_offset_k(each.state->modes_k, surfaces_[sample.material]);
  const double change_k = static_cast<double>(each.state->aside_k) + each.drive.aside.change_k;
  out.aside_offset_k = -alone_surface_k;
  if (!sample.covered) {
    const physics::FosterSurface<double>& surface = surfaces_[sample.material];
    const double expected_k = alone_surface_k + change_k;
    const double t_k = reference_k_ + expected_k;
    const double slope_w_m2_k = 4.0 * surface.emission_w_m2_k4 * t_k * t_k * t_k + end.film_w_m2_k +
                                physics::latent_flux(t_k, end).slope_w_m2_k;
    const double at_zero_w_m2 =
        into_w_m2 + physics::foster_flux_w_m2(expected_k, end, surface) -
        physics::foster_flux_w_m2(alone_surface_k + sample.felt_frac * change_k, end, surface) +
        slope_w_m2_k * expected_k;
    const double above_m2k_w = sample.excess_frac / cells.surface_w_m2_k();
    const double part = 1.0 / (1.0 + slope_w_m2_k * above_m2k_w);
    out.surface_frac = part;
    out.aside_offset_k += above_m2k_w * part * at_zero_w_m2;
    out.diagonal_w_m2_k[0] += sample.exposed_frac * part * slope_w_m2_k;
    out.right_w_m2[0] += sample.exposed_frac * part * at_zero_w_m2;
  }
  for (std::size_t l = 0; l < cells.count; ++l) {
    const double held_w_m2_k = cells.heat_j_m2_k[l] * column.share_frac[l] * per_s;
    const double below = column.below_w_m2_k[l];
    out.diagonal_w_m2_k[l] += held_w_m2_k + below;
    out.right_w_m2[l] += held_w_m2_k * each.state->cells_k[l];
    out.below_w_m2_k[l] = below;
    if (l + 1 < cells.count) {
      out.diagonal_w_m2_k[l + 1] += below;
    } else {
      out.right_w_m2[l] += below * base_k;
    }
  }
  return out;
}

BesideColumn FosterHeat::beside(const SurfaceSamples& all, const SampleColumn& column,
                                std::span<const SampleState> states) const noexcept {
  BesideColumn out;
  const physics::CellState<float>& own_k = states[column.sample].cells_k;
  for (std::size_t l = 0; l < physics::kMaxColumnCells; ++l) {
    for (std::uint32_t k = column.first_link[l]; k < column.first_link[l + 1]; ++k) {
      const CellLink& link = all.links[k];
      out.conductance_w_m2_k[l] += link.conductance_w_m2_k;
      out.mean_k[l] +=
          link.conductance_w_m2_k * states[all.columns[link.column].sample].cells_k[link.cell];
    }
    if (!(out.conductance_w_m2_k[l] > 0.0)) continue;
    // Neighbours move towards the cell while it moves towards them, so that they meet half way:
    // twice the conductance leads to the middle between both. Closely coupled cells would take each
    // other's temperature in turn without it.
    out.mean_k[l] = 0.5 * (own_k[l] + out.mean_k[l] / out.conductance_w_m2_k[l]);
    out.conductance_w_m2_k[l] *= 2.0;
  }
  return out;
}

void FosterHeat::conduct_aside(const SampleAdvance& each, const HeatInterval& interval,
                               const FosterDrive<double>& end) const noexcept {
  const ColumnDrive& aside = each.drive.aside;
  if (aside.beside == nullptr && aside.equations == nullptr) return;
  ColumnEquations equations = column_equations(each, interval, end);
  if (aside.equations != nullptr) {
    *aside.equations = equations;
    return;
  }
  for (std::size_t l = 0; l < equations.count; ++l) {
    equations.diagonal_w_m2_k[l] += aside.beside->conductance_w_m2_k[l];
    equations.right_w_m2[l] += aside.beside->conductance_w_m2_k[l] * aside.beside->mean_k[l];
  }
  const physics::CellState<double> cells_k = solve_column(
      equations.count, equations.diagonal_w_m2_k, equations.below_w_m2_k, equations.right_w_m2);
  keep_cells(equations, cells_k, *each.state);
}

bool FosterHeat::begin_advance(const SampleAdvance& each, const HeatInterval& interval,
                               const Incoming& end, const FilmSpan& film,
                               physics::FosterLane& lane) const noexcept {
  const SurfaceSample& sample = *each.sample;
  const SampleDrive& drive = each.drive;
  const IntervalForcing& forcing = interval.forcing;
  // Gather what drives the body at both ends of the interval.
  const Incoming begin =
      incoming(sample, each.normal, forcing.begin, drive, drive.longwave_begin_w_m2);
  const Incoming body_begin = into_body(begin, sample.covered, each.normal, forcing.begin,
                                        each.back, &SampleDrive::longwave_begin_w_m2);
  const Incoming body_end = into_body(end, sample.covered, each.normal, forcing.end, each.back,
                                      &SampleDrive::longwave_end_w_m2);
  lane.ladder = &interval.ladders[sample.material];
  FosterSurface<double>& surface = lane.surface;
  surface = surfaces_[sample.material];
  surface.base_offset_k += count_from_body(each, -1.0);
  // Heat from neighbours shifts the temperature above which the own flux acts. Its mean over
  // the interval is added to the base.
  if (sample.column != kNoSample || sample.twin_of != kNoSample) {
    surface.base_offset_k +=
        sample.felt_frac * (static_cast<double>(each.state->aside_k) + 0.5 * drive.aside.change_k);
  }
  // Let the modes decay without any flux if all faces are covered.
  if (sample.covered && (each.back == nullptr || each.back->sample.covered)) {
    relax(each.state->modes_k, lane.ladder->level[0]);
    return false;
  }
  lane.x = &each.state->modes_k;
  lane.begin = absorbed(sample.material, film.begin, body_begin, drive.part.begin);
  lane.end = absorbed(sample.material, film.end, body_end, drive.part.end);
  return true;
}

BaseConductance FosterHeat::base_conductance(std::uint32_t material) const noexcept {
  const FosterMaterial& m = materials_[material];
  BaseConductance out;
  for (std::size_t i = 0; i < m.network.count; ++i) {
    out.sudden_w_m2_k += m.base_shares[i] * m.base_shares[i] / m.network.modes[i].resistance_m2k_w;
  }
  if (m.network.count != 0) out.steady_w_m2_k = 1.0 / m.network.resistance_m2k_w();
  return out;
}

double FosterHeat::into_base_w_m2(std::uint32_t material, const SampleState& state) const noexcept {
  const FosterMaterial& m = materials_[material];
  const double base_k = surfaces_[material].base_offset_k;
  double flux_w_m2 = 0.0;
  for (std::size_t i = 0; i < m.network.count; ++i) {
    flux_w_m2 += m.base_shares[i] / m.network.modes[i].resistance_m2k_w *
                 (state.modes_k[i] + m.base_shares[i] * base_k);
  }
  return flux_w_m2;
}

double FosterHeat::mean_flux_w_m2(const SurfaceSample& sample, const SampleState& begin,
                                  double begin_base_offset_k, const SampleState& end,
                                  double end_base_offset_k, double dt_s) const noexcept {
  EMIT_CHECK_OP(dt_s, >, 0.0);
  const FosterMaterial& m = materials_[sample.material];
  if (m.prescribed()) return std::numeric_limits<double>::quiet_NaN();
  if (sample.covered) return 0.0;
  // Neighbours change the flux. Read it off the drop between the surface and its first cell.
  if (sample.column != kNoSample) {
    const auto drop_k = [&](const SampleState& state) {
      return offset_k(sample.material, state) - static_cast<double>(state.cells_k[0]);
    };
    return 0.5 * (drop_k(begin) + drop_k(end)) * cells_[sample.material].surface_w_m2_k() /
           sample.excess_frac;
  }
  const std::size_t i = m.network.count - 1;
  // Solve eq. 17 for the constant flux that leads from one state to the other. States count from
  // the base of the material, modes from the base of the sample.
  const double own_base_k = surfaces_[sample.material].base_offset_k;
  const double begin_k = begin.modes_k[i] - m.base_shares[i] * (begin_base_offset_k - own_base_k);
  const double end_k = end.modes_k[i] - m.base_shares[i] * (end_base_offset_k - own_base_k);
  const double decay = -std::expm1(-dt_s / m.network.modes[i].tau_s);
  return (end_k - begin_k + decay * begin_k) / (m.network.modes[i].resistance_m2k_w * decay);
}

double FosterHeat::count_from_body(const SampleAdvance& each, double sign) const noexcept {
  const SurfaceSample& sample = *each.sample;
  if (sample.body < 0) return 0.0;
  const double warmer_k = each.drive.body_k - surfaces_[sample.material].base_offset_k;
  const FosterState<double>& shares = materials_[sample.material].base_shares;
  for (std::size_t i = 0; i < physics::kMaxFosterModes; ++i) {
    each.state->modes_k[i] += sign * shares[i] * warmer_k;
  }
  return warmer_k;
}

template <std::size_t most>
void FosterHeat::advance_group(std::span<SampleAdvance> group,
                               const HeatInterval& interval) const noexcept {
  const SurfaceForcing& at_end = interval.forcing.end;
  // Collect the samples whose own modes the surface balance drives.
  std::array<Incoming, most> ends;
  std::array<FosterDrive<double>, most> end_drives;  // of a covered sample: nothing
  std::array<physics::FosterLane, most> lanes;
  std::size_t count = 0;
  for (std::size_t i = 0; i < group.size(); ++i) {
    SampleAdvance& each = group[i];
    each.bow_k = 0.0;
    ends[i] = incoming(*each.sample, each.normal, at_end, each.drive, each.drive.longwave_end_w_m2);
    if (materials_[each.sample->material].prescribed()) continue;
    const FilmSpan film = film_over(each, interval.forcing);
    if (begin_advance(each, interval, ends[i], film, lanes[count])) {
      lanes[count].bow_k = &each.bow_k;
      end_drives[i] = lanes[count++].end;
    }
  }
  physics::foster_advance_all(std::span(lanes).first(count), tolerance_k_);
  for (std::size_t i = 0; i < group.size(); ++i) {
    SampleAdvance& each = group[i];
    count_from_body(each, 1.0);
    if (each.drive.aside.column != nullptr) conduct_aside(each, interval, end_drives[i]);
    each.output =
        output_of(*each.sample, ends[i], each.drive, offset_k(each.sample->material, *each.state));
  }
}

void FosterHeat::advance(std::span<SampleAdvance> samples,
                         const HeatInterval& interval) const noexcept {
  while (samples.size() > 1) {
    const std::size_t count = std::min(samples.size(), kAdvanceTogether);
    advance_group<kAdvanceTogether>(samples.first(count), interval);
    samples = samples.subspan(count);
  }
  // Spare a single sample the room for others.
  if (!samples.empty()) advance_group<1>(samples, interval);
}

void FosterHeat::advance_unshadowed(std::uint32_t material, const glm::vec3& normal,
                                    const HeatInterval& interval,
                                    FosterState<double>& modes_k) const noexcept {
  if (materials_[material].prescribed()) return;
  const double offset_k = physics::foster_offset_k(modes_k, surfaces_[material]);
  const auto drive = [&](const SurfaceForcing& forcing) {
    return unshadowed_drive(forcing, materials_[material], glm::dvec3(normal), reference_k_,
                            offset_k);
  };
  physics::foster_advance(modes_k, drive(interval.forcing.begin), drive(interval.forcing.end),
                          interval.ladders[material], surfaces_[material], tolerance_k_);
}

void FosterHeat::step_response(std::uint32_t material, const ResponseConditions& around,
                               std::span<const double> times_s,
                               std::span<double> response_m2k_w) const noexcept {
  const FosterMaterial& m = materials_[material];
  std::ranges::fill(response_m2k_w, 0.0);
  if (m.prescribed() || m.sheet) return;
  // Linearise the losses: convection, the slope of thermal emission, and evaporation in the light.
  const double t = around.surface_k;
  FosterDrive<double> moist{.film_w_m2_k = around.film_w_m2_k};
  physics::add_moisture(m.moisture, around.moist, physics::kOpenStomataWM2, moist);
  const double h_w_m2_k = around.film_w_m2_k +
                          4.0 * m.emissivity_frac * physics::kStefanBoltzmannWPerM2K4 * t * t * t +
                          physics::latent_flux(t, moist).slope_w_m2_k;
  // Integrate tau x' = r q - x with q = 1 - h sum x by implicit steps: they are stable for any
  // ratio of step and time constant.
  constexpr int kParts = 16;
  FosterState<double> x{};
  double now_s = 0.0;
  for (std::size_t j = 0; j < times_s.size(); ++j) {
    const double dt_s = (times_s[j] - now_s) / kParts;
    for (int part = 0; part < kParts; ++part) {
      // Solve the step for the flux at its end. `left` is what the old states leave of the
      // temperature, `driven` what a unit of flux adds.
      double left = 0.0;
      double driven = 0.0;
      for (std::size_t i = 0; i < m.network.count; ++i) {
        const physics::NetworkMode& mode = m.network.modes[i];
        left += x[i] * mode.tau_s / (mode.tau_s + dt_s);
        driven += mode.resistance_m2k_w * dt_s / (mode.tau_s + dt_s);
      }
      const double q = (1.0 - h_w_m2_k * left) / (1.0 + h_w_m2_k * driven);
      for (std::size_t i = 0; i < m.network.count; ++i) {
        const physics::NetworkMode& mode = m.network.modes[i];
        x[i] = (x[i] * mode.tau_s + mode.resistance_m2k_w * q * dt_s) / (mode.tau_s + dt_s);
      }
    }
    now_s = times_s[j];
    // Scale by the absorbed share of the direct sunlight.
    response_m2k_w[j] = m.solar_absorptance_frac * physics::foster_sum(x);
  }
}

}  // namespace emit::renderer
