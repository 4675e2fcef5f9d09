// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float3.hpp>
#include <string>
#include <vector>

#include "cut_out.hpp"
#include "edge_points.hpp"

namespace emit::scene {

/// Vertices and triangles that are cut.
struct CutSurface {
  std::vector<glm::dvec3>& positions;
  std::vector<glm::vec3>& normals;  ///< empty, or one for each position
  std::vector<glm::dvec2>& uv;      ///< texture coordinates, one for each position
};

/// Triangles of one part of an image.
struct CutPart {
  std::uint8_t part = 0;
  std::vector<std::uint32_t> indices;  ///< three for each triangle
};

/// Result of apply_cut_out().
struct AppliedCut {
  bool done = false;                   ///< false: the triangles stay as they were
  std::vector<CutPart> parts;          ///< ascending, only those that are there
  std::vector<EdgePoint> edge_points;  ///< new vertices on edges of old triangles
  double unlike_frac = 0.0;            ///< see CutTriangles
  std::vector<std::string> messages;   ///< sentences for warnings
};

/// Cuts triangles by an image; new vertices are appended to the surface. Outlines of a mask are
/// within a fifth of a texel, those of regions within 0.75 texels; they are coarser where the
/// primitive would have more than a million triangles.
/// @param indices  three for each triangle
[[nodiscard]] AppliedCut apply_cut_out(CutOut& cut_out, const std::vector<std::uint32_t>& indices,
                                       CutSurface surface);

}  // namespace emit::scene
