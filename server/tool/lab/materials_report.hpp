// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdio>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/reference/fit.hpp"
#include "tool/support/json.hpp"
#include "tool/support/svg_plot.hpp"

/// Text, JSON and diagrams of `emit materials`. Any thread, setup only.
namespace emit::tool {

/// Error of a material's modes against one dimension in a climate: the worst of the day in sun and
/// of the five histories after it.
struct ClimateError {
  std::string climate;
  double rms_k = 0.0;
  double max_k = 0.0;
};

/// A material and what was computed about it.
struct MaterialEntry {
  scene::Material material;
  std::vector<reference::CoursePoint> day;  ///< empty: none was asked for, or it has no layers
  std::vector<ClimateError> errors;         ///< empty: it was not checked
};

/// Bars of the check, for the largest RMS and the largest error of a material in a climate.
inline constexpr double kClimateRmsBarK = 0.25;
inline constexpr double kClimateMaxBarK = 0.35;

/// Returns the families in the order in which they first occur.
[[nodiscard]] std::vector<std::string> families_of(std::span<const MaterialEntry> entries);

/// Prints one line per material, by family.
void print_materials(std::FILE* out, std::span<const MaterialEntry> entries);
/// Prints every number of the materials beside each other, and then their sources.
void print_comparison(std::FILE* out, std::span<const MaterialEntry> entries);
/// Prints the errors in every climate. Returns true if all are below the bars.
bool print_climates(std::FILE* out, std::span<const MaterialEntry> entries);

[[nodiscard]] Json materials_json(std::span<const MaterialEntry> entries);

/// Returns diagrams per family: temperatures over the day, emissivities by band with their
/// uncertainty, and spectra where there are any. The day ends at midnight.
[[nodiscard]] std::vector<Plot> material_plots(std::span<const MaterialEntry> entries,
                                               const std::string& climate);

}  // namespace emit::tool
