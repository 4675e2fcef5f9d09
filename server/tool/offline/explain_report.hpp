// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emit/renderer/renderer.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/offline/probe_run.hpp"
#include "tool/support/json.hpp"

/// Findings of `emit explain` about a pixel, as text, JSON and page.
namespace emit::tool {

/// Radiance of a pixel in one band.
struct ExplainedBand {
  std::string name;
  double pixel_w_m2_sr = 0.0;  ///< of the frame
  double apparent_k = 0.0;     ///< temperature of the blackbody with that radiance
  renderer::RadianceTerms terms;
};

/// Surface that the pixel shows.
struct ExplainedSurface {
  std::string object;
  bool is_entity = false;  ///< the object may move
  std::string material;
  std::size_t material_index = 0;  ///< in the loaded scene
  glm::dvec3 position_m{0.0};
  glm::dvec3 normal{0.0};
  double range_m = 0.0;
  double temperature_k = 0.0;
  double sky_frac = 0.0;
  double sun_cosine = 0.0;  ///< with the visible share of the sun
  double clutter_sd = 0.0;  ///< mean of the clutter's field over the pixel
  double clutter_k = 0.0;   ///< part of temperature_k
  double cloud_sun = 1.0;   ///< part of sun_cosine: direct sun under clouds by the weather's mean
};

struct Explanation {
  std::string scenario;
  std::int64_t epoch_utc_ns = 0;
  double time_s = 0.0;
  glm::uvec2 px{0};
  std::optional<ExplainedSurface> surface = std::nullopt;  ///< empty: sky
  double cloud_frac = 0.0;  ///< opacity of clouds in a pixel of the sky
  bool clouds = false;      ///< the scenario has [clouds]
  std::vector<ExplainedBand> bands{};
  std::optional<ProbeRun> history = std::nullopt;
  std::vector<double> equilibrium_k{};  ///< by row of the history (Equilibrium); NaN: not known
};

/// Terms of a radiance with their names, in the order in which they are shown.
[[nodiscard]] std::array<std::pair<std::string_view, double>, 11> named_terms(
    const renderer::RadianceTerms& terms);

[[nodiscard]] std::string explain_text(const Explanation& found);
[[nodiscard]] Json explain_json(const Explanation& found);
[[nodiscard]] std::string explain_page(const Explanation& found);

}  // namespace emit::tool
