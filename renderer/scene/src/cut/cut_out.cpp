// SPDX-License-Identifier: Apache-2.0
#include "cut_out.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <optional>
#include <tuple>
#include <utility>

#include "emit/physics/check.hpp"
#include "geos.hpp"
#include "outline_shapes.hpp"

namespace emit::scene {
namespace {

/// Images of one triangle beyond this number are not counted out.
constexpr double kMaxTiles = 1e6;
/// A triangle whose area in texels is below this share of its longest edge squared has no inside.
constexpr double kFlatFrac = 1e-12;

double cross(const glm::dvec2& a, const glm::dvec2& b) {
  return a.x * b.y - a.y * b.x;
}

using Triangle = std::array<glm::dvec2, 3>;

/// Shares of the corners of a triangle that make up a point in its plane.
glm::dvec3 shares_of(const Triangle& t, const glm::dvec2& p) {
  const double whole = cross(t[1] - t[0], t[2] - t[0]);
  const double second = cross(p - t[0], t[2] - t[0]) / whole;
  const double third = cross(t[1] - t[0], p - t[0]) / whole;
  glm::dvec3 shares(1.0 - second - third, second, third);
  // Points on an edge or corner of the triangle stay there exactly: neighbours have the same ones.
  // Coordinates of thousands of texels are rounded to a billionth of a texel.
  constexpr double kRounding = 1e-9;
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
  template <typename Image>
  Outline(const Image& image, double tolerance_px)
      : shapes_(outline_shapes(geos_, image, tolerance_px)) {
    tree_ = GEOSSTRtree_create_r(geos_.get(), 10);
    for (const OutlineShapes::Part& part : shapes_.parts) {
      polygons_.push_back({part.polygon, GEOSPrepare_r(geos_.get(), part.polygon), part.part});
    }
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
  [[nodiscard]] bool valid() const { return shapes_.owner != nullptr; }

  /// A piece of a triangle.
  struct Piece {
    Triangle corners;
    std::uint8_t part = 0;
  };
  enum class Kept { nothing, whole, part, failed };

  /// Appends what is kept of a triangle. Where all of it is of one part, there is one piece.
  Kept cut(const Triangle& triangle, std::vector<Piece>& pieces) {
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
    const std::size_t before = pieces.size();
    const glm::dvec2 low = glm::min(glm::min(triangle[0], triangle[1]), triangle[2]);
    const glm::dvec2 high = glm::max(glm::max(triangle[0], triangle[1]), triangle[2]);
    for (const Polygon* polygon : found_) {
      if (GEOSPreparedIntersects_r(geos_.get(), polygon->prepared, area.get()) == 0) continue;
      if (GEOSPreparedContains_r(geos_.get(), polygon->prepared, area.get()) == 1) {
        pieces.push_back({triangle, polygon->part});
        return Kept::whole;
      }
      // A large polygon is cut to the triangle's box first, which costs far less than an overlay.
      const Geos::Shape near = geos_.own(GEOSClipByRect_r(geos_.get(), polygon->shape, low.x - 1.0,
                                                          low.y - 1.0, high.x + 1.0, high.y + 1.0));
      const bool sound = near && GEOSisValid_r(geos_.get(), near.get()) == 1;
      const Geos::Shape piece = geos_.own(
          GEOSIntersection_r(geos_.get(), sound ? near.get() : polygon->shape, area.get()));
      if (!piece || !add_pieces(piece.get(), polygon->part, pieces)) {
        pieces.resize(before);
        return Kept::failed;
      }
    }
    return pieces.size() > before ? Kept::part : Kept::nothing;
  }

 private:
  struct Polygon {
    const GEOSGeometry* shape;
    const GEOSPreparedGeometry* prepared;
    std::uint8_t part;
  };

  /// Appends the triangles of every polygon of a shape; false: there is no triangulation.
  bool add_pieces(const GEOSGeometry* shape, std::uint8_t part, std::vector<Piece>& pieces) {
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
        const std::vector<glm::dvec2> ring =
            geos_.points_of(GEOSGetExteriorRing_r(geos_.get(), triangle));
        sound = sound && ring.size() == 4;
        if (sound) pieces.push_back({{ring[0], ring[1], ring[2]}, part});
      });
    });
    return sound;
  }

  Geos geos_;
  OutlineShapes shapes_;
  std::vector<Polygon> polygons_;
  std::vector<Polygon*> found_;
  GEOSSTRtree* tree_ = nullptr;
};

CutOut::CutOut(AlphaMask mask) : image_(std::move(mask)) {}
CutOut::CutOut(RegionImage image) : image_(std::move(image)) {}
CutOut::~CutOut() = default;
CutOut::CutOut(CutOut&&) noexcept = default;
CutOut& CutOut::operator=(CutOut&&) noexcept = default;

const ImageFrame& CutOut::frame() const {
  return std::visit([](const auto& image) -> const ImageFrame& { return image.frame; }, image_);
}

std::span<const double> CutOut::tolerances_px() const {
  static constexpr double kOfMasks[] = {0.2, 0.5, 1.0, 2.0, 4.0, 8.0};
  static constexpr double kOfRegions[] = {0.75, 1.5, 3.0, 6.0, 12.0};
  if (mask() != nullptr) return kOfMasks;
  return kOfRegions;
}

std::optional<std::uint8_t> CutOut::part_at(double x_px, double y_px) const {
  if (const AlphaMask* mask = this->mask()) {
    if (alpha_at(*mask, x_px, y_px) >= mask->cutoff) return 0;
    return std::nullopt;
  }
  const RegionImage& image = std::get<RegionImage>(image_);
  const TexelPlace place = texel_at(image.frame, x_px, y_px);
  return image.at(place.x, place.y);
}

std::optional<std::optional<std::uint8_t>> CutOut::sole_part() const {
  using Sole = std::optional<std::optional<std::uint8_t>>;
  if (const AlphaMask* mask = this->mask()) {
    const auto [least, most] = std::ranges::minmax(mask->alpha);
    if (most < mask->cutoff) return Sole(std::in_place, std::nullopt);
    if (least >= mask->cutoff) return Sole(std::in_place, std::uint8_t{0});
    return std::nullopt;
  }
  const RegionImage& image = std::get<RegionImage>(image_);
  const auto [least, most] = std::ranges::minmax(image.region);
  if (least != most) return std::nullopt;
  return Sole(std::in_place, least);
}

double CutOut::unlike_frac(std::span<const glm::dvec2, 3> triangle) const {
  const auto* image = std::get_if<RegionImage>(&image_);
  if (image == nullptr) return 0.0;
  // Places spread evenly over the triangle: a sequence of low discrepancy, folded at its diagonal.
  constexpr int kPlaces = 32;
  int unlike = 0;
  for (int i = 1; i <= kPlaces; ++i) {
    double a = std::fmod(0.7548776662466927 * i, 1.0);
    double b = std::fmod(0.5698402909980532 * i, 1.0);
    if (a + b > 1.0) {
      a = 1.0 - a;
      b = 1.0 - b;
    }
    const glm::dvec2 p =
        triangle[0] + a * (triangle[1] - triangle[0]) + b * (triangle[2] - triangle[0]);
    const TexelPlace place = texel_at(image->frame, p.x, p.y);
    unlike += image->unlike[image->index(place.x, place.y)];
  }
  return static_cast<double>(unlike) / kPlaces;
}

std::optional<CutTriangles> CutOut::cut(const std::vector<glm::dvec2>& uv,
                                        const std::vector<std::uint32_t>& indices,
                                        double tolerance_px) {
  EMIT_CHECK_OP(tolerance_px, >, 0.0);
  CutTriangles out;
  const auto sole = sole_part();
  if (sole && !*sole) return out;
  if (!sole && (!outline_ || tolerance_px_ != tolerance_px)) {
    outline_ = std::visit(
        [&](const auto& image) { return std::make_unique<Outline>(image, tolerance_px); }, image_);
    tolerance_px_ = tolerance_px;
  }
  const bool keeps_all = mask() == nullptr;
  const ImageFrame& frame = this->frame();
  const glm::dvec2 size(frame.width_px, frame.height_px);
  double tiles = 0.0;
  double covered_px2 = 0.0;
  double unlike_px2 = 0.0;
  std::vector<Outline::Piece> pieces;
  for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
    const auto index = static_cast<std::uint32_t>(i / 3);
    if (sole && mask() != nullptr) {
      out.whole.push_back({index, **sole});
      continue;
    }
    Triangle triangle;
    for (std::size_t c = 0; c < 3; ++c) {
      triangle[c] = glm::dvec2(frame.image_from_uv * glm::dvec3(uv[indices[i + c]], 1.0)) * size;
    }
    const glm::dvec2 low = glm::min(glm::min(triangle[0], triangle[1]), triangle[2]);
    const glm::dvec2 high = glm::max(glm::max(triangle[0], triangle[1]), triangle[2]);
    const double extent = std::max(high.x - low.x, high.y - low.y);
    // Coordinates beyond this have no place in the image any more.
    constexpr double kFarthestPx = 1e12;
    if (!(std::max({-low.x, -low.y, high.x, high.y}) < kFarthestPx)) {
      out.whole.push_back({index, 0});
      ++out.uncut;
      continue;
    }
    const glm::dvec2 middle = (triangle[0] + triangle[1] + triangle[2]) / 3.0;
    const double area = std::abs(cross(triangle[1] - triangle[0], triangle[2] - triangle[0]));
    if (!(area > kFlatFrac * extent * extent)) {
      // All of it has one place in the image.
      if (const auto part = part_at(middle.x, middle.y)) out.whole.push_back({index, *part});
      continue;
    }
    covered_px2 += area;
    unlike_px2 += area * unlike_frac(triangle);
    if (sole) {
      out.whole.push_back({index, **sole});
      continue;
    }
    // A triangle that cannot be cut is solid, or of the part in its middle.
    const auto give_up = [&] {
      out.whole.push_back({index, keeps_all ? *part_at(middle.x, middle.y) : std::uint8_t{0}});
      ++out.uncut;
    };
    if (!outline_->valid()) {
      give_up();
      continue;
    }
    glm::dvec2 first(0.0);
    glm::dvec2 last(0.0);
    if (frame.wrap_u != Wrap::clamp) {
      std::tie(first.x, last.x) = tiles_of(low.x / size.x, high.x / size.x);
    }
    if (frame.wrap_v != Wrap::clamp) {
      std::tie(first.y, last.y) = tiles_of(low.y / size.y, high.y / size.y);
    }
    tiles += (last.x - first.x + 1.0) * (last.y - first.y + 1.0);
    if (!(tiles <= kMaxTiles)) return std::nullopt;
    const bool one_tile = first == last;
    // Coordinates that rounding carried over the edge of the image go back onto it.
    const glm::dvec2 lowest(frame.wrap_u == Wrap::clamp ? low.x : 0.0,
                            frame.wrap_v == Wrap::clamp ? low.y : 0.0);
    const glm::dvec2 highest(frame.wrap_u == Wrap::clamp ? high.x : size.x,
                             frame.wrap_v == Wrap::clamp ? high.y : size.y);
    const std::size_t begin = out.corners.size();
    double pieces_px2 = 0.0;
    bool failed = false;
    std::optional<std::uint8_t> whole;
    for (double row = first.y; row <= last.y && !failed; ++row) {
      for (double column = first.x; column <= last.x && !failed; ++column) {
        const bool turn_u = frame.wrap_u == Wrap::mirror && std::fmod(column, 2.0) != 0.0;
        const bool turn_v = frame.wrap_v == Wrap::mirror && std::fmod(row, 2.0) != 0.0;
        // The triangle moves into the one image that the outline is known for.
        Triangle moved = triangle;
        for (glm::dvec2& corner : moved) {
          corner -= glm::dvec2(column, row) * size;
          if (one_tile) corner = glm::clamp(corner, lowest, highest);
          if (turn_u) corner.x = size.x - corner.x;
          if (turn_v) corner.y = size.y - corner.y;
        }
        pieces.clear();
        const Outline::Kept kept = outline_->cut(moved, pieces);
        failed = kept == Outline::Kept::failed;
        if (kept == Outline::Kept::whole && one_tile) {
          whole = pieces.back().part;
          break;
        }
        const bool is_positive = cross(moved[1] - moved[0], moved[2] - moved[0]) > 0.0;
        for (const Outline::Piece& piece : pieces) {
          const double turned =
              cross(piece.corners[1] - piece.corners[0], piece.corners[2] - piece.corners[0]);
          pieces_px2 += std::abs(turned);
          const bool turns = (turned > 0.0) != is_positive;
          for (const std::size_t corner : {0U, turns ? 2U : 1U, turns ? 1U : 2U}) {
            out.corners.push_back({index, piece.part, shares_of(moved, piece.corners[corner])});
          }
        }
      }
    }
    // Regions leave nothing out: the sum of the pieces proves it, but for what tiles_of() rounds.
    constexpr double kMissingFrac = 1e-6;
    const double rounded_px2 = 4.0 * kMissingFrac * extent * std::max(size.x, size.y);
    if (whole) {
      out.whole.push_back({index, *whole});
    } else if (failed ||
               (keeps_all && std::abs(pieces_px2 - area) > kMissingFrac * area + rounded_px2)) {
      out.corners.resize(begin);
      give_up();
    }
  }
  out.unlike_frac = covered_px2 > 0.0 ? unlike_px2 / covered_px2 : 0.0;
  return out;
}

}  // namespace emit::scene
