// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/reference/solid_solver.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

/// The true image of a scenario: temperatures by conduction in three dimensions (VoxelModel,
/// SolidSolver, SceneExchange) or in one dimension behind every pixel (PointSolver), visibility by
/// rays, radiance by its own quadrature of Planck's law. The camera is that of the renderer: rays
/// go through the centres of the pixels.
namespace emit::reference {

enum class SolveDimension : std::uint8_t {
  automatic,  ///< three where VoxelModel takes the scene, else one
  one,
  three
};

struct SolveOptions {
  SolveDimension dimension = SolveDimension::automatic;
  std::uint32_t rays = 256;          ///< per face or pixel, for sky and surroundings
  double refine = 1.0;               ///< three dimensions: multiplies cells per axis; steps follow
  double tolerance_k = 0.02;         ///< error of one step at refine 1; falls with its square
  std::uint64_t pixels = 0;          ///< of the surface, the same ones every time; 0: all
  std::filesystem::path checkpoint;  ///< folder; empty: none. Three dimensions only.
  std::uint32_t checkpoint_steps = 25;
  /// Called now and then with the share done, from the calling thread; false stops the run (what
  /// was reached is in the checkpoint). May be empty.
  std::function<bool(double done_frac)> progress;
};

/// One picture that is wanted.
struct SolveView {
  std::int64_t sim_time_ns = 0;
  physics::Pose sensor_pose;
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  double fov_h_rad = 0.0;
};

/// Planes as the renderer's frames have them; NaN where a pixel was not asked for.
struct SolvedImage {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<float> temperature_k;                  ///< NaN: sky
  std::vector<float> depth_m;                        ///< along the boresight, +Inf: sky
  std::vector<float> object_id;                      ///< object index + 1, 0: sky
  std::vector<std::vector<float>> radiance_w_m2_sr;  ///< per band of the scenario
  std::uint64_t surface_px = 0;
  std::uint64_t solved_px = 0;
};

struct SolveReport {
  int dimension = 1;
  std::uint64_t nodes = 0;    ///< unknowns of the three-dimensional grid
  std::uint64_t faces = 0;    ///< exposed ones
  std::uint64_t patches = 0;  ///< of the radiative exchange
  SolidStats stats;           ///< of the history; the spin-up apart
  SolidStats spin_up;
  bool resumed = false;  ///< from a checkpoint
  std::vector<std::string> notes;
};

/// One history, any number of pictures along it. Owner: the caller; one thread at a time.
///   auto solver = SceneSolver::create(scenario, geometry, options, last_ns);
///   solver->advance_to(t1); solver->image({t1, ...}); solver->advance_to(t2); ...
class SceneSolver {
 public:
  /// `end_ns`: nothing later is asked for. Errors: unsupported or config (what VoxelModel refuses,
  /// when three dimensions are demanded), config (checkpoint of another scenario or other options,
  /// naming what differs), invalid_argument, io.
  [[nodiscard]] static physics::Result<SceneSolver> create(const scene::ScenarioDesc& scenario,
                                                           const scene::SceneGeometry& geometry,
                                                           const SolveOptions& options,
                                                           std::int64_t end_ns);
  ~SceneSolver();
  SceneSolver(SceneSolver&&) noexcept;
  SceneSolver& operator=(SceneSolver&&) noexcept;

  /// Three dimensions: integrates to that instant (never back); one: nothing to do. Errors:
  /// invalid_argument (back), internal (no convergence), io (checkpoint).
  [[nodiscard]] physics::Result<void> advance_to(std::int64_t sim_time_ns);
  /// The picture at the instant reached (three dimensions), or at any instant up to end_ns (one).
  [[nodiscard]] physics::Result<SolvedImage> image(const SolveView& view);
  [[nodiscard]] SolveReport report() const;
  /// Three dimensions: temperatures of the grid's nodes at the instant reached; else empty.
  [[nodiscard]] std::span<const double> node_k() const noexcept;
  /// True after `progress` stopped the run.
  [[nodiscard]] bool stopped() const noexcept;

 private:
  struct Data;
  explicit SceneSolver(std::unique_ptr<Data> data);
  std::unique_ptr<Data> data_;
};

/// All views from one history, in ascending time. Errors as SceneSolver.
[[nodiscard]] physics::Result<std::vector<SolvedImage>> solve(const scene::ScenarioDesc& scenario,
                                                              const scene::SceneGeometry& geometry,
                                                              std::span<const SolveView> views,
                                                              const SolveOptions& options,
                                                              SolveReport* report = nullptr);

}  // namespace emit::reference
