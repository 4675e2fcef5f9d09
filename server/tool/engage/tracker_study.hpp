// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <glm/ext/vector_double3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "tool/support/json.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {

/// Simulations that a template is made by (server/docs/engage.md).
enum class ShadowModel : std::uint8_t { thermal, plain, none };
inline constexpr ShadowModel kShadowModels[] = {ShadowModel::thermal, ShadowModel::plain,
                                                ShadowModel::none};
[[nodiscard]] std::string_view to_string(ShadowModel model) noexcept;

/// Matching errors of all templates of a picture.
struct MatchFigures {
  double time_s = 0.0;  ///< since the begin of the study
  double rms_px = 0.0;
  double median_px = 0.0;
  double lost_frac = 0.0;    ///< share of the templates that are found more than 2 px off
  double correlation = 0.0;  ///< mean of the peaks
};

/// Matching errors of the templates of one simulation against pictures over an hour.
struct StudySeries {
  ShadowModel model = ShadowModel::thermal;
  std::vector<MatchFigures> predicted;  ///< the template is made for the time of the picture
  std::vector<MatchFigures> stored;     ///< the template is that of the begin
};

struct TrackerStudy {
  std::string band;
  double start_s = 0.0;  ///< simulation time of the begin
  std::uint32_t template_px = 0;
  std::uint32_t search_px = 0;
  std::uint32_t templates = 0;  ///< of each picture
  double noise_k = 0.0;
  std::vector<std::string> forecast;
  std::vector<StudySeries> series;
  std::vector<std::string> pictures;  ///< files: the truth at the begin and at the end
};

struct TrackerStudyOptions {
  ScenarioChoice truth;
  /// Settings by which the templates' weather differs from the truth, "KEY=VALUE".
  std::vector<std::string> forecast;
  std::string band = "8-12";
  double start_s = 0.0;  ///< simulation time
  double length_s = 3600.0;
  double step_s = 300.0;
  glm::dvec3 look_at_m{0.0};
  double range_m = 900.0;  ///< of the camera from that place, towards the scenario's sensor
  double depression_rad = 0.5;
  double noise_k = 0.05;  ///< standard deviation of the detector noise, apparent temperature
  std::uint32_t template_px = 32;
  std::uint32_t search_px = 12;
  std::filesystem::path out;   ///< folder for pictures
  std::filesystem::path work;  ///< folder for files of the matching program
};

/// Renders the pictures and matches them. Errors: config; those of the renderer; io, protocol (the
/// matching program).
[[nodiscard]] physics::Result<TrackerStudy> run_tracker_study(const TrackerStudyOptions& options);

[[nodiscard]] Json study_json(const TrackerStudy& study);
/// Returns the two diagrams of the study: predicted and stored templates.
[[nodiscard]] std::vector<Plot> study_plots(const TrackerStudy& study);

}  // namespace emit::tool
