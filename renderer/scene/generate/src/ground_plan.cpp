// SPDX-License-Identifier: Apache-2.0
#include "ground_plan.hpp"

#include <geos_c.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <map>
#include <memory>
#include <utility>

#include "emit/physics/check.hpp"
#include "triangulation.hpp"

namespace emit::scenegen {
namespace {

/// Points of the plan are multiples of this. They stay exact as 32-bit numbers, so that thin
/// triangles keep their direction.
constexpr double kGridM = 1.0 / 128.0;

struct FreeShape {
  GEOSContextHandle_t context;
  void operator()(GEOSGeometry* shape) const { GEOSGeom_destroy_r(context, shape); }
};
using Shape = std::unique_ptr<GEOSGeometry, FreeShape>;

/// Context of the geometry library.
class Geos {
 public:
  Geos() : context_(GEOS_init_r()) {}
  ~Geos() { GEOS_finish_r(context_); }
  Geos(const Geos&) = delete;
  Geos& operator=(const Geos&) = delete;
  [[nodiscard]] GEOSContextHandle_t get() const { return context_; }

  /// Takes a shape that the library made. Plans are fixed, so a failure is a fault of the program.
  [[nodiscard]] Shape own(GEOSGeometry* shape) const {
    EMIT_CHECK(shape != nullptr);
    return Shape(shape, FreeShape{context_});
  }

  [[nodiscard]] GEOSGeometry* closed_line(const std::vector<glm::dvec2>& ring) const {
    const auto count = static_cast<unsigned int>(ring.size());
    GEOSCoordSequence* points = GEOSCoordSeq_create_r(context_, count + 1, 2);
    for (unsigned int i = 0; i <= count; ++i) {
      GEOSCoordSeq_setXY_r(context_, points, i, ring[i % count].x, ring[i % count].y);
    }
    return GEOSGeom_createLineString_r(context_, points);
  }

  /// Cuts all lines where they meet. Calls `call(a, b)` with the ends of each straight piece.
  template <class F>
  void each_piece(const std::vector<Shape>& lines, const F& call) const {
    std::vector<GEOSGeometry*> copies;
    copies.reserve(lines.size());
    for (const Shape& line : lines) copies.push_back(GEOSGeom_clone_r(context_, line.get()));
    const Shape all = own(GEOSGeom_createCollection_r(context_, GEOS_MULTILINESTRING, copies.data(),
                                                      static_cast<unsigned int>(copies.size())));
    const Shape cut = own(GEOSUnaryUnionPrec_r(context_, all.get(), kGridM));
    const int count = GEOSGetNumGeometries_r(context_, cut.get());
    for (int line = 0; line < count; ++line) {
      const GEOSCoordSequence* points =
          GEOSGeom_getCoordSeq_r(context_, GEOSGetGeometryN_r(context_, cut.get(), line));
      unsigned int size = 0;
      GEOSCoordSeq_getSize_r(context_, points, &size);
      glm::dvec2 from(0.0);
      for (unsigned int i = 0; i < size; ++i) {
        glm::dvec2 to(0.0);
        GEOSCoordSeq_getXY_r(context_, points, i, &to.x, &to.y);
        if (i > 0) call(from, to);
        from = to;
      }
    }
  }

 private:
  GEOSContextHandle_t context_;
};

Triangulation::Point grid_from(const glm::dvec2& point_m) {
  return {std::llround(point_m.x / kGridM), std::llround(point_m.y / kGridM)};
}

/// True for a point inside a ring: a ray towards +x leaves it once more than it enters it.
bool inside(const std::vector<glm::dvec2>& ring, const glm::dvec2& p) {
  bool in = false;
  for (std::size_t i = 0, j = ring.size() - 1; i < ring.size(); j = i++) {
    const glm::dvec2& a = ring[i];
    const glm::dvec2& b = ring[j];
    if ((a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)) in = !in;
  }
  return in;
}

/// Vertices and triangles of the plan by material. Vertices of one material are shared.
class Parts {
 public:
  void add(const std::string& material, const std::array<Triangulation::Point, 3>& corners) {
    Entry& entry = entries_[material];
    for (const Triangulation::Point& corner : corners) {
      const auto [found, is_new] = entry.vertices.emplace(
          std::pair(corner.x, corner.y), static_cast<std::uint32_t>(entry.part.positions_m.size()));
      if (is_new) {
        entry.part.positions_m.emplace_back(glm::dvec2(corner) * kGridM, 0.0);
        entry.part.normals.emplace_back(0.0F, 0.0F, 1.0F);
      }
      entry.part.indices.push_back(found->second);
    }
  }

  [[nodiscard]] std::vector<Part> take() {
    std::vector<Part> parts;
    for (auto& [material, entry] : entries_) {
      entry.part.material = material;
      parts.push_back(std::move(entry.part));
    }
    return parts;
  }

 private:
  struct Entry {
    Part part;
    std::map<std::pair<std::int64_t, std::int64_t>, std::uint32_t> vertices;
  };
  std::map<std::string, Entry> entries_;
};

}  // namespace

void GroundPlan::rectangle(double x0_m, double y0_m, double x1_m, double y1_m,
                           const char* material) {
  polygon({{x0_m, y0_m}, {x1_m, y0_m}, {x1_m, y1_m}, {x0_m, y1_m}}, material);
}

void GroundPlan::polygon(std::vector<glm::dvec2> corners_m, const char* material) {
  EMIT_CHECK_OP(corners_m.size(), >=, 3U);
  Patch patch{std::move(corners_m), {}, {}, material};
  for (glm::dvec2& corner : patch.ring_m) corner = glm::round(corner / kGridM) * kGridM;
  patch.min_m = patch.max_m = patch.ring_m.front();
  for (const glm::dvec2& corner : patch.ring_m) {
    patch.min_m = glm::min(patch.min_m, corner);
    patch.max_m = glm::max(patch.max_m, corner);
  }
  patches_.push_back(std::move(patch));
}

void GroundPlan::band(const std::vector<glm::dvec2>& points_m, double width_m,
                      const char* material) {
  EMIT_CHECK_OP(points_m.size(), >=, 2U);
  // Walk along one side and back along the other. The mitre of a bend keeps the width.
  std::vector<glm::dvec2> left;
  std::vector<glm::dvec2> right;
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    const glm::dvec2 before = i > 0 ? glm::normalize(points_m[i] - points_m[i - 1])
                                    : glm::normalize(points_m[1] - points_m[0]);
    const glm::dvec2 after =
        i + 1 < points_m.size() ? glm::normalize(points_m[i + 1] - points_m[i]) : before;
    const glm::dvec2 along = glm::normalize(before + after);
    const glm::dvec2 side(-along.y, along.x);
    const double reach_m = 0.5 * width_m / glm::dot(along, after);
    left.push_back(points_m[i] + reach_m * side);
    right.push_back(points_m[i] - reach_m * side);
  }
  left.insert(left.end(), right.rbegin(), right.rend());
  polygon(std::move(left), material);
}

const char* GroundPlan::top_at(const glm::dvec2& point_m) const {
  for (auto patch = patches_.rbegin(); patch != patches_.rend(); ++patch) {
    if (point_m.x > patch->min_m.x && point_m.x < patch->max_m.x && point_m.y > patch->min_m.y &&
        point_m.y < patch->max_m.y && inside(patch->ring_m, point_m)) {
      return patch->material;
    }
  }
  return nullptr;
}

SceneMesh GroundPlan::mesh(const std::string& name) const {
  EMIT_CHECK(!patches_.empty());
  const Geos geos;
  std::vector<Shape> lines;
  glm::dvec2 low_m = patches_.front().min_m;
  glm::dvec2 high_m = patches_.front().max_m;
  for (const Patch& patch : patches_) {
    lines.push_back(geos.own(geos.closed_line(patch.ring_m)));
    low_m = glm::min(low_m, patch.min_m);
    high_m = glm::max(high_m, patch.max_m);
  }
  // A frame around the plan takes all points inside; its triangles belong to no patch.
  Triangulation triangulation(grid_from(low_m - 1.0), grid_from(high_m + 1.0));
  std::vector<std::pair<std::uint32_t, std::uint32_t>> segments;
  geos.each_piece(lines, [&](const glm::dvec2& from_m, const glm::dvec2& to_m) {
    const std::uint32_t from = triangulation.add_point(grid_from(from_m));
    segments.emplace_back(from, triangulation.add_point(grid_from(to_m)));
  });
  for (const auto& [from, to] : segments) triangulation.add_segment(from, to);
  triangulation.improve();
  // A triangle is of the material that lies on top there.
  Parts parts;
  triangulation.each_triangle([&](const Triangulation::Point& a, const Triangulation::Point& b,
                                  const Triangulation::Point& c) {
    const char* material = top_at(glm::dvec2(a + b + c) * (kGridM / 3.0));
    if (material != nullptr) parts.add(material, {a, b, c});
  });
  return {name, parts.take()};
}

}  // namespace emit::scenegen
