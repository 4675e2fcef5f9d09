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

/// Returns the forcing of an interval as the model emit2014 has it: the surroundings have the
/// temperature that the weather gives and reflect nothing. RT-safe.
[[nodiscard]] IntervalForcing weather_forcing(const HistoryInterval& interval) noexcept;

/// Forcing that all samples of a surface share, for either thermal model: with `foster` the
/// surroundings are simulated, with emit2014 they are the weather's. Owner: CachedStage.
/// Thread: the renderer's.  Real time: everything but the constructor is RT-safe.
class SurfaceHistory {
 public:
  /// Prepares for a plan of `steps` intervals. `foster` is empty for emit2014.
  SurfaceHistory(std::uint32_t steps, std::optional<FosterHistory> foster)
      : foster_(std::move(foster)), intervals_(foster_ ? 0 : steps) {}

  /// Computes the forcing of the plan's intervals.
  void update(const StepPlan& plan, const Environment& environment) noexcept;

  [[nodiscard]] std::span<const IntervalForcing> intervals() const noexcept;
  /// Returns the unshadowed intervals before the history. The span is empty with emit2014.
  [[nodiscard]] std::span<const IntervalForcing> tail() const noexcept;

  /// Returns the forcing of an interval that follows the last one.
  [[nodiscard]] IntervalForcing extend(std::int64_t begin_ns, std::int64_t end_ns,
                                       const Environment& environment) noexcept;
  /// Returns the state of the surroundings after the last update() or extend().
  [[nodiscard]] GroundState surroundings() const noexcept;
  /// Restores a state that surroundings() returned.
  void restore_surroundings(const GroundState& state) noexcept;

  /// Returns whether rain wets something here. Nothing with emit2014.
  [[nodiscard]] bool holds_water() const noexcept { return foster_ && foster_->holds_water(); }

  /// Returns the temperature of the surroundings, K; nothing with emit2014.
  [[nodiscard]] std::optional<double> surroundings_now_k() const noexcept;

  /// Returns the network of a material. With emit2014 it has no modes.
  /// @pre material is an index into the scene's materials
  [[nodiscard]] const physics::FosterNetwork& network(std::size_t material) const noexcept;
  /// Returns the states of a material before the tail, on an unshadowed face with that normal. With
  /// emit2014 they are 0.
  /// @pre material is an index into the scene's materials
  [[nodiscard]] physics::FosterState<double> start_states(std::size_t material,
                                                          const glm::dvec3& normal) const noexcept;
  /// Returns whether surfaces of a material begin in the balance of their own first day. None does
  /// with emit2014.
  [[nodiscard]] bool starts_balanced(std::size_t material) const noexcept {
    return foster_ && foster_->materials()[material].starts_balanced;
  }
  /// Returns by how much less sun and sky have changed them (FosterHistory::hidden_states()). With
  /// emit2014 it is 0.
  [[nodiscard]] physics::FosterState<double> hidden_states(std::size_t material,
                                                           const FaceOpening& face) const noexcept {
    return foster_ ? foster_->hidden_states(material, face) : physics::FosterState<double>{};
  }
  /// Returns the sun on an unshadowed face over the day in whose balance surfaces begin, J m-2. It
  /// is 0 where none does.
  [[nodiscard]] double day_sun_j_m2(const glm::dvec3& normal) const noexcept {
    return foster_ ? foster_->day_sun_j_m2(normal) : 0.0;
  }

 private:
  std::optional<FosterHistory> foster_;
  physics::FosterNetwork no_network_;
  std::vector<IntervalForcing> intervals_;  ///< intervals of emit2014
};

}  // namespace emit::renderer
