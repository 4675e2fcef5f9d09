// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/sample_numbers.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>

#include "emit/physics/check.hpp"
#include "emit/threads/parallel.hpp"
#include "surface/mesh/sheet_sides.hpp"
#include "surface/rays/held_faces.hpp"

namespace emit::renderer {
namespace {

/// Views in one part of the lists.
constexpr std::size_t kPartViews = 256;

/// Largest number of samples in the list of a view: three corners for each seen face, and for each
/// face of a prescribed temperature.
constexpr std::size_t kMaxListed = 3 * (SurfaceView::kMaxSeen + HeldFaces::kMost);

/// List of the samples that one view shows, each of them once, in the order in which they were met.
/// It finds entries by a hash table with open addressing.
class SeenList {
 public:
  void clear() noexcept {
    count_ = 0;
    slots_.fill(kFree);
  }
  void add(std::uint32_t sample, float weight_frac) noexcept {
    // Walk from the number's own slot to its entry or to a free one: at most half of them are used.
    std::size_t slot = (sample * 2654435761U) >> (32U - kBits);
    while (slots_[slot] != kFree && list_[slots_[slot]].sample != sample) {
      slot = (slot + 1) % slots_.size();
    }
    if (slots_[slot] != kFree) {
      list_[slots_[slot]].weight_frac += weight_frac;
      return;
    }
    EMIT_CHECK_OP(count_, <, kMaxListed);
    slots_[slot] = static_cast<std::uint16_t>(count_);
    list_[count_++] = {sample, weight_frac};
  }
  [[nodiscard]] std::span<const SeenSample> list() const noexcept { return {list_.data(), count_}; }

 private:
  static constexpr unsigned kBits = 11;
  static constexpr std::uint16_t kFree = 0xffff;
  static_assert(2 * kMaxListed < (std::size_t{1} << kBits));
  std::array<std::uint16_t, std::size_t{1} << kBits> slots_{};
  std::array<SeenSample, kMaxListed> list_;
  std::size_t count_ = 0;
};

/// Does the work of number_samples().
class Numbers {
 public:
  Numbers(const SurfaceInputs& inputs, const SurfaceModelOptions& options,
          std::vector<SurfacePatch>& patches, SurfaceModel& model)
      : in_(inputs), options_(options), patches_(patches), model_(model) {}

  void run();

 private:
  /// Index of the sample of a vertex of an instance, on the side that is seen.
  [[nodiscard]] std::uint32_t sample_of(std::uint32_t instance, std::uint32_t vertex,
                                        bool behind) const;
  /// Fills `list` with the samples around the places of one view. Returns the sum of the weights.
  float spread(std::span<const SeenPlace> places, SeenList& list) const;
  /// Turns the views of one side of a patch into lists of samples, and frees them.
  void list_views(SurfacePatch& side);
  /// Appends the sample of a vertex on one side of a patch.
  void append(const SurfacePatch& side, std::size_t vertex, SurfaceSample sample);

  const SurfaceInputs& in_;
  const SurfaceModelOptions& options_;
  std::vector<SurfacePatch>& patches_;
  SurfaceModel& model_;
  std::vector<std::vector<std::uint32_t>> backs_;  ///< by mesh: vertices of sheets, ascending
  std::vector<std::uint32_t> first_;               ///< by patch: its first sample
  /// Place of the list of a view in SurfaceSamples::seen, and the sum of its weights.
  struct Listed {
    std::uint32_t first = 0;
    std::uint32_t count = 0;
    float weight_frac = 0.0F;
  };
  std::vector<Listed> listed_;  ///< by vertex of the side at hand
};

std::uint32_t Numbers::sample_of(std::uint32_t instance, std::uint32_t vertex, bool behind) const {
  // Samples of an instance are those of its vertices, then the backs of the vertices on sheets.
  const std::uint32_t mesh = in_.geometry.instances[instance].mesh;
  const auto back = std::ranges::lower_bound(backs_[mesh], vertex);
  if (!behind || back == backs_[mesh].end() || *back != vertex) return first_[instance] + vertex;
  return first_[instance] + static_cast<std::uint32_t>(model_.meshes[mesh].vertices().size()) +
         static_cast<std::uint32_t>(back - backs_[mesh].begin());
}

float Numbers::spread(std::span<const SeenPlace> places, SeenList& list) const {
  list.clear();
  float sum_frac = 0.0F;
  for (const SeenPlace& place : places) {
    sum_frac += place.weight_frac;
    const RefinedMesh& mesh = model_.meshes[in_.geometry.instances[place.instance].mesh];
    const RefinedMesh::Place at = mesh.locate(place.triangle, place.barycentric);
    for (glm::length_t k = 0; k < 3; ++k) {
      const float weight_frac = place.weight_frac * at.weight[k];
      if (!(weight_frac > 0.0F)) continue;
      const std::uint32_t corner = at.vertex[static_cast<std::size_t>(k)];
      list.add(sample_of(place.instance, corner, place.behind), weight_frac);
    }
  }
  return sum_frac;
}

void Numbers::list_views(SurfacePatch& side) {
  listed_.assign(side.samples.size(), {});
  if (options_.exchange) {
    std::vector<std::uint32_t> views;
    for (std::uint32_t v = 0; v < side.seen.size(); ++v) {
      if (!side.seen[v].empty()) views.push_back(v);
    }
    // Spread the weight of every seen place over the corners of the triangle there. Parts of the
    // views make their lists on all cores, and free the views.
    std::vector<std::vector<SeenSample>> parts((views.size() + kPartViews - 1) / kPartViews);
    threads::parallel_parts(parts.size(), 1, [&](std::size_t from, std::size_t to) {
      SeenList list;
      for (std::size_t part = from; part < to; ++part) {
        const std::size_t end = std::min(views.size(), (part + 1) * kPartViews);
        for (std::size_t i = part * kPartViews; i < end; ++i) {
          const float sum_frac = spread(side.seen[views[i]], list);
          listed_[views[i]] = {static_cast<std::uint32_t>(parts[part].size()),
                               static_cast<std::uint32_t>(list.list().size()), sum_frac};
          parts[part].insert(parts[part].end(), list.list().begin(), list.list().end());
          side.seen[views[i]] = {};
        }
      }
    });
    // Append the parts one after the other, so that their order does not depend on the threads.
    std::vector<SeenSample>& seen = model_.samples.seen;
    std::vector<std::size_t> first(parts.size());
    std::size_t total = seen.size();
    for (std::size_t part = 0; part < parts.size(); ++part) {
      first[part] = total;
      total += parts[part].size();
    }
    EMIT_CHECK_OP(total, <=, std::numeric_limits<std::uint32_t>::max());
    seen.resize(total);
    threads::parallel_parts(parts.size(), 1, [&](std::size_t from, std::size_t to) {
      for (std::size_t part = from; part < to; ++part) {
        std::ranges::copy(parts[part], seen.begin() + static_cast<std::ptrdiff_t>(first[part]));
        const std::size_t end = std::min(views.size(), (part + 1) * kPartViews);
        for (std::size_t i = part * kPartViews; i < end; ++i) {
          listed_[views[i]].first += static_cast<std::uint32_t>(first[part]);
        }
      }
    });
  }
  side.seen = {};
}

void Numbers::append(const SurfacePatch& side, std::size_t vertex, SurfaceSample sample) {
  if (!options_.exchange) sample.far_frac = 1.0F - sample.sky_frac;
  const Listed& view = listed_[side.view_of[vertex]];
  sample.first_seen = view.first;
  sample.seen_count = view.count;
  // Scale the weights so that the faces fill the part of the hemisphere that is not open.
  const float left_frac = 1.0F - sample.sky_frac - sample.far_frac;
  sample.seen_scale = view.count != 0 ? left_frac / view.weight_frac : 0.0F;
  sample.vertex = static_cast<std::uint32_t>(model_.samples.samples.size());
  model_.samples.samples.push_back(sample);
}

void Numbers::run() {
  // Give each patch its range of samples.
  for (const RefinedMesh& mesh : model_.meshes) {
    backs_.push_back(back_vertices(mesh, in_.materials));
  }
  std::uint32_t next = 0;
  for (const SurfacePatch& patch : patches_) {
    first_.push_back(next);
    next += static_cast<std::uint32_t>(patch.samples.size());
    if (patch.back) next += static_cast<std::uint32_t>(backs_[patch.mesh].size());
  }
  model_.first_sample = first_;
  model_.drawn_samples = next;
  model_.samples.samples.reserve(next);
  // Append the samples patch by patch.
  for (std::size_t p = 0; p < patches_.size(); ++p) {
    SurfacePatch& patch = patches_[p];
    list_views(patch);
    for (std::size_t i = 0; i < patch.samples.size(); ++i) {
      append(patch, i, patch.samples[i]);
    }
    // Append the backs of sheets, and link both sides.
    if (!patch.back) continue;
    list_views(*patch.back);
    for (const std::uint32_t v : backs_[patch.mesh]) {
      SurfaceSample sample = patch.back->samples[v];
      sample.other_side = first_[p] + v;
      model_.samples.samples[sample.other_side].other_side =
          static_cast<std::uint32_t>(model_.samples.samples.size());
      append(*patch.back, v, sample);
    }
  }
}

}  // namespace

void number_samples(const SurfaceInputs& inputs, const SurfaceModelOptions& options,
                    std::vector<SurfacePatch>& patches, SurfaceModel& model) {
  EMIT_CHECK_OP(patches.size(), ==, inputs.geometry.instances.size());
  Numbers(inputs, options, patches, model).run();
}

}  // namespace emit::renderer
