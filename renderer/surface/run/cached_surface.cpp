// SPDX-License-Identifier: Apache-2.0
#include "surface/run/cached_surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <utility>

#include "emit/physics/check.hpp"
#include "surface/mesh/drawn_mesh.hpp"
#include "surface/run/weather_change.hpp"
#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {
namespace {

/// Samples in one task of a parallel loop.
constexpr std::size_t kGrain = 32;
/// Rise of apparent temperature in K that a tenth of the sun's light causes by reflection between 3
/// and 5 um, on a surface of 300 K.
constexpr float kSunK = 5.0F;
/// Largest number of intervals that are made up for one by one after a jump of sim time.
constexpr std::int64_t kMaxIntervals = 16;
/// Events closer than this after a node belong to the node. The second limit is a fraction of an
/// interval and holds for events that are known in advance, so that many events do not make many
/// intervals.
constexpr std::int64_t kSameNs = 1'000'000;
constexpr std::int64_t kSameFraction = 16;
/// Fraction of an interval over which node 1 is computed anew after the host has changed the
/// weather.
constexpr std::int64_t kRenewalFraction = 8;
/// Fraction of an interval that is the length of the interval after such a change, if it matters.
constexpr std::int64_t kAnswerFraction = 4;
/// Number of frames over which node 1 is computed anew while sim time stands still.
constexpr std::int64_t kHeldFrames = 64;

/// Box of each entity's geometry in the axes of its body.
std::vector<scene::Aabb> entity_boxes_m(const scene::SceneGeometry& geometry, std::size_t entities,
                                        std::span<const std::int32_t> entity_of_object) {
  std::vector<scene::Aabb> boxes(entities);
  for (const scene::Instance& instance : geometry.instances) {
    const std::int32_t entity = entity_of_object[instance.object];
    if (entity < 0) continue;
    boxes[static_cast<std::size_t>(entity)].add(
        scene::transformed(geometry.meshes[instance.mesh].bounds, instance.body_from_mesh));
  }
  return boxes;
}

/// Radius of each entity's geometry around the origin of its body, in m.
std::vector<float> entity_radii_m(const scene::SceneGeometry& geometry, std::size_t entities,
                                  std::span<const std::int32_t> entity_of_object) {
  std::vector<float> radius_m(entities, 0.0F);
  for (const scene::Instance& instance : geometry.instances) {
    const std::int32_t entity = entity_of_object[instance.object];
    if (entity < 0) continue;
    const scene::Aabb box =
        scene::transformed(geometry.meshes[instance.mesh].bounds, instance.body_from_mesh);
    if (box.empty()) continue;
    const glm::dvec3 farthest = glm::max(glm::abs(box.min_m), glm::abs(box.max_m));
    float& radius = radius_m[static_cast<std::size_t>(entity)];
    radius = std::max(radius, static_cast<float>(glm::length(farthest)));
  }
  return radius_m;
}

/// The thermal model that the scenario names.
SampleHeat heat_of(const scene::ThermalOptions& options, std::span<const scene::Material> materials,
                   std::span<const FosterMaterial> networks, double reference_k) {
  if (options.model == scene::ThermalModel::emit2014) {
    return SampleHeat(Emit2014Heat(materials, options.initial_k, reference_k));
  }
  return SampleHeat(FosterHeat(networks, reference_k, std::min(0.02, 0.2 * options.tolerance_k)));
}

}  // namespace

CachedSurface::CachedSurface(const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
                             std::vector<std::int32_t> entity_of_object,
                             std::span<const FosterMaterial> networks, CasterRays places,
                             std::optional<SurfaceDetail> detail, double reference_k)
    : geometry_(std::move(geometry)),
      materials_(geometry_.materials),
      options_(scenario.thermal),
      entity_of_object_(std::move(entity_of_object)),
      places_(std::move(places)),
      detail_(std::move(detail)),
      extended_(scenario.thermal.model == scene::ThermalModel::foster),
      heat_(heat_of(scenario.thermal, materials_, networks, reference_k)),
      interval_(heat_.sized_interval()),
      workers_(threads::WorkerPool::all_cores()),
      interval_ns_(std::max<std::int64_t>(1, std::llround(scenario.thermal.first_step_s * 1e9))) {
  const auto entities = static_cast<std::size_t>(
      std::ranges::count_if(entity_of_object_, [](std::int32_t m) { return m >= 0; }));
  interval_rays_.emplace(entity_radii_m(geometry_, entities, entity_of_object_),
                         heat_.sky_measure());
  shadow_maps_ = EntityShadowMaps(entity_boxes_m(geometry_, entities, entity_of_object_));
}

physics::Result<std::unique_ptr<CachedSurface>> CachedSurface::create(
    const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
    std::vector<std::int32_t> entity_of_object, std::span<const FosterMaterial> networks,
    double reference_k, std::optional<SurfaceDetail> detail) {
  auto rays = CasterRays::create(
      geometry, detail ? std::optional(detail->rays().origin_world_m()) : std::nullopt);
  if (!rays) return tl::unexpected(std::move(rays.error()));
  // Check that the rays number the entities like the scenario does.
  std::size_t entity = 0;
  for (std::size_t object = 0; object < scenario.objects.size(); ++object) {
    if (scenario.objects[object].entity_id == 0) continue;
    if (entity >= rays->entities() || rays->object_of_entity(entity) != object) {
      return physics::make_error(
          physics::ErrorCode::config,
          fmt::format("entity object '{}' has no triangles", scenario.objects[object].name));
    }
    ++entity;
  }
  return std::unique_ptr<CachedSurface>(
      new CachedSurface(scenario, std::move(geometry), std::move(entity_of_object), networks,
                        std::move(*rays), std::move(detail), reference_k));
}

void CachedSurface::place_entities(std::int64_t now_ns, std::span<const PoseHistory> entities) {
  entities_now_.resize(entities.size());
  for (std::size_t m = 0; m < entities.size(); ++m) {
    const TrajectoryState state = entities[m].at(now_ns);
    entities_now_[m] = {glm::mat3(glm::mat3_cast(state.pose.world_from_body)),
                        glm::vec3(state.pose.position_world_m - rays().origin_world_m()), state.on};
  }
}

std::vector<std::vector<glm::vec3>> CachedSurface::ways_m(
    std::int64_t from_ns, std::span<const PoseHistory> entities) const {
  std::vector<std::vector<glm::vec3>> ways;
  const auto rel_m = [&](const physics::Pose& pose) {
    return glm::vec3(pose.position_world_m - rays().origin_world_m());
  };
  for (const PoseHistory& entity : entities) {
    std::vector<glm::vec3>& way = ways.emplace_back();
    way.push_back(rel_m(entity.at(from_ns).pose));
    for (const scene::Keyframe& key : entity.script()) {
      if (key.sim_time_ns > from_ns) way.push_back(rel_m(key.pose));
    }
  }
  return ways;
}

bool CachedSurface::stale(std::int64_t now_ns) const noexcept {
  if (!model_) return true;
  // Let the first interval stand for all time before the history, because nothing changes there.
  const std::int64_t begin_ns = nodes_[storage(0)].at_ns;
  return (now_ns < begin_ns && begin_ns > options_.history_start_ns) ||
         now_ns > nodes_[storage(1)].at_ns + kMaxIntervals * interval_ns_;
}

std::int64_t CachedSurface::take_weather_change(const Environment& environment) noexcept {
  return environment.changed_since_ns(std::exchange(revision_, environment.revision()));
}

std::int64_t CachedSurface::next_node_ns(std::int64_t from_ns, std::int64_t now_ns,
                                         const Inputs& inputs) const noexcept {
  // Take the next instant of the grid, or the one after it if that is too close.
  const std::int64_t into_ns = (from_ns - options_.history_start_ns) % interval_ns_;
  std::int64_t next_ns = from_ns + interval_ns_ - into_ns;
  now_ns = std::clamp(now_ns, from_ns, next_ns);
  if (next_ns - now_ns < interval_ns_ / 4) next_ns += interval_ns_;
  // Cut the interval at the first event that is known in advance.
  const auto cut = [&](std::span<const std::int64_t> instants_ns) {
    const auto after = std::ranges::lower_bound(
        instants_ns, now_ns + std::max(kSameNs, interval_ns_ / kSameFraction));
    if (after != instants_ns.end()) next_ns = std::min(next_ns, *after);
  };
  for (const PoseHistory& entity : inputs.entities) cut(entity.events_ns());
  cut(inputs.environment.changes_ns());
  return next_ns;
}

SurfaceInputs CachedSurface::surface_inputs(const HistoryRecord& record,
                                            const SurfaceHistory& history,
                                            std::span<const std::vector<glm::vec3>> ways_m) const {
  return {geometry_,
          materials_,
          entity_of_object_,
          rays(),
          places_,
          heat_,
          history,
          record,
          entities_now_,
          detail_ ? &*detail_ : nullptr,
          ways_m};
}

physics::Result<SurfaceModel> CachedSurface::warm_up(const ModelWork& work) const {
  work.plan.update(work.start_ns, work.inputs.environment, work.inputs.entities);
  work.history.update(work.plan, work.inputs.environment);
  const HistoryRecord record =
      make_history_record(work.plan, work.history, record_inputs(work.inputs));
  const std::vector<std::vector<glm::vec3>> ways_m =
      this->ways_m(work.start_ns, work.inputs.entities);
  auto model = build_surface_model(surface_inputs(record, work.history, ways_m), work.view,
                                   work.options, work.progress);
  if (!model) return model;
  model->at_ns = work.start_ns;
  model->eyes = work.view.eyes;
  return model;
}

StateKey CachedSurface::key_of(const ModelWork& work, const Saved& saved) {
  StateKey key = saved.key;
  key[static_cast<std::size_t>(StatePart::live)] =
      live_hash(work.start_ns, work.inputs.environment, work.inputs.entities);
  return key;
}

physics::Result<std::optional<SurfaceModel>> CachedSurface::take_saved(const ModelWork& work,
                                                                       const Saved& saved) const {
  auto read = read_state(saved.file, {key_of(work, saved), work.start_ns}, geometry_,
                         entities_now_.size(), work.options);
  if (!read) {
    if (!saved.start) return std::nullopt;
    return tl::unexpected(std::move(read.error()));
  }
  // Refuse a state for another camera.
  if (saved.fits_camera && !saved.fits_camera(read->eyes)) {
    if (!saved.start) return std::nullopt;
    return physics::make_error(
        physics::ErrorCode::config,
        fmt::format("thermal.state_file {}: the surface in it was refined for other places of the "
                    "camera than that of the first frame. Remove it to have it made anew",
                    saved.file.string()));
  }

  // Bring plan and history to the instant of the state.
  work.plan.update(read->at_ns, work.inputs.environment, work.inputs.entities);
  work.history.update(work.plan, work.inputs.environment);
  return std::move(*read);
}

physics::Result<CachedSurface::MadeModel> CachedSurface::make_model(
    const ModelWork& work, const std::optional<Saved>& saved) const {
  // Read the file if it exists. An error of the look-up is left to read_state(), which reports it.
  std::error_code error;
  if (saved && (std::filesystem::exists(saved->file, error) || error)) {
    auto taken = take_saved(work, *saved);
    if (!taken) return tl::unexpected(std::move(taken.error()));
    if (*taken) return MadeModel{std::move(**taken), false};
  }
  const bool writes = saved && saved->start;
  // Test the file before the long work, not after it.
  if (writes) {
    if (auto writable = check_state_writable(saved->file); !writable) {
      return tl::unexpected(std::move(writable.error()));
    }
  }
  auto model = warm_up(work);
  if (!model) return tl::unexpected(std::move(model.error()));
  return MadeModel{std::move(*model), writes};
}

float CachedSurface::first_sun_frac(std::uint32_t sample) const {
  const bool moves = !entities_now_.empty() && model_->samples.samples[sample].entity < 0;
  return node(moves ? 1 : 0).outputs[sample].sun_frac;
}

std::vector<DrawnMesh> CachedSurface::make_drawn_meshes() const {
  std::vector<scene::Mesh> meshes;
  for (std::size_t m = 0; m < geometry_.meshes.size(); ++m) {
    meshes.push_back(refined_copy(geometry_.meshes[m], model_->meshes[m], materials_));
  }
  // Judge levels by the shown temperature, with reflected sunlight counted in.
  const SurfaceNode& first = node(0);
  std::vector<float> value_k(model_->drawn_samples);
  for (std::uint32_t i = 0; i < model_->drawn_samples; ++i) {
    value_k[i] = first.outputs[i].offset_k + kSunK * first_sun_frac(i);
  }
  std::vector<VertexValues> values(meshes.size());
  for (std::size_t i = 0; i < geometry_.instances.size(); ++i) {
    const std::uint32_t m = geometry_.instances[i].mesh;
    values[m].push_back(
        std::span(value_k).subspan(model_->first_sample[i], meshes[m].positions_m.size()));
  }
  return drawn_meshes(std::move(meshes), values);
}

physics::Result<void> CachedSurface::save(const ModelWork& work, const Saved& saved) {
  std::swap(model_->states, node(0).states);
  std::swap(model_->outputs, node(0).outputs);
  auto written = write_state(saved.file, key_of(work, saved), *model_);
  std::swap(model_->states, node(0).states);
  std::swap(model_->outputs, node(0).outputs);
  return written;
}

physics::Result<void> CachedSurface::prepare(std::int64_t now_ns, const RefineView& view,
                                             const Inputs& inputs, StepPlan& plan,
                                             SurfaceHistory& history,
                                             const std::optional<Saved>& saved,
                                             const SurfaceProgress& progress) {
  // Start at the node of the grid at or before now.
  const std::int64_t start_ns =
      options_.history_start_ns +
      std::max<std::int64_t>(0, now_ns - options_.history_start_ns) / interval_ns_ * interval_ns_;
  place_entities(start_ns, inputs.entities);
  SurfaceModelOptions options;
  options.tolerance_k = options_.tolerance_k;
  options.max_samples = options_.max_samples;
  // Leave lateral conduction and exchange out of the published model: it conducts straight down and
  // knows no other surface.
  options.lateral = extended_ && options_.lateral;
  options.exchange = extended_ && options_.exchange;
  const ModelWork work{start_ns, view, inputs, plan, history, options, progress};
  auto made = make_model(work, saved);
  if (!made) return tl::unexpected(std::move(made.error()));
  offsets_ = ray_offsets(geometry_);
  model_ = std::move(made->model);
  if (options.exchange) {
    exitance_ = EntityExitance(*model_, geometry_, entity_of_object_);
    faces_.assign(entities_now_.size(), {});
  }

  // Take the memory of the nodes.
  const std::size_t count = model_->samples.samples.size();
  for (SurfaceNode& node : nodes_) {
    node.states.assign(count, {});
    node.outputs.assign(count, {});
    node.vertices.assign(model_->drawn_samples, {});
  }
  // Complete nodes 0 and 1, and begin node 2, before the first frame.
  ring_ = 0;
  SurfaceNode& first = node(0);
  first.states = std::move(model_->states);
  first.outputs = std::move(model_->outputs);
  first.at_ns = start_ns;
  first.surroundings = history.surroundings();
  first.surroundings_k = history.surroundings_now_k();
  (void)take_weather_change(inputs.environment);
  weather_change_ns_ = kNoChange;
  renewing_ = false;
  lags_ = false;
  last_now_ns_ = now_ns;
  local_ =
      LocalSteps(model_->samples,
                 LocalSteps::Setup{options_.history_start_ns, interval_ns_, inputs.entities.size()},
                 *interval_rays_, heat_.sized_interval());
  local_->restart(start_ns);
  turn_ = static_cast<std::uint32_t>(plan.intervals().size());
  begin_anew(0, inputs, history);
  compute(0, static_cast<std::uint32_t>(count));
  // Save the surface before the outputs of node 0 change.
  if (model_->drawn.empty()) model_->drawn = make_drawn_meshes();
  if (made->to_save) {
    if (auto written = save(work, *saved); !written) return written;
  }
  // Replace the model's shares of the sun, which include the shade of entities, by those of the
  // first interval, which do not.
  for (std::uint32_t i = 0; i < model_->drawn_samples; ++i) {
    first.outputs[i].sun_frac = first_sun_frac(i);
    first.vertices[i] = {first.outputs[i].offset_k, first.outputs[i].sun_frac};
  }
  begin_anew(1, inputs, history);
  share_begin_ns_ = node(0).at_ns;
  share_end_ns_ = node(1).at_ns;
  for (SurfaceNode& node : nodes_) {
    node.changes.clear();
    node.changes.add(0, model_->drawn_samples);
  }
  begin_shade(start_ns, inputs);
  return {};
}

std::uint64_t CachedSurface::sample_bytes() const noexcept {
  const auto bytes = [](const auto& values) { return values.capacity() * sizeof(values[0]); };
  std::uint64_t sum = 0;
  if (model_) sum = bytes(model_->samples.samples) + bytes(model_->samples.seen);
  for (const SurfaceNode& node : nodes_) {
    sum += bytes(node.states) + bytes(node.outputs) + bytes(node.vertices);
  }
  return sum;
}

void CachedSurface::begin_interval(std::size_t index, const Inputs& inputs,
                                   SurfaceHistory& history) noexcept {
  const SurfaceNode& from = node(index);
  SurfaceNode& to = node(index + 1);
  // Fill the forcing, which also advances the surroundings to the end of the interval.
  history.restore_surroundings(from.surroundings);
  interval_.forcing = history.extend(from.at_ns, to.at_ns, inputs.environment);
  to.forcing = interval_.forcing;
  to.surroundings = history.surroundings();
  to.surroundings_k = history.surroundings_now_k();
  heat_.prepare(interval_);
  // Send the rays with the poses that are known now.
  interval_rays_->update(from.at_ns, to.at_ns, turn_++, inputs.environment,
                         EntityPoses(inputs.entities), rays().origin_world_m());
  local_->send_rays(index, inputs.entities);
  exitance_.measure(
      model_->samples, *interval_rays_,
      [&from](std::size_t sample) { return from.outputs[sample].longwave_out_w_m2; }, faces_);
  done_ = 0;
}

void CachedSurface::compute(std::size_t index, std::uint32_t last) noexcept {
  const SurfaceNode& from = node(index);
  SurfaceNode& to = node(index + 1);
  const SurfaceStep step = this->step();
  const std::uint32_t first = done_;
  if (last <= first) return;
  const auto keep = [&to](std::size_t i, const SampleState& state, const SampleOutput& output) {
    to.states[i] = state;
    to.outputs[i] = output;
    if (i < to.vertices.size()) to.vertices[i] = {output.offset_k, output.sun_frac};
  };
  // Step the samples on all cores. During a renewal LocalSteps steps its own blocks.
  workers_.run(last - first, kGrain, [&](std::size_t begin, std::size_t end) {
    SteppedSample stepped;
    for (auto i = static_cast<std::uint32_t>(first + begin); i < first + end; ++i) {
      if (!steps_itself(step.all, i) || (renewing_ && local_->has_own_clock(i))) continue;
      stepped.state = from.states[i];
      step_sample(step, *interval_rays_, interval_, from.outputs, i, stepped);
      keep(i, stepped.state, stepped.output);
      const std::uint32_t behind = step.all.samples[i].other_side;
      if (behind != kNoSample) keep(behind, stepped.state, stepped.behind);
    }
  });
  done_ = last;
  const auto drawn = static_cast<std::uint32_t>(to.vertices.size());
  to.changes.add(std::min(first, drawn), std::min(last, drawn) - std::min(first, drawn));
}

void CachedSurface::cut_at(std::int64_t event_ns, std::int64_t end_ns) noexcept {
  SurfaceNode& first = node(0);
  SurfaceNode& second = node(1);
  const auto way_of = [&](std::int64_t at_ns) {
    return static_cast<double>(at_ns - first.at_ns) /
           static_cast<double>(second.at_ns - first.at_ns);
  };
  // Move states, outputs and vertices of each sample along the line between the nodes.
  const double frac = way_of(event_ns);
  const double end_frac = way_of(end_ns);
  workers_.run(first.states.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (auto i = static_cast<std::uint32_t>(begin); i < end; ++i) {
      if (frac > 0.0 && !local_->has_own_clock(i)) {
        first.states[i] = between(first.states[i], second.states[i], frac);
        first.outputs[i] = between(first.outputs[i], second.outputs[i], frac);
      }
      if (i >= first.vertices.size()) continue;
      const SampleVertex from = first.vertices[i];
      SampleVertex& to = second.vertices[i];
      first.vertices[i] = {between(from.offset_k, to.offset_k, frac),
                           between(from.sun_frac, to.sun_frac, frac)};
      to.offset_k = between(from.offset_k, to.offset_k, end_frac);
    }
  });
  first.surroundings = between(first.surroundings, second.surroundings, frac);
  if (first.surroundings_k && second.surroundings_k) {
    first.surroundings_k = between(*first.surroundings_k, *second.surroundings_k, frac);
  }
  first.at_ns = event_ns;
  second.at_ns = end_ns;
  for (SurfaceNode* node : {&first, &second}) {
    node->changes.add(0, static_cast<std::uint32_t>(node->vertices.size()));
  }
}

void CachedSurface::begin_anew(std::size_t index, const Inputs& inputs,
                               SurfaceHistory& history) noexcept {
  const std::int64_t from_ns = node(index).at_ns;
  std::int64_t end_ns = next_node_ns(from_ns, from_ns, inputs);
  // Answer a change of the weather with a short interval.
  if (std::ranges::binary_search(inputs.environment.changes_ns(), from_ns)) {
    end_ns = std::min(end_ns, from_ns + interval_ns_ / kAnswerFraction);
  }
  node(index + 1).at_ns = end_ns;
  begin_interval(index, inputs, history);
}

void CachedSurface::begin_renewal(std::int64_t event_ns, std::int64_t now_ns, const Inputs& inputs,
                                  SurfaceHistory& history) noexcept {
  if (event_ns < node(0).at_ns + kSameNs) event_ns = node(0).at_ns;
  lags_ = weather_matters(node(1), now_ns, inputs.environment, options_.tolerance_k);
  std::int64_t end_ns = next_node_ns(event_ns, now_ns, inputs);
  // Shorten the interval after a change that matters: surfaces answer like the root of time at
  // first, which a line over a whole interval does not follow.
  if (lags_) end_ns = std::min(end_ns, std::max(event_ns, now_ns) + interval_ns_ / kAnswerFraction);
  local_->take_weather_change(event_ns, window(), model_->samples);
  cut_at(event_ns, end_ns);
  begin_interval(0, inputs, history);
  renewing_ = true;
  // Make up for the time since the latest frame in this frame.
  share_begin_ns_ = std::max(event_ns, last_now_ns_);
  share_end_ns_ =
      share_begin_ns_ + std::min(interval_ns_ / kRenewalFraction, (end_ns - now_ns) / 2);
}

void CachedSurface::end_renewal(std::int64_t now_ns, const Inputs& inputs,
                                SurfaceHistory& history) noexcept {
  // Compute the rest of node 1, then begin node 2 anew from there.
  compute(0, static_cast<std::uint32_t>(model_->samples.samples.size()));
  renewing_ = false;
  lags_ = weather_change_ns_ <= now_ns &&
          weather_matters(node(1), now_ns, inputs.environment, options_.tolerance_k);
  node(2).changes.clear();
  begin_anew(1, inputs, history);
  share_begin_ns_ = now_ns;
  share_end_ns_ = node(1).at_ns;
}

void CachedSurface::take_weather(std::int64_t now_ns, const Inputs& inputs,
                                 SurfaceHistory& history) noexcept {
  // Merge the newest change with what waits already.
  const std::int64_t newest_ns = take_weather_change(inputs.environment);
  if (newest_ns != kNoChange) local_->discard_foreseen(newest_ns);
  weather_change_ns_ = std::min(weather_change_ns_, newest_ns);
  if (weather_change_ns_ == kNoChange) return;
  // Let a change wait while another one is being taken in.
  if (renewing_) {
    lags_ = lags_ || (weather_change_ns_ <= now_ns &&
                      weather_matters(node(1), now_ns, inputs.environment, options_.tolerance_k));
    return;
  }
  if (weather_change_ns_ >= node(2).at_ns) {
    weather_change_ns_ = kNoChange;
  } else if (weather_change_ns_ >= node(1).at_ns) {
    // Begin the next interval anew, unless the current one is about to end: then the change waits
    // for the next one.
    if (node(1).at_ns - now_ns < interval_ns_ / kRenewalFraction) return;
    begin_anew(1, inputs, history);
    share_begin_ns_ = now_ns;
    share_end_ns_ = node(1).at_ns;
    weather_change_ns_ = kNoChange;
  } else if (weather_change_ns_ <= now_ns) {  // later weather waits for its instant
    const SurfaceStep step = this->step();
    local_->run(std::min(now_ns, node(1).at_ns), window(), local_inputs(inputs, history, step));
    begin_renewal(std::exchange(weather_change_ns_, kNoChange), now_ns, inputs, history);
  }
}

std::uint32_t CachedSurface::share_at(std::int64_t now_ns) const noexcept {
  const auto count = static_cast<double>(model_->samples.samples.size());
  const auto way_ns =
      static_cast<double>(std::max<std::int64_t>(1, share_end_ns_ - share_begin_ns_));
  const double gone_frac = static_cast<double>(now_ns - share_begin_ns_) / way_ns;
  return static_cast<std::uint32_t>(std::ceil(std::clamp(gone_frac, 0.0, 1.0) * count));
}

void CachedSurface::advance(std::int64_t now_ns, const Inputs& inputs,
                            SurfaceHistory& history) noexcept {
  EMIT_CHECK(!stale(now_ns));
  shadow_maps_.begin_frame();
  const auto count = static_cast<std::uint32_t>(model_->samples.samples.size());
  const SurfaceStep step = this->step();
  const LocalSteps::Inputs local = local_inputs(inputs, history, step);
  // Take in new weather, then finish all intervals that end before now.
  take_weather(now_ns, inputs, history);
  while (now_ns > node(1).at_ns) {
    local_->run(node(1).at_ns, window(), local);
    if (renewing_) {
      end_renewal(node(1).at_ns, inputs, history);
      take_weather(now_ns, inputs, history);  // a change that came meanwhile moves the node
      continue;
    }
    local_->rotate(window(), model_->samples);
    compute(1, count);
    rotate();
    local_->rotated(window(), model_->samples);
    node(2).changes.clear();
    begin_anew(1, inputs, history);
    share_begin_ns_ = node(0).at_ns;
    share_end_ns_ = node(1).at_ns;
    take_weather(now_ns, inputs, history);  // a change may have waited for this interval
  }
  // Advance blocks on their own and exposure tiles to now.
  local_->run(now_ns, window(), local);
  shade_->run(now_ns, model_->samples,
              {inputs.environment, inputs.entities, rays(), workers_, shadow_maps_});
  const double fraction = static_cast<double>(now_ns - node(0).at_ns) /
                          static_cast<double>(node(1).at_ns - node(0).at_ns);
  fraction_ = static_cast<float>(std::clamp(fraction, 0.0, 1.0));
  if (renewing_ && now_ns == last_now_ns_) {
    // Continue with node 1 while sim time stands still, by moving the time of its shares.
    const std::int64_t step_ns = (share_end_ns_ - share_begin_ns_) / kHeldFrames;
    share_begin_ns_ -= step_ns;
    share_end_ns_ -= step_ns;
  }
  last_now_ns_ = now_ns;
  // Compute the share of the samples that the passed time asks for.
  compute(renewing_ ? 0 : 1, share_at(now_ns));
  if (renewing_ && done_ == count) end_renewal(now_ns, inputs, history);
}

std::optional<double> CachedSurface::surroundings_now_k() const noexcept {
  const SurfaceNode& before = node(0);
  const SurfaceNode& after = node(1);
  if (!before.surroundings_k || !after.surroundings_k) return std::nullopt;
  return between(*before.surroundings_k, *after.surroundings_k, static_cast<double>(fraction_));
}

void CachedSurface::forget_changes() noexcept {
  shade_->forget_changes();
  for (SurfaceNode& node : nodes_) node.changes.clear();
}

SampledScene CachedSurface::take_drawn_scene() {
  EMIT_CHECK(model_.has_value());
  EMIT_CHECK_OP(model_->drawn.size(), ==, geometry_.meshes.size());
  SampledScene scene{geometry_, {}, {}, {}};
  scene::SceneGeometry& out = scene.geometry;
  // Group the instances by mesh.
  std::vector<std::uint32_t> order(out.instances.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::stable_sort(order, {}, [&](std::uint32_t i) { return out.instances[i].mesh; });
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    out.instances[i] = geometry_.instances[order[i]];
    scene.first_sample.push_back(model_->first_sample[order[i]]);
  }
  // Replace the triangles and vertices of each mesh by the refined ones, in the order of clusters.
  for (std::size_t m = 0; m < out.meshes.size(); ++m) {
    out.meshes[m] = refined_copy(geometry_.meshes[m], model_->meshes[m], materials_);
    out.meshes[m].indices = std::move(model_->drawn[m].indices);
    scene.levels.push_back(std::move(model_->drawn[m].levels));
  }
  model_->drawn.clear();
  for (std::uint32_t i = 0; i < model_->drawn_samples; ++i) {
    scene.sky_frac.push_back(model_->samples.samples[i].sky_frac);
  }
  return scene;
}

}  // namespace emit::renderer
