// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/surface_partners.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>
#include <tuple>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/threads/parallel.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {
namespace {

/// Partners in one task of a parallel loop.
constexpr std::size_t kGrain = 64;
/// Partners between two reports of progress. It is a multiple of kGrain, so that the tasks hold the
/// same partners with and without slices.
constexpr std::size_t kSlice = 16384;
/// A partner that drives no mode by more than this share is left out.
constexpr double kMinWeightFrac = 0.03;
/// Greatest distance of a partner's face from its sample, in m.
constexpr float kMaxReachM = 1.0F;
/// Least sine of the angle between two faces that exchange heat.
constexpr float kMinSine = 0.2F;
/// Distance, in reaches, within which one of eight tangents meets a face that lies within reach:
/// the tangent points at most 22.5 degrees aside of the face, which slants by kMinSine at least.
constexpr float kFlatReaches = 5.5F;
/// Distance, in ray offsets, that counts as touching: ground touches a body if it lies this close
/// beside it, and this close to the plane of its face.
constexpr float kBesideOffsets = 6.0F;

}  // namespace

std::array<float, physics::kMaxFosterModes> PartnerFinder::weights(std::uint32_t material,
                                                                   float distance_m) const {
  std::array<float, physics::kMaxFosterModes> out{};
  const double a = diffusivity_m2_s(in_.materials[material]);
  if (!(a > 0.0)) return out;
  const physics::FosterNetwork& network = in_.history.network(material);
  for (std::size_t i = 0; i < network.count; ++i) {
    const double z = static_cast<double>(distance_m) / std::sqrt(a * network.modes[i].tau_s);
    out[i] = static_cast<float>(std::exp(-0.5 * z * z));
  }
  return out;
}

float PartnerFinder::greatest_weight(std::uint32_t material, float distance_m) const {
  const auto weight = weights(material, distance_m);
  return *std::ranges::max_element(weight);
}

void PartnerFinder::grow(std::size_t patch, std::size_t vertices) {
  EMIT_CHECK_OP(patch, <, in_.geometry.instances.size());
  if (found_.size() <= patch) found_.resize(patch + 1);
  EMIT_CHECK_OP(vertices, >=, found_[patch].size());
  found_[patch].resize(vertices);
}

void PartnerFinder::find(std::size_t patch, std::uint32_t vertex, const SurfaceSample& own) {
  EMIT_DCHECK_OP(patch, <, found_.size());
  EMIT_DCHECK_OP(vertex, <, found_[patch].size());
  std::vector<Found>& partners = found_[patch][vertex];
  // Reach as far as the slowest mode conducts: beyond five depths the weight is next to 0.
  const scene::Material& material = in_.materials[own.material];
  const double a = diffusivity_m2_s(material);
  const physics::FosterNetwork& network = in_.history.network(own.material);
  if (!(a > 0.0) || network.count == 0) return;
  const double slowest_s = network.modes[network.count - 1].tau_s;
  const float reach_m = std::min(kMaxReachM, 5.0F * static_cast<float>(std::sqrt(a * slowest_s)));
  // Leave out a sample around which the surface is a plane as far as the rays below would look.
  if (own.flat_m > kFlatReaches * reach_m) return;
  // Look at the sample's own body alone, in the axes of the body.
  std::vector<EntityPlacement> alone(in_.entities_now.size());
  for (EntityPlacement& place : alone) place.on = false;
  CasterSelection selection{own.entity < 0, {}};
  if (own.entity >= 0) {
    alone[static_cast<std::size_t>(own.entity)] = {};
    selection.entities = alone;
  }
  // Take the offset of the place in the body's axes: float32 resolves more there than where the
  // body stands.
  const float offset_m = ray_offsets(own.position_m, own.facet_m).around_m;
  const ViewPoint point{own.position_m, own.normal, glm::vec3(0.0F), offset_m};
  const AdjacentFaces adjacent = adjacent_faces(in_.places, point, reach_m, selection);
  for (std::uint32_t k = 0; k < adjacent.count && partners.size() < kMaxPartners; ++k) {
    const glm::vec3 m = adjacent.faces[k].normal;
    const float x_m = std::max(adjacent.faces[k].distance_m, 0.0F);
    // Step to the point on the other face that is as far from the edge as the sample is.
    const float into = glm::dot(m, own.normal);
    const glm::vec3 along = own.normal - into * m;
    if (glm::length(along) < kMinSine) continue;
    const glm::vec3 at_m = own.position_m + x_m * m - (x_m + offset_m) * glm::normalize(along);
    const float lift_m = 20.0F * offset_m;
    const CasterRay probe{at_m + lift_m * m, -m};
    std::array<CasterHit, 1> hit;
    if (in_.places.first_hits({&probe, 1}, selection, hit) == 0U ||
        std::abs(hit[0].distance_m - lift_m) > 0.5F * lift_m || glm::dot(hit[0].normal, m) < 0.9F) {
      continue;
    }
    // Fill the partner's sample. Its material is that of the triangle that was hit.
    const scene::Instance& instance = in_.geometry.instances[hit[0].instance];
    const scene::Mesh& mesh = in_.geometry.meshes[instance.mesh];
    Found found;
    found.sample.position_m = at_m;
    found.sample.normal = m;
    found.sample.entity = own.entity;
    found.sample.facet_m = own.facet_m;
    found.sample.material = own.material;
    for (const scene::Submesh& submesh : mesh.submeshes) {
      if (3 * hit[0].triangle >= submesh.first_index &&
          3 * hit[0].triangle < submesh.first_index + submesh.index_count) {
        found.sample.material = submesh.material;
      }
    }
    found.distance_m = x_m;
    // Find out whether the partner's face stands on ground: look for ground beside the body, in the
    // plane of that face.
    const CasterRay beside{own.position_m + kBesideOffsets * offset_m * own.normal, m};
    found.sample.covered = in_.places.first_hits({&beside, 1}, selection, hit) != 0U &&
                           std::abs(hit[0].distance_m - x_m) < kBesideOffsets * offset_m &&
                           glm::dot(hit[0].normal, m) < -0.9F;
    if (greatest_weight(own.material, x_m) < kMinWeightFrac) continue;
    partners.push_back(found);
  }
}

std::size_t PartnerFinder::count() const noexcept {
  std::size_t out = 0;
  for (const auto& vertices : found_) {
    for (const std::vector<Found>& partners : vertices) out += partners.size();
  }
  return out;
}

void PartnerFinder::drop(std::size_t count) {
  // List all partners by their greatest weight, equal ones by the sample they belong to.
  struct Place {
    float weight_frac = 0.0F;
    std::uint32_t patch = 0;
    std::uint32_t vertex = 0;
  };
  std::vector<Place> places;
  for (std::uint32_t p = 0; p < found_.size(); ++p) {
    for (std::uint32_t v = 0; v < found_[p].size(); ++v) {
      for (const Found& found : found_[p][v]) {
        places.push_back({greatest_weight(found.sample.material, found.distance_m), p, v});
      }
    }
  }
  count = std::min(count, places.size());
  std::ranges::sort(places, [](const Place& a, const Place& b) {
    return std::tie(a.weight_frac, a.patch, a.vertex) < std::tie(b.weight_frac, b.patch, b.vertex);
  });
  // Remove the farthest partner of each of the first samples in the list.
  for (std::size_t i = 0; i < count; ++i) {
    std::vector<Found>& partners = found_[places[i].patch][places[i].vertex];
    partners.erase(std::ranges::max_element(partners, {}, &Found::distance_m));
  }
}

bool PartnerFinder::append(std::vector<SurfacePatch>& patches,
                           const std::function<bool(std::size_t count)>& evaluated) const {
  EMIT_CHECK_OP(found_.size(), ==, patches.size());
  SurfacePatch partners;
  for (std::size_t p = 0; p < patches.size(); ++p) {
    SurfacePatch& patch = patches[p];
    for (std::size_t i = 0; i < found_[p].size(); ++i) {
      for (std::size_t k = 0; k < found_[p][i].size(); ++k) {
        const Found& found = found_[p][i][k];
        Partner& own = patch.samples[i].partners[k];
        own.sample = static_cast<std::uint32_t>(partners.samples.size());
        own.distance_m = found.distance_m;
        own.weight_frac = weights(patch.samples[i].material, own.distance_m);
        SurfaceSample sample = found.sample;
        // Note the sample that the partner belongs to, until samples are numbered.
        sample.partners[0] = {static_cast<std::uint32_t>(i), own.distance_m,
                              weights(sample.material, own.distance_m)};
        sample.first_seen = static_cast<std::uint32_t>(p);
        partners.samples.push_back(sample);
      }
    }
  }
  // Evaluate the partners like other samples, in slices.
  const std::size_t count = partners.samples.size();
  std::vector<SurfaceSample> samples = std::move(partners.samples);
  partners.samples = {};
  partners.begin(in_.record.size(), !in_.entities_now.empty(), sampler_.keeps_sent());
  partners.grow(count);
  partners.samples = std::move(samples);
  for (std::size_t begin = 0; begin < count; begin += kSlice) {
    const std::size_t end = std::min(count, begin + kSlice);
    threads::parallel_parts(end - begin, kGrain, [&](std::size_t from, std::size_t to) {
      PatchSampler::StartMemo memo;
      std::array<NewSample, kAdvanceTogether> group;
      for (std::size_t i = begin + from; i < begin + to; i += kAdvanceTogether) {
        const std::size_t in_group = std::min(begin + to - i, kAdvanceTogether);
        for (std::size_t k = 0; k < in_group; ++k) {
          group[k] = {&partners,
                      static_cast<std::uint32_t>(i + k),
                      {partners.samples[i + k].position_m, glm::vec3(0.0F)}};
        }
        sampler_.evaluate(std::span(group).first(in_group), memo);
      }
    });
    if (!evaluated(end - begin)) return false;
  }
  patches.push_back(std::move(partners));
  return true;
}

}  // namespace emit::renderer
