// SPDX-License-Identifier: Apache-2.0
#include "tool/view/pixel_report.hpp"

#include <fmt/format.h>

#include <cmath>

#include "emit/physics/apparent_temperature.hpp"
#include "tool/offline/explain_report.hpp"

namespace emit::tool::view {

std::vector<std::string> pixel_report(const scene::ScenarioDesc& scenario,
                                      const ProbeFinder& finder, const renderer::Renderer& renderer,
                                      const renderer::FrameView& frame, std::size_t band,
                                      const glm::uvec2& px) {
  const std::size_t i = std::size_t{px.y} * frame.width_px + px.x;
  const float pixel_w_m2_sr = frame.radiance_w_m2_sr[band][i];
  const auto radiance_w_m2_sr = static_cast<double>(pixel_w_m2_sr);
  std::vector<std::string> lines;
  // The report stays on the screen while time goes on or jumps.
  const std::string at = fmt::format("at {:.3f} s", 1e-9 * static_cast<double>(frame.sim_time_ns));
  double normal_up = 1.0;
  if (std::isfinite(frame.depth_m[i])) {
    const ProbePoint point{.name = "", .kind = ProbePoint::Kind::pixel, .x_px = px.x, .y_px = px.y};
    const auto place = finder.place(point, frame.sim_time_ns, frame.sensor_pose);
    if (place) normal_up = place->normal.z;
    const glm::dvec3 ray = pixel_direction_body(scenario.sensor, px.x, px.y);
    const scene::ObjectDesc& object =
        scenario.objects[static_cast<std::size_t>(frame.object_id[i]) - 1];
    lines.push_back(fmt::format("pixel {} {}  {}  range {:.1f} m", px.x, px.y, at,
                                static_cast<double>(frame.depth_m[i]) / ray.x));
    lines.push_back(fmt::format("object {}  material {}", object.name,
                                finder.material_name(static_cast<std::size_t>(frame.material[i]))));
    lines.push_back(fmt::format("surface {:.2f} K  sun {:.2f}  sky {:.2f}", frame.temperature_k[i],
                                frame.sun_cosine[i], frame.sky_frac[i]));
  } else {
    lines.push_back(fmt::format("pixel {} {}  {}  sky", px.x, px.y, at));
  }
  const physics::ApparentTemperature apparent(scene::spectral_band(scenario.bands[band]));
  lines.push_back(fmt::format("band {}  apparent {:.2f} K", scenario.bands[band].name,
                              static_cast<double>(apparent.k(pixel_w_m2_sr))));
  if (!frame.coverage_frac.empty() && frame.coverage_frac[i] > 0.0F) {
    lines.emplace_back("small target: many samples in one pixel, no terms");
    return lines;
  }
  const std::vector<renderer::RadianceTerms> terms = renderer.radiance_terms(frame, px, normal_up);
  for (const auto& [name, value_w_m2_sr] : named_terms(terms[band])) {
    if (value_w_m2_sr == 0.0) continue;
    lines.push_back(fmt::format("{} {:.4g}  {:.1f} %", name, value_w_m2_sr,
                                100.0 * value_w_m2_sr / radiance_w_m2_sr));
  }
  lines.push_back(
      fmt::format("sum {:.6g}  pixel {:.6g} W/m2/sr", terms[band].sum_w_m2_sr(), radiance_w_m2_sr));
  return lines;
}

}  // namespace emit::tool::view
