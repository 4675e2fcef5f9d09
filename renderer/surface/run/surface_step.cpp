// SPDX-License-Identifier: Apache-2.0
#include "surface/run/surface_step.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>

#include "emit/physics/check.hpp"
#include "surface/heat/view_of_now.hpp"
#include "surface/rays/ray_offsets.hpp"
#include "surface/run/column_solve.hpp"

namespace emit::renderer {
namespace {

/// Share of a whole, 0 to 1; 0 of nothing.
float share_of(float part, float whole) noexcept {
  return whole > 1e-6F ? std::clamp(part / whole, 0.0F, 1.0F) : 0.0F;
}

/// Sample with the view that it has in an interval. Only the samples of entities that have moved
/// since the warm-up, or that others have left or come to, are copied for it.
class ViewedSample {
 public:
  ViewedSample(const SurfaceStep& step, const IntervalRays& interval_rays,
               const SurfaceSample& sample) noexcept
      : sample_(&sample) {
    const EntityStand stand = sample.entity >= 0
                                  ? interval_rays.stand(static_cast<std::size_t>(sample.entity))
                                  : EntityStand{};
    view_ = view_of_now(step.all, sample, stand);
    if (sample.entity >= 0 && !step.views.empty()) {
      leave_departed(step, interval_rays, sample);
      const BodyView& body = step.views[static_cast<std::size_t>(sample.entity)];
      if (body.known) meet(body.towards(sample.normal), sample, stand);
      changed_ = changed_ || body.known;
    }
    if (stand.moved_frac == 0.0F && !changed_) return;
    moved_ = sample;
    moved_->sky_frac = view_.sky_frac;
    moved_->far_frac = view_.far_frac;
    moved_->sphere_sky_frac = view_.sphere_sky_frac;
    sample_ = &*moved_;
  }
  ViewedSample(const ViewedSample&) = delete;
  ViewedSample& operator=(const ViewedSample&) = delete;

  [[nodiscard]] const SurfaceSample& sample() const noexcept { return *sample_; }
  [[nodiscard]] const ViewOfNow& view() const noexcept { return view_; }
  /// Radiation of surfaces that stand there now and that the warm-up did not see, by their shares
  /// of the hemisphere.
  [[nodiscard]] double longwave_w_m2() const noexcept { return longwave_w_m2_; }
  [[nodiscard]] double shortwave_w_m2() const noexcept { return shortwave_w_m2_; }
  /// Share of the other samples in view that bodies which came stand before, and what those send.
  [[nodiscard]] float hidden_frac() const noexcept { return hidden_frac_; }
  [[nodiscard]] const SideView::Met& before() const noexcept { return before_; }

 private:
  /// Gives the shares of samples of entities that have left to the sky and to the surroundings.
  void leave_departed(const SurfaceStep& step, const IntervalRays& interval_rays,
                      const SurfaceSample& sample) noexcept {
    float left_frac = 0.0F;
    for (std::uint32_t k = 0; k < sample.seen_count; ++k) {
      const SeenSample& seen = step.all.seen[sample.first_seen + k];
      const std::int32_t other = step.all.samples[seen.sample].entity;
      if (other < 0 || other == sample.entity) continue;
      left_frac +=
          seen.weight_frac * interval_rays.stand(static_cast<std::size_t>(other)).moved_frac;
    }
    left_frac *= view_.others_scale;
    if (left_frac == 0.0F) return;
    // They were at about the height of the body: the horizon halves them for an upright face.
    const float up_frac = 0.5F + 0.5F * interval_rays.normal(sample).z;
    view_.sky_frac += up_frac * left_frac;
    view_.far_frac += (1.0F - up_frac) * left_frac;
    changed_ = true;
  }
  /// Puts the surfaces that stand there before sky, surroundings and other samples (physics.md
  /// eq. 30).
  void meet(const SideView& side, const SurfaceSample& sample, const EntityStand& stand) noexcept {
    const auto take = [this](float& from_frac, float take_frac, const SideView::Met& met) {
      if (!(met.frac > 0.0F)) return;
      take_frac = std::min(take_frac, from_frac);
      from_frac -= take_frac;
      longwave_w_m2_ += take_frac * met.longwave_w_m2 / met.frac;
      shortwave_w_m2_ += take_frac * met.shortwave_w_m2 / met.frac;
    };
    const float p = stand.moved_frac;
    const float down_frac = 1.0F - side.up_frac;
    if (p > 0.0F) {
      const float sky_frac = p * sky_past_hull(sample, stand.up_body);
      const float ground_frac = std::max(0.0F, p * sample.hull_open_frac - sky_frac);
      take(view_.sky_frac, sky_frac * share_of(side.still_up.frac, side.up_frac), side.still_up);
      take(view_.far_frac, ground_frac * share_of(side.still_down.frac, down_frac),
           side.still_down);
    }
    take(view_.sky_frac,
         view_.sky_frac * share_of(side.moved_up.frac, side.up_frac - side.still_up.frac),
         side.moved_up);
    take(view_.far_frac,
         view_.far_frac * share_of(side.moved_down.frac, down_frac - side.still_down.frac),
         side.moved_down);
    if (side.moved_down.frac > 0.0F) {
      hidden_frac_ = share_of(side.moved_down.frac, down_frac);
      before_ = side.moved_down;
    }
  }

  const SurfaceSample* sample_;
  ViewOfNow view_;
  double longwave_w_m2_ = 0.0;
  double shortwave_w_m2_ = 0.0;
  float hidden_frac_ = 0.0F;
  SideView::Met before_;
  bool changed_ = false;
  std::optional<SurfaceSample> moved_;
};

/// Input of a sample over an interval. Other samples count with their output at its begin.
SampleDrive drive_of(const SurfaceStep& step, const IntervalRays& interval_rays,
                     const EntityForcing& entities, std::span<const SampleOutput> begin,
                     const ViewedSample& viewed, const RayOffsets& offsets,
                     const SunShare& sun) noexcept {
  const SurfaceSample& sample = viewed.sample();
  const ViewOfNow& view = viewed.view();
  SampleDrive drive;
  drive.sun_frac = sun.frac * interval_rays.cloud_sun(sample);
  drive.take_entity(entities, sample);
  if (sample.body >= 0) drive.body_k = step.body_k[static_cast<std::size_t>(sample.body)];
  // Replace the sky behind entities by the long-wave radiation of the one that hides most.
  const HiddenSky hidden = interval_rays.hidden_sky(step.rays, sample, offsets.around_m);
  drive.hidden_sky_frac = hidden.frac;
  if (hidden.frac > 0.0F && !step.faces.empty()) {
    const float sent_w_m2 = step.faces[hidden.entity].towards_w_m2(sample.normal);
    drive.hidden_is_seen = sent_w_m2 >= 0.0F;
    if (drive.hidden_is_seen) {
      drive.longwave_begin_w_m2 += sample.sky_frac * hidden.frac * sent_w_m2;
    }
  }
  if (!step.hot.empty() && sample.entity < 0) {
    drive.longwave_begin_w_m2 +=
        step.hot.on_w_m2(step.rays, interval_rays,
                         sample.position_m + offsets.around_m * sample.normal, sample.normal);
  }
  // Add the radiation of the samples that it sees.
  struct Radiation {
    double longwave_w_m2 = 0.0;
    double shortwave_w_m2 = 0.0;
    double frac = 0.0;
  };
  Radiation own;
  Radiation others;
  const bool apart = view.own_scale != view.others_scale || viewed.hidden_frac() > 0.0F;
  const bool some_left = sample.entity >= 0 && !step.views.empty();
  for (std::uint32_t k = 0; k < sample.seen_count; ++k) {
    const SeenSample& seen = step.all.seen[sample.first_seen + k];
    const SampleOutput& other = begin[seen.sample];
    const std::int32_t of_entity = step.all.samples[seen.sample].entity;
    Radiation& sum = apart && of_entity == sample.entity ? own : others;
    float weight_frac = seen.weight_frac;
    if (some_left && of_entity >= 0 && of_entity != sample.entity) {
      weight_frac *= 1.0F - interval_rays.stand(static_cast<std::size_t>(of_entity)).moved_frac;
    }
    sum.longwave_w_m2 += weight_frac * other.longwave_out_w_m2;
    sum.shortwave_w_m2 += weight_frac * other.shortwave_out_w_m2;
    sum.frac += weight_frac;
  }
  if (const float hidden_frac = viewed.hidden_frac(); hidden_frac > 0.0F) {
    const SideView::Met& before = viewed.before();
    others.longwave_w_m2 +=
        hidden_frac * (others.frac * before.longwave_w_m2 / before.frac - others.longwave_w_m2);
    others.shortwave_w_m2 +=
        hidden_frac * (others.frac * before.shortwave_w_m2 / before.frac - others.shortwave_w_m2);
  }
  drive.longwave_begin_w_m2 +=
      view.others_scale * others.longwave_w_m2 + view.own_scale * own.longwave_w_m2;
  drive.longwave_begin_w_m2 += viewed.longwave_w_m2();
  drive.shortwave_w_m2 = viewed.shortwave_w_m2() + view.others_scale * others.shortwave_w_m2 +
                         view.own_scale * own.shortwave_w_m2;
  // Let the start of the interval stand for all of it: neighbours change by hundredths of a kelvin.
  drive.longwave_end_w_m2 = drive.longwave_begin_w_m2;
  return drive;
}

}  // namespace

void step_sample(const SurfaceStep& step, const IntervalRays& interval_rays,
                 const HeatInterval& interval, const SurfaceBegin& begin, std::uint32_t index,
                 SteppedSample& stepped) noexcept {
  EMIT_DCHECK(steps_itself(step.all, index));
  const ViewedSample viewed(step, interval_rays, step.all.samples[index]);
  const SurfaceSample& sample = viewed.sample();
  const RayOffsets offsets = ray_offsets(sample.position_m, sample.facet_m);
  const auto sun_of = [&](const SurfaceSample& side) {
    return interval_rays.sun_share(step.rays, side, offsets.sun_m, 0.0F);
  };
  const SunShare sun = sun_of(sample);
  SampleDrive drive =
      drive_of(step, interval_rays, interval.entities, begin.outputs, viewed, offsets, sun);
  const glm::vec3 normal = interval_rays.normal(sample);
  BesideColumn beside;
  double twin_change_k = 0.0;
  if (sample.twin_of != kNoSample) {
    // Neighbours warm a twin as much as the sample itself.
    stepped.state.aside_k = begin.states[sample.twin_of].aside_k;
    const std::uint32_t column = step.all.samples[sample.twin_of].column;
    if (column != kNoSample && step.columns != nullptr) {
      twin_change_k = step.columns->expected_change_k(column);
    }
    drive.aside.change_k = twin_change_k;
  }
  if (sample.column != kNoSample) {
    const SampleColumn& column = step.all.columns[sample.column];
    drive.aside.column = &column;
    if (step.columns != nullptr) {
      drive.aside.equations = &step.columns->equations(sample.column);
      drive.aside.change_k = step.columns->expected_change_k(sample.column);
    } else {
      beside = step.heat.foster()->beside(step.all, column, begin.states);
      drive.aside.beside = &beside;
    }
  }
  const auto advance = [&](const SheetBack* back) {
    SampleAdvance one{&sample, normal, drive, &stepped.state, back, {}};
    step.heat.advance_all({&one, 1}, interval);
    stepped.output = one.output;
    // The drive of a sample is smooth while nothing changes suddenly: its steps between intervals
    // are those of the rays then. The shade of an entity comes at any time of the interval.
    const bool sudden = interval.after_weather && sun.frac == sun.fixed_frac;
    stepped.bow_k = sudden ? static_cast<float>(one.bow_k) : 0.0F;
  };
  if (sample.other_side == kNoSample) {
    advance(nullptr);
    stepped.output.offset_k += static_cast<float>(twin_change_k);
    // Show the sun that static geometry leaves, because frames have their own shade of entities.
    stepped.output.sun_frac = sun.fixed_frac;
    return;
  }
  // Advance a sheet by the mean of what both faces receive.
  const ViewedSample viewed_behind(step, interval_rays, step.all.samples[sample.other_side]);
  const SurfaceSample& behind = viewed_behind.sample();
  const SunShare sun_behind = sun_of(behind);
  const SampleDrive back_drive = drive_of(step, interval_rays, interval.entities, begin.outputs,
                                          viewed_behind, offsets, sun_behind);
  const SheetBack back{behind, back_drive};
  advance(&back);
  stepped.behind =
      step.heat.output(behind, -normal, interval.forcing.end, back_drive, stepped.state);
  stepped.output.sun_frac = sun.fixed_frac;
  stepped.behind.sun_frac = sun_behind.fixed_frac;
}

}  // namespace emit::renderer
