// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <string>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"
#include "history/band_lights.hpp"
#include "surface/heat/sample_heat.hpp"
#include "surface/heat/surface_samples.hpp"
#include "surface/mesh/drawn_mesh.hpp"
#include "surface/mesh/refined_mesh.hpp"
#include "surface/model/history_record.hpp"
#include "surface/rays/caster_rays.hpp"
#include "surface/rays/surface_detail.hpp"
#include "surface/rays/surface_view.hpp"

namespace emit::renderer {

/// Places of the camera and its resolution, which decide how finely the surface is refined.
struct RefineView {
  /// Place of the camera and the direction that it looks in.
  struct Eye {
    glm::dvec3 world_m{0.0};
    glm::dvec3 boresight{0.0};  ///< unit length, world axes; zero: the camera looks all around
  };
  std::vector<Eye> eyes;    ///< places of the camera; empty: nothing is refined
  double pixel_rad = 1e-3;  ///< angle of a pixel
  /// Angle around a boresight in which surfaces are refined first. The default is all around.
  double field_rad = 3.1416;
  /// Directions to the sun at instants of later frames, unit length, world axes. Edges of shadows
  /// that static geometry will cast then are places to refine too.
  std::vector<glm::dvec3> coming_suns{};
};

/// Options of build_surface_model(), from the scenario.
struct SurfaceModelOptions {
  double tolerance_k = 0.1;             ///< largest error of linear interpolation between samples
  std::size_t max_samples = 1'000'000;  ///< limit on samples; refinement stops there
  double max_blur_m = 0.5;              ///< limit on the lateral blur of old shadows
  bool lateral = true;                  ///< heat moves along the surface and across convex edges
  bool exchange = true;  ///< faces exchange radiation; false: what hides the sky is surroundings
};

/// Result of the warm-up: refined meshes, their samples, and the state of every sample at the end
/// of the record. build_surface_model() leaves `drawn` empty.
struct SurfaceModel {
  std::int64_t at_ns = 0;             ///< end of the record
  std::vector<RefineView::Eye> eyes;  ///< places of the camera that the surface was refined for
  std::vector<RefinedMesh> meshes;    ///< same order as SceneGeometry::meshes
  std::vector<DrawnMesh> drawn;       ///< levels of detail of `meshes`, same order
  /// Index of the first sample of each instance. One sample per vertex of its mesh comes first,
  /// then one for the back of each vertex on a sheet.
  std::vector<std::uint32_t> first_sample;
  SurfaceSamples samples;             ///< samples of all instances
  std::uint32_t drawn_samples = 0;    ///< number of samples that belong to vertices and backs
  std::vector<SampleState> states;    ///< states at the end of the record
  std::vector<SampleOutput> outputs;  ///< outputs at the end of the record
  std::vector<double> body_k;         ///< interiors of bodies there, from the reference temperature
  /// Largest residual of the exchange where it is above the limit of the warm-up, W/m2; otherwise
  /// 0.
  double exchange_left_w_m2 = 0.0;
  bool full = false;          ///< the refinement stopped at max_samples
  bool full_in_view = false;  ///< surfaces in the field of view were then still too coarse
};

/// Callback that receives the fraction done, 0 to 1. The builder stops if it returns false.
using SurfaceProgress = std::function<bool(double done_frac)>;

/// Joints of a scenario between bodies that touch, and the names of its objects. Plain data.
struct BodyJoints {
  std::vector<scene::ContactDesc> contacts;
  std::vector<std::string> objects;  ///< names, by object

  /// Returns the resistance of the joint between two bodies, each given by an object and a
  /// material, in m2 K W-1; 0 where no contact names them.
  [[nodiscard]] double resistance_m2k_w(std::uint32_t object, const scene::Material& material,
                                        std::uint32_t other_object,
                                        const scene::Material& other_material) const noexcept;
};

/// Inputs of build_surface_model(). All of them must outlive the call.
struct SurfaceInputs {
  const scene::SceneGeometry& geometry;
  std::span<const scene::Material> materials;
  std::span<const std::int32_t> entity_of_object;  ///< entity of each object; -1: static
  const CasterRays& rays;                          ///< geometry that casts shade, as loaded
  const CasterRays& places;  ///< `geometry` with the same origin: finds the place that a ray hits
  const BodyJoints& joints;
  const SampleHeat& heat;
  const SurfaceHistory& history;
  const HistoryRecord& record;
  /// Placements of the entities at the end of the record.
  std::span<const EntityPlacement> entities_now;
  const SurfaceDetail* detail = nullptr;  ///< null: no mesh has lost triangles
  /// Places in rel where each entity stands now and where its script takes it. An empty span:
  /// entities stay where they are.
  std::span<const std::vector<glm::vec3>> ways_m{};
  const BandLights* lights = nullptr;  ///< null: reflections in band refine nothing
};

/// Returns the thermal diffusivity of the outermost layer. It is 0 for a prescribed material, and
/// for a sheet, whose layers carry heat sideways over centimetres only.
[[nodiscard]] double diffusivity_m2_s(const scene::Material& material) noexcept;

/// Builds the cached surface: places samples on every surface, integrates their history, and adds
/// samples until linear interpolation between them is good to the tolerance or the triangles are as
/// small as a pixel. The result depends on the input alone. Setup only: it uses all cores. Errors:
/// `internal` if `progress` stopped it.
[[nodiscard]] physics::Result<SurfaceModel> build_surface_model(const SurfaceInputs& inputs,
                                                                const RefineView& view,
                                                                const SurfaceModelOptions& options,
                                                                const SurfaceProgress& progress);

}  // namespace emit::renderer
