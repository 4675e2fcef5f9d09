// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double2.hpp>
#include <string>
#include <vector>

#include "mesh_builder.hpp"

namespace emit::scenegen {

/// Plan of level ground: outlines with materials, where later ones lie on top. Its mesh is cut
/// along all outlines, so that the ground is one layer: a marking is a hole in the asphalt and
/// triangles of paint that fill it. No triangle lies on another and no corner lies on the edge of
/// a neighbour.
class GroundPlan {
 public:
  /// Adds a rectangle. @pre x0 < x1 and y0 < y1
  void rectangle(double x0_m, double y0_m, double x1_m, double y1_m, const char* material);
  /// Adds a simple polygon, in either direction. @pre corners.size() >= 3
  void polygon(std::vector<glm::dvec2> corners_m, const char* material);
  /// Adds a band of constant width along a line of points; bends must be blunter than a right
  /// angle. @pre points.size() >= 2
  void band(const std::vector<glm::dvec2>& points_m, double width_m, const char* material);
  /// Fills a rectangle with equal slabs and the sealed joints between them. A slab is of the
  /// material that `material_of(column, row)` returns; `joint_m` 0 leaves the joints out.
  template <class F>
  void slabs(double x0_m, double y0_m, double x1_m, double y1_m, int columns, int rows,
             double joint_m, const char* joint, const F& material_of) {
    if (joint_m > 0.0) rectangle(x0_m, y0_m, x1_m, y1_m, joint);
    const double width_m = (x1_m - x0_m) / columns;
    const double height_m = (y1_m - y0_m) / rows;
    const double half_m = 0.5 * joint_m;
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        const double x = x0_m + column * width_m;
        const double y = y0_m + row * height_m;
        rectangle(x + half_m, y + half_m, x + width_m - half_m, y + height_m - half_m,
                  material_of(column, row));
      }
    }
  }

  /// Returns the mesh, at height 0 and facing up. Points are rounded to 1/128 m.
  [[nodiscard]] SceneMesh mesh(const std::string& name) const;

 private:
  struct Patch {
    std::vector<glm::dvec2> ring_m;
    glm::dvec2 min_m;
    glm::dvec2 max_m;
    const char* material;
  };
  [[nodiscard]] const char* top_at(const glm::dvec2& point_m) const;

  std::vector<Patch> patches_;
};

}  // namespace emit::scenegen
