// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/surface/facets.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::renderer {

/// Glossy materials in the bands of the picture: tables of their lobes, and the sky as lobes see it
/// (physics.md section 5). lib/lobe.glsl reads both.
/// Owner: BandModel. Thread: the one of the renderer. Real time: build() is setup only, the rest is
/// RT-safe.
class LobeModel {
 public:
  /// Returns nothing if no material is glossy.
  [[nodiscard]] static std::optional<LobeModel> build(const scene::ScenarioDesc& scenario,
                                                      std::span<const scene::Material> materials);

  /// Returns the emissivity of a material over the hemisphere; empty if it is not glossy.
  [[nodiscard]] std::optional<double> hemispherical_emissivity_frac(
      std::size_t material, std::size_t band) const noexcept;

  /// Table of the lobes as lib/lobe.glsl reads it: an entry per material, then blocks.
  [[nodiscard]] std::span<const float> table() const noexcept { return table_; }

  // The sky as a lobe sees it, by the mean direction of the lobe and by its width.
  static constexpr std::size_t kSkyElevations = 33;
  static constexpr std::size_t kSkyWidths = 9;
  static constexpr std::size_t kSkyNodes = kSkyElevations * kSkyWidths;
  /// Nodes of the table for both kinds of facets: the radiance of all bands at each node, then the
  /// share of the lobe that sees the sky.
  static constexpr std::size_t kSkyTable = 4 * kSkyNodes;
  using SkyNode = std::array<float, 4>;

  /// Elevations at which update_sky() takes the radiance of the sky.
  static constexpr std::size_t kSkySamples = 48;
  [[nodiscard]] static double sky_sample_sine(std::size_t sample) noexcept;
  /// Sets the sky of a band. `out` is the table that the shader reads.
  /// @pre out.size() == kSkyTable
  void update_sky(std::size_t band, const std::array<double, kSkySamples>& sky_w_m2_sr,
                  std::span<SkyNode> out) const noexcept;

  /// Glossy surface of a pixel.
  struct Seen {
    std::uint32_t material = 0;
    glm::vec3 normal{0.0F, 0.0F, 1.0F};     ///< unit, relworld
    glm::vec3 to_viewer{0.0F, 0.0F, 1.0F};  ///< unit, relworld
    glm::vec3 to_sun{0.0F, 0.0F, 1.0F};     ///< unit, relworld
    float open_frac = 0.0F;                 ///< share of the hemisphere that shows sky
    float sun_cosine = 0.0F;                ///< with the visible share of the sun
    float glint_per_sr = 0.0F;              ///< of facets without loss, as the shader has it
  };
  /// Light in the band.
  struct Light {
    float incoming_w_m2_sr = 0.0F;      ///< from everything but the sun, mean
    float sky_w_m2_sr = 0.0F;           ///< of the sky as a face of that tilt sees it
    float surroundings_w_m2_sr = 0.0F;  ///< blackbody at their temperature
  };
  /// Parts of the light that leaves the surface.
  struct Parts {
    float emissivity_frac = 0.0F;
    float diffuse_frac = 0.0F;
    float lobe_sky_w_m2_sr = 0.0F;
    float lobe_neighbours_w_m2_sr = 0.0F;
    float diffuse_sun_per_sr = 0.0F;  ///< per irradiance across the direction of the sun
    float glint_per_sr = 0.0F;        ///< the same
  };
  /// Returns the parts in a band; empty if the material is not glossy. Twin of lib/lobe.glsl.
  /// `sky` is the table that update_sky() wrote.
  [[nodiscard]] std::optional<Parts> parts(std::size_t band, const Seen& seen, const Light& light,
                                           std::span<const SkyNode> sky) const noexcept;

 private:
  std::size_t bands_ = 0;
  std::vector<float> table_;
  std::vector<std::vector<physics::Lobe>> lobes_;  ///< by material, then band; empty: not glossy
};

}  // namespace emit::renderer
