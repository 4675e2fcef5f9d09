// SPDX-License-Identifier: Apache-2.0
#include "coplanar.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/ext/vector_double2.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <map>
#include <set>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "emit/physics/check.hpp"
#include "plane_pieces.hpp"

namespace emit::scene {
namespace {

/// Corners within this distance lie in a plane; float32 positions add a share of their size.
constexpr double kPlaneM = 2e-4;
constexpr double kPlaneFrac = 2.4e-7;
/// Widths of the cells in which planes are sorted. Two lattices, half a cell apart, keep planes
/// that agree to rounding together in at least one of them.
constexpr double kNormalCell = 0.0137;
constexpr double kOffsetCellM = 0.0113;
/// An overlap narrower than this share of the covering triangle's size is a common edge.
constexpr double kMinWidthFrac = 3e-4;
/// Distance that a cut reaches under the covering triangle, as a share of its size.
constexpr double kUnderlapFrac = 1e-4;
/// Pieces of one triangle beyond which their corners are not set into each other's edges.
constexpr std::size_t kMaxMatchedPieces = 3000;
/// Most vertices of meshes that are copied to be cut.
constexpr std::size_t kMaxCopiedVertices = 2'000'000;
constexpr std::size_t kMaxMessages = 8;

/// A triangle of one part, in the common axes.
struct Facet {
  std::uint32_t part = 0;
  std::uint32_t submesh = 0;
  std::uint32_t first_index = 0;
  std::uint32_t material = 0;
  bool double_sided = false;
  std::array<glm::dvec3, 3> corner_m{};
  glm::dvec3 normal{0.0};
  double area_m2 = 0.0;
};

struct PlaneEntry {
  std::uint64_t key = 0;
  std::uint32_t facet = 0;
  auto operator<=>(const PlaneEntry&) const = default;
};

struct EdgeKey {
  std::array<std::int64_t, 6> cell{};
  bool operator<(const EdgeKey& other) const { return cell < other.cell; }
};

EdgeKey edge_key(const glm::dvec3& a, const glm::dvec3& b, double cell_m) {
  std::array<std::int64_t, 3> low{};
  std::array<std::int64_t, 3> high{};
  for (int axis = 0; axis < 3; ++axis) {
    low[static_cast<std::size_t>(axis)] = std::llround(a[axis] / cell_m);
    high[static_cast<std::size_t>(axis)] = std::llround(b[axis] / cell_m);
  }
  if (high < low) std::swap(low, high);
  return {{low[0], low[1], low[2], high[0], high[1], high[2]}};
}

std::uint64_t plane_key(const glm::dvec3& normal, double offset_m, double shift) {
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  for (const double value : {normal.x / kNormalCell, normal.y / kNormalCell, normal.z / kNormalCell,
                             offset_m / kOffsetCellM}) {
    hash = (hash ^ static_cast<std::uint64_t>(std::llround(value + shift))) * 0x9e3779b97f4a7c15ULL;
    hash ^= hash >> 29U;
  }
  return hash;
}

class CoplanarCutter {
 public:
  CoplanarCutter(std::vector<Mesh>& meshes, std::vector<CoplanarPart>& parts)
      : meshes_(meshes), parts_(parts) {}

  std::vector<std::string> run() {
    const std::size_t triangles = count_triangles();
    if (triangles > kMaxComparedTriangles) {
      return {
          fmt::format("{} triangles are more than {}: surfaces that lie in one plane are not "
                      "looked for, and may "
                      "show through each other",
                      triangles, kMaxComparedTriangles)};
    }
    collect();
    if (several_materials_) find_overlaps();
    if (!covers_.empty()) rebuild();
    return messages();
  }

 private:
  [[nodiscard]] std::size_t count_triangles() const {
    std::size_t count = 0;
    for (const CoplanarPart& part : parts_) count += meshes_[part.mesh].indices.size() / 3;
    return count;
  }

  void collect() {
    std::set<std::uint32_t> materials;
    for (std::uint32_t p = 0; p < parts_.size(); ++p) {
      const Mesh& mesh = meshes_[parts_[p].mesh];
      for (std::uint32_t s = 0; s < mesh.submeshes.size(); ++s) {
        materials.insert(mesh.submeshes[s].material);
        collect(p, s);
      }
    }
    several_materials_ = materials.size() > 1;
  }

  void collect(std::uint32_t part, std::uint32_t submesh_index) {
    const Mesh& mesh = meshes_[parts_[part].mesh];
    const Submesh& submesh = mesh.submeshes[submesh_index];
    const glm::dmat4& matrix = parts_[part].common_from_mesh;
    for (std::uint32_t i = submesh.first_index; i < submesh.first_index + submesh.index_count;
         i += 3) {
      Facet facet{part, submesh_index, i, submesh.material, submesh.double_sided};
      for (std::uint32_t k = 0; k < 3; ++k) {
        facet.corner_m[k] =
            glm::dvec3(matrix * glm::dvec4(glm::dvec3(mesh.positions_m[mesh.indices[i + k]]), 1.0));
      }
      const glm::dvec3 area = 0.5 * glm::cross(facet.corner_m[1] - facet.corner_m[0],
                                               facet.corner_m[2] - facet.corner_m[0]);
      facet.area_m2 = glm::length(area);
      if (!(facet.area_m2 > 0.0) || !std::isfinite(facet.area_m2)) continue;
      facet.normal = area / facet.area_m2;
      facets_.push_back(facet);
    }
  }

  void find_overlaps() {
    std::vector<PlaneEntry> entries;
    entries.reserve(2 * facets_.size());
    for (std::uint32_t f = 0; f < facets_.size(); ++f) {
      const Facet& facet = facets_[f];
      const double offset_m = glm::dot(facet.normal, facet.corner_m[0]);
      for (const double shift : {0.0, 0.5}) {
        entries.push_back({plane_key(facet.normal, offset_m, shift), f});
        if (facet.double_sided) {
          entries.push_back({plane_key(-facet.normal, -offset_m, shift), f});
        }
      }
    }
    std::ranges::sort(entries);
    std::vector<std::uint32_t> plane;
    for (std::size_t i = 0, next = 0; i < entries.size(); i = next) {
      plane.clear();
      bool mixed = false;
      for (next = i; next < entries.size() && entries[next].key == entries[i].key; ++next) {
        plane.push_back(entries[next].facet);
        mixed =
            mixed || facets_[entries[next].facet].material != facets_[entries[i].facet].material;
      }
      if (mixed) compare(plane);
    }
  }

  /// Sweeps over the facets of one plane and compares those whose boxes meet.
  void compare(std::vector<std::uint32_t>& plane) {
    const Projection flat(facets_[plane.front()].normal);
    struct Box {
      Point2 min{0.0};
      Point2 max{0.0};
      std::uint32_t facet = 0;
    };
    std::vector<Box> boxes;
    std::map<std::uint32_t, double> area_m2;  // by material
    for (const std::uint32_t f : plane) {
      const auto& corner = facets_[f].corner_m;
      const Point2 a = flat(corner[0]);
      const Point2 b = flat(corner[1]);
      const Point2 c = flat(corner[2]);
      boxes.push_back({glm::min(glm::min(a, b), c), glm::max(glm::max(a, b), c), f});
      area_m2[facets_[f].material] += facets_[f].area_m2;
    }
    std::ranges::sort(boxes, {}, [](const Box& box) { return box.min.x; });
    std::vector<Box> active;
    std::set<std::uint32_t> hidden;  // facets that lie wholly under one other
    for (const Box& box : boxes) {
      std::erase_if(active, [&](const Box& other) {
        return other.max.x <= box.min.x || hidden.contains(other.facet);
      });
      for (const Box& other : active) {
        if (hidden.contains(box.facet)) break;
        if (hidden.contains(other.facet) || other.max.y <= box.min.y || other.min.y >= box.max.y)
          continue;
        const Facet& a = facets_[box.facet];
        const Facet& b = facets_[other.facet];
        if (a.material == b.material || is_known_group(a, b) || !one_plane(a, b)) continue;
        const double area_a = area_m2[a.material];
        const double area_b = area_m2[b.material];
        // Equal areas differ by rounding only; then the later one covers the earlier one.
        const bool equal = std::abs(area_a - area_b) <= 1e-9 * (area_a + area_b);
        const bool a_covers =
            equal ? std::tie(a.part, a.submesh) > std::tie(b.part, b.submesh) : area_a < area_b;
        const std::uint32_t top = a_covers ? box.facet : other.facet;
        const std::uint32_t bottom = a_covers ? other.facet : box.facet;
        if (!overlap(facets_[bottom], facets_[top])) continue;
        covers_[bottom].insert(top);
        // The cover of a hidden facet covers what that facet covers, too. So a stack of equal
        // facets costs time in proportion to its height.
        if (hides(facets_[bottom], facets_[top])) hidden.insert(bottom);
      }
      if (!hidden.contains(box.facet)) active.push_back(box);
    }
  }

  [[nodiscard]] bool is_known_group(const Facet& a, const Facet& b) const {
    const std::uint32_t group = parts_[a.part].group;
    return group != 0 && group == parts_[b.part].group;
  }

  static bool one_plane(const Facet& a, const Facet& b) {
    if (glm::dot(a.normal, b.normal) < 0.0 && !a.double_sided && !b.double_sided) return false;
    const auto within = [](const Facet& plane, const Facet& other) {
      return std::ranges::all_of(other.corner_m, [&](const glm::dvec3& corner) {
        const glm::dvec3 size = glm::abs(corner);
        const double tolerance_m = kPlaneM + kPlaneFrac * std::max({size.x, size.y, size.z});
        return std::abs(glm::dot(plane.normal, corner - plane.corner_m[0])) <= tolerance_m;
      });
    };
    return within(a, b) && within(b, a);
  }

  /// The bottom facet in the coordinates of its plane.
  static Piece whole(const Facet& facet, const Projection& flat) {
    Piece piece(3);
    for (int k = 0; k < 3; ++k) {
      piece[static_cast<std::size_t>(k)].weight[k] = 1.0;
      piece[static_cast<std::size_t>(k)].at = flat(facet.corner_m[static_cast<std::size_t>(k)]);
    }
    return piece;
  }

  /// The sides of a facet, the inside to the left. `inset` moves side k inwards.
  static std::array<Line, 3> sides(const Facet& facet, const Projection& flat,
                                   const std::array<double, 3>& inset) {
    std::array<Point2, 3> corner{flat(facet.corner_m[0]), flat(facet.corner_m[1]),
                                 flat(facet.corner_m[2])};
    const bool turned = cross2(corner[1] - corner[0], corner[2] - corner[0]) < 0.0;
    std::array<Line, 3> lines;
    for (std::size_t k = 0; k < 3; ++k) {
      const Point2 from = turned ? corner[(k + 1) % 3] : corner[k];
      const Point2 to = turned ? corner[k] : corner[(k + 1) % 3];
      const Point2 direction = glm::normalize(to - from);
      lines[k] = {from + inset[k] * Point2(-direction.y, direction.x), direction};
    }
    return lines;
  }

  static double tolerance_of(const Facet& facet) { return 1e-9 * std::sqrt(facet.area_m2); }

  static bool overlap(const Facet& bottom, const Facet& top) {
    const Projection flat(bottom.normal);
    Piece inside = whole(bottom, flat);
    for (const Line& line : sides(top, flat, {0.0, 0.0, 0.0})) {
      inside = split(inside, line, tolerance_of(top)).first;
      if (inside.size() < 3) return false;
    }
    const double around = perimeter(inside);
    return around > 0.0 &&
           2.0 * std::abs(area2(inside)) > kMinWidthFrac * std::sqrt(top.area_m2) * around;
  }

  /// Returns true if no part of `bottom` reaches out from under `top`.
  static bool hides(const Facet& bottom, const Facet& top) {
    const Projection flat(bottom.normal);
    return std::ranges::all_of(sides(top, flat, {0.0, 0.0, 0.0}), [&](const Line& line) {
      return std::ranges::all_of(bottom.corner_m, [&](const glm::dvec3& corner) {
        return line.side(flat(corner)) >= -tolerance_of(top);
      });
    });
  }

  /// Edges that two covering facets share; a cut goes on below them.
  void find_inner_edges() {
    std::set<std::uint32_t> tops;
    for (const auto& [bottom, covering] : covers_) tops.insert(covering.begin(), covering.end());
    for (const std::uint32_t top : tops) {
      for (std::size_t k = 0; k < 3; ++k) {
        ++edge_uses_[{facets_[top].material, key_of(facets_[top], k)}];
      }
    }
  }

  [[nodiscard]] EdgeKey key_of(const Facet& facet, std::size_t side) const {
    return edge_key(facet.corner_m[side], facet.corner_m[(side + 1) % 3], 0.1 * kPlaneM);
  }

  /// Returns the convex pieces of a facet that the covering facets leave visible.
  [[nodiscard]] std::vector<Piece> remainder(const Facet& bottom,
                                             const std::set<std::uint32_t>& covering) const {
    const Projection flat(bottom.normal);
    std::vector<Piece> pieces = {whole(bottom, flat)};
    for (const std::uint32_t t : covering) {
      const Facet& top = facets_[t];
      const double underlap_m = kUnderlapFrac * std::sqrt(top.area_m2);
      std::array<double, 3> inset{};
      for (std::size_t k = 0; k < 3; ++k) {
        const auto uses = edge_uses_.find({top.material, key_of(top, k)});
        inset[k] = uses != edge_uses_.end() && uses->second > 1 ? 0.0 : underlap_m;
      }
      const std::array<Line, 3> lines = sides(top, flat, inset);
      std::vector<Piece> next;
      const std::array<Line, 3> edges = sides(top, flat, {0.0, 0.0, 0.0});
      for (Piece& piece : pieces) subtract(std::move(piece), lines, edges, tolerance_of(top), next);
      pieces = std::move(next);
    }
    std::erase_if(pieces, [&](const Piece& piece) {
      return piece.size() < 3 || !(std::abs(area2(piece)) > 1e-12 * bottom.area_m2);
    });
    return pieces;
  }

  /// Sets the corners of all pieces into the edges of the others on which they lie.
  static void match_corners(std::vector<Piece>& pieces, double size_m) {
    if (pieces.size() > kMaxMatchedPieces) return;
    std::vector<PieceCorner> corners;
    for (const Piece& piece : pieces) corners.insert(corners.end(), piece.begin(), piece.end());
    for (Piece& piece : pieces) piece = with_corners_on_edges(piece, corners, 1e-8 * size_m);
  }

  /// New vertices of one part by the edge of its mesh on which they lie.
  using EdgeVertices = std::map<std::pair<std::array<float, 3>, std::array<float, 3>>,
                                std::vector<std::pair<double, glm::vec3>>>;

  static std::array<float, 3> bits(const glm::vec3& p) { return {p.x, p.y, p.z}; }

  void rebuild() {
    find_inner_edges();
    std::map<std::uint32_t, std::vector<std::uint32_t>> by_part;  // covered facets
    for (const auto& [bottom, covering] : covers_) {
      by_part[facets_[bottom].part].push_back(bottom);
      count_pairs(bottom, covering);
    }
    std::vector<std::uint32_t> users(meshes_.size(), 0);
    for (const CoplanarPart& part : parts_) ++users[part.mesh];
    std::size_t copied = 0;
    for (const auto& [part, facets] : by_part) {
      std::uint32_t& mesh = parts_[part].mesh;
      if (users[mesh] > 1 || parts_[part].shared) {
        if (copied + meshes_[mesh].positions_m.size() > kMaxCopiedVertices) {
          ++left_uncut_;
          continue;
        }
        copied += meshes_[mesh].positions_m.size();
        --users[mesh];
        meshes_.push_back(Mesh(meshes_[mesh]));
        mesh = static_cast<std::uint32_t>(meshes_.size() - 1);
      }
      cut_mesh(meshes_[mesh], facets);
    }
  }

  /// A facet's remainder as triangles of its mesh.
  struct Cut {
    std::vector<Piece> pieces;
    std::array<std::uint32_t, 3> corner{};
  };

  void cut_mesh(Mesh& mesh, const std::vector<std::uint32_t>& bottoms) {
    std::unordered_map<std::uint32_t, Cut> cuts;  // by first index
    EdgeVertices on_edges;
    for (const std::uint32_t f : bottoms) {
      const Facet& facet = facets_[f];
      Cut cut;
      cut.pieces = remainder(facet, covers_.at(f));
      match_corners(cut.pieces, std::sqrt(facet.area_m2));
      for (std::uint32_t k = 0; k < 3; ++k) cut.corner[k] = mesh.indices[facet.first_index + k];
      note_edge_vertices(mesh, cut, on_edges);
      cuts.emplace(facet.first_index, std::move(cut));
    }
    for (auto& [first_index, cut] : cuts) add_edge_vertices(mesh, on_edges, cut);
    const std::vector<std::uint32_t> old_indices = std::move(mesh.indices);
    mesh.indices.clear();
    for (Submesh& submesh : mesh.submeshes) {
      const std::uint32_t first = submesh.first_index;
      const std::uint32_t end = first + submesh.index_count;
      submesh.first_index = static_cast<std::uint32_t>(mesh.indices.size());
      for (std::uint32_t i = first; i < end; i += 3) {
        const std::array<std::uint32_t, 3> corner{old_indices[i], old_indices[i + 1],
                                                  old_indices[i + 2]};
        if (const auto cut = cuts.find(i); cut != cuts.end()) {
          for (const Piece& piece : cut->second.pieces) append(mesh, corner, piece);
        } else {
          append_with_edge_vertices(mesh, corner, on_edges);
        }
      }
      submesh.index_count = static_cast<std::uint32_t>(mesh.indices.size()) - submesh.first_index;
    }
    std::erase_if(mesh.submeshes, [](const Submesh& submesh) { return submesh.index_count == 0; });
    update_bounds(mesh);
  }

  /// Position of a corner of a piece. Corners on an edge come out alike from both of its triangles:
  /// the two ends are added in an order that does not depend on the triangle.
  static glm::vec3 position_of(const Mesh& mesh, const std::array<std::uint32_t, 3>& corner,
                               const glm::dvec3& weight) {
    glm::dvec3 sum(0.0);
    double total = 0.0;
    for (int k = 0; k < 3; ++k) {
      if (weight[k] == 1.0) return mesh.positions_m[corner[static_cast<std::size_t>(k)]];
      sum += weight[k] * glm::dvec3(mesh.positions_m[corner[static_cast<std::size_t>(k)]]);
      total += weight[k];
    }
    return glm::vec3(sum / total);
  }

  static void note_edge_vertices(const Mesh& mesh, const Cut& cut, EdgeVertices& on_edges) {
    for (const Piece& piece : cut.pieces) {
      for (const PieceCorner& corner : piece) {
        for (int k = 0; k < 3; ++k) {
          // A corner on the edge opposite to k has no weight there, and some at both ends.
          const int a = (k + 1) % 3;
          const int b = (k + 2) % 3;
          constexpr double kNone = 1e-9;
          if (std::abs(corner.weight[k]) > kNone || corner.weight[a] < kNone ||
              corner.weight[b] < kNone) {
            continue;
          }
          const glm::vec3 from = mesh.positions_m[cut.corner[static_cast<std::size_t>(a)]];
          const glm::vec3 to = mesh.positions_m[cut.corner[static_cast<std::size_t>(b)]];
          const glm::vec3 at = position_of(mesh, cut.corner, corner.weight);
          const bool ordered = bits(from) < bits(to);
          on_edges[ordered ? std::pair{bits(from), bits(to)} : std::pair{bits(to), bits(from)}]
              .emplace_back(ordered ? corner.weight[b] : corner.weight[a], at);
        }
      }
    }
  }

  /// Sets the new vertices of a cut triangle's neighbours, which are cut too, into its edges.
  static void add_edge_vertices(const Mesh& mesh, const EdgeVertices& on_edges, Cut& cut) {
    std::array<glm::dvec3, 3> corner;
    for (std::size_t k = 0; k < 3; ++k) corner[k] = glm::dvec3(mesh.positions_m[cut.corner[k]]);
    // Pieces lie in the plane of the common axes; only shares of the edges are needed here.
    const auto at = [&](const glm::dvec3& weight) { return Point2(weight.y, weight.z); };
    std::vector<PieceCorner> fresh;
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      const glm::vec3 from(corner[static_cast<std::size_t>(k)]);
      const glm::vec3 to(corner[static_cast<std::size_t>(next)]);
      const bool ordered = bits(from) < bits(to);
      const auto found = on_edges.find(ordered ? std::pair{bits(from), bits(to)}
                                               : std::pair{bits(to), bits(from)});
      if (found == on_edges.end()) continue;
      for (const auto& [share, position] : found->second) {
        PieceCorner vertex;
        vertex.weight[k] = ordered ? 1.0 - share : share;
        vertex.weight[next] = ordered ? share : 1.0 - share;
        vertex.at = at(vertex.weight);
        fresh.push_back(vertex);
      }
    }
    if (fresh.empty()) return;
    for (Piece& piece : cut.pieces) {
      for (PieceCorner& c : piece) c.at = at(c.weight);
      piece = with_corners_on_edges(piece, fresh, 1e-8);
    }
  }

  /// A triangle beside a cut one gets the new vertices of their common edge.
  static void append_with_edge_vertices(Mesh& mesh, const std::array<std::uint32_t, 3>& corner,
                                        const EdgeVertices& on_edges) {
    Piece piece;
    const glm::dvec3 a(mesh.positions_m[corner[0]]);
    const glm::dvec3 b(mesh.positions_m[corner[1]]);
    const glm::dvec3 c(mesh.positions_m[corner[2]]);
    const Projection flat(glm::cross(b - a, c - a));
    std::vector<glm::vec3> exact;  // of piece corners, where they are new
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      const glm::vec3 from = mesh.positions_m[corner[static_cast<std::size_t>(k)]];
      const glm::vec3 to = mesh.positions_m[corner[static_cast<std::size_t>(next)]];
      PieceCorner own;
      own.weight[k] = 1.0;
      own.at = flat(glm::dvec3(from));
      piece.push_back(own);
      exact.push_back(from);
      const bool ordered = bits(from) < bits(to);
      const auto found = on_edges.find(ordered ? std::pair{bits(from), bits(to)}
                                               : std::pair{bits(to), bits(from)});
      if (found == on_edges.end()) continue;
      std::vector<std::pair<double, glm::vec3>> fresh = found->second;
      for (auto& [t, at] : fresh) t = ordered ? t : 1.0 - t;
      std::ranges::sort(fresh, {}, [](const auto& entry) { return entry.first; });
      double last = 0.0;
      for (const auto& [t, at] : fresh) {
        if (t - last < 1e-9 || t > 1.0 - 1e-9) continue;
        PieceCorner corner_on_edge;
        corner_on_edge.weight[k] = 1.0 - t;
        corner_on_edge.weight[next] = t;
        corner_on_edge.at = flat(glm::dvec3(at));
        piece.push_back(corner_on_edge);
        exact.push_back(at);
        last = t;
      }
    }
    if (piece.size() == 3) {
      mesh.indices.insert(mesh.indices.end(), corner.begin(), corner.end());
      return;
    }
    // Rounded points may lie a little outside the straight edge; the exact edge is what counts
    // here.
    for (PieceCorner& p : piece) {
      p.at = flat(p.weight.x * a + p.weight.y * b + p.weight.z * c);
    }
    append(mesh, corner, piece, &exact);
  }

  static glm::dvec3 area_of(const Mesh& mesh, const std::array<std::uint32_t, 3>& corner) {
    const glm::dvec3 a(mesh.positions_m[corner[0]]);
    return 0.5 * glm::cross(glm::dvec3(mesh.positions_m[corner[1]]) - a,
                            glm::dvec3(mesh.positions_m[corner[2]]) - a);
  }

  /// Appends the triangles of a piece, with normals between those of the cut triangle's corners.
  static void append(Mesh& mesh, const std::array<std::uint32_t, 3>& corner, const Piece& piece,
                     const std::vector<glm::vec3>* exact = nullptr) {
    std::vector<std::uint32_t> vertex(piece.size());
    for (std::size_t i = 0; i < piece.size(); ++i) {
      const glm::dvec3& weight = piece[i].weight;
      vertex[i] = static_cast<std::uint32_t>(mesh.positions_m.size());
      for (int k = 0; k < 3; ++k) {
        if (weight[k] == 1.0) vertex[i] = corner[static_cast<std::size_t>(k)];
      }
      if (vertex[i] < mesh.positions_m.size()) continue;
      glm::dvec3 normal(0.0);
      for (int k = 0; k < 3; ++k) {
        normal += weight[k] * glm::dvec3(mesh.normals[corner[static_cast<std::size_t>(k)]]);
      }
      const double length = glm::length(normal);
      mesh.normals.push_back(length > 1e-6 ? glm::vec3(normal / length) : mesh.normals[corner[0]]);
      mesh.positions_m.push_back(exact != nullptr ? (*exact)[i]
                                                  : position_of(mesh, corner, weight));
    }
    const glm::dvec3 front = area_of(mesh, corner);
    for (const auto& triangle : triangulate(piece)) {
      const std::array<std::uint32_t, 3> index{vertex[triangle[0]], vertex[triangle[1]],
                                               vertex[triangle[2]]};
      // Rounding to float32 turns the thinnest slivers over.
      if (!(glm::dot(area_of(mesh, index), front) > 0.0)) continue;
      mesh.indices.insert(mesh.indices.end(), index.begin(), index.end());
    }
  }

  void count_pairs(std::uint32_t bottom, const std::set<std::uint32_t>& covering) {
    std::set<std::tuple<std::uint32_t, std::uint32_t>> tops;
    for (const std::uint32_t t : covering) tops.insert({facets_[t].part, facets_[t].submesh});
    for (const auto& [part, submesh] : tops) {
      ++pairs_[{facets_[bottom].part, facets_[bottom].submesh, part, submesh}];
    }
  }

  [[nodiscard]] std::string name_of(std::uint32_t part, std::uint32_t submesh) const {
    return fmt::format("{} primitive {}", parts_[part].name, submesh);
  }

  [[nodiscard]] std::vector<std::string> messages() const {
    std::vector<std::string> out;
    for (const auto& [pair, triangles] : pairs_) {
      const auto& [bottom_part, bottom_submesh, top_part, top_submesh] = pair;
      if (out.size() == kMaxMessages) {
        out.push_back(fmt::format("{} more pairs of surfaces lie in one plane",
                                  pairs_.size() - kMaxMessages));
        break;
      }
      out.push_back(fmt::format(
          "{} lies in the plane of {}: it is shown, and {} triangles are cut away beneath it",
          name_of(top_part, top_submesh), name_of(bottom_part, bottom_submesh), triangles));
    }
    if (left_uncut_ > 0) {
      out.push_back(fmt::format(
          "{} placements of shared meshes with surfaces in one plane are not cut, because the "
          "copies would have more than {} vertices: their surfaces may show through each other",
          left_uncut_, kMaxCopiedVertices));
    }
    return out;
  }

  std::vector<Mesh>& meshes_;
  std::vector<CoplanarPart>& parts_;
  bool several_materials_ = false;
  std::vector<Facet> facets_;
  std::map<std::uint32_t, std::set<std::uint32_t>> covers_;  ///< bottom facet -> those above it
  std::map<std::pair<std::uint32_t, EdgeKey>, std::uint32_t> edge_uses_;
  std::map<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t, std::uint32_t>, std::uint32_t>
      pairs_;  ///< bottom part and submesh, top part and submesh -> triangles cut
  std::size_t left_uncut_ = 0;
};

}  // namespace

std::vector<std::string> cut_coplanar(std::vector<Mesh>& meshes, std::vector<CoplanarPart>& parts) {
  for (const CoplanarPart& part : parts) EMIT_CHECK_OP(part.mesh, <, meshes.size());
  return CoplanarCutter(meshes, parts).run();
}

}  // namespace emit::scene
