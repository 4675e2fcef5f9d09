// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/surface_exchange.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/threads/parallel.hpp"
#include "surface/mesh/sheet_sides.hpp"
#include "surface/model/mover_glow.hpp"

namespace emit::renderer {
namespace {

constexpr std::size_t kGrain = 64;
/// Sweeps after the one that takes the surroundings for whatever is seen: each passes heat on by
/// one more bounce, of which a third at most is reflected or re-emitted within minutes.
constexpr std::uint32_t kSweeps = 3;
/// A partner that drives no mode by more is left out.
constexpr double kLeastWeightFrac = 0.03;
constexpr float kMaxReachM = 1.0F;
/// How far beside a body, and how near to the plane of its face, ground counts as touching it.
constexpr float kBesideOffsets = 6.0F;

/// Whole histories of what samples send out, by sample, then node or interval.
struct Columns {
  std::vector<float> longwave_out_w_m2;   ///< nodes
  std::vector<float> flux_w_m2;           ///< nodes, just before what changes there
  std::vector<float> shortwave_out_w_m2;  ///< intervals

  Columns(std::size_t samples, std::size_t intervals)
      : longwave_out_w_m2(samples * (intervals + 1)),
        flux_w_m2(samples * (intervals + 1)),
        shortwave_out_w_m2(samples * intervals) {}
};

class Partners {
 public:
  Partners(const SurfaceInputs& inputs, const PatchSampler& sampler,
           std::vector<SurfacePatch>& patches)
      : in_(inputs), sampler_(sampler), patches_(patches) {}

  /// Appends one patch with all partners. Entries of Partner::sample are indices into it.
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
  // The body alone, in its own axes.
  std::vector<MoverPlacement> alone(in_.movers_now.size());
  for (MoverPlacement& place : alone) place.on = false;
  CasterSelection selection{own.mover < 0, {}};
  if (own.mover >= 0) {
    alone[static_cast<std::size_t>(own.mover)] = {};
    selection.movers = alone;
  }
  const ViewPoint point{own.position_m, own.normal, glm::vec3(0.0F), sampler_.offset_m()};
  const AdjacentFaces adjacent = adjacent_faces(in_.places, point, reach_m, selection);
  for (std::uint32_t k = 0; k < adjacent.count && found_[index].size() < kMaxPartners; ++k) {
    const glm::vec3 m = adjacent.faces[k].normal;
    const float x_m = std::max(adjacent.faces[k].distance_m, 0.0F);
    // As far from the edge as the own point, on the other face.
    const float into = glm::dot(m, own.normal);
    const glm::vec3 along = own.normal - into * m;
    if (glm::length(along) < 0.2F) continue;
    const glm::vec3 at_m =
        own.position_m + x_m * m - (x_m + sampler_.offset_m()) * glm::normalize(along);
    const float lift_m = 20.0F * sampler_.offset_m();
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
    // A body that stands on something: beside it, that something lies in the face's plane.
    const CasterRay beside{own.position_m + kBesideOffsets * sampler_.offset_m() * own.normal, m};
    found.sample.covered =
        in_.places.first_hits({&beside, 1}, selection, hit) != 0U &&
        std::abs(hit[0].distance_m - x_m) < kBesideOffsets * sampler_.offset_m() &&
        glm::dot(hit[0].normal, m) < -0.9F;
    const auto weight = weights(own.material, x_m);
    if (*std::ranges::max_element(weight) < kLeastWeightFrac) continue;
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
        // Until samples are numbered: who the partner belongs to.
        sample.partners[0] = {static_cast<std::uint32_t>(i), own.distance_m,
                              weights(sample.material, own.distance_m)};
        sample.first_seen = static_cast<std::uint32_t>(p);
        partners.samples.push_back(sample);
      }
    }
  }
  const std::size_t count = partners.samples.size();
  const std::size_t intervals = in_.record.size();
  partners.seen.resize(count);
  partners.states.resize(count);
  partners.outputs.resize(count);
  partners.to_sky.resize(count);
  partners.sun_frac.resize(count * intervals);
  if (!in_.movers_now.empty()) partners.hidden_sky.resize(count * intervals);
  threads::parallel_parts(count, kGrain, [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) {
      sampler_.evaluate(partners, static_cast<std::uint32_t>(i),
                        {partners.samples[i].position_m, glm::vec3(0.0F)});
    }
  });
  patches_.push_back(std::move(partners));
}

/// What is seen of one sample counts once.
void add_seen(std::uint32_t sample, float weight_frac, std::size_t first,
              std::vector<SeenSample>& seen) {
  const auto known =
      std::find_if(seen.begin() + static_cast<std::ptrdiff_t>(first), seen.end(),
                   [sample](const SeenSample& other) { return other.sample == sample; });
  if (known != seen.end()) {
    known->weight_frac += weight_frac;
  } else {
    seen.push_back({sample, weight_frac});
  }
}

}  // namespace

void number_samples(const SurfaceInputs& inputs, const PatchSampler& sampler,
                    const SurfaceModelOptions& options, std::vector<SurfacePatch>& patches,
                    SurfaceModel& model) {
  if (options.lateral) Partners(inputs, sampler, patches).add();
  std::vector<std::vector<std::uint32_t>> backs;  // by mesh, vertices of sheets
  for (const RefinedMesh& mesh : model.meshes) {
    backs.push_back(back_vertices(mesh, inputs.materials));
  }
  std::vector<std::uint32_t> first;
  std::uint32_t next = 0;
  for (const SurfacePatch& patch : patches) {
    first.push_back(next);
    next += static_cast<std::uint32_t>(patch.samples.size());
    if (patch.back) next += static_cast<std::uint32_t>(backs[patch.mesh].size());
  }
  // The sample of a vertex of an instance, on the side that is seen.
  const auto sample_of = [&](std::uint32_t instance, std::uint32_t vertex, bool behind) {
    const std::uint32_t mesh = inputs.geometry.instances[instance].mesh;
    const auto back = std::ranges::lower_bound(backs[mesh], vertex);
    if (!behind || back == backs[mesh].end() || *back != vertex) return first[instance] + vertex;
    return first[instance] + static_cast<std::uint32_t>(model.meshes[mesh].vertices().size()) +
           static_cast<std::uint32_t>(back - backs[mesh].begin());
  };
  const std::size_t instances = inputs.geometry.instances.size();
  model.first_sample.assign(first.begin(), first.begin() + static_cast<std::ptrdiff_t>(instances));
  model.drawn_samples = first.size() > instances ? first[instances] : next;
  model.samples.samples.reserve(next);
  const auto number = [&](SurfacePatch& patch, std::size_t i, SurfaceSample sample) {
    sample.first_seen = static_cast<std::uint32_t>(model.samples.seen.size());
    if (!options.exchange) {
      sample.far_frac = 1.0F - sample.sky_frac;
      patch.seen[i].clear();
    }
    for (const SeenPlace& place : patch.seen[i]) {
      const RefinedMesh& mesh = model.meshes[inputs.geometry.instances[place.instance].mesh];
      const RefinedMesh::Place at = mesh.locate(place.triangle, place.barycentric);
      for (glm::length_t k = 0; k < 3; ++k) {
        const float weight = place.weight_frac * at.weight[k];
        if (weight > 0.0F) {
          add_seen(sample_of(place.instance, at.vertex[static_cast<std::size_t>(k)], place.behind),
                   weight, sample.first_seen, model.samples.seen);
        }
      }
    }
    sample.seen_count = static_cast<std::uint32_t>(model.samples.seen.size()) - sample.first_seen;
    model.samples.samples.push_back(sample);
  };
  for (std::size_t p = 0; p < patches.size(); ++p) {
    SurfacePatch& patch = patches[p];
    const bool partners = p >= instances;
    for (std::size_t i = 0; i < patch.samples.size(); ++i) {
      SurfaceSample sample = patch.samples[i];
      if (partners) {
        sample.partners[0].sample += first[sample.first_seen];
      } else {
        for (Partner& partner : sample.partners) {
          if (partner.sample != kNoSample) partner.sample += first[instances];
        }
      }
      number(patch, i, sample);
    }
    if (!patch.back) continue;
    for (const std::uint32_t v : backs[patch.mesh]) {
      SurfaceSample sample = patch.back->samples[v];
      sample.other_side = first[p] + v;
      model.samples.samples[sample.other_side].other_side =
          static_cast<std::uint32_t>(model.samples.samples.size());
      number(*patch.back, v, sample);
    }
  }
}

namespace {

/// What a sample receives over the whole history, but for what its face itself has.
struct Received {
  std::vector<double> longwave_w_m2;   ///< nodes
  std::vector<double> shortwave_w_m2;  ///< intervals

  explicit Received(std::size_t intervals)
      : longwave_w_m2(intervals + 1), shortwave_w_m2(intervals) {}
  void gather(const SurfaceSamples& all, const SurfaceSample& sample, const Columns& sent) {
    const std::size_t intervals = shortwave_w_m2.size();
    const std::size_t nodes = intervals + 1;
    std::ranges::fill(longwave_w_m2, 0.0);
    std::ranges::fill(shortwave_w_m2, 0.0);
    for (std::uint32_t k = 0; k < sample.seen_count; ++k) {
      const SeenSample& seen = all.seen[sample.first_seen + k];
      const double weight = seen.weight_frac;
      for (std::size_t j = 0; j < nodes; ++j) {
        longwave_w_m2[j] += weight * sent.longwave_out_w_m2[seen.sample * nodes + j];
      }
      for (std::size_t j = 0; j < intervals; ++j) {
        shortwave_w_m2[j] += weight * sent.shortwave_out_w_m2[seen.sample * intervals + j];
      }
    }
  }
  /// Of interval j; `i`: the vertex in its patch.
  [[nodiscard]] SampleDrive drive(const SurfacePatch& patch, std::size_t i, std::size_t j) const {
    const std::size_t intervals = shortwave_w_m2.size();
    SampleDrive drive;
    drive.sun_frac = patch.sun_frac[i * intervals + j];
    if (!patch.hidden_sky.empty()) {
      drive.hidden_sky_frac = patch.hidden_sky[i * intervals + j].frac;
    }
    drive.longwave_begin_w_m2 = longwave_w_m2[j];
    drive.longwave_end_w_m2 = longwave_w_m2[j + 1];
    drive.shortwave_w_m2 = shortwave_w_m2[j];
    return drive;
  }
};

/// Carries samples over the whole history, from what the others sent in the sweep before.
class Sweeper {
 public:
  Sweeper(const SurfaceInputs& inputs, const PatchSampler& sampler,
          const SurfaceModelOptions& options, SurfaceModel& model)
      : in_(inputs),
        sampler_(sampler),
        model_(model),
        intervals_(inputs.record.size()),
        nodes_(intervals_ + 1),
        start_(model.samples.samples.size()),
        before_(start_.size(), intervals_),
        after_(start_.size(), intervals_) {
    if (options.exchange && !inputs.movers_now.empty()) {
      glow_ = MoverGlow(model, inputs.geometry, inputs.mover_of_object);
      faces_.resize(inputs.movers_now.size() * nodes_);
    }
    model.states.resize(start_.size());
    model.outputs.resize(start_.size());
  }

  /// The first one takes the surroundings for whatever is seen.
  void sweep(const std::vector<SurfacePatch>& patches, bool first) {
    for (std::size_t p = 0; p < patches.size(); ++p) {
      const SurfacePatch& patch = patches[p];
      const std::size_t offset =
          p < model_.first_sample.size() ? model_.first_sample[p] : model_.drawn_samples;
      threads::parallel_parts(patch.samples.size(), kGrain,
                              [&, offset](std::size_t from, std::size_t to) {
                                Received front(intervals_);
                                Received back(intervals_);
                                for (std::size_t i = from; i < to; ++i)
                                  carry(patch, i, offset + i, first, front, back);
                              });
    }
    std::swap(before_, after_);
    const std::size_t movers = faces_.size() / nodes_;
    for (std::size_t j = 0; j < nodes_ && movers > 0; ++j) {
      glow_.measure(
          model_.samples, in_.record.rays[std::min(j, intervals_ - 1)],
          [&](std::size_t s) { return before_.longwave_out_w_m2[s * nodes_ + j]; },
          std::span(faces_).subspan(j * movers, movers));
    }
    faces_known_ = movers > 0;
  }

 private:
  /// Adds what the entities send that hide the sample's sky in interval j.
  void add_glow(const SurfaceSample& sample, const glm::vec3& normal, const SurfacePatch& patch,
                std::size_t i, std::size_t j, SampleDrive& drive) const;
  void carry(const SurfacePatch& patch, std::size_t i, std::size_t s, bool first, Received& front,
             Received& back);
  [[nodiscard]] SurfaceSample sample_at(std::size_t s, bool first) const {
    SurfaceSample sample = model_.samples.samples[s];
    if (first) {
      sample.far_frac = 1.0F - sample.sky_frac;
      sample.seen_count = 0;
      sample.partners = {};
    }
    return sample;
  }
  void keep_begin(std::size_t s, const SampleOutput& output) {
    after_.longwave_out_w_m2[s * nodes_] = output.longwave_out_w_m2;
    after_.flux_w_m2[s * nodes_] = output.flux_w_m2;
  }
  void keep_end(std::size_t s, std::size_t j, const SampleOutput& output) {
    after_.longwave_out_w_m2[s * nodes_ + j + 1] = output.longwave_out_w_m2;
    after_.flux_w_m2[s * nodes_ + j + 1] = output.flux_w_m2;
    after_.shortwave_out_w_m2[s * intervals_ + j] = output.shortwave_out_w_m2;
  }

  const SurfaceInputs& in_;
  const PatchSampler& sampler_;
  SurfaceModel& model_;
  std::size_t intervals_;
  std::size_t nodes_;
  std::vector<SampleState> start_;
  Columns before_;
  Columns after_;
  MoverGlow glow_;
  std::vector<MoverFaces> faces_;  ///< by node, then entity
  bool faces_known_ = false;
};

void Sweeper::add_glow(const SurfaceSample& sample, const glm::vec3& normal,
                       const SurfacePatch& patch, std::size_t i, std::size_t j,
                       SampleDrive& drive) const {
  if (!faces_known_ || drive.hidden_sky_frac == 0.0F) return;
  const std::size_t mover = patch.hidden_sky[i * intervals_ + j].mover;
  const std::size_t movers = faces_.size() / nodes_;
  const float begin_w_m2 = faces_[j * movers + mover].towards_w_m2(normal);
  const float end_w_m2 = faces_[(j + 1) * movers + mover].towards_w_m2(normal);
  if (begin_w_m2 < 0.0F || end_w_m2 < 0.0F) return;
  const double hidden_frac = sample.sky_frac * drive.hidden_sky_frac;
  drive.longwave_begin_w_m2 += hidden_frac * begin_w_m2;
  drive.longwave_end_w_m2 += hidden_frac * end_w_m2;
  drive.hidden_is_seen = true;
}

void Sweeper::carry(const SurfacePatch& patch, std::size_t i, std::size_t s, bool first,
                    Received& front, Received& back) {
  const SurfaceSample sample = sample_at(s, first);
  const std::uint32_t other = sample.other_side;
  const bool sheet = other != kNoSample;
  const SurfaceSample behind = sheet ? sample_at(other, first) : SurfaceSample{};
  if (first) start_[s] = sampler_.start_state(sample);
  front.gather(model_.samples, sample, before_);
  if (sheet) back.gather(model_.samples, behind, before_);
  SampleState state = start_[s];
  // A partner's modes drive the same states here, scaled: so do those at the start.
  for (std::size_t p = 0; p < kMaxPartners; ++p) {
    const Partner& partner = sample.partners[p];
    if (partner.sample == kNoSample) continue;
    for (std::size_t m = 0; m < physics::kMaxFosterModes; ++m) {
      state.partner_k[p][m] = partner.weight_frac[m] * start_[partner.sample].modes_k[m];
    }
  }
  SampleOutput output;
  SampleOutput back_output;
  for (std::size_t j = 0; j < intervals_; ++j) {
    const HeatInterval& interval = in_.record.intervals[j];
    SampleDrive drive = front.drive(patch, i, j);
    for (std::size_t p = 0; p < kMaxPartners; ++p) {
      const std::uint32_t partner = sample.partners[p].sample;
      if (partner == kNoSample) continue;
      drive.partner_begin_w_m2[p] = before_.flux_w_m2[partner * nodes_ + j];
      drive.partner_end_w_m2[p] = before_.flux_w_m2[partner * nodes_ + j + 1];
    }
    const glm::vec3 normal = in_.record.rays[j].normal(sample);
    add_glow(sample, normal, patch, i, j, drive);
    if (j == 0) {
      keep_begin(s, in_.heat.output(sample, normal, interval.forcing.begin, drive, state));
    }
    if (!sheet) {
      output = in_.heat.advance(sample, normal, interval, drive, state);
    } else {
      SampleDrive back_drive = back.drive(*patch.back, i, j);
      add_glow(behind, -normal, *patch.back, i, j, back_drive);
      const SheetBack face{behind, back_drive};
      if (j == 0) {
        keep_begin(other,
                   in_.heat.output(behind, -normal, interval.forcing.begin, back_drive, state));
      }
      output = in_.heat.advance(sample, normal, interval, drive, state, &face);
      back_drive.longwave_begin_w_m2 = back_drive.longwave_end_w_m2;
      back_output = in_.heat.output(behind, -normal, interval.forcing.end, back_drive, state);
      keep_end(other, j, back_output);
    }
    keep_end(s, j, output);
  }
  model_.states[s] = state;
  model_.outputs[s] = output;
  if (sheet) {
    model_.states[other] = state;
    model_.outputs[other] = back_output;
  }
}

}  // namespace

bool exchange(const SurfaceInputs& inputs, const PatchSampler& sampler,
              const SurfaceModelOptions& options, std::vector<SurfacePatch>& patches,
              SurfaceModel& model, const SurfaceProgress& report) {
  Sweeper sweeper(inputs, sampler, options, model);
  const std::uint32_t sweeps = options.exchange || options.lateral ? kSweeps : 0;
  for (std::uint32_t i = 0; i <= sweeps; ++i) {
    sweeper.sweep(patches, i == 0);
    if (report && !report((i + 1.0) / (sweeps + 1.0))) return false;
  }
  return true;
}

}  // namespace emit::renderer
