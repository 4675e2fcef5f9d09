// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

/// Ray-traced visibility: the truth about what a surface point sees of sun, sky and scene.
///
/// Precision. A bounding-volume hierarchy (Embree) finds candidate triangles around a local origin
/// in float32, with boxes padded by its own rounding error; every candidate is then decided in
/// double with a watertight test on the world's own coordinates. Nothing is decided in float32, so
/// a scene 100 km from the origin of the world gives the same answers, and no ray passes between
/// two triangles that share an edge or a vertex.
/// A triangle whose plane holds the ray's start, to within the rounding of its coordinates, never
/// stops that ray: this is what keeps a surface from shading itself, without an offset. Both sides
/// of every triangle are opaque.
///
/// Vectors are in world axes (local east-north-up), metres; directions are unit vectors.
/// Thread class: building is setup (any thread, allocates); every query is const and may run in
/// any number of threads at once. Results do not depend on the number of threads.
namespace emit::reference {

inline constexpr std::uint32_t kNoMover = 0xffffffffU;

/// Triangles of one frame: the world for static geometry, the body frame for those of a mover.
struct RayMesh {
  std::vector<glm::dvec3> positions_m{};
  std::vector<glm::dvec3> normals{};       ///< per vertex, unit; empty: those of the faces
  std::vector<std::uint32_t> indices{};    ///< three per triangle, counter-clockwise from outside
  std::vector<std::uint32_t> materials{};  ///< per triangle, or one entry for all; empty: 0
  std::uint32_t object = 0;
  std::uint32_t instance = 0;  ///< of SceneGeometry::instances
  std::uint32_t mover = kNoMover;
};

/// Something that moves as one rigid body. `poses` is not empty, ascending in time.
struct RayMover {
  std::uint32_t entity_id = 0;
  scene::Trajectory poses{};
};

struct RaySceneDesc {
  std::vector<RayMesh> meshes{};
  std::vector<RayMover> movers{};
};

/// The loaded scene in double. Entities become movers along their trajectory, or their placement
/// where they have none; replace `movers[i].poses` to use another pose history.
[[nodiscard]] RaySceneDesc ray_scene_desc(const scene::ScenarioDesc& scenario,
                                          const scene::SceneGeometry& geometry);

/// `exact`: as described above. `fast`: Embree's own float32 triangle test with the start moved off
/// the surface by the rounding error; a yardstick for speed, not a truth.
enum class RayArithmetic : std::uint8_t { exact, fast };

struct Ray {
  glm::dvec3 origin_world_m{0.0};
  glm::dvec3 direction{0.0, 0.0, 1.0};
  /// Triangles whose plane passes the origin at this distance or less do not stop the ray. Zero
  /// already covers the rounding of double coordinates; raise it for points known less well.
  double tolerance_m = 0.0;
};

struct RayHit {
  double distance_m = 0.0;
  glm::dvec3 position_world_m{0.0};
  glm::dvec3 geometric_normal{0.0};  ///< of the winding, unit, world axes
  glm::dvec3 shading_normal{0.0};    ///< interpolated; the geometric one without vertex normals
  glm::dvec2 barycentric{0.0};       ///< weights of the second and the third vertex
  bool front = true;                 ///< the outside was hit
  std::uint32_t mesh = 0;            ///< index into RaySceneDesc::meshes
  std::uint32_t primitive = 0;       ///< triangle of that mesh
  std::uint32_t object = 0;
  std::uint32_t instance = 0;
  std::uint32_t material = 0;
  std::uint32_t mover = kNoMover;
};

/// A point whose surroundings are asked for. `normal` is the outward normal of its own surface,
/// which hides everything behind its tangent plane; a zero vector stands for a point without such a
/// plane (on an edge or a corner, or in the air), which may see in all directions.
struct SurfacePoint {
  glm::dvec3 position_world_m{0.0};
  glm::dvec3 normal{0.0};
  double tolerance_m = 0.0;  ///< as in Ray
};

/// A share with an estimate of its sampling error (one standard deviation, on the safe side: from
/// the spread between blocks of the sequence, whose errors partly cancel in the whole). Zero where
/// every ray agrees and where the share was integrated instead of sampled.
struct Share {
  double value_frac = 0.0;
  double error_frac = 0.0;
};

struct SunQuery {
  std::uint32_t rays = 256;
  double semi_angle_rad = physics::kSunSemiAngleRad;
  /// Linear limb darkening I = 1 - u (1 - mu); 0: uniform disc. 0.6 stands for visible light.
  double limb_darkening_frac = 0.0;
  std::uint32_t seed = 0;  ///< chooses the scrambling of the sequence
};

struct SkyView {
  /// Cosine-weighted shares of the hemisphere above the tangent plane; with the share that ends on
  /// geometry they add up to one. Needs a normal; zero without.
  Share sky_cosine;     ///< leaves the scene above the horizon
  Share ground_cosine;  ///< leaves the scene below the horizon: surroundings
  /// Shares of the FULL sphere by solid angle, 0.5 for open flat ground; a point without normal on
  /// a convex edge sees more.
  Share sky_uniform;
  Share ground_uniform;
};

/// One direction out of a hemisphere and what it meets. Every direction stands for the same share
/// of the cosine-weighted hemisphere.
struct HemisphereRay {
  glm::dvec3 direction{0.0};
  bool hit_surface = false;
  RayHit hit;  ///< valid if hit_surface; otherwise sky (direction.z > 0) or surroundings
};

class RayScene;

/// The scene at one instant: the movers stand where they stood then. Cheap to make and to copy the
/// handle of; valid as long as its RayScene.
class SceneInstant {
 public:
  [[nodiscard]] std::optional<RayHit> first_hit(const Ray& ray) const;
  [[nodiscard]] bool occluded(const Ray& ray) const;

  /// out[i] = 1 where the straight line from points[i] towards `direction` is blocked or leaves
  /// behind the point's own tangent plane. Split over the cores. @pre equal sizes.
  void occluded(std::span<const SurfacePoint> points, const glm::dvec3& direction,
                std::span<std::uint8_t> out) const;

  /// Share of the sun's disc that is seen, by rays over the disc (equal solid angles, weighted by
  /// the limb darkening).
  [[nodiscard]] Share sun_visible_frac(const SurfacePoint& point, const glm::dvec3& to_sun,
                                       const SunQuery& query = {}) const;
  /// The same, integrated: the triangles between the point and the disc are projected and the
  /// uncovered area of the disc is computed. Exact to about 1e-11 for simple edges; where very many
  /// outlines cross the disc the error estimate says what remains. `rays` and `seed` are not used.
  [[nodiscard]] Share sun_visible_frac_clipped(const SurfacePoint& point, const glm::dvec3& to_sun,
                                               const SunQuery& query = {}) const;
  /// Many points, split over the cores. @pre equal sizes. `clipped` chooses the method.
  void sun_visible_frac(std::span<const SurfacePoint> points, const glm::dvec3& to_sun,
                        const SunQuery& query, bool clipped, std::span<double> out_frac) const;

  /// `rays` for each of the two measures (a power of two wastes nothing). @pre rays > 0
  [[nodiscard]] SkyView sky_view(const SurfacePoint& point, std::uint32_t rays,
                                 std::uint32_t seed = 0) const;

  /// Cosine-distributed directions and what each meets first. @pre point.normal is not zero
  void hemisphere(const SurfacePoint& point, std::span<HemisphereRay> out,
                  std::uint32_t seed = 0) const;

  /// Where a mover stands at this instant, and whether it is there. @pre mover < number of movers
  [[nodiscard]] const physics::Pose& mover_pose(std::uint32_t mover) const;
  [[nodiscard]] bool mover_on(std::uint32_t mover) const;

  /// Corners of a triangle as it stands at this instant, world axes. @pre mesh and primitive exist
  struct Corners {
    glm::dvec3 a, b, c;
  };
  [[nodiscard]] Corners triangle(std::uint32_t mesh, std::uint32_t primitive) const;

  struct Impl;  ///< of the module itself

 private:
  friend class RayScene;
  explicit SceneInstant(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
  std::shared_ptr<const Impl> impl_;
};

/// Geometry ready for rays: one hierarchy for everything static, built once, and one per mover in
/// its own frame. Movable.
class RayScene {
 public:
  /// Triangles with a coordinate that is not finite are dropped (see dropped_triangles()); those
  /// without area stay and are never hit.
  /// Errors: invalid_argument naming the mesh (index out of range, array sizes, unknown mover, a
  /// mover without poses), internal (Embree).
  [[nodiscard]] static physics::Result<RayScene> create(
      RaySceneDesc desc, RayArithmetic arithmetic = RayArithmetic::exact);
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(RayScene&&) noexcept;
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;
  ~RayScene();

  /// Places the movers; costs nothing per triangle.
  [[nodiscard]] SceneInstant at(std::int64_t sim_time_ns) const;

  [[nodiscard]] const RaySceneDesc& desc() const noexcept;
  [[nodiscard]] std::size_t triangles() const noexcept;
  [[nodiscard]] std::size_t dropped_triangles() const noexcept;

  struct Impl;  ///< of the module itself

 private:
  explicit RayScene(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::reference
