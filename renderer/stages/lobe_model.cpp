// SPDX-License-Identifier: Apache-2.0
#include "stages/lobe_model.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "emit/scene/gloss_optics.hpp"
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
constexpr float kLeastShut = 0.02F;
constexpr auto kPi = static_cast<float>(physics::kPi);

/// Radial samples of slopes, which make a lobe around the normal of a surface: the angles by which
/// facets turn light, and their weights.
constexpr std::size_t kRadii = 120;
struct Turn {
  double angle = 0.0;
  double weight = 0.0;
};
std::array<Turn, kRadii> turns_of(physics::FacetSlopes slopes, double slope) {
  std::array<Turn, kRadii> out;
  for (std::size_t r = 0; r < kRadii; ++r) {
    const double rest = 1.0 - (static_cast<double>(r) + 0.5) / kRadii;
    const double steeper = rest * rest * rest;
    const double radius =
        slope * (slopes == physics::FacetSlopes::ggx ? std::sqrt((1.0 - steeper) / steeper)
                                                     : std::sqrt(-std::log(steeper)));
    out[r] = {2.0 * std::atan(radius), 3.0 * rest * rest / kRadii};
  }
  return out;
}

/// Returns the width of the slopes whose lobe has a mean direction of a length, 0 to 1.
double slope_of(physics::FacetSlopes slopes, double length) {
  double low = 1e-5;
  double high = 10.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = std::sqrt(low * high);
    double mean = 0.0;
    for (const Turn& turn : turns_of(slopes, middle)) mean += turn.weight * std::cos(turn.angle);
    (mean > length ? low : high) = middle;
  }
  return low;
}

/// Weights with which lobes see the samples of the sky, and their shares in the sky.
struct SkyWeights {
  std::array<std::array<double, LobeModel::kSkySamples>, LobeModel::kSkyNodes> weight{};
  std::array<double, LobeModel::kSkyNodes> share{};
};

SkyWeights make_sky_weights(physics::FacetSlopes slopes) {
  constexpr std::size_t kSectors = 24;  // of half a turn
  SkyWeights out;
  for (std::size_t w = 0; w < LobeModel::kSkyWidths; ++w) {
    const double root = static_cast<double>(w) / (LobeModel::kSkyWidths - 1);
    const auto turns = turns_of(slopes, slope_of(slopes, 1.0 - std::pow(root, 4)));
    for (std::size_t e = 0; e < LobeModel::kSkyElevations; ++e) {
      const std::size_t node = w * LobeModel::kSkyElevations + e;
      const double place = 2.0 * static_cast<double>(e) / (LobeModel::kSkyElevations - 1) - 1.0;
      const double sine = std::clamp(kSkyScale * std::sinh(kSkyReach * place), -1.0, 1.0);
      const double cosine = std::sqrt(1.0 - sine * sine);
      const auto add = [&](double sine_of, double weight) {
        if (sine_of < 0.0) return;
        out.share[node] += weight;
        const double at =
            std::asinh(sine_of / kSkyScale) / kSkyReach * (LobeModel::kSkySamples - 1);
        const auto i = std::min(static_cast<std::size_t>(at), LobeModel::kSkySamples - 2);
        const double high = std::min(at - static_cast<double>(i), 1.0);
        out.weight[node][i] += weight * (1.0 - high);
        out.weight[node][i + 1] += weight * high;
      };
      if (w == 0) {
        add(sine, 1.0);
        continue;
      }
      for (const Turn& turn : turns) {
        for (std::size_t k = 0; k < kSectors; ++k) {
          const double around = physics::kPi * (static_cast<double>(k) + 0.5) / kSectors;
          add(sine * std::cos(turn.angle) + cosine * std::sin(turn.angle) * std::cos(around),
              turn.weight / kSectors);
        }
      }
    }
  }
  return out;
}

const SkyWeights& sky_weights(physics::FacetSlopes slopes) {
  static const SkyWeights kGgx = make_sky_weights(physics::FacetSlopes::ggx);
  static const SkyWeights kGaussian = make_sky_weights(physics::FacetSlopes::gaussian);
  return slopes == physics::FacetSlopes::ggx ? kGgx : kGaussian;
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
  if (std::ranges::none_of(materials,
                           [](const scene::Material& m) { return m.gloss.has_value(); })) {
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
      Lobe lobe = physics::make_lobe(facets, scene::facet_optics(materials[m], facets, band));
      model.table_.push_back(static_cast<float>(lobe.diffuse_mean_frac));
      for (const LobeCurve* curve : {&lobe.emissivity_frac, &lobe.lobe_frac, &lobe.forward_ratio,
                                     &lobe.upward, &lobe.unmasked, &lobe.sun_facet}) {
        for (const double value : *curve) model.table_.push_back(static_cast<float>(value));
      }
      model.lobes_[m].push_back(lobe);
    }
  }
  (void)sky_weights(physics::FacetSlopes::ggx);
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
  for (const auto slopes : {physics::FacetSlopes::ggx, physics::FacetSlopes::gaussian}) {
    const SkyWeights& weights = sky_weights(slopes);
    const std::size_t first = slopes == physics::FacetSlopes::ggx ? 0 : 2 * kSkyNodes;
    for (std::size_t node = 0; node < kSkyNodes; ++node) {
      double sum = 0.0;
      for (std::size_t s = 0; s < kSkySamples; ++s) sum += weights.weight[node][s] * sky_w_m2_sr[s];
      out[first + node][band] = static_cast<float>(sum);
      out[first + kSkyNodes + node][0] = static_cast<float>(weights.share[node]);
    }
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
  const glm::vec3 forward = seen.normal * view_up - seen.to_viewer;
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
  const std::size_t first_sky = table_[block + 1] > 0.5F ? 2 * kSkyNodes : 0;
  const auto at = [&](std::size_t first, std::size_t member) {
    const std::size_t i = first_sky + first + static_cast<std::size_t>(row) * kSkyElevations +
                          static_cast<std::size_t>(column);
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
  out.diffuse_sun_per_sr =
      out.diffuse_frac * to_sun / (std::max(table_[numbers], 1e-6F) * kPi) * seen.sun_cosine;
  out.glint_per_sr = curve(numbers, kSunFacet, place_of(facet_cosine)) * seen.glint_per_sr;
  return out;
}

}  // namespace emit::renderer
