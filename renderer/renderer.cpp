// SPDX-License-Identifier: Apache-2.0
#include "emit/renderer/renderer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <optional>

#include "emit/scene/mesh.hpp"
#include "gl/egl_context.hpp"
#include "history/environment.hpp"
#include "history/foster_history.hpp"
#include "history/pose_history.hpp"
#include "history/step_plan.hpp"
#include "passes/band_model.hpp"
#include "passes/compute_passes.hpp"
#include "passes/draw_lists.hpp"
#include "passes/foster_setup.hpp"
#include "passes/frame_setup.hpp"
#include "passes/raster_passes.hpp"
#include "passes/readback_ring.hpp"
#include "passes/scene_buffers.hpp"

namespace emit::renderer {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

// Temperatures on the device are offsets from here: float32 then resolves micro-kelvins.
constexpr double kReferenceK = 295.0;
// The newest interval's shade stands for "now" if it is at most this old: the sun moves by less
// than its own radius.
constexpr std::int64_t kFreshShadeNs = 60'000'000'000;
constexpr double kFreshCasterM = 0.05;
constexpr std::size_t kBlockAlignment = 256;  // GL guarantees that no driver asks for more

/// A step's uniform block, padded so that every step can be bound at its offset.
struct alignas(kBlockAlignment) StepSlot {
  gpu::StepParams params;
};

/// Device buffer refilled by the CPU each frame.
gl::Buffer make_dynamic(std::size_t bytes) {
  return gl::Buffer(std::max<std::size_t>(bytes, 16), nullptr, GL_DYNAMIC_STORAGE_BIT);
}
template <class T>
void upload(const gl::Buffer& buffer, std::span<const T> data) noexcept {
  if (data.empty()) return;
  glNamedBufferSubData(buffer.id(), 0, static_cast<GLsizeiptr>(data.size_bytes()), data.data());
}

Result<void> check_limits(const scene::ScenarioDesc& scenario, const OutputOptions& output) {
  const scene::ThermalOptions& thermal = scenario.thermal;
  const auto fail = [](std::string text) { return make_error(ErrorCode::config, std::move(text)); };
  if (scenario.sensor.width_px == 0 || scenario.sensor.width_px > 8192 ||
      scenario.sensor.height_px == 0 || scenario.sensor.height_px > 8192) {
    return fail(fmt::format("sensor format {} x {}: 1 to 8192 pixels are possible",
                            scenario.sensor.width_px, scenario.sensor.height_px));
  }
  if (!(scenario.sensor.fov_h_rad > 0.0 && scenario.sensor.fov_h_rad < 0.95 * physics::kPi)) {
    return fail("sensor field of view must lie between 0 and 171 degrees");
  }
  if (thermal.steps < 1 || thermal.steps > 4096) {
    return fail(fmt::format("thermal steps {}: 1 to 4096 are possible", thermal.steps));
  }
  if (thermal.max_cascades < 1 || thermal.max_cascades > EMIT_MAX_CASCADES) {
    return fail(
        fmt::format("{} cascades: 1 to {} are possible", thermal.max_cascades, EMIT_MAX_CASCADES));
  }
  if (thermal.shadow_map_px < 16 || thermal.shadow_map_px > 16384) {
    return fail(
        fmt::format("shadow map of {} px: 16 to 16384 are possible", thermal.shadow_map_px));
  }
  if (thermal.blocker_taps < 1 || thermal.blocker_taps > EMIT_MAX_TAPS || thermal.filter_taps < 1 ||
      thermal.filter_taps > EMIT_MAX_TAPS) {
    return fail(fmt::format("shadow taps {} + {}: 1 to {} each are possible", thermal.blocker_taps,
                            thermal.filter_taps, EMIT_MAX_TAPS));
  }
  if (output.slots < 2 || output.slots > ReadbackRing::kMaxSlots) {
    return fail(fmt::format("{} read-back slots: 2 to {} are possible", output.slots,
                            ReadbackRing::kMaxSlots));
  }
  if (scenario.objects.size() > 65534) return fail("more than 65534 objects");
  return {};
}

class GlRenderer final : public Renderer {
 public:
  GlRenderer(const scene::ScenarioDesc& scenario, gl::EglContext context,
             scene::SceneGeometry geometry, const OutputOptions& output, BandModel bands,
             std::vector<FosterMaterial> foster_materials, GeometryPass geometry_pass,
             OcclusionPass occlusion_pass, ShadowPass shadow_pass, ThermalPass thermal_pass,
             RadiancePass radiance_pass);

  std::size_t apply_entities(std::int64_t sim_time_ns,
                             std::span<const EntityUpdate> updates) noexcept override;
  bool apply_weather(const scene::WeatherSample& sample) noexcept override {
    return environment_.append(sample);
  }
  void reset() noexcept override;
  int submit(const FrameRequest& request) noexcept override;
  bool poll(SlotIndex slot) noexcept override { return readback_.ready(slot); }
  const FrameView& collect(SlotIndex slot) noexcept override;
  void release(SlotIndex slot) noexcept override { readback_.release(slot); }
  physics::Pose scenario_sensor_pose_at(std::int64_t sim_time_ns) const noexcept override;
  const SceneStats& scene_stats() const noexcept override { return scene_stats_; }
  const std::string& device_name() const noexcept override { return context_.device_name(); }

  [[nodiscard]] bool memory_mapped() const noexcept { return readback_.mapped(); }

 private:
  using TimePoint = std::chrono::steady_clock::time_point;

  void prepare(const FrameRequest& request) noexcept;
  void prepare_steps(const FrameRequest& request) noexcept;
  /// Extended model: fluxes, surroundings and gains of all intervals, spin-up tail included.
  void prepare_foster(bool table_changed) noexcept;
  void upload_frame() noexcept;
  void bind_frame() const noexcept;
  void bind_step(std::uint32_t step) const noexcept;
  void draw_shadow(std::uint32_t step) noexcept;
  /// With stage timing: waits for the device and adds the time since the last call to `stage_ms`.
  void mark(double& stage_ms) noexcept;
  [[nodiscard]] int find_entity(std::uint32_t entity_id) const noexcept;

  scene::ScenarioDesc scenario_;
  OutputOptions output_;
  gl::EglContext context_;  // before everything that owns GL objects
  std::vector<scene::Material> materials_;
  SceneStats scene_stats_;
  Environment environment_;
  std::vector<std::uint32_t> entity_ids_;
  std::vector<PoseHistory> histories_;
  StepPlan plan_;
  std::optional<FosterHistory> foster_;  ///< extended model only
  std::uint32_t tail_steps_ = 0;
  BandModel bands_;
  SceneBuffers scene_;
  DrawLists lists_;
  GeometryPass geometry_pass_;
  OcclusionPass occlusion_pass_;
  ShadowPass shadow_pass_;
  ThermalPass thermal_pass_;
  RadiancePass radiance_pass_;

  // CPU side of what the shaders read.
  gpu::FrameParams frame_params_{};
  std::vector<StepSlot> step_params_;
  std::vector<gpu::RelaxationParams> relaxation_params_;
  std::vector<std::array<CommandRange, 4>> shadow_commands_;
  CommandRange view_single_sided_;
  CommandRange view_double_sided_;
  bool extra_sun_pass_ = false;

  gl::Buffer frame_buffer_;
  gl::Buffer instance_buffer_;
  gl::Buffer record_buffer_;
  gl::Buffer light_record_buffer_;
  gl::Buffer step_buffer_;
  gl::Buffer relaxation_buffer_;
  gl::Buffer band_buffer_;
  gl::Buffer tap_buffer_;
  gl::Buffer material_buffer_;
  gl::Buffer table_buffer_;
  gl::Buffer spin_up_buffer_;
  gl::BufferTexture instance_table_;
  gl::BufferTexture relaxation_table_;
  gl::BufferTexture material_table_;
  gl::BufferTexture band_table_;
  gl::BufferTexture spin_up_table_;
  gl::Buffer output_buffer_;  ///< planes, then counters
  std::size_t stats_offset_ = 0;
  SceneVertexArrays vertices_;
  ReadbackRing readback_;
  std::vector<FrameView> views_;
  TimePoint last_mark_;
};

gl::Buffer make_tap_buffer(const scene::ThermalOptions& options) {
  const gpu::TapParams taps = shadow_taps(options.blocker_taps, options.filter_taps);
  return gl::Buffer(sizeof(taps), &taps, 0);
}

std::vector<std::int32_t> histories_of_objects(const scene::ScenarioDesc& scenario) {
  std::vector<std::int32_t> out;
  std::int32_t next = 0;
  for (const scene::ObjectDesc& object : scenario.objects) {
    out.push_back(object.entity_id != 0 ? next++ : -1);
  }
  return out;
}

std::size_t plane_count(const scene::ScenarioDesc& scenario, const OutputOptions& output) {
  return scenario.bands.size() + (output.temperature ? 1U : 0U) + (output.depth ? 1U : 0U) +
         (output.object ? 1U : 0U);
}

std::size_t planes_bytes(const scene::ScenarioDesc& scenario, const OutputOptions& output) {
  const std::size_t bytes = plane_count(scenario, output) * scenario.sensor.width_px *
                            scenario.sensor.height_px * sizeof(float);
  return (bytes + kBlockAlignment - 1) / kBlockAlignment * kBlockAlignment;
}

std::vector<gpu::MaterialParams> make_material_params(const scene::ScenarioDesc& scenario,
                                                      std::span<const scene::Material> materials,
                                                      const std::optional<FosterHistory>& foster) {
  std::vector<gpu::MaterialParams> params = material_params(materials, scenario, kReferenceK);
  add_resistances(foster, params);
  return params;
}

GlRenderer::GlRenderer(const scene::ScenarioDesc& scenario, gl::EglContext context,
                       scene::SceneGeometry geometry, const OutputOptions& output, BandModel bands,
                       std::vector<FosterMaterial> foster_materials, GeometryPass geometry_pass,
                       OcclusionPass occlusion_pass, ShadowPass shadow_pass,
                       ThermalPass thermal_pass, RadiancePass radiance_pass)
    : scenario_(scenario),
      output_(output),
      context_(std::move(context)),
      materials_(geometry.materials),
      scene_stats_{.triangles = geometry.triangles,
                   .instances = static_cast<std::uint32_t>(geometry.instances.size()),
                   .warnings = geometry.warnings},
      environment_(scenario),
      plan_(scenario.thermal),
      foster_(make_foster(scenario, std::move(foster_materials), environment_, kReferenceK)),
      tail_steps_(foster_ ? static_cast<std::uint32_t>(foster_->tail().size()) : 0),
      bands_(std::move(bands)),
      scene_(std::move(geometry)),
      lists_(scene_, histories_of_objects(scenario),
             (scenario.thermal.steps + 1) * scenario.thermal.max_cascades),
      geometry_pass_(std::move(geometry_pass)),
      occlusion_pass_(std::move(occlusion_pass)),
      shadow_pass_(std::move(shadow_pass)),
      thermal_pass_(std::move(thermal_pass)),
      radiance_pass_(std::move(radiance_pass)),
      step_params_(scenario.thermal.steps + 1 + tail_steps_),
      relaxation_params_(materials_.size() * (scenario.thermal.steps + tail_steps_) *
                         (foster_ ? EMIT_FOSTER_LEVELS + 1 : 1)),
      shadow_commands_(scenario.thermal.steps + 1),
      frame_buffer_(make_dynamic(sizeof(gpu::FrameParams))),
      instance_buffer_(make_dynamic(lists_.max_instance_params() * sizeof(gpu::InstanceParams))),
      record_buffer_(make_dynamic(lists_.max_records() * sizeof(DrawRecord))),
      light_record_buffer_(make_dynamic(lists_.max_light_records() * sizeof(LightRecord))),
      step_buffer_(make_dynamic(step_params_.size() * sizeof(StepSlot))),
      relaxation_buffer_(make_dynamic(relaxation_params_.size() * sizeof(gpu::RelaxationParams))),
      band_buffer_(make_dynamic(EMIT_MAX_BANDS * sizeof(gpu::BandParams))),
      tap_buffer_(make_tap_buffer(scenario.thermal)),
      material_buffer_(gl::Buffer::from(std::span<const gpu::MaterialParams>(
          make_material_params(scenario, materials_, foster_)))),
      table_buffer_(gl::Buffer::from(bands_.tables())),
      spin_up_buffer_(make_spin_up_buffer(foster_)),
      instance_table_(GL_RGBA32F, instance_buffer_),
      relaxation_table_(GL_RGBA32F, relaxation_buffer_),
      material_table_(GL_RGBA32F, material_buffer_),
      band_table_(GL_R32F, table_buffer_),
      spin_up_table_(GL_RGBA32F, spin_up_buffer_),
      output_buffer_(planes_bytes(scenario, output) + sizeof(gpu::FrameStatsGpu), nullptr, 0),
      stats_offset_(planes_bytes(scenario, output)),
      vertices_(scene_, record_buffer_, light_record_buffer_),
      readback_(output.slots, output_buffer_.bytes()),
      views_(output.slots) {
  for (const scene::ObjectDesc& object : scenario_.objects) {
    if (object.entity_id == 0) continue;
    entity_ids_.push_back(object.entity_id);
    histories_.emplace_back(object, object.instances.front());
  }
  const std::size_t plane_px = std::size_t{scenario_.sensor.width_px} * scenario_.sensor.height_px;
  frame_params_.format_px = glm::uvec4(
      scenario_.sensor.width_px, scenario_.sensor.height_px, static_cast<std::uint32_t>(plane_px),
      (output_.temperature ? EMIT_OUTPUT_TEMPERATURE : 0U) |
          (output_.depth ? EMIT_OUTPUT_DEPTH : 0U) | (output_.object ? EMIT_OUTPUT_OBJECT : 0U));
  frame_params_.obscurance =
      glm::vec4(static_cast<float>(scenario_.thermal.obscurance_radius_m),
                static_cast<float>(kReferenceK), static_cast<float>(scenario_.thermal.tolerance_k),
                foster_ ? static_cast<float>(foster_->grid_nodes()) : 0.0F);
  frame_params_.bands = glm::uvec4(static_cast<std::uint32_t>(scenario_.bands.size()),
                                   bands_.nodes_per_band(), 0U, 0U);
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
  }
  glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
}

int GlRenderer::find_entity(std::uint32_t entity_id) const noexcept {
  const auto found = std::find(entity_ids_.begin(), entity_ids_.end(), entity_id);
  return found == entity_ids_.end() ? -1 : static_cast<int>(found - entity_ids_.begin());
}

std::size_t GlRenderer::apply_entities(std::int64_t sim_time_ns,
                                       std::span<const EntityUpdate> updates) noexcept {
  std::size_t applied = 0;
  for (const EntityUpdate& update : updates) {
    const int index = find_entity(update.entity_id);
    if (index < 0 || !physics::is_valid(update.pose)) continue;
    if (histories_[static_cast<std::size_t>(index)].append(sim_time_ns, update.pose, update.on,
                                                           update.teleport)) {
      ++applied;
    }
  }
  return applied;
}

void GlRenderer::reset() noexcept {
  for (PoseHistory& history : histories_) history.reset();
  environment_.reset();
}

physics::Pose GlRenderer::scenario_sensor_pose_at(std::int64_t sim_time_ns) const noexcept {
  if (scenario_.sensor.trajectory.empty()) return {};
  return trajectory_at(scenario_.sensor.trajectory, sim_time_ns).pose;
}

void GlRenderer::mark(double& stage_ms) noexcept {
  if (!output_.stage_timing) return;
  glFinish();
  const TimePoint now = std::chrono::steady_clock::now();
  stage_ms += std::chrono::duration<double, std::milli>(now - last_mark_).count();
  last_mark_ = now;
}

void GlRenderer::prepare(const FrameRequest& request) noexcept {
  plan_.update(request.thermal_time_ns, environment_, histories_);
  physics::Forcing now = plan_.forcing_now();
  bool table_changed = false;
  if (foster_) {
    table_changed = foster_->update(plan_, environment_);
    now.environment_k = foster_->surroundings_now_k();
  }
  bands_.update(now, plan_.sun_now());
  lists_.begin(request.sensor_pose.position_world_m, request.sim_time_ns, histories_);
  prepare_steps(request);
  if (foster_) prepare_foster(table_changed);
  upload_frame();
}

void GlRenderer::prepare_foster(bool table_changed) noexcept {
  const auto materials = foster_->materials();
  const std::size_t stride = materials.size() * (EMIT_FOSTER_LEVELS + 1);
  const auto set = [&](const IntervalForcing& forcing, std::size_t entry, gpu::StepParams& params) {
    set_foster_forcing(forcing, kReferenceK, params);
    set_foster_gains(forcing.dt_s, materials,
                     std::span(relaxation_params_).subspan(entry * stride, stride));
    params.info.y = static_cast<std::uint32_t>(entry * stride);
  };
  const auto intervals = foster_->intervals();
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    set(intervals[i], i, step_params_[i].params);
  }
  const auto tail = foster_->tail();
  for (std::size_t i = 0; i < tail.size(); ++i) {
    gpu::StepParams& params = step_params_[intervals.size() + 1 + i].params;
    params.info = glm::uvec4(0, 0, EMIT_STEP_UNSHADED | (i == 0 ? EMIT_STEP_FIRST : 0U), 0);
    set(tail[i], intervals.size() + i, params);
  }
  if (!tail.empty()) step_params_[0].params.info.z &= ~EMIT_STEP_FIRST;
  if (table_changed) upload(spin_up_buffer_, foster_->table());
}

void GlRenderer::prepare_steps(const FrameRequest& request) noexcept {
  CameraSetup camera = set_camera(scenario_.sensor, request.sensor_pose, frame_params_);
  const scene::Aabb& bounds = lists_.bounds();
  if (!bounds.empty()) {
    camera.view.scene_min_m = bounds.min_m;
    camera.view.scene_max_m = bounds.max_m;
    const glm::dvec3 farthest = glm::max(glm::abs(bounds.min_m), glm::abs(bounds.max_m));
    camera.view.far_m = std::max(2.0 * camera.view.near_m, glm::length(farthest));
  }
  lists_.cull_view(camera.view, view_single_sided_, view_double_sided_);

  const physics::SunPosition& sun = plan_.sun_now();
  const bool sun_up = sun.elevation.value() > StepPlan::kMinSunElevationRad;
  frame_params_.sun_now =
      glm::vec4(static_cast<float>(sun.direction_enu.x), static_cast<float>(sun.direction_enu.y),
                static_cast<float>(sun.direction_enu.z), sun_up ? 1.0F : 0.0F);

  const auto intervals = plan_.intervals();
  const auto steps = static_cast<std::uint32_t>(intervals.size());
  const auto material_count = static_cast<std::uint32_t>(materials_.size());
  const auto add_step = [&](const HistoryInterval& interval, std::uint32_t step, bool last) {
    // Casters of the past may stand where, and as high as, nothing does now.
    scene::Aabb casters = bounds;
    if (interval.sun_up) {
      casters.add(
          lists_.pose_casters(interval.sample_ns, interval.begin_ns, interval.end_ns, histories_));
    }
    if (!casters.empty()) {
      camera.view.casters_min_m = casters.min_m;
      camera.view.casters_max_m = casters.max_m;
    }
    const LightFrusta frusta =
        set_step(interval, camera, scenario_.thermal, step == 0, last,
                 std::min(step, steps - 1) * material_count, step_params_[step].params);
    shadow_commands_[step] = {};
    if (frusta.count == 0) return;
    for (std::uint32_t c = 0; c < frusta.count; ++c) {
      shadow_commands_[step][c] = lists_.cull_light(frusta.cascades[c]);
    }
  };
  for (std::uint32_t step = 0; step < steps; ++step) {
    add_step(intervals[step], step, step + 1 == steps);
    if (foster_) continue;
    set_relaxation(intervals[step], materials_,
                   std::span(relaxation_params_).subspan(step * material_count, material_count));
  }

  // Reflected sunlight wants the shade of this very instant.
  const HistoryInterval& newest = intervals.back();
  extra_sun_pass_ = sun_up && newest.end_ns - newest.begin_ns > kFreshShadeNs;
  for (const PoseHistory& history : histories_) {
    const auto events = history.events_ns();
    const bool changed = std::any_of(events.begin(), events.end(), [&](std::int64_t event_ns) {
      return event_ns > newest.begin_ns && event_ns <= request.sim_time_ns;
    });
    extra_sun_pass_ = extra_sun_pass_ ||
                      (sun_up && (changed || history.path_m(newest.begin_ns, request.sim_time_ns) >
                                                 kFreshCasterM));
  }
  if (extra_sun_pass_) add_step(instant_interval(plan_, request.sim_time_ns), steps, true);
}

void GlRenderer::upload_frame() noexcept {
  upload(frame_buffer_, std::span<const gpu::FrameParams>(&frame_params_, 1));
  upload(instance_buffer_, lists_.instance_params());
  upload(record_buffer_, lists_.records());
  upload(light_record_buffer_, lists_.light_records());
  upload(step_buffer_, std::span<const StepSlot>(step_params_));
  upload(relaxation_buffer_, std::span<const gpu::RelaxationParams>(relaxation_params_));
  upload(band_buffer_, bands_.params());
}

void GlRenderer::bind_frame() const noexcept {
  frame_buffer_.bind_uniform(EMIT_BIND_FRAME);
  band_buffer_.bind_uniform(EMIT_BIND_BANDS);
  tap_buffer_.bind_uniform(EMIT_BIND_TAPS);
  instance_table_.bind(EMIT_TEX_INSTANCES);
  material_table_.bind(EMIT_TEX_MATERIALS);
  relaxation_table_.bind(EMIT_TEX_RELAXATION);
  band_table_.bind(EMIT_TEX_BAND_LUT);
  spin_up_table_.bind(EMIT_TEX_SPIN_UP);
  output_buffer_.bind_storage(EMIT_BIND_OUTPUT, 0, stats_offset_);
  output_buffer_.bind_storage(EMIT_BIND_STATS, stats_offset_, sizeof(gpu::FrameStatsGpu));
  geometry_pass_.bind_textures();
  occlusion_pass_.bind_texture();
  shadow_pass_.bind_texture();
  thermal_pass_.bind_textures();
}

void GlRenderer::bind_step(std::uint32_t step) const noexcept {
  step_buffer_.bind_uniform(EMIT_BIND_STEP, step * sizeof(StepSlot), sizeof(gpu::StepParams));
}

void GlRenderer::draw_shadow(std::uint32_t step) noexcept {
  bind_step(step);
  for (std::uint32_t c = 0; c < step_params_[step].params.info.x; ++c) {
    shadow_pass_.draw(vertices_, c, lists_.commands(shadow_commands_[step][c]));
  }
}

int GlRenderer::submit(const FrameRequest& request) noexcept {
  const int slot = readback_.acquire();
  if (slot < 0) return -1;
  FrameView& view = views_[static_cast<std::size_t>(slot)];
  view.frame_number = request.frame_number;
  view.sim_time_ns = request.sim_time_ns;
  view.sensor_pose = request.sensor_pose;
  view.stats.dropped_poses = 0;
  for (const PoseHistory& history : histories_) view.stats.dropped_poses += history.dropped();
  view.stages_ms = {};
  StageTimes& stages = view.stages_ms;
  if (output_.stage_timing) {
    glFinish();
    last_mark_ = std::chrono::steady_clock::now();
  }

  prepare(request);
  bind_frame();
  const std::uint32_t zero = 0;
  glClearNamedBufferSubData(output_buffer_.id(), GL_R32UI, static_cast<GLintptr>(stats_offset_),
                            sizeof(gpu::FrameStatsGpu), GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);

  geometry_pass_.draw(vertices_, lists_.commands(view_single_sided_),
                      lists_.commands(view_double_sided_));
  mark(stages.geometry_ms);
  occlusion_pass_.dispatch();
  mark(stages.occlusion_ms);
  const auto steps = static_cast<std::uint32_t>(plan_.intervals().size());
  for (std::uint32_t i = 0; i < tail_steps_; ++i) {
    bind_step(steps + 1 + i);
    thermal_pass_.dispatch_step();
    mark(stages.thermal_ms);
  }
  for (std::uint32_t step = 0; step < steps; ++step) {
    draw_shadow(step);
    mark(stages.shadow_ms);
    thermal_pass_.dispatch_step();
    mark(stages.thermal_ms);
  }
  if (extra_sun_pass_) {
    draw_shadow(steps);
    mark(stages.shadow_ms);
    thermal_pass_.dispatch_sun_only();
    mark(stages.thermal_ms);
  }
  radiance_pass_.dispatch();
  mark(stages.radiance_ms);
  readback_.copy_from(output_buffer_, static_cast<std::uint32_t>(slot));
  mark(stages.readback_ms);
  return slot;
}

const FrameView& GlRenderer::collect(SlotIndex slot) noexcept {
  FrameView& view = views_[slot];
  view.device_failed = !readback_.wait(slot) || glGetError() != GL_NO_ERROR;
  gpu::FrameStatsGpu stats{};
  std::copy_n(readback_.data(slot) + stats_offset_, sizeof(stats),
              reinterpret_cast<std::byte*>(&stats));
  view.stats = {stats.nonfinite_px, stats.clamped_px, stats.surface_px, view.stats.dropped_poses};
  return view;
}

}  // namespace

Result<std::unique_ptr<Renderer>> Renderer::create(const scene::ScenarioDesc& scenario,
                                                   const DeviceOptions& device,
                                                   const OutputOptions& output) {
  if (auto ok = check_limits(scenario, output); !ok) return tl::unexpected(ok.error());
  auto bands = BandModel::build(scenario);
  if (!bands) return tl::unexpected(std::move(bands.error()));
  auto geometry = scene::load_scene(scenario);
  if (!geometry) return tl::unexpected(std::move(geometry.error()));
  auto context = gl::EglContext::create(device.gpu_index, device.debug_context);
  if (!context) return tl::unexpected(std::move(context.error()));

  auto foster = build_foster_materials(scenario, geometry->materials);
  if (!foster) return tl::unexpected(std::move(foster.error()));

  const std::uint32_t width_px = scenario.sensor.width_px;
  const std::uint32_t height_px = scenario.sensor.height_px;
  auto geometry_pass = GeometryPass::create(width_px, height_px);
  if (!geometry_pass) return tl::unexpected(std::move(geometry_pass.error()));
  auto occlusion_pass = OcclusionPass::create(width_px, height_px);
  if (!occlusion_pass) return tl::unexpected(std::move(occlusion_pass.error()));
  auto shadow_pass =
      ShadowPass::create(scenario.thermal.shadow_map_px, scenario.thermal.max_cascades);
  if (!shadow_pass) return tl::unexpected(std::move(shadow_pass.error()));
  auto thermal_pass = ThermalPass::create(width_px, height_px, scenario.thermal);
  if (!thermal_pass) return tl::unexpected(std::move(thermal_pass.error()));
  auto radiance_pass = RadiancePass::create(width_px, height_px, scenario.thermal.model);
  if (!radiance_pass) return tl::unexpected(std::move(radiance_pass.error()));

  auto renderer = std::make_unique<GlRenderer>(
      scenario, std::move(*context), std::move(*geometry), output, std::move(*bands),
      std::move(*foster), std::move(*geometry_pass), std::move(*occlusion_pass),
      std::move(*shadow_pass), std::move(*thermal_pass), std::move(*radiance_pass));
  if (glGetError() != GL_NO_ERROR || !renderer->memory_mapped()) {
    return make_error(ErrorCode::gpu, "the device cannot provide the buffers of this scenario");
  }
  return renderer;
}

}  // namespace emit::renderer
