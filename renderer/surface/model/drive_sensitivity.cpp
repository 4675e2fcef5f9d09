// SPDX-License-Identifier: Apache-2.0
#include "surface/model/drive_sensitivity.hpp"

namespace emit::renderer {

DriveSensitivity::DriveSensitivity(const SurfaceInputs& inputs) : intervals_(inputs.record.size()) {
  constexpr float kHalf = 0.5F;   ///< share of sun and sky around which the difference is taken
  constexpr float kMore = 0.25F;  ///< step of the difference
  const HistoryRecord& record = inputs.record;
  // Integrate the whole record with one share of the sun in `interval` and half of the sun in all
  // others. An `interval` past the end changes none.
  const auto offset_k = [&](const SurfaceSample& sample, std::size_t interval, float sun_frac) {
    SampleState state = inputs.heat.open_start(sample, sample.normal, inputs.history, record.tail);
    SampleOutput output;
    for (std::size_t k = 0; k < intervals_; ++k) {
      SampleDrive drive;
      drive.sun_frac = k == interval ? sun_frac : kHalf;
      output = inputs.heat.advance(sample, sample.normal, record.intervals[k], drive, state);
    }
    return output.offset_k;
  };
  // Take the difference for every material and interval, on a face that looks to the sun of that
  // interval.
  sun_k_.assign(inputs.materials.size() * intervals_, 0.0F);
  for (std::uint32_t m = 0; m < inputs.materials.size(); ++m) {
    SurfaceSample sample;
    sample.material = m;
    sample.sky_frac = kHalf;
    sample.far_frac = kHalf;
    for (std::size_t i = 0; i < intervals_; ++i) {
      if (!record.rays[i].sun_up()) continue;
      sample.normal = record.rays[i].to_sun();
      sun_k_[m * intervals_ + i] =
          (offset_k(sample, i, kHalf + kMore) - offset_k(sample, i, kHalf)) / kMore;
    }
    // Take the difference for the sky with a fixed normal. A quarter of the hemisphere goes from
    // the surroundings to the sky; it is an eighth of the full sphere.
    sample.normal = {1.0F, 0.0F, 0.0F};
    // Halve the sensitivity of a sheet: the sun on one face is half of what drives it.
    if (inputs.materials[m].sheet) {
      for (std::size_t i = 0; i < intervals_; ++i) sun_k_[m * intervals_ + i] *= kHalf;
    }
    const float before_k = offset_k(sample, intervals_, 0.0F);
    sample.sky_frac += kMore;
    sample.far_frac -= kMore;
    sample.sphere_sky_frac += kHalf * kMore;
    sky_k_.push_back((offset_k(sample, intervals_, 0.0F) - before_k) / kMore);
  }
}

}  // namespace emit::renderer
