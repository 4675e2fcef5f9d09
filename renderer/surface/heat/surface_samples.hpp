// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <vector>

#include "emit/physics/foster.hpp"

/// Thermal samples: points of the surface that remember their temperature. They are plain data; a
/// comment at a member says who fills it if that is not the warm-up.
namespace emit::renderer {

/// Index that stands for no sample.
inline constexpr std::uint32_t kNoSample = 0xffffffffU;
/// Largest number of faces across convex edges with which a sample exchanges heat.
inline constexpr std::size_t kMaxPartners = 2;

/// Sample in whose neighbourhood rays of a view ended, and the share of those rays.
struct SeenSample {
  std::uint32_t sample = kNoSample;
  float weight_frac = 0.0F;
};

/// Partner of a sample: the point of the neighbouring face that has the same distance from their
/// convex edge.
struct Partner {
  std::uint32_t sample = kNoSample;
  float distance_m = 0.0F;  ///< distance of either point from the edge
  /// Share w_i of the partner's flux that drives each mode (physics.md eq. 22).
  std::array<float, physics::kMaxFosterModes> weight_frac{};
};

/// Place, material and view of a sample. They are fixed while the geometry of the scene stays the
/// same. Coordinates are in rel for static surfaces and in the body frame for those of entities.
struct SurfaceSample {
  glm::vec3 position_m{0.0F};
  glm::vec3 normal{0.0F};    ///< outward, unit length
  std::int32_t entity = -1;  ///< entity, or -1: static
  std::int32_t body = -1;    ///< body whose interior the layers rest on, or -1: a fixed temperature
  std::uint32_t material = 0;
  float sky_frac = 1.0F;  ///< cosine-weighted share of the hemisphere that shows sky
  float far_frac = 0.0F;  ///< share of the hemisphere whose rays leave the scene below the horizon
  /// Share f_i of the full sphere that shows sky. Only the model emit2014 uses it; with other
  /// models it keeps its default.
  float sphere_sky_frac = 0.5F;
  /// Cosine-weighted share of the hemisphere that the own hull leaves open, and the part of the sky
  /// in it that depends on the zenith (sky_past_hull()). Static samples keep the defaults.
  float hull_open_frac = 1.0F;
  glm::vec3 hull_tilt_frac{0.0F};
  std::uint32_t first_seen = 0;  ///< rest of the hemisphere: entries of SurfaceSamples::seen
  std::uint32_t seen_count = 0;
  /// Factor on the weights of those entries. Samples with a similar view share the entries and
  /// differ in this factor.
  float seen_scale = 0.0F;
  /// True if another face lies on the surface. No air and no radiation reach it then, and because
  /// contact between bodies is not modelled, it has no flux at all.
  bool covered = false;
  /// Share o_i of the response of each mode that remains next to a solid, which keeps sun, sky and
  /// air from the ground under it (physics.md eq. 23). The first holds over the history, the second
  /// for the states at its start.
  std::array<float, physics::kMaxFosterModes> open_frac{1.0F, 1.0F, 1.0F, 1.0F};
  std::array<float, physics::kMaxFosterModes> open_before_frac{1.0F, 1.0F, 1.0F, 1.0F};
  /// Sample of the other face of a sheet at the same place, which shares the state of this one.
  std::uint32_t other_side = kNoSample;
  float flat_m = 0.0F;   ///< the surface is plane at least this far in all directions
  float facet_m = 0.0F;  ///< longest edge of the triangles on which it lies, before any is halved
  std::array<Partner, kMaxPartners> partners{};
};

/// Measure by which directions count when a sample looks for sky.
enum class SkyMeasure : std::uint8_t {
  cosine,  ///< directions count with the cosine to the normal
  sphere,  ///< all directions of the full sphere count alike
};

/// Heat of a sample at the end of an interval, as values of the modes of its thermal model. With
/// foster they are kelvins above the base (physics.md eq. 17), with emit2014 offsets from the
/// reference temperature.
struct SampleState {
  /// Modes of the sample itself. With foster its own flux drives them, with emit2014 its
  /// equilibrium temperature.
  physics::FosterState<double> modes_k{};
  /// Modes y_i that the fluxes of each partner drive (physics.md eq. 22).
  std::array<physics::FosterState<double>, kMaxPartners> partner_k{};
};

/// Output of a sample at one node of time, which other samples and the device read.
struct SampleOutput {
  float offset_k = 0.0F;  ///< temperature from the reference temperature
  /// Visible share of the sun's disc, mean over the interval before. In the output of a step of a
  /// static sample it counts the shade of static geometry alone, because frames add the shade of
  /// entities themselves (ExposureTiles).
  float sun_frac = 0.0F;
  float longwave_out_w_m2 = 0.0F;   ///< emitted and reflected
  float shortwave_out_w_m2 = 0.0F;  ///< reflected sunlight, mean of the interval before
  float flux_w_m2 = 0.0F;           ///< net flux into the solid
};

/// All samples of a scene and the lists of samples that they see.
struct SurfaceSamples {
  std::vector<SurfaceSample> samples;
  std::vector<SeenSample> seen;  ///< lists of all samples, one after the other
};

/// Returns whether a sample is advanced on its own. It is false for the second side of a sheet,
/// which follows from the first one.
[[nodiscard]] inline bool steps_itself(const SurfaceSamples& all, std::uint32_t index) noexcept {
  return all.samples[index].other_side >= index;
}

}  // namespace emit::renderer
