// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>

#include "emit/physics/weather.hpp"

/// Exchange of heat between surfaces and the air (physics.md section 8, eq. 31 to 36 and 97). Raw
/// SI numbers. Any thread. RT-safe. shaders/lib/air_film.glsl is the float32 twin of film_w_m2_k().
namespace emit::physics {

/// Properties of dry air.
struct AirProperties {
  double density_kg_m3 = 0.0;
  double viscosity_pa_s = 0.0;  ///< dynamic
  double conductivity_w_m_k = 0.0;
  double prandtl = 0.0;
};
/// Returns the properties of air by Sutherland's law and the ideal gas (White, Viscous Fluid Flow,
/// 3rd ed., tables 1-2 and 1-3). Valid for 170 to 1900 K, within 4 %.
[[nodiscard]] AirProperties air_properties(double air_k, double pressure_pa) noexcept;
/// Returns the pressure of the standard atmosphere, Pa, for -500 to 20,000 m; heights outside are
/// clamped.
[[nodiscard]] double standard_pressure_pa(double height_m) noexcept;

/// Returns the mean Nusselt number of a plate along the flow by its length: laminar 0.664 Re^1/2
/// Pr^1/3 below Re = 5e5, and above it a turbulent layer after that start, by the skin friction of
/// Schlichting (Incropera et al., Fundamentals of Heat and Mass Transfer, 7th ed., section 7.2).
/// Valid up to Re = 1e9.
[[nodiscard]] double plate_nusselt(double reynolds, double prandtl) noexcept;
/// Returns the mean Nusselt number of a cylinder across the flow by its diameter (Churchill and
/// Bernstein 1977). Valid for Re Pr above 0.2 and Re up to 1e7.
[[nodiscard]] double cylinder_nusselt(double reynolds, double prandtl) noexcept;

/// Returns the temperature that an insulated skin takes in a turbulent flow: air_k (1 + 0.178 M^2),
/// with the recovery factor Pr^1/3 = 0.89 (physics.md eq. 36).
[[nodiscard]] double recovery_k(double air_k, double mach) noexcept;
/// Returns the speed of sound in air, m/s.
[[nodiscard]] double sound_m_s(double air_k) noexcept;

/// Flow around a body.
enum class AirFilmShape : std::uint8_t {
  surface,   ///< outdoor surface in the wind, windward or leeward; a plate above Mach 0.3
  plate,     ///< thin panel along the flow
  cylinder,  ///< pipe or mast across the flow; its length is the diameter
};
/// Shape and size that set the film of a body.
struct AirFilmBody {
  AirFilmShape shape = AirFilmShape::surface;
  double length_m = 10.0;  ///< along the flow and upwards, > 0
  bool operator==(const AirFilmBody&) const = default;
};

/// Air around a body at an instant: what all of its faces share.
struct AirFilm {
  /// Unit vector to where the flow comes from. Zero if `directed_frac` is 0.
  glm::dvec3 upwind{0.0};
  /// Share of the flow whose direction is known, 0..1.
  double directed_frac = 0.0;
  double windward_w_m2_k = 0.0;  ///< forced part on a smooth windward face
  double leeward_w_m2_k = 0.0;   ///< forced part on a smooth leeward face
  /// Natural part of a vertical face: (root + rise |dT|^1/6)^2.
  double vertical_root = 0.0;
  double vertical_rise = 0.0;
  /// Natural part of a level face: the greater of a |dT|^1/4 and b |dT|^1/3 where the air beside it
  /// is unstable, and c |dT|^1/4 where it is stable.
  double unstable_quarter = 0.0;
  double unstable_third = 0.0;
  double stable_quarter = 0.0;
  double leaf_forced = 0.0;   ///< forced part on one side of a leaf of 1 m; times length^-1/2
  double leaf_quarter = 0.0;  ///< its natural part at 1 K; times (|dT|/length)^1/4
  double rough_frac = 0.0;    ///< share of the roughness of a material that counts, 0..1
  /// Film that the user gave, multiplied by its share, and share of the model in the rest.
  double stated_w_m2_k = 0.0;
  double model_frac = 1.0;
};
/// Returns a film that does not depend on the face.
[[nodiscard]] inline AirFilm stated_film(double film_w_m2_k) noexcept {
  AirFilm film;
  film.stated_w_m2_k = film_w_m2_k;
  film.model_frac = 0.0;
  return film;
}
/// Returns the film between `a` (f = 0) and `b` (f = 1), linear in every coefficient.
[[nodiscard]] AirFilm between_films(const AirFilm& a, const AirFilm& b, double f) noexcept;

/// The film of a face takes these numbers from its material.
struct FilmSkin {
  /// A number is the factor R of physics.md eq. 34: 1 for a smooth face.
  constexpr FilmSkin(double roughness_factor = 1.0) noexcept : roughness(roughness_factor) {}

  double roughness = 1.0;
  /// Leaves (physics.md eq. 97): area of their sides by that of the face, by length^-1/2 and
  /// length^-1/4. Zero for a face without leaves.
  double leaf_forced = 0.0;
  double leaf_natural = 0.0;

  [[nodiscard]] constexpr bool leafy() const noexcept { return leaf_forced > 0.0; }
  bool operator==(const FilmSkin&) const = default;
};
/// Returns the skin of leaves, needles or strips of a width in metres, of which a square metre of
/// face has an area `area_index` (one side). @pre both > 0
[[nodiscard]] FilmSkin leaf_skin(double width_m, double area_index) noexcept;

/// Air and flow relative to a body, from which its film follows.
struct AirFlow {
  double air_k = 0.0;
  double pressure_pa = 101'325.0;
  glm::dvec3 flow_m_s{0.0};   ///< of the air past the body, as far as its direction is known
  double undirected_m_s = 0;  ///< speed whose direction is not known; adds in squares
  double stated_w_m2_k = 0.0;
  double stated_frac = 0.0;  ///< 0..1
  double film_factor = 1.0;  ///< multiplies the film, > 0
};
/// Returns the flow past a body at rest.
[[nodiscard]] AirFlow air_flow(const Forcing& weather) noexcept;
/// Returns the flow between `a` (f = 0) and `b` (f = 1), linear in f.
[[nodiscard]] AirFlow between_flows(const AirFlow& a, const AirFlow& b, double f) noexcept;
/// Returns the flow of the same wind higher up: the air cools by 6.5 K per km and thins out with
/// it, and keeps its temperature from 11 km above the place on. `up_m` below -500 m counts as
/// -500 m.
[[nodiscard]] AirFlow raised_flow(const AirFlow& flow, double up_m) noexcept;
/// Returns the temperature of the air as the faces of a body feel it, K (physics.md eq. 36).
[[nodiscard]] double felt_air_k(const AirFlow& flow) noexcept;
/// Returns the film of a body (physics.md eq. 31 to 35). @pre body.length_m > 0
[[nodiscard]] AirFilm air_film(const AirFlow& flow, const AirFilmBody& body = {}) noexcept;

/// Returns the film coefficient of a level, medium rough face 10 K above the air, for estimates.
[[nodiscard]] double typical_film_w_m2_k(const Forcing& weather) noexcept;

/// Returns the natural part of the film of a face, W m-2 K-1 (physics.md eq. 31, 32 and 97).
/// `normal_up` is the vertical component of the unit normal, `excess_k` the temperature of the face
/// above the air.
[[nodiscard]] inline double natural_film_w_m2_k(const AirFilm& film, const FilmSkin& skin,
                                                double normal_up, double excess_k) noexcept {
  const double size_k = std::abs(excess_k);
  const double quarter = std::sqrt(std::sqrt(size_k));
  if (skin.leafy()) return skin.leaf_natural * film.leaf_quarter * quarter;
  const double third = std::cbrt(size_k);
  const double root = film.vertical_root + film.vertical_rise * std::sqrt(third);
  const double vertical = root * root;
  const double level_frac = std::min(std::abs(normal_up), 1.0);
  // A warm face that looks up, or a cold one that looks down, stirs the air.
  if (normal_up * excess_k > 0.0) {
    const double level = std::max(film.unstable_quarter * quarter, film.unstable_third * third);
    return vertical + (level - vertical) * 6.283 * level_frac / (7.283 - level_frac);
  }
  const double level = film.stable_quarter * quarter;
  return vertical + (level - vertical) * 2.382 * level_frac / (1.382 + level_frac);
}

/// Returns the forced part on a smooth face of that unit normal, or on its leaves, W m-2 K-1
/// (physics.md eq. 33 and 97).
[[nodiscard]] inline double forced_film_w_m2_k(const AirFilm& film, const FilmSkin& skin,
                                               const glm::dvec3& normal) noexcept {
  if (skin.leafy()) return skin.leaf_forced * film.leaf_forced;
  // Take the share of the windward side: with the direction of the flow, and as its mean over all
  // directions around the vertical.
  const double facing_frac = std::clamp(1.0 + 5.0 * glm::dot(normal, film.upwind), 0.0, 1.0);
  const double steep_frac = std::sqrt(std::max(0.0, 1.0 - normal.z * normal.z));
  const double any_frac = 0.5 + 0.5 / (1.0 + 10.0 * steep_frac);
  const double windward_frac = any_frac + film.directed_frac * (facing_frac - any_frac);
  return film.leeward_w_m2_k + windward_frac * (film.windward_w_m2_k - film.leeward_w_m2_k);
}

/// Joins both parts (physics.md eq. 34) with what the user gave.
[[nodiscard]] inline double joined_film_w_m2_k(const AirFilm& film, const FilmSkin& skin,
                                               double natural_w_m2_k,
                                               double forced_w_m2_k) noexcept {
  const double rough = 1.0 + film.rough_frac * (skin.roughness - 1.0);
  const double model_w_m2_k =
      natural_w_m2_k +
      rough * (std::sqrt(natural_w_m2_k * natural_w_m2_k + forced_w_m2_k * forced_w_m2_k) -
               natural_w_m2_k);
  return film.stated_w_m2_k + film.model_frac * model_w_m2_k;
}

/// Returns the film coefficient of a face, W m-2 K-1. `normal` is its unit normal in world axes (z
/// up), `skin` what its material gives, `excess_k` its temperature above the air.
[[nodiscard]] inline double film_w_m2_k(const AirFilm& film, const glm::dvec3& normal,
                                        const FilmSkin& skin, double excess_k) noexcept {
  return joined_film_w_m2_k(film, skin, natural_film_w_m2_k(film, skin, normal.z, excess_k),
                            forced_film_w_m2_k(film, skin, normal));
}

}  // namespace emit::physics
