// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/ext/matrix_float3x3.hpp>
#include <glm/ext/matrix_float4x4.hpp>
#include <glm/geometric.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "surface/model/drive_sensitivity.hpp"
#include "surface/model/surface_model.hpp"
#include "surface/rays/held_faces.hpp"
#include "surface/rays/sphere_view.hpp"
#include "surface/warm_up/sent_history.hpp"
#include "surface/warm_up/sun_tracer.hpp"

namespace emit::renderer {

/// Place of a face that a sample sees. It stands for samples until these are numbered.
struct SeenPlace {
  std::uint32_t instance = 0;
  std::uint32_t triangle = 0;
  glm::vec2 barycentric{0.0F};
  float weight_frac = 0.0F;
  bool behind = false;  ///< the side that its winding calls inside is seen
};

/// Part of a view that shows faces with a prescribed temperature: what they send is known before
/// samples exchange radiation.
struct HeldView {
  float frac = 0.0F;                             ///< of the hemisphere
  float longwave_w_m2 = 0.0F;                    ///< times that share
  std::array<float, kMostBands> sent_w_m2_sr{};  ///< by band, times that share
};

/// Samples of one instance while its mesh is being refined. Arrays are by vertex of the mesh.
struct SurfacePatch {
  std::uint32_t mesh = 0;
  std::uint32_t object = 0;
  std::int32_t entity = -1;
  glm::mat4 rel_from_mesh{1.0F};  ///< body_from_mesh for entities
  glm::mat3 normal_from_mesh{1.0F};

  std::vector<SurfaceSample> samples;
  /// Views: the faces that a vertex sees, by rays of its own. A vertex that shares the view of
  /// another one has none. The sum of the weights is arbitrary: they are scaled to the share of the
  /// hemisphere that is not open.
  std::vector<std::vector<SeenPlace>> seen;
  std::vector<std::uint32_t> view_of;                 ///< vertex whose view counts for this one
  std::vector<physics::FosterState<double>> start_k;  ///< modes at the start of the history
  SentHistory sent;  ///< rows of SentRow by vertex; they are empty if nothing is exchanged
  std::vector<SampleState> states;
  std::vector<SampleOutput> outputs;
  /// Difference of the temperature from the mean of the vertex's parents, K; negative if it has
  /// none.
  std::vector<float> surplus_k;
  std::vector<glm::vec3> to_sky;  ///< ViewShares::to_sky
  /// Share of the hemisphere that shows faces with a prescribed temperature, and what they send.
  std::vector<HeldView> held;
  /// Greatest difference of the shares of sky and surroundings from the mean of the vertex's
  /// parents. It is infinite if the vertex has no parents, and until the difference is known.
  std::vector<float> sky_surplus_frac;
  RowStore<float> sun_frac;        ///< rows by vertex: visible share of the sun in each interval
  RowStore<HiddenSky> hidden_sky;  ///< rows by vertex; the rows are empty without entities
  /// Rows by vertex: IntervalRays::cloud_sun(); the rows are empty without broken clouds.
  RowStore<float> cloud_sun;
  /// Patch of the other faces of sheets, with the same vertices; null if the mesh has no sheets.
  std::unique_ptr<SurfacePatch> back;

  /// Length by which `rel_from_mesh` stretches an axis of the mesh at most.
  [[nodiscard]] float greatest_scale() const noexcept {
    return std::max({glm::length(glm::vec3(rel_from_mesh[0])),
                     glm::length(glm::vec3(rel_from_mesh[1])),
                     glm::length(glm::vec3(rel_from_mesh[2]))});
  }
  /// Sets the number of intervals that rows hold, whether there are entities and broken clouds,
  /// and whether `sent` is stored. @pre the patch has no vertices
  void begin(std::size_t intervals, bool entities, bool clouds, bool keeps_sent);
  /// Makes room for the samples of `vertices` vertices in all.
  /// @pre begin(); vertices never become fewer
  void grow(std::size_t vertices);
  /// Frees everything but sun_frac, hidden_sky, cloud_sun and sent, on both sides of sheets.
  void free_all_but_rows();

 private:
  bool begun_ = false;
};

/// Facts about the place of a sample that the sample itself does not hold.
struct SampleStand {
  glm::vec3 drawn_m{0.0F};  ///< place on the surface as drawn, moved off edges
  glm::vec3 inward{0.0F};   ///< unit tangent away from the edge it lies on; zero inside a face
  /// Vertices of the edge that it halves; empty unless both are evaluated already.
  std::optional<std::array<std::uint32_t, 2>> parents = std::nullopt;
};

/// Sample to be evaluated: vertex `index` of a patch.
struct NewSample {
  SurfacePatch* patch = nullptr;
  std::uint32_t index = 0;
  SampleStand stand;
};

/// Evaluator of samples of patches: view, shade and history. Owner: the builder. Any thread.
class PatchSampler {
 public:
  /// Keeps a reference to `inputs`, which must outlive it.
  PatchSampler(const SurfaceInputs& inputs, const DriveSensitivity& sensitivity,
               const SurfaceModelOptions& options);

  [[nodiscard]] const SunTracer& tracer() const noexcept { return tracer_; }
  /// Returns true if samples exchange heat with others or with the interior of their body, or have
  /// twins, so that the histories of their output are needed.
  [[nodiscard]] bool keeps_sent() const noexcept {
    return options_.exchange || options_.lateral || in_.heat.has_bodies() || in_.heat.has_twins();
  }

  /// Start of the latest sample in the open. Neighbours face alike and share it. Each thread has
  /// its own memo.
  struct StartMemo {
    std::uint32_t material = kNoSample;
    glm::vec3 normal{0.0F};
    SampleState state;
  };

  /// Evaluates samples and their other faces. Everything that a sample sees counts as surroundings
  /// here.
  /// @pre there are at most kAdvanceTogether; position, normal, material and entity stand in
  /// patch->samples; none is the parent of another
  void evaluate(std::span<const NewSample> samples, StartMemo& memo) const;

 private:
  /// State at the start of the record, by the thermal model. `sun_frac` has the share of the sun
  /// that reaches the sample, by interval.
  [[nodiscard]] SampleState start_state(const SurfaceSample& sample,
                                        std::span<const float> sun_frac,
                                        StartMemo& memo) const noexcept;

  /// Takes the mean of the parents' views if their own views were about the mean of their parents'.
  /// Returns false, and changes nothing, if rays are needed.
  bool inherit_view(SurfacePatch& patch, std::uint32_t index, const SampleStand& stand) const;

  /// Integrates the temperatures over the history, and stores what the samples send out.
  void integrate(std::span<const NewSample> samples, StartMemo& memo) const;

  /// Returns true if a face of the scene as loaded belongs to a sheet. A sample that sees its back
  /// is not inside a body.
  [[nodiscard]] bool of_a_sheet(const SeenFace& face) const noexcept;

  /// Puts faces of a prescribed temperature into a view by their areas, in place of what rays found
  /// of them.
  void take_held(SurfacePatch& patch, std::uint32_t index, const ViewPoint& point,
                 const CasterSelection& selection) const;

  /// Finds the shares of sky and surroundings of a sample by rays, and whether it is covered.
  void look_around(SurfacePatch& patch, std::uint32_t index, const SampleStand& stand) const;
  /// Looks around from a sample that lies on the foot of a wall, from beside the wall: its view
  /// from the line itself would be that of the ground under the wall or of the open one, by
  /// rounding.
  void leave_foot(SurfacePatch& patch, std::uint32_t index, const SampleStand& stand) const;

  /// Returns the share of the rain around the vertical that nothing above a point keeps off.
  [[nodiscard]] float rain_share(const ViewPoint& point,
                                 const CasterSelection& selection) const noexcept;

  /// Finds the faces that fill the part of the hemisphere which is not open.
  void look_at_faces(SurfacePatch& patch, std::uint32_t index, const ViewPoint& point,
                     const CasterSelection& selection) const;

  /// Sends rays along the surface, a little above and a little below it. They show how far it is a
  /// plane and which walls stand on it.
  void feel_along(SurfacePatch& patch, std::uint32_t index, const ViewPoint& point,
                  const CasterSelection& selection) const;

  const SurfaceInputs& in_;
  SurfaceModelOptions options_;
  HeldFaces held_;
  ViewSampler view_;
  ViewSampler sky_;
  SphereSampler sphere_;
  SunTracer tracer_;
  std::array<glm::vec3, CasterRays::kMaxRays> rain_from_{};  ///< directions, of even weight
  /// Distance that heat spreads over in the memory of the slowest mode, by material; 0 where no
  /// heat moves along the surface.
  std::vector<double> memory_m_;
  std::vector<float> sky_limit_frac_;  ///< by material: difference up to which shares are alike
};

}  // namespace emit::renderer
