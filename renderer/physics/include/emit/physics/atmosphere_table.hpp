// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <vector>

#include "emit/physics/error.hpp"

/// Transmittance and path radiance of the air in one band, given as a table over range and
/// elevation. Range is the distance from the sensor to a point; elevation is that of the line of
/// sight, seen from the sensor (physics.md section 9).
namespace emit::physics {

/// Regular grid of range and elevation. The two tables have ranges x elevations values, ordered
/// elevation by elevation: [elevation][range].
struct AtmosphereGrid {
  std::vector<double> range_m;                ///< ascending, >= 0
  std::vector<double> elevation_rad;          ///< ascending, -pi/2..pi/2; a single one fits all
  std::vector<double> transmittance_frac;     ///< 0..1, must not rise with range
  std::vector<double> path_radiance_w_m2_sr;  ///< >= 0, in the band

  [[nodiscard]] bool empty() const noexcept { return range_m.empty(); }
};

/// Checks the sizes, the order and the ranges of the values.
/// Errors: invalid_argument, naming the element at fault.
[[nodiscard]] Result<void> validate(const AtmosphereGrid& grid);

/// An AtmosphereGrid made ready for evaluation in double. The shader evaluates the same equations
/// in float32 from shader_nodes() (shaders/lib/atmosphere_table.glsl). Rules (physics.md eq. 14,
/// 15):
///   - along range the optical depth -ln(transmittance) is linear between rows (Beer-Lambert) and
///     the path radiance is linear in the transmittance (constant source between rows);
///   - over elevation both are linear in the sine of the elevation;
///   - if the first row lies beyond range 0, the air at range 0 is clear;
///   - outside the grid its edge is used and reported;
///   - the last range stands for the whole path out of the atmosphere, to the sky and the sun.
/// Owner: the caller of build(). Any thread after construction. Real time: along() and out() are
/// RT-safe, build() is setup only.
class AtmosphereTable {
 public:
  struct Air {
    double transmittance_frac = 1.0;
    double path_radiance_w_m2_sr = 0.0;
    bool clamped = false;  ///< the point lies outside the grid, or an argument is NaN
  };

  /// Smallest transmittance, used in place of smaller ones: the logarithm must stay finite.
  static constexpr double kMinTransmittance = 1e-30;

  /// Errors: those of validate().
  [[nodiscard]] static Result<AtmosphereTable> build(const AtmosphereGrid& grid);

  /// Returns the air between the sensor and a point at `range_m` metres. `sin_elevation` is the
  /// sine of the elevation, -1..1.
  [[nodiscard]] Air along(double range_m, double sin_elevation) const noexcept;
  /// Returns the air of the whole path out of the atmosphere: along() at the last range.
  [[nodiscard]] Air out(double sin_elevation) const noexcept;

  [[nodiscard]] std::size_t ranges() const noexcept { return range_m_.size(); }
  [[nodiscard]] std::size_t elevations() const noexcept { return sin_elevation_.size(); }
  /// Returns the table for the shader: the ranges, the sines of the elevations, then the pair of
  /// optical depth and path radiance of every grid point.
  [[nodiscard]] std::vector<float> shader_nodes() const;

 private:
  struct Node {
    double optical_depth = 0.0;
    double path_radiance_w_m2_sr = 0.0;
  };
  [[nodiscard]] Node at_elevation(std::size_t elevation, std::size_t cell,
                                  double fraction) const noexcept;

  std::vector<double> range_m_;
  std::vector<double> sin_elevation_;
  std::vector<Node> nodes_;
};

}  // namespace emit::physics
