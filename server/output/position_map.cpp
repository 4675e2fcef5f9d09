// SPDX-License-Identifier: Apache-2.0
#include "output/position_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "emit/image/exr_image.hpp"
#include "emit/physics/check.hpp"
#include "output/sample_row.hpp"
#include "output/wide.hpp"

namespace emit::server {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;
using protocol::ImagePoint;
using protocol::ImageSize;

namespace {

bool shows(const ImagePoint& point, const ImageSize& picture) noexcept {
  // A point that is not a number fails all of these.
  return point.x_px >= 0.0 && point.y_px >= 0.0 && point.x_px <= picture.width_px &&
         point.y_px <= picture.height_px;
}

}  // namespace

PositionMap::Source PositionMap::identity(const ImageSize& picture) {
  Source out{picture, {}};
  out.points.reserve(std::size_t{picture.width_px} * picture.height_px);
  for (std::uint32_t row = 0; row < picture.height_px; ++row) {
    for (std::uint32_t column = 0; column < picture.width_px; ++column) {
      out.points.push_back({column + 0.5, row + 0.5});
    }
  }
  return out;
}

Result<PositionMap::Source> PositionMap::read(const std::filesystem::path& file,
                                              const ImageSize& picture) {
  const auto map = image::read_exr(file);
  if (!map) return tl::unexpected(map.error());
  const image::ExrChannel* x = map->find("x");
  const image::ExrChannel* y = map->find("y");
  if (x == nullptr || y == nullptr) {
    return make_error(ErrorCode::config,
                      fmt::format("{}: channel '{}' is missing; a distortion map has 'x' and 'y', "
                                  "in pixels",
                                  file.string(), x == nullptr ? "x" : "y"));
  }
  Source out{{map->width_px, map->height_px}, {}};
  out.points.reserve(x->pixels.size());
  for (std::size_t i = 0; i < x->pixels.size(); ++i) {
    out.points.push_back({x->pixels[i], y->pixels[i]});
  }
  const auto within = [&](const ImagePoint& point) { return shows(point, picture); };
  if (std::none_of(out.points.begin(), out.points.end(), within)) {
    return make_error(ErrorCode::config,
                      fmt::format("{}: no pixel points into the picture of {} x {}", file.string(),
                                  picture.width_px, picture.height_px));
  }
  return out;
}

PositionMap::Source PositionMap::brown(const ImageSize& picture, double focal_px,
                                       const std::array<double, 3>& radial,
                                       const std::array<double, 2>& tangential) {
  const double centre_x_px = 0.5 * picture.width_px;
  const double centre_y_px = 0.5 * picture.height_px;
  const auto [p1, p2] = tangential;
  Source out = identity(picture);
  for (ImagePoint& point : out.points) {
    const double x = (point.x_px - centre_x_px) / focal_px;
    const double y = (point.y_px - centre_y_px) / focal_px;
    const double r2 = x * x + y * y;
    const double scale = 1.0 + r2 * (radial[0] + r2 * (radial[1] + r2 * radial[2]));
    point.x_px = centre_x_px + focal_px * (x * scale + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x));
    point.y_px = centre_y_px + focal_px * (y * scale + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y);
  }
  return out;
}

PositionMap::PositionMap(const Source& source, std::uint16_t output_steps, const ImageSize& window,
                         const ImagePoint& window_at, const SampledPart& part,
                         float outside_w_m2_sr)
    : frame_(source.frame), part_(part), outside_w_m2_sr_(outside_w_m2_sr) {
  constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();
  const ImageSize picture = protocol::turned_size(output_steps, window);
  x_px_.reserve(source.points.size());
  y_px_.reserve(source.points.size());
  for (const ImagePoint& point : source.points) {
    if (!shows(point, picture)) {
      ++outside_px_;
      x_px_.push_back(kNowhere);
      y_px_.push_back(kNowhere);
      continue;
    }
    const ImagePoint at = protocol::window_point(output_steps, window, point);
    x_px_.push_back(static_cast<float>(window_at.x_px + at.x_px - 0.5));
    y_px_.push_back(static_cast<float>(window_at.y_px + at.y_px - 0.5));
  }
}

void PositionMap::sample_line(std::span<const float> image, const glm::vec2& shift_px,
                              std::uint32_t row, std::span<float> line) const noexcept {
  EMIT_DCHECK_OP(line.size(), ==, std::size_t{frame_.width_px});
  const std::size_t at = std::size_t{row} * frame_.width_px;
  const SampledRow sampled{x_px_.data() + at,
                           y_px_.data() + at,
                           shift_px,
                           image.data() + part_.first,
                           static_cast<std::int32_t>(part_.pitch_px),
                           static_cast<std::int32_t>(part_.size.width_px) - 1,
                           static_cast<std::int32_t>(part_.size.height_px) - 1,
                           outside_w_m2_sr_};
  if (has_wide()) {
    sample_row_wide(sampled, line);
  } else {
    sample_row_plain(sampled, line);
  }
}

}  // namespace emit::server
