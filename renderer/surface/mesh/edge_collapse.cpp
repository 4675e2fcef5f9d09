// SPDX-License-Identifier: Apache-2.0
#include "surface/mesh/edge_collapse.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <queue>
#include <utility>

#include "surface/mesh/nearest_triangle.hpp"

namespace emit::renderer {
namespace {

/// Width in pixels that the distance of a lost place from the surface must reach to be visible.
constexpr float kDeviationPx = 0.25F;
/// Width in pixels that the longest edge of a triangle with a wrong temperature must reach to be
/// visible.
constexpr float kEdgePx = 0.5F;
/// Width in pixels that the longest edge of any new triangle must reach to be visible.
constexpr float kSizePx = 4.0F;
/// Smallest cosine of the angle by which a triangle may turn in a collapse.
constexpr float kMinTurnCosine = 0.25F;

/// Number of neighbours, the nearest ones, that a place may be collapsed into.
constexpr std::size_t kTried = 4;

/// Cost of a collapse that is not allowed.
constexpr float kNever = std::numeric_limits<float>::infinity();

using Corners = std::array<std::uint32_t, 3>;

/// Collapse of a place into its best neighbour, as an entry of the queue.
struct Candidate {
  /// Width of a pixel, at the surface, from which on nobody sees the collapse.
  float cost_m = kNever;
  std::uint32_t from = 0;
  std::uint32_t to = 0;
  /// Entry of `stamp_` at the time of the offer. The offer is void once the two differ.
  std::uint32_t stamp = 0;
  bool operator<(const Candidate& other) const noexcept {  // the cheapest on top of a heap
    return std::pair(cost_m, from) > std::pair(other.cost_m, other.from);
  }
};

/// State of one call of collapse_edges().
class Collapse {
 public:
  explicit Collapse(const CollapseInput& input);
  std::vector<std::uint32_t> run(std::size_t triangles);

 private:
  [[nodiscard]] std::uint32_t place(std::uint32_t vertex) const noexcept {
    return in_.place[vertex];
  }
  /// Returns whether a triangle has a corner at the place `at`.
  [[nodiscard]] bool has(std::uint32_t triangle, std::uint32_t at) const noexcept {
    const Corners& c = corners_[triangle];
    return place(c[0]) == at || place(c[1]) == at || place(c[2]) == at;
  }
  /// Locks the places on edges that do not have exactly two triangles, and on degenerate triangles.
  void lock_rims();
  /// Lists the places that share a triangle with `at`, each once, and marks them.
  void gather_ring(std::uint32_t at, std::vector<std::uint32_t>& ring);
  /// Returns how many places share a triangle with `at` and carry the mark `mark`.
  [[nodiscard]] std::size_t count_marked(std::uint32_t at, std::uint32_t mark);
  /// Finds, for each vertex of the place `from`, the vertex of `to` that takes over from it.
  /// Returns false if one of them has none or two.
  [[nodiscard]] bool pair_up(std::uint32_t from, std::uint32_t to);
  /// Returns the vertex that takes over from `vertex` (see pair_up()), or `vertex` itself.
  [[nodiscard]] std::uint32_t partner(std::uint32_t vertex) const noexcept;
  /// Returns the cost of collapsing `from` into `to`, or kNever.
  [[nodiscard]] float cost_m(std::uint32_t from, std::uint32_t to);
  /// Puts the cheapest collapse of `from` into the queue; its earlier offers become void.
  void offer(std::uint32_t from);
  /// Collapses `from` into `to`, which must be allowed.
  void collapse(std::uint32_t from, std::uint32_t to);

  const CollapseInput& in_;
  std::vector<Corners> corners_;
  std::vector<bool> alive_;
  std::size_t left_ = 0;                          ///< number of triangles that are alive
  std::vector<std::vector<std::uint32_t>> star_;  ///< triangles of each place
  std::vector<bool> locked_;                      ///< by place; true: it must stay
  std::vector<std::uint32_t> stamp_;              ///< number of offers so far, by place
  std::priority_queue<Candidate> queue_;
  // Scratch of the calls, kept to save allocations.
  std::vector<std::uint32_t> mark_;  ///< by place; number of the latest list that holds it
  std::uint32_t latest_mark_ = 0;
  std::uint32_t ring_mark_ = 0;  ///< mark of the places in `ring_`
  std::vector<std::uint32_t> ring_;
  std::vector<std::uint32_t> counted_;
  std::vector<std::pair<float, std::uint32_t>> nearest_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> partners_;
  /// Triangle of `from` after the collapse: its new corners.
  struct Turned {
    std::array<glm::vec3, 3> at_m;
    Corners corners;
    std::uint32_t moved = 0;  ///< vertex of `from` that it had before
  };
  std::vector<Turned> turned_;
};

Collapse::Collapse(const CollapseInput& input)
    : in_(input),
      corners_(input.indices.size() / 3),
      alive_(corners_.size(), true),
      left_(corners_.size()),
      star_(input.positions_m.size()),
      locked_(input.positions_m.size(), false),
      stamp_(input.positions_m.size(), 0),
      mark_(input.positions_m.size(), 0) {
  for (std::uint32_t t = 0; t < corners_.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      corners_[t][k] = input.indices[3 * std::size_t{t} + k];
      star_[place(corners_[t][k])].push_back(t);
    }
  }
  lock_rims();
}

void Collapse::lock_rims() {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (const Corners& c : corners_) {
    for (std::size_t k = 0; k < 3; ++k) {
      edges.emplace_back(std::minmax(place(c[k]), place(c[(k + 1) % 3])));
    }
  }
  // Sort the edges so that those between the same two places lie together, and count them.
  std::ranges::sort(edges);
  for (std::size_t first = 0; first < edges.size();) {
    std::size_t end = first;
    while (end < edges.size() && edges[end] == edges[first]) ++end;
    if (end - first != 2 || edges[first].first == edges[first].second) {
      locked_[edges[first].first] = true;
      locked_[edges[first].second] = true;
    }
    first = end;
  }
}

void Collapse::gather_ring(std::uint32_t at, std::vector<std::uint32_t>& ring) {
  ring.clear();
  ++latest_mark_;
  for (const std::uint32_t t : star_[at]) {
    for (const std::uint32_t v : corners_[t]) {
      const std::uint32_t other = place(v);
      if (other == at || mark_[other] == latest_mark_) continue;
      mark_[other] = latest_mark_;
      ring.push_back(other);
    }
  }
}

std::size_t Collapse::count_marked(std::uint32_t at, std::uint32_t mark) {
  counted_.clear();
  for (const std::uint32_t t : star_[at]) {
    for (const std::uint32_t v : corners_[t]) {
      const std::uint32_t other = place(v);
      if (other == at || mark_[other] != mark) continue;
      // Take the mark off, so that the place counts once.
      mark_[other] = 0;
      counted_.push_back(other);
    }
  }
  for (const std::uint32_t other : counted_) mark_[other] = mark;
  return counted_.size();
}

bool Collapse::pair_up(std::uint32_t from, std::uint32_t to) {
  partners_.clear();
  for (const std::uint32_t t : star_[from]) {
    for (const std::uint32_t v : corners_[t]) {
      if (place(v) != from) continue;
      // Enter each copy of `from` once, without a partner yet.
      auto known = std::ranges::find(partners_, v, &std::pair<std::uint32_t, std::uint32_t>::first);
      if (known == partners_.end()) {
        partners_.emplace_back(v, v);
        known = partners_.end() - 1;
      }
      for (const std::uint32_t u : corners_[t]) {
        if (place(u) != to) continue;
        // Refuse a second partner: a crease would be torn.
        if (known->second != v && known->second != u) return false;
        known->second = u;
      }
    }
  }
  return std::ranges::all_of(partners_, [](const auto& pair) { return pair.first != pair.second; });
}

std::uint32_t Collapse::partner(std::uint32_t vertex) const noexcept {
  for (const auto& [from, to] : partners_) {
    if (from == vertex) return to;
  }
  return vertex;
}

float Collapse::cost_m(std::uint32_t from, std::uint32_t to) {
  if (!pair_up(from, to)) return kNever;
  if (count_marked(to, ring_mark_) != 2) return kNever;  // else the surface would branch
  turned_.clear();
  for (const std::uint32_t t : star_[from]) {
    if (has(t, to)) continue;
    // Move the corner of every triangle that survives, and refuse triangles that turn too far.
    Turned turned;
    std::array<glm::vec3, 3> before_m;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = corners_[t][k];
      before_m[k] = in_.positions_m[v];
      if (place(v) == from) turned.moved = v;
      turned.corners[k] = place(v) == from ? partner(v) : v;
      turned.at_m[k] = in_.positions_m[turned.corners[k]];
    }
    const auto normal = [](const std::array<glm::vec3, 3>& p) {
      return glm::cross(p[1] - p[0], p[2] - p[0]);
    };
    const glm::vec3 old_normal = normal(before_m);
    const glm::vec3 new_normal = normal(turned.at_m);
    if (!(glm::dot(old_normal, new_normal) >
          kMinTurnCosine * glm::length(old_normal) * glm::length(new_normal))) {
      return kNever;
    }
    turned_.push_back(turned);
  }
  // Find the loss at every copy of `from`: it lies nearest to one of the new triangles of its own
  // side.
  float cost_m = 0.0F;
  for (const auto& [vertex, heir] : partners_) {
    const glm::vec3& at_m = in_.positions_m[vertex];
    float best_m = kNever;
    float longest_m = glm::distance(at_m, in_.positions_m[heir]);
    float difference_k = 0.0F;
    for (const Turned& turned : turned_) {
      if (turned.moved != vertex) continue;
      const glm::vec3 weight = nearest_weight(turned.at_m, at_m);
      glm::vec3 there_m(0.0F);
      for (glm::length_t k = 0; k < 3; ++k) {
        there_m += weight[k] * turned.at_m[static_cast<std::size_t>(k)];
      }
      const float distance_m = glm::distance(there_m, at_m);
      if (distance_m >= best_m) continue;
      // Compare the temperature at the nearest point with that of the vertex.
      best_m = distance_m;
      difference_k = 0.0F;
      for (const std::span<const float> value_k : in_.values_k) {
        float there_k = 0.0F;
        for (glm::length_t k = 0; k < 3; ++k) {
          there_k += weight[k] * value_k[turned.corners[static_cast<std::size_t>(k)]];
        }
        difference_k = std::max(difference_k, std::abs(there_k - value_k[vertex]));
      }
      for (std::size_t k = 0; k < 3; ++k) {
        longest_m = std::max(longest_m, glm::distance(turned.at_m[k], turned.at_m[(k + 1) % 3]));
      }
    }
    if (best_m == kNever) best_m = longest_m;  // all triangles of its side vanish
    // Combine what may show: distance, wrong temperature, and the size of the triangles.
    const float share = std::min(1.0F, difference_k / in_.tolerance_k);
    cost_m =
        std::max({cost_m, best_m / kDeviationPx, share * longest_m / kEdgePx, longest_m / kSizePx});
  }
  return cost_m;
}

void Collapse::offer(std::uint32_t from) {
  ++stamp_[from];
  if (locked_[from] || star_[from].empty()) return;
  gather_ring(from, ring_);
  ring_mark_ = latest_mark_;
  // Choose the nearest neighbours.
  nearest_.clear();
  for (const std::uint32_t to : ring_) {
    nearest_.emplace_back(glm::distance(in_.positions_m[from], in_.positions_m[to]), to);
  }
  const auto tried = static_cast<std::ptrdiff_t>(std::min(kTried, nearest_.size()));
  std::ranges::partial_sort(nearest_, nearest_.begin() + tried);
  nearest_.resize(static_cast<std::size_t>(tried));
  // Offer the cheapest collapse that is allowed.
  Candidate best;
  best.from = from;
  best.stamp = stamp_[from];
  for (const auto& [distance_m, to] : nearest_) {
    const float cost = cost_m(from, to);
    if (cost < best.cost_m) {
      best.cost_m = cost;
      best.to = to;
    }
  }
  if (best.cost_m < kNever) queue_.push(best);
}

void Collapse::collapse(std::uint32_t from, std::uint32_t to) {
  // Pair the copies as when this was offered: nothing around has changed since.
  (void)pair_up(from, to);
  for (const std::uint32_t t : star_[from]) {
    // Remove triangles that have both places, and hand the others over to `to`.
    if (has(t, to)) {
      alive_[t] = false;
      --left_;
      for (const std::uint32_t v : corners_[t]) {
        if (place(v) != from) std::erase(star_[place(v)], t);
      }
      continue;
    }
    for (std::uint32_t& v : corners_[t]) v = partner(v);
    star_[to].push_back(t);
  }
  star_[from].clear();
}

std::vector<std::uint32_t> Collapse::run(std::size_t triangles) {
  for (std::uint32_t at = 0; at < star_.size(); ++at) {
    if (!star_[at].empty()) offer(at);
  }
  // Collapse the cheapest candidate, then offer its surroundings anew.
  std::vector<std::uint32_t> changed;
  while (left_ > triangles && !queue_.empty()) {
    const Candidate next = queue_.top();
    queue_.pop();
    if (next.stamp != stamp_[next.from]) continue;
    collapse(next.from, next.to);
    gather_ring(next.to, changed);
    changed.push_back(next.to);
    for (const std::uint32_t at : changed) offer(at);
  }
  // Gather the triangles that are left.
  std::vector<std::uint32_t> indices;
  indices.reserve(3 * left_);
  for (std::size_t t = 0; t < corners_.size(); ++t) {
    if (alive_[t]) indices.insert(indices.end(), corners_[t].begin(), corners_[t].end());
  }
  return indices;
}

}  // namespace

std::vector<std::uint32_t> collapse_edges(const CollapseInput& input, std::size_t triangles) {
  return Collapse(input).run(triangles);
}

}  // namespace emit::renderer
