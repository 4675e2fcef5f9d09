// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/surface/facets.hpp"

#include <gtest/gtest.h>

#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>

#include "emit/physics/constants.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/surface/optical_constants.hpp"

/// Lobes of rough surfaces against integrals over directions, and published values of water.
namespace emit::physics {
namespace {

LobeCurve curve_of(auto&& value) {
  LobeCurve out{};
  for (std::size_t i = 0; i < kLobeNodes; ++i) out[i] = value(lobe_cosine(i));
  return out;
}

/// Integral over the directions above a surface, of a function that is the same on both sides of
/// the plane of x and z.
template <class Function>
double over_hemisphere(const Function& function, int rings = 700, int sectors = 350) {
  double sum = 0.0;
  for (int i = 0; i < rings; ++i) {
    const double z = (i + 0.5) / rings;
    const double flat = std::sqrt(1.0 - z * z);
    for (int k = 0; k < sectors; ++k) {
      const double angle = kPi * (k + 0.5) / sectors;
      sum += function(glm::dvec3(flat * std::cos(angle), flat * std::sin(angle), z));
    }
  }
  return sum * 2.0 * kPi / (double{1} * rings * sectors);
}

glm::dvec3 view_at(double cosine) {
  return {std::sqrt(1.0 - cosine * cosine), 0.0, cosine};
}

/// Smith's share for Gaussian slopes and for GGX, from Lambda's integral over slopes.
double smith_by_slopes(const Facets& facets, double cosine) {
  // 1 / (1 + Lambda) = cosine / int max(0, cosine - s sine) p(s) ds, with p the slopes along a
  // line.
  const double sine = std::sqrt(1.0 - cosine * cosine);
  double seen = 0.0;
  constexpr int kSteps = 40000;
  for (int i = 0; i < kSteps; ++i) {
    const double u = -1.0 + 2.0 * (i + 0.5) / kSteps;
    const double s = facets.slope * u / (1.0 - u * u);
    const double ds = facets.slope * (1.0 + u * u) / ((1.0 - u * u) * (1.0 - u * u)) * 2.0 / kSteps;
    const double x = s / facets.slope;
    const double p = facets.slopes == FacetSlopes::gaussian
                         ? std::exp(-x * x) / (facets.slope * std::sqrt(kPi))
                         : 0.5 / (facets.slope * std::pow(1.0 + x * x, 1.5));
    seen += std::max(0.0, cosine - s * sine) * p * ds;
  }
  return cosine / seen;
}

const Facets kFacets[] = {{FacetSlopes::ggx, 0.1},
                          {FacetSlopes::ggx, 0.4},
                          {FacetSlopes::ggx, 1.0},
                          {FacetSlopes::gaussian, 0.1},
                          {FacetSlopes::gaussian, 0.23}};

TEST(Facets, CoverTheSurfaceOnce) {
  for (const Facets& facets : kFacets) {
    const double covered = over_hemisphere(
        [&](const glm::dvec3& h) { return h.z * facet_density_per_sr(facets, h.z); }, 20000, 1);
    EXPECT_NEAR(covered, 1.0, 2e-3) << facets.slope;
  }
}

TEST(Facets, HideEachOtherAsTheirSlopesSay) {
  for (const Facets& facets : kFacets) {
    for (const double cosine : {0.02, 0.1, 0.3, 0.7}) {
      EXPECT_NEAR(unmasked_frac(facets, cosine), smith_by_slopes(facets, cosine), 1e-3)
          << facets.slope << ' ' << cosine;
    }
  }
}

// Integral of the lobe over incoming directions, with the density of facets per direction.
TEST(Facets, LobeHoldsWhatItsDirectionsReflect) {
  const LobeCurve water = curve_of([](double c) { return fresnel_reflectance_frac(1.33, 0.0, c); });
  for (const Facets& facets : {kFacets[0], kFacets[2], kFacets[4]}) {
    for (const LobeCurve& reflectance : {curve_of([](double) { return 1.0; }), water}) {
      const Lobe lobe = make_lobe(facets, {reflectance, reflectance, 1.0, 1.0});
      for (const std::size_t node : {10U, 20U, 31U}) {
        const double cosine = lobe_view_cosine(node);
        const glm::dvec3 view = view_at(cosine);
        glm::dvec3 mean(0.0);
        const auto reflected = [&](const glm::dvec3& light) {
          const glm::dvec3 half = glm::normalize(view + light);
          return facet_density_per_sr(facets, half.z) *
                 unmasked_both_frac(unmasked_frac(facets, cosine), unmasked_frac(facets, light.z)) *
                 lobe_at(reflectance, glm::dot(half, view)) / (4.0 * cosine);
        };
        const double total = over_hemisphere([&](const glm::dvec3& light) {
          const double part = reflected(light);
          mean += part * light;
          return part;
        });
        mean *= 2.0 * kPi / (700.0 * 350.0) / total;
        EXPECT_NEAR(lobe.lobe_frac[node], total, 2e-3 * total + 2e-4)
            << facets.slope << ' ' << node;
        EXPECT_NEAR(lobe.forward_ratio[node] * view.x, -mean.x, 4e-3)
            << facets.slope << ' ' << node;
        EXPECT_NEAR(lobe.upward[node], mean.z, 4e-3) << facets.slope << ' ' << node;
        EXPECT_LE(lobe.lobe_frac[node], 1.0);
      }
    }
  }
}

TEST(Facets, CloseTheEnergy) {
  for (const Facets& facets : kFacets) {
    const LobeCurve mirror = curve_of([](double) { return 1.0; });
    const Lobe white = make_lobe(facets, {mirror, mirror, 1.0, 1.0});
    const LobeCurve glass =
        curve_of([](double c) { return fresnel_reflectance_frac(1.5, 0.0, c); });
    const Lobe paint = make_lobe(facets, {glass, glass, 0.8, 0.7});
    for (std::size_t i = 0; i < kLobeNodes; ++i) {
      // A mirror of any roughness takes nothing and gives everything back.
      EXPECT_NEAR(white.emissivity_frac[i], 0.0, 1e-12);
      EXPECT_GE(white.diffuse_frac[i], -1e-12);
      EXPECT_DOUBLE_EQ(paint.emissivity_frac[i] + paint.lobe_frac[i] + paint.diffuse_frac[i], 1.0);
      EXPECT_GT(paint.emissivity_frac[i], 0.0);
      EXPECT_GT(paint.diffuse_frac[i], 0.0);
    }
  }
}

TEST(Facets, MirrorReflectsAlongItsMirrorDirection) {
  const LobeCurve glass = curve_of([](double c) { return fresnel_reflectance_frac(1.5, 0.0, c); });
  const Lobe lobe = make_lobe({FacetSlopes::ggx, 0.001}, {glass, glass, 1.0, 1.0});
  for (const std::size_t node : {6U, 16U, 31U}) {
    EXPECT_NEAR(lobe.lobe_frac[node], glass[node], 2e-3 * glass[node]);
    EXPECT_NEAR(lobe.upward[node], lobe_view_cosine(node), 1e-3);
    EXPECT_NEAR(lobe.forward_ratio[node], 1.0, 1e-3);
  }
}

// The glint of a rough surface is that of the disc's points, one by one.
TEST(Facets, GlintSpreadsTheDiscOfTheSun) {
  const Facets facets{FacetSlopes::ggx, 0.02};
  const double sun_cosine = std::cos(0.6);
  for (const double off_rad : {0.0, 0.01, 0.03, 0.1}) {
    const glm::dvec3 view = view_at(std::cos(0.6 + off_rad));
    double mean = 0.0;
    int count = 0;
    const glm::dvec3 sun(-std::sin(0.6), 0.0, sun_cosine);
    for (int i = -40; i <= 40; ++i) {
      for (int k = -40; k <= 40; ++k) {
        if (i * i + k * k > 1600) continue;
        const glm::dvec3 up(std::cos(0.6), 0.0, std::sin(0.6));
        const glm::dvec3 point = glm::normalize(
            sun + kSunSemiAngleRad / 40.0 * (double{1} * i * up + glm::dvec3(0.0, k, 0.0)));
        const glm::dvec3 half = glm::normalize(view + point);
        mean += glint_per_sr(facets, {view.z, point.z, half.z, glm::dot(half, view)}, 1e-9);
        ++count;
      }
    }
    mean /= count;
    const glm::dvec3 half = glm::normalize(view + sun);
    EXPECT_NEAR(
        glint_per_sr(facets, {view.z, sun.z, half.z, glm::dot(half, view)}, kSunSemiAngleRad), mean,
        0.02 * mean)
        << off_rad;
  }
}

TEST(Facets, GlintOfAMirrorIsTheDisc) {
  const double peak =
      glint_per_sr({FacetSlopes::ggx, 1e-5}, {0.8, 0.8, 1.0, 0.8}, kSunSemiAngleRad);
  EXPECT_NEAR(peak * kPi * std::pow(std::sin(kSunSemiAngleRad), 2), 1.0, 0.01);
}

// Cox and Munk's radiance: slopes of the sea as they measured them, without masking.
TEST(Facets, SeaGlintIsThatOfCoxAndMunk) {
  for (const double wind_m_s : {1.0, 5.0, 10.0}) {
    const double variance = 0.003 + 0.00512 * wind_m_s;
    const Facets sea{FacetSlopes::gaussian, std::sqrt(sea_mean_square_slope(wind_m_s))};
    const glm::dvec3 sun(-std::sin(0.7), 0.0, std::cos(0.7));
    for (const double zenith : {0.0, 0.4, 0.7, 0.9}) {
      const glm::dvec3 view = view_at(std::cos(zenith));
      const glm::dvec3 half = glm::normalize(view + sun);
      const double tan2 = (1.0 - half.z * half.z) / (half.z * half.z);
      const double expected =
          std::exp(-tan2 / variance) / (kPi * variance) / (4.0 * view.z * std::pow(half.z, 4));
      if (expected < 1e-3) continue;
      EXPECT_NEAR(
          glint_per_sr(sea, {view.z, sun.z, half.z, glm::dot(half, view)}, kSunSemiAngleRad),
          expected, 0.02 * expected)
          << wind_m_s << ' ' << zenith;
    }
  }
}

/// Emissivity of the sea by rays that start on facets which a viewer sees and go on to others.
TEST(Facets, SeaEmissivityIsThatOfItsVisibleFacets) {
  const auto table = optical_constants(IndexTable::water);
  const OpticalConstants at = constants_at(table, 11.0);
  const auto fresnel = [&](double c) {
    return fresnel_reflectance_frac(at.refractive_index, at.extinction_index, c);
  };
  const LobeCurve reflectance = curve_of(fresnel);
  for (const double wind_m_s : {0.0, 5.0, 15.0}) {
    const double sigma = std::sqrt(0.5 * sea_mean_square_slope(wind_m_s));
    const Facets facets{FacetSlopes::gaussian, std::sqrt(2.0) * sigma};
    const Lobe sea = make_lobe(facets, {reflectance, reflectance, 1.0, 1.0});
    for (const double zenith_deg : {0.0, 40.0, 60.0, 70.0, 80.0}) {
      // Mean over slopes, weighted by the projected area that faces the viewer (Masuda et al.
      // 1988). What facets send to others adds to it, as Wu and Smith (1997) have it; others are
      // black here.
      const glm::dvec3 view = view_at(std::cos(zenith_deg * kDegree));
      double emitted = 0.0;
      double caught = 0.0;
      double area = 0.0;
      constexpr int kSteps = 160;
      for (int i = -kSteps; i <= kSteps; ++i) {
        for (int k = -kSteps; k <= kSteps; ++k) {
          const double x = 6.0 * sigma * i / kSteps;
          const double y = 6.0 * sigma * k / kSteps;
          const glm::dvec3 up(-x, -y, 1.0);
          const double seen = glm::dot(up, view);
          if (seen <= 0.0) continue;
          const double weight = seen * std::exp(-0.5 * (x * x + y * y) / (sigma * sigma));
          const double facet_cosine = seen / glm::length(up);
          const double to_z = 2.0 * facet_cosine / glm::length(up) - view.z;
          const double out = to_z <= 0.0
                                 ? 0.0
                                 : 1.0 / (1.0 + unmasked_frac(facets, view.z) *
                                                    (1.0 / unmasked_frac(facets, to_z) - 1.0));
          emitted += weight * (1.0 - fresnel(facet_cosine));
          caught += weight * fresnel(facet_cosine) * (1.0 - out);
          area += weight;
        }
      }
      const double model = lobe_at(sea.emissivity_frac, view.z);
      EXPECT_NEAR(model, (emitted + caught) / area, 0.003) << wind_m_s << ' ' << zenith_deg;
      EXPECT_GE(model, emitted / area - 0.001) << wind_m_s << ' ' << zenith_deg;
    }
  }
}

}  // namespace
}  // namespace emit::physics
