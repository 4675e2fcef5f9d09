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

/// A parsed file. The parser checks syntax; everything an element refers to is checked by whoever
/// reads the element.
struct GltfFile {
  std::filesystem::path path;
  std::string name;  ///< file name without folder: begins every message
  tinygltf::Model model;
  std::vector<std::string> warnings;
};

/// Errors: not_found, io, parse, unsupported (required extension). Never throws.
[[nodiscard]] physics::Result<GltfFile> parse_gltf_file(const std::filesystem::path& path);

/// "mesh 3 'hangar'"; without quotes where the element has no name.
[[nodiscard]] std::string element(const char* kind, int index, const std::string& name);

}  // namespace emit::scene
