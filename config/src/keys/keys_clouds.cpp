// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include "emit/physics/constants.hpp"
#include "keys.hpp"

/// Keys of clouds with structure.
namespace emit::config {

CloudsDraft clouds_draft(const physics::Clouds& clouds) {
  return {clouds, clouds.drift_m_s, clouds.drift_from_rad};
}

const KeyTable<CloudsDraft>& clouds_keys() {
  static const KeyTable<CloudsDraft> keys = {
      required(number<CloudsDraft>(
          "cover_frac", "", between(0.02, 0.95), EMIT_FIELD(clouds.cover_frac),
          "Share of the sky overhead that clouds cover, in place of `weather.cloud_frac`.")),
      number<CloudsDraft>("base_m", "m", between(100, 12000), EMIT_FIELD(clouds.base_m),
                          "Height of the clouds above the world's origin, in place of "
                          "`weather.cloud_base_m`."),
      number<CloudsDraft>("transmission_frac", "", between(0, 0.9),
                          EMIT_FIELD(clouds.transmission_frac),
                          "Share of the direct sun that passes a cloud."),
      number<CloudsDraft>("shortest_m", "m", between(20, 2000), EMIT_FIELD(clouds.shortest_m),
                          "Shortest wavelength of the field of clouds. The field repeats after 128 "
                          "of them."),
      number<CloudsDraft>("longest_m", "m", between(40, 64000), EMIT_FIELD(clouds.longest_m),
                          "Longest wavelength: at most 32 times the shortest."),
      number<CloudsDraft>("slope", "", between(0, 6), EMIT_FIELD(clouds.slope),
                          "Power spectral density over the plane goes with k^-slope: larger clouds "
                          "at a steeper slope."),
      integer<CloudsDraft>("seed", "", 0, std::numeric_limits<std::uint32_t>::max(),
                           EMIT_FIELD(clouds.seed), "Another seed gives other clouds."),
      number<CloudsDraft>(
          "drift_m_s", "m s-1", between(0, 100), EMIT_FIELD(drift_m_s),
          "Speed of the clouds. Without it the weather's wind at simulation time 0, "
          "times (base_m / 10 m)^(1/7)."),
      number<CloudsDraft>("drift_from_deg", "deg", between(0, 360), EMIT_FIELD(drift_from_rad),
                          "Direction from which the clouds come, clockwise from north. Without it "
                          "that of the weather's wind at simulation time 0.",
                          physics::kDegree),
  };
  return keys;
}

}  // namespace emit::config
