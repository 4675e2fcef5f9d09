// SPDX-License-Identifier: Apache-2.0
#include "gltf_buffers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>
#include <string>
#include <utility>

#include "gltf_meshopt.hpp"
#include "json_text.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;
using Bytes = std::vector<unsigned char>;

constexpr std::size_t kMaxShownUri = 120;

std::string shown(std::string_view uri) {
  return uri.size() <= kMaxShownUri ? std::string(uri)
                                    : std::string(uri.substr(0, kMaxShownUri)) + "...";
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

/// Resolves %20 and its kind. A percent sign without two digits stays: exporters forget to escape.
std::string percent_decoded(std::string_view uri) {
  std::string out;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const int high = uri[i] == '%' && i + 2 < uri.size() ? hex_digit(uri[i + 1]) : -1;
    const int low = high >= 0 ? hex_digit(uri[i + 2]) : -1;
    if (low >= 0) {
      out += static_cast<char>(high * 16 + low);
      i += 2;
    } else {
      out += uri[i];
    }
  }
  return out;
}

Result<Bytes> decode_data_uri(const std::string& uri) {
  const std::size_t comma = uri.find(',');
  constexpr std::string_view kBase64 = ";base64";
  if (comma == std::string::npos || comma < kBase64.size() ||
      uri.compare(comma - kBase64.size(), kBase64.size(), kBase64) != 0) {
    return make_error(ErrorCode::parse, "the data URI is not base64");
  }
  // The parser's decoder takes only some media types; the type says nothing about a buffer.
  Bytes bytes;
  std::string media_type;
  if (!tinygltf::DecodeDataURI(&bytes, media_type,
                               "data:application/octet-stream;base64" + uri.substr(comma), 0,
                               false)) {
    return make_error(ErrorCode::parse, "the data URI cannot be decoded");
  }
  return bytes;
}

/// A file beside the model. Exporters write its name with and without escapes, and with the other
/// kind of slash.
Result<Bytes> read_external(const std::string& uri, const std::filesystem::path& folder) {
  if (uri.find("://") != std::string::npos) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("'{}' is not a file beside the model", shown(uri)));
  }
  std::string slashes = percent_decoded(uri);
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  std::error_code status;
  for (const std::string& name : {percent_decoded(uri), uri, slashes}) {
    if (!std::filesystem::is_regular_file(folder / name, status)) continue;
    auto bytes = read_bytes(folder / name);
    if (!bytes) return tl::unexpected(std::move(bytes.error()).with_context(shown(name)));
    return bytes;
  }
  return make_error(ErrorCode::not_found, fmt::format("{}: no such file", shown(uri)));
}

/// Compressed views have their data elsewhere; their own buffer need not exist.
bool is_fallback(const std::vector<JsonMember>& buffer) {
  const auto extensions = json_members(json_member(buffer, "extensions"));
  if (!extensions) return false;
  return std::ranges::any_of(kMeshoptExtensions, [&](std::string_view name) {
    const auto extension = json_members(json_member(*extensions, name));
    return extension && json_member(*extension, "fallback") == "true";
  });
}

Result<Bytes> load_buffer(std::string_view text,
                          std::optional<std::span<const unsigned char>> chunk,
                          const std::filesystem::path& folder) {
  const auto buffer = json_members(text);
  if (!buffer) return make_error(ErrorCode::parse, "not an object");
  const auto length = json_unsigned(json_member(*buffer, "byteLength"));
  if (!length) return make_error(ErrorCode::parse, "byteLength is missing or not a size");
  const std::string_view uri_text = json_member(*buffer, "uri");
  Bytes bytes;
  std::string source = "the binary chunk";
  if (uri_text.empty()) {
    if (!chunk) {
      if (is_fallback(*buffer)) return bytes;
      return make_error(ErrorCode::parse, "it has no uri, and the file has no binary chunk for it");
    }
    if (*length <= chunk->size()) {
      return Bytes(chunk->begin(), chunk->begin() + static_cast<std::ptrdiff_t>(*length));
    }
    bytes.assign(chunk->begin(), chunk->end());
  } else {
    const auto uri = json_string(uri_text);
    if (!uri) return make_error(ErrorCode::parse, "uri is not a text");
    const bool embedded = uri->starts_with("data:");
    source = embedded ? "the data URI" : "'" + shown(*uri) + "'";
    Result<Bytes> loaded = embedded ? decode_data_uri(*uri) : read_external(*uri, folder);
    if (!loaded) return loaded;
    bytes = std::move(*loaded);
  }
  if (bytes.size() < *length) {
    return make_error(ErrorCode::parse,
                      fmt::format("byteLength is {}, but {} has {} bytes: truncated?", *length,
                                  source, bytes.size()));
  }
  bytes.resize(static_cast<std::size_t>(*length));
  return bytes;
}

Result<Bytes> bytes_of_view(const tinygltf::Model& model, std::uint64_t index) {
  if (index >= model.bufferViews.size()) {
    return make_error(ErrorCode::parse, fmt::format("bufferView {} does not exist", index));
  }
  const tinygltf::BufferView& view = model.bufferViews[index];
  if (view.buffer < 0 || static_cast<std::size_t>(view.buffer) >= model.buffers.size()) {
    return make_error(ErrorCode::parse,
                      fmt::format("bufferView {}: buffer {} does not exist", index, view.buffer));
  }
  const Bytes& data = model.buffers[static_cast<std::size_t>(view.buffer)].data;
  if (view.byteOffset > data.size() || view.byteLength > data.size() - view.byteOffset) {
    return make_error(ErrorCode::parse,
                      fmt::format("bufferView {} exceeds buffer {}", index, view.buffer));
  }
  const auto first = data.begin() + static_cast<std::ptrdiff_t>(view.byteOffset);
  return Bytes(first, first + static_cast<std::ptrdiff_t>(view.byteLength));
}

}  // namespace

Result<Bytes> image_bytes(const GltfFile& file, int index) {
  const auto images = json_items(file.images);
  if (!images || index < 0 || static_cast<std::size_t>(index) >= images->size()) {
    return make_error(ErrorCode::parse, "it does not exist");
  }
  const auto image = json_members((*images)[static_cast<std::size_t>(index)]);
  if (!image) return make_error(ErrorCode::parse, "not an object");
  if (const auto view = json_unsigned(json_member(*image, "bufferView"))) {
    return bytes_of_view(file.model, *view);
  }
  const auto uri = json_string(json_member(*image, "uri"));
  if (!uri) return make_error(ErrorCode::parse, "it has neither uri nor bufferView");
  if (uri->starts_with("data:")) return decode_data_uri(*uri);
  const std::filesystem::path parent = file.path.parent_path();
  return read_external(*uri, parent.empty() ? "." : parent);
}

Result<Bytes> read_bytes(const std::filesystem::path& path) {
  std::error_code status;
  if (!std::filesystem::is_regular_file(path, status)) {
    return make_error(ErrorCode::not_found, "no such file");
  }
  const std::uintmax_t size = std::filesystem::file_size(path, status);
  if (status || size > std::numeric_limits<std::uint32_t>::max()) {
    return make_error(ErrorCode::unsupported, "files of 4 GiB and more are not read");
  }
  std::ifstream stream(path, std::ios::binary);
  Bytes bytes(static_cast<std::size_t>(size));
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (!stream || stream.gcount() != static_cast<std::streamsize>(size)) {
    return make_error(ErrorCode::io, "reading failed");
  }
  return bytes;
}

Result<void> load_buffers(std::string_view list,
                          std::optional<std::span<const unsigned char>> chunk,
                          const std::filesystem::path& folder, tinygltf::Model& model) {
  if (list.empty()) return {};
  const auto buffers = json_items(list);
  if (!buffers) return make_error(ErrorCode::parse, "buffers: not an array");
  for (std::size_t i = 0; i < buffers->size(); ++i) {
    // Only the first buffer may be the binary chunk.
    Result<Bytes> bytes = load_buffer((*buffers)[i], i == 0 ? chunk : std::nullopt, folder);
    if (!bytes) {
      return tl::unexpected(std::move(bytes.error()).with_context(fmt::format("buffer {}", i)));
    }
    model.buffers.emplace_back().data = std::move(*bytes);
  }
  return {};
}

}  // namespace emit::scene
