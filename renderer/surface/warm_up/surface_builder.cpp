// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <memory>
#include <span>

#include "emit/threads/parallel.hpp"
#include "surface/columns/surface_columns.hpp"
#include "surface/mesh/refined_mesh_edges.hpp"
#include "surface/mesh/sheet_sides.hpp"
#include "surface/model/body_nodes.hpp"
#include "surface/model/surface_model.hpp"
#include "surface/rays/ray_offsets.hpp"
#include "surface/warm_up/clutter_twins.hpp"
#include "surface/warm_up/facet_edges.hpp"
#include "surface/warm_up/sample_numbers.hpp"
#include "surface/warm_up/surface_exchange.hpp"
#include "surface/warm_up/surface_patch.hpp"
#include "surface/warm_up/surface_refinement.hpp"

namespace emit::renderer {
namespace {

/// Largest number of rounds of refinement.
constexpr std::uint32_t kMaxRounds = 400;
/// Limits of a round. It halves the leaves that need more than the greatest need divided by
/// kNeedStep. If these are fewer than one in kRoundShare of all leaves in need, or than
/// kMinPerRound, it takes that many: otherwise a few needy triangles, one per round, would use up
/// the rounds.
constexpr float kNeedStep = 4.0F;
constexpr std::size_t kRoundShare = 8;
constexpr std::size_t kMinPerRound = 256;
/// A round for which samples do not suffice is the last one if it adds no more than max_samples /
/// kLastFraction samples.
constexpr std::size_t kLastFraction = 256;
/// Samples in one task of a parallel loop.
constexpr std::size_t kGrain = 64;
/// Distance within which the surface as loaded is searched, as a share of the halved edge.
constexpr float kDetailReachFrac = 0.5F;
/// Distance from a crease at which the surface as loaded is searched, as a share of the halved
/// edge.
constexpr float kOffCreaseFrac = 0.02F;

/// Share of the progress that ends when every sample is evaluated. The rest is the exchange, which
/// takes somewhat more than half the time in scenes of bodies on open ground.
constexpr double kEvaluatedFrac = 0.45;

/// Estimates how much of the evaluation of samples is done. Nobody knows how many samples the
/// refinement will take: at least one and a half as many as before it, and some for each leaf that
/// is too coarse.
class EvaluationProgress {
 public:
  /// Sets the number of samples before the refinement, and the greatest one after it.
  void begin(std::size_t samples, std::size_t most) noexcept {
    most_ = static_cast<double>(std::max(samples, most));
    least_ = refined_ = std::min(2.5 * static_cast<double>(samples), most_);
  }
  /// Takes the number of leaves that a round of the refinement found too coarse. The refinement is
  /// over when there is none.
  void expect(std::size_t coarse_leaves) noexcept {
    // A leaf that is halved often has halves that are too coarse as well.
    constexpr double kSamplesOfLeaf = 2.5;
    const double left = kSamplesOfLeaf * static_cast<double>(coarse_leaves);
    const double expected = std::min(std::max(least_, done_ + left), std::max(most_, done_));
    refined_ = coarse_leaves == 0 ? done_ : expected;
  }
  /// Takes the number of samples that were evaluated since the last call. Returns the part that is
  /// done, 0 to 1; it never falls.
  double advance(std::size_t samples) noexcept {
    done_ += static_cast<double>(samples);
    frac_ = std::max(frac_, done_ / std::max({refined_, done_, 1.0}));
    return frac_;
  }

 private:
  double most_ = 0.0;     ///< greatest number of samples after the refinement
  double least_ = 0.0;    ///< least number of samples after the refinement
  double refined_ = 0.0;  ///< expected number of samples after the refinement
  double done_ = 0.0;
  double frac_ = 0.0;
};

/// Sample to be evaluated: vertex `index` of a patch.
struct Job {
  std::uint32_t patch = 0;
  std::uint32_t index = 0;
};

/// Returns by how much what a sample reflects of hot faces differs from the mean of its parents, as
/// a temperature: a hundredth of the radiance counts as half a kelvin, as between 250 and 400 K in
/// 3 to 12 um.
float reflected_surplus_k(const SurfaceInputs& inputs, const SurfacePatch& patch,
                          std::uint32_t index, const std::array<std::uint32_t, 2>& parent) {
  constexpr float kKelvinPerShare = 50.0F;
  const HeldView& held = patch.held[index];
  const HeldView& low = patch.held[parent[0]];
  const HeldView& high = patch.held[parent[1]];
  if (inputs.lights == nullptr || std::max({held.frac, low.frac, high.frac}) == 0.0F) return 0.0F;
  const float kelvin = static_cast<float>(physics::kReferenceK) + patch.outputs[index].offset_k;
  const std::uint32_t material = patch.samples[index].material;
  float greatest_frac = 0.0F;
  for (std::size_t b = 0; b < inputs.lights->bands(); ++b) {
    const float emissivity_frac = inputs.lights->emissivity_frac(material, b);
    const float mean = 0.5F * (low.sent_w_m2_sr[b] + high.sent_w_m2_sr[b]);
    const float off = (1.0F - emissivity_frac) * std::abs(held.sent_w_m2_sr[b] - mean);
    const float all = emissivity_frac * inputs.lights->black_w_m2_sr(b, kelvin) +
                      (1.0F - emissivity_frac) * held.sent_w_m2_sr[b];
    if (off > 0.0F) greatest_frac = std::max(greatest_frac, all > off ? off / all : 1.0F);
  }
  return kKelvinPerShare * greatest_frac;
}

/// Does the work of build_surface_model().
class Builder {
 public:
  Builder(const SurfaceInputs& inputs, const RefineView& view, const SurfaceModelOptions& options,
          const SurfaceProgress& progress)
      : in_(inputs),
        options_(options),
        progress_(progress),
        sensitivity_(inputs),
        sampler_(inputs, sensitivity_, options),
        refinement_(inputs, sensitivity_, view, options) {}

  physics::Result<SurfaceModel> run();

 private:
  /// Makes a patch for each instance, still without samples.
  void make_patches();
  /// Halves the leaves of a mesh whose need is greater than `above`. If samples run short, it
  /// begins with the neediest leaves.
  void split(std::uint32_t mesh, float above);
  /// Need above which lie about as many leaves as a round takes at least; 0 if there are fewer.
  [[nodiscard]] float need_of_neediest();
  /// Evaluates a sample for every vertex that has none yet. Returns false when stopped.
  bool sample_new_vertices();
  /// Gives the vertices from `first` on the normals of the surface as loaded, and moves their
  /// samples onto it.
  void adopt_detail(std::uint32_t mesh, std::uint32_t first);
  /// Replaces covered samples next to open ones by copies of these. Nobody sees covered samples,
  /// but triangles that the foot of a body cuts would show a mixture of both.
  void replace_covered();
  /// Number of samples of each instance of a mesh, backs of sheets included.
  [[nodiscard]] std::size_t samples_of(std::uint32_t mesh) const {
    const RefinedMesh& refined = model_.meshes[mesh];
    return refined.vertices().size() + back_vertices(refined, in_.materials).size();
  }
  bool report(double frac) const { return !progress_ || progress_(frac); }
  /// Reports that `samples` more were evaluated. Returns false when stopped.
  bool report_evaluated(std::size_t samples) {
    return report(kEvaluatedFrac * evaluation_.advance(samples));
  }

  const SurfaceInputs& in_;
  SurfaceModelOptions options_;
  const SurfaceProgress& progress_;
  EvaluationProgress evaluation_;
  DriveSensitivity sensitivity_;
  PatchSampler sampler_;
  SurfaceRefinement refinement_;
  SurfaceModel model_;
  std::vector<SurfacePatch> patches_;
  std::vector<std::vector<std::uint32_t>> patches_of_mesh_;
  std::size_t sample_count_ = 0;    ///< samples of all patches
  bool short_of_samples_ = false;   ///< leaves stayed whole in this round, because samples ran out
  std::vector<FacetEdges> facets_;  ///< by mesh
  // Arrays by vertex of the mesh at hand, filled for the vertices that have no sample yet.
  std::vector<glm::vec3> inward_;
  std::vector<glm::vec3> place_m_;  ///< place of the samples of the vertex, axes of the mesh
  std::vector<Job> jobs_;
  std::vector<SurfaceRefinement::Need> needs_;
  std::vector<float> ranked_;
  std::vector<std::uint32_t> slots_;
  std::vector<SampleStand> job_stand_;
};

void Builder::make_patches() {
  patches_of_mesh_.resize(model_.meshes.size());
  facets_.resize(model_.meshes.size());
  for (const scene::Instance& instance : in_.geometry.instances) {
    SurfacePatch patch;
    patch.mesh = instance.mesh;
    patch.object = instance.object;
    patch.entity = in_.entity_of_object[instance.object];
    // Static patches lie in rel axes, and those of entities lie in the axes of their body.
    glm::dmat4 rel_from_mesh = instance.body_from_mesh;
    if (patch.entity < 0) {
      rel_from_mesh = instance.world_from_mesh;
      rel_from_mesh[3] -= glm::dvec4(in_.rays.origin_world_m(), 0.0);
    }
    patch.rel_from_mesh = glm::mat4(rel_from_mesh);
    patch.normal_from_mesh = glm::mat3(glm::transpose(glm::inverse(glm::dmat3(rel_from_mesh))));
    // Give meshes with sheets a second patch for the other faces.
    if (!back_vertices(model_.meshes[patch.mesh], in_.materials).empty()) {
      patch.back = std::make_unique<SurfacePatch>();
      patch.back->mesh = patch.mesh;
      patch.back->object = patch.object;
      patch.back->entity = patch.entity;
    }
    patch.begin(in_.record.size(), !in_.entities_now.empty(),
                std::ranges::any_of(in_.record.rays, &IntervalRays::clouds_pass),
                sampler_.keeps_sent());
    patches_of_mesh_[patch.mesh].push_back(static_cast<std::uint32_t>(patches_.size()));
    sample_count_ += samples_of(patch.mesh);
    patches_.push_back(std::move(patch));
  }
}

void Builder::adopt_detail(std::uint32_t mesh, std::uint32_t first) {
  RefinedMesh& refined = model_.meshes[mesh];
  const auto vertices = refined.vertices();
  place_m_.resize(vertices.size());
  for (std::size_t v = first; v < vertices.size(); ++v) place_m_[v] = vertices[v].position_m;
  // Move vertices that halve an edge. Those of the simplified mesh lie on the surface already.
  if (in_.detail == nullptr || !in_.detail->has(mesh)) return;
  threads::parallel_parts(vertices.size() - first, kGrain, [&](std::size_t from, std::size_t to) {
    for (std::size_t i = first + from; i < first + to; ++i) {
      const RefinedMesh::Vertex& vertex = vertices[i];
      if (vertex.parent[0] == i) continue;
      const float edge_m = glm::distance(vertices[vertex.parent[0]].position_m,
                                         vertices[vertex.parent[1]].position_m);
      // Step aside from a crease, onto the face that the vertex belongs to.
      const glm::vec3 place_m = vertex.position_m + kOffCreaseFrac * edge_m * inward_[i];
      const auto full = in_.detail->place(mesh, place_m, vertex.normal, kDetailReachFrac * edge_m);
      if (!full) continue;
      refined.set_normal(static_cast<std::uint32_t>(i), full->normal);
      place_m_[i] = full->position_m;
    }
  });
}

bool Builder::sample_new_vertices() {
  // Place a sample at each new vertex of each instance.
  jobs_.clear();
  job_stand_.clear();
  for (std::uint32_t mesh = 0; mesh < model_.meshes.size(); ++mesh) {
    const auto vertices = model_.meshes[mesh].vertices();
    bool looked = false;
    for (const std::uint32_t p : patches_of_mesh_[mesh]) {
      SurfacePatch& patch = patches_[p];
      if (patch.samples.size() == vertices.size()) continue;
      const auto first = static_cast<std::uint32_t>(patch.samples.size());
      if (!looked) {
        find_inward(model_.meshes[mesh], first, inward_);
        adopt_detail(mesh, first);
        facets_[mesh].grow(model_.meshes[mesh]);
      }
      looked = true;
      patch.grow(vertices.size());
      for (std::uint32_t v = first; v < vertices.size(); ++v) {
        SurfaceSample& sample = patch.samples[v];
        // Move the sample off the edge on which the vertex lies, by the distance at which rays
        // start.
        const glm::vec3 inward = patch.normal_from_mesh * inward_[v];
        const float length = glm::length(inward);
        const glm::vec3 unit_inward = length > 0.0F ? inward / length : glm::vec3(0.0F);
        const glm::vec3 drawn_m(patch.rel_from_mesh * glm::vec4(vertices[v].position_m, 1.0F));
        sample.facet_m = patch.greatest_scale() * facets_[mesh].longest_m(v);
        const glm::vec3 off_edge_m = ray_offsets(drawn_m, sample.facet_m).around_m * unit_inward;
        const auto to_rel = [&](const glm::vec3& at_m) {
          return glm::vec3(patch.rel_from_mesh * glm::vec4(at_m, 1.0F)) + off_edge_m;
        };
        sample.position_m = to_rel(place_m_[v]);
        sample.normal = glm::normalize(patch.normal_from_mesh * vertices[v].normal);
        sample.entity = patch.entity;
        sample.material = vertices[v].material;
        // Let the sample of a sheet's other face stand at the same place.
        if (in_.materials[sample.material].sheet) {
          SurfaceSample& back = patch.back->samples[v];
          back = sample;
          back.normal = -sample.normal;
        }
        jobs_.push_back({p, v});
        const std::array<std::uint32_t, 2>& parent = vertices[v].parent;
        job_stand_.push_back({to_rel(vertices[v].position_m), unit_inward, std::nullopt});
        if (parent[0] < first && parent[1] < first) job_stand_.back().parents = parent;
      }
    }
  }
  // Evaluate the samples in slices, so that the progress moves and a stop is noticed soon.
  constexpr std::size_t kSlice = 16384;
  for (std::size_t begin = 0; begin < jobs_.size(); begin += kSlice) {
    const std::size_t end = std::min(jobs_.size(), begin + kSlice);
    threads::parallel_parts(end - begin, kGrain, [&](std::size_t from, std::size_t to) {
      PatchSampler::StartMemo memo;
      std::array<NewSample, kAdvanceTogether> group;
      for (std::size_t j = begin + from; j < begin + to; j += kAdvanceTogether) {
        const std::size_t count = std::min(begin + to - j, kAdvanceTogether);
        for (std::size_t k = 0; k < count; ++k) {
          const Job& job = jobs_[j + k];
          group[k] = {&patches_[job.patch], job.index, job_stand_[j + k]};
        }
        sampler_.evaluate(std::span(group).first(count), memo);
      }
    });
    if (!report_evaluated(end - begin)) return false;
  }
  // Compare each sample with the mean of its parents.
  for (const Job& job : jobs_) {
    SurfacePatch& patch = patches_[job.patch];
    const RefinedMesh::Vertex& vertex = model_.meshes[patch.mesh].vertices()[job.index];
    if (vertex.parent[0] == job.index) continue;
    const float mean_k = 0.5F * (patch.outputs[vertex.parent[0]].offset_k +
                                 patch.outputs[vertex.parent[1]].offset_k);
    patch.surplus_k[job.index] =
        std::max(std::abs(patch.outputs[job.index].offset_k - mean_k),
                 reflected_surplus_k(in_, patch, job.index, vertex.parent));
    for (SurfacePatch* side = &patch; side != nullptr; side = side->back.get()) {
      if (!std::isinf(side->sky_surplus_frac[job.index])) continue;  // the parents' view was taken
      const auto off_mean = [&](float SurfaceSample::*share) {
        const float mean = 0.5F * (side->samples[vertex.parent[0]].*share +
                                   side->samples[vertex.parent[1]].*share);
        return std::abs(side->samples[job.index].*share - mean);
      };
      side->sky_surplus_frac[job.index] =
          std::max({off_mean(&SurfaceSample::sky_frac), off_mean(&SurfaceSample::far_frac),
                    off_mean(&SurfaceSample::sphere_sky_frac)});
    }
  }
  return true;
}

void Builder::replace_covered() {
  SurfaceSamples& all = model_.samples;
  for (std::size_t p = 0; p < in_.geometry.instances.size(); ++p) {
    const RefinedMesh& mesh = model_.meshes[in_.geometry.instances[p].mesh];
    const std::uint32_t first = model_.first_sample[p];
    const auto vertices = mesh.vertices();
    // Find for each covered vertex the nearest open vertex of its triangles.
    std::vector<std::uint32_t> open(vertices.size(), kNoSample);
    const auto apart_m = [&](std::uint32_t a, std::uint32_t b) {
      return glm::distance(vertices[a].position_m, vertices[b].position_m);
    };
    for (std::uint32_t slot = 0; slot < mesh.leaf_count(); ++slot) {
      for (const std::uint32_t covered : mesh.leaf(slot)) {
        const SurfaceSample& under = all.samples[first + covered];
        if (!under.covered || under.other_side != kNoSample) continue;
        for (const std::uint32_t other : mesh.leaf(slot)) {
          if (all.samples[first + other].covered) continue;
          std::uint32_t& nearest = open[covered];
          if (nearest == kNoSample || apart_m(covered, other) < apart_m(covered, nearest)) {
            nearest = other;
          }
        }
      }
    }
    // Copy the open ones, and their twins, to the places of the covered ones. Those with a column
    // keep their heat, which is that of ground under a solid, and take the view alone.
    const auto copy = [&](std::uint32_t to, std::uint32_t from) {
      const SurfaceSample own = all.samples[to];
      SurfaceSample& sample = all.samples[to];
      sample = all.samples[from];
      sample.vertex = own.vertex;
      sample.twin_of = own.twin_of;
      sample.column = own.column;
      const bool keeps_heat = own.twin_of == kNoSample
                                  ? own.column != kNoSample
                                  : all.samples[own.twin_of].column != kNoSample;
      sample.covered = keeps_heat;
      if (keeps_heat) {
        sample.exposed_frac = own.exposed_frac;
        sample.excess_frac = own.excess_frac;
        return;
      }
      model_.states[to] = model_.states[from];
      model_.outputs[to] = model_.outputs[from];
    };
    for (std::uint32_t v = 0; v < open.size(); ++v) {
      if (open[v] == kNoSample) continue;
      copy(first + v, first + open[v]);
      const SampleTwins to = twins_of(all, first + v);
      const SampleTwins from = twins_of(all, first + open[v]);
      if (to.low == kNoSample || from.low == kNoSample) continue;
      copy(to.low, from.low);
      copy(to.high, from.high);
    }
  }
}

void Builder::split(std::uint32_t mesh, float above) {
  refinement_.list(mesh, above, needs_);
  if (needs_.empty()) return;
  RefinedMesh& refined = model_.meshes[mesh];
  const std::size_t uses = patches_of_mesh_[mesh].size();
  const std::size_t left =
      options_.max_samples > sample_count_ ? options_.max_samples - sample_count_ : 0;
  const std::size_t vertices = refined.vertices().size();
  const std::size_t samples = samples_of(mesh);
  // A vertex of a sheet has two samples.
  const std::size_t most = left / std::max<std::size_t>(samples > vertices ? 2 * uses : uses, 1);
  // Take the neediest first if there are more leaves than new vertices.
  refined.limit(vertices + most);
  if (needs_.size() > most) {
    std::ranges::sort(needs_, [](const auto& a, const auto& b) {
      return a.need != b.need ? a.need > b.need : a.slot < b.slot;
    });
  }
  // Halve them. Leaves that stayed whole for another reason than want of samples need no more.
  slots_.clear();
  for (const SurfaceRefinement::Need& need : needs_) slots_.push_back(need.slot);
  const bool complete = refined.split(slots_);
  sample_count_ += (samples_of(mesh) - samples) * uses;
  if (complete) {
    refinement_.leave(mesh, refined, slots_);
  } else {
    short_of_samples_ = true;
  }
}

float Builder::need_of_neediest() {
  ranked_.clear();
  for (std::uint32_t mesh = 0; mesh < model_.meshes.size(); ++mesh) {
    refinement_.list(mesh, 0.0F, needs_);
    for (const SurfaceRefinement::Need& need : needs_) ranked_.push_back(need.need);
  }
  const std::size_t taken = std::max(kMinPerRound, ranked_.size() / kRoundShare);
  if (ranked_.size() <= taken) return 0.0F;
  const auto last = ranked_.begin() + static_cast<std::ptrdiff_t>(taken);
  std::ranges::nth_element(ranked_, last, std::greater{});
  return *last;
}

physics::Result<SurfaceModel> Builder::run() {
  const auto stopped = [] {
    return physics::make_error(physics::ErrorCode::internal, "stopped while sampling the surface");
  };
  // Begin with the meshes as they are, one patch per instance.
  for (const scene::Mesh& mesh : in_.geometry.meshes) {
    model_.meshes.emplace_back(mesh, options_.max_samples);
  }
  make_patches();
  evaluation_.begin(sample_count_, options_.max_samples);
  std::size_t count_before = 0;  // samples before the latest round
  if (!sample_new_vertices()) return stopped();
  // Refine in rounds, the greatest need first: if samples run out, what is left matters least.
  for (std::uint32_t round = 0;; ++round) {
    SurfaceRefinement::Most most;
    for (std::uint32_t mesh = 0; mesh < model_.meshes.size(); ++mesh) {
      const auto here =
          refinement_.judge(mesh, model_.meshes[mesh], patches_, patches_of_mesh_[mesh]);
      most.need = std::max(most.need, here.need);
      most.in_view = std::max(most.in_view, here.in_view);
      most.coarse_leaves += here.coarse_leaves;
    }
    evaluation_.expect(most.coarse_leaves);
    // Stop when samples have run out. The next round takes the room that this one leaves, until a
    // round adds next to nothing.
    const bool none_left =
        short_of_samples_ && sample_count_ - count_before <= options_.max_samples / kLastFraction;
    if (none_left || round == kMaxRounds) {
      model_.full = true;
      model_.full_in_view = most.in_view > 0.0F;
      break;
    }
    if (most.need == 0.0F) break;
    short_of_samples_ = false;
    count_before = sample_count_;
    // Halve the neediest leaves of all meshes, and evaluate the new samples.
    const float above = std::min(most.need / kNeedStep, need_of_neediest());
    for (std::uint32_t mesh = 0; mesh < model_.meshes.size(); ++mesh) split(mesh, above);
    if (!sample_new_vertices()) return stopped();
  }
  // Lay all samples out in one array, and integrate their history again with exchange.
  number_samples(in_, options_, patches_, model_);
  name_bodies(in_.geometry, in_.heat, model_);
  if (options_.lateral) link_columns(in_, model_);
  const auto exchanged = [this](double frac) {
    return report(kEvaluatedFrac + (1.0 - kEvaluatedFrac) * frac);
  };
  SampleHistories histories = take_histories(in_, std::move(patches_), model_);
  add_twins(in_, histories, model_);
  if (sampler_.keeps_sent()) {
    const ExchangeOptions exchange_options{.exitance = options_.exchange};
    if (!exchange(in_, exchange_options, std::move(histories), model_, exchanged)) return stopped();
  } else if (!report(1.0)) {
    return stopped();
  }
  replace_covered();
  return std::move(model_);
}

}  // namespace

double diffusivity_m2_s(const scene::Material& material) noexcept {
  if (material.layers.empty() || material.prescribed_k || material.sheet) return 0.0;
  const scene::Layer& layer = material.layers.front();
  return layer.conductivity_w_m_k / (layer.density_kg_m3 * layer.specific_heat_j_kg_k);
}

physics::Result<SurfaceModel> build_surface_model(const SurfaceInputs& inputs,
                                                  const RefineView& view,
                                                  const SurfaceModelOptions& options,
                                                  const SurfaceProgress& progress) {
  return Builder(inputs, view, options, progress).run();
}

}  // namespace emit::renderer
