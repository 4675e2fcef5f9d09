// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/foster.hpp"
#include "emit/scene/scene_desc.hpp"

/// Fits the real-time path's models of a material to the reference solver. This is the one place of
/// the reference that runs the real-time path's own formulas: they are what is fitted, not what
/// judges. Target emit::fit. Any thread; setup only.
namespace emit::reference {

enum class FitModel : std::uint8_t { foster, emit2014 };

/// What falls on level, open ground at an instant. Linear in between; two at one time are a jump.
struct GroundForcing {
  double time_s = 0.0;
  double direct_w_m2 = 0.0;  ///< direct sun on level ground, after clouds
  double diffuse_w_m2 = 0.0;
  double longwave_w_m2 = 0.0;
  double film_w_m2_k = 0.0;
  double air_k = 0.0;
};

/// Forcing of a scenario every `step_s` between two sim times, its weather table or clear sky.
[[nodiscard]] std::vector<GroundForcing> ground_forcing(const scene::ScenarioDesc& scenario,
                                                        double begin_s, double end_s,
                                                        double step_s);

/// A surface's history: what it absorbs, and how warm it truly was.
struct CurvePoint {
  double time_s = 0.0;
  double absorbed_w_m2 = 0.0;  ///< short-wave and long-wave
  double film_w_m2_k = 0.0;
  double air_k = 0.0;
  double temperature_k = 0.0;
};

struct FitOptions {
  FitModel model = FitModel::foster;
  std::size_t modes = 4;  ///< foster 1..4, emit2014 1..2
  std::uint32_t starts = 4;
  double spin_up_s = 172'800.0;  ///< unshadowed, before the histories
  double history_s = 12'600.0;   ///< their length
  double reference_tolerance_k = 1e-3;
};

/// How far the model is from the reference over one history.
struct FitResidual {
  std::string history;
  double rms_k = 0.0;
  double max_k = 0.0;
  bool judged = true;  ///< false: fitted along, but not one of the five
};

struct FitResult {
  std::string material;
  physics::FosterNetwork network;            ///< foster
  std::vector<scene::RelaxationMode> modes;  ///< emit2014
  std::vector<FitResidual> residuals;
  double rms_k = 0.0;  ///< worst history
  double max_k = 0.0;
  double horizon_s = 0.0;      ///< length of what was fitted, spin-up included as far as it counted
  double derived_rms_k = 0.0;  ///< the same with modes from the layers alone
  double derived_max_k = 0.0;
  std::uint32_t iterations = 0;
  bool converged = false;
};

/// Over five histories of level ground that share the spin-up: sun all the time; shade all the
/// time; shade from 75 minutes on; shade until two hours; two passing shadows (20 and 10 minutes).
/// The day before counts a little, so that the slow modes are right too. `forcing` reaches from
/// `start_s - spin_up_s` to `start_s + history_s`. Errors: invalid_argument (options, forcing),
/// config (layers), naming the material.
[[nodiscard]] physics::Result<FitResult> fit_material(const scene::Material& material,
                                                      std::span<const GroundForcing> forcing,
                                                      double start_s, double initial_k,
                                                      const FitOptions& options = {});

/// The same comparison for modes as they are: the material's own, or those of its layers where it
/// has none. Nothing is fitted.
[[nodiscard]] physics::Result<FitResult> judge_material(const scene::Material& material,
                                                        std::span<const GroundForcing> forcing,
                                                        double start_s, double initial_k,
                                                        const FitOptions& options = {});

/// To a measured or computed curve; the material gives emissivity, layers and base. Both models
/// start at the curve's first temperature.
[[nodiscard]] physics::Result<FitResult> fit_curve(const scene::Material& material,
                                                   std::span<const CurvePoint> curve,
                                                   const FitOptions& options = {});

}  // namespace emit::reference
