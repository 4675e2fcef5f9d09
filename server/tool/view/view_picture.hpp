// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "emit/image/exr_image.hpp"
#include "emit/image/false_color.hpp"
#include "emit/image/image_diff.hpp"
#include "emit/physics/error.hpp"
#include "tool/view/frame_provider.hpp"

/// Pictures of the viewer: a frame's quantity in false colours, or what lies behind it.
namespace emit::tool::view {

enum class Overlay : std::uint8_t {
  picture,    ///< temperature or radiance
  materials,  ///< a hue for each material, as bright as the picture
  samples,    ///< pixels that hold a thermal sample, over a grey picture
  sun,        ///< visible share of the sun times the cosine of its incidence
  sky,        ///< share of the hemisphere that shows sky
  error,      ///< frame less reference
};
inline constexpr std::uint8_t kOverlays = 6;
[[nodiscard]] const char* name_of(Overlay overlay) noexcept;
[[nodiscard]] std::optional<Overlay> overlay_of(std::string_view name) noexcept;

/// Picture of another program or of `emit solve` that frames are held against.
struct ReferencePicture {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<float> temperature_k;     ///< empty: the file has none
  std::vector<float> radiance_w_m2_sr;  ///< of the band that is shown; empty: the file has none
  std::optional<image::FrameMetadata> metadata;
};
/// Reads a reference; an empty `band` is that of the file. Errors: those of image::read_exr();
/// invalid_argument where the file has neither a temperature nor a radiance of the band.
[[nodiscard]] physics::Result<ReferencePicture> read_reference(const std::filesystem::path& file,
                                                               const std::string& band);

/// Frame less reference, pixel by pixel. NaN where one of them has no surface.
struct PictureError {
  std::vector<float> difference;
  image::DiffStats stats;
  /// The frame shows the instant and the view of the reference, as far as the file states them.
  bool same_view = true;
};
/// Errors: invalid_argument where sizes differ or the reference lacks the quantity.
[[nodiscard]] physics::Result<PictureError> picture_error(const ViewFrame& frame,
                                                          const ReferencePicture& reference,
                                                          bool show_radiance);

struct PictureOptions {
  Overlay overlay = Overlay::picture;
  image::ColorMap map = image::ColorMap::thermal;
  bool show_radiance = false;
  /// Limits of the colours: K or W m-2 sr-1, of `error` K or W m-2 sr-1 to both sides of 0.
  double low = 280.0;
  double high = 330.0;
};
/// Draws a frame with a bar of its colours at the right. `error` is needed for Overlay::error.
/// Errors: those of image::false_color(); invalid_argument where the frame lacks the plane.
[[nodiscard]] physics::Result<image::RgbImage> draw_picture(const ViewFrame& frame,
                                                            const PictureOptions& options,
                                                            const PictureError* error);

/// Colour of a material in Overlay::materials; neighbours in the list are far apart in hue.
[[nodiscard]] image::Rgb material_color(std::size_t material, double brightness_frac) noexcept;

/// Material in view, and the share of the surfaces' pixels that it has.
struct MaterialShare {
  std::size_t material = 0;
  double frac = 0.0;
};
/// Returns the materials in view, largest first.
[[nodiscard]] std::vector<MaterialShare> material_shares(const ViewFrame& frame);

}  // namespace emit::tool::view
