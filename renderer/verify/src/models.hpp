// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/csv.hpp"
#include "emit/physics/planck.hpp"
#include "emit/verify/evaluate.hpp"

/// Functions of the models, one each. A function reads its columns from `table` and returns the
/// result as CSV text. Errors are those of evaluate().
namespace emit::verify {

inline constexpr std::string_view kEquilibriumInputs = "lambda,d,eps,Ta,Tc,hc,Tair";
inline constexpr std::string_view kEquilibriumOutputs = "Ts";
inline constexpr std::string_view kBandRadianceInputs = "T_K";
inline constexpr std::string_view kBandRadianceOutputs = "L_3_5,L_3.4_4.1,L_8_12,L_7.7_9.3";
inline constexpr std::string_view kBalanceInputs =
    "S_d,S_i,R_e,R_LW,alb,alb_reading,beta,f_d,f_i,eps,lambda,d,Tc,hc,Tair";
inline constexpr std::string_view kBalanceOutputs = "E_abs,Ta,Ts,Ts_conv";
inline constexpr std::string_view kRelaxationInputs = "case,t_s";
inline constexpr std::string_view kRelaxationOutputs = "T_K";
inline constexpr std::string_view kSunPositionInputs = "year,month,day,hours_ut,lat,lon,height,dT";
inline constexpr std::string_view kSunPositionOutputs = "azimuth,elevation";

inline constexpr std::string_view kAirPathInputs =
    "model,vis_km,band,source,h_sensor_m,h_target_m,range_m[,sun_elevation_deg,sun_azimuth_deg]";
inline constexpr std::string_view kAirPathOutputs = "tau_band,path_radiance_w_m2_sr";
inline constexpr std::string_view kFogPathInputs =
    "kind,visibility_m,top_m,band,h_sensor_m,h_target_m,range_m";
inline constexpr std::string_view kFogPathOutputs =
    "extinction_per_km,albedo_frac,asymmetry,begin_m,length_m,tau_fog";
inline constexpr std::string_view kAirSkyInputs =
    "model,vis_km,band,h_sensor_m,elevation_deg[,sun_elevation_deg,sun_azimuth_deg]";
inline constexpr std::string_view kAirSkyOutputs = "tau_flat,tau_sun,sky_radiance_w_m2_sr";
inline constexpr std::string_view kAirSunInputs = "model,vis_km,band,sun_elevation_deg";
inline constexpr std::string_view kAirSunOutputs = "e_ground_w_m2";

inline constexpr std::string_view kSunDiscInputs = "delta_deg";
inline constexpr std::string_view kSunDiscOutputs = "f";
inline constexpr std::string_view kWallShadowInputs = "H,e_deg,x";
inline constexpr std::string_view kWallShadowOutputs = "f";
inline constexpr std::string_view kSkyViewInputs = "kind,p1,p2,p3,p4,p5,p6,p7";
inline constexpr std::string_view kSkyViewOutputs = "svf,f_uni";
inline constexpr std::string_view kConductionSlabInputs = "kind,k,rc,d,q,h,Tinf,Td,Ti,x,t";
inline constexpr std::string_view kConductionSemiInfiniteInputs =
    "kind,k,rc,q_or_amp,h,Tinf_or_Ts,Ti,period_s,x,t";
inline constexpr std::string_view kConductionOutputs = "T";
inline constexpr std::string_view kConductionLayeredInputs =
    "n,base,d1,k1,rc1,d2,k2,rc2,d3,k3,rc3,period_s";
inline constexpr std::string_view kConductionLayeredOutputs = "absZ,argZ";
inline constexpr std::string_view kConductionLateralInputs = "kind,k,rc,q,lx,ly,v,x,y,z,t";
inline constexpr std::string_view kConductionLateralOutputs = "dT";
inline constexpr std::string_view kSurfaceHistoryInputs = "t_s,Tair,E0,E1,E2,E3";
inline constexpr std::string_view kSurfaceHistoryOutputs = "Ts0,Ts1,Ts2,Ts3";

/// Returns the flat band of a name, by its limits in um: "3-5". Errors: parse.
[[nodiscard]] physics::Result<physics::Band> flat_band(std::string_view band);

[[nodiscard]] physics::Result<std::string> run_fog_path(const EvaluateRequest& request,
                                                        const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_equilibrium(const EvaluateRequest& request,
                                                           const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_band_radiance(const EvaluateRequest& request,
                                                             const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_balance(const EvaluateRequest& request,
                                                       const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_relaxation(const EvaluateRequest& request,
                                                          const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_sun_position(const EvaluateRequest& request,
                                                            const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_air_path(const EvaluateRequest& request,
                                                        const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_air_sky(const EvaluateRequest& request,
                                                       const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_air_sun(const EvaluateRequest& request,
                                                       const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_sun_disc(const EvaluateRequest& request,
                                                        const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_wall_shadow(const EvaluateRequest& request,
                                                           const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_sky_view(const EvaluateRequest& request,
                                                        const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_conduction_slab(const EvaluateRequest& request,
                                                               const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_conduction_semi_infinite(
    const EvaluateRequest& request, const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_conduction_layered(const EvaluateRequest& request,
                                                                  const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_conduction_lateral(const EvaluateRequest& request,
                                                                  const physics::CsvTable& table);
[[nodiscard]] physics::Result<std::string> run_surface_history(const EvaluateRequest& request,
                                                               const physics::CsvTable& table);

/// Values of several columns, each as long as the table.
template <std::size_t N>
[[nodiscard]] physics::Result<std::array<std::vector<double>, N>> read_columns(
    const physics::CsvTable& table, const std::array<std::string_view, N>& names) {
  std::array<std::vector<double>, N> columns;
  for (std::size_t i = 0; i < N; ++i) {
    auto column = table.numbers(names[i]);
    if (!column) return tl::unexpected(std::move(column.error()));
    columns[i] = std::move(*column);
  }
  return columns;
}

/// Returns true when a conductivity `lambda` (not negative) and a thickness `d` (positive) describe
/// a body.
[[nodiscard]] inline bool is_body(double conductivity, double thickness) {
  return conductivity >= 0.0 && thickness > 0.0;
}

/// Value of a result that is not defined.
template <class Real>
inline constexpr Real kUndefined = std::numeric_limits<Real>::quiet_NaN();

}  // namespace emit::verify
