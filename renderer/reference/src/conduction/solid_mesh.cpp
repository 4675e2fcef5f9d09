// SPDX-License-Identifier: Apache-2.0
#include "solid_mesh.hpp"

#include <fmt/format.h>
#include <tbb/blocked_range.h>

#include <array>
#include <cmath>
#include <limits>

#include "emit/physics/constants.hpp"
#include "emit/threads/parallel.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::uint32_t kNoNode = 0xffffffffU;
/// Flags of a lattice node: it belongs to a solid cell, or it is held at a temperature.
constexpr std::uint8_t kActive = 1;
constexpr std::uint8_t kHeld = 2;

/// Indices of the nodes of a grid. Nodes run along z first, then x, then y.
class Lattice {
 public:
  explicit Lattice(const SolidGrid& grid) : grid_(grid) {
    for (std::size_t axis = 0; axis < 3; ++axis) n_[axis] = grid.lines_m[axis].size();
  }
  [[nodiscard]] std::size_t nodes() const noexcept { return n_[0] * n_[1] * n_[2]; }
  [[nodiscard]] std::size_t lines(std::size_t axis) const noexcept { return n_[axis]; }
  [[nodiscard]] std::size_t node(std::size_t i, std::size_t j, std::size_t k) const noexcept {
    return k + n_[2] * (i + n_[0] * j);
  }
  [[nodiscard]] std::array<std::size_t, 3> at(std::size_t node) const noexcept {
    return {node / n_[2] % n_[0], node / (n_[2] * n_[0]), node % n_[2]};
  }
  [[nodiscard]] std::size_t stride(std::size_t axis) const noexcept {
    return axis == 2 ? 1 : axis == 0 ? n_[2] : n_[2] * n_[0];
  }
  [[nodiscard]] double length(std::size_t axis, std::size_t cell) const noexcept {
    return grid_.lines_m[axis][cell + 1] - grid_.lines_m[axis][cell];
  }

 private:
  const SolidGrid& grid_;
  std::array<std::size_t, 3> n_{};
};

bool is_solid(std::uint16_t cell) {
  return cell < kFixedCell;
}

/// Checks lines, materials and cells of a grid.
Result<void> check(const SolidGrid& grid) {
  const auto fail = [](std::string text) {
    return make_error(ErrorCode::invalid_argument, "solid grid: " + std::move(text));
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::vector<double>& lines = grid.lines_m[axis];
    if (lines.size() < 2) return fail(fmt::format("axis {} has fewer than two lines", axis));
    for (std::size_t i = 0; i + 1 < lines.size(); ++i) {
      if (!(std::isfinite(lines[i]) && lines[i + 1] > lines[i])) {
        return fail(fmt::format("lines {} and {} of axis {} do not ascend", i, i + 1, axis));
      }
    }
  }
  if (grid.cells.size() != grid.count(0) * grid.count(1) * grid.count(2)) {
    return fail("the number of cells is not that of the lines");
  }
  if (Lattice(grid).nodes() >= 0x7fffffffULL) return fail("too many nodes");
  for (std::size_t m = 0; m < grid.materials.size(); ++m) {
    const SolidMaterial& material = grid.materials[m];
    if (!(material.conductivity_w_m_k > 0.0 && std::isfinite(material.conductivity_w_m_k)) ||
        !(material.heat_capacity_j_m3_k > 0.0 && std::isfinite(material.heat_capacity_j_m3_k))) {
      return fail(fmt::format("material {}: conductivity and heat capacity must be positive", m));
    }
  }
  bool any = false;
  for (const std::uint16_t cell : grid.cells) {
    if (cell >= kFixedCell && cell != kVoidCell &&
        static_cast<std::size_t>(cell - kFixedCell) >= grid.fixed_cell_k.size()) {
      return fail("a held cell has no temperature");
    }
    if (!is_solid(cell)) continue;
    any = true;
    if (cell >= grid.materials.size()) return fail(fmt::format("there is no material {}", cell));
  }
  if (!any) return fail("no cell is solid");
  return {};
}

/// Returns the corner nodes of the face of a cell across `axis`, as lattice indices.
std::array<std::size_t, 4> face_corners(const Lattice& lattice, std::array<std::size_t, 3> cell,
                                        std::size_t axis, int sign) {
  if (sign > 0) ++cell[axis];
  const std::size_t first = lattice.node(cell[0], cell[1], cell[2]);
  const std::size_t u = axis == 0 ? 1 : 0;
  const std::size_t v = axis == 2 ? 1 : 2;
  return {first, first + lattice.stride(u), first + lattice.stride(v),
          first + lattice.stride(u) + lattice.stride(v)};
}

/// Builds the network of a grid step by step.
class MeshBuilder {
 public:
  MeshBuilder(const SolidGrid& grid,
              const std::function<FaceCondition(const SolidFace&)>& condition)
      : grid_(grid), condition_(condition), lattice_(grid) {}

  Result<SolidMesh> build() {
    flags_.assign(lattice_.nodes(), 0);
    mark_cells();
    if (auto made = make_faces(); !made) return tl::unexpected(std::move(made.error()));
    number_nodes();
    if (mesh_.free_count == 0) {
      return make_error(ErrorCode::invalid_argument,
                        "solid grid: every node has a fixed temperature");
    }
    make_rows();
    finish_faces();
    for (std::size_t axis = 0; axis < 3; ++axis) mesh_.plane |= grid_.count(axis) == 1;
    return std::move(mesh_);
  }

 private:
  // Visit every cell with its indices and its content.
  template <class Visit>
  void for_cells(Visit visit) const {
    for (std::size_t k = 0; k < grid_.count(2); ++k) {
      for (std::size_t j = 0; j < grid_.count(1); ++j) {
        for (std::size_t i = 0; i < grid_.count(0); ++i) {
          visit(std::array<std::size_t, 3>{i, j, k}, grid_.cells[grid_.index(i, j, k)]);
        }
      }
    }
  }

  // Flag the corners of solid and of held cells.
  void mark_cells() {
    for_cells([&](const std::array<std::size_t, 3>& cell, std::uint16_t fill) {
      if (fill == kVoidCell) return;
      for (std::size_t corner = 0; corner < 8; ++corner) {
        const std::size_t node = lattice_.node(
            cell[0] + (corner & 1U), cell[1] + (corner >> 1U & 1U), cell[2] + (corner >> 2U));
        if (is_solid(fill)) {
          flags_[node] |= kActive;
        } else if (!(flags_[node] & kHeld)) {
          flags_[node] |= kHeld;
          held_k_.emplace_back(node, grid_.fixed_cell_k[fill - kFixedCell]);
        }
      }
    });
    // Release nodes that belong to held cells alone.
    std::erase_if(held_k_, [&](const auto& held) {
      if (flags_[held.first] != kHeld) return false;
      flags_[held.first] = 0;
      return true;
    });
  }

  // Make a face for every side of a solid cell that borders on no solid.
  Result<void> make_faces() {
    Result<void> result;
    for_cells([&](const std::array<std::size_t, 3>& cell, std::uint16_t fill) {
      if (!is_solid(fill) || !result) return;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        for (const int sign : {-1, 1}) {
          if (auto made = make_face(cell, fill, axis, sign); !made) result = std::move(made);
        }
      }
    });
    return result;
  }

  Result<void> make_face(const std::array<std::size_t, 3>& cell, std::uint16_t fill,
                         std::size_t axis, int sign) {
    SolidFace face;
    const bool rim = sign < 0 ? cell[axis] == 0 : cell[axis] + 1 == grid_.count(axis);
    face.outside_cell = kOutsideGrid;
    // Skip a side that borders on another cell of material or on a held cell.
    if (!rim) {
      std::array<std::size_t, 3> across = cell;
      across[axis] += sign < 0 ? std::size_t(-1) : 1;
      const std::size_t index = grid_.index(across[0], across[1], across[2]);
      if (grid_.cells[index] != kVoidCell) return {};
      face.outside_cell = static_cast<std::uint32_t>(index);
    }
    // Describe the face: its place, its area and the cells on both sides.
    face.axis = static_cast<std::uint8_t>(axis);
    face.sign = static_cast<std::int8_t>(sign);
    face.material = fill;
    face.cell = static_cast<std::uint32_t>(grid_.index(cell[0], cell[1], cell[2]));
    face.area_m2 = 1.0;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto shift = static_cast<glm::dvec3::length_type>(a);
      face.low_m[shift] = grid_.lines_m[a][cell[a]];
      face.high_m[shift] = grid_.lines_m[a][cell[a] + 1];
      if (a != axis) {
        face.area_m2 *= lattice_.length(a, cell[a]);
      } else if (sign > 0) {
        face.low_m[shift] = face.high_m[shift];
      } else {
        face.high_m[shift] = face.low_m[shift];
      }
    }
    // Apply the boundary condition.
    const FaceCondition condition = condition_(face);
    const auto corners = face_corners(lattice_, cell, axis, sign);
    switch (condition.kind) {
      case FaceKind::adiabatic:
        break;
      case FaceKind::fixed:
        if (!(condition.fixed_k > 0.0)) {
          return make_error(ErrorCode::invalid_argument,
                            "solid face: the fixed temperature must be positive");
        }
        for (const std::size_t node : corners) {
          if (!(flags_[node] & kHeld)) held_k_.emplace_back(node, condition.fixed_k);
          flags_[node] |= kHeld;
        }
        break;
      case FaceKind::exposed:
        if (!(condition.emissivity_frac >= 0.0 && condition.emissivity_frac <= 1.0)) {
          return make_error(ErrorCode::invalid_argument,
                            "solid face: the emissivity must lie in 0..1");
        }
        for (std::size_t c = 0; c < 4; ++c) face.nodes[c] = static_cast<std::uint32_t>(corners[c]);
        mesh_.faces.push_back(face);
        emissivity_.push_back(condition.emissivity_frac);
        break;
    }
    return {};
  }

  // Number the free nodes first, then the held ones.
  void number_nodes() {
    number_.assign(lattice_.nodes(), kNoNode);
    std::uint32_t next = 0;
    const auto take = [&](std::size_t node) {
      number_[node] = next++;
      const auto at = lattice_.at(node);
      mesh_.nodes_m.emplace_back(grid_.lines_m[0][at[0]], grid_.lines_m[1][at[1]],
                                 grid_.lines_m[2][at[2]]);
    };
    for (std::size_t node = 0; node < flags_.size(); ++node) {
      if (flags_[node] == kActive) {
        take(node);
        lattice_node_.push_back(static_cast<std::uint32_t>(node));
      }
    }
    mesh_.free_count = next;
    for (const auto& [node, kelvin] : held_k_) {
      take(node);
      mesh_.fixed_k.push_back(kelvin);
    }
  }

  /// Returns the material of the cell on one side of a node per axis (bit `axis` of `corner` is set
  /// for the greater side), or nothing. Sets the size of that cell.
  [[nodiscard]] const SolidMaterial* cell_at(const std::array<std::size_t, 3>& node,
                                             unsigned corner, std::array<double, 3>& size_m) const {
    std::array<std::size_t, 3> cell = node;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const bool up = (corner >> axis & 1U) != 0;
      if (up ? node[axis] == grid_.count(axis) : node[axis] == 0) return nullptr;
      if (!up) --cell[axis];
      size_m[axis] = lattice_.length(axis, cell[axis]);
    }
    const std::uint16_t fill = grid_.cells[grid_.index(cell[0], cell[1], cell[2])];
    return is_solid(fill) ? &grid_.materials[fill] : nullptr;
  }

  /// Heat capacity of one node and its conductances towards -y, -x, -z, +z, +x, +y. In this order
  /// the numbers of free nodes ascend.
  struct Links {
    double capacity_j_k = 0.0;
    std::array<double, 6> conductance_w_k{};
  };
  [[nodiscard]] Links links_of(std::size_t node) const {
    static constexpr std::array<std::array<std::size_t, 2>, 3> kSlot{{{1, 4}, {0, 5}, {2, 3}}};
    Links links;
    const auto at = lattice_.at(node);
    // Collect an eighth of the capacity of each cell around the node.
    for (unsigned corner = 0; corner < 8; ++corner) {
      std::array<double, 3> size_m{};
      const SolidMaterial* material = cell_at(at, corner, size_m);
      if (material == nullptr) continue;
      const double volume = size_m[0] * size_m[1] * size_m[2];
      links.capacity_j_k += material->heat_capacity_j_m3_k * volume / 8.0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        // Add the conductance of a quarter of the cell's section, which lies around this edge.
        links.conductance_w_k[kSlot[axis][corner >> axis & 1U]] +=
            material->conductivity_w_m_k * volume / (4.0 * size_m[axis] * size_m[axis]);
      }
    }
    return links;
  }
  [[nodiscard]] std::uint32_t neighbour(std::size_t node, std::size_t slot) const {
    const std::array<std::size_t, 3> strides{lattice_.stride(1), lattice_.stride(0), 1};
    return slot < 3 ? number_[node - strides[slot]] : number_[node + strides[5 - slot]];
  }

  // Assemble the sparse rows: count the links of every node, then fill them.
  void make_rows() {
    const std::size_t n = mesh_.free_count;
    mesh_.capacity_j_k.resize(n);
    mesh_.conductance_sum_w_k.resize(n);
    mesh_.row_start.assign(n + 1, 0);
    mesh_.upper_start.assign(n, 0);
    std::vector<Links> links(n);
    threads::parallel_ranges(tbb::blocked_range<std::size_t>(0, n, 4096), [&](const auto& range) {
      for (std::size_t row = range.begin(); row != range.end(); ++row) {
        links[row] = links_of(lattice_node_[row]);
        std::uint32_t used = 0;
        for (const double g : links[row].conductance_w_k) used += g > 0.0 ? 1 : 0;
        mesh_.row_start[row + 1] = used;
      }
    });
    for (std::size_t row = 0; row < n; ++row) mesh_.row_start[row + 1] += mesh_.row_start[row];
    mesh_.columns.resize(mesh_.row_start[n]);
    mesh_.conductance_w_k.resize(mesh_.row_start[n]);
    threads::parallel_ranges(tbb::blocked_range<std::size_t>(0, n, 4096), [&](const auto& range) {
      for (std::size_t row = range.begin(); row != range.end(); ++row) fill_row(row, links[row]);
    });
  }

  void fill_row(std::size_t row, const Links& links) {
    mesh_.capacity_j_k[row] = links.capacity_j_k;
    std::uint32_t at = mesh_.row_start[row];
    double sum = 0.0;
    // Put fixed neighbours last. Their numbers are above all free ones, so the row stays in order.
    for (const bool fixed : {false, true}) {
      for (std::size_t slot = 0; slot < 6; ++slot) {
        const double g = links.conductance_w_k[slot];
        if (!(g > 0.0)) continue;
        const std::uint32_t column = neighbour(lattice_node_[row], slot);
        if ((column >= mesh_.free_count) != fixed) continue;
        mesh_.columns[at] = column;
        mesh_.conductance_w_k[at] = g;
        sum += g;
        ++at;
      }
    }
    mesh_.conductance_sum_w_k[row] = sum;
    // Find the first entry above the diagonal.
    std::uint32_t upper = mesh_.row_start[row];
    while (upper < mesh_.row_start[row + 1] && mesh_.columns[upper] < row) ++upper;
    mesh_.upper_start[row] = upper;
  }

  // Translate the corners of the faces to node numbers and list the faces around every surface
  // node.
  void finish_faces() {
    const std::size_t n = mesh_.free_count;
    std::vector<std::uint32_t> slot(n, kNoNode);
    std::vector<std::uint32_t> count;
    for (SolidFace& face : mesh_.faces) {
      for (std::uint32_t& node : face.nodes) {
        node = number_[node];
        if (node >= n) continue;
        if (slot[node] == kNoNode) {
          slot[node] = static_cast<std::uint32_t>(mesh_.surface_nodes.size());
          mesh_.surface_nodes.push_back(node);
          count.push_back(0);
        }
        ++count[slot[node]];
      }
    }
    // Turn the counts into the start of each node's list, then fill the lists.
    mesh_.face_start.assign(count.size() + 1, 0);
    for (std::size_t s = 0; s < count.size(); ++s) {
      mesh_.face_start[s + 1] = mesh_.face_start[s] + count[s];
    }
    mesh_.node_faces.resize(mesh_.face_start.back());
    mesh_.emission_w_k4.assign(count.size(), 0.0);
    std::vector<std::uint32_t> at(mesh_.face_start.begin(), mesh_.face_start.end() - 1);
    for (std::size_t f = 0; f < mesh_.faces.size(); ++f) {
      for (const std::uint32_t node : mesh_.faces[f].nodes) {
        if (node >= n) continue;
        mesh_.node_faces[at[slot[node]]++] = static_cast<std::uint32_t>(f);
        // Give each corner a quarter of the emission of the face.
        mesh_.emission_w_k4[slot[node]] +=
            0.25 * mesh_.faces[f].area_m2 * emissivity_[f] * physics::kStefanBoltzmannWPerM2K4;
      }
    }
  }

  const SolidGrid& grid_;
  const std::function<FaceCondition(const SolidFace&)>& condition_;
  Lattice lattice_;
  SolidMesh mesh_;
  std::vector<std::uint8_t> flags_;
  std::vector<std::pair<std::size_t, double>> held_k_;
  std::vector<double> emissivity_;
  std::vector<std::uint32_t> number_;        ///< number of every lattice node
  std::vector<std::uint32_t> lattice_node_;  ///< lattice node of every free node
};

}  // namespace

Result<SolidMesh> build_solid_mesh(
    const SolidGrid& grid, const std::function<FaceCondition(const SolidFace&)>& condition) {
  if (auto valid = check(grid); !valid) return tl::unexpected(std::move(valid.error()));
  return MeshBuilder(grid, condition).build();
}

}  // namespace emit::reference
