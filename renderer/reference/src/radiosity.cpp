// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/radiosity.hpp"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <tuple>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "emit/threads/parallel.hpp"

namespace emit::reference {
namespace {

constexpr double kPatchM = 0.2;
/// Distance of a face from the triangle that it stands for, at most: its plane is that of the
/// cells, rounded, and the triangle has coordinates in float32.
constexpr double kFaceToleranceM = 2e-5;
/// Greatest number of reflections that are followed. Each round is weaker by reflectance times the
/// share of the view that shows patches: a closed box that absorbs a hundredth needs some 1400.
constexpr int kMostBounces = 20'000;

/// Calls body(i) for i < n, in parallel.
template <class Body>
void for_range(std::size_t n, std::size_t grain, const Body& body) {
  threads::parallel_ranges(tbb::blocked_range<std::size_t>(0, n, grain), [&](const auto& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i) body(i);
  });
}

/// Returns t^4.
double fourth(double t) {
  const double t2 = t * t;
  return t2 * t2;
}

}  // namespace

SceneExchange::SceneExchange(std::span<const SolidFace> faces,
                             std::span<const ExchangeFace> surfaces, const FaceFinder& finder,
                             const SceneInstant& scene, std::uint32_t rays) {
  EMIT_CHECK_OP(faces.size(), ==, surfaces.size());
  // Gather the optics, then the patches, the views of the faces and the links between patches.
  for (const ExchangeFace& surface : surfaces) {
    absorptance_.push_back(surface.solar_absorptance_frac);
    emissivity_.push_back(surface.emissivity_frac);
    area_m2_.push_back(surface.area_m2);
  }
  sky_frac_.resize(faces.size());
  ground_frac_.resize(faces.size());
  gather_patches(faces);
  trace(surfaces, finder, scene, rays);
  link_patches();
}

void SceneExchange::gather_patches(std::span<const SolidFace> faces) {
  using Key = std::tuple<std::uint8_t, std::int8_t, std::uint16_t, std::int64_t, std::int64_t,
                         std::int64_t>;
  std::map<Key, std::uint32_t> known;
  patch_.resize(faces.size());
  // Assign every face to the tile that contains its centre.
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const SolidFace& face = faces[f];
    const glm::dvec3 centre = face.centre_m();
    std::array<std::int64_t, 3> tile{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double x = centre[static_cast<glm::dvec3::length_type>(axis)];
      // Use the plane's own coordinate across the face, which keeps parallel faces apart.
      tile[axis] = axis == face.axis ? std::llround(x * 1e5)
                                     : static_cast<std::int64_t>(std::floor(x / kPatchM));
    }
    const auto [found, added] =
        known.try_emplace(Key{face.axis, face.sign, face.material, tile[0], tile[1], tile[2]},
                          static_cast<std::uint32_t>(known.size()));
    patch_[f] = found->second;
  }
  // Average area and optics over each patch.
  patch_area_m2_.assign(known.size(), 0.0);
  for (std::size_t f = 0; f < faces.size(); ++f) patch_area_m2_[patch_[f]] += area_m2_[f];
  std::vector<double> reflect(faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) reflect[f] = 1.0 - absorptance_[f];
  patch_reflect_ = patch_means(reflect);
  patch_emissivity_ = patch_means(emissivity_);
}

std::vector<double> SceneExchange::patch_means(std::span<const double> per_face) const {
  EMIT_CHECK_OP(per_face.size(), ==, patch_.size());
  std::vector<double> means(patch_area_m2_.size(), 0.0);
  for (std::size_t f = 0; f < per_face.size(); ++f) means[patch_[f]] += area_m2_[f] * per_face[f];
  for (std::size_t p = 0; p < means.size(); ++p) means[p] /= patch_area_m2_[p];
  return means;
}

void SceneExchange::trace(std::span<const ExchangeFace> surfaces, const FaceFinder& finder,
                          const SceneInstant& scene, std::uint32_t rays) {
  const std::size_t n = surfaces.size();
  std::vector<std::vector<Link>> found(n);
  tbb::enumerable_thread_specific<std::vector<HemisphereRay>> buffers(
      [&] { return std::vector<HemisphereRay>(rays); });
  // Trace the hemisphere of every face.
  for_range(n, 64, [&](std::size_t f) {
    const ExchangeFace& surface = surfaces[f];
    if (surface.enclosed) return;
    std::vector<HemisphereRay>& buffer = buffers.local();
    scene.hemisphere({surface.centre_m, surface.normal, kFaceToleranceM}, buffer,
                     static_cast<std::uint32_t>(f));
    std::uint32_t sky = 0;
    std::uint32_t ground = 0;
    std::vector<std::uint32_t> hits;
    // Sort the rays into sky, surroundings and patches.
    for (const HemisphereRay& ray : buffer) {
      if (!ray.hit_surface) {
        ++(ray.direction.z > 0.0 ? sky : ground);
        continue;
      }
      // The back of a sheet is a face too.
      const glm::dvec3 towards =
          ray.hit.front ? ray.hit.geometric_normal : -ray.hit.geometric_normal;
      const auto face = finder.find(ray.hit.position_world_m, towards);
      // Count a surface that is not part of the model as surroundings.
      if (face) {
        hits.push_back(patch_[*face]);
      } else {
        ++ground;
      }
    }
    const double share = 1.0 / static_cast<double>(rays);
    sky_frac_[f] = sky * share;
    ground_frac_[f] = ground * share;
    // Merge the hits of one patch to one link.
    std::sort(hits.begin(), hits.end());
    for (std::size_t i = 0; i < hits.size();) {
      std::size_t end = i;
      while (end < hits.size() && hits[end] == hits[i]) ++end;
      found[f].push_back({hits[i], static_cast<float>(static_cast<double>(end - i) * share)});
      i = end;
    }
  });
  // Store the links of all faces in one array.
  link_start_.assign(n + 1, 0);
  for (std::size_t f = 0; f < n; ++f) link_start_[f + 1] = link_start_[f] + found[f].size();
  links_.reserve(link_start_[n]);
  for (const auto& list : found) links_.insert(links_.end(), list.begin(), list.end());
}

/// Computes the view factors between patches as means over their faces, weighted by area.
void SceneExchange::link_patches() {
  patch_sky_ = patch_means(sky_frac_);
  patch_ground_ = patch_means(ground_frac_);
  std::vector<std::map<std::uint32_t, double>> sums(patches());
  for (std::size_t f = 0; f < patch_.size(); ++f) {
    for (const Link& link : links(f)) {
      sums[patch_[f]][link.patch] += area_m2_[f] * static_cast<double>(link.share_frac);
    }
  }
  patch_link_start_.push_back(0);
  for (std::size_t p = 0; p < sums.size(); ++p) {
    for (const auto& [other, sum] : sums[p]) {
      patch_links_.push_back({other, static_cast<float>(sum / patch_area_m2_[p])});
    }
    patch_link_start_.push_back(patch_links_.size());
  }
}

namespace {

/// Greatest reflectance times share of the view that shows patches: no round of reflections exceeds
/// this share of the round before.
double most_reflected_frac(const PatchLinks& links, std::span<const double> reflect) {
  double most = 0.0;
  for (std::size_t p = 0; p < reflect.size(); ++p) {
    double share = 0.0;
    for (std::size_t at = links.start[p]; at < links.start[p + 1]; ++at) {
      share += static_cast<double>(links.links[at].share_frac);
    }
    most = std::max(most, reflect[p] * share);
  }
  return most;
}

/// Bound of the sum of all rounds x after `last`, from three consecutive rounds. No entry of the
/// operator K is negative. If y' = K y <= r y in all entries, where y is the sum of two rounds and
/// r < 1, that sum is at most y' r^2/(1 - r^2) (Collatz and Wielandt). Sums of two rounds serve
/// because two plates that face each other are dark in turn.
double bound_of_rest_w_m2(std::span<const double> first, std::span<const double> middle,
                          std::span<const double> last) {
  double ratio = 0.0;
  double most_w_m2 = 0.0;
  for (std::size_t p = 0; p < last.size(); ++p) {
    const double before_w_m2 = first[p] + middle[p];
    const double now_w_m2 = middle[p] + last[p];
    if (now_w_m2 > 0.0) ratio = std::max(ratio, now_w_m2 / before_w_m2);
    most_w_m2 = std::max(most_w_m2, now_w_m2);
  }
  if (!(ratio < 1.0)) return std::numeric_limits<double>::infinity();
  return most_w_m2 * ratio * ratio / (1.0 - ratio * ratio);
}

}  // namespace

double solve_radiosity(const PatchLinks& links, std::span<const double> reflect,
                       std::span<const double> source_w_m2, std::span<double> radiosity_w_m2) {
  const std::size_t n = source_w_m2.size();
  EMIT_CHECK_OP(links.start.size(), ==, n + 1);
  EMIT_CHECK_OP(reflect.size(), ==, n);
  EMIT_CHECK_OP(radiosity_w_m2.size(), ==, n);
  if (n == 0) return 0.0;
  const double share = most_reflected_frac(links, reflect);
  // Add up the reflections of one round after the other, until all that follow are below the limit.
  std::ranges::copy(source_w_m2, radiosity_w_m2.begin());
  std::vector<double> before(n), round(source_w_m2.begin(), source_w_m2.end()), next(n);
  double rest_w_m2 = std::numeric_limits<double>::infinity();
  for (int bounce = 0; bounce < kMostBounces && rest_w_m2 > kRadiosityToleranceWM2; ++bounce) {
    for_range(n, 256, [&](std::size_t p) {
      double in_w_m2 = 0.0;
      for (std::size_t at = links.start[p]; at < links.start[p + 1]; ++at) {
        in_w_m2 += static_cast<double>(links.links[at].share_frac) * round[links.links[at].patch];
      }
      next[p] = reflect[p] * in_w_m2;
      radiosity_w_m2[p] += next[p];
    });
    if (share < 1.0) rest_w_m2 = std::ranges::max(next) * share / (1.0 - share);
    if (bounce > 0) rest_w_m2 = std::min(rest_w_m2, bound_of_rest_w_m2(before, round, next));
    before.swap(round);
    round.swap(next);
  }
  return rest_w_m2;
}

double SceneExchange::incoming(std::span<const double> direct_w_m2, std::span<const double> face_k,
                               const ExchangeSky& sky, std::span<Incoming> out) const {
  EMIT_CHECK_OP(direct_w_m2.size(), ==, patch_.size());
  EMIT_CHECK_OP(face_k.size(), ==, patch_.size());
  EMIT_CHECK_OP(out.size(), ==, patch_.size());
  // Start with the emission of the patches, and with the reflections of sun, sky and surroundings.
  const std::size_t n = patches();
  const std::vector<double> direct = patch_means(direct_w_m2);
  std::vector<double> emitted(face_k.size());
  for_range(face_k.size(), 8192, [&](std::size_t f) {
    emitted[f] = emissivity_[f] * physics::kStefanBoltzmannWPerM2K4 * fourth(face_k[f]);
  });
  const std::vector<double> own_long = patch_means(emitted);
  std::vector<double> reflect_long(n), source_short(n), source_long(n), short_w(n), long_w(n);
  for_range(n, 8192, [&](std::size_t p) {
    reflect_long[p] = 1.0 - patch_emissivity_[p];
    source_short[p] = patch_reflect_[p] * (direct[p] + patch_sky_[p] * sky.diffuse_w_m2 +
                                           patch_ground_[p] * sky.ground_short_w_m2);
    source_long[p] = own_long[p] + reflect_long[p] * (patch_sky_[p] * sky.longwave_w_m2 +
                                                      patch_ground_[p] * sky.ground_long_w_m2);
  });
  // Solve for the radiosities J_sw and J_lw of physics.md eq. 20.
  const PatchLinks links_of_patches{patch_link_start_, patch_links_};
  const double left_w_m2 =
      std::max(solve_radiosity(links_of_patches, patch_reflect_, source_short, short_w),
               solve_radiosity(links_of_patches, reflect_long, source_long, long_w));
  // Collect the radiosity that every face sees.
  for_range(out.size(), 4096, [&](std::size_t f) {
    Incoming in{sky_frac_[f] * sky.diffuse_w_m2 + ground_frac_[f] * sky.ground_short_w_m2,
                sky_frac_[f] * sky.longwave_w_m2 + ground_frac_[f] * sky.ground_long_w_m2};
    for (const Link& link : links(f)) {
      in.shortwave_w_m2 += static_cast<double>(link.share_frac) * short_w[link.patch];
      in.longwave_w_m2 += static_cast<double>(link.share_frac) * long_w[link.patch];
    }
    out[f] = in;
  });
  return left_w_m2;
}

SunOnFaces::SunOnFaces(std::span<const SolidFace> faces, std::span<const ExchangeFace> surfaces)
    : faces_(faces), surfaces_(surfaces.begin(), surfaces.end()) {
  // List the faces around every node: count, sum up, fill.
  std::uint32_t nodes = 0;
  for (const SolidFace& face : faces) {
    for (const std::uint32_t node : face.nodes) nodes = std::max(nodes, node + 1);
  }
  node_start_.assign(nodes + 1, 0);
  for (const SolidFace& face : faces) {
    for (const std::uint32_t node : face.nodes) ++node_start_[node + 1];
  }
  for (std::size_t i = 0; i < nodes; ++i) node_start_[i + 1] += node_start_[i];
  node_faces_.resize(node_start_[nodes]);
  std::vector<std::uint32_t> at(node_start_.begin(), node_start_.end() - 1);
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (const std::uint32_t node : faces[f].nodes) {
      node_faces_[at[node]++] = static_cast<std::uint32_t>(f);
    }
  }
}

/// Returns the mean over a face at three Gauss points each way.
double SunOnFaces::mean_frac(const SceneInstant& scene, const glm::dvec3& to_sun,
                             std::size_t f) const {
  static constexpr std::array<double, 3> kPlace{0.1127016653792583, 0.5, 0.8872983346207417};
  static constexpr std::array<double, 3> kWeight{5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
  const SolidFace& face = faces_[f];
  const auto u = static_cast<glm::dvec3::length_type>(face.axis == 0 ? 1 : 0);
  const auto v = static_cast<glm::dvec3::length_type>(face.axis == 2 ? 1 : 2);
  double sum = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      glm::dvec3 p = face.low_m;
      p[u] += kPlace[i] * (face.high_m[u] - face.low_m[u]);
      p[v] += kPlace[j] * (face.high_m[v] - face.low_m[v]);
      sum += kWeight[i] * kWeight[j] *
             scene.sun_visible_frac_clipped({p, surfaces_[f].normal, kFaceToleranceM}, to_sun)
                 .value_frac;
    }
  }
  return sum;
}

void SunOnFaces::visible_frac(const SceneInstant& scene, const glm::dvec3& to_sun,
                              std::span<double> out) const {
  EMIT_CHECK_OP(out.size(), ==, faces_.size());
  // Test sun or shade by one ray per face. Then integrate the faces beside a change, and from there
  // on their neighbours as long as the disc is partly covered. This covers every penumbra.
  const std::size_t n = faces_.size();
  const auto towards = [&](std::size_t f) {
    return !surfaces_[f].enclosed && glm::dot(surfaces_[f].normal, to_sun) > 0.0;
  };
  std::vector<double> ray(n);
  for_range(n, 256, [&](std::size_t f) {
    const bool lit =
        towards(f) && !scene.occluded({surfaces_[f].centre_m, to_sun, kFaceToleranceM});
    ray[f] = lit ? 1.0 : 0.0;
    out[f] = ray[f];
  });
  const auto same_side = [&](std::size_t a, std::size_t b) {
    return faces_[a].axis == faces_[b].axis && faces_[a].sign == faces_[b].sign;
  };
  // Choose the faces beside a change.
  std::vector<char> taken(n, 0);
  for_range(n, 256, [&](std::size_t f) {
    if (!towards(f)) return;
    for (const std::uint32_t node : faces_[f].nodes) {
      for (std::uint32_t at = node_start_[node]; at < node_start_[node + 1]; ++at) {
        const std::uint32_t other = node_faces_[at];
        // Choose faces at the foot or edge of a solid too: a shadow narrower than a face may begin
        // there.
        if (same_side(f, other) ? ray[other] != ray[f] : !towards(other)) taken[f] = 1;
      }
    }
  });
  std::vector<std::uint32_t> front;
  for (std::size_t f = 0; f < n; ++f) {
    if (taken[f] != 0) front.push_back(static_cast<std::uint32_t>(f));
  }
  // Integrate the front and move it on while the sun is partly visible.
  while (!front.empty()) {
    for_range(front.size(), 8,
              [&](std::size_t i) { out[front[i]] = mean_frac(scene, to_sun, front[i]); });
    std::vector<std::uint32_t> next;
    for (const std::uint32_t f : front) {
      if (!(out[f] > 0.0 && out[f] < 1.0)) continue;
      for (const std::uint32_t node : faces_[f].nodes) {
        for (std::uint32_t at = node_start_[node]; at < node_start_[node + 1]; ++at) {
          const std::uint32_t other = node_faces_[at];
          if (taken[other] != 0 || !same_side(f, other) || !towards(other)) continue;
          taken[other] = 1;
          next.push_back(other);
        }
      }
    }
    front.swap(next);
  }
}

}  // namespace emit::reference
