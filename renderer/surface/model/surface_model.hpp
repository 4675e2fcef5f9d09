// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "surface/heat/sample_heat.hpp"
#include "surface/heat/surface_samples.hpp"
#include "surface/mesh/refined_mesh.hpp"
#include "surface/model/history_record.hpp"
#include "surface/rays/caster_rays.hpp"
#include "surface/rays/surface_detail.hpp"
#include "surface/rays/surface_view.hpp"

namespace emit::renderer {

/// From where, and how finely, the surface will be looked at.
struct RefineView {
  struct Eye {
    glm::dvec3 world_m{0.0};
    glm::dvec3 boresight{0.0};  ///< unit length; zero: all around
  };
  std::vector<Eye> eyes;  ///< places of the camera; without any nothing is refined
  double pixel_rad = 1e-3;
  double field_rad = 3.1416;  ///< what lies within that angle of a boresight comes first
};

struct SurfaceModelOptions {
  double tolerance_k = 0.1;
  std::size_t max_samples = 1'000'000;
  double max_blur_m = 0.5;
  bool lateral = true;   ///< heat moves along the surface and across convex edges
  bool exchange = true;  ///< faces exchange radiation; false: what hides the sky is surroundings
};

/// Everything a sample carries after the history.
struct SurfaceModel {
  std::int64_t at_ns = 0;             ///< end of the record
  std::vector<RefineView::Eye> eyes;  ///< places of the camera that the surface was refined for
  std::vector<RefinedMesh> meshes;    ///< as SceneGeometry::meshes
  /// By instance; its samples are the mesh's vertices, then the backs of those on sheets.
  std::vector<std::uint32_t> first_sample;
  SurfaceSamples samples;  ///< drawn ones first, then partners across edges
  std::uint32_t drawn_samples = 0;
  std::vector<SampleState> states;    ///< at the end of the record
  std::vector<SampleOutput> outputs;  ///< at the end of the record
  bool full = false;                  ///< max_samples stopped the refinement
  bool full_in_view = false;          ///< ... also of what lies in the announced field of view
};

/// Fraction done; false stops.
using SurfaceProgress = std::function<bool(double done_frac)>;

/// What the builder works with; all outlive it.
struct SurfaceInputs {
  const scene::SceneGeometry& geometry;
  std::span<const scene::Material> materials;
  std::span<const std::int32_t> mover_of_object;  ///< -1: static
  const CasterRays& rays;                         ///< what shades, as loaded
  const CasterRays& places;  ///< `geometry`, same origin: where on it a ray ends
  const SampleHeat& heat;
  const SurfaceHistory& history;
  const HistoryRecord& record;
  std::span<const MoverPlacement> movers_now;
  const SurfaceDetail* detail = nullptr;  ///< null: no mesh has lost triangles
  /// By entity: where it stands and where its script takes it, rel. None: it stays.
  std::span<const std::vector<glm::vec3>> ways_m{};
};

/// Of the outermost layer; 0 for a prescribed material, and for a sheet, whose layers carry heat
/// sideways over centimetres only.
[[nodiscard]] double diffusivity_m2_s(const scene::Material& material) noexcept;

/// Places samples on every surface, integrates their history, and adds samples until linear
/// interpolation between them is good to the tolerance or the triangles are as small as a pixel.
/// Deterministic. Setup only: uses all cores. Errors: `internal` when stopped by `progress`.
[[nodiscard]] physics::Result<SurfaceModel> build_surface_model(const SurfaceInputs& inputs,
                                                                const RefineView& view,
                                                                const SurfaceModelOptions& options,
                                                                const SurfaceProgress& progress);

}  // namespace emit::renderer
