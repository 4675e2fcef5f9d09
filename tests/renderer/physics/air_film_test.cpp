// SPDX-License-Identifier: Apache-2.0
// Judges the air film against correlations, tables and exact solutions that others published.
#include "emit/physics/air_film.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace {

using namespace emit::physics;

constexpr double kPrandtl = 0.71;
const glm::dvec3 kUp(0.0, 0.0, 1.0);
const glm::dvec3 kNorth(0.0, 1.0, 0.0);

/// Returns the relative distance of a value to the nearest of others.
double off_frac(double value, std::initializer_list<double> published) {
  double least = 1e9;
  for (const double other : published) least = std::min(least, std::abs(value / other - 1.0));
  return least;
}

/// Returns Nu / Re^1/2 of the mean over a laminar plate: Blasius' flow and Pohlhausen's energy
/// equation, integrated by Runge and Kutta.
double laminar_plate(double prandtl) {
  struct State {
    double f = 0.0;
    double slope = 0.0;
    double shear = 0.332057336;  // Blasius
    double decay = 0.0;          // integral of Pr f / 2
    double integral = 0.0;       // of exp(-decay)
  };
  const auto rate = [prandtl](const State& s) {
    return State{s.slope, s.shear, -0.5 * s.f * s.shear, 0.5 * prandtl * s.f, std::exp(-s.decay)};
  };
  const auto add = [](const State& s, const State& d, double h) {
    return State{s.f + h * d.f, s.slope + h * d.slope, s.shear + h * d.shear, s.decay + h * d.decay,
                 s.integral + h * d.integral};
  };
  State s;
  constexpr double kStep = 0.005;
  for (int i = 0; i < 2400; ++i) {
    const State a = rate(s);
    const State b = rate(add(s, a, kStep / 2));
    const State c = rate(add(s, b, kStep / 2));
    const State d = rate(add(s, c, kStep));
    s = add(add(add(add(s, a, kStep / 6), b, kStep / 3), c, kStep / 3), d, kStep / 6);
  }
  return 2.0 / s.integral;
}

/// Returns the Rayleigh number of 1 m and 1 K.
double buoyancy(double air_k) {
  const AirProperties air = air_properties(air_k, 101'325.0);
  const double kinematic = air.viscosity_pa_s / air.density_kg_m3;
  const double diffusivity = air.conductivity_w_m_k / (air.density_kg_m3 * 1005.0);
  return 9.80665 / air_k / (kinematic * diffusivity);
}

/// Returns the Nusselt number of natural convection from a face by a length of it.
double natural_nusselt(double rayleigh, double normal_up, double length_m, double by_m) {
  AirFlow still;
  still.air_k = 300.0;
  const AirFilm film = air_film(still, {.length_m = length_m});
  const double excess_k = rayleigh / (buoyancy(300.0) * by_m * by_m * by_m);
  const double conductivity = air_properties(300.0, 101'325.0).conductivity_w_m_k;
  return natural_film_w_m2_k(film, {}, normal_up, excess_k) * by_m / conductivity;
}

Forcing wind(double speed_m_s) {
  Forcing weather;
  weather.air_k = 293.0;
  weather.wind_m_s = speed_m_s;
  return weather;
}

TEST(AirFilm, PropertiesAreThoseOfTheTables) {
  // Incropera et al., Fundamentals of Heat and Mass Transfer, 7th ed., table A.4, at 1 bar.
  const struct {
    double air_k, density, viscosity, conductivity, prandtl;
  } table[] = {{200, 1.7458, 132.5e-7, 18.1e-3, 0.737},
               {250, 1.3947, 159.6e-7, 22.3e-3, 0.720},
               {300, 1.1614, 184.6e-7, 26.3e-3, 0.707},
               {400, 0.8711, 230.1e-7, 33.8e-3, 0.690},
               {600, 0.5804, 305.8e-7, 46.9e-3, 0.685}};
  for (const auto& row : table) {
    const AirProperties air = air_properties(row.air_k, 1e5);
    EXPECT_NEAR(air.density_kg_m3 / row.density, 1.0, 0.005) << row.air_k;
    EXPECT_NEAR(air.viscosity_pa_s / row.viscosity, 1.0, 0.02) << row.air_k;
    EXPECT_NEAR(air.conductivity_w_m_k / row.conductivity, 1.0, 0.03) << row.air_k;
    EXPECT_NEAR(air.prandtl / row.prandtl, 1.0, 0.05) << row.air_k;
  }
  // Pressures of the 1976 standard atmosphere.
  EXPECT_NEAR(standard_pressure_pa(0.0), 101'325.0, 1.0);
  EXPECT_NEAR(standard_pressure_pa(5000.0), 54'020.0, 100.0);
  EXPECT_NEAR(standard_pressure_pa(11'000.0), 22'632.0, 50.0);
  EXPECT_NEAR(standard_pressure_pa(15'000.0), 12'045.0, 50.0);
}

TEST(AirFilm, PlateIsWithinTenPercentOfThePublishedOnes) {
  const double cube_root = std::cbrt(kPrandtl);
  for (const double re : {1e3, 1e4, 1e5, 4e5}) {
    EXPECT_NEAR(plate_nusselt(re, kPrandtl) / (laminar_plate(kPrandtl) * std::sqrt(re)), 1.0, 0.01)
        << re;
  }
  // Incropera et al., eq. 7.38, with the transition at 5e5.
  for (const double re : {1e6, 3e6, 1e7}) {
    const double mixed = (0.037 * std::pow(re, 0.8) - 871.0) * cube_root;
    EXPECT_NEAR(plate_nusselt(re, kPrandtl) / mixed, 1.0, 0.1) << re;
  }
  // White's skin friction 0.523 / ln^2(0.06 Re) with the analogy of Colburn.
  for (const double re : {1e7, 1e8, 1e9}) {
    const double friction = 0.523 / std::pow(std::log(0.06 * re), 2);
    EXPECT_NEAR(plate_nusselt(re, kPrandtl) / (0.5 * friction * re * cube_root), 1.0, 0.1) << re;
  }
}

TEST(AirFilm, CylinderIsWithinTenPercentOfThePublishedOnes) {
  const struct {
    double reynolds;
    double factor, power;      // Hilpert 1933 and Knudsen and Katz, with Pr^1/3
    double factor_z, power_z;  // Zukauskas 1972, with Pr^0.37
  } rows[] = {{10, 0.911, 0.385, 0.75, 0.4},  {100, 0.683, 0.466, 0.51, 0.5},
              {1e3, 0.683, 0.466, 0.26, 0.6}, {4e3, 0.193, 0.618, 0.26, 0.6},
              {1e4, 0.193, 0.618, 0.26, 0.6}, {4e4, 0.193, 0.618, 0.26, 0.6},
              {1e5, 0.027, 0.805, 0.26, 0.6}, {4e5, 0.027, 0.805, 0.076, 0.7}};
  for (const auto& row : rows) {
    const double hilpert = row.factor * std::pow(row.reynolds, row.power) * std::cbrt(kPrandtl);
    const double zukauskas =
        row.factor_z * std::pow(row.reynolds, row.power_z) * std::pow(kPrandtl, 0.37);
    EXPECT_LT(off_frac(cylinder_nusselt(row.reynolds, kPrandtl), {hilpert, zukauskas}), 0.1)
        << row.reynolds;
  }
}

TEST(AirFilm, NaturalConvectionIsWithinTenPercentOfThePublishedOnes) {
  // Vertical plates: McAdams 1954 (0.59 Ra^1/4 below 1e9, 0.13 Ra^1/3 above), and the laminar form
  // of Churchill and Chu 1975.
  for (const double ra : {1e4, 1e5, 1e6, 1e7, 1e8}) {
    const double mc_adams = 0.59 * std::pow(ra, 0.25);
    const double laminar =
        0.68 + 0.670 * std::pow(ra, 0.25) /
                   std::pow(1.0 + std::pow(0.492 / kPrandtl, 9.0 / 16.0), 4.0 / 9.0);
    EXPECT_LT(off_frac(natural_nusselt(ra, 0.0, 1.0, 1.0), {mc_adams, laminar}), 0.1) << ra;
  }
  for (const double ra : {1e9, 2e9, 5e9, 1e10}) {
    EXPECT_NEAR(natural_nusselt(ra, 0.0, 10.0, 10.0) / (0.13 * std::cbrt(ra)), 1.0, 0.1) << ra;
  }
  // Warm plates that look up, by area over perimeter: Lloyd and Moran 1974.
  for (const double ra : {1e5, 3e5, 1e6, 3e6}) {
    EXPECT_NEAR(natural_nusselt(ra, 1.0, 1.0, 0.25) / (0.54 * std::pow(ra, 0.25)), 1.0, 0.1) << ra;
  }
  for (const double ra : {3e7, 1e8, 1e9, 1e10}) {
    EXPECT_NEAR(natural_nusselt(ra, 1.0, 8.0, 2.0) / (0.15 * std::cbrt(ra)), 1.0, 0.1) << ra;
  }
  // Warm plates that look down: McAdams 1954. Fujii and Imura 1972 agree with it where they meet.
  for (const double ra : {3e5, 1e6, 3e6, 1e7, 3e7, 1e8, 1e9, 1e10}) {
    const double side_m = ra > 1e8 ? 8.0 : 1.0;
    EXPECT_NEAR(natural_nusselt(ra, -1.0, side_m, 0.25 * side_m) / (0.27 * std::pow(ra, 0.25)), 1.0,
                0.1)
        << ra;
  }
  for (const double ra : {1e6, 1e7}) {
    EXPECT_NEAR(natural_nusselt(ra, -1.0, 1.0, 0.25) / (0.58 * std::pow(ra, 0.2)), 1.0, 0.1) << ra;
  }
  // A cold plate that looks down is a warm one that looks up.
  AirFlow still;
  still.air_k = 300.0;
  const AirFilm film = air_film(still);
  EXPECT_DOUBLE_EQ(natural_film_w_m2_k(film, {}, 0.7, 12.0),
                   natural_film_w_m2_k(film, {}, -0.7, -12.0));
  EXPECT_GT(natural_film_w_m2_k(film, {}, 1.0, 12.0),
            2.0 * natural_film_w_m2_k(film, {}, -1.0, 12.0));
}

TEST(AirFilm, SkinHeatsToTheRecoveryTemperature) {
  // The recovery factor of a turbulent layer is Pr^1/3 (measured 0.88 to 0.89).
  for (const double mach : {0.3, 0.5, 0.8, 1.2, 1.6, 2.0, 2.5}) {
    for (const double air_k : {216.65, 288.15}) {
      const double published_k = air_k * (1.0 + std::cbrt(0.71) * 0.2 * mach * mach);
      AirFlow flow;
      flow.air_k = air_k;
      flow.flow_m_s = {-mach * std::sqrt(1.4 * 287.05 * air_k), 0.0, 0.0};
      EXPECT_NEAR(felt_air_k(flow) / published_k, 1.0, 0.01) << mach;
    }
  }
}

TEST(AirFilm, FastBodiesHaveTheFilmOfATurbulentPlate) {
  for (const double mach : {0.4, 0.8, 1.5, 2.5}) {
    AirFlow flow;
    flow.air_k = 250.0;
    flow.pressure_pa = standard_pressure_pa(6000.0);
    const double speed_m_s = mach * sound_m_s(flow.air_k);
    flow.flow_m_s = {speed_m_s, 0.0, 0.0};
    constexpr double kLengthM = 5.0;
    const AirFilm film = air_film(flow, {.length_m = kLengthM});
    // White's skin friction at Eckert's reference temperature of an insulated wall.
    const double reference_k = 250.0 * (1.0 + 0.72 * 0.178 * mach * mach);
    const AirProperties air = air_properties(reference_k, flow.pressure_pa);
    const double re = air.density_kg_m3 * speed_m_s * kLengthM / air.viscosity_pa_s;
    const double stanton =
        0.5 * 0.523 / std::pow(std::log(0.06 * re), 2) * std::pow(air.prandtl, -2.0 / 3.0);
    const double expected = stanton * air.density_kg_m3 * speed_m_s * 1005.0;
    // Roughness does not count, and all faces are alike.
    EXPECT_NEAR(film_w_m2_k(film, kNorth, 2.17, 0.0) / expected, 1.0, 0.1) << mach;
    EXPECT_NEAR(film_w_m2_k(film, kNorth, 2.17, 0.0), film_w_m2_k(film, kUp, 1.0, 0.0), 1e-6);
  }
}

TEST(AirFilm, WindActsByItsSide) {
  Forcing weather = wind(5.0);
  weather.wind_to_north = -1.0;  // from the north
  const AirFilm film = air_film(air_flow(weather));
  // MoWiTT (Yazdanian and Klems 1994): 3.26 V^0.89 and 3.55 V^0.617, in calm natural convection.
  const double density = air_properties(293.0, 101'325.0).density_kg_m3 / 1.2;
  EXPECT_NEAR(film_w_m2_k(film, kNorth, 1.0, 0.0), 3.26 * std::pow(5.0 * density, 0.89), 1e-6);
  EXPECT_NEAR(film_w_m2_k(film, -kNorth, 1.0, 0.0), 3.55 * std::pow(5.0 * density, 0.617), 1e-6);
  EXPECT_NEAR(film_w_m2_k(film, kUp, 1.0, 0.0), film_w_m2_k(film, kNorth, 1.0, 0.0), 1e-6);
  EXPECT_GT(film_w_m2_k(film, kNorth, 2.17, 0.0), 2.0 * film_w_m2_k(film, kNorth, 1.0, 0.0));
  // Thin air exchanges less.
  weather.height_m = 4000.0;
  EXPECT_LT(film_w_m2_k(air_film(air_flow(weather)), kNorth, 1.0, 0.0),
            0.72 * film_w_m2_k(film, kNorth, 1.0, 0.0));
}

TEST(AirFilm, WithoutADirectionItIsTheMeanOverAllOfThem) {
  Forcing weather = wind(4.0);
  const AirFilm unknown = air_film(air_flow(weather));
  for (const double tilt_deg : {0.0, 5.0, 15.0, 45.0, 90.0, 135.0}) {
    const double tilt_rad = tilt_deg * std::numbers::pi / 180.0;
    const glm::dvec3 normal(std::sin(tilt_rad), 0.0, std::cos(tilt_rad));
    double mean = 0.0;
    constexpr int kDirections = 720;
    for (int i = 0; i < kDirections; ++i) {
      const double from_rad = 2.0 * std::numbers::pi * (i + 0.5) / kDirections;
      weather.wind_to_east = std::sin(from_rad);
      weather.wind_to_north = std::cos(from_rad);
      mean += forced_film_w_m2_k(air_film(air_flow(weather)), {}, normal) / kDirections;
    }
    EXPECT_NEAR(forced_film_w_m2_k(unknown, {}, normal) / mean, 1.0, 0.03) << tilt_deg;
  }
}

TEST(AirFilm, TheUsersNumberWins) {
  Forcing weather = wind(9.0);
  weather.stated_film_w_m2_k = 13.3;
  weather.stated_film_frac = 1.0;
  const AirFilm film = air_film(air_flow(weather));
  for (const double excess_k : {-20.0, 0.0, 40.0}) {
    EXPECT_EQ(film_w_m2_k(film, kUp, 2.17, excess_k), 13.3);
    EXPECT_EQ(film_w_m2_k(film, kNorth, 1.0, excess_k), 13.3);
  }
  // Half way to a row without a number, it is half of each.
  weather.stated_film_w_m2_k = 6.65;
  weather.stated_film_frac = 0.5;
  const double model = film_w_m2_k(air_film(air_flow(wind(9.0))), kUp, 1.5, 8.0);
  EXPECT_NEAR(film_w_m2_k(air_film(air_flow(weather)), kUp, 1.5, 8.0), 6.65 + 0.5 * model, 1e-9);
}

TEST(AirFilm, AirThinsAndCoolsWithHeight) {
  AirFlow flow;
  flow.air_k = 288.15;
  for (const double height_m : {1000.0, 8000.0, 15'000.0}) {
    const AirFlow raised = raised_flow(flow, height_m);
    EXPECT_NEAR(raised.pressure_pa / standard_pressure_pa(height_m), 1.0, 0.005) << height_m;
    EXPECT_NEAR(raised.air_k, 288.15 - 0.0065 * std::min(height_m, 11'000.0), 1e-9);
  }
}

}  // namespace
