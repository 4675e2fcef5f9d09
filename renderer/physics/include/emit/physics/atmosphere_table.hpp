// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <vector>

#include "emit/physics/error.hpp"

/// Tabulated air of one band: what lies between the sensor and a point `range` away along a line of
/// sight of given elevation, seen from the sensor (physics.md section 9).
namespace emit::physics {

/// Regular grid. Values are ordered elevation by elevation: [elevation][range].
struct AtmosphereGrid {
  std::vector<double> range_m;                ///< ascending, >= 0
  std::vector<double> elevation_rad;          ///< ascending, -pi/2..pi/2; one: every elevation
  std::vector<double> transmittance_frac;     ///< 0..1, never rising with range
  std::vector<double> path_radiance_w_m2_sr;  ///< in band, >= 0

  [[nodiscard]] bool empty() const noexcept { return range_m.empty(); }
};

/// Errors: invalid_argument naming the element at fault.
[[nodiscard]] Result<void> validate(const AtmosphereGrid& grid);

/// The grid made ready for evaluation, in double; the shader does the same in float32 from
/// shader_nodes() (shaders/lib/atmosphere_table.glsl).
///   - along range the optical depth -ln(transmittance) is linear between rows (Beer-Lambert) and
///     the path radiance linear in the transmittance (constant source between rows);
///   - over elevation optical depth and path radiance are linear in the elevation's sine;
///   - a first row beyond range 0 is preceded by no air at range 0;
///   - outside the grid its edge is used and reported;
///   - the last range stands for the way out of the atmosphere: sky and sun.
/// Owner: whoever builds it. Any thread after construction. Real time: along() and out() RT-safe;
/// build() setup only.
class AtmosphereTable {
 public:
  struct Air {
    double transmittance_frac = 1.0;
    double path_radiance_w_m2_sr = 0.0;
    bool clamped = false;  ///< outside the grid, or NaN
  };

  /// A transmittance below this counts as this: its logarithm must stay finite.
  static constexpr double kLeastTransmittance = 1e-30;

  /// Errors: those of validate().
  [[nodiscard]] static Result<AtmosphereTable> build(const AtmosphereGrid& grid);

  [[nodiscard]] Air along(double range_m, double sin_elevation) const noexcept;
  [[nodiscard]] Air out(double sin_elevation) const noexcept;

  /// Cosine-weighted mean of the sky's radiance over the upper hemisphere. Setup only.
  [[nodiscard]] double sky_hemisphere_w_m2_sr() const;

  [[nodiscard]] std::size_t ranges() const noexcept { return range_m_.size(); }
  [[nodiscard]] std::size_t elevations() const noexcept { return sin_elevation_.size(); }
  /// Ranges, sines of the elevations, then optical depth and path radiance of every grid point.
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
