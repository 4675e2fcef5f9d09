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

/// Ray-traced visibility: the true view of a surface point of sun, sky and scene.
///
/// Precision. A bounding-volume hierarchy (Embree) finds candidate triangles around a local origin
/// in float32, with boxes padded by its own rounding error. Every candidate is then decided in
/// double, with a watertight test on the world's own coordinates. Nothing is decided in float32. A
/// scene 100 km from the origin of the world therefore gives the same answers, and no ray passes
/// between two triangles that share an edge or a vertex.
/// A triangle whose plane contains the start of a ray, to within the rounding of its coordinates,
/// never stops that ray. This keeps a surface from shading itself, without an offset. Both sides of
/// every triangle are opaque.
///
/// Vectors are in world axes (local east-north-up), metres. Directions are unit vectors.
/// Thread class: building is setup (any thread, allocates). Every query is const and may run in any
/// number of threads at once. Results do not depend on the number of threads.
namespace emit::reference {

/// Value of the entity index for geometry that does not move.
inline constexpr std::uint32_t kNoEntity = 0xffffffffU;

/// Triangles of one frame: the world frame for static geometry, the body frame for an entity.
struct RayMesh {
  std::vector<glm::dvec3> positions_m{};
  /// Unit normal per vertex; if empty, the normals of the faces.
  std::vector<glm::dvec3> normals{};
  /// Three per triangle, counter-clockwise seen from outside.
  std::vector<std::uint32_t> indices{};
  std::vector<std::uint32_t> materials{};  ///< per triangle, or one for all; if empty, material 0
  std::uint32_t object = 0;
  std::uint32_t instance = 0;        ///< index into SceneGeometry::instances
  std::uint32_t entity = kNoEntity;  ///< index into RaySceneDesc::entities
};

/// Entity that moves as one rigid body. `poses` is not empty and ascends in time.
struct RayEntity {
  std::uint32_t entity_id = 0;
  scene::Trajectory poses{};
};

/// Description of a scene for rays.
struct RaySceneDesc {
  std::vector<RayMesh> meshes{};
  std::vector<RayEntity> entities{};
};

/// Converts a loaded scene to double. An entity moves along its trajectory, or stands at its
/// placement if it has none. Replace `entities[i].poses` to use another history of poses.
[[nodiscard]] RaySceneDesc ray_scene_desc(const scene::ScenarioDesc& scenario,
                                          const scene::SceneGeometry& geometry);

/// Arithmetic of the ray tests. `exact` is the one described above. `fast` is Embree's own float32
/// triangle test, with the start moved off the surface by the rounding error; it is a yardstick for
/// speed, not a truth.
enum class RayArithmetic : std::uint8_t { exact, fast };

/// Ray from a point in a unit direction.
struct Ray {
  glm::dvec3 origin_world_m{0.0};
  glm::dvec3 direction{0.0, 0.0, 1.0};
  /// Distance in m. A triangle whose plane passes the origin at this distance or less does not stop
  /// the ray. Zero already covers the rounding of double coordinates; raise it for points that are
  /// known less well.
  double tolerance_m = 0.0;
};

/// First hit of a ray.
struct RayHit {
  double distance_m = 0.0;
  glm::dvec3 position_world_m{0.0};
  glm::dvec3 geometric_normal{0.0};  ///< unit normal by the winding, world axes
  /// Unit normal interpolated from the vertices, or the geometric normal.
  glm::dvec3 shading_normal{0.0};
  glm::dvec2 barycentric{0.0};  ///< weights of the second and the third vertex
  bool front = true;            ///< true if the outside was hit
  std::uint32_t mesh = 0;       ///< index into RaySceneDesc::meshes
  std::uint32_t primitive = 0;  ///< triangle of the mesh
  std::uint32_t object = 0;
  std::uint32_t instance = 0;
  std::uint32_t material = 0;
  std::uint32_t entity = kNoEntity;
};

/// Point whose view is asked for. `normal` is the outward normal of its own surface, which hides
/// everything behind its tangent plane. A zero vector stands for a point without such a plane (on
/// an edge or a corner, or in the air), which may see in all directions.
struct SurfacePoint {
  glm::dvec3 position_world_m{0.0};
  glm::dvec3 normal{0.0};
  double tolerance_m = 0.0;  ///< same meaning as in Ray
};

/// Share with an estimate of its sampling error. The error is one standard deviation, on the safe
/// side: it comes from the spread between blocks of the sequence, whose errors partly cancel in the
/// whole. It is zero if every ray agrees, or if the share was integrated instead of sampled.
struct Share {
  double value_frac = 0.0;
  double error_frac = 0.0;
};

/// Options of a query of the sun's disc.
struct SunQuery {
  /// Number of rays; 0 counts as 1.
  std::uint32_t rays = 256;
  double semi_angle_rad = physics::kSunSemiAngleRad;
  /// Limb darkening u of the linear law I = 1 - u (1 - mu). 0 is a uniform disc, 0.6 stands for
  /// visible light.
  double limb_darkening_frac = 0.0;
  std::uint32_t seed = 0;  ///< chooses the scrambling of the sequence
};

/// View of sky and surroundings.
struct SkyView {
  /// Cosine-weighted shares of the hemisphere above the tangent plane. Together with the share that
  /// ends on geometry they add up to one. They are zero for a point without a normal.
  Share sky_cosine;     ///< rays that leave the scene above the horizon
  Share ground_cosine;  ///< rays that leave the scene below the horizon: surroundings
  /// Shares of the FULL sphere by solid angle, 0.5 for open flat ground. A point without a normal
  /// on a convex edge sees more.
  Share sky_uniform;
  Share ground_uniform;
};

/// One direction of a hemisphere and its first hit. Every direction stands for the same share of
/// the cosine-weighted hemisphere.
struct HemisphereRay {
  glm::dvec3 direction{0.0};
  bool hit_surface = false;
  /// Valid if hit_surface. Otherwise the ray shows sky (direction.z > 0) or surroundings.
  RayHit hit;
};

class RayScene;

/// Scene at one instant, with the entities at their poses of that instant. It is a handle that is
/// cheap to make and to copy. It is valid as long as its RayScene.
class SceneInstant {
 public:
  /// Returns the first hit of a ray, or nothing if it leaves the scene.
  [[nodiscard]] std::optional<RayHit> first_hit(const Ray& ray) const;
  /// Returns true if anything stops the ray.
  [[nodiscard]] bool occluded(const Ray& ray) const;

  /// Sets out[i] to 1 if the straight line from points[i] in `direction` is blocked or starts
  /// behind the point's own tangent plane, else to 0. The work is split over the cores.
  /// @pre points and out are of equal size.
  void occluded(std::span<const SurfacePoint> points, const glm::dvec3& direction,
                std::span<std::uint8_t> out) const;

  /// Returns the visible share of the sun's disc, by rays over the disc with equal solid angles,
  /// weighted by the limb darkening.
  [[nodiscard]] Share sun_visible_frac(const SurfacePoint& point, const glm::dvec3& to_sun,
                                       const SunQuery& query = {}) const;
  /// Returns the visible share of the sun's disc by integration. The triangles between the point
  /// and the disc are projected, and the uncovered area of the disc is computed. It is exact to
  /// about 1e-11 for simple edges; if very many outlines cross the disc, the error estimate states
  /// what remains. `rays` and `seed` are not used.
  [[nodiscard]] Share sun_visible_frac_clipped(const SurfacePoint& point, const glm::dvec3& to_sun,
                                               const SunQuery& query = {}) const;
  /// Computes the visible share for many points, split over the cores. `clipped` chooses the
  /// method.
  /// @pre points and out_frac are of equal size.
  void sun_visible_frac(std::span<const SurfacePoint> points, const glm::dvec3& to_sun,
                        const SunQuery& query, bool clipped, std::span<double> out_frac) const;

  /// Returns the view of a point. `rays` are traced for each of the two measures (0 counts as 1; a
  /// power of two wastes nothing).
  [[nodiscard]] SkyView sky_view(const SurfacePoint& point, std::uint32_t rays,
                                 std::uint32_t seed = 0) const;

  /// Fills `out` with cosine-distributed directions and the first hit of each.
  /// @pre point.normal is not zero.
  void hemisphere(const SurfacePoint& point, std::span<HemisphereRay> out,
                  std::uint32_t seed = 0) const;

  /// Returns the pose of an entity at this instant.
  /// @pre entity is less than the number of entities.
  [[nodiscard]] const physics::Pose& entity_pose(std::uint32_t entity) const;
  /// Returns true if the entity is switched on at this instant.
  /// @pre entity is less than the number of entities.
  [[nodiscard]] bool entity_on(std::uint32_t entity) const;
  /// Moves an entity, or takes it out of the scene. Copies of this handle keep theirs where it was.
  /// It allocates where such copies exist.
  /// @pre entity is less than the number of entities.
  void place(std::uint32_t entity, const physics::Pose& pose, bool on);

  /// Corners of a triangle in world axes.
  struct Corners {
    glm::dvec3 a, b, c;
  };
  /// Returns the corners of a triangle at this instant.
  /// @pre mesh is less than the number of meshes, and primitive less than its number of triangles.
  [[nodiscard]] Corners triangle(std::uint32_t mesh, std::uint32_t primitive) const;

  struct Impl;  ///< private to the library

 private:
  friend class RayScene;
  explicit SceneInstant(std::shared_ptr<Impl> impl) : impl_(std::move(impl)) {}
  std::shared_ptr<Impl> impl_;
};

/// Geometry that is ready for rays: one hierarchy for everything static, built once, and one per
/// entity in its own frame. Movable.
class RayScene {
 public:
  /// Builds the hierarchies. Triangles with a coordinate that is not finite are dropped (see
  /// dropped_triangles()). Triangles without area stay and are never hit.
  /// Errors: invalid_argument, naming the mesh (index out of range, array sizes, unknown entity, an
  /// entity without poses), internal (Embree).
  [[nodiscard]] static physics::Result<RayScene> create(
      RaySceneDesc desc, RayArithmetic arithmetic = RayArithmetic::exact);
  RayScene(RayScene&&) noexcept;
  RayScene& operator=(RayScene&&) noexcept;
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;
  ~RayScene();

  /// Returns the scene at an instant. The cost does not depend on the number of triangles.
  [[nodiscard]] SceneInstant at(std::int64_t sim_time_ns) const;

  [[nodiscard]] const RaySceneDesc& desc() const noexcept;
  [[nodiscard]] std::size_t triangles() const noexcept;
  [[nodiscard]] std::size_t dropped_triangles() const noexcept;

  struct Impl;  ///< private to the library

 private:
  explicit RayScene(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::reference
