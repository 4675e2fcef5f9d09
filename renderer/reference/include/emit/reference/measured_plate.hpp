// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/air_film.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/scene/scene_desc.hpp"

/// Level, open ground under measured weather, and fits of its properties to a measured surface
/// temperature. The conduction is that of LayerSolver, the film that of physics/air_film.hpp.
/// Target emit::fit. Any thread. Setup only.
namespace emit::reference {

/// Row of a logger. Values are linear between rows.
struct LoggerRow {
  double time_s = 0.0;
  double sun_w_m2 = 0.0;            ///< direct and diffuse sun on the face, >= 0
  double longwave_down_w_m2 = 0.0;  ///< from the whole sky
  double air_k = 0.0;
  double wind_m_s = 0.0;          ///< 10 m above the ground, >= 0
  double film_w_m2_k = 0.0;       ///< stated film of the air; 0: from wind and temperatures
  double surface_k = 0.0;         ///< measured; fit_plate() alone reads it
  double vapour_pa = 0.0;         ///< of the air; counts where the ground is moist
  double evaporation_w_m2 = 0.0;  ///< measured heat that evaporation takes; dew is negative
};

/// Properties of the ground that a logger can show.
struct PlateNumbers {
  double absorptance_frac = 0.0;  ///< of sunlight, 0..1
  double inertia_factor = 1.0;    ///< on conductivity and heat capacity of all layers, > 0
  double film_factor = 1.0;       ///< on the film of the air, > 0
  double base_k = 288.0;          ///< below the last layer
  double emissivity_frac = 0.95;  ///< total, long-wave; never fitted
};

/// Ground and place that do not change in a fit.
struct PlateSetup {
  std::vector<scene::Layer> layers;  ///< outermost first
  physics::FilmSkin skin = 1.52;     ///< what the film of the air takes from the ground
  double height_m = 0.0;             ///< of the place above the sea; sets the air's density
  physics::MoistSurface moisture;    ///< exchange of water with the air; dry unless stated
  /// Number of times that the first day is repeated before the record. The profile begins steady
  /// between the mean of the air and the base.
  std::uint32_t spin_up_days = 5;
};

/// Returns the temperature of the surface at every row, K.
/// Errors: invalid_argument for fewer than 20 rows, less than 20 hours, times that do not ascend,
/// layers that are none, or numbers out of range.
[[nodiscard]] physics::Result<std::vector<double>> plate_history_k(const PlateSetup& setup,
                                                                   std::span<const LoggerRow> rows,
                                                                   const PlateNumbers& numbers);

/// Returns the heat that the ground takes up at every row if its face follows the measured
/// temperature, W/m2: the mean since the row before, and of the first row that of the second.
/// Errors: those of plate_history_k().
[[nodiscard]] physics::Result<std::vector<double>> ground_heat_w_m2(const PlateSetup& setup,
                                                                    std::span<const LoggerRow> rows,
                                                                    const PlateNumbers& numbers);

/// Returns the flow of the air over a row: its wind with the gusts of convection (gusts.hpp).
[[nodiscard]] physics::AirFlow air_flow(const PlateSetup& setup, const LoggerRow& row) noexcept;

/// Returns the film between the air and the measured surface at every row, W m-2 K-1.
[[nodiscard]] std::vector<double> measured_films_w_m2_k(const PlateSetup& setup,
                                                        std::span<const LoggerRow> rows,
                                                        const PlateNumbers& numbers);

/// Number that a fit may change.
enum class PlateNumber : std::uint8_t { absorptance, inertia, film, base };
/// Returns the member of a number.
[[nodiscard]] double& value_of(PlateNumbers& numbers, PlateNumber which) noexcept;
[[nodiscard]] const char* name_of(PlateNumber which) noexcept;
/// Range in which a fit keeps a number.
struct PlateRange {
  double low = 0.0;
  double high = 0.0;
};
[[nodiscard]] PlateRange range_of(PlateNumber which) noexcept;

/// Fitted number with its confidence interval.
struct PlateEstimate {
  PlateNumber number = PlateNumber::absorptance;
  double value = 0.0;
  double standard_error = 0.0;  ///< in the number's own unit
  /// Ends of the simultaneous 99 % interval of all fitted numbers (Bonferroni). It comes from the
  /// curvature at the optimum and from residuals whose correlation in time is counted; it knows
  /// nothing of errors of the model, and ends where the range of the number does.
  double low = 0.0;
  double high = 0.0;
};
/// Result of a fit.
struct PlateFit {
  PlateNumbers numbers;
  std::vector<PlateEstimate> estimates;  ///< in the order that was asked for
  std::vector<double> model_k;           ///< at every row
  double rms_k = 0.0;
  double bias_k = 0.0;  ///< model less measurement
  double max_k = 0.0;
  double independent_rows = 0.0;  ///< rows over the correlation time of the residuals, in rows
  std::uint32_t iterations = 0;
  bool converged = false;
};
/// Fits numbers to the measured surface by least squares (Levenberg and Marquardt), from `start`.
/// Absorptance stays in 0..1, factors in 0.05..20, the base in 150..400 K.
/// Errors: those of plate_history_k(); invalid_argument if no number is free, or if the record does
/// not determine one of them, which is named.
[[nodiscard]] physics::Result<PlateFit> fit_plate(const PlateSetup& setup,
                                                  std::span<const LoggerRow> rows,
                                                  const PlateNumbers& start,
                                                  std::span<const PlateNumber> free);

}  // namespace emit::reference
