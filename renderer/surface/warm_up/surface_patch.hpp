// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/matrix_float3x3.hpp>
#include <glm/ext/matrix_float4x4.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "surface/model/drive_worth.hpp"
#include "surface/model/surface_model.hpp"
#include "surface/rays/sphere_view.hpp"
#include "surface/warm_up/sent_history.hpp"
#include "surface/warm_up/sun_tracer.hpp"

namespace emit::renderer {

/// A seen face until samples are numbered.
struct SeenPlace {
  std::uint32_t instance = 0;
  std::uint32_t triangle = 0;
  glm::vec2 barycentric{0.0F};
  float weight_frac = 0.0F;
  bool behind = false;  ///< from where the winding calls inside
};

/// The samples of one instance while its mesh is being refined; arrays by vertex of the mesh.
struct SurfacePatch {
  std::uint32_t mesh = 0;
  std::uint32_t object = 0;
  std::int32_t mover = -1;
  glm::mat4 rel_from_mesh{1.0F};  ///< body_from_mesh for entities
  glm::mat3 normal_from_mesh{1.0F};

  std::vector<SurfaceSample> samples;
  /// Views: what a vertex sees of faces, by rays of its own. Vertices that share another one's view
  /// have none. Weights add up to something: the share that is not open is spread over them.
  std::vector<std::vector<SeenPlace>> seen;
  std::vector<std::uint32_t> view_of;                 ///< vertex whose view it is
  std::vector<physics::FosterState<double>> start_k;  ///< modes at the start of the history
  SentHistory sent;                                   ///< what it sends out over the history
  std::vector<SampleState> states;
  std::vector<SampleOutput> outputs;
  /// Difference from the mean of the vertex's parents, K; negative where it has none.
  std::vector<float> surplus_k;
  std::vector<glm::vec3> to_sky;  ///< ViewShares::to_sky
  /// How far its shares of the sky were from the mean of the vertex's parents; infinite where it
  /// has none, and until that is known.
  std::vector<float> sky_surplus_frac;
  std::vector<float> sun_frac;        ///< by vertex, then interval
  std::vector<HiddenSky> hidden_sky;  ///< likewise; empty without entities
  /// The other faces of sheets, by the same vertices; null where the mesh has none.
  std::unique_ptr<SurfacePatch> back;

  /// Sets what is kept of every vertex: over how many intervals, whether there are entities, and
  /// whether what it sends is kept. @pre no vertices yet
  void begin(std::size_t intervals, bool movers, bool keeps_sent);
  /// Makes room for samples of `vertices` vertices. @pre begin()
  void grow(std::size_t vertices);

 private:
  std::size_t intervals_ = 0;
  bool movers_ = false;
};

/// Where a sample stands, beside its own place.
struct SampleStand {
  glm::vec3 drawn_m{0.0F};  ///< its place on the surface as drawn, off edges
  glm::vec3 inward{0.0F};   ///< unit tangent away from the edge it lies on; zero where on none
  /// Vertices of the edge it halves, where both are evaluated.
  std::optional<std::array<std::uint32_t, 2>> parents = std::nullopt;
};

/// Evaluates single samples of patches: view, visibility and history. Owner: the builder. Any
/// thread.
class PatchSampler {
 public:
  PatchSampler(const SurfaceInputs& inputs, const DriveWorth& worth,
               const SurfaceModelOptions& options);

  [[nodiscard]] const SunTracer& tracer() const noexcept { return tracer_; }
  /// True where samples exchange heat with others, so that what they send must be known.
  [[nodiscard]] bool keeps_sent() const noexcept { return options_.exchange || options_.lateral; }

  /// The state that the latest sample started with: its neighbours, which face alike, start with
  /// the same. Each thread has its own.
  struct StartMemo {
    std::uint32_t material = kNoSample;
    glm::vec3 normal{0.0F};
    SampleState state;
  };

  /// Fills everything of sample `index`, whose position, normal, material and mover stand in
  /// patch.samples already, and of its other side. What it sees counts as the surroundings here.
  void evaluate(SurfacePatch& patch, std::uint32_t index, const SampleStand& stand,
                StartMemo& memo) const;

 private:
  /// State at the start of the record, as the thermal model has it.
  [[nodiscard]] SampleState start_state(const SurfaceSample& sample,
                                        StartMemo& memo) const noexcept;

  /// Takes the view of its parents where theirs was what it would have been of their own; false,
  /// and nothing changed, where rays are needed.
  bool inherit_view(SurfacePatch& patch, std::uint32_t index, const SampleStand& stand) const;

  /// Temperature over the history, and what the sample sends out.
  void integrate(SurfacePatch& patch, std::uint32_t index, StartMemo& memo) const;

  /// A face of the scene as loaded that is a sheet's: who sees its back is in no body.
  [[nodiscard]] bool of_a_sheet(const SeenFace& face) const noexcept;

  void look_around(SurfacePatch& patch, std::uint32_t index, const SampleStand& stand) const;

  /// Faces that fill the part of the hemisphere which is not open.
  void look_at_faces(SurfacePatch& patch, std::uint32_t index, const ViewPoint& point,
                     const CasterSelection& selection) const;

  /// Rays along the surface, a little above and a little below: how far it is a plane, and which
  /// walls stand on it.
  void feel_along(SurfacePatch& patch, std::uint32_t index, const ViewPoint& point,
                  const CasterSelection& selection) const;

  const SurfaceInputs& in_;
  SurfaceModelOptions options_;
  ViewSampler view_;
  ViewSampler sky_;
  SphereSampler sphere_;
  SunTracer tracer_;
  double history_s_ = 0.0;
  std::vector<float> diffusivity_m2_s_;  ///< by material, of its first layer
  std::vector<float> sky_limit_frac_;    ///< by material: shares that differ less are alike
};

}  // namespace emit::renderer
