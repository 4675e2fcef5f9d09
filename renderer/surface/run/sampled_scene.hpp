// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "surface/heat/surface_node.hpp"
#include "surface/mesh/cluster_levels.hpp"
#include "surface/mesh/drawn_mesh.hpp"
#include "surface/model/surface_model.hpp"

namespace emit::renderer {

/// Scene whose vertices are samples; every instance has its own samples.
struct SampledScene {
  /// Instances grouped by mesh. The indices of a mesh hold its submeshes, then the triangles of
  /// coarser levels of detail.
  scene::SceneGeometry geometry;
  std::vector<ClusterLevels> levels;        ///< levels of detail by mesh
  std::vector<std::uint32_t> first_sample;  ///< by instance: sample of its mesh's first vertex
  std::vector<float> sky_frac;              ///< by sample: share of the hemisphere that shows sky
  /// Half of SurfaceSample::hull_open_frac, then hull_tilt_frac, by sample. It is empty without
  /// entities.
  std::vector<glm::vec4> hull;
};

/// Makes the levels of detail of the refined meshes of a model of `geometry`, for the values of the
/// first frame in `first`. Setup: it allocates, and uses all cores.
/// @pre `first` has model.drawn_samples entries
[[nodiscard]] std::vector<DrawnMesh> make_drawn_meshes(const scene::SceneGeometry& geometry,
                                                       const SurfaceModel& model,
                                                       std::span<const SampleVertex> first);

/// Takes the refined meshes of a model of `geometry` as a scene whose instances are grouped by
/// mesh. The levels of detail leave the model. Setup: it allocates.
/// @pre model.drawn has an entry for every mesh
[[nodiscard]] SampledScene take_sampled_scene(const scene::SceneGeometry& geometry,
                                              SurfaceModel& model);

}  // namespace emit::renderer
