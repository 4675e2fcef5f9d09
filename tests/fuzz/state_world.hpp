// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "surface/state/state_file.hpp"

/// Scene of the state files in the corpus.
namespace emit::fuzz {

inline constexpr std::size_t kEntities = 2;

[[nodiscard]] inline renderer::StateKey state_key() {
  renderer::StateKey key{};
  for (std::size_t i = 0; i < key.size(); ++i) key[i] = 0x0123456789abcdefULL * (i + 3);
  return key;
}

/// Returns one octahedron of two materials.
[[nodiscard]] inline scene::SceneGeometry state_geometry() {
  scene::Mesh mesh;
  mesh.positions_m = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  mesh.normals = mesh.positions_m;
  mesh.indices = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
  mesh.submeshes = {{0, 12, 1, false}, {12, 12, 2, false}};
  scene::SceneGeometry geometry;
  geometry.meshes.push_back(std::move(mesh));
  geometry.materials.resize(3);
  geometry.instances.resize(1);
  return geometry;
}

}  // namespace emit::fuzz
