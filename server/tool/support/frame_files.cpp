// SPDX-License-Identifier: Apache-2.0
#include "tool/support/frame_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <system_error>

#include "emit/image/png_image.hpp"
#include "emit/physics/check.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;

constexpr double kTableFromK = 150.0;
constexpr double kTableToK = 1500.0;
constexpr double kTableStepK = 0.05;

}  // namespace

physics::Band spectral_band(const scene::SpectralBand& band) {
  return {band.lo_um, band.hi_um, response_of(band)};
}

std::vector<physics::ResponsePoint> response_of(const scene::SpectralBand& band) {
  std::vector<physics::ResponsePoint> out;
  for (const scene::ResponseSample& sample : band.response) {
    out.push_back({sample.wavelength_um, sample.response_frac});
  }
  return out;
}

std::optional<physics::Band> spectral_band(const image::FrameMetadata& metadata) {
  physics::Band band{metadata.band_lo_um, metadata.band_hi_um,
                     metadata.band_response.value_or(std::vector<physics::ResponsePoint>())};
  if (!physics::validate(band)) return std::nullopt;
  return band;
}

std::string conversion_text(const physics::Band& band, bool response_known) {
  const std::string limits = fmt::format("band {:g}-{:g} um", band.lo_um, band.hi_um);
  if (!band.response.empty()) {
    return fmt::format("{} by its response of {} points", limits, band.response.size());
  }
  return limits + (response_known ? ", a rectangle" : ", response not known: a rectangle assumed");
}

ApparentTemperature::ApparentTemperature(double lo_um, double hi_um)
    : ApparentTemperature(physics::Band{lo_um, hi_um, {}}) {}

ApparentTemperature::ApparentTemperature(const physics::Band& band) {
  EMIT_CHECK(physics::validate(band).has_value());
  // The table is exact every 2 K. In between ln L is linear in 1/T, with an error below 1 mK in the
  // thermal bands.
  constexpr double kAnchorK = 2.0;
  const auto count = static_cast<std::size_t>((kTableToK - kTableFromK) / kTableStepK) + 1;
  radiance_.reserve(count);
  double anchor_k = kTableFromK;
  double log_low = physics::band_radiance(band, physics::Kelvin{anchor_k}).log_radiance;
  double log_high = physics::band_radiance(band, physics::Kelvin{anchor_k + kAnchorK}).log_radiance;
  for (std::size_t i = 0; i < count; ++i) {
    const double t_k = kTableFromK + kTableStepK * static_cast<double>(i);
    while (t_k > anchor_k + kAnchorK) {
      anchor_k += kAnchorK;
      log_low = log_high;
      log_high = physics::band_radiance(band, physics::Kelvin{anchor_k + kAnchorK}).log_radiance;
    }
    const double fraction =
        (1.0 / anchor_k - 1.0 / t_k) / (1.0 / anchor_k - 1.0 / (anchor_k + kAnchorK));
    radiance_.push_back(std::exp(log_low + (log_high - log_low) * fraction));
  }
}

std::size_t ApparentTemperature::interval(double radiance_w_m2_sr) const noexcept {
  const auto above = std::upper_bound(radiance_.begin(), radiance_.end(), radiance_w_m2_sr);
  const auto index = above - radiance_.begin();
  return static_cast<std::size_t>(
      std::clamp<std::ptrdiff_t>(index, 1, static_cast<std::ptrdiff_t>(radiance_.size()) - 1) - 1);
}

double ApparentTemperature::kelvin(double radiance_w_m2_sr) const noexcept {
  if (std::isnan(radiance_w_m2_sr)) return std::numeric_limits<double>::quiet_NaN();
  const std::size_t i = interval(radiance_w_m2_sr);
  const double fraction = (radiance_w_m2_sr - radiance_[i]) / (radiance_[i + 1] - radiance_[i]);
  return kTableFromK + kTableStepK * (static_cast<double>(i) + std::clamp(fraction, 0.0, 1.0));
}

double ApparentTemperature::kelvin_per_radiance(double radiance_w_m2_sr) const noexcept {
  const std::size_t i = interval(radiance_w_m2_sr);
  return kTableStepK / (radiance_[i + 1] - radiance_[i]);
}

std::vector<float> ApparentTemperature::kelvin(std::span<const float> radiance_w_m2_sr) const {
  std::vector<float> out(radiance_w_m2_sr.size());
  std::transform(
      radiance_w_m2_sr.begin(), radiance_w_m2_sr.end(), out.begin(),
      [this](float value) { return static_cast<float>(kelvin(static_cast<double>(value))); });
  return out;
}

physics::Result<void> write_frame_exr(const std::filesystem::path& file, const FramePlanes& frame) {
  image::ExrImage exr;
  exr.width_px = frame.width_px;
  exr.height_px = frame.height_px;
  const auto add = [&exr](const char* name, std::span<const float> plane) {
    if (!plane.empty()) exr.add(name, plane);
  };
  add(image::kRadianceChannel, frame.radiance_w_m2_sr);
  add(image::kTemperatureChannel, frame.temperature_k);
  add(image::kDepthChannel, frame.depth_m);
  add(image::kObjectChannel, frame.object_id);
  add(image::kValidChannel, frame.valid);
  if (!frame.valid.empty()) {
    exr.attributes["missingPx"] =
        std::to_string(std::count(frame.valid.begin(), frame.valid.end(), 0.0F));
  }
  if (frame.sensor_width_px > frame.width_px || frame.sensor_height_px > frame.height_px) {
    exr.attributes["windowXPx"] = std::to_string(frame.window_px.x_px);
    exr.attributes["windowYPx"] = std::to_string(frame.window_px.y_px);
    exr.attributes["sensorWidthPx"] = std::to_string(frame.sensor_width_px);
    exr.attributes["sensorHeightPx"] = std::to_string(frame.sensor_height_px);
  }
  image::set_frame_metadata(exr, frame.metadata);
  return image::write_exr(file, exr);
}

physics::Result<void> write_frame_png(const std::filesystem::path& file, const FramePlanes& frame,
                                      const ColorLimits& limits) {
  image::FalseColorOptions options;
  options.min_value = limits.min_k;
  options.max_value = limits.max_k;
  options.color_bar = true;
  options.unit = "K";
  std::vector<float> apparent;
  std::span<const float> values = frame.temperature_k;
  if (values.empty()) {
    if (frame.apparent != nullptr) {
      apparent = frame.apparent->kelvin(frame.radiance_w_m2_sr);
      values = apparent;
    } else if (const auto band = spectral_band(frame.metadata)) {
      apparent = ApparentTemperature(*band).kelvin(frame.radiance_w_m2_sr);
      values = apparent;
    } else {
      // A canned image of no band is scaled by its own range of radiance.
      values = frame.radiance_w_m2_sr;
      options.unit.assign(1, 'W');
      const auto range = image::percentile_range(values, 1.0, 99.0);
      options.min_value = range ? range->min_value : 0.0;
      options.max_value =
          range && range->max_value > range->min_value ? range->max_value : options.min_value + 1.0;
    }
  }
  const auto picture = image::false_color(values, frame.width_px, frame.height_px, options);
  if (!picture) return tl::unexpected(picture.error());
  return image::write_png(file, *picture);
}

physics::Result<void> write_frame_files(const std::filesystem::path& directory,
                                        const FramePlanes& frame, const ColorLimits& limits) {
  const auto stem = directory / fmt::format("frame_{:06}", frame.metadata.frame_number);
  if (auto written = write_frame_exr(stem.string() + ".exr", frame); !written) return written;
  return write_frame_png(stem.string() + ".png", frame, limits);
}

physics::Result<void> make_directory(const std::filesystem::path& directory) {
  std::error_code error;
  std::filesystem::create_directories(directory, error);
  if (error) {
    return make_error(ErrorCode::io, fmt::format("{}: cannot create the folder: {}",
                                                 directory.string(), error.message()));
  }
  return {};
}

}  // namespace emit::tool
