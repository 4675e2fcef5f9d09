// SPDX-License-Identifier: Apache-2.0
#include "alpha_mask.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>
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

Wrap wrap_of(int mode) {
  if (mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::clamp;
  return mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? Wrap::mirror : Wrap::repeat;
}

/// Takes the opacity of an image with four values a pixel.
Result<void> take_alpha(const tinygltf::Image& image, double factor, AlphaMask& mask) {
  const auto pixels =
      static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  const std::size_t bytes_per_value = image.bits == 16 ? 2 : 1;
  if (image.component != 4 || image.image.size() != pixels * 4 * bytes_per_value) {
    return make_error(ErrorCode::unsupported, "its pixels are of an unknown form");
  }
  mask.width_px = image.width;
  mask.height_px = image.height;
  mask.alpha.resize(pixels);
  mask.one_colour = true;
  const std::size_t colour_bytes = 3 * bytes_per_value;
  for (std::size_t i = 0; i < pixels; ++i) {
    double value = image.image[4 * i + 3] / 255.0;
    if (bytes_per_value == 2) {
      std::uint16_t word = 0;
      std::memcpy(&word, image.image.data() + 8 * i + 6, sizeof word);
      value = word / 65535.0;
    }
    mask.alpha[i] = static_cast<float>(value * factor);
    mask.one_colour = mask.one_colour &&
                      std::memcmp(image.image.data(), image.image.data() + 4 * bytes_per_value * i,
                                  colour_bytes) == 0;
  }
  return {};
}

/// The same opacity everywhere.
void take_plain(double opacity, AlphaMask& mask) {
  mask.width_px = mask.height_px = 1;
  mask.alpha = {static_cast<float>(opacity)};
  mask.wrap_u = mask.wrap_v = Wrap::clamp;
}

Result<void> read_image(const GltfFile& file, int index, double factor, AlphaMask& mask) {
  const Result<std::vector<unsigned char>> bytes = image_bytes(file, index);
  if (!bytes) return tl::unexpected(bytes.error());
  if (begins_with(*bytes, kJpegBegin)) {
    take_plain(factor, mask);  // JPEG has no opacity.
    return {};
  }
  if (!begins_with(*bytes, kPngBegin)) {
    return make_error(ErrorCode::unsupported, "it is neither PNG nor JPEG");
  }
  // The size is looked at before the decoder takes memory for it.
  const auto [width, height] = png_size(*bytes);
  if (width > kMaxSidePx || height > kMaxSidePx) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("{} x {} px are more than {} a side", width, height, kMaxSidePx));
  }
  tinygltf::Image image;
  std::string error;
  std::string warning;
  if (!tinygltf::LoadImageData(&image, index, &error, &warning, 0, 0, bytes->data(),
                               static_cast<int>(bytes->size()), nullptr) ||
      image.width <= 0 || image.height <= 0) {
    return make_error(ErrorCode::parse, "it cannot be decoded");
  }
  return take_alpha(image, factor, mask);
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
void take_transform(const tinygltf::TextureInfo& info, AlphaMask& mask) {
  const auto found = info.extensions.find("KHR_texture_transform");
  if (found == info.extensions.end()) return;
  const tinygltf::Value& object = found->second;
  const double turn = number_of(object, "rotation", -1, 0.0);
  const double scale_u = number_of(object, "scale", 0, 1.0);
  const double scale_v = number_of(object, "scale", 1, 1.0);
  mask.image_from_uv[0] = glm::dvec3(scale_u * std::cos(turn), -scale_u * std::sin(turn), 0.0);
  mask.image_from_uv[1] = glm::dvec3(scale_v * std::sin(turn), scale_v * std::cos(turn), 0.0);
  mask.image_from_uv[2] =
      glm::dvec3(number_of(object, "offset", 0, 0.0), number_of(object, "offset", 1, 0.0), 1.0);
  const double set = number_of(object, "texCoord", -1, static_cast<double>(mask.tex_coord));
  mask.tex_coord = static_cast<int>(std::clamp(set, 0.0, 1e6));
}

/// The same place of the image near its first copy, so that it fits into an int.
double near_first(double px, int size, Wrap wrap) {
  const double period = wrap == Wrap::mirror ? 2.0 * size : static_cast<double>(size);
  if (wrap == Wrap::clamp) return std::clamp(px, 0.0, period);
  return px - std::floor(px / period) * period;
}

int wrapped(int i, int size, Wrap wrap) {
  if (wrap == Wrap::clamp) return std::clamp(i, 0, size - 1);
  const int period = wrap == Wrap::mirror ? 2 * size : size;
  i = ((i % period) + period) % period;
  return i < size ? i : period - 1 - i;
}

}  // namespace

double alpha_at(const AlphaMask& mask, double x_px, double y_px) {
  x_px = near_first(x_px, mask.width_px, mask.wrap_u);
  y_px = near_first(y_px, mask.height_px, mask.wrap_v);
  const double left = std::floor(x_px - 0.5);
  const double top = std::floor(y_px - 0.5);
  const double right_share = x_px - 0.5 - left;
  const double lower_share = y_px - 0.5 - top;
  const auto value = [&](int dx, int dy) {
    return static_cast<double>(
        mask.at(wrapped(static_cast<int>(left) + dx, mask.width_px, mask.wrap_u),
                wrapped(static_cast<int>(top) + dy, mask.height_px, mask.wrap_v)));
  };
  return std::lerp(std::lerp(value(0, 0), value(1, 0), right_share),
                   std::lerp(value(0, 1), value(1, 1), right_share), lower_share);
}

Result<std::optional<AlphaMask>> read_alpha_mask(const GltfFile& file, int material) {
  const tinygltf::Material& source = file.model.materials[static_cast<std::size_t>(material)];
  if (source.alphaMode != "MASK") return std::optional<AlphaMask>{};
  const auto& pbr = source.pbrMetallicRoughness;
  const double factor = pbr.baseColorFactor.size() == 4 ? pbr.baseColorFactor[3] : 1.0;
  AlphaMask mask;
  mask.cutoff = static_cast<float>(source.alphaCutoff);
  const tinygltf::TextureInfo& info = pbr.baseColorTexture;
  if (info.index < 0) {
    take_plain(factor, mask);
    return std::optional<AlphaMask>(std::move(mask));
  }
  if (static_cast<std::size_t>(info.index) >= file.model.textures.size()) {
    return make_error(ErrorCode::parse, fmt::format("texture {} does not exist", info.index));
  }
  const tinygltf::Texture& texture = file.model.textures[static_cast<std::size_t>(info.index)];
  if (texture.sampler >= 0) {
    if (static_cast<std::size_t>(texture.sampler) >= file.model.samplers.size()) {
      return make_error(ErrorCode::parse,
                        fmt::format("sampler {} does not exist", texture.sampler));
    }
    const auto& sampler = file.model.samplers[static_cast<std::size_t>(texture.sampler)];
    mask.wrap_u = wrap_of(sampler.wrapS);
    mask.wrap_v = wrap_of(sampler.wrapT);
  }
  mask.tex_coord = info.texCoord;
  take_transform(info, mask);
  if (texture.source < 0) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("texture {} has no image as PNG or JPEG", info.index));
  }
  if (auto read = read_image(file, texture.source, factor, mask); !read) {
    return tl::unexpected(
        std::move(read.error()).with_context(fmt::format("image {}", texture.source)));
  }
  return std::optional<AlphaMask>(std::move(mask));
}

}  // namespace emit::scene
