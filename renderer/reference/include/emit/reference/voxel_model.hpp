// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/reference/solid_solver.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

/// Solids for SolidSolver out of the triangles of a scene.
///
/// The scene has to be static and its faces must lie in planes across the world's axes. Horizontal
/// sheets that face up are ground: below them lie the layers of their material, then its base_k.
/// All other faces must close solids. A solid has the layers of its material from the open air
/// inwards; what lies deeper is a core at base_k. Around a cavity that the open air does not reach
/// the last layer goes through to the cavity, whose walls are held at base_k. Solid and ground in
/// contact share their nodes.
namespace emit::reference {

struct VoxelShape;

struct PastSun {
  glm::dvec3 to_sun{0.0};  ///< unit vector
  double age_s = 0.0;      ///< before the instant of the picture
};

struct VoxelOptions {
  double normal_cell_m = 0.0025;  ///< first cell below an exposed face
  double swept_cell_m = 0.015;    ///< along a face, where shadow edges pass
  double shadow_cell_m = 0.004;   ///< across the edge of a shadow that is still sharp
  double growth_frac = 0.16;      ///< growth of the cells per length of distance
  double max_cell_m = 1.0;
  double refine = 1.0;  ///< multiplies the cells along every axis
  std::uint64_t max_nodes = 60'000'000;
  /// The sun over the history, oldest first; shadow edges pass where their shadows lie. Empty:
  /// nowhere, as for the unshadowed start.
  std::vector<PastSun> suns;
};

/// What a face of the model is, beside SolidFace.
struct VoxelFace {
  std::uint32_t material = 0;  ///< index into SceneGeometry::materials
  bool in_cavity = false;      ///< ground that looks into a closed cavity
};

class VoxelModel {
 public:
  /// Errors: unsupported (moving objects, oblique or open faces, a body of several materials, an
  /// emitter of given temperature, too many nodes), config (a material without layers); the text
  /// names object and material.
  [[nodiscard]] static physics::Result<VoxelModel> build(const scene::ScenarioDesc& scenario,
                                                         const scene::SceneGeometry& geometry,
                                                         const VoxelOptions& options);
  /// True where build() would not refuse the scene for its shape.
  [[nodiscard]] static bool fits(const scene::ScenarioDesc& scenario,
                                 const scene::SceneGeometry& geometry);

  [[nodiscard]] const SolidGrid& grid() const noexcept { return grid_; }
  /// For SolidSolver::create().
  [[nodiscard]] FaceCondition condition(const SolidFace& face) const;
  [[nodiscard]] VoxelFace face(const SolidFace& face) const;
  /// Temperature of the enclosure that in_cavity ground looks into.
  [[nodiscard]] double cavity_k() const noexcept { return cavity_k_; }

  /// Depth below the nearest open face and the materials' steady profile between `surface_k` there
  /// and base_k: where a run starts.
  [[nodiscard]] double steady_k(const glm::dvec3& point_m, double initial_k) const;

 private:
  friend class VoxelBuilder;
  struct CellKind {
    std::uint32_t material = 0;  ///< scene material
    bool ground = false;
  };

  SolidGrid grid_;
  std::vector<CellKind> kinds_;             ///< per entry of grid_.materials
  std::vector<scene::Material> materials_;  ///< of the scene
  std::vector<std::uint8_t> cavity_cell_;   ///< per cell: 1 in a closed cavity
  std::shared_ptr<const VoxelShape> shape_;
  double cavity_k_ = 0.0;
};

/// Finds the face of the model at a point of its surface.
class FaceFinder {
 public:
  FaceFinder(const SolidGrid& grid, std::span<const SolidFace> faces);
  /// `normal` points out of the solid, along an axis. Points between two faces go to either.
  [[nodiscard]] std::optional<std::uint32_t> find(const glm::dvec3& point_m,
                                                  const glm::dvec3& normal) const;

 private:
  std::array<std::vector<double>, 3> lines_m_;
  std::unordered_map<std::uint64_t, std::uint32_t> faces_;
};

}  // namespace emit::reference
