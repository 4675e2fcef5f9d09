// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/sun_disc.hpp"

#include <glm/ext/vector_double2.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "emit/reference/sampling.hpp"

namespace emit::reference {
namespace {

using physics::kPi;

constexpr std::size_t kNodes = 16;
constexpr std::size_t kEvenChords = 1024;
/// Half side of the square to which everything is clipped, in radii of the disc.
constexpr double kClip = 2.0;

/// Gauss-Legendre rule of kNodes points.
struct GaussRule {
  std::array<double, kNodes> node;  ///< abscissae in (-1, 1)
  std::array<double, kNodes> weight;
};

GaussRule make_gauss_rule() noexcept {
  GaussRule rule{};
  for (std::size_t i = 0; i < kNodes; ++i) {
    double x = std::cos(kPi * (static_cast<double>(i) + 0.75) / (kNodes + 0.5));
    double slope = 1.0;
    for (int iteration = 0; iteration < 8; ++iteration) {  // solves Legendre's polynomial by Newton
      double p = 1.0;
      double before = 0.0;
      for (std::size_t k = 1; k <= kNodes; ++k) {
        const double n = static_cast<double>(k);
        const double next = ((2.0 * n - 1.0) * x * p - (n - 1.0) * before) / n;
        before = p;
        p = next;
      }
      slope = kNodes * (x * p - before) / (x * x - 1.0);
      x -= p / slope;
    }
    rule.node[i] = x;
    rule.weight[i] = 2.0 / ((1.0 - x * x) * slope * slope);
  }
  return rule;
}

const GaussRule& gauss() noexcept {
  static const GaussRule rule = make_gauss_rule();
  return rule;
}

/// Convex polygon on the projection plane, in radii of the disc. It is a triangle cut by four
/// planes.
struct Polygon {
  std::array<glm::dvec2, 7> corner;
  std::size_t count = 0;
  double low = 0.0;
  double high = 0.0;
};

/// Covered interval of a chord.
struct Interval {
  double begin = 0.0;
  double end = 0.0;
};

/// Side of a triangle that enters the disc, with the key that identifies it among its neighbours.
struct Outline {
  glm::dvec2 a, b;
  std::array<double, 6> key;  ///< both corners in space, in their own fixed order
  bool left = false;          ///< the triangle lies to the left of the key's direction
};

/// Integral of the brightness over the covered part of a disc.
class DiscIntegral {
 public:
  DiscIntegral(const SunDisc& disc, std::vector<Polygon> polygons)
      : radius_(std::tan(disc.semi_angle_rad)),
        limb_(disc.limb_darkening_frac),
        polygons_(std::move(polygons)) {
    std::sort(polygons_.begin(), polygons_.end(),
              [](const Polygon& a, const Polygon& b) { return a.low < b.low; });
  }

  /// Returns the integral over the whole disc with nothing in front of it.
  [[nodiscard]] double total() const noexcept {
    // Integrate over rings r = sin(phi), which turns the square root of the darkening into a
    // cosine.
    double sum = 0.0;
    for (std::size_t i = 0; i < kNodes; ++i) {
      const double phi = 0.25 * kPi * (1.0 + gauss().node[i]);
      const double r = std::sin(phi);
      const double stretch = std::sqrt(1.0 + radius_ * radius_ * r * r);
      const double brightness = 1.0 - limb_ + limb_ * std::cos(phi) / stretch;
      sum += gauss().weight[i] * brightness * r * std::cos(phi) / (stretch * stretch * stretch);
    }
    return 2.0 * kPi * 0.25 * kPi * sum;
  }

  /// Returns the covered part between two chords at sin(begin) and sin(end), by 16 chords.
  [[nodiscard]] double covered(double begin, double end) {
    double sum = 0.0;
    for (std::size_t i = 0; i < kNodes; ++i) {
      sum += gauss().weight[i] *
             covered_chord(0.5 * (begin + end) + 0.5 * (end - begin) * gauss().node[i]);
    }
    return 0.5 * (end - begin) * sum;
  }

  /// Returns the covered part of the chord at y = sin(s), times dy/ds.
  [[nodiscard]] double covered_chord(double s) {
    const double y = std::sin(s);
    const double half = std::cos(s);
    intervals_.clear();
    // Cut the chord with every polygon that reaches it. They are sorted by their lower end.
    for (const Polygon& polygon : polygons_) {
      if (polygon.low > y) break;
      if (polygon.high < y) continue;
      const Interval cut = cut_at(polygon, y);
      const Interval clipped{std::max(cut.begin, -half), std::min(cut.end, half)};
      if (clipped.begin < clipped.end) intervals_.push_back(clipped);
    }
    if (intervals_.empty()) return 0.0;
    // Merge overlapping intervals and integrate each of them.
    std::sort(intervals_.begin(), intervals_.end(),
              [](const Interval& a, const Interval& b) { return a.begin < b.begin; });
    double sum = 0.0;
    Interval open = intervals_.front();
    for (const Interval& next : intervals_) {
      if (next.begin > open.end) {
        sum += along_chord(open, y, half);
        open = next;
      } else {
        open.end = std::max(open.end, next.end);
      }
    }
    return half * (sum + along_chord(open, y, half));
  }

 private:
  /// Returns the interval of the horizontal line at y inside a polygon.
  static Interval cut_at(const Polygon& polygon, double y) noexcept {
    Interval cut{kClip + 1.0, -kClip - 1.0};
    for (std::size_t i = 0; i < polygon.count; ++i) {
      const glm::dvec2& a = polygon.corner[i];
      const glm::dvec2& b = polygon.corner[i + 1 == polygon.count ? 0 : i + 1];
      if ((a.y < y && b.y < y) || (a.y > y && b.y > y)) continue;
      // Interpolate from the same end whichever way the side runs, so that neighbours meet exactly.
      const bool up = a.y < b.y || (a.y == b.y && a.x < b.x);
      const glm::dvec2& from = up ? a : b;
      const glm::dvec2& to = up ? b : a;
      if (from.y == to.y) {
        cut.begin = std::min(cut.begin, from.x);
        cut.end = std::max(cut.end, to.x);
        continue;
      }
      const double x = from.x + (to.x - from.x) * ((y - from.y) / (to.y - from.y));
      cut.begin = std::min(cut.begin, x);
      cut.end = std::max(cut.end, x);
    }
    return cut;
  }

  /// Returns the integral of solid angle times brightness over an interval of a chord, in squared
  /// radii.
  [[nodiscard]] double along_chord(const Interval& part, double y, double half) const noexcept {
    const double r2 = radius_ * radius_;
    const double row = 1.0 + r2 * y * y;
    // Use the closed form for a uniform disc.
    if (limb_ == 0.0) {
      const auto primitive = [&](double x) { return x / (row * std::sqrt(row + r2 * x * x)); };
      return primitive(part.end) - primitive(part.begin);
    }
    // Integrate along the chord by Gauss in x = half sin(t), which removes the root at the rim.
    const double begin = std::asin(std::clamp(part.begin / half, -1.0, 1.0));
    const double end = std::asin(std::clamp(part.end / half, -1.0, 1.0));
    double sum = 0.0;
    for (std::size_t i = 0; i < kNodes; ++i) {
      const double t = 0.5 * (begin + end) + 0.5 * (end - begin) * gauss().node[i];
      const double x = half * std::sin(t);
      const double stretch = std::sqrt(row + r2 * x * x);
      const double brightness = 1.0 - limb_ + limb_ * half * std::cos(t) / stretch;
      sum += gauss().weight[i] * brightness * half * std::cos(t) / (stretch * stretch * stretch);
    }
    return 0.5 * (end - begin) * sum;
  }

  double radius_;
  double limb_;
  std::vector<Polygon> polygons_;
  std::vector<Interval> intervals_;
};

/// Polygon in the disc's frame (x, y across, z along the axis), which is cut to the square pyramid
/// around the disc.
struct Clipper {
  std::array<glm::dvec3, 8> corner;
  std::size_t count = 0;

  void cut(const glm::dvec3& inward) noexcept {
    std::array<glm::dvec3, 8> kept;
    std::size_t kept_count = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const glm::dvec3& a = corner[i];
      const glm::dvec3& b = corner[i + 1 == count ? 0 : i + 1];
      const double da = glm::dot(a, inward);
      const double db = glm::dot(b, inward);
      if (da >= 0.0) kept[kept_count++] = a;
      if ((da >= 0.0) != (db >= 0.0)) {
        // Cut from the inside outwards: both triangles of an edge get the same point.
        kept[kept_count++] =
            da >= 0.0 ? a + (b - a) * (da / (da - db)) : b + (a - b) * (db / (db - da));
      }
      if (kept_count == kept.size()) break;
    }
    corner = kept;
    count = kept_count;
  }
};

/// Clips and projects a triangle. Returns false if it does not reach the disc's height range.
bool project(const std::array<glm::dvec3, 3>& triangle, double radius, Polygon& polygon) noexcept {
  Clipper clipper;
  for (std::size_t i = 0; i < 3; ++i) clipper.corner[i] = triangle[i];
  clipper.count = 3;
  // Cut the triangle with the four planes of the pyramid.
  for (const glm::dvec3& inward :
       {glm::dvec3(1.0, 0.0, kClip * radius), glm::dvec3(-1.0, 0.0, kClip * radius),
        glm::dvec3(0.0, 1.0, kClip * radius), glm::dvec3(0.0, -1.0, kClip * radius)}) {
    clipper.cut(inward);
  }
  polygon.count = 0;
  polygon.low = kClip + 1.0;
  polygon.high = -kClip - 1.0;
  if (clipper.count < 3 || clipper.count > polygon.corner.size()) return false;
  // Project the corners and bound their heights.
  for (std::size_t i = 0; i < clipper.count; ++i) {
    const glm::dvec3& p = clipper.corner[i];
    if (!(p.z > 0.0)) return false;  // only the point itself projects to the apex
    const glm::dvec2 at = glm::dvec2(p) / (p.z * radius);
    polygon.corner[polygon.count++] = at;
    polygon.low = std::min(polygon.low, at.y);
    polygon.high = std::max(polygon.high, at.y);
  }
  return polygon.low < 1.0 && polygon.high > -1.0;
}

/// Returns the least distance of a segment from the centre.
double distance_to_centre(const glm::dvec2& a, const glm::dvec2& b) noexcept {
  const glm::dvec2 ab = b - a;
  const double length2 = glm::dot(ab, ab);
  const double t = length2 > 0.0 ? std::clamp(-glm::dot(a, ab) / length2, 0.0, 1.0) : 0.0;
  return glm::length(a + t * ab);
}

/// Projects the side of a triangle, as far as it lies in the clip square. Returns false if it lies
/// outside.
bool project_side(const glm::dvec3& a, const glm::dvec3& b, double radius, glm::dvec2& from,
                  glm::dvec2& to) noexcept {
  glm::dvec3 begin = a;
  glm::dvec3 end = b;
  for (const glm::dvec3& inward :
       {glm::dvec3(1.0, 0.0, kClip * radius), glm::dvec3(-1.0, 0.0, kClip * radius),
        glm::dvec3(0.0, 1.0, kClip * radius), glm::dvec3(0.0, -1.0, kClip * radius)}) {
    const double d0 = glm::dot(begin, inward);
    const double d1 = glm::dot(end, inward);
    if (d0 < 0.0 && d1 < 0.0) return false;
    if (d0 < 0.0) begin = end + (begin - end) * (d1 / (d1 - d0));
    if (d1 < 0.0) end = begin + (end - begin) * (d0 / (d0 - d1));
  }
  if (!(begin.z > 0.0 && end.z > 0.0)) return false;
  from = glm::dvec2(begin) / (begin.z * radius);
  to = glm::dvec2(end) / (end.z * radius);
  return true;
}

/// Orders corners, so that both triangles of a side give it the same key.
bool key_less(const glm::dvec3& a, const glm::dvec3& b) noexcept {
  return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
}

/// Adds the sides of a triangle that enter the disc.
void add_outlines(const std::array<glm::dvec3, 3>& triangle, double radius,
                  std::vector<Outline>& outlines) {
  for (std::size_t i = 0; i < 3; ++i) {
    const glm::dvec3* a = &triangle[i];
    const glm::dvec3* b = &triangle[(i + 1) % 3];
    const glm::dvec3& apex = triangle[(i + 2) % 3];
    if (key_less(*b, *a)) std::swap(a, b);
    Outline outline;
    if (!project_side(*a, *b, radius, outline.a, outline.b)) continue;
    if (distance_to_centre(outline.a, outline.b) >= 1.0) continue;
    outline.key = {a->x, a->y, a->z, b->x, b->y, b->z};
    // Note on which side of the plane through the point and this edge the triangle lies.
    outline.left = glm::dot(glm::cross(*a, *b), apex) > 0.0;
    outlines.push_back(outline);
  }
}

/// Drops sides that two triangles share from opposite sides. They lie inside a surface and are no
/// outline.
void drop_inner_sides(std::vector<Outline>& outlines) {
  std::sort(outlines.begin(), outlines.end(),
            [](const Outline& a, const Outline& b) { return a.key < b.key; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < outlines.size();) {
    std::size_t end = i + 1;
    while (end < outlines.size() && outlines[end].key == outlines[i].key) ++end;
    const bool inner = end - i == 2 && outlines[i].left != outlines[i + 1].left;
    if (!inner) outlines[kept++] = outlines[i];
    i = end;
  }
  outlines.resize(kept);
}

/// Adds the chords at which the covered length is not smooth, as s with y = sin(s).
void add_breaks(const std::vector<Outline>& outlines, std::vector<double>& breaks) {
  const auto add = [&](double y) {
    if (y > -1.0 && y < 1.0) breaks.push_back(std::asin(y));
  };
  const auto add_inside = [&](const glm::dvec2& p) {
    if (glm::dot(p, p) < 1.0 + 1e-9) add(p.y);
  };
  for (std::size_t i = 0; i < outlines.size(); ++i) {
    const glm::dvec2 a = outlines[i].a;
    const glm::dvec2 ab = outlines[i].b - a;
    // Add the ends of the outline.
    add_inside(a);
    add_inside(outlines[i].b);
    // Add the points at which the outline meets the rim.
    const double length2 = glm::dot(ab, ab);
    if (length2 > 0.0) {
      const double middle = -glm::dot(a, ab) / length2;
      const glm::dvec2 nearest = a + middle * ab;
      const double room = (1.0 - glm::dot(nearest, nearest)) / length2;
      if (room > 0.0) {
        for (const double t : {middle - std::sqrt(room), middle + std::sqrt(room)}) {
          if (t >= 0.0 && t <= 1.0) add((a + t * ab).y);
        }
      }
    }
    // Add the crossings with the outlines before it.
    for (std::size_t k = 0; k < i; ++k) {
      const glm::dvec2 cd = outlines[k].b - outlines[k].a;
      const double cross = ab.x * cd.y - ab.y * cd.x;
      if (cross == 0.0) continue;
      const glm::dvec2 ac = outlines[k].a - a;
      const double t = (ac.x * cd.y - ac.y * cd.x) / cross;
      const double w = (ac.x * ab.y - ac.y * ab.x) / cross;
      if (t >= 0.0 && t <= 1.0 && w >= 0.0 && w <= 1.0) add_inside(a + t * ab);
    }
  }
}

/// Returns the region behind the tangent plane as one large triangle that covers the clip square on
/// the dark side.
std::array<glm::dvec3, 3> tangent_plane_cover(const glm::dvec3& normal, double radius) noexcept {
  const glm::dvec2 across(normal.x, normal.y);
  const double size = glm::length(across);
  // Find the line of the tangent plane on the plane z = 1; its light side is dot(across, p) +
  // normal.z > 0.
  const glm::dvec2 inward = across / size;
  const glm::dvec2 along(-inward.y, inward.x);
  const glm::dvec2 foot = -inward * (normal.z / size);
  // Make the triangle large. Only lines that pass near the disc occur, so that the foot is near as
  // well.
  const double far = 8.0 * kClip * radius;
  const glm::dvec2 left = foot + along * far;
  const glm::dvec2 right = foot - along * far;
  const glm::dvec2 behind = foot - inward * far;
  return {glm::dvec3(left, 1.0), glm::dvec3(behind, 1.0), glm::dvec3(right, 1.0)};
}

}  // namespace

double disc_brightness_frac(const SunDisc& disc, double angle_rad) noexcept {
  EMIT_DCHECK_OP(angle_rad, >=, 0.0);
  EMIT_DCHECK(angle_rad <= disc.semi_angle_rad * (1.0 + 1e-9));
  if (disc.limb_darkening_frac == 0.0) return 1.0;
  const double ratio = std::sin(angle_rad) / std::sin(disc.semi_angle_rad);
  return 1.0 - disc.limb_darkening_frac * (1.0 - std::sqrt(std::max(1.0 - ratio * ratio, 0.0)));
}

DiscShare visible_disc_share(std::span<const std::array<glm::dvec3, 3>> triangles,
                             const glm::dvec3& normal, const SunDisc& disc) {
  // Turn everything to the frame of the disc.
  const Tangents tangents = tangents_of(disc.to_centre);
  const auto turned = [&](const glm::dvec3& p) {
    return glm::dvec3(glm::dot(p, tangents.u), glm::dot(p, tangents.v),
                      glm::dot(p, disc.to_centre));
  };
  const double radius = std::tan(disc.semi_angle_rad);
  std::vector<Polygon> polygons;
  std::vector<Outline> outlines;
  const auto add = [&](const std::array<glm::dvec3, 3>& triangle) {
    Polygon polygon;
    if (!project(triangle, radius, polygon)) return;
    polygons.push_back(polygon);
    add_outlines(triangle, radius, outlines);
  };
  // Treat the point's own surface: it hides the whole disc, nothing, or a part of it.
  if (glm::dot(normal, normal) > 0.0) {
    const glm::dvec3 n = turned(glm::normalize(normal));
    const double across = glm::length(glm::dvec2(n));
    if (n.z <= -across * radius) return {0.0, 0.0};
    if (n.z < across * radius) add(tangent_plane_cover(n, radius));
  }
  // Project all triangles, then keep the true outlines.
  for (const auto& triangle : triangles) {
    add({turned(triangle[0]), turned(triangle[1]), turned(triangle[2])});
  }
  if (polygons.empty()) return {1.0, 0.0};
  drop_inner_sides(outlines);

  // Integrate between all breaks.
  DiscIntegral integral(disc, std::move(polygons));
  const double total = integral.total();
  const double rim = 0.5 * kPi;
  double covered = 0.0;
  double error = 0.0;
  if (outlines.size() <= kMaxDiscOutlines) {
    std::vector<double> breaks{-rim, 0.0, rim};
    add_breaks(outlines, breaks);
    std::sort(breaks.begin(), breaks.end());
    for (std::size_t i = 0; i + 1 < breaks.size(); ++i) {
      if (breaks[i + 1] > breaks[i]) covered += integral.covered(breaks[i], breaks[i + 1]);
    }
  } else {
    // Use even chords for too many outlines, and compare the two halves for an error estimate.
    double even = 0.0;
    double odd = 0.0;
    for (std::size_t i = 0; i < kEvenChords; ++i) {
      const double s = -rim + kPi * (static_cast<double>(i) + 0.5) / kEvenChords;
      (i % 2 == 0 ? even : odd) += integral.covered_chord(s) * kPi / kEvenChords;
    }
    covered = even + odd;
    error = std::abs(even - odd) / total;
  }
  return {std::clamp(1.0 - covered / total, 0.0, 1.0), error};
}

}  // namespace emit::reference
