// SPDX-License-Identifier: Apache-2.0
#include "surface/run/surface_step.hpp"

#include <cstddef>
#include <optional>

#include "emit/physics/check.hpp"
#include "surface/heat/view_of_now.hpp"
#include "surface/rays/ray_offsets.hpp"

namespace emit::renderer {
namespace {

/// Sample with the view that it has in an interval. Only the samples of entities that have moved
/// since the warm-up are copied for it.
class ViewedSample {
 public:
  ViewedSample(const SurfaceStep& step, const IntervalRays& interval_rays,
               const SurfaceSample& sample) noexcept
      : sample_(&sample) {
    const EntityStand stand = sample.entity >= 0
                                  ? interval_rays.stand(static_cast<std::size_t>(sample.entity))
                                  : EntityStand{};
    view_ = view_of_now(step.all, sample, stand);
    if (stand.moved_frac == 0.0F) return;
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

 private:
  const SurfaceSample* sample_;
  ViewOfNow view_;
  std::optional<SurfaceSample> moved_;
};

/// Input of a sample over an interval. Other samples count with their output at its begin.
SampleDrive drive_of(const SurfaceStep& step, const IntervalRays& interval_rays,
                     const PartForcing& parts, std::span<const SampleOutput> begin,
                     const ViewedSample& viewed, const RayOffsets& offsets,
                     const SunShare& sun) noexcept {
  const SurfaceSample& sample = viewed.sample();
  const ViewOfNow& view = viewed.view();
  SampleDrive drive;
  drive.sun_frac = sun.frac;
  drive.take_part(parts, sample);
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
  // Add the radiation of the samples that it sees.
  struct Radiation {
    double longwave_w_m2 = 0.0;
    double shortwave_w_m2 = 0.0;
  };
  Radiation own;
  Radiation others;
  const bool apart = view.own_scale != view.others_scale;
  for (std::uint32_t k = 0; k < sample.seen_count; ++k) {
    const SeenSample& seen = step.all.seen[sample.first_seen + k];
    const SampleOutput& other = begin[seen.sample];
    Radiation& sum = apart && step.all.samples[seen.sample].entity == sample.entity ? own : others;
    sum.longwave_w_m2 += seen.weight_frac * other.longwave_out_w_m2;
    sum.shortwave_w_m2 += seen.weight_frac * other.shortwave_out_w_m2;
  }
  drive.longwave_begin_w_m2 +=
      view.others_scale * others.longwave_w_m2 + view.own_scale * own.longwave_w_m2;
  drive.shortwave_w_m2 =
      view.others_scale * others.shortwave_w_m2 + view.own_scale * own.shortwave_w_m2;
  // Let the start of the interval stand for all of it: neighbours change by hundredths of a kelvin.
  drive.longwave_end_w_m2 = drive.longwave_begin_w_m2;
  for (std::size_t p = 0; p < kMaxPartners; ++p) {
    const std::uint32_t partner = sample.partners[p].sample;
    if (partner == kNoSample) continue;
    drive.partner_begin_w_m2[p] = begin[partner].flux_w_m2;
    drive.partner_end_w_m2[p] = drive.partner_begin_w_m2[p];
  }
  return drive;
}

}  // namespace

void step_sample(const SurfaceStep& step, const IntervalRays& interval_rays,
                 const HeatInterval& interval, std::span<const SampleOutput> begin,
                 std::uint32_t index, SteppedSample& stepped) noexcept {
  EMIT_DCHECK(steps_itself(step.all, index));
  const ViewedSample viewed(step, interval_rays, step.all.samples[index]);
  const SurfaceSample& sample = viewed.sample();
  const RayOffsets offsets = ray_offsets(sample.position_m, sample.facet_m);
  const auto sun_of = [&](const SurfaceSample& side) {
    return interval_rays.sun_share(step.rays, side, offsets.sun_m, 0.0F);
  };
  const SunShare sun = sun_of(sample);
  const SampleDrive drive =
      drive_of(step, interval_rays, interval.parts, begin, viewed, offsets, sun);
  const glm::vec3 normal = interval_rays.normal(sample);
  if (sample.other_side == kNoSample) {
    stepped.output = step.heat.advance(sample, normal, interval, drive, stepped.state);
    // Show the sun that static geometry leaves, because frames have their own shade of entities.
    stepped.output.sun_frac = sun.fixed_frac;
    return;
  }
  // Advance a sheet by the mean of what both faces receive.
  const ViewedSample viewed_behind(step, interval_rays, step.all.samples[sample.other_side]);
  const SurfaceSample& behind = viewed_behind.sample();
  const SunShare sun_behind = sun_of(behind);
  const SampleDrive back_drive =
      drive_of(step, interval_rays, interval.parts, begin, viewed_behind, offsets, sun_behind);
  const SheetBack back{behind, back_drive};
  stepped.output = step.heat.advance(sample, normal, interval, drive, stepped.state, &back);
  stepped.behind =
      step.heat.output(behind, -normal, interval.forcing.end, back_drive, stepped.state);
  stepped.output.sun_frac = sun.fixed_frac;
  stepped.behind.sun_frac = sun_behind.fixed_frac;
}

}  // namespace emit::renderer
