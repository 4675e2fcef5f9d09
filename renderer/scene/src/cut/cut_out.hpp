// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "alpha_mask.hpp"
#include "region_image.hpp"

namespace emit::scene {

/// Triangles that an image makes of others. A mask has the one part 0, and leaves out the rest. The
/// parts of a region image are its regions, and leave out nothing.
struct CutTriangles {
  /// Old triangle that stays as it is.
  struct Whole {
    std::uint32_t triangle = 0;
    std::uint8_t part = 0;
  };
  /// Corner of a new triangle as shares of the three corners of the old one, which sum to one.
  struct Corner {
    std::uint32_t triangle = 0;  ///< index of the old triangle
    std::uint8_t part = 0;       ///< the same for the three corners of a new triangle
    glm::dvec3 shares{0.0};
  };
  std::vector<Whole> whole;
  std::vector<Corner> corners;  ///< three for each new triangle, wound as the old one
  std::size_t uncut = 0;        ///< triangles in `whole` that could not be cut
  /// Share of the surface whose texels are unlike all colours of the legend, by samples.
  double unlike_frac = 0.0;
};

/// Outlines of an image as polygons. Those of a mask are marching squares on the bilinear opacity,
/// saddles decided by their middle (Lorensen and Cline 1987). Those of a region image are the sides
/// of texels. Cuts are part of the geometry, so picture, shade, exchange of heat and reference all
/// have the same holes and the same materials.
///
/// Thread safety: one thread at a time.
class CutOut {
 public:
  explicit CutOut(AlphaMask mask);
  explicit CutOut(RegionImage image);
  ~CutOut();
  CutOut(CutOut&&) noexcept;
  CutOut& operator=(CutOut&&) noexcept;
  CutOut(const CutOut&) = delete;
  CutOut& operator=(const CutOut&) = delete;

  [[nodiscard]] const ImageFrame& frame() const;
  /// The mask; null for a region image.
  [[nodiscard]] const AlphaMask* mask() const { return std::get_if<AlphaMask>(&image_); }
  /// Distances in texels by which outlines may be off, in the order in which they are to be tried.
  /// The sides of texels along a slanted line are up to 0.71 texels off it.
  [[nodiscard]] std::span<const double> tolerances_px() const;

  /// Cuts triangles.
  /// @param uv            texture coordinates of the vertices as the file has them
  /// @param indices       three for each triangle
  /// @param tolerance_px  distance in texels by which an outline may be off, above 0; parts of a
  ///                      mask smaller than its square are left out
  /// @return nothing where triangles repeat the image more than a million times
  [[nodiscard]] std::optional<CutTriangles> cut(const std::vector<glm::dvec2>& uv,
                                                const std::vector<std::uint32_t>& indices,
                                                double tolerance_px);

 private:
  class Outline;
  /// Part at a place; nothing where the mask leaves nothing.
  [[nodiscard]] std::optional<std::uint8_t> part_at(double x_px, double y_px) const;
  /// Part of the whole image where it has but one: nothing inside where the mask leaves nothing.
  [[nodiscard]] std::optional<std::optional<std::uint8_t>> sole_part() const;
  /// Share of random places of a triangle whose texels are unlike the legend.
  [[nodiscard]] double unlike_frac(std::span<const glm::dvec2, 3> triangle) const;

  std::variant<AlphaMask, RegionImage> image_;
  double tolerance_px_ = 0.0;  ///< of outline_; 0: there is none yet
  std::unique_ptr<Outline> outline_;
};

}  // namespace emit::scene
