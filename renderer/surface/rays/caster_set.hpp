// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/matrix_float3x3.hpp>
#include <glm/ext/vector_double3.hpp>

#include "embree/embree_device.hpp"
#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"
#include "surface/rays/caster_rays.hpp"

namespace emit::renderer {

/// Mesh of a set and its placement.
struct CasterPart {
  std::uint32_t instance = 0;  ///< index into SceneGeometry::instances
  const scene::Mesh* mesh = nullptr;
  glm::dmat4 frame_from_mesh{1.0};
};

/// Returns the box of the finite vertices in the common frame of the parts. It is empty if there
/// are none.
[[nodiscard]] scene::Aabb bounds_of(std::span<const CasterPart> parts);

/// Triangles of one rigid frame in one Embree hierarchy, in float32 around an origin in that frame.
///
/// A small set is one list of triangles, which is fastest to trace. A set of more than
/// `flat_triangles` stores each mesh that appears several times once and places it as instances.
/// Immutable; any thread; queries allocate nothing.
class CasterSet {
 public:
  CasterSet() = default;
  /// Builds the hierarchy. Setup only. Errors: invalid_argument (an index out of range, more than
  /// 2^31 triangles, wider than 1e8 m), internal (Embree refused).
  [[nodiscard]] static physics::Result<CasterSet> create(RTCDeviceTy* device,
                                                         std::span<const CasterPart> parts,
                                                         const glm::dvec3& origin_m,
                                                         std::uint64_t flat_triangles);

  /// Returns the radius of a ball around the origin that holds every triangle.
  [[nodiscard]] float radius_m() const noexcept { return radius_m_; }

  /// Returns the bits of those rays of `wanted` that hit a face. Rays are relative to the origin.
  [[nodiscard]] std::uint32_t occluded(std::span<const CasterRay> rays,
                                       std::uint32_t wanted) const noexcept;
  /// Finds the nearest faces of the rays of `wanted`, closer than limits_m[i] each. Only hits[i]
  /// with a set bit i in the result are written.
  [[nodiscard]] std::uint32_t nearest(std::span<const CasterRay> rays, std::uint32_t wanted,
                                      std::span<const float> limits_m,
                                      std::span<CasterHit> hits) const noexcept;

 private:
  /// Range of the flat list that belongs to one instance. It ends where the next range begins.
  struct FlatRange {
    std::uint32_t first = 0;
    std::uint32_t instance = 0;
  };
  /// Instance of a mesh that is stored once.
  struct Shared {
    std::uint32_t instance = 0;
    glm::mat3 normal_from_mesh{1.0F};  ///< inverse transpose; lengths are arbitrary
  };
  /// Adds parts as one list of triangles, in the frame of the set.
  [[nodiscard]] physics::Result<void> add_flat(RTCDeviceTy* device,
                                               std::span<const CasterPart> parts,
                                               const glm::dvec3& origin_m);
  /// Adds parts as instances of meshes that are stored once.
  [[nodiscard]] physics::Result<void> add_shared(RTCDeviceTy* device,
                                                 std::span<const CasterPart> parts,
                                                 const glm::dvec3& origin_m);

  embree::Scene scene_;          ///< null: the set is empty
  std::vector<FlatRange> flat_;  ///< ranges of geometry 0 of the scene, ascending by `first`
  std::vector<Shared> shared_;   ///< entry i is geometry 1 + i
  float radius_m_ = 0.0F;
};

}  // namespace emit::renderer
