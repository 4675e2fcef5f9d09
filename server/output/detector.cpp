// SPDX-License-Identifier: Apache-2.0
#include "output/detector.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"
#include "output/noise.hpp"

namespace emit::server {
namespace {

/// Temporal noise: its variance is that before the reference, of which a share grows with radiance.
struct Noise {
  float sigma = 0.0F;
  float still_frac = 1.0F;
  float by_radiance = 0.0F;  ///< per W m-2 sr-1
};

void add_noise(const Noise& noise, std::span<const float> normals, std::span<float> line) noexcept {
  if (noise.by_radiance == 0.0F) {
    for (std::size_t i = 0; i < line.size(); ++i) line[i] += noise.sigma * normals[i];
    return;
  }
  for (std::size_t i = 0; i < line.size(); ++i) {
    const float seen = line[i] > 0.0F ? line[i] : 0.0F;
    const float share = noise.still_frac + noise.by_radiance * seen;
    line[i] += noise.sigma * std::sqrt(share) * normals[i];
  }
}

}  // namespace

physics::Result<Detector> Detector::make(const scene::ChannelDetector& settings,
                                         const std::optional<physics::Band>& band,
                                         const protocol::ImageSize& frame) {
  Detector out;
  out.settings_ = settings;
  out.frame_ = frame;
  if (settings.bad_px_frac > 0.0 && !(settings.counts_per_w_m2_sr > 0.0)) {
    return physics::make_error(
        physics::ErrorCode::config,
        "detector.bad_px_frac needs detector.counts_per_w_m2_sr: a hot pixel "
        "reads full scale");
  }
  const bool in_kelvin = settings.netd_k > 0.0 || settings.row_noise_k > 0.0 ||
                         settings.column_noise_k > 0.0 || settings.offset_spread_k > 0.0;
  physics::BandRadiance reference;
  if (band) reference = physics::band_radiance(*band, physics::Kelvin(settings.reference_k));
  if (in_kelvin && !(std::isnormal(static_cast<float>(reference.derivative_w_m2_sr_k)) &&
                     std::isnormal(static_cast<float>(reference.radiance_w_m2_sr)))) {
    return physics::make_error(
        physics::ErrorCode::config,
        band ? fmt::format(
                   "detector.reference_k is {}: a blackbody of it has next to no radiance in the "
                   "band, so noise in kelvin is not defined",
                   settings.reference_k)
             : "detector noise in kelvin needs the band of a scenario");
  }
  const auto to_radiance = [&](double kelvin) {
    return static_cast<float>(kelvin * reference.derivative_w_m2_sr_k);
  };
  out.reference_w_m2_sr_ = static_cast<float>(reference.radiance_w_m2_sr);
  out.noise_w_m2_sr_ = to_radiance(settings.netd_k);
  out.row_w_m2_sr_ = to_radiance(settings.row_noise_k);
  out.column_w_m2_sr_ = to_radiance(settings.column_noise_k);
  // Draw the fixed pattern.
  const std::size_t width = frame.width_px;
  const std::size_t pixels = width * frame.height_px;
  if (settings.gain_spread_frac > 0.0 || settings.offset_spread_k > 0.0) {
    out.gain_.resize(pixels);
    out.offset_w_m2_sr_.resize(pixels);
    const float offset = to_radiance(settings.offset_spread_k);
    for (std::uint32_t row = 0; row < frame.height_px; ++row) {
      const auto gains = std::span(out.gain_).subspan(row * width, width);
      const auto offsets = std::span(out.offset_w_m2_sr_).subspan(row * width, width);
      normal_row({settings.seed, NoiseStream::pixel_gain, 0, row}, gains);
      normal_row({settings.seed, NoiseStream::pixel_offset, 0, row}, offsets);
      for (float& gain : gains) {
        gain = 1.0F + static_cast<float>(settings.gain_spread_frac) * gain;
      }
      for (float& value : offsets) value *= offset;
    }
  }
  out.first_bad_.assign(frame.height_px + 1, 0);
  if (settings.bad_px_frac > 0.0) {
    const double limit = settings.bad_px_frac * 0x1p32;
    for (std::uint32_t row = 0; row < frame.height_px; ++row) {
      out.first_bad_[row] = static_cast<std::uint32_t>(out.bad_.size());
      for (std::uint32_t column = 0; column < frame.width_px; ++column) {
        const auto words =
            philox({column, row, 0, 0},
                   {settings.seed, static_cast<std::uint32_t>(NoiseStream::bad_pixels)});
        if (words[0] < limit) out.bad_.push_back({row, column, (words[1] & 1U) != 0});
      }
    }
    out.first_bad_.back() = static_cast<std::uint32_t>(out.bad_.size());
  }
  if (settings.row_noise_k > 0.0) out.row_drift_w_m2_sr_.resize(frame.height_px);
  if (settings.column_noise_k > 0.0) out.column_drift_w_m2_sr_.resize(width);
  out.normals_.resize(width);
  return out;
}

void Detector::begin_frame(std::uint64_t frame_number) noexcept {
  frame_number_ = frame_number;
  const auto drift = [&](NoiseStream stream, float scale_w_m2_sr, std::span<float> out) {
    for (std::uint32_t i = 0; i < out.size(); ++i) {
      out[i] = scale_w_m2_sr * drift_at({settings_.seed, stream, frame_number, i});
    }
  };
  drift(NoiseStream::row_drift, row_w_m2_sr_, row_drift_w_m2_sr_);
  drift(NoiseStream::column_drift, column_w_m2_sr_, column_drift_w_m2_sr_);
}

std::uint32_t Detector::apply_line(std::uint32_t row, std::span<float> line) noexcept {
  EMIT_DCHECK_OP(line.size(), ==, std::size_t{frame_.width_px});
  // Add temporal noise to the radiance that arrives.
  if (noise_w_m2_sr_ > 0.0F) {
    normal_row({settings_.seed, NoiseStream::temporal, frame_number_, row}, normals_);
    const auto photon = static_cast<float>(settings_.photon_frac);
    add_noise({noise_w_m2_sr_, 1.0F - photon, photon / reference_w_m2_sr_}, normals_, line);
  }
  // Put the fixed pattern and the drift of the read-out on top.
  if (!gain_.empty()) {
    const float* const gain = gain_.data() + std::size_t{row} * line.size();
    const float* const offset = offset_w_m2_sr_.data() + std::size_t{row} * line.size();
    for (std::size_t i = 0; i < line.size(); ++i) line[i] = gain[i] * line[i] + offset[i];
  }
  if (!row_drift_w_m2_sr_.empty()) {
    for (float& value : line) value += row_drift_w_m2_sr_[row];
  }
  if (!column_drift_w_m2_sr_.empty()) {
    for (std::size_t i = 0; i < line.size(); ++i) line[i] += column_drift_w_m2_sr_[i];
  }
  const auto bad = std::span(bad_).subspan(first_bad_[row], first_bad_[row + 1] - first_bad_[row]);
  // Convert to counts.
  if (!(settings_.counts_per_w_m2_sr > 0.0)) return 0;
  const auto scale = static_cast<float>(settings_.counts_per_w_m2_sr);
  const auto offset = static_cast<float>(settings_.counts_offset);
  const auto most = static_cast<float>((std::uint32_t{1} << settings_.counts_bits) - 1);
  std::uint32_t clamped = 0;
  for (float& value : line) {
    const float counts = offset + scale * value;
    clamped += counts >= -0.5F && counts < most + 0.5F ? 0 : 1;
    const float kept = counts > 0.0F ? counts : 0.0F;
    // Full scale is at most 2^16 - 1, so that adding a half and cutting rounds exactly.
    value = static_cast<float>(static_cast<std::int32_t>((kept < most ? kept : most) + 0.5F));
  }
  for (const BadPixel& pixel : bad) line[pixel.column] = pixel.hot ? most : 0.0F;
  return clamped;
}

}  // namespace emit::server
