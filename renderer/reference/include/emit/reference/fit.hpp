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

/// Fits of a material's real-time models to the reference solver. This is the only part of the
/// reference that runs the formulas of the real-time path, because they are what is fitted; they do
/// not judge the result. Target emit::fit. Any thread. Setup only.
namespace emit::reference {

/// Real-time model that is fitted.
enum class FitModel : std::uint8_t { foster, emit2014 };

/// Fluxes that fall on level, open ground at an instant. Values are linear between two instants;
/// two entries at one time make a jump.
struct GroundForcing {
  double time_s = 0.0;
  double direct_w_m2 = 0.0;  ///< direct sun on level ground, after clouds
  double diffuse_w_m2 = 0.0;
  double longwave_w_m2 = 0.0;
  double film_w_m2_k = 0.0;
  double air_k = 0.0;
  double vapour_pa = 0.0;  ///< of the air, for materials that evaporate (foster alone)
  double pressure_pa = 101'325.0;
};

/// Returns the forcing of a scenario every `step_s` between two simulated times, from its weather
/// table or its clear sky.
[[nodiscard]] std::vector<GroundForcing> ground_forcing(const scene::ScenarioDesc& scenario,
                                                        double begin_s, double end_s,
                                                        double step_s);

/// Point of a surface's history: the absorbed flux and the true temperature.
struct CurvePoint {
  double time_s = 0.0;
  double absorbed_w_m2 = 0.0;  ///< short-wave and long-wave flux
  double film_w_m2_k = 0.0;
  double air_k = 0.0;
  double temperature_k = 0.0;
};

/// Options of the fit functions.
struct FitOptions {
  FitModel model = FitModel::foster;
  std::size_t modes = physics::kMaxFosterModes;  ///< 1..kMaxFosterModes; 1..2 for emit2014
  std::uint32_t starts = 5;
  double spin_up_s = 172'800.0;  ///< length of the unshadowed time before the histories
  double history_s = 12'600.0;   ///< length of the histories
  double reference_tolerance_k = 1e-3;
};

/// Error of the model against the reference over one history.
struct FitResidual {
  std::string history;
  double rms_k = 0.0;
  double max_k = 0.0;
  bool judged = true;  ///< false if the history is fitted too but is not one of the five
};

/// Outcome of a fit.
struct FitResult {
  std::string material;
  physics::FosterNetwork network;            ///< result of a fit of foster
  std::vector<scene::RelaxationMode> modes;  ///< result of a fit of emit2014
  std::vector<FitResidual> residuals;
  double rms_k = 0.0;  ///< largest of all histories
  double max_k = 0.0;
  /// Length of the fitted time, including the part of the spin-up that counted.
  double horizon_s = 0.0;
  double derived_rms_k = 0.0;  ///< rms_k of the modes derived from the layers alone
  double derived_max_k = 0.0;
  std::uint32_t iterations = 0;
  bool converged = false;
};

/// Fits a material over five histories of level ground that share the spin-up: sun all the time;
/// shade all the time; shade from 75 minutes on; shade until two hours; two passing shadows of 20
/// and 10 minutes. The day before has a small weight, so that the slow modes are right too.
/// `forcing` must reach from `start_s - spin_up_s` to `start_s + history_s`. Errors:
/// invalid_argument (options, forcing), config (layers); the message names the material.
[[nodiscard]] physics::Result<FitResult> fit_material(const scene::Material& material,
                                                      std::span<const GroundForcing> forcing,
                                                      double start_s, double initial_k,
                                                      const FitOptions& options = {});

/// Makes the same comparison for the modes as they are: the material's own, or those derived from
/// its layers. Nothing is fitted. Errors: those of fit_material().
[[nodiscard]] physics::Result<FitResult> judge_material(const scene::Material& material,
                                                        std::span<const GroundForcing> forcing,
                                                        double start_s, double initial_k,
                                                        const FitOptions& options = {});

/// Temperature of an open, level surface at an instant.
struct CoursePoint {
  double time_s = 0.0;
  double reference_k = 0.0;  ///< by the reference solver
  double model_k = 0.0;      ///< by the modes that judge_material() takes
};

/// Returns the course of a material in sun over the day that ends at `end_s`, a point every five
/// minutes. The spin-up of the options ends with it. `forcing` must reach from `end_s - spin_up_s`
/// to 20 s after `end_s`. Errors: those of fit_material().
[[nodiscard]] physics::Result<std::vector<CoursePoint>> day_course(
    const scene::Material& material, std::span<const GroundForcing> forcing, double end_s,
    double initial_k, const FitOptions& options = {});

/// Fits to a measured or computed curve. The material gives emissivity, layers and base; both
/// models start at the first temperature of the curve. Errors: those of fit_material().
[[nodiscard]] physics::Result<FitResult> fit_curve(const scene::Material& material,
                                                   std::span<const CurvePoint> curve,
                                                   const FitOptions& options = {});

}  // namespace emit::reference
