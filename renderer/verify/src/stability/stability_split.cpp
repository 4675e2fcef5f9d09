// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/physics/relaxation.hpp"
#include "emit/verify/stability.hpp"
#include "gl/egl_context.hpp"
#include "gpu_rows.hpp"
#include "stability_tally.hpp"

namespace emit::verify {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

// Layout of rows and intervals for passes/evaluate_relaxation.comp.
constexpr std::size_t kModes = 3;
constexpr std::size_t kRowStride = 3 + 2 * kModes;
constexpr std::uint32_t kMaxSplits = 1000;
constexpr std::size_t kMaxIntervals = 65'535;
bool is_valid(const DriveHistory& h, std::uint32_t splits) {
  return h.node_s.size() >= 2 && h.node_s.size() == h.drive_k.size() && !h.tau_s.empty() &&
         h.tau_s.size() <= kModes && h.tau_s.size() == h.weight_frac.size() && splits >= 1 &&
         splits <= kMaxSplits && (h.node_s.size() - 1) * splits <= kMaxIntervals;
}

void append_intervals(const DriveHistory& h, std::uint32_t splits, std::vector<float>& out) {
  for (std::size_t i = 0; i + 1 < h.node_s.size(); ++i) {
    const double length_s = (h.node_s[i + 1] - h.node_s[i]) / splits;
    const double slope_k = (h.drive_k[i + 1] - h.drive_k[i]) / splits;
    for (std::uint32_t part = 0; part < splits; ++part) {
      const double from_k = h.drive_k[i] + slope_k * part - physics::kReferenceK;
      out.push_back(static_cast<float>(from_k));
      out.push_back(static_cast<float>(from_k + slope_k));
      for (std::size_t mode = 0; mode < kModes; ++mode) {
        const auto gains = mode < h.tau_s.size()
                               ? physics::relaxation_gains(length_s, h.tau_s[mode])
                               : physics::RelaxationGains<double>{};
        out.push_back(static_cast<float>(gains.start_frac));
        out.push_back(static_cast<float>(gains.end_frac));
      }
    }
  }
}

/// Returns the surface offsets of all histories at their last node, K.
Result<std::vector<float>> relaxed(std::span<const DriveHistory> histories, std::uint32_t splits,
                                   int gpu_index) {
  std::vector<float> rows;
  std::vector<float> intervals;
  std::size_t first = 0;
  for (const DriveHistory& h : histories) {
    const std::size_t count = (h.node_s.size() - 1) * splits;
    rows.insert(rows.end(), {static_cast<float>(first), static_cast<float>(count), 1.0F});
    for (std::size_t mode = 0; mode < kModes; ++mode) {
      const bool used = mode < h.tau_s.size();
      rows.push_back(used ? static_cast<float>(h.weight_frac[mode]) : 0.0F);
      rows.push_back(used ? static_cast<float>(h.start_k - physics::kReferenceK) : 0.0F);
    }
    append_intervals(h, splits, intervals);
    first += count;
  }
  GpuRows job;
  job.shader = "passes/evaluate_relaxation.comp";
  job.inputs = rows;
  job.input_stride = kRowStride;
  job.constants = intervals;
  job.gpu_index = gpu_index;
  return run_gpu_rows(job);
}

}  // namespace

Result<SweepReport> sweep_split(std::span<const DriveHistory> histories,
                                std::span<const std::uint32_t> splits, int gpu_index) {
  for (const DriveHistory& h : histories) {
    for (const std::uint32_t s : splits) {
      if (!is_valid(h, s)) {
        return make_error(ErrorCode::invalid_argument,
                          fmt::format("history '{}' cannot be cut {} times", h.name, s));
      }
    }
  }
  SweepReport report;
  {
    auto context = gl::EglContext::create(gpu_index, false);
    if (!context) return tl::unexpected(std::move(context.error()));
    report.device = context->device_name();
  }
  const auto whole = relaxed(histories, 1, gpu_index);
  if (!whole) return tl::unexpected(whole.error());
  for (const std::uint32_t s : splits) {
    const auto cut = relaxed(histories, s, gpu_index);
    if (!cut) return tl::unexpected(cut.error());
    Tally tally;
    for (std::size_t i = 0; i < histories.size(); ++i) {
      const double truth_k = physics::kReferenceK + static_cast<double>((*whole)[i]);
      const float result_k =
          static_cast<float>(physics::kReferenceK + static_cast<double>((*cut)[i]));
      const double error_k =
          std::abs(static_cast<double>((*cut)[i]) - static_cast<double>((*whole)[i]));
      tally.add(result_k, truth_k, error_k, error_k / truth_k, static_cast<std::uint32_t>(i));
    }
    SweepResult row{
        .test = fmt::format("split {}", s), .computed_by = "shader", .worst_input = {}, .note = {}};
    tally.write(row);
    if (tally.has_worst()) row.worst_input = histories[tally.worst_case()].name;
    report.results.push_back(std::move(row));
  }
  return report;
}

}  // namespace emit::verify
