// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float3.hpp>
#include <string>
#include <vector>

namespace emit::scenegen {

/// One material's part of a mesh. Vertices are in scene axes; the writer turns them into glTF axes.
struct Part {
  std::string material;
  bool double_sided = false;
  std::vector<glm::vec3> positions_m;
  std::vector<glm::vec3> normals;
  std::vector<std::uint32_t> indices;
};

/// Axes in which shapes are drawn. `map`: x east, y north, z up, for scenery that is placed level
/// and heading north. `vehicle`: x forward, y left, z up. Both are right-handed.
enum class Axes : std::uint8_t { map, vehicle };

struct SceneMesh {
  std::string name;
  std::vector<Part> parts;
};
struct SceneNode {
  std::string name;
  std::uint32_t mesh = 0;
  glm::dvec3 position_m{0.0};
  double yaw_rad = 0.0;  ///< about z, counter-clockwise seen from above
};
struct Scene {
  Axes axes = Axes::map;
  std::vector<SceneMesh> meshes;
  std::vector<SceneNode> nodes;

  std::uint32_t add_mesh(SceneMesh mesh);
  void place(std::uint32_t mesh, const std::string& name, const glm::dvec3& position_m = {},
             double yaw_rad = 0.0);
};

/// Draws flat-shaded and round shapes into the parts of one mesh. z is up; angles in radians.
class MeshBuilder {
 public:
  explicit MeshBuilder(std::string name) { mesh_.name = std::move(name); }

  /// Following shapes get this material.
  MeshBuilder& material(const std::string& name, bool double_sided = false);
  /// Following points are shifted and turned about z: world = offset + R(yaw) p.
  MeshBuilder& origin(const glm::dvec3& offset_m, double yaw_rad = 0.0);

  /// Convex polygon, counter-clockwise seen from the front, one normal.
  void polygon(const std::vector<glm::dvec3>& corners);
  void quad(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d);
  /// Quad cut into `columns` x `rows` equal cells.
  void grid_quad(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c, const glm::dvec3& d,
                 std::uint32_t columns, std::uint32_t rows);

  enum Faces : std::uint32_t { kTop = 1, kBottom = 2, kSides = 4, kAll = 7 };
  /// Axis-parallel box.
  void box(const glm::dvec3& min_m, const glm::dvec3& max_m, std::uint32_t faces = kAll);
  /// Horizontal polygon (counter-clockwise from above) drawn up from z0 to z1.
  void prism(const std::vector<glm::dvec2>& outline, double z0_m, double z1_m,
             std::uint32_t faces = kAll);
  /// Side view (x, z), counter-clockwise seen from -y, drawn across from y0 to y1.
  void profile(const std::vector<glm::dvec2>& outline_xz, double y0_m, double y1_m,
               bool caps = true);
  /// Cone stump or cylinder between two points, smooth sides; a radius may be 0.
  void tube(const glm::dvec3& from_m, const glm::dvec3& to_m, double from_radius_m,
            double to_radius_m, std::uint32_t sides, bool cap_from = true, bool cap_to = true);
  /// Body of revolution along +x: (x, radius) rings, smooth; elliptic when scale_z differs from 1.
  void lathe_x(const std::vector<glm::dvec2>& rings, const glm::dvec3& axis_point_m,
               std::uint32_t sides, double scale_z = 1.0);

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

[[nodiscard]] std::uint64_t triangle_count(const Scene& scene);  ///< placements counted

}  // namespace emit::scenegen
