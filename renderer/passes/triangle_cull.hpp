// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/matrix_float4x4.hpp>
#include <glm/ext/vector_uint2.hpp>
#include <memory>
#include <span>
#include <vector>

#include "emit/scene/clusters.hpp"
#include "emit/scene/mesh.hpp"
#include "surface/worker_pool.hpp"

namespace emit::renderer {

/// Leaves out triangles that hold no pixel's middle or show their backs, where they are dense:
/// software rasterisers sort each into tiles on one thread, at a tenth of a microsecond, before
/// they find that nothing of it shows. What is drawn stays the same, bit for bit.
///
/// Owner: DrawLists. Thread: the renderer's; computes on all cores. Real time: everything but the
/// constructor is RT-safe.
class TriangleCull {
 public:
  /// Of all clusters in one frame; what comes on top of that is drawn as it is.
  static constexpr std::size_t kMostIndices = std::size_t{3} << 18U;

  TriangleCull() : workers_(WorkerPool::all_cores()) {}
  /// Adds the clusters of a mesh, whose indices start with number `first_index` of all: in the
  /// order of the clusters that are asked for.
  void add(const scene::Mesh& mesh, std::span<const scene::Cluster> clusters,
           std::uint32_t first_index);
  /// After the last add(): takes the memory of a frame.
  void finish();

  /// Starts a frame.
  void begin(const glm::uvec2& size_px) noexcept;
  /// Where a cluster's triangles are so dense that it may be worth it, and memory is left: true,
  /// and it is done by run(). `clip_from_mesh`: as it is drawn, valid until then; `range`: whatever
  /// the caller knows it by.
  [[nodiscard]] bool take(const scene::Cluster& cluster, std::uint32_t number,
                          const glm::mat4& clip_from_mesh, bool single_sided,
                          std::uint32_t range) noexcept;
  /// What is left of the clusters that were taken, in their order.
  struct Part {
    std::uint32_t range = 0;
    std::uint32_t first = 0;  ///< of indices()
    std::uint32_t count = 0;
  };
  void run() noexcept;
  [[nodiscard]] std::span<const Part> parts() const noexcept { return parts_; }
  [[nodiscard]] std::span<const std::uint32_t> indices() const noexcept {
    return std::span(indices_).first(used_);
  }

 private:
  /// A cluster with its vertices to itself.
  struct Local {
    std::uint32_t first_vertex = 0;
    std::uint32_t vertices = 0;  ///< 0: too many
  };
  struct Job {
    const scene::Cluster* cluster = nullptr;
    const glm::mat4* clip_from_mesh = nullptr;
    std::uint32_t number = 0;
    bool single_sided = true;
  };
  [[nodiscard]] std::uint32_t cull(const Job& job, std::uint32_t* out) const noexcept;

  WorkerPool workers_;
  std::vector<Local> locals_;  ///< by cluster
  std::vector<float> x_m_;     ///< by local vertex
  std::vector<float> y_m_;
  std::vector<float> z_m_;
  std::vector<std::uint8_t> corners_;        ///< by index: local vertex
  std::vector<std::uint32_t> mesh_indices_;  ///< by index
  glm::uvec2 size_px_{0};
  std::vector<Job> jobs_;
  std::vector<Part> parts_;
  std::vector<std::uint32_t> indices_;
  std::size_t used_ = 0;
};

}  // namespace emit::renderer
