// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "emit/image/exr_image.hpp"
#include "output/output_chain.hpp"
#include "support/daemon_process.hpp"

namespace emit::test {

/// Value at a place of an image, px from its top left corner.
using ValueAt = std::function<double(double x_px, double y_px)>;

/// Returns an image of the values at the centres of its pixels.
inline std::vector<float> image_of(const protocol::ImageSize& size, const ValueAt& value_at) {
  std::vector<float> out;
  for (std::uint32_t y = 0; y < size.height_px; ++y) {
    for (std::uint32_t x = 0; x < size.width_px; ++x) {
      out.push_back(static_cast<float>(value_at(x + 0.5, y + 0.5)));
    }
  }
  return out;
}

/// Returns the frame that a chain makes of an image.
inline std::vector<float> made(server::OutputChain& chain, const std::vector<float>& image,
                               const glm::vec2& shift_px = glm::vec2(0.0F)) {
  std::vector<float> out(std::size_t{chain.frame().width_px} * chain.frame().height_px, -1.0F);
  static_cast<void>(chain.apply(image, {shift_px, 0}, out));
  return out;
}

/// Files of the outputs of channels, in a folder of one test.
class OutputFiles {
 public:
  [[nodiscard]] const ScratchFolder& folder() const { return folder_; }
  std::filesystem::path text(const std::string& name, const std::string& content) const {
    return folder_.write(name, content);
  }
  std::filesystem::path exr(const std::string& name, const protocol::ImageSize& size,
                            const std::vector<std::pair<std::string, ValueAt>>& channels) const {
    image::ExrImage exr;
    exr.width_px = size.width_px;
    exr.height_px = size.height_px;
    for (const auto& [channel, value_at] : channels) exr.add(channel, image_of(size, value_at));
    const auto written = image::write_exr(folder_.path() / name, exr);
    EXPECT_TRUE(written.has_value()) << written.error().text;
    return folder_.path() / name;
  }
  /// Writes a distortion map.
  std::filesystem::path map(
      const std::string& name, const protocol::ImageSize& size,
      const std::function<protocol::ImagePoint(double x_px, double y_px)>& source_of) const {
    return exr(name, size,
               {{"x", [&](double x, double y) { return source_of(x, y).x_px; }},
                {"y", [&](double x, double y) { return source_of(x, y).y_px; }}});
  }

 private:
  ScratchFolder folder_;
};

}  // namespace emit::test
