// SPDX-License-Identifier: Apache-2.0
#include "surface/run/weather_change.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "emit/physics/surface_balance.hpp"
#include "history/foster_history.hpp"

namespace emit::renderer {
namespace {

/// Flux in W m-2 per kelvin of tolerance below which a change does not matter: however thin a
/// surface is, its own radiation balances as much.
constexpr double kMinChangeWM2K = 5.0;
/// Typical difference in K between sunlit surfaces and the air. It turns a change of the film
/// coefficient into a flux.
constexpr double kFilmK = 20.0;
/// Roughness factor of a typical surface.
constexpr double kRoughness = 1.52;

}  // namespace

bool weather_matters(const SurfaceNode& node, std::int64_t now_ns, const Environment& environment,
                     double tolerance_k) noexcept {
  const physics::SunPosition sun = environment.sun_at(now_ns);
  const physics::Forcing weather = environment.forcing_at(now_ns, sun);
  const SurfaceForcing is = open_forcing(sun, weather);
  const IntervalForcing& taken = node.forcing;
  const double way = std::clamp(
      1.0 - 1e-9 * static_cast<double>(node.at_ns - now_ns) / std::max(taken.dt_s, 1e-9), 0.0, 1.0);
  const auto off = [&](double SurfaceForcing::*value) {
    return std::abs(is.*value - between(taken.begin.*value, taken.end.*value, way));
  };
  // Compare the films of a level face and of walls that much above the air: a wind that turns
  // changes those of walls alone.
  const auto film_of = [](const SurfaceForcing& forcing, const glm::dvec3& normal) {
    return physics::film_w_m2_k(forcing.film, normal, kRoughness, kFilmK);
  };
  const auto film_w_m2_k = [&](const SurfaceForcing& forcing) {
    return film_of(forcing, {0.0, 0.0, 1.0});
  };
  double film_change_w_m2_k = 0.0;
  for (const glm::dvec3& normal :
       {glm::dvec3(0.0, 0.0, 1.0), glm::dvec3(1.0, 0.0, 0.0), glm::dvec3(-1.0, 0.0, 0.0),
        glm::dvec3(0.0, 1.0, 0.0), glm::dvec3(0.0, -1.0, 0.0)}) {
    film_change_w_m2_k =
        std::max(film_change_w_m2_k,
                 std::abs(film_of(is, normal) -
                          between(film_of(taken.begin, normal), film_of(taken.end, normal), way)));
  }
  // Bound the change of the flux into a surface by the sum of the changes of all its parts.
  double change_w_m2 =
      glm::distance(is.sun_w_m2, glm::mix(taken.begin.sun_w_m2, taken.end.sun_w_m2, way)) +
      off(&SurfaceForcing::diffuse_w_m2) + off(&SurfaceForcing::longwave_w_m2) +
      film_w_m2_k(is) * off(&SurfaceForcing::air_k) + kFilmK * film_change_w_m2_k +
      physics::evaporation_w_m2_pa(film_w_m2_k(is), 1.0, 0.0, is.moist) *
          std::abs(is.moist.vapour_pa -
                   between(taken.begin.moist.vapour_pa, taken.end.moist.vapour_pa, way));
  if (weather.environment_stated) {
    change_w_m2 += std::abs(physics::environment_input_w_m2(1.0, weather.environment_k) -
                            between(taken.begin.environment_w_m2, taken.end.environment_w_m2, way));
  }
  // Water matters by the heat that takes it away: 0.01 mm are 24 kJ/m2.
  constexpr double kRainMm = 0.01;
  const std::int64_t begin_ns = node.at_ns - std::llround(1e9 * taken.dt_s);
  const double rain_change_mm = std::abs(environment.rain_mm(begin_ns, node.at_ns) - taken.rain_mm);
  return change_w_m2 > kMinChangeWM2K * tolerance_k || rain_change_mm > kRainMm;
}

}  // namespace emit::renderer
