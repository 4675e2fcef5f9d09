// SPDX-License-Identifier: Apache-2.0
#include "region_image.hpp"

#include <algorithm>
#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <unordered_map>

#include "emit/physics/check.hpp"

namespace emit::scene {
namespace {

/// Colours that are nearer than this cannot be told apart: the texel has that very colour.
constexpr double kSameDistance = 0.02;

/// Linear light of a value of sRGB (IEC 61966-2-1).
double linear(std::uint8_t value) {
  const double v = value / 255.0;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

/// OKLab: lightness 0 to 1 and two opponent colours (B. Ottosson, 2020).
glm::dvec3 oklab(const Rgb& colour) {
  const glm::dvec3 rgb(linear(colour[0]), linear(colour[1]), linear(colour[2]));
  const double l = std::cbrt(glm::dot(rgb, glm::dvec3(0.4122214708, 0.5363325363, 0.0514459929)));
  const double m = std::cbrt(glm::dot(rgb, glm::dvec3(0.2119034982, 0.6806995451, 0.1073969566)));
  const double s = std::cbrt(glm::dot(rgb, glm::dvec3(0.0883024619, 0.2817188376, 0.6299787005)));
  return {0.2104542553 * l + 0.7936177850 * m - 0.0040720468 * s,
          1.9779984951 * l - 2.4285922050 * m + 0.4505937099 * s,
          0.0259040371 * l + 0.7827717662 * m - 0.8086757660 * s};
}

/// Nearest region among those that `allowed` has a bit for.
struct Nearest {
  std::uint8_t region = 0;
  double distance = std::numeric_limits<double>::infinity();
};
Nearest nearest(const glm::dvec3& lab, std::span<const glm::dvec3> legend, std::uint64_t allowed) {
  Nearest out;
  for (std::size_t k = 0; k < legend.size(); ++k) {
    if (((allowed >> k) & 1U) == 0) continue;
    const double distance = glm::distance(lab, legend[k]);
    if (distance < out.distance) out = {static_cast<std::uint8_t>(k), distance};
  }
  return out;
}

/// A colour of the image is looked up once for all its texels.
struct KnownColour {
  glm::dvec3 lab{0.0};
  Nearest nearest;
};

/// Patch of texels of one region that are joined along their sides.
struct Patch {
  std::vector<std::size_t> texels;
  std::array<std::uint32_t, kMaxRegions> border{};  ///< sides towards each other region
};

}  // namespace

TexelPlace texel_at(const ImageFrame& frame, double x_px, double y_px) {
  x_px = near_first(x_px, frame.width_px, frame.wrap_u);
  y_px = near_first(y_px, frame.height_px, frame.wrap_v);
  return {wrapped(static_cast<int>(std::floor(x_px)), frame.width_px, frame.wrap_u),
          wrapped(static_cast<int>(std::floor(y_px)), frame.height_px, frame.wrap_v)};
}

RegionImage regions_by_colour(const ImageFrame& frame, std::span<const unsigned char> pixels,
                              std::span<const Rgb> legend) {
  EMIT_CHECK_OP(legend.size(), <=, kMaxRegions);
  EMIT_CHECK(!legend.empty());
  RegionImage image{frame, legend.size(), {}, {}};
  const std::size_t count =
      static_cast<std::size_t>(frame.width_px) * static_cast<std::size_t>(frame.height_px);
  EMIT_CHECK_OP(pixels.size(), ==, 4 * count);
  std::vector<glm::dvec3> labs;
  for (const Rgb& colour : legend) labs.push_back(oklab(colour));
  const std::uint64_t all =
      legend.size() == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << legend.size()) - 1;

  std::unordered_map<std::uint32_t, KnownColour> known;
  const auto colour_of = [&](std::size_t texel) -> const KnownColour& {
    const unsigned char* p = pixels.data() + 4 * texel;
    const std::uint32_t key = (std::uint32_t{p[0]} << 16U) | (std::uint32_t{p[1]} << 8U) | p[2];
    const auto [entry, is_new] = known.try_emplace(key);
    if (is_new) {
      entry->second.lab = oklab({p[0], p[1], p[2]});
      entry->second.nearest = nearest(entry->second.lab, labs, all);
    }
    return entry->second;
  };
  image.region.resize(count);
  image.unlike.resize(count);
  std::vector<std::uint8_t> exact(count);
  for (std::size_t i = 0; i < count; ++i) {
    const KnownColour& colour = colour_of(i);
    image.region[i] = colour.nearest.region;
    image.unlike[i] = colour.nearest.distance > kUnlikeDistance ? 1 : 0;
    exact[i] = colour.nearest.distance <= kSameDistance ? 1 : 0;
  }
  // Filters mix the colours of both sides of an outline over two texels at most.
  constexpr int kReach = 2;
  for (int y = 0; y < frame.height_px; ++y) {
    for (int x = 0; x < frame.width_px; ++x) {
      const std::size_t i = image.index(x, y);
      if (exact[i] != 0) continue;
      std::uint64_t around = 0;
      for (int dy = -kReach; dy <= kReach; ++dy) {
        for (int dx = -kReach; dx <= kReach; ++dx) {
          const std::size_t n = image.index(wrapped(x + dx, frame.width_px, frame.wrap_u),
                                            wrapped(y + dy, frame.height_px, frame.wrap_v));
          if (exact[n] != 0) around |= std::uint64_t{1} << image.region[n];
        }
      }
      // Texels that are not exact keep what they are until all have been looked at: only exact
      // ones are read above.
      if (around != 0) image.region[i] = nearest(colour_of(i).lab, labs, around).region;
    }
  }
  return image;
}

std::vector<ColourShare> main_colours(std::span<const unsigned char> pixels, std::size_t most) {
  struct Sum {
    std::array<std::uint64_t, 3> values{};
    std::uint64_t count = 0;
  };
  std::uint64_t count = 0;
  // Similar colours have the same first bits: all of them, or three where that makes too many.
  for (const unsigned int dropped_bits : {0U, 5U}) {
    std::unordered_map<std::uint32_t, Sum> sums;
    count = 0;
    for (std::size_t i = 0; i + 3 < pixels.size(); i += 4) {
      if (pixels[i + 3] == 0) continue;
      std::uint32_t key = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        key = (key << 8U) | (std::uint32_t{pixels[i + c]} >> dropped_bits);
      }
      Sum& sum = sums[key];
      for (std::size_t c = 0; c < 3; ++c) sum.values[c] += pixels[i + c];
      ++sum.count;
      ++count;
      if (dropped_bits == 0 && sums.size() > kMaxRegions) break;
    }
    if (dropped_bits == 0 && sums.size() > kMaxRegions) continue;
    std::vector<ColourShare> out;
    for (const auto& [key, sum] : sums) {
      ColourShare colour;
      for (std::size_t c = 0; c < 3; ++c) {
        colour.rgb[c] = static_cast<std::uint8_t>((sum.values[c] + sum.count / 2) / sum.count);
      }
      colour.frac = static_cast<double>(sum.count) / static_cast<double>(count);
      out.push_back(colour);
    }
    std::ranges::sort(out, [](const ColourShare& a, const ColourShare& b) {
      return a.frac != b.frac ? a.frac > b.frac : a.rgb < b.rgb;
    });
    if (out.size() > most) out.resize(most);
    return out;
  }
  return {};
}

void drop_small_patches(RegionImage& image, std::uint32_t smallest_px) {
  if (smallest_px <= 1) return;
  const int width = image.frame.width_px;
  const int height = image.frame.height_px;
  // A patch that takes another region may join others, so that the passes end when none is small.
  // A picture of nothing but small patches may go on changing; it stops here.
  constexpr int kMaxPasses = 8;
  std::vector<std::uint8_t> seen;
  std::vector<std::size_t> open;
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    bool changed = false;
    seen.assign(image.region.size(), 0);
    for (std::size_t first = 0; first < image.region.size(); ++first) {
      if (seen[first] != 0) continue;
      const std::uint8_t region = image.region[first];
      Patch patch;
      open.assign(1, first);
      seen[first] = 1;
      std::size_t size = 0;
      while (!open.empty()) {
        const std::size_t i = open.back();
        open.pop_back();
        ++size;
        if (size <= smallest_px) patch.texels.push_back(i);
        const int x = static_cast<int>(i % static_cast<std::size_t>(width));
        const int y = static_cast<int>(i / static_cast<std::size_t>(width));
        constexpr int kSides[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
        for (const auto& side : kSides) {
          const int nx = x + side[0];
          const int ny = y + side[1];
          if (nx < 0 || ny < 0 || nx >= width || ny >= height) continue;
          const std::size_t n = image.index(nx, ny);
          if (image.region[n] != region) {
            ++patch.border[image.region[n]];
          } else if (seen[n] == 0) {
            seen[n] = 1;
            open.push_back(n);
          }
        }
      }
      const auto most = std::ranges::max_element(patch.border);
      if (size >= smallest_px || *most == 0) continue;
      const auto other = static_cast<std::uint8_t>(most - patch.border.begin());
      for (const std::size_t i : patch.texels) image.region[i] = other;
      changed = true;
    }
    if (!changed) break;
  }
}

}  // namespace emit::scene
