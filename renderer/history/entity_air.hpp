// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

#include "emit/physics/air_film.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "history/pose_history.hpp"

namespace emit::renderer {

/// Air past one entity over an interval, linear between its ends.
struct EntityAir {
  physics::AirFilm begin;
  physics::AirFilm end;
  double begin_air_k = 0.0;  ///< felt_air_k()
  double end_air_k = 0.0;
  /// Moisture of the air at the height of the entity.
  physics::MoistAir begin_moist;
  physics::MoistAir end_moist;
};

/// Returns the air past an entity over an interval of the thermal history: the wind less its own
/// speed, at its height above the place. The relative humidity is that of the ground. RT-safe.
[[nodiscard]] EntityAir entity_air(const PoseHistory& entity, const IntervalForcing& forcing,
                                   std::int64_t begin_ns, std::int64_t end_ns) noexcept;

}  // namespace emit::renderer
