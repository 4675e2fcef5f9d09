// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <vector>

#include "gltf_file.hpp"

namespace emit::scene {

/// Treatment of a value that is infinite or not a number in read_floats().
enum class NonFinite { refuse, keep };

/// Values of an accessor, tightly packed, `components` per element. Normalised integers become
/// 0..1 or -1..1, other integers keep their value; sparse elements are filled in.
/// Errors: parse, "accessor N: ...".
[[nodiscard]] physics::Result<std::vector<float>> read_floats(
    const tinygltf::Model& model, int accessor, int components,
    NonFinite non_finite = NonFinite::refuse);

/// Vertex indices, each checked against the number of `vertices`. A negative accessor stands for a
/// primitive without indices and gives 0, 1, 2, ...
/// Errors: parse, "accessor N: ...".
[[nodiscard]] physics::Result<std::vector<std::uint32_t>> read_indices(const tinygltf::Model& model,
                                                                       int accessor,
                                                                       std::size_t vertices);

}  // namespace emit::scene
