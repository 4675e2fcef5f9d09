// SPDX-License-Identifier: Apache-2.0
#include "passes/triangle_cull.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace emit::renderer {
namespace {

constexpr std::size_t kMostVertices = 256;  ///< of a cluster: corners are bytes
constexpr std::size_t kMostClusters = 1U << 14U;
/// Triangles that look larger than that on average, at most, are drawn as they are. Square pixels.
constexpr float kDensePx = 128.0F;
/// Rasterisers round to 1/256 pixel, and the device's arithmetic differs from this one's.
constexpr float kMarginPx = 1.0F / 64.0F;
/// Beyond the picture's rim nothing has to be told apart.
constexpr float kRimPx = 8.0F;
/// Where a triangle's box holds no more, each is tested whether the triangle holds it, too.
constexpr int kMostMiddles = 4;

/// Positive on the inner side of an edge, and by the margin beyond it.
struct Edge {
  float a = 0.0F;
  float b = 0.0F;
  float c = 0.0F;
  [[nodiscard]] bool holds(float x_px, float y_px) const noexcept {
    return a * x_px + b * y_px + c >= 0.0F;
  }
};

/// Corners in GL's window, `side` -1 for those that turn clockwise, else 1.
Edge edge(float x0, float y0, float x1, float y1, float side) noexcept {
  const float a = side * (y0 - y1);
  const float b = side * (x1 - x0);
  return {a, b, kMarginPx * (std::abs(a) + std::abs(b)) - a * x0 - b * y0};
}

/// Middles of pixels, (k + 0.5) px, between two places; k from kShift on.
struct Middles {
  static constexpr float kShift = 16.0F;  // what is cut off instead of rounded down is positive
  Middles(float low_px, float high_px) noexcept
      : first(static_cast<int>(low_px + (0.5F - kMarginPx + kShift))),
        count(static_cast<int>(high_px + (kMarginPx - 0.5F + kShift)) - first + 1) {}
  [[nodiscard]] float at_px(int i) const noexcept {
    return static_cast<float>(first + i) + (0.5F - kShift);
  }
  int first;
  int count;  ///< or less than 1
};

}  // namespace

void TriangleCull::add(const scene::Mesh& mesh, std::span<const scene::Cluster> clusters,
                       std::uint32_t first_index) {
  const std::size_t end = first_index + mesh.indices.size();
  if (corners_.size() < end) {
    corners_.resize(end);
    mesh_indices_.resize(end);
  }
  std::ranges::copy(mesh.indices, mesh_indices_.begin() + first_index);
  std::vector<std::uint32_t> own;
  for (const scene::Cluster& cluster : clusters) {
    Local& local = locals_.emplace_back();
    const auto indices = std::span(mesh_indices_).subspan(cluster.first_index, cluster.index_count);
    own.assign(indices.begin(), indices.end());
    std::ranges::sort(own);
    own.erase(std::ranges::unique(own).begin(), own.end());
    if (own.size() > kMostVertices || !std::isfinite(cluster.radius_m)) continue;
    local = {static_cast<std::uint32_t>(x_m_.size()), static_cast<std::uint32_t>(own.size())};
    for (const std::uint32_t v : own) {
      x_m_.push_back(mesh.positions_m[v].x);
      y_m_.push_back(mesh.positions_m[v].y);
      z_m_.push_back(mesh.positions_m[v].z);
    }
    for (std::size_t i = 0; i < indices.size(); ++i) {
      corners_[cluster.first_index + i] =
          static_cast<std::uint8_t>(std::ranges::lower_bound(own, indices[i]) - own.begin());
    }
  }
}

void TriangleCull::finish() {
  jobs_.reserve(kMostClusters);
  parts_.reserve(kMostClusters);
  indices_.resize(kMostIndices);
}

void TriangleCull::begin(const glm::uvec2& size_px) noexcept {
  size_px_ = size_px;
  jobs_.clear();
  parts_.clear();
  used_ = 0;
}

bool TriangleCull::take(const scene::Cluster& cluster, std::uint32_t number,
                        const glm::mat4& clip_from_mesh, bool single_sided,
                        std::uint32_t range) noexcept {
  if (locals_[number].vertices == 0 || jobs_.size() == jobs_.capacity() ||
      used_ + cluster.index_count > indices_.size()) {
    return false;
  }
  // Clip coordinates of a point change by so much per metre, at most.
  const glm::mat4& m = clip_from_mesh;
  const auto row = [&m](glm::length_t i) { return glm::vec3(m[0][i], m[1][i], m[2][i]); };
  const float boresight_m = glm::dot(row(3), cluster.centre_m) + m[3][3];
  if (!(boresight_m > cluster.radius_m * glm::length(row(3)))) return false;
  const float radius_px =
      0.5F * static_cast<float>(size_px_.x) * cluster.radius_m * glm::length(row(0)) / boresight_m;
  constexpr float kDisc = 3.14F;
  if (kDisc * radius_px * radius_px > kDensePx / 3.0F * static_cast<float>(cluster.index_count)) {
    return false;
  }
  jobs_.push_back({&cluster, &clip_from_mesh, number, single_sided});
  parts_.push_back({range, static_cast<std::uint32_t>(used_), 0});
  used_ += cluster.index_count;
  return true;
}

std::uint32_t TriangleCull::cull(const Job& job, std::uint32_t* out) const noexcept {
  const Local& local = locals_[job.number];
  const glm::mat4& m = *job.clip_from_mesh;
  const float* x_m = &x_m_[local.first_vertex];
  const float* y_m = &y_m_[local.first_vertex];
  const float* z_m = &z_m_[local.first_vertex];
  std::array<float, kMostVertices> x_px;
  std::array<float, kMostVertices> y_px;
  const float half_x = 0.5F * static_cast<float>(size_px_.x);
  const float half_y = 0.5F * static_cast<float>(size_px_.y);
  float least_w = 1.0F;
  for (std::uint32_t v = 0; v < local.vertices; ++v) {
    const float w = m[0][3] * x_m[v] + m[1][3] * y_m[v] + m[2][3] * z_m[v] + m[3][3];
    const float x = m[0][0] * x_m[v] + m[1][0] * y_m[v] + m[2][0] * z_m[v] + m[3][0];
    const float y = m[0][1] * x_m[v] + m[1][1] * y_m[v] + m[2][1] * z_m[v] + m[3][1];
    least_w = std::min(least_w, w);
    x_px[v] = std::clamp(half_x * (x / w) + half_x, -kRimPx, 2.0F * half_x + kRimPx);
    y_px[v] = std::clamp(half_y * (y / w) + half_y, -kRimPx, 2.0F * half_y + kRimPx);
  }
  const std::uint32_t* from = &mesh_indices_[job.cluster->first_index];
  if (!(least_w > 0.0F)) {  // behind the camera
    std::copy_n(from, job.cluster->index_count, out);
    return job.cluster->index_count;
  }
  const std::uint8_t* corner = &corners_[job.cluster->first_index];
  std::uint32_t count = 0;
  for (std::uint32_t i = 0; i < job.cluster->index_count; i += 3) {
    const float x0 = x_px[corner[i]];
    const float x1 = x_px[corner[i + 1]];
    const float x2 = x_px[corner[i + 2]];
    const float y0 = y_px[corner[i]];
    const float y1 = y_px[corner[i + 1]];
    const float y2 = y_px[corner[i + 2]];
    const float left = std::min({x0, x1, x2});
    const float right = std::max({x0, x1, x2});
    const float low = std::min({y0, y1, y2});
    const float high = std::max({y0, y1, y2});
    // Front faces turn clockwise in GL's window, whose first row is the picture's.
    const float turn = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
    const float around_px = (right - left) + (high - low);
    // Of what reaches beyond the rim the corners are not where they belong.
    const bool whole = left > -kRimPx && low > -kRimPx && right < 2.0F * half_x + kRimPx &&
                       high < 2.0F * half_y + kRimPx;
    const bool back =
        job.single_sided && whole && turn > 4.0F * kMarginPx * (around_px + kMarginPx);
    const Middles columns(left, right);
    const Middles rows(low, high);
    bool kept = !back && columns.count > 0 && rows.count > 0;
    // Those of what reaches beyond the rim are more than that, or not in the picture.
    static_assert(static_cast<float>(kMostMiddles) < kRimPx);
    if (kept && columns.count * rows.count <= kMostMiddles) {
      // Of the same rounded corners: needles, too, have their inside between their edges.
      const float side = turn < 0.0F ? -1.0F : 1.0F;
      const std::array<Edge, 3> edges = {edge(x0, y0, x1, y1, side), edge(x1, y1, x2, y2, side),
                                         edge(x2, y2, x0, y0, side)};
      kept = false;
      for (int at = 0; at < columns.count * rows.count && !kept; ++at) {
        const float x = columns.at_px(at % columns.count);
        const float y = rows.at_px(at / columns.count);
        kept = edges[0].holds(x, y) && edges[1].holds(x, y) && edges[2].holds(x, y);
      }
    }
    out[count] = from[i];
    out[count + 1] = from[i + 1];
    out[count + 2] = from[i + 2];
    count += kept ? 3 : 0;
  }
  return count;
}

void TriangleCull::run() noexcept {
  constexpr std::size_t kGrain = 8;
  workers_.run(jobs_.size(), kGrain, [this](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j) {
      parts_[j].count = cull(jobs_[j], &indices_[parts_[j].first]);
    }
  });
  // Without gaps, those of one draw are one range.
  std::size_t used = 0;
  for (Part& part : parts_) {
    std::copy_n(indices_.begin() + part.first, part.count,
                indices_.begin() + static_cast<std::ptrdiff_t>(used));
    part.first = static_cast<std::uint32_t>(used);
    used += part.count;
  }
  used_ = used;
}

}  // namespace emit::renderer
