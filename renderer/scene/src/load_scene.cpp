// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/ext/matrix_transform.hpp>
#include <map>
#include <set>
#include <utility>

#include "coplanar.hpp"
#include "emit/scene/gltf_import.hpp"
#include "emit/scene/mesh.hpp"
#include "material_lookup.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// A file with the images that give its surfaces several materials.
struct ModelKey {
  std::filesystem::path file;
  std::vector<MaterialImage> images;
  auto operator<=>(const ModelKey&) const = default;
};
/// One model under one assignment of materials. Objects that agree in both share its meshes.
using ModelUse = std::pair<const GltfModel*, std::vector<std::size_t>>;

class SceneLoader {
 public:
  SceneLoader(const ScenarioDesc& scenario, MaterialLookup lookup)
      : scenario_(scenario), lookup_(std::move(lookup)) {}

  Result<SceneGeometry> load() {
    for (std::uint32_t i = 0; i < scenario_.objects.size(); ++i) {
      if (auto added = add_object(i); !added) {
        return tl::unexpected(added.error());
      }
      geometry_.interiors.push_back(scenario_.objects[i].interior);
    }
    separate_coplanar();
    const std::vector<std::uint32_t> index_of = lookup_.finish(geometry_);
    for (Mesh& mesh : geometry_.meshes) {
      for (Submesh& submesh : mesh.submeshes) {
        submesh.material = index_of[submesh.material];
      }
    }
    for (const Instance& instance : geometry_.instances) {
      geometry_.bounds.add(instance.world_bounds);
      if (instance.entity_id == 0) {
        geometry_.static_bounds.add(instance.world_bounds);
      }
      geometry_.triangles += geometry_.meshes[instance.mesh].indices.size() / 3;
    }
    return std::move(geometry_);
  }

 private:
  Result<void> check(const ObjectDesc& object) {
    const std::string context =
        fmt::format("{}: object '{}'", scenario_.file.string(), object.name);
    if (!(object.scale > 0.0) || !std::isfinite(object.scale)) {
      return make_error(ErrorCode::config,
                        fmt::format("{}: scale {} is not positive", context, object.scale));
    }
    for (const physics::Pose& pose : object.instances) {
      if (!physics::is_valid(pose)) {
        return make_error(ErrorCode::config, context + ": a placement is not a valid pose");
      }
    }
    if (object.entity_id != 0) {
      if (object.instances.size() != 1) {
        return make_error(ErrorCode::config,
                          fmt::format("{}: entity {} has {} placements instead of one", context,
                                      object.entity_id, object.instances.size()));
      }
      if (!entities_.insert(object.entity_id).second) {
        return make_error(ErrorCode::config,
                          fmt::format("{}: entity id {} is used twice", context, object.entity_id));
      }
    }
    return {};
  }

  Result<const GltfModel*> model_of(const ObjectDesc& object) {
    const ModelKey key{object.gltf.lexically_normal(), object.material_images};
    if (const auto known = models_.find(key); known != models_.end()) {
      return &known->second;
    }
    Result<GltfModel> model = import_gltf(key.file, key.images);
    if (!model) {
      return tl::unexpected(std::move(model.error()));
    }
    geometry_.dropped_triangles += model->dropped_triangles;
    geometry_.warnings.insert(geometry_.warnings.end(), model->warnings.begin(),
                              model->warnings.end());
    return &models_.emplace(key, std::move(*model)).first->second;
  }

  /// Index of the model's first mesh in the scene. Until the end of the load, materials of
  /// submeshes are positions in the library.
  std::uint32_t mesh_base(const GltfModel& model, const std::vector<std::size_t>& materials) {
    const ModelUse use{&model, materials};
    const auto [entry, is_new] =
        bases_.emplace(use, static_cast<std::uint32_t>(geometry_.meshes.size()));
    if (is_new) {
      for (const Mesh& mesh : model.meshes) {
        geometry_.meshes.push_back(mesh);
        for (Submesh& submesh : geometry_.meshes.back().submeshes) {
          const std::size_t slot = std::min<std::size_t>(submesh.material, materials.size() - 1);
          submesh.material = static_cast<std::uint32_t>(materials[slot]);
        }
      }
    }
    return entry->second;
  }

  Result<void> add_object(std::uint32_t object_index) {
    const ObjectDesc& object = scenario_.objects[object_index];
    if (auto checked = check(object); !checked) {
      return checked;
    }
    const Result<const GltfModel*> model = model_of(object);
    if (!model) {
      physics::Error error =
          physics::Error(model.error()).with_context(fmt::format("object '{}'", object.name));
      // A file that cannot be read now may be readable later. Any other fault is the scenario's
      // own.
      if (error.code != ErrorCode::io) error.code = ErrorCode::config;
      return tl::unexpected(std::move(error));
    }
    if ((*model)->placements.empty()) {
      geometry_.warnings.push_back(fmt::format("{}: object '{}': {} has no triangles to show",
                                               scenario_.file.string(), object.name,
                                               object.gltf.string()));
    }
    const Result<std::vector<std::size_t>> materials = lookup_.resolve(object_index, **model);
    if (!materials) {
      return tl::unexpected(materials.error());
    }
    const std::uint32_t base = mesh_base(**model, *materials);
    const glm::dmat4 body_from_gltf_scaled = body_from_model(object) * body_from_gltf();
    for (std::uint32_t p = 0; p < object.instances.size(); ++p) {
      const glm::dmat4 world_from_body = world_from_body_matrix(object.instances[p]);
      for (const GltfPlacement& placement : (*model)->placements) {
        Instance instance;
        instance.mesh = base + placement.mesh;
        instance.object = object_index;
        instance.placement = p;
        instance.entity_id = object.entity_id;
        instance.body_from_mesh = body_from_gltf_scaled * placement.gltf_from_mesh;
        instance.world_from_mesh = world_from_body * instance.body_from_mesh;
        instance.world_bounds =
            transformed(geometry_.meshes[instance.mesh].bounds, instance.world_from_mesh);
        geometry_.instances.push_back(instance);
      }
    }
    return {};
  }

  /// True where entities place the mesh, or more static instances than are compared.
  [[nodiscard]] bool is_shared(std::uint32_t mesh, std::size_t static_uses) const {
    return static_uses > kMaxComparedPlacements ||
           std::ranges::any_of(geometry_.instances, [&](const Instance& instance) {
             return instance.mesh == mesh && instance.entity_id != 0;
           });
  }

  /// Cuts static surfaces that lie in the plane of those of other placements. Within one placement
  /// the import has done so.
  void separate_coplanar() {
    std::vector<std::size_t> uses(geometry_.meshes.size(), 0);
    std::vector<std::size_t> candidates;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> groups;
    for (std::size_t i = 0; i < geometry_.instances.size(); ++i) {
      const Instance& instance = geometry_.instances[i];
      if (instance.entity_id != 0 || ++uses[instance.mesh] > kMaxComparedPlacements) continue;
      candidates.push_back(i);
      const auto next = static_cast<std::uint32_t>(groups.size() + 1);
      groups.try_emplace({instance.object, instance.placement}, next);
    }
    if (groups.size() < 2) return;
    std::vector<CoplanarPart> parts;
    for (const std::size_t i : candidates) {
      const Instance& instance = geometry_.instances[i];
      const Mesh& mesh = geometry_.meshes[instance.mesh];
      parts.push_back(
          {instance.mesh, instance.world_from_mesh,
           fmt::format("object '{}' mesh '{}'", scenario_.objects[instance.object].name, mesh.name),
           groups.at({instance.object, instance.placement})});
    }
    for (CoplanarPart& part : parts) part.shared = is_shared(part.mesh, uses[part.mesh]);
    const std::vector<std::string> messages = cut_coplanar(geometry_.meshes, parts);
    if (messages.empty()) return;
    for (std::size_t k = 0; k < parts.size(); ++k) {
      Instance& instance = geometry_.instances[candidates[k]];
      instance.mesh = parts[k].mesh;
      instance.world_bounds =
          transformed(geometry_.meshes[instance.mesh].bounds, instance.world_from_mesh);
    }
    for (const std::string& message : messages) {
      geometry_.warnings.push_back(fmt::format("{}: {}", scenario_.file.string(), message));
    }
    drop_unused(geometry_.meshes, geometry_.instances);
  }

  const ScenarioDesc& scenario_;
  MaterialLookup lookup_;
  SceneGeometry geometry_;
  std::map<ModelKey, GltfModel> models_;
  std::map<ModelUse, std::uint32_t> bases_;
  std::set<std::uint32_t> entities_;
};

}  // namespace

Result<SceneGeometry> load_scene(const ScenarioDesc& scenario) {
  Result<MaterialLookup> lookup = MaterialLookup::create(scenario);
  if (!lookup) {
    return tl::unexpected(std::move(lookup.error()));
  }
  return SceneLoader(scenario, std::move(*lookup)).load();
}

}  // namespace emit::scene
