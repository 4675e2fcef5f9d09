// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>

#include "emit/physics/check.hpp"
#include "surface/run/world_inputs.hpp"

namespace emit::renderer {

/// Grid of instants at which intervals of a cached surface begin, and the rules by which intervals
/// depart from it. Immutable; any thread; RT-safe.
class NodeGrid {
 public:
  /// Events closer than this after a node belong to the node, ns.
  static constexpr std::int64_t kSameNs = 1'000'000;

  /// The grid begins at `start_ns`. Its instants are `interval_ns` apart. @pre interval_ns > 0
  NodeGrid(std::int64_t start_ns, std::int64_t interval_ns)
      : start_ns_(start_ns), interval_ns_(interval_ns) {
    EMIT_CHECK_OP(interval_ns, >, 0);
  }

  [[nodiscard]] std::int64_t start_ns() const noexcept { return start_ns_; }
  [[nodiscard]] std::int64_t interval_ns() const noexcept { return interval_ns_; }
  /// Length of the interval after a change of the weather that matters. Surfaces answer like the
  /// root of time at first, which a line over a whole interval does not follow.
  [[nodiscard]] std::int64_t answer_ns() const noexcept { return interval_ns_ / 4; }
  /// Time over which a node is computed anew after the host has changed the weather.
  [[nodiscard]] std::int64_t renewal_ns() const noexcept { return interval_ns_ / 8; }

  /// Returns the instant of the grid at or before `now_ns`; the first one if there is none.
  [[nodiscard]] std::int64_t at_or_before_ns(std::int64_t now_ns) const noexcept;
  /// Returns the time of the node after one at `from_ns`: the next instant of the grid, or an
  /// earlier one after `now_ns` at which an entity, the weather or a part that was at rest changes.
  [[nodiscard]] std::int64_t next_ns(std::int64_t from_ns, std::int64_t now_ns,
                                     const WorldInputs& inputs) const noexcept;

 private:
  std::int64_t start_ns_;
  std::int64_t interval_ns_;
};

}  // namespace emit::renderer
