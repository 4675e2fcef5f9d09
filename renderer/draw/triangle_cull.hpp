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

/// Culling of single triangles for software rasterisers. It leaves out triangles that hold no
/// centre of a pixel, lie outside the image or face away, and it mixes the order of the rest. A
/// software rasteriser sorts triangles into screen tiles on one thread, at a tenth of a microsecond
/// each, before it finds that nothing of a triangle shows; then it fills the tiles on several
/// threads, one thread per tile. The image stays the same, bit for bit, except where surfaces
/// coincide.
///
/// Call order: add() for every mesh, finish(), then for each frame begin(), take() and close(),
/// run().
///
/// Owner: DrawnScene. Thread: the one of the renderer; run() computes on all cores. Real time:
/// add() and finish() are setup only, all other functions are RT-safe.
class TriangleCull {
 public:
  /// Largest number of indices that a frame can take; further clusters are drawn without culling.
  static constexpr std::size_t kMaxIndices = std::size_t{3} << 18U;

  TriangleCull() : workers_(threads::WorkerPool::all_cores()) {}
  /// Adds the clusters of a mesh. `first_index` is the number of the mesh's first index among the
  /// indices of all meshes. The order of the calls numbers the clusters, from 0.
  /// @pre Every cluster lies within the indices that end with this mesh; finish() was not called.
  void add(const scene::Mesh& mesh, std::span<const scene::Cluster> clusters,
           std::uint32_t first_index);
  /// Allocates the memory of a frame, after the last add().
  void finish();

  /// Starts a frame for a rendered image of `size_px`.
  void begin(const glm::uvec2& size_px) noexcept;
  /// Takes a cluster for run(). Returns false when the memory of the frame is used up; the caller
  /// then draws the cluster itself. `number` is the number that add() gave the cluster.
  /// `clip_from_mesh` is the matrix it is drawn with and must live until run() returns.
  /// @pre finish() was called and `number` exists.
  [[nodiscard]] bool take(const scene::Cluster& cluster, std::uint32_t number,
                          const glm::mat4& clip_from_mesh, bool single_sided) noexcept;
  /// Makes one part of all clusters that were taken since the last call. `range` is stored with the
  /// part for the caller. Returns false, and makes no part, when no cluster was taken.
  [[nodiscard]] bool close(std::uint32_t range) noexcept;
  /// Triangles that are left of the clusters of one close(). Neighbours lie apart: every piece of a
  /// part holds triangles from all of it. The parts follow each other in indices() without gaps.
  struct Part {
    std::uint32_t range = 0;     ///< argument of close()
    std::uint32_t first = 0;     ///< entry of indices()
    std::uint32_t count = 0;     ///< number of entries
    std::uint32_t clusters = 0;  ///< number of clusters that were taken
  };
  /// Culls all clusters that were taken. parts() and indices() are valid from then on.
  void run() noexcept;
  /// Parts of the frame in the order of close().
  [[nodiscard]] std::span<const Part> parts() const noexcept { return parts_; }
  /// Vertex indices of the triangles that are left, three per triangle.
  [[nodiscard]] std::span<const std::uint32_t> indices() const noexcept {
    return std::span(indices_).first(used_);
  }

 private:
  /// Largest number of vertices of a cluster that is culled, because corners are bytes.
  static constexpr std::size_t kMaxVertices = 256;

  /// Vertices of one cluster.
  struct Local {
    std::uint32_t first_vertex = 0;
    std::uint32_t vertices = 0;  ///< 0: the cluster is not culled, because it has too many
  };
  /// One cluster of the frame.
  struct Job {
    const scene::Cluster* cluster = nullptr;
    const glm::mat4* clip_from_mesh = nullptr;
    std::uint32_t number = 0;
    std::uint32_t first = 0;  ///< entry of uncut_
    std::uint32_t count = 0;  ///< number of indices that are left
    bool single_sided = true;
  };
  /// Vertices of a cluster in GL's window, pixels, held within a rim around the image.
  struct Placed {
    std::array<float, kMaxVertices> x_px;
    std::array<float, kMaxVertices> y_px;
  };
  /// Projects the vertices of a cluster. Returns false when some lie behind the camera or when the
  /// cluster has too many vertices.
  [[nodiscard]] bool place(const Job& job, Placed& placed) const noexcept;
  /// Writes the indices that are left of a cluster to `out` and returns their number.
  [[nodiscard]] std::uint32_t cull(const Job& job, std::uint32_t* out) const noexcept;

  threads::WorkerPool workers_;
  std::vector<Local> locals_;  ///< one entry per cluster
  std::vector<float> x_m_;     ///< one entry per local vertex, mesh coordinates
  std::vector<float> y_m_;
  std::vector<float> z_m_;
  std::vector<std::uint8_t> corners_;        ///< local vertex of each index
  std::vector<std::uint32_t> mesh_indices_;  ///< vertex of each index in its mesh
  glm::uvec2 size_px_{0};
  std::vector<Job> jobs_;
  std::uint32_t open_ = 0;  ///< jobs that are in no part yet
  std::vector<Part> parts_;
  std::vector<std::uint32_t> uncut_;  ///< results by job, with a gap after each
  std::vector<std::uint32_t> indices_;
  std::size_t used_ = 0;
};

}  // namespace emit::renderer
