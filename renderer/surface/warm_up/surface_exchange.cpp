// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/surface_exchange.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/check.hpp"
#include "emit/threads/parallel.hpp"
#include "surface/mesh/sheet_sides.hpp"
#include "surface/model/mover_glow.hpp"

namespace emit::renderer {
namespace {

constexpr std::size_t kGrain = 64;
/// Sweeps after the one that takes the surroundings for whatever is seen: each passes heat on by
/// one more bounce, of which a third at most is reflected or re-emitted within minutes.
constexpr std::uint32_t kSweeps = 3;
constexpr std::uint32_t kNoList = 0xffffffffU;

/// What the seen samples of every list send together, over the whole history: their weights are
/// those of SurfaceSamples::seen.
class SeenRadiation {
 public:
  SeenRadiation(const SurfaceSamples& all, std::size_t row_size)
      : all_(all), row_size_(row_size), list_of_entry_(all.seen.size(), kNoList) {
    for (const SurfaceSample& sample : all.samples) {
      if (sample.seen_count == 0 || list_of_entry_[sample.first_seen] != kNoList) continue;
      list_of_entry_[sample.first_seen] = static_cast<std::uint32_t>(lists_.size());
      lists_.push_back({sample.first_seen, sample.seen_count});
    }
    sums_w_m2_.resize(lists_.size() * row_size_);
  }

  /// Adds up what `sent` holds, list by list. Uses all cores.
  void gather(const SentHistory& sent) {
    constexpr std::size_t kListGrain = 16;
    threads::parallel_parts(lists_.size(), kListGrain, [&](std::size_t from, std::size_t to) {
      for (std::size_t i = from; i < to; ++i) {
        const std::span<double> sum_w_m2 = std::span(sums_w_m2_).subspan(i * row_size_, row_size_);
        std::ranges::fill(sum_w_m2, 0.0);
        for (std::uint32_t k = 0; k < lists_[i].count; ++k) {
          const SeenSample& seen = all_.seen[lists_[i].first + k];
          const double weight = seen.weight_frac;
          const std::span<const float> row_w_m2 = sent.radiation_w_m2(seen.sample);
          for (std::size_t j = 0; j < row_size_; ++j) sum_w_m2[j] += weight * row_w_m2[j];
        }
      }
    });
  }

  /// Row of the list that the sample sees; empty where it sees nothing.
  [[nodiscard]] std::span<const double> of(const SurfaceSample& sample) const noexcept {
    if (sample.seen_count == 0) return {};
    return std::span(sums_w_m2_).subspan(list_of_entry_[sample.first_seen] * row_size_, row_size_);
  }

 private:
  struct List {
    std::uint32_t first = 0;
    std::uint32_t count = 0;
  };
  const SurfaceSamples& all_;
  std::size_t row_size_;
  std::vector<std::uint32_t> list_of_entry_;  ///< by entry of `seen` that begins a list
  std::vector<List> lists_;
  std::vector<double> sums_w_m2_;  ///< by list: rows like SentHistory::radiation_w_m2()
};

/// Carries samples over the whole history, from what the others sent in the sweep before.
class Sweeper {
 public:
  /// Takes over what the patches' own evaluation gave: that is the first sweep.
  Sweeper(const SurfaceInputs& inputs, const SurfaceModelOptions& options,
          std::vector<SurfacePatch>& patches, SurfaceModel& model);

  void sweep();

 private:
  void adopt(SurfacePatch& patch, std::size_t first);
  /// Measures what the faces of entities send at every node, as `before_` has it.
  void measure_faces();
  /// True where no sweep changes anything: the sample sees no other one, has no partner, and no
  /// entity that sends anything hides its sky.
  [[nodiscard]] bool alone(const SurfacePatch& patch, std::size_t vertex,
                           const SurfaceSample& sample) const noexcept;
  /// What the sample on that side of a patch receives in interval j.
  [[nodiscard]] SampleDrive drive(const SurfacePatch& side, std::size_t vertex,
                                  const SurfaceSample& sample, std::size_t j) const noexcept;
  /// Adds what the entities send that hide the sample's sky in interval j.
  void add_glow(const SurfaceSample& sample, const glm::vec3& normal, const SurfacePatch& side,
                std::size_t vertex, std::size_t j, SampleDrive& drive) const noexcept;
  void carry(const SurfacePatch& patch, std::size_t vertex, std::size_t s);

  const SurfaceInputs& in_;
  const std::vector<SurfacePatch>& patches_;
  SurfaceModel& model_;
  std::size_t intervals_;
  std::size_t nodes_;
  std::vector<physics::FosterState<double>> start_k_;  ///< by sample
  SentHistory before_;
  SentHistory after_;
  SeenRadiation seen_;
  MoverGlow glow_;
  std::vector<MoverFaces> faces_;  ///< by node, then entity; empty without exchange or entities
};

Sweeper::Sweeper(const SurfaceInputs& inputs, const SurfaceModelOptions& options,
                 std::vector<SurfacePatch>& patches, SurfaceModel& model)
    : in_(inputs),
      patches_(patches),
      model_(model),
      intervals_(inputs.record.size()),
      nodes_(intervals_ + 1),
      start_k_(model.samples.samples.size()),
      before_(intervals_),
      seen_(model.samples, before_.radiation_size()) {
  before_.resize(start_k_.size());
  for (std::size_t p = 0; p < patches.size(); ++p) {
    adopt(patches[p], p < model_.first_sample.size() ? model_.first_sample[p] : model_.drawn_samples);
  }
  after_ = before_;
  if (options.exchange && !inputs.movers_now.empty()) {
    glow_ = MoverGlow(model, inputs.geometry, inputs.mover_of_object);
    faces_.resize(inputs.movers_now.size() * nodes_);
    measure_faces();
  }
}

void Sweeper::adopt(SurfacePatch& patch, std::size_t first) {
  for (std::size_t i = 0; i < patch.samples.size(); ++i) {
    start_k_[first + i] = patch.start_k[i];
    std::ranges::copy(patch.sent.row(i), before_.row(first + i).begin());
    const std::uint32_t other = model_.samples.samples[first + i].other_side;
    if (other != kNoSample) {
      std::ranges::copy(patch.back->sent.row(i), before_.row(other).begin());
    }
  }
  patch.sent.clear();
  patch.start_k = {};
  if (patch.back) patch.back->sent.clear();
}

void Sweeper::measure_faces() {
  const std::size_t movers = faces_.size() / nodes_;
  threads::parallel_parts(faces_.empty() ? 0 : nodes_, 1, [&](std::size_t from, std::size_t to) {
    for (std::size_t j = from; j < to; ++j) {
      glow_.measure(
          model_.samples, in_.record.rays[std::min(j, intervals_ - 1)],
          [&](std::size_t s) { return before_.longwave_w_m2(s, j); },
          std::span(faces_).subspan(j * movers, movers));
    }
  });
}

void Sweeper::sweep() {
  seen_.gather(before_);
  for (std::size_t p = 0; p < patches_.size(); ++p) {
    const SurfacePatch& patch = patches_[p];
    const std::size_t first =
        p < model_.first_sample.size() ? model_.first_sample[p] : model_.drawn_samples;
    threads::parallel_parts(patch.samples.size(), kGrain, [&](std::size_t from, std::size_t to) {
      for (std::size_t i = from; i < to; ++i) carry(patch, i, first + i);
    });
  }
  std::swap(before_, after_);
  measure_faces();
}

bool Sweeper::alone(const SurfacePatch& side, std::size_t vertex,
                    const SurfaceSample& sample) const noexcept {
  if (sample.seen_count != 0) return false;
  for (const Partner& partner : sample.partners) {
    if (partner.sample != kNoSample) return false;
  }
  if (faces_.empty()) return true;
  const auto hidden = std::span(side.hidden_sky).subspan(vertex * intervals_, intervals_);
  return std::ranges::all_of(hidden, [](const HiddenSky& sky) { return sky.frac == 0.0F; });
}

SampleDrive Sweeper::drive(const SurfacePatch& side, std::size_t vertex,
                           const SurfaceSample& sample, std::size_t j) const noexcept {
  SampleDrive drive;
  drive.sun_frac = side.sun_frac[vertex * intervals_ + j];
  if (!side.hidden_sky.empty()) {
    drive.hidden_sky_frac = side.hidden_sky[vertex * intervals_ + j].frac;
  }
  if (const std::span<const double> received_w_m2 = seen_.of(sample); !received_w_m2.empty()) {
    const double scale = sample.seen_scale;
    drive.longwave_begin_w_m2 = scale * received_w_m2[j];
    drive.longwave_end_w_m2 = scale * received_w_m2[j + 1];
    drive.shortwave_w_m2 = scale * received_w_m2[nodes_ + j];
  }
  return drive;
}

void Sweeper::add_glow(const SurfaceSample& sample, const glm::vec3& normal,
                       const SurfacePatch& side, std::size_t vertex, std::size_t j,
                       SampleDrive& drive) const noexcept {
  if (faces_.empty() || drive.hidden_sky_frac == 0.0F) return;
  const std::size_t mover = side.hidden_sky[vertex * intervals_ + j].mover;
  const std::size_t movers = faces_.size() / nodes_;
  const float begin_w_m2 = faces_[j * movers + mover].towards_w_m2(normal);
  const float end_w_m2 = faces_[(j + 1) * movers + mover].towards_w_m2(normal);
  if (begin_w_m2 < 0.0F || end_w_m2 < 0.0F) return;
  const double hidden_frac = sample.sky_frac * drive.hidden_sky_frac;
  drive.longwave_begin_w_m2 += hidden_frac * begin_w_m2;
  drive.longwave_end_w_m2 += hidden_frac * end_w_m2;
  drive.hidden_is_seen = true;
}

void Sweeper::carry(const SurfacePatch& patch, std::size_t vertex, std::size_t s) {
  const SurfaceSample& sample = model_.samples.samples[s];
  const std::uint32_t other = sample.other_side;
  const bool sheet = other != kNoSample;
  const SurfaceSample& behind = sheet ? model_.samples.samples[other] : sample;
  if (alone(patch, vertex, sample) && (!sheet || alone(*patch.back, vertex, behind))) return;
  SampleState state;
  state.modes_k = start_k_[s];
  // Start the modes that a partner drives where its own modes start, scaled like its flux.
  for (std::size_t p = 0; p < kMaxPartners; ++p) {
    const Partner& partner = sample.partners[p];
    if (partner.sample == kNoSample) continue;
    for (std::size_t m = 0; m < physics::kMaxFosterModes; ++m) {
      state.partner_k[p][m] = partner.weight_frac[m] * start_k_[partner.sample][m];
    }
  }
  SampleOutput output;
  SampleOutput back_output;
  for (std::size_t j = 0; j < intervals_; ++j) {
    // Collect what the sample receives over the interval.
    const HeatInterval& interval = in_.record.intervals[j];
    SampleDrive drive = this->drive(patch, vertex, sample, j);
    for (std::size_t p = 0; p < kMaxPartners; ++p) {
      const std::uint32_t partner = sample.partners[p].sample;
      if (partner == kNoSample) continue;
      drive.partner_begin_w_m2[p] = before_.flux_w_m2(partner, j);
      drive.partner_end_w_m2[p] = before_.flux_w_m2(partner, j + 1);
    }
    const glm::vec3 normal = in_.record.rays[j].normal(sample);
    add_glow(sample, normal, patch, vertex, j, drive);
    if (j == 0) {
      after_.keep_begin(s, in_.heat.output(sample, normal, interval.forcing.begin, drive, state));
    }
    // Advance it, together with its other face where it is a sheet.
    if (!sheet) {
      output = in_.heat.advance(sample, normal, interval, drive, state);
    } else {
      SampleDrive back_drive = this->drive(*patch.back, vertex, behind, j);
      add_glow(behind, -normal, *patch.back, vertex, j, back_drive);
      const SheetBack face{behind, back_drive};
      if (j == 0) {
        after_.keep_begin(
            other, in_.heat.output(behind, -normal, interval.forcing.begin, back_drive, state));
      }
      output = in_.heat.advance(sample, normal, interval, drive, state, &face);
      back_drive.longwave_begin_w_m2 = back_drive.longwave_end_w_m2;
      back_output = in_.heat.output(behind, -normal, interval.forcing.end, back_drive, state);
      after_.keep_end(other, j, back_output);
    }
    after_.keep_end(s, j, output);
  }
  model_.states[s] = state;
  model_.outputs[s] = output;
  if (sheet) {
    model_.states[other] = state;
    model_.outputs[other] = back_output;
  }
}

/// Copies what the patches' own evaluation gave.
void take_evaluated(const std::vector<SurfacePatch>& patches, SurfaceModel& model) {
  const std::size_t count = model.samples.samples.size();
  model.states.resize(count);
  model.outputs.resize(count);
  for (std::size_t p = 0; p < patches.size(); ++p) {
    const SurfacePatch& patch = patches[p];
    const std::size_t first =
        p < model.first_sample.size() ? model.first_sample[p] : model.drawn_samples;
    for (std::size_t i = 0; i < patch.samples.size(); ++i) {
      model.states[first + i] = patch.states[i];
      model.outputs[first + i] = patch.outputs[i];
      const std::uint32_t other = model.samples.samples[first + i].other_side;
      if (other == kNoSample) continue;
      model.states[other] = patch.states[i];
      model.outputs[other] = patch.back->outputs[i];
    }
  }
}

}  // namespace

bool exchange(const SurfaceInputs& inputs, const SurfaceModelOptions& options,
              std::vector<SurfacePatch>& patches, SurfaceModel& model,
              const SurfaceProgress& report) {
  EMIT_CHECK_OP(model.first_sample.size(), ==, inputs.geometry.instances.size());
  take_evaluated(patches, model);
  if (!options.exchange && !options.lateral) return !report || report(1.0);
  Sweeper sweeper(inputs, options, patches, model);
  for (std::uint32_t i = 0; i < kSweeps; ++i) {
    if (report && !report((i + 1.0) / (kSweeps + 1.0))) return false;
    sweeper.sweep();
  }
  return !report || report(1.0);
}

}  // namespace emit::renderer
