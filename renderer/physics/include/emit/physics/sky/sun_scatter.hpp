// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/air_model.hpp"

/// Sunlight that the air of the model atmospheres scatters once towards a sensor (physics.md eq. 78
/// and 79): by the haze near the ground, by the aerosols above it, and by the air's molecules.
/// Light that is scattered again, and light that the ground sends up, are not part of it. Any
/// thread after construction.
namespace emit::physics {

/// Scattered sunlight of one band in one atmosphere.
class SunScatter {
 public:
  /// Kinds of scatterers that have a phase function of their own: haze, tropospheric and
  /// stratospheric aerosol above it, molecules.
  static constexpr std::size_t kKinds = 4;
  /// One number for each of them.
  using Kinds = std::array<double, kKinds>;

  /// Makes the scattered sunlight of a band with a response of any shape. It is empty where the
  /// air model does not reach, and where the sun hardly counts: a white surface in full sun sends
  /// less than a tenth of what a blackbody of 300 K does. Setup only: a millisecond.
  [[nodiscard]] static std::optional<SunScatter> build(const AirColumn& column, const Band& band);

  /// Share of the sunlight that arrives at a height, by the apparent elevation of the sun.
  class Beams {
   public:
    /// Number of the sun's elevations.
    [[nodiscard]] std::size_t size() const noexcept { return suns_; }

   private:
    friend class SunScatter;
    std::size_t suns_ = 0;
    std::vector<float> through_frac_;  ///< [height][term][sun]
  };
  /// Follows the sun's rays down to all heights, for ascending apparent elevations in rad, 0 to
  /// pi/2. Setup only: a millisecond for each elevation.
  [[nodiscard]] Beams beams(const AirColumn& column, std::span<const double> elevations_rad) const;

  /// Writes the light that a path scatters towards its sensor for every elevation of the sun, by
  /// kind, W m-2: times phase_per_sr() it is a radiance in band, at one astronomical unit. RT-safe.
  /// @pre out.size() == beams.size(), and the beams are those of this object.
  void scattered_w_m2(const AirPath& path, const Beams& beams, std::span<Kinds> out) const noexcept;

  /// Returns the phase functions at the cosine of the angle between a line of sight and the
  /// direction to the sun, sr-1. Their integral over all directions is 1. RT-safe.
  [[nodiscard]] Kinds phase_per_sr(double cosine) const noexcept;
  /// The same at node `i` of a table that is even in the sine of half the angle.
  static constexpr std::size_t kPhaseNodes = 129;
  [[nodiscard]] const std::array<float, kKinds>& phase_node_per_sr(std::size_t i) const noexcept {
    return phases_[i];
  }

 private:
  SunScatter() = default;
  /// Scatterers with an amount of their own along a path: the haze at four humidities, the
  /// tropospheric and the stratospheric aerosol, and the molecules.
  static constexpr std::size_t kScatterers = 7;
  struct Term {
    double sun_w_m2 = 0.0;  ///< sunlight outside the atmosphere at 1 au
    std::array<double, kAirAbsorbers> extinction{};
    std::array<double, kScatterers> scattering{};
  };
  [[nodiscard]] static std::array<double, kScatterers> amounts_of(
      const AirPath::Stretch& stretch) noexcept;
  void set_phases(std::span<const Term> terms, std::span<const double> um, const AirPath& vertical);
  std::vector<Term> terms_;
  double sun_w_m2_ = 0.0;  ///< of all terms
  std::array<std::array<float, kKinds>, kPhaseNodes> phases_{};
};

}  // namespace emit::physics
