// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "surface/heat/surface_node.hpp"
#include "surface/run/local_steps.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {

/// The three nodes of time of a cached surface: before now (0), after now (1), and the one that is
/// being computed (2). Their storage rotates when an interval ends.
///
/// Owner: CachedSurface. Thread: the renderer's; cut() computes on all cores. Real time: everything
/// but begin() is RT-safe.
class SurfaceNodes {
 public:
  /// Makes node 0 of these states, outputs and interiors of bodies, and takes memory for the
  /// others. The first `drawn` samples of `all` are drawn. Samples see others in `bands` bands,
  /// from 0 on. @pre states and outputs have equal sizes
  void begin(std::vector<SampleState> states, std::vector<SampleOutput> outputs,
             const SurfaceSamples& all, std::uint32_t drawn, std::span<const double> body_k,
             std::size_t bands);

  /// A node. @pre index < 3
  [[nodiscard]] SurfaceNode& operator[](std::size_t index) noexcept {
    return nodes_[storage(index)];
  }
  [[nodiscard]] const SurfaceNode& operator[](std::size_t index) const noexcept {
    return nodes_[storage(index)];
  }
  /// Index of the storage that a node has. @pre index < 3
  [[nodiscard]] std::size_t storage(std::size_t index) const noexcept;
  /// The node in a storage. @pre storage < 3
  [[nodiscard]] const SurfaceNode& stored(std::size_t storage) const noexcept;
  /// Makes node 1 the node before now, and node 2 the one after now. The storage of node 0 becomes
  /// that of node 2.
  void rotate() noexcept;

  /// Moves node 0 to `event_ns`, to the values between it and node 1. The vertices of node 1 move
  /// to `end_ns` along the same line; its states and outputs stay, because they are computed anew.
  /// Samples with a clock of their own keep their states.
  void cut(std::int64_t event_ns, std::int64_t end_ns, const LocalSteps& local,
           const SurfaceSamples& all, threads::WorkerPool& workers) noexcept;

  void mark_all_changed() noexcept;
  void forget_changes() noexcept;
  static void forget_changes(SurfaceNode& node) noexcept;

  /// Place of an instant between nodes 0 and 1, 0 to 1.
  [[nodiscard]] float fraction(std::int64_t now_ns) const noexcept;
  /// Temperature of the surroundings in K between nodes 0 and 1; empty if the thermal model does
  /// not compute it.
  [[nodiscard]] std::optional<double> surroundings_k(float fraction) const noexcept;
  /// Main memory of the nodes in bytes.
  [[nodiscard]] std::uint64_t bytes() const noexcept;

 private:
  static void mark_changed(SurfaceNode& node) noexcept;

  std::array<SurfaceNode, 3> nodes_;
  std::size_t ring_ = 0;  ///< storage of node 0
};

}  // namespace emit::renderer
