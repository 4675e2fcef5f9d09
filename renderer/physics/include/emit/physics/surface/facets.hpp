// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

/// Rough surfaces as mirrors of many slopes: their emission by angle and the lobe that they reflect
/// (physics.md eq. 71 to 75). Any thread. Real time: make_lobe() is setup only.
namespace emit::physics {

/// Distribution of the slopes of the facets, the same in all directions along the surface.
enum class FacetSlopes : std::uint8_t {
  ggx,       ///< a narrow peak with a long tail: polished and painted surfaces
  gaussian,  ///< wind waves
};
/// Facets of a surface.
struct Facets {
  FacetSlopes slopes = FacetSlopes::ggx;
  /// Width of the distribution: that of GGX, or the root of the mean square slope. Above 0, to 1.
  double slope = 0.05;
};

/// Returns the mean square slope of the sea by Cox and Munk (1954), clean surface, both directions
/// together. The wind is that at 12.5 m, 0 to 14 m/s.
[[nodiscard]] constexpr double sea_mean_square_slope(double wind_m_s) noexcept {
  return 0.003 + 0.00512 * wind_m_s;
}

/// Returns the area of facets per solid angle of their normals and per area of the surface, sr-1.
/// `cosine` is that between the normals of facet and surface; facets do not look down.
[[nodiscard]] double facet_density_per_sr(const Facets& facets, double cosine) noexcept;

/// Returns the share of the facets before a direction that no other facet hides from it, by Smith
/// (1967). `cosine` is that between the direction and the normal of the surface, 0..1.
[[nodiscard]] double unmasked_frac(const Facets& facets, double cosine) noexcept;

/// Returns the share that neither of two directions loses, from unmasked_frac() of each.
[[nodiscard]] constexpr double unmasked_both_frac(double from, double to) noexcept {
  return from > 0.0 && to > 0.0 ? 1.0 / (1.0 / from + 1.0 / to - 1.0) : 0.0;
}

/// Curves of a lobe have nodes by the cosine to the normal, dense at grazing angles.
inline constexpr std::size_t kLobeNodes = 32;
using LobeCurve = std::array<double, kLobeNodes>;
/// Returns the cosine of a node. The first one stands for 0.
[[nodiscard]] constexpr double lobe_cosine(std::size_t node) noexcept {
  const double root = static_cast<double>(node) / (kLobeNodes - 1);
  return node == 0 ? 1e-4 : root * root;
}
/// Returns the cosine at which a lobe is computed for a node: the last one stands for 1, where the
/// lobe has no direction along the surface.
[[nodiscard]] constexpr double lobe_view_cosine(std::size_t node) noexcept {
  return node + 1 == kLobeNodes ? 0.9998 : lobe_cosine(node);
}
/// Returns a curve between its nodes, linear in the root of the cosine.
[[nodiscard]] inline double lobe_at(const LobeCurve& curve, double cosine) noexcept {
  const double place =
      (kLobeNodes - 1) * std::sqrt(cosine > 0.0 ? (cosine < 1.0 ? cosine : 1.0) : 0.0);
  const auto node = place < kLobeNodes - 2 ? static_cast<std::size_t>(place) : kLobeNodes - 2;
  return std::lerp(curve[node], curve[node + 1], place - static_cast<double>(node));
}
/// Returns the mean of a curve over the hemisphere, weighted with the cosine.
[[nodiscard]] double hemispherical_mean(const LobeCurve& curve) noexcept;

/// Facets of one surface in one band.
struct FacetOptics {
  LobeCurve reflectance_frac{};      ///< of the interface, by the cosine of incidence on a facet
  LobeCurve sun_reflectance_frac{};  ///< the same for sunlight
  /// Share of the interface's reflectance that goes into the lobe; the rest is diffuse.
  double lobe_frac = 1.0;
  /// Absorbed share of what passes the interface; the rest is diffuse.
  double body_absorptance_frac = 1.0;
};

/// A surface in one band by the direction of view. emissivity + lobe + diffuse is 1 at each node.
struct Lobe {
  LobeCurve emissivity_frac{};
  LobeCurve lobe_frac{};     ///< reflected by facets once
  LobeCurve diffuse_frac{};  ///< reflected by the body, and by several facets
  /// Mean of the directions that the lobe comes from: along the surface, away from the viewer, over
  /// the sine of the view, which a mirror has 1 of, and along the normal. The length of the mean is
  /// 1 for a mirror and less for a wide lobe.
  LobeCurve forward_ratio{};
  LobeCurve upward{};
  LobeCurve unmasked{};   ///< unmasked_frac()
  LobeCurve sun_facet{};  ///< reflectance of a facet for sunlight that goes into the lobe
  double hemispherical_emissivity_frac = 0.0;
  double diffuse_mean_frac = 0.0;  ///< hemispherical_mean() of diffuse_frac
};
/// Returns the share of light from each direction that passes the interface of rough facets, after
/// further reflections between them too. It is what a black body under them absorbs and emits.
/// @param reflectance_frac  of the interface, by the cosine of incidence on a facet
/// @pre 0 < facets.slope <= 1
[[nodiscard]] LobeCurve passed_frac(const Facets& facets, const LobeCurve& reflectance_frac);

/// Integrates over the facets that a viewer sees. What they send to other facets counts as diffuse,
/// in the amount that closes the energy (Kulla and Conty 2017).
/// @pre 0 < facets.slope <= 1
[[nodiscard]] Lobe make_lobe(const Facets& facets, const FacetOptics& optics);

/// Returns the radiance of the lobe per irradiance of the sun across its direction, sr-1, without
/// the reflectance of the facets (physics.md eq. 74). The cosines are those to the surface's
/// normal of viewer, sun and half-way direction, then that between half-way direction and viewer.
/// `disc_rad` is the radius of the sun's disc, over which the facets spread the light.
struct GlintAngles {
  double view_cosine = 1.0;
  double sun_cosine = 1.0;
  double half_cosine = 1.0;
  double facet_cosine = 1.0;
};
[[nodiscard]] double glint_per_sr(const Facets& facets, const GlintAngles& angles,
                                  double disc_rad) noexcept;

}  // namespace emit::physics
