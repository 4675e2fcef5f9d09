// SPDX-License-Identifier: Apache-2.0
#include "emit/renderer/renderer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <limits>
#include <optional>

#include "budget/ladder_survey.hpp"
#include "budget/quality_ladder.hpp"
#include "draw/image_window.hpp"
#include "draw/sky_bodies.hpp"
#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/limits.hpp"
#include "emit/physics/sky/moon.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/rain.hpp"
#include "emit/scene/sheets.hpp"
#include "gl/egl_context.hpp"
#include "heat_warnings.hpp"
#include "history/entity_air.hpp"
#include "history/first_frame_warnings.hpp"
#include "history/foster_setup.hpp"
#include "history/pose_history.hpp"
#include "passes/enlarge_pass.hpp"
#include "passes/gas_pass.hpp"
#include "passes/geometry_pass.hpp"
#include "passes/radiance_pass.hpp"
#include "passes/readback_ring.hpp"
#include "passes/target_pass.hpp"
#include "stages/band_model.hpp"
#include "stages/cached_stage.hpp"
#include "stages/cloud_layer.hpp"
#include "stages/clutter_fields.hpp"
#include "stages/foster_params.hpp"
#include "stages/frame_setup.hpp"
#include "stages/gas_model.hpp"
#include "stages/per_frame_stage.hpp"

namespace emit::renderer {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

namespace limits = physics::limits;
static_assert(EMIT_MAX_BANDS == limits::kMaxBands);
static_assert(EMIT_MAX_CASCADES == limits::kCascades.hi);
static_assert(EMIT_MAX_TAPS == limits::kShadowTaps.hi);
static_assert(EMIT_MAX_MODES == limits::kMaxRelaxationModes);
static_assert(EMIT_MAX_ATMOSPHERE_TERMS == limits::kMaxAtmosphereTerms);

/// Alignment of storage blocks. GL guarantees that no driver asks for more.
constexpr std::size_t kBlockAlignment = 256;
/// Largest number of planes: radiance of all bands, temperature, depth, object, sun, sky, what
/// arrives in all bands, material, coverage.
constexpr std::size_t kMaxPlanes = 2 * EMIT_MAX_BANDS + 15;

/// Checks the limits of the renderer. Errors: config, naming the value and the limit.
Result<void> check_limits(const scene::ScenarioDesc& scenario, const OutputOptions& output) {
  const scene::ThermalOptions& thermal = scenario.thermal;
  const auto fail = [](std::string text) { return make_error(ErrorCode::config, std::move(text)); };
  for (const scene::ObjectDesc& object : scenario.objects) {
    if (object.parts.empty() || (thermal.method == scene::ThermalMethod::cached &&
                                 thermal.model == scene::ThermalModel::foster)) {
      continue;
    }
    return fail(fmt::format(
        "object '{}' has parts: they need thermal.method = \"cached\" and thermal.model = "
        "\"foster\"",
        object.name));
  }
  if (!limits::kSensorPx.contains(scenario.sensor.width_px) ||
      !limits::kSensorPx.contains(scenario.sensor.height_px)) {
    return fail(fmt::format("sensor format {} x {}: {} to {} pixels are possible",
                            scenario.sensor.width_px, scenario.sensor.height_px,
                            limits::kSensorPx.lo, limits::kSensorPx.hi));
  }
  // A scenario's degrees and back may round beyond the limit by a bit.
  const double fov_h_deg = scenario.sensor.fov_h_rad / physics::kDegree;
  if (!(fov_h_deg > 0.0 && fov_h_deg <= limits::kFieldOfViewDeg.hi + 1e-9)) {
    return fail(fmt::format("sensor field of view of {} degrees: above 0 to {} are possible",
                            fov_h_deg, limits::kFieldOfViewDeg.hi));
  }
  if (scenario.sensor.narrowest_fov_rad() > scenario.sensor.fov_h_rad) {
    return fail(fmt::format("sensor.fov_h_min_deg is {}, wider than sensor.fov_h_deg ({})",
                            scenario.sensor.fov_h_min_rad / physics::kDegree, fov_h_deg));
  }
  if (!(scenario.sensor.small_target_px >= 0.0 &&
        scenario.sensor.small_target_px <= scene::kMaxSmallTargetPx)) {
    return fail(fmt::format("sensor.small_target_px is {}: 0 to {} are possible",
                            scenario.sensor.small_target_px, scene::kMaxSmallTargetPx));
  }
  const auto check = [&fail](std::string_view what, std::uint32_t value,
                             const limits::Count& count) -> Result<void> {
    if (count.contains(value)) return {};
    return fail(fmt::format("{} {}: {} to {} are possible", what, value, count.lo, count.hi));
  };
  for (const auto& checked :
       {check("thermal.steps", thermal.steps, limits::kHistorySteps),
        check("thermal.max_cascades", thermal.max_cascades, limits::kCascades),
        check("thermal.shadow_map_px", thermal.shadow_map_px, limits::kShadowMapPx),
        check("thermal.blocker_taps", thermal.blocker_taps, limits::kShadowTaps),
        check("thermal.filter_taps", thermal.filter_taps, limits::kShadowTaps)}) {
    if (!checked) return checked;
  }
  if (output.slots < 2 || output.slots > ReadbackRing::kMaxSlots) {
    return fail(fmt::format("{} read-back slots: 2 to {} are possible", output.slots,
                            ReadbackRing::kMaxSlots));
  }
  if (scenario.objects.size() > 65534) return fail("more than 65534 objects");
  return {};
}

/// Passes that every thermal method uses.
struct FramePasses {
  GeometryPass geometry;
  RadiancePass radiance;
  std::optional<EnlargePass> enlarge;  ///< empty when no frame may shed work
  std::optional<TargetPass> targets;   ///< empty when no target can be small
  std::optional<GasPass> gas;          ///< empty when the scenario has no gas
};

/// Renderer on an OpenGL device.
class GlRenderer final : public Renderer {
 public:
  GlRenderer(const scene::ScenarioDesc& scenario, gl::EglContext context,
             const scene::SceneGeometry& geometry, const OutputOptions& output, BandModel bands,
             std::optional<GasModel> gas, ClutterFields clutter, FramePasses passes);
  /// Sets the thermal method, which reads history(). It is called before anything else.
  void set_stage(std::unique_ptr<ThermalStage> stage) { stage_ = std::move(stage); }
  [[nodiscard]] const SceneHistory& history() const noexcept { return history_; }
  [[nodiscard]] const BandModel& bands() const noexcept { return bands_; }
  [[nodiscard]] std::span<const DrawnClutter> clutter() const noexcept {
    return clutter_.empty() ? std::span<const DrawnClutter>() : clutter_.of_materials();
  }

  std::size_t apply_entities(std::int64_t sim_time_ns,
                             std::span<const EntityUpdate> updates) noexcept override;
  void foresee_entities(std::int64_t sim_time_ns,
                        std::span<const EntityUpdate> updates) noexcept override;
  bool apply_part(std::int64_t sim_time_ns, const PartUpdate& update) noexcept override;
  bool apply_weather(const scene::WeatherSample& sample) noexcept override {
    return history_.environment.append(sample);
  }
  void reset() noexcept override;
  void plan(std::span<const std::int64_t> thermal_times_ns) override {
    stage_->plan(thermal_times_ns);
  }
  Result<void> warm_up(const FrameRequest& first, const WarmUpProgress& progress) override;
  Result<void> carry_on(const FrameRequest& to, const WarmUpProgress& progress) override {
    EMIT_CHECK(warm_);
    return stage_->carry_on(to, progress);
  }
  int submit(const FrameRequest& request) noexcept override;
  bool poll(SlotIndex slot) noexcept override { return readback_.ready(slot); }
  const FrameView& collect(SlotIndex slot) noexcept override;
  void release(SlotIndex slot) noexcept override { readback_.release(slot); }
  std::span<const QualityLevelStats> expected_levels(const FrameRequest& request) noexcept override;
  physics::Pose scenario_sensor_pose_at(std::int64_t sim_time_ns) const noexcept override;
  std::vector<RadianceTerms> radiance_terms(const FrameView& view, const glm::uvec2& px,
                                            double normal_up) const override;
  std::optional<std::uint32_t> nearest_sample(const SurfacePlace& place) const noexcept override {
    return stage_->nearest_sample(place);
  }
  SampleReading sample_reading(std::uint32_t sample) const noexcept override {
    return stage_->sample_reading(sample);
  }
  const SceneStats& scene_stats() const noexcept override { return scene_stats_; }
  const std::string& device_name() const noexcept override { return context_.device_name(); }

  /// False when the driver could not map the read-back memory.
  [[nodiscard]] bool memory_mapped() const noexcept { return readback_.mapped(); }
  /// True when the device is a CPU.
  [[nodiscard]] bool software() const noexcept { return context_.software(); }

 private:
  /// Warms the thermal method up and updates the statistics of the scene.
  [[nodiscard]] Result<void> warm_up_stage(const FrameRequest& first,
                                           const WarmUpProgress& progress) {
    auto ready = stage_->warm_up(first, progress);
    if (ready) stage_->describe(scene_stats_);
    scene_stats_.first_frame_warnings = first_frame_warnings(scenario_, first.thermal_time_ns);
    warm_ = warm_ || ready.has_value();
    return ready;
  }
  [[nodiscard]] glm::uvec2 output_px() const noexcept { return frame_params_.output_px; }
  [[nodiscard]] double fov_of(const FrameRequest& request) const noexcept {
    return request.fov_h_rad > 0.0 ? request.fov_h_rad : scenario_.sensor.fov_h_rad;
  }
  /// Returns true for a field of view that the surface was not prepared for.
  [[nodiscard]] bool is_beyond_sensor(double fov_h_rad) const noexcept {
    constexpr double kSlackFrac = 1e-6;  // hosts round
    return fov_h_rad < (1.0 - kSlackFrac) * scenario_.sensor.narrowest_fov_rad() ||
           fov_h_rad > (1.0 + kSlackFrac) * scenario_.sensor.fov_h_rad;
  }
  /// Sets up the camera of a frame and starts its draw lists with all instances at its instant.
  [[nodiscard]] CameraSetup place_camera(const FrameRequest& request,
                                         const QualityLevel& level) noexcept;
  /// Number of triangles that each quality level draws of a frame. Starts the draw lists anew.
  [[nodiscard]] TrianglesPerLevel count_triangles(const FrameRequest& request) noexcept;
  /// Does the work of the CPU for a frame and sends its data to the device.
  void prepare(const FrameRequest& request, const QualityLevel& level) noexcept;
  /// Makes the gas of a frame and finds the pixels that it covers.
  void prepare_gas(const FrameRequest& request) noexcept;
  void upload_frame() noexcept;
  void bind_frame() const noexcept;
  /// Issues the passes from geometry to the planes of the output image.
  void draw_frame(const QualityLevel& level, StageTimes& stages) noexcept;
  /// Copies the rows of the window of every plane, and the counters, into a slot.
  void read_back(std::uint32_t slot) noexcept;
  /// Entry of the entity with an id in history_.entities; -1 for an unknown id.
  [[nodiscard]] int find_entity(std::uint32_t entity_id) const noexcept;

  scene::ScenarioDesc scenario_;
  OutputOptions output_;
  gl::EglContext context_;  ///< declared before every member that owns GL objects
  SceneStats scene_stats_;
  SceneHistory history_;
  bool unknown_wet_ = false;  ///< some material does not state what rain does to it
  bool guide_only_ = false;   ///< some material is more than dry layers
  std::vector<std::uint32_t> entity_ids_;
  BandModel bands_;
  std::optional<GasModel> gas_;
  ClutterFields clutter_;
  std::optional<CloudLayer> cloud_layer_;  ///< empty without broken clouds
  FramePasses passes_;
  std::unique_ptr<ThermalStage> stage_;
  bool warm_ = false;  ///< the stage has been warmed up

  gpu::FrameParams frame_params_{};
  CommandRange view_single_sided_;
  CommandRange view_double_sided_;

  gl::Buffer frame_buffer_;
  gl::Buffer band_buffer_;
  gl::Buffer table_buffer_;
  gl::BufferTexture band_table_;
  gl::Buffer air_buffer_;  ///< tables of the built-in air for the frame's camera
  gl::BufferTexture air_table_;
  gl::Buffer output_buffer_;  ///< planes of the output image, then counters
  std::size_t planes_ = 0;
  std::size_t stats_offset_ = 0;  ///< bytes from the start of output_buffer_ to the counters
  ReadbackRing readback_;
  std::vector<FrameView> views_;
  StageClock clock_;
  LadderMap ladder_;
  FrameCost frame_cost_;
  LadderMap::PerLevel expected_levels_{};  ///< result of the last call of expected_levels()
};

/// Content that the radiance pass is compiled for.
RadianceContent radiance_content(const BandModel& bands, const ClutterFields& clutter, bool clouds,
                                 const OutputOptions& output) {
  return {.bands = static_cast<std::uint32_t>(bands.params().size()),
          .air_terms = bands.air_terms(),
          .air_table = bands.air_table(),
          .air_model = bands.air_model(),
          .air_sun = bands.air_sun(),
          .terms = bands.max_terms(),
          .first_lobe = bands.first_lobe(),
          .outputs = (output.temperature ? EMIT_OUTPUT_TEMPERATURE : 0U) |
                     (output.depth ? EMIT_OUTPUT_DEPTH : 0U) |
                     (output.object ? EMIT_OUTPUT_OBJECT : 0U) |
                     (output.sun ? EMIT_OUTPUT_SUN : 0U) | (output.sky ? EMIT_OUTPUT_SKY : 0U) |
                     (output.terms ? EMIT_OUTPUT_TERMS : 0U),
          .clutter = !clutter.empty(),
          .clutter_emissivity = clutter.change_emissivity(),
          .clouds = clouds,
          .fog = bands.fog()};
}

/// True when some object of the scenario is an entity.
bool has_entities(const scene::ScenarioDesc& scenario) {
  return std::ranges::any_of(scenario.objects,
                             [](const scene::ObjectDesc& object) { return object.entity_id != 0; });
}

/// Number of planes that show surfaces: all but the coverage, which is the last.
std::size_t surface_planes(const scene::ScenarioDesc& scenario, const OutputOptions& output) {
  return scenario.bands.size() + (output.temperature ? 1U : 0U) + (output.depth ? 1U : 0U) +
         (output.object ? 1U : 0U) + (output.sun ? 1U : 0U) + (output.sky ? 1U : 0U) +
         (output.terms ? scenario.bands.size() + 9 : 0U);
}

/// Number of planes of the output image.
std::size_t plane_count(const scene::ScenarioDesc& scenario, const OutputOptions& output) {
  return surface_planes(scenario, output) + (output.coverage ? 1U : 0U);
}

/// Size of all planes, rounded up to the alignment of a storage block.
std::size_t planes_bytes(const scene::ScenarioDesc& scenario, const OutputOptions& output) {
  const std::size_t bytes = plane_count(scenario, output) * scenario.sensor.width_px *
                            scenario.sensor.height_px * sizeof(float);
  return (bytes + kBlockAlignment - 1) / kBlockAlignment * kBlockAlignment;
}

GlRenderer::GlRenderer(const scene::ScenarioDesc& scenario, gl::EglContext context,
                       const scene::SceneGeometry& geometry, const OutputOptions& output,
                       BandModel bands, std::optional<GasModel> gas, ClutterFields clutter,
                       FramePasses passes)
    : scenario_(scenario),
      output_(output),
      context_(std::move(context)),
      scene_stats_{.triangles = geometry.triangles,
                   .instances = static_cast<std::uint32_t>(geometry.instances.size()),
                   .warnings = scenario.warnings},
      history_{Environment(scenario), {}, {}},
      bands_(std::move(bands)),
      gas_(std::move(gas)),
      clutter_(std::move(clutter)),
      passes_(std::move(passes)),
      frame_buffer_(gl::Buffer::dynamic(sizeof(gpu::FrameParams))),
      band_buffer_(gl::Buffer::dynamic(EMIT_MAX_BANDS * sizeof(gpu::BandParams))),
      table_buffer_(gl::Buffer::from(bands_.tables())),
      band_table_(GL_R32F, table_buffer_),
      air_buffer_(gl::Buffer::dynamic(bands_.air_nodes().size_bytes())),
      air_table_(GL_RGBA32F, air_buffer_),
      output_buffer_(planes_bytes(scenario, output) + sizeof(gpu::FrameStatsGpu), nullptr, 0),
      planes_(plane_count(scenario, output)),
      stats_offset_(planes_bytes(scenario, output)),
      readback_(output.slots, output_buffer_.bytes()),
      views_(output.slots),
      clock_(output.stage_timing) {
  scene_stats_.warnings.insert(scene_stats_.warnings.end(), geometry.warnings.begin(),
                               geometry.warnings.end());
  const std::vector<std::uint32_t> bare = scene::materials_without_rain(scenario.thermal, geometry);
  unknown_wet_ = !bare.empty();
  guide_only_ = std::ranges::any_of(geometry.materials, [](const scene::Material& material) {
    return !material.dry_layers_valid && !material.prescribed_k;
  });
  add_heat_warnings(scenario, geometry, bare, history_.environment.rains(), scene_stats_.warnings);
  if (!scenario.contacts.empty()) {
    const scene::ThermalOptions& thermal = scenario.thermal;
    const bool at_feet = thermal.method == scene::ThermalMethod::cached &&
                         thermal.model == scene::ThermalModel::foster && thermal.lateral;
    scene_stats_.warnings.push_back(fmt::format(
        "{}: [[contact]] {}: bodies conduct to each other through all that they have in common "
        "only in emit solve in three dimensions",
        scenario.file.string(), at_feet ? "counts at the feet of walls alone" : "is ignored"));
  }
  // Give each entity a history of poses.
  for (std::size_t i = 0; i < scenario_.objects.size(); ++i) {
    const scene::ObjectDesc& object = scenario_.objects[i];
    if (object.entity_id == 0) continue;
    entity_ids_.push_back(object.entity_id);
    history_.entities.emplace_back(object, object.instances.front(),
                                   scene::film_body(scenario_, geometry, i));
  }
  history_.parts = make_part_histories(scenario_, geometry, scene_stats_.warnings);
  if (const physics::CloudField* clouds = history_.environment.clouds()) {
    cloud_layer_.emplace(*clouds);
  }
  const std::size_t plane_px = std::size_t{scenario_.sensor.width_px} * scenario_.sensor.height_px;
  // Set the parameters that all frames share.
  frame_params_.output_px = glm::uvec2(scenario_.sensor.width_px, scenario_.sensor.height_px);
  frame_params_.output_plane_px = static_cast<std::uint32_t>(plane_px);
  frame_params_.obscurance_radius_m = static_cast<float>(scenario_.thermal.obscurance_radius_m);
  frame_params_.reference_k = static_cast<float>(physics::kReferenceK);
  frame_params_.step_tolerance_k = static_cast<float>(scenario_.thermal.tolerance_k);
  frame_params_.near_m = static_cast<float>(scenario_.sensor.near_m);
  frame_params_.band_lut_nodes = bands_.nodes_per_band();
  frame_params_.first_emissivity = bands_.first_emissivity();
  frame_params_.first_emissivity_sd = bands_.first_emissivity_sd();
  // Let the view of each slot refer to the planes in its memory.
  for (std::uint32_t slot = 0; slot < output_.slots; ++slot) {
    FrameView& view = views_[slot];
    view.width_px = scenario_.sensor.width_px;
    view.height_px = scenario_.sensor.height_px;
    const auto* planes = reinterpret_cast<const float*>(readback_.data(slot));
    std::size_t plane = 0;
    const auto next_plane = [&] {
      return std::span<const float>(planes + plane++ * plane_px, plane_px);
    };
    for (std::size_t b = 0; b < scenario_.bands.size(); ++b) {
      view.radiance_w_m2_sr.push_back(next_plane());
    }
    if (output_.temperature) view.temperature_k = next_plane();
    if (output_.depth) view.depth_m = next_plane();
    if (output_.object) view.object_id = next_plane();
    if (output_.sun) view.sun_cosine = next_plane();
    if (output_.sky) view.sky_frac = next_plane();
    for (std::size_t b = 0; output_.terms && b < scenario_.bands.size(); ++b) {
      view.incoming_w_m2_sr.push_back(next_plane());
    }
    if (output_.terms) {
      view.material = next_plane();
      view.clutter_sd = next_plane();
      view.clutter_k = next_plane();
      view.clutter_variance_k2 = next_plane();
      for (std::span<const float>& plane_of_axis : view.normal) plane_of_axis = next_plane();
      view.glint_per_sr = next_plane();
      view.clouds = next_plane();
    }
    if (output_.coverage) view.coverage_frac = next_plane();
  }
  glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
}

int GlRenderer::find_entity(std::uint32_t entity_id) const noexcept {
  const auto found = std::find(entity_ids_.begin(), entity_ids_.end(), entity_id);
  return found == entity_ids_.end() ? -1 : static_cast<int>(found - entity_ids_.begin());
}

std::size_t GlRenderer::apply_entities(std::int64_t sim_time_ns,
                                       std::span<const EntityUpdate> updates) noexcept {
  for (PoseHistory& history : history_.entities) history.forget();
  std::size_t applied = 0;
  for (const EntityUpdate& update : updates) {
    const int index = find_entity(update.entity_id);
    if (index < 0 || !physics::is_valid(update.pose)) continue;
    if (history_.entities[static_cast<std::size_t>(index)].append(sim_time_ns, update.pose,
                                                                  update.on, update.teleport)) {
      ++applied;
    }
  }
  return applied;
}

void GlRenderer::foresee_entities(std::int64_t sim_time_ns,
                                  std::span<const EntityUpdate> updates) noexcept {
  for (const EntityUpdate& update : updates) {
    const int index = find_entity(update.entity_id);
    if (index < 0 || !physics::is_valid(update.pose)) continue;
    history_.entities[static_cast<std::size_t>(index)].foresee(sim_time_ns, update.pose);
  }
}

bool GlRenderer::apply_part(std::int64_t sim_time_ns, const PartUpdate& update) noexcept {
  const int entity = find_entity(update.entity_id);
  bool applied = false;
  for (PartHistory& part : history_.parts) {
    if (static_cast<int>(part.entity()) != entity || part.id() != update.part_id) continue;
    applied = part.append(sim_time_ns, update.command) || applied;
  }
  return applied;
}

void GlRenderer::reset() noexcept {
  for (PartHistory& part : history_.parts) part.reset();
  for (PoseHistory& history : history_.entities) history.reset();
  history_.environment.reset();
}

physics::Pose GlRenderer::scenario_sensor_pose_at(std::int64_t sim_time_ns) const noexcept {
  if (scenario_.sensor.trajectory.empty()) return {};
  return trajectory_at(scenario_.sensor.trajectory, sim_time_ns).pose;
}

Result<void> GlRenderer::warm_up(const FrameRequest& first, const WarmUpProgress& progress) {
  if (auto ready = warm_up_stage(first, progress); !ready) return ready;
  if (output_.ladder != Ladder::live || !passes_.enlarge) {
    // Render one frame, because drivers compile when something is drawn for the first time. A few
    // pixels suffice where each of them integrates its own history.
    constexpr std::uint32_t kFewPx = 32;
    FrameRequest drawn = first;
    if (scenario_.thermal.method == scene::ThermalMethod::per_frame) {
      const glm::uvec2 size_px = glm::min(output_px(), glm::uvec2(kFewPx));
      drawn.window_px = {0, 0, size_px.x, size_px.y};
    }
    if (const int slot = submit(drawn); slot >= 0) {
      (void)collect(static_cast<SlotIndex>(slot));
      release(static_cast<SlotIndex>(slot));
    }
    return {};
  }
  // Measure the quality levels.
  auto survey =
      survey_ladder({*this, scenario_.sensor, bands_.apparent_temperatures(), output_px(),
                     [this](const FrameRequest& request) { return count_triangles(request); }},
                    first, progress);
  if (!survey) return tl::unexpected(std::move(survey.error()));
  ladder_ = std::move(survey->map);
  frame_cost_ = std::move(survey->cost);
  return {};
}

CameraSetup GlRenderer::place_camera(const FrameRequest& request,
                                     const QualityLevel& level) noexcept {
  // Set the sizes of the images and the window of the request in both.
  const glm::uvec2 size_px = rendered_px(level, output_px());
  const glm::uvec4 window_px = window_of(request.window_px, output_px());
  frame_params_.rendered_px = size_px;
  frame_params_.rendered_plane_px = size_px.x * size_px.y;
  frame_params_.output_window_px = window_px;
  frame_params_.rendered_window_px = rendered_window(window_px, output_px(), size_px);
  // Place the instances and the camera.
  DrawLists& lists = stage_->drawn().lists;
  lists.begin(request.sensor_pose.position_world_m, request.sim_time_ns, history_.entities);
  CameraSetup camera =
      set_camera(scenario_.sensor, fov_of(request), request.sensor_pose, frame_params_);
  if (!stage_->looks_around() && window_size_px(window_px) != output_px()) {
    // Draw one pixel more on every side, because a triangle may touch the outermost pixels of the
    // window.
    const glm::dvec4 px(glm::dvec4(frame_params_.rendered_window_px) +
                        glm::dvec4(-1.0, -1.0, 1.0, 1.0));
    const glm::dvec2 per_px(frame_params_.ray_per_px);
    const glm::dvec2 corner(frame_params_.ray_at_corner);
    camera.view.drawn_tan = glm::dvec4(corner.x + per_px.x * px.x, corner.y + per_px.y * px.y,
                                       corner.x + per_px.x * px.z, corner.y + per_px.y * px.w);
  }
  // Bound the view by the box around the scene.
  const scene::Aabb& bounds = lists.bounds();
  if (!bounds.empty()) {
    camera.view.scene_min_m = bounds.min_m;
    camera.view.scene_max_m = bounds.max_m;
    const glm::dvec3 farthest = glm::max(glm::abs(bounds.min_m), glm::abs(bounds.max_m));
    camera.view.far_m = std::max(2.0 * camera.view.near_m, glm::length(farthest));
  }
  return camera;
}

void GlRenderer::prepare(const FrameRequest& request, const QualityLevel& level) noexcept {
  // Give small targets their windows, whatever the quality level, then cull the draws of the
  // camera.
  CameraSetup camera = place_camera(request, level);
  std::span<const TargetWindow> targets;
  if (passes_.targets) {
    targets = stage_->drawn().lists.find_targets(
        camera.view, output_px(), scenario_.sensor.small_target_px, kQualityLadder[0].limits);
  }
  LevelLimits limits = level.limits;
  limits.pixel_rad = camera.pixel_rad;
  stage_->drawn().lists.cull_view(camera.view, limits, frame_params_.rendered_px,
                                  view_single_sided_, view_double_sided_);
  // Advance the thermal method, then set sun and bands to its instant.
  stage_->prepare(request, camera, frame_params_);
  const physics::SunPosition& sun = stage_->sun_now();
  const bool sun_up = sun.elevation.value() > StepPlan::kMinSunElevationRad;
  frame_params_.to_sun = glm::vec3(sun.direction_enu);
  frame_params_.sun_up = sun_up ? 1.0F : 0.0F;
  const double sensor_m = scenario_.place.height_m + request.sensor_pose.position_world_m.z;
  frame_params_.sensor_height_m = static_cast<float>(sensor_m);
  const physics::MoonPosition moon = physics::moon_position(
      scenario_.epoch_utc_ns + request.thermal_time_ns,
      {physics::Radians(scenario_.place.lat_rad), physics::Radians(scenario_.place.lon_rad),
       physics::Metres(scenario_.place.height_m)});
  set_sky_bodies(sun, moon, frame_params_);
  physics::CloudLight cloud_light;
  if (cloud_layer_) {
    cloud_light = history_.environment.cloud_light(stage_->forcing_now(), sun);
    cloud_layer_->update(*history_.environment.clouds(), cloud_light, sun,
                         request.sensor_pose.position_world_m, request.thermal_time_ns);
  }
  bands_.update(stage_->forcing_now(), sun, moon, sensor_m, cloud_light);
  frame_params_.fog_above_m = bands_.fog_above_m();
  frame_params_.fog_k = static_cast<float>(stage_->forcing_now().air_k);
  if (passes_.targets) passes_.targets->prepare(targets, camera.view, frame_params_);
  if (gas_) prepare_gas(request);
  upload_frame();
}

void GlRenderer::prepare_gas(const FrameRequest& request) noexcept {
  gas_->update({.sim_time_ns = request.sim_time_ns,
                .camera_world_m = request.sensor_pose.position_world_m,
                .world_from_sensor = glm::dmat3(glm::mat3(frame_params_.relworld_from_sensor)),
                .sensor_height_m = double{frame_params_.sensor_height_m}},
               stage_->forcing_now(), history_, bands_, frame_params_);
  GasTiles& tiles = passes_.gas->tiles();
  tiles.begin(gas_->puffs(), gas_->term_frac());
  tiles.add_output(frame_params_);
  for (std::size_t t = 0; passes_.targets && t < passes_.targets->windows(); ++t) {
    tiles.add_target(passes_.targets->window_frame(t));
  }
}

std::vector<RadianceTerms> GlRenderer::radiance_terms(const FrameView& view, const glm::uvec2& px,
                                                      double normal_up) const {
  EMIT_CHECK(output_.terms && output_.temperature && output_.depth && output_.sun && output_.sky);
  const std::size_t i = std::size_t{px.y} * view.width_px + px.x;
  // Find the line of sight, by the numbers that the shader has.
  const glm::vec2 middle(static_cast<float>(px.x) + 0.5F, static_cast<float>(px.y) + 0.5F);
  const glm::vec2 tan = frame_params_.ray_at_corner + frame_params_.ray_per_px * middle;
  const glm::vec3 ray(tan, 1.0F);
  const glm::vec3 up(frame_params_.relworld_from_sensor[0].z,
                     frame_params_.relworld_from_sensor[1].z,
                     frame_params_.relworld_from_sensor[2].z);
  BandModel::Seen seen;
  seen.surface = std::isfinite(view.depth_m[i]);
  seen.temperature_k = view.temperature_k[i];
  seen.open_frac = view.sky_frac[i];
  seen.sun_cosine = view.sun_cosine[i];
  seen.normal_up = static_cast<float>(normal_up);
  seen.material = static_cast<std::uint32_t>(view.material[i]);
  seen.range_m = view.depth_m[i] * glm::length(ray);
  seen.sin_elevation = glm::dot(up, ray) / glm::length(ray);
  seen.sensor_height_m = frame_params_.sensor_height_m;
  seen.bodies = sky_bodies_at(glm::ivec2(px), frame_params_);
  seen.normal = {view.normal[0][i], view.normal[1][i], view.normal[2][i]};
  seen.to_viewer = -glm::normalize(glm::mat3(frame_params_.relworld_from_sensor) * ray);
  seen.to_sun = frame_params_.to_sun;
  seen.ray_sun_cosine = -glm::dot(seen.to_sun, seen.to_viewer);
  seen.glint_per_sr = view.glint_per_sr[i];
  seen.clutter_sd = view.clutter_sd[i];
  seen.clutter_variance_k2 = view.clutter_variance_k2[i];
  if (!seen.surface) seen.cloud_frac = view.clouds[i];
  std::vector<RadianceTerms> out;
  for (std::size_t b = 0; b < bands_.bands(); ++b) {
    out.push_back(bands_.terms(b, seen, view.incoming_w_m2_sr[b][i]));
  }
  if (!gas_) return out;
  // See the surface through the gas in front of it.
  const float boresight_m = seen.surface ? view.depth_m[i] : EMIT_SKY_DEPTH_M;
  const GasTiles& tiles = passes_.gas->tiles();
  const GasModel::Seen gas = gas_->seen(tiles.output(), px, boresight_m, tiles.output_samples(px));
  for (std::size_t b = 0; b < out.size(); ++b) {
    RadianceTerms& terms = out[b];
    terms.gas_frac = gas.through_frac[b];
    terms.gas_w_m2_sr = gas.added_w_m2_sr[b];
    for (double* part : {&terms.emission_w_m2_sr, &terms.sky_w_m2_sr, &terms.neighbours_w_m2_sr,
                         &terms.sun_w_m2_sr, &terms.lobe_sky_w_m2_sr,
                         &terms.lobe_neighbours_w_m2_sr, &terms.glint_w_m2_sr, &terms.path_w_m2_sr,
                         &terms.scattered_w_m2_sr, &terms.bodies_w_m2_sr}) {
      *part *= terms.gas_frac;
    }
  }
  return out;
}

void GlRenderer::upload_frame() noexcept {
  frame_buffer_.upload(std::span<const gpu::FrameParams>(&frame_params_, 1));
  band_buffer_.upload(bands_.params());
  if (bands_.air_nodes_change()) air_buffer_.upload(bands_.air_nodes_now());
  if (cloud_layer_) cloud_layer_->upload();
  if (passes_.targets) passes_.targets->upload();
  if (passes_.gas) passes_.gas->upload();
  stage_->upload();
}

void GlRenderer::bind_frame() const noexcept {
  frame_buffer_.bind_uniform(EMIT_BIND_FRAME);
  band_buffer_.bind_uniform(EMIT_BIND_BANDS);
  band_table_.bind(EMIT_TEX_BAND_LUT);
  air_table_.bind(EMIT_TEX_AIR);
  output_buffer_.bind_storage(EMIT_BIND_OUTPUT, 0, stats_offset_);
  output_buffer_.bind_storage(EMIT_BIND_STATS, stats_offset_, sizeof(gpu::FrameStatsGpu));
  passes_.geometry.bind_textures();
  if (!clutter_.empty()) clutter_.bind();
  if (cloud_layer_) cloud_layer_->bind();
  stage_->bind();
}

void GlRenderer::read_back(std::uint32_t slot) noexcept {
  const glm::uvec4& window_px = frame_params_.output_window_px;
  const std::size_t row_bytes = frame_params_.output_px.x * sizeof(float);
  const std::size_t plane_bytes = frame_params_.output_plane_px * sizeof(float);
  std::array<ReadbackRing::Range, kMaxPlanes + 1> parts;
  for (std::size_t plane = 0; plane < planes_; ++plane) {
    parts[plane] = {plane * plane_bytes + window_px.y * row_bytes,
                    window_size_px(window_px).y * row_bytes};
  }
  parts[planes_] = {stats_offset_, sizeof(gpu::FrameStatsGpu)};
  readback_.copy_from(output_buffer_, slot, std::span(parts).first(planes_ + 1));
}

std::span<const QualityLevelStats> GlRenderer::expected_levels(
    const FrameRequest& request) noexcept {
  static constexpr std::array<QualityLevelStats, 1> kFullOnly{};
  if (ladder_.empty()) return kFullOnly;
  const bool known = ladder_.at(request.sensor_pose, fov_of(request), expected_levels_);
  // Estimate the times from triangles and pixels where nothing was measured. The measured frames
  // are whole images.
  const glm::uvec2 window_px = window_size_px(window_of(request.window_px, output_px()));
  if (!known || window_px != output_px()) {
    const TrianglesPerLevel triangles = count_triangles(request);
    for (std::size_t r = 0; r < kQualityLadder.size(); ++r) {
      expected_levels_[r].frame_ms =
          frame_cost_.frame_ms(triangles[r], rendered_pixels(kQualityLadder[r], window_px));
    }
  }
  return expected_levels_;
}

TrianglesPerLevel GlRenderer::count_triangles(const FrameRequest& request) noexcept {
  // Express the limits of every level in pixels of full quality.
  const CameraSetup camera = place_camera(request, kQualityLadder[0]);
  std::array<LevelLimits, kQualityLadder.size()> limits;
  for (std::size_t r = 0; r < limits.size(); ++r) {
    limits[r] = kQualityLadder[r].limits;
    limits[r].pixel_rad =
        camera.pixel_rad * output_px().x / rendered_px(kQualityLadder[r], output_px()).x;
  }
  TrianglesPerLevel triangles{};
  stage_->drawn().lists.count_triangles(camera.view, limits, triangles);
  return triangles;
}

int GlRenderer::submit(const FrameRequest& request) noexcept {
  // Take a slot and describe the frame in its view.
  const int slot = readback_.acquire();
  if (slot < 0) return -1;
  FrameView& view = views_[static_cast<std::size_t>(slot)];
  view.frame_number = request.frame_number;
  view.sim_time_ns = request.sim_time_ns;
  view.sensor_pose = request.sensor_pose;
  view.fov_h_rad = fov_of(request);
  view.stats.dropped_poses = 0;
  for (const PoseHistory& history : history_.entities) {
    view.stats.dropped_poses += history.dropped();
  }
  view.stages_ms = {};
  view.quality_level = 0;
  view.estimated_error_k = 0.0F;
  StageTimes& stages = view.stages_ms;
  // Prepare the surface where the thermal time has jumped, and measure how long that takes.
  view.stats.rewarm_s = 0.0;
  view.device_failed = false;
  if (stage_->cold(request)) {
    const bool again = warm_;
    const auto begin = std::chrono::steady_clock::now();
    view.device_failed = !warm_up_stage(request, {});
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
    if (again) view.stats.rewarm_s = took.count();
  }
  // If that fails, nothing can be drawn: the old content of the planes goes out, flagged as failed.
  if (view.device_failed) {
    const ReadbackRing::Range all{0, output_buffer_.bytes()};
    readback_.copy_from(output_buffer_, static_cast<std::uint32_t>(slot), {&all, 1});
    return slot;
  }
  clock_.start();

  // Choose the quality level and state its expected error.
  view.quality_level =
      passes_.enlarge ? std::min<std::uint8_t>(request.quality_level, kQualityLadder.size() - 1)
                      : 0;
  const bool known = ladder_.at(request.sensor_pose, fov_of(request), expected_levels_);
  view.estimated_error_k = view.quality_level == 0 ? 0.0F
                           : known
                               ? static_cast<float>(expected_levels_[view.quality_level].error_k)
                               : std::numeric_limits<float>::quiet_NaN();
  const QualityLevel& level = kQualityLadder[view.quality_level];
  // Do the work of the CPU and bind everything.
  prepare(request, level);
  view.stats.coarse = stage_->coarse_from(request.sensor_pose);
  add(view.stats.coarse, CoarseReason::warmed_up, view.stats.rewarm_s > 0.0);
  add(view.stats.coarse, CoarseReason::field_of_view, is_beyond_sensor(fov_of(request)));
  view.stats.heat_limits = stage_->heat_limits(request);
  constexpr double kLeastMm = 0.05;
  if (unknown_wet_ && history_.environment.rain_mm(request.thermal_time_ns - kLimitMemoryNs,
                                                   request.thermal_time_ns) > kLeastMm) {
    add(view.stats.heat_limits, HeatLimit::rain_unknown);
  }
  if (guide_only_) add(view.stats.heat_limits, HeatLimit::layers_invalid);
  view.stats.plain_targets = passes_.targets ? stage_->drawn().lists.plain_targets() : 0;
  bind_frame();
  // Clear the counters, then issue all passes and the read-back.
  const std::uint32_t zero = 0;
  glClearNamedBufferSubData(output_buffer_.id(), GL_R32UI, static_cast<GLintptr>(stats_offset_),
                            sizeof(gpu::FrameStatsGpu), GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
  if (output_.coverage) {
    const std::size_t plane_bytes = frame_params_.output_plane_px * sizeof(float);
    glClearNamedBufferSubData(
        output_buffer_.id(), GL_R32UI, static_cast<GLintptr>((planes_ - 1) * plane_bytes),
        static_cast<GLsizeiptr>(plane_bytes), GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
  }
  draw_frame(level, stages);
  read_back(static_cast<std::uint32_t>(slot));
  clock_.mark(stages.readback_ms);
  return slot;
}

void GlRenderer::draw_frame(const QualityLevel& level, StageTimes& stages) noexcept {
  // Draw the geometry buffer: the window, or everything if the method looks around it.
  const DrawnScene& drawn = stage_->drawn();
  const glm::uvec2 size_px(frame_params_.rendered_px);
  const glm::uvec4& window_px = frame_params_.rendered_window_px;
  const GeometryPass::View view{view_single_sided_, view_double_sided_, window_of({}, size_px),
                                stage_->looks_around() ? window_of({}, size_px) : window_px};
  passes_.geometry.draw(drawn.vertices, drawn.lists, drawn.record_buffer, {&view, 1});
  if (passes_.targets) {
    passes_.targets->draw_geometry(drawn.vertices, drawn.lists, drawn.record_buffer);
  }
  clock_.mark(stages.geometry_ms);
  // Compute the temperatures.
  stage_->draw(window_size_px(window_px), stages, clock_);
  // Compute the radiance, and enlarge it if the level renders fewer pixels.
  if (is_scaled(level)) {
    passes_.enlarge->planes().bind_storage(EMIT_BIND_OUTPUT);
    passes_.radiance.dispatch(window_size_px(window_px));
    output_buffer_.bind_storage(EMIT_BIND_OUTPUT, 0, stats_offset_);
    passes_.enlarge->dispatch(window_size_px(frame_params_.output_window_px));
  } else {
    passes_.radiance.dispatch(window_size_px(window_px));
  }
  // Draw gas over the image, then put small targets into it, because both have its pixels at every
  // quality level. Gas in front of a target is drawn over the target's samples.
  const GasPass* gas = passes_.gas ? &*passes_.gas : nullptr;
  if (gas != nullptr) gas->draw(0);
  if (passes_.targets) {
    passes_.targets->resolve(passes_.radiance, gas, frame_buffer_, output_buffer_, stats_offset_);
  }
  clock_.mark(stages.radiance_ms);
}

const FrameView& GlRenderer::collect(SlotIndex slot) noexcept {
  EMIT_CHECK_OP(slot, <, views_.size());
  FrameView& view = views_[slot];
  // Wait for the frame and look for errors of the driver.
  view.device_failed = !readback_.wait(slot) || glGetError() != GL_NO_ERROR || view.device_failed;
  view.device_lost = glGetGraphicsResetStatus() != GL_NO_ERROR;
  view.device_failed = view.device_failed || view.device_lost;
  // Read the counters behind the planes.
  gpu::FrameStatsGpu stats{};
  std::copy_n(readback_.data(slot) + stats_offset_, sizeof(stats),
              reinterpret_cast<std::byte*>(&stats));
  const auto* flagged_px = stats.flagged_px;
  view.stats.nonfinite_px =
      flagged_px[EMIT_FLAG_NONFINITE] + flagged_px[EMIT_FLAG_NONFINITE + EMIT_FLAG_CLAMPED];
  view.stats.clamped_px =
      flagged_px[EMIT_FLAG_CLAMPED] + flagged_px[EMIT_FLAG_NONFINITE + EMIT_FLAG_CLAMPED];
  return view;
}

}  // namespace

Result<std::unique_ptr<Renderer>> Renderer::create(const scene::ScenarioDesc& scenario,
                                                   const DeviceOptions& device,
                                                   const OutputOptions& output) {
  // Check the limits and load the scene.
  if (auto ok = check_limits(scenario, output); !ok) return tl::unexpected(ok.error());
  auto geometry = scene::load_scene(scenario);
  if (!geometry) return tl::unexpected(std::move(geometry.error()));
  const bool cached = scenario.thermal.method == scene::ThermalMethod::cached;
  if (cached) scene::adopt_sheets(*geometry);
  if (geometry->materials.size() > EMIT_MAX_MATERIALS) {
    return make_error(ErrorCode::config,
                      fmt::format("{} materials: {} are possible", geometry->materials.size(),
                                  EMIT_MAX_MATERIALS));
  }
  // Build the tables on the CPU and create the context.
  auto bands = BandModel::build(scenario, geometry->materials);
  if (!bands) return tl::unexpected(std::move(bands.error()));
  auto context = gl::EglContext::create(device.gpu_index, device.debug_context);
  if (!context) return tl::unexpected(std::move(context.error()));

  auto foster = build_foster_materials(scenario, geometry->materials);
  if (!foster) return tl::unexpected(std::move(foster.error()));
  if (!foster->empty()) {
    const std::string shared = shared_water_warning(scenario, geometry->materials, *foster);
    if (!shared.empty()) geometry->warnings.push_back(shared);
  }

  auto clutter = ClutterFields::build(geometry->materials);
  if (!clutter) return tl::unexpected(std::move(clutter.error()));

  // Compile the passes that every method uses.
  const std::uint32_t width_px = scenario.sensor.width_px;
  const std::uint32_t height_px = scenario.sensor.height_px;
  using Content = GeometryPass::Content;
  const GeometryPass::Setup geometry_setup{.width_px = width_px,
                                           .height_px = height_px,
                                           .content = !cached         ? Content::normals
                                                      : output.object ? Content::samples_and_objects
                                                                      : Content::samples,
                                           .shade = cached && has_entities(scenario)
                                                        ? GeometryPass::Shade::of_entities
                                                        : GeometryPass::Shade::none,
                                           .bands = static_cast<std::uint32_t>(bands->bands()),
                                           .normal = bands->first_lobe() != 0,
                                           .seen = CachedStage::sees_in_band(scenario.thermal),
                                           .clutter = !clutter->empty()};
  auto geometry_pass = GeometryPass::create(*context, geometry_setup);
  if (!geometry_pass) return tl::unexpected(std::move(geometry_pass.error()));
  RadianceContent content = radiance_content(*bands, *clutter, scenario.clouds.has_value(), output);
  content.foster_groups = foster_groups(*foster);
  auto radiance_pass = RadiancePass::create(scenario.thermal, content, context->software());
  if (!radiance_pass) return tl::unexpected(std::move(radiance_pass.error()));
  FramePasses passes{std::move(*geometry_pass), std::move(*radiance_pass), {}, {}, {}};
  std::optional<GasModel> gas;
  if (!scenario.gas.empty()) {
    auto model = GasModel::build(scenario);
    if (!model) return tl::unexpected(std::move(model.error()));
    gas = std::move(*model);
    auto gas_pass = GasPass::create({.bands = static_cast<std::uint32_t>(scenario.bands.size()),
                                     .reversed_depth = cached,
                                     .output_px = glm::uvec2(width_px, height_px)});
    if (!gas_pass) return tl::unexpected(std::move(gas_pass.error()));
    passes.gas = std::move(*gas_pass);
  }
  if (cached && output.ladder != Ladder::none) {
    auto enlarge_pass =
        EnlargePass::create(static_cast<std::uint32_t>(scenario.bands.size()),
                            static_cast<std::uint32_t>(surface_planes(scenario, output)),
                            std::size_t{width_px} * height_px);
    if (!enlarge_pass) return tl::unexpected(std::move(enlarge_pass.error()));
    passes.enlarge = std::move(*enlarge_pass);
  }
  if (cached && has_entities(scenario) && scenario.sensor.small_target_px > 0.0) {
    auto target_pass =
        TargetPass::create(*context, static_cast<std::uint32_t>(surface_planes(scenario, output)),
                           output.coverage, geometry_setup);
    if (!target_pass) return tl::unexpected(std::move(target_pass.error()));
    passes.targets = std::move(*target_pass);
  }

  // Create the renderer, then the thermal method, which reads its history.
  auto renderer = std::make_unique<GlRenderer>(scenario, std::move(*context), *geometry, output,
                                               std::move(*bands), std::move(gas),
                                               std::move(*clutter), std::move(passes));
  auto stage = cached ? CachedStage::create(scenario, std::move(*geometry), std::move(*foster),
                                            renderer->history(), renderer->bands(),
                                            renderer->clutter(), renderer->software())
                      : PerFrameStage::create(scenario, std::move(*geometry), std::move(*foster),
                                              renderer->history());
  if (!stage) return tl::unexpected(std::move(stage.error()));
  renderer->set_stage(std::move(*stage));
  if (glGetError() != GL_NO_ERROR || !renderer->memory_mapped()) {
    return make_error(ErrorCode::gpu, "the device cannot provide the buffers of this scenario");
  }
  return renderer;
}

}  // namespace emit::renderer
