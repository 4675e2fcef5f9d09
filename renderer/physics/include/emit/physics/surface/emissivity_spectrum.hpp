// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "emit/physics/air_model.hpp"
#include "emit/physics/planck.hpp"
#include "emit/physics/units.hpp"

/// Emissivity over wavelength, folded to one number of a band (physics.md eq. 87), and the error
/// that this number has at other temperatures and behind other air (eq. 88). Setup only; any
/// thread.
namespace emit::physics {

/// Emissivity of a surface at one wavelength.
struct EmissivityPoint {
  double wavelength_um = 0.0;
  double emissivity_frac = 0.0;  ///< 0..1
};

/// Transmittance of the built-in air over a path by wavelength: even within each piece of the air's
/// spectrum (20 to 50 cm-1), and 1 where the model knows no air.
class SpectralAir {
 public:
  /// No air: all light passes.
  SpectralAir() = default;
  explicit SpectralAir(const AirPath& path);

  /// Returns the transmittance at a wavelength, 0..1.
  [[nodiscard]] double transmittance_frac(double wavelength_um) const noexcept;
  /// Returns the air behind another one, as if they absorbed independently of each other.
  [[nodiscard]] SpectralAir behind(const SpectralAir& other) const;
  /// Returns the transmittances by piece; empty without air.
  [[nodiscard]] std::span<const double> pieces() const noexcept { return by_piece_; }

 private:
  std::vector<double> by_piece_;
};

/// A spectrum of emissivity in a band, ready to be weighted with any source and any air. The
/// spectrum is linear between its points and has the value of its ends beyond them.
class EmissivityFold {
 public:
  /// @param coldest  least temperature that the functions below are asked for; the steps of the
  ///                 quadrature follow from it
  /// @pre spectrum has a point and ascends; the band passes validate()
  EmissivityFold(std::span<const EmissivityPoint> spectrum, const Band& band, Kelvin coldest);

  /// A folded emissivity.
  struct Folded {
    double emissivity_frac = 0.0;
    double beyond_frac = 0.0;  ///< share of the weight beyond the ends of the spectrum
  };
  /// Returns the mean emissivity for the radiation of a blackbody behind air: 1e-9 relative. Where
  /// air or temperature leave no light, all members are 0.
  [[nodiscard]] Folded at(Kelvin source, const SpectralAir& air = {}) const noexcept;
  /// Returns the radiance of a blackbody in the band behind air, W m-2 sr-1. The path itself adds
  /// nothing.
  [[nodiscard]] double black_w_m2_sr(Kelvin source, const SpectralAir& air = {}) const noexcept;
  /// Returns the temperature of the blackbody that has a radiance in the band; 0 K for a radiance
  /// that is not positive. `near` begins the search.
  [[nodiscard]] Kelvin apparent(double radiance_w_m2_sr, Kelvin near) const noexcept;

 private:
  static constexpr std::size_t kNoPiece = static_cast<std::size_t>(-1);
  struct Node {
    double wavelength_um;
    double weight;  ///< response times the step and the constants of Planck's law
    double emissivity_frac;
    std::size_t piece;  ///< of the air's spectrum, or kNoPiece
    bool beyond;        ///< of the spectrum's ends
  };
  struct Sums {
    double black = 0.0;
    double slope_per_k = 0.0;
    double emitted = 0.0;
    double beyond = 0.0;
  };
  [[nodiscard]] Sums sums(double source_k, const SpectralAir& air) const noexcept;
  void add_panels(std::span<const EmissivityPoint> spectrum, const Band& band, double lo_um,
                  double hi_um, double coldest_k);
  std::vector<Node> nodes_;
};

/// Returns the total emissivity at a temperature: the mean over the whole spectrum of a blackbody.
[[nodiscard]] EmissivityFold::Folded total_emissivity(std::span<const EmissivityPoint> spectrum,
                                                      Kelvin temperature);

/// Paths through the air over which an emissivity is judged.
struct JudgedAir {
  SpectralAir folded;   ///< that of the folding
  SpectralAir longest;  ///< the longest path; the shortest one is no air
  SpectralAir sun;      ///< from the sun to the surface
};
/// Temperatures over which an emissivity is judged.
struct JudgedRange {
  Kelvin reference;  ///< of the folding
  Kelvin least;
  Kelvin greatest;
};
/// Largest errors of one emissivity in place of a spectrum, in kelvin of apparent temperature of a
/// picture. Those of emission count without what the surface reflects, and the air on the path
/// emits at the temperature of the surface.
struct EmissivityErrors {
  double temperature_k = 0.0;  ///< over the temperatures, behind the air of the folding
  double air_k = 0.0;          ///< over no air and the longest path, at the reference
  double largest_k = 0.0;      ///< over both together
  double sunlight_k = 0.0;     ///< by the sunlight that a face square to the sun reflects
};
[[nodiscard]] EmissivityErrors emissivity_errors(const EmissivityFold& fold, double emissivity_frac,
                                                 const JudgedRange& range, const JudgedAir& air);

}  // namespace emit::physics
