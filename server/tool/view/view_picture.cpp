// SPDX-License-Identifier: Apache-2.0
#include "tool/view/view_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <limits>

namespace emit::tool::view {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::array<const char*, kOverlays> kNames{"picture", "materials", "samples",
                                                    "sun",     "sky",       "error"};
constexpr image::Rgb kSampleInk{0, 235, 215};

void set_pixel(image::RgbImage& picture, std::size_t x, std::size_t y, const image::Rgb& color) {
  std::copy(color.begin(), color.end(),
            picture.rgb.begin() + static_cast<std::ptrdiff_t>(3 * (y * picture.width_px + x)));
}

const std::vector<float>& quantity_of(const ViewFrame& frame, bool show_radiance) {
  return show_radiance ? frame.radiance_w_m2_sr : frame.temperature_k;
}

/// Replaces the colours of all surfaces by those of their materials.
void paint_materials(const ViewFrame& frame, const PictureOptions& options,
                     image::RgbImage& picture) {
  const std::vector<float>& values = quantity_of(frame, options.show_radiance);
  for (std::size_t i = 0; i < frame.material.size(); ++i) {
    if (std::isnan(frame.sky_frac[i])) continue;
    const double frac =
        (static_cast<double>(values[i]) - options.low) / (options.high - options.low);
    set_pixel(picture, i % frame.width_px, i / frame.width_px,
              material_color(static_cast<std::size_t>(frame.material[i]),
                             std::isnan(frac) ? 0.0 : std::clamp(frac, 0.0, 1.0)));
  }
}

bool same_view(const ViewFrame& frame, const image::FrameMetadata& reference) {
  constexpr std::int64_t kSameNs = 1'000'000;
  constexpr double kSameM = 1e-3;
  constexpr double kSameRad = 1e-5;
  const physics::Pose& a = frame.sensor_pose;
  const physics::Pose& b = reference.sensor_pose;
  const double cosine = std::abs(glm::dot(a.world_from_body, b.world_from_body));
  return std::abs(frame.sim_time_ns - reference.sim_time_ns) <= kSameNs &&
         glm::distance(a.position_world_m, b.position_world_m) <= kSameM &&
         2.0 * std::acos(std::min(1.0, cosine)) <= kSameRad;
}

}  // namespace

const char* name_of(Overlay overlay) noexcept {
  return kNames[static_cast<std::size_t>(overlay)];
}

std::optional<Overlay> overlay_of(std::string_view name) noexcept {
  const auto found = std::ranges::find(kNames, name);
  if (found == kNames.end()) return std::nullopt;
  return static_cast<Overlay>(found - kNames.begin());
}

Result<ReferencePicture> read_reference(const std::filesystem::path& file,
                                        const std::string& band) {
  auto exr = image::read_exr(file);
  if (!exr) return tl::unexpected(std::move(exr.error()));
  ReferencePicture out{exr->width_px, exr->height_px, {}, {}, {}};
  if (const auto* found = exr->find(image::kTemperatureChannel)) out.temperature_k = found->pixels;
  if (auto metadata = image::frame_metadata(*exr)) out.metadata = std::move(*metadata);
  // A file of several bands names the band of each radiance behind a dot.
  const bool is_of_band = band.empty() || !out.metadata || out.metadata->band_name.empty() ||
                          out.metadata->band_name == band;
  const auto* radiance = exr->find(fmt::format("{}.{}", image::kRadianceChannel, band));
  if (radiance == nullptr && is_of_band) radiance = exr->find(image::kRadianceChannel);
  if (radiance != nullptr) out.radiance_w_m2_sr = radiance->pixels;
  if (!out.temperature_k.empty() || !out.radiance_w_m2_sr.empty()) return out;
  return make_error(ErrorCode::invalid_argument,
                    fmt::format("{}: there is neither a channel '{}' nor a radiance of band '{}'",
                                file.string(), image::kTemperatureChannel, band));
}

Result<PictureError> picture_error(const ViewFrame& frame, const ReferencePicture& reference,
                                   bool show_radiance) {
  if (frame.width_px != reference.width_px || frame.height_px != reference.height_px) {
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format("the reference has {}x{} pixels, the view {}x{}", reference.width_px,
                    reference.height_px, frame.width_px, frame.height_px));
  }
  const std::vector<float>& truth =
      show_radiance ? reference.radiance_w_m2_sr : reference.temperature_k;
  if (truth.empty()) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("the reference has no {}",
                                  show_radiance ? "radiance of the band" : "temperature"));
  }
  const std::vector<float>& values = quantity_of(frame, show_radiance);
  PictureError out;
  out.difference.resize(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) out.difference[i] = values[i] - truth[i];
  out.stats = image::diff_values(values, truth, frame.width_px);
  out.same_view = !reference.metadata || same_view(frame, *reference.metadata);
  return out;
}

Result<image::RgbImage> draw_picture(const ViewFrame& frame, const PictureOptions& options,
                                     const PictureError* error) {
  image::FalseColorOptions colors;
  colors.map = options.map;
  colors.min_value = options.low;
  colors.max_value = options.high;
  colors.color_bar = true;
  colors.unit = options.show_radiance ? (frame.unit.empty() ? "W" : "") : "K";
  const std::vector<float>* values = &quantity_of(frame, options.show_radiance);
  switch (options.overlay) {
    case Overlay::picture:
      break;
    case Overlay::materials:
    case Overlay::samples:
      colors.map = image::ColorMap::grey;
      break;
    case Overlay::sun:
    case Overlay::sky:
      values = options.overlay == Overlay::sun ? &frame.sun_cosine : &frame.sky_frac;
      colors.min_value = 0.0;
      colors.max_value = 1.0;
      colors.unit = "";
      break;
    case Overlay::error:
      if (error == nullptr) {
        return make_error(ErrorCode::invalid_argument, "there is no reference");
      }
      values = &error->difference;
      colors.map = image::ColorMap::difference;
      break;
  }
  if (values->empty() || (options.overlay == Overlay::materials && frame.material.empty())) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("the source has no {}", name_of(options.overlay)));
  }
  auto picture = image::false_color(*values, frame.width_px, frame.height_px, colors);
  if (!picture) return picture;
  if (options.overlay == Overlay::materials) paint_materials(frame, options, *picture);
  if (options.overlay == Overlay::samples) {
    for (const std::uint32_t px : frame.sample_px) {
      set_pixel(*picture, px % frame.width_px, px / frame.width_px, kSampleInk);
    }
  }
  return picture;
}

image::Rgb material_color(std::size_t material, double brightness_frac) noexcept {
  // Turn the hue by the golden section, so that no two of the first dozens come close.
  constexpr double kGoldenFrac = 0.6180339887;
  const double turn = std::fmod(0.05 + kGoldenFrac * static_cast<double>(material), 1.0);
  const double value = 0.25 + 0.75 * brightness_frac;
  const auto part = [&](double offset) {
    const double distance = std::abs(std::fmod(6.0 * turn + offset, 6.0) - 3.0);
    const double pure = std::clamp(distance - 1.0, 0.0, 1.0);
    return static_cast<std::uint8_t>(std::lround(255.0 * value * std::lerp(0.4, 1.0, pure)));
  };
  return {part(0.0), part(4.0), part(2.0)};
}

std::vector<MaterialShare> material_shares(const ViewFrame& frame) {
  std::vector<std::size_t> counts;
  std::size_t all = 0;
  for (std::size_t i = 0; i < frame.material.size(); ++i) {
    if (std::isnan(frame.sky_frac[i])) continue;
    const auto material = static_cast<std::size_t>(frame.material[i]);
    if (material >= counts.size()) counts.resize(material + 1, 0);
    ++counts[material];
    ++all;
  }
  std::vector<MaterialShare> out;
  for (std::size_t m = 0; m < counts.size(); ++m) {
    if (counts[m] == 0) continue;
    out.push_back({m, static_cast<double>(counts[m]) / static_cast<double>(all)});
  }
  std::ranges::stable_sort(out, std::greater{}, &MaterialShare::frac);
  return out;
}

}  // namespace emit::tool::view
