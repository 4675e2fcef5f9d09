// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/foster.hpp"

#include <algorithm>
#include <type_traits>

#include "emit/physics/surface/wide_lanes.hpp"

namespace emit::physics {

std::complex<double> stack_impedance_m2k_w(std::span<const StackLayer> layers,
                                           double angular_rad_s) noexcept {
  std::complex<double> z = 0.0;  // the base is isothermal
  for (auto layer = layers.rbegin(); layer != layers.rend(); ++layer) {
    // Pass from below through every layer, physics.md eq. 19.
    const std::complex<double> g = std::sqrt(std::complex<double>(
        0.0, angular_rad_s * layer->volumetric_heat_j_m3_k / layer->conductivity_w_m_k));
    const std::complex<double> gd = g * layer->thickness_m;
    // Treat a thin layer as a plain resistance: its own impedance is infinite at frequency 0.
    if (std::abs(gd) < 1e-6) {
      z += layer->thickness_m / layer->conductivity_w_m_k;
      continue;
    }
    const std::complex<double> own = 1.0 / (layer->conductivity_w_m_k * g);
    const std::complex<double> t = std::tanh(gd);
    z = own * (z + own * t) / (own + z * t);
  }
  return z;
}

std::complex<double> network_impedance_m2k_w(const FosterNetwork& network,
                                             double angular_rad_s) noexcept {
  std::complex<double> z = 0.0;
  for (std::size_t i = 0; i < network.count; ++i) {
    z += network.modes[i].resistance_m2k_w /
         std::complex<double>(1.0, angular_rad_s * network.modes[i].tau_s);
  }
  return z;
}

FosterGains<double> foster_gains(double dt_s, const FosterNetwork& network) noexcept {
  FosterGains<double> gains;
  for (std::size_t i = 0; i < network.count; ++i) {
    const RelaxationGains<double> g = relaxation_gains(dt_s, network.modes[i].tau_s);
    gains.start_frac[i] = g.start_frac;
    gains.end_frac[i] = g.end_frac;
  }
  return gains;
}

FosterGains<double> foster_doubled(const FosterGains<double>& gains) noexcept {
  FosterGains<double> out;
  for (std::size_t i = 0; i < kMaxFosterModes; ++i) {
    // 1 - E^2 = t (2 - t) and phi(2z) = phi(z) (1 + E) / 2 with t = 1 - E.
    const double total = gains.start_frac[i] + gains.end_frac[i];
    const double end = gains.end_frac[i] + 0.5 * total * (1.0 - gains.end_frac[i]);
    out.end_frac[i] = end;
    out.start_frac[i] = total * (2.0 - total) - end;
  }
  return out;
}

FosterSurface<double> foster_surface(const FosterNetwork& network, double emissivity_frac,
                                     double base_k, double reference_k) noexcept {
  FosterSurface<double> surface;
  surface.emission_w_m2_k4 = emissivity_frac * kStefanBoltzmannWPerM2K4;
  for (std::size_t i = 0; i < network.count; ++i) {
    surface.resistance_m2k_w[i] = network.modes[i].resistance_m2k_w;
  }
  surface.base_offset_k = base_k - reference_k;
  surface.reference_k = reference_k;
  return surface;
}

FosterLadder foster_ladder(double dt_s, const FosterNetwork& network) noexcept {
  FosterLadder ladder;
  ladder.modes = network.count;
  // Compute the finest level and double it up to the whole interval.
  ladder.level[kMaxFosterLevel] =
      foster_gains(dt_s / static_cast<double>(1 << kMaxFosterLevel), network);
  for (int i = kMaxFosterLevel; i > 0; --i) {
    const auto level = static_cast<std::size_t>(i);
    ladder.level[level - 1] = foster_doubled(ladder.level[level]);
  }
  return ladder;
}

namespace {

/// Advances as foster_advance() does. `gains_at(level)` returns the gains of a level. `bow_k` takes
/// FosterAdvance::bow_k. Lanes that have converged keep their result while others go on.
template <std::size_t kModes, class Real, class GainsAt>
FosterAdvance advance_controlled(FosterState<Real>& x, const FosterDrive<Real>& begin,
                                 const FosterDrive<Real>& end, const GainsAt& gains_at,
                                 const FosterSurface<Real>& surface, double tolerance_k,
                                 Real& bow_k) noexcept {
  using std::abs;
  FosterAdvance result;
  // Start with one step, then halve the steps until the result stops moving.
  const FosterState<Real> start = x;
  Mask<Real> clamped = foster_step<kModes>(x, begin, end, gains_at(0), surface);
  Mask<Real> moves = Mask<Real>(true);
  for (int level = 1; level <= kMaxFosterLevel; ++level) {
    const FosterGains<Real> gains = gains_at(static_cast<std::size_t>(level));
    const int steps = 1 << level;
    FosterState<Real> fine = start;
    FosterDrive<Real> from = begin;
    Real middle_k = Real(0.0);
    for (int i = 1; i <= steps; ++i) {
      const FosterDrive<Real> to =
          i == steps ? end : lerp(begin, end, Real(static_cast<double>(i) / steps));
      clamped = either(foster_step<kModes>(fine, from, to, gains, surface), clamped);
      from = to;
      if (2 * i == steps) middle_k = foster_offset_k<kModes>(fine, surface);
    }
    const Real end_k = foster_offset_k<kModes>(fine, surface);
    bow_k = choose(moves, middle_k - Real(0.5) * (foster_offset_k<kModes>(start, surface) + end_k),
                   bow_k);
    // Compare with the coarser result. Step doubling of a second-order scheme leaves a third of the
    // change as error.
    Real change_k = abs(end_k - foster_offset_k<kModes>(x, surface));
    for (std::size_t i = 0; i < kModes; ++i) {
      const Real mode_k = abs(fine[i] - x[i]);
      change_k = choose(Mask<Real>(change_k < mode_k), mode_k, change_k);
      x[i] = choose(moves, fine[i], x[i]);
    }
    moves = both(moves, Mask<Real>(change_k > Real(tolerance_k)));
    if constexpr (std::is_same_v<Real, double>) {
      result.level = level;
      result.error_k = change_k / 3.0;
      result.clamped = clamped;
    }
    if (none(moves)) break;
  }
  return result;
}

static_assert(kFosterLanes == kWideLanes);

/// Advances as many surfaces as there are lanes. None of them has more than `kModes` modes.
template <class Lanes, std::size_t kModes>
[[gnu::always_inline]] inline void advance_lanes(
    const std::array<const FosterLane*, kFosterLanes>& lanes, double tolerance_k) noexcept {
  // Takes one value a lane; `value` takes the number of the lane.
  const auto gathered = [](const auto& value) {
    std::array<double, kFosterLanes> out;
    for (std::size_t l = 0; l < kFosterLanes; ++l) out[l] = value(l);
    return Lanes(out);
  };
  const auto drive = [&](FosterDrive<double> FosterLane::*which) {
    return FosterDrive<Lanes>{
        gathered([&](std::size_t l) { return (lanes[l]->*which).absorbed_w_m2; }),
        gathered([&](std::size_t l) { return (lanes[l]->*which).film_w_m2_k; }),
        gathered([&](std::size_t l) { return (lanes[l]->*which).air_offset_k; }),
        gathered([&](std::size_t l) { return (lanes[l]->*which).evaporation_w_m2_pa; }),
        gathered([&](std::size_t l) { return (lanes[l]->*which).dew_w_m2_pa; }),
        gathered([&](std::size_t l) { return (lanes[l]->*which).vapour_pa; })};
  };
  FosterSurface<Lanes> surface;
  surface.emission_w_m2_k4 =
      gathered([&](std::size_t l) { return lanes[l]->surface.emission_w_m2_k4; });
  surface.base_offset_k = gathered([&](std::size_t l) { return lanes[l]->surface.base_offset_k; });
  surface.reference_k = gathered([&](std::size_t l) { return lanes[l]->surface.reference_k; });
  FosterState<Lanes> x;
  for (std::size_t i = 0; i < kModes; ++i) {
    surface.resistance_m2k_w[i] =
        gathered([&](std::size_t l) { return lanes[l]->surface.resistance_m2k_w[i]; });
    x[i] = gathered([&](std::size_t l) { return (*lanes[l]->x)[i]; });
  }
  const auto gains_at = [&](std::size_t level) {
    FosterGains<Lanes> gains;
    for (std::size_t i = 0; i < kModes; ++i) {
      gains.start_frac[i] =
          gathered([&](std::size_t l) { return lanes[l]->ladder->level[level].start_frac[i]; });
      gains.end_frac[i] =
          gathered([&](std::size_t l) { return lanes[l]->ladder->level[level].end_frac[i]; });
    }
    return gains;
  };
  Lanes bow_k = Lanes(0.0);
  advance_controlled<kModes>(x, drive(&FosterLane::begin), drive(&FosterLane::end), gains_at,
                             surface, tolerance_k, bow_k);
  for (std::size_t l = 0; l < kFosterLanes; ++l) {
    if (lanes[l]->bow_k != nullptr) *lanes[l]->bow_k = bow_k[l];
    for (std::size_t i = 0; i < kModes; ++i) (*lanes[l]->x)[i] = x[i][l];
  }
}

}  // namespace

FosterAdvance foster_advance(FosterState<double>& x, const FosterDrive<double>& begin,
                             const FosterDrive<double>& end, const FosterLadder& ladder,
                             const FosterSurface<double>& surface, double tolerance_k) noexcept {
  double bow_k = 0.0;
  FosterAdvance result = advance_controlled<kMaxFosterModes>(
      x, begin, end, [&](std::size_t level) -> const auto& { return ladder.level[level]; }, surface,
      tolerance_k, bow_k);
  result.bow_k = bow_k;
  return result;
}

namespace {

using AdvanceGroup = void (*)(const std::array<const FosterLane*, kFosterLanes>& lanes,
                              double tolerance_k) noexcept;

/// `flatten` inlines all that is called, so that it is compiled for these registers.
template <std::size_t kModes>
[[gnu::flatten]] void advance_plain(const std::array<const FosterLane*, kFosterLanes>& lanes,
                                    double tolerance_k) noexcept {
  advance_lanes<WideLanes<16>, kModes>(lanes, tolerance_k);
}

// clang inlines no function into one of another target, so it takes the plain one.
#if defined(__x86_64__) && !defined(__clang__)
#define EMIT_HAS_AVX2_LANES
template <std::size_t kModes>
[[gnu::flatten, gnu::target("avx2")]] void advance_avx2(
    const std::array<const FosterLane*, kFosterLanes>& lanes, double tolerance_k) noexcept {
  advance_lanes<WideLanes<32>, kModes>(lanes, tolerance_k);
}
#endif

/// Returns the fastest function that this machine runs. All have the same bits, because none fuses
/// multiplications with additions.
template <std::size_t kModes>
AdvanceGroup fastest_advance() noexcept {
#if defined(EMIT_HAS_AVX2_LANES)
  if (__builtin_cpu_supports("avx2")) return advance_avx2<kModes>;
#endif
  return advance_plain<kModes>;
}

}  // namespace

void foster_advance_all(std::span<const FosterLane> lanes, double tolerance_k) noexcept {
  static const AdvanceGroup advance_few = fastest_advance<kFewFosterModes>();
  static const AdvanceGroup advance_all = fastest_advance<kMaxFosterModes>();
  while (lanes.size() > 1) {
    // Fill lanes without a surface with the first one, whose result is stored again.
    std::array<const FosterLane*, kFosterLanes> group;
    group.fill(&lanes.front());
    const std::size_t count = std::min(lanes.size(), kFosterLanes);
    for (std::size_t l = 0; l < count; ++l) group[l] = &lanes[l];
    const bool few = std::ranges::all_of(
        group, [](const FosterLane* lane) { return lane->ladder->modes <= kFewFosterModes; });
    (few ? advance_few : advance_all)(group, tolerance_k);
    lanes = lanes.subspan(count);
  }
  for (const FosterLane& lane : lanes) {
    const FosterAdvance result =
        foster_advance(*lane.x, lane.begin, lane.end, *lane.ladder, lane.surface, tolerance_k);
    if (lane.bow_k != nullptr) *lane.bow_k = result.bow_k;
  }
}

}  // namespace emit::physics
