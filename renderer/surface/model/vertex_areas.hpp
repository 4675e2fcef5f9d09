// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

#include "emit/scene/mesh.hpp"
#include "surface/mesh/refined_mesh.hpp"

namespace emit::renderer {

/// Returns the area that each vertex of a mesh stands for in m2, by vertex: a third of its
/// triangles, measured in the body frame, where the instance has its true size. Setup only.
[[nodiscard]] std::vector<float> vertex_areas_m2(const RefinedMesh& mesh,
                                                 const scene::Instance& instance);

}  // namespace emit::renderer
