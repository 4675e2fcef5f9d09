// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <string_view>

#include "gltf_file.hpp"

namespace emit::scene {

/// Both names of the extension: the vendor's, which gltfpack writes, and that of its ratified form.
inline constexpr std::array<std::string_view, 2> kMeshoptExtensions = {"EXT_meshopt_compression",
                                                                       "KHR_meshopt_compression"};

/// Decodes the buffer views that are compressed by meshoptimizer. Each gets a buffer of its own
/// behind those of the file, so that readers see plain data. Modes: ATTRIBUTES, TRIANGLES, INDICES;
/// filters: NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL.
/// Errors name view and extension: parse (malformed), unsupported (a newer codec, mode or filter).
[[nodiscard]] physics::Result<void> decode_meshopt_views(tinygltf::Model& model);

}  // namespace emit::scene
