// SPDX-License-Identifier: Apache-2.0
#include "stages/lobe_model.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "shared/bindings.glsl.h"

namespace emit::renderer {
namespace {

using physics::kLobeNodes;
using physics::Lobe;
using physics::LobeCurve;

// Layout of the table; lib/lobe.glsl has the same numbers.
enum Curve : std::size_t { kEmissivity, kShare, kForward, kUpward, kUnmasked, kSunFacet, kCurves };
constexpr std::size_t kBlock = 2;
constexpr std::size_t kBandNumbers = 1 + kLobeNodes * kCurves;
constexpr double kSkyScale = 0.03;
const double kSkyReach = std::asinh(1.0 / kSkyScale);
constexpr auto kDiscRad = static_cast<float>(physics::kSunSemiAngleRad);
constexpr float kLeastShut = 0.02F;
constexpr auto kPi = static_cast<float>(physics::kPi);

/// Concentration of a von Mises-Fisher lobe whose mean direction has a length: coth k - 1/k.
double concentration_of(double length) {
  if (!(length > 0.0)) return 0.0;
  double low = 0.0;
  double high = 1e9;
  for (int i = 0; i < 200; ++i) {
    const double k = low > 1.0 ? std::sqrt(low * high) : 0.5 * (low + std::min(high, 2.0 * low + 2.0));
    const double at = k > 1e-3 ? 1.0 / std::tanh(k) - 1.0 / k : k / 3.0;
    (at < length ? low : high) = k;
  }
  return low;
}

/// Modified Bessel function of order 0 times exp(-x), by Abramowitz and Stegun 9.8.1 and 9.8.2.
double scaled_bessel(double x) {
  if (x < 3.75) {
    const double t = x * x / 14.0625;
    return std::exp(-x) *
           (1.0 +
            t * (3.5156229 +
                 t * (3.0899424 +
                      t * (1.2067492 + t * (0.2659732 + t * (0.0360768 + t * 0.0045813))))));
  }
  const double t = 3.75 / x;
  return (0.39894228 +
          t * (0.01328592 +
               t * (0.00225319 +
                    t * (-0.00157565 +
                         t * (0.00916281 +
                              t * (-0.02057706 +
                                   t * (0.02635537 + t * (-0.01647633 + t * 0.00392377)))))))) /
         std::sqrt(x);
}

/// Weights with which lobes see the samples of the sky, and their shares in the sky.
struct SkyWeights {
  std::array<std::array<double, LobeModel::kSkySamples>, LobeModel::kSkyNodes> weight{};
  std::array<double, LobeModel::kSkyNodes> share{};
};

SkyWeights make_sky_weights() {
  SkyWeights out;
  for (std::size_t w = 0; w < LobeModel::kSkyWidths; ++w) {
    const double root = static_cast<double>(w) / (LobeModel::kSkyWidths - 1);
    const double concentration = concentration_of(1.0 - std::pow(root, 4));
    for (std::size_t e = 0; e < LobeModel::kSkyElevations; ++e) {
      const std::size_t node = w * LobeModel::kSkyElevations + e;
      const double place = 2.0 * static_cast<double>(e) / (LobeModel::kSkyElevations - 1) - 1.0;
      const double middle = std::asin(std::clamp(kSkyScale * std::sinh(kSkyReach * place), -1.0, 1.0));
      const auto add = [&](double elevation, double weight) {
        if (elevation < 0.0) return;
        out.share[node] += weight;
        const double at = std::asinh(std::sin(elevation) / kSkyScale) / kSkyReach *
                          (LobeModel::kSkySamples - 1);
        const auto i = std::min(static_cast<std::size_t>(at), LobeModel::kSkySamples - 2);
        const double high = std::min(at - static_cast<double>(i), 1.0);
        out.weight[node][i] += weight * (1.0 - high);
        out.weight[node][i + 1] += weight * high;
      };
      if (w == 0) {
        add(middle, 1.0);
        continue;
      }
      // Sum rings of equal elevation; around each, the lobe is a Bessel function.
      constexpr int kRings = 600;
      const double reach = concentration > 0.0 ? 7.0 / std::sqrt(concentration) : physics::kPi;
      const double low = std::max(middle - reach, -physics::kPi / 2.0);
      const double high = std::min(middle + reach, physics::kPi / 2.0);
      std::array<double, kRings> weights{};
      double sum = 0.0;
      for (int i = 0; i < kRings; ++i) {
        const double elevation = std::lerp(low, high, (i + 0.5) / kRings);
        const double across = concentration * std::cos(middle) * std::cos(elevation);
        weights[static_cast<std::size_t>(i)] =
            std::exp(concentration * (std::cos(elevation - middle) - 1.0)) * scaled_bessel(across) *
            std::cos(elevation);
        sum += weights[static_cast<std::size_t>(i)];
      }
      for (int i = 0; i < kRings; ++i) {
        add(std::lerp(low, high, (i + 0.5) / kRings), weights[static_cast<std::size_t>(i)] / sum);
      }
    }
  }
  return out;
}

const SkyWeights& sky_weights() {
  static const SkyWeights kWeights = make_sky_weights();
  return kWeights;
}

/// Place of a cosine on a curve, in float32 as the shader has it.
struct CurvePlace {
  std::size_t node = 0;
  float behind = 0.0F;
};
CurvePlace place_of(float cosine) noexcept {
  const float place = float{kLobeNodes - 1} * std::sqrt(std::clamp(cosine, 0.0F, 1.0F));
  const float node = std::min(std::floor(place), float{kLobeNodes - 2});
  return {static_cast<std::size_t>(node), place - node};
}

}  // namespace

std::optional<LobeModel> LobeModel::build(const scene::ScenarioDesc& scenario,
                                          std::span<const scene::Material> materials) {
  if (std::ranges::none_of(materials, [](const scene::Material& m) { return m.gloss.has_value(); })) {
    return std::nullopt;
  }
  LobeModel model;
  model.bands_ = scenario.bands.size();
  model.lobes_.resize(materials.size());
  model.table_.resize(materials.size());
  for (std::size_t m = 0; m < materials.size(); ++m) {
    if (!materials[m].gloss) continue;
    const physics::Facets facets = scene::facets_of(materials[m], scenario);
    model.table_[m] = static_cast<float>(model.table_.size());
    model.table_.push_back(static_cast<float>(facets.slope * facets.slope));
    model.table_.push_back(facets.slopes == physics::FacetSlopes::gaussian ? 1.0F : 0.0F);
    for (const scene::SpectralBand& band : scenario.bands) {
      Lobe lobe = physics::make_lobe(facets, scene::facet_optics(materials[m], band));
      model.table_.push_back(static_cast<float>(lobe.diffuse_mean_frac));
      for (const LobeCurve* curve : {&lobe.emissivity_frac, &lobe.lobe_frac, &lobe.forward,
                                     &lobe.upward, &lobe.unmasked, &lobe.sun_facet}) {
        for (const double value : *curve) model.table_.push_back(static_cast<float>(value));
      }
      model.lobes_[m].push_back(lobe);
    }
  }
  (void)sky_weights();
  return model;
}

std::optional<double> LobeModel::hemispherical_emissivity_frac(std::size_t material,
                                                               std::size_t band) const noexcept {
  if (lobes_[material].empty()) return std::nullopt;
  return lobes_[material][band].hemispherical_emissivity_frac;
}

double LobeModel::sky_sample_sine(std::size_t sample) noexcept {
  return std::min(
      kSkyScale * std::sinh(kSkyReach * static_cast<double>(sample) / (kSkySamples - 1)), 1.0);
}

void LobeModel::update_sky(std::size_t band, const std::array<double, kSkySamples>& sky_w_m2_sr,
                           std::span<SkyNode> out) const noexcept {
  EMIT_DCHECK(out.size() == kSkyTable && band < bands_);
  const SkyWeights& weights = sky_weights();
  for (std::size_t node = 0; node < kSkyNodes; ++node) {
    double sum = 0.0;
    for (std::size_t s = 0; s < kSkySamples; ++s) sum += weights.weight[node][s] * sky_w_m2_sr[s];
    out[node][band] = static_cast<float>(sum);
    out[kSkyNodes + node][0] = static_cast<float>(weights.share[node]);
  }
}

std::optional<LobeModel::Parts> LobeModel::parts(std::size_t band, const Seen& seen,
                                                 const Light& light,
                                                 std::span<const SkyNode> sky) const noexcept {
  const auto block = static_cast<std::size_t>(table_[seen.material]);
  if (block == 0) return std::nullopt;
  const std::size_t numbers = block + kBlock + band * kBandNumbers;
  const auto curve = [&](std::size_t of_band, Curve which, const CurvePlace& place) {
    const float* first = &table_[of_band + 1 + which * kLobeNodes + place.node];
    return first[0] + place.behind * (first[1] - first[0]);
  };
  // Find the directions.
  const float view_up = glm::dot(seen.normal, seen.to_viewer);
  const float view_cosine = std::clamp(view_up, 1e-3F, 1.0F);
  const glm::vec3 along = seen.normal * view_up - seen.to_viewer;
  const glm::vec3 forward = along / std::sqrt(std::max(glm::dot(along, along), 1e-12F));
  const float sun_up = glm::dot(seen.normal, seen.to_sun);
  glm::vec3 half_way = seen.to_viewer + seen.to_sun;
  half_way /= std::sqrt(std::max(glm::dot(half_way, half_way), 1e-12F));
  const float facet_cosine = std::clamp(glm::dot(half_way, seen.to_viewer), 0.0F, 1.0F);
  const CurvePlace view = place_of(view_cosine);
  const CurvePlace sun = place_of(sun_up);
  // Sum the lobe over sky and the rest.
  Parts out;
  out.emissivity_frac = curve(numbers, kEmissivity, view);
  const float share = curve(numbers, kShare, view);
  out.diffuse_frac = 1.0F - out.emissivity_frac - share;
  const glm::vec3 mean =
      curve(numbers, kForward, view) * forward + curve(numbers, kUpward, view) * seen.normal;
  const float length = std::max(glm::length(mean), 1e-3F);
  const float x = mean.z / length / static_cast<float>(kSkyScale);
  const float root = std::log(std::abs(x) + std::sqrt(x * x + 1.0F)) *
                     static_cast<float>((kSkyElevations - 1) / 2 / kSkyReach);
  constexpr float kMiddle = float{(kSkyElevations - 1) / 2};
  const float along_sky =
      std::clamp(kMiddle + (x < 0.0F ? -root : root), 0.0F, float{kSkyElevations - 1});
  const float across_sky =
      std::clamp(float{kSkyWidths - 1} * std::sqrt(std::sqrt(std::max(1.0F - length, 0.0F))), 0.0F,
                 float{kSkyWidths - 1});
  const float column = std::min(std::floor(along_sky), float{kSkyElevations - 2});
  const float row = std::min(std::floor(across_sky), float{kSkyWidths - 2});
  const auto at = [&](std::size_t first, std::size_t member) {
    const std::size_t i =
        first + static_cast<std::size_t>(row) * kSkyElevations + static_cast<std::size_t>(column);
    const float behind = along_sky - column;
    const float near = std::lerp(sky[i][member], sky[i + 1][member], behind);
    const float far =
        std::lerp(sky[i + kSkyElevations][member], sky[i + kSkyElevations + 1][member], behind);
    return std::lerp(near, far, across_sky - row);
  };
  float sky_part = at(0, band);
  float sky_share = at(kSkyNodes, 0);
  const float low = std::min(1.0F, (1.0F - seen.normal.z) / (2.0F * (1.0F - length) + 1e-6F));
  const float sky_seen =
      std::min(seen.open_frac / std::max(0.5F + 0.5F * seen.normal.z, 1e-3F), 1.0F);
  const float scale = sky_seen / std::max(sky_share + (1.0F - sky_share) * low, 1e-3F);
  sky_part *= scale;
  sky_share *= scale;
  const float rest = light.incoming_w_m2_sr - seen.open_frac * light.sky_w_m2_sr -
                     (1.0F - seen.open_frac) * light.surroundings_w_m2_sr;
  const float other = std::max(
      light.surroundings_w_m2_sr + rest / std::max(1.0F - seen.open_frac, kLeastShut), 0.0F);
  out.lobe_sky_w_m2_sr = share * sky_part;
  out.lobe_neighbours_w_m2_sr = share * (1.0F - sky_share) * other;
  // Reflect the sun.
  const float to_sun = 1.0F - curve(numbers, kEmissivity, sun) - curve(numbers, kShare, sun);
  out.diffuse_sun_per_sr = out.diffuse_frac * to_sun /
                           (std::max(table_[numbers], 1e-6F) * kPi) *
                           seen.sun_cosine;
  if (!(sun_up > 1e-4F && glm::dot(seen.normal, half_way) > 0.0F)) return out;
  const std::size_t first_band = block + kBlock;
  const float from = curve(first_band, kUnmasked, view);
  const float to = curve(first_band, kUnmasked, sun);
  const float open = from > 0.0F && to > 0.0F ? 1.0F / (1.0F / from + 1.0F / to - 1.0F) : 0.0F;
  const glm::vec3 off = glm::cross(seen.normal, half_way);
  const float across2 = glm::dot(off, off);
  const float slope2 = table_[block];
  const float disc2 = 0.25F * kDiscRad * kDiscRad;
  const float wide2 = std::sqrt(
      (slope2 + disc2) * (slope2 + disc2 / std::max(facet_cosine * facet_cosine, 1e-4F)));
  const float cos2 = std::max(1.0F - across2, 1e-6F);
  const float spread = wide2 * cos2 + across2;

  const float density = table_[block + 1] > 0.5F
                            ? std::exp(-across2 / (cos2 * wide2)) / (kPi * wide2 * cos2 * cos2)
                            : wide2 / (kPi * spread * spread);
  const float glint =
      std::min(density * open / (4.0F * view_cosine), 1.0F / (kPi * kDiscRad * kDiscRad));
  out.glint_per_sr = curve(numbers, kSunFacet, place_of(facet_cosine)) * glint *
                     std::min(seen.sun_cosine / std::max(sun_up, 1e-4F), 1.0F);
  return out;
}

}  // namespace emit::renderer
