// SPDX-License-Identifier: Apache-2.0
#include "tool/truth/probe_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <string_view>

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::array<const char*, 7> kColumns{"x_m", "y_m", "z_m", "nx", "ny", "nz", "object"};
constexpr std::size_t kNone = static_cast<std::size_t>(-1);

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\"";
  const auto first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> cells;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    cells.push_back(trimmed(line.substr(begin, end - begin)));
    begin = end + 1;
  }
  return cells;
}

std::optional<double> number(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

/// Columns of the table by their place in kColumns.
using Columns = std::array<std::size_t, kColumns.size()>;

Result<Columns> columns_of(const std::vector<std::string_view>& header) {
  Columns columns;
  columns.fill(kNone);
  for (std::size_t i = 0; i < header.size(); ++i) {
    const auto found = std::ranges::find(kColumns, header[i]);
    if (found == kColumns.end()) {
      return make_error(ErrorCode::parse, fmt::format("unknown column '{}' (known: {})", header[i],
                                                      fmt::join(kColumns, ", ")));
    }
    columns[static_cast<std::size_t>(found - kColumns.begin())] = i;
  }
  for (std::size_t c = 0; c < 3; ++c) {
    if (columns[c] == kNone) {
      return make_error(ErrorCode::parse, fmt::format("column '{}' is missing", kColumns[c]));
    }
  }
  const auto normals = std::ranges::count(std::span(columns).subspan(3, 3), kNone);
  if (normals != 0 && normals != 3) {
    return make_error(ErrorCode::parse, "a normal needs all of 'nx', 'ny' and 'nz'");
  }
  return columns;
}

Result<reference::SolveProbe> probe_of(const std::vector<std::string_view>& cells,
                                       const Columns& columns,
                                       const scene::ScenarioDesc& scenario) {
  reference::SolveProbe probe;
  const auto cell = [&](std::size_t c) {
    return columns[c] < cells.size() ? cells[columns[c]] : std::string_view();
  };
  glm::dvec3 normal(0.0);
  bool has_normal = false;
  for (std::size_t c = 0; c < 6; ++c) {
    if (c >= 3 && cell(c).empty()) continue;
    const auto value = number(cell(c));
    if (!value) {
      return make_error(ErrorCode::parse,
                        fmt::format("'{}': '{}' is not a number", kColumns[c], cell(c)));
    }
    const auto axis = static_cast<glm::dvec3::length_type>(c % 3);
    (c < 3 ? probe.position_m : normal)[axis] = *value;
    has_normal |= c >= 3;
  }
  if (has_normal) {
    if (normal == glm::dvec3(0.0)) return make_error(ErrorCode::parse, "the normal is zero");
    probe.normal = normal;
  }
  probe.object = cell(6);
  if (!probe.object.empty() &&
      std::ranges::find(scenario.objects, probe.object, &scene::ObjectDesc::name) ==
          scenario.objects.end()) {
    return make_error(ErrorCode::config, fmt::format("no object is named '{}'", probe.object));
  }
  return probe;
}

}  // namespace

Result<std::vector<reference::SolveProbe>> read_probes(const std::filesystem::path& file,
                                                       const scene::ScenarioDesc& scenario) {
  std::ifstream in(file);
  if (!in) {
    return make_error(ErrorCode::not_found, fmt::format("{}: cannot be read", file.string()));
  }
  std::vector<reference::SolveProbe> probes;
  std::optional<Columns> columns;
  std::string line;
  for (std::size_t number = 1; std::getline(in, line); ++number) {
    if (trimmed(line).empty() || trimmed(line).front() == '#') continue;
    const auto cells = cells_of(line);
    const auto place = [&] { return fmt::format("{}:{}", file.string(), number); };
    if (!columns) {
      auto read = columns_of(cells);
      if (!read) return tl::unexpected(std::move(read.error()).with_context(place()));
      columns = *read;
      continue;
    }
    auto probe = probe_of(cells, *columns, scenario);
    if (!probe) return tl::unexpected(std::move(probe.error()).with_context(place()));
    probes.push_back(std::move(*probe));
  }
  if (probes.empty()) {
    return make_error(ErrorCode::parse, fmt::format("{}: the table has no points", file.string()));
  }
  return probes;
}

std::string probe_header() {
  return "time_s,x_m,y_m,z_m,nx,ny,nz,object,temperature_k\n";
}

std::string probe_rows(double time_s, std::span<const reference::SolveProbe> probes,
                       std::span<const reference::ProbedPoint> points,
                       const scene::ScenarioDesc& scenario) {
  std::string out;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const reference::ProbedPoint& point = points[i];
    if (!std::isfinite(point.temperature_k)) {
      const glm::dvec3& at = probes[i].position_m;
      out += fmt::format("{:.9g},{:.9g},{:.9g},{:.9g},,,,,nan\n", time_s, at.x, at.y, at.z);
      continue;
    }
    out += fmt::format("{:.9g},{:.9g},{:.9g},{:.9g},{:.6g},{:.6g},{:.6g},{},{:.6f}\n", time_s,
                       point.position_m.x, point.position_m.y, point.position_m.z, point.normal.x,
                       point.normal.y, point.normal.z, scenario.objects[point.object].name,
                       point.temperature_k);
  }
  return out;
}

}  // namespace emit::tool
