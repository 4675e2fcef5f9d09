// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/apparent_temperature.hpp"
#include "emit/physics/atmosphere_table.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"
#include "emit/physics/weather.hpp"
#include "emit/scene/scene_desc.hpp"
#include "shared/frame_params.glsl.h"

namespace emit::renderer {

/// Blackbody tables and atmosphere of the scenario's bands.
/// Owner: Renderer. Real time: update is RT-safe, build is setup only.
class BandModel {
 public:
  /// Errors (config): more than EMIT_MAX_BANDS bands, a band or an atmosphere that is not valid.
  [[nodiscard]] static physics::Result<BandModel> build(const scene::ScenarioDesc& scenario,
                                                        std::span<const scene::Material> materials);

  /// Air, surroundings and sun at the frame's instant.
  void update(const physics::Forcing& forcing, const physics::SunPosition& sun) noexcept;

  [[nodiscard]] std::span<const gpu::BandParams> params() const noexcept { return params_; }
  /// T ln L tables, one band after the other, then the tables of the air, then emissivities.
  [[nodiscard]] std::span<const float> tables() const noexcept { return tables_; }
  [[nodiscard]] std::uint32_t nodes_per_band() const noexcept { return nodes_per_band_; }
  /// Bit per band whose air is a sum of exponential terms; a table.
  [[nodiscard]] std::uint32_t air_terms() const noexcept { return air_terms_; }
  [[nodiscard]] std::uint32_t air_table() const noexcept { return air_table_; }
  /// Most exponential terms of a band.
  [[nodiscard]] std::uint32_t max_terms() const noexcept { return max_terms_; }
  /// Place in tables() of the emissivities: by material, then by band.
  [[nodiscard]] std::uint32_t first_emissivity() const noexcept { return first_emissivity_; }
  [[nodiscard]] std::vector<physics::ApparentTemperature> apparent_temperatures()
      const;  ///< Setup only.

 private:
  struct Entry {
    physics::Band band;
    double sun_radiance_w_m2_sr = 0.0;  ///< photosphere, in band
    double sky_hemisphere_frac = 0.0;   ///< hemisphere mean over blackbody at air temperature
    double vertical_transmittance_frac = 1.0;
    std::optional<physics::AtmosphereTable> air = std::nullopt;  ///< in place of the terms
    double air_hemisphere_w_m2_sr = 0.0;                         ///< sky of that table
  };
  std::vector<Entry> entries_;
  std::vector<gpu::BandParams> params_;
  std::vector<float> tables_;
  std::uint32_t nodes_per_band_ = 0;
  std::uint32_t air_terms_ = 0;
  std::uint32_t air_table_ = 0;
  std::uint32_t max_terms_ = 0;
  std::uint32_t first_emissivity_ = 0;
};

/// Materials as the shaders read them. `reference_k` is what temperature offsets count from.
[[nodiscard]] std::vector<gpu::MaterialParams> material_params(
    std::span<const scene::Material> materials, const scene::ScenarioDesc& scenario,
    double reference_k);

}  // namespace emit::renderer
