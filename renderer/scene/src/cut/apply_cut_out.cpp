// SPDX-License-Identifier: Apache-2.0
#include "apply_cut_out.hpp"

#include <fmt/format.h>

#include <array>
#include <map>
#include <utility>

namespace emit::scene {
namespace {

constexpr std::size_t kMaxTriangles = 1'000'000;

/// Makes the vertices of pieces.
class NewVertices {
 public:
  explicit NewVertices(CutSurface surface) : surface_(surface) {}

  /// Vertex at a corner of a piece of a triangle.
  std::uint32_t at(const std::array<std::uint32_t, 3>& old, const glm::dvec3& shares) {
    int used = 0;
    for (int c = 0; c < 3; ++c) used += shares[c] != 0.0 ? 1 : 0;
    if (used == 1) {
      for (std::size_t c = 0; c < 3; ++c) {
        if (shares[static_cast<int>(c)] != 0.0) return old[c];
      }
    }
    glm::dvec3 position(0.0);
    glm::dvec3 normal(0.0);
    glm::dvec2 uv(0.0);
    EdgePoint edge;
    int found = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double share = shares[static_cast<int>(c)];
      if (share == 0.0) continue;
      position += share * surface_.positions[old[c]];
      uv += share * surface_.uv[old[c]];
      if (!surface_.normals.empty()) normal += share * glm::dvec3(surface_.normals[old[c]]);
      (found++ == 0 ? edge.first : edge.second) = old[c];
      edge.second_share = share;
    }
    const auto vertex = static_cast<std::uint32_t>(surface_.positions.size());
    if (used == 2) {
      edge.vertex = vertex;
      edge_points.push_back(edge);
    }
    surface_.positions.push_back(position);
    surface_.uv.push_back(uv);
    if (!surface_.normals.empty()) surface_.normals.emplace_back(normal);
    return vertex;
  }

  std::vector<EdgePoint> edge_points;

 private:
  CutSurface surface_;
};

}  // namespace

AppliedCut apply_cut_out(CutOut& cut_out, const std::vector<std::uint32_t>& indices,
                         CutSurface surface) {
  const bool is_mask = cut_out.mask() != nullptr;
  const char* what = is_mask ? "what its image cuts out" : "its image of materials";
  AppliedCut out;
  std::optional<CutTriangles> cut;
  double tolerance_px = 0.0;
  for (const double tried_px : cut_out.tolerances_px()) {
    tolerance_px = tried_px;
    cut = cut_out.cut(surface.uv, indices, tried_px);
    if (!cut || cut->corners.size() <= 3 * kMaxTriangles) break;
  }
  if (!cut || cut->corners.size() > 3 * kMaxTriangles) {
    out.messages.emplace_back(
        is_mask ? "its image cuts out more than a million pieces: it is taken as solid"
                : "its image of materials makes more than a million pieces: it is left out");
    return out;
  }
  out.done = true;
  out.unlike_frac = cut->unlike_frac;
  if (tolerance_px > cut_out.tolerances_px()[0]) {
    out.messages.push_back(fmt::format(
        "{} is within {} texels, because finer outlines have more than a million triangles", what,
        tolerance_px));
  }
  if (cut->uncut > 0) {
    out.messages.push_back(
        is_mask
            ? fmt::format("{} triangles could not be cut out and are taken as solid", cut->uncut)
            : fmt::format("{} triangles could not be cut by its image of materials: each has "
                          "the material at its middle",
                          cut->uncut));
  }
  const auto old = [&](std::uint32_t triangle) {
    return std::array<std::uint32_t, 3>{indices[3 * triangle], indices[3 * triangle + 1],
                                        indices[3 * triangle + 2]};
  };
  std::map<std::uint8_t, std::vector<std::uint32_t>> parts;
  for (const CutTriangles::Whole& whole : cut->whole) {
    for (const std::uint32_t vertex : old(whole.triangle)) parts[whole.part].push_back(vertex);
  }
  NewVertices vertices(surface);
  surface.positions.reserve(surface.positions.size() + cut->corners.size());
  for (const CutTriangles::Corner& corner : cut->corners) {
    parts[corner.part].push_back(vertices.at(old(corner.triangle), corner.shares));
  }
  for (auto& [part, list] : parts) out.parts.push_back({part, std::move(list)});
  out.edge_points = std::move(vertices.edge_points);
  return out;
}

}  // namespace emit::scene
