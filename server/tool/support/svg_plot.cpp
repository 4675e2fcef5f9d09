// SPDX-License-Identifier: Apache-2.0
#include "tool/support/svg_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>

namespace emit::tool {
namespace {

constexpr double kWidth = 560.0;
constexpr double kHeight = 420.0;
constexpr double kLeft = 68.0;
constexpr double kRight = 16.0;
constexpr double kTop = 34.0;
constexpr double kBottom = 58.0;
constexpr double kLegendLine = 15.0;

/// Palette of Okabe and Ito, whose colours differ for any colour vision, and a grey.
constexpr std::array<const char*, 8> kColors{"#0072b2", "#e69f00", "#009e73", "#cc79a7",
                                             "#56b4e9", "#d55e00", "#8c6d1f", "#808080"};

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

/// Maps values to pixels and knows where its ticks stand.
class Scale {
 public:
  Scale(PlotScale kind, double from_px, double to_px)
      : kind_(kind), from_px_(from_px), to_px_(to_px) {}

  [[nodiscard]] bool shows(double value) const {
    return std::isfinite(value) && (kind_ == PlotScale::linear || value > 0.0);
  }
  void include(double value) {
    if (!shows(value)) return;
    low_ = std::min(low_, inner(value));
    high_ = std::max(high_, inner(value));
  }
  void settle() {
    if (!(low_ <= high_)) {
      low_ = kind_ == PlotScale::linear ? 0.0 : -1.0;
      high_ = 1.0;
    }
    // Values that hardly differ get room, so that the labels of the axis differ too.
    const double largest = std::max({std::abs(low_), std::abs(high_), 1e-8});
    const double margin =
        std::max(0.04 * (high_ - low_), kind_ == PlotScale::linear ? 1e-3 * largest : 0.05);
    low_ -= margin;
    high_ += margin;
  }
  [[nodiscard]] double px(double value) const {
    return from_px_ + (inner(value) - low_) / (high_ - low_) * (to_px_ - from_px_);
  }

  struct Tick {
    double value = 0.0;
    bool labelled = true;
  };
  [[nodiscard]] std::vector<Tick> ticks() const {
    std::vector<Tick> ticks;
    if (kind_ == PlotScale::logarithmic) {
      const bool dense = high_ - low_ < 1.3;
      for (int decade = static_cast<int>(std::floor(low_));
           decade <= static_cast<int>(std::ceil(high_)); ++decade) {
        for (const int digit : {1, 2, 3, 4, 5, 6, 7, 8, 9}) {
          const double value = digit * std::pow(10.0, decade);
          const double at = std::log10(value);
          if (at < low_ || at > high_) continue;
          ticks.push_back({value, digit == 1 || (dense && (digit == 2 || digit == 5))});
        }
      }
      return ticks;
    }
    const double rough = (high_ - low_) / 6.0;
    const double decade = std::pow(10.0, std::floor(std::log10(rough)));
    double step = decade;
    for (const double factor : {2.0, 5.0, 10.0}) {
      if (step < rough) step = factor * decade;
    }
    for (double value = std::ceil(low_ / step) * step; value <= high_; value += step) {
      ticks.push_back({std::abs(value) < 1e-9 * step ? 0.0 : value, true});
    }
    return ticks;
  }

 private:
  [[nodiscard]] double inner(double value) const {
    return kind_ == PlotScale::linear ? value : std::log10(value);
  }
  PlotScale kind_;
  double from_px_;
  double to_px_;
  double low_ = std::numeric_limits<double>::infinity();
  double high_ = -std::numeric_limits<double>::infinity();
};

class PlotWriter {
 public:
  PlotWriter(const Plot& plot, std::string& out)
      : plot_(plot),
        out_(out),
        x_(plot.x.scale, kLeft, kWidth - kRight),
        y_(plot.y.scale, kHeight - kBottom, kTop) {
    for (const PlotSeries& series : plot.series) {
      for (const PlotPoint& point : series.points) {
        if (!x_.shows(point.x) || !y_.shows(point.y)) {
          ++left_out_;
          continue;
        }
        x_.include(point.x);
        y_.include(point.y);
        if (point.range) {
          y_.include(point.range->low);
          y_.include(point.range->high);
        }
      }
    }
    if (!plot.x.names.empty()) {
      // Half a place on the left, and room for the legend on the right.
      constexpr double kLegendShare = 0.4;
      const auto count = static_cast<double>(plot.x.names.size());
      x_.include(0.5);
      x_.include((1.0 + kLegendShare) * count + 0.5);
    }
    x_.settle();
    y_.settle();
  }

  void write() {
    write_frame();
    std::size_t color = 0;
    const Corner corner = emptiest_corner();
    double legend_y = corner.top ? kTop + 16.0 : kHeight - kBottom + 6.0 - legend_height();
    for (const PlotSeries& series : plot_.series) {
      // Lines beyond the palette have the same colours and the other kind of line.
      const bool again = !series.emphasis && color / kColors.size() % 2 == 1;
      const bool dashed = series.dashed != again;
      const std::string ink = series.emphasis ? "#111111" : kColors[color++ % kColors.size()];
      write_series(series, ink, dashed);
      if (series.label.empty()) continue;
      // A white rim keeps the text legible over lines.
      append(R"(<circle cx="{:.1f}" cy="{:.1f}" r="4" fill="{}" stroke="{}"/>)",
             corner.left ? kLeft + 10.0 : kWidth - kRight - 10.0, legend_y - 4.0,
             dashed ? "#fff" : ink, ink);
      append(R"(<text x="{:.1f}" y="{:.1f}" text-anchor="{}" class="legend">{}</text>)",
             corner.left ? kLeft + 20.0 : kWidth - kRight - 20.0, legend_y,
             corner.left ? "start" : "end", escaped(series.label));
      legend_y += kLegendLine;
    }
    if (left_out_ > 0) {
      append(R"(<text x="{}" y="{}" class="note">{} points have no place on these axes</text>)",
             kLeft, kHeight - 6.0, left_out_);
    }
  }

 private:
  struct Corner {
    bool left = false;
    bool top = true;
  };
  [[nodiscard]] double legend_height() const {
    const auto named = std::ranges::count_if(
        plot_.series, [](const PlotSeries& series) { return !series.label.empty(); });
    return kLegendLine * static_cast<double>(named);
  }
  /// Returns the corner in which the legend hides the fewest points; the first of equals.
  [[nodiscard]] Corner emptiest_corner() const {
    constexpr double kCharPx = 6.5;
    std::size_t longest = 0;
    for (const PlotSeries& series : plot_.series) longest = std::max(longest, series.label.size());
    const double width = 32.0 + kCharPx * static_cast<double>(longest);
    const double height = legend_height() + 8.0;
    Corner best;
    std::size_t fewest = std::numeric_limits<std::size_t>::max();
    for (const Corner corner :
         {Corner{false, true}, Corner{true, true}, Corner{false, false}, Corner{true, false}}) {
      std::size_t hidden = 0;
      for (const PlotSeries& series : plot_.series) {
        for (const PlotPoint& point : series.points) {
          const double x = x_.px(point.x);
          const double y = y_.px(point.y);
          if ((corner.left ? x < kLeft + width : x > kWidth - kRight - width) &&
              (corner.top ? y < kTop + height : y > kHeight - kBottom - height)) {
            ++hidden;
          }
        }
      }
      if (hidden < fewest) {
        fewest = hidden;
        best = corner;
      }
    }
    return best;
  }

  template <class... Args>
  void append(fmt::format_string<Args...> text, Args&&... args) {
    fmt::format_to(std::back_inserter(out_), text, std::forward<Args>(args)...);
    out_ += '\n';
  }

  void write_frame() {
    append(R"(<text x="{:.1f}" y="20" text-anchor="middle" class="title">{}</text>)",
           0.5 * (kLeft + kWidth - kRight), escaped(plot_.title));
    for (std::size_t i = 0; i < plot_.x.names.size(); ++i) {
      append(R"(<text x="{:.1f}" y="{}" text-anchor="middle">{}</text>)",
             x_.px(static_cast<double>(i + 1)), kHeight - kBottom + 16.0,
             escaped(plot_.x.names[i]));
    }
    for (const Scale::Tick& tick : x_.ticks()) {
      if (!plot_.x.names.empty()) break;
      const double at = x_.px(tick.value);
      append(R"(<line x1="{0:.1f}" x2="{0:.1f}" y1="{1}" y2="{2}" class="{3}"/>)", at, kTop,
             kHeight - kBottom, tick.labelled ? "grid" : "fine");
      if (tick.labelled) {
        append(R"(<text x="{:.1f}" y="{}" text-anchor="middle">{:g}</text>)", at,
               kHeight - kBottom + 16.0, tick.value);
      }
    }
    for (const Scale::Tick& tick : y_.ticks()) {
      const double at = y_.px(tick.value);
      append(R"(<line x1="{}" x2="{}" y1="{:.1f}" y2="{:.1f}" class="{}"/>)", kLeft,
             kWidth - kRight, at, at, tick.labelled ? "grid" : "fine");
      if (tick.labelled) {
        append(R"(<text x="{}" y="{:.1f}" text-anchor="end">{:g}</text>)", kLeft - 6.0, at + 4.0,
               tick.value);
      }
    }
    append(R"(<rect x="{}" y="{}" width="{}" height="{}" class="frame"/>)", kLeft, kTop,
           kWidth - kLeft - kRight, kHeight - kTop - kBottom);
    append(R"(<text x="{:.1f}" y="{}" text-anchor="middle">{}</text>)",
           0.5 * (kLeft + kWidth - kRight), kHeight - 22.0, escaped(plot_.x.label));
    append(
        R"svg(<text transform="translate(16 {:.1f}) rotate(-90)" text-anchor="middle">{}</text>)svg",
        0.5 * (kTop + kHeight - kBottom), escaped(plot_.y.label));
  }

  void write_series(const PlotSeries& series, const std::string& ink, bool dashed) {
    std::string path;
    for (const PlotPoint& point : series.points) {
      if (!x_.shows(point.x) || !y_.shows(point.y)) continue;
      path += fmt::format("{:.1f},{:.1f} ", x_.px(point.x), y_.px(point.y));
    }
    if (series.area) {
      if (path.empty()) return;
      append(R"(<polygon points="{}" fill="{}" fill-opacity="0.25" stroke="none"/>)", path, ink);
      return;
    }
    if (series.line && !path.empty()) {
      append(R"(<polyline points="{}" fill="none" stroke="{}" stroke-width="{}"{}/>)", path, ink,
             series.emphasis ? 2.5 : 1.5, dashed ? R"( stroke-dasharray="6 3")" : "");
    }
    for (const PlotPoint& point : series.points) {
      if (!point.range || !x_.shows(point.x) || !y_.shows(point.range->low) ||
          !y_.shows(point.range->high)) {
        continue;
      }
      append(R"(<line x1="{0:.1f}" x2="{0:.1f}" y1="{1:.1f}" y2="{2:.1f}" stroke="{3}"/>)",
             x_.px(point.x), y_.px(point.range->low), y_.px(point.range->high), ink);
    }
    if (!series.markers) return;
    for (const PlotPoint& point : series.points) {
      if (!x_.shows(point.x) || !y_.shows(point.y)) continue;
      append(R"(<circle cx="{:.1f}" cy="{:.1f}" r="{}" fill="{}"><title>{}</title></circle>)",
             x_.px(point.x), y_.px(point.y), series.emphasis ? 4.5 : 3.5, ink,
             escaped(point.title));
    }
  }

  const Plot& plot_;
  std::string& out_;
  Scale x_;
  Scale y_;
  std::size_t left_out_ = 0;
};

/// Writes one tornado plot of a given height.
class TornadoWriter {
 public:
  static constexpr double kTornadoWidth = 640.0;
  TornadoWriter(const Tornado& tornado, double height, std::string& out)
      : tornado_(tornado), height_(height), out_(out), x_(PlotScale::linear, kNames, kNotes) {
    x_.include(0.0);
    for (const TornadoBar& bar : tornado.bars) {
      x_.include(bar.at_low);
      x_.include(bar.at_high);
    }
    x_.settle();
  }
  [[nodiscard]] static double height_of(const Tornado& tornado) {
    return kTop + kLegendLine + kRow * static_cast<double>(tornado.bars.size()) + kFoot;
  }

  void write() {
    const double middle = 0.5 * (kNames + kNotes);
    const double bottom = height_ - kFoot;
    append(R"(<text x="{:.1f}" y="20" text-anchor="middle" class="title">{}</text>)", middle,
           escaped(tornado_.title));
    write_legend(kNames, kLow, "input at its low end");
    write_legend(middle, kHigh, "at its high end");
    for (const Scale::Tick& tick : x_.ticks()) {
      const double at = x_.px(tick.value);
      append(R"(<line x1="{0:.1f}" x2="{0:.1f}" y1="{1}" y2="{2}" class="grid"/>)", at,
             kTop + kLegendLine, bottom);
      append(R"(<text x="{:.1f}" y="{}" text-anchor="middle">{:g}</text>)", at, bottom + 16.0,
             tick.value);
    }
    double y = kTop + kLegendLine;
    for (const TornadoBar& bar : tornado_.bars) {
      append(R"(<text x="{}" y="{:.1f}" text-anchor="end">{}</text>)", kNames - 8.0,
             y + 0.5 * kRow + 4.0, escaped(bar.label));
      write_bar(bar.at_low, y, kLow, bar.title);
      write_bar(bar.at_high, y, kHigh, bar.title);
      append(R"(<text x="{}" y="{:.1f}">{}</text>)", kNotes + 8.0, y + 0.5 * kRow + 4.0,
             escaped(bar.note));
      y += kRow;
    }
    append(R"(<line x1="{0:.1f}" x2="{0:.1f}" y1="{1}" y2="{2}" class="frame"/>)", x_.px(0.0),
           kTop + kLegendLine, bottom);
    append(R"(<text x="{:.1f}" y="{}" text-anchor="middle">{}</text>)", middle, height_ - 10.0,
           escaped(tornado_.label));
  }

 private:
  static constexpr double kNames = 190.0;  ///< right edge of the names
  static constexpr double kNotes = 560.0;  ///< left edge of the notes
  static constexpr double kRow = 22.0;
  static constexpr double kFoot = 48.0;
  static constexpr const char* kLow = kColors[0];
  static constexpr const char* kHigh = kColors[1];

  template <class... Args>
  void append(fmt::format_string<Args...> text, Args&&... args) {
    fmt::format_to(std::back_inserter(out_), text, std::forward<Args>(args)...);
    out_ += '\n';
  }
  void write_legend(double x, const char* ink, const char* text) {
    append(R"(<rect x="{}" y="{}" width="10" height="10" fill="{}"/>)", x, kTop - 6.0, ink);
    append(R"(<text x="{}" y="{}">{}</text>)", x + 16.0, kTop + 3.0, text);
  }
  void write_bar(double value, double y, const char* ink, const std::string& title) {
    const double from = x_.px(std::min(0.0, value));
    const double to = x_.px(std::max(0.0, value));
    append(
        R"(<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{}" fill="{}" fill-opacity="0.8"><title>{}</title></rect>)",
        from, y + 4.0, to - from, kRow - 8.0, ink, escaped(title));
  }

  const Tornado& tornado_;
  double height_;
  std::string& out_;
  Scale x_;
};

/// Begins a document of a size in pixels.
std::string begin_document(double width, double height) {
  return fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" width="{0}" height="{1}">
<style>
text {{ font: 12px sans-serif; fill: #222; }}
.title {{ font-weight: bold; font-size: 14px; }}
.legend {{ paint-order: stroke; stroke: #fff; stroke-width: 3px; }}
.note {{ font-size: 10px; fill: #666; }}
.grid {{ stroke: #d0d0d0; stroke-width: 1; }}
.fine {{ stroke: #ececec; stroke-width: 1; }}
.frame {{ fill: none; stroke: #444; stroke-width: 1; }}
</style>
<rect width="100%" height="100%" fill="#fff"/>
)",
      width, height);
}

physics::Result<void> write_document(const std::filesystem::path& file,
                                     const std::string& document) {
  std::ofstream stream(file, std::ios::binary);
  stream << document;
  stream.flush();
  if (!stream) {
    return physics::make_error(physics::ErrorCode::io,
                               fmt::format("{}: cannot be written", file.string()));
  }
  return {};
}

}  // namespace

std::string svg_document(const std::vector<Tornado>& tornados) {
  double height = 0.0;
  for (const Tornado& tornado : tornados) {
    height = std::max(height, TornadoWriter::height_of(tornado));
  }
  const double width = TornadoWriter::kTornadoWidth;
  std::string out = begin_document(width * static_cast<double>(tornados.size()), height);
  for (std::size_t i = 0; i < tornados.size(); ++i) {
    fmt::format_to(std::back_inserter(out), "<g transform=\"translate({} 0)\">\n",
                   width * static_cast<double>(i));
    TornadoWriter(tornados[i], TornadoWriter::height_of(tornados[i]), out).write();
    out += "</g>\n";
  }
  out += "</svg>\n";
  return out;
}

physics::Result<void> write_svg(const std::filesystem::path& file,
                                const std::vector<Tornado>& tornados) {
  return write_document(file, svg_document(tornados));
}

std::string svg_document(const std::vector<Plot>& plots, std::size_t columns) {
  columns = std::clamp<std::size_t>(columns, 1, std::max<std::size_t>(1, plots.size()));
  const std::size_t rows = (plots.size() + columns - 1) / columns;
  const double width = kWidth * static_cast<double>(columns);
  const double height = kHeight * static_cast<double>(std::max<std::size_t>(rows, 1));
  std::string out = begin_document(width, height);
  for (std::size_t i = 0; i < plots.size(); ++i) {
    fmt::format_to(std::back_inserter(out), "<g transform=\"translate({} {})\">\n",
                   kWidth * static_cast<double>(i % columns),
                   kHeight * static_cast<double>(i / columns));
    PlotWriter(plots[i], out).write();
    out += "</g>\n";
  }
  out += "</svg>\n";
  return out;
}

physics::Result<void> write_svg(const std::filesystem::path& file, const std::vector<Plot>& plots,
                                std::size_t columns) {
  return write_document(file, svg_document(plots, columns));
}

}  // namespace emit::tool
