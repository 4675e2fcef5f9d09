// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <limits>
#include <vector>

#include "emit/physics/column_cells.hpp"
#include "emit/physics/foster.hpp"

/// Thermal samples: points of the surface that remember their temperature. They are plain data; a
/// comment at a member says who fills it if that is not the warm-up.
namespace emit::renderer {

/// Index that stands for no sample.
inline constexpr std::uint32_t kNoSample = 0xffffffffU;

/// Sample in whose neighbourhood rays of a view ended, and the share of those rays.
struct SeenSample {
  std::uint32_t sample = kNoSample;
  float weight_frac = 0.0F;
};

/// Cells of the column of a sample near a crease or a foot (physics.md eq. 22): which shares of
/// them belong to it, and what they exchange heat with. All conductances are per area of the
/// sample.
struct SampleColumn {
  std::uint32_t sample = kNoSample;
  float area_m2 = 0.0F;
  physics::CellState<float> share_frac{};  ///< of the cells of the whole stack; the rest is cut off
  physics::CellState<float> below_w_m2_k{};  ///< to the next cell, or to the base
  /// Entries of SurfaceSamples::links of cell l: first_link[l] .. first_link[l + 1].
  std::array<std::uint32_t, physics::kMaxColumnCells + 1> first_link{};
};
/// Cell of another column with which a cell exchanges heat.
struct CellLink {
  std::uint32_t column = 0;
  std::uint32_t cell = 0;
  float conductance_w_m2_k = 0.0F;
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
  /// Share of the rain that nothing above keeps off, by the rays of the warm-up. The tilt of the
  /// sample is not in it, because that of entities changes.
  float rain_frac = 1.0F;
  std::uint32_t first_seen = 0;  ///< rest of the hemisphere: entries of SurfaceSamples::seen
  std::uint32_t seen_count = 0;
  /// Factor on the weights of those entries. Samples with a similar view share the entries and
  /// differ in this factor.
  float seen_scale = 0.0F;
  /// True if another face lies on the surface. No air and no radiation reach it then, and because
  /// contact between bodies is not modelled, it has no flux at all.
  bool covered = false;
  /// Distance along the surface to the nearest wall of a solid that stands on it, seen from beside
  /// the solid or from under it; infinite: there is none within 3 m.
  float foot_m = std::numeric_limits<float>::infinity();
  /// Share of the heat of open ground that the cells have at the start of the history, because the
  /// solid has kept sun, sky and air from the ground under it (physics.md eq. 23).
  float before_frac = 1.0F;
  /// Area that takes up the flux of the sample, per area of its column. Triangles that the foot of
  /// a solid cuts give what lies open of them to their open corners. It is 0 under the solid.
  float exposed_frac = 1.0F;
  /// Share of the difference between surface and first cell of open ground that is left beside a
  /// foot: half of it at the wall itself, where the flux ends.
  float excess_frac = 1.0F;
  /// Share of what neighbours add to the surface that counts where its modes are driven: 0 on
  /// bodies that stand on ground and on that ground, because conduction there may take away more
  /// than a surface that stood alone would ever lose.
  float felt_frac = 1.0F;
  /// Sample of the other face of a sheet at the same place, which shares the state of this one.
  std::uint32_t other_side = kNoSample;
  float flat_m = 0.0F;   ///< the surface is plane at least this far in all directions
  float facet_m = 0.0F;  ///< longest edge of the triangles on which it lies, before any is halved
  /// Column in SurfaceSamples::columns; kNoSample where heat moves straight down alone.
  std::uint32_t column = kNoSample;
  /// Place of its values in SurfaceNode::vertices; kNoSample: it has none.
  std::uint32_t vertex = kNoSample;
  /// Sample whose clutter this one stands for: it has the same place and view and a twin of its
  /// material. kNoSample: it stands for itself.
  std::uint32_t twin_of = kNoSample;
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
  /// Modes: with foster the sample's own flux drives them, with emit2014 its equilibrium
  /// temperature.
  physics::FosterState<double> modes_k{};
  /// Cells of the sample's column (physics.md eq. 22), from the reference temperature: with the
  /// heat of its neighbours, and as they were if it had none. They are 0 without a column.
  physics::CellState<float> cells_k{};
  physics::CellState<float> alone_k{};
  /// Difference that the neighbours have made to the surface temperature.
  float aside_k = 0.0F;
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
};

/// All samples of a scene, the lists of samples that they see, and the columns of those that
/// exchange heat along the surface.
struct SurfaceSamples {
  std::vector<SurfaceSample> samples;
  std::vector<SeenSample> seen;       ///< lists of all samples, one after the other
  std::vector<SampleColumn> columns;  ///< ascending by sample
  std::vector<CellLink> links;        ///< of all columns, one after the other
  /// Samples that have twins, ascending. Their low twins are the samples from `first_twin` on, in
  /// the same order, and behind them the high ones.
  std::vector<std::uint32_t> twinned;
  std::uint32_t first_twin = 0;
};

/// The twins of a sample; both are kNoSample if it has none.
struct SampleTwins {
  std::uint32_t low = kNoSample;
  std::uint32_t high = kNoSample;
};
[[nodiscard]] inline SampleTwins twins_of(const SurfaceSamples& all, std::uint32_t index) noexcept {
  const auto found = std::ranges::lower_bound(all.twinned, index);
  if (found == all.twinned.end() || *found != index) return {};
  const auto low = all.first_twin + static_cast<std::uint32_t>(found - all.twinned.begin());
  return {low, low + static_cast<std::uint32_t>(all.twinned.size())};
}

/// Returns whether a sample is advanced on its own. It is false for the second side of a sheet,
/// which follows from the first one.
[[nodiscard]] inline bool steps_itself(const SurfaceSamples& all, std::uint32_t index) noexcept {
  return all.samples[index].other_side >= index;
}

}  // namespace emit::renderer
