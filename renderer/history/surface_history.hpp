// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "emit/renderer/surface_forcing.hpp"
#include "history/environment.hpp"
#include "history/foster_history.hpp"
#include "history/step_plan.hpp"

namespace emit::renderer {

/// Forcing of an interval whose surroundings have the temperature that the weather gives them and
/// reflect nothing: that of the model emit2014.
[[nodiscard]] IntervalForcing weather_forcing(const HistoryInterval& interval) noexcept;

/// The forcing that all samples of a surface share, whatever the thermal model: with `foster` the
/// surroundings are carried along, with emit2014 they are the weather's.
/// Owner: CachedStage. Real time: everything but the constructor is RT-safe.
class SurfaceHistory {
 public:
  /// `steps` of the plan; `foster`: nothing for emit2014.
  SurfaceHistory(std::uint32_t steps, std::optional<FosterHistory> foster)
      : foster_(std::move(foster)), intervals_(foster_ ? 0 : steps) {}

  /// Brings the intervals to those of the plan.
  void update(const StepPlan& plan, const Environment& environment) noexcept;

  [[nodiscard]] std::span<const IntervalForcing> intervals() const noexcept;
  /// Unshadowed, before the history; none with emit2014.
  [[nodiscard]] std::span<const IntervalForcing> tail() const noexcept;

  /// Forcing of an interval that follows the last one.
  [[nodiscard]] IntervalForcing extend(std::int64_t begin_ns, std::int64_t end_ns,
                                       const Environment& environment) noexcept;
  /// States of the surroundings where update() or extend() left them, and going back to such.
  [[nodiscard]] physics::FosterState<double> surroundings() const noexcept;
  void restore_surroundings(const physics::FosterState<double>& state) noexcept;

  /// Temperature of the surroundings where the model carries it; nothing with emit2014.
  [[nodiscard]] std::optional<double> surroundings_now_k() const noexcept;

  /// What foster knows of a material: its network, and its states before the tail on an unshadowed
  /// face of direction `normal`. emit2014: no modes, no states.
  [[nodiscard]] const physics::FosterNetwork& network(std::size_t material) const noexcept;
  [[nodiscard]] physics::FosterState<double> start_states(std::size_t material,
                                                          const glm::dvec3& normal) const noexcept;

 private:
  std::optional<FosterHistory> foster_;
  physics::FosterNetwork no_network_;
  std::vector<IntervalForcing> intervals_;  ///< emit2014
};

}  // namespace emit::renderer
