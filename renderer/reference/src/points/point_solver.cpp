// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <limits>
#include <memory>

#include "emit/physics/check.hpp"
#include "emit/reference/surface_forcing.hpp"
#include "emit/reference/surface_water.hpp"
#include "emit/scene/base.hpp"

namespace emit::reference {
namespace {

/// Interpolates a climate.
ClimateNode mix(const ClimateNode& a, const ClimateNode& b, double f) noexcept {
  const auto at = [f](double x, double y) { return x + f * (y - x); };
  return {a.time_ns,
          a.to_sun + f * (b.to_sun - a.to_sun),
          at(a.direct_normal_w_m2, b.direct_normal_w_m2),
          at(a.diffuse_horizontal_w_m2, b.diffuse_horizontal_w_m2),
          at(a.longwave_down_w_m2, b.longwave_down_w_m2),
          at(a.air_k, b.air_k),
          physics::between_flows(a.flow, b.flow, f),
          at(a.surroundings_k, b.surroundings_k),
          at(a.vapour_pa, b.vapour_pa),
          at(a.rain_mm, b.rain_mm),
          at(a.wet_frac, b.wet_frac)};
}

/// Interpolates a view.
ViewSample mix(const ViewSample& a, const ViewSample& b, double f) noexcept {
  const auto at = [f](double x, double y) { return x + f * (y - x); };
  return {a.time_ns,
          at(a.sun_frac, b.sun_frac),
          at(a.sky_frac, b.sky_frac),
          at(a.scene_frac, b.scene_frac),
          at(a.scene_shortwave_w_m2, b.scene_shortwave_w_m2),
          at(a.scene_longwave_w_m2, b.scene_longwave_w_m2)};
}

/// Interpolates a temperature of the base.
BaseSample mix(const BaseSample& a, const BaseSample& b, double f) noexcept {
  return {a.time_ns, a.kelvin + f * (b.kelvin - a.kelvin)};
}

/// Interpolates a motion. A face that has turned over between two samples has no normal in the
/// middle, and keeps the nearer one.
MotionSample mix(const MotionSample& a, const MotionSample& b, double f) noexcept {
  constexpr double kShortest = 1e-6;
  const glm::dvec3 between = a.normal + f * (b.normal - a.normal);
  const double length = glm::length(between);
  return {a.time_ns, a.velocity_m_s + f * (b.velocity_m_s - a.velocity_m_s),
          a.up_m + f * (b.up_m - a.up_m),
          length > kShortest ? between / length : (f < 0.5 ? a.normal : b.normal)};
}

/// Moves `row` on to the last row at or before `now_ns`. At a jump this is the later one.
template <class Rows>
void seek(const Rows& rows, std::int64_t now_ns, std::size_t& row) noexcept {
  while (row + 1 < rows.size() && rows[row + 1].time_ns <= now_ns) ++row;
}

/// Returns the next time after `row` at which the rows bend.
template <class Rows>
std::int64_t next_time(const Rows& rows, std::int64_t now_ns, std::size_t row) noexcept {
  if (!rows.empty() && rows[row].time_ns > now_ns) return rows[row].time_ns;
  return row + 1 < rows.size() ? rows[row + 1].time_ns : std::numeric_limits<std::int64_t>::max();
}

/// Returns the value at a time in the stretch that starts with `row`. Outside the rows the first or
/// last value holds.
template <class Rows>
auto value_at(const Rows& rows, std::int64_t time_ns, std::size_t row) noexcept {
  if (row + 1 >= rows.size() || time_ns <= rows[row].time_ns) return mix(rows[row], rows[row], 0.0);
  const std::int64_t length_ns = rows[row + 1].time_ns - rows[row].time_ns;
  return mix(rows[row], rows[row + 1],
             static_cast<double>(time_ns - rows[row].time_ns) / static_cast<double>(length_ns));
}

}  // namespace

PointSolver::PointSolver(const SurfaceClimate& climate, const LayerMesh& mesh,
                         const scene::Material& material, double initial_k,
                         const StepOptions& steps)
    : climate_(&climate),
      material_(&material),
      initial_k_(material.initial_k.value_or(initial_k)),
      balanced_(!climate.stated_start_k(material, initial_k)),
      solver_(mesh, steps),
      spin_up_k_(mesh.nodes()) {
  start_profile_ = steady_profile(solid_layers(material.layers), initial_k_,
                                  material.sheet ? initial_k_ : material.base_k);
  if (material.prescribed_k) return;
  auto rain = std::make_shared<const RainCourses>(
      climate.nodes(), material, initial_k_, climate.surroundings_reflectance_frac(), mesh, steps);
  if (!rain->empty()) rain_ = std::move(rain);
}

double PointSolver::seconds(std::int64_t time_ns) const noexcept {
  return static_cast<double>(time_ns - climate_->start_ns()) * 1e-9;
}

void PointSolver::advance(const SurfaceOptics& surface, const Views& views,
                          std::int64_t until_ns) noexcept {
  const auto nodes = climate_->nodes();
  // Rain that falls straight down meets a tilted face by its cosine.
  const double front_rain = views.front_rain_frac.value_or(std::max(0.0, surface.normal.z));
  const double back_rain = views.back_rain_frac.value_or(std::max(0.0, -surface.normal.z));
  const auto wetness_at = [&](std::size_t node) {
    const double front = rain_->at_node(node, front_rain);
    return material_->sheet ? 0.5 * (front + rain_->at_node(node, back_rain)) : front;
  };
  // Step to the next time at which climate or view bends.
  while (now_ns_ < until_ns) {
    seek(nodes, now_ns_, climate_row_);
    seek(views.front, now_ns_, view_row_);
    std::int64_t end_ns = std::min({until_ns, next_time(nodes, now_ns_, climate_row_),
                                    next_time(views.front, now_ns_, view_row_)});
    // A sheet also has the bends of its back's view.
    if (material_->sheet) {
      seek(views.back, now_ns_, back_row_);
      end_ns = std::min(end_ns, next_time(views.back, now_ns_, back_row_));
    }
    // An entity also has the bends of its motion.
    if (!views.motion.empty()) {
      seek(views.motion, now_ns_, motion_row_);
      end_ns = std::min(end_ns, next_time(views.motion, now_ns_, motion_row_));
    }
    // The interior of a body also has the bends of its course.
    if (!views.base.empty()) {
      seek(views.base, now_ns_, base_row_);
      end_ns = std::min(end_ns, next_time(views.base, now_ns_, base_row_));
      const double from_k = value_at(views.base, now_ns_, base_row_).kelvin;
      const double to_k = value_at(views.base, end_ns, base_row_).kelvin;
      solver_.move_base(from_k, (to_k - from_k) / (1e-9 * static_cast<double>(end_ns - now_ns_)));
    }
    // Build the state of the face. A sheet takes the mean of both faces, physics.md eq. 24.
    const auto state = [&](std::int64_t time_ns) {
      ClimateNode climate = value_at(nodes, time_ns, climate_row_);
      if (rain_ != nullptr) {
        // Interpolate as the climate is.
        ClimateNode a = nodes[climate_row_];
        a.wet_frac = wetness_at(climate_row_);
        const std::size_t next = std::min(climate_row_ + 1, nodes.size() - 1);
        ClimateNode b = nodes[next];
        b.wet_frac = wetness_at(next);
        climate.wet_frac = value_at(std::array{a, b}, time_ns, 0).wet_frac;
      }
      const double reflectance_frac = climate_->surroundings_reflectance_frac();
      SurfaceOptics side = surface;
      if (!views.motion.empty()) {
        const MotionSample motion = value_at(views.motion, time_ns, motion_row_);
        climate = climate_past(climate, motion);
        side.normal = motion.normal;
      }
      FaceState face =
          face_state(climate, side, value_at(views.front, time_ns, view_row_), reflectance_frac);
      if (!material_->sheet) return face;
      side.normal = -side.normal;
      const FaceState other =
          face_state(climate, side, value_at(views.back, time_ns, back_row_), reflectance_frac);
      face.absorbed_w_m2 = 0.5 * (face.absorbed_w_m2 + other.absorbed_w_m2);
      if (face.moisture) {
        face.moisture->resistance_s_m =
            0.5 * (face.moisture->resistance_s_m + other.moisture->resistance_s_m);
      }
      return face;
    };
    // Solve the stretch, which is linear in time.
    solver_.advance({solver_.time_s(), seconds(end_ns), state(now_ns_), state(end_ns)},
                    surface.emissivity_frac);
    now_ns_ = end_ns;
  }
}

void PointSolver::rewind(std::int64_t now_ns) noexcept {
  now_ns_ = now_ns;
  climate_row_ = 0;
  view_row_ = 0;
  back_row_ = 0;
  base_row_ = 0;
  motion_row_ = 0;
}

BalancedStart PointSolver::start_of(const SurfaceOptics& surface, const Views& views,
                                    std::int64_t start_ns) {
  const ViewSample open = open_view(surface.normal);
  Views seen = views;
  if (seen.front.empty()) seen.front = std::span(&open, 1);
  // The mean of the surface is that of its temperatures every quarter of an hour.
  constexpr std::int64_t kParts = 96;
  const auto run_day = [&] {
    rewind(start_ns);
    double sum_k = 0.5 * solver_.face_k();
    for (std::int64_t part = 1; part <= kParts; ++part) {
      advance(surface, seen, start_ns + scene::kBalancedDayNs / kParts * part);
      sum_k += (part == kParts ? 0.5 : 1.0) * solver_.face_k();
    }
    return sum_k / static_cast<double>(kParts);
  };
  const double base_k =
      views.base.empty() ? material_->base_k : value_at(views.base, start_ns, 0).kelvin;
  return balanced_start(solver_, solid_layers(material_->layers), base_k, initial_k_,
                        seconds(start_ns), run_day);
}

double PointSolver::balanced_mean_k(const glm::dvec3& normal) {
  return start_of(SurfaceOptics{normal, material_->solar_absorptance_frac,
                                material_->emissivity_frac, scene::film_skin(*material_), false,
                                scene::moisture_of(*material_), rain_ != nullptr},
                  {}, climate_->start_ns())
      .mean_k;
}

ViewSample PointSolver::mean_view(const glm::dvec3& normal, const Views& seen) const noexcept {
  ViewSample mean = open_view(normal);
  if (seen.front.empty()) return mean;
  mean.sky_frac = seen.front.front().sky_frac;
  // Weigh the visible share of the sun by the energy on the face, every quarter of an hour of the
  // first day.
  constexpr std::int64_t kParts = 96;
  double all_w_m2 = 0.0;
  double seen_w_m2 = 0.0;
  std::size_t row = 0;
  for (std::int64_t part = 0; part < kParts; ++part) {
    const std::int64_t at_ns = climate_->history_start_ns() + scene::kBalancedDayNs / kParts * part;
    if (at_ns > seen.front.back().time_ns) break;
    seek(seen.front, at_ns, row);
    const ClimateNode now = climate_->at(at_ns);
    const double sun_w_m2 = now.direct_normal_w_m2 * std::max(0.0, glm::dot(normal, now.to_sun));
    all_w_m2 += sun_w_m2;
    seen_w_m2 += sun_w_m2 * value_at(seen.front, at_ns, row).sun_frac;
  }
  if (all_w_m2 > 0.0) mean.sun_frac = seen_w_m2 / all_w_m2;
  return mean;
}

void PointSolver::spin_up(const SurfaceOptics& surface, std::span<const MotionSample> rest,
                          const Views& seen) {
  // Run with an open view, or with the mean of what a balanced point sees later.
  const ViewSample before = balanced_ ? mean_view(surface.normal, seen) : open_view(surface.normal);
  const ViewSample behind = open_view(-surface.normal);
  Views views{std::span(&before, 1), std::span(&behind, 1), seen.front_rain_frac,
              seen.back_rain_frac};
  if (!balanced_) views.front_rain_frac = views.back_rain_frac = std::nullopt;
  views.motion = rest;
  views.base = seen.base;
  const std::int64_t start_ns = climate_->start_ns();
  const std::int64_t history_ns = climate_->history_start_ns();
  if (balanced_) {
    // Repeat the first day of the history itself where there is no spin-up.
    const Views& first = start_ns < history_ns ? views : seen;
    solver_.start_nodes(start_of(surface, first, start_ns).node_k, 0.0);
  } else {
    solver_.start(start_profile_, 0.0);
  }
  rewind(start_ns);
  advance(surface, views, history_ns);
  // Store the profile for further points of this orientation.
  solver_.copy_nodes_k(spin_up_k_);
  spin_up_normal_ = surface.normal;
  spin_up_up_m_ = rest.empty() ? 0.0 : rest.front().up_m;
  spin_up_film_body_ = surface.film_body;
  has_spin_up_ = !balanced_;
}

void PointSolver::run(const glm::dvec3& normal, const Views& views,
                      std::span<const std::int64_t> times_ns, std::span<double> out_k,
                      std::span<double> out_base_j_m2) {
  EMIT_CHECK_OP(out_k.size(), ==, times_ns.size());
  EMIT_CHECK(out_base_j_m2.empty() || out_base_j_m2.size() == times_ns.size());
  EMIT_CHECK(views.base.empty() || !material_->sheet);
  if (material_->prescribed_k) {
    std::fill(out_k.begin(), out_k.end(), *material_->prescribed_k);
    return;
  }
  // An entity stands where it is at the start of the history until then.
  std::optional<MotionSample> rest;
  if (!views.motion.empty()) {
    rest = views.motion.front();
    rest->velocity_m_s = glm::dvec3(0.0);
  }
  const SurfaceOptics surface{rest ? rest->normal : normal,
                              material_->solar_absorptance_frac,
                              material_->emissivity_frac,
                              scene::film_skin(*material_),
                              material_->sheet,
                              scene::moisture_of(*material_),
                              rain_ != nullptr,
                              views.film_body};
  // Replace empty views by open ones.
  const ViewSample open = open_view(normal);
  const ViewSample open_behind = open_view(-normal);
  const Views seen{views.front.empty() ? std::span(&open, 1) : views.front,
                   views.back.empty() ? std::span(&open_behind, 1) : views.back,
                   views.front_rain_frac,
                   views.back_rain_frac,
                   views.base,
                   views.motion,
                   views.film_body};
  // Repeat the spin-up for another orientation, height or flow, or for other views in balance.
  if (!has_spin_up_ || surface.normal != spin_up_normal_ ||
      (rest ? rest->up_m : 0.0) != spin_up_up_m_ || !(views.film_body == spin_up_film_body_)) {
    spin_up(surface, rest ? std::span(&*rest, 1) : std::span<const MotionSample>(), seen);
  }
  const std::int64_t start_ns = climate_->history_start_ns();
  solver_.start_nodes(spin_up_k_, seconds(start_ns));
  rewind(start_ns);
  // Advance from answer to answer.
  double first_j_m2 = 0.0;
  for (std::size_t i = 0; i < times_ns.size(); ++i) {
    advance(surface, seen, times_ns[i]);
    out_k[i] = solver_.face_k();
    if (out_base_j_m2.empty()) continue;
    if (i == 0) first_j_m2 = solver_.heat_out_of_base_j_m2();
    out_base_j_m2[i] = solver_.heat_out_of_base_j_m2() - first_j_m2;
  }
}

physics::Result<std::vector<double>> point_history(const SurfaceClimate& climate,
                                                   const scene::Material& material,
                                                   double initial_k, const glm::dvec3& normal,
                                                   std::span<const ViewSample> view,
                                                   std::span<const std::int64_t> times_ns,
                                                   const MeshOptions& mesh_options,
                                                   const StepOptions& steps) {
  std::vector<double> out_k(times_ns.size());
  if (material.prescribed_k) {
    std::fill(out_k.begin(), out_k.end(), *material.prescribed_k);
    return out_k;
  }
  const auto mesh = material_mesh(material, mesh_options);
  if (!mesh) return tl::unexpected(mesh.error());
  PointSolver solver(climate, *mesh, material, initial_k, steps);
  solver.run(normal, {view, {}}, times_ns, out_k);
  return out_k;
}

}  // namespace emit::reference
