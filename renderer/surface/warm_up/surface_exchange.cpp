// SPDX-License-Identifier: Apache-2.0
#include "surface/warm_up/surface_exchange.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>
#include <span>

#include "emit/physics/check.hpp"
#include "emit/threads/parallel.hpp"
#include "surface/mesh/sheet_sides.hpp"
#include "surface/model/entity_exitance.hpp"
#include "surface/warm_up/body_courses.hpp"

namespace emit::renderer {
namespace {

/// Groups of samples in one task of a parallel loop.
constexpr std::size_t kGrain = 8;
constexpr std::uint32_t kNoList = 0xffffffffU;

/// Sum of the radiation of the seen samples of every list, over the whole history. The weights are
/// those of SurfaceSamples::seen.
class SeenRadiation {
 public:
  SeenRadiation(const SurfaceSamples& all, std::size_t row_size)
      : all_(all), row_size_(row_size), list_of_entry_(all.seen.size(), kNoList) {
    // Find the lists: samples that share a view share its first entry.
    for (const SurfaceSample& sample : all.samples) {
      if (sample.seen_count == 0 || list_of_entry_[sample.first_seen] != kNoList) continue;
      list_of_entry_[sample.first_seen] = static_cast<std::uint32_t>(lists_.size());
      lists_.push_back({sample.first_seen, sample.seen_count});
    }
    sums_w_m2_.resize(lists_.size() * row_size_);
  }

  /// Adds up the radiation in the rows `sent`, by sample, list by list. Uses all cores.
  void gather(std::span<const SentRow> sent) {
    constexpr std::size_t kListGrain = 16;
    threads::parallel_parts(lists_.size(), kListGrain, [&](std::size_t from, std::size_t to) {
      for (std::size_t i = from; i < to; ++i) {
        const std::span<double> sum_w_m2 = std::span(sums_w_m2_).subspan(i * row_size_, row_size_);
        std::ranges::fill(sum_w_m2, 0.0);
        for (std::uint32_t k = 0; k < lists_[i].count; ++k) {
          const SeenSample& seen = all_.seen[lists_[i].first + k];
          const double weight = seen.weight_frac;
          const std::span<const float> row_w_m2 = sent[seen.sample].radiation_w_m2();
          for (std::size_t j = 0; j < row_size_; ++j) sum_w_m2[j] += weight * row_w_m2[j];
        }
      }
    });
  }

  /// Returns the row of the list that a sample sees. It is empty if the sample sees nothing.
  [[nodiscard]] std::span<const double> of(const SurfaceSample& sample) const noexcept {
    if (sample.seen_count == 0) return {};
    return std::span(sums_w_m2_).subspan(list_of_entry_[sample.first_seen] * row_size_, row_size_);
  }

 private:
  /// Range of SurfaceSamples::seen.
  struct List {
    std::uint32_t first = 0;
    std::uint32_t count = 0;
  };
  const SurfaceSamples& all_;
  std::size_t row_size_;
  std::vector<std::uint32_t> list_of_entry_;  ///< list that begins with an entry of `seen`
  std::vector<List> lists_;
  std::vector<double> sums_w_m2_;  ///< by list: rows like SentRow::radiation_w_m2()
};

/// Integrates samples over the whole history, with what the others sent in the sweep before.
class Sweeper {
 public:
  Sweeper(const SurfaceInputs& inputs, const ExchangeOptions& options, SampleHistories histories,
          SurfaceModel& model);

  /// Does one sweep over the samples that sweeps change.
  void sweep();

 private:
  /// Measures the radiation of the faces of entities at every node, from the latest sweep.
  void measure_faces();
  /// Returns true if no sweep changes the sample: it sees no other one, has no partner and no body,
  /// and no entity that sends radiation hides its sky.
  [[nodiscard]] bool alone(std::size_t s) const noexcept;
  /// Input of sample `s` in interval j, without the fluxes of its partners.
  [[nodiscard]] SampleDrive drive(std::size_t s, const glm::vec3& normal,
                                  std::size_t j) const noexcept;
  /// Adds the radiation of the entity that hides most of the sample's sky in interval j.
  void add_exitance(std::size_t s, const glm::vec3& normal, std::size_t j,
                    SampleDrive& drive) const noexcept;
  /// Integrates the samples of a group, and the other faces of sheets with them, over the record.
  void carry(std::size_t group);
  /// Input of sample `s` in interval j, with the fluxes of its partners.
  [[nodiscard]] SampleDrive whole_drive(std::size_t s, const glm::vec3& normal,
                                        std::size_t j) const noexcept;

  const SurfaceInputs& in_;
  SurfaceModel& model_;
  SampleHistories histories_;
  std::size_t intervals_;
  std::size_t nodes_;
  std::vector<std::uint32_t> swept_;  ///< samples that sweeps change; one for both faces of a sheet
  SentHistory second_;                ///< second rows of the samples that sweeps change
  std::vector<SentRow> before_;       ///< by sample: what it sent in the latest sweep
  std::vector<SentRow> after_;        ///< by sample: what it sends in this sweep
  SeenRadiation seen_;
  EntityExitance exitance_;
  std::vector<EntityFaces> faces_;  ///< by node, then entity; empty without exchange or entities
  std::optional<BodyCourses> bodies_;
};

Sweeper::Sweeper(const SurfaceInputs& inputs, const ExchangeOptions& options,
                 SampleHistories histories, SurfaceModel& model)
    : in_(inputs),
      model_(model),
      histories_(std::move(histories)),
      intervals_(inputs.record.size()),
      nodes_(intervals_ + 1),
      second_(SentRow::length(intervals_)),
      seen_(model.samples, 2 * intervals_ + 1) {
  for (const SampleHistories::Rows& rows : histories_.rows) before_.emplace_back(rows.sent_w_m2);
  if (options.exitance && !inputs.entities_now.empty()) {
    exitance_ = EntityExitance(model, inputs.geometry, inputs.entity_of_object);
    faces_.resize(inputs.entities_now.size() * nodes_);
    measure_faces();
  }
  // Find the samples that sweeps change. They need a second row; the others keep theirs.
  after_ = before_;
  const auto give_row = [&](std::uint32_t s) {
    const std::size_t row = second_.rows();
    second_.grow(row + 1);
    after_[s] = SentRow(second_.row(row));
  };
  for (std::uint32_t s = 0; s < before_.size(); ++s) {
    if (!steps_itself(model_.samples, s)) continue;
    const std::uint32_t other = model_.samples.samples[s].other_side;
    if (alone(s) && (other == kNoSample || alone(other))) continue;
    swept_.push_back(s);
    give_row(s);
    if (other != kNoSample) give_row(other);
  }
  bodies_.emplace(model, inputs.geometry, inputs.heat, inputs.record, swept_, kAdvanceTogether);
  model.body_k = bodies_->end_k();
}

void Sweeper::measure_faces() {
  const std::size_t entities = faces_.size() / nodes_;
  threads::parallel_parts(faces_.empty() ? 0 : nodes_, 1, [&](std::size_t from, std::size_t to) {
    for (std::size_t j = from; j < to; ++j) {
      exitance_.measure(
          model_.samples, in_.record.rays[std::min(j, intervals_ - 1)],
          [&](std::size_t s) { return before_[s].longwave_w_m2(j); },
          std::span(faces_).subspan(j * entities, entities));
    }
  });
}

void Sweeper::sweep() {
  // Gather the radiation of the sweep before, then integrate every sample that it can change.
  seen_.gather(before_);
  threads::parallel_parts(bodies_->groups().size(), kGrain, [&](std::size_t from, std::size_t to) {
    for (std::size_t group = from; group < to; ++group) carry(group);
  });
  bodies_->correct();
  model_.body_k = bodies_->end_k();
  // Make the result of this sweep the input of the next one.
  std::swap(before_, after_);
  measure_faces();
}

bool Sweeper::alone(std::size_t s) const noexcept {
  const SurfaceSample& sample = model_.samples.samples[s];
  if (sample.seen_count != 0 || sample.body >= 0) return false;
  for (const Partner& partner : sample.partners) {
    if (partner.sample != kNoSample) return false;
  }
  if (faces_.empty()) return true;
  return std::ranges::all_of(histories_.rows[s].hidden_sky,
                             [](const HiddenSky& sky) { return sky.frac == 0.0F; });
}

SampleDrive Sweeper::drive(std::size_t s, const glm::vec3& normal, std::size_t j) const noexcept {
  const SurfaceSample& sample = model_.samples.samples[s];
  SampleDrive drive;
  const SampleHistories::Rows& rows = histories_.rows[s];
  drive.sun_frac = rows.sun_frac[j];
  drive.take_part(in_.record.intervals[j].parts, sample);
  if (sample.body >= 0) drive.body_k = bodies_->mean_k(sample.body, j);
  if (!rows.hidden_sky.empty()) drive.hidden_sky_frac = rows.hidden_sky[j].frac;
  // Add what the seen samples send, scaled to the share of the hemisphere that they fill.
  if (const std::span<const double> received_w_m2 = seen_.of(sample); !received_w_m2.empty()) {
    const double scale = sample.seen_scale;
    drive.longwave_begin_w_m2 = scale * received_w_m2[j];
    drive.longwave_end_w_m2 = scale * received_w_m2[j + 1];
    drive.shortwave_w_m2 = scale * received_w_m2[nodes_ + j];
  }
  add_exitance(s, normal, j, drive);
  return drive;
}

void Sweeper::add_exitance(std::size_t s, const glm::vec3& normal, std::size_t j,
                           SampleDrive& drive) const noexcept {
  if (faces_.empty() || drive.hidden_sky_frac == 0.0F) return;
  const std::size_t entity = histories_.rows[s].hidden_sky[j].entity;
  const std::size_t entities = faces_.size() / nodes_;
  // Leave the surroundings in place if no face of the entity looks towards the surface.
  const float begin_w_m2 = faces_[j * entities + entity].towards_w_m2(normal);
  const float end_w_m2 = faces_[(j + 1) * entities + entity].towards_w_m2(normal);
  if (begin_w_m2 < 0.0F || end_w_m2 < 0.0F) return;
  const double hidden_frac = model_.samples.samples[s].sky_frac * drive.hidden_sky_frac;
  drive.longwave_begin_w_m2 += hidden_frac * begin_w_m2;
  drive.longwave_end_w_m2 += hidden_frac * end_w_m2;
  drive.hidden_is_seen = true;
}

SampleDrive Sweeper::whole_drive(std::size_t s, const glm::vec3& normal,
                                 std::size_t j) const noexcept {
  SampleDrive drive = this->drive(s, normal, j);
  const SurfaceSample& sample = model_.samples.samples[s];
  for (std::size_t p = 0; p < kMaxPartners; ++p) {
    const std::uint32_t partner = sample.partners[p].sample;
    if (partner == kNoSample) continue;
    drive.partner_begin_w_m2[p] = before_[partner].flux_w_m2(j);
    drive.partner_end_w_m2[p] = before_[partner].flux_w_m2(j + 1);
  }
  return drive;
}

void Sweeper::carry(std::size_t group) {
  const BodyCourses::Group& chosen = bodies_->groups()[group];
  const std::span<const std::uint32_t> samples =
      std::span(swept_).subspan(chosen.first, chosen.count);
  const auto add_to_body = [&](std::size_t i, std::size_t node, const SampleState& state) {
    if (chosen.body >= 0) bodies_->add(group, node, samples[i], state);
  };
  const std::vector<SurfaceSample>& all = model_.samples.samples;
  std::array<SampleAdvance, kAdvanceTogether> fronts;
  std::array<SampleState, kAdvanceTogether> states;
  // Inputs and outputs of the other faces of sheets.
  std::array<SampleDrive, kAdvanceTogether> back_drives;
  std::array<std::optional<SheetBack>, kAdvanceTogether> backs;
  std::array<SampleOutput, kAdvanceTogether> back_outputs;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const SurfaceSample& sample = all[samples[i]];
    states[i] = histories_.start[samples[i]];
    fronts[i].sample = &sample;
    fronts[i].state = &states[i];
    if (sample.other_side == kNoSample) continue;
    backs[i].emplace(SheetBack{all[sample.other_side], back_drives[i]});
    fronts[i].back = &*backs[i];
  }
  for (std::size_t j = 0; j < intervals_; ++j) {
    const HeatInterval& interval = in_.record.intervals[j];
    const SurfaceForcing& begin = interval.forcing.begin;
    // Collect the input of the samples over the interval.
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const std::uint32_t s = samples[i];
      SampleAdvance& front = fronts[i];
      front.normal = in_.record.rays[j].normal(*front.sample);
      front.drive = whole_drive(s, front.normal, j);
      const bool first = j == 0;
      if (first) {
        add_to_body(i, 0, states[i]);
        after_[s].keep_begin(
            in_.heat.output(*front.sample, front.normal, begin, front.drive, states[i]));
      }
      if (front.back == nullptr) continue;
      const std::uint32_t other = front.sample->other_side;
      back_drives[i] = drive(other, -front.normal, j);
      if (first) {
        after_[other].keep_begin(
            in_.heat.output(all[other], -front.normal, begin, back_drives[i], states[i]));
      }
    }
    // Advance them, sheets together with their other faces.
    in_.heat.advance_all(std::span(fronts).first(samples.size()), interval);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const SampleAdvance& front = fronts[i];
      after_[samples[i]].keep_end(j, front.output);
      add_to_body(i, j + 1, states[i]);
      if (front.back == nullptr) continue;
      const std::uint32_t other = front.sample->other_side;
      back_drives[i].longwave_begin_w_m2 = back_drives[i].longwave_end_w_m2;
      back_outputs[i] = in_.heat.output(all[other], -front.normal, interval.forcing.end,
                                        back_drives[i], states[i]);
      after_[other].keep_end(j, back_outputs[i]);
    }
  }
  // Store the end of the record; both faces of a sheet have one state.
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const std::uint32_t s = samples[i];
    model_.states[s] = states[i];
    model_.outputs[s] = fronts[i].output;
    const std::uint32_t other = all[s].other_side;
    if (other == kNoSample) continue;
    model_.states[other] = states[i];
    model_.outputs[other] = back_outputs[i];
  }
}

}  // namespace

SampleHistories take_histories(const SurfaceInputs& inputs, std::vector<SurfacePatch> patches,
                               SurfaceModel& model) {
  EMIT_CHECK_OP(model.first_sample.size(), ==, inputs.geometry.instances.size());
  const std::size_t count = model.samples.samples.size();
  SampleHistories out;
  out.patches = std::move(patches);
  out.rows.resize(count);
  out.start.resize(count);
  model.states.resize(count);
  model.outputs.resize(count);
  // Go through the patches. The partners' patch follows the drawn samples.
  for (std::size_t p = 0; p < out.patches.size(); ++p) {
    SurfacePatch& patch = out.patches[p];
    const std::size_t first =
        p < model.first_sample.size() ? model.first_sample[p] : model.drawn_samples;
    const bool keeps = patch.sent.length() != 0;
    const auto rows_of = [](SurfacePatch& side, std::size_t vertex) {
      return SampleHistories::Rows{side.sun_frac.row(vertex), side.hidden_sky.row(vertex),
                                   side.sent.row(vertex)};
    };
    for (std::size_t i = 0; i < patch.states.size(); ++i) {
      out.rows[first + i] = rows_of(patch, i);
      if (keeps) out.start[first + i].modes_k = patch.start_k[i];
      model.states[first + i] = patch.states[i];
      model.outputs[first + i] = patch.outputs[i];
      const std::uint32_t other = model.samples.samples[first + i].other_side;
      if (other == kNoSample) continue;
      out.rows[other] = rows_of(*patch.back, i);
      model.states[other] = patch.states[i];
      model.outputs[other] = patch.back->outputs[i];
    }
    patch.free_all_but_rows();
  }
  // Start the modes that a partner drives like that partner's own modes, with the weight of its
  // flux (physics.md eq. 22).
  for (std::size_t s = 0; s < count; ++s) {
    for (std::size_t p = 0; p < kMaxPartners; ++p) {
      const Partner& partner = model.samples.samples[s].partners[p];
      if (partner.sample == kNoSample) continue;
      for (std::size_t m = 0; m < physics::kMaxFosterModes; ++m) {
        out.start[s].partner_k[p][m] =
            partner.weight_frac[m] * out.start[partner.sample].modes_k[m];
      }
    }
  }
  return out;
}

bool exchange(const SurfaceInputs& inputs, const ExchangeOptions& options,
              SampleHistories histories, SurfaceModel& model, const SurfaceProgress& report) {
  EMIT_CHECK_OP(histories.start.size(), ==, model.samples.samples.size());
  EMIT_CHECK_OP(histories.rows.size(), ==, model.samples.samples.size());
  if (options.sweeps == 0) return !report || report(1.0);
  Sweeper sweeper(inputs, options, std::move(histories), model);
  for (std::uint32_t i = 0; i < options.sweeps; ++i) {
    if (report && !report((i + 1.0) / (options.sweeps + 1.0))) return false;
    sweeper.sweep();
  }
  return !report || report(1.0);
}

}  // namespace emit::renderer
