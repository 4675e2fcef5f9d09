// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/gltf_import.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <optional>
#include <utility>

#include "coplanar.hpp"
#include "emit/physics/nearest_name.hpp"
#include "facing.hpp"
#include "gltf/gltf_file.hpp"
#include "gltf/gltf_image.hpp"
#include "gltf/gltf_mesh.hpp"
#include "gltf/gltf_nodes.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Float32 positions that are coarser than this are worth a warning.
constexpr double kMaxResolutionM = 0.005;

/// Most names that one warning lists.
constexpr std::size_t kMaxNames = 6;

std::string list_of(const std::vector<std::string>& names) {
  std::string out;
  for (std::size_t i = 0; i < std::min(names.size(), kMaxNames); ++i) {
    out += (i > 0 ? ", " : "") + names[i];
  }
  return names.size() > kMaxNames ? fmt::format("{} and {} more", out, names.size() - kMaxNames)
                                  : out;
}

/// A converted mesh among those of the model.
struct StoredMesh {
  std::optional<std::uint32_t> index;  ///< into GltfModel::meshes; nothing: it has no triangles
  glm::dvec3 origin_m{0.0};
  double resolution = 0.0;
  double max_coordinate = 0.0;
  bool first_use = false;
};

/// Converts each glTF mesh at most once per skin and handedness, when a node first asks for it.
class MeshStore {
 public:
  MeshStore(const GltfFile& file, GltfModel& model) : file_(file), model_(model), cut_outs_(file) {}

  /// @param skin  -1: the node has none
  /// Errors of convert_mesh() and read_skin().
  Result<StoredMesh> find(int mesh, int skin, const glm::dmat4& gltf_from_node, bool mirrored) {
    const auto [entry, is_new] = slots_.try_emplace({mesh, skin});
    Slot& slot = entry->second;
    if (is_new) {
      if (auto filled = fill(slot, mesh, skin, gltf_from_node); !filled) {
        return tl::unexpected(filled.error());
      }
    }
    const ConvertedMesh& converted = slot.converted;
    StoredMesh stored{std::nullopt, converted.origin_m, converted.resolution,
                      converted.max_coordinate, is_new};
    if (converted.mesh.indices.empty()) return stored;
    std::optional<std::uint32_t>& index = mirrored ? slot.mirrored_index : slot.index;
    if (!index) {
      index = static_cast<std::uint32_t>(model_.meshes.size());
      model_.meshes.push_back(mirrored ? mirrored_copy(converted.mesh) : converted.mesh);
    }
    stored.index = index;
    return stored;
  }

  /// Reads the images that give surfaces several materials, and adds these to the model.
  /// Errors name the material: config, and those of CutOuts::add_regions().
  Result<void> add_images(std::span<const MaterialImage> images) {
    const std::size_t count = model_.materials.size();
    for (const MaterialImage& image : images) {
      bool found = false;
      for (std::size_t i = 0; i < count; ++i) {
        if (model_.materials[i].name != image.gltf_material) continue;
        found = true;
        if (auto added = add_image(static_cast<std::uint32_t>(i), image); !added) return added;
      }
      if (!found) return unknown_material(image.gltf_material, count);
    }
    return {};
  }

  /// True where an image gives the surfaces of a material several ones.
  [[nodiscard]] bool has_regions(std::uint32_t material) const {
    return cut_outs_.has_regions(material);
  }
  /// True where the image of a material shows nothing but the outline that it cuts out.
  [[nodiscard]] bool is_outline(std::uint32_t material) const {
    return cut_outs_.is_outline(material);
  }

 private:
  struct Slot {
    ConvertedMesh converted;
    std::optional<std::uint32_t> index;
    std::optional<std::uint32_t> mirrored_index;
  };

  Result<void> add_image(std::uint32_t material, const MaterialImage& image) {
    const auto first = static_cast<std::uint32_t>(model_.materials.size());
    if (auto added = cut_outs_.add_regions(material, image, first); !added) {
      return tl::unexpected(
          std::move(added.error())
              .with_context(fmt::format("material_images: material '{}'", image.gltf_material)));
    }
    for (const MaterialColour& colour : image.legend) {
      model_.materials.push_back({fmt::format("{} #{:02x}{:02x}{:02x}", image.gltf_material,
                                              colour.rgb[0], colour.rgb[1], colour.rgb[2]),
                                  model_.materials[material].double_sided, colour.material});
    }
    return {};
  }

  [[nodiscard]] Result<void> unknown_material(const std::string& name, std::size_t count) const {
    std::vector<std::string_view> names;
    for (std::size_t i = 0; i < count; ++i) names.push_back(model_.materials[i].name);
    return make_error(ErrorCode::config,
                      fmt::format("material_images: the file has no material '{}'{}", name,
                                  physics::did_you_mean(name, names)));
  }

  Result<void> fill(Slot& slot, int mesh, int skin, const glm::dmat4& gltf_from_node) {
    std::optional<SkinPose> pose;
    if (skin >= 0) {
      if (nodes_.empty()) {
        Result<std::vector<glm::dmat4>> nodes = all_node_transforms(file_);
        if (!nodes) return tl::unexpected(std::move(nodes.error()));
        nodes_ = std::move(*nodes);
      }
      Result<SkinPose> read = read_skin(file_, skin, nodes_);
      if (!read) return tl::unexpected(std::move(read.error()));
      pose = std::move(*read);
      pose->gltf_from_node = gltf_from_node;
    }
    Result<ConvertedMesh> converted =
        convert_mesh(file_, mesh, pose ? &*pose : nullptr, cut_outs_, model_.warnings);
    if (!converted) return tl::unexpected(std::move(converted.error()));
    slot.converted = std::move(*converted);
    model_.dropped_triangles += slot.converted.dropped_triangles;
    return {};
  }

  const GltfFile& file_;
  GltfModel& model_;
  CutOuts cut_outs_;
  std::map<std::pair<int, int>, Slot> slots_;  ///< by mesh and skin
  std::vector<glm::dmat4> nodes_;              ///< transforms of all nodes, once a skin asks
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

/// True where the matrix presses a body flat, or to a line or a point. Small uniform scales do not:
/// files with whole numbers for positions have scales of 1e-6 and less.
bool has_no_volume(const glm::dmat4& matrix) {
  const glm::dmat3 linear(matrix);
  const double lengths[3] = {glm::length(linear[0]), glm::length(linear[1]),
                             glm::length(linear[2])};
  const double longest = std::max({lengths[0], lengths[1], lengths[2]});
  const double shortest = std::min({lengths[0], lengths[1], lengths[2]});
  constexpr double kMinRatio = 1e-9;
  if (!(shortest > kMinRatio * longest)) return true;
  const glm::dmat3 unit(linear[0] / lengths[0], linear[1] / lengths[1], linear[2] / lengths[2]);
  return !(std::abs(glm::determinant(unit)) > kMinRatio);
}

double greatest_scale(const glm::dmat4& matrix) {
  return std::max({glm::length(glm::dvec3(matrix[0])), glm::length(glm::dvec3(matrix[1])),
                   glm::length(glm::dvec3(matrix[2]))});
}

/// A mirroring node gets a mirrored copy of the mesh, so that its matrix no longer mirrors and
/// front faces come out counter-clockwise. A skinned mesh is placed by its joints alone: the
/// transform of its own node does not count (glTF 2.0, 3.7.3.3).
Result<void> place_mesh(const GltfFile& file, const PlacedNode& placed, MeshStore& store,
                        GltfModel& model) {
  const tinygltf::Node& node = file.model.nodes[static_cast<std::size_t>(placed.node)];
  const std::string context = element("node", placed.node, node.name);
  if (static_cast<std::size_t>(node.mesh) >= file.model.meshes.size()) {
    return make_error(ErrorCode::parse,
                      fmt::format("{}: mesh {} does not exist", context, node.mesh));
  }
  Result<std::vector<glm::dmat4>> instances = node_instances(file, placed.node);
  if (!instances) {
    return tl::unexpected(instances.error());
  }
  glm::dmat4 gltf_from_node = placed.gltf_from_node;
  if (node.skin >= 0) {
    model.warnings.push_back(
        fmt::format("{}: {}: the skinned mesh stays in the pose that the file's joints have",
                    file.name, context));
    gltf_from_node = glm::dmat4(1.0);
    *instances = {glm::dmat4(1.0)};
  }
  std::size_t collapsed = 0;
  for (const glm::dmat4& node_from_mesh : *instances) {
    glm::dmat4 gltf_from_mesh = gltf_from_node * node_from_mesh;
    const double determinant = glm::determinant(glm::dmat3(gltf_from_mesh));
    if (!is_finite(gltf_from_mesh) || !std::isfinite(determinant)) {
      return make_error(ErrorCode::parse, context + ": the transform is not finite");
    }
    if (has_no_volume(gltf_from_mesh)) {
      ++collapsed;
      continue;
    }
    const bool mirrored = determinant < 0.0;
    const Result<StoredMesh> mesh =
        store.find(node.mesh, node.skin, placed.gltf_from_node, mirrored);
    if (!mesh) {
      return tl::unexpected(mesh.error());
    }
    if (!mesh->index) continue;
    const double resolution_m = mesh->resolution * greatest_scale(gltf_from_mesh);
    if (mesh->first_use && resolution_m > kMaxResolutionM) {
      model.warnings.push_back(fmt::format(
          "{}: {}: vertices lie up to {:.3g} from the origin of {}, where float32 positions "
          "resolve "
          "{:.2g} m: details finer than that are lost in the file; export local coordinates",
          file.name, context, mesh->max_coordinate,
          element("mesh", node.mesh, file.model.meshes[static_cast<std::size_t>(node.mesh)].name),
          resolution_m));
    }
    if (mesh->origin_m != glm::dvec3(0.0)) {
      gltf_from_mesh = glm::translate(gltf_from_mesh, mesh->origin_m);
    }
    const std::string name = node.name.empty() ? fmt::format("node {}", placed.node) : node.name;
    model.placements.push_back(
        {*mesh->index, mirrored ? gltf_from_mesh * mesh_from_mirrored() : gltf_from_mesh, name});
  }
  if (collapsed > 0) {
    model.warnings.push_back(
        fmt::format("{}: {}: {} placements of zero volume skipped", file.name, context, collapsed));
  }
  return {};
}

/// True where images promise more than a surface gets. `is_read` is true where the image of the
/// base colour shows nothing but what it cuts out, or gives the surface its materials.
bool has_texture(const tinygltf::Material& material, bool is_read) {
  const auto& pbr = material.pbrMetallicRoughness;
  for (const int index : {is_read ? -1 : pbr.baseColorTexture.index,
                          pbr.metallicRoughnessTexture.index, material.normalTexture.index,
                          material.occlusionTexture.index, material.emissiveTexture.index}) {
    if (index >= 0) return true;
  }
  const auto extension = material.extensions.find("KHR_materials_pbrSpecularGlossiness");
  return extension != material.extensions.end() && extension->second.Has("diffuseTexture");
}

/// Says what the materials in use ask for and do not get.
void warn_of_materials(const GltfFile& file, const MeshStore& store, GltfModel& model) {
  std::vector<bool> in_use(model.materials.size(), false);
  for (const Mesh& mesh : model.meshes) {
    for (const Submesh& submesh : mesh.submeshes) {
      if (submesh.material < in_use.size()) in_use[submesh.material] = true;
    }
  }
  std::vector<std::string> textured;
  std::vector<std::string> blended;
  for (std::uint32_t i = 0; i < file.model.materials.size(); ++i) {
    if (!in_use[i]) continue;
    const tinygltf::Material& material = file.model.materials[i];
    const std::string name = "'" + model.materials[i].name + "'";
    const bool is_read = store.has_regions(i) || store.is_outline(i);
    if (has_texture(material, is_read)) textured.push_back(name);
    if (material.alphaMode == "BLEND") blended.push_back(name);
  }
  if (!textured.empty()) {
    model.warnings.push_back(
        fmt::format("{}: textures only cut out what alphaMode MASK says: the surface of material "
                    "{} has one set of properties, whatever its images show "
                    "('material_images' makes materials of their colours)",
                    file.name, list_of(textured)));
  }
  if (!blended.empty()) {
    model.warnings.push_back(
        fmt::format("{}: alphaMode BLEND of material {} is ignored: the surface is taken as opaque",
                    file.name, list_of(blended)));
  }
}

/// Says what else of the file is not shown. `shown` has an entry per glTF mesh.
void warn_of_the_rest(const GltfFile& file, const std::vector<bool>& shown, GltfModel& model) {
  std::vector<std::string> coloured;
  for (std::size_t m = 0; m < shown.size(); ++m) {
    const tinygltf::Mesh& mesh = file.model.meshes[m];
    const bool has_colour =
        std::ranges::any_of(mesh.primitives, [](const tinygltf::Primitive& primitive) {
          return primitive.attributes.count("COLOR_0") > 0;
        });
    if (shown[m] && has_colour) coloured.push_back(element("mesh", static_cast<int>(m), mesh.name));
  }
  if (!coloured.empty()) {
    model.warnings.push_back(
        fmt::format("{}: vertex colours are ignored: {}", file.name, list_of(coloured)));
  }
  if (!file.model.animations.empty()) {
    model.warnings.push_back(
        fmt::format("{}: {} animations are not played: nodes stay where the "
                    "file places them",
                    file.name, file.model.animations.size()));
  }
  if (!model.placements.empty()) return;
  const bool other_scene = file.model.scenes.size() > 1;
  model.warnings.push_back(fmt::format(
      "{}: {} has no triangles{}", file.name,
      file.model.scenes.empty()
          ? std::string("the file")
          : element(
                "scene", std::max(file.model.defaultScene, 0),
                file.model.scenes[static_cast<std::size_t>(std::max(file.model.defaultScene, 0))]
                    .name),
      other_scene ? "; the other scenes of the file are not shown" : ""));
}

/// Cuts surfaces that lie in one plane, see cut_coplanar().
void separate_coplanar(const GltfFile& file, GltfModel& model) {
  std::vector<CoplanarPart> parts;
  std::vector<std::size_t> placement_of;
  std::vector<std::size_t> count(model.meshes.size(), 0);
  for (std::size_t i = 0; i < model.placements.size(); ++i) {
    const GltfPlacement& placement = model.placements[i];
    if (++count[placement.mesh] > kMaxComparedPlacements) continue;
    parts.push_back(
        {placement.mesh, placement.gltf_from_mesh,
         fmt::format("node '{}' mesh '{}'", placement.node, model.meshes[placement.mesh].name)});
    placement_of.push_back(i);
  }
  for (CoplanarPart& part : parts) part.shared = count[part.mesh] > kMaxComparedPlacements;
  const std::vector<std::string> messages = cut_coplanar(model.meshes, parts);
  if (messages.empty()) return;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    model.placements[placement_of[i]].mesh = parts[i].mesh;
  }
  for (const std::string& message : messages) {
    model.warnings.push_back(fmt::format("{}: {}", file.name, message));
  }
  drop_unused(model.meshes, model.placements);
}

Result<GltfModel> build_model(const GltfFile& file, std::span<const MaterialImage> images) {
  GltfModel model;
  model.file = file.path;
  model.warnings = file.warnings;
  for (std::size_t i = 0; i < file.model.materials.size(); ++i) {
    const tinygltf::Material& material = file.model.materials[i];
    model.materials.push_back(
        {material.name.empty() ? fmt::format("material {}", i) : material.name,
         material.doubleSided,
         {}});
  }
  const Result<std::vector<PlacedNode>> nodes = place_nodes(file);
  if (!nodes) {
    return tl::unexpected(nodes.error());
  }
  model.nodes = static_cast<std::uint32_t>(nodes->size());
  MeshStore store(file, model);
  if (auto added = store.add_images(images); !added) return tl::unexpected(added.error());
  std::vector<bool> shown(file.model.meshes.size(), false);
  for (const PlacedNode& placed : *nodes) {
    const int mesh = file.model.nodes[static_cast<std::size_t>(placed.node)].mesh;
    if (mesh < 0) {
      continue;
    }
    if (auto result = place_mesh(file, placed, store, model); !result) {
      return tl::unexpected(result.error());
    }
    shown[static_cast<std::size_t>(mesh)] = true;
  }
  mend_facing(model);
  separate_coplanar(file, model);
  warn_of_materials(file, store, model);
  warn_of_the_rest(file, shown, model);
  return model;
}

}  // namespace

Result<std::vector<GltfColours>> gltf_colours(const std::filesystem::path& path) {
  const Result<GltfFile> file = parse_gltf_file(path);
  if (!file) return tl::unexpected(file.error());
  constexpr std::size_t kMostColours = 8;
  std::vector<GltfColours> out;
  for (std::size_t i = 0; i < file->model.materials.size(); ++i) {
    const tinygltf::Material& material = file->model.materials[i];
    const auto use = texture_use(*file, material.pbrMetallicRoughness.baseColorTexture);
    if (!use) continue;
    const auto image = read_image(*file, use->image);
    if (!image) continue;
    GltfColours colours{material.name.empty() ? fmt::format("material {}", i) : material.name, {}};
    for (const ColourShare& share : main_colours(image->rgba, kMostColours)) {
      colours.colours.push_back({share.rgb, share.frac});
    }
    out.push_back(std::move(colours));
  }
  return out;
}

Result<GltfModel> import_gltf(const std::filesystem::path& file,
                              std::span<const MaterialImage> images) {
  // The only exception left is bad_alloc, for a file that claims absurd sizes.
  try {
    const Result<GltfFile> parsed = parse_gltf_file(file);
    if (!parsed) {
      return tl::unexpected(parsed.error());
    }
    Result<GltfModel> model = build_model(*parsed, images);
    if (!model) {
      return tl::unexpected(std::move(model.error()).with_context(file.string()));
    }
    return model;
  } catch (const std::exception& thrown) {
    return make_error(ErrorCode::parse, fmt::format("{}: {}", file.string(), thrown.what()));
  }
}

}  // namespace emit::scene
