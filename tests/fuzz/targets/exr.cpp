// SPDX-License-Identifier: Apache-2.0
// Fuzz target: OpenEXR images and the frame metadata in them.
#include "emit/image/exr_image.hpp"
#include "fuzz/fuzz_input.hpp"
#include "fuzz/memory_file.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  const auto image = image::read_exr(fuzz::file_of(fuzz::as_bytes(data, size)));
  if (!image) return 0;
  for (const image::ExrChannel& channel : image->channels) {
    fuzz::require(channel.pixels.size() == std::size_t{image->width_px} * image->height_px,
                  "every plane has the size of the image");
  }
  static_cast<void>(image::frame_metadata(*image));
  return 0;
}
