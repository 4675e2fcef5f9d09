// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/scene/scene_desc.hpp"

/// The whole interface between the renderer and the rest of emitd.
///
/// Lifecycle (one thread owns a Renderer from create() to destruction, it owns the GL context):
///   auto renderer = Renderer::create(scenario, options);
///   renderer->apply_entities(sim_time_ns, updates);
///   auto slot = renderer->submit(request);        // never blocks on the device
///   const FrameView& frame = renderer->collect(*slot);   // or poll(*slot) first
///   ... stream frame.planes ...                    // memory stays valid until
///   renderer->release(*slot);                      // release, which any thread may call
namespace emit::renderer {

struct DeviceOptions {
  int gpu_index = -1;          ///< EGL device; -1: first hardware device, else Mesa surfaceless
  bool debug_context = false;  ///< GL debug output; slow
};

/// Whether frames may shed work, see FrameRequest::rung. Takes memory for another picture. Without
/// effect where the thermal method has nothing to shed: then there is one rung.
enum class Ladder : std::uint8_t {
  none,
  replayed,  ///< rungs as they were chosen before
  live,      ///< warm_up() measures what the rungs are worth: another 200 frames
};

struct OutputOptions {
  bool temperature = false;  ///< surface temperature, K; NaN where there is only sky
  bool depth = false;        ///< distance along the boresight, m; +Inf where there is only sky
  bool object = false;  ///< 1 + index of the scenario's object, as float; 0 where there is only sky
  Ladder ladder = Ladder::none;
  std::uint32_t slots = 3;  ///< read-back ring, 2..16: frames in flight plus frames being streamed
  bool stage_timing = false;  ///< waits for the device after each stage: fills stages_ms, slower
};

struct EntityUpdate {
  std::uint32_t entity_id = 0;
  physics::Pose pose;
  bool on = true;
  bool teleport = false;  ///< jump: no motion between the previous pose and this one
};

struct FrameRequest {
  std::uint64_t frame_number = 0;
  std::int64_t sim_time_ns = 0;      ///< what the image shows: entities at this instant
  std::int64_t thermal_time_ns = 0;  ///< where the thermal clock stands; behind sim time in a hold
  physics::Pose sensor_pose;         ///< body frame of the seeker head, x along the boresight
  std::uint8_t rung = 0;  ///< of the quality ladder, 0 = full; one that does not exist: the last
  /// The pixels that are wanted, which are those of the whole picture bit for bit; the others are
  /// not drawn and hold nothing of meaning. Empty, or one that does not fit: all.
  scene::PixelRect window_px;
};

/// Time per stage of Table 3; only with OutputOptions::stage_timing.
struct StageTimes {
  double geometry_ms = 0.0;
  double occlusion_ms = 0.0;
  double shadow_ms = 0.0;
  double thermal_ms = 0.0;
  double radiance_ms = 0.0;
  double readback_ms = 0.0;
};

/// What a rung of the quality ladder is worth.
struct RungStats {
  double frame_ms =
      0.0;  ///< from submit() to the end of collect(), with nothing else to do; 0: not measured
  double error_k = 0.0;  ///< as FrameView::estimated_error_k
};

/// Counted on the device for every frame, of the pixels that are drawn: nothing is silently
/// repaired.
struct FrameStats {
  std::uint32_t nonfinite_px = 0;  ///< NaN or Inf pixels, written as 0
  std::uint32_t clamped_px = 0;    ///< model evaluations with an input outside the valid range
  /// Live poses the entities' histories forgot since the last reset because their store was full:
  /// shade of the distant past is coarser than it was sent.
  std::uint64_t dropped_poses = 0;
  /// thermal.method = "cached": the camera stands where no one said it would, or samples ran out
  /// before what it sees was fine enough: triangles may be wider than its pixels and shadows
  /// coarser than thermal.tolerance_k. Or some surfaces do not know yet that the weather changed, or
  /// the surface was prepared anew (rewarm_s).
  bool coarse = false;
  /// How long it took to prepare the surface anew inside this frame, because the thermal time had
  /// jumped, in s of wall time; 0 in frames that did not. The frame is also `coarse`.
  double rewarm_s = 0.0;
};

/// One rendered frame. Rows go down, row-major, float32, no padding.
struct FrameView {
  std::uint64_t frame_number = 0;
  std::int64_t sim_time_ns = 0;
  physics::Pose sensor_pose;
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<std::span<const float>> radiance_w_m2_sr;  ///< one plane per scenario band, its order
  std::span<const float> temperature_k;                  ///< empty unless asked for
  std::span<const float> depth_m;
  std::span<const float> object_id;
  FrameStats stats;
  std::uint8_t rung = 0;  ///< of the quality ladder that was rendered
  /// Expected difference to full quality: RMS of the apparent temperature over the picture, K, of
  /// the band where it is largest. NaN: not measured near this camera.
  float estimated_error_k = 0.0F;
  bool device_failed = false;  ///< the driver reported an error: pixels are not to be trusted
  bool device_lost = false;    ///< the context was reset: nothing can be drawn with it any more
  StageTimes stages_ms;
};

struct SceneStats {
  std::uint64_t triangles = 0;  ///< drawn when everything is in view, instances counted
  std::uint32_t instances = 0;
  /// thermal.method "cached", after warm_up(): thermal samples, what they take of main memory, and
  /// whether thermal.max_samples stopped their refinement.
  std::uint64_t samples = 0;
  std::uint64_t sample_bytes = 0;
  bool samples_full = false;
  std::uint64_t max_samples = 0;  ///< thermal.max_samples; fewer than the meshes need do not bind
  /// For want of samples meshes lost detail that pixels show (thermal.max_samples).
  bool coarse_meshes = false;
  /// Doubts of the scenario's and the scene's loaders: unmapped materials, gaps of the weather.
  std::vector<std::string> warnings;
  /// After warm_up(): what the first frame's history and weather lack, one sentence each.
  std::vector<std::string> first_frame_warnings;
};

/// Warnings that are known after warm_up(), one sentence each: what the first frame lacks, and what
/// `thermal.max_samples` is too small for.
[[nodiscard]] std::vector<std::string> warm_up_warnings(const SceneStats& stats);

using SlotIndex = std::uint32_t;

/// Share done; false asks to stop.
using WarmUpProgress = std::function<bool(double done_frac)>;

class Renderer {
 public:
  /// Loads the scene, creates the GL context and takes all memory. Setup only.
  /// Errors: gpu (no device, naming what was tried), those of scene::load_scene(), config.
  [[nodiscard]] static physics::Result<std::unique_ptr<Renderer>> create(
      const scene::ScenarioDesc& scenario, const DeviceOptions& device,
      const OutputOptions& output);
  virtual ~Renderer() = default;

  /// Appends poses to the entities' history at `sim_time_ns`; from then on they override the
  /// scenario's trajectory. Unknown ids are not applied. Returns the number applied. RT-safe.
  virtual std::size_t apply_entities(std::int64_t sim_time_ns,
                                     std::span<const EntityUpdate> updates) noexcept = 0;

  /// Weather from `sample.sim_time_ns` on, overriding the scenario's. False when its store is full.
  virtual bool apply_weather(const scene::WeatherSample& sample) noexcept = 0;

  /// Forgets live poses and weather: the state of create(). RT-safe.
  virtual void reset() noexcept = 0;

  /// Does what frames from `first` on need once: thermal.method "cached" samples the surface and
  /// integrates its history, seconds to minutes on all cores. Call it before the first frame;
  /// submit() does it otherwise, and again where sim time goes back behind it.
  /// Errors: internal (stopped by `progress`), gpu (no memory for the samples).
  [[nodiscard]] virtual physics::Result<void> warm_up(const FrameRequest& first,
                                                      const WarmUpProgress& progress = {}) = 0;

  /// Records and issues a frame; -1 when every slot is in use. RT-safe after warm_up().
  [[nodiscard]] virtual int submit(const FrameRequest& request) noexcept = 0;
  /// True when collect() would not wait.
  [[nodiscard]] virtual bool poll(SlotIndex slot) noexcept = 0;
  /// Waits for the frame of a slot that submit() returned. The view lives until release().
  [[nodiscard]] virtual const FrameView& collect(SlotIndex slot) noexcept = 0;
  /// What the rungs are expected to be worth in that frame, as measured by warm_up() where the
  /// camera came nearest; where it came not near: times by what is in view, errors the median of
  /// the way. [0] is full quality; without a ladder the only one. Holds until the next call.
  /// RT-safe.
  [[nodiscard]] virtual std::span<const RungStats> expected_rungs(
      const FrameRequest& request) noexcept = 0;
  /// Gives the slot back. Any thread.
  virtual void release(SlotIndex slot) noexcept = 0;

  /// Sensor pose of the scenario's own trajectory.
  [[nodiscard]] virtual physics::Pose scenario_sensor_pose_at(
      std::int64_t sim_time_ns) const noexcept = 0;

  [[nodiscard]] virtual const SceneStats& scene_stats() const noexcept = 0;
  /// GL_RENDERER and GL_VERSION, for logs, goldens and benchmarks.
  [[nodiscard]] virtual const std::string& device_name() const noexcept = 0;
};

}  // namespace emit::renderer
