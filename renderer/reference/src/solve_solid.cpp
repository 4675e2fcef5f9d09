// SPDX-License-Identifier: Apache-2.0
#include "solve_solid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "emit/physics/constants.hpp"

namespace emit::reference {
namespace {

using physics::Result;

/// Interval of the sun's directions that choose the cells. Shadows move slowly against it.
constexpr double kSunSampleS = 600.0;
/// Interval of the sun's directions in the last time before the end, kLateS, in which edges are
/// still sharp.
constexpr double kLateSunSampleS = 60.0;
constexpr double kLateS = 1200.0;
constexpr double kMaxSpinUpStepS = 3600.0;
/// Largest step of the history at refine 1. Moving shadows are sampled at least this often.
constexpr double kMaxHistoryStepS = 120.0;

/// Converts seconds to nanoseconds.
std::int64_t ns(double time_s) {
  return std::llround(time_s * 1e9);
}

/// Returns place and optics of a face.
ExchangeFace surface_of(const VoxelModel& model, const SolidFace& face,
                        const scene::SceneGeometry& geometry) {
  const VoxelFace info = model.face(face);
  const scene::Material& material = geometry.materials[info.material];
  return {face.centre_m(),
          face.normal(),
          face.area_m2,
          material.solar_absorptance_frac,
          material.emissivity_frac,
          scene::film_skin(material),
          info.in_cavity};
}

/// Adds the latent heat of a face to its film and air, along its tangent at the temperature of now.
/// The solver takes film and air as constant over a stage, to second order in its step, and a
/// tangent is as good as that.
void add_latent(const ClimateNode& now, const physics::MoistSurface& moisture,
                double shortwave_w_m2, double face_k, double& film_w_m2_k, double& air_k) {
  if (!(film_w_m2_k > 0.0)) return;
  const FaceMoisture face{.vapour_pa = now.vapour_pa,
                          .pressure_pa = now.flow.pressure_pa,
                          .wetness_frac = moisture.wetness_frac,
                          .resistance_s_m = light_resistance_s_m(moisture, shortwave_w_m2),
                          .film_frac = moisture.film_frac};
  constexpr double kDifferenceK = 0.01;
  const auto latent_w_m2 = [&](double k) { return face.latent_w_m2(k, now.air_k, film_w_m2_k); };
  const double slope_w_m2_k =
      (latent_w_m2(face_k + kDifferenceK) - latent_w_m2(face_k - kDifferenceK)) /
      (2.0 * kDifferenceK);
  const double into_w_m2 = film_w_m2_k * air_k + slope_w_m2_k * face_k - latent_w_m2(face_k);
  film_w_m2_k += slope_w_m2_k;
  air_k = into_w_m2 / film_w_m2_k;
}

/// Temperature field of another solver's grid, trilinear between its nodes.
class NodeField {
 public:
  NodeField(const SolidGrid& grid, const SolidSolver& solver) : lines_m_(grid.lines_m) {
    const std::size_t nodes = lines_m_[0].size() * lines_m_[1].size() * lines_m_[2].size();
    kelvin_.assign(nodes, std::numeric_limits<double>::quiet_NaN());
    const auto places = solver.nodes_m();
    for (std::size_t i = 0; i < places.size(); ++i) {
      kelvin_[index(line(0, places[i].x), line(1, places[i].y), line(2, places[i].z))] =
          solver.node_k()[i];
    }
  }

  [[nodiscard]] double at(const glm::dvec3& p) const {
    std::array<std::size_t, 3> cell{};
    std::array<double, 3> share{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double x = p[static_cast<glm::dvec3::length_type>(axis)];
      const std::size_t above = line(axis, x);
      cell[axis] = std::min(above, lines_m_[axis].size() - 2);
      share[axis] = std::clamp((x - lines_m_[axis][cell[axis]]) /
                                   (lines_m_[axis][cell[axis] + 1] - lines_m_[axis][cell[axis]]),
                               0.0, 1.0);
    }
    double sum = 0.0;
    double weights = 0.0;
    for (unsigned corner = 0; corner < 8; ++corner) {
      double weight = 1.0;
      std::array<std::size_t, 3> node = cell;
      for (unsigned axis = 0; axis < 3; ++axis) {
        const bool up = (corner >> axis & 1U) != 0;
        weight *= up ? share[axis] : 1.0 - share[axis];
        node[axis] += up ? 1 : 0;
      }
      const double value = kelvin_[index(node[0], node[1], node[2])];
      // Skip places without a node: they are air, and a point on a face has no weight there.
      if (!(weight > 0.0) || std::isnan(value)) continue;
      sum += weight * value;
      weights += weight;
    }
    return weights > 0.0 ? sum / weights : std::numeric_limits<double>::quiet_NaN();
  }

 private:
  [[nodiscard]] std::size_t index(std::size_t i, std::size_t j, std::size_t k) const {
    return i + lines_m_[0].size() * (j + lines_m_[1].size() * k);
  }
  /// Returns the last line at or below x, to rounding.
  [[nodiscard]] std::size_t line(std::size_t axis, double x) const {
    const auto after = std::upper_bound(lines_m_[axis].begin(), lines_m_[axis].end(), x + 1e-9);
    return static_cast<std::size_t>(
        std::max<std::ptrdiff_t>(after - lines_m_[axis].begin() - 1, 0));
  }
  std::array<std::vector<double>, 3> lines_m_;
  std::vector<double> kelvin_;
};

}  // namespace

ExchangeSky exchange_sky(const ClimateNode& now, double surroundings_reflectance_frac) {
  const double t2 = now.surroundings_k * now.surroundings_k;
  const double global =
      now.diffuse_horizontal_w_m2 + now.direct_normal_w_m2 * std::max(0.0, now.to_sun.z);
  return {now.diffuse_horizontal_w_m2, now.longwave_down_w_m2,
          surroundings_reflectance_frac * global, physics::kStefanBoltzmannWPerM2K4 * t2 * t2};
}

SolidRadiation::SolidRadiation(const VoxelModel& model, const SolidSolver& solver,
                               const scene::SceneGeometry& geometry, const SceneInstant& instant,
                               const SurfaceClimate& climate, const SolveOptions& options,
                               const scene::ThermalOptions& thermal)
    : model_(model),
      instant_(instant),
      climate_(climate),
      exchanges_(thermal.exchange),
      finder_(model.grid(), solver.faces(), model.thickest_sheet_m()) {
  const auto faces = solver.faces();
  for (const SolidFace& face : faces) {
    surfaces_.push_back(surface_of(model, face, geometry));
    face_material_.push_back(model.face(face).material);
    moisture_.push_back(scene::moisture_of(geometry.materials[face_material_.back()]));
  }
  for (const scene::Material& material : geometry.materials) {
    water_.emplace_back();
    if (scene::water_store_of(material).none()) continue;
    if (const auto mesh = material_mesh(material)) {
      water_.back() =
          RainCourses(climate.nodes(), material, material.initial_k.value_or(thermal.initial_k),
                      climate.surroundings_reflectance_frac(), *mesh);
    }
  }
  rain_frac_.resize(surfaces_.size(), 0.0);
  for (std::size_t f = 0; f < surfaces_.size(); ++f) {
    if (water_[face_material_[f]].empty() || surfaces_[f].enclosed) continue;
    rain_frac_[f] = rain_on_face_frac(instant, {surfaces_[f].centre_m, surfaces_[f].normal, 1e-9});
  }
  exchange_ = std::make_unique<SceneExchange>(faces, surfaces_, finder_, instant, options.rays);
  sun_ = std::make_unique<SunOnFaces>(faces, surfaces_);
  sun_frac_.resize(faces.size());
  direct_w_m2_.resize(faces.size());
  incoming_.resize(faces.size());
}

void SolidRadiation::drive(double time_s, std::span<const double> face_k, const FaceDrive& out) {
  const ClimateNode now = climate_.at(ns(time_s));
  const glm::dvec3 to_sun = glm::normalize(now.to_sun);
  const std::size_t n = surfaces_.size();
  // Compute the sun on every face.
  if (now.direct_normal_w_m2 > 0.0) {
    sun_->visible_frac(instant_, to_sun, sun_frac_);
  } else {
    std::fill(sun_frac_.begin(), sun_frac_.end(), 0.0);
  }
  for (std::size_t f = 0; f < n; ++f) {
    direct_w_m2_[f] = now.direct_normal_w_m2 * sun_frac_[f] *
                      std::max(0.0, glm::dot(surfaces_[f].normal, to_sun));
    if (climate_.clouds() != nullptr && direct_w_m2_[f] > 0.0) {
      direct_w_m2_[f] *= climate_.cloud_sun(now, surfaces_[f].centre_m);
    }
  }
  // Compute the radiation between the faces, or take all of them for surroundings.
  const ExchangeSky sky = exchange_sky(now, climate_.surroundings_reflectance_frac());
  if (exchanges_) {
    left_w_m2_ = std::max(left_w_m2_, exchange_->incoming(direct_w_m2_, face_k, sky, incoming_));
  } else {
    for (std::size_t f = 0; f < n; ++f) {
      const double open = exchange_->sky_frac(f);
      const double around = surroundings_frac(f);
      incoming_[f] = {open * sky.diffuse_w_m2 + around * sky.ground_short_w_m2,
                      open * sky.longwave_w_m2 + around * sky.ground_long_w_m2};
    }
  }
  // Set the drive of every face, with the film at its temperature now.
  const physics::AirFilm film = physics::air_film(now.flow);
  const double cavity4 = std::pow(model_.cavity_k(), 4);
  for (std::size_t f = 0; f < n; ++f) {
    const ExchangeFace& s = surfaces_[f];
    out.film_w_m2_k[f] =
        s.enclosed ? 0.0 : physics::film_w_m2_k(film, s.normal, s.skin, face_k[f] - now.air_k);
    out.air_k[f] = now.air_k;
    physics::MoistSurface moisture = moisture_[f];
    const RainCourses& water = water_[face_material_[f]];
    if (!water.empty()) moisture.film_frac = water.at(ns(time_s), rain_frac_[f]);
    if (!s.enclosed && !moisture.dry()) {
      add_latent(now, moisture, direct_w_m2_[f] + incoming_[f].shortwave_w_m2, face_k[f],
                 out.film_w_m2_k[f], out.air_k[f]);
    }
    out.absorbed_w_m2[f] =
        s.enclosed ? s.emissivity_frac * physics::kStefanBoltzmannWPerM2K4 * cavity4
                   : s.solar_absorptance_frac * (direct_w_m2_[f] + incoming_[f].shortwave_w_m2) +
                         s.emissivity_frac * incoming_[f].longwave_w_m2;
  }
}

Result<void> SolidRadiation::check() const {
  if (left_w_m2_ <= kRadiosityToleranceWM2) return {};
  return physics::make_error(
      physics::ErrorCode::invalid_argument,
      fmt::format("reflections between faces do not fade: {:.3g} W/m2 are left. Some material "
                  "absorbs nothing and encloses others",
                  left_w_m2_));
}

Result<std::unique_ptr<SolidHistory>> SolidHistory::create(const scene::ScenarioDesc& scenario,
                                                           const scene::SceneGeometry& geometry,
                                                           const SceneInstant& instant,
                                                           const SurfaceClimate& climate,
                                                           const SolveOptions& options,
                                                           double end_s) {
  auto history = std::unique_ptr<SolidHistory>(
      new SolidHistory(scenario, geometry, instant, climate, options));
  // Sample the directions of the sun, for the choice of cells along its shadows.
  VoxelOptions voxels;
  voxels.refine = options.refine;
  const auto past_sun = [&](double t) {
    const ClimateNode now = climate.at(ns(t));
    if (now.direct_normal_w_m2 > 0.0) {
      voxels.suns.push_back({glm::normalize(now.to_sun), end_s - t});
    }
  };
  const double start_s = static_cast<double>(climate.history_start_ns()) * 1e-9;
  for (double t = start_s; t < end_s;
       t += t < end_s - kLateS - kSunSampleS ? kSunSampleS : kLateSunSampleS) {
    past_sun(t);
  }
  past_sun(end_s);
  // Build the model and the solver.
  auto model = VoxelModel::build(scenario, geometry, voxels);
  if (!model) return tl::unexpected(std::move(model.error()));
  history->model_ = std::make_unique<VoxelModel>(std::move(*model));
  const VoxelModel& voxel = *history->model_;
  auto solver = SolidSolver::create(
      voxel.grid(), [&](const SolidFace& face) { return voxel.condition(face); },
      history->solid_options());
  if (!solver) return tl::unexpected(std::move(solver.error()));
  history->solver_ = std::make_unique<SolidSolver>(std::move(*solver));
  history->radiation_ = std::make_unique<SolidRadiation>(
      voxel, *history->solver_, geometry, instant, climate, options, scenario.thermal);
  return history;
}

SolidOptions SolidHistory::solid_options() const {
  SolidOptions solid;
  solid.tolerance_k = options_.tolerance_k / (options_.refine * options_.refine);
  solid.first_step_s = 1.0;
  solid.max_step_s = kMaxHistoryStepS / options_.refine;
  if (climate_.clouds() != nullptr) {
    solid.max_step_s = std::min(solid.max_step_s, climate_.clouds()->step_s());
  }
  return solid;
}

Result<void> SolidHistory::spin_up() {
  const double start_s = static_cast<double>(climate_.start_ns()) * 1e-9;
  const double history_s = static_cast<double>(climate_.history_start_ns()) * 1e-9;
  const double initial_k = scenario_.thermal.initial_k;
  const auto steady = [&](const glm::dvec3& p) { return model_->steady_k(p, initial_k); };
  if (!(history_s > start_s)) {
    solver_->set_temperature(history_s, steady);
    return {};
  }
  // Build a coarser grid: an edge of a shadow that old has faded.
  VoxelOptions voxels;
  voxels.refine = options_.refine;
  auto coarse = VoxelModel::build(scenario_, geometry_, voxels);
  if (!coarse) return tl::unexpected(std::move(coarse.error()));
  SolidOptions solid = solid_options();
  solid.max_step_s = kMaxSpinUpStepS / options_.refine;
  auto solver = SolidSolver::create(
      coarse->grid(), [&](const SolidFace& face) { return coarse->condition(face); }, solid);
  if (!solver) return tl::unexpected(std::move(solver.error()));
  SolidRadiation radiation(*coarse, *solver, geometry_, instant_, climate_, options_,
                           scenario_.thermal);
  // Advance from the steady profile to the start of the history.
  solver->set_temperature(start_s, steady);
  const auto reached = solver->advance(
      history_s,
      [&](double time_s, std::span<const double> face_k, const FaceDrive& out) {
        radiation.drive(time_s, face_k, out);
      },
      [&](double) { return !options_.progress || options_.progress(0.0); });
  if (!reached) return tl::unexpected(reached.error());
  if (auto faded = radiation.check(); !faded) return faded;
  // Take over the temperatures.
  const NodeField field(coarse->grid(), *solver);
  solver_->set_temperature(history_s, [&](const glm::dvec3& p) { return field.at(p); });
  spin_up_stats_ = solver->stats();
  return {};
}

Result<void> SolidHistory::advance(double to_s, const std::function<bool(double)>& after_step) {
  auto advanced = solver_->advance(
      to_s,
      [this](double time_s, std::span<const double> face_k, const FaceDrive& out) {
        radiation_->drive(time_s, face_k, out);
      },
      after_step);
  return advanced ? radiation_->check() : std::move(advanced);
}

Result<void> SolidHistory::restore(const SolidState& state, const SolidStats& spin_up) {
  spin_up_stats_ = spin_up;
  return solver_->restore(state);
}

}  // namespace emit::reference
