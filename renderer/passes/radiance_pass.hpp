// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_uint2.hpp>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "gl/program.hpp"

namespace emit::renderer {

/// Content of a scenario that the radiance pass is compiled for.
struct RadianceContent {
  std::uint32_t bands = 0;
  std::uint32_t air_terms = 0;  ///< bit per band: its air is a sum of exponential terms
  std::uint32_t air_table = 0;  ///< bit per band: its air is a table
  std::uint32_t air_model = 0;  ///< bit per band: its air is built in
  std::uint32_t air_sun = 0;    ///< bit per band: this air may scatter sunlight
  std::uint32_t terms = 0;      ///< largest number of exponential terms of a band
  /// Index of the first number of the lobes in the buffer of the tables; 0: nothing is glossy.
  std::uint32_t first_lobe = 0;
  std::uint32_t outputs = 0;        ///< planes behind those of the bands, EMIT_OUTPUT_*
  bool clutter = false;             ///< some materials vary from place to place
  bool clutter_emissivity = false;  ///< the emissivity of some does
  bool clouds = false;              ///< there are broken clouds
  bool fog = false;                 ///< there is a layer of fog
  std::uint32_t foster_groups = 1;  ///< texels with the modes of a pixel: foster_groups()
};

/// Radiance of every pixel in all bands (part 5 of the paper). See passes/radiance.comp.
/// Thread: the one that owns the GL context. Real time: create() is setup only, the rest is
/// RT-safe.
class RadiancePass {
 public:
  /// Compiles the pass. `software` says that the device is a CPU. Errors: gpu (names the shader).
  /// @pre content.bands is 1..EMIT_MAX_BANDS.
  [[nodiscard]] static physics::Result<RadiancePass> create(const scene::ThermalOptions& options,
                                                            const RadianceContent& content,
                                                            bool software);
  /// Writes all planes of the window of the frame, which has `size_px` pixels, to EMIT_BIND_OUTPUT.
  void dispatch(const glm::uvec2& size_px) const noexcept;

 private:
  gl::Program program_;
  std::uint32_t rows_ = 1;  ///< result of pixel_rows()
};

}  // namespace emit::renderer
