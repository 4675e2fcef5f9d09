// SPDX-License-Identifier: Apache-2.0
#include "gltf_image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "gltf_buffers.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr int kMaxSidePx = 8192;

constexpr unsigned char kPngBegin[] = {0x89, 'P', 'N', 'G'};
constexpr unsigned char kJpegBegin[] = {0xff, 0xd8, 0xff};

template <std::size_t N>
bool begins_with(std::span<const unsigned char> bytes, const unsigned char (&begin)[N]) {
  return bytes.size() > N && std::equal(begin, begin + N, bytes.begin());
}

/// Width and height that a PNG file states in its first chunk.
std::pair<std::uint32_t, std::uint32_t> png_size(std::span<const unsigned char> bytes) {
  const auto big_endian = [&](std::size_t at) {
    return (std::uint32_t{bytes[at]} << 24U) | (std::uint32_t{bytes[at + 1]} << 16U) |
           (std::uint32_t{bytes[at + 2]} << 8U) | std::uint32_t{bytes[at + 3]};
  };
  if (bytes.size() < 24) return {0, 0};
  return {big_endian(16), big_endian(20)};
}

/// Width and height that a JPEG file states in the header of its frame.
std::pair<std::uint32_t, std::uint32_t> jpeg_size(std::span<const unsigned char> bytes) {
  const auto word = [&](std::size_t at) {
    return (std::uint32_t{bytes[at]} << 8U) | std::uint32_t{bytes[at + 1]};
  };
  // Segments follow each other, each a marker and its length, after the marker of the beginning.
  for (std::size_t at = 2; at + 9 < bytes.size() && bytes[at] == 0xff;) {
    const unsigned char marker = bytes[at + 1];
    const bool is_frame =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (is_frame) return {word(at + 7), word(at + 5)};
    at += marker == 0xff ? 1 : 2 + word(at + 2);
  }
  return {0, 0};
}

Wrap wrap_of(int mode) {
  if (mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::clamp;
  return mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? Wrap::mirror : Wrap::repeat;
}

double number_of(const tinygltf::Value& object, const char* key, int item, double otherwise) {
  if (!object.IsObject() || !object.Has(key)) return otherwise;
  const tinygltf::Value& value = object.Get(key);
  if (item < 0) return value.IsNumber() ? value.GetNumberAsDouble() : otherwise;
  if (!value.IsArray() || static_cast<std::size_t>(item) >= value.ArrayLen()) return otherwise;
  const tinygltf::Value& entry = value.Get(item);
  return entry.IsNumber() ? entry.GetNumberAsDouble() : otherwise;
}

/// Takes KHR_texture_transform: image = offset + R(rotation) * scale * uv, where the rotation turns
/// u towards -v for positive angles.
void take_transform(const tinygltf::TextureInfo& info, ImageFrame& frame) {
  const auto found = info.extensions.find("KHR_texture_transform");
  if (found == info.extensions.end()) return;
  const tinygltf::Value& object = found->second;
  const double turn = number_of(object, "rotation", -1, 0.0);
  const double scale_u = number_of(object, "scale", 0, 1.0);
  const double scale_v = number_of(object, "scale", 1, 1.0);
  frame.image_from_uv[0] = glm::dvec3(scale_u * std::cos(turn), -scale_u * std::sin(turn), 0.0);
  frame.image_from_uv[1] = glm::dvec3(scale_v * std::sin(turn), scale_v * std::cos(turn), 0.0);
  frame.image_from_uv[2] =
      glm::dvec3(number_of(object, "offset", 0, 0.0), number_of(object, "offset", 1, 0.0), 1.0);
  const double set = number_of(object, "texCoord", -1, static_cast<double>(frame.tex_coord));
  frame.tex_coord = static_cast<int>(std::clamp(set, 0.0, 1e6));
}

}  // namespace

Result<DecodedImage> decode_image(std::span<const unsigned char> bytes) {
  DecodedImage out;
  out.is_jpeg = begins_with(bytes, kJpegBegin);
  if (!out.is_jpeg && !begins_with(bytes, kPngBegin)) {
    return make_error(ErrorCode::unsupported, "it is neither PNG nor JPEG");
  }
  // The size is looked at before the decoder takes memory for it.
  const auto [width, height] = out.is_jpeg ? jpeg_size(bytes) : png_size(bytes);
  if (width > kMaxSidePx || height > kMaxSidePx) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("{} x {} px are more than {} a side", width, height, kMaxSidePx));
  }
  tinygltf::Image image;
  std::string error;
  std::string warning;
  if (width == 0 || height == 0 ||
      !tinygltf::LoadImageData(&image, 0, &error, &warning, 0, 0, bytes.data(),
                               static_cast<int>(bytes.size()), nullptr) ||
      image.width <= 0 || image.height <= 0) {
    return make_error(ErrorCode::parse, "it cannot be decoded");
  }
  const auto pixels =
      static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  const std::size_t bytes_per_value = image.bits == 16 ? 2 : 1;
  if (image.component != 4 || image.image.size() != pixels * 4 * bytes_per_value) {
    return make_error(ErrorCode::unsupported, "its pixels are of an unknown form");
  }
  out.width_px = image.width;
  out.height_px = image.height;
  out.opacity.resize(pixels);
  if (bytes_per_value == 1) {
    out.rgba = std::move(image.image);
    for (std::size_t i = 0; i < pixels; ++i) {
      out.opacity[i] = static_cast<float>(out.rgba[4 * i + 3] / 255.0);
    }
    return out;
  }
  out.rgba.resize(4 * pixels);
  for (std::size_t i = 0; i < 4 * pixels; ++i) {
    std::uint16_t value = 0;
    std::memcpy(&value, image.image.data() + 2 * i, sizeof value);
    out.rgba[i] = static_cast<unsigned char>((value + 128U) / 257U);
    if (i % 4 == 3) out.opacity[i / 4] = static_cast<float>(value / 65535.0);
  }
  return out;
}

Result<DecodedImage> read_image(const GltfFile& file, int index) {
  const auto named = [&](physics::Error error) {
    return tl::unexpected(std::move(error).with_context(fmt::format("image {}", index)));
  };
  const Result<std::vector<unsigned char>> bytes = image_bytes(file, index);
  if (!bytes) return named(bytes.error());
  Result<DecodedImage> image = decode_image(*bytes);
  if (!image) return named(std::move(image.error()));
  return image;
}

Result<DecodedImage> read_image(const std::filesystem::path& path) {
  const auto named = [&](physics::Error error) {
    return tl::unexpected(std::move(error).with_context(path.string()));
  };
  const Result<std::vector<unsigned char>> bytes = read_bytes(path);
  if (!bytes) return named(bytes.error());
  Result<DecodedImage> image = decode_image(*bytes);
  if (!image) return named(std::move(image.error()));
  return image;
}

Result<TextureUse> texture_use(const GltfFile& file, const tinygltf::TextureInfo& info) {
  TextureUse use;
  if (info.index < 0 || static_cast<std::size_t>(info.index) >= file.model.textures.size()) {
    return make_error(ErrorCode::parse, fmt::format("texture {} does not exist", info.index));
  }
  const tinygltf::Texture& texture = file.model.textures[static_cast<std::size_t>(info.index)];
  if (texture.sampler >= 0) {
    if (static_cast<std::size_t>(texture.sampler) >= file.model.samplers.size()) {
      return make_error(ErrorCode::parse,
                        fmt::format("sampler {} does not exist", texture.sampler));
    }
    const auto& sampler = file.model.samplers[static_cast<std::size_t>(texture.sampler)];
    use.frame.wrap_u = wrap_of(sampler.wrapS);
    use.frame.wrap_v = wrap_of(sampler.wrapT);
  }
  use.frame.tex_coord = info.texCoord;
  take_transform(info, use.frame);
  use.image = texture.source;
  if (use.image < 0) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("texture {} has no image as PNG or JPEG", info.index));
  }
  return use;
}

}  // namespace emit::scene
