// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/reference/nearest_surface.hpp"
#include "emit/reference/solid_solver.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

/// The true image of a scenario. Temperatures come from conduction in three dimensions (VoxelModel,
/// SolidSolver, SceneExchange) or in one dimension below every pixel (PointSolver). Visibility
/// comes from rays, and radiance from a quadrature of Planck's law of its own. The camera is that
/// of the renderer: rays go through the centres of the pixels.
namespace emit::reference {

/// Number of dimensions in which conduction is solved.
enum class SolveDimension : std::uint8_t {
  automatic,  ///< three if VoxelModel accepts the scene, else one
  one,
  three
};

/// Options of a SceneSolver.
struct SolveOptions {
  SolveDimension dimension = SolveDimension::automatic;
  std::uint32_t rays = 256;  ///< rays per face or pixel, for sky and surroundings
  /// Multiplies the cells per axis of three dimensions; the steps follow.
  double refine = 1.0;
  /// Error of one step at refine 1, K; it falls with the square of refine.
  double tolerance_k = 0.02;
  /// Least length of the shaded history before the scenario's own, s. Scenarios without a spin-up
  /// begin at their initial temperatures and get none.
  double spin_up_s = 72.0 * 3600.0;
  /// First instant that a picture will be asked for. Three dimensions take all but the last day
  /// before it on a coarse grid. The lowest number keeps the whole history of the scenario fine.
  std::int64_t first_ns = std::numeric_limits<std::int64_t>::min() / 2;
  /// Number of pixels of the surface that are solved, always the same ones; 0 solves all.
  std::uint64_t pixels = 0;
  /// Folder of the checkpoint; empty if there is none. Only three dimensions have one.
  std::filesystem::path checkpoint;
  std::uint32_t checkpoint_steps = 25;
  /// Called from time to time with the share done, from the calling thread. A return of false stops
  /// the run, and the checkpoint keeps what was reached. May be empty.
  std::function<bool(double done_frac)> progress;
};

/// Request for one image.
struct SolveView {
  std::int64_t sim_time_ns = 0;
  physics::Pose sensor_pose;
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  double fov_h_rad = 0.0;
};

/// Solved image with the channels of a renderer's frame. A pixel that was not asked for is NaN in
/// all channels.
struct SolvedImage {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<float> temperature_k;                  ///< K; NaN in the sky
  std::vector<float> depth_m;                        ///< m along the boresight; +Inf in the sky
  std::vector<float> object_id;                      ///< object index + 1; 0 in the sky
  std::vector<std::vector<float>> radiance_w_m2_sr;  ///< one channel per band of the scenario
  std::uint64_t surface_px = 0;                      ///< pixels that show a surface
  std::uint64_t solved_px = 0;                       ///< pixels that were solved
};

/// Size and cost of a run.
struct SolveReport {
  int dimension = 1;
  std::string reason;         ///< sentence that says why the solution has this dimension
  std::uint64_t nodes = 0;    ///< unknowns of the three-dimensional grid
  std::uint64_t faces = 0;    ///< number of exposed faces
  std::uint64_t patches = 0;  ///< number of patches of the radiative exchange
  SolidStats stats;           ///< counters of the history, without the spin-up
  SolidStats spin_up;         ///< counters of the spin-up
  bool resumed = false;       ///< true if the run continued from a checkpoint
  double spin_up_s = 0.0;     ///< length of the shaded history before the scenario's own
  /// Keys of the scenario that this solution does not follow, one sentence each.
  std::vector<std::string> notes;
};

/// Point of the world at which temperatures are asked for.
struct SolveProbe {
  glm::dvec3 position_m{0.0};
  std::optional<glm::dvec3> normal;  ///< out of the body; nothing takes the nearest surface's
  std::string object;                ///< name of the object; empty takes any
};

/// Temperature at a probe.
struct ProbedPoint {
  double temperature_k = std::numeric_limits<double>::quiet_NaN();  ///< NaN: no surface is near
  glm::dvec3 position_m{0.0};                                       ///< place on the surface
  glm::dvec3 normal{0.0};
  std::uint32_t object = 0;  ///< index into ScenarioDesc::objects
};
/// Solver of a scenario's history, with any number of images along it. Owner: the caller. Thread:
/// one at a time.
///   auto solver = SceneSolver::create(scenario, geometry, options, last_ns);
///   solver->advance_to(t1); solver->image({t1, ...}); solver->advance_to(t2); ...
class SceneSolver {
 public:
  /// Creates a solver. No image after `end_ns` can be asked for. Errors: unsupported or config
  /// (three dimensions are demanded and VoxelModel refuses the scene), config (the checkpoint
  /// belongs to another scenario or other options; the message names what differs),
  /// invalid_argument, io.
  [[nodiscard]] static physics::Result<SceneSolver> create(const scene::ScenarioDesc& scenario,
                                                           const scene::SceneGeometry& geometry,
                                                           const SolveOptions& options,
                                                           std::int64_t end_ns);
  ~SceneSolver();
  SceneSolver(SceneSolver&&) noexcept;
  SceneSolver& operator=(SceneSolver&&) noexcept;

  /// Integrates to an instant if the solution has three dimensions; does nothing in one dimension.
  /// Errors: invalid_argument (the instant lies in the past), internal (no convergence), io
  /// (checkpoint).
  [[nodiscard]] physics::Result<void> advance_to(std::int64_t sim_time_ns);
  /// Returns the image at the instant reached (three dimensions), or at any instant up to end_ns
  /// (one dimension).
  [[nodiscard]] physics::Result<SolvedImage> image(const SolveView& view);
  /// Returns the temperatures of the surface at probes, at the instants of image(). Errors:
  /// those of image().
  [[nodiscard]] physics::Result<std::vector<ProbedPoint>> probe(std::span<const SolveProbe> probes,
                                                                std::int64_t sim_time_ns);
  [[nodiscard]] SolveReport report() const;
  /// Returns the temperatures of the grid's nodes at the instant reached. The result is empty in
  /// one dimension.
  [[nodiscard]] std::span<const double> node_k() const noexcept;
  /// Returns true after `progress` has stopped the run.
  [[nodiscard]] bool stopped() const noexcept;

 private:
  struct Data;
  explicit SceneSolver(std::unique_ptr<Data> data);
  std::unique_ptr<Data> data_;
};

/// Solves all views from one history. The views may be in any order; the result has theirs. Images
/// that a stopped run did not reach are empty. Errors: those of SceneSolver.
[[nodiscard]] physics::Result<std::vector<SolvedImage>> solve(const scene::ScenarioDesc& scenario,
                                                              const scene::SceneGeometry& geometry,
                                                              std::span<const SolveView> views,
                                                              const SolveOptions& options,
                                                              SolveReport* report = nullptr);

}  // namespace emit::reference
