// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/matrix_float4x4.hpp>
#include <glm/ext/vector_uint2.hpp>
#include <memory>
#include <span>
#include <vector>

#include "emit/scene/clusters.hpp"
#include "emit/scene/mesh.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {

/// Leaves out triangles that hold no pixel's middle, lie beside the picture or show their backs,
/// and mixes what is left: software rasterisers sort each into tiles on one thread, at a tenth of a
/// microsecond, before they find that nothing of it shows, and fill tiles on several threads, one
/// tile on one. What is drawn stays the same, bit for bit, but for surfaces that coincide.
///
/// Owner: DrawLists. Thread: the renderer's; computes on all cores. Real time: everything but the
/// constructor is RT-safe.
class TriangleCull {
 public:
  /// Of all clusters in one frame; what comes on top of that is drawn as it is.
  static constexpr std::size_t kMostIndices = std::size_t{3} << 18U;

  TriangleCull() : workers_(threads::WorkerPool::all_cores()) {}
  /// Adds the clusters of a mesh, whose indices start with number `first_index` of all: in the
  /// order of the clusters that are asked for.
  void add(const scene::Mesh& mesh, std::span<const scene::Cluster> clusters,
           std::uint32_t first_index);
  /// After the last add(): takes the memory of a frame.
  void finish();

  /// Starts a frame.
  void begin(const glm::uvec2& size_px) noexcept;
  /// While memory is left: true, and run() does it. `clip_from_mesh`: as it is drawn, valid until
  /// then.
  [[nodiscard]] bool take(const scene::Cluster& cluster, std::uint32_t number,
                          const glm::mat4& clip_from_mesh, bool single_sided) noexcept;
  /// What was taken since the last call becomes one part, `range` whatever the caller knows it by.
  /// False where that is nothing.
  [[nodiscard]] bool close(std::uint32_t range) noexcept;
  /// What is left of the clusters that were taken together: neighbours among them lie apart, and
  /// any piece of a part holds some from all of it. Parts follow each other in their order.
  struct Part {
    std::uint32_t range = 0;
    std::uint32_t first = 0;  ///< of indices()
    std::uint32_t count = 0;
    std::uint32_t clusters = 0;
  };
  void run() noexcept;
  [[nodiscard]] std::span<const Part> parts() const noexcept { return parts_; }
  [[nodiscard]] std::span<const std::uint32_t> indices() const noexcept {
    return std::span(indices_).first(used_);
  }

 private:
  static constexpr std::size_t kMostVertices = 256;  ///< of a cluster: corners are bytes

  /// A cluster with its vertices to itself.
  struct Local {
    std::uint32_t first_vertex = 0;
    std::uint32_t vertices = 0;  ///< 0: too many
  };
  struct Job {
    const scene::Cluster* cluster = nullptr;
    const glm::mat4* clip_from_mesh = nullptr;
    std::uint32_t number = 0;
    std::uint32_t first = 0;  ///< of uncut_
    std::uint32_t count = 0;  ///< what is left of it
    bool single_sided = true;
  };
  /// A cluster's vertices in GL's window, no farther than a rim from the picture.
  struct Placed {
    std::array<float, kMostVertices> x_px;
    std::array<float, kMostVertices> y_px;
  };
  /// False where some lie behind the camera, or there are too many.
  [[nodiscard]] bool place(const Job& job, Placed& placed) const noexcept;
  /// Writes the indices that are left of a cluster's; returns how many.
  [[nodiscard]] std::uint32_t cull(const Job& job, std::uint32_t* out) const noexcept;

  threads::WorkerPool workers_;
  std::vector<Local> locals_;  ///< by cluster
  std::vector<float> x_m_;     ///< by local vertex
  std::vector<float> y_m_;
  std::vector<float> z_m_;
  std::vector<std::uint8_t> corners_;        ///< by index: local vertex
  std::vector<std::uint32_t> mesh_indices_;  ///< by index
  glm::uvec2 size_px_{0};
  std::vector<Job> jobs_;
  std::uint32_t open_ = 0;  ///< jobs that are in no part yet
  std::vector<Part> parts_;
  std::vector<std::uint32_t> uncut_;  ///< with gaps: each cluster has place for all its triangles
  std::vector<std::uint32_t> indices_;
  std::size_t used_ = 0;
};

}  // namespace emit::renderer
