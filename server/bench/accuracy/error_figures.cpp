// SPDX-License-Identifier: Apache-2.0
#include "bench/accuracy/error_figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "emit/image/false_color.hpp"
#include "emit/image/png_image.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {
namespace {

constexpr double kDifferenceK = 3.0;
constexpr std::uint32_t kCaptionPx = 14;

/// Copies `tile` into `sheet` with a caption above.
void place(image::RgbImage& sheet, const image::RgbImage& tile, std::uint32_t x_px,
           std::uint32_t y_px, const std::string& caption) {
  for (std::uint32_t row = 0; row < tile.height_px; ++row) {
    const auto from = tile.rgb.begin() + std::ptrdiff_t{3} * row * tile.width_px;
    std::copy(from, from + std::ptrdiff_t{3} * tile.width_px,
              sheet.rgb.begin() +
                  std::ptrdiff_t{3} *
                      ((std::ptrdiff_t{y_px} + kCaptionPx + row) * sheet.width_px + x_px));
  }
  std::string text = caption;
  std::ranges::transform(text, text.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  image::draw_text(sheet, text, static_cast<std::int32_t>(x_px) + 4,
                   static_cast<std::int32_t>(y_px) + 3, {255, 255, 255});
}

}  // namespace

void ErrorFigures::add(std::string model, std::span<const float> temperature_k) {
  models_.push_back({std::move(model), {temperature_k.begin(), temperature_k.end()}});
}

void ErrorFigures::choose_lines(std::uint32_t& row, std::uint32_t& column) const {
  const auto spread = [this](std::uint32_t first, std::uint32_t step, std::uint32_t count) {
    double low = std::numeric_limits<double>::infinity();
    double high = -low;
    std::uint32_t known = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      const auto value = static_cast<double>(truth_.temperature_k[first + std::size_t{i} * step]);
      if (!std::isfinite(value)) continue;
      ++known;
      low = std::min(low, value);
      high = std::max(high, value);
    }
    // A line that is mostly sky says little.
    return known * 2 < count ? -1.0 : high - low;
  };
  double best = -2.0;
  for (std::uint32_t r = 0; r < truth_.height_px; ++r) {
    const double value = spread(r * truth_.width_px, 1, truth_.width_px);
    if (value > best) {
      best = value;
      row = r;
    }
  }
  best = -2.0;
  for (std::uint32_t c = 0; c < truth_.width_px; ++c) {
    const double value = spread(c, truth_.width_px, truth_.height_px);
    if (value > best) {
      best = value;
      column = c;
    }
  }
}

physics::Result<void> ErrorFigures::write(const std::filesystem::path& directory,
                                          const scene::DisplayOptions& display) const {
  if (auto made = make_directory(directory); !made) return made;
  image::FalseColorOptions colors;
  colors.min_value = display.min_k;
  colors.max_value = display.max_k;
  const auto limits = image::percentile_range(truth_.temperature_k, 0.5, 99.5);
  if (limits && limits->max_value > limits->min_value) {
    colors.min_value = limits->min_value;
    colors.max_value = limits->max_value;
  }
  colors.color_bar = true;
  image::FalseColorOptions difference_colors = colors;
  difference_colors.min_value = -kDifferenceK;
  difference_colors.max_value = kDifferenceK;

  const std::uint32_t tile_width = truth_.width_px + image::kColorBarWidthPx;
  const std::uint32_t tile_height = truth_.height_px + kCaptionPx;
  image::RgbImage sheet;
  sheet.width_px = tile_width * static_cast<std::uint32_t>(1 + models_.size());
  sheet.height_px = 2 * tile_height;
  sheet.rgb.assign(std::size_t{3} * sheet.width_px * sheet.height_px, 24);
  const auto picture =
      image::false_color(truth_.temperature_k, truth_.width_px, truth_.height_px, colors);
  if (!picture) return tl::unexpected(picture.error());
  place(sheet, *picture, 0, 0, scene_ + " - reference");
  for (std::size_t m = 0; m < models_.size(); ++m) {
    const std::uint32_t x_px = tile_width * static_cast<std::uint32_t>(m + 1);
    const auto model =
        image::false_color(models_[m].temperature_k, truth_.width_px, truth_.height_px, colors);
    if (!model) return tl::unexpected(model.error());
    place(sheet, *model, x_px, 0, models_[m].model);
    std::vector<float> difference(truth_.temperature_k.size());
    for (std::size_t i = 0; i < difference.size(); ++i) {
      difference[i] = models_[m].temperature_k[i] - truth_.temperature_k[i];
    }
    const auto delta =
        image::false_color(difference, truth_.width_px, truth_.height_px, difference_colors);
    if (!delta) return tl::unexpected(delta.error());
    place(sheet, *delta, x_px, tile_height, models_[m].model + " - minus reference");
  }
  if (auto written = image::write_png(directory / (scene_ + "_images.png"), sheet); !written) {
    return written;
  }

  std::uint32_t row = 0;
  std::uint32_t column = 0;
  choose_lines(row, column);
  std::vector<Plot> plots;
  for (const bool along_row : {true, false}) {
    Plot plot;
    plot.title = along_row ? fmt::format("{}: row {} of the picture", scene_, row)
                           : fmt::format("{}: column {} of the picture", scene_, column);
    plot.x.label = along_row ? "column, px" : "row, px";
    plot.y.label = "surface temperature, K";
    const auto profile = [&](std::span<const float> values, std::string label, bool emphasis) {
      PlotSeries series{std::move(label), {}, true, false, emphasis};
      const std::uint32_t count = along_row ? truth_.width_px : truth_.height_px;
      for (std::uint32_t i = 0; i < count; ++i) {
        const std::size_t at = along_row ? std::size_t{row} * truth_.width_px + i
                                         : std::size_t{i} * truth_.width_px + column;
        if (!std::isfinite(truth_.temperature_k[at]) || !std::isfinite(values[at])) continue;
        series.points.push_back({static_cast<double>(i), static_cast<double>(values[at]), ""});
      }
      plot.series.push_back(std::move(series));
    };
    profile(truth_.temperature_k, "reference", true);
    for (const ModelImage& model : models_) profile(model.temperature_k, model.model, false);
    plots.push_back(std::move(plot));
  }
  return write_svg(directory / (scene_ + "_profiles.svg"), plots);
}

}  // namespace emit::tool
