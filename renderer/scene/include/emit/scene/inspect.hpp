// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"

namespace emit::scene {

/// What the loader sees in one glTF file: the content of `emit inspect`.
struct SceneSummary {
  struct MeshRow {
    std::string name;
    std::uint64_t triangles = 0;
    std::uint64_t vertices = 0;
    std::uint32_t submeshes = 0;
    std::uint32_t placements = 0;
  };
  struct MaterialRow {
    std::string gltf_material;     ///< "" for primitives without material
    std::string library_material;  ///< "" when nothing of that name is in the library
    bool double_sided = false;
    std::uint64_t triangles = 0;  ///< placements counted
    double area_m2 = 0.0;         ///< placements counted
    /// Of these, sheets with the library's material (sheets.hpp): one temperature for both faces.
    std::uint64_t sheet_triangles = 0;
  };
  std::filesystem::path file;
  std::uint32_t nodes = 0;
  std::uint32_t placements = 0;
  std::uint64_t triangles = 0;  ///< placements counted
  std::uint64_t vertices = 0;   ///< stored, each mesh once
  std::uint64_t dropped_triangles = 0;
  std::vector<MeshRow> meshes;
  std::vector<MaterialRow> materials;
  std::vector<std::string> warnings;
  Aabb bounds_body;  ///< body axes: x forward, y right, z down
};

/// @param library  materials to match glTF names against; may be empty. Setup only.
/// Errors as import_gltf().
[[nodiscard]] physics::Result<SceneSummary> inspect_gltf(const std::filesystem::path& file,
                                                         std::span<const Material> library);
/// Lines for people, and one JSON object with the same content.
[[nodiscard]] std::string to_text(const SceneSummary& summary);
[[nodiscard]] std::string to_json(const SceneSummary& summary);

}  // namespace emit::scene
