// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float4.hpp>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/foster.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "emit/scene/scene_desc.hpp"
#include "history/environment.hpp"
#include "history/step_plan.hpp"

/// What the extended thermal model (`thermal.model = "foster"`) carries on the CPU: the temperature
/// of the surroundings, and the states of unshadowed surfaces before the history begins.
namespace emit::renderer {

/// Forcing at an instant but for what the surroundings send.
[[nodiscard]] SurfaceForcing open_forcing(const physics::SunPosition& sun,
                                          const physics::Forcing& weather) noexcept;
/// Sun and weather at both ends; weather that changes at the end has not acted. Where the host
/// changes it in between, the line nearest to what it was, with its mean. No sample instant.
[[nodiscard]] HistoryInterval interval_between(std::int64_t begin_ns, std::int64_t end_ns,
                                               const Environment& environment) noexcept;

/// Drive of an unshadowed face of that direction.
[[nodiscard]] physics::FosterDrive<double> unshadowed_drive(const SurfaceForcing& forcing,
                                                            const FosterMaterial& material,
                                                            const glm::dvec3& normal,
                                                            double reference_k) noexcept;

/// Owner: Renderer. Real time: update is RT-safe, and takes microseconds unless the host has
/// changed the weather before the history's start; then the spin-up runs again (tens of
/// milliseconds per material).
class FosterHistory {
 public:
  /// The last part of the spin-up is done per pixel, in this many intervals: states of two hours
  /// ago vary smoothly enough with direction for the table, those of now do not (they know where
  /// the sun is just grazing).
  static constexpr std::uint32_t kTailSteps = 10;
  static constexpr std::int64_t kTailNs = 7'200'000'000'000;
  /// Nodes per axis of the octahedral grid of directions. Odd, so that the axes are nodes.
  static constexpr std::uint32_t kGridNodes = 49;

  /// `materials` as the scene's shaders number them. Runs the spin-up.
  FosterHistory(const scene::ScenarioDesc& scenario, std::vector<FosterMaterial> materials,
                FosterMaterial surroundings, const Environment& environment, double reference_k);

  /// Brings everything to the plan's intervals. True when the table has changed.
  bool update(const StepPlan& plan, const Environment& environment) noexcept;

  /// Forcing between nodes of the caller's own from the history's start on; entry i from node i to
  /// node i + 1. @pre out has one entry less than nodes_ns, which ascends
  void forcing_over(std::span<const std::int64_t> nodes_ns, const Environment& environment,
                    std::span<IntervalForcing> out) noexcept;

  [[nodiscard]] std::span<const FosterMaterial> materials() const noexcept { return materials_; }
  [[nodiscard]] std::span<const IntervalForcing> intervals() const noexcept { return intervals_; }
  /// Last intervals of the spin-up; none without spin-up.
  [[nodiscard]] std::span<const IntervalForcing> tail() const noexcept { return tail_; }
  [[nodiscard]] double surroundings_now_k() const noexcept { return surroundings_now_k_; }

  /// States by material, row and column of the grid; node (i, j) of a grid of m nodes is the
  /// direction of octahedral coordinates (2 i / (m - 1) - 1, 2 j / (m - 1) - 1).
  [[nodiscard]] std::span<const glm::vec4> table() const noexcept { return table_; }
  [[nodiscard]] std::uint32_t grid_nodes() const noexcept { return grid_nodes_; }

  /// States from the table, bilinear. @pre material < materials().size(). Any thread; RT-safe.
  [[nodiscard]] physics::FosterState<double> start_states(std::size_t material,
                                                          const glm::dvec3& normal) const noexcept;

  /// Carries the surroundings on over an interval that follows the last one. RT-safe.
  [[nodiscard]] IntervalForcing extend(std::int64_t begin_ns, std::int64_t end_ns,
                                       const Environment& environment) noexcept;

  /// States of the surroundings where update() or extend() left them, and going back to such.
  [[nodiscard]] const physics::FosterState<double>& surroundings() const noexcept {
    return surroundings_state_;
  }
  void restore_surroundings(const physics::FosterState<double>& state) noexcept {
    surroundings_state_ = state;
  }

  /// States of an unshadowed face of materials()[material] of any direction at the instant where
  /// the table stands, from the full spin-up rather than the table.
  [[nodiscard]] physics::FosterState<double> spun_up(std::size_t material,
                                                     const glm::dvec3& normal) const noexcept;

 private:
  void spin_up(const Environment& environment) noexcept;
  void spin_up_surroundings(const Environment& environment) noexcept;
  /// Advances the surroundings over one interval and fills its forcing.
  void carry(const HistoryInterval& interval, double tolerance_k, IntervalForcing& out) noexcept;
  [[nodiscard]] SurfaceForcing forcing(const physics::SunPosition& sun,
                                       const physics::Forcing& weather) const noexcept;

  std::vector<FosterMaterial> materials_;
  FosterMaterial surroundings_;
  double reference_k_ = 0.0;
  double tolerance_k_ = 0.0;
  std::int64_t history_start_ns_ = 0;
  std::int64_t spin_up_ns_ = 0;
  std::uint32_t grid_nodes_ = 2;

  physics::FosterSurface<double> surroundings_surface_;
  physics::FosterState<double> surroundings_state_{};     ///< while carrying
  physics::FosterState<double> surroundings_at_start_{};  ///< at history start
  double surroundings_now_k_ = 0.0;

  std::vector<IntervalForcing> spin_up_;  ///< up to the instant of the table
  std::vector<std::vector<physics::FosterGains<double>>> spin_up_gains_;  ///< by material
  std::vector<IntervalForcing> tail_;
  std::vector<IntervalForcing> intervals_;
  std::vector<std::int64_t> nodes_ns_;
  std::vector<glm::vec4> table_;

  std::uint64_t revision_ = 0;
  bool weather_before_start_ = false;
};

}  // namespace emit::renderer
