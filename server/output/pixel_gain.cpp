// SPDX-License-Identifier: Apache-2.0
#include "output/pixel_gain.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "emit/image/exr_image.hpp"

namespace emit::server {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

Result<PixelGain> PixelGain::read(const std::filesystem::path& file,
                                  const protocol::ImageSize& frame) {
  auto map = image::read_exr(file);
  if (!map) return tl::unexpected(std::move(map.error()));
  if (map->width_px != frame.width_px || map->height_px != frame.height_px) {
    return make_error(
        ErrorCode::config,
        fmt::format("{}: {} x {} pixels, but the frames of the channel have {} x {}", file.string(),
                    map->width_px, map->height_px, frame.width_px, frame.height_px));
  }
  PixelGain out;
  for (const auto& [name, values] :
       {std::pair{"gain", &out.gain_}, std::pair{"offset", &out.offset_w_m2_sr_}}) {
    const image::ExrChannel* channel = map->find(name);
    if (channel == nullptr) {
      return make_error(ErrorCode::config,
                        fmt::format("{}: channel '{}' is missing; a correction of non-uniformity "
                                    "has 'gain' and 'offset'",
                                    file.string(), name));
    }
    *values = channel->pixels;
    const bool is_gain = values == &out.gain_;
    const auto bad = std::find_if(values->begin(), values->end(), [&](float value) {
      return !std::isfinite(value) || (is_gain && value < 0.0F);
    });
    if (bad != values->end()) {
      const auto at = static_cast<std::uint32_t>(bad - values->begin());
      return make_error(ErrorCode::config,
                        fmt::format("{}: '{}' is {} at column {}, row {}; it must be {}",
                                    file.string(), name, *bad, at % frame.width_px,
                                    at / frame.width_px, is_gain ? "0 or more" : "finite"));
    }
  }
  return out;
}

void PixelGain::apply_line(std::uint32_t row, std::span<float> line) const noexcept {
  const std::size_t at = std::size_t{row} * line.size();
  const float* const gain = gain_.data() + at;
  const float* const offset = offset_w_m2_sr_.data() + at;
  for (std::size_t i = 0; i < line.size(); ++i) line[i] = gain[i] * line[i] + offset[i];
}

}  // namespace emit::server
