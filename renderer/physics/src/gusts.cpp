// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/climate.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/constants.hpp"

namespace emit::physics {
namespace {

constexpr double kGravityMS2 = 9.80665;
constexpr double kGasJKgK = 287.05;  // of dry air
constexpr double kHeatJKgK = 1005.0;
constexpr double kEvaporationJKg = 2.47e6;
constexpr double kVapourRatio = 0.622;  // molar mass of water to that of air
/// Land of no known kind: its albedo, the share of its soil moisture that counts (0 dry, 1 wet
/// grass), and the share of the net radiation that goes into the ground.
constexpr double kAlbedo = 0.2;
constexpr double kMoistShare = 0.5;
constexpr double kGroundShare = 0.1;
/// Evaporation that does not depend on the net radiation, W/m2, of wet grass.
constexpr double kConstantEvaporationWM2 = 20.0;
constexpr double kMixedM = 1000.0;
constexpr double kGustShare = 1.2;

/// Returns the rise of the saturation vapour pressure with temperature, Pa/K (Magnus' formula with
/// the constants of Alduchov and Eskridge 1996).
double saturation_rise_pa_k(double air_k) noexcept {
  const double air_c = air_k - 273.15;
  const double to_pole_k = air_c + 243.04;
  return 610.94 * std::exp(17.625 * air_c / to_pole_k) * 17.625 * 243.04 / (to_pole_k * to_pole_k);
}

}  // namespace

double land_heat_w_m2(const ConvectionDrive& drive) noexcept {
  const double psychrometric_pa_k =
      kHeatJKgK * drive.pressure_pa / (kVapourRatio * kEvaporationJKg);
  const double rise = saturation_rise_pa_k(drive.air_k) / psychrometric_pa_k;
  // Share of what radiation leaves to the air that warms it: the rest evaporates water.
  const double dry_share = ((1.0 - kMoistShare) * rise + 1.0) / (rise + 1.0);
  // The land is warmer than the air by a share of its net radiation.
  const double warming = 0.38 * dry_share;
  const double square_k2 = drive.air_k * drive.air_k;
  const double net_w_m2 = ((1.0 - kAlbedo) * drive.global_sun_w_m2 + drive.longwave_down_w_m2 -
                           kStefanBoltzmannWPerM2K4 * square_k2 * square_k2) /
                          (1.0 + warming);
  return dry_share * (1.0 - kGroundShare) * net_w_m2 - kMoistShare * kConstantEvaporationWM2;
}

double convective_gust_m_s(const ConvectionDrive& drive) noexcept {
  const double capacity_j_m3_k = kHeatJKgK * drive.pressure_pa / (kGasJKgK * drive.air_k);
  return kGustShare * std::cbrt(kGravityMS2 / drive.air_k * kMixedM *
                                std::max(land_heat_w_m2(drive), 0.0) / capacity_j_m3_k);
}

}  // namespace emit::physics
