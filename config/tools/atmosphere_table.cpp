// SPDX-License-Identifier: Apache-2.0
// atmosphere_table > config/atmospheres/midlatitude_summer_ground.csv
// A table of air for a sensor near the ground, from the built-in air.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "emit/physics/air_model.hpp"
#include "emit/physics/constants.hpp"

namespace {

using namespace emit;

constexpr double kSensorM = 2.0;
constexpr double kEarthRadiusM = 6371e3;
constexpr double kRangesM[] = {1,    2,   5,     10,  16,   25,   50,   100,  150,
                               200,  300, 500,   700, 1000, 1500, 2000, 3000, 5000,
                               7000, 1e4, 1.5e4, 2e4, 3e4,  5e4,  1e5};
constexpr double kElevationsDeg[] = {-90, 0, 1, 2, 5, 10, 20, 30, 45, 60, 90};

}  // namespace

int main() {
  const auto column =
      physics::AirColumn::build({physics::AirClimate::midlatitude_summer, 23.0, 1.0});
  if (!column) return 1;
  fmt::print(
      "# SPDX-License-Identifier: Apache-2.0\n"
      "# Air of the mid-latitude summer (rural haze, visibility 23 km) for a sensor 2 m above sea\n"
      "# level. Made by atmosphere_table from the built-in air, which is fitted to LOWTRAN7. Below "
      "the\n"
      "# horizon the air is that of a level path. No scattered sunlight.\n"
      "band,range_m,elevation_deg,transmittance_frac,path_radiance_w_m2_sr\n");
  for (const auto& [name, limits] : {std::pair{"3-5", physics::Band{3.0, 5.0, {}}},
                                     std::pair{"8-12", physics::Band{8.0, 12.0, {}}}}) {
    const auto band = physics::BandAir::build(limits);
    if (!band) return 1;
    for (const double elevation_deg : kElevationsDeg) {
      const double elevation_rad = std::max(elevation_deg, 0.0) * physics::kDegree;
      for (const double range_m : kRangesM) {
        // A straight ray climbs by its slope, and because the ground bends away from it.
        const double level_m = range_m * std::cos(elevation_rad);
        const double bend_m = elevation_deg < 0.0 ? 0.0 : level_m * level_m / (2.0 * kEarthRadiusM);
        const auto path = physics::AirPath::between(
            *column, kSensorM, kSensorM + range_m * std::sin(elevation_rad) + bend_m, range_m);
        fmt::print("{},{:g},{:g},{:.6g},{:.6g}\n", name, range_m, elevation_deg,
                   band->transmittance(path, physics::AirSource::black_300k),
                   band->path_radiance_w_m2_sr(path));
      }
    }
  }
}
