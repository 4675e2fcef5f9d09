// SPDX-License-Identifier: Apache-2.0
#include "gltf_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

static_assert(std::endian::native == std::endian::little, "glTF buffers are little endian");

constexpr std::uint32_t kMagic = 0x46546c67;  // "glTF"
constexpr std::uint32_t kJsonChunk = 0x4e4f534a;
constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;
/// The parser descends by recursion; real files nest below 20.
constexpr int kMaxNesting = 200;

/// Extensions that do not change the geometry, and those that are handled.
constexpr std::string_view kAcceptedExtensions[] = {
    "EXT_mesh_gpu_instancing", "KHR_mesh_quantization", "KHR_texture_transform",
    "KHR_texture_basisu",      "EXT_texture_webp",      "KHR_lights_punctual",
    "KHR_xmp_json_ld",         "MSFT_texture_dds"};

Result<std::vector<unsigned char>> read_bytes(const std::filesystem::path& path) {
  std::error_code status;
  if (!std::filesystem::is_regular_file(path, status)) {
    return make_error(ErrorCode::not_found, "no such file");
  }
  const std::uintmax_t size = std::filesystem::file_size(path, status);
  if (status || size > std::numeric_limits<std::uint32_t>::max()) {
    return make_error(ErrorCode::unsupported, "files of 4 GiB and more are not read");
  }
  std::ifstream stream(path, std::ios::binary);
  std::vector<unsigned char> bytes(static_cast<std::size_t>(size));
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!stream || stream.gcount() != static_cast<std::streamsize>(size)) {
    return make_error(ErrorCode::io, "reading failed");
  }
  return bytes;
}

std::uint32_t read_u32(std::span<const unsigned char> bytes, std::size_t offset) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

/// The chunk structure of a .glb; the parser trusts it in places. Gives the JSON text.
Result<std::span<const unsigned char>> check_container(std::span<const unsigned char> bytes) {
  if (bytes.size() < kHeaderBytes + kChunkHeaderBytes) {
    return make_error(ErrorCode::parse,
                      fmt::format("GLB header: {} bytes are too few", bytes.size()));
  }
  const std::uint32_t version = read_u32(bytes, 4);
  if (version != 2) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("GLB header: version {}, not 2", version));
  }
  const std::uint32_t length = read_u32(bytes, 8);
  if (length > bytes.size()) {
    return make_error(ErrorCode::parse, fmt::format("GLB header: length {}, but the file has {} "
                                                    "bytes: truncated?",
                                                    length, bytes.size()));
  }
  std::span<const unsigned char> json;
  std::size_t offset = kHeaderBytes;
  for (int chunk = 0; offset + kChunkHeaderBytes <= length; ++chunk) {
    const std::size_t size = read_u32(bytes, offset);
    const std::uint32_t kind = read_u32(bytes, offset + 4);
    offset += kChunkHeaderBytes;
    if (size > length - offset) {
      return make_error(ErrorCode::parse, fmt::format("GLB chunk {}: {} bytes, but {} are left: "
                                                      "truncated?",
                                                      chunk, size, length - offset));
    }
    if (chunk == 0) {
      if (kind != kJsonChunk) {
        return make_error(ErrorCode::parse, "GLB chunk 0: not JSON");
      }
      json = bytes.subspan(offset, size);
    }
    offset += size;
  }
  return json;
}

Result<void> check_nesting(std::span<const unsigned char> json) {
  int depth = 0;
  bool in_text = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const unsigned char c = json[i];
    if (in_text) {
      if (c == '\\') {
        ++i;
      } else if (c == '"') {
        in_text = false;
      }
      continue;
    }
    in_text = c == '"';
    depth += (c == '{' || c == '[') ? 1 : 0;
    depth -= (c == '}' || c == ']') ? 1 : 0;
    if (depth > kMaxNesting) {
      return make_error(ErrorCode::parse,
                        fmt::format("JSON byte {}: nested deeper than {}", i, kMaxNesting));
    }
  }
  return {};
}

/// Pictures are of no use here; accepting without decoding also spares their memory.
bool skip_image(tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*,
                int, void*) {
  return true;
}

std::string one_line(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) {
    text.pop_back();
  }
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

Result<void> check_extensions(const tinygltf::Model& model) {
  for (const std::string& name : model.extensionsRequired) {
    const bool material_only = name.rfind("KHR_materials_", 0) == 0;
    const bool accepted = std::find(std::begin(kAcceptedExtensions), std::end(kAcceptedExtensions),
                                    name) != std::end(kAcceptedExtensions);
    if (!material_only && !accepted) {
      return make_error(ErrorCode::unsupported,
                        fmt::format("required extension '{}' is not supported", name));
    }
  }
  return {};
}

Result<void> parse_bytes(const std::vector<unsigned char>& bytes, GltfFile& file) {
  const bool binary = bytes.size() >= 4 && read_u32(bytes, 0) == kMagic;
  std::span<const unsigned char> json = bytes;
  if (binary) {
    const Result<std::span<const unsigned char>> chunk = check_container(bytes);
    if (!chunk) {
      return tl::unexpected(chunk.error());
    }
    json = *chunk;
  }
  if (auto nesting = check_nesting(json); !nesting) {
    return nesting;
  }
  tinygltf::TinyGLTF parser;
  parser.SetImageLoader(skip_image, nullptr);
  std::string error;
  std::string warning;
  const std::filesystem::path parent = file.path.parent_path();
  const std::string folder = parent.empty() ? "." : parent.string();
  const auto size = static_cast<unsigned int>(bytes.size());
  bool parsed = false;
  try {
    parsed =
        binary
            ? parser.LoadBinaryFromMemory(&file.model, &error, &warning, bytes.data(), size, folder)
            : parser.LoadASCIIFromString(&file.model, &error, &warning,
                                         reinterpret_cast<const char*>(bytes.data()), size, folder);
  } catch (const std::exception& thrown) {
    return make_error(ErrorCode::parse, one_line(error + thrown.what()));
  }
  if (!parsed) {
    return make_error(ErrorCode::parse, error.empty() ? "not a glTF file" : one_line(error));
  }
  return check_extensions(file.model);
}

}  // namespace

Result<GltfFile> parse_gltf_file(const std::filesystem::path& path) {
  GltfFile file;
  file.path = path;
  file.name = path.filename().string();
  const Result<std::vector<unsigned char>> bytes = read_bytes(path);
  if (!bytes) {
    return tl::unexpected(physics::Error(bytes.error()).with_context(path.string()));
  }
  if (auto parsed = parse_bytes(*bytes, file); !parsed) {
    return tl::unexpected(std::move(parsed.error()).with_context(path.string()));
  }
  return file;
}

std::string element(const char* kind, int index, const std::string& name) {
  return name.empty() ? fmt::format("{} {}", kind, index)
                      : fmt::format("{} {} '{}'", kind, index, name);
}

}  // namespace emit::scene
