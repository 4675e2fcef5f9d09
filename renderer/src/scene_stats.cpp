// SPDX-License-Identifier: Apache-2.0
#include "emit/renderer/renderer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace emit::renderer {
namespace {

/// Twice as many, in round figures.
std::uint64_t suggested(std::uint64_t samples) {
  const double twice = 2.0 * static_cast<double>(samples);
  const double unit = std::pow(10.0, std::floor(std::log10(std::max(twice, 10.0))) - 1.0);
  return static_cast<std::uint64_t>(std::ceil(twice / unit) * unit);
}

}  // namespace

std::vector<std::string> warm_up_warnings(const SceneStats& stats) {
  std::vector<std::string> out = stats.first_frame_warnings;
  if (stats.samples > stats.max_samples && stats.max_samples != 0) {
    out.push_back(fmt::format(
        "thermal.max_samples = {} does not bind: the meshes' own vertices take {} samples, and no "
        "triangle was refined, so shadows are coarser than tolerance_k asks. Set it to {} or more",
        stats.max_samples, stats.samples, suggested(stats.samples)));
  } else if (stats.samples_full) {
    out.push_back(fmt::format(
        "thermal.max_samples = {} stopped the refinement: shadows are coarser than tolerance_k "
        "asks. Set it to {} or more",
        stats.max_samples, suggested(stats.max_samples)));
  }
  if (stats.exchange_left_w_m2 > 0.0) {
    out.push_back(fmt::format(
        "the radiation between surfaces did not settle in the warm-up: {:.3g} W/m2 are left, so "
        "that surfaces which face each other may be off by kelvins",
        stats.exchange_left_w_m2));
  }
  if (stats.coarse_meshes) {
    out.emplace_back(
        "thermal.max_samples is too small for the meshes: outlines are up to two pixels off");
  }
  return out;
}

}  // namespace emit::renderer
