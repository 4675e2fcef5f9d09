// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float3.hpp>

#include "emit/scene/mesh.hpp"

namespace emit::renderer {

/// A mesh whose triangles are cut finer where asked: conforming longest-edge bisection (Rivara
/// 1984, Int. J. Numer. Meth. Eng. 20, 745). Vertices only get added and never move; triangles keep
/// their winding, their plane and their part of the original triangle.
///
/// A vertex belongs to one material and to one kind of surface (sheet or body): where submeshes of
/// different kind share a vertex, each later one gets a copy of its own, behind the vertices of the
/// mesh, which keep their order. Edges are told apart by position: both sides of a crease or of a
/// material seam are halved together, with a vertex for each side.
///
/// Lengths count in the mesh's own axes. Positions must be finite. The order of calls alone decides
/// the result. Owner: one per scene::Mesh, shared by its instances; independent of the mesh once
/// built. Construction and split() allocate and are for setup; all else may run on many threads.
/// Memory: 24 B a triangle and 40 B a vertex; once split, 12 B and 4 B more, and room to grow.
class RefinedMesh {
 public:
  struct Vertex {
    glm::vec3 position_m;
    glm::vec3 normal;  ///< unit; of a new vertex the mean of its parents' at first
    std::uint32_t material = 0;
    bool sheet = false;  ///< of a double-sided submesh
    /// Ends of the edge it halves, both below its own index; its own index for original vertices
    /// and their copies. Parents are of the same material and kind.
    std::array<std::uint32_t, 2> parent{};
  };
  /// A point as the weighted mean of three vertices; weights are >= 0 and add up to 1.
  struct Place {
    std::array<std::uint32_t, 3> vertex{};
    glm::vec3 weight{0.0F};
  };

  /// Triangles and vertices as they stand, to be kept somewhere: see from().
  struct Parts {
    std::vector<Vertex> vertices;
    std::vector<std::array<std::uint32_t, 3>> leaves;
    std::vector<std::uint32_t> leaf_submesh;
    std::vector<std::uint32_t> leaf_node;
    std::vector<std::uint32_t> nodes;
  };

  /// No vertex is added by split() beyond `max_vertices`. Vertices that no triangle uses stay, with
  /// material 0. O(n).
  explicit RefinedMesh(const scene::Mesh& mesh, std::size_t max_vertices);

  [[nodiscard]] std::span<const Vertex> vertices() const noexcept { return vertices_; }
  /// Leaves live in dense slots, at first slot = index / 3 of the mesh. A leaf that is halved
  /// leaves one child in its slot, the other is appended.
  [[nodiscard]] std::uint32_t leaf_count() const noexcept {
    return static_cast<std::uint32_t>(leaves_.size());
  }
  /// Its vertices, counter-clockwise seen from outside. slot < leaf_count().
  [[nodiscard]] const std::array<std::uint32_t, 3>& leaf(std::uint32_t slot) const noexcept {
    return leaves_[slot];
  }
  /// Of the triangle in this slot; another one once it was halved. slot < leaf_count().
  [[nodiscard]] std::uint32_t node(std::uint32_t slot) const noexcept { return leaf_node_[slot]; }
  [[nodiscard]] Parts parts() const {
    return {vertices_, leaves_, leaf_submesh_, leaf_node_, nodes_};
  }
  /// The refined mesh that had these parts; nothing when they contradict each other or `mesh`.
  [[nodiscard]] static std::optional<RefinedMesh> from(const scene::Mesh& mesh,
                                                       std::size_t max_vertices, Parts parts);

  /// Index into scene::Mesh::submeshes.
  [[nodiscard]] std::uint32_t submesh(std::uint32_t slot) const noexcept {
    return leaf_submesh_[slot];
  }

  /// From now on no vertex is added beyond `max_vertices`.
  void limit(std::size_t max_vertices) noexcept { max_vertices_ = max_vertices; }

  /// Halves the longest edge of each of these leaves (as they are at the time of the call, each
  /// once) together with every leaf that shares this edge, after halving those neighbours whose own
  /// longest edge is a longer one, so that no vertex ever lies inside another leaf's edge.
  /// Left alone are leaves with two corners at one position and edges shorter than 1e-6 or 4e-6 of
  /// their largest coordinate. Returns false when a leaf stayed whole because max_vertices would
  /// have been passed; its neighbours may have been halved by then, and later leaves of the list
  /// are still tried.
  bool split(std::span<const std::uint32_t> slots);

  /// Turns a vertex that split() has made towards where the surface really faces. Unit length.
  void set_normal(std::uint32_t vertex, const glm::vec3& normal) noexcept {
    vertices_[vertex].normal = normal;
  }

  /// The leaf that holds a point of an original triangle (index / 3 of the mesh; below its number
  /// of triangles). `barycentric`: weights of the second and third vertex, as ray tracers give
  /// them, clamped to the triangle. Exact but for the rounding of the vertices' positions.
  [[nodiscard]] Place locate(std::uint32_t triangle, glm::vec2 barycentric) const noexcept;

  /// Triangles for drawing, replacing both contents: 3 indices a leaf, grouped by submesh, and for
  /// each submesh (first, count) in `indices`. Leaves of one original triangle stay together.
  void write_indices(std::vector<std::uint32_t>& indices,
                     std::vector<std::pair<std::uint32_t, std::uint32_t>>& ranges) const;

 private:
  enum class Outcome : std::uint8_t { halved, full, too_short };
  /// Midpoint of one side's copy of an edge.
  struct Midpoint {
    std::uint32_t low = 0;
    std::uint32_t high = 0;
  };
  /// A leaf to be halved and, afterwards, the two halves of its edge.
  struct Cut {
    std::uint32_t half_edge = 0;
    std::uint32_t midpoint = 0;  ///< index into midpoints_
    std::uint32_t start_half = 0;
    std::uint32_t end_half = 0;
  };

  [[nodiscard]] std::uint32_t longest_edge(std::uint32_t slot) const noexcept;
  [[nodiscard]] bool has_double_corner(std::uint32_t slot) const noexcept;
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
  /// Forest of halvings, one tree per original triangle, rooted at its index. Low two bits: which
  /// edge was halved, the rest the first of two neighbouring children; low bits 3: a leaf, the rest
  /// its slot.
  std::vector<std::uint32_t> nodes_;
  // From the first split on:
  std::vector<std::uint32_t> position_id_;  ///< per vertex; equal for equal positions
  /// Per half-edge (3 slot + corner it starts from): the next one between the same positions; a
  /// ring, of one at a border, of two inside a surface, of more where surfaces branch.
  std::vector<std::uint32_t> ring_;
  // Scratch of split().
  std::vector<std::uint32_t> asked_nodes_;
  std::vector<std::uint32_t> path_;
  std::vector<Cut> cuts_;
  std::vector<Midpoint> midpoints_;
};

}  // namespace emit::renderer
