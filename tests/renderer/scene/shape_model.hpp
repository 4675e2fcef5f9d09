// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <glm/geometric.hpp>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "emit/scene/gltf_import.hpp"
#include "renderer/scene/gltf_builder.hpp"

namespace emit::test {

/// Triangles with flat normals, as lists of plain numbers.
struct Shape {
  std::vector<glm::vec3> positions;
  std::vector<glm::vec3> normals;

  /// Corners counter-clockwise seen from the front.
  void add_quad(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c, const glm::vec3& d) {
    const glm::vec3 normal = glm::normalize(glm::cross(b - a, c - a));
    for (const glm::vec3& p : {a, b, c, a, c, d}) {
      positions.push_back(p);
      normals.push_back(normal);
    }
  }
  /// Makes a level rectangle that faces up.
  static Shape ground(float x0, float z0, float x1, float z1, float y = 0.0F) {
    Shape shape;
    shape.add_quad({x0, y, z0}, {x0, y, z1}, {x1, y, z1}, {x1, y, z0});
    return shape;
  }
  /// Makes a box of 2 m that faces outwards; without a floor on demand.
  static Shape box(bool with_floor) {
    Shape shape;
    shape.add_quad({-1, 2, -1}, {-1, 2, 1}, {1, 2, 1}, {1, 2, -1});
    shape.add_quad({1, 0, -1}, {1, 2, -1}, {1, 2, 1}, {1, 0, 1});
    shape.add_quad({-1, 0, -1}, {-1, 0, 1}, {-1, 2, 1}, {-1, 2, -1});
    shape.add_quad({-1, 0, 1}, {1, 0, 1}, {1, 2, 1}, {-1, 2, 1});
    shape.add_quad({-1, 0, -1}, {-1, 2, -1}, {1, 2, -1}, {1, 0, -1});
    if (with_floor) shape.add_quad({-1, 0, -1}, {1, 0, -1}, {1, 0, 1}, {-1, 0, 1});
    return shape;
  }
  Shape& turn_normals() {
    for (glm::vec3& normal : normals) normal = -normal;
    return *this;
  }
  Shape& turn_winding(std::size_t every = 1) {
    for (std::size_t i = 0; i + 2 < positions.size(); i += 3 * every) {
      std::swap(positions[i + 1], positions[i + 2]);
      std::swap(normals[i + 1], normals[i + 2]);
    }
    return *this;
  }
};

/// One node, mesh and material per shape.
inline GltfText text_of(const std::vector<std::pair<std::string, Shape>>& shapes) {
  GltfText text;
  text.buffer.clear();
  text.views.clear();
  text.accessors.clear();
  text.nodes.clear();
  std::string scene;
  int count = 0;
  const auto add = [&](const std::vector<glm::vec3>& values) {
    const std::string comma = text.views.empty() ? "" : ",";
    text.views += comma + R"({"buffer":0,"byteOffset":)" + std::to_string(text.buffer.size()) +
                  R"(,"byteLength":)" + std::to_string(values.size() * sizeof(glm::vec3)) + "}";
    text.accessors += comma + R"({"bufferView":)" + std::to_string(count++) +
                      R"(,"componentType":5126,"count":)" + std::to_string(values.size()) +
                      R"(,"type":"VEC3"})";
    text.buffer.append(reinterpret_cast<const char*>(values.data()),
                       values.size() * sizeof(glm::vec3));
  };
  int index = 0;
  for (const auto& [name, shape] : shapes) {
    const std::string comma = index == 0 ? "" : ",";
    add(shape.positions);
    add(shape.normals);
    text.meshes += comma + R"({"name":")" + name + R"(","primitives":[{"attributes":{"POSITION":)" +
                   std::to_string(count - 2) + R"(,"NORMAL":)" + std::to_string(count - 1) +
                   R"(},"material":)" + std::to_string(index) + "}]}";
    text.nodes += comma + R"({"name":")" + name + R"(","mesh":)" + std::to_string(index) + "}";
    text.materials += comma + R"({"name":")" + name + R"("})";
    scene += comma + std::to_string(index++);
  }
  text.scenes = R"({"nodes":[)" + scene + "]}";
  return text;
}

/// A placed triangle in the axes of the model.
struct PlacedTriangle {
  std::uint32_t material = 0;
  std::array<glm::dvec3, 3> corner{};
  glm::dvec3 area{0.0};    ///< by winding
  glm::dvec3 normal{0.0};  ///< of the first corner
};

inline std::vector<PlacedTriangle> triangles_of(const scene::GltfModel& model) {
  std::vector<PlacedTriangle> out;
  for (const scene::GltfPlacement& placement : model.placements) {
    const scene::Mesh& mesh = model.meshes.at(placement.mesh);
    for (const scene::Submesh& submesh : mesh.submeshes) {
      for (std::uint32_t i = 0; i < submesh.index_count; i += 3) {
        PlacedTriangle triangle;
        triangle.material = submesh.material;
        for (std::uint32_t k = 0; k < 3; ++k) {
          const std::uint32_t index = mesh.indices.at(submesh.first_index + i + k);
          triangle.corner[k] = glm::dvec3(placement.gltf_from_mesh *
                                          glm::dvec4(glm::dvec3(mesh.positions_m.at(index)), 1.0));
        }
        triangle.area = 0.5 * glm::cross(triangle.corner[1] - triangle.corner[0],
                                         triangle.corner[2] - triangle.corner[0]);
        triangle.normal = glm::dvec3(mesh.normals.at(mesh.indices.at(submesh.first_index + i)));
        out.push_back(triangle);
      }
    }
  }
  return out;
}

}  // namespace emit::test
