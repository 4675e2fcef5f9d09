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
#include "emit/physics/relaxation.hpp"

/// Conduction into a stack of layers as a few flux-driven states (a Foster network):
///
///   T = T_base + sum x_i,   tau_i x_i' = r_i q - x_i,   sum r_i = sum d/lambda
///   q = A + h (T_air - T) - e T^4                           (physics.md eq. 16-18)
///
/// x_i are kelvins above the base, q the net flux into the solid, A the absorbed flux. A step is
/// implicit in the surface balance and exact for q linear over it; the new temperature is the root
/// of the same quartic as eq. 4 with P for the core temperature and 1/R for its conductance. A
/// steady state is that of eq. 4. shaders/lib/foster.glsl is the float32 twin of foster_step().
namespace emit::physics {

inline constexpr std::size_t kMaxFosterModes = 4;

/// One layer, outermost first in a stack.
struct StackLayer {
  double thickness_m = 0.0;
  double conductivity_w_m_k = 0.0;
  double volumetric_heat_j_m3_k = 0.0;  ///< density times specific heat
};

struct NetworkMode {
  double tau_s = 0.0;
  double resistance_m2k_w = 0.0;
};

/// Fastest mode first; entries from `count` on are zero.
struct FosterNetwork {
  std::array<NetworkMode, kMaxFosterModes> modes{};
  std::size_t count = 0;

  [[nodiscard]] double resistance_m2k_w() const noexcept {
    double sum = 0.0;
    for (const NetworkMode& mode : modes) sum += mode.resistance_m2k_w;
    return sum;
  }
};

/// Surface temperature per surface flux at an angular frequency, m2 K/W, over an isothermal base.
/// At 0 it is sum d/lambda. Any thread; RT-safe.
[[nodiscard]] std::complex<double> stack_impedance_m2k_w(std::span<const StackLayer> layers,
                                                         double angular_rad_s) noexcept;
[[nodiscard]] std::complex<double> network_impedance_m2k_w(const FosterNetwork& network,
                                                           double angular_rad_s) noexcept;

struct NetworkOptions {
  std::size_t modes = 4;  ///< 1..kMaxFosterModes
  double shortest_period_s = 600.0;
  double longest_period_s = 172'800.0;
  /// Part of the surface's heat exchange that the fit assumes, W/m2/K: convection plus linearised
  /// radiation. The error of the temperature is that of 1/(h + 1/Z).
  double film_w_m2_k = 19.0;
};

/// Network of a stack, from its impedance over the given periods: non-negative least squares on a
/// fine grid of time constants, merged to the wanted number and refined with sum r_i held at the
/// total resistance. Fewer modes come back where a thin stack supports no more. Setup only:
/// milliseconds, allocates. Errors: config when a layer is not finite and positive.
[[nodiscard]] Result<FosterNetwork> network_of_stack(std::span<const StackLayer> layers,
                                                     const NetworkOptions& options = {});

// ---- one step -----------------------------------------------------------------------------------

template <class Real>
using FosterState = std::array<Real, kMaxFosterModes>;  ///< x_i, K above the base

/// RelaxationGains of every mode over one step, and R = sum r_i end_i.
template <class Real>
struct FosterGains {
  FosterState<Real> start_frac{};
  FosterState<Real> end_frac{};
};
[[nodiscard]] FosterGains<double> foster_gains(double dt_s, const FosterNetwork& network) noexcept;
/// Gains of the step twice as long. Nothing cancels, so a ladder of steps starts at its finest.
[[nodiscard]] FosterGains<double> foster_doubled(const FosterGains<double>& gains) noexcept;

/// What drives a surface at an instant. Offsets are from `reference_k` of the surface.
template <class Real>
struct FosterDrive {
  Real absorbed_w_m2 = 0;  ///< A: absorbed short-wave and long-wave flux
  Real film_w_m2_k = 0;    ///< h
  Real air_offset_k = 0;
};

/// What stays the same over the steps of one surface.
template <class Real>
struct FosterSurface {
  Real emission_w_m2_k4 = 0;  ///< emissivity * sigma
  FosterState<Real> resistance_m2k_w{};
  Real base_offset_k = 0;
  Real reference_k = 0;
};

/// Temperature as an offset from the surface's reference.
template <class Real>
[[nodiscard]] constexpr Real foster_offset_k(const FosterState<Real>& x,
                                             const FosterSurface<Real>& s) noexcept {
  return s.base_offset_k + ((x[0] + x[1]) + (x[2] + x[3]));
}

/// Net flux into the solid at a temperature.
template <class Real>
[[nodiscard]] constexpr Real foster_flux_w_m2(Real offset_k, const FosterDrive<Real>& d,
                                              const FosterSurface<Real>& s) noexcept {
  const Real t = s.reference_k + offset_k;
  const Real t2 = t * t;
  return d.absorbed_w_m2 + d.film_w_m2_k * (d.air_offset_k - offset_k) -
         s.emission_w_m2_k4 * t2 * t2;
}

/// Advances `x` by one step whose drive goes from `begin` to `end`. At the start of the step the
/// temperature is continuous and the flux is that of `begin`: a shade that changes there acts at
/// once. Returns true where the surface balance had to be clamped (see solve_equilibrium).
/// Any thread; RT-safe. Unconditionally stable; second order in the step.
template <class Real>
bool foster_step(FosterState<Real>& x, const FosterDrive<Real>& begin, const FosterDrive<Real>& end,
                 const FosterGains<Real>& g, const FosterSurface<Real>& s) noexcept {
  const Real q_begin = foster_flux_w_m2(foster_offset_k(x, s), begin, s);
  FosterState<Real> partial;  // new states without the flux at the end
  Real p_k = s.base_offset_k;
  Real r_m2k_w = 0;
  for (std::size_t i = 0; i < kMaxFosterModes; ++i) {
    partial[i] =
        x[i] + ((s.resistance_m2k_w[i] * q_begin - x[i]) * g.start_frac[i] - x[i] * g.end_frac[i]);
    p_k += partial[i];
    r_m2k_w += s.resistance_m2k_w[i] * g.end_frac[i];
  }
  if (!(r_m2k_w > Real(0))) return false;  // no time passed
  const Real conductance = Real(1) / r_m2k_w;
  const SurfaceBalance<Real> balance{s.emission_w_m2_k4, end.film_w_m2_k + conductance,
                                     end.absorbed_w_m2 +
                                         end.film_w_m2_k * (s.reference_k + end.air_offset_k) +
                                         conductance * (s.reference_k + p_k)};
  const EquilibriumResult<Real> root = solve_equilibrium(balance);
  // One Newton step on offsets: a kelvin temperature resolves only 3e-5 K in float32, which a short
  // step (small R) would turn into a wrong flux.
  Real offset_k = root.temperature_k - s.reference_k;
  const Real t3 = root.temperature_k * root.temperature_k * root.temperature_k;
  const Real slope = Real(4) * s.emission_w_m2_k4 * t3 + end.film_w_m2_k;
  if (!root.clamped) {
    offset_k += (foster_flux_w_m2(offset_k, end, s) - (offset_k - p_k) * conductance) /
                (slope + conductance);
  }
  // The flux from whichever side loses less to rounding.
  const Real q_end = slope * r_m2k_w > Real(1) ? (offset_k - p_k) * conductance
                                               : foster_flux_w_m2(offset_k, end, s);
  for (std::size_t i = 0; i < kMaxFosterModes; ++i) {
    x[i] = partial[i] + s.resistance_m2k_w[i] * q_end * g.end_frac[i];
  }
  return root.clamped;
}

/// Steady states under a flux: x_i = r_i q. With q = (T - T_base) / sum r_i this is the linear
/// profile between surface and base.
template <class Real>
[[nodiscard]] constexpr FosterState<Real> foster_steady(Real flux_w_m2,
                                                        const FosterSurface<Real>& s) noexcept {
  FosterState<Real> x{};
  for (std::size_t i = 0; i < kMaxFosterModes; ++i) x[i] = s.resistance_m2k_w[i] * flux_w_m2;
  return x;
}

[[nodiscard]] FosterSurface<double> foster_surface(const FosterNetwork& network,
                                                   double emissivity_frac, double base_k,
                                                   double reference_k) noexcept;

// ---- controlled steps ---------------------------------------------------------------------------

template <class Real>
[[nodiscard]] constexpr FosterDrive<Real> lerp(const FosterDrive<Real>& a,
                                               const FosterDrive<Real>& b, Real f) noexcept {
  return {a.absorbed_w_m2 + (b.absorbed_w_m2 - a.absorbed_w_m2) * f,
          a.film_w_m2_k + (b.film_w_m2_k - a.film_w_m2_k) * f,
          a.air_offset_k + (b.air_offset_k - a.air_offset_k) * f};
}

/// Finest split of an interval: 2^kMaxFosterLevel equal steps.
inline constexpr int kMaxFosterLevel = 6;

/// Gains of an interval split into 2^level equal steps, level 0..kMaxFosterLevel.
struct FosterLadder {
  std::array<FosterGains<double>, kMaxFosterLevel + 1> level{};
};
[[nodiscard]] FosterLadder foster_ladder(double dt_s, const FosterNetwork& network) noexcept;

struct FosterAdvance {
  double error_k = 0.0;  ///< estimate for the temperature at the end of the interval
  int level = 0;         ///< the interval was split into 2^level steps
  bool clamped = false;
};

/// Advances over an interval with a drive linear in time, splitting it until halving the steps
/// changes no state, and not the temperature, by more than `tolerance_k` (step doubling: the error
/// of the finer result is a third of the difference). Keeps the finer result. Any thread; RT-safe:
/// at most 2^(kMaxFosterLevel + 1) steps.
FosterAdvance foster_advance(FosterState<double>& x, const FosterDrive<double>& begin,
                             const FosterDrive<double>& end, const FosterLadder& ladder,
                             const FosterSurface<double>& surface, double tolerance_k) noexcept;

}  // namespace emit::physics
