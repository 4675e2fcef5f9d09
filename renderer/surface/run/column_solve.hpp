// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "surface/heat/column_system.hpp"
#include "surface/heat/sample_heat.hpp"
#include "surface/heat/surface_node.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {

/// Heat between the columns of all samples over the interval that is being computed, found together
/// and spread over the frames of that interval.
///
/// A column that advanced on its own would meet its neighbours as they were at the begin. Heat
/// would then pass one sample per interval, however small the samples are. The balance of all
/// columns at the end of the interval is solved by the steps of ColumnSystem instead. Each step is
/// a pass over all columns, which may be cut anywhere. Results do not depend on the cuts.
///
/// Owner: SurfaceInterval. Thread: the renderer's; work() uses all cores. Real time: everything but
/// the constructor is RT-safe.
class ColumnSolve {
 public:
  /// Most steps over one interval. The rest of an error waits for the next interval.
  static constexpr int kMostSteps = 60;
  /// Most passes that a solution takes, by which callers plan its time: three for each step, two to
  /// begin and one to keep. A solution that needs fewer ends earlier.
  static constexpr std::size_t kMostPasses = 3 * static_cast<std::size_t>(kMostSteps) + 3;

  ColumnSolve(const SurfaceSamples& all, const SampleHeat& heat);

  [[nodiscard]] std::size_t columns() const noexcept { return stepped_again_.size(); }

  /// Begins an interval of `dt_s`, whose samples advance next.
  void begin(double dt_s) noexcept;
  /// Equations of a column, which its sample fills when it advances.
  [[nodiscard]] ColumnEquations& equations(std::uint32_t column) noexcept {
    return system_.equations(column);
  }
  /// Change of a surface over the interval that its neighbours are expected to bring, K: as in the
  /// interval before.
  [[nodiscard]] double expected_change_k(std::uint32_t column) const noexcept {
    return dt_s_ * static_cast<double>(change_k_s_[column]);
  }
  /// Flags by column. A column with 1 keeps the state that the end of the interval has already.
  [[nodiscard]] std::span<std::uint8_t> stepped_again() noexcept { return stepped_again_; }

  /// Begins the solution once all samples have advanced from `from`. Columns for which
  /// `holds(sample)` is true keep the cells of `from`.
  template <class Holds>
  void start(const SurfaceNode& from, const Holds& holds) noexcept;
  [[nodiscard]] bool started() const noexcept { return pass_ != Pass::none; }
  [[nodiscard]] bool finished() const noexcept { return pass_ == Pass::finished; }
  /// Largest error that the latest solution left when its steps were used up, K; 0: it was solved.
  [[nodiscard]] double left_k() const noexcept { return left_k_; }
  /// Columns that work() has visited since start(), over all passes.
  [[nodiscard]] std::size_t worked() const noexcept { return worked_; }
  /// Continues the solution by `count` columns in its passes. The last pass writes to `to`: cells,
  /// outputs and vertices.
  /// @pre started()
  void work(std::size_t count, SurfaceNode& to, threads::WorkerPool& workers) noexcept;
  [[nodiscard]] std::uint64_t bytes() const noexcept;

 private:
  enum class Pass : std::uint8_t {
    none,
    residual,
    precondition,
    turn,
    multiply,
    move,
    keep,
    finished
  };
  /// Conductance by which a held cell keeps its temperature, W/m2/K.
  static constexpr double kHoldW = 1e7;

  void hold(std::uint32_t column, const SampleState& state) noexcept;
  void end_pass() noexcept;
  /// Sums what the columns of each island have added in this pass.
  void sum_parts() noexcept;
  void keep(std::uint32_t column, SurfaceNode& to) noexcept;

  const SurfaceSamples& all_;
  const SampleHeat& heat_;
  ColumnSystem system_;
  std::vector<std::uint32_t> active_;      ///< columns of islands that are not solved, by island
  std::vector<std::uint32_t> every_;       ///< all columns, ascending
  std::vector<ColumnSystem::Part> parts_;  ///< by column
  std::vector<ColumnSystem::Part> left_;   ///< by island: what is unbalanced
  std::vector<double> before_;             ///< by island: square of it one step ago
  std::vector<float> factor_;              ///< by island: way or turn
  std::vector<float> change_k_s_;          ///< by column: change by neighbours, interval before
  std::vector<std::uint8_t> stepped_again_;
  double dt_s_ = 1.0;
  double left_k_ = 0.0;
  int steps_ = 0;
  std::size_t at_ = 0;      ///< columns that the pass has done
  std::size_t worked_ = 0;  ///< columns in all passes
  Pass pass_ = Pass::none;
};

template <class Holds>
void ColumnSolve::start(const SurfaceNode& from, const Holds& holds) noexcept {
  for (std::uint32_t c = 0; c < columns(); ++c) {
    const std::uint32_t sample = all_.columns[c].sample;
    const SampleState& begin = from.states[sample];
    if (holds(sample)) {
      hold(c, begin);
      continue;
    }
    // Guess that neighbours go on to add what they add.
    for (std::size_t l = 0; l < physics::kMaxColumnCells; ++l) {
      system_.cells_k(c)[l] = system_.equations(c).alone_k[l] + begin.cells_k[l] - begin.alone_k[l];
    }
  }
  active_.clear();
  for (std::size_t island = 0; island < system_.islands(); ++island) {
    const auto columns = system_.columns(island);
    active_.insert(active_.end(), columns.begin(), columns.end());
  }
  steps_ = 0;
  at_ = 0;
  worked_ = 0;
  pass_ = columns() == 0 ? Pass::finished : Pass::residual;
}

}  // namespace emit::renderer
