// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "emit/physics/planck.hpp"

namespace emit::image {

/// Converts in-band radiance to the temperature of a blackbody of the same radiance, for displays
/// and files. It uses a table of equal steps of temperature; a radiance outside gets the end of the
/// table. ApparentTemperature is quicker and less exact.
/// Construction: setup only. Lookup: any thread.
class TemperatureTable {
 public:
  static constexpr double kFromK = 150.0;
  static constexpr double kToK = 1500.0;
  static constexpr double kStepK = 0.05;

  /// Makes the table of a band with its response.
  /// @pre validate(band) succeeds
  explicit TemperatureTable(const physics::Band& band);
  /// Makes the table of a rectangular band.
  /// @pre 0 < lo_um < hi_um
  TemperatureTable(double lo_um, double hi_um);
  [[nodiscard]] double kelvin(double radiance_w_m2_sr) const noexcept;
  /// Returns dT/dL at that radiance, K per W m-2 sr-1.
  [[nodiscard]] double kelvin_per_radiance(double radiance_w_m2_sr) const noexcept;
  [[nodiscard]] std::vector<float> kelvin(std::span<const float> radiance_w_m2_sr) const;

  /// Returns the radiances at kFromK, kFromK + kStepK and so on, ascending.
  [[nodiscard]] std::span<const double> radiances_w_m2_sr() const noexcept { return radiance_; }

 private:
  [[nodiscard]] std::size_t interval(double radiance_w_m2_sr) const noexcept;
  std::vector<double> radiance_;  ///< ascending
};

}  // namespace emit::image
