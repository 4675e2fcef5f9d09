// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "surface/model/surface_model.hpp"
#include "surface/rays/interval_rays.hpp"

namespace emit::renderer {

/// What an entity's faces send in long wave, for each of the six directions of the world's axes.
struct MoverFaces {
  /// By axis: towards its positive direction, then its negative one.
  std::array<float, 6> area_m2{};
  std::array<float, 6> sent_w{};

  /// Mean of the faces that look against a surface of that unit normal; negative where there are
  /// none.
  [[nodiscard]] float towards_w_m2(const glm::vec3& normal) const noexcept;
};

/// What entities send towards the surfaces near them: ground under a vehicle sees its underside.
/// Immutable after construction; any thread.
class MoverGlow {
 public:
  MoverGlow() = default;
  /// Weighs the samples of entities by their share of the surface.
  MoverGlow(const SurfaceModel& model, const scene::SceneGeometry& geometry,
            std::span<const std::int32_t> mover_of_object);

  /// `longwave_out_w_m2(i)`: of sample i. Entities stand as in the middle of the interval; `out` by
  /// entity. RT-safe.
  template <class LongwaveOut>
  void measure(const SurfaceSamples& all, const IntervalRays& interval,
               const LongwaveOut& longwave_out_w_m2, std::span<MoverFaces> out) const noexcept {
    for (MoverFaces& faces : out) faces = {};
    for (const Part& part : parts_) {
      const SurfaceSample& sample = all.samples[part.sample];
      add(interval.normal(sample), part.area_m2, longwave_out_w_m2(part.sample),
          out[static_cast<std::size_t>(sample.mover)]);
    }
  }

 private:
  struct Part {
    std::uint32_t sample = 0;
    float area_m2 = 0.0F;
  };
  static void add(const glm::vec3& normal, float area_m2, float sent_w_m2,
                  MoverFaces& faces) noexcept;

  std::vector<Part> parts_;
};

}  // namespace emit::renderer
