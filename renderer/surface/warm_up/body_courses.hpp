// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "surface/model/body_nodes.hpp"
#include "surface/model/history_record.hpp"

namespace emit::renderer {

/// Temperatures of the interiors of bodies over the record, which passes over all samples improve:
/// each pass takes the course of the pass before and finds the inflow for the next one. Setup only.
class BodyCourses {
 public:
  /// Samples that a task advances together. They belong to one body or to none.
  struct Group {
    std::uint32_t first = 0;  ///< range of the list of samples
    std::uint32_t count = 0;
    std::int32_t body = -1;
  };

  /// Begins with interiors that keep the temperature at which they start. `samples` is the list of
  /// samples that are advanced; groups hold at most `most` of them, in their order, and all with
  /// the same entry of `kinds`. Everything that it refers to must outlive it.
  BodyCourses(const SurfaceModel& model, const scene::SceneGeometry& geometry,
              const SampleHeat& heat, const HistoryRecord& record,
              std::span<const std::uint32_t> samples, std::span<const std::uint32_t> kinds,
              std::size_t most);

  [[nodiscard]] std::span<const Group> groups() const noexcept { return groups_; }
  /// Returns the mean temperature of a body over an interval.
  [[nodiscard]] double mean_k(std::int32_t body, std::size_t interval) const noexcept {
    return mean_k_[static_cast<std::size_t>(body) * intervals_ + interval];
  }
  /// Adds the state of a sample of a group at a node to the inflow of the group's body. Groups may
  /// do so at the same time. @pre the group has a body
  void add(std::size_t group, std::size_t node, std::uint32_t sample,
           const SampleState& state) noexcept {
    inflow_w_[row_of_group_[group] * (intervals_ + 1) + node] +=
        bodies_.inflow_w(all_, sample, state);
  }
  /// Forgets the inflow of a group over intervals from `first` on, before it is added again. The
  /// node at which the first of them begins keeps it, except at the begin of the record.
  void forget(std::size_t group, std::size_t first, std::size_t count) noexcept {
    double* const row_w = &inflow_w_[row_of_group_[group] * (intervals_ + 1)];
    std::fill(row_w + (first == 0 ? 0 : first + 1), row_w + first + count + 1, 0.0);
  }
  /// Finds the courses that follow from the inflow, and forgets it.
  void correct() noexcept;
  /// Returns the temperatures at the end of the record, by body.
  [[nodiscard]] std::vector<double> end_k() const;

 private:
  const SurfaceSamples& all_;
  const SampleHeat& heat_;
  const HistoryRecord& record_;
  std::size_t intervals_;
  BodyNodes bodies_;
  std::vector<Group> groups_;
  std::vector<std::size_t> row_of_group_;  ///< row of `inflow_w_`, counted over groups with a body
  std::vector<double> inflow_w_;           ///< by row, then node
  std::vector<double> node_k_;             ///< by body, then node
  std::vector<double> mean_k_;             ///< by body, then interval
};

}  // namespace emit::renderer
