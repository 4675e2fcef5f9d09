// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/surface_water.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/constants.hpp"

namespace emit::reference {
namespace {

using physics::WaterStore;

/// Share of the evaporation of ground that is wet all over, from the depth that is gone.
double wetness(const WaterStore& store, double water_mm) noexcept {
  if (!(water_mm > 0.0)) return 0.0;
  if (store.kind == WaterStore::Kind::film) {
    return std::pow(std::min(1.0, water_mm / store.capacity_mm), 2.0 / 3.0);
  }
  const double gone_mm = store.capacity_mm - water_mm;
  if (gone_mm <= store.ready_mm) return 1.0;
  return (store.capacity_mm - gone_mm) / (store.capacity_mm - store.ready_mm);
}

/// Resistance of the soil over that of its air film, for which the equation of Penman and Monteith
/// gives its share of the evaporation of wet soil: (1 + slope/gamma) (1/share - 1).
double soil_resistance(const WaterStore& store, double share, const ClimateNode& node) noexcept {
  if (store.kind != WaterStore::Kind::soil) return 0.0;
  constexpr double kDifferenceK = 0.05;
  const double slope_pa_k =
      (saturation_pa(node.air_k + kDifferenceK) - saturation_pa(node.air_k - kDifferenceK)) /
      (2.0 * kDifferenceK);
  const double latent_j_kg = 2.501e6 - 2361.0 * (node.air_k - physics::kZeroCelsiusK);
  const double gamma_pa_k = 1013.0 * node.flow.pressure_pa / (0.622 * latent_j_kg);
  return (1.0 + slope_pa_k / gamma_pa_k) * (1.0 / share - 1.0);
}

/// Share of what ground of the same temperature would give that is wet all over.
double warm_share(const WaterStore& store, double water_mm, const ClimateNode& node) noexcept {
  const double share = wetness(store, water_mm);
  if (!(share > 0.0)) return 0.0;
  return store.kind == WaterStore::Kind::film ? share
                                              : 1.0 / (1.0 + soil_resistance(store, share, node));
}

/// Water after a stretch, and where the rest of it went.
struct Stretch {
  double water_mm = 0.0;
  double evaporated_mm = 0.0;  ///< below 0: dew
  double drained_mm = 0.0;
};

/// Advances the water over a stretch in small steps of second order (Heun's), never below 0 or
/// above the store. What evaporates is the sum of the rates, less what was not there; what drains
/// is the sum of what the store could not take.
Stretch later(const WaterStore& store, double water_mm, double rain_mm_s, double begin_mm_s,
              double end_mm_s, double dt_s, const ClimateNode& node) noexcept {
  constexpr double kStepS = 1.0;
  const auto steps = static_cast<int>(std::max(1.0, std::ceil(dt_s / kStepS)));
  const double h = dt_s / steps;
  const auto evaporation_mm_s = [&](double mm, double frac) {
    const double open_mm_s = begin_mm_s + frac * (end_mm_s - begin_mm_s);
    // Dew forms on what is wet.
    const double share = open_mm_s > 0.0 ? warm_share(store, mm, node) : (mm > 0.0 ? 1.0 : 0.0);
    return share * open_mm_s;
  };
  Stretch out{.water_mm = water_mm};
  for (int i = 0; i < steps; ++i) {
    const double begin = evaporation_mm_s(out.water_mm, static_cast<double>(i) / steps);
    const double next_mm =
        std::clamp(out.water_mm + h * (rain_mm_s - begin), 0.0, store.capacity_mm);
    const double end = evaporation_mm_s(next_mm, static_cast<double>(i + 1) / steps);
    const double mean_mm_s = 0.5 * (begin + end);
    const double free_mm = out.water_mm + h * (rain_mm_s - mean_mm_s);
    out.evaporated_mm += h * mean_mm_s + std::min(0.0, free_mm);
    out.drained_mm += std::max(0.0, free_mm - store.capacity_mm);
    out.water_mm = std::clamp(free_mm, 0.0, store.capacity_mm);
  }
  return out;
}

}  // namespace

WaterCourse water_course(std::span<const ClimateNode> nodes, const scene::Material& material,
                         double initial_k, double surroundings_reflectance_frac,
                         const LayerMesh& mesh, const StepOptions& steps, double rain_frac) {
  const WaterStore store = scene::water_store_of(material);
  WaterCourse out;
  const double rain_mm = rain_frac * (nodes.back().rain_mm - nodes.front().rain_mm);
  if (store.none() || !(rain_mm > 0.0 || store.initial_mm > 0.0)) return out;
  const SurfaceOptics surface{{0.0, 0.0, 1.0},
                              material.solar_absorptance_frac,
                              material.emissivity_frac,
                              scene::film_skin(material),
                              false,
                              scene::moisture_of(material),
                              true};
  const ViewSample open = open_view(surface.normal);
  LayerSolver solver(mesh, steps);
  solver.start(steady_profile(solid_layers(material.layers), initial_k,
                              material.sheet ? initial_k : material.base_k),
               0.0);
  const auto face_at = [&](ClimateNode node, double wet_frac) {
    node.wet_frac = wet_frac;
    return face_state(node, surface, open, surroundings_reflectance_frac);
  };
  const auto open_mm_s = [&](const ClimateNode& node) {
    const FaceState face = face_at(node, 1.0);
    const double k = solver.face_k();
    const double latent_j_kg = 2.501e6 - 2361.0 * (node.air_k - physics::kZeroCelsiusK);
    return face.moisture->latent_w_m2(k, face.air_k, face.film_at_w_m2_k(k)) / latent_j_kg;
  };
  double water_mm = store.initial_mm;
  const auto keep = [&](const ClimateNode& node) {
    out.time_ns.push_back(node.time_ns);
    out.water_mm.push_back(water_mm);
    out.wet_frac.push_back(warm_share(store, water_mm, node));
    out.face_k.push_back(solver.face_k());
  };
  keep(nodes.front());
  for (std::size_t i = 0; i + 1 < nodes.size(); ++i) {
    const ClimateNode& a = nodes[i];
    const ClimateNode& b = nodes[i + 1];
    const double dt_s = static_cast<double>(b.time_ns - a.time_ns) * 1e-9;
    if (dt_s > 0.0) {
      const double rain_mm_s = rain_frac * (b.rain_mm - a.rain_mm) / dt_s;
      const double begin_mm_s = open_mm_s(a);
      const double expected_mm =
          later(store, water_mm, rain_mm_s, begin_mm_s, begin_mm_s, dt_s, a).water_mm;
      const double end_s = static_cast<double>(b.time_ns - nodes.front().time_ns) * 1e-9;
      solver.advance({solver.time_s(), end_s, face_at(a, warm_share(store, water_mm, a)),
                      face_at(b, warm_share(store, expected_mm, b))},
                     surface.emissivity_frac);
      const Stretch after = later(store, water_mm, rain_mm_s, begin_mm_s, open_mm_s(b), dt_s, b);
      water_mm = after.water_mm;
      out.evaporated_mm += after.evaporated_mm;
      out.drained_mm += after.drained_mm;
    }
    keep(b);
  }
  return out;
}

RainCourses::RainCourses(std::span<const ClimateNode> nodes, const scene::Material& material,
                         double initial_k, double surroundings_reflectance_frac,
                         const LayerMesh& mesh, const StepOptions& steps) {
  for (std::size_t i = 0; i < courses_.size(); ++i) {
    const double rain_frac = static_cast<double>(i) / static_cast<double>(courses_.size() - 1);
    courses_[i] = water_course(nodes, material, initial_k, surroundings_reflectance_frac, mesh,
                               steps, rain_frac);
  }
}

double RainCourses::between(double rain_frac, const auto& wetness_of) const noexcept {
  const double place = std::clamp(rain_frac, 0.0, 1.0) * static_cast<double>(courses_.size() - 1);
  const auto low = std::min(static_cast<std::size_t>(place), courses_.size() - 2);
  const double share = place - static_cast<double>(low);
  return (1.0 - share) * wetness_of(courses_[low]) + share * wetness_of(courses_[low + 1]);
}

double RainCourses::at_node(std::size_t node, double rain_frac) const noexcept {
  return between(rain_frac, [node](const WaterCourse& course) {
    return course.empty() ? 0.0 : course.wet_frac[node];
  });
}

double RainCourses::at(std::int64_t at_ns, double rain_frac) const noexcept {
  return between(rain_frac, [at_ns](const WaterCourse& course) { return course.at(at_ns); });
}

double rain_on_face_frac(const SceneInstant& instant, const SurfacePoint& point) {
  if (!(point.normal.z > 0.0)) return 0.0;
  constexpr double kConeRad = 20.0 * physics::kDegree;
  constexpr int kRings = 8;
  constexpr int kAzimuths = 8;
  int reach = 0;
  int rays = 0;
  for (int ring = 0; ring < kRings; ++ring) {
    // Rings of a level plane above the point have equal areas.
    const double tangent = std::tan(kConeRad) * std::sqrt((ring + 0.5) / kRings);
    for (int k = 0; k < kAzimuths; ++k) {
      const double azimuth_rad = 2.0 * physics::kPi * (k + 0.5 * (ring % 2)) / kAzimuths;
      const glm::dvec3 direction = glm::normalize(
          glm::dvec3(tangent * std::cos(azimuth_rad), tangent * std::sin(azimuth_rad), 1.0));
      // Rays from behind the face count neither way.
      if (!(glm::dot(direction, point.normal) > 0.0)) continue;
      ++rays;
      if (!instant.occluded({point.position_world_m, direction, point.tolerance_m})) ++reach;
    }
  }
  return rays == 0 ? point.normal.z : point.normal.z * reach / rays;
}

double WaterCourse::at(std::int64_t at_ns) const noexcept {
  if (time_ns.empty()) return 0.0;
  const auto after = std::upper_bound(time_ns.begin(), time_ns.end(), at_ns);
  if (after == time_ns.begin()) return wet_frac.front();
  if (after == time_ns.end()) return wet_frac.back();
  const auto i = static_cast<std::size_t>(after - time_ns.begin());
  const double f = static_cast<double>(at_ns - time_ns[i - 1]) /
                   static_cast<double>(time_ns[i] - time_ns[i - 1]);
  return wet_frac[i - 1] + f * (wet_frac[i] - wet_frac[i - 1]);
}

}  // namespace emit::reference
