// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "emit/reference/voxel_model.hpp"
#include "voxel_shape.hpp"

namespace emit::reference {

FaceFinder::FaceFinder(const SolidGrid& grid, std::span<const SolidFace> faces,
                       double thickest_sheet_m)
    : lines_m_(grid.lines_m), thickest_sheet_m_(thickest_sheet_m) {
  faces_.reserve(faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const std::uint64_t key = faces[f].cell * std::uint64_t{6} + faces[f].axis * std::uint64_t{2} +
                              (faces[f].sign > 0 ? 1U : 0U);
    faces_.emplace(key, static_cast<std::uint32_t>(f));
  }
}

std::optional<std::uint32_t> FaceFinder::find(const glm::dvec3& point_m,
                                              const glm::dvec3& normal) const {
  constexpr double kNudgeM = 2e-5;
  // Take the axis of the normal.
  std::size_t axis = 0;
  for (std::size_t a = 1; a < 3; ++a) {
    if (std::abs(normal[static_cast<glm::dvec3::length_type>(a)]) >
        std::abs(normal[static_cast<glm::dvec3::length_type>(axis)])) {
      axis = a;
    }
  }
  const bool up = normal[static_cast<glm::dvec3::length_type>(axis)] > 0.0;
  const std::size_t u = axis == 0 ? 1 : 0;
  const std::size_t v = axis == 2 ? 1 : 2;
  const auto component = [&](std::size_t a) {
    return point_m[static_cast<glm::dvec3::length_type>(a)];
  };
  const std::uint64_t nx = lines_m_[0].size() - 1;
  const std::uint64_t ny = lines_m_[1].size() - 1;
  static constexpr std::array<std::array<double, 2>, 9> kTries{
      {{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}}};
  // Look just inside the solid. The back of a sheet lies a thickness away from the surface that
  // rays hit; go on to it, cell by cell.
  std::size_t inside = cell_of(lines_m_[axis], component(axis) + (up ? -kNudgeM : kNudgeM));
  const double reach = component(axis) + (up ? 1.0 : -1.0) * (thickest_sheet_m_ + kNudgeM);
  const std::size_t last = cell_of(lines_m_[axis], reach);
  while (true) {
    for (const auto& nudge : kTries) {
      std::array<std::size_t, 3> cell{};
      // Nudge the point sideways if it lies between two faces.
      cell[axis] = inside;
      cell[u] = cell_of(lines_m_[u], component(u) + kNudgeM * nudge[0]);
      cell[v] = cell_of(lines_m_[v], component(v) + kNudgeM * nudge[1]);
      const std::uint64_t index = cell[0] + nx * (cell[1] + ny * cell[2]);
      const auto found = faces_.find(index * 6 + axis * 2 + (up ? 1U : 0U));
      if (found != faces_.end()) return found->second;
    }
    if (!(thickest_sheet_m_ > 0.0) || inside == last) return std::nullopt;
    inside += up ? 1 : std::size_t(-1);
  }
}

}  // namespace emit::reference
