// SPDX-License-Identifier: Apache-2.0
#include "draw/triangle_cull.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_int2.hpp>
#include <numeric>

namespace emit::renderer {
namespace {

constexpr std::size_t kMostClusters = 1U << 14U;
/// Rasterisers round to 1/256 pixel, and the device's arithmetic differs from this one's.
constexpr float kMarginPx = 1.0F / 64.0F;
/// Beyond the picture's rim nothing has to be told apart.
constexpr float kRimPx = 8.0F;
/// Where a triangle's box holds no more rows or no more columns of middles, these are tested, too.
constexpr int kMostLines = 2;

/// Positive on the inner side of an edge, and by the margin beyond it.
struct Edge {
  float a = 0.0F;
  float b = 0.0F;
  float c = 0.0F;
};

/// Corners in GL's window, `side` -1 for those that turn clockwise, else 1.
Edge edge(float x0, float y0, float x1, float y1, float side) noexcept {
  const float a = side * (y0 - y1);
  const float b = side * (x1 - x0);
  return {a, b, kMarginPx * (std::abs(a) + std::abs(b)) - a * x0 - b * y0};
}

/// Middles of the picture's pixels, (k + 0.5) px, between two places; k from kShift on.
struct Middles {
  static constexpr int kShift = 16;  // what is cut off instead of rounded down is positive
  /// Precondition: places no farther than the rim from the picture, `size_px` wide.
  Middles(float low_px, float high_px, int size_px) noexcept
      : first(std::max(static_cast<int>(low_px + (0.5F - kMarginPx + kShift)), kShift)),
        count(std::min(static_cast<int>(high_px + (kMarginPx - 0.5F + kShift)),
                       size_px - 1 + kShift) -
              first + 1) {}
  [[nodiscard]] float at_px(int i) const noexcept {
    return static_cast<float>(first + i) + (0.5F - kShift);
  }
  int first;
  int count;  ///< or less than 1
};
static_assert(kRimPx + 0.5F < Middles::kShift);

/// True when all edges hold one of the middles along a line at `line_px`.
template <float Edge::*kAlong, float Edge::*kAcross>
bool hold_any(const std::array<Edge, 3>& edges, const Middles& along, float line_px,
              int size_px) noexcept {
  float low_px = along.at_px(0);
  float high_px = along.at_px(along.count - 1);
  for (const Edge& each : edges) {
    const float rest = each.*kAcross * line_px + each.c;
    const float slope = each.*kAlong;
    if (slope > 0.0F) {
      low_px = std::max(low_px, -rest / slope);
    } else if (slope < 0.0F) {
      high_px = std::min(high_px, -rest / slope);
    } else if (rest < 0.0F) {
      return false;
    }
  }
  return low_px <= high_px && Middles(low_px, high_px, size_px).count > 0;
}

// By value: compilers make vectors of these.
float least(float a, float b, float c) noexcept {
  const float ab = a < b ? a : b;
  return ab < c ? ab : c;
}
float most(float a, float b, float c) noexcept {
  const float ab = a > b ? a : b;
  return ab > c ? ab : c;
}
float within(float value, float low, float high) noexcept {
  const float above = value > low ? value : low;
  return above < high ? above : high;
}

/// Corners in GL's window, pixels.
struct Triangle {
  float x0, x1, x2;
  float y0, y1, y2;
  [[nodiscard]] float left() const noexcept { return least(x0, x1, x2); }
  [[nodiscard]] float right() const noexcept { return most(x0, x1, x2); }
  [[nodiscard]] float low() const noexcept { return least(y0, y1, y2); }
  [[nodiscard]] float high() const noexcept { return most(y0, y1, y2); }
  /// Twice its area; front faces turn clockwise, less than 0: the window's first row is the
  /// picture's.
  [[nodiscard]] float turn_px2() const noexcept {
    return (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
  }
  [[nodiscard]] Middles columns(const glm::ivec2& size_px) const noexcept {
    return {left(), right(), size_px.x};
  }
  [[nodiscard]] Middles rows(const glm::ivec2& size_px) const noexcept {
    return {low(), high(), size_px.y};
  }
};

/// True when a triangle holds the middle of a pixel: by its rows or columns, of which there are
/// fewer.
bool holds_middle(const Triangle& t, const glm::ivec2& size_px) noexcept {
  const float side = t.turn_px2() < 0.0F ? -1.0F : 1.0F;
  // Of the same rounded corners: needles, too, have their inside between their edges.
  const std::array<Edge, 3> edges = {edge(t.x0, t.y0, t.x1, t.y1, side),
                                     edge(t.x1, t.y1, t.x2, t.y2, side),
                                     edge(t.x2, t.y2, t.x0, t.y0, side)};
  const Middles columns = t.columns(size_px);
  const Middles rows = t.rows(size_px);
  const bool by_row = rows.count <= columns.count;
  const Middles& lines = by_row ? rows : columns;
  for (int line = 0; line < lines.count; ++line) {
    const float at_px = lines.at_px(line);
    if (by_row ? hold_any<&Edge::a, &Edge::b>(edges, columns, at_px, size_px.x)
               : hold_any<&Edge::b, &Edge::a>(edges, rows, at_px, size_px.y)) {
      return true;
    }
  }
  return false;
}

/// Triangles of a cluster that are judged together, as vectors.
struct Block {
  static constexpr std::uint32_t kMost = 64;
  enum Verdict : std::uint32_t { kGone, kKept, kSmall };
  std::uint32_t count = 0;
  std::array<std::array<float, kMost>, 3> x_px;  ///< by corner
  std::array<std::array<float, kMost>, 3> y_px;
  std::array<std::uint32_t, kMost> verdict;

  [[nodiscard]] Triangle at(std::uint32_t t) const noexcept {
    return {x_px[0][t], x_px[1][t], x_px[2][t], y_px[0][t], y_px[1][t], y_px[2][t]};
  }
  /// Without branches: compilers make vectors only of that.
  void judge(const glm::ivec2& size_px, bool single_sided) noexcept {
    const float most_x = static_cast<float>(size_px.x) + kRimPx;
    const float most_y = static_cast<float>(size_px.y) + kRimPx;
    for (std::uint32_t t = 0; t < count; ++t) {
      const Triangle each = at(t);
      const float left = each.left();
      const float right = each.right();
      const float low = each.low();
      const float high = each.high();
      const float around_px = (right - left) + (high - low);
      // Of what reaches beyond the rim the corners are not where they belong.
      const bool whole = (left > -kRimPx) & (low > -kRimPx) & (right < most_x) & (high < most_y);
      const bool back =
          single_sided & whole & (each.turn_px2() > 4.0F * kMarginPx * (around_px + kMarginPx));
      const int columns = each.columns(size_px).count;
      const int rows = each.rows(size_px).count;
      const bool gone = back | (columns < 1) | (rows < 1);
      const bool small = whole & (std::min(columns, rows) <= kMostLines);
      verdict[t] = gone ? kGone : small ? kSmall : kKept;
    }
  }
};

/// Steps of this size through so many come to each once, and any few of them in a row to all parts.
std::size_t spreading_stride(std::size_t count) noexcept {
  constexpr double kGoldenRatio = 0.618;
  auto stride =
      std::max(std::size_t{1}, static_cast<std::size_t>(kGoldenRatio * static_cast<double>(count)));
  while (std::gcd(stride, count) != 1) ++stride;
  return stride;
}

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
  uncut_.resize(kMostIndices);
  indices_.resize(kMostIndices);
}

void TriangleCull::begin(const glm::uvec2& size_px) noexcept {
  size_px_ = size_px;
  jobs_.clear();
  parts_.clear();
  open_ = 0;
  used_ = 0;
}

bool TriangleCull::take(const scene::Cluster& cluster, std::uint32_t number,
                        const glm::mat4& clip_from_mesh, bool single_sided) noexcept {
  if (jobs_.size() == jobs_.capacity() || used_ + cluster.index_count > uncut_.size()) return false;
  jobs_.push_back(
      {&cluster, &clip_from_mesh, number, static_cast<std::uint32_t>(used_), 0, single_sided});
  used_ += cluster.index_count;
  ++open_;
  return true;
}

bool TriangleCull::close(std::uint32_t range) noexcept {
  if (open_ == 0) return false;
  parts_.push_back({range, 0, 0, open_});
  open_ = 0;
  return true;
}

bool TriangleCull::place(const Job& job, Placed& placed) const noexcept {
  const Local& local = locals_[job.number];
  if (local.vertices == 0) return false;
  // By value: nothing that is written below changes it.
  const glm::mat4 m = *job.clip_from_mesh;
  const std::array<float, 4> row_x = {m[0][0], m[1][0], m[2][0], m[3][0]};
  const std::array<float, 4> row_y = {m[0][1], m[1][1], m[2][1], m[3][1]};
  const std::array<float, 4> row_w = {m[0][3], m[1][3], m[2][3], m[3][3]};
  const float* x_m = &x_m_[local.first_vertex];
  const float* y_m = &y_m_[local.first_vertex];
  const float* z_m = &z_m_[local.first_vertex];
  const glm::vec2 half(0.5F * glm::vec2(size_px_));
  const float half_x = half.x;
  const float half_y = half.y;
  std::uint32_t in_front = 0;
  for (std::uint32_t v = 0; v < local.vertices; ++v) {
    const float w = row_w[0] * x_m[v] + row_w[1] * y_m[v] + row_w[2] * z_m[v] + row_w[3];
    const float x = row_x[0] * x_m[v] + row_x[1] * y_m[v] + row_x[2] * z_m[v] + row_x[3];
    const float y = row_y[0] * x_m[v] + row_y[1] * y_m[v] + row_y[2] * z_m[v] + row_y[3];
    in_front += w > 0.0F ? 1U : 0U;
    placed.x_px[v] = within(half_x * (x / w) + half_x, -kRimPx, 2.0F * half_x + kRimPx);
    placed.y_px[v] = within(half_y * (y / w) + half_y, -kRimPx, 2.0F * half_y + kRimPx);
  }
  return in_front == local.vertices;
}

std::uint32_t TriangleCull::cull(const Job& job, std::uint32_t* out) const noexcept {
  const std::uint32_t* from = &mesh_indices_[job.cluster->first_index];
  Placed placed;
  if (!place(job, placed)) {
    std::copy_n(from, job.cluster->index_count, out);
    return job.cluster->index_count;
  }
  const std::uint8_t* corner = &corners_[job.cluster->first_index];
  const std::uint32_t triangles = job.cluster->index_count / 3;
  const glm::ivec2 size_px(size_px_);
  std::uint32_t count = 0;
  for (std::uint32_t first = 0; first < triangles; first += Block::kMost) {
    Block block;
    block.count = std::min(Block::kMost, triangles - first);
    for (std::uint32_t t = 0; t < block.count; ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint8_t v = corner[3 * (first + t) + k];
        block.x_px[k][t] = placed.x_px[v];
        block.y_px[k][t] = placed.y_px[v];
      }
    }
    block.judge(size_px, job.single_sided);
    for (std::uint32_t t = 0; t < block.count; ++t) {
      if (block.verdict[t] == Block::kGone) continue;
      if (block.verdict[t] == Block::kSmall && !holds_middle(block.at(t), size_px)) continue;
      std::copy_n(from + 3 * (first + t), 3, out + count);
      count += 3;
    }
  }
  return count;
}

void TriangleCull::run() noexcept {
  constexpr std::size_t kGrain = 8;
  workers_.run(jobs_.size(), kGrain, [this](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j) {
      jobs_[j].count = cull(jobs_[j], &uncut_[jobs_[j].first]);
    }
  });
  std::size_t used = 0;
  std::size_t first_job = 0;
  for (Part& part : parts_) {
    part.first = static_cast<std::uint32_t>(used);
    const std::size_t stride = spreading_stride(part.clusters);
    for (std::size_t i = 0, at = 0; i < part.clusters; ++i, at = (at + stride) % part.clusters) {
      const Job& job = jobs_[first_job + at];
      std::copy_n(uncut_.begin() + job.first, job.count,
                  indices_.begin() + static_cast<std::ptrdiff_t>(used));
      used += job.count;
    }
    part.count = static_cast<std::uint32_t>(used) - part.first;
    first_job += part.clusters;
  }
  used_ = used;
}

}  // namespace emit::renderer
