// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/surface/facets.hpp"

#include <algorithm>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::physics {
namespace {

/// Facet whose normal has this slope against the surface's, and its weight among all.
struct SlopeSample {
  double along = 0.0;
  double across = 0.0;
  double weight = 1.0;
};
// Half of the slopes, because the other half is its mirror image.
constexpr std::size_t kRadii = 96;
constexpr std::size_t kSectors = 48;

std::array<SlopeSample, kRadii * kSectors> slope_samples(const Facets& facets) {
  std::array<SlopeSample, kRadii * kSectors> out;
  for (std::size_t r = 0; r < kRadii; ++r) {
    // The share of steeper facets falls with the third power, because few but steep ones count at
    // grazing angles.
    const double rest = 1.0 - (static_cast<double>(r) + 0.5) / kRadii;
    const double steeper = rest * rest * rest;
    const double radius =
        facets.slope * (facets.slopes == FacetSlopes::ggx ? std::sqrt((1.0 - steeper) / steeper)
                                                          : std::sqrt(-std::log(steeper)));
    for (std::size_t s = 0; s < kSectors; ++s) {
      // Turn every ring, so that the sectors do not line up.
      const double turn = static_cast<double>(r % 2) * 0.5;
      const double angle = kPi * (static_cast<double>(s) + 0.25 + turn) / kSectors;
      out[r * kSectors + s] = {radius * std::cos(angle), radius * std::sin(angle), rest * rest};
    }
  }
  return out;
}

/// Density of facets for a width of the distribution.
double density_per_sr(FacetSlopes slopes, double slope2, double cosine) noexcept {
  if (!(cosine > 0.0)) return 0.0;
  const double cos2 = cosine * cosine;
  const double sine2 = std::max(0.0, 1.0 - cos2);
  if (slopes == FacetSlopes::gaussian) {
    return std::exp(-sine2 / (cos2 * slope2)) / (kPi * slope2 * cos2 * cos2);
  }
  const double spread = slope2 * cos2 + sine2;
  return slope2 / (kPi * spread * spread);
}

}  // namespace

double facet_density_per_sr(const Facets& facets, double cosine) noexcept {
  return density_per_sr(facets.slopes, facets.slope * facets.slope, cosine);
}

double unmasked_frac(const Facets& facets, double cosine) noexcept {
  const double c = std::clamp(cosine, 0.0, 1.0);
  const double sine = std::sqrt(1.0 - c * c);
  if (!(sine > 0.0)) return 1.0;
  const double a = c / (facets.slope * sine);
  if (facets.slopes == FacetSlopes::ggx) {
    return 2.0 * a / (a + std::sqrt(1.0 + a * a));
  }
  if (!(a > 0.0)) return 0.0;
  const double hidden = 0.5 * (std::exp(-a * a) / (a * std::sqrt(kPi)) - std::erfc(a));
  return 1.0 / (1.0 + std::max(hidden, 0.0));
}

double hemispherical_mean(const LobeCurve& curve) noexcept {
  // The curve is linear in r, the root of the cosine, and the weight is 2 r^2 d(r^2).
  double sum = 0.0;
  for (std::size_t i = 0; i + 1 < kLobeNodes; ++i) {
    const double r0 = static_cast<double>(i) / (kLobeNodes - 1);
    const double r1 = static_cast<double>(i + 1) / (kLobeNodes - 1);
    const double whole = (std::pow(r1, 4) - std::pow(r0, 4)) / 4.0;
    const double first = (std::pow(r1, 5) - std::pow(r0, 5)) / 5.0;
    const double high = (first - r0 * whole) / (r1 - r0);
    sum += 4.0 * (curve[i] * (whole - high) + curve[i + 1] * high);
  }
  return sum;
}

namespace {

/// Reflections of facets over any body. `lobe` has its directions and the masking alone.
struct Reflected {
  Lobe lobe;
  LobeCurve once{};    ///< share that facets reflect once
  LobeCurve passed{};  ///< share that passes the interface
};

Reflected reflect(const Facets& facets, const LobeCurve& reflectance_frac) {
  EMIT_CHECK(facets.slope > 0.0 && facets.slope <= 1.0);
  const auto samples = slope_samples(facets);
  Reflected all;
  Lobe& out = all.lobe;
  LobeCurve& once = all.once;
  LobeCurve escape{};  // reflected once by an interface that reflects everything
  for (std::size_t node = 0; node < kLobeNodes; ++node) {
    const double cosine = lobe_view_cosine(node);
    const double sine = std::sqrt(1.0 - cosine * cosine);
    const double from = unmasked_frac(facets, cosine);
    double weights = 0.0;
    double along = 0.0;
    double up = 0.0;
    for (const SlopeSample& slope : samples) {
      // Take both a facet and the one that leans the other way.
      for (const double side : {1.0, -1.0}) {
        const double lean = side * slope.along;
        // Take its area as a viewer at (sine, 0, cosine) sees it.
        const double towards = cosine - lean * sine;
        if (!(towards > 0.0)) continue;
        const double seen = towards * slope.weight;
        weights += seen;
        const double length = std::sqrt(1.0 + lean * lean + slope.across * slope.across);
        const double facet_cosine = std::min(towards / length, 1.0);
        const double to_x = 2.0 * facet_cosine * (-lean / length) - sine;
        const double to_z = 2.0 * facet_cosine / length - cosine;
        if (!(to_z > 0.0)) continue;  // it goes down, to another facet
        const double open = unmasked_both_frac(from, unmasked_frac(facets, to_z)) / from;
        const double reflected = seen * open * lobe_at(reflectance_frac, facet_cosine);
        escape[node] += seen * open;
        once[node] += reflected;
        along += reflected * -to_x;
        up += reflected * to_z;
      }
    }
    out.unmasked[node] = from;
    // A surface that reflects nothing still needs a direction.
    out.forward_ratio[node] = once[node] > 0.0 ? along / (once[node] * sine) : 1.0;
    out.upward[node] = once[node] > 0.0 ? up / once[node] : cosine;
    escape[node] /= weights;
    once[node] /= weights;
  }
  // Light that facets send to each other comes out after further reflections.
  const double mean_escape = hemispherical_mean(escape);
  const double mean_reflectance = hemispherical_mean(reflectance_frac);
  const double several_frac = mean_reflectance * mean_reflectance * mean_escape /
                              (1.0 - mean_reflectance * (1.0 - mean_escape));
  for (std::size_t node = 0; node < kLobeNodes; ++node) {
    const double several = several_frac * (1.0 - escape[node]);
    all.passed[node] = 1.0 - once[node] - several;
  }
  return all;
}

}  // namespace

LobeCurve passed_frac(const Facets& facets, const LobeCurve& reflectance_frac) {
  return reflect(facets, reflectance_frac).passed;
}

Lobe make_lobe(const Facets& facets, const FacetOptics& optics) {
  const Reflected reflected = reflect(facets, optics.reflectance_frac);
  Lobe out = reflected.lobe;
  for (std::size_t node = 0; node < kLobeNodes; ++node) {
    out.lobe_frac[node] = optics.lobe_frac * reflected.once[node];
    out.emissivity_frac[node] = reflected.passed[node] * optics.body_absorptance_frac;
    out.diffuse_frac[node] = 1.0 - out.emissivity_frac[node] - out.lobe_frac[node];
    out.sun_facet[node] = optics.lobe_frac * optics.sun_reflectance_frac[node];
  }
  out.hemispherical_emissivity_frac = hemispherical_mean(out.emissivity_frac);
  out.diffuse_mean_frac = hemispherical_mean(out.diffuse_frac);
  return out;
}

double glint_per_sr(const Facets& facets, const GlintAngles& angles, double disc_rad) noexcept {
  if (!(angles.view_cosine > 0.0 && angles.sun_cosine > 0.0)) return 0.0;
  // Facets spread the disc to half its width along the plane of incidence, and farther across it.
  const double slope2 = facets.slope * facets.slope;
  const double disc2 = 0.25 * disc_rad * disc_rad;
  const double lean2 = std::max(angles.facet_cosine * angles.facet_cosine, 1e-4);
  const double wide2 = std::sqrt((slope2 + disc2) * (slope2 + disc2 / lean2));
  const double density = density_per_sr(facets.slopes, wide2, angles.half_cosine);
  const double open = unmasked_both_frac(unmasked_frac(facets, angles.view_cosine),
                                         unmasked_frac(facets, angles.sun_cosine));
  // No mirror shows more than the disc itself.
  const double sine = std::sin(disc_rad);
  return std::min(density * open / (4.0 * angles.view_cosine), 1.0 / (kPi * sine * sine));
}

}  // namespace emit::physics
