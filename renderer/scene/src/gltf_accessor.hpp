// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <vector>

#include "gltf_file.hpp"

namespace emit::scene {

/// Values of an accessor, tightly packed, `components` per element; normalised integers become
/// 0..1 or -1..1, other integers their value; sparse elements are filled in.
/// Errors: parse, "accessor N: ...".
[[nodiscard]] physics::Result<std::vector<float>> read_floats(const tinygltf::Model& model,
                                                              int accessor, int components);

/// Vertex indices, each checked against `vertices`; no indices (accessor < 0) gives 0, 1, 2, ...
[[nodiscard]] physics::Result<std::vector<std::uint32_t>> read_indices(const tinygltf::Model& model,
                                                                       int accessor,
                                                                       std::size_t vertices);

}  // namespace emit::scene
