// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::tool {

enum class PlotScale : unsigned char { linear, logarithmic };

struct PlotAxis {
  std::string label;  ///< with the unit
  PlotScale scale = PlotScale::linear;
  std::vector<std::string> names{};  ///< of the values 1, 2, 3 ... of a linear x axis of kinds
};

/// Ends of a bar.
struct PlotRange {
  double low = 0.0;
  double high = 0.0;
};

struct PlotPoint {
  double x = 0.0;
  double y = 0.0;
  std::string title;                              ///< shown under the pointer; may be empty
  std::optional<PlotRange> range = std::nullopt;  ///< of y: a bar through the point
};

struct PlotSeries {
  std::string label;  ///< legend entry; empty: none
  std::vector<PlotPoint> points;
  bool line = false;      ///< joined in the order given
  bool markers = true;    ///< a dot at every point
  bool area = false;      ///< the points go round an area that is filled; neither line nor markers
  bool emphasis = false;  ///< thick and dark, for the data that the reader should see first
  bool dashed = false;
};

/// One diagram. Points that an axis cannot show (NaN, or not positive on a logarithmic axis) are
/// left out and counted below the diagram.
struct Plot {
  std::string title;
  PlotAxis x;
  PlotAxis y;
  std::vector<PlotSeries> series;
};

/// Input that is moved to both ends of its range, and the shifts that it causes.
struct TornadoBar {
  std::string label;     ///< of the input
  std::string title;     ///< shown under the pointer; may be empty
  double at_low = 0.0;   ///< shift with the input at its low end
  double at_high = 0.0;  ///< and at its high end
  std::string note;      ///< written at the right; may be empty
};
/// Bars below each other, from zero to both sides.
struct Tornado {
  std::string title;
  std::string label;  ///< of the shifts, with the unit
  std::vector<TornadoBar> bars;
};
/// Returns tornado plots side by side as one SVG document. Setup only; any thread.
[[nodiscard]] std::string svg_document(const std::vector<Tornado>& tornados);
/// Writes it. Errors: io, naming the file.
[[nodiscard]] physics::Result<void> write_svg(const std::filesystem::path& file,
                                              const std::vector<Tornado>& tornados);

/// Returns diagrams side by side as one SVG document, `columns` in a row. Setup only; any thread.
[[nodiscard]] std::string svg_document(const std::vector<Plot>& plots, std::size_t columns = 2);

/// Writes an SVG document. Errors: io, naming the file.
[[nodiscard]] physics::Result<void> write_svg(const std::filesystem::path& file,
                                              const std::vector<Plot>& plots,
                                              std::size_t columns = 2);

}  // namespace emit::tool
