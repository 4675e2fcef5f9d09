// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"

namespace emit::scene {

/// Summary of one glTF file as the loader sees it. `emit inspect` prints it.
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
    std::string library_material;  ///< "" when the library has no material of that name
    bool double_sided = false;
    std::uint64_t triangles = 0;  ///< sum over the placements
    double area_m2 = 0.0;         ///< sum over the placements
    /// Number of these triangles that are sheets with the library's material (see sheets.hpp): both
    /// faces have one temperature.
    std::uint64_t sheet_triangles = 0;
    /// Main colours of the image of its base colour as "#rrggbb", with their share of the texels.
    std::vector<std::pair<std::string, double>> colours;
  };
  std::filesystem::path file;
  std::uint32_t nodes = 0;
  std::uint32_t placements = 0;
  std::uint64_t triangles = 0;  ///< sum over the placements
  std::uint64_t vertices = 0;   ///< sum over the meshes
  std::uint64_t dropped_triangles = 0;
  std::vector<MeshRow> meshes;
  std::vector<MaterialRow> materials;
  std::vector<std::string> warnings;
  Aabb bounds_body;  ///< body axes: x forward, y right, z down
};

/// Loads a file and sums up what is in it. Setup only.
/// @param library  materials whose names glTF materials may have; may be empty
/// Errors are those of import_gltf().
[[nodiscard]] physics::Result<SceneSummary> inspect_gltf(const std::filesystem::path& file,
                                                         std::span<const Material> library);
/// The summary as lines for people.
[[nodiscard]] std::string to_text(const SceneSummary& summary);
/// The summary as one JSON object with the same content.
[[nodiscard]] std::string to_json(const SceneSummary& summary);

}  // namespace emit::scene
