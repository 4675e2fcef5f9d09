// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wold-style-cast"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#include <tiny_gltf.h>
#pragma GCC diagnostic pop

#include "emit/physics/error.hpp"

namespace emit::scene {

/// A parsed file whose buffers are loaded and decompressed. The parser checks syntax. The reader of
/// an element checks what the element refers to.
struct GltfFile {
  std::filesystem::path path;
  std::string name;  ///< file name without folder: begins every message
  tinygltf::Model model;
  std::vector<std::string> warnings;
  std::string images;  ///< JSON text of the `images` array; empty: the file has none
};

/// Reads and parses a file.
/// Errors name file and element: not_found, io, parse, unsupported (required extension, version).
/// Throws std::bad_alloc only.
[[nodiscard]] physics::Result<GltfFile> parse_gltf_file(const std::filesystem::path& path);

/// Name of an element for messages: "mesh 3 'hangar'", or "mesh 3" for an element without a name.
[[nodiscard]] std::string element(const char* kind, int index, const std::string& name);

}  // namespace emit::scene
