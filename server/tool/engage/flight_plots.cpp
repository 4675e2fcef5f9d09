// SPDX-License-Identifier: Apache-2.0
#include "tool/engage/flight_plots.hpp"

#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "emit/physics/check.hpp"

namespace emit::tool {
namespace {

PlotSeries line(std::string label) {
  PlotSeries out;
  out.label = std::move(label);
  out.line = true;
  out.markers = false;
  return out;
}

Plot over_time(
    const std::string& title, const std::string& unit, const LoopRecord& record,
    const std::vector<std::pair<std::string, std::function<double(const LoopFrame&)>>>& values) {
  Plot plot;
  plot.title = title;
  plot.x.label = "time since the begin of the flight, s";
  plot.y.label = unit;
  for (const auto& [label, value] : values) {
    PlotSeries series = line(label);
    for (const LoopFrame& frame : record.frames) {
      const double y = value(frame);
      if (std::isfinite(y)) series.points.push_back({frame.time_s, y, ""});
    }
    plot.series.push_back(std::move(series));
  }
  return plot;
}

Plot path_plot(const LoopRecord& record, bool guided, bool side) {
  Plot plot;
  plot.title = side ? "Path from the side" : "Path from above";
  plot.x.label = "east, m";
  plot.y.label = side ? "up, m" : "north, m";
  const auto point = [side](const glm::dvec3& at) {
    return PlotPoint{at.x, side ? at.z : at.y, ""};
  };
  PlotSeries host = line("seeker");
  PlotSeries target = line("target");
  target.emphasis = true;
  for (const LoopFrame& frame : record.frames) {
    host.points.push_back(point(frame.host_pose.position_world_m));
    if (frame.target_m) target.points.push_back(point(*frame.target_m));
  }
  plot.series.push_back(std::move(host));
  if (guided) plot.series.push_back(std::move(target));
  return plot;
}

}  // namespace

double measured_error_px(const LoopFrame& frame, double focal_px) {
  return std::isfinite(frame.measured_error_rad) ? focal_px * std::tan(frame.measured_error_rad)
                                                 : NAN;
}

std::vector<Plot> flight_plots(const EngageResults& results) {
  EMIT_CHECK(results.flight.has_value());
  const LoopRecord& record = *results.flight;
  const auto far = [](const LoopFrame& f, double value) {
    return f.truth.range_m > kFarM ? value : NAN;
  };
  const bool guided = results.outcome.has_value();
  std::vector<Plot> plots{path_plot(record, guided, false), path_plot(record, guided, true)};
  if (guided) {
    plots.push_back(over_time(fmt::format("Pointing, beyond {:g} m", kFarM), "error, px", record,
                              {{"optical axis against the target",
                                [&](const LoopFrame& f) {
                                  return far(
                                      f, results.focal_px * std::tan(f.truth.boresight_error_rad));
                                }},
                               {"measured direction against the target", [&](const LoopFrame& f) {
                                  return far(f, measured_error_px(f, results.focal_px));
                                }}}));
    plots.push_back(
        over_time("Lateral acceleration", "m/s2", record,
                  {{"command", [](const LoopFrame& f) { return f.truth.command_m_s2; }},
                   {"achieved by lift", [](const LoopFrame& f) { return f.truth.lift_m_s2; }}}));
    plots.push_back(over_time(fmt::format("Rate of the line of sight, beyond {:g} m", kFarM),
                              "mrad/s", record, {{"", [&](const LoopFrame& f) {
                                                    return far(
                                                        f, 1e3 * f.truth.line_of_sight_rate_rad_s);
                                                  }}}));
    plots.push_back(over_time("Range to the target", "m", record,
                              {{"", [](const LoopFrame& f) { return f.truth.range_m; }}}));
  }
  if (results.real_time) {
    plots.push_back(over_time("Pointing error of the motion simulator", "px", record,
                              {{"", [](const LoopFrame& f) { return f.pointing_error_px; }}}));
  }
  plots.push_back(over_time("Loop delay: pose sent to answer read", "ms", record,
                            {{"", [](const LoopFrame& f) { return f.loop_delay_ms; }}}));
  return plots;
}

}  // namespace emit::tool
