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

/// Solids for SolidSolver, made from the triangles of a scene.
///
/// The scene has to be static, and its faces must lie in planes across the world's axes. Horizontal
/// sheets that face up are ground: below them lie the layers of their material, and below those its
/// base_k. All other faces must close solids. A solid has the layers of its material from the open
/// air inwards; its core, which lies deeper, is held at base_k. Around a cavity that the open air
/// does not reach, the last layer extends to the cavity, whose walls are held at base_k. A sheet
/// is a solid of its thickness behind its front, without a core. Bodies that touch, and a body and
/// the ground below it, share the nodes of their contact, unless a contact of the scenario puts a
/// resistance there. Materials on one solid may differ in their optics.
namespace emit::reference {

struct VoxelShape;

/// Direction of the sun at an instant of the history.
struct PastSun {
  glm::dvec3 to_sun{0.0};  ///< unit vector
  double age_s = 0.0;      ///< time before the instant of the image
};

/// Options of VoxelModel::build().
struct VoxelOptions {
  double normal_cell_m = 0.0025;  ///< first cell below an exposed face
  double swept_cell_m = 0.015;    ///< cell along a face that shadow edges cross
  double shadow_cell_m = 0.004;   ///< cell across the edge of a shadow that is still sharp
  double growth_frac = 0.16;      ///< growth of the cells per distance
  double max_cell_m = 1.0;
  double refine = 1.0;  ///< multiplies the cells along every axis
  std::uint64_t max_nodes = 60'000'000;
  /// Sun over the history, oldest first. Shadow edges pass the places at which these shadows lie.
  /// An empty list stands for no shadow, as in the unshadowed start.
  std::vector<PastSun> suns;
};

/// Properties of a face of the model in addition to SolidFace.
struct VoxelFace {
  std::uint32_t material = 0;  ///< index into SceneGeometry::materials
  bool in_cavity = false;      ///< the face is ground that looks into a closed cavity
};

/// Grid of solids for a scene.
class VoxelModel {
 public:
  /// Builds the model. Errors: unsupported (moving objects, oblique or open faces, a solid of
  /// materials with different layers, an emitter of given temperature, too many nodes), config (a
  /// material without layers), invalid_argument (options out of range). The message names object
  /// and material.
  [[nodiscard]] static physics::Result<VoxelModel> build(const scene::ScenarioDesc& scenario,
                                                         const scene::SceneGeometry& geometry,
                                                         const VoxelOptions& options);
  /// Checks if build() would accept the shape of the scene. Errors: those of build() for a shape.
  [[nodiscard]] static physics::Result<void> fits(const scene::ScenarioDesc& scenario,
                                                  const scene::SceneGeometry& geometry);

  [[nodiscard]] const SolidGrid& grid() const noexcept { return grid_; }
  /// Returns the boundary condition of a face, for SolidSolver::create().
  [[nodiscard]] FaceCondition condition(const SolidFace& face) const;
  /// Returns the material of a face and whether it looks into a cavity.
  [[nodiscard]] VoxelFace face(const SolidFace& face) const;
  /// Returns the temperature of the enclosure that in_cavity ground looks into.
  [[nodiscard]] double cavity_k() const noexcept { return cavity_k_; }

  /// Returns the thickness of the thickest sheet, m; 0 without sheets.
  [[nodiscard]] double thickest_sheet_m() const noexcept;

  /// Returns the temperature of a point at the start of a run. It depends on the depth below the
  /// nearest open face, along the steady profile of the material's layers from the initial
  /// temperature to base_k. `initial_k` counts for materials without an initial temperature of
  /// their own.
  [[nodiscard]] double steady_k(const glm::dvec3& point_m, double initial_k) const;

 private:
  friend class VoxelBuilder;
  struct CellKind {
    std::uint32_t material = 0;  ///< index of the scene material
    bool ground = false;
    std::uint32_t joint_of = 0xffffffffU;  ///< grid material that a joint's cells stand in
  };
  [[nodiscard]] std::uint32_t cover_of(const SolidFace& face) const;

  SolidGrid grid_;
  std::vector<CellKind> kinds_;             ///< one entry per entry of grid_.materials
  std::vector<scene::Material> materials_;  ///< all materials of the scene
  std::vector<std::uint8_t> cavity_cell_;   ///< one entry per cell: 1 in a closed cavity
  std::shared_ptr<const VoxelShape> shape_;
  double cavity_k_ = 0.0;
};

/// Finds the face of a model at a point of its surface.
class FaceFinder {
 public:
  /// Indexes the faces of a grid, whose thickest sheet is given in m.
  FaceFinder(const SolidGrid& grid, std::span<const SolidFace> faces, double thickest_sheet_m);
  /// Returns the face at a point, or nothing. `normal` points out of the solid, along an axis. A
  /// point between two faces belongs to either. A point on the front of a sheet and the normal of
  /// its back give the face of the back.
  [[nodiscard]] std::optional<std::uint32_t> find(const glm::dvec3& point_m,
                                                  const glm::dvec3& normal) const;

 private:
  std::array<std::vector<double>, 3> lines_m_;
  double thickest_sheet_m_ = 0.0;
  std::unordered_map<std::uint64_t, std::uint32_t> faces_;
};

}  // namespace emit::reference
