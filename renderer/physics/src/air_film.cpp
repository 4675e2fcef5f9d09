// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/air_film.hpp"

#include "emit/physics/check.hpp"

namespace emit::physics {
namespace {

constexpr double kGasJKgK = 287.05;  // of dry air
constexpr double kHeatJKgK = 1005.0;
constexpr double kGravityMS2 = 9.80665;
/// Density at which the wind's coefficients were measured, kg m-3.
constexpr double kMeasuredDensityKgM3 = 1.2;
/// Range of Mach numbers over which the film passes from that of the wind to that of a plate.
constexpr double kPlateFromMach = 0.25;
constexpr double kPlateMach = 0.35;
constexpr double kTransitionReynolds = 5e5;
/// Length of a leaf along the flow by its width, and what the turbulence of the open adds to the
/// laminar film (Campbell and Norman, An Introduction to Environmental Biophysics, 2nd ed., section
/// 7.7).
constexpr double kLeafLength = 0.7;
constexpr double kOutdoors = 1.4;
/// Wind among the leaves by that beside the crown: exp(-2.5 (1 - z/h)) of Cionco (1972) at z/h =
/// 0.85, the mean height of the leaves that one sees from above.
constexpr double kLeafWind = 0.7;

/// Returns the forced film of the plate or the cylinder at a speed.
double shaped_film_w_m2_k(const AirFlow& flow, double speed_m_s, AirFilmShape shape,
                          double length_m) noexcept {
  // Take the properties at the reference temperature of Eckert (1955) of an insulated wall.
  const double reference_k =
      flow.air_k + 0.72 * (recovery_k(flow.air_k, speed_m_s / sound_m_s(flow.air_k)) - flow.air_k);
  const AirProperties air = air_properties(reference_k, flow.pressure_pa);
  const double reynolds = air.density_kg_m3 * speed_m_s * length_m / air.viscosity_pa_s;
  const double nusselt = shape == AirFilmShape::cylinder ? cylinder_nusselt(reynolds, air.prandtl)
                                                         : plate_nusselt(reynolds, air.prandtl);
  return nusselt * air.conductivity_w_m_k / length_m;
}

}  // namespace

AirProperties air_properties(double air_k, double pressure_pa) noexcept {
  EMIT_DCHECK(air_k > 0.0);
  const double ratio = air_k / 273.15;
  const double power = ratio * std::sqrt(ratio);
  AirProperties out;
  out.density_kg_m3 = pressure_pa / (kGasJKgK * air_k);
  out.viscosity_pa_s = 1.716e-5 * power * (273.15 + 110.4) / (air_k + 110.4);
  out.conductivity_w_m_k = 0.0241 * power * (273.15 + 194.0) / (air_k + 194.0);
  out.prandtl = out.viscosity_pa_s * kHeatJKgK / out.conductivity_w_m_k;
  return out;
}

double standard_pressure_pa(double height_m) noexcept {
  constexpr double kTropopauseM = 11'000.0;
  constexpr double kScaleHeightM = 6341.6;  // of the isothermal layer above it
  const double height = std::clamp(height_m, -500.0, 20'000.0);
  const double below = 101'325.0 * pressure_ratio(Metres(std::min(height, kTropopauseM)));
  return height > kTropopauseM ? below * std::exp((kTropopauseM - height) / kScaleHeightM) : below;
}

double plate_nusselt(double reynolds, double prandtl) noexcept {
  const auto laminar = [](double re) { return 0.664 * std::sqrt(re); };
  const auto turbulent = [](double re) { return 0.228 * re * std::pow(std::log10(re), -2.584); };
  const double cube_root = std::cbrt(prandtl);
  if (reynolds <= kTransitionReynolds) return laminar(reynolds) * cube_root;
  // Take away what a turbulent layer would have over the laminar start.
  return (turbulent(reynolds) - turbulent(kTransitionReynolds) + laminar(kTransitionReynolds)) *
         cube_root;
}

double cylinder_nusselt(double reynolds, double prandtl) noexcept {
  const double prandtl_part = std::pow(1.0 + std::pow(0.4 / prandtl, 2.0 / 3.0), 0.25);
  return 0.3 + 0.62 * std::sqrt(reynolds) * std::cbrt(prandtl) / prandtl_part *
                   std::pow(1.0 + std::pow(reynolds / 282'000.0, 0.625), 0.8);
}

double sound_m_s(double air_k) noexcept {
  return std::sqrt(1.4 * kGasJKgK * air_k);
}

double recovery_k(double air_k, double mach) noexcept {
  return air_k * (1.0 + 0.178 * mach * mach);
}

AirFilm between_films(const AirFilm& a, const AirFilm& b, double f) noexcept {
  AirFilm out;
  out.upwind = a.upwind + f * (b.upwind - a.upwind);
  for (double AirFilm::*value :
       {&AirFilm::directed_frac, &AirFilm::windward_w_m2_k, &AirFilm::leeward_w_m2_k,
        &AirFilm::vertical_root, &AirFilm::vertical_rise, &AirFilm::unstable_quarter,
        &AirFilm::unstable_third, &AirFilm::stable_quarter, &AirFilm::leaf_forced,
        &AirFilm::leaf_quarter, &AirFilm::rough_frac, &AirFilm::stated_w_m2_k,
        &AirFilm::model_frac}) {
    out.*value = a.*value + f * (b.*value - a.*value);
  }
  return out;
}

FilmSkin leaf_skin(double width_m, double area_index) noexcept {
  EMIT_DCHECK(width_m > 0.0 && area_index > 0.0);
  const double root = std::sqrt(kLeafLength * width_m);
  FilmSkin skin;
  skin.leaf_forced = 2.0 * area_index / root;
  skin.leaf_natural = 2.0 * area_index / std::sqrt(root);
  return skin;
}

AirFlow air_flow(const Forcing& weather) noexcept {
  AirFlow flow;
  flow.air_k = weather.air_k;
  flow.pressure_pa = standard_pressure_pa(weather.height_m);
  // A wind that turns between two rows keeps its speed; what its mean direction lacks is
  // undirected.
  const double known = std::min(std::hypot(weather.wind_to_east, weather.wind_to_north), 1.0);
  flow.flow_m_s = weather.wind_m_s * glm::dvec3(weather.wind_to_east, weather.wind_to_north, 0.0);
  flow.undirected_m_s =
      std::hypot(weather.wind_m_s * std::sqrt(1.0 - known * known), weather.gust_m_s);
  flow.stated_w_m2_k = weather.stated_film_w_m2_k;
  flow.stated_frac = weather.stated_film_frac;
  flow.film_factor = weather.film_factor;
  return flow;
}

AirFlow between_flows(const AirFlow& a, const AirFlow& b, double f) noexcept {
  const auto mix = [f](double x, double y) { return x + f * (y - x); };
  return {mix(a.air_k, b.air_k),
          mix(a.pressure_pa, b.pressure_pa),
          a.flow_m_s + f * (b.flow_m_s - a.flow_m_s),
          mix(a.undirected_m_s, b.undirected_m_s),
          mix(a.stated_w_m2_k, b.stated_w_m2_k),
          mix(a.stated_frac, b.stated_frac),
          mix(a.film_factor, b.film_factor)};
}

AirFlow raised_flow(const AirFlow& flow, double up_m) noexcept {
  constexpr double kLapseKM = 0.0065;
  constexpr double kTropopauseM = 11'000.0;
  AirFlow out = flow;
  const double lapse_m = std::clamp(up_m, -500.0, kTropopauseM);
  out.air_k = flow.air_k - kLapseKM * lapse_m;
  out.pressure_pa *= std::pow(out.air_k / flow.air_k, kGravityMS2 / (kGasJKgK * kLapseKM));
  if (up_m > kTropopauseM) {
    out.pressure_pa *= std::exp(kGravityMS2 * (kTropopauseM - up_m) / (kGasJKgK * out.air_k));
  }
  return out;
}

double felt_air_k(const AirFlow& flow) noexcept {
  const double square_m2_s2 =
      glm::dot(flow.flow_m_s, flow.flow_m_s) + flow.undirected_m_s * flow.undirected_m_s;
  return recovery_k(flow.air_k, std::sqrt(square_m2_s2) / sound_m_s(flow.air_k));
}

AirFilm air_film(const AirFlow& flow, const AirFilmBody& body) noexcept {
  EMIT_DCHECK(body.length_m > 0.0);
  AirFilm film;
  film.stated_w_m2_k = flow.film_factor * flow.stated_w_m2_k;
  film.model_frac = flow.film_factor * (1.0 - flow.stated_frac);
  if (!(film.model_frac > 0.0) || !(flow.air_k > 0.0)) return film;
  // Set the direction of the flow.
  const double directed_m2_s2 = glm::dot(flow.flow_m_s, flow.flow_m_s);
  const double speed_m_s = std::sqrt(directed_m2_s2 + flow.undirected_m_s * flow.undirected_m_s);
  if (directed_m2_s2 > 0.0) {
    film.upwind = flow.flow_m_s / -std::sqrt(directed_m2_s2);
    film.directed_frac = directed_m2_s2 / (speed_m_s * speed_m_s);
  }
  // Set the natural parts, physics.md eq. 31 and 32.
  const AirProperties air = air_properties(flow.air_k, flow.pressure_pa);
  const double k = air.conductivity_w_m_k;
  const double kinematic_m2_s = air.viscosity_pa_s / air.density_kg_m3;
  // `buoyancy` is the Rayleigh number of 1 m and 1 K.
  const double buoyancy =
      kGravityMS2 * air.prandtl / (flow.air_k * kinematic_m2_s * kinematic_m2_s);
  const double prandtl_part = std::pow(1.0 + std::pow(0.492 / air.prandtl, 9.0 / 16.0), 8.0 / 27.0);
  const double level_m = 0.25 * body.length_m;  // area over perimeter of a square
  const double quarter = k * std::pow(buoyancy / level_m, 0.25);
  film.vertical_root = 0.825 * std::sqrt(k / body.length_m);
  film.vertical_rise = 0.387 * std::sqrt(k) * std::pow(buoyancy, 1.0 / 6.0) / prandtl_part;
  film.unstable_quarter = 0.54 * quarter;
  film.unstable_third = 0.14 * k * std::cbrt(buoyancy);
  film.stable_quarter = 0.27 * quarter;
  // Set those of leaves, physics.md eq. 97: one side has the unstable film, the other the stable
  // one.
  film.leaf_quarter = 0.5 * (0.54 + 0.27) * k * std::pow(buoyancy, 0.25);
  film.leaf_forced = kOutdoors * 0.664 * k * std::sqrt(kLeafWind * speed_m_s / kinematic_m2_s) *
                     std::cbrt(air.prandtl);
  // Set the forced part, physics.md eq. 33 and 35.
  const double mach = speed_m_s / sound_m_s(flow.air_k);
  const bool in_wind = body.shape == AirFilmShape::surface;
  const double plate_frac =
      in_wind ? std::clamp((mach - kPlateFromMach) / (kPlateMach - kPlateFromMach), 0.0, 1.0) : 1.0;
  if (plate_frac < 1.0) {
    const double wind_m_s = speed_m_s * air.density_kg_m3 / kMeasuredDensityKgM3;
    film.windward_w_m2_k = (1.0 - plate_frac) * 3.26 * std::pow(wind_m_s, 0.89);
    film.leeward_w_m2_k = (1.0 - plate_frac) * 3.55 * std::pow(wind_m_s, 0.617);
  }
  if (plate_frac > 0.0 && speed_m_s > 0.0) {
    const double shaped_w_m2_k =
        plate_frac * shaped_film_w_m2_k(flow, speed_m_s, body.shape, body.length_m);
    film.windward_w_m2_k += shaped_w_m2_k;
    film.leeward_w_m2_k += shaped_w_m2_k;
  }
  film.rough_frac = 1.0 - plate_frac;
  return film;
}

double typical_film_w_m2_k(const Forcing& weather) noexcept {
  constexpr double kMediumRough = 1.52;
  constexpr double kExcessK = 10.0;
  return film_w_m2_k(air_film(air_flow(weather)), glm::dvec3(0.0, 0.0, 1.0), kMediumRough,
                     kExcessK);
}

}  // namespace emit::physics
