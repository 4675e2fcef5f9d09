// SPDX-License-Identifier: Apache-2.0
#include "draw/triangle_cull.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_int2.hpp>
#include <numeric>

#include "emit/physics/check.hpp"

namespace emit::renderer {
namespace {

/// Largest number of clusters that a frame can take.
constexpr std::size_t kMaxClusters = 1U << 14U;
/// Margin of every test. Rasterisers round to 1/256 pixel, and the device's arithmetic differs from
/// this one.
constexpr float kMarginPx = 1.0F / 64.0F;
/// Width of the rim around the image. Positions beyond it need not be distinguished.
constexpr float kRimPx = 8.0F;
/// A triangle is tested line by line when its box holds at most this many rows or columns of pixel
/// centres.
constexpr int kMaxLines = 2;

/// Edge of a triangle as a linear function a x + b y + c of a position in pixels. It is positive on
/// the inner side, and up to the margin outside.
struct Edge {
  float a = 0.0F;
  float b = 0.0F;
  float c = 0.0F;
};

/// Edge between two corners in GL's window. `side` is -1 for a triangle that turns clockwise,
/// else 1.
Edge edge(float x0, float y0, float x1, float y1, float side) noexcept {
  const float a = side * (y0 - y1);
  const float b = side * (x1 - x0);
  return {a, b, kMarginPx * (std::abs(a) + std::abs(b)) - a * x0 - b * y0};
}

/// Centres of pixels between two positions along one axis. Pixel k has its centre at (k + 0.5) px.
struct Centres {
  /// Shift of pixel numbers that makes them positive, so that a conversion to int rounds down.
  static constexpr int kShift = 16;
  /// Centres in [low_px, high_px] of an image with `size_px` pixels along the axis.
  /// @pre Both positions lie at most kRimPx outside the image.
  Centres(float low_px, float high_px, int size_px) noexcept
      : first(std::max(static_cast<int>(low_px + (0.5F - kMarginPx + kShift)), kShift)),
        count(std::min(static_cast<int>(high_px + (kMarginPx - 0.5F + kShift)),
                       size_px - 1 + kShift) -
              first + 1) {
    EMIT_DCHECK_OP(low_px, >=, -kRimPx);
    EMIT_DCHECK_OP(high_px, <=, static_cast<float>(size_px) + kRimPx);
  }
  /// Position of centre i, 0 <= i < count.
  [[nodiscard]] float at_px(int i) const noexcept {
    return static_cast<float>(first + i) + (0.5F - kShift);
  }
  int first;  ///< number of the first pixel + kShift
  int count;  ///< less than 1 when there is none
};
static_assert(kRimPx + 0.5F < Centres::kShift);

/// True when all edges hold one of the centres `along` on the line at `line_px`.
template <float Edge::*kAlong, float Edge::*kAcross>
bool hold_any(const std::array<Edge, 3>& edges, const Centres& along, float line_px,
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
  return low_px <= high_px && Centres(low_px, high_px, size_px).count > 0;
}

// These functions take their arguments by value, so that compilers vectorise them.
float smallest(float a, float b, float c) noexcept {
  const float ab = a < b ? a : b;
  return ab < c ? ab : c;
}
float largest(float a, float b, float c) noexcept {
  const float ab = a > b ? a : b;
  return ab > c ? ab : c;
}
float within(float value, float low, float high) noexcept {
  const float above = value > low ? value : low;
  return above < high ? above : high;
}

/// Triangle with its corners in GL's window, pixels.
struct Triangle {
  float x0, x1, x2;
  float y0, y1, y2;
  [[nodiscard]] float left() const noexcept { return smallest(x0, x1, x2); }
  [[nodiscard]] float right() const noexcept { return largest(x0, x1, x2); }
  [[nodiscard]] float low() const noexcept { return smallest(y0, y1, y2); }
  [[nodiscard]] float high() const noexcept { return largest(y0, y1, y2); }
  /// Twice the signed area. Front faces turn clockwise and have less than 0, because the first row
  /// of GL's window is the first row of the image.
  [[nodiscard]] float turn_px2() const noexcept {
    return (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
  }
  [[nodiscard]] Centres columns(const glm::ivec2& size_px) const noexcept {
    return {left(), right(), size_px.x};
  }
  [[nodiscard]] Centres rows(const glm::ivec2& size_px) const noexcept {
    return {low(), high(), size_px.y};
  }
};

/// True when a triangle holds the centre of a pixel. It walks along rows or along columns,
/// whichever are fewer.
bool holds_centre(const Triangle& t, const glm::ivec2& size_px) noexcept {
  const float side = t.turn_px2() < 0.0F ? -1.0F : 1.0F;
  // Make all edges from the same rounded corners, so that a needle has its inside between them too.
  const std::array<Edge, 3> edges = {edge(t.x0, t.y0, t.x1, t.y1, side),
                                     edge(t.x1, t.y1, t.x2, t.y2, side),
                                     edge(t.x2, t.y2, t.x0, t.y0, side)};
  const Centres columns = t.columns(size_px);
  const Centres rows = t.rows(size_px);
  const bool by_row = rows.count <= columns.count;
  const Centres& lines = by_row ? rows : columns;
  for (int line = 0; line < lines.count; ++line) {
    const float at_px = lines.at_px(line);
    if (by_row ? hold_any<&Edge::a, &Edge::b>(edges, columns, at_px, size_px.x)
               : hold_any<&Edge::b, &Edge::a>(edges, rows, at_px, size_px.y)) {
      return true;
    }
  }
  return false;
}

/// Triangles of a cluster that are judged together, in vector registers.
struct Block {
  static constexpr std::uint32_t kMax = 64;
  enum Verdict : std::uint32_t { kGone, kKept, kSmall };
  std::uint32_t count = 0;
  std::array<std::array<float, kMax>, 3> x_px;  ///< positions of each corner
  std::array<std::array<float, kMax>, 3> y_px;
  std::array<std::uint32_t, kMax> verdict;

  [[nodiscard]] Triangle at(std::uint32_t t) const noexcept {
    return {x_px[0][t], x_px[1][t], x_px[2][t], y_px[0][t], y_px[1][t], y_px[2][t]};
  }
  /// Decides for every triangle whether it is gone, kept, or small enough for holds_centre(). The
  /// loop has no branch, because compilers vectorise nothing else.
  void judge(const glm::ivec2& size_px, bool single_sided) noexcept {
    const float max_x = static_cast<float>(size_px.x) + kRimPx;
    const float max_y = static_cast<float>(size_px.y) + kRimPx;
    for (std::uint32_t t = 0; t < count; ++t) {
      const Triangle each = at(t);
      const float left = each.left();
      const float right = each.right();
      const float low = each.low();
      const float high = each.high();
      const float around_px = (right - left) + (high - low);
      // Only a triangle within the rim has its corners where they belong.
      const bool whole = (left > -kRimPx) & (low > -kRimPx) & (right < max_x) & (high < max_y);
      const bool back =
          single_sided & whole & (each.turn_px2() > 4.0F * kMarginPx * (around_px + kMarginPx));
      const int columns = each.columns(size_px).count;
      const int rows = each.rows(size_px).count;
      const bool gone = back | (columns < 1) | (rows < 1);
      const bool small = whole & (std::min(columns, rows) <= kMaxLines);
      verdict[t] = gone ? kGone : small ? kSmall : kKept;
    }
  }
};

/// Step that visits each of `count` entries once when it is repeated modulo `count`. A few visits
/// in a row are spread over all entries.
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
  EMIT_CHECK(uncut_.empty());
  const std::size_t end = first_index + mesh.indices.size();
  if (corners_.size() < end) {
    corners_.resize(end);
    mesh_indices_.resize(end);
  }
  std::ranges::copy(mesh.indices, mesh_indices_.begin() + first_index);
  std::vector<std::uint32_t> own;
  // Give each cluster a copy of its vertices and byte indices into them.
  for (const scene::Cluster& cluster : clusters) {
    EMIT_CHECK_OP(std::size_t{cluster.first_index} + cluster.index_count, <=, end);
    Local& local = locals_.emplace_back();
    const auto indices = std::span(mesh_indices_).subspan(cluster.first_index, cluster.index_count);
    own.assign(indices.begin(), indices.end());
    std::ranges::sort(own);
    own.erase(std::unique(own.begin(), own.end()), own.end());
    if (own.size() > kMaxVertices || !std::isfinite(cluster.radius_m)) continue;
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
  jobs_.reserve(kMaxClusters);
  parts_.reserve(kMaxClusters);
  uncut_.resize(kMaxIndices);
  indices_.resize(kMaxIndices);
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
  EMIT_CHECK_OP(uncut_.size(), ==, kMaxIndices);
  EMIT_CHECK_OP(number, <, locals_.size());
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
  // Copy the matrix, so that the compiler knows that the stores below do not change it.
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
  // Project the vertices, hold them within the rim and count those in front of the camera.
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
  // Keep a cluster whole that cannot be projected.
  Placed placed;
  if (!place(job, placed)) {
    std::copy_n(from, job.cluster->index_count, out);
    return job.cluster->index_count;
  }
  const std::uint8_t* corner = &corners_[job.cluster->first_index];
  const std::uint32_t triangles = job.cluster->index_count / 3;
  const glm::ivec2 size_px(size_px_);
  std::uint32_t count = 0;
  for (std::uint32_t first = 0; first < triangles; first += Block::kMax) {
    // Gather the corners of the next triangles.
    Block block;
    block.count = std::min(Block::kMax, triangles - first);
    for (std::uint32_t t = 0; t < block.count; ++t) {
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint8_t v = corner[3 * (first + t) + k];
        block.x_px[k][t] = placed.x_px[v];
        block.y_px[k][t] = placed.y_px[v];
      }
    }
    // Judge them together and copy those that are left.
    block.judge(size_px, job.single_sided);
    for (std::uint32_t t = 0; t < block.count; ++t) {
      if (block.verdict[t] == Block::kGone) continue;
      if (block.verdict[t] == Block::kSmall && !holds_centre(block.at(t), size_px)) continue;
      std::copy_n(from + 3 * (first + t), 3, out + count);
      count += 3;
    }
  }
  return count;
}

void TriangleCull::run() noexcept {
  // Cull each cluster on its own, into its place of uncut_.
  constexpr std::size_t kGrain = 8;
  workers_.run(jobs_.size(), kGrain, [this](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j) {
      jobs_[j].count = cull(jobs_[j], &uncut_[jobs_[j].first]);
    }
  });
  // Join the results of each part without gaps, in an order that sets neighbours apart.
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
