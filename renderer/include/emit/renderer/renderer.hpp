// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <glm/ext/vector_double3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/renderer/coarse_reasons.hpp"
#include "emit/renderer/heat_limits.hpp"
#include "emit/scene/scene_desc.hpp"

/// Interface of the renderer to the rest of emitd. One thread owns a Renderer from create() to its
/// destruction, because it owns the GL context.
///
/// Example (tests/renderer/readme_example_test.cpp compiles and runs this text):
/// @code
///   auto created = Renderer::create(scenario, DeviceOptions{}, OutputOptions{});
///   if (!created) return created.error().text;
///   Renderer& renderer = **created;
///   renderer.apply_entities(request.sim_time_ns, updates);
///   const int slot = renderer.submit(request);  // does not wait for the device
///   if (slot < 0) return "every slot is in use";
///   const auto index = static_cast<SlotIndex>(slot);
///   const FrameView& frame = renderer.collect(index);  // waits; poll(index) asks whether it would
///   send(frame.radiance_w_m2_sr);  // the memory of the frame is valid until release()
///   renderer.release(index);       // any thread may call it
/// @endcode
namespace emit::renderer {

/// Choice of the device.
struct DeviceOptions {
  int gpu_index = -1;          ///< EGL device; -1: first hardware device, else Mesa surfaceless
  bool debug_context = false;  ///< turns the debug output of GL on, which is slow
};

/// Use of the quality levels of FrameRequest::quality_level. With `replayed` and `live` the
/// renderer takes memory for a second image. Where the thermal method has nothing to shed there is
/// one level, whatever is chosen.
enum class Ladder : std::uint8_t {
  none,      ///< frames have full quality
  replayed,  ///< frames have the levels of a recording
  live,      ///< warm_up() also measures time and error of every level, in about 200 frames
};

/// Choice of the planes of a frame and of the read-back.
struct OutputOptions {
  bool temperature = false;  ///< surface temperature, K; NaN for sky
  bool depth = false;        ///< distance along the boresight, m; +Inf for sky
  bool object = false;       ///< 1 + index of the scenario's object, as float; 0 for sky
  bool sun = false;  ///< visible share of the sun times the cosine of its incidence; NaN for sky
  bool sky = false;  ///< cosine-weighted share of the hemisphere that shows sky; NaN for sky
  /// Share of the pixel that small targets cover (scene::SensorDesc::small_target_px), 0..1. Where
  /// it is not 0 the other planes show the nearest of these targets.
  bool coverage = false;
  /// Planes that Renderer::radiance_terms() needs.
  bool terms = false;
  Ladder ladder = Ladder::none;
  std::uint32_t slots = 3;    ///< read-back slots, 2..16: frames in flight plus frames being sent
  bool stage_timing = false;  ///< fills FrameView::stages_ms; the renderer waits after each stage
};

/// Pose of an entity from the host.
struct EntityUpdate {
  std::uint32_t entity_id = 0;
  physics::Pose pose;
  bool on = true;         ///< false: the entity is not in the scene
  bool teleport = false;  ///< jump: there is no motion between the previous pose and this one
};

/// Drive of a part of an entity from the instant of a host on.
struct PartUpdate {
  std::uint32_t entity_id = 0;
  std::uint32_t part_id = 0;  ///< scene::PartDesc::id
  scene::PartCommand command;
};

/// Request for one frame.
struct FrameRequest {
  std::uint64_t frame_number = 0;
  std::int64_t sim_time_ns = 0;      ///< instant that the image shows: entities at this time
  std::int64_t thermal_time_ns = 0;  ///< instant of the temperatures; in a hold before sim_time_ns
  physics::Pose sensor_pose;         ///< body frame of the seeker head, x along the boresight
  /// Horizontal field of view, rad; 0: that of the scenario. Beyond what the scenario's sensor may
  /// have the frame is coarse (FrameStats::coarse).
  double fov_h_rad = 0.0;
  std::uint8_t quality_level =
      0;  ///< quality level; 0 is full quality, a number too high is the last one
  /// Part of the image that is requested. Its pixels have the bits of the whole image. The other
  /// pixels are not drawn and have no meaning. An empty rectangle, or one that does not fit,
  /// requests all.
  scene::PixelRect window_px;
};

/// Time of each stage of a frame. It is measured only with OutputOptions::stage_timing.
struct StageTimes {
  double geometry_ms = 0.0;
  double occlusion_ms = 0.0;
  double shadow_ms = 0.0;
  double thermal_ms = 0.0;
  double radiance_ms = 0.0;
  double readback_ms = 0.0;
};

/// Time and error of a quality level.
struct QualityLevelStats {
  /// Time from submit() to the end of collect() without other load; 0: not measured.
  double frame_ms = 0.0;
  double error_k = 0.0;  ///< error as FrameView::estimated_error_k defines it
};

/// Counters of a frame, for the pixels that are drawn. Nothing is repaired silently.
struct FrameStats {
  std::uint32_t nonfinite_px = 0;  ///< pixels with NaN or Inf, which are written as 0
  std::uint32_t clamped_px = 0;  ///< pixels for which a model got an input outside its valid range
  /// Poses from the host that were dropped since the last reset because the store of an entity was
  /// full. Shade of the distant past is coarser than it was sent.
  std::uint64_t dropped_poses = 0;
  /// Reasons why the frame may be coarser than asked (thermal.method = "cached"): triangles may be
  /// wider than pixels, and temperatures further off than thermal.tolerance_k. None: it is not.
  CoarseReasons coarse;
  /// Small targets without a window of their own, because a frame has no more windows or its draws
  /// fill their memory. They have one sample per pixel, so their energy is not kept.
  std::uint32_t plain_targets = 0;
  /// Limits of the formulae that were passed in the last six hours of thermal time. They hold for
  /// the scene, whether or not the picture shows the surfaces that they touch.
  HeatLimits heat_limits;
  /// Wall time that this frame spent on preparing the surface anew because the thermal time had
  /// jumped, s. It is 0 in other frames. Such a frame is also `coarse`.
  double rewarm_s = 0.0;
};

/// One rendered frame. A plane holds rows from top to bottom, row-major, float32, without padding.
struct FrameView {
  std::uint64_t frame_number = 0;
  std::int64_t sim_time_ns = 0;
  physics::Pose sensor_pose;
  double fov_h_rad = 0.0;  ///< horizontal field of view, rad
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<std::span<const float>> radiance_w_m2_sr;  ///< one plane per band, in their order
  std::span<const float> temperature_k;                  ///< empty unless asked for
  std::span<const float> depth_m;                        ///< empty unless asked for
  std::span<const float> object_id;                      ///< empty unless asked for
  std::span<const float> sun_cosine;                     ///< empty unless asked for
  std::span<const float> sky_frac;                       ///< empty unless asked for
  /// Radiance that arrives at the surface from everything but the sun, one plane per band, the
  /// material, its clutter (mean of the field over the pixel, what it adds to the temperature, and
  /// the variance of the temperature within the pixel), and of glossy surfaces the normal (east,
  /// north, up) and the sun's light that facets without loss would reflect, per irradiance (0
  /// elsewhere). Empty unless OutputOptions::terms.
  std::vector<std::span<const float>> incoming_w_m2_sr;
  std::span<const float> material;
  std::span<const float> clutter_sd;
  std::span<const float> clutter_k;
  std::span<const float> clutter_variance_k2;
  std::array<std::span<const float>, 3> normal;
  std::span<const float> glint_per_sr;
  /// Broken clouds: of a surface the direct sun by the mean of the weather, 1 without such clouds;
  /// of the sky the opacity of the clouds in the pixel. Empty unless OutputOptions::terms.
  std::span<const float> clouds;
  std::span<const float> coverage_frac;  ///< empty unless asked for
  FrameStats stats;
  std::uint8_t quality_level = 0;  ///< quality level that was rendered
  /// Expected difference from full quality: RMS of the apparent temperature over the image, K, in
  /// the band where it is largest. NaN: nothing was measured near this camera.
  float estimated_error_k = 0.0F;
  bool device_failed = false;  ///< the driver reported an error, and the pixels may be wrong
  bool device_lost = false;    ///< the context was reset, and nothing can be drawn with it any more
  StageTimes stages_ms;
};

/// Place on a surface at the instant of the latest frame.
struct SurfacePlace {
  glm::dvec3 position_world_m{0.0};
  glm::dvec3 normal{0.0, 0.0, 1.0};  ///< outward, unit length, world axes
};

/// Parts of a pixel's radiance in one band. They are W m-2 sr-1 at the aperture, behind the air,
/// and add up to the pixel.
struct RadianceTerms {
  double emission_w_m2_sr = 0.0;    ///< of the surface
  double sky_w_m2_sr = 0.0;         ///< reflected
  double neighbours_w_m2_sr = 0.0;  ///< reflected: bodies, ground and surroundings that it sees
  double sun_w_m2_sr = 0.0;         ///< reflected
  // Reflected by the lobe of a glossy surface: sky, what hides it or lies below it, and the sun.
  double lobe_sky_w_m2_sr = 0.0;
  double lobe_neighbours_w_m2_sr = 0.0;
  double glint_w_m2_sr = 0.0;
  double path_w_m2_sr = 0.0;       ///< emission of the air in between; the sky where it is seen
  double scattered_w_m2_sr = 0.0;  ///< sunlight that this air, or the sky, scatters
  double bodies_w_m2_sr = 0.0;     ///< of the sun's and the moon's disc
  double gas_w_m2_sr = 0.0;        ///< of hot gas, smoke and flares in between
  double gas_frac = 1.0;           ///< transmittance of these, which the terms above include
  double emissivity_frac = 0.0;
  double air_frac = 1.0;      ///< transmittance for emission and for what is reflected
  double air_sun_frac = 1.0;  ///< transmittance for reflected sunlight

  [[nodiscard]] double sum_w_m2_sr() const noexcept {
    return emission_w_m2_sr + sky_w_m2_sr + neighbours_w_m2_sr + sun_w_m2_sr + lobe_sky_w_m2_sr +
           lobe_neighbours_w_m2_sr + glint_w_m2_sr + path_w_m2_sr + scattered_w_m2_sr +
           bodies_w_m2_sr + gas_w_m2_sr;
  }
};

/// State of a thermal sample at the thermal instant of the latest frame.
struct SampleReading {
  glm::dvec3 position_world_m{0.0};
  double temperature_k = 0.0;
  /// Net flux into the solid, mean over the interval in which the renderer advances its heat. NaN
  /// where no flux drives the heat: with emit2014 and prescribed temperatures.
  double flux_w_m2 = 0.0;
};

/// Figures of the loaded scene.
struct SceneStats {
  std::uint64_t triangles = 0;  ///< drawn when everything is in view; each instance counts
  std::uint32_t instances = 0;
  /// Thermal samples of the method "cached", valid after warm_up(): their number, the main memory
  /// they take, and whether thermal.max_samples stopped their refinement.
  std::uint64_t samples = 0;
  std::uint64_t sample_bytes = 0;
  bool samples_full = false;
  /// Radiation between surfaces that the warm-up could not settle, W/m2; 0 if it did.
  double exchange_left_w_m2 = 0.0;
  std::uint64_t max_samples = 0;  ///< thermal.max_samples; fewer than the meshes need do not bind
  /// Meshes lost visible detail because thermal.max_samples is too small.
  bool coarse_meshes = false;
  /// Warnings of the scenario's and the scene's loaders: unmapped materials, gaps of the weather.
  std::vector<std::string> warnings;
  /// Gaps of the first frame's history and weather, one sentence each; valid after warm_up().
  std::vector<std::string> first_frame_warnings = {};
};

/// Returns warnings that are known after warm_up(), one sentence each: gaps of the first frame's
/// history and weather, a `thermal.max_samples` that is too small, and radiation between surfaces
/// that did not settle.
[[nodiscard]] std::vector<std::string> warm_up_warnings(const SceneStats& stats);

/// Number of a read-back slot.
using SlotIndex = std::uint32_t;

/// Function that takes the share of the work that is done, 0..1. It returns false to stop the work.
using WarmUpProgress = std::function<bool(double done_frac)>;

/// Renderer of one scenario on one device.
/// Thread: the one that called create(), except where a function says otherwise.
class Renderer {
 public:
  /// Loads the scene, creates the GL context and allocates all memory. Setup only.
  /// Errors: gpu (no device; the text names what was tried), config (a value outside its limits),
  /// and those of scene::load_scene().
  [[nodiscard]] static physics::Result<std::unique_ptr<Renderer>> create(
      const scene::ScenarioDesc& scenario, const DeviceOptions& device,
      const OutputOptions& output);
  virtual ~Renderer() = default;

  /// Appends poses at `sim_time_ns` to the histories of entities. From then on they replace the
  /// trajectory of the scenario. An update is not applied when its id is unknown, its pose is not
  /// valid, or it is older than the history. Returns the number of updates that were applied.
  /// RT-safe.
  virtual std::size_t apply_entities(std::int64_t sim_time_ns,
                                     std::span<const EntityUpdate> updates) noexcept = 0;

  /// Says where entities will be at `sim_time_ns`, for images of that instant before its poses have
  /// come. Until the next apply_entities() an entity moves evenly from its newest pose to there.
  /// The history of shade does not take it in. Updates of entities without a pose of the host, or
  /// with one that is not older, have no effect. RT-safe.
  virtual void foresee_entities(std::int64_t sim_time_ns,
                                std::span<const EntityUpdate> updates) noexcept = 0;

  /// Drives a part of an entity from `sim_time_ns` on. The first command of a run replaces those of
  /// the scenario from there on. Returns false, and changes nothing, when no such part is in the
  /// scene or the time is before that of the part's newest command. RT-safe.
  virtual bool apply_part(std::int64_t sim_time_ns, const PartUpdate& update) noexcept = 0;

  /// Sets the weather from `sample.sim_time_ns` on, in place of the scenario's weather. Returns
  /// false when the store is full. RT-safe.
  virtual bool apply_weather(const scene::WeatherSample& sample) noexcept = 0;

  /// Forgets all poses, commands to parts and weather from the host. With thermal.method = "cached"
  /// the samples of the surface stay, so that frames of a later run may differ in the last bits
  /// from those of a new renderer. RT-safe.
  virtual void reset() noexcept = 0;

  /// Names the thermal instants of frames that will follow by carry_on(). With thermal.method =
  /// "cached" warm_up() then refines static surfaces also along the shadows that static geometry
  /// casts at these instants, which takes time in proportion to their number. Setup only; call it
  /// before warm_up().
  virtual void plan(std::span<const std::int64_t> thermal_times_ns) = 0;

  /// Does the work that frames from `first` on need once. With thermal.method = "cached" it samples
  /// the surface and integrates its history, which takes seconds to minutes on all cores. Call it
  /// before the first frame; otherwise submit() does it, and does it again where sim time goes back
  /// behind the samples. With thermal.state_file it takes a saved surface of that instant, or of a
  /// little earlier and carries it on. Setup only. Errors: internal (`progress` asked to stop), gpu
  /// (no memory for the samples), config (the state file does not fit), io.
  [[nodiscard]] virtual physics::Result<void> warm_up(const FrameRequest& first,
                                                      const WarmUpProgress& progress = {}) = 0;

  /// Brings the surface to the thermal instant of `to`, however far ahead it is: submit() would
  /// sample it anew behind a long jump. It does nothing for an instant before the latest one.
  /// Setup only. Errors: internal (`progress` asked to stop).
  /// @pre warm_up() has succeeded.
  [[nodiscard]] virtual physics::Result<void> carry_on(const FrameRequest& to,
                                                       const WarmUpProgress& progress = {}) = 0;

  /// Issues a frame and returns its slot; -1 when every slot is in use. It does not wait for the
  /// device. RT-safe after warm_up().
  [[nodiscard]] virtual int submit(const FrameRequest& request) noexcept = 0;
  /// True when collect() would not wait. RT-safe.
  /// @pre submit() returned the slot, and it was not released.
  [[nodiscard]] virtual bool poll(SlotIndex slot) noexcept = 0;
  /// Waits for the frame of a slot. The view is valid until release().
  /// @pre submit() returned the slot, and it was not released.
  [[nodiscard]] virtual const FrameView& collect(SlotIndex slot) noexcept = 0;
  /// Expected time and error of every quality level for a frame, from the measurements of warm_up()
  /// near the camera. Where nothing was measured near, times come from what is in view, and errors
  /// are the medians of the trajectory. Entry 0 is full quality; without a ladder it is the only
  /// one. The result is valid until the next call. RT-safe.
  [[nodiscard]] virtual std::span<const QualityLevelStats> expected_levels(
      const FrameRequest& request) noexcept = 0;
  /// Makes a slot free again. Thread: any. RT-safe.
  /// @pre submit() returned the slot, and it was not released.
  virtual void release(SlotIndex slot) noexcept = 0;

  /// Pose of the sensor on the trajectory of the scenario; the default pose where it has none.
  [[nodiscard]] virtual physics::Pose scenario_sensor_pose_at(
      std::int64_t sim_time_ns) const noexcept = 0;

  /// Finds the thermal sample nearest to a place among those whose face looks the same way (within
  /// 30 degrees). The number stays valid until the next warm_up(). Empty: there is none, as always
  /// with thermal.method = "per-frame". It looks at all samples: setup only.
  [[nodiscard]] virtual std::optional<std::uint32_t> nearest_sample(
      const SurfacePlace& place) const noexcept = 0;
  /// Reads a sample. RT-safe.
  /// @pre nearest_sample() returned the number, or it is below SceneStats::samples.
  [[nodiscard]] virtual SampleReading sample_reading(std::uint32_t sample) const noexcept = 0;

  /// Splits the radiance of a pixel of the latest frame by band. `normal_up` is the vertical
  /// component of the unit normal that it shows. Setup only.
  /// @pre The frame has temperature, depth, sun, sky and terms, full quality and no small targets.
  [[nodiscard]] virtual std::vector<RadianceTerms> radiance_terms(const FrameView& view,
                                                                  const glm::uvec2& px,
                                                                  double normal_up) const = 0;

  /// Figures of the scene. They grow in warm_up().
  [[nodiscard]] virtual const SceneStats& scene_stats() const noexcept = 0;
  /// GL_RENDERER and GL_VERSION of the device, for logs, golden images and benchmarks.
  [[nodiscard]] virtual const std::string& device_name() const noexcept = 0;
};

}  // namespace emit::renderer
