// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float3.hpp>
#include <glm/geometric.hpp>

#include "emit/physics/check.hpp"
#include "emit/scene/mesh.hpp"

namespace emit::renderer {

/// Mesh whose triangles are halved on request, by conforming longest-edge bisection (Rivara 1984,
/// Int. J. Numer. Meth. Eng. 20, 745). Vertices are only added and never move. Triangles keep their
/// winding, their plane and their part of the original triangle.
///
/// A vertex belongs to one material and to one kind of surface (sheet or body). If submeshes of
/// different kind share a vertex, each later one gets a copy of its own behind the vertices of the
/// mesh, which keep their order. Edges are compared by position: both sides of a crease or of a
/// material seam are halved together, with a vertex for each side.
///
/// Lengths are measured in the axes of the mesh. Positions must be finite. The order of calls alone
/// decides the result. There is one object per scene::Mesh, shared by its instances and independent
/// of the mesh once built. Construction and split() allocate and are for setup; everything else may
/// run on many threads. Memory is 24 B per triangle and 40 B per vertex; after the first split it
/// is 12 B and 4 B more, plus room to grow.
class RefinedMesh {
 public:
  /// Vertex with the material and the kind of its surface.
  struct Vertex {
    glm::vec3 position_m;
    glm::vec3 normal;  ///< unit length; a new vertex starts with the mean of its parents
    std::uint32_t material = 0;
    bool sheet = false;  ///< it belongs to a double-sided submesh
    /// Ends of the edge that this vertex halves, both below its own index. An original vertex or a
    /// copy has its own index twice. Parents have the same material and kind.
    std::array<std::uint32_t, 2> parent{};
  };
  /// Point given as the weighted mean of three vertices. Weights are >= 0 and add up to 1.
  struct Place {
    std::array<std::uint32_t, 3> vertex{};
    glm::vec3 weight{0.0F};
    std::uint32_t slot = 0;  ///< leaf with these vertices
  };

  /// Complete state of a refined mesh, to be stored in a file; see from().
  struct Parts {
    std::vector<Vertex> vertices;
    std::vector<std::array<std::uint32_t, 3>> leaves;
    std::vector<std::uint32_t> leaf_submesh;
    std::vector<std::uint32_t> leaf_node;
    std::vector<std::uint32_t> nodes;
  };

  /// Starts with the triangles of the mesh. split() adds no vertex beyond `max_vertices`. Vertices
  /// that no triangle uses stay, with material 0. O(n).
  explicit RefinedMesh(const scene::Mesh& mesh, std::size_t max_vertices);

  [[nodiscard]] std::span<const Vertex> vertices() const noexcept { return vertices_; }
  /// Returns the number of leaves, the triangles that are not halved. Leaves have dense slots; at
  /// first the slot is index / 3 of the mesh. A halved leaf is replaced by one child in its slot,
  /// and the other child is appended.
  [[nodiscard]] std::uint32_t leaf_count() const noexcept {
    return static_cast<std::uint32_t>(leaves_.size());
  }
  /// Returns the vertices of a leaf, counter-clockwise seen from outside.
  /// @pre slot < leaf_count()
  [[nodiscard]] const std::array<std::uint32_t, 3>& leaf(std::uint32_t slot) const noexcept {
    EMIT_DCHECK_OP(slot, <, leaf_count());
    return leaves_[slot];
  }
  /// Returns the node of the triangle in this slot. The number changes when the triangle is halved.
  /// @pre slot < leaf_count()
  [[nodiscard]] std::uint32_t node(std::uint32_t slot) const noexcept {
    EMIT_DCHECK_OP(slot, <, leaf_count());
    return leaf_node_[slot];
  }
  /// Returns a copy of the complete state.
  [[nodiscard]] Parts parts() const {
    return {vertices_, leaves_, leaf_submesh_, leaf_node_, nodes_};
  }
  /// Returns the refined mesh that had these parts, or nothing if they contradict each other or
  /// `mesh`.
  [[nodiscard]] static std::optional<RefinedMesh> from(const scene::Mesh& mesh,
                                                       std::size_t max_vertices, Parts parts);

  /// Returns the submesh of a leaf, an index into scene::Mesh::submeshes.
  /// @pre slot < leaf_count()
  [[nodiscard]] std::uint32_t submesh(std::uint32_t slot) const noexcept {
    EMIT_DCHECK_OP(slot, <, leaf_count());
    return leaf_submesh_[slot];
  }

  /// Sets the limit on vertices for later calls of split().
  void limit(std::size_t max_vertices) noexcept { max_vertices_ = max_vertices; }

  /// Halves the longest edge of each of these leaves, as they are at the time of the call, each
  /// once. Every leaf that shares the edge is halved with it. Neighbours that have a longer edge of
  /// their own are halved first, so that no vertex ever lies inside an edge of another leaf.
  /// Leaves with two corners at one position stay whole, and so do edges shorter than 1e-6 or
  /// shorter than 4e-6 of their largest coordinate. Returns false if a leaf stayed whole because
  /// max_vertices would have been exceeded. Its neighbours may have been halved by then, and later
  /// leaves of the list are still tried.
  bool split(std::span<const std::uint32_t> slots);

  /// Sets the normal of a vertex that split() has made, to the direction in which the surface
  /// really faces.
  /// @pre `vertex` exists; `normal` has unit length
  void set_normal(std::uint32_t vertex, const glm::vec3& normal) noexcept {
    EMIT_DCHECK_OP(vertex, <, vertices_.size());
    EMIT_DCHECK(std::abs(glm::dot(normal, normal) - 1.0F) < 1e-3F);
    vertices_[vertex].normal = normal;
  }

  /// Returns the leaf that holds a point of an original triangle. `triangle` is index / 3 of the
  /// mesh and below its number of triangles. `barycentric` has the weights of the second and the
  /// third vertex, as ray tracers give them; they are clamped to the triangle. The result is exact
  /// except for the rounding of positions.
  [[nodiscard]] Place locate(std::uint32_t triangle, glm::vec2 barycentric) const noexcept;

  /// Writes the triangles for drawing and replaces both contents: 3 indices per leaf, grouped by
  /// submesh, and for each submesh (first, count) in `indices`. Leaves of one original triangle
  /// stay together.
  void write_indices(std::vector<std::uint32_t>& indices,
                     std::vector<std::pair<std::uint32_t, std::uint32_t>>& ranges) const;

 private:
  /// Result of an attempt to halve an edge.
  enum class Outcome : std::uint8_t { halved, full, too_short };
  /// Midpoint of an edge on one side of a crease or seam: the vertices at its ends.
  struct Midpoint {
    std::uint32_t low = 0;
    std::uint32_t high = 0;
  };
  /// Leaf to be halved and, after that, the two halves of its edge.
  struct Cut {
    std::uint32_t half_edge = 0;
    std::uint32_t midpoint = 0;  ///< index into `midpoints_`
    std::uint32_t start_half = 0;
    std::uint32_t end_half = 0;
  };

  [[nodiscard]] std::uint32_t longest_edge(std::uint32_t slot) const noexcept;
  [[nodiscard]] bool has_double_corner(std::uint32_t slot) const noexcept;
  /// Halves a leaf after all neighbours that must come first.
  Outcome split_leaf(std::uint32_t slot);
  Outcome halve_edge(std::uint32_t half_edge);
  [[nodiscard]] std::uint32_t midpoint_of(std::uint32_t half_edge);
  void cut(Cut& cut, std::uint32_t midpoint);
  void link_cuts(std::uint32_t end_position) noexcept;
  void join_rings(std::uint32_t a, std::uint32_t b) noexcept { std::swap(ring_[a], ring_[b]); }

  std::size_t max_vertices_;
  std::vector<scene::Submesh> submeshes_;
  std::vector<Vertex> vertices_;
  std::vector<std::array<std::uint32_t, 3>> leaves_;
  std::vector<std::uint32_t> leaf_submesh_;
  std::vector<std::uint32_t> leaf_node_;
  /// Forest of halvings with one tree per original triangle, whose root has the index of the
  /// triangle. The low two bits of a node say which edge was halved, and the rest is the first of
  /// two adjacent children. In a leaf the low bits are 3 and the rest is its slot.
  std::vector<std::uint32_t> nodes_;
  // The next two are filled by the first split.
  std::vector<std::uint32_t> position_id_;  ///< by vertex; equal for equal positions
  /// Next half-edge between the same positions, by half-edge (3 slot + corner that it starts from).
  /// They form a ring of one at a border, of two inside a surface, of more where surfaces branch.
  std::vector<std::uint32_t> ring_;
  // Scratch of split(), kept to save allocations.
  std::vector<std::uint32_t> asked_nodes_;
  std::vector<std::uint32_t> path_;
  std::vector<Cut> cuts_;
  std::vector<Midpoint> midpoints_;
};

}  // namespace emit::renderer
