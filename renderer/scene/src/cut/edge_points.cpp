// SPDX-License-Identifier: Apache-2.0
#include "edge_points.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <map>
#include <optional>
#include <tuple>
#include <unordered_map>
#include <utility>

namespace emit::scene {
namespace {

/// Points of an edge that are nearer to each other than this share of it are one.
constexpr double kSameShare = 1e-7;

using Key = std::array<double, 6>;

/// An edge that was cut, whichever of its triangles it was seen from.
struct Edge {
  glm::dvec3 low{0.0};  ///< the end that comes first in the order of coordinates
  glm::dvec3 high{0.0};
  std::vector<double> shares;  ///< of the end `high`, ascending

  [[nodiscard]] glm::dvec3 point(std::size_t i) const { return low + shares[i] * (high - low); }
};

bool comes_first(const glm::dvec3& a, const glm::dvec3& b) {
  return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
}

/// Place of a vertex on an edge: 0 and the number of shares plus one are its ends.
struct Place {
  Edge* edge = nullptr;
  std::size_t index = 0;
};

class Edges {
 public:
  void add(const EdgeSurface& surface) {
    for (const EdgePoint& point : surface.edge_points) {
      const auto [first, second] = ends(surface, point);
      Edge& edge = edges_.try_emplace(key(first, second)).first->second;
      edge.low = comes_first(first, second) ? first : second;
      edge.high = comes_first(first, second) ? second : first;
      edge.shares.push_back(share_of_high(surface, point));
    }
  }

  void join() {
    for (auto& [key, edge] : edges_) {
      std::ranges::sort(edge.shares);
      const auto rest =
          std::ranges::unique(edge.shares, [](double a, double b) { return b - a < kSameShare; });
      edge.shares.erase(rest.begin(), rest.end());
    }
  }

  /// The edge between two positions; null where it has no points.
  [[nodiscard]] Edge* find(const glm::dvec3& a, const glm::dvec3& b) {
    const auto found = edges_.find(key(a, b));
    return found == edges_.end() ? nullptr : &found->second;
  }

  /// Place of a point that a cut has made. @pre it was added.
  [[nodiscard]] Place place(const EdgeSurface& surface, const EdgePoint& point) {
    const auto [first, second] = ends(surface, point);
    Edge* edge = find(first, second);
    const double share = share_of_high(surface, point);
    const auto after = std::ranges::upper_bound(edge->shares, share);
    std::size_t i = static_cast<std::size_t>(after - edge->shares.begin());
    // The point is one of the two that surround it, whichever is nearer.
    const bool before = i > 0 && (i == edge->shares.size() ||
                                  share - edge->shares[i - 1] <= edge->shares[i] - share);
    if (before) --i;
    return {edge, i + 1};
  }

 private:
  static Key key(const glm::dvec3& a, const glm::dvec3& b) {
    const glm::dvec3& low = comes_first(a, b) ? a : b;
    const glm::dvec3& high = comes_first(a, b) ? b : a;
    // Adding zero makes one number of both zeros.
    return {low.x + 0.0, low.y + 0.0, low.z + 0.0, high.x + 0.0, high.y + 0.0, high.z + 0.0};
  }
  static std::pair<glm::dvec3, glm::dvec3> ends(const EdgeSurface& surface,
                                                const EdgePoint& point) {
    return {surface.positions[point.first], surface.positions[point.second]};
  }
  static double share_of_high(const EdgeSurface& surface, const EdgePoint& point) {
    const auto [first, second] = ends(surface, point);
    return comes_first(first, second) ? point.second_share : 1.0 - point.second_share;
  }

  std::map<Key, Edge> edges_;
};

/// Splits the triangles of one surface at the points that their edges have.
class Splitter {
 public:
  Splitter(Edges& edges, const EdgeSurface& surface) : edges_(edges), surface_(surface) {
    for (const EdgePoint& point : surface.edge_points) {
      const Place place = edges.place(surface, point);
      places_[point.vertex] = place;
      surface.positions[point.vertex] = place.edge->point(place.index - 1);
    }
  }

  void split(std::vector<std::uint32_t>& triangles) {
    std::vector<std::uint32_t> out;
    out.reserve(triangles.size());
    for (std::size_t i = 0; i + 2 < triangles.size(); i += 3) {
      open_.push_back({triangles[i], triangles[i + 1], triangles[i + 2]});
      while (!open_.empty()) {
        const Triangle triangle = open_.back();
        open_.pop_back();
        if (!split_at_a_side(triangle)) out.insert(out.end(), triangle.begin(), triangle.end());
      }
    }
    triangles = std::move(out);
  }

 private:
  using Triangle = std::array<std::uint32_t, 3>;

  /// Places of two vertices on the edge that both lie on; nothing where there is none.
  [[nodiscard]] std::optional<std::pair<Place, Place>> common_edge(std::uint32_t a,
                                                                   std::uint32_t b) {
    const auto place_a = places_.find(a);
    const auto place_b = places_.find(b);
    const bool on_a = place_a != places_.end();
    const bool on_b = place_b != places_.end();
    if (on_a && on_b) {
      if (place_a->second.edge != place_b->second.edge) return std::nullopt;
      return std::pair(place_a->second, place_b->second);
    }
    Edge* edge = nullptr;
    if (on_a || on_b) {
      edge = (on_a ? place_a : place_b)->second.edge;
    } else {
      edge = edges_.find(surface_.positions[a], surface_.positions[b]);
    }
    if (edge == nullptr) return std::nullopt;
    const std::optional<Place> first = on_a ? std::optional(place_a->second) : end_of(*edge, a);
    const std::optional<Place> second = on_b ? std::optional(place_b->second) : end_of(*edge, b);
    if (!first || !second) return std::nullopt;
    return std::pair(*first, *second);
  }
  [[nodiscard]] std::optional<Place> end_of(Edge& edge, std::uint32_t vertex) const {
    if (surface_.positions[vertex] == edge.low) return Place{&edge, 0};
    if (surface_.positions[vertex] == edge.high) return Place{&edge, edge.shares.size() + 1};
    return std::nullopt;
  }

  /// Replaces a triangle by a fan over the points of one of its sides; false: it has none.
  bool split_at_a_side(const Triangle& triangle) {
    for (std::size_t s = 0; s < 3; ++s) {
      const std::uint32_t from = triangle[s];
      const std::uint32_t to = triangle[(s + 1) % 3];
      const std::uint32_t apex = triangle[(s + 2) % 3];
      const auto common = common_edge(from, to);
      if (!common) continue;
      const auto [first, last] = *common;
      const std::size_t low = std::min(first.index, last.index);
      const std::size_t high = std::max(first.index, last.index);
      if (high - low < 2) continue;
      std::uint32_t before = from;
      for (std::size_t k = 1; k < high - low; ++k) {
        const std::size_t index = first.index < last.index ? low + k : high - k;
        const std::uint32_t vertex = new_vertex({first.edge, index}, from, to);
        open_.push_back({before, vertex, apex});
        before = vertex;
      }
      open_.push_back({before, to, apex});
      return true;
    }
    return false;
  }

  std::uint32_t new_vertex(const Place& place, std::uint32_t from, std::uint32_t to) {
    const glm::dvec3 position = place.edge->point(place.index - 1);
    const auto vertex = static_cast<std::uint32_t>(surface_.positions.size());
    if (!surface_.normals.empty()) {
      const double whole = glm::distance(surface_.positions[from], surface_.positions[to]);
      const double share =
          whole > 0.0 ? glm::distance(surface_.positions[from], position) / whole : 0.0;
      surface_.normals.push_back(
          glm::mix(surface_.normals[from], surface_.normals[to], static_cast<float>(share)));
    }
    surface_.positions.push_back(position);
    places_[vertex] = place;
    return vertex;
  }

  Edges& edges_;
  const EdgeSurface& surface_;
  std::unordered_map<std::uint32_t, Place> places_;  ///< of vertices on edges that were cut
  std::vector<Triangle> open_;
};

}  // namespace

void share_edge_points(std::span<const EdgeSurface> surfaces) {
  Edges edges;
  for (const EdgeSurface& surface : surfaces) edges.add(surface);
  edges.join();
  for (const EdgeSurface& surface : surfaces) {
    Splitter splitter(edges, surface);
    for (std::vector<std::uint32_t>* triangles : surface.triangles) splitter.split(*triangles);
  }
}

}  // namespace emit::scene
