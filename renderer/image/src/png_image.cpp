// SPDX-License-Identifier: Apache-2.0
#include "emit/image/png_image.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <memory>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wsign-conversion"
#pragma GCC diagnostic ignored "-Wold-style-cast"
#pragma GCC diagnostic ignored "-Wuseless-cast"
#pragma GCC diagnostic ignored "-Wnull-dereference"
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#define STBI_WRITE_NO_STDIO
#include <stb_image_write.h>
#pragma GCC diagnostic pop

namespace emit::image {
namespace {

struct FileSink {
  std::FILE* file = nullptr;
  bool failed = false;
};

void append(void* context, void* data, int size) {
  auto* sink = static_cast<FileSink*>(context);
  const auto length = static_cast<std::size_t>(size);
  sink->failed = sink->failed || std::fwrite(data, 1, length, sink->file) != length;
}

}  // namespace

physics::Result<void> write_png(const std::filesystem::path& file, const RgbImage& image) {
  constexpr std::uint32_t kMaxSidePx = 1U << 15U;
  if (image.width_px == 0 || image.height_px == 0 || image.width_px > kMaxSidePx ||
      image.height_px > kMaxSidePx ||
      image.rgb.size() != std::size_t{3} * image.width_px * image.height_px) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               fmt::format("{}: picture of {}x{} with {} bytes", file.string(),
                                           image.width_px, image.height_px, image.rgb.size()));
  }
  FileSink sink{std::fopen(file.c_str(), "wb")};
  if (sink.file == nullptr) {
    return physics::make_error(physics::ErrorCode::io,
                               fmt::format("{}: {}", file.string(), std::strerror(errno)));
  }
  const int width = static_cast<int>(image.width_px);
  const int written = stbi_write_png_to_func(
      append, &sink, width, static_cast<int>(image.height_px), 3, image.rgb.data(), width * 3);
  const bool closed = std::fclose(sink.file) == 0;
  if (written == 0 || sink.failed || !closed) {
    return physics::make_error(physics::ErrorCode::io,
                               fmt::format("{}: writing the PNG failed", file.string()));
  }
  return {};
}

}  // namespace emit::image
