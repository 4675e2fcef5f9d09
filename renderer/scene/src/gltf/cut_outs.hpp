// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "../cut/cut_out.hpp"
#include "emit/scene/scene_desc.hpp"
#include "gltf_file.hpp"

namespace emit::scene {

/// Image that gives the surfaces of one glTF material several materials.
struct RegionCut {
  CutOut cut_out;
  std::uint32_t first_material = 0;  ///< of the first colour of the legend; the others follow
  std::string name;                  ///< of the image, for messages
};

/// Images that cut the surfaces of one file.
class CutOuts {
 public:
  explicit CutOuts(const GltfFile& file) : file_(file) {}

  /// Returns the mask that cuts out the surfaces of a material; null where there is none. It is
  /// read when a surface first asks for it. An image that cannot be read leaves the surfaces solid,
  /// which `warnings` says once.
  [[nodiscard]] CutOut* mask(std::uint32_t material, std::vector<std::string>& warnings);
  /// True where a mask has been read for a material, and its image shows nothing but the outline.
  [[nodiscard]] bool is_outline(std::uint32_t material) const;

  /// Reads the image that gives the surfaces of a material several ones.
  /// @param first_material  material that the first colour of the legend stands for
  /// Errors name image or texture: not_found, io, parse, unsupported.
  [[nodiscard]] physics::Result<void> add_regions(std::uint32_t material,
                                                  const MaterialImage& image,
                                                  std::uint32_t first_material);
  /// The image of a material that was added; null where there is none.
  [[nodiscard]] RegionCut* regions(std::uint32_t material);
  [[nodiscard]] bool has_regions(std::uint32_t material) const {
    return regions_.count(material) > 0;
  }

 private:
  const GltfFile& file_;
  std::map<std::uint32_t, std::optional<CutOut>> masks_;
  std::map<std::uint32_t, RegionCut> regions_;
};

}  // namespace emit::scene
