// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/gltf_import.hpp"
#include "emit/scene/mesh.hpp"

namespace emit::scene {

/// Material of scenarios that name no default: a grey concrete-like body.
[[nodiscard]] Material builtin_default_material();

/// Finds library materials for glTF ones and collects those in use.
class MaterialLookup {
 public:
  /// Error: config, when default_material is not in the library.
  [[nodiscard]] static physics::Result<MaterialLookup> create(const ScenarioDesc& scenario);

  /// Library positions for each glTF material and, last, for primitives without one. A material or
  /// a key of the map that finds nothing is noted for a warning.
  /// @pre the object exists.
  /// Error: config, naming object and material.
  [[nodiscard]] physics::Result<std::vector<std::size_t>> resolve(std::uint32_t object_index,
                                                                  const GltfModel& model);

  /// Moves materials, mappings and warnings into `geometry`. Returns, by library position, the
  /// index in its table (0 for materials that are not in use).
  [[nodiscard]] std::vector<std::uint32_t> finish(SceneGeometry& geometry);

 private:
  /// Notes each key of the object's material_map that no material of the file has.
  void warn_of_unknown_keys(const ObjectDesc& object, const GltfModel& model);
  /// Notes where the evaporation of materials in use, or of the surroundings, does not hold.
  void warn_of_moisture();
  [[nodiscard]] bool find(std::string_view name, std::size_t& position) const noexcept;

  /// Returns ", did you mean 'NAME'?" with the nearest name of the library, else an empty text.
  [[nodiscard]] std::string hint_at_material(std::string_view name) const;

  const ScenarioDesc* scenario_ = nullptr;
  std::vector<Material> library_;
  std::size_t default_position_ = 0;
  std::vector<bool> used_;
  std::vector<MaterialMapping> mappings_;
  std::vector<std::size_t> mapping_positions_;
  std::vector<std::string> warnings_;
};

}  // namespace emit::scene
