// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/solve.hpp"

#include <fmt/format.h>
#include <tbb/blocked_range.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <numeric>
#include <optional>

#include "emit/physics/climate/climate.hpp"
#include "emit/physics/weather.hpp"
#include "emit/reference/surface_forcing.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/scene/base.hpp"
#include "emit/threads/parallel.hpp"
#include "points/point_histories.hpp"
#include "sky_discs.hpp"
#include "solve_checkpoint.hpp"
#include "solve_limits.hpp"
#include "solve_radiance.hpp"
#include "solve_solid.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

/// Longest time on the fine grid before the first picture. Edges of older shadows have faded.
constexpr std::int64_t kFineNs = 24LL * 3600 * 1'000'000'000;

/// First hit of a pixel's ray.
struct PixelHit {
  std::uint32_t pixel = 0;
  SolvePoint point;
  glm::dvec3 direction{0.0};
  double range_m = 0.0;
  double sky_frac = 0.0;
  double ground_frac = 0.0;
  double sun_frac = 0.0;
  std::uint32_t face = 0;  ///< face of the voxel model, if there is one
};

/// Hash of the pixel's number (SplitMix64).
std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31U);
}

/// Returns the share of the direct sun that clouds take: from the weather table, linear between
/// rows, else from the clear-sky model.
double cloud_frac_at(const scene::ScenarioDesc& scenario, std::int64_t sim_time_ns) {
  if (scenario.weather.empty()) return scenario.clear_sky.cloud_frac;
  return physics::forcing_from_rows(scenario.weather, sim_time_ns).cloud_frac;
}

/// Keeps the pixels with the smallest hashes. The choice looks random and is the same every time.
void choose(std::vector<PixelHit>& hits, std::uint64_t wanted) {
  if (wanted == 0 || wanted >= hits.size()) return;
  std::sort(hits.begin(), hits.end(),
            [](const PixelHit& a, const PixelHit& b) { return mix(a.pixel) < mix(b.pixel); });
  hits.resize(wanted);
  std::sort(hits.begin(), hits.end(),
            [](const PixelHit& a, const PixelHit& b) { return a.pixel < b.pixel; });
}

}  // namespace

/// Copies of the input, and all parts of a run.
struct SceneSolver::Data {
  scene::ScenarioDesc scenario;
  scene::SceneGeometry geometry;
  SolveOptions options;
  std::int64_t end_ns = 0;
  std::optional<RayScene> rays;
  std::optional<SceneInstant> start;
  std::optional<SurfaceClimate> climate;
  std::unique_ptr<SolidHistory> solid;
  std::vector<BandRadiance> bands;
  SolveFingerprint print;
  bool started = false;
  bool resumed = false;
  bool stopped = false;
  double spin_up_s = 0.0;
  PointSolution points;          ///< of the last instant, in one dimension
  double interior_left_k = 0.0;  ///< most that an interior changed in its last round
  std::string reason;
  std::vector<std::string> notes;

  void lengthen_history(bool three);
  /// Returns the start of the scenario's own history in one dimension.
  [[nodiscard]] std::int64_t fine_from_ns() const {
    return scenario.thermal.history_start_ns + std::llround(spin_up_s * 1e9);
  }
  Result<void> start_solid();
  Result<std::vector<PixelHit>> see(const SolveView& view, SolvedImage& image,
                                    std::vector<glm::dvec3>& sky_rays) const;
  Result<void> choose_dimension(bool& three);
  void note_simpler_physics(bool three);
  void note_temperatures(std::span<const PixelHit> hits, std::span<const double> kelvin,
                         std::int64_t sim_time_ns);
  Result<void> check_instant(std::int64_t sim_time_ns) const;
  Result<std::vector<double>> temperatures(std::vector<PixelHit>& hits, std::int64_t sim_time_ns);
  std::optional<PixelHit> surface_at(const SceneInstant& instant, const SolveProbe& probe,
                                     ProbedPoint& out) const;
  void radiate(const SolveView& view, std::span<const PixelHit> hits,
               std::span<const double> kelvin, std::span<const glm::dvec3> sky_rays,
               SolvedImage& image);
};

Result<SceneSolver> SceneSolver::create(const scene::ScenarioDesc& scenario,
                                        const scene::SceneGeometry& geometry,
                                        const SolveOptions& options, std::int64_t end_ns) {
  if (options.rays == 0 || !(options.refine > 0.0) || !(options.tolerance_k > 0.0) ||
      !(options.spin_up_s >= 0.0)) {
    return make_error(ErrorCode::invalid_argument,
                      "solve: rays, refinement and tolerance must be positive, the spin-up must "
                      "not be negative");
  }
  if (end_ns < scenario.thermal.history_start_ns) {
    return make_error(ErrorCode::invalid_argument,
                      "solve: the time asked for lies before the start of the thermal history");
  }
  auto data = std::make_unique<Data>();
  data->scenario = scenario;
  data->geometry = geometry;
  data->options = options;
  data->end_ns = end_ns;
  bool three = false;
  if (auto chosen = data->choose_dimension(three); !chosen) {
    return tl::unexpected(std::move(chosen.error()));
  }
  data->lengthen_history(three);
  // Prepare rays, climate and bands, which every run needs.
  auto rays = RayScene::create(ray_scene_desc(scenario, geometry));
  if (!rays) return tl::unexpected(std::move(rays.error()));
  data->rays.emplace(std::move(*rays));
  ClimateOptions climate_options;
  climate_options.end_ns = std::max(end_ns, scenario.thermal.history_start_ns + 1);
  if (!three) climate_options.fine_from_ns = data->fine_from_ns();
  auto climate = SurfaceClimate::create(data->scenario, climate_options);
  if (!climate) return tl::unexpected(std::move(climate.error()));
  data->climate.emplace(std::move(*climate));
  for (std::string& note : weather_limits(data->scenario, geometry, data->climate->nodes())) {
    data->notes.push_back(std::move(note));
  }
  for (std::size_t band = 0; band < scenario.bands.size(); ++band) {
    auto made = BandRadiance::create(scenario, band);
    if (!made) return tl::unexpected(std::move(made.error()));
    data->bands.push_back(std::move(*made));
  }
  if (three) {
    // Begin each material at the mean of an open, level face in its balance.
    for (scene::Material& material : data->geometry.materials) {
      if (data->climate->stated_start_k(material, 0.0)) continue;
      const auto mesh = material_mesh(material);
      if (!mesh) return tl::unexpected(mesh.error());
      material.initial_k = PointSolver(*data->climate, *mesh, material, scenario.thermal.initial_k)
                               .balanced_mean_k({0.0, 0.0, 1.0});
    }
    data->start.emplace(data->rays->at(scenario.thermal.history_start_ns));
    auto solid = SolidHistory::create(data->scenario, data->geometry, *data->start, *data->climate,
                                      data->options, static_cast<double>(end_ns) * 1e-9);
    if (!solid) return tl::unexpected(std::move(solid.error()));
    data->solid = std::move(*solid);
    data->print = fingerprint(data->scenario, geometry, options, end_ns);
  }
  return SceneSolver(std::move(data));
}

/// Decides on the number of dimensions, and says why. Errors: the keys of the scenario contradict
/// the number that was asked for.
Result<void> SceneSolver::Data::choose_dimension(bool& three) {
  const auto fits = VoxelModel::fits(scenario, geometry);
  switch (options.dimension) {
    case SolveDimension::three:
      reason = "asked for";
      three = true;
      break;
    case SolveDimension::one:
      reason = "asked for";
      three = false;
      break;
    case SolveDimension::automatic:
      three = fits.has_value() && scenario.thermal.lateral;
      reason = three  ? "every face lies across an axis of the world, all bodies are closed or "
                        "sheets, and nothing moves"
               : fits ? "thermal.lateral = false asks for no conduction along surfaces"
                      : fits.error().text;
      break;
  }
  if (three && !scenario.thermal.lateral) {
    return make_error(ErrorCode::config,
                      "solve: thermal.lateral = false contradicts a solution in three dimensions, "
                      "which conducts along surfaces; ask for one dimension");
  }
  note_simpler_physics(three);
  if (three) return {};
  // Name the keys that one dimension cannot follow.
  const bool moving = std::ranges::any_of(
      geometry.instances, [](const scene::Instance& instance) { return instance.entity_id != 0; });
  if (scenario.thermal.exchange && moving) {
    notes.emplace_back(
        "in one dimension thermal.exchange leaves out objects while they move: what they send "
        "counts as surroundings of environment temperature");
  }
  if (!scenario.contacts.empty()) {
    notes.emplace_back("in one dimension [[contact]] has no effect: no body conducts to another");
  }
  return {};
}

/// Names what the solution does not follow: gloss, parts that heat themselves, and in three
/// dimensions the air past moving or shaped objects and the interiors of bodies.
void SceneSolver::Data::note_simpler_physics(bool three) {
  for (const scene::Material& material : geometry.materials) {
    if (!material.gloss) continue;
    notes.push_back(fmt::format(
        "material '{}' is glossy, but its radiance here is emitted and reflected evenly to all "
        "sides, with the emissivities that it states",
        material.name));
  }
  for (const scene::Material& material : geometry.materials) {
    if (!three || !material.rests_on_body()) continue;
    notes.push_back(
        fmt::format("material '{}' rests on the interior of its body, which is held at {:.1f} K "
                    "here",
                    material.name, material.base_k));
  }
  for (const scene::ObjectDesc& object : scenario.objects) {
    const bool moves = object.trajectory.size() > 1;
    if (three && (moves || object.air_film.shape != physics::AirFilmShape::surface)) {
      notes.push_back(fmt::format(
          "object '{}': its film is that of scenery in the wind, without its own speed{}",
          object.name, moves ? "" : " and 'air_film'"));
    }
    if (object.parts.empty()) continue;
    notes.push_back(fmt::format(
        "object '{}': [[object.parts]] has no effect, no part heats itself here", object.name));
  }
}

/// Names what is moist and frozen, or snow that should melt, once for each material.
void SceneSolver::Data::note_temperatures(std::span<const PixelHit> hits,
                                          std::span<const double> kelvin,
                                          std::int64_t sim_time_ns) {
  std::vector<SolvedPlace> places;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    places.push_back({hits[i].point.material, kelvin[i]});
  }
  for (std::string& note : temperature_limits(scenario, geometry, places, sim_time_ns)) {
    // The text up to the second quote has the limit and the material.
    const std::string begin = note.substr(0, note.find('\'', note.find('\'') + 1) + 1);
    if (std::ranges::any_of(notes,
                            [&](const std::string& told) { return told.starts_with(begin); }))
      continue;
    notes.push_back(std::move(note));
  }
}

/// Lets the history begin earlier than the scenario's. Three dimensions take the time before it on
/// a coarse grid, one dimension in longer steps.
void SceneSolver::Data::lengthen_history(bool three) {
  scene::ThermalOptions& thermal = scenario.thermal;
  if (thermal.spin_up_ns <= 0) return;
  // Three dimensions take all but the last day on the coarse grid and in longer steps.
  const std::int64_t fine_ns =
      three ? std::max(thermal.history_start_ns, std::min(options.first_ns, end_ns) - kFineNs)
            : thermal.history_start_ns;
  const std::int64_t shift_ns = fine_ns - thermal.history_start_ns;
  thermal.history_start_ns = fine_ns;
  thermal.spin_up_ns =
      std::max<std::int64_t>(thermal.spin_up_ns + shift_ns, std::llround(options.spin_up_s * 1e9));
  spin_up_s = static_cast<double>(thermal.spin_up_ns) / 1e9;
  if (three) return;
  thermal.history_start_ns -= thermal.spin_up_ns;
  thermal.spin_up_ns = 0;
}

SceneSolver::SceneSolver(std::unique_ptr<Data> data) : data_(std::move(data)) {}
SceneSolver::~SceneSolver() = default;
SceneSolver::SceneSolver(SceneSolver&&) noexcept = default;
SceneSolver& SceneSolver::operator=(SceneSolver&&) noexcept = default;

/// Starts from the checkpoint, else through the spin-up.
Result<void> SceneSolver::Data::start_solid() {
  if (started) return {};
  if (!options.checkpoint.empty()) {
    auto saved = load_checkpoint(checkpoint_file(scenario, options), print);
    if (!saved) return tl::unexpected(std::move(saved.error()));
    if (*saved) {
      auto restored = solid->restore((*saved)->state, (*saved)->spin_up);
      if (!restored) return restored;
      resumed = true;
      started = true;
      return {};
    }
  }
  auto done = solid->spin_up();
  started = done.has_value();
  return done;
}

Result<void> SceneSolver::advance_to(std::int64_t sim_time_ns) {
  Data& d = *data_;
  if (sim_time_ns > d.end_ns) {
    return make_error(ErrorCode::invalid_argument, "solve: later than the end that was announced");
  }
  if (!d.solid || d.stopped) return {};
  if (auto ready = d.start_solid(); !ready) return ready;
  const double to_s = static_cast<double>(sim_time_ns) * 1e-9;
  const double start_s = static_cast<double>(d.climate->history_start_ns()) * 1e-9;
  const double whole_s = std::max(1e-9, static_cast<double>(d.end_ns) * 1e-9 - start_s);
  if (d.solid->solver().time_s() > to_s) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("solve: the run has reached {} s, {} s is in its past{}",
                                  d.solid->solver().time_s(), to_s,
                                  d.resumed ? " (remove the checkpoint to start anew)" : ""));
  }
  // Save the state every few steps and at the end.
  Result<void> saved;
  const auto save = [&] {
    if (d.options.checkpoint.empty()) return;
    saved = save_checkpoint(checkpoint_file(d.scenario, d.options), d.print,
                            d.solid->solver().state(), d.solid->spin_up_stats());
  };
  // Advance and report the progress after every step.
  const auto done = d.solid->advance(to_s, [&](double time_s) {
    const std::uint64_t steps = d.solid->solver().stats().steps;
    if (d.options.checkpoint_steps > 0 && steps % d.options.checkpoint_steps == 0) save();
    d.stopped = d.options.progress && !d.options.progress((time_s - start_s) / whole_s);
    return !d.stopped && saved.has_value();
  });
  if (!done) return done;
  save();
  return saved;
}

/// Finds the first hit of every pixel and chooses the pixels to solve. Fills depth, objects and the
/// rays of the sky.
Result<std::vector<PixelHit>> SceneSolver::Data::see(const SolveView& view, SolvedImage& image,
                                                     std::vector<glm::dvec3>& sky_rays) const {
  if (view.width_px == 0 || view.height_px == 0 || !(view.fov_h_rad > 0.0)) {
    return make_error(ErrorCode::invalid_argument, "solve: the camera has no pixels or no view");
  }
  // Start with an image of sky.
  const std::size_t pixels = std::size_t{view.width_px} * view.height_px;
  image.width_px = view.width_px;
  image.height_px = view.height_px;
  image.temperature_k.assign(pixels, kNan);
  image.depth_m.assign(pixels, std::numeric_limits<float>::infinity());
  image.object_id.assign(pixels, 0.0F);
  image.radiance_w_m2_sr.assign(bands.size(), std::vector<float>(pixels, kNan));
  sky_rays.assign(pixels, glm::dvec3(0.0));
  // Prepare the camera: rays go through the centres of the pixels.
  const double focal_px = 0.5 * view.width_px / std::tan(0.5 * view.fov_h_rad);
  const glm::dmat3 world_from_sensor = glm::mat3_cast(view.sensor_pose.world_from_body) *
                                       glm::transpose(physics::sensor_from_body());
  const SceneInstant instant = rays->at(view.sim_time_ns);
  std::vector<std::optional<PixelHit>> found(pixels);
  threads::parallel_indices(std::uint32_t{0}, view.height_px, [&](std::uint32_t y) {
    for (std::uint32_t x = 0; x < view.width_px; ++x) {
      const glm::dvec3 sensor_ray((x + 0.5 - 0.5 * view.width_px) / focal_px,
                                  (y + 0.5 - 0.5 * view.height_px) / focal_px, 1.0);
      const glm::dvec3 direction = world_from_sensor * glm::normalize(sensor_ray);
      const std::uint32_t pixel = y * view.width_px + x;
      const auto hit = instant.first_hit({view.sensor_pose.position_world_m, direction, 0.0});
      if (!hit) {
        sky_rays[pixel] = direction;
        continue;
      }
      PixelHit p;
      p.pixel = pixel;
      p.direction = direction;
      p.range_m = hit->distance_m;
      glm::dvec3 normal = solid ? hit->geometric_normal : hit->shading_normal;
      // Take the face's own normal if the interpolated one turns away from the side that is seen.
      if (glm::dot(normal, hit->geometric_normal) <= 0.0) normal = hit->geometric_normal;
      if (!hit->front) normal = -normal;
      p.point = {hit->position_world_m, normal, hit->material, hit->entity, hit->instance};
      found[pixel] = p;
      image.depth_m[pixel] = static_cast<float>(hit->distance_m / glm::length(sensor_ray));
      image.object_id[pixel] = static_cast<float>(hit->object + 1);
    }
  });
  // Keep the pixels that show a surface.
  std::vector<PixelHit> hits;
  for (auto& hit : found) {
    if (hit) hits.push_back(*hit);
  }
  image.surface_px = hits.size();
  choose(hits, options.pixels);
  return hits;
}

/// Computes the radiance of the solved pixels and of the sky, at the aperture.
void SceneSolver::Data::radiate(const SolveView& view, std::span<const PixelHit> hits,
                                std::span<const double> kelvin,
                                std::span<const glm::dvec3> sky_rays, SolvedImage& image) {
  const ClimateNode now = climate->at(view.sim_time_ns);
  const glm::dvec3 to_sun = glm::normalize(now.to_sun);
  const physics::GeoPlace place{physics::Radians(scenario.place.lat_rad),
                                physics::Radians(scenario.place.lon_rad),
                                physics::Metres(scenario.place.height_m)};
  const physics::SunPosition sun =
      physics::sun_position(scenario.epoch_utc_ns + view.sim_time_ns, place);
  const double cloud_frac = cloud_frac_at(scenario, view.sim_time_ns);
  const double ground_beam_frac = physics::beam_share_frac(
      now.direct_normal_w_m2, sun, place.height, scenario.clear_sky.linke_turbidity);
  const double dew_point_k = scenario.weather.empty()
                                 ? scenario.clear_sky.dew_point_k
                                 : physics::usual_dew_point_k(scene::mean_air_k(scenario));
  // Find the sun and the sky above the fog.
  double beam_frac = ground_beam_frac;
  double longwave_w_m2 = now.longwave_down_w_m2;
  if (scenario.atmosphere.fog) {
    const physics::FogShade fog = physics::fog_shade(*scenario.atmosphere.fog);
    if (sun.direction_enu.z > 0.0) {
      beam_frac = physics::beam_above_fog_frac(fog, ground_beam_frac, sun.direction_enu.z,
                                               1.0 - cloud_frac);
    }
    longwave_w_m2 = physics::longwave_above_fog_w_m2(
        fog, longwave_w_m2, now.air_k,
        physics::sky_longwave_w_m2(physics::Kelvin(now.air_k), physics::Kelvin(dew_point_k), 0.0));
  }
  const double fog_beam_frac = beam_frac > 0.0 ? ground_beam_frac / beam_frac : 1.0;
  const physics::SkyState sky_now =
      scenario.clouds
          ? covered_sky_by_bisection(longwave_w_m2, now.air_k, dew_point_k,
                                     scenario.clouds->cover_frac, scenario.clear_sky.cloud_base)
          : sky_by_bisection(longwave_w_m2, now.air_k, dew_point_k, cloud_frac,
                             scenario.clear_sky.cloud_base);
  const CloudSun* const clouds = climate->clouds();
  const double sensor_m = view.sensor_pose.position_world_m.z;
  // Above the clouds the sun is that of a clear sky.
  const double taken_frac =
      scenario.clouds ? (1.0 - scenario.clouds->transmission_frac) * scenario.clouds->cover_frac
                      : cloud_frac;
  const double beam_above_frac = taken_frac < 1.0 ? beam_frac / (1.0 - taken_frac) : beam_frac;
  const SkyDiscs discs{sun, physics::moon_position(scenario.epoch_utc_ns + view.sim_time_ns, place),
                       sensor_m >= sky_now.cloud_base_m ? beam_above_frac : beam_frac, &*climate,
                       now};
  std::vector<double> face_k;
  if (solid) {
    face_k.resize(solid->solver().faces().size());
    for (std::size_t f = 0; f < face_k.size(); ++f) face_k[f] = solid->solver().face_k(f);
  }
  for (std::size_t b = 0; b < bands.size(); ++b) {
    BandRadiance& band = bands[b];
    band.set_air(now.air_k, sun, beam_frac, beam_above_frac, sky_now,
                 {fog_beam_frac, now.surroundings_k});
    // Compute the radiance that every patch sends out.
    const double around = band.black(now.surroundings_k);
    const double level_sky = band.sky_mean(1.0);  // patches hold faces of several tilts
    std::vector<double> patch;
    if (solid) {
      // The radiance is the patch's emission, and the surroundings mirrored once.
      std::vector<double> leaving(face_k.size());
      threads::parallel_indices(std::size_t{0}, face_k.size(), [&](std::size_t f) {
        const double e = band.emissivity(geometry.materials[solid->radiation().material_of(f)]);
        const double sky = solid->radiation().exchange().sky_frac(f);
        leaving[f] =
            e * band.black(face_k[f]) + (1.0 - e) * (sky * level_sky + (1.0 - sky) * around);
      });
      patch = solid->radiation().exchange().patch_means(leaving);
    } else {
      for (std::size_t p = 0; p < points.patches.size(); ++p) {
        const double e = band.emissivity(geometry.materials[points.patch_material[p]]);
        const PatchState& state = points.patches[p];
        patch.push_back(e * band.black(state.temperature_k) +
                        (1.0 - e) * (state.sky_frac * level_sky + (1.0 - state.sky_frac) * around));
      }
    }
    std::vector<float>& plane = image.radiance_w_m2_sr[b];
    threads::parallel_indices(std::size_t{0}, hits.size(), [&](std::size_t i) {
      const PixelHit& hit = hits[i];
      const double e = band.emissivity(geometry.materials[hit.point.material]);
      // Sum what arrives at the surface: sky, surroundings, sun and patches.
      double incoming = hit.sky_frac * band.sky_mean(hit.point.normal.z) + hit.ground_frac * around;
      const double sunlight = band.sun_w_m2() / physics::kPi * hit.sun_frac *
                              std::max(0.0, glm::dot(hit.point.normal, to_sun));
      if (solid) {
        for (const SceneExchange::Link& link : solid->radiation().links(hit.face)) {
          incoming += static_cast<double>(link.share_frac) * patch[link.patch];
        }
      } else {
        for (const SightLink& link : points.sights[i].now()) {
          incoming += link.share_frac * patch[link.patch];
        }
        for (const PartLink& link : points.sights[i].parts_now()) {
          const scene::Material& part = geometry.materials[link.material];
          incoming += link.share_frac * band.emissivity(part) * band.black(*part.prescribed_k);
        }
      }
      // Add emission and reflection, then pass the air to the camera.
      const BandRadiance::Leaving leaving{e * band.black(kelvin[i]) + (1.0 - e) * incoming,
                                          (1.0 - e) * sunlight, kelvin[i]};
      plane[hit.pixel] =
          static_cast<float>(band.at_aperture(leaving, sensor_m, hit.range_m, hit.direction));
    });
    // Fill the pixels of the sky.
    if (clouds != nullptr) band.part_clouds();
    for (std::size_t p = 0; p < sky_rays.size(); ++p) {
      if (sky_rays[p] == glm::dvec3(0.0)) continue;
      double sky = band.sky(sensor_m, sky_rays[p]);
      if (clouds != nullptr) {
        const double opacity =
            clouds->opacity_frac(view.sensor_pose.position_world_m, sky_rays[p], view.sim_time_ns);
        sky = std::lerp(sky, band.cloud(sensor_m, sky_rays[p].z), opacity);
      }
      sky = band.through_fog(sky, sensor_m, sky_rays[p]);
      plane[p] = static_cast<float>(sky + discs.radiance_w_m2_sr(band, view, p));
    }
  }
}

/// Checks that the solution stands at an instant, or can be computed there.
Result<void> SceneSolver::Data::check_instant(std::int64_t sim_time_ns) const {
  if (sim_time_ns > end_ns || sim_time_ns < climate->history_start_ns()) {
    return make_error(ErrorCode::invalid_argument, "solve: the picture lies outside the history");
  }
  if (solid &&
      std::abs(solid->solver().time_s() - static_cast<double>(sim_time_ns) * 1e-9) > 1e-6) {
    return make_error(ErrorCode::invalid_argument,
                      "solve: the history does not stand at the picture's instant");
  }
  return {};
}

/// Computes the temperatures of hits. In three dimensions it drops the hits on no face of the model
/// and completes the others by face and views; in one it solves a history for each.
Result<std::vector<double>> SceneSolver::Data::temperatures(std::vector<PixelHit>& hits,
                                                            std::int64_t sim_time_ns) {
  if (solid) {
    const SolidRadiation& radiation = solid->radiation();
    std::vector<PixelHit> on_model;
    std::vector<double> their_k;
    for (PixelHit& hit : hits) {
      const auto face = radiation.finder().find(hit.point.position_world_m, hit.point.normal);
      if (!face) continue;
      hit.face = *face;
      hit.sky_frac = radiation.exchange().sky_frac(*face);
      hit.ground_frac = radiation.surroundings_frac(*face);
      on_model.push_back(hit);
      their_k.push_back(solid->solver().face_k_at(*face, hit.point.position_world_m));
    }
    hits.swap(on_model);
    return their_k;
  }
  const PointHistories histories(scenario, geometry, *rays, *climate, options.rays, fine_from_ns());
  std::vector<SolvePoint> places;
  for (const PixelHit& hit : hits) places.push_back(hit.point);
  auto solved = histories.temperatures(places, sim_time_ns, [&](double share) {
    stopped = options.progress && !options.progress(share);
    return !stopped;
  });
  if (!solved) return tl::unexpected(std::move(solved.error()));
  points = std::move(*solved);
  interior_left_k = std::max(interior_left_k, points.interior_left_k);
  return points.kelvin;
}

Result<SolvedImage> SceneSolver::image(const SolveView& view) {
  Data& d = *data_;
  SolvedImage image;
  if (auto good = d.check_instant(view.sim_time_ns); !good) {
    return tl::unexpected(std::move(good.error()));
  }
  // Find what the pixels show.
  std::vector<glm::dvec3> sky_rays;
  auto seen = d.see(view, image, sky_rays);
  if (!seen) return tl::unexpected(std::move(seen.error()));
  std::vector<PixelHit>& hits = *seen;
  const SceneInstant instant = d.rays->at(view.sim_time_ns);
  const ClimateNode now = d.climate->at(view.sim_time_ns);
  const glm::dvec3 to_sun = glm::normalize(now.to_sun);
  const auto solved = d.temperatures(hits, view.sim_time_ns);
  if (!solved) return tl::unexpected(solved.error());
  const std::vector<double>& kelvin = *solved;
  if (!d.solid) {
    // Trace the view of the sky of every pixel.
    threads::parallel_indices(std::size_t{0}, hits.size(), [&](std::size_t i) {
      hits[i].sky_frac = instant
                             .sky_view({hits[i].point.position_world_m, hits[i].point.normal, 1e-9},
                                       d.options.rays)
                             .sky_cosine.value_frac;
      double known_frac = hits[i].sky_frac;
      for (const SightLink& link : d.points.sights[i].now()) known_frac += link.share_frac;
      for (const PartLink& link : d.points.sights[i].parts_now()) known_frac += link.share_frac;
      hits[i].ground_frac = std::max(0.0, 1.0 - known_frac);
    });
  }
  if (now.direct_normal_w_m2 > 0.0) {
    // Integrate the sun's disc of every pixel.
    threads::parallel_indices(std::size_t{0}, hits.size(), [&](std::size_t i) {
      hits[i].sun_frac =
          instant
              .sun_visible_frac_clipped(
                  {hits[i].point.position_world_m, hits[i].point.normal, 1e-9}, to_sun)
              .value_frac *
          d.climate->cloud_sun(now, hits[i].point.position_world_m);
    });
  }
  d.note_temperatures(hits, kelvin, view.sim_time_ns);
  // Write the temperatures and the radiance.
  for (std::size_t i = 0; i < hits.size(); ++i) {
    image.temperature_k[hits[i].pixel] = static_cast<float>(kelvin[i]);
    if (std::isfinite(kelvin[i])) ++image.solved_px;
  }
  d.radiate(view, hits, kelvin, sky_rays, image);
  return image;
}

/// Finds the surface that a probe stands for, by rays that come in from around it.
std::optional<PixelHit> SceneSolver::Data::surface_at(const SceneInstant& instant,
                                                      const SolveProbe& probe,
                                                      ProbedPoint& out) const {
  const auto hit =
      nearest_surface(instant, probe.position_m, probe.normal, [&](const RayHit& candidate) {
        return probe.object.empty() || scenario.objects[candidate.object].name == probe.object;
      });
  if (!hit) return std::nullopt;
  glm::dvec3 normal = solid ? hit->geometric_normal : hit->shading_normal;
  if (glm::dot(normal, hit->geometric_normal) <= 0.0) normal = hit->geometric_normal;
  if (!hit->front) normal = -normal;
  out.position_m = hit->position_world_m;
  out.normal = normal;
  out.object = hit->object;
  PixelHit p;
  p.point = {hit->position_world_m, normal, hit->material, hit->entity, hit->instance};
  return p;
}

Result<std::vector<ProbedPoint>> SceneSolver::probe(std::span<const SolveProbe> probes,
                                                    std::int64_t sim_time_ns) {
  Data& d = *data_;
  if (auto good = d.check_instant(sim_time_ns); !good) {
    return tl::unexpected(std::move(good.error()));
  }
  const SceneInstant instant = d.rays->at(sim_time_ns);
  std::vector<ProbedPoint> points(probes.size());
  std::vector<PixelHit> hits;
  for (std::size_t i = 0; i < probes.size(); ++i) {
    auto hit = d.surface_at(instant, probes[i], points[i]);
    if (!hit) continue;
    hit->pixel = static_cast<std::uint32_t>(i);
    hits.push_back(*hit);
  }
  const auto kelvin = d.temperatures(hits, sim_time_ns);
  if (!kelvin) return tl::unexpected(kelvin.error());
  for (std::size_t i = 0; i < hits.size(); ++i) points[hits[i].pixel].temperature_k = (*kelvin)[i];
  d.note_temperatures(hits, *kelvin, sim_time_ns);
  return points;
}

SolveReport SceneSolver::report() const {
  const Data& d = *data_;
  SolveReport report;
  report.notes = d.notes;
  constexpr double kToldK = 0.01;
  if (d.interior_left_k > kToldK) {
    report.notes.push_back(fmt::format(
        "the interiors of bodies still changed by {:.2f} K in the last round", d.interior_left_k));
  }
  report.reason = d.reason;
  report.spin_up_s = d.spin_up_s;
  report.resumed = d.resumed;
  if (d.solid) {
    report.dimension = 3;
    report.nodes = d.solid->solver().free_nodes();
    report.faces = d.solid->solver().faces().size();
    report.patches = d.solid->radiation().exchange().patches();
    report.stats = d.solid->solver().stats();
    report.spin_up = d.solid->spin_up_stats();
  }
  return report;
}

std::span<const double> SceneSolver::node_k() const noexcept {
  return data_->solid ? data_->solid->solver().node_k() : std::span<const double>();
}

bool SceneSolver::stopped() const noexcept {
  return data_->stopped;
}

Result<std::vector<SolvedImage>> solve(const scene::ScenarioDesc& scenario,
                                       const scene::SceneGeometry& geometry,
                                       std::span<const SolveView> views,
                                       const SolveOptions& options, SolveReport* report) {
  // Solve the views in the order of time.
  std::vector<std::size_t> order(views.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return views[a].sim_time_ns < views[b].sim_time_ns;
  });
  std::vector<SolvedImage> images(views.size());
  if (views.empty()) return images;
  SolveOptions with_first = options;
  with_first.first_ns = views[order.front()].sim_time_ns;
  auto solver =
      SceneSolver::create(scenario, geometry, with_first, views[order.back()].sim_time_ns);
  if (!solver) return tl::unexpected(std::move(solver.error()));
  for (const std::size_t i : order) {
    if (auto reached = solver->advance_to(views[i].sim_time_ns); !reached) {
      return tl::unexpected(std::move(reached.error()));
    }
    if (solver->stopped()) break;
    auto image = solver->image(views[i]);
    if (!image) return tl::unexpected(std::move(image.error()));
    images[i] = std::move(*image);
  }
  if (report != nullptr) *report = solver->report();
  return images;
}

}  // namespace emit::reference
