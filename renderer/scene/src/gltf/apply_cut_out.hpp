// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float3.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cut_out.hpp"

namespace emit::scene {

/// Alpha masks of one file, each read when a surface first asks for it.
class CutOuts {
 public:
  explicit CutOuts(const GltfFile& file) : file_(file) {}

  /// Returns the mask that cuts out the surfaces of a material; null where there is none. An image
  /// that cannot be read leaves the surfaces solid, which `warnings` says once.
  [[nodiscard]] CutOut* find(std::uint32_t material, std::vector<std::string>& warnings);
  /// True where a mask has been read for a material, and its image shows nothing but the outline.
  [[nodiscard]] bool is_outline(std::uint32_t material) const {
    const auto found = cut_outs_.find(material);
    return found != cut_outs_.end() && found->second && found->second->mask().one_colour;
  }

 private:
  const GltfFile& file_;
  std::map<std::uint32_t, std::optional<CutOut>> cut_outs_;
};

/// Vertices and triangles that are cut.
struct CutSurface {
  std::vector<glm::dvec3>& positions;
  std::vector<glm::vec3>& normals;  ///< empty, or one for each position
  std::vector<std::uint32_t>& indices;
};

/// Replaces triangles by what the mask keeps of them. Their outlines are within a fifth of a texel;
/// they are coarser where the primitive would have more than a million triangles.
/// @param uv  texture coordinates, one for each position
/// @return what there is to say about it, each a sentence for a warning
[[nodiscard]] std::vector<std::string> apply_cut_out(CutOut& cut_out,
                                                     const std::vector<glm::dvec2>& uv,
                                                     CutSurface surface);

}  // namespace emit::scene
