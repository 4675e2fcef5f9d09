// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

/// glTF 2.0 files (.glb, .gltf with embedded or external buffers) to plain meshes.
///
/// The import handles node hierarchies (TRS and matrix, mirrored ones too), the default scene (else
/// the first, else all root nodes), any number of primitives and materials, triangle lists, strips
/// and fans, 8/16/32-bit and no indices, interleaved, strided, normalised and sparse accessors,
/// skins in the pose of the file, doubleSided, EXT_mesh_gpu_instancing, KHR_mesh_quantization and
/// EXT_meshopt_compression, and surfaces that an alpha mask cuts out (alphaMode MASK, PNG images,
/// KHR_texture_transform), whose triangles end at the outline of the mask. Missing normals are
/// computed flat, as the glTF specification asks. Images may part the surfaces of a material into
/// several (MaterialImage), along the sides of their texels.
///
/// A warning names points, lines, morph targets, animations, other images, vertex colours and
/// alphaMode BLEND, none of which is used. An unknown required extension, another version than 2
/// and coordinates beyond 1e9 are errors.
///
/// The import repairs what would otherwise be shown wrong, and warns of it: normals without
/// direction, normals against the winding, surfaces of two materials in one plane. Vertices far
/// from the origin of their mesh get an origin of their own, which the placements take into
/// account.
namespace emit::scene {

/// Submesh::material of a primitive without material.
inline constexpr std::uint32_t kNoGltfMaterial = 0xffffffffU;

/// A material of the file.
struct GltfMaterial {
  std::string name;  ///< "material N" where the file gives none; with "#rrggbb" for a colour
  bool double_sided = false;
  std::string library;  ///< material that the legend of an image names; else empty
};

/// One mesh under one node.
struct GltfPlacement {
  std::uint32_t mesh = 0;          ///< index into GltfModel::meshes
  glm::dmat4 gltf_from_mesh{1.0};  ///< determinant > 0
  std::string node;                ///< name of the node, "node N" where the file gives none
};

/// A file as the scene loader needs it.
struct GltfModel {
  std::filesystem::path file;
  std::vector<Mesh> meshes;  ///< Submesh::material indexes `materials`, or is kNoGltfMaterial
  std::vector<GltfMaterial> materials;
  std::vector<GltfPlacement> placements;
  std::uint32_t nodes = 0;              ///< nodes of the scene shown, with and without a mesh
  std::uint64_t dropped_triangles = 0;  ///< triangles of zero area
  std::vector<std::string> warnings;    ///< each begins with the file name
};

/// Main colours of the image that a material of a file has for its base colour.
struct GltfColours {
  std::string gltf_material;
  struct Share {
    std::array<std::uint8_t, 3> rgb{};  ///< sRGB
    double frac = 0.0;                  ///< share of the texels of the image
  };
  std::vector<Share> colours;  ///< the most frequent first
};
/// Reads the images of base colours, for legends of MaterialImage. Images that cannot be read are
/// left out. Setup only; any thread. Errors are those of import_gltf().
[[nodiscard]] physics::Result<std::vector<GltfColours>> gltf_colours(
    const std::filesystem::path& file);

/// Setup only; any thread.
/// @param images  what gives surfaces several materials; each colour of a legend becomes a material
///                of the model
/// Errors name file and element: not_found, io, parse (malformed or inconsistent), unsupported
/// (required extension, image), config (a material that the file does not have).
[[nodiscard]] physics::Result<GltfModel> import_gltf(const std::filesystem::path& file,
                                                     std::span<const MaterialImage> images = {});

}  // namespace emit::scene
