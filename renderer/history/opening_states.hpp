// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

#include "emit/physics/foster.hpp"
#include "emit/renderer/surface_forcing.hpp"

/// States in which surfaces begin that nobody has stated a temperature for: the balance of their
/// own first day.
namespace emit::renderer {

/// The type says what reaches a face of sun and sky.
struct FaceOpening {
  glm::dvec3 normal{0.0, 0.0, 1.0};  ///< unit vector, world axes
  double sun_frac = 1.0;             ///< share of the sun on the face that nothing hides, 0..1
  double sky_frac = 1.0;             ///< share of the hemisphere that is sky, by the cosine, 0..1

  /// Returns the opening of a face with nothing before it.
  [[nodiscard]] static FaceOpening unshadowed(const glm::dvec3& normal) noexcept {
    return {normal, 1.0, 0.5 * (1.0 + normal.z)};
  }
};

/// Returns the mean sun over a day of intervals on an unshadowed face, W m-2. RT-safe.
[[nodiscard]] double mean_sun_w_m2(std::span<const IntervalForcing> day,
                                   const glm::dvec3& normal) noexcept;

/// Periodic states of faces under a day that repeats itself without end, by the tilt of the face,
/// its mean sun and its share of the sky (physics.md eq. 89). They are found once for some values
/// of each, and lie between these elsewhere. Each is carried on over the intervals that follow.
/// Owner: FosterHistory.
class OpeningStates {
 public:
  /// Makes room for so many materials. It allocates.
  void resize(std::size_t materials) { materials_.resize(materials); }

  /// Finds the states of a material: at the start of `day`, and after `later`, whose first interval
  /// begins there too. Different materials may be filled by different threads. RT-safe.
  /// @pre material < size; the material is not prescribed; the intervals of `day` last 1 h at most
  void fill(std::size_t material, const FosterMaterial& properties,
            std::span<const IntervalForcing> day, std::span<const IntervalForcing> later,
            double reference_k) noexcept;

  /// Returns the states of a face at the start of the day. `sun_w_m2` is its mean sun over the day.
  /// RT-safe. @pre fill() has been called for the material
  [[nodiscard]] physics::FosterState<double> at_start(std::size_t material, double up,
                                                      double sun_w_m2,
                                                      double sky_frac) const noexcept {
    return between(materials_[material].start, material, up, sun_w_m2, sky_frac);
  }
  /// Returns the states after the intervals that follow. RT-safe.
  [[nodiscard]] physics::FosterState<double> later(std::size_t material, double up, double sun_w_m2,
                                                   double sky_frac) const noexcept {
    return between(materials_[material].later, material, up, sun_w_m2, sky_frac);
  }

 private:
  static constexpr std::size_t kTilts = 3;  ///< facing down, to the side, up
  static constexpr std::size_t kSuns =
      5;  ///< mean sun, from none to that of a face that follows it
  static constexpr std::size_t kSkies = 3;  ///< no sky, half of it, all of it
  using Nodes = std::array<physics::FosterState<double>, kTilts * kSuns * kSkies>;
  struct OfMaterial {
    Nodes start{};
    Nodes later{};
    double most_sun_w_m2 = 0.0;  ///< mean sun of the last node of kSuns
  };
  [[nodiscard]] physics::FosterState<double> between(const Nodes& nodes, std::size_t material,
                                                     double up, double sun_w_m2,
                                                     double sky_frac) const noexcept;

  std::vector<OfMaterial> materials_;
};

}  // namespace emit::renderer
