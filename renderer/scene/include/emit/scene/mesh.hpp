// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float3.hpp>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

/// Loaded geometry as plain arrays, ready to be copied to a device.
///
/// Frames. Vertices stay in the axes of the glTF file (x left, y up, z forward). Every object, be
/// it a vehicle or a map, is turned into the body frame (x forward, y right, z down) by
/// `body_from_gltf()`:
///   body x = glTF z,   body y = -glTF x,   body z = -glTF y
/// and placed by a pose `world_from_body`. With the default pose, level and heading north, a glTF
/// file stands upright: glTF +z points north, +y up, +x west. A map drawn with north along glTF -z
/// (the usual export of a plan with x east and y north) is placed with heading 180 degrees.
namespace emit::scene {

/// Axis-aligned box. It is empty (min > max) until something is added.
struct Aabb {
  glm::dvec3 min_m{std::numeric_limits<double>::infinity()};
  glm::dvec3 max_m{-std::numeric_limits<double>::infinity()};

  void add(const glm::dvec3& point_m) noexcept;
  void add(const Aabb& other) noexcept;
  [[nodiscard]] bool empty() const noexcept { return !(min_m.x <= max_m.x); }
};
/// Box around the eight transformed corners; an empty box stays empty.
[[nodiscard]] Aabb transformed(const Aabb& box, const glm::dmat4& target_from_source) noexcept;

/// A range of triangles of one material.
struct Submesh {
  std::uint32_t first_index = 0;
  std::uint32_t index_count = 0;  ///< multiple of 3
  std::uint32_t material = 0;     ///< index into SceneGeometry::materials
  bool double_sided = false;      ///< both sides are seen and lit; thin materials are sheets
};

/// Indexed triangles, counter-clockwise seen from outside. positions_m and normals have equal size,
/// every index is below that size, and normals have unit length.
struct Mesh {
  std::string name;
  std::vector<glm::vec3> positions_m;
  std::vector<glm::vec3> normals;
  std::vector<std::uint32_t> indices;
  std::vector<Submesh> submeshes;  ///< cover `indices` without gap or overlap
  Aabb bounds;                     ///< around the triangles, in the mesh's own axes
  /// True for the surface of a body, see is_closed_surface(): seen from outside, its nearest face
  /// along any ray is a front face.
  bool closed = false;
};

/// One mesh drawn once. Transforms have a positive determinant: a glTF node that mirrors gets a
/// mirrored copy of the mesh, so front faces are always counter-clockwise. Scales need not be
/// uniform: normals are transformed by the inverse transpose.
struct Instance {
  std::uint32_t mesh = 0;
  std::uint32_t object = 0;         ///< index into ScenarioDesc::objects
  std::uint32_t placement = 0;      ///< index into that object's instances
  std::uint32_t entity_id = 0;      ///< 0: static
  glm::dmat4 body_from_mesh{1.0};   ///< node transform, axis change, place of the model; fixed
  glm::dmat4 world_from_mesh{1.0};  ///< at the placement of the scenario
  Aabb world_bounds;                ///< at that placement
};

/// Rule by which a glTF material found its entry in SceneGeometry::materials.
enum class MappedBy : std::uint8_t {
  material_image,
  material_map,
  object_material,
  name,
  fallback
};
/// Material of one glTF material of one object.
struct MaterialMapping {
  std::uint32_t object = 0;
  std::string gltf_material;  ///< "" for primitives without material
  std::string material;       ///< name of the entry used
  std::uint32_t index = 0;
  MappedBy by = MappedBy::fallback;
};

/// Geometry and materials of a whole scenario.
struct SceneGeometry {
  std::vector<Mesh> meshes;
  std::vector<Instance> instances;
  /// Materials in use, in the order of the library. Entry 0 is the default material, in use or not.
  std::vector<Material> materials;
  std::vector<MaterialMapping> mappings;
  std::vector<BodyInterior> interiors;  ///< by object; one that is absent has the default
  std::vector<std::string> warnings;    ///< faults of the files and what was done about them
  std::uint64_t triangles = 0;          ///< sum over the instances
  std::uint64_t dropped_triangles = 0;  ///< triangles of zero area, counted once per file
  Aabb static_bounds;                   ///< world, static instances
  Aabb bounds;                          ///< world, all instances at their placements
};

/// True when the triangles bound a body: every directed edge is met by exactly one opposite one
/// (vertices at equal positions count as one), no submesh is double-sided, and the enclosed volume
/// is positive, which means that front faces look outwards. Setup only: O(n log n) in time, 24
/// bytes a triangle.
[[nodiscard]] bool is_closed_surface(const Mesh& mesh);

/// Computes Mesh::bounds and Mesh::closed anew, from positions and indices.
void update_bounds(Mesh& mesh);

/// The change of axes described above. Its determinant is +1.
[[nodiscard]] glm::dmat4 body_from_gltf() noexcept;
/// Matrix that scales, turns and shifts an object's model (in body axes) into its body.
[[nodiscard]] glm::dmat4 body_from_model(const ObjectDesc& object) noexcept;
/// Returns shape and length of an object's flow of air: the user's, or the longest side of the box
/// around its geometry in body axes, at least 1 cm. `object` is an index into the scenario's
/// objects. Setup only.
[[nodiscard]] physics::AirFilmBody film_body(const ScenarioDesc& scenario,
                                             const SceneGeometry& geometry, std::size_t object);
/// Matrix of a pose.
[[nodiscard]] glm::dmat4 world_from_body_matrix(const physics::Pose& pose) noexcept;

/// Loads every glTF file of the scenario and resolves its materials. Images of materials part
/// surfaces first. A glTF material is looked up in the object's material_map, then the object's
/// `material`, then the library by name, then the scenario's default_material (with a warning that
/// names it). Static surfaces of different objects that lie in one plane are cut, so that one of
/// them wins everywhere. Setup only; any thread. Errors: io (a file cannot be read), config (a file
/// that is missing or malformed, naming file and element; unknown library material, naming object
/// and material; an entity without exactly one placement).
[[nodiscard]] physics::Result<SceneGeometry> load_scene(const ScenarioDesc& scenario);

}  // namespace emit::scene
