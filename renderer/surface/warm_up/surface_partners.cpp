// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/surface_partners.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/threads/parallel.hpp"

namespace emit::renderer {
namespace {

constexpr std::size_t kGrain = 64;
/// A partner that drives no mode by more than this share is left out.
constexpr double kMinWeightFrac = 0.03;
constexpr float kMaxReachM = 1.0F;
/// The sine of the angle between two faces that exchange heat is at least this.
constexpr float kMinSine = 0.2F;
/// One of eight tangents meets a face within reach after at most that many reaches: it points at
/// most 22.5 degrees aside of the face, which slants by kMinSine at least.
constexpr float kFlatReaches = 5.5F;
/// Ground touches a body when it lies this many ray offsets beside it, and as near to the plane of
/// its face.
constexpr float kBesideOffsets = 6.0F;

class Partners {
 public:
  Partners(const SurfaceInputs& inputs, const PatchSampler& sampler,
           std::vector<SurfacePatch>& patches)
      : in_(inputs), sampler_(sampler), patches_(patches) {}

  /// Appends one patch with all partners.
  void add();

 private:
  void find(SurfacePatch& patch, std::uint32_t index);
  [[nodiscard]] std::array<float, physics::kMaxFosterModes> weights(std::uint32_t material,
                                                                    float distance_m) const;

  const SurfaceInputs& in_;
  const PatchSampler& sampler_;
  std::vector<SurfacePatch>& patches_;
  struct Found {
    SurfaceSample sample;
    float distance_m = 0.0F;
  };
  std::vector<std::vector<Found>> found_;  ///< by vertex of the patch at hand
};

std::array<float, physics::kMaxFosterModes> Partners::weights(std::uint32_t material,
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

void Partners::find(SurfacePatch& patch, std::uint32_t index) {
  const SurfaceSample& own = patch.samples[index];
  const scene::Material& material = in_.materials[own.material];
  const double a = diffusivity_m2_s(material);
  const physics::FosterNetwork& network = in_.history.network(own.material);
  if (!(a > 0.0) || network.count == 0) return;
  const double slowest_s = network.modes[network.count - 1].tau_s;
  const float reach_m = std::min(kMaxReachM, 5.0F * static_cast<float>(std::sqrt(a * slowest_s)));
  // Leave out what lies in a plane as far as the rays below would look.
  if (own.flat_m > kFlatReaches * reach_m) return;
  // Look at the body alone, in its own axes.
  std::vector<MoverPlacement> alone(in_.movers_now.size());
  for (MoverPlacement& place : alone) place.on = false;
  CasterSelection selection{own.mover < 0, {}};
  if (own.mover >= 0) {
    alone[static_cast<std::size_t>(own.mover)] = {};
    selection.movers = alone;
  }
  // Inside a body's own axes float32 resolves more than where the body stands.
  const float offset_m = sampler_.tracer().offsets(own.position_m, -1).around_m;
  const ViewPoint point{own.position_m, own.normal, glm::vec3(0.0F), offset_m};
  const AdjacentFaces adjacent = adjacent_faces(in_.places, point, reach_m, selection);
  for (std::uint32_t k = 0; k < adjacent.count && found_[index].size() < kMaxPartners; ++k) {
    const glm::vec3 m = adjacent.faces[k].normal;
    const float x_m = std::max(adjacent.faces[k].distance_m, 0.0F);
    // Step to the point on the other face that is as far from the edge as the own one.
    const float into = glm::dot(m, own.normal);
    const glm::vec3 along = own.normal - into * m;
    if (glm::length(along) < kMinSine) continue;
    const glm::vec3 at_m =
        own.position_m + x_m * m - (x_m + offset_m) * glm::normalize(along);
    const float lift_m = 20.0F * offset_m;
    const CasterRay probe{at_m + lift_m * m, -m};
    std::array<CasterHit, 1> hit;
    if (in_.places.first_hits({&probe, 1}, selection, hit) == 0U ||
        std::abs(hit[0].distance_m - lift_m) > 0.5F * lift_m || glm::dot(hit[0].normal, m) < 0.9F) {
      continue;
    }
    const scene::Instance& instance = in_.geometry.instances[hit[0].instance];
    const scene::Mesh& mesh = in_.geometry.meshes[instance.mesh];
    Found found;
    found.sample.position_m = at_m;
    found.sample.normal = m;
    found.sample.mover = own.mover;
    found.sample.material = own.material;
    for (const scene::Submesh& submesh : mesh.submeshes) {
      if (3 * hit[0].triangle >= submesh.first_index &&
          3 * hit[0].triangle < submesh.first_index + submesh.index_count) {
        found.sample.material = submesh.material;
      }
    }
    found.distance_m = x_m;
    // Find out whether the face stands on something: beside the body that lies in its plane.
    const CasterRay beside{own.position_m + kBesideOffsets * offset_m * own.normal, m};
    found.sample.covered =
        in_.places.first_hits({&beside, 1}, selection, hit) != 0U &&
        std::abs(hit[0].distance_m - x_m) < kBesideOffsets * offset_m &&
        glm::dot(hit[0].normal, m) < -0.9F;
    const auto weight = weights(own.material, x_m);
    if (*std::ranges::max_element(weight) < kMinWeightFrac) continue;
    found_[index].push_back(found);
  }
}

void Partners::add() {
  SurfacePatch partners;
  const std::size_t own_patches = patches_.size();
  for (std::size_t p = 0; p < own_patches; ++p) {
    SurfacePatch& patch = patches_[p];
    found_.assign(patch.samples.size(), {});
    threads::parallel_parts(patch.samples.size(), kGrain, [&](std::size_t from, std::size_t to) {
      for (std::size_t i = from; i < to; ++i) find(patch, static_cast<std::uint32_t>(i));
    });
    for (std::size_t i = 0; i < found_.size(); ++i) {
      for (std::size_t k = 0; k < found_[i].size(); ++k) {
        Partner& own = patch.samples[i].partners[k];
        own.sample = static_cast<std::uint32_t>(partners.samples.size());
        own.distance_m = found_[i][k].distance_m;
        own.weight_frac = weights(patch.samples[i].material, own.distance_m);
        SurfaceSample sample = found_[i][k].sample;
        // Note whom the partner belongs to, until samples are numbered.
        sample.partners[0] = {static_cast<std::uint32_t>(i), own.distance_m,
                              weights(sample.material, own.distance_m)};
        sample.first_seen = static_cast<std::uint32_t>(p);
        partners.samples.push_back(sample);
      }
    }
  }
  const std::size_t count = partners.samples.size();
  const std::size_t intervals = in_.record.size();
  std::vector<SurfaceSample> samples = std::move(partners.samples);
  partners.begin(intervals, !in_.movers_now.empty(), sampler_.keeps_sent());
  partners.grow(count);
  partners.samples = std::move(samples);
  threads::parallel_parts(count, kGrain, [&](std::size_t from, std::size_t to) {
    PatchSampler::StartMemo memo;
    for (std::size_t i = from; i < to; ++i) {
      sampler_.evaluate(partners, static_cast<std::uint32_t>(i),
                        {partners.samples[i].position_m, glm::vec3(0.0F)}, memo);
    }
  });
  patches_.push_back(std::move(partners));
}

}  // namespace

void add_partners(const SurfaceInputs& inputs, const PatchSampler& sampler,
                  std::vector<SurfacePatch>& patches) {
  Partners(inputs, sampler, patches).add();
}

}  // namespace emit::renderer
