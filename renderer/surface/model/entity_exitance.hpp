// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "emit/physics/check.hpp"
#include "emit/scene/mesh.hpp"
#include "surface/model/surface_model.hpp"
#include "surface/rays/interval_rays.hpp"

namespace emit::renderer {

/// Long-wave radiation that leaves an entity, summed over its faces for each of the six directions
/// of the world's axes. Faces count with the cosine to the axis.
struct EntityFaces {
  /// Sums for each axis: first faces that look in its positive direction, then those that look in
  /// its negative one.
  std::array<float, 6> area_m2{};  ///< projected area
  std::array<float, 6> sent_w{};   ///< power that leaves the projected area

  /// Returns the mean exitance, W/m2, of the faces that look against a surface with this unit
  /// normal (world axes). The three axes count with the square of the normal. The result is
  /// negative if the entity has no such faces.
  [[nodiscard]] float towards_w_m2(const glm::vec3& normal) const noexcept;
};

/// Long-wave radiation that entities send towards the surfaces near them (physics.md, section 10).
/// The ground under a vehicle sees its underside, for example. Immutable after construction; any
/// thread.
class EntityExitance {
 public:
  EntityExitance() = default;
  /// Lists the samples of entities with the area that each stands for. Setup only: it allocates.
  /// `entity_of_object` has the entity of every object, or -1 for a static one.
  EntityExitance(const SurfaceModel& model, const scene::SceneGeometry& geometry,
                 std::span<const std::int32_t> entity_of_object);

  /// Sums over all faces of each entity as it stands in the middle of the interval.
  /// `longwave_out_w_m2(i)` returns the exitance of sample i. Entry m of `out` receives entity m.
  /// RT-safe.
  /// @pre `out` has an entry for every entity with samples
  template <class LongwaveOut>
  void measure(const SurfaceSamples& all, const IntervalRays& interval,
               const LongwaveOut& longwave_out_w_m2, std::span<EntityFaces> out) const noexcept {
    for (EntityFaces& faces : out) faces = {};
    for (const Part& part : parts_) {
      const SurfaceSample& sample = all.samples[part.sample];
      EMIT_DCHECK_OP(static_cast<std::size_t>(sample.entity), <, out.size());
      add(interval.normal(sample), part.area_m2, longwave_out_w_m2(part.sample),
          out[static_cast<std::size_t>(sample.entity)]);
    }
  }

 private:
  /// Sample of an entity and the area that it stands for.
  struct Part {
    std::uint32_t sample = 0;
    float area_m2 = 0.0F;
  };
  /// Adds the radiation of one sample to the axes that its face looks along.
  static void add(const glm::vec3& normal, float area_m2, float sent_w_m2,
                  EntityFaces& faces) noexcept;

  std::vector<Part> parts_;
};

}  // namespace emit::renderer
