// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/reference/layer_solver.hpp"
#include "emit/scene/scene_desc.hpp"

/// From a scenario's weather and sun, and from what a surface point sees, to the forcing of the
/// one-dimensional solver:
///
///   q = a_s [DNI f_sun max(0, N.L) + f_sky E_dif + G_scene + f_ground rho GHI]
///       + eps [f_sky L_down + L_scene + f_ground sigma T_env^4] - eps sigma T^4 + h (T_air - T)
///
/// GHI = DNI sin(elevation) + E_dif; f_ground = 1 - f_sky - f_scene is what lies below the horizon
/// or is not part of the scene: surroundings of temperature T_env and short-wave reflectance rho.
namespace emit::reference {

/// Everything that acts on surfaces at an instant, wherever they are.
struct ClimateNode {
  std::int64_t time_ns = 0;  ///< simulated time
  glm::dvec3 to_sun{0.0, 0.0, 1.0};
  double direct_normal_w_m2 = 0.0;  ///< after clouds; 0 with the sun's centre below the horizon
  double diffuse_horizontal_w_m2 = 0.0;
  double longwave_down_w_m2 = 0.0;
  double air_k = 0.0;
  double film_w_m2_k = 0.0;
  double surroundings_k = 0.0;
};

struct ClimateOptions {
  std::int64_t end_ns = 0;                 ///< last instant asked for; from then on it holds
  double step_s = 60.0;                    ///< longest stretch over which forcing is linear
  std::optional<std::int64_t> spin_up_ns;  ///< default: thermal.spin_up_ns
  MeshOptions mesh = {};                   ///< of the surroundings
  StepOptions steps = {};
};

/// Weather, sun and surroundings of a scenario over the whole run, spin-up included.
/// Setup class: create() allocates and solves for the surroundings. Immutable afterwards: any
/// number of threads.
class SurfaceClimate {
 public:
  /// Errors: config (no spin-up start before the end, unknown or empty surroundings material).
  [[nodiscard]] static physics::Result<SurfaceClimate> create(const scene::ScenarioDesc& scenario,
                                                              const ClimateOptions& options);

  /// Ascending; two nodes at one time are a jump. Linear in between.
  [[nodiscard]] std::span<const ClimateNode> nodes() const noexcept { return nodes_; }
  [[nodiscard]] std::int64_t history_start_ns() const noexcept { return history_start_ns_; }
  /// Start of the spin-up.
  [[nodiscard]] std::int64_t start_ns() const noexcept { return nodes_.front().time_ns; }
  [[nodiscard]] double surroundings_reflectance_frac() const noexcept { return reflectance_frac_; }
  /// At any instant; after a jump where one falls on it; held outside the nodes.
  [[nodiscard]] ClimateNode at(std::int64_t time_ns) const noexcept;

 private:
  std::vector<ClimateNode> nodes_;
  std::int64_t history_start_ns_ = 0;
  double reflectance_frac_ = 0.0;
};

/// What a surface point sees, linear between samples, held outside; two samples at one time are a
/// jump. Shares are of the cosine-weighted hemisphere above the point's tangent plane, except
/// sun_frac, the visible share of the sun's disc.
struct ViewSample {
  std::int64_t time_ns = 0;
  double sun_frac = 1.0;
  double sky_frac = 1.0;
  /// Other surfaces of the scene, where their state is known: share of the hemisphere and what
  /// comes from there, W/m2 on the surface. Without them (0) they count as surroundings.
  double scene_frac = 0.0;
  double scene_shortwave_w_m2 = 0.0;
  double scene_longwave_w_m2 = 0.0;
};

/// Orientation and optics of a point. `normal` is a unit vector in world axes, z up.
struct SurfaceOptics {
  glm::dvec3 normal{0.0, 0.0, 1.0};
  double solar_absorptance_frac = 0.0;
  double emissivity_frac = 0.0;
};

/// Terms of the balance that do not depend on the surface temperature. RT-safe.
[[nodiscard]] FaceState face_state(const ClimateNode& climate, const SurfaceOptics& surface,
                                   const ViewSample& view,
                                   double surroundings_reflectance_frac) noexcept;

/// What an unshadowed point of this orientation sees: the sun when it stands above the tangent
/// plane (N.L decides), (1 + cos tilt)/2 of the sky.
[[nodiscard]] ViewSample open_view(const glm::dvec3& normal) noexcept;

/// Mesh of a material's layers over its base, or of a sheet's over its insulated middle. Errors:
/// config naming the material (no layers, or a layer that is no body).
[[nodiscard]] physics::Result<LayerMesh> material_mesh(const scene::Material& material,
                                                       const MeshOptions& options = {});

/// Surface temperature of points of one material. At the climate's start the profile is the steady
/// one between the initial temperature and the base; until the history starts the point stands
/// unshadowed, from then on it sees what its samples say.
/// Owner: caller, one per thread; climate, mesh and material must outlive it. run() allocates
/// nothing once every orientation's spin-up fits its store (one orientation is kept).
class PointSolver {
 public:
  PointSolver(const SurfaceClimate& climate, const LayerMesh& mesh, const scene::Material& material,
              double initial_k, const StepOptions& steps = {});

  /// What the face sees, ascending, and what that of opposite normal sees, which counts where the
  /// material is a sheet; empty: unshadowed throughout.
  struct Views {
    std::span<const ViewSample> front;
    std::span<const ViewSample> back;
  };
  /// Temperatures at `times_ns`, ascending, none before the history start (those answer as the
  /// start). A prescribed material answers with its prescription. @pre out has the size of
  /// times_ns.
  void run(const glm::dvec3& normal, const Views& views, std::span<const std::int64_t> times_ns,
           std::span<double> out_k);

  /// The solver after run(): profile, counters.
  [[nodiscard]] const LayerSolver& solver() const noexcept { return solver_; }

 private:
  void spin_up(const SurfaceOptics& surface);
  void advance(const SurfaceOptics& surface, const Views& views, std::int64_t until_ns) noexcept;
  [[nodiscard]] double seconds(std::int64_t time_ns) const noexcept;

  const SurfaceClimate* climate_;
  const scene::Material* material_;
  double initial_k_;
  LayerSolver solver_;
  std::int64_t now_ns_ = 0;
  std::size_t climate_row_ = 0;
  std::size_t view_row_ = 0;
  std::size_t back_row_ = 0;
  bool has_spin_up_ = false;
  glm::dvec3 spin_up_normal_{0.0};
  std::vector<double> spin_up_k_;  ///< per node at the history start
  std::vector<ProfilePoint> start_profile_;
};

/// One point by itself, its mesh included. Errors: those of material_mesh().
[[nodiscard]] physics::Result<std::vector<double>> point_history(
    const SurfaceClimate& climate, const scene::Material& material, double initial_k,
    const glm::dvec3& normal, std::span<const ViewSample> view,
    std::span<const std::int64_t> times_ns, const MeshOptions& mesh = {},
    const StepOptions& steps = {});

}  // namespace emit::reference
