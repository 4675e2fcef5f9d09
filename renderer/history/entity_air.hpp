// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/physics/air_film.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "emit/scene/mesh.hpp"
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

/// Returns shape and length of an entity's flow: the user's, or the longest side of the box around
/// its geometry, at least 1 cm. `object` is an index into the scenario's objects. Setup only.
[[nodiscard]] physics::AirFilmBody entity_film_body(const scene::ScenarioDesc& scenario,
                                                    const scene::SceneGeometry& geometry,
                                                    std::size_t object);

/// Returns the air past an entity over an interval of the thermal history: the wind less its own
/// speed, at its height above the place. The relative humidity is that of the ground. RT-safe.
[[nodiscard]] EntityAir entity_air(const PoseHistory& entity, const IntervalForcing& forcing,
                                   std::int64_t begin_ns, std::int64_t end_ns) noexcept;

}  // namespace emit::renderer
