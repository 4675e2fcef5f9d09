// SPDX-License-Identifier: Apache-2.0
#include "surface/heat/foster_heat.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

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

/// Adds all modes, in a fixed order.
double sum(const FosterState<double>& x) noexcept {
  return (x[0] + x[1]) + (x[2] + x[3]);
}

/// Returns the product of a matrix and a vector.
FosterState<double> product(const physics::ColumnModes::Matrix& a,
                            const FosterState<double>& x) noexcept {
  FosterState<double> out{};
  for (std::size_t l = 0; l < physics::kMaxFosterModes; ++l) {
    out[l] = (a[l][0] * x[0] + a[l][1] * x[1]) + (a[l][2] * x[2] + a[l][3] * x[3]);
  }
  return out;
}

/// Returns true if a column has the modes of a network, in the same order.
bool same_modes(const physics::FosterNetwork& network, const physics::ConductionColumn& column) {
  const physics::FosterNetwork found = physics::modes_of_column(column).network;
  if (found.count != network.count) return false;
  constexpr double kSame = 1e-6;
  for (std::size_t i = 0; i < found.count; ++i) {
    const physics::NetworkMode& a = found.modes[i];
    const physics::NetworkMode& b = network.modes[i];
    if (std::abs(a.tau_s - b.tau_s) > kSame * b.tau_s ||
        std::abs(a.resistance_m2k_w - b.resistance_m2k_w) > kSame * b.resistance_m2k_w) {
      return false;
    }
  }
  return true;
}

}  // namespace

FosterHeat::FosterHeat(std::span<const FosterMaterial> materials, double reference_k,
                       double tolerance_k)
    : materials_(materials.begin(), materials.end()),
      reference_k_(reference_k),
      tolerance_k_(tolerance_k) {
  // Keep to one dimension what has no column with the same modes, as where two of them coincide.
  for (FosterMaterial& material : materials_) {
    if (!same_modes(material.network, physics::column_of_network(material.network))) {
      material.layers.clear();
    }
  }
  for (std::uint32_t cut = 0; cut <= kColumnCuts; ++cut) {
    for (const FosterMaterial& material : materials_) {
      Stack stack;
      stack.network = material.network;
      stack.base_shares = material.base_shares;
      if (!material.layers.empty()) {
        stack.column = physics::column_of_network(material.network);
        if (cut != 0) {
          double depth_m = 0.0;
          for (const physics::StackLayer& layer : material.layers) depth_m += layer.thickness_m;
          stack.column =
              physics::cut_column(material.layers, stack.column, cut_frac(cut) * depth_m);
        }
        stack.depths = physics::depths_of_column(material.layers, stack.column);
        stack.modes = physics::modes_of_column(stack.column);
        if (cut != 0) {
          stack.network = stack.modes.network;
          stack.base_shares = stack.modes.base_shares;
        }
      }
      stack.surface = physics::foster_surface(stack.network, material.emissivity_frac,
                                              material.base_k, reference_k);
      stacks_.push_back(stack);
    }
  }
}

void FosterHeat::prepare(HeatInterval& interval) const noexcept {
  for (std::size_t i = 0; i < stacks_.size(); ++i) {
    const FosterMaterial& material = materials_[i % materials_.size()];
    const bool whole = i < materials_.size();
    if (material.prescribed() || (!whole && material.layers.empty())) continue;
    interval.ladders[i] = physics::foster_ladder(interval.forcing.dt_s, stacks_[i].network);
    if (!material.layers.empty()) interval.sides[i] = side_response(i, interval.ladders[i]);
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
  // Reduce the states next to a solid: it kept the sun from the ground before the history too
  // (physics.md eq. 23).
  for (std::size_t i = 0; i < physics::kMaxFosterModes; ++i) {
    state.modes_k[i] *= sample.open_before_frac[i];
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
  const double excess_k = reference_k_ + offset_k(sample.material, *each.state) - out.begin.air_k;
  const double roughness = materials_[sample.material].roughness;
  const auto add_face = [&](const glm::dvec3& normal, double share_frac) {
    const double natural = physics::natural_film_w_m2_k(begin, normal.z, excess_k);
    out.begin.film_w_m2_k +=
        share_frac * physics::joined_film_w_m2_k(
                         begin, natural, physics::forced_film_w_m2_k(begin, normal), roughness);
    out.end.film_w_m2_k +=
        share_frac * physics::joined_film_w_m2_k(
                         end, natural, physics::forced_film_w_m2_k(end, normal), roughness);
  };
  // Take the mean of both faces of a sheet. A covered face has no film, so the open one counts.
  const glm::dvec3 normal(each.normal);
  if (each.back == nullptr || each.back->sample.covered) {
    add_face(normal, 1.0);
  } else if (sample.covered) {
    add_face(-normal, 1.0);
  } else {
    add_face(normal, 0.5);
    add_face(-normal, 0.5);
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

double FosterHeat::offset_k(const SurfaceSample& sample, const SampleState& state) const noexcept {
  const FosterMaterial& material = materials_[sample.material];
  if (material.prescribed()) return material.prescribed_k - reference_k_;
  return physics::foster_offset_k(state.modes_k, stacks_[stack_of(sample)].surface);
}

void FosterHeat::cut(const SurfaceSample& sample, SampleState& state) const noexcept {
  if (sample.cut == 0) return;
  const FosterState<double> lumps_k =
      product(stacks_[sample.material].modes.lump_from_mode, state.modes_k);
  state.modes_k = product(stacks_[stack_of(sample)].modes.mode_from_lump, lumps_k);
}

FosterState<double> FosterHeat::lumps_k(const SurfaceSample& sample, const SampleState& state,
                                        double body_k) const noexcept {
  const Stack& stack = stacks_[stack_of(sample)];
  FosterState<double> modes_k = state.modes_k;
  double base_k = stack.surface.base_offset_k;
  if (sample.body >= 0) {
    const double warmer_k = body_k - base_k;
    for (std::size_t i = 0; i < modes_k.size(); ++i) modes_k[i] -= stack.base_shares[i] * warmer_k;
    base_k = body_k;
  }
  FosterState<double> out = product(stack.modes.lump_from_mode, modes_k);
  for (double& lump_k : out) lump_k += base_k;
  return out;
}

SideHeat FosterHeat::side_heat(const SurfaceSamples& all, const SurfaceSample& sample,
                               const SampleState& own, std::span<const SampleState> states,
                               double body_k) const noexcept {
  SideHeat side;
  for (std::uint32_t k = 0; k < sample.link_count; ++k) {
    const SideLink& link = all.links[sample.first_link + k];
    const FosterState<double> other_k =
        lumps_k(all.samples[link.sample], states[link.sample], body_k);
    for (std::size_t l = 0; l < other_k.size(); ++l) {
      side.conductance_w_m2_k[l] += link.conductance_w_m2_k[l];
      side.mean_k[l] += link.conductance_w_m2_k[l] * other_k[l];
    }
  }
  // Neighbours move towards the sample while it moves towards them, so that they meet half way:
  // twice the conductance leads to the middle between both. Closely coupled samples would take each
  // other's temperature in turn without it.
  const FosterState<double> own_k = lumps_k(sample, own, body_k);
  for (std::size_t l = 0; l < side.mean_k.size(); ++l) {
    if (!(side.conductance_w_m2_k[l] > 0.0)) continue;
    side.mean_k[l] = 0.5 * (own_k[l] + side.mean_k[l] / side.conductance_w_m2_k[l]);
    side.conductance_w_m2_k[l] *= 2.0;
  }
  return side;
}

SideResponse FosterHeat::side_response(std::size_t index,
                                       const physics::FosterLadder& ladder) const noexcept {
  const Stack& stack = stacks_[index];
  const physics::FosterGains<double>& gains = ladder.level[0];
  SideResponse out;
  for (std::size_t i = 0; i < stack.network.count; ++i) {
    const physics::NetworkMode& mode = stack.network.modes[i];
    // A steady flux into lump m drives mode i by its share of that lump.
    const double steady_s = mode.tau_s * (gains.start_frac[i] + gains.end_frac[i]);
    for (std::size_t l = 0; l < stack.column.count; ++l) {
      const double own = stack.modes.lump_from_mode[l][i];
      out.to_surface[l] += own * mode.resistance_m2k_w * gains.end_frac[i];
      for (std::size_t m = 0; m < stack.column.count; ++m) {
        out.to_side[l][m] +=
            own * steady_s * stack.modes.mode_from_lump[i][m] / stack.column.heat_j_m2_k[m];
      }
    }
  }
  return out;
}

double FosterHeat::losses_w_m2_k(const SurfaceSample& sample, const HeatInterval& interval,
                                 const SampleDrive& drive, double offset_k) const noexcept {
  if (sample.covered) return 0.0;
  const double t = reference_k_ + offset_k;
  return 4.0 * stacks_[stack_of(sample)].surface.emission_w_m2_k4 * t * t * t +
         interval.forcing.end.film_w_m2_k + drive.part.end.contact_w_m2_k;
}

physics::ColumnModes::Matrix FosterHeat::side_gains(const SurfaceSample& sample,
                                                    const HeatInterval& interval,
                                                    const SampleDrive& drive, const SideHeat& side,
                                                    double offset_k) const noexcept {
  const std::size_t index = stack_of(sample);
  const std::size_t count = stacks_[index].column.count;
  const SideResponse& response = interval.sides[index];
  const double losses = losses_w_m2_k(sample, interval, drive, offset_k);
  // Take the losses of the surface into the answer: its flux falls by them as it warms.
  physics::ColumnModes::Matrix a = response.to_side;
  const double held = losses / (1.0 + losses * response.to_surface[0]);
  for (std::size_t l = 0; l < count; ++l) {
    for (std::size_t m = 0; m < count; ++m) {
      a[l][m] -= response.to_surface[l] * held * response.to_side[0][m];
      a[l][m] *= side.conductance_w_m2_k[m];
    }
  }
  // Solve (1 + A) M = A by elimination. A has positive eigenvalues, so that no pivot vanishes.
  physics::ColumnModes::Matrix left = a;
  for (std::size_t l = 0; l < count; ++l) left[l][l] += 1.0;
  for (std::size_t k = 0; k < count; ++k) {
    const double pivot = 1.0 / left[k][k];
    for (std::size_t i = 0; i < count; ++i) {
      if (i == k) continue;
      const double factor = left[i][k] * pivot;
      for (std::size_t j = 0; j < count; ++j) {
        left[i][j] -= factor * left[k][j];
        a[i][j] -= factor * a[k][j];
      }
    }
  }
  for (std::size_t k = 0; k < count; ++k) {
    for (std::size_t j = 0; j < count; ++j) a[k][j] /= left[k][k];
  }
  return a;
}

void FosterHeat::take_aside(const SampleAdvance& each, const HeatInterval& interval,
                            const FosterState<double>& from_w_m2, double change_k,
                            double offset_k) const noexcept {
  const std::size_t index = stack_of(*each.sample);
  const Stack& stack = stacks_[index];
  const physics::FosterGains<double>& gains = interval.ladders[index].level[0];
  const double lost_w_m2 = losses_w_m2_k(*each.sample, interval, each.drive, offset_k) * change_k;
  for (std::size_t i = 0; i < stack.network.count; ++i) {
    const physics::NetworkMode& mode = stack.network.modes[i];
    double rate_k_s = 0.0;
    for (std::size_t m = 0; m < stack.column.count; ++m) {
      rate_k_s += stack.modes.mode_from_lump[i][m] / stack.column.heat_j_m2_k[m] * from_w_m2[m];
    }
    each.state->modes_k[i] += mode.tau_s * (gains.start_frac[i] + gains.end_frac[i]) * rate_k_s -
                              mode.resistance_m2k_w * gains.end_frac[i] * lost_w_m2;
  }
}

void FosterHeat::conduct_aside(const SampleAdvance& each,
                               const HeatInterval& interval) const noexcept {
  const SideHeat& side = each.drive.side;
  if (std::ranges::none_of(side.conductance_w_m2_k, [](double g) { return g > 0.0; })) return;
  const SurfaceSample& sample = *each.sample;
  const Stack& stack = stacks_[stack_of(sample)];
  const double base_k = sample.body >= 0 ? each.drive.body_k : stack.surface.base_offset_k;
  FosterState<double> below_k = product(stack.modes.lump_from_mode, each.state->modes_k);
  for (std::size_t l = 0; l < below_k.size(); ++l)
    below_k[l] = side.mean_k[l] - base_k - below_k[l];
  const double offset_k = side.mean_k[0] - below_k[0];
  const FosterState<double> change_k =
      product(side_gains(sample, interval, each.drive, side, offset_k), below_k);
  FosterState<double> from_w_m2{};
  for (std::size_t l = 0; l < from_w_m2.size(); ++l) {
    from_w_m2[l] = side.conductance_w_m2_k[l] * (below_k[l] - change_k[l]);
  }
  take_aside(each, interval, from_w_m2, change_k[0], offset_k);
}

SampleOutput FosterHeat::output(const SurfaceSample& sample, const glm::vec3& normal,
                                const SurfaceForcing& forcing, const SampleDrive& drive,
                                const SampleState& state) const noexcept {
  const Incoming in = incoming(sample, normal, forcing, drive, drive.longwave_begin_w_m2);
  return output_of(sample, in, drive, offset_k(sample, state));
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
  const std::size_t index = stack_of(sample);
  lane.ladder = &interval.ladders[index];
  // Reduce the resistances at the foot of a solid (physics.md eq. 23).
  FosterSurface<double>& surface = lane.surface;
  surface = stacks_[index].surface;
  surface.base_offset_k += count_from_body(each, -1.0);
  for (std::size_t i = 0; i < physics::kMaxFosterModes; ++i) {
    surface.resistance_m2k_w[i] *= sample.open_frac[i];
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

BaseConductance FosterHeat::base_conductance(const SurfaceSample& sample) const noexcept {
  const Stack& stack = stacks_[stack_of(sample)];
  BaseConductance out;
  for (std::size_t i = 0; i < stack.network.count; ++i) {
    out.sudden_w_m2_k +=
        stack.base_shares[i] * stack.base_shares[i] / stack.network.modes[i].resistance_m2k_w;
  }
  if (stack.network.count != 0) out.steady_w_m2_k = 1.0 / stack.network.resistance_m2k_w();
  return out;
}

double FosterHeat::into_base_w_m2(const SurfaceSample& sample,
                                  const SampleState& state) const noexcept {
  const Stack& stack = stacks_[stack_of(sample)];
  const double base_k = stack.surface.base_offset_k;
  double flux_w_m2 = 0.0;
  for (std::size_t i = 0; i < stack.network.count; ++i) {
    flux_w_m2 += stack.base_shares[i] / stack.network.modes[i].resistance_m2k_w *
                 (state.modes_k[i] + stack.base_shares[i] * base_k);
  }
  return flux_w_m2;
}

double FosterHeat::count_from_body(const SampleAdvance& each, double sign) const noexcept {
  const SurfaceSample& sample = *each.sample;
  if (sample.body < 0) return 0.0;
  const Stack& stack = stacks_[stack_of(sample)];
  const double warmer_k = each.drive.body_k - stack.surface.base_offset_k;
  const FosterState<double>& shares = stack.base_shares;
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
  std::array<FilmDrive, most> end_films;
  std::array<physics::FosterLane, most> lanes;
  std::size_t count = 0;
  for (std::size_t i = 0; i < group.size(); ++i) {
    const SampleAdvance& each = group[i];
    ends[i] = incoming(*each.sample, each.normal, at_end, each.drive, each.drive.longwave_end_w_m2);
    if (materials_[each.sample->material].prescribed()) continue;
    const FilmSpan film = film_over(each, interval.forcing);
    end_films[i] = film.end;
    if (begin_advance(each, interval, ends[i], film, lanes[count])) ++count;
  }
  physics::foster_advance_all(std::span(lanes).first(count), tolerance_k_);
  for (std::size_t i = 0; i < group.size(); ++i) {
    SampleAdvance& each = group[i];
    conduct_aside(each, interval);
    count_from_body(each, 1.0);
    each.output = output_of(*each.sample, ends[i], each.drive, offset_k(*each.sample, *each.state));
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
                          interval.ladders[material], stacks_[material].surface, tolerance_k_);
}

void FosterHeat::step_response(std::uint32_t material, const ResponseConditions& around,
                               std::span<const double> times_s,
                               std::span<double> response_m2k_w) const noexcept {
  const FosterMaterial& m = materials_[material];
  std::ranges::fill(response_m2k_w, 0.0);
  if (m.prescribed() || m.sheet) return;
  // Linearise the losses: convection and the slope of thermal emission.
  const double t = around.surface_k;
  const double h_w_m2_k =
      around.film_w_m2_k + 4.0 * m.emissivity_frac * physics::kStefanBoltzmannWPerM2K4 * t * t * t;
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
    response_m2k_w[j] = m.solar_absorptance_frac * sum(x);
  }
}

}  // namespace emit::renderer
