// SPDX-License-Identifier: Apache-2.0
// Fuzz target: scene files (.glb, .gltf), and the processing of their meshes when a scene is
// loaded.
#include <cmath>
#include <span>

#include "emit/scene/clusters.hpp"
#include "emit/scene/gltf_import.hpp"
#include "emit/scene/mesh.hpp"
#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"

namespace {

using namespace emit;

void check(const scene::Mesh& mesh, std::size_t materials) {
  fuzz::require(mesh.normals.size() == mesh.positions_m.size(), "every vertex has a normal");
  for (const std::uint32_t index : mesh.indices) {
    fuzz::require(index < mesh.positions_m.size(), "indices lie within the vertices");
  }
  for (const glm::vec3& p : mesh.positions_m) {
    fuzz::require(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z),
                  "positions are numbers");
  }
  for (const scene::Submesh& part : mesh.submeshes) {
    fuzz::require(std::uint64_t{part.first_index} + part.index_count <= mesh.indices.size(),
                  "submeshes lie within the indices");
    fuzz::require(part.material < materials || part.material == scene::kNoGltfMaterial,
                  "materials exist");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  auto model = scene::import_gltf(fuzz::file_of(fuzz::as_bytes(data, size)));
  if (!model) return 0;
  for (scene::Mesh& mesh : model->meshes) {
    check(mesh, model->materials.size());
    static_cast<void>(scene::is_closed_surface(mesh));
    std::size_t indices = 0;
    for (const scene::Submesh& submesh : mesh.submeshes) {
      const auto part = std::span(mesh.indices).subspan(submesh.first_index, submesh.index_count);
      for (const scene::Cluster& cluster : scene::cut_into_clusters(mesh.positions_m, part)) {
        indices += cluster.index_count;
      }
    }
    check(mesh, model->materials.size());
    fuzz::require(indices == mesh.indices.size(), "clusters hold every triangle");
  }
  for (const scene::GltfPlacement& placement : model->placements) {
    fuzz::require(placement.mesh < model->meshes.size(), "placements name meshes");
  }
  return 0;
}
