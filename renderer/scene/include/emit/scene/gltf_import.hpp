// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"

/// glTF 2.0 files (.glb, .gltf with embedded or external buffers) to plain meshes.
///
/// Handled: node hierarchies (TRS and matrix, mirrored ones too), the default scene (else the
/// first, else all root nodes), any number of primitives and materials, triangle lists, strips and
/// fans, 8/16/32-bit and no indices, interleaved, strided, normalised and sparse accessors,
/// EXT_mesh_gpu_instancing, KHR_mesh_quantization, doubleSided. Images are not read. Points, lines,
/// skins and morph targets are skipped with a warning; an unknown required extension is an error,
/// and so are coordinates beyond 1e9. Missing normals are computed flat, as the glTF specification
/// asks.
namespace emit::scene {

inline constexpr std::uint32_t kNoGltfMaterial = 0xffffffffU;

struct GltfMaterial {
  std::string name;  ///< "material N" where the file gives none
  bool double_sided = false;
};

/// One mesh under one node.
struct GltfPlacement {
  std::uint32_t mesh = 0;          ///< index into GltfModel::meshes
  glm::dmat4 gltf_from_mesh{1.0};  ///< determinant > 0
  std::string node;                ///< name of the node, "node N" where the file gives none
};

struct GltfModel {
  std::filesystem::path file;
  std::vector<Mesh> meshes;  ///< Submesh::material indexes `materials`, or is kNoGltfMaterial
  std::vector<GltfMaterial> materials;
  std::vector<GltfPlacement> placements;
  std::uint32_t nodes = 0;  ///< of the scene shown, with and without a mesh
  std::uint64_t dropped_triangles = 0;
  std::vector<std::string> warnings;  ///< each begins with the file name
};

/// Setup only; any thread. Errors name file and element: not_found, io, parse (malformed or
/// inconsistent), unsupported (required extension).
[[nodiscard]] physics::Result<GltfModel> import_gltf(const std::filesystem::path& file);

}  // namespace emit::scene
