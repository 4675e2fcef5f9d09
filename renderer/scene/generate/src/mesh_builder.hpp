// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float3.hpp>
#include <string>
#include <vector>

namespace emit::scenegen {

/// Part of a mesh with one material. Vertices are in scene axes; the writer converts them to glTF
/// axes.
struct Part {
  std::string material;
  bool double_sided = false;
  std::vector<glm::vec3> positions_m;
  std::vector<glm::vec3> normals;
  /// Texture coordinates, where the outline of foliage cuts out the part; else empty.
  std::vector<glm::vec2> uv;
  std::vector<std::uint32_t> indices;
};

/// Axes in which shapes are drawn. `map`: x east, y north, z up, for scenery that is placed level
/// and heading north. `vehicle`: x forward, y left, z up. Both are right-handed.
enum class Axes : std::uint8_t { map, vehicle };

/// Mesh of a scene.
struct SceneMesh {
  std::string name;
  std::vector<Part> parts;
};
/// Placement of a mesh.
struct SceneNode {
  std::string name;
  std::uint32_t mesh = 0;
  glm::dvec3 position_m{0.0};
  double yaw_rad = 0.0;  ///< angle about z, counter-clockwise seen from above
};
/// Scene: meshes and their placements.
struct Scene {
  Axes axes = Axes::map;
  std::vector<SceneMesh> meshes;
  std::vector<SceneNode> nodes;

  /// Adds a mesh and returns its index.
  std::uint32_t add_mesh(SceneMesh mesh);
  /// Places a mesh.
  void place(std::uint32_t mesh, const std::string& name, const glm::dvec3& position_m = {},
             double yaw_rad = 0.0);
};

/// Builder of one mesh from flat-shaded and round shapes. z is up; angles are in radians.
class MeshBuilder {
 public:
  explicit MeshBuilder(std::string name) { mesh_.name = std::move(name); }

  /// Sets the material of the shapes that follow.
  MeshBuilder& material(const std::string& name, bool double_sided = false);
  /// Sets the origin of the points that follow: world = offset + R(yaw) p, where R turns about z.
  MeshBuilder& origin(const glm::dvec3& offset_m, double yaw_rad = 0.0);

  /// Adds a convex polygon with one normal. Corners are counter-clockwise seen from the front.
  /// @pre corners.size() >= 3
  void polygon(const std::vector<glm::dvec3>& corners);
  /// Adds a quad, counter-clockwise seen from the front.
  void quad(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d);
  /// Adds a quad that is cut into `columns` x `rows` equal cells.
  void grid_quad(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d,
                 std::uint32_t columns, std::uint32_t rows);

  /// Adds a card that foliage cuts out of a quad: the image stands upright from a, b to d, c. It
  /// needs a material of its own, in which it is double-sided.
  void foliage_card(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c,
                    const glm::dvec3& d);

  enum Faces : std::uint32_t { kTop = 1, kBottom = 2, kSides = 4, kAll = 7 };
  /// Adds a box with edges along the axes.
  void box(const glm::dvec3& min_m, const glm::dvec3& max_m, std::uint32_t faces = kAll);
  /// Adds a prism: a horizontal polygon (counter-clockwise seen from above), extended from z0 to
  /// z1.
  void prism(const std::vector<glm::dvec2>& outline, double z0_m, double z1_m,
             std::uint32_t faces = kAll);
  /// Adds a profile: a side view (x, z), counter-clockwise seen from -y, extended from y0 to y1.
  void profile(const std::vector<glm::dvec2>& outline_xz, double y0_m, double y1_m,
               bool caps = true);
  /// Adds a truncated cone or cylinder between two points, with smooth sides. A radius may be 0.
  /// @pre sides >= 3
  void tube(const glm::dvec3& from_m, const glm::dvec3& to_m, double from_radius_m,
            double to_radius_m, std::uint32_t sides, bool cap_from = true, bool cap_to = true);
  /// Adds a smooth body of revolution along +x from (x, radius) rings. It is elliptic when scale_z
  /// differs from 1.
  /// @pre rings.size() >= 2 && sides >= 3
  void lathe_x(const std::vector<glm::dvec2>& rings, const glm::dvec3& axis_point_m,
               std::uint32_t sides, double scale_z = 1.0);

  /// Returns the mesh.
  [[nodiscard]] SceneMesh take() { return std::move(mesh_); }

 private:
  Part& part();
  std::uint32_t vertex(const glm::dvec3& position, const glm::dvec3& normal);
  void triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c);

  SceneMesh mesh_;
  std::size_t current_ = 0;
  glm::dvec3 offset_m_{0.0};
  double cos_yaw_ = 1.0;
  double sin_yaw_ = 0.0;
};

/// Number of triangles; each placement counts.
[[nodiscard]] std::uint64_t triangle_count(const Scene& scene);

}  // namespace emit::scenegen
