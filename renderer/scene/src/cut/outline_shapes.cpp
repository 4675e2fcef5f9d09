// SPDX-License-Identifier: Apache-2.0
#include "outline_shapes.hpp"

#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <map>
#include <tuple>
#include <utility>

#include "alpha_rings.hpp"
#include "region_arcs.hpp"

namespace emit::scene {
namespace {

/// A line between two corners, in its direction.
using Side = std::tuple<double, double, double, double>;
Side side_of(const glm::dvec2& from, const glm::dvec2& to) {
  return {from.x, from.y, to.x, to.y};
}

/// Twice the signed area within a ring: positive where its inside is on the left.
double turned_area(const std::vector<glm::dvec2>& ring) {
  double sum = 0.0;
  for (std::size_t i = 0; i + 1 < ring.size(); ++i) {
    const glm::dvec2 a = ring[i] - ring[0];
    const glm::dvec2 b = ring[i + 1] - ring[0];
    sum += a.x * b.y - a.y * b.x;
  }
  return sum;
}

/// Region of a side that belongs to two lines.
constexpr std::uint8_t kUnknown = 254;
static_assert(kUnknown >= kMaxRegions && kUnknown != kNoRegion);

/// Parts lines that have both ends in common at their farthest points. Straight lines in their
/// place would fall together, and what lies between them, a texel that touches others at its
/// corners alone, would be gone: so would a slanted line of such texels.
std::vector<RegionArc> parted_twins(std::vector<RegionArc> arcs) {
  std::map<Side, int> count;
  const auto ends_of = [](const RegionArc& arc) {
    const glm::dvec2& a = arc.points.front();
    const glm::dvec2& b = arc.points.back();
    return std::tie(a.x, a.y) < std::tie(b.x, b.y) ? side_of(a, b) : side_of(b, a);
  };
  for (const RegionArc& arc : arcs) ++count[ends_of(arc)];
  std::vector<RegionArc> out;
  for (RegionArc& arc : arcs) {
    if (count[ends_of(arc)] < 2 || arc.points.size() < 3) {
      out.push_back(std::move(arc));
      continue;
    }
    const glm::dvec2 first = arc.points.front();
    const glm::dvec2 chord = arc.points.back() - first;
    std::size_t farthest = 1;
    double most = -1.0;
    for (std::size_t i = 1; i + 1 < arc.points.size(); ++i) {
      const glm::dvec2 to = arc.points[i] - first;
      const double distance =
          chord == glm::dvec2(0.0) ? glm::dot(to, to) : std::abs(chord.x * to.y - chord.y * to.x);
      if (distance > most) {
        most = distance;
        farthest = i;
      }
    }
    const auto middle = arc.points.begin() + static_cast<std::ptrdiff_t>(farthest);
    out.push_back({{arc.points.begin(), middle + 1}, arc.left, arc.right});
    out.push_back({{middle, arc.points.end()}, arc.left, arc.right});
  }
  return out;
}

}  // namespace

OutlineShapes outline_shapes(const Geos& geos, const AlphaMask& mask, double tolerance_px) {
  std::vector<Geos::Shape> lines;
  for (const std::vector<glm::dvec2>& ring : alpha_rings(mask)) lines.push_back(geos.line(ring));
  const Geos::Shape all = geos.collection(GEOS_MULTILINESTRING, std::move(lines));
  const Geos::Shape area = geos.own(GEOSBuildArea_r(geos.get(), all.get()));
  OutlineShapes out;
  if (!area) return out;
  out.owner = geos.own(GEOSTopologyPreserveSimplify_r(geos.get(), area.get(), tolerance_px));
  if (!out.owner) return out;
  geos.each_polygon(out.owner.get(), [&](const GEOSGeometry* polygon) {
    if (geos.area(polygon) < tolerance_px * tolerance_px) return;
    out.parts.push_back({polygon, 0});
  });
  return out;
}

OutlineShapes outline_shapes(const Geos& geos, const RegionImage& image, double tolerance_px) {
  const std::vector<RegionArc> arcs = parted_twins(region_arcs(image));
  std::vector<Geos::Shape> lines;
  for (const RegionArc& arc : arcs) lines.push_back(geos.line(arc.points));
  const Geos::Shape all = geos.collection(GEOS_MULTILINESTRING, std::move(lines));
  // All lines are made straight together, so that none crosses another; their ends stay.
  const Geos::Shape straight =
      geos.own(GEOSTopologyPreserveSimplify_r(geos.get(), all.get(), tolerance_px));
  OutlineShapes out;
  if (!straight ||
      GEOSGetNumGeometries_r(geos.get(), straight.get()) != static_cast<int>(arcs.size())) {
    return out;
  }
  // Each side of a line knows the region to its left. Sides of two lines know nothing.
  std::map<Side, std::uint8_t> left_of;
  const auto note = [&](const glm::dvec2& from, const glm::dvec2& to, std::uint8_t region) {
    const auto [entry, is_new] = left_of.try_emplace(side_of(from, to), region);
    if (!is_new && entry->second != region) entry->second = kUnknown;
  };
  for (std::size_t i = 0; i < arcs.size(); ++i) {
    const std::vector<glm::dvec2> points =
        geos.points_of(GEOSGetGeometryN_r(geos.get(), straight.get(), static_cast<int>(i)));
    for (std::size_t p = 0; p + 1 < points.size(); ++p) {
      note(points[p], points[p + 1], arcs[i].left);
      note(points[p + 1], points[p], arcs[i].right);
    }
  }
  // A straight line may touch the corner of another one: all meet at their ends afterwards.
  const Geos::Shape joined = geos.own(GEOSUnaryUnion_r(geos.get(), straight.get()));
  if (!joined) return out;
  const GEOSGeometry* const lines_of_all[] = {joined.get()};
  out.owner = geos.own(GEOSPolygonize_r(geos.get(), lines_of_all, 1));
  if (!out.owner) return out;
  bool sound = true;
  geos.each_polygon(out.owner.get(), [&](const GEOSGeometry* polygon) {
    const std::vector<glm::dvec2> ring = geos.points_of(GEOSGetExteriorRing_r(geos.get(), polygon));
    const bool inside_is_left = turned_area(ring) > 0.0;
    std::uint8_t region = kUnknown;
    for (std::size_t p = 0; p + 1 < ring.size() && region == kUnknown; ++p) {
      const auto found = inside_is_left ? left_of.find(side_of(ring[p], ring[p + 1]))
                                        : left_of.find(side_of(ring[p + 1], ring[p]));
      if (found != left_of.end()) region = found->second;
    }
    // A sliver between lines that were joined has the region of the texel in its middle.
    if (region == kUnknown) {
      const Geos::Shape middle = geos.own(GEOSPointOnSurface_r(geos.get(), polygon));
      glm::dvec2 p(0.0);
      sound = sound && middle && GEOSGeomGetX_r(geos.get(), middle.get(), &p.x) == 1 &&
              GEOSGeomGetY_r(geos.get(), middle.get(), &p.y) == 1;
      const TexelPlace place = texel_at(image.frame, p.x, p.y);
      region = image.at(place.x, place.y);
    }
    if (region != kNoRegion) {
      out.parts.push_back({polygon, region});
    }
  });
  if (!sound) out = {};
  return out;
}

}  // namespace emit::scene
