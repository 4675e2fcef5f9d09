// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/gltf_import.hpp"

#include <fmt/format.h>

#include <cmath>
#include <exception>
#include <glm/matrix.hpp>
#include <optional>
#include <utility>

#include "gltf_file.hpp"
#include "gltf_mesh.hpp"
#include "gltf_nodes.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Converts each glTF mesh at most once per handedness, when a node first asks for it.
class MeshStore {
 public:
  MeshStore(const GltfFile& file, GltfModel& model)
      : file_(file), model_(model), slots_(file.model.meshes.size()) {}

  /// Index into GltfModel::meshes; nothing for a mesh without triangles.
  Result<std::optional<std::uint32_t>> find(int mesh, bool mirrored) {
    Slot& slot = slots_[static_cast<std::size_t>(mesh)];
    if (!slot.converted) {
      Result<ConvertedMesh> converted = convert_mesh(file_, mesh, model_.warnings);
      if (!converted) {
        return tl::unexpected(converted.error());
      }
      slot.converted = true;
      slot.mesh = std::move(converted->mesh);
      model_.dropped_triangles += converted->dropped_triangles;
    }
    if (slot.mesh.indices.empty()) {
      return std::optional<std::uint32_t>{};
    }
    std::optional<std::uint32_t>& index = mirrored ? slot.mirrored_index : slot.index;
    if (!index) {
      index = static_cast<std::uint32_t>(model_.meshes.size());
      model_.meshes.push_back(mirrored ? mirrored_copy(slot.mesh) : slot.mesh);
    }
    return index;
  }

 private:
  struct Slot {
    bool converted = false;
    Mesh mesh;
    std::optional<std::uint32_t> index;
    std::optional<std::uint32_t> mirrored_index;
  };
  const GltfFile& file_;
  GltfModel& model_;
  std::vector<Slot> slots_;
};

bool is_finite(const glm::dmat4& matrix) {
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) {
      if (!std::isfinite(matrix[column][row])) {
        return false;
      }
    }
  }
  return true;
}

/// A mirroring node gets a mirrored copy of the mesh, so that its matrix no longer mirrors and
/// front faces come out counter-clockwise.
Result<void> place_mesh(const GltfFile& file, const PlacedNode& placed, MeshStore& store,
                        GltfModel& model) {
  const tinygltf::Node& node = file.model.nodes[static_cast<std::size_t>(placed.node)];
  const std::string context = element("node", placed.node, node.name);
  if (static_cast<std::size_t>(node.mesh) >= file.model.meshes.size()) {
    return make_error(ErrorCode::parse,
                      fmt::format("{}: mesh {} does not exist", context, node.mesh));
  }
  if (node.skin >= 0) {
    model.warnings.push_back(
        fmt::format("{}: {}: skin ignored, shown in its bind pose", file.name, context));
  }
  const Result<std::vector<glm::dmat4>> instances = node_instances(file, placed.node);
  if (!instances) {
    return tl::unexpected(instances.error());
  }
  std::size_t collapsed = 0;
  for (const glm::dmat4& node_from_mesh : *instances) {
    const glm::dmat4 gltf_from_mesh = placed.gltf_from_node * node_from_mesh;
    const double determinant = glm::determinant(glm::dmat3(gltf_from_mesh));
    if (!is_finite(gltf_from_mesh) || !std::isfinite(determinant)) {
      return make_error(ErrorCode::parse, context + ": the transform is not finite");
    }
    if (std::abs(determinant) < 1e-18) {
      ++collapsed;
      continue;
    }
    const Result<std::optional<std::uint32_t>> mesh = store.find(node.mesh, determinant < 0.0);
    if (!mesh) {
      return tl::unexpected(mesh.error());
    }
    if (*mesh) {
      const glm::dmat4 proper =
          determinant < 0.0 ? gltf_from_mesh * mesh_from_mirrored() : gltf_from_mesh;
      const std::string name = node.name.empty() ? fmt::format("node {}", placed.node) : node.name;
      model.placements.push_back({**mesh, proper, name});
    }
  }
  if (collapsed > 0) {
    model.warnings.push_back(
        fmt::format("{}: {}: {} placements of zero volume skipped", file.name, context, collapsed));
  }
  return {};
}

Result<GltfModel> build_model(const GltfFile& file) {
  GltfModel model;
  model.file = file.path;
  model.warnings = file.warnings;
  for (std::size_t i = 0; i < file.model.materials.size(); ++i) {
    const tinygltf::Material& material = file.model.materials[i];
    model.materials.push_back(
        {material.name.empty() ? fmt::format("material {}", i) : material.name,
         material.doubleSided});
  }
  const Result<std::vector<PlacedNode>> nodes = place_nodes(file);
  if (!nodes) {
    return tl::unexpected(nodes.error());
  }
  model.nodes = static_cast<std::uint32_t>(nodes->size());
  MeshStore store(file, model);
  for (const PlacedNode& placed : *nodes) {
    if (file.model.nodes[static_cast<std::size_t>(placed.node)].mesh < 0) {
      continue;
    }
    if (auto result = place_mesh(file, placed, store, model); !result) {
      return tl::unexpected(result.error());
    }
  }
  return model;
}

}  // namespace

Result<GltfModel> import_gltf(const std::filesystem::path& file) {
  // bad_alloc for a file that claims absurd sizes is the only throw left.
  try {
    const Result<GltfFile> parsed = parse_gltf_file(file);
    if (!parsed) {
      return tl::unexpected(parsed.error());
    }
    Result<GltfModel> model = build_model(*parsed);
    if (!model) {
      return tl::unexpected(std::move(model.error()).with_context(file.string()));
    }
    return model;
  } catch (const std::exception& thrown) {
    return make_error(ErrorCode::parse, fmt::format("{}: {}", file.string(), thrown.what()));
  }
}

}  // namespace emit::scene
