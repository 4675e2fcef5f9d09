// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "renderer/scene/gltf_builder.hpp"

// The library's own code is not held to the warnings of this project.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpragmas"
#pragma GCC diagnostic ignored "-Wold-style-cast"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wcast-qual"
#define STB_IMAGE_WRITE_STATIC
#define STB_IMAGE_WRITE_IMPLEMENTATION
#include <stb_image_write.h>
#pragma GCC diagnostic pop

namespace emit::test {

/// A PNG file of red, green, blue and opacity of each texel, row by row.
inline std::string png_of(int width_px, int height_px, const std::string& rgba) {
  std::string out;
  stbi_write_png_to_func(
      [](void* text, void* data, int size) {
        static_cast<std::string*>(text)->append(static_cast<const char*>(data),
                                                static_cast<std::size_t>(size));
      },
      &out, width_px, height_px, 4, rgba.data(), 4 * width_px);
  return out;
}

/// JSON of an image inside a glTF file.
inline std::string embedded_png(const std::string& png) {
  return R"({"uri":"data:image/png;base64,)" + base64(png) + R"("})";
}

/// A square of 1 m in the plane z = 0 with uv = (x, 1 - y) times `repeats`, and its image.
struct Card {
  double repeats = 1.0;
  int wrap = 10497;
  std::string texture_extension;  ///< members of baseColorTexture, each begun with a comma
  std::string material = R"("alphaMode":"MASK")";
  std::string factor;
  bool has_uv = true;

  [[nodiscard]] std::string json(const std::string& image) const {
    GltfText text;
    const auto r = static_cast<float>(repeats);
    text.buffer = packed<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}) +
                  packed<float>({0, r, r, r, r, 0, 0, 0}) +
                  packed<std::uint16_t>({0, 1, 2, 0, 2, 3});
    text.views = R"({"buffer":0,"byteOffset":0,"byteLength":48},
                    {"buffer":0,"byteOffset":48,"byteLength":32},
                    {"buffer":0,"byteOffset":80,"byteLength":12})";
    text.accessors = R"({"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},
                        {"bufferView":1,"componentType":5126,"count":4,"type":"VEC2"},
                        {"bufferView":2,"componentType":5123,"count":6,"type":"SCALAR"})";
    text.primitive = std::string(R"({"attributes":{"POSITION":0)") +
                     (has_uv ? R"(,"TEXCOORD_0":1)" : "") + R"(},"indices":2,"material":0})";
    text.materials = R"({"name":"leaf",)" + material + R"(,"pbrMetallicRoughness":{)" + factor +
                     R"("baseColorTexture":{"index":0)" + texture_extension + "}}}";
    text.extra = R"("textures":[{"source":0,"sampler":0}],"samplers":[{"wrapS":)" +
                 std::to_string(wrap) + R"(,"wrapT":)" + std::to_string(wrap) + R"(}],"images":[)" +
                 image + "],";
    return text.json();
  }
};

}  // namespace emit::test
