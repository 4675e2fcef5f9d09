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
#include "surface/heat/column_system.hpp"
#include "surface/mesh/sheet_sides.hpp"
#include "surface/model/entity_exitance.hpp"
#include "surface/warm_up/body_courses.hpp"
#include "surface/warm_up/fixed_point_mixer.hpp"

namespace emit::renderer {
namespace {

/// Groups of samples in one task of a parallel loop.
constexpr std::size_t kGrain = 8;
constexpr std::uint32_t kNoList = 0xffffffffU;
/// Entry of Sweeper::kinds_ that stands for twins.
constexpr std::uint32_t kTwins = 0xffffffffU;
/// Intervals in a window: short enough that the radiation within it settles in few iterations and
/// that its rows stay in the cache, long enough that sums over rows run at full width.
constexpr std::size_t kWindow = 16;
/// Iterations that take what the one before sent as it is; later ones are mixed.
constexpr std::uint32_t kPlainIterations = 4;
/// A list is taken anew when it has changed by more than this share of kExchangeResidual.
constexpr double kRenewFrac = 0.5;
/// Rounds in which surfaces and the columns below them agree over an interval, and the difference
/// at which they do, K.
constexpr int kMostColumnRounds = 4;
constexpr double kColumnsAgreeK = 0.02;

/// A pass over the record has one of these purposes.
enum class Pass : std::uint8_t {
  bounce,   ///< carries all samples once, with the radiation of the first guess
  courses,  ///< carries those that take a course from the pass before, once
  settle,   ///< carries all samples until the radiation of every window has settled
};

/// Time of a pass over the record as a share of one that settles, about: a window is carried once,
/// or some ten times.
constexpr double share_of_settling(Pass pass) noexcept {
  return pass == Pass::settle ? 1.0 : pass == Pass::bounce ? 0.2 : 0.1;
}
/// Share of the time of a window after which all its samples have been carried once.
constexpr double kCarriedFrac = 0.2;

/// Range of intervals of the record.
struct Window {
  std::size_t first = 0;
  std::size_t count = 0;
};

/// Row of a sample over a window of `count` intervals: its long-wave exitance at every node, then
/// the sunlight that it reflects in every interval, W/m2.
constexpr std::size_t row_size(std::size_t count) noexcept {
  return 2 * count + 1;
}

/// Radiation that lists of samples send towards those who see them, over a window. The sums are
/// scaled to the viewer that is surrounded most.
class SeenRadiation {
  template <class Values>
  [[nodiscard]] auto row(Values& values, std::size_t list) const noexcept {
    return std::span(values).subspan(list * row_size_, row_size_);
  }

 public:
  explicit SeenRadiation(const SurfaceSamples& all)
      : all_(all), list_of_entry_(all.seen.size(), kNoList) {
    // Find the lists: samples that share a view share its first entry.
    for (const SurfaceSample& sample : all.samples) {
      if (sample.seen_count == 0) continue;
      std::uint32_t& list = list_of_entry_[sample.first_seen];
      if (list == kNoList) {
        list = static_cast<std::uint32_t>(lists_.size());
        lists_.push_back({sample.first_seen, sample.seen_count});
      }
      lists_[list].scale = std::max(lists_[list].scale, sample.seen_scale);
    }
    renewed_.resize(lists_.size());
  }

  /// Begins a window and takes what the rows `sent`, by sample, add up to. Uses all cores.
  void begin(std::span<const float> sent, std::size_t count) {
    row_size_ = row_size(count);
    taken_w_m2_.resize(lists_.size() * row_size_);
    fresh_w_m2_.resize(lists_.size() * row_size_);
    gather(sent);
    taken_w_m2_ = fresh_w_m2_;
    mixer_.reset();
  }
  /// Adds up the rows `sent` again. Returns how far the sums are from those that were taken, W/m2.
  [[nodiscard]] double look(std::span<const float> sent) {
    gather(sent);
    const auto value = [this](std::size_t i) { return off_w_m2(i); };
    float most_w_m2 = 0.0F;
    // The greatest difference does not depend on the order.
    off_w_m2_.resize(lists_.size());
    threads::parallel_parts(lists_.size(), kListGrain, [&](std::size_t from, std::size_t to) {
      for (std::size_t i = from; i < to; ++i) off_w_m2_[i] = value(i);
    });
    for (const float off_w_m2 : off_w_m2_) most_w_m2 = std::max(most_w_m2, off_w_m2);
    return most_w_m2;
  }
  /// Takes the sums that look() has found, mixed with earlier ones or as they are. Lists whose sums
  /// have hardly changed keep them.
  void take(bool mixed) {
    if (mixed) mixer_.mix(taken_w_m2_, fresh_w_m2_);
    threads::parallel_parts(lists_.size(), kListGrain, [&](std::size_t from, std::size_t to) {
      for (std::size_t i = from; i < to; ++i) {
        renewed_[i] = off_w_m2(i) > kRenewFrac * kExchangeResidual_w_m2 ? 1 : 0;
        if (renewed_[i] == 0) continue;
        std::ranges::copy(row(fresh_w_m2_, i), row(taken_w_m2_, i).begin());
      }
    });
  }
  /// Returns whether take() has changed what a sample receives.
  [[nodiscard]] bool renewed(const SurfaceSample& sample) const noexcept {
    return sample.seen_count != 0 && renewed_[list_of_entry_[sample.first_seen]] != 0;
  }

  /// The type holds what a sample receives: a row, and the factor on it. The row is empty if the
  /// sample sees nothing.
  struct Received {
    std::span<const float> row_w_m2;
    double scale = 0.0;
  };
  [[nodiscard]] Received of(const SurfaceSample& sample) const noexcept {
    if (sample.seen_count == 0) return {};
    const std::size_t list = list_of_entry_[sample.first_seen];
    if (!(lists_[list].scale > 0.0F)) return {};
    return {row(taken_w_m2_, list), static_cast<double>(sample.seen_scale) / lists_[list].scale};
  }

 private:
  static constexpr std::size_t kListGrain = 64;
  /// Range of SurfaceSamples::seen, and the greatest scale of its viewers.
  struct List {
    std::uint32_t first = 0;
    std::uint32_t count = 0;
    float scale = 0.0F;
  };
  /// Greatest difference between the sums of a list and those that were taken.
  [[nodiscard]] float off_w_m2(std::size_t list) const noexcept {
    const std::span<const float> fresh_w_m2 = row(fresh_w_m2_, list);
    const std::span<const float> taken_w_m2 = row(taken_w_m2_, list);
    float most_w_m2 = 0.0F;
    for (std::size_t k = 0; k < row_size_; ++k) {
      most_w_m2 = std::max(most_w_m2, std::abs(fresh_w_m2[k] - taken_w_m2[k]));
    }
    return most_w_m2;
  }
  void gather(std::span<const float> sent) {
    threads::parallel_parts(lists_.size(), kListGrain, [&](std::size_t from, std::size_t to) {
      for (std::size_t i = from; i < to; ++i) {
        const List& list = lists_[i];
        const std::span<float> sum_w_m2 = row(fresh_w_m2_, i);
        std::ranges::fill(sum_w_m2, 0.0F);
        for (std::uint32_t k = 0; k < list.count; ++k) {
          const SeenSample& seen = all_.seen[list.first + k];
          const float weight = list.scale * seen.weight_frac;
          const float* const row_w_m2 = &sent[seen.sample * row_size_];
          for (std::size_t j = 0; j < row_size_; ++j) sum_w_m2[j] += weight * row_w_m2[j];
        }
      }
    });
  }

  const SurfaceSamples& all_;
  std::size_t row_size_ = 0;
  std::vector<std::uint32_t> list_of_entry_;  ///< list that begins with an entry of `seen`
  std::vector<List> lists_;
  std::vector<float> taken_w_m2_;      ///< by list: the row that its viewers receive
  std::vector<float> fresh_w_m2_;      ///< by list: the row that follows from what is sent
  std::vector<float> off_w_m2_;        ///< by list: difference of both
  std::vector<std::uint8_t> renewed_;  ///< by list: the latest take() has changed it
  FixedPointMixer mixer_;
};

/// Integrates samples over the record, window by window, with what the others send meanwhile.
class Sweeper {
 public:
  Sweeper(const SurfaceInputs& inputs, const ExchangeOptions& options, SampleHistories histories,
          SurfaceModel& model);

  /// Returns whether some samples take a course from the pass before: the interior of a body.
  [[nodiscard]] bool takes_courses() const noexcept { return takes_courses_; }
  /// Does a pass over the record. `report` receives the share of the pass that is done. Returns
  /// false when it stopped.
  [[nodiscard]] bool sweep(Pass pass, const SurfaceProgress& report);

 private:
  /// Puts what is known of the radiation in a window into rows, as a guess.
  void load(const Window& window);
  /// Iterates a window. `report` receives the share that is done. Returns false when it stopped.
  [[nodiscard]] bool settle(const Window& window, const SurfaceProgress& report);
  /// Keeps the rows and the states at the end of a window.
  void store(const Window& window);
  /// Makes the interiors of this pass those that the next one takes.
  void take_courses();
  /// Measures the radiation of the faces of entities at every node of a window. Returns by how much
  /// it has changed since the call before, W/m2.
  double measure_faces(const Window& window);
  /// Returns whether a sample takes a course from the pass before.
  [[nodiscard]] bool takes_course(std::uint32_t s) const noexcept {
    return model_.samples.samples[s].body >= 0;
  }
  /// Advances those groups over a window of which `chosen(s)` is true for a sample.
  template <class Chosen>
  void carry_groups(const Window& window, const Chosen& chosen);
  /// Returns whether the latest iteration has changed what a sample receives in a window.
  [[nodiscard]] bool changed(std::uint32_t s, const Window& window,
                             bool faces_changed) const noexcept;
  /// Returns true if nothing changes the sample: it sees no other one, has no column and no body,
  /// and no entity that sends radiation hides its sky.
  [[nodiscard]] bool alone(std::size_t s) const noexcept;
  /// Input of sample `s` in interval k of a window.
  [[nodiscard]] SampleDrive drive(std::size_t s, const glm::vec3& normal, const Window& window,
                                  std::size_t k) const noexcept;
  /// Adds the radiation of the entity that hides most of the sample's sky.
  void add_exitance(std::size_t s, const glm::vec3& normal, const Window& window, std::size_t k,
                    SampleDrive& drive) const noexcept;
  /// Integrates the samples of a group, and the other faces of sheets with them, over a window.
  void carry(std::size_t group, const Window& window);
  /// Integrates the samples of the islands in `needed_` over a window, all of an island interval by
  /// interval.
  void march(const Window& window);
  /// Integrates the samples of a group over a window with the heat of neighbours that the latest
  /// march() has found.
  void carry_columns(std::size_t group, const Window& window);
  /// Advances the samples of a group over interval k of a window, and fills the equations of their
  /// columns. Cells stay at its begin.
  void begin_columns(std::size_t group, const Window& window, std::size_t k) noexcept;
  /// Takes over what the columns of a group agree on at the end of interval k of a window.
  void end_columns(std::size_t group, const Window& window, std::size_t k) noexcept;
  /// Integrates the twins of a group over a window, once the radiation in it has settled. Nobody
  /// receives what they send.
  void carry_twins(std::size_t group, const Window& window);
  /// Returns what neighbours add to the surface of the sample of a twin at the begin of interval k.
  [[nodiscard]] double aside_of_k(const SurfaceSample& twin, std::size_t k) const noexcept;
  [[nodiscard]] bool has_twins(std::size_t group) const noexcept {
    return kinds_[bodies_->groups()[group].first] == kTwins;
  }
  /// Island of a group; kNoList if its samples have no columns.
  [[nodiscard]] std::uint32_t island(std::size_t group) const noexcept {
    return has_twins(group) ? kNoList : kinds_[bodies_->groups()[group].first] - 1;
  }
  [[nodiscard]] std::uint32_t column(std::uint32_t s) const noexcept {
    return model_.samples.samples[s].column;
  }
  /// Row of a sample in the window at hand.
  [[nodiscard]] float* row_of(std::size_t s, const Window& window) noexcept {
    return &sent_[s * row_size(window.count)];
  }

  const SurfaceInputs& in_;
  SurfaceModel& model_;
  SampleHistories histories_;
  std::size_t intervals_;
  std::vector<std::uint32_t> swept_;  ///< samples that change; one for both faces of a sheet
  std::vector<SentRow> rows_;         ///< by sample: what it sent in the latest pass
  /// Kinds by entry of `swept_`: 1 + island of its column, or 0; kTwins for twins, which come last.
  std::vector<std::uint32_t> kinds_;
  std::vector<float> sent_;         ///< by sample: its row in the window at hand
  std::vector<float> shift_w_m2_;   ///< by sample: long wave at the last node above its guess
  std::vector<SampleState> begin_;  ///< by sample: state at the begin of the window
  SeenRadiation seen_;
  EntityExitance exitance_;
  std::size_t entities_ = 0;         ///< entities whose faces count; 0 without exchange
  std::vector<EntityFaces> faces_;   ///< by node of the window, then entity
  std::vector<EntityFaces> before_;  ///< faces of the iteration before
  bool takes_courses_ = false;
  std::optional<BodyCourses> bodies_;
  /// A sample with a column, in the interval at hand.
  struct Front {
    SampleDrive drive;
    SampleState next;       ///< modes at the end of the interval, cells at its begin
    double change_k = 0.0;  ///< change over the interval of what neighbours add to the surface
    /// Results of the iteration before, by interval of the window: cells, and that change.
    std::array<physics::CellState<float>, kWindow> known_k{};
    std::array<float, kWindow> known_change_k{};
  };
  ColumnSystem columns_;
  std::vector<Front> fronts_;         ///< by column
  std::vector<std::uint8_t> known_;   ///< by island: the window was integrated before
  std::vector<std::uint8_t> needed_;  ///< by island: to be integrated
};

Sweeper::Sweeper(const SurfaceInputs& inputs, const ExchangeOptions& options,
                 SampleHistories histories, SurfaceModel& model)
    : in_(inputs),
      model_(model),
      histories_(std::move(histories)),
      intervals_(inputs.record.size()),
      shift_w_m2_(model.samples.samples.size()),
      seen_(model.samples),
      columns_(model.samples),
      fronts_(model.samples.columns.size()),
      known_(columns_.islands()),
      needed_(columns_.islands()) {
  for (const SampleHistories::Rows& rows : histories_.rows) rows_.emplace_back(rows.sent_w_m2);
  if (options.exitance && !inputs.entities_now.empty()) {
    exitance_ = EntityExitance(model, inputs.geometry, inputs.entity_of_object);
    entities_ = inputs.entities_now.size();
  }
  // Find the samples that change. Those with columns come last, island by island.
  const std::vector<SurfaceSample>& all = model_.samples.samples;
  for (std::uint32_t s = 0; s < all.size(); ++s) {
    if (!steps_itself(model_.samples, s)) continue;
    const std::uint32_t other = all[s].other_side;
    if (alone(s) && (other == kNoSample || alone(other))) continue;
    swept_.push_back(s);
    takes_courses_ = takes_courses_ || takes_course(s);
  }
  const auto kind = [&](std::uint32_t s) {
    if (all[s].twin_of != kNoSample) return kTwins;
    return column(s) == kNoSample ? 0 : 1 + columns_.island(column(s));
  };
  std::ranges::stable_sort(swept_, {}, kind);
  for (const std::uint32_t s : swept_) kinds_.push_back(kind(s));
  bodies_.emplace(model, inputs.geometry, inputs.heat, inputs.record, swept_, kinds_,
                  kAdvanceTogether);
  model.body_k = bodies_->end_k();
}

bool Sweeper::sweep(Pass pass, const SurfaceProgress& report) {
  begin_ = histories_.start;
  std::ranges::fill(shift_w_m2_, 0.0F);
  for (Window window; window.first < intervals_; window.first += window.count) {
    window.count = std::min(kWindow, intervals_ - window.first);
    const SurfaceProgress within = [&](double frac) {
      const double done =
          static_cast<double>(window.first) + frac * static_cast<double>(window.count);
      return !report || report(done / static_cast<double>(intervals_));
    };
    if (!within(0.0)) return false;
    load(window);
    seen_.begin(sent_, window.count);
    faces_.resize(entities_ * (window.count + 1));
    measure_faces(window);
    std::ranges::fill(known_, std::uint8_t{0});
    std::ranges::fill(needed_, std::uint8_t{0});
    carry_groups(window, [&](std::uint32_t s) { return pass != Pass::courses || takes_course(s); });
    march(window);
    if (pass == Pass::settle) {
      if (!settle(window, within)) return false;
      threads::parallel_parts(bodies_->groups().size(), kGrain,
                              [&](std::size_t from, std::size_t to) {
                                for (std::size_t group = from; group < to; ++group) {
                                  if (has_twins(group)) carry_twins(group, window);
                                }
                              });
    }
    store(window);
  }
  take_courses();
  return true;
}

void Sweeper::load(const Window& window) {
  sent_.resize(rows_.size() * row_size(window.count));
  threads::parallel_parts(rows_.size(), kGrain * kGrain, [&](std::size_t from, std::size_t to) {
    for (std::size_t s = from; s < to; ++s) {
      // Expect the long wave to stay as far above the guess as it was at the node before.
      float* const row_w_m2 = row_of(s, window);
      row_w_m2[0] = rows_[s].longwave_w_m2(window.first);
      for (std::size_t k = 0; k < window.count; ++k) {
        row_w_m2[1 + k] = rows_[s].longwave_w_m2(window.first + k + 1) + shift_w_m2_[s];
        row_w_m2[window.count + 1 + k] = rows_[s].shortwave_w_m2(window.first + k);
      }
    }
  });
}

bool Sweeper::settle(const Window& window, const SurfaceProgress& report) {
  double most_w_m2 = 0.0;
  double done_frac = 0.0;
  for (std::uint32_t i = 0; i < kMostIterations; ++i) {
    const double faces_w_m2 = measure_faces(window);
    const double seen_w_m2 = seen_.look(sent_);
    const double left_w_m2 = std::max(faces_w_m2, seen_w_m2);
    if (!(left_w_m2 > kExchangeResidual_w_m2)) {
      // The radiation has settled with the heat along the surface that was known: find it anew.
      if (std::ranges::find(needed_, std::uint8_t{1}) == needed_.end()) return true;
      march(window);
      continue;
    }
    if (i + 1 == kMostIterations) {
      model_.exchange_left_w_m2 = std::max(model_.exchange_left_w_m2, left_w_m2);
      return true;
    }
    // The residual falls by about the same factor in each iteration.
    most_w_m2 = std::max(most_w_m2, left_w_m2);
    done_frac = std::max(done_frac, std::log(most_w_m2 / left_w_m2) /
                                        std::log(most_w_m2 / (0.5 * kExchangeResidual_w_m2)));
    if (!report(kCarriedFrac + (1.0 - kCarriedFrac) * done_frac)) return false;
    seen_.take(i >= kPlainIterations);
    const bool faces_changed = faces_w_m2 > kRenewFrac * kExchangeResidual_w_m2;
    carry_groups(window, [&](std::uint32_t s) { return changed(s, window, faces_changed); });
  }
  return true;
}

void Sweeper::store(const Window& window) {
  const std::size_t last = window.first + window.count;
  threads::parallel_parts(swept_.size(), kGrain * kGrain, [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) {
      const auto keep = [&](std::uint32_t s) {
        const float* const row_w_m2 = row_of(s, window);
        shift_w_m2_[s] = row_w_m2[window.count] - rows_[s].longwave_w_m2(last);
        for (std::size_t k = 0; k <= window.count; ++k) {
          rows_[s].keep_longwave(window.first + k, row_w_m2[k]);
        }
        for (std::size_t k = 0; k < window.count; ++k) {
          rows_[s].keep_shortwave(window.first + k, row_w_m2[window.count + 1 + k]);
        }
      };
      const std::uint32_t s = swept_[i];
      begin_[s] = model_.states[s];
      if (model_.samples.samples[s].twin_of != kNoSample) continue;
      keep(s);
      const std::uint32_t other = model_.samples.samples[s].other_side;
      if (other != kNoSample) keep(other);
    }
  });
}

void Sweeper::take_courses() {
  bodies_->correct();
  model_.body_k = bodies_->end_k();
}

double Sweeper::measure_faces(const Window& window) {
  if (entities_ == 0) return 0.0;
  before_ = faces_;
  threads::parallel_parts(window.count + 1, 1, [&](std::size_t from, std::size_t to) {
    for (std::size_t k = from; k < to; ++k) {
      exitance_.measure(
          model_.samples, in_.record.rays[std::min(window.first + k, intervals_ - 1)],
          [&](std::size_t s) { return row_of(s, window)[k]; },
          std::span(faces_).subspan(k * entities_, entities_));
    }
  });
  double most_w_m2 = 0.0;
  for (std::size_t i = 0; i < faces_.size(); ++i) {
    for (std::size_t side = 0; side < faces_[i].sent_w.size(); ++side) {
      if (!(faces_[i].area_m2[side] > 0.0F)) continue;
      const float off_w = std::abs(faces_[i].sent_w[side] - before_[i].sent_w[side]);
      most_w_m2 = std::max(most_w_m2, static_cast<double>(off_w / faces_[i].area_m2[side]));
    }
  }
  return most_w_m2;
}

bool Sweeper::alone(std::size_t s) const noexcept {
  const SurfaceSample& sample = model_.samples.samples[s];
  if (sample.seen_count != 0 || sample.body >= 0 || sample.column != kNoSample ||
      sample.twin_of != kNoSample) {
    return false;
  }
  if (entities_ == 0) return true;
  return std::ranges::all_of(histories_.rows[s].hidden_sky,
                             [](const HiddenSky& sky) { return sky.frac == 0.0F; });
}

bool Sweeper::changed(std::uint32_t s, const Window& window, bool faces_changed) const noexcept {
  const SurfaceSample& sample = model_.samples.samples[s];
  if (seen_.renewed(sample)) return true;
  if (!faces_changed) return false;
  return std::ranges::any_of(histories_.rows[s].hidden_sky.subspan(window.first, window.count),
                             [](const HiddenSky& sky) { return sky.frac != 0.0F; });
}

template <class Chosen>
void Sweeper::carry_groups(const Window& window, const Chosen& chosen) {
  const std::span<const BodyCourses::Group> groups = bodies_->groups();
  const auto needed = [&](std::size_t group) {
    if (has_twins(group)) return false;
    const auto samples = std::span(swept_).subspan(groups[group].first, groups[group].count);
    return std::ranges::any_of(samples, [&](std::uint32_t s) {
      const std::uint32_t other = model_.samples.samples[s].other_side;
      return chosen(s) || (other != kNoSample && chosen(other));
    });
  };
  threads::parallel_parts(groups.size(), kGrain, [&](std::size_t from, std::size_t to) {
    for (std::size_t group = from; group < to; ++group) {
      if (island(group) == kNoList && needed(group)) carry(group, window);
    }
  });
  // Samples with columns are carried with the heat of neighbours that is known, and their island
  // waits for march(). Without such knowledge march() comes first.
  std::vector<std::uint8_t> dirty(groups.size(), 0);
  threads::parallel_parts(groups.size(), kGrain, [&](std::size_t from, std::size_t to) {
    for (std::size_t group = from; group < to; ++group) {
      if (island(group) == kNoList || !needed(group)) continue;
      dirty[group] = 1;
      if (known_[island(group)] != 0) carry_columns(group, window);
    }
  });
  for (std::size_t group = 0; group < groups.size(); ++group) {
    if (dirty[group] != 0) needed_[island(group)] = 1;
  }
}

SampleDrive Sweeper::drive(std::size_t s, const glm::vec3& normal, const Window& window,
                           std::size_t k) const noexcept {
  const std::size_t j = window.first + k;
  const SurfaceSample& sample = model_.samples.samples[s];
  SampleDrive drive;
  const SampleHistories::Rows& rows = histories_.rows[s];
  drive.sun_frac = rows.sun_frac[j];
  if (!rows.cloud_sun.empty()) drive.sun_frac *= rows.cloud_sun[j];
  drive.take_entity(in_.record.intervals[j].entities, sample);
  if (sample.body >= 0) drive.body_k = bodies_->mean_k(sample.body, j);
  if (!rows.hidden_sky.empty()) {
    drive.hidden_sky_frac = rows.hidden_sky[j].frac;
    drive.longwave_begin_w_m2 = drive.longwave_end_w_m2 = rows.hidden_sky[j].hot_w_m2;
  }
  // Add what the seen samples send, scaled to the share of the hemisphere that they fill.
  const SeenRadiation::Received received = seen_.of(sample);
  if (!received.row_w_m2.empty()) {
    drive.longwave_begin_w_m2 += received.scale * received.row_w_m2[k];
    drive.longwave_end_w_m2 += received.scale * received.row_w_m2[k + 1];
    drive.shortwave_w_m2 = received.scale * received.row_w_m2[window.count + 1 + k];
  }
  add_exitance(s, normal, window, k, drive);
  return drive;
}

void Sweeper::add_exitance(std::size_t s, const glm::vec3& normal, const Window& window,
                           std::size_t k, SampleDrive& drive) const noexcept {
  if (entities_ == 0 || drive.hidden_sky_frac == 0.0F) return;
  const std::size_t entity = histories_.rows[s].hidden_sky[window.first + k].entity;
  // Leave the surroundings in place if no face of the entity looks towards the surface.
  const float begin_w_m2 = faces_[k * entities_ + entity].towards_w_m2(normal);
  const float end_w_m2 = faces_[(k + 1) * entities_ + entity].towards_w_m2(normal);
  if (begin_w_m2 < 0.0F || end_w_m2 < 0.0F) return;
  const double hidden_frac = model_.samples.samples[s].sky_frac * drive.hidden_sky_frac;
  drive.longwave_begin_w_m2 += hidden_frac * begin_w_m2;
  drive.longwave_end_w_m2 += hidden_frac * end_w_m2;
  drive.hidden_is_seen = true;
}

void Sweeper::march(const Window& window) {
  // List the groups of these islands; their samples begin with the window.
  std::vector<std::uint32_t> groups;
  std::vector<std::uint32_t> islands;
  for (std::uint32_t group = 0; group < bodies_->groups().size(); ++group) {
    if (island(group) == kNoList || needed_[island(group)] == 0) continue;
    if (islands.empty() || islands.back() != island(group)) islands.push_back(island(group));
    groups.push_back(group);
    const BodyCourses::Group& chosen = bodies_->groups()[group];
    if (chosen.body >= 0) bodies_->forget(group, window.first, window.count);
    for (std::size_t i = chosen.first; i < chosen.first + chosen.count; ++i) {
      model_.states[swept_[i]] = begin_[swept_[i]];
    }
  }
  if (groups.empty()) return;
  const auto each_group = [&](const auto& visit) {
    threads::parallel_parts(groups.size(), kGrain, [&](std::size_t from, std::size_t to) {
      for (std::size_t i = from; i < to; ++i) visit(groups[i]);
    });
  };
  std::vector<double> off_k(islands.size());
  for (std::size_t k = 0; k < window.count; ++k) {
    // Expect the change that is known, else the one of the interval before.
    for (const std::uint32_t i : islands) {
      for (const std::uint32_t c : columns_.columns(i)) {
        if (known_[i] != 0) fronts_[c].change_k = fronts_[c].known_change_k[k];
      }
    }
    for (int round = 0; round < kMostColumnRounds; ++round) {
      each_group([&](std::size_t group) { begin_columns(group, window, k); });
      threads::parallel_parts(islands.size(), 1, [&](std::size_t from, std::size_t to) {
        for (std::size_t i = from; i < to; ++i) {
          off_k[i] = 0.0;
          const bool known = known_[islands[i]] != 0 || round != 0;
          for (const std::uint32_t c : columns_.columns(islands[i])) {
            const SampleState& begin = fronts_[c].next;
            for (std::size_t l = 0; l < physics::kMaxColumnCells; ++l) {
              columns_.cells_k(c)[l] =
                  known ? fronts_[c].known_k[k][l]
                        : columns_.equations(c).alone_k[l] + begin.cells_k[l] - begin.alone_k[l];
            }
          }
          columns_.solve(islands[i]);
          for (const std::uint32_t c : columns_.columns(islands[i])) {
            Front& front = fronts_[c];
            for (std::size_t l = 0; l < physics::kMaxColumnCells; ++l) {
              front.known_k[k][l] = static_cast<float>(columns_.cells_k(c)[l]);
            }
            const double change_k =
                columns_.equations(c).aside_k(columns_.cells_k(c)) - front.next.aside_k;
            off_k[i] = std::max(off_k[i], std::abs(change_k - front.change_k));
            front.change_k = change_k;
            front.known_change_k[k] = static_cast<float>(change_k);
          }
        }
      });
      if (std::ranges::max(off_k) < kColumnsAgreeK) break;
    }
    each_group([&](std::size_t group) { end_columns(group, window, k); });
  }
  for (const std::uint32_t i : islands) {
    known_[i] = 1;
    needed_[i] = 0;
  }
}

void Sweeper::carry_columns(std::size_t group, const Window& window) {
  const BodyCourses::Group& chosen = bodies_->groups()[group];
  std::array<SampleAdvance, kAdvanceTogether> advances;
  std::array<SampleState, kAdvanceTogether> states;
  for (std::size_t i = 0; i < chosen.count; ++i) {
    states[i] = begin_[swept_[chosen.first + i]];
    advances[i].sample = &model_.samples.samples[swept_[chosen.first + i]];
    advances[i].state = &states[i];
  }
  for (std::size_t k = 0; k < window.count; ++k) {
    const std::size_t j = window.first + k;
    const HeatInterval& interval = in_.record.intervals[j];
    for (std::size_t i = 0; i < chosen.count; ++i) {
      const std::uint32_t s = swept_[chosen.first + i];
      SampleAdvance& advance = advances[i];
      advance.normal = in_.record.rays[j].normal(*advance.sample);
      advance.drive = drive(s, advance.normal, window, k);
      advance.drive.aside.change_k = fronts_[column(s)].known_change_k[k];
      if (j != 0) continue;
      row_of(s, window)[0] = in_.heat
                                 .output(*advance.sample, advance.normal, interval.forcing.begin,
                                         advance.drive, states[i])
                                 .longwave_out_w_m2;
    }
    in_.heat.advance_all(std::span(advances).first(chosen.count), interval);
    for (std::size_t i = 0; i < chosen.count; ++i) {
      const std::uint32_t s = swept_[chosen.first + i];
      SampleAdvance& advance = advances[i];
      // Only what neighbours add to the surface is known here: cells stay as they are.
      states[i].aside_k += fronts_[column(s)].known_change_k[k];
      advance.drive.longwave_begin_w_m2 = advance.drive.longwave_end_w_m2;
      const SampleOutput output = in_.heat.output(*advance.sample, advance.normal,
                                                  interval.forcing.end, advance.drive, states[i]);
      row_of(s, window)[1 + k] = output.longwave_out_w_m2;
      row_of(s, window)[window.count + 1 + k] = output.shortwave_out_w_m2;
    }
  }
}

void Sweeper::begin_columns(std::size_t group, const Window& window, std::size_t k) noexcept {
  const BodyCourses::Group& chosen = bodies_->groups()[group];
  const std::size_t j = window.first + k;
  const HeatInterval& interval = in_.record.intervals[j];
  std::array<SampleAdvance, kAdvanceTogether> advances;
  for (std::size_t i = 0; i < chosen.count; ++i) {
    const std::uint32_t s = swept_[chosen.first + i];
    const SurfaceSample& sample = model_.samples.samples[s];
    Front& front = fronts_[sample.column];
    SampleAdvance& advance = advances[i];
    advance.sample = &sample;
    advance.normal = in_.record.rays[j].normal(sample);
    front.drive = drive(s, advance.normal, window, k);
    front.next = model_.states[s];
    if (j == 0) {
      row_of(s, window)[0] =
          in_.heat.output(sample, advance.normal, interval.forcing.begin, front.drive, front.next)
              .longwave_out_w_m2;
    }
    advance.drive = front.drive;
    advance.drive.aside = {&model_.samples.columns[sample.column], nullptr,
                           &columns_.equations(sample.column), front.change_k};
    advance.state = &front.next;
  }
  in_.heat.advance_all(std::span(advances).first(chosen.count), interval);
}

void Sweeper::end_columns(std::size_t group, const Window& window, std::size_t k) noexcept {
  const BodyCourses::Group& chosen = bodies_->groups()[group];
  const std::size_t j = window.first + k;
  for (std::size_t i = 0; i < chosen.count; ++i) {
    const std::uint32_t s = swept_[chosen.first + i];
    const SurfaceSample& sample = model_.samples.samples[s];
    Front& front = fronts_[sample.column];
    if (j == 0 && chosen.body >= 0) bodies_->add(group, 0, s, model_.states[s]);
    keep_cells(columns_.equations(sample.column), columns_.cells_k(sample.column), front.next);
    model_.states[s] = front.next;
    // Take what arrives at the end of the interval.
    front.drive.longwave_begin_w_m2 = front.drive.longwave_end_w_m2;
    SampleOutput& output = model_.outputs[s];
    output = in_.heat.output(sample, in_.record.rays[j].normal(sample),
                             in_.record.intervals[j].forcing.end, front.drive, front.next);
    float* const row_w_m2 = row_of(s, window);
    row_w_m2[1 + k] = output.longwave_out_w_m2;
    row_w_m2[window.count + 1 + k] = output.shortwave_out_w_m2;
    if (chosen.body >= 0) bodies_->add(group, j + 1, s, front.next);
  }
}

void Sweeper::carry(std::size_t group, const Window& window) {
  const BodyCourses::Group& chosen = bodies_->groups()[group];
  const std::span<const std::uint32_t> samples =
      std::span(swept_).subspan(chosen.first, chosen.count);
  if (chosen.body >= 0) bodies_->forget(group, window.first, window.count);
  const auto add_to_body = [&](std::size_t i, std::size_t node, const SampleState& state) {
    if (chosen.body >= 0) bodies_->add(group, node, samples[i], state);
  };
  // Keep what a sample sends at node k of the window, or over interval k and at its end.
  const auto keep_node = [&](std::uint32_t s, std::size_t k, const SampleOutput& output) {
    row_of(s, window)[k] = output.longwave_out_w_m2;
  };
  const auto keep_end = [&](std::uint32_t s, std::size_t k, const SampleOutput& output) {
    keep_node(s, k + 1, output);
    row_of(s, window)[window.count + 1 + k] = output.shortwave_out_w_m2;
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
    states[i] = begin_[samples[i]];
    fronts[i].sample = &sample;
    fronts[i].state = &states[i];
    if (sample.other_side == kNoSample) continue;
    backs[i].emplace(SheetBack{all[sample.other_side], back_drives[i]});
    fronts[i].back = &*backs[i];
  }
  for (std::size_t k = 0; k < window.count; ++k) {
    const std::size_t j = window.first + k;
    const HeatInterval& interval = in_.record.intervals[j];
    const SurfaceForcing& begin = interval.forcing.begin;
    // Collect the input of the samples over the interval.
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const std::uint32_t s = samples[i];
      SampleAdvance& front = fronts[i];
      front.normal = in_.record.rays[j].normal(*front.sample);
      front.drive = drive(s, front.normal, window, k);
      const bool first = j == 0;
      if (first) {
        add_to_body(i, 0, states[i]);
        keep_node(s, 0,
                  in_.heat.output(*front.sample, front.normal, begin, front.drive, states[i]));
      }
      if (front.back == nullptr) continue;
      const std::uint32_t other = front.sample->other_side;
      back_drives[i] = drive(other, -front.normal, window, k);
      if (first) {
        keep_node(other, 0,
                  in_.heat.output(all[other], -front.normal, begin, back_drives[i], states[i]));
      }
    }
    // Advance them, sheets together with their other faces.
    in_.heat.advance_all(std::span(fronts).first(samples.size()), interval);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const SampleAdvance& front = fronts[i];
      keep_end(samples[i], k, front.output);
      add_to_body(i, j + 1, states[i]);
      if (front.back == nullptr) continue;
      const std::uint32_t other = front.sample->other_side;
      back_drives[i].longwave_begin_w_m2 = back_drives[i].longwave_end_w_m2;
      back_outputs[i] = in_.heat.output(all[other], -front.normal, interval.forcing.end,
                                        back_drives[i], states[i]);
      keep_end(other, k, back_outputs[i]);
    }
  }
  // Store the end of the window; both faces of a sheet have one state.
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

double Sweeper::aside_of_k(const SurfaceSample& twin, std::size_t k) const noexcept {
  const std::uint32_t column = model_.samples.samples[twin.twin_of].column;
  if (column == kNoSample) return 0.0;
  const std::array<float, kWindow>& change_k = fronts_[column].known_change_k;
  double sum_k = begin_[twin.twin_of].aside_k;
  for (std::size_t j = 0; j < k; ++j) sum_k += static_cast<double>(change_k[j]);
  return sum_k;
}

void Sweeper::carry_twins(std::size_t group, const Window& window) {
  const BodyCourses::Group& chosen = bodies_->groups()[group];
  const std::vector<SurfaceSample>& all = model_.samples.samples;
  std::array<SampleAdvance, kAdvanceTogether> fronts;
  std::array<SampleState, kAdvanceTogether> states;
  std::array<SampleDrive, kAdvanceTogether> back_drives;
  std::array<std::optional<SheetBack>, kAdvanceTogether> backs;
  for (std::size_t i = 0; i < chosen.count; ++i) {
    const std::uint32_t s = swept_[chosen.first + i];
    states[i] = begin_[s];
    fronts[i].sample = &all[s];
    fronts[i].state = &states[i];
    if (all[s].other_side == kNoSample) continue;
    backs[i].emplace(SheetBack{all[all[s].other_side], back_drives[i]});
    fronts[i].back = &*backs[i];
  }
  for (std::size_t k = 0; k < window.count; ++k) {
    const std::size_t j = window.first + k;
    for (std::size_t i = 0; i < chosen.count; ++i) {
      const std::uint32_t s = swept_[chosen.first + i];
      SampleAdvance& front = fronts[i];
      front.normal = in_.record.rays[j].normal(*front.sample);
      front.drive = drive(s, front.normal, window, k);
      // Neighbours warm a twin as much as the sample itself.
      const double aside_k = aside_of_k(*front.sample, k);
      states[i].aside_k = static_cast<float>(aside_k);
      front.drive.aside.change_k = aside_of_k(*front.sample, k + 1) - aside_k;
      if (front.back != nullptr) {
        back_drives[i] = drive(front.sample->other_side, -front.normal, window, k);
      }
    }
    in_.heat.advance_all(std::span(fronts).first(chosen.count), in_.record.intervals[j]);
  }
  const std::size_t last = window.first + window.count - 1;
  const SurfaceForcing& end = in_.record.intervals[last].forcing.end;
  for (std::size_t i = 0; i < chosen.count; ++i) {
    const std::uint32_t s = swept_[chosen.first + i];
    states[i].aside_k = static_cast<float>(aside_of_k(all[s], window.count));
    model_.states[s] = states[i];
    model_.outputs[s] = in_.heat.output(all[s], fronts[i].normal, end, fronts[i].drive, states[i]);
    const std::uint32_t other = all[s].other_side;
    if (other == kNoSample) continue;
    model_.states[other] = states[i];
    model_.outputs[other] =
        in_.heat.output(all[other], -fronts[i].normal, end, back_drives[i], states[i]);
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
  // Go through the patches.
  for (std::size_t p = 0; p < out.patches.size(); ++p) {
    SurfacePatch& patch = out.patches[p];
    const std::size_t first = model.first_sample[p];
    const bool keeps = patch.sent.length() != 0;
    const auto rows_of = [](SurfacePatch& side, std::size_t vertex) {
      return SampleHistories::Rows{side.sun_frac.row(vertex), side.hidden_sky.row(vertex),
                                   side.cloud_sun.row(vertex), side.sent.row(vertex)};
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
  // Start the columns with the profile of the time before.
  for (const SampleColumn& column : model.samples.columns) {
    inputs.heat.foster()->begin_column(model.samples.samples[column.sample],
                                       out.start[column.sample]);
  }
  return out;
}

bool exchange(const SurfaceInputs& inputs, const ExchangeOptions& options,
              SampleHistories histories, SurfaceModel& model, const SurfaceProgress& report) {
  EMIT_CHECK_OP(histories.start.size(), ==, model.samples.samples.size());
  EMIT_CHECK_OP(histories.rows.size(), ==, model.samples.samples.size());
  Sweeper sweeper(inputs, options, std::move(histories), model);
  std::vector<Pass> passes{Pass::settle};
  if (sweeper.takes_courses()) passes = {Pass::bounce, Pass::courses, Pass::settle};
  double whole = 0.0;
  for (const Pass pass : passes) whole += share_of_settling(pass);
  double before = 0.0;
  for (const Pass pass : passes) {
    const auto within = [&](double frac) {
      return !report || report((before + frac * share_of_settling(pass)) / whole);
    };
    if (!sweeper.sweep(pass, within)) return false;
    before += share_of_settling(pass);
  }
  return !report || report(1.0);
}

}  // namespace emit::renderer
