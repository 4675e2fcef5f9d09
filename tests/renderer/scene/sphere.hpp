// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cmath>
#include <cstdint>

#include "emit/physics/constants.hpp"
#include "emit/scene/mesh.hpp"

namespace emit::scene {

/// Sphere of radius 1 m with `rings` bands of latitude; its upper half may be of another material.
inline Mesh sphere(std::uint32_t rings, bool two_materials) {
  Mesh mesh;
  const std::uint32_t columns = 2 * rings;
  for (std::uint32_t r = 0; r <= rings; ++r) {
    const double polar = physics::kPi * r / rings;
    for (std::uint32_t c = 0; c < columns; ++c) {
      const double turn = 2.0 * physics::kPi * c / columns;
      mesh.normals.emplace_back(std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn),
                                std::cos(polar));
    }
  }
  mesh.positions_m = mesh.normals;
  const auto vertex = [columns](std::uint32_t r, std::uint32_t c) {
    return r * columns + c % columns;
  };
  const auto band = [&](std::uint32_t r) {
    for (std::uint32_t c = 0; c < columns; ++c) {
      if (r > 0) {
        for (const std::uint32_t v : {vertex(r, c), vertex(r + 1, c), vertex(r, c + 1)}) {
          mesh.indices.push_back(v);
        }
      }
      if (r + 1 < rings) {
        for (const std::uint32_t v : {vertex(r, c + 1), vertex(r + 1, c), vertex(r + 1, c + 1)}) {
          mesh.indices.push_back(v);
        }
      }
    }
  };
  for (std::uint32_t r = 0; r < rings; ++r) {
    if (r == 0 || (two_materials && r == rings / 2)) {
      mesh.submeshes.push_back({static_cast<std::uint32_t>(mesh.indices.size()), 0,
                                static_cast<std::uint32_t>(mesh.submeshes.size()), false});
    }
    band(r);
    mesh.submeshes.back().index_count =
        static_cast<std::uint32_t>(mesh.indices.size()) - mesh.submeshes.back().first_index;
  }
  for (const glm::vec3& p : mesh.positions_m) mesh.bounds.add(glm::dvec3(p));
  return mesh;
}

}  // namespace emit::scene
