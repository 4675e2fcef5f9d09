// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/body_courses.hpp"

#include <algorithm>

namespace emit::renderer {

BodyCourses::BodyCourses(const SurfaceModel& model, const scene::SceneGeometry& geometry,
                         const SampleHeat& heat, const HistoryRecord& record,
                         std::span<const std::uint32_t> samples,
                         std::span<const std::uint32_t> kinds, std::size_t most)
    : all_(model.samples),
      heat_(heat),
      record_(record),
      intervals_(record.size()),
      bodies_(model, geometry, heat) {
  // Cut the list into groups of one body each.
  std::size_t rows = 0;
  for (std::uint32_t i = 0; i < samples.size(); ++i) {
    const std::int32_t body = all_.samples[samples[i]].body;
    if (groups_.empty() || groups_.back().body != body || groups_.back().count == most ||
        kinds[i] != kinds[i - 1]) {
      groups_.push_back({i, 0, body});
      row_of_group_.push_back(rows);
      if (body >= 0) ++rows;
    }
    ++groups_.back().count;
  }
  inflow_w_.resize(rows * (intervals_ + 1));
  node_k_.resize(bodies_.size() * (intervals_ + 1));
  mean_k_.resize(bodies_.size() * intervals_);
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const double start_k = bodies_.start_k(all_, b);
    std::fill_n(&node_k_[b * (intervals_ + 1)], intervals_ + 1, start_k);
    std::fill_n(mean_k_.begin() + static_cast<std::ptrdiff_t>(b * intervals_), intervals_, start_k);
  }
}

void BodyCourses::correct() noexcept {
  if (bodies_.size() == 0) return;
  const std::size_t nodes = intervals_ + 1;
  // Gather the rows of the groups, in their order, in the first row of each body.
  std::vector<double> sums_w(bodies_.size() * nodes);
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    if (groups_[g].body < 0) continue;
    double* const sum_w = &sums_w[static_cast<std::size_t>(groups_[g].body) * nodes];
    const double* const row_w = &inflow_w_[row_of_group_[g] * nodes];
    for (std::size_t j = 0; j < nodes; ++j) sum_w[j] += row_w[j];
  }
  std::ranges::fill(inflow_w_, 0.0);
  const FosterHeat& foster = heat_.of_bodies();
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const double* const inflow_w = &sums_w[b * nodes];
    double* const course_k = &node_k_[b * nodes];
    const auto end_of = [&](std::size_t node, const SurfaceForcing& forcing, double assumed_k) {
      return BodyNodes::End{inflow_w[node], foster.offset_of_k(forcing.air_k), assumed_k};
    };
    double assumed_k = course_k[0];
    course_k[0] =
        bodies_.balance_k(b, end_of(0, record_.intervals.front().forcing.begin, assumed_k));
    for (std::size_t j = 0; j < intervals_; ++j) {
      const IntervalForcing& forcing = record_.intervals[j].forcing;
      const double next_assumed_k = course_k[j + 1];
      const BodyNodes::Course course =
          bodies_.correct(b, course_k[j], end_of(j, forcing.begin, assumed_k),
                          end_of(j + 1, forcing.end, next_assumed_k), forcing.dt_s);
      course_k[j + 1] = course.end_k;
      mean_k_[b * intervals_ + j] = course.mean_k;
      assumed_k = next_assumed_k;
    }
  }
}

std::vector<double> BodyCourses::end_k() const {
  std::vector<double> out;
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    out.push_back(node_k_[b * (intervals_ + 1) + intervals_]);
  }
  return out;
}

}  // namespace emit::renderer
