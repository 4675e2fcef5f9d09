// SPDX-License-Identifier: Apache-2.0
#include "gltf_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <exception>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "gltf_buffers.hpp"
#include "gltf_meshopt.hpp"
#include "json_text.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

static_assert(std::endian::native == std::endian::little, "glTF buffers are little endian");

constexpr std::uint32_t kMagic = 0x46546c67;  // "glTF"
constexpr std::uint32_t kJsonChunk = 0x4e4f534a;
constexpr std::uint32_t kBinaryChunk = 0x004e4942;
constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;
/// The parser descends by recursion; real files nest below 20.
constexpr int kMaxNesting = 200;

/// Extensions that the import handles, and those that do not change the geometry.
constexpr std::string_view kAcceptedExtensions[] = {
    "EXT_mesh_gpu_instancing", "EXT_meshopt_compression", "KHR_meshopt_compression",
    "KHR_mesh_quantization",   "KHR_texture_transform",   "KHR_texture_basisu",
    "EXT_texture_avif",        "EXT_texture_webp",        "KHR_animation_pointer",
    "KHR_lights_punctual",     "KHR_xmp_json_ld",         "MSFT_texture_dds"};

std::uint32_t read_u32(std::span<const unsigned char> bytes, std::size_t offset) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

/// Parts of a .glb.
struct Container {
  std::span<const unsigned char> json;
  std::optional<std::span<const unsigned char>> binary;  ///< the second chunk, if it is binary
};

/// Checks the header of a .glb and every chunk's size, and finds the two chunks that glTF defines.
Result<Container> check_container(std::span<const unsigned char> bytes) {
  if (bytes.size() < kHeaderBytes + kChunkHeaderBytes) {
    return make_error(ErrorCode::parse,
                      fmt::format("GLB header: {} bytes are too few", bytes.size()));
  }
  const std::uint32_t version = read_u32(bytes, 4);
  if (version != 2) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("glTF version {} (binary): only glTF 2.x is read; export or "
                                  "convert the model to glTF 2.0",
                                  version));
  }
  const std::uint32_t length = read_u32(bytes, 8);
  if (length > bytes.size()) {
    return make_error(ErrorCode::parse, fmt::format("GLB header: length {}, but the file has {} "
                                                    "bytes: truncated?",
                                                    length, bytes.size()));
  }
  Container container;
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
      container.json = bytes.subspan(offset, size);
    } else if (chunk == 1 && kind == kBinaryChunk) {
      container.binary = bytes.subspan(offset, size);
    }
    offset += size;
  }
  return container;
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

/// The parser quotes what it read last, which can be a data URI of many megabytes.
std::string printable(std::string text) {
  constexpr std::size_t kMaxText = 300;
  if (const std::size_t uri = text.find("data:"); uri != std::string::npos) {
    text = text.substr(0, uri) + "(data URI)";
  }
  if (text.size() > kMaxText) text = text.substr(0, kMaxText) + "...";
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ')) {
    text.pop_back();
  }
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

/// Versions are "major.minor"; files of glTF 1.0 parse as 2.0 and would come out empty.
Result<void> check_version(const std::vector<JsonMember>& root) {
  const auto asset = json_members(json_member(root, "asset"));
  if (!asset) return make_error(ErrorCode::parse, "asset: the object is missing");
  for (const std::string_view key : {"version", "minVersion"}) {
    const std::string_view value = json_member(*asset, key);
    if (value.empty() && key == "minVersion") continue;
    const auto version = json_string(value);
    if (!version) {
      return make_error(ErrorCode::parse, fmt::format("asset: {} is missing or no text", key));
    }
    if ((*version != "2" && !version->starts_with("2.")) ||
        (key == "minVersion" && *version != "2.0")) {
      return make_error(ErrorCode::unsupported,
                        fmt::format("asset: {} is {}: only glTF 2.0 is read; export or convert the "
                                    "model to glTF 2.0",
                                    key, printable(*version)));
    }
  }
  return {};
}

Result<void> check_extensions(const std::vector<JsonMember>& root) {
  const auto required = json_items(json_member(root, "extensionsRequired"));
  if (!required) return {};
  for (const std::string_view item : *required) {
    const std::string name = json_string(item).value_or("");
    const bool material_only = name.starts_with("KHR_materials_");
    if (!material_only && std::ranges::count(kAcceptedExtensions, name) == 0) {
      return make_error(ErrorCode::unsupported,
                        fmt::format("required extension '{}' is not supported", printable(name)));
    }
  }
  return {};
}

/// The text with the arrays `buffers` and `images` emptied: buffers are loaded here, by rules of
/// their own, and images only where a surface needs them.
std::string without_sources(std::string_view json, const std::vector<JsonMember>& root) {
  std::string out;
  out.reserve(json.size());
  std::size_t copied = 0;
  for (const JsonMember& member : root) {
    if (member.name != "buffers" && member.name != "images") continue;
    const auto first = static_cast<std::size_t>(member.value.data() - json.data());
    out.append(json, copied, first - copied).append("[]");
    copied = first + member.value.size();
  }
  return out.append(json, copied);
}

/// Text of an error of the JSON parser, without the name of its exception.
std::string json_fault(const std::string& text) {
  constexpr std::string_view kException = "[json.exception.";
  const std::size_t end = text.starts_with(kException) ? text.find("] ") : std::string::npos;
  return end == std::string::npos ? printable(text)
                                  : "not valid JSON: " + printable(text.substr(end + 2));
}

Result<void> parse_json(const std::string& json, tinygltf::Model& model) {
  tinygltf::TinyGLTF parser;
  std::string error;
  std::string warning;
  bool parsed = false;
  try {
    parsed = parser.LoadASCIIFromString(&model, &error, &warning, json.data(),
                                        static_cast<unsigned int>(json.size()), "");
  } catch (const std::exception& thrown) {
    return make_error(ErrorCode::parse, json_fault(error + thrown.what()));
  }
  if (!parsed) {
    return make_error(ErrorCode::parse, error.empty() ? "not a glTF file" : json_fault(error));
  }
  return {};
}

Result<void> parse_bytes(std::span<const unsigned char> bytes, GltfFile& file) {
  Container parts{bytes, std::nullopt};
  if (bytes.size() >= 4 && read_u32(bytes, 0) == kMagic) {
    Result<Container> container = check_container(bytes);
    if (!container) return tl::unexpected(std::move(container.error()));
    parts = *container;
  }
  if (auto nesting = check_nesting(parts.json); !nesting) return nesting;
  std::string_view json(reinterpret_cast<const char*>(parts.json.data()), parts.json.size());
  if (json.starts_with("\xef\xbb\xbf")) json.remove_prefix(3);
  const auto root = json_members(json);
  if (!root) {
    if (json.find_first_not_of(" \t\r\n") == std::string_view::npos ||
        json[json.find_first_not_of(" \t\r\n")] != '{') {
      return make_error(
          ErrorCode::parse,
          "not a glTF file: it begins neither with 'glTF' (.glb) nor with '{' (.gltf)");
    }
    // The parser knows best what is the matter with the text.
    auto parsed = parse_json(std::string(json), file.model);
    if (!parsed) return parsed;
    return make_error(ErrorCode::parse, "not a JSON object");
  }
  if (auto checked = check_version(*root); !checked) return checked;
  if (auto checked = check_extensions(*root); !checked) return checked;
  if (auto parsed = parse_json(without_sources(json, *root), file.model); !parsed) return parsed;
  file.images = std::string(json_member(*root, "images"));
  file.model.buffers.clear();
  const std::filesystem::path parent = file.path.parent_path();
  if (auto loaded = load_buffers(json_member(*root, "buffers"), parts.binary,
                                 parent.empty() ? "." : parent, file.model);
      !loaded) {
    return loaded;
  }
  return decode_meshopt_views(file.model);
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
