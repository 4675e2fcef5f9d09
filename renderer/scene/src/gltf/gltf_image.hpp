// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "../cut/image_frame.hpp"
#include "gltf_file.hpp"

namespace emit::scene {

/// A decoded image.
struct DecodedImage {
  int width_px = 0;
  int height_px = 0;
  std::vector<unsigned char> rgba;  ///< red, green, blue, opacity of sRGB, row by row from v = 0
  std::vector<float> opacity;       ///< 0 to 1, with all bits of the file
  bool is_jpeg = false;
};

/// Decodes an image. Errors: parse, unsupported (neither PNG nor JPEG, more than 8192 px a side).
[[nodiscard]] physics::Result<DecodedImage> decode_image(std::span<const unsigned char> bytes);
/// An image of a glTF file. Errors name it: not_found, io, parse, unsupported.
[[nodiscard]] physics::Result<DecodedImage> read_image(const GltfFile& file, int index);
/// An image file. Errors name it: not_found, io, parse, unsupported.
[[nodiscard]] physics::Result<DecodedImage> read_image(const std::filesystem::path& path);

/// A texture as a surface uses it: sampler, KHR_texture_transform and number of its image. The
/// frame has no size yet.
struct TextureUse {
  ImageFrame frame;
  int image = -1;
};
/// Errors: parse, unsupported (no image as PNG or JPEG).
[[nodiscard]] physics::Result<TextureUse> texture_use(const GltfFile& file,
                                                      const tinygltf::TextureInfo& info);

}  // namespace emit::scene
