// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/reference/radiosity.hpp"
#include "emit/reference/solid_solver.hpp"
#include "emit/reference/solve.hpp"
#include "emit/reference/surface_forcing.hpp"
#include "emit/reference/surface_water.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/reference/voxel_model.hpp"

namespace emit::reference {

/// Radiation on the faces of a voxel model under a scenario's forcing: the sun with the shade of
/// all surfaces, the sky, and the exchange between the faces, unless the scenario switches it off.
class SolidRadiation {
 public:
  /// Traces the views of all faces. The arguments must outlive the object.
  SolidRadiation(const VoxelModel& model, const SolidSolver& solver,
                 const scene::SceneGeometry& geometry, const SceneInstant& instant,
                 const SurfaceClimate& climate, const SolveOptions& options,
                 const scene::ThermalOptions& thermal);

  /// Fills the drive of every face at a time, for SolidSolver::advance().
  void drive(double time_s, std::span<const double> face_k, const FaceDrive& out);

  /// Errors: invalid_argument (reflections between faces did not fade in some drive).
  [[nodiscard]] physics::Result<void> check() const;

  [[nodiscard]] const FaceFinder& finder() const noexcept { return finder_; }
  /// Returns the exchange that was traced, also if the scenario switches it off.
  [[nodiscard]] const SceneExchange& exchange() const noexcept { return *exchange_; }
  /// Returns the links of a face to the patches; none if the exchange is switched off.
  [[nodiscard]] std::span<const SceneExchange::Link> links(std::size_t face) const noexcept {
    return exchanges_ ? exchange_->links(face) : std::span<const SceneExchange::Link>();
  }
  /// Returns the share of a face's hemisphere that counts as surroundings.
  [[nodiscard]] double surroundings_frac(std::size_t face) const noexcept {
    return exchanges_ ? exchange_->ground_frac(face) : 1.0 - exchange_->sky_frac(face);
  }
  [[nodiscard]] std::uint32_t material_of(std::size_t face) const noexcept {
    return face_material_[face];
  }

 private:
  const VoxelModel& model_;
  const SceneInstant& instant_;
  const SurfaceClimate& climate_;
  bool exchanges_;
  std::vector<ExchangeFace> surfaces_;
  std::vector<std::uint32_t> face_material_;
  std::vector<physics::MoistSurface> moisture_;  ///< by face
  std::vector<RainCourses> water_;               ///< by material
  FaceFinder finder_;
  std::unique_ptr<SceneExchange> exchange_;
  std::unique_ptr<SunOnFaces> sun_;
  std::vector<double> sun_frac_, direct_w_m2_;
  std::vector<Incoming> incoming_;
  std::vector<double> rain_frac_;  ///< share of the rain that a face gets
  double left_w_m2_ = 0.0;         ///< greatest result of SceneExchange::incoming()
};

/// History of a voxel model under a scenario's forcing. It has a spin-up on a coarse grid, then one
/// on the fine grid; both have true visibility and exchange. Times are in s of simulated time.
class SolidHistory {
 public:
  /// Builds the model. `instant` and `climate` must outlive the history. Errors: those of
  /// VoxelModel and SolidSolver.
  [[nodiscard]] static physics::Result<std::unique_ptr<SolidHistory>> create(
      const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry,
      const SceneInstant& instant, const SurfaceClimate& climate, const SolveOptions& options,
      double end_s);

  /// Runs the spin-up and takes over its temperatures. Errors: internal.
  [[nodiscard]] physics::Result<void> spin_up();
  /// Advances to a time. See SolidSolver::advance().
  [[nodiscard]] physics::Result<void> advance(double to_s,
                                              const std::function<bool(double)>& after_step);
  /// Continues from a saved state.
  [[nodiscard]] physics::Result<void> restore(const SolidState& state, const SolidStats& spin_up);

  [[nodiscard]] const SolidSolver& solver() const noexcept { return *solver_; }
  [[nodiscard]] const SolidRadiation& radiation() const noexcept { return *radiation_; }
  [[nodiscard]] const SolidStats& spin_up_stats() const noexcept { return spin_up_stats_; }

 private:
  SolidHistory(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry,
               const SceneInstant& instant, const SurfaceClimate& climate,
               const SolveOptions& options)
      : scenario_(scenario),
        geometry_(geometry),
        instant_(instant),
        climate_(climate),
        options_(options) {}
  [[nodiscard]] SolidOptions solid_options() const;

  const scene::ScenarioDesc& scenario_;
  const scene::SceneGeometry& geometry_;
  const SceneInstant& instant_;
  const SurfaceClimate& climate_;
  const SolveOptions& options_;
  std::unique_ptr<VoxelModel> model_;
  std::unique_ptr<SolidSolver> solver_;
  std::unique_ptr<SolidRadiation> radiation_;
  SolidStats spin_up_stats_;
};

/// Returns the radiation of sky and surroundings on faces at an instant.
[[nodiscard]] ExchangeSky exchange_sky(const ClimateNode& now,
                                       double surroundings_reflectance_frac);

}  // namespace emit::reference
