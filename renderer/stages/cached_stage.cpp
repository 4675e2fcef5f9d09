// SPDX-License-Identifier: Apache-2.0
#include "stages/cached_stage.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "emit/scene/simplify.hpp"
#include "history/foster_setup.hpp"
#include "surface/rays/coarse_geometry.hpp"

namespace emit::renderer {
namespace {

/// A position of the camera stands for positions around it up to this share of its distance from
/// the scene.
constexpr double kReachFrac = 0.05;
/// Number of positions along a known trajectory of the camera that the refinement uses.
constexpr std::size_t kEyes = 16;
/// Number of intervals between positions of the sun that show which surfaces it reaches.
constexpr std::size_t kSuns = 16;
constexpr std::int64_t kDayNs = 86'400'000'000'000;
/// Share of the field of view by which the camera may point away from its planned direction.
constexpr double kFieldMarginFrac = 0.5;
/// The camera may point anywhere.
constexpr double kAnyCosine = -2.0;

static_assert(kTwinSd == EMIT_CLUTTER_TWIN_SD);

/// Angle of one pixel at the boresight, with the narrowest field of view.
double pixel_rad(const scene::SensorDesc& sensor) {
  return 2.0 * std::tan(0.5 * sensor.narrowest_fov_rad()) / sensor.width_px;
}

/// Angle between the boresight and a corner of the image.
double half_diagonal_rad(const scene::SensorDesc& sensor) {
  const double corner_px = std::hypot(sensor.width_px, sensor.height_px);
  return std::atan(std::tan(0.5 * sensor.fov_h_rad) * corner_px / sensor.width_px);
}

/// Position and boresight of a camera.
RefineView::Eye eye_of(const physics::Pose& pose) {
  return {pose.position_world_m, pose.world_from_body * glm::dvec3(1.0, 0.0, 0.0)};
}

/// Positions of the camera along the whole trajectory of the scenario.
std::vector<RefineView::Eye> all_eyes(const scene::Trajectory& keys) {
  std::vector<RefineView::Eye> eyes;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    eyes.push_back(eye_of(keys[i].pose));
    if (i + 1 == keys.size()) break;
    if (keys[i + 1].teleport) continue;  // the camera stays until it jumps
    // Add positions between this key and the next.
    const std::int64_t length_ns = keys[i + 1].sim_time_ns - keys[i].sim_time_ns;
    for (std::size_t part = 1; part < kEyes; ++part) {
      const auto way = static_cast<double>(length_ns) * static_cast<double>(part) / kEyes;
      eyes.push_back(eye_of(trajectory_at(keys, keys[i].sim_time_ns + std::llround(way)).pose));
    }
  }
  return eyes;
}

/// View that the surface is refined for: the camera of the request and its positions along the rest
/// of the trajectory.
RefineView refine_view(const scene::SensorDesc& sensor, const FrameRequest& request) {
  RefineView view;
  view.pixel_rad = pixel_rad(sensor);
  view.field_rad = (1.0 + kFieldMarginFrac) * half_diagonal_rad(sensor);
  // Start with the camera of the request.
  view.eyes.push_back(eye_of(request.sensor_pose));
  const scene::Trajectory& keys = sensor.trajectory;
  if (keys.size() < 2) return view;
  // Add the positions that the camera jumps to, and positions along the rest of the trajectory.
  for (const scene::Keyframe& key : keys) {
    if (key.teleport && key.sim_time_ns > request.sim_time_ns)
      view.eyes.push_back(eye_of(key.pose));
  }
  const std::int64_t end_ns = keys[keys.size() - 1].sim_time_ns;
  for (std::size_t i = 1; i <= kEyes && request.sim_time_ns < end_ns; ++i) {
    const auto way = static_cast<double>(end_ns - request.sim_time_ns) * static_cast<double>(i);
    const std::int64_t at_ns = request.sim_time_ns + std::llround(way / kEyes);
    view.eyes.push_back(eye_of(trajectory_at(keys, at_ns).pose));
  }
  return view;
}

/// Directions to the sun over the last day of history and camera trajectory, from the start of the
/// history on, or over a day when the camera has no trajectory. Instants without sun are left out.
std::vector<glm::vec3> suns(const scene::ScenarioDesc& scenario, const Environment& environment) {
  const std::int64_t start_ns = scenario.thermal.history_start_ns;
  const scene::Trajectory& keys = scenario.sensor.trajectory;
  const std::int64_t end_ns =
      keys.size() < 2 ? start_ns + kDayNs : keys[keys.size() - 1].sim_time_ns;
  const std::int64_t begin_ns = std::max(start_ns, end_ns - kDayNs);
  std::vector<glm::vec3> out;
  for (std::size_t i = 0; i <= kSuns; ++i) {
    const auto way = static_cast<double>(end_ns - begin_ns) * static_cast<double>(i) / kSuns;
    const physics::SunPosition sun = environment.sun_at(begin_ns + std::llround(way));
    if (sun.elevation.value() > StepPlan::kMinSunElevationRad) out.emplace_back(sun.direction_enu);
  }
  return out;
}

}  // namespace

std::vector<CachedStage::Eye> CachedStage::eyes_around(std::span<const RefineView::Eye> eyes,
                                                       const scene::Aabb& static_bounds) {
  std::vector<Eye> out;
  for (std::size_t i = 0; i < eyes.size(); ++i) {
    // Reach as far as the next position, so that the way between them is covered.
    const double way_m =
        i + 1 < eyes.size() ? glm::distance(eyes[i].world_m, eyes[i + 1].world_m) : 0.0;
    const double around_m = kReachFrac * scene::distance_m(static_bounds, eyes[i].world_m);
    out.push_back({eyes[i], std::max(way_m, around_m)});
  }
  return out;
}

physics::Result<std::unique_ptr<ThermalStage>> CachedStage::create(
    const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
    std::vector<FosterMaterial> foster_materials, const SceneHistory& history,
    const BandLights& lights, std::span<const DrawnClutter> clutter, bool software) {
  // Collect the positions that the scenario's camera takes.
  const std::vector<RefineView::Eye> eyes = all_eyes(scenario.sensor.trajectory);
  std::vector<glm::dvec3> eyes_world_m;
  for (const RefineView::Eye& eye : eyes) eyes_world_m.push_back(eye.world_m);
  const scene::Aabb bounds = geometry.static_bounds;
  // Describe the state file. Its key is made before the meshes are simplified.
  std::optional<SavedSurface> saved;
  if (!scenario.thermal.state_file.empty()) {
    saved = {scenario.thermal.state_file, scenario_key(scenario, geometry), true};
  }
  // Simplify the meshes as far as no position of the camera shows it.
  const scene::DetailView view{eyes_world_m, pixel_rad(scenario.sensor)};
  geometry = scene::separated(std::move(geometry), view);
  auto coarse = coarse_geometry(std::move(geometry), view, suns(scenario, history.environment),
                                scenario.thermal.max_samples);
  if (!coarse) return tl::unexpected(std::move(coarse.error()));
  // Create the surface. The last material is that of the surroundings and has no samples.
  const std::size_t simulated = foster_materials.empty() ? 0 : foster_materials.size() - 1;
  auto surface =
      CachedSurface::create(scenario, std::move(coarse->geometry), histories_of_objects(scenario),
                            std::span(foster_materials).first(simulated), physics::kReferenceK,
                            std::move(coarse->detail));
  if (!surface) return tl::unexpected(std::move(surface.error()));
  // Compile the shade of entities if the scenario has entities.
  std::optional<ShadePass> shade_pass;
  if (!history.entities.empty()) {
    auto pass = ShadePass::create(history.entities.size(), software);
    if (!pass) return tl::unexpected(std::move(pass.error()));
    shade_pass = std::move(*pass);
  }
  return std::unique_ptr<ThermalStage>(new CachedStage(
      scenario, bounds, eyes_around(eyes, bounds), std::move(*surface), std::move(foster_materials),
      history, sees_in_band(scenario.thermal) ? &lights : nullptr, clutter, std::move(saved),
      coarse->visibly, std::move(shade_pass), software));
}

CachedStage::CachedStage(const scene::ScenarioDesc& scenario, const scene::Aabb& static_bounds,
                         std::vector<Eye> detail_eyes, std::unique_ptr<CachedSurface> surface,
                         std::vector<FosterMaterial> foster_materials, const SceneHistory& history,
                         const BandLights* lights, std::span<const DrawnClutter> clutter,
                         std::optional<SavedSurface> saved, bool visibly_simplified,
                         std::optional<ShadePass> shade_pass, bool software)
    : sensor_(scenario.sensor),
      max_samples_(scenario.thermal.max_samples),
      software_(software),
      static_bounds_(static_bounds),
      detail_eyes_(std::move(detail_eyes)),
      visibly_simplified_(visibly_simplified),
      history_of_object_(histories_of_objects(scenario)),
      history_(history),
      lights_(lights),
      clutter_(clutter.begin(), clutter.end()),
      plan_(scenario.thermal),
      surface_history_(scenario.thermal.steps,
                       make_foster(scenario, std::move(foster_materials), history.environment,
                                   physics::kReferenceK, DryGrounds::followed, StartNodes::asked)),
      surface_(std::move(surface)),
      saved_(std::move(saved)),
      shade_pass_(std::move(shade_pass)) {}

physics::Result<void> CachedStage::warm_up(const FrameRequest& request,
                                           const WarmUpProgress& progress) {
  // Sample the surface for the camera and integrate its history, or read the state file.
  const CachedSurface::Inputs inputs{history_.environment, history_.entities, history_.parts,
                                     lights_};
  RefineView view = refine_view(sensor_, request);
  for (const std::int64_t at_ns : planned_ns_) {
    const physics::SunPosition sun = history_.environment.sun_at(at_ns);
    if (at_ns > request.thermal_time_ns && sun.elevation.value() > StepPlan::kMinSunElevationRad) {
      view.coming_suns.push_back(sun.direction_enu);
    }
  }
  if (saved_) {
    const RefineView::Eye here = view.eyes.front();
    saved_->fits_camera = [this, here](std::span<const RefineView::Eye> eyes) {
      return stands_near(eyes_around(eyes, static_bounds_), here, kAnyCosine);
    };
  }
  auto ready = surface_->prepare(request.thermal_time_ns, view, inputs, plan_, surface_history_,
                                 saved_, progress);
  if (!ready) return ready;
  // Do not require the state file again: after a jump of sim time it need not fit.
  if (saved_) saved_->start = false;
  refined_eyes_ = eyes_around(surface_->model().eyes, static_bounds_);
  // Send the meshes to the device. Release the memory of the old ones first.
  drawn_.reset();
  drawn_ = std::make_unique<DrawnScene>(surface_->take_drawn_scene(), history_of_object_,
                                        surface_->anchors(), clutter_, software_);
  // Allocate the buffers of the samples.
  static_assert(sizeof(SampleVertex) == SceneVertexArrays::kNodeFloats * sizeof(float) &&
                offsetof(SampleVertex, bow_k) == sizeof(float) &&
                offsetof(SampleVertex, sun_frac) == 2 * sizeof(float));
  for (gl::Buffer& node : node_buffers_) {
    node = gl::Buffer::dynamic(surface_->vertices(0).size_bytes());
  }
  if (lights_ != nullptr) {
    for (gl::Buffer& node : seen_buffers_) {
      node =
          gl::Buffer::dynamic(surface_->model().drawn_samples * lights_->bands() * sizeof(float));
    }
  }
  if (shade_pass_) {
    shade_pass_->begin(surface_->exposure_tiles());
    shade_buffer_ = gl::Buffer::dynamic(surface_->exposure_tiles().vertices_k().size_bytes());
  }
  // Report a device that ran out of memory.
  if (glGetError() != GL_NO_ERROR) {
    return physics::make_error(physics::ErrorCode::gpu,
                               "the device cannot hold the samples of this scenario");
  }
  return {};
}

physics::Result<void> CachedStage::carry_on(const FrameRequest& to,
                                            const WarmUpProgress& progress) {
  return surface_->carry_on(to.thermal_time_ns,
                            {history_.environment, history_.entities, history_.parts, lights_},
                            surface_history_, progress);
}

DrawnScene& CachedStage::drawn() noexcept {
  EMIT_CHECK(drawn_ != nullptr);
  return *drawn_;
}

bool CachedStage::stands_near(const std::vector<Eye>& eyes, const RefineView::Eye& here,
                              double cos_at_least) noexcept {
  return std::ranges::any_of(eyes, [&](const Eye& each) {
    return glm::distance(each.eye.world_m, here.world_m) <= each.reach_m &&
           glm::dot(each.eye.boresight, here.boresight) >= cos_at_least;
  });
}

CoarseReasons CachedStage::coarse_from(const physics::Pose& camera) const noexcept {
  const RefineView::Eye here = eye_of(camera);
  // Compare the direction of the camera only if samples ran out. Then surfaces outside the planned
  // view got none.
  const double least_cos =
      surface_->model().full ? std::cos(kFieldMarginFrac * half_diagonal_rad(sensor_)) : kAnyCosine;
  // Check the flags of the surface, then the positions it was prepared for. Meshes were simplified
  // only if the scenario has positions of the camera.
  CoarseReasons out;
  add(out, CoarseReason::meshes, visibly_simplified_);
  add(out, CoarseReason::samples, surface_->model().full_in_view);
  add(out, CoarseReason::shade, surface_->exposure_tiles().short_of_tiles());
  add(out, CoarseReason::entity_shadows, surface_->entity_shadows().stale());
  add(out, CoarseReason::weather, surface_->lags());
  add(out, CoarseReason::edges, surface_->columns_cut_short());
  add(out, CoarseReason::camera,
      !stands_near(refined_eyes_, here, least_cos) ||
          (!detail_eyes_.empty() && !stands_near(detail_eyes_, here, kAnyCosine)));
  return out;
}

void CachedStage::describe(SceneStats& stats) const noexcept {
  // Twins of clutter stand at the places of others and do not count against the limit.
  const SurfaceSamples& samples = surface_->model().samples;
  stats.samples = samples.twinned.empty() ? samples.samples.size() : samples.first_twin;
  stats.sample_bytes = surface_->sample_bytes();
  stats.samples_full = surface_->model().full;
  stats.exchange_left_w_m2 = surface_->model().exchange_left_w_m2;
  stats.max_samples = max_samples_;
  stats.coarse_meshes = visibly_simplified_;
}

physics::Pose CachedStage::frame_of(const SurfaceSample& sample) const noexcept {
  if (sample.entity < 0) return {surface_->origin_world_m(), glm::dquat(1.0, 0.0, 0.0, 0.0)};
  return history_.entities[static_cast<std::size_t>(sample.entity)].at(drawn_ns_).pose;
}

std::optional<std::uint32_t> CachedStage::nearest_sample(const SurfacePlace& place) const noexcept {
  if (drawn_ == nullptr) return std::nullopt;
  const double same_way = std::cos(30.0 * physics::kDegree);
  const SurfaceModel& model = surface_->model();
  std::optional<std::uint32_t> nearest;
  double nearest_m = std::numeric_limits<double>::infinity();
  // Bring the place into the frame of the samples, which changes only between entities.
  std::int32_t entity = std::numeric_limits<std::int32_t>::min();
  glm::dvec3 position_m{0.0};
  glm::dvec3 normal{0.0};
  for (std::uint32_t i = 0; i < model.drawn_samples; ++i) {
    const SurfaceSample& sample = model.samples.samples[i];
    if (sample.entity != entity) {
      entity = sample.entity;
      const physics::Pose frame = frame_of(sample);
      const glm::dquat frame_from_world = glm::conjugate(frame.world_from_body);
      position_m = frame_from_world * (place.position_world_m - frame.position_world_m);
      normal = frame_from_world * place.normal;
    }
    if (glm::dot(glm::dvec3(sample.normal), normal) < same_way) continue;
    const double away_m = glm::distance(glm::dvec3(sample.position_m), position_m);
    if (away_m >= nearest_m) continue;
    nearest_m = away_m;
    nearest = i;
  }
  return nearest;
}

SampleReading CachedStage::sample_reading(std::uint32_t sample) const noexcept {
  EMIT_CHECK_OP(sample, <, surface_->model().drawn_samples);
  const SurfaceSample& each = surface_->model().samples.samples[sample];
  const SampleOutput output = surface_->output_now(sample);
  const physics::Pose frame = frame_of(each);
  return {frame.position_world_m + frame.world_from_body * glm::dvec3(each.position_m),
          physics::kReferenceK + static_cast<double>(output.offset_k),
          surface_->flux_now_w_m2(sample)};
}

void CachedStage::prepare(const FrameRequest& request, CameraSetup& camera,
                          gpu::FrameParams& frame) noexcept {
  const CachedSurface::Inputs inputs{history_.environment, history_.entities, history_.parts,
                                     lights_};
  // Advance the samples to the thermal instant.
  surface_->advance(request.thermal_time_ns, inputs, surface_history_);
  // Place the shadows of entities at their poses of the frame.
  if (shade_pass_) {
    surface_->place_shadows(request.sim_time_ns, request.thermal_time_ns, inputs);
    shade_pass_->prepare(*surface_, request.sensor_pose.position_world_m, camera, frame);
  }
  // Store the position between the two nodes, and sun and weather.
  drawn_ns_ = request.sim_time_ns;
  frame.node_frac = surface_->fraction();
  frame.node_bow = bow_shape(frame.node_frac);
  sun_now_ = history_.environment.sun_at(request.thermal_time_ns);
  forcing_now_ = history_.environment.forcing_at(request.thermal_time_ns, sun_now_);
  forcing_now_.environment_k = surface_->surroundings_now_k().value_or(forcing_now_.environment_k);
}

HeatLimits CachedStage::heat_limits(const FrameRequest& request) const noexcept {
  HeatLimits out = surface_->ground_now().limits.until(request.thermal_time_ns);
  const std::int64_t now_ns = request.thermal_time_ns;
  constexpr double kLeastMm = 0.05;
  if (!surface_history_.holds_water() ||
      history_.environment.rain_mm(now_ns - kLimitMemoryNs, now_ns) <= kLeastMm) {
    return out;
  }
  // The shelter from rain was found where entities stood at the warm-up. A way as long as a body or
  // a turn of 0.1 rad uncovers what it kept dry.
  constexpr double kHalfTurnCos = 0.99875;
  const std::vector<EntityAnchor>& anchors = surface_->anchors();
  for (std::size_t m = 0; m < anchors.size(); ++m) {
    const physics::Pose now = history_.entities[m].at(request.sim_time_ns).pose;
    const physics::Pose& then = anchors[m].pose;
    if (glm::distance(now.position_world_m, then.position_world_m) > anchors[m].radius_m ||
        std::abs(glm::dot(now.world_from_body, then.world_from_body)) < kHalfTurnCos) {
      add(out, HeatLimit::rain_shelter);
    }
  }
  return out;
}

void CachedStage::upload() noexcept {
  drawn_->upload();
  // Send the parts of the samples that changed.
  for (std::size_t node = 0; node < node_buffers_.size(); ++node) {
    const std::size_t storage = surface_->storage(node);
    for (const ChangedRanges::Range& range : surface_->changes(storage)) {
      node_buffers_[storage].upload(surface_->vertices(node).subspan(range.first, range.count),
                                    range.first);
    }
    if (lights_ == nullptr) continue;
    const std::size_t bands = lights_->bands();
    for (const ChangedRanges::Range& range : surface_->seen_changes(storage)) {
      seen_buffers_[storage].upload(
          surface_->seen_w_m2_sr(node).subspan(range.first * bands, range.count * bands),
          range.first * bands);
    }
  }
  // Send the shade of entities that changed.
  if (shade_pass_) {
    for (const ChangedRanges::Range& range : surface_->exposure_tiles().changes()) {
      shade_buffer_.upload(
          surface_->exposure_tiles().vertices_k().subspan(range.first, range.count), range.first);
    }
    shade_pass_->upload(*surface_);
  }
  surface_->forget_changes();
}

void CachedStage::draw(const glm::uvec2&, StageTimes& stages, StageClock& clock) noexcept {
  if (!shade_pass_) return;
  shade_pass_->dispatch();
  clock.mark(stages.thermal_ms);
}

void CachedStage::bind() const noexcept {
  drawn_->vertices.read_nodes(node_buffers_[surface_->storage(0)],
                              node_buffers_[surface_->storage(1)]);
  if (lights_ != nullptr) {
    drawn_->vertices.read_seen(seen_buffers_[surface_->storage(0)],
                               seen_buffers_[surface_->storage(1)],
                               static_cast<std::uint32_t>(lights_->bands()));
  }
  if (!clutter_.empty()) {
    // Read the sample itself where there are no twins: then nothing is added to its temperature.
    const std::size_t drawn = surface_->model().drawn_samples;
    const bool twins = surface_->vertices(0).size() > drawn;
    drawn_->vertices.read_twins(node_buffers_[surface_->storage(0)],
                                node_buffers_[surface_->storage(1)], twins ? drawn : 0);
  }
  if (shade_pass_) drawn_->vertices.read_shade(shade_buffer_);
}

}  // namespace emit::renderer
