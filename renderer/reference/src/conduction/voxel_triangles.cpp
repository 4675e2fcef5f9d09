// SPDX-License-Identifier: Apache-2.0
#include "voxel_triangles.hpp"

#include <fmt/format.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "voxel_shape.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Collects the triangles of a scene.
class TriangleCollection {
 public:
  TriangleCollection(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry)
      : scenario_(scenario), geometry_(geometry) {}

  Result<std::vector<VoxelTriangle>> run() {
    if (auto done = collect(); !done) return tl::unexpected(std::move(done.error()));
    find_ground();
    return std::move(triangles_);
  }

 private:
  /// Collects the triangles and refuses what the model does not handle.
  Result<void> collect() {
    for (const scene::Instance& instance : geometry_.instances) {
      if (instance.entity_id != 0)
        return refuse_shape(scenario_, instance.object, "moving objects are not handled");
      const scene::Mesh& mesh = geometry_.meshes[instance.mesh];
      for (const scene::Submesh& submesh : mesh.submeshes) {
        if (geometry_.materials[submesh.material].prescribed_k) {
          return refuse_shape(scenario_, instance.object,
                              "an emitter of given temperature is not handled");
        }
        for (std::uint32_t i = 0; i + 2 < submesh.index_count; i += 3) {
          VoxelTriangle t;
          t.material = submesh.material;
          t.object = instance.object;
          // The layers of a sheet are half of its body.
          const scene::Material& material = geometry_.materials[submesh.material];
          t.sheet_m = material.sheet ? 2.0 * layers_m(material) : 0.0;
          for (std::size_t c = 0; c < 3; ++c) {
            const glm::vec3& p = mesh.positions_m[mesh.indices[submesh.first_index + i +
                                                               static_cast<std::uint32_t>(c)]];
            t.p_m[c] = glm::dvec3(instance.world_from_mesh * glm::dvec4(glm::dvec3(p), 1.0));
          }
          // Find the axis of the normal and check that the triangle lies across it.
          const glm::dvec3 normal = glm::cross(t.p_m[1] - t.p_m[0], t.p_m[2] - t.p_m[0]);
          if (glm::length(normal) < 1e-12) continue;
          for (std::size_t axis = 1; axis < 3; ++axis) {
            if (std::abs(normal[vector_index(axis)]) > std::abs(normal[vector_index(t.axis)]))
              t.axis = axis;
          }
          t.sign = normal[vector_index(t.axis)] > 0.0 ? 1 : -1;
          const double a = t.p_m[0][vector_index(t.axis)];
          if (std::abs(t.p_m[1][vector_index(t.axis)] - a) > kPlaneM ||
              std::abs(t.p_m[2][vector_index(t.axis)] - a) > kPlaneM) {
            return refuse_shape(scenario_, instance.object,
                                "a face does not lie across one of the world's axes");
          }
          // Note the instance of the triangle, which find_ground() needs. A node's primitives form
          // one solid.
          part_.push_back(part_of(instance));
          triangles_.push_back(t);
        }
      }
    }
    if (triangles_.empty()) {
      return make_error(ErrorCode::unsupported, "three-dimensional solution: the scene is empty");
    }
    return {};
  }
  [[nodiscard]] std::size_t part_of(const scene::Instance& instance) const {
    return static_cast<std::size_t>(&instance - geometry_.instances.data());
  }

  /// Finds the ground: an instance whose faces all look up from one height.
  void find_ground() {
    std::vector<char> sheet(geometry_.instances.size(), 1);
    std::vector<double> height(geometry_.instances.size(), std::nan(""));
    for (std::size_t i = 0; i < triangles_.size(); ++i) {
      const VoxelTriangle& t = triangles_[i];
      double& z = height[part_[i]];
      if (std::isnan(z)) z = t.p_m[0].z;
      if (t.sheet_m > 0.0 || t.axis != 2 || t.sign < 0 || std::abs(t.p_m[0].z - z) > kPlaneM)
        sheet[part_[i]] = 0;
    }
    for (std::size_t i = 0; i < triangles_.size(); ++i) triangles_[i].ground = sheet[part_[i]] != 0;
  }

  const scene::ScenarioDesc& scenario_;
  const scene::SceneGeometry& geometry_;
  std::vector<VoxelTriangle> triangles_;
  std::vector<std::size_t> part_;  ///< instance of every triangle
};

}  // namespace

tl::unexpected<physics::Error> refuse_shape(const scene::ScenarioDesc& scenario,
                                            std::uint32_t object, std::string text) {
  const std::string name =
      object < scenario.objects.size() ? scenario.objects[object].name : std::string();
  return make_error(ErrorCode::unsupported,
                    fmt::format("three-dimensional solution: object '{}': {}", name, text));
}

Result<std::vector<VoxelTriangle>> voxel_triangles(const scene::ScenarioDesc& scenario,
                                                   const scene::SceneGeometry& geometry) {
  return TriangleCollection(scenario, geometry).run();
}

}  // namespace emit::reference
