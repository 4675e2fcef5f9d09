// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <vector>

#include "emit/physics/foster.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "history/environment.hpp"
#include "history/ground_state.hpp"
#include "history/step_plan.hpp"

namespace emit::renderer {

/// Gives the materials that hold water their slots: at first materials that are no twins, then
/// twins as far as slots are left. What gets none has `water_shared` and the slot of another
/// material: a twin that of its mean, others that whose store is most alike. Setup only.
/// @pre the slots are not set, but first_twin is
void number_water(std::span<FosterMaterial> materials);

/// Open, level ground of the materials that hold water, are moist, snow or ice, beside the
/// surroundings of a scene: it says how wet rain leaves faces, and which limits of the formulae are
/// passed (physics.md section 8). Immutable after construction; any thread; RT-safe except for the
/// constructor.
class OpenGrounds {
 public:
  /// Copies the properties of `materials`, whose last entry is that of the surroundings. It
  /// allocates.
  OpenGrounds(std::span<const FosterMaterial> materials, double reference_k, double tolerance_k);

  /// Sets the grounds to their start.
  void start(GroundState& state) const noexcept;

  /// Returns false if nothing can wet a ground over these intervals or make it pass a limit, so
  /// that carry() would write nothing but zeros.
  [[nodiscard]] bool needed(const Environment& environment,
                            std::span<const HistoryInterval> intervals) const noexcept;
  /// Advances heat and water over an interval, and writes the wetness of its ends.
  void carry(const HistoryInterval& interval, IntervalForcing& out,
             GroundState& state) const noexcept;
  /// Notes the limits that the weather of an interval passes.
  void note_weather(const HistoryInterval& interval, GroundState& state) const noexcept;

 private:
  /// Ground of a material, and its surface over its base.
  struct Ground {
    FosterMaterial material;
    physics::FosterSurface<double> surface;
  };
  /// Wetness at both ends of an interval.
  struct Wetness {
    double begin_frac = 0.0;
    double end_frac = 0.0;
  };
  /// Advances the ground of a slot that gets `rain_mm`, and notes frost.
  [[nodiscard]] Wetness carry_water(std::size_t slot, const IntervalForcing& interval,
                                    std::int64_t begin_ns, double rain_mm, WaterGround& now,
                                    HeatLimitTimes& limits) const noexcept;
  /// Notes that moist ground is frozen, or that snow is not.
  void note_temperature(const Ground& ground, const physics::FosterState<double>& modes_k, bool wet,
                        std::int64_t at_ns, HeatLimitTimes& limits) const noexcept;

  std::vector<Ground> water_;    ///< by slot
  std::vector<Ground> watched_;  ///< GroundState::watched
  // Materials for which no place was left: the air's temperature counts for theirs.
  bool more_moist_ = false;
  bool more_snow_ = false;
  bool moist_ = false;   ///< some material is moist without rain
  bool always_ = false;  ///< there is snow, or soil that starts wet
  double reference_k_ = 0.0;
  double tolerance_k_ = 0.0;
};

}  // namespace emit::renderer
