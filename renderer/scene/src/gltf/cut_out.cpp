// SPDX-License-Identifier: Apache-2.0
#include "cut_out.hpp"

#include <geos_c.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <numeric>
#include <optional>
#include <span>
#include <tuple>
#include <utility>

#include "alpha_rings.hpp"
#include "emit/physics/check.hpp"

namespace emit::scene {
namespace {

/// Images of one triangle beyond this number are not counted out.
constexpr double kMaxTiles = 1e6;
/// A triangle whose area in texels is below this share of its longest edge squared has no inside.
constexpr double kFlatFrac = 1e-12;

double cross(const glm::dvec2& a, const glm::dvec2& b) {
  return a.x * b.y - a.y * b.x;
}

/// A context of the geometry library, and what it makes.
class Geos {
 public:
  struct Free {
    GEOSContextHandle_t context;
    void operator()(GEOSGeometry* g) const { GEOSGeom_destroy_r(context, g); }
  };
  using Shape = std::unique_ptr<GEOSGeometry, Free>;

  // The library is silent, because it gets no handlers for messages; every result is looked at.
  Geos() : context_(GEOS_init_r()) {}
  ~Geos() { GEOS_finish_r(context_); }
  Geos(const Geos&) = delete;
  Geos& operator=(const Geos&) = delete;

  [[nodiscard]] GEOSContextHandle_t get() const { return context_; }
  [[nodiscard]] Shape own(GEOSGeometry* shape) const { return Shape(shape, Free{context_}); }

  [[nodiscard]] GEOSCoordSequence* sequence(std::span<const glm::dvec2> points) const {
    GEOSCoordSequence* out =
        GEOSCoordSeq_create_r(context_, static_cast<unsigned int>(points.size()), 2);
    for (unsigned int i = 0; i < points.size(); ++i) {
      GEOSCoordSeq_setXY_r(context_, out, i, points[i].x, points[i].y);
    }
    return out;
  }
  [[nodiscard]] double area(const GEOSGeometry* shape) const {
    double area = 0.0;
    return shape != nullptr && GEOSArea_r(context_, shape, &area) == 1 ? area : 0.0;
  }

  /// Calls for every polygon in a shape, which may be a collection of collections.
  template <typename F>
  void each_polygon(const GEOSGeometry* shape, const F& call) const {
    const int kind = GEOSGeomTypeId_r(context_, shape);
    if (kind == GEOS_POLYGON) {
      if (GEOSisEmpty_r(context_, shape) == 0) call(shape);
      return;
    }
    if (kind < GEOS_MULTIPOINT) return;
    const int parts = GEOSGetNumGeometries_r(context_, shape);
    for (int i = 0; i < parts; ++i) each_polygon(GEOSGetGeometryN_r(context_, shape, i), call);
  }

 private:
  GEOSContextHandle_t context_;
};

using Triangle = std::array<glm::dvec2, 3>;

/// Shares of the corners of a triangle that make up a point in its plane.
glm::dvec3 shares_of(const Triangle& t, const glm::dvec2& p) {
  const double whole = cross(t[1] - t[0], t[2] - t[0]);
  const double second = cross(p - t[0], t[2] - t[0]) / whole;
  const double third = cross(t[1] - t[0], p - t[0]) / whole;
  glm::dvec3 shares(1.0 - second - third, second, third);
  // Points on an edge or corner of the triangle stay there exactly: neighbours have the same ones.
  constexpr double kRounding = 1e-12;
  for (int i = 0; i < 3; ++i) {
    if (std::abs(shares[i]) < kRounding) shares[i] = 0.0;
  }
  return shares / (shares.x + shares.y + shares.z);
}

/// First and last image that an interval of texture coordinates reaches by more than rounding.
std::pair<double, double> tiles_of(double low, double high) {
  constexpr double kRounding = 1e-6;
  const double first = std::floor(low + kRounding);
  return {first, std::max(std::ceil(high - kRounding) - 1.0, first)};
}

}  // namespace

/// Polygons of one image, with an index of their places.
class CutOut::Outline {
 public:
  Outline(const AlphaMask& mask, double tolerance_px) {
    std::vector<GEOSGeometry*> lines;
    for (const std::vector<glm::dvec2>& ring : alpha_rings(mask)) {
      lines.push_back(GEOSGeom_createLineString_r(geos_.get(), geos_.sequence(ring)));
    }
    const Geos::Shape all = geos_.own(GEOSGeom_createCollection_r(
        geos_.get(), GEOS_MULTILINESTRING, lines.data(), static_cast<unsigned int>(lines.size())));
    const Geos::Shape area = geos_.own(GEOSBuildArea_r(geos_.get(), all.get()));
    shape_ = area ? geos_.own(GEOSTopologyPreserveSimplify_r(geos_.get(), area.get(), tolerance_px))
                  : geos_.own(nullptr);
    tree_ = GEOSSTRtree_create_r(geos_.get(), 10);
    if (!shape_) return;
    geos_.each_polygon(shape_.get(), [&](const GEOSGeometry* polygon) {
      if (geos_.area(polygon) < tolerance_px * tolerance_px) return;
      polygons_.push_back({polygon, GEOSPrepare_r(geos_.get(), polygon)});
    });
    for (Polygon& polygon : polygons_) {
      GEOSSTRtree_insert_r(geos_.get(), tree_, polygon.shape, &polygon);
    }
  }
  ~Outline() {
    GEOSSTRtree_destroy_r(geos_.get(), tree_);
    for (const Polygon& polygon : polygons_)
      GEOSPreparedGeom_destroy_r(geos_.get(), polygon.prepared);
  }
  Outline(const Outline&) = delete;
  Outline& operator=(const Outline&) = delete;

  /// False: the outline could not be made.
  [[nodiscard]] bool valid() const { return shape_ != nullptr; }

  enum class Kept { nothing, whole, part, failed };

  /// Appends what is kept of a triangle, three corners for each piece.
  Kept cut(const Triangle& triangle, std::vector<glm::dvec2>& corners) {
    const std::array<glm::dvec2, 4> ring{triangle[0], triangle[1], triangle[2], triangle[0]};
    const Geos::Shape area = geos_.own(GEOSGeom_createPolygon_r(
        geos_.get(), GEOSGeom_createLinearRing_r(geos_.get(), geos_.sequence(ring)), nullptr, 0));
    if (!area) return Kept::failed;
    found_.clear();
    GEOSSTRtree_query_r(
        geos_.get(), tree_, area.get(),
        [](void* item, void* list) {
          static_cast<std::vector<Polygon*>*>(list)->push_back(static_cast<Polygon*>(item));
        },
        &found_);
    const std::size_t before = corners.size();
    const glm::dvec2 low = glm::min(glm::min(triangle[0], triangle[1]), triangle[2]);
    const glm::dvec2 high = glm::max(glm::max(triangle[0], triangle[1]), triangle[2]);
    for (const Polygon* polygon : found_) {
      if (GEOSPreparedIntersects_r(geos_.get(), polygon->prepared, area.get()) == 0) continue;
      if (GEOSPreparedContains_r(geos_.get(), polygon->prepared, area.get()) == 1) {
        return Kept::whole;
      }
      // A large polygon is cut to the triangle's box first, which costs far less than an overlay.
      const Geos::Shape near = geos_.own(GEOSClipByRect_r(geos_.get(), polygon->shape, low.x - 1.0,
                                                          low.y - 1.0, high.x + 1.0, high.y + 1.0));
      const bool sound = near && GEOSisValid_r(geos_.get(), near.get()) == 1;
      const Geos::Shape piece = geos_.own(
          GEOSIntersection_r(geos_.get(), sound ? near.get() : polygon->shape, area.get()));
      if (!piece || !add_pieces(piece.get(), corners)) {
        corners.resize(before);
        return Kept::failed;
      }
    }
    return corners.size() > before ? Kept::part : Kept::nothing;
  }

 private:
  struct Polygon {
    const GEOSGeometry* shape;
    const GEOSPreparedGeometry* prepared;
  };

  /// Appends the triangles of every polygon of a shape; false: there is no triangulation.
  bool add_pieces(const GEOSGeometry* shape, std::vector<glm::dvec2>& corners) {
    bool sound = true;
    geos_.each_polygon(shape, [&](const GEOSGeometry* polygon) {
      const Geos::Shape triangles =
          geos_.own(GEOSConstrainedDelaunayTriangulation_r(geos_.get(), polygon));
      const double area = geos_.area(polygon);
      // The sum of the pieces proves that nothing is missing or doubled.
      if (!triangles || std::abs(geos_.area(triangles.get()) - area) > 1e-6 * area + 1e-9) {
        sound = false;
        return;
      }
      geos_.each_polygon(triangles.get(), [&](const GEOSGeometry* triangle) {
        const GEOSCoordSequence* points =
            GEOSGeom_getCoordSeq_r(geos_.get(), GEOSGetExteriorRing_r(geos_.get(), triangle));
        for (unsigned int i = 0; i < 3; ++i) {
          glm::dvec2 point(0.0);
          GEOSCoordSeq_getXY_r(geos_.get(), points, i, &point.x, &point.y);
          corners.push_back(point);
        }
      });
    });
    return sound;
  }

  Geos geos_;
  Geos::Shape shape_{nullptr, Geos::Free{nullptr}};
  std::vector<Polygon> polygons_;
  std::vector<Polygon*> found_;
  GEOSSTRtree* tree_ = nullptr;
};

CutOut::CutOut(AlphaMask mask) : mask_(std::move(mask)) {}
CutOut::~CutOut() = default;
CutOut::CutOut(CutOut&&) noexcept = default;
CutOut& CutOut::operator=(CutOut&&) noexcept = default;

std::optional<CutTriangles> CutOut::cut(const std::vector<glm::dvec2>& uv,
                                        const std::vector<std::uint32_t>& indices,
                                        double tolerance_px) {
  EMIT_CHECK_OP(tolerance_px, >, 0.0);
  if (!outline_ || tolerance_px_ != tolerance_px) {
    outline_ = std::make_unique<Outline>(mask_, tolerance_px);
    tolerance_px_ = tolerance_px;
  }
  const glm::dvec2 size(mask_.width_px, mask_.height_px);
  CutTriangles out;
  const auto [least, most] = std::ranges::minmax(mask_.alpha);
  if (most < mask_.cutoff) return out;
  if (least >= mask_.cutoff) {
    out.whole.resize(indices.size() / 3);
    std::iota(out.whole.begin(), out.whole.end(), 0U);
    return out;
  }
  double tiles = 0.0;
  std::vector<glm::dvec2> corners;
  for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
    const auto index = static_cast<std::uint32_t>(i / 3);
    Triangle triangle;
    for (std::size_t c = 0; c < 3; ++c) {
      triangle[c] = glm::dvec2(mask_.image_from_uv * glm::dvec3(uv[indices[i + c]], 1.0)) * size;
    }
    const glm::dvec2 low = glm::min(glm::min(triangle[0], triangle[1]), triangle[2]);
    const glm::dvec2 high = glm::max(glm::max(triangle[0], triangle[1]), triangle[2]);
    const double extent = std::max(high.x - low.x, high.y - low.y);
    // Coordinates beyond this have no place in the image any more.
    constexpr double kFarthestPx = 1e12;
    if (!(std::max({-low.x, -low.y, high.x, high.y}) < kFarthestPx)) {
      out.whole.push_back(index);
      ++out.uncut;
      continue;
    }
    const double area = std::abs(cross(triangle[1] - triangle[0], triangle[2] - triangle[0]));
    if (!(area > kFlatFrac * extent * extent)) {
      // All of it has one place in the image.
      const glm::dvec2 middle = (triangle[0] + triangle[1] + triangle[2]) / 3.0;
      if (alpha_at(mask_, middle.x, middle.y) >= mask_.cutoff) out.whole.push_back(index);
      continue;
    }
    if (!outline_->valid()) {
      out.whole.push_back(index);
      ++out.uncut;
      continue;
    }
    glm::dvec2 first(0.0);
    glm::dvec2 last(0.0);
    if (mask_.wrap_u != Wrap::clamp) {
      std::tie(first.x, last.x) = tiles_of(low.x / size.x, high.x / size.x);
    }
    if (mask_.wrap_v != Wrap::clamp) {
      std::tie(first.y, last.y) = tiles_of(low.y / size.y, high.y / size.y);
    }
    tiles += (last.x - first.x + 1.0) * (last.y - first.y + 1.0);
    if (!(tiles <= kMaxTiles)) return std::nullopt;
    const bool one_tile = first == last;
    // Coordinates that rounding carried over the edge of the image go back onto it.
    const glm::dvec2 lowest(mask_.wrap_u == Wrap::clamp ? low.x : 0.0,
                            mask_.wrap_v == Wrap::clamp ? low.y : 0.0);
    const glm::dvec2 highest(mask_.wrap_u == Wrap::clamp ? high.x : size.x,
                             mask_.wrap_v == Wrap::clamp ? high.y : size.y);
    const std::size_t begin = out.corners.size();
    bool failed = false;
    bool whole = false;
    for (double row = first.y; row <= last.y && !failed; ++row) {
      for (double column = first.x; column <= last.x && !failed; ++column) {
        const bool turn_u = mask_.wrap_u == Wrap::mirror && std::fmod(column, 2.0) != 0.0;
        const bool turn_v = mask_.wrap_v == Wrap::mirror && std::fmod(row, 2.0) != 0.0;
        // The triangle moves into the one image that the outline is known for.
        Triangle moved = triangle;
        for (glm::dvec2& corner : moved) {
          corner -= glm::dvec2(column, row) * size;
          if (one_tile) corner = glm::clamp(corner, lowest, highest);
          if (turn_u) corner.x = size.x - corner.x;
          if (turn_v) corner.y = size.y - corner.y;
        }
        corners.clear();
        const Outline::Kept kept = outline_->cut(moved, corners);
        failed = kept == Outline::Kept::failed;
        whole = one_tile && kept == Outline::Kept::whole;
        const bool is_positive = cross(moved[1] - moved[0], moved[2] - moved[0]) > 0.0;
        for (std::size_t k = 0; k + 2 < corners.size(); k += 3) {
          const bool turned = (cross(corners[k + 1] - corners[k], corners[k + 2] - corners[k]) >
                               0.0) != is_positive;
          for (const std::size_t corner : {k, turned ? k + 2 : k + 1, turned ? k + 1 : k + 2}) {
            out.corners.push_back({index, shares_of(moved, corners[corner])});
          }
        }
      }
    }
    if (failed) {
      out.corners.resize(begin);
      ++out.uncut;
    }
    if (failed || whole) out.whole.push_back(index);
  }
  return out;
}

}  // namespace emit::scene
