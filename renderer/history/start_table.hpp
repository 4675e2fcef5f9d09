// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float4.hpp>
#include <memory>
#include <span>
#include <vector>

#include "emit/physics/foster.hpp"

namespace emit::renderer {

/// A number for each mode as shaders read it: in texels of four floats, with zeros at the end.
using StateTexels = std::array<glm::vec4, (physics::kMaxFosterModes + 3) / 4>;

/// Which nodes of the table of first states are found before anybody asks for them.
enum class StartNodes : std::uint8_t {
  all,    ///< for shaders, which read all of the table
  asked,  ///< none: a scene has few directions, and a node takes some 70 us
};

/// States by node. A node is found when it is first asked for. Owner: FosterHistory.
class StartTable {
 public:
  /// Makes room for so many nodes, of which none is found. It allocates.
  void resize(std::size_t nodes) {
    texels_.assign(nodes, {});
    marks_ = std::make_unique<std::atomic<Mark>[]>(nodes);
  }
  /// Forgets all nodes. Nobody else may read meanwhile. RT-safe.
  void clear() noexcept {
    for (std::size_t i = 0; i < texels_.size(); ++i) {
      marks_[i].store(Mark::none, std::memory_order_relaxed);
    }
  }

  /// Returns the states of a node; `find` returns them where nobody has asked before. Any thread:
  /// threads that ask at once find the same. RT-safe if `find` is.
  template <class Find>
  [[nodiscard]] StateTexels at(std::size_t node, const Find& find) const noexcept {
    std::atomic<Mark>& mark = marks_[node];
    if (mark.load(std::memory_order_acquire) == Mark::found) return texels_[node];
    const StateTexels out = find();
    Mark before = Mark::none;
    if (mark.compare_exchange_strong(before, Mark::taken, std::memory_order_relaxed)) {
      texels_[node] = out;
      mark.store(Mark::found, std::memory_order_release);
    }
    return out;
  }
  /// Returns all nodes, with zeros for those that are not found.
  [[nodiscard]] std::span<const StateTexels> texels() const noexcept { return texels_; }

 private:
  enum class Mark : std::uint8_t { none, taken, found };

  mutable std::vector<StateTexels> texels_;
  std::unique_ptr<std::atomic<Mark>[]> marks_;
};

}  // namespace emit::renderer
