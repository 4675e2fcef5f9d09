// SPDX-License-Identifier: Apache-2.0
// atmosphere_table > config/atmospheres/midlatitude_summer_ground.csv
// A table of air for a sensor near the ground, from the horizontal fits of the built-in model.
#include <fmt/format.h>
#include <cmath>
#include <cstdio>

#include "emit/physics/constants.hpp"
#include "emit/physics/planck.hpp"
#include "resolve/resolve.hpp"

namespace {

using namespace emit;

constexpr const char* kModel = "midlatitude_summer";
constexpr double kGroundAirK = 294.2;  // of the model atmosphere
constexpr double kLapseKPerKm = 6.5;
constexpr double kTropopauseK = 215.8;

struct BandColumn {
  const char* name;
  double lo_um;
  double hi_um;
  /// Height over which what absorbs thins out by e, so that LOWTRAN7's transmittances of vertical
  /// paths to 1, 2 and 8 km are met within 0.02 (0.518, 0.438, 0.356 and 0.782, 0.706, 0.642).
  double scale_height_km;
};
constexpr BandColumn kBands[] = {{"3-5", 3.0, 5.0, 2.1}, {"8-12", 8.0, 12.0, 1.55}};
constexpr double kRangesM[] = {25,   50,   100,  150,  200, 300,   500, 700, 1000, 1500,
                               2000, 3000, 5000, 7000, 1e4, 1.5e4, 2e4, 3e4, 5e4,  1e5};
constexpr double kElevationsDeg[] = {-90, 0, 1, 2, 5, 10, 20, 30, 45, 60, 90};

double transmittance(const scene::BandAtmosphere& fit, double sea_level_km) {
  double sum = 0.0;
  for (const scene::AtmosphereTerm& term : fit.terms) {
    sum += term.amplitude_frac * std::exp(-term.extinction_per_km * sea_level_km);
  }
  return sum;
}

/// Length of the sea-level path with the same absorbers. Below the horizon the air is that of the
/// ground.
double sea_level_km(const BandColumn& band, double range_km, double sin_elevation) {
  const double climb = std::max(sin_elevation, 0.0) * range_km / band.scale_height_km;
  return climb < 1e-9 ? range_km : range_km * -std::expm1(-climb) / climb;
}

double air_k(double height_km) {
  return std::max(kTropopauseK, kGroundAirK - kLapseKPerKm * height_km);
}

}  // namespace

int main() {
  fmt::print(
      "# SPDX-License-Identifier: Apache-2.0\n"
      "# Air of the mid-latitude summer (rural haze, visibility 23 km) for a sensor near the "
      "ground.\n"
      "# Made by atmosphere_table: horizontal paths are the three-term fits to LOWTRAN7; upwards "
      "the\n"
      "# absorbers thin out with a scale height that meets its vertical paths within 0.02, and "
      "the\n"
      "# air cools by 6.5 K/km. No scattered sunlight.\n"
      "band,range_m,elevation_deg,transmittance_frac,path_radiance_w_m2_sr\n");
  for (const BandColumn& band : kBands) {
    const auto fit = config::model_atmosphere(kModel, band.name);
    if (!fit) {
      return 1;
    }
    for (const double elevation_deg : kElevationsDeg) {
      const double sine = std::sin(elevation_deg * physics::kDegree);
      double near_km = 0.0;
      double path = 0.0;
      for (const double range_m : kRangesM) {
        // dL = B(T) |d tau|, in steps short against the change of either.
        constexpr int kSteps = 64;
        const double far_km = range_m * 1e-3;
        for (int i = 0; i < kSteps; ++i) {
          const double a_km = near_km + (far_km - near_km) * i / kSteps;
          const double b_km = near_km + (far_km - near_km) * (i + 1) / kSteps;
          const double height_km = 0.5 * (a_km + b_km) * std::max(sine, 0.0);
          path += physics::band_radiance({band.lo_um, band.hi_um, {}},
                                         physics::Kelvin(air_k(height_km)))
                      .radiance_w_m2_sr *
                  (transmittance(*fit, sea_level_km(band, a_km, sine)) -
                   transmittance(*fit, sea_level_km(band, b_km, sine)));
        }
        near_km = far_km;
        fmt::print("{},{:g},{:g},{:.6g},{:.6g}\n", band.name, range_m, elevation_deg,
                   transmittance(*fit, sea_level_km(band, far_km, sine)), path);
      }
    }
  }
}
