// SPDX-License-Identifier: Apache-2.0
#include "surface/run/cached_surface.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "surface/run/weather_change.hpp"
#include "surface/shade/shade_response.hpp"

namespace emit::renderer {
namespace {

/// Largest number of intervals that are made up for one by one after a jump of sim time.
constexpr std::int64_t kMaxIntervals = 16;
/// A saved surface serves runs that start up to this much later. Shadows that have moved for longer
/// meet triangles that were not refined for them.
constexpr std::int64_t kServedNs = 900'000'000'000;
/// A saved surface serves runs that start up to this many intervals later. To sample it anew takes
/// less time than more of them.
constexpr std::int64_t kServedIntervals = 90;
/// Longest step of carry_on(). Exposure tiles take their normal steps over it, as they do between
/// frames.
constexpr std::int64_t kCarryNs = ExposureTiles::kTurnsPerFrame * ExposureTiles::kTurnNs;
/// Number of frames over which node 1 is computed anew while sim time stands still.
constexpr std::int64_t kHeldFrames = 64;

/// Progress of the warm-up when all samples are made, and when the levels of detail are made too.
/// The rest is the state file.
constexpr double kSampledFrac = 0.85;
constexpr double kLevelsFrac = 0.97;

/// The thermal model that the scenario names.
SampleHeat heat_of(const scene::ThermalOptions& options, std::span<const scene::Material> materials,
                   std::span<const FosterMaterial> networks, double reference_k) {
  if (options.model == scene::ThermalModel::emit2014) {
    return SampleHeat(Emit2014Heat(materials, options.initial_k, reference_k));
  }
  return SampleHeat(FosterHeat(networks, reference_k, std::min(0.02, 0.2 * options.tolerance_k)));
}

/// The grid of instants at which the intervals of a scenario begin.
NodeGrid grid_of(const scene::ThermalOptions& options) {
  return {options.history_start_ns,
          std::max<std::int64_t>(1, std::llround(options.first_step_s * 1e9))};
}

}  // namespace

CachedSurface::CachedSurface(const scene::ScenarioDesc& scenario, SurfaceGeometry geometry,
                             std::span<const FosterMaterial> networks, double reference_k)
    : geometry_(std::move(geometry)),
      options_(scenario.thermal),
      heat_(heat_of(scenario.thermal, geometry_.materials(), networks, reference_k)),
      grid_(grid_of(scenario.thermal)),
      workers_(threads::WorkerPool::all_cores()),
      interval_(geometry_, heat_),
      entity_shadows_(geometry_.entity_boxes_m(), geometry_.highest_static_m()) {}

physics::Result<std::unique_ptr<CachedSurface>> CachedSurface::create(
    const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
    std::vector<std::int32_t> entity_of_object, std::span<const FosterMaterial> networks,
    double reference_k, std::optional<SurfaceDetail> detail) {
  auto surface = SurfaceGeometry::create(scenario, std::move(geometry), std::move(entity_of_object),
                                         std::move(detail));
  if (!surface) return tl::unexpected(std::move(surface.error()));
  return std::unique_ptr<CachedSurface>(
      new CachedSurface(scenario, std::move(*surface), networks, reference_k));
}

SurfaceModelOptions CachedSurface::model_options() const noexcept {
  SurfaceModelOptions options;
  options.tolerance_k = options_.tolerance_k;
  options.max_samples = options_.max_samples;
  // Leave lateral conduction and exchange out of the published model: it conducts straight down and
  // knows no other surface.
  const bool extended = options_.model == scene::ThermalModel::foster;
  options.lateral = extended && options_.lateral;
  options.exchange = extended && options_.exchange;
  return options;
}

std::int64_t CachedSurface::earliest_ns(std::int64_t start_ns) const noexcept {
  return start_ns - std::min(kServedNs, kServedIntervals * grid_.interval_ns());
}

physics::Result<void> CachedSurface::prepare(std::int64_t now_ns, const RefineView& view,
                                             const Inputs& inputs, StepPlan& plan,
                                             SurfaceHistory& history,
                                             const std::optional<SavedSurface>& saved,
                                             const SurfaceProgress& progress) {
  EMIT_CHECK_OP(inputs.entities.size(), ==, geometry_.entities());
  // Make the model for the node of the grid at or before now, or take an earlier one.
  const std::int64_t latest_ns = grid_.at_or_before_ns(now_ns);
  const auto report = [&progress](double done_frac) -> physics::Result<void> {
    if (!progress || progress(done_frac)) return {};
    return physics::make_error(physics::ErrorCode::internal, "stopped while preparing the surface");
  };
  const SurfaceProgress sampling = [&progress](double done_frac) {
    return !progress || progress(kSampledFrac * done_frac);
  };
  const SurfaceWarmUp warm_up({geometry_, heat_, interval_.rays(), latest_ns,
                               earliest_ns(latest_ns), view, inputs, model_options(), sampling,
                               plan, history});
  auto made = warm_up.make(saved);
  if (!made) return tl::unexpected(std::move(made.error()));
  model_ = std::move(made->model);
  const std::int64_t start_ns = model_->at_ns;
  // Complete the first interval.
  begin_first_interval(start_ns, inputs, plan, history);
  fill_first_vertices(inputs.environment.clouds() != nullptr);
  // Save the surface before the outputs of node 0 change.
  const bool made_anew = model_->drawn.empty();
  if (made_anew) {
    model_->drawn = make_drawn_meshes(geometry_.geometry(), *model_,
                                      std::span(nodes_[0].vertices).first(model_->drawn_samples));
    if (auto go_on = report(kLevelsFrac); !go_on) return go_on;
  }
  if (made->to_save) {
    if (auto written = save(warm_up, *saved); !written) return written;
  }
  // Replace the model's shares of the sun, which include the shade of entities.
  for (std::uint32_t i = 0; i < model_->drawn_samples; ++i) {
    nodes_[0].outputs[i].sun_frac = nodes_[0].vertices[i].sun_frac;
  }
  // Begin the next interval.
  begin_next(start_ns, inputs, history);
  nodes_.mark_all_changed();
  begin_shade(start_ns, inputs);
  if (start_ns < latest_ns) {
    last_now_ns_ = start_ns;
    return carry_on(now_ns, inputs, history, progress);
  }
  last_now_ns_ = now_ns;
  return made_anew ? report(1.0) : physics::Result<void>();
}

physics::Result<void> CachedSurface::carry_on(std::int64_t now_ns, const Inputs& inputs,
                                              SurfaceHistory& history,
                                              const SurfaceProgress& progress) {
  EMIT_CHECK(model_.has_value());
  const std::int64_t from_ns = last_now_ns_;
  while (last_now_ns_ < now_ns) {
    const double done_frac =
        static_cast<double>(last_now_ns_ - from_ns) / static_cast<double>(now_ns - from_ns);
    if (progress && !progress(done_frac)) {
      return physics::make_error(physics::ErrorCode::internal,
                                 "stopped while carrying the surface on");
    }
    // Pass at most the end of one interval at a time.
    advance(std::min({now_ns, nodes_[2].at_ns, last_now_ns_ + kCarryNs}), inputs, history);
  }
  return {};
}

void CachedSurface::begin_first_interval(std::int64_t start_ns, const Inputs& inputs,
                                         const StepPlan& plan, SurfaceHistory& history) {
  // Move the states of the model into node 0.
  const BandLights* const lights = model_options().exchange ? inputs.lights : nullptr;
  nodes_.begin(std::move(model_->states), std::move(model_->outputs), model_->samples,
               model_->drawn_samples, model_->body_k, lights == nullptr ? 0 : lights->bands());
  SurfaceNode& first = nodes_[0];
  first.at_ns = start_ns;
  first.surroundings = history.surroundings();
  first.surroundings_k = history.surroundings_now_k();
  // Forget changes of the weather, which the model knows.
  (void)take_weather_change(inputs.environment);
  weather_change_ns_ = kNoChange;
  renewing_ = false;
  lags_ = false;
  // Note where the entities stand: views of their samples hold for there.
  const std::vector<float> radii_m = geometry_.entity_radii_m();
  anchors_.clear();
  for (std::size_t m = 0; m < inputs.entities.size(); ++m) {
    anchors_.push_back({inputs.entities[m].at(start_ns).pose, radii_m[m]});
  }
  // Let all blocks follow the intervals.
  interval_.reset(*model_, anchors_, model_options().exchange,
                  static_cast<std::uint32_t>(plan.intervals().size()), lights);
  local_ = LocalSteps(model_->samples,
                      LocalSteps::Setup{grid_.start_ns(), grid_.interval_ns(),
                                        inputs.entities.size(), inputs.parts},
                      interval_.rays(), heat_.sized_interval());
  local_->restart(start_ns);
  bodies_.reset();
  if (model_options().exchange && !inputs.entities.empty()) {
    bodies_.emplace(
        geometry_, *model_, anchors_,
        BodySurroundings::Grid{grid_.start_ns(), grid_.interval_ns(), local_->step_ns(), start_ns});
  }
  // Compute node 1.
  begin_anew(0, inputs, history);
  interval_.settle_bands(model_->samples, inputs, nodes_[0], nodes_[1], workers_);
  interval_.finish(nodes_[0], nodes_[1], model_->samples, nullptr, workers_);
}

void CachedSurface::fill_first_vertices(bool clouds) {
  SurfaceNode& first = nodes_[0];
  const std::vector<SurfaceSample>& all = model_->samples.samples;
  for (std::uint32_t i = 0; i < all.size(); ++i) {
    if (all[i].vertex == kNoSample) continue;
    const bool moves = clouds || (geometry_.entities() != 0 && all[i].entity < 0);
    first.vertices[all[i].vertex] = {first.outputs[i].offset_k, 0.0F,
                                     nodes_[moves ? 1 : 0].outputs[i].sun_frac};
  }
}

physics::Result<void> CachedSurface::save(const SurfaceWarmUp& warm_up, const SavedSurface& saved) {
  std::swap(model_->states, nodes_[0].states);
  std::swap(model_->outputs, nodes_[0].outputs);
  auto written = warm_up.save(saved, *model_);
  std::swap(model_->states, nodes_[0].states);
  std::swap(model_->outputs, nodes_[0].outputs);
  return written;
}

void CachedSurface::begin_shade(std::int64_t now_ns, const Inputs& inputs) {
  const physics::SunPosition sun = inputs.environment.sun_at(now_ns);
  const physics::Forcing forcing = inputs.environment.forcing_at(now_ns, sun);
  // Linearise the response around a sunlit surface in the weather of now.
  constexpr double kSunlitK = 10.0;  // typical difference to the air
  exposure_tiles_.emplace(
      model_->samples, model_->drawn_samples,
      ShadeResponse(heat_, geometry_.materials().size(),
                    {physics::typical_film_w_m2_k(forcing), forcing.air_k + kSunlitK,
                     open_forcing(sun, forcing).moist}),
      inputs.entities.size(), grid_.start_ns(), static_cast<float>(options_.tolerance_k));
  exposure_tiles_->restart(now_ns, inputs.entities);
  entity_shadows_.begin(now_ns, inputs.environment, inputs.entities, geometry_.rays(), workers_);
}

bool CachedSurface::stale(std::int64_t now_ns) const noexcept {
  if (!model_) return true;
  // Let the first interval stand for all time before the history, because nothing changes there.
  const std::int64_t begin_ns = nodes_[0].at_ns;
  return (now_ns < begin_ns && begin_ns > grid_.start_ns()) ||
         now_ns > nodes_[1].at_ns + kMaxIntervals * grid_.interval_ns();
}

void CachedSurface::begin_interval(std::size_t node, const Inputs& inputs,
                                   SurfaceHistory& history) noexcept {
  interval_.begin(nodes_[node], nodes_[node + 1], model_->samples, inputs, history);
  local_->send_rays(node, inputs.entities);
}

void CachedSurface::begin_anew(std::size_t node, const Inputs& inputs,
                               SurfaceHistory& history) noexcept {
  const std::int64_t from_ns = nodes_[node].at_ns;
  std::int64_t end_ns = grid_.next_ns(from_ns, from_ns, inputs);
  // Answer a change of the weather with a short interval.
  if (std::ranges::binary_search(inputs.environment.changes_ns(), from_ns)) {
    end_ns = std::min(end_ns, from_ns + grid_.answer_ns());
  }
  nodes_[node + 1].at_ns = end_ns;
  begin_interval(node, inputs, history);
}

void CachedSurface::begin_next(std::int64_t from_ns, const Inputs& inputs,
                               SurfaceHistory& history) noexcept {
  begin_anew(1, inputs, history);
  shares_ = {from_ns, nodes_[1].at_ns};
}

void CachedSurface::compute(double passed_frac) noexcept {
  // Leave blocks that LocalSteps steps to it during a renewal.
  const std::size_t node = renewing_ ? 0 : 1;
  interval_.compute(nodes_[node], nodes_[node + 1], passed_frac, model_->samples,
                    renewing_ ? &*local_ : nullptr, workers_);
}

void CachedSurface::finish() noexcept {
  const std::size_t node = renewing_ ? 0 : 1;
  interval_.finish(nodes_[node], nodes_[node + 1], model_->samples, renewing_ ? &*local_ : nullptr,
                   workers_);
}

void CachedSurface::end_interval(const Inputs& inputs, SurfaceHistory& history) noexcept {
  local_->rotate(window(), model_->samples);
  finish();
  nodes_.rotate();
  local_->rotated(window(), model_->samples);
  SurfaceNodes::forget_changes(nodes_[2]);
  begin_next(nodes_[0].at_ns, inputs, history);
}

std::int64_t CachedSurface::take_weather_change(const Environment& environment) noexcept {
  return environment.changed_since_ns(std::exchange(revision_, environment.revision()));
}

bool CachedSurface::misses_weather(std::int64_t now_ns, const Inputs& inputs) const noexcept {
  return weather_change_ns_ <= now_ns &&
         weather_matters(nodes_[1], now_ns, inputs.environment, options_.tolerance_k);
}

void CachedSurface::begin_renewal(std::int64_t event_ns, std::int64_t now_ns, const Inputs& inputs,
                                  SurfaceHistory& history) noexcept {
  if (event_ns < nodes_[0].at_ns + NodeGrid::kSameNs) event_ns = nodes_[0].at_ns;
  lags_ = weather_matters(nodes_[1], now_ns, inputs.environment, options_.tolerance_k);
  std::int64_t end_ns = grid_.next_ns(event_ns, now_ns, inputs);
  if (lags_) end_ns = std::min(end_ns, std::max(event_ns, now_ns) + grid_.answer_ns());
  // Move node 0 to the change, and begin the interval from there anew.
  local_->take_weather_change(event_ns, window(), model_->samples);
  nodes_.cut(event_ns, end_ns, *local_, model_->samples, workers_);
  begin_interval(0, inputs, history);
  renewing_ = true;
  // Make up for the time since the latest frame in this frame.
  const std::int64_t begin_ns = std::max(event_ns, last_now_ns_);
  shares_ = {begin_ns, begin_ns + std::min(grid_.renewal_ns(), (end_ns - now_ns) / 2)};
}

void CachedSurface::end_renewal(std::int64_t now_ns, const Inputs& inputs,
                                SurfaceHistory& history) noexcept {
  // Compute the rest of node 1, then begin node 2 anew from there.
  finish();
  renewing_ = false;
  lags_ = misses_weather(now_ns, inputs);
  SurfaceNodes::forget_changes(nodes_[2]);
  begin_next(now_ns, inputs, history);
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
    lags_ = lags_ || misses_weather(now_ns, inputs);
    return;
  }
  if (weather_change_ns_ >= nodes_[2].at_ns) {
    weather_change_ns_ = kNoChange;
  } else if (weather_change_ns_ >= nodes_[1].at_ns) {
    // Begin the next interval anew, unless the current one is about to end: then the change waits
    // for the next one.
    if (nodes_[1].at_ns - now_ns < grid_.renewal_ns()) return;
    begin_next(now_ns, inputs, history);
    weather_change_ns_ = kNoChange;
  } else if (weather_change_ns_ <= now_ns) {  // later weather waits for its instant
    run_local(std::min(now_ns, nodes_[1].at_ns), inputs, history);
    begin_renewal(std::exchange(weather_change_ns_, kNoChange), now_ns, inputs, history);
  }
}

void CachedSurface::run_local(std::int64_t until_ns, const Inputs& inputs,
                              SurfaceHistory& history) noexcept {
  const SurfaceStep step = interval_.step(model_->samples);
  local_->run(until_ns, window(),
              {inputs.environment, inputs.entities, inputs.parts, history, step, workers_,
               geometry_.origin_world_m()});
}

void CachedSurface::advance(std::int64_t now_ns, const Inputs& inputs,
                            SurfaceHistory& history) noexcept {
  EMIT_CHECK(!stale(now_ns));
  entity_shadows_.begin_frame();
  // Take in new weather, then finish all intervals that end before now.
  take_weather(now_ns, inputs, history);
  while (now_ns > nodes_[1].at_ns) {
    run_local(nodes_[1].at_ns, inputs, history);
    if (renewing_) {
      end_renewal(nodes_[1].at_ns, inputs, history);
    } else {
      end_interval(inputs, history);
    }
    take_weather(now_ns, inputs, history);  // a change may have waited for this
  }
  // Look around from entities that have moved.
  if (bodies_) {
    bodies_->run(now_ns, inputs.entities, nodes_[0].outputs);
    interval_.see(bodies_->views());
  }
  // Advance blocks on their own and exposure tiles to now.
  run_local(now_ns, inputs, history);
  exposure_tiles_->run(now_ns, model_->samples,
                       {inputs.environment, inputs.entities, geometry_.rays(), workers_,
                        entity_shadows_.maps(), geometry_.origin_world_m()});
  fraction_ = nodes_.fraction(now_ns);
  // Continue with node 1 while sim time stands still.
  if (renewing_ && now_ns == last_now_ns_) shares_.move_back(kHeldFrames);
  last_now_ns_ = now_ns;
  // Do the share of the work that the passed time asks for.
  compute(shares_.passed_frac(now_ns));
  if (renewing_ && interval_.finished()) end_renewal(now_ns, inputs, history);
}

void CachedSurface::place_shadows(std::int64_t drawn_ns, std::int64_t sun_ns,
                                  const Inputs& inputs) noexcept {
  EMIT_CHECK(model_.has_value());
  entity_shadows_.place(drawn_ns, sun_ns, inputs.environment, inputs.entities, geometry_.rays());
}

void CachedSurface::forget_changes() noexcept {
  exposure_tiles_->forget_changes();
  nodes_.forget_changes();
}

double CachedSurface::flux_now_w_m2(std::uint32_t sample) const noexcept {
  const FosterHeat* foster = heat_.foster();
  const SurfaceNode& begin = nodes_[0];
  const SurfaceNode& end = nodes_[1];
  if (foster == nullptr || end.at_ns <= begin.at_ns)
    return std::numeric_limits<double>::quiet_NaN();
  // Read the front of a sheet: both faces share its state.
  const SurfaceSamples& all = model().samples;
  const std::uint32_t own = steps_itself(all, sample) ? sample : all.samples[sample].other_side;
  const SurfaceSample& read = all.samples[own];
  const auto base_offset_k = [&](const SurfaceNode& node) {
    return read.body >= 0 ? node.body_k[static_cast<std::size_t>(read.body)]
                          : foster->base_offset_k(read.material);
  };
  return foster->mean_flux_w_m2(read, begin.states[own], base_offset_k(begin), end.states[own],
                                base_offset_k(end),
                                1e-9 * static_cast<double>(end.at_ns - begin.at_ns));
}

std::uint64_t CachedSurface::sample_bytes() const noexcept {
  const auto bytes = [](const auto& values) { return values.capacity() * sizeof(values[0]); };
  std::uint64_t sum = nodes_.bytes() + interval_.bytes();
  if (model_)
    sum += bytes(model_->samples.samples) + bytes(model_->samples.seen) +
           bytes(model_->samples.columns) + bytes(model_->samples.links);
  return sum;
}

SampledScene CachedSurface::take_drawn_scene() {
  EMIT_CHECK(model_.has_value());
  return take_sampled_scene(geometry_.geometry(), *model_);
}

}  // namespace emit::renderer
