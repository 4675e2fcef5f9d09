// SPDX-License-Identifier: Apache-2.0
#include "surface/run/column_solve.hpp"

#include <algorithm>
#include <numeric>

#include "emit/physics/check.hpp"
#include "surface/run/surface_step.hpp"

namespace emit::renderer {

ColumnSolve::ColumnSolve(const SurfaceSamples& all, const SampleHeat& heat)
    : all_(all), heat_(heat), system_(all) {
  const std::size_t count = all.columns.size();
  active_.reserve(count);
  every_.resize(count);
  std::iota(every_.begin(), every_.end(), 0U);
  parts_.resize(count);
  left_.resize(system_.islands());
  before_.resize(system_.islands());
  factor_.resize(system_.islands());
  change_k_s_.assign(count, 0.0F);
  stepped_again_.assign(count, 0);
}

void ColumnSolve::begin(double dt_s) noexcept {
  dt_s_ = dt_s > 0.0 ? dt_s : 1.0;  // an interval without length changes nothing
  std::ranges::fill(stepped_again_, std::uint8_t{0});
  pass_ = Pass::none;
}

void ColumnSolve::hold(std::uint32_t column, const SampleState& state) noexcept {
  ColumnEquations& equations = system_.equations(column);
  equations.count = heat_.foster()->cells(all_.samples[all_.columns[column].sample].material).count;
  for (std::size_t l = 0; l < equations.count; ++l) {
    const auto value_k = static_cast<double>(state.cells_k[l]);
    equations.diagonal_w_m2_k[l] = kHoldW;
    equations.below_w_m2_k[l] = 0.0;
    equations.right_w_m2[l] = kHoldW * value_k;
    system_.cells_k(column)[l] = value_k;
  }
  stepped_again_[column] = 1;
}

void ColumnSolve::work(std::size_t count, SurfaceNode& to, threads::WorkerPool& workers) noexcept {
  EMIT_CHECK(started());
  while (count > 0 && !finished()) {
    const std::vector<std::uint32_t>& order = pass_ == Pass::keep ? every_ : active_;
    const std::size_t now = std::min(count, order.size() - at_);
    workers.run(now, kSamplesPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = at_ + begin; i < at_ + end; ++i) {
        const std::uint32_t c = order[i];
        switch (pass_) {
          case Pass::residual:
            system_.form_residual(c);
            break;
          case Pass::precondition:
            parts_[c] = system_.precondition(c);
            break;
          case Pass::turn:
            system_.turn_direction(c, factor_[system_.island(c)]);
            break;
          case Pass::multiply:
            parts_[c].size = system_.multiply(c);
            break;
          case Pass::move:
            system_.move(c, factor_[system_.island(c)]);
            parts_[c] = system_.precondition(c);
            break;
          case Pass::keep:
            keep(c, to);
            break;
          case Pass::none:
          case Pass::finished:
            break;
        }
      }
    });
    if (pass_ == Pass::keep && now > 0) {
      const std::uint32_t first = all_.columns[every_[at_]].sample;
      const std::uint32_t last = all_.columns[every_[at_ + now - 1]].sample;
      if (first < to.drawn) to.changes.add(first, std::min(last + 1, to.drawn) - first);
    }
    at_ += now;
    worked_ += now;
    count -= now;
    if (at_ == order.size()) end_pass();
  }
}

void ColumnSolve::sum_parts() noexcept {
  for (ColumnSystem::Part& sum : left_) sum = {};
  // Add in the order of the columns, so that sums have the same bits on any number of cores.
  for (const std::uint32_t c : active_) {
    ColumnSystem::Part& sum = left_[system_.island(c)];
    sum.size += parts_[c].size;
    sum.most_k = std::max(sum.most_k, parts_[c].most_k);
  }
}

void ColumnSolve::end_pass() noexcept {
  at_ = 0;
  // Leave out islands that are solved. End when none is left or the steps are used up.
  const auto next_step = [&] {
    std::erase_if(active_, [&](std::uint32_t c) {
      const ColumnSystem::Part& left = left_[system_.island(c)];
      return !(left.most_k > ColumnSystem::kSolvedK && left.size > 0.0);
    });
    pass_ = active_.empty() || steps_++ == kMostSteps ? Pass::keep : Pass::turn;
    if (pass_ != Pass::keep) return;
    left_k_ = 0.0;
    for (const std::uint32_t c : active_) {
      left_k_ = std::max(left_k_, static_cast<double>(left_[system_.island(c)].most_k));
    }
  };
  switch (pass_) {
    case Pass::residual:
      pass_ = Pass::precondition;
      break;
    case Pass::precondition:
      sum_parts();
      std::ranges::fill(factor_, 0.0F);
      next_step();
      break;
    case Pass::turn:
      pass_ = Pass::multiply;
      break;
    case Pass::multiply: {
      // Keep what is unbalanced; the sums of this pass give the way.
      for (float& factor : factor_) factor = 0.0F;
      double along = 0.0;
      for (std::size_t i = 0; i < active_.size(); ++i) {
        const std::uint32_t island = system_.island(active_[i]);
        along += parts_[active_[i]].size;
        if (i + 1 < active_.size() && system_.island(active_[i + 1]) == island) continue;
        factor_[island] = along > 0.0 ? static_cast<float>(left_[island].size / along) : 0.0F;
        along = 0.0;
      }
      pass_ = Pass::move;
      break;
    }
    case Pass::move:
      // The turn is the ratio of the squares after and before the move.
      for (std::size_t island = 0; island < left_.size(); ++island) {
        before_[island] = left_[island].size;
      }
      sum_parts();
      for (std::size_t island = 0; island < left_.size(); ++island) {
        factor_[island] =
            before_[island] > 0.0 ? static_cast<float>(left_[island].size / before_[island]) : 0.0F;
      }
      next_step();
      break;
    case Pass::keep:
      pass_ = Pass::finished;
      break;
    case Pass::none:
    case Pass::finished:
      break;
  }
}

void ColumnSolve::keep(std::uint32_t column, SurfaceNode& to) noexcept {
  if (stepped_again_[column] != 0) return;
  const std::uint32_t sample = all_.columns[column].sample;
  SampleState& state = to.states[sample];
  const float before_k = state.aside_k;
  keep_cells(system_.equations(column), system_.cells_k(column), state);
  change_k_s_[column] = static_cast<float>(static_cast<double>(state.aside_k - before_k) / dt_s_);
  heat_.foster()->show_state(all_.samples[sample].material, state, to.outputs[sample]);
  if (sample < to.drawn) to.vertices[sample].offset_k = to.outputs[sample].offset_k;
}

std::uint64_t ColumnSolve::bytes() const noexcept {
  const auto bytes_of = [](const auto& values) { return values.capacity() * sizeof(values[0]); };
  return system_.bytes() + bytes_of(active_) + bytes_of(every_) + bytes_of(parts_) +
         bytes_of(change_k_s_) + bytes_of(stepped_again_);
}

}  // namespace emit::renderer
