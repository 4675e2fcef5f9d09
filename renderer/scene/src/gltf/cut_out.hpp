// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "alpha_mask.hpp"

namespace emit::scene {

/// Triangles that a mask leaves of others.
struct CutTriangles {
  /// Corner of a new triangle as shares of the three corners of the old one, which sum to one.
  struct Corner {
    std::uint32_t triangle = 0;  ///< index of the old triangle
    glm::dvec3 shares{0.0};
  };
  std::vector<std::uint32_t> whole;  ///< indices of old triangles that stay as they are
  std::vector<Corner> corners;       ///< three for each new triangle, wound as the old one
  std::size_t uncut = 0;             ///< triangles in `whole` that could not be cut
};

/// Outline of what an alpha mask keeps, as polygons over its image (marching squares on the
/// bilinear opacity, saddles decided by their middle; Lorensen and Cline 1987). Cut-outs are part
/// of the geometry, so picture, shade, exchange of heat and reference all have the same holes.
///
/// Thread safety: one thread at a time.
class CutOut {
 public:
  explicit CutOut(AlphaMask mask);
  ~CutOut();
  CutOut(CutOut&&) noexcept;
  CutOut& operator=(CutOut&&) noexcept;
  CutOut(const CutOut&) = delete;
  CutOut& operator=(const CutOut&) = delete;

  [[nodiscard]] const AlphaMask& mask() const { return mask_; }

  /// Cuts triangles.
  /// @param uv            texture coordinates of the vertices as the file has them
  /// @param indices       three for each triangle
  /// @param tolerance_px  distance in texels by which an outline may be off, above 0; parts smaller
  ///                      than its square are left out
  /// @return nothing where triangles repeat the image more than a million times
  [[nodiscard]] std::optional<CutTriangles> cut(const std::vector<glm::dvec2>& uv,
                                                const std::vector<std::uint32_t>& indices,
                                                double tolerance_px);

 private:
  class Outline;
  AlphaMask mask_;
  double tolerance_px_ = 0.0;  ///< of outline_; 0: there is none yet
  std::unique_ptr<Outline> outline_;
};

}  // namespace emit::scene
