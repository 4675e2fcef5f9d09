// SPDX-License-Identifier: Apache-2.0
#include "tool/support/frame_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <system_error>

#include "emit/image/png_image.hpp"
#include "emit/physics/check.hpp"
#include "emit/protocol/frame_header.hpp"

namespace emit::tool {

using physics::ErrorCode;
using physics::make_error;

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

std::string_view pixel_unit(protocol::PixelQuantity quantity) noexcept {
  switch (quantity) {
    case protocol::PixelQuantity::temperature_k:
      return "K";
    case protocol::PixelQuantity::drive:
      return "drive";
    case protocol::PixelQuantity::counts:
      return "counts";
    case protocol::PixelQuantity::photon_radiance:
      return "photons s-1 m-2 sr-1";
    default:
      return "W m-2 sr-1";
  }
}

std::span<const float>& plane_of(FramePlanes& planes, protocol::PixelQuantity quantity) noexcept {
  switch (quantity) {
    case protocol::PixelQuantity::temperature_k:
      return planes.temperature_k;
    case protocol::PixelQuantity::drive:
      return planes.drive;
    case protocol::PixelQuantity::counts:
      return planes.counts;
    case protocol::PixelQuantity::photon_radiance:
      return planes.photons;
    default:
      return planes.radiance_w_m2_sr;
  }
}

std::string output_text(std::uint16_t output_steps) {
  using namespace protocol;
  std::string out;
  const auto add = [&](bool so, const std::string& text) {
    if (so) out += (out.empty() ? "" : ", ") + text;
  };
  add((output_steps & kOutputMirroredHorizontally) != 0, "mirror horizontal");
  add((output_steps & kOutputMirroredVertically) != 0, "mirror vertical");
  const int rotate_deg = ((output_steps & kOutputRotated90) != 0 ? 90 : 0) +
                         ((output_steps & kOutputRotated180) != 0 ? 180 : 0);
  add(rotate_deg != 0, fmt::format("rotate {}", rotate_deg));
  add((output_steps & kOutputDistorted) != 0, "distortion");
  add((output_steps & kOutputShifted) != 0, "shift");
  add((output_steps & kOutputCorrected) != 0, "non-uniformity");
  add((output_steps & kOutputDriven) != 0, "drive table");
  add((output_steps & kOutputBlurred) != 0, "optics");
  add((output_steps & kOutputDetected) != 0, "detector");
  add((output_steps & kOutputCounted) != 0, "counts");
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
  add(image::kDriveChannel, frame.drive);
  add(image::kCountsChannel, frame.counts);
  add(image::kPhotonsChannel, frame.photons);
  add(image::kTemperatureChannel, frame.temperature_k);
  add(image::kDepthChannel, frame.depth_m);
  add(image::kObjectChannel, frame.object_id);
  add(image::kCoverageChannel, frame.coverage_frac);
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
  if (frame.output_steps != 0) {
    exr.attributes["outputSteps"] = output_text(frame.output_steps);
  }
  if ((frame.output_steps & protocol::kOutputShifted) != 0) {
    exr.attributes["appliedShiftXPx"] = double{frame.applied_shift_x_px};
    exr.attributes["appliedShiftYPx"] = double{frame.applied_shift_y_px};
  }
  image::set_frame_metadata(exr, frame.metadata);
  return image::write_exr(file, exr);
}

PngQuantity png_quantity(std::string_view text) noexcept {
  if (text == "temperature") return PngQuantity::temperature;
  if (text == "radiance") return PngQuantity::radiance;
  return PngQuantity::apparent;
}

namespace {

/// Values of a picture with what the colour bar says.
struct PngValues {
  std::vector<float> made;  ///< holds what `values` shows where the frame does not have it
  std::span<const float> values;
  std::string unit;
  double min_value = 0.0;
  double max_value = 1.0;
};

/// Returns values between their 1st and 99th percentile.
PngValues ranged_values(std::span<const float> values, const std::string& unit) {
  PngValues out;
  out.values = values;
  out.unit = unit;
  const auto range = image::percentile_range(out.values, 1.0, 99.0);
  out.min_value = range ? range->min_value : 0.0;
  out.max_value =
      range && range->max_value > range->min_value ? range->max_value : out.min_value + 1.0;
  return out;
}

physics::Result<PngValues> png_values(const FramePlanes& frame, const PngStyle& style) {
  if (!frame.drive.empty()) return ranged_values(frame.drive, "");
  if (!frame.counts.empty()) return ranged_values(frame.counts, "");
  if (!frame.photons.empty()) return ranged_values(frame.photons, "");
  PngValues out;
  out.unit = "K";
  out.min_value = style.min_k;
  out.max_value = style.max_k;
  if (style.quantity == PngQuantity::temperature || frame.radiance_w_m2_sr.empty()) {
    if (frame.temperature_k.empty() || style.quantity == PngQuantity::radiance) {
      return make_error(
          ErrorCode::invalid_argument,
          fmt::format(
              "the frame carries no {}, so that no picture shows it",
              style.quantity == PngQuantity::radiance ? "radiance" : "temperature of surfaces"));
    }
    out.values = frame.temperature_k;
    return out;
  }
  if (style.quantity == PngQuantity::radiance) return ranged_values(frame.radiance_w_m2_sr, "W");
  if (frame.apparent != nullptr) {
    out.made = frame.apparent->kelvin(frame.radiance_w_m2_sr);
  } else if (const auto band = spectral_band(frame.metadata)) {
    out.made = ApparentTemperature(*band).kelvin(frame.radiance_w_m2_sr);
  } else {
    return ranged_values(frame.radiance_w_m2_sr, "W");  // a canned frame of no band
  }
  out.values = out.made;
  return out;
}

std::string with_placeholder(std::string text, std::string_view place, const std::string& value) {
  for (std::size_t at = text.find(place); at != std::string::npos;
       at = text.find(place, at + value.size())) {
    text.replace(at, place.size(), value);
  }
  return text;
}

}  // namespace

physics::Result<void> write_frame_png(const std::filesystem::path& file, const FramePlanes& frame,
                                      const PngStyle& style) {
  const auto shown = png_values(frame, style);
  if (!shown) {
    return make_error(shown.error().code, fmt::format("{}: {}", file.string(), shown.error().text));
  }
  image::FalseColorOptions options;
  options.min_value = shown->min_value;
  options.max_value = shown->max_value;
  options.color_bar = true;
  options.unit = shown->unit;
  const auto picture = image::false_color(shown->values, frame.width_px, frame.height_px, options);
  if (!picture) return tl::unexpected(picture.error());
  return image::write_png(file, *picture);
}

physics::Result<void> write_frame_files(const std::filesystem::path& directory,
                                        const FramePlanes& frame, const PngStyle& style) {
  const auto stem = directory / fmt::format("frame_{:06}", frame.metadata.frame_number);
  if (auto written = write_frame_exr(stem.string() + ".exr", frame); !written) return written;
  return write_frame_png(stem.string() + ".png", frame, style);
}

std::filesystem::path FrameFileNames::file(double time_s, std::string_view band) const {
  constexpr std::string_view kTime = "{time}";
  constexpr std::string_view kBand = "{band}";
  // A slash in the name of a band makes no folder.
  std::string band_name(band);
  std::ranges::replace(band_name, '/', '_');
  const std::string time = fmt::format("{}", time_s);
  const std::string pattern = pattern_.string();
  std::string added;
  if (several_times_ && pattern.find(kTime) == std::string::npos) added += "_t" + time;
  if (several_bands_ && pattern.find(kBand) == std::string::npos) added += "_" + band_name;
  std::filesystem::path named = pattern_;
  if (!added.empty()) {
    named.replace_filename(pattern_.stem().string() + added + pattern_.extension().string());
  }
  return with_placeholder(with_placeholder(named.string(), kTime, time), kBand, band_name);
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
