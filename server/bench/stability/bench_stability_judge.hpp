// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <string>

#include "bench/stability/bench_stability_frames.hpp"
#include "bench/stability/bench_stability_scene.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {

/// Gathers one row from the frames of a test.
class FrameJudge {
 public:
  /// Counts NaN, Inf and the renderer's own counters.
  void count(const StoredFrame& frame);

  /// Compares a frame with the published model in double at every pixel: on open parts with the
  /// sunlit temperature, elsewhere with the range between never and always lit. It takes only parts
  /// with a sky factor of 0.5: the obscurance radius must be next to nothing.
  void against_model(const StoredFrame& frame, const scene::ScenarioDesc& scenario,
                     std::span<const FlatPart> parts, std::int64_t sim_time_ns,
                     const std::string& frame_name);

  /// Compares a frame pixel by pixel with a frame of a harmless variant. Pixels that show another
  /// part count as moved edges, not as errors.
  void against_frame(const StoredFrame& frame, const StoredFrame& harmless,
                     const std::string& frame_name);

  void add(double error_k, const std::string& where);

  [[nodiscard]] HostileFrameResult result(std::string test, std::string note) const;

 private:
  HostileFrameResult counts_;
  Samples errors_k_;
  double worst_k_ = -1.0;
  std::uint64_t moved_edges_ = 0;
};

}  // namespace emit::tool
