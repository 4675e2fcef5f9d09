// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>

#include "emit/physics/geodesy.hpp"

namespace emit::v1 {
class Recording;
}

namespace emit::tool {

/// Instant and place of a recorded run, from the scenario that its journal keeps.
struct RecordedPlace {
  /// Instant of simulation time 0, POSIX ns UTC; absent: the journal does not hold it.
  std::optional<std::int64_t> epoch_utc_ns;
  /// Origin of the world frame; absent: the journal does not hold it.
  std::optional<physics::GeoPlace> origin;
};

/// Reads epoch and place from the keys `epoch_utc`, `place.lat_deg`, `place.lon_deg` and
/// `place.height_m`. A missing or unreadable value leaves its member absent.
[[nodiscard]] RecordedPlace recorded_place(const v1::Recording& recording);

}  // namespace emit::tool
