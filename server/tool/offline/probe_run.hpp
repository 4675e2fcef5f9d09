// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/offline/offline_frames.hpp"
#include "tool/offline/probe_points.hpp"
#include "tool/support/svg_plot.hpp"

/// Histories of points of a scenario.
namespace emit::tool {

/// Values of one point at one instant; NaN where there are none.
struct ProbeRow {
  double time_s = 0.0;
  std::size_t point = 0;
  std::optional<ProbePlace> place{};
  double temperature_k = std::numeric_limits<double>::quiet_NaN();
  double sun_frac = std::numeric_limits<double>::quiet_NaN();
  double sun_w_m2 = std::numeric_limits<double>::quiet_NaN();
  double sky_frac = std::numeric_limits<double>::quiet_NaN();
  double flux_w_m2 = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> radiance_w_m2_sr{};
};

/// Forcing at the instants of the rows.
class ProbeForcing {
 public:
  /// Errors: those of renderer::surface_forcing().
  [[nodiscard]] static physics::Result<ProbeForcing> create(const scene::ScenarioDesc& scenario,
                                                            std::span<const double> times_s);
  [[nodiscard]] const renderer::SurfaceForcing& at(std::size_t time) const {
    return intervals_[time].begin;
  }

 private:
  explicit ProbeForcing(std::vector<renderer::IntervalForcing> intervals)
      : intervals_(std::move(intervals)) {}
  std::vector<renderer::IntervalForcing> intervals_;
};

/// One run: it renders a pixel for each point and time. Thread: one. Setup only.
class ProbeRun {
 public:
  /// `times_s` ascend. `scenario` is copied.
  ProbeRun(const scene::ScenarioDesc& scenario, std::vector<double> times_s,
           std::vector<ProbePoint> points);
  /// Finds the surfaces of the points and reads their values. Warns of points without a surface.
  /// Errors: those of OfflineFrames and renderer::surface_forcing().
  [[nodiscard]] physics::Result<void> run(const ProbeFinder& finder, int gpu_index,
                                          SceneWarnings warnings = SceneWarnings::told);

  [[nodiscard]] const std::vector<ProbePoint>& points() const noexcept { return points_; }
  [[nodiscard]] const std::vector<double>& times_s() const noexcept { return times_s_; }
  /// Values by time, then by point.
  [[nodiscard]] const std::vector<ProbeRow>& rows() const noexcept { return rows_; }
  /// Diagrams of temperature, sun, sky, flux and radiance over time.
  [[nodiscard]] std::vector<Plot> plots() const;

 private:
  void plan(const ProbeFinder& finder);
  [[nodiscard]] physics::Result<void> render(int gpu_index, SceneWarnings warnings);
  void read(const renderer::FrameView& view, const OfflineShot& shot,
            const renderer::SurfaceForcing& forcing, ProbeRow& row);
  void read_flux(const renderer::Renderer& renderer, ProbeRow& row);

  scene::ScenarioDesc scenario_;
  std::vector<double> times_s_;
  std::vector<ProbePoint> points_;
  std::vector<ProbeRow> rows_;
  std::vector<OfflineShot> shots_;
  std::vector<std::size_t> row_of_shot_;
  /// Sample of each point and the place that it was found for.
  std::vector<std::pair<std::optional<std::uint32_t>, glm::dvec3>> samples_;
  std::size_t hidden_ = 0;
};

}  // namespace emit::tool
