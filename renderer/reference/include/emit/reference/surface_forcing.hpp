// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/air_film.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/reference/balanced_start.hpp"
#include "emit/reference/cloud_sun.hpp"
#include "emit/reference/layer_solver.hpp"
#include "emit/scene/scene_desc.hpp"

/// Forcing of the one-dimensional solver, from a scenario's weather and sun and from the view of a
/// surface point:
///
///   q = a_s [DNI f_sun max(0, N.L) + f_sky E_dif + G_scene + f_ground rho GHI]
///       + eps [f_sky L_down + L_scene + f_ground sigma T_env^4] - eps sigma T^4 + h (T_air - T)
///       - latent heat (FaceMoisture)
///
/// h is that of physics.md eq. 34 at the face's temperature T.
/// GHI = DNI sin(elevation) + E_dif. f_ground = 1 - f_sky - f_scene is the share that lies below
/// the horizon or is not part of the scene: surroundings of temperature T_env and short-wave
/// reflectance rho. See physics.md eq. 16.
namespace emit::reference {

/// Weather and sun that act on all surfaces at an instant.
struct ClimateNode {
  std::int64_t time_ns = 0;  ///< simulated time
  glm::dvec3 to_sun{0.0, 0.0, 1.0};
  double direct_normal_w_m2 = 0.0;  ///< after clouds; 0 if the sun's centre is below the horizon
  double diffuse_horizontal_w_m2 = 0.0;
  double longwave_down_w_m2 = 0.0;
  double air_k = 0.0;
  physics::AirFlow flow = {};  ///< past what stands still
  double surroundings_k = 0.0;
  double vapour_pa = 0.0;  ///< of the air
  double rain_mm = 0.0;    ///< depth since some instant
  double wet_frac = 0.0;   ///< share of a face that rain has wetted, mean over both of a sheet
};

/// Options of SurfaceClimate::create().
struct ClimateOptions {
  std::int64_t end_ns = 0;  ///< last instant asked for; its climate holds from then on
  double step_s = 60.0;     ///< longest stretch over which forcing is linear
  /// Instant from which step_s counts; before it stretches of up to ten times that, whose errors
  /// fade until then. Absent: it counts throughout.
  std::optional<std::int64_t> fine_from_ns = std::nullopt;
  std::optional<std::int64_t> spin_up_ns;  ///< start of the spin-up; thermal.spin_up_ns if absent
  MeshOptions mesh = {};                   ///< mesh of the surroundings
  StepOptions steps = {};
};

/// Weather, sun and surroundings of a scenario over the whole run, including the spin-up. Setup
/// class: create() allocates and solves for the temperature of the surroundings. The object is
/// immutable afterwards and serves any number of threads.
class SurfaceClimate {
 public:
  /// Creates the climate. Errors: invalid_argument (step_s is not positive or gives 10 million
  /// nodes or more), config (the surroundings material is unknown or has no layers).
  [[nodiscard]] static physics::Result<SurfaceClimate> create(const scene::ScenarioDesc& scenario,
                                                              const ClimateOptions& options);

  /// Instants of the climate, ascending. Values are linear between them; two nodes at one time make
  /// a jump.
  [[nodiscard]] std::span<const ClimateNode> nodes() const noexcept { return nodes_; }
  [[nodiscard]] std::int64_t history_start_ns() const noexcept { return history_start_ns_; }
  /// Start of the spin-up, ns of simulated time.
  [[nodiscard]] std::int64_t start_ns() const noexcept { return nodes_.front().time_ns; }
  /// Returns the start of a material's surface: absent if it begins in the balance of its own first
  /// day, which nobody has stated a temperature for.
  [[nodiscard]] std::optional<double> stated_start_k(const scene::Material& material,
                                                     double initial_k) const noexcept;
  [[nodiscard]] double surroundings_reflectance_frac() const noexcept { return reflectance_frac_; }
  /// Returns the climate at any instant. The value after a jump counts if a jump lies at that
  /// instant. Outside the nodes the first or last value holds.
  [[nodiscard]] ClimateNode at(std::int64_t time_ns) const noexcept;
  /// Returns the broken clouds over the scene; null without any.
  [[nodiscard]] const CloudSun* clouds() const noexcept { return clouds_.get(); }
  /// Returns the direct sun at a point of the world by that of `now`, which is a result of at().
  [[nodiscard]] double cloud_sun(const ClimateNode& now, const glm::dvec3& point_m) const noexcept;

 private:
  std::vector<ClimateNode> nodes_;
  std::shared_ptr<const CloudSun> clouds_;
  std::int64_t history_start_ns_ = 0;
  double reflectance_frac_ = 0.0;
  bool starts_balanced_ = false;
};

/// View of a surface point. It is linear between samples and constant outside them; two samples at
/// one time make a jump. Shares are of the cosine-weighted hemisphere above the point's tangent
/// plane, except sun_frac, which is the visible share of the sun's disc.
struct ViewSample {
  std::int64_t time_ns = 0;
  double sun_frac = 1.0;
  double sky_frac = 1.0;
  /// Share of the hemisphere that shows other surfaces of the scene whose state is known, and the
  /// irradiance that comes from there, W/m2. A share of 0 makes them count as surroundings.
  double scene_frac = 0.0;
  double scene_shortwave_w_m2 = 0.0;
  double scene_longwave_w_m2 = 0.0;
};

/// Temperature under the last layer at an instant. It is linear between samples and constant
/// outside them.
struct BaseSample {
  std::int64_t time_ns = 0;
  double kelvin = 0.0;
};

/// Motion of a face that goes with an entity, for the air past it. It is linear between samples and
/// constant outside them; two samples at one time make a jump.
struct MotionSample {
  std::int64_t time_ns = 0;
  glm::dvec3 velocity_m_s{0.0};  ///< world axes
  double up_m = 0.0;             ///< above the place of the scenario
  glm::dvec3 normal{0.0, 0.0, 1.0};
};

/// Orientation and optics of a surface point. `normal` is a unit vector in world axes, z up.
struct SurfaceOptics {
  glm::dvec3 normal{0.0, 0.0, 1.0};
  double solar_absorptance_frac = 0.0;
  double emissivity_frac = 0.0;
  physics::FilmSkin skin = {};  ///< what the film of the air takes from the material
  bool both_sides = false;      ///< the film is the mean of both faces of a sheet
  physics::MoistSurface moisture = {};
  bool holds_water = false;             ///< rain wets it
  physics::AirFilmBody film_body = {};  ///< shape and length of the flow
};

/// Returns the climate at a face that moves: the wind less its velocity, the air of its height as
/// the face feels it, and the relative humidity of the ground (physics.md section 8). RT-safe.
[[nodiscard]] ClimateNode climate_past(const ClimateNode& open,
                                       const MotionSample& motion) noexcept;

/// Returns the resistance of a moist surface under a short-wave irradiance, s m-1: its inverse goes
/// linearly from that of the night to that of the day, which counts from 100 W/m2 on.
[[nodiscard]] double light_resistance_s_m(const physics::MoistSurface& moisture,
                                          double shortwave_w_m2) noexcept;

/// Returns the terms of the balance that do not depend on the surface temperature. RT-safe.
[[nodiscard]] FaceState face_state(const ClimateNode& climate, const SurfaceOptics& surface,
                                   const ViewSample& view,
                                   double surroundings_reflectance_frac) noexcept;

/// Returns the view of an unshadowed point of this orientation: the full sun disc (N.L decides
/// whether the sun stands above the tangent plane) and (1 + cos tilt)/2 of the sky.
[[nodiscard]] ViewSample open_view(const glm::dvec3& normal) noexcept;

/// Returns the mesh of a material's layers over its base, or of a sheet's layers over its insulated
/// middle. Errors: config, naming the material (no layers, or a layer that is no solid).
[[nodiscard]] physics::Result<LayerMesh> material_mesh(const scene::Material& material,
                                                       const MeshOptions& options = {});

class RainCourses;

/// Solver of the surface temperature of points of one material. At the climate's start the profile
/// is the steady one between the initial temperature and the base, or the balance of the point's
/// own first day where nobody has stated a temperature (balanced_start()). Until the history starts
/// the point is unshadowed; a point that begins in its balance has its own mean sun and sky then.
/// From then on its view follows its samples. Owner: the caller, one solver per thread. Climate,
/// mesh and material must outlive it. The solver stores the spin-up of one orientation; run()
/// allocates only for another orientation.
class PointSolver {
 public:
  PointSolver(const SurfaceClimate& climate, const LayerMesh& mesh, const scene::Material& material,
              double initial_k, const StepOptions& steps = {});

  /// Views of the face and of the face of opposite normal, samples ascending. The back counts only
  /// if the material is a sheet. An empty view is unshadowed throughout.
  struct Views {
    std::span<const ViewSample> front;
    std::span<const ViewSample> back;
    // Share of the rain on open, level ground that each face gets; absent: nothing is above it.
    std::optional<double> front_rain_frac = std::nullopt;
    std::optional<double> back_rain_frac = std::nullopt;
    /// Temperature of the base, ascending; empty: that of the material throughout.
    std::span<const BaseSample> base = {};
    /// Motion of the face, ascending; empty: it stands still at the height of the place.
    std::span<const MotionSample> motion = {};
    /// Shape and length of the flow past the face.
    physics::AirFilmBody film_body = {};
  };
  /// Computes the temperatures at `times_ns`, which ascend. A time before the start of the history
  /// gives the temperature of its start. A prescribed material gives its prescribed temperature.
  /// `out_base_j_m2` takes the heat that has left through the base by then, J/m2 since the first of
  /// these times.
  /// @pre out_k has the size of times_ns, and so has out_base_j_m2 if it is not empty; a material
  /// with a course of its base is no sheet.
  void run(const glm::dvec3& normal, const Views& views, std::span<const std::int64_t> times_ns,
           std::span<double> out_k, std::span<double> out_base_j_m2 = {});

  /// Returns the mean temperature of an unshadowed surface in the balance of its first day. It
  /// allocates. @pre the material has layers
  [[nodiscard]] double balanced_mean_k(const glm::dvec3& normal);

  /// Solver after run(), with profile and counters.
  [[nodiscard]] const LayerSolver& solver() const noexcept { return solver_; }

 private:
  /// Finds the profile at the start of the history.
  void spin_up(const SurfaceOptics& surface, std::span<const MotionSample> rest, const Views& seen);
  /// Finds the balance of the day that begins at `start_ns`.
  [[nodiscard]] BalancedStart start_of(const SurfaceOptics& surface, const Views& views,
                                       std::int64_t start_ns);
  /// Returns what the point sees of sun and sky in the mean of its first day.
  [[nodiscard]] ViewSample mean_view(const glm::dvec3& normal, const Views& seen) const noexcept;
  /// Returns to the first rows of climate and views, at an instant.
  void rewind(std::int64_t now_ns) noexcept;
  void advance(const SurfaceOptics& surface, const Views& views, std::int64_t until_ns) noexcept;
  [[nodiscard]] double seconds(std::int64_t time_ns) const noexcept;

  const SurfaceClimate* climate_;
  const scene::Material* material_;
  double initial_k_;
  bool balanced_;  ///< nobody has stated initial_k_
  LayerSolver solver_;
  std::int64_t now_ns_ = 0;
  std::size_t climate_row_ = 0;
  std::size_t view_row_ = 0;
  std::size_t back_row_ = 0;
  std::size_t base_row_ = 0;
  std::size_t motion_row_ = 0;
  bool has_spin_up_ = false;
  glm::dvec3 spin_up_normal_{0.0};
  double spin_up_up_m_ = 0.0;
  physics::AirFilmBody spin_up_film_body_;
  std::vector<double> spin_up_k_;  ///< temperature of every node at the start of the history
  std::shared_ptr<const RainCourses> rain_;  ///< null: it never holds water
  std::vector<ProfilePoint> start_profile_;
};

/// Returns the history of one point, which gets a mesh of its own. Errors: those of
/// material_mesh().
[[nodiscard]] physics::Result<std::vector<double>> point_history(
    const SurfaceClimate& climate, const scene::Material& material, double initial_k,
    const glm::dvec3& normal, std::span<const ViewSample> view,
    std::span<const std::int64_t> times_ns, const MeshOptions& mesh = {},
    const StepOptions& steps = {});

}  // namespace emit::reference
