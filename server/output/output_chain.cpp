// SPDX-License-Identifier: Apache-2.0
#include "output/output_chain.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "emit/physics/check.hpp"
#include "output/window_margin.hpp"

namespace emit::server {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;
using protocol::ImagePoint;
using protocol::ImageSize;

namespace {

/// Rows that pass through all steps together, so that they stay in the cache. A picture that was
/// turned by 90 degrees reads as many neighbours of a row in memory.
constexpr std::uint32_t kRowsAtOnce = 16;
/// Range of apparent temperatures; pixels beyond are counted as clamped.
constexpr double kApparentFromK = 150.0;
constexpr double kApparentToK = 3000.0;

/// Returns whether a detector changes radiance before its converter.
bool detects(const scene::ChannelDetector& detector) noexcept {
  return std::ranges::any_of(
      std::array{detector.netd_k, detector.row_noise_k, detector.column_noise_k,
                 detector.gain_spread_frac, detector.offset_spread_k, detector.bad_px_frac},
      [](double setting) { return setting > 0.0; });
}

std::uint16_t steps_of(const scene::ChannelOutput& settings) noexcept {
  using protocol::OutputSteps;
  using scene::PictureMirror;
  const auto if_so = [](bool so, OutputSteps step) {
    return so ? static_cast<std::uint16_t>(step) : std::uint16_t{0};
  };
  const PictureMirror mirror = settings.mirror;
  const bool both = mirror == PictureMirror::both;
  const bool distorted = !settings.distortion_file.empty() || settings.has_polynomial();
  return static_cast<std::uint16_t>(
      if_so(both || mirror == PictureMirror::horizontal, protocol::kOutputMirroredHorizontally) |
      if_so(both || mirror == PictureMirror::vertical, protocol::kOutputMirroredVertically) |
      if_so(settings.rotate_deg % 180 == 90, protocol::kOutputRotated90) |
      if_so(settings.rotate_deg >= 180, protocol::kOutputRotated180) |
      if_so(distorted, protocol::kOutputDistorted) |
      if_so(settings.apply_shift, protocol::kOutputShifted) |
      if_so(!settings.nuc_file.empty(), protocol::kOutputCorrected) |
      if_so(!settings.drive_table_file.empty(), protocol::kOutputDriven) |
      if_so(settings.optics != scene::ChannelOptics{}, protocol::kOutputBlurred) |
      if_so(detects(settings.detector), protocol::kOutputDetected) |
      if_so(settings.detector.counts_per_w_m2_sr > 0.0, protocol::kOutputCounted));
}

Result<PositionMap::Source> positions_of(const scene::ChannelOutput& settings,
                                         const ImageSize& picture, double focal_px) {
  if (!settings.distortion_file.empty()) {
    auto read = PositionMap::read(settings.distortion_file, picture);
    if (!read) return tl::unexpected(std::move(read.error()).with_context("distortion_file"));
    return read;
  }
  if (!settings.has_polynomial()) return PositionMap::identity(picture);
  if (!(focal_px > 0.0)) {
    return make_error(ErrorCode::config,
                      "a distortion polynomial needs the sensor's field of view");
  }
  return PositionMap::brown(picture, focal_px, settings.distortion_radial,
                            settings.distortion_tangential);
}

/// Returns the share of the irradiance on the axis that each pixel of a frame gets: the fourth
/// power of the cosine of the angle of what it shows. `source` has the place of that in the turned
/// picture. Pixels that show nothing keep all.
std::vector<float> vignetting_of(std::uint16_t steps, const PositionMap::Source& source,
                                 const OutputChain::Origin& origin) {
  const ImageSize window{origin.window_px.width_px, origin.window_px.height_px};
  std::vector<float> out;
  out.reserve(source.points.size());
  for (const ImagePoint& point : source.points) {
    const ImagePoint at = protocol::window_point(steps, window, point);
    const double x = origin.window_px.x_px + at.x_px - 0.5 * origin.image.width_px;
    const double y = origin.window_px.y_px + at.y_px - 0.5 * origin.image.height_px;
    const double cos2 = 1.0 / (1.0 + (x * x + y * y) / (origin.focal_px * origin.focal_px));
    out.push_back(std::isfinite(cos2) ? static_cast<float>(cos2 * cos2) : 1.0F);
  }
  return out;
}

}  // namespace

Result<OutputChain> OutputChain::make(const scene::ChannelOutput& settings, const Origin& origin) {
  const scene::PixelRect& window_px = origin.window_px;
  const ImageSize window{window_px.width_px, window_px.height_px};
  OutputChain out;
  out.steps_ = steps_of(settings);
  out.source_px_ = window_px;
  out.frame_ = protocol::turned_size(out.steps_, window);
  if ((out.steps_ & (protocol::kOutputDistorted | protocol::kOutputShifted)) != 0) {
    out.source_px_ =
        grown(window_px, settings.apply_shift ? kShiftMarginPx : kSampleMarginPx, origin.image);
    const SampledPart part{
        std::size_t{out.source_px_.y_px} * origin.image.width_px + out.source_px_.x_px,
        origin.image.width_px,
        {out.source_px_.width_px, out.source_px_.height_px}};
    auto source = positions_of(settings, out.frame_, origin.focal_px);
    if (!source) return tl::unexpected(std::move(source.error()));
    const ImagePoint window_at{static_cast<double>(window_px.x_px - out.source_px_.x_px),
                               static_cast<double>(window_px.y_px - out.source_px_.y_px)};
    out.room_before_px_ = {static_cast<float>(window_at.x_px), static_cast<float>(window_at.y_px)};
    out.room_behind_px_ =
        glm::vec2(static_cast<float>(out.source_px_.width_px - window_px.width_px),
                  static_cast<float>(out.source_px_.height_px - window_px.height_px)) -
        out.room_before_px_;
    out.map_.emplace(*source, out.steps_, window, window_at, part,
                     static_cast<float>(settings.outside_w_m2_sr));
    out.frame_ = out.map_->frame();
    if (out.map_->outside_px() == source->points.size()) {
      return make_error(ErrorCode::config, "the distortion polynomial points nowhere");
    }
  } else {
    const auto index_of = [&](double x_px, double y_px) {
      const ImagePoint at = protocol::window_point(out.steps_, window, {x_px + 0.5, y_px + 0.5});
      return (static_cast<std::ptrdiff_t>(std::floor(at.y_px)) + window_px.y_px) *
                 static_cast<std::ptrdiff_t>(origin.image.width_px) +
             static_cast<std::ptrdiff_t>(std::floor(at.x_px)) + window_px.x_px;
    };
    out.turn_first_ = index_of(0, 0);
    out.turn_right_ = index_of(1, 0) - out.turn_first_;
    out.turn_down_ = index_of(0, 1) - out.turn_first_;
  }
  if (settings.optics.spot != scene::SpotKind::none) {
    auto spot = make_spot(settings.optics);
    if (!spot) return tl::unexpected(std::move(spot.error()).with_context("optics.spot_file"));
    out.spot_.emplace(*spot, out.source_px_, origin.image);
  }
  if (settings.optics.vignetting) {
    if (!(origin.focal_px > 0.0)) {
      return make_error(ErrorCode::config, "vignetting needs the sensor's field of view");
    }
    const auto source =
        positions_of(settings, protocol::turned_size(out.steps_, window), origin.focal_px);
    if (!source) return tl::unexpected(source.error());
    out.vignetting_frac_ = vignetting_of(out.steps_, *source, origin);
  }
  if ((out.steps_ & (protocol::kOutputDetected | protocol::kOutputCounted)) != 0) {
    std::optional<physics::Band> band;
    if (origin.band) band = scene::spectral_band(*origin.band);
    auto detector = Detector::make(settings.detector, band, out.frame_);
    if (!detector) return tl::unexpected(std::move(detector.error()));
    out.detector_ = std::move(*detector);
  }
  if (!settings.nuc_file.empty()) {
    auto gain = PixelGain::read(settings.nuc_file, out.frame_);
    if (!gain) return tl::unexpected(std::move(gain.error()).with_context("nuc_file"));
    out.gain_ = std::move(*gain);
  }
  if (!settings.drive_table_file.empty()) {
    auto table = DriveTable::read(settings.drive_table_file);
    if (!table) return tl::unexpected(std::move(table.error()).with_context("drive_table_file"));
    out.table_ = std::move(*table);
  }
  if (auto chosen = out.choose_quantity(settings, origin); !chosen) {
    return tl::unexpected(std::move(chosen.error()));
  }
  return out;
}

Result<void> OutputChain::choose_quantity(const scene::ChannelOutput& settings,
                                          const Origin& origin) {
  using protocol::PixelQuantity;
  if ((steps_ & protocol::kOutputCounted) != 0) {
    quantity_ = PixelQuantity::counts;
  } else if ((steps_ & (protocol::kOutputCorrected | protocol::kOutputDriven)) != 0) {
    quantity_ = PixelQuantity::drive;
  }
  if (settings.quantity == scene::PictureQuantity::radiance) return {};
  if (!origin.band) {
    return make_error(ErrorCode::config, "another quantity than radiance needs a scenario's band");
  }
  if (settings.quantity == scene::PictureQuantity::photon_radiance) {
    quantity_ = PixelQuantity::photon_radiance;
    photons_per_joule_ = static_cast<float>(scene::photons_per_joule(*origin.band));
    return {};
  }
  quantity_ = PixelQuantity::temperature_k;
  const physics::Band band = scene::spectral_band(*origin.band);
  apparent_.emplace(band);
  const auto radiance_at = [&](double kelvin) {
    return static_cast<float>(
        physics::band_radiance(band, physics::Kelvin(kelvin)).radiance_w_m2_sr);
  };
  apparent_from_w_m2_sr_ = radiance_at(kApparentFromK);
  apparent_to_w_m2_sr_ = radiance_at(kApparentToK);
  return {};
}

std::uint32_t OutputChain::convert_line(std::span<float> line) const noexcept {
  if (quantity_ == protocol::PixelQuantity::photon_radiance) {
    for (float& value : line) value *= photons_per_joule_;
    return 0;
  }
  if (!apparent_) return 0;
  std::uint32_t beyond = 0;
  for (float& value : line) {
    beyond += value >= apparent_from_w_m2_sr_ && value <= apparent_to_w_m2_sr_ ? 0U : 1U;
    value = apparent_->k(value);
  }
  return beyond;
}

void OutputChain::turn_rows(std::span<const float> image, std::uint32_t first, std::uint32_t end,
                            std::span<float> out) const noexcept {
  const float* const source = image.data() + turn_first_;
  const std::size_t width = frame_.width_px;
  if (!protocol::exchanges_sides(steps_)) {
    for (std::size_t row = first; row < end; ++row) {
      const float* from = source + static_cast<std::ptrdiff_t>(row) * turn_down_;
      float* const line = out.data() + row * width;
      if (turn_right_ == 1) {
        std::copy_n(from, width, line);
      } else {
        std::reverse_copy(from - (width - 1), from + 1, line);
      }
    }
    return;
  }
  // Neighbours in a column of the frame are neighbours in memory.
  for (std::size_t column = 0; column < width; ++column) {
    const float* from = source + static_cast<std::ptrdiff_t>(column) * turn_right_ +
                        static_cast<std::ptrdiff_t>(first) * turn_down_;
    for (std::size_t row = first; row < end; ++row, from += turn_down_) {
      out[row * width + column] = *from;
    }
  }
}

bool OutputChain::cuts(const Moment& moment) const noexcept {
  if ((steps_ & protocol::kOutputShifted) == 0) return false;
  // The centre of an edge pixel may lie half a pixel beyond the middle of the last one.
  const glm::vec2& shift_px = moment.shift_px;
  return shift_px.x > room_before_px_.x + 0.5F || shift_px.y > room_before_px_.y + 0.5F ||
         -shift_px.x > room_behind_px_.x + 0.5F || -shift_px.y > room_behind_px_.y + 0.5F;
}

std::uint32_t OutputChain::apply(std::span<const float> image, const Moment& moment,
                                 std::span<float> out) noexcept {
  const std::size_t width = frame_.width_px;
  EMIT_DCHECK_OP(out.size(), ==, width * frame_.height_px);
  const glm::vec2 moved_px =
      (steps_ & protocol::kOutputShifted) != 0 ? moment.shift_px : glm::vec2(0.0F);
  if (spot_) image = spot_->apply(image);
  if (detector_) detector_->begin_frame(moment.frame_number);
  std::uint32_t clamped = 0;
  for (std::uint32_t first = 0; first < frame_.height_px; first += kRowsAtOnce) {
    const std::uint32_t end = std::min(first + kRowsAtOnce, frame_.height_px);
    if (!map_) turn_rows(image, first, end, out);
    for (std::uint32_t row = first; row < end; ++row) {
      const std::span<float> line = out.subspan(row * width, width);
      if (map_) map_->sample_line(image, moved_px, row, line);
      if (!vignetting_frac_.empty()) {
        const float* const share_frac = vignetting_frac_.data() + row * width;
        for (std::size_t i = 0; i < width; ++i) line[i] *= share_frac[i];
      }
      if (detector_) clamped += detector_->apply_line(row, line);
      if (gain_) gain_->apply_line(row, line);
      if (table_) clamped += table_->apply(line);
      clamped += convert_line(line);
    }
  }
  return clamped;
}

}  // namespace emit::server
