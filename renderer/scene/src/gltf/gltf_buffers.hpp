// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>

#include "gltf_file.hpp"

namespace emit::scene {

/// Loads every buffer of the file into `model.buffers`: the binary chunk, data URIs and files
/// beside the model. A source may be longer than the buffer's byteLength; the rest is not used. A
/// fallback buffer of EXT_meshopt_compression without a source stays empty.
///
/// @param list    JSON text of the `buffers` array; empty: the file has none
/// @param chunk   binary chunk of a .glb, if it has one
/// Errors name the buffer: not_found, io, parse (too short, not decodable), unsupported (a URI that
/// is no local file). No message holds a data URI.
[[nodiscard]] physics::Result<void> load_buffers(
    std::string_view list, std::optional<std::span<const unsigned char>> chunk,
    const std::filesystem::path& folder, tinygltf::Model& model);

/// Encoded bytes of an image: a data URI, a file beside the model or a view of a buffer.
/// Errors: not_found, io, parse (no such image, malformed), unsupported (a URI that is no local
/// file). No message holds a data URI.
[[nodiscard]] physics::Result<std::vector<unsigned char>> image_bytes(const GltfFile& file,
                                                                      int index);

/// Whole content of a file. Errors: not_found, unsupported (4 GiB and more), io.
[[nodiscard]] physics::Result<std::vector<unsigned char>> read_bytes(
    const std::filesystem::path& path);

}  // namespace emit::scene
