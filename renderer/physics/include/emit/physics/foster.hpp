// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <span>

#include "emit/physics/constants.hpp"
#include "emit/physics/equilibrium.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/lanes.hpp"
#include "emit/physics/relaxation.hpp"
#include "emit/physics/saturation.hpp"

/// Heat conduction into a stack of layers, modelled by a few flux-driven states (a Foster network):
///
///   T = T_base + sum x_i,   tau_i x_i' = r_i q - x_i,   sum r_i = sum d/lambda
///   q = A + h (T_air - T) - e T^4 - k (e_s(T) - e_a)        (physics.md eq. 16-18, 47)
///
/// x_i are kelvins above the base, q is the net flux into the solid and A is the absorbed flux. A
/// step is implicit in the surface balance and exact for q linear over the step. The new
/// temperature is the root of the quartic of physics.md eq. 4, with P in place of the core
/// temperature and 1/R in place of its conductance. A steady state is that of the same equation.
/// The last term is there for moist surfaces alone; the quartic has its tangent.
/// shaders/lib/foster.glsl is the float32 twin of foster_step().
namespace emit::physics {

/// Largest number of modes of a network.
inline constexpr std::size_t kMaxFosterModes = 6;
/// Number of modes up to which a network is advanced without the work for more. Sheets and shells
/// need no more; ground needs all (physics.md, Modes).
inline constexpr std::size_t kFewFosterModes = 4;

/// One layer of a stack. A stack lists its outermost layer first.
struct StackLayer {
  double thickness_m = 0.0;
  double conductivity_w_m_k = 0.0;
  double volumetric_heat_j_m3_k = 0.0;  ///< density times specific heat
};

/// One mode of a network: its time constant tau_i and its resistance r_i.
struct NetworkMode {
  double tau_s = 0.0;
  double resistance_m2k_w = 0.0;
};

/// Modes of a network, fastest first. Entries from `count` on are zero.
struct FosterNetwork {
  std::array<NetworkMode, kMaxFosterModes> modes{};
  std::size_t count = 0;

  /// Returns sum r_i, m2 K/W.
  [[nodiscard]] double resistance_m2k_w() const noexcept {
    double sum = 0.0;
    for (const NetworkMode& mode : modes) sum += mode.resistance_m2k_w;
    return sum;
  }
};

/// Returns the impedance of a stack over an isothermal base: surface temperature per surface flux
/// at an angular frequency, m2 K/W (physics.md eq. 19). At frequency 0 it is sum d/lambda. Any
/// thread. RT-safe.
[[nodiscard]] std::complex<double> stack_impedance_m2k_w(std::span<const StackLayer> layers,
                                                         double angular_rad_s) noexcept;
/// Returns the impedance sum r_i / (1 + i w tau_i) of a network, m2 K/W. Any thread. RT-safe.
[[nodiscard]] std::complex<double> network_impedance_m2k_w(const FosterNetwork& network,
                                                           double angular_rad_s) noexcept;

/// Options of network_of_stack().
struct NetworkOptions {
  std::size_t modes = kMaxFosterModes;  ///< 1..kMaxFosterModes
  double shortest_period_s = 100.0;
  double longest_period_s = 864'000.0;
  /// Conductance of the surface's heat exchange that the fit assumes, W/m2/K: convection plus
  /// linearised radiation. The fit minimises the error of the temperature, which is that of 1/(h +
  /// 1/Z).
  double film_w_m2_k = 19.0;
};

/// Derives the network of a stack from its impedance over the given periods. Non-negative least
/// squares run on a fine grid of time constants; the modes are then merged to the wanted number and
/// refined, with sum r_i held at the total resistance. A thin stack that supports fewer modes gets
/// fewer.
/// Setup only: it takes milliseconds and allocates. Errors: config if a layer is not finite and
/// positive, or if the options are out of range.
[[nodiscard]] Result<FosterNetwork> network_of_stack(std::span<const StackLayer> layers,
                                                     const NetworkOptions& options = {});

/// States x_i of a surface, K above the base. Those of a network with fewer modes end with zeros.
template <class Real>
using FosterState = std::array<Real, kMaxFosterModes>;

/// Returns the sum of all states, K, in a fixed order. `kModes` is kMaxFosterModes, or
/// kFewFosterModes where no network has more; both have the same bits then.
template <std::size_t kModes = kMaxFosterModes, class Real>
[[nodiscard]] constexpr Real foster_sum(const FosterState<Real>& x) noexcept {
  static_assert(kFewFosterModes == 4 && kMaxFosterModes == 6);
  const Real few = (x[0] + x[1]) + (x[2] + x[3]);
  if constexpr (kModes <= kFewFosterModes) return few;
  return few + (x[4] + x[5]);
}

// ---- moving base --------------------------------------------------------------------------------

/// Returns the temperature of the surface of a stack per temperature of its base at an angular
/// frequency, when no heat passes through the surface. It is 1 at frequency 0. Any thread. RT-safe.
[[nodiscard]] std::complex<double> stack_transfer(std::span<const StackLayer> layers,
                                                  double angular_rad_s) noexcept;

/// Returns the shares c_i with which the modes of a network take part in a change of the base
/// (physics.md eq. 27):
///
///   T = sum w_i,   tau_i w_i' = r_i q + c_i T_base - w_i,   sum c_i = 1
///
/// They are fitted to stack_transfer() over the periods of `options`. By reciprocity the stack
/// passes the flux sum c_i (w_i - c_i T_base) / r_i into its base. Any thread. RT-safe.
[[nodiscard]] FosterState<double> base_shares(std::span<const StackLayer> layers,
                                              const FosterNetwork& network,
                                              const NetworkOptions& options = {}) noexcept;

// ---- one step -----------------------------------------------------------------------------------

/// RelaxationGains of every mode over one step.
template <class Real>
struct FosterGains {
  FosterState<Real> start_frac{};
  FosterState<Real> end_frac{};
};
/// Returns the gains of a step of `dt_s` (physics.md eq. 6).
/// @pre dt_s >= 0 and all time constants are positive.
[[nodiscard]] FosterGains<double> foster_gains(double dt_s, const FosterNetwork& network) noexcept;
/// Returns the gains of a step twice as long. Nothing cancels, so a ladder of step lengths starts
/// at its finest.
[[nodiscard]] FosterGains<double> foster_doubled(const FosterGains<double>& gains) noexcept;

/// Inputs that drive a surface at an instant. Temperature offsets are from `reference_k` of the
/// surface.
template <class Real>
struct FosterDrive {
  Real absorbed_w_m2 = 0;  ///< A: absorbed short-wave and long-wave flux
  Real film_w_m2_k = 0;    ///< h
  Real air_offset_k = 0;
  // Exchange of water with the air (evaporation.hpp). Both k are 0 for a dry surface.
  Real evaporation_w_m2_pa = 0;  ///< k where e_s(T) is above e_a
  Real dew_w_m2_pa = 0;          ///< k where it is below
  Real vapour_pa = 0;            ///< e_a
};

/// Properties of one surface that stay the same over its steps.
template <class Real>
struct FosterSurface {
  Real emission_w_m2_k4 = 0;  ///< emissivity * sigma
  FosterState<Real> resistance_m2k_w{};
  Real base_offset_k = 0;
  Real reference_k = 0;
};

/// Latent heat that leaves a surface at a temperature, W m-2, and its slope in W m-2 K-1, which is
/// never below 0.
template <class Real>
struct LatentFlux {
  Real flux_w_m2 = 0;
  Real slope_w_m2_k = 0;
};
/// Returns the latent heat by physics.md eq. 47. It is 0 for a dry surface.
template <class Real>
[[nodiscard]] LatentFlux<Real> latent_flux(const Real& temperature_k,
                                           const FosterDrive<Real>& d) noexcept {
  // Most surfaces are dry: spare them the exponential.
  if (none(Mask<Real>(d.dew_w_m2_pa > Real(0)))) return {};
  const Saturation<Real> water = saturation(temperature_k);
  const Real excess_pa = water.pressure_pa - d.vapour_pa;
  const Real k_w_m2_pa =
      choose(Mask<Real>(excess_pa > Real(0)), d.evaporation_w_m2_pa, d.dew_w_m2_pa);
  return {k_w_m2_pa * excess_pa, k_w_m2_pa * water.slope_pa_k};
}

/// Returns the surface temperature as an offset from the surface's reference, K.
template <std::size_t kModes = kMaxFosterModes, class Real>
[[nodiscard]] constexpr Real foster_offset_k(const FosterState<Real>& x,
                                             const FosterSurface<Real>& s) noexcept {
  return s.base_offset_k + foster_sum<kModes>(x);
}

/// Returns the net flux into the solid at a surface temperature, W/m2 (physics.md eq. 16 and 47).
template <class Real>
[[nodiscard]] Real foster_flux_w_m2(const Real& offset_k, const FosterDrive<Real>& d,
                                    const FosterSurface<Real>& s) noexcept {
  const Real t = s.reference_k + offset_k;
  const Real t2 = t * t;
  return d.absorbed_w_m2 + d.film_w_m2_k * (d.air_offset_k - offset_k) -
         s.emission_w_m2_k4 * t2 * t2 - latent_flux(t, d).flux_w_m2;
}

/// Returns the flags of moist surfaces whose flux at the start of a step, if it held over the whole
/// step, would carry them past their balance by more than they are off. Half of such a flux rings
/// from step to step, and grows where a hot surface evaporates more steeply than a cold one.
template <std::size_t kModes = kMaxFosterModes, class Real>
[[nodiscard]] Mask<Real> foster_rings(const FosterState<Real>& x, const Real& q_begin,
                                      const FosterDrive<Real>& begin, const FosterGains<Real>& g,
                                      const FosterSurface<Real>& s) noexcept {
  const Mask<Real> moist = begin.dew_w_m2_pa > Real(0);
  if (none(moist)) return moist;
  Real offset_k = foster_offset_k<kModes>(x, s);
  for (std::size_t i = 0; i < kModes; ++i) {
    offset_k += (s.resistance_m2k_w[i] * q_begin - x[i]) * (g.start_frac[i] + g.end_frac[i]);
  }
  const Real q_there = foster_flux_w_m2(offset_k, begin, s);
  return both(moist, Mask<Real>((q_there + q_begin) * q_begin < Real(0)));
}

/// Advances `x` by one step whose drive goes from `begin` to `end` (physics.md eq. 18). The
/// temperature is continuous at the start of the step, and the flux there is that of `begin`: a
/// change of shade acts at once.
/// Returns true if the surface balance had to be clamped (see solve_equilibrium). The step is
/// unconditionally stable and second order in its length. States from `kModes` on stay as they are.
/// Any thread. RT-safe.
template <std::size_t kModes = kMaxFosterModes, class Real>
Mask<Real> foster_step(FosterState<Real>& x, const FosterDrive<Real>& begin,
                       const FosterDrive<Real>& end, const FosterGains<Real>& g,
                       const FosterSurface<Real>& s) noexcept {
  // Advance the states with the flux at the start alone. P of physics.md eq. 18 is the temperature
  // that this gives, R is what each W/m2 of the flux at the end adds to it.
  const Real begin_offset_k = foster_offset_k<kModes>(x, s);
  const Real q_begin = foster_flux_w_m2(begin_offset_k, begin, s);
  // Let the flux at the end count for the whole step where that at the start would ring.
  const Mask<Real> rings = foster_rings<kModes>(x, q_begin, begin, g, s);
  FosterState<Real> end_frac;
  FosterState<Real> partial;  // new states before the flux at the end is added
  Real p_k = s.base_offset_k;
  Real r_m2k_w = 0;
  for (std::size_t i = 0; i < kModes; ++i) {
    const Real start_frac = choose(rings, Real(0), g.start_frac[i]);
    end_frac[i] = choose(rings, g.start_frac[i] + g.end_frac[i], g.end_frac[i]);
    partial[i] =
        x[i] + ((s.resistance_m2k_w[i] * q_begin - x[i]) * start_frac - x[i] * end_frac[i]);
    p_k += partial[i];
    r_m2k_w += s.resistance_m2k_w[i] * end_frac[i];
  }
  const Mask<Real> lasts = r_m2k_w > Real(0);
  if (none(lasts)) return Mask<Real>(false);  // the step has no length
  const Real conductance = Real(1) / r_m2k_w;
  // Take the latent heat along its tangent at the start, so that the balance stays a quartic.
  const Real begin_k = s.reference_k + begin_offset_k;
  const LatentFlux<Real> latent = latent_flux(begin_k, end);
  // Solve physics.md eq. 18 for the temperature at the end of the step.
  const SurfaceBalance<Real> balance{
      s.emission_w_m2_k4, end.film_w_m2_k + conductance + latent.slope_w_m2_k,
      end.absorbed_w_m2 + end.film_w_m2_k * (s.reference_k + end.air_offset_k) +
          conductance * (s.reference_k + p_k) + (latent.slope_w_m2_k * begin_k - latent.flux_w_m2)};
  const EquilibriumResult<Real> root = solve_equilibrium(balance);
  // Take one Newton step on offsets. A temperature in kelvin resolves only 3e-5 K in float32, which
  // a short step (small R) would turn into a wrong flux. The step also leads from the tangent of
  // the latent heat to its curve.
  Real offset_k = root.temperature_k - s.reference_k;
  const Real t3 = root.temperature_k * root.temperature_k * root.temperature_k;
  const Real slope = Real(4) * s.emission_w_m2_k4 * t3 + end.film_w_m2_k +
                     latent_flux(root.temperature_k, end).slope_w_m2_k;
  const Real polished_k =
      offset_k +
      (foster_flux_w_m2(offset_k, end, s) - (offset_k - p_k) * conductance) / (slope + conductance);
  offset_k = choose(root.clamped, offset_k, polished_k);
  // Take the flux from the side of the balance that loses less to rounding.
  const Mask<Real> steep = slope * r_m2k_w > Real(1);
  const Real q_end =
      choose(steep, (offset_k - p_k) * conductance, foster_flux_w_m2(offset_k, end, s));
  for (std::size_t i = 0; i < kModes; ++i) {
    x[i] = choose(lasts, partial[i] + s.resistance_m2k_w[i] * q_end * end_frac[i], x[i]);
  }
  return both(root.clamped, lasts);
}

/// Returns the steady states under a flux, x_i = r_i q. With q = (T - T_base) / sum r_i they are
/// the linear profile between surface and base.
template <class Real>
[[nodiscard]] constexpr FosterState<Real> foster_steady(Real flux_w_m2,
                                                        const FosterSurface<Real>& s) noexcept {
  FosterState<Real> x{};
  for (std::size_t i = 0; i < kMaxFosterModes; ++i) x[i] = s.resistance_m2k_w[i] * flux_w_m2;
  return x;
}

/// Returns the constants of a surface on a network. `base_k` and `reference_k` are absolute
/// temperatures; `emissivity_frac` is 0..1.
[[nodiscard]] FosterSurface<double> foster_surface(const FosterNetwork& network,
                                                   double emissivity_frac, double base_k,
                                                   double reference_k) noexcept;

// ---- controlled steps ---------------------------------------------------------------------------

/// Returns the drive between `a` (f = 0) and `b` (f = 1), linear in f.
template <class Real>
[[nodiscard]] constexpr FosterDrive<Real> lerp(const FosterDrive<Real>& a,
                                               const FosterDrive<Real>& b, const Real& f) noexcept {
  return {a.absorbed_w_m2 + (b.absorbed_w_m2 - a.absorbed_w_m2) * f,
          a.film_w_m2_k + (b.film_w_m2_k - a.film_w_m2_k) * f,
          a.air_offset_k + (b.air_offset_k - a.air_offset_k) * f,
          a.evaporation_w_m2_pa + (b.evaporation_w_m2_pa - a.evaporation_w_m2_pa) * f,
          a.dew_w_m2_pa + (b.dew_w_m2_pa - a.dew_w_m2_pa) * f,
          a.vapour_pa + (b.vapour_pa - a.vapour_pa) * f};
}

/// Finest split of an interval. It has 2^kMaxFosterLevel equal steps.
inline constexpr int kMaxFosterLevel = 6;

/// Gains of an interval split into 2^level equal steps, level 0..kMaxFosterLevel, for a network of
/// `modes` modes.
struct FosterLadder {
  std::size_t modes = 0;
  std::array<FosterGains<double>, kMaxFosterLevel + 1> level{};
};
/// Returns the gains of an interval of `dt_s` at every level.
/// @pre dt_s >= 0 and all time constants are positive.
[[nodiscard]] FosterLadder foster_ladder(double dt_s, const FosterNetwork& network) noexcept;

/// Outcome of foster_advance().
struct FosterAdvance {
  double error_k = 0.0;  ///< estimated error of the temperature at the end of the interval, K
  /// Bow of the temperature: its value in the middle of the interval minus the mean of those at
  /// both ends, K.
  double bow_k = 0.0;
  int level = 0;  ///< the interval was split into 2^level steps
  bool clamped = false;
};

/// Advances over an interval whose drive is linear in time. The interval is split until halving the
/// steps changes neither a state nor the temperature by more than `tolerance_k`. By step doubling,
/// the error of the finer result, which is kept, is a third of the change.
/// Any thread. RT-safe: it takes at most 2^(kMaxFosterLevel + 1) steps.
FosterAdvance foster_advance(FosterState<double>& x, const FosterDrive<double>& begin,
                             const FosterDrive<double>& end, const FosterLadder& ladder,
                             const FosterSurface<double>& surface, double tolerance_k) noexcept;

/// Number of surfaces that foster_advance_all() computes side by side.
inline constexpr std::size_t kFosterLanes = 8;

/// One surface of foster_advance_all(): the parameters of foster_advance().
struct FosterLane {
  FosterState<double>* x = nullptr;
  FosterDrive<double> begin;
  FosterDrive<double> end;
  const FosterLadder* ladder = nullptr;
  FosterSurface<double> surface;
  double* bow_k = nullptr;  ///< takes FosterAdvance::bow_k; null: it is not wanted
};

/// Advances each surface as foster_advance() does, bit for bit, in less time: a step waits for
/// divisions and roots, which several surfaces share. Any thread. RT-safe.
/// @pre no pointer is null, and no two surfaces share `x`
void foster_advance_all(std::span<const FosterLane> lanes, double tolerance_k) noexcept;

}  // namespace emit::physics
