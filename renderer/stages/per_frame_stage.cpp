// SPDX-License-Identifier: Apache-2.0
#include "stages/per_frame_stage.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/scene/sheets.hpp"
#include "stages/band_model.hpp"

namespace emit::renderer {
namespace {

/// Largest length of the newest interval whose shade is used for the instant of the frame. The sun
/// moves by less than its own radius in this time.
constexpr std::int64_t kFreshShadeNs = 60'000'000'000;
/// Largest way of an entity since the start of that interval for which its shade is used.
constexpr double kFreshCasterM = 0.05;

/// Buffer with the samples of the sun's disc.
gl::Buffer make_tap_buffer(const scene::ThermalOptions& options) {
  const gpu::TapParams taps = shadow_taps(options.blocker_taps, options.filter_taps);
  return gl::Buffer(sizeof(taps), &taps, 0);
}

/// Refuses sheets with the extended model: their temperature follows from what both faces receive,
/// of which a pixel knows one.
physics::Result<void> check_no_sheets(const scene::ScenarioDesc& scenario,
                                      const scene::SceneGeometry& geometry) {
  if (scenario.thermal.model != scene::ThermalModel::foster) return {};
  const std::vector<std::uint32_t> sheets = scene::materials_of_sheets(geometry);
  if (sheets.empty()) return {};
  std::string names;
  for (const std::uint32_t m : sheets) {
    names += fmt::format("{}'{}'", names.empty() ? "" : ", ", geometry.materials[m].name);
  }
  return physics::make_error(
      physics::ErrorCode::config,
      fmt::format(
          "{}: thin double-sided faces of {} are sheets, whose two sides share a "
          "temperature. thermal.method = \"per-frame\" does not compute that with the model "
          "foster: use \"cached\", or make the faces single-sided",
          scenario.file.string(), names));
}

/// Material table of the shaders for either thermal model.
std::vector<gpu::MaterialParams> make_material_params(const scene::ScenarioDesc& scenario,
                                                      std::span<const scene::Material> materials,
                                                      const std::optional<FosterHistory>& foster) {
  std::vector<gpu::MaterialParams> params =
      material_params(materials, scenario, physics::kReferenceK);
  add_resistances(foster, params);
  return params;
}

}  // namespace

physics::Result<std::unique_ptr<ThermalStage>> PerFrameStage::create(
    const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
    std::vector<FosterMaterial> foster_materials, const SceneHistory& history) {
  if (auto checked = check_no_sheets(scenario, geometry); !checked) {
    return tl::unexpected(std::move(checked.error()));
  }
  const std::uint32_t width_px = scenario.sensor.width_px;
  const std::uint32_t height_px = scenario.sensor.height_px;
  auto occlusion = OcclusionPass::create(width_px, height_px);
  if (!occlusion) return tl::unexpected(std::move(occlusion.error()));
  auto shadow = ShadowPass::create(scenario.thermal.shadow_map_px, scenario.thermal.max_cascades);
  if (!shadow) return tl::unexpected(std::move(shadow.error()));
  auto thermal =
      ThermalPass::create(width_px, height_px, scenario.thermal, foster_groups(foster_materials));
  if (!thermal) return tl::unexpected(std::move(thermal.error()));
  return std::unique_ptr<ThermalStage>(
      new PerFrameStage(scenario, std::move(geometry), std::move(foster_materials), history,
                        Passes{std::move(*occlusion), std::move(*shadow), std::move(*thermal)}));
}

PerFrameStage::PerFrameStage(const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
                             std::vector<FosterMaterial> foster_materials,
                             const SceneHistory& history, Passes passes)
    : options_(scenario.thermal),
      history_(history),
      materials_(geometry.materials),
      plan_(scenario.thermal),
      foster_(make_foster(scenario, std::move(foster_materials), history.environment,
                          physics::kReferenceK, DryGrounds::skipped, StartNodes::all)),
      tail_steps_(foster_ ? static_cast<std::uint32_t>(foster_->tail().size()) : 0),
      drawn_(std::move(geometry), histories_of_objects(scenario),
             (scenario.thermal.steps + 1) * scenario.thermal.max_cascades),
      passes_(std::move(passes)),
      step_params_(scenario.thermal.steps + 1 + tail_steps_),
      relaxation_params_(materials_.size() * (scenario.thermal.steps + tail_steps_) *
                         (foster_ ? EMIT_FOSTER_ENTRIES : 1)),
      shadow_commands_(scenario.thermal.steps + 1),
      step_buffer_(gl::Buffer::dynamic(step_params_.size() * sizeof(StepSlot))),
      relaxation_buffer_(
          gl::Buffer::dynamic(relaxation_params_.size() * sizeof(gpu::RelaxationParams))),
      tap_buffer_(make_tap_buffer(scenario.thermal)),
      material_buffer_(gl::Buffer::from(std::span<const gpu::MaterialParams>(
          make_material_params(scenario, materials_, foster_)))),
      spin_up_buffer_(make_spin_up_buffer(foster_)),
      relaxation_table_(GL_RGBA32F, relaxation_buffer_),
      material_table_(GL_RGBA32F, material_buffer_),
      spin_up_table_(GL_RGBA32F, spin_up_buffer_) {}

void PerFrameStage::prepare(const FrameRequest& request, CameraSetup& camera,
                            gpu::FrameParams& frame) noexcept {
  // Plan the intervals of the history up to the thermal instant.
  plan_.update(request.thermal_time_ns, history_.environment, history_.entities);
  forcing_now_ = plan_.forcing_now();
  // Advance the extended model on the CPU: surroundings and, if needed, the spin-up table.
  bool table_changed = false;
  if (foster_) {
    table_changed = foster_->update(plan_, history_.environment);
    forcing_now_.environment_k = foster_->surroundings_now_k();
    frame.spin_up_nodes = foster_->grid_nodes();
  }
  prepare_steps(request, camera);
  if (foster_) prepare_foster(table_changed);
}

void PerFrameStage::prepare_foster(bool table_changed) noexcept {
  // Define how one step is filled in: its drive, and gains in the part of the table that `entry`
  // names.
  const auto materials = foster_->materials();
  const std::size_t stride = materials.size() * EMIT_FOSTER_ENTRIES;
  const auto set = [&](const IntervalForcing& forcing, std::size_t entry, gpu::StepParams& params) {
    set_foster_forcing(forcing, physics::kReferenceK, params);
    set_foster_gains(forcing, materials,
                     std::span(relaxation_params_).subspan(entry * stride, stride));
    params.relaxation_offset = static_cast<std::uint32_t>(entry * stride);
  };
  // Fill in the intervals of the history.
  const auto intervals = foster_->intervals();
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    set(intervals[i], i, step_params_[i].params);
  }
  // Fill in the steps between the spin-up table and the history, which have no shadow map.
  const auto tail = foster_->tail();
  for (std::size_t i = 0; i < tail.size(); ++i) {
    gpu::StepParams& params = step_params_[intervals.size() + 1 + i].params;
    params.cascade_count = 0;
    params.flags = EMIT_STEP_UNSHADED | (i == 0 ? EMIT_STEP_FIRST : 0U);
    set(tail[i], intervals.size() + i, params);
  }
  // Let the states continue from the tail into the history.
  if (!tail.empty()) step_params_[0].params.flags &= ~EMIT_STEP_FIRST;
  if (table_changed) spin_up_buffer_.upload(foster_->table());
}

void PerFrameStage::prepare_steps(const FrameRequest& request, CameraSetup& camera) noexcept {
  const scene::Aabb& bounds = drawn_.lists.bounds();
  const physics::SunPosition& sun = plan_.sun_now();
  const bool sun_up = sun.elevation.value() > StepPlan::kMinSunElevationRad;
  const auto intervals = plan_.intervals();
  const auto steps = static_cast<std::uint32_t>(intervals.size());
  const auto material_count = static_cast<std::uint32_t>(materials_.size());
  // Define how one interval is filled in.
  const auto add_step = [&](const HistoryInterval& interval, std::uint32_t step, bool last) {
    // Pose the casters of that time. They may have stood where nothing stands now, and higher.
    scene::Aabb casters = bounds;
    if (interval.sun_up) {
      casters.add(drawn_.lists.pose_entities(interval.sample_ns, interval.begin_ns, interval.end_ns,
                                             history_.entities));
    }
    if (!casters.empty()) {
      camera.view.casters_min_m = casters.min_m;
      camera.view.casters_max_m = casters.max_m;
    }
    // Fit the light frusta and list the draws into their maps.
    const LightFrusta frusta =
        set_step(interval, camera, options_, step == 0, last,
                 std::min(step, steps - 1) * material_count, step_params_[step].params);
    shadow_commands_[step] = {};
    if (frusta.count == 0) return;
    for (std::uint32_t c = 0; c < frusta.count; ++c) {
      shadow_commands_[step][c] = drawn_.lists.cull_light(frusta.cascades[c]);
    }
  };
  // Fill in all intervals; the published model also needs their gains.
  for (std::uint32_t step = 0; step < steps; ++step) {
    add_step(intervals[step], step, step + 1 == steps);
    if (foster_) continue;
    set_relaxation(intervals[step], materials_,
                   std::span(relaxation_params_).subspan(step * material_count, material_count));
  }

  // Decide whether reflected sunlight needs the shade of the instant of the frame: the newest
  // interval is too long, an entity appeared or vanished in it, or an entity moved too far.
  const HistoryInterval& newest = intervals.back();
  extra_sun_pass_ = sun_up && newest.end_ns - newest.begin_ns > kFreshShadeNs;
  for (const PoseHistory& history : history_.entities) {
    const auto events = history.events_ns();
    const bool changed = std::any_of(events.begin(), events.end(), [&](std::int64_t event_ns) {
      return event_ns > newest.begin_ns && event_ns <= request.sim_time_ns;
    });
    extra_sun_pass_ = extra_sun_pass_ ||
                      (sun_up && (changed || history.path_m(newest.begin_ns, request.sim_time_ns) >
                                                 kFreshCasterM));
  }
  // Fill in the instant of the frame.
  if (extra_sun_pass_) add_step(instant_interval(plan_, request.sim_time_ns), steps, true);
}

void PerFrameStage::upload() noexcept {
  // Send the draws, the steps and their gains.
  drawn_.upload();
  step_buffer_.upload(std::span<const StepSlot>(step_params_));
  relaxation_buffer_.upload(std::span<const gpu::RelaxationParams>(relaxation_params_));
}

void PerFrameStage::bind() const noexcept {
  // Bind the tables.
  tap_buffer_.bind_uniform(EMIT_BIND_TAPS);
  material_table_.bind(EMIT_TEX_MATERIALS);
  relaxation_table_.bind(EMIT_TEX_RELAXATION);
  spin_up_table_.bind(EMIT_TEX_SPIN_UP);
  // Bind the textures of the passes.
  passes_.occlusion.bind_texture();
  passes_.shadow.bind_texture();
  passes_.thermal.bind_textures();
}

void PerFrameStage::bind_step(std::uint32_t step) const noexcept {
  step_buffer_.bind_uniform(EMIT_BIND_STEP, step * sizeof(StepSlot), sizeof(gpu::StepParams));
}

void PerFrameStage::draw_shadow(std::uint32_t step) noexcept {
  bind_step(step);
  for (std::uint32_t c = 0; c < step_params_[step].params.cascade_count; ++c) {
    passes_.shadow.draw(drawn_.vertices, c, drawn_.lists.light_commands(shadow_commands_[step][c]));
  }
}

void PerFrameStage::draw(const glm::uvec2& size_px, StageTimes& stages,
                         StageClock& clock) noexcept {
  // Compute the obscurance once for all steps.
  passes_.occlusion.dispatch(size_px);
  clock.mark(stages.occlusion_ms);
  const auto steps = static_cast<std::uint32_t>(plan_.intervals().size());
  // Advance through the spin-up tail.
  for (std::uint32_t i = 0; i < tail_steps_; ++i) {
    bind_step(steps + 1 + i);
    passes_.thermal.dispatch_step(size_px);
    clock.mark(stages.thermal_ms);
  }
  // Advance through the history: one shadow map and one thermal step per interval.
  for (std::uint32_t step = 0; step < steps; ++step) {
    draw_shadow(step);
    clock.mark(stages.shadow_ms);
    passes_.thermal.dispatch_step(size_px);
    clock.mark(stages.thermal_ms);
  }
  // Store the shade of the instant of the frame.
  if (extra_sun_pass_) {
    draw_shadow(steps);
    clock.mark(stages.shadow_ms);
    passes_.thermal.dispatch_sun_only(size_px);
    clock.mark(stages.thermal_ms);
  }
}

}  // namespace emit::renderer
