// SPDX-License-Identifier: Apache-2.0
#include "bench/stability/bench_stability_judge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace emit::tool {
namespace {

const scene::Material& material_of(const scene::ScenarioDesc& scenario, const std::string& name) {
  for (const scene::Material& material : scenario.materials) {
    if (material.name == name) return material;
  }
  return scenario.materials.front();
}

std::string pixel_name(const StoredFrame& frame, std::size_t pixel) {
  return fmt::format("pixel ({}, {})", pixel % frame.width_px, pixel / frame.width_px);
}

}  // namespace

void FrameJudge::count(const StoredFrame& frame) {
  ++counts_.frames;
  counts_.device = frame.device;
  const auto look = [&](float value) {
    counts_.nan_count += std::isnan(value) ? 1U : 0U;
    counts_.inf_count += std::isinf(value) ? 1U : 0U;
  };
  for (const auto& plane : frame.radiance_w_m2_sr) {
    for (const float value : plane) look(value);
  }
  for (std::size_t i = 0; i < frame.temperature_k.size(); ++i) {
    if (frame.object_id[i] > 0.0F) look(frame.temperature_k[i]);
  }
  counts_.nonfinite_px += frame.stats.nonfinite_px;
  counts_.clamped_count += frame.stats.clamped_px;
}

void FrameJudge::add(double error_k, const std::string& where) {
  if (!std::isfinite(error_k)) return;  // counted as NaN or Inf
  errors_k_.add(error_k);
  if (error_k > worst_k_) {
    worst_k_ = error_k;
    counts_.worst_input = where;
  }
}

void FrameJudge::against_model(const StoredFrame& frame, const scene::ScenarioDesc& scenario,
                               std::span<const FlatPart> parts, std::int64_t sim_time_ns,
                               const std::string& frame_name) {
  struct Range {
    double shaded_k = 0.0;
    double lit_k = 0.0;
  };
  std::vector<Range> ranges;
  const PointHistory history(scenario, sim_time_ns, scenario.thermal.steps);
  for (const FlatPart& part : parts) {
    const scene::Material& material = material_of(scenario, part.material);
    const auto with = [&](double sun_frac) {
      return history.temperature_k(material, part.normal,
                                   [sun_frac](std::size_t) { return sun_frac; });
    };
    ranges.push_back({with(0.0), with(1.0)});
  }
  for (std::size_t i = 0; i < frame.temperature_k.size(); ++i) {
    if (!(frame.object_id[i] > 0.0F)) continue;
    const auto part = static_cast<std::size_t>(frame.object_id[i]) - 1;
    if (part >= parts.size()) continue;
    const double t = frame.temperature_k[i];
    const Range& range = ranges[part];
    const double low_k = parts[part].open ? range.lit_k : std::min(range.shaded_k, range.lit_k);
    const double high_k = std::max(range.shaded_k, range.lit_k);
    const double error_k = std::max({0.0, low_k - t, t - (parts[part].open ? low_k : high_k)});
    if (error_k > worst_k_) {
      add(error_k,
          fmt::format("{}, {} ({}): {:.4f} K, model {:.4f} K", frame_name, pixel_name(frame, i),
                      parts[part].name, t, parts[part].open || t < low_k ? low_k : high_k));
    } else {
      add(error_k, {});
    }
  }
}

void FrameJudge::against_frame(const StoredFrame& frame, const StoredFrame& harmless,
                               const std::string& frame_name) {
  for (std::size_t i = 0; i < frame.temperature_k.size(); ++i) {
    if (frame.object_id[i] != harmless.object_id[i]) {
      ++moved_edges_;
      continue;
    }
    if (!(frame.object_id[i] > 0.0F)) continue;
    const double error_k =
        std::abs(static_cast<double>(frame.temperature_k[i]) - harmless.temperature_k[i]);
    if (error_k > worst_k_) {
      add(error_k,
          fmt::format("{}, {}: {:.4f} K, harmless {:.4f} K", frame_name, pixel_name(frame, i),
                      frame.temperature_k[i], harmless.temperature_k[i]));
    } else {
      add(error_k, {});
    }
  }
}

HostileFrameResult FrameJudge::result(std::string test, std::string note) const {
  HostileFrameResult row = counts_;
  row.test = std::move(test);
  row.cases = errors_k_.count();
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  row.max_error_k = errors_k_.empty() ? kNone : errors_k_.max();
  row.p99_error_k = errors_k_.empty() ? kNone : errors_k_.percentile(0.99);
  row.note = std::move(note);
  if (moved_edges_ > 0) row.note += fmt::format("; {} px show another part", moved_edges_);
  return row;
}

}  // namespace emit::tool
