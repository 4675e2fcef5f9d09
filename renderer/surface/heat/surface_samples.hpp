// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <vector>

#include "emit/physics/foster.hpp"

/// Thermal samples: the points of a surface that remember. Plain arrays; who fills what is said at
/// each member.
namespace emit::renderer {

inline constexpr std::uint32_t kNoSample = 0xffffffffU;
/// Neighbouring faces across convex edges that a sample exchanges heat with.
inline constexpr std::size_t kMaxPartners = 2;

/// A sample near which rays of a view ended, and the share of those rays.
struct SeenSample {
  std::uint32_t sample = kNoSample;
  float weight_frac = 0.0F;
};

/// The point at the same distance from a convex edge on the other face.
struct Partner {
  std::uint32_t sample = kNoSample;
  float distance_m = 0.0F;  ///< of both from the edge
  /// Share of the partner's flux that drives each mode (physics.md eq. 22).
  std::array<float, physics::kMaxFosterModes> weight_frac{};
};

/// What a sample is: fixed while the scene's geometry stands. Coordinates are relative to the
/// origin of CasterRays for static surfaces and in the body frame for those of entities.
struct SurfaceSample {
  glm::vec3 position_m{0.0F};
  glm::vec3 normal{0.0F};
  std::int32_t mover = -1;  ///< entity, or -1: static
  std::uint32_t material = 0;
  float sky_frac = 1.0F;  ///< cosine-weighted share of the hemisphere that shows sky
  float far_frac = 0.0F;  ///< ... and that leaves the scene below the horizon
  /// Share of the full sphere that shows sky; filled where the thermal model has that measure.
  float sphere_sky_frac = 0.5F;
  std::uint32_t first_seen = 0;  ///< the rest: entries of SurfaceSamples::seen
  std::uint32_t seen_count = 0;
  /// Their weights count that much: samples whose view is alike share its entries.
  float seen_scale = 0.0F;
  /// Another face lies on it: no air and no radiation in between, and for want of a path between
  /// the two bodies no flux.
  bool covered = false;
  /// Share of each mode's response that is left next to a body which keeps the sun, the sky and
  /// the air from the surface beyond its foot (physics.md eq. 23): over the history, and over the
  /// days before.
  std::array<float, physics::kMaxFosterModes> open_frac{1.0F, 1.0F, 1.0F, 1.0F};
  std::array<float, physics::kMaxFosterModes> open_before_frac{1.0F, 1.0F, 1.0F, 1.0F};
  /// Of a sheet: the sample of its other face at this place, which shares its state.
  std::uint32_t other_side = kNoSample;
  float flat_m = 0.0F;  ///< the surface is a plane at least this far in all directions
  std::array<Partner, kMaxPartners> partners{};
};

/// Which directions count when a sample looks for sky.
enum class SkyMeasure : std::uint8_t {
  cosine,  ///< by the cosine to the normal
  sphere,  ///< every direction of the full sphere alike
};

/// Heat of a sample at the end of an interval: modes of the thermal model, as offsets.
struct SampleState {
  /// foster: driven by the sample's own flux; emit2014: by its equilibrium temperature.
  physics::FosterState<double> modes_k{};
  /// Driven by the fluxes of its partners (physics.md, edges); all modes of one partner.
  std::array<physics::FosterState<double>, kMaxPartners> partner_k{};
};

/// What others and the device read of a sample at one node of time.
struct SampleOutput {
  float offset_k = 0.0F;  ///< temperature from the renderer's reference
  /// Visible share of the sun's disc in the interval before; in a step's output of static samples
  /// by what stands still, because frames have their own shade of entities (ShadePages).
  float sun_frac = 0.0F;
  float longwave_out_w_m2 = 0.0F;   ///< emitted and reflected
  float shortwave_out_w_m2 = 0.0F;  ///< reflected sunlight, mean of the interval before
  float flux_w_m2 = 0.0F;           ///< net, into the solid
};

struct SurfaceSamples {
  std::vector<SurfaceSample> samples;
  std::vector<SeenSample> seen;
};

/// False for the side of a sheet that is carried on with its other one.
[[nodiscard]] inline bool steps_itself(const SurfaceSamples& all, std::uint32_t index) noexcept {
  return all.samples[index].other_side >= index;
}

}  // namespace emit::renderer
