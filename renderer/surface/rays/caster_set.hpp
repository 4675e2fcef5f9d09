// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/matrix_float3x3.hpp>
#include <glm/ext/vector_double3.hpp>

#include "emit/physics/error.hpp"
#include "emit/scene/mesh.hpp"
#include "surface/rays/caster_rays.hpp"

struct RTCDeviceTy;
struct RTCSceneTy;

namespace emit::renderer {

struct EmbreeRelease {
  void operator()(RTCDeviceTy* device) const noexcept;
  void operator()(RTCSceneTy* scene) const noexcept;
};
using EmbreeDevice = std::unique_ptr<RTCDeviceTy, EmbreeRelease>;
using EmbreeScene = std::unique_ptr<RTCSceneTy, EmbreeRelease>;

/// A mesh of a set and where it stands.
struct CasterPart {
  std::uint32_t instance = 0;  ///< index into SceneGeometry::instances
  const scene::Mesh* mesh = nullptr;
  glm::dmat4 frame_from_mesh{1.0};
};

/// The finite vertices' box in the parts' common frame; empty without any.
[[nodiscard]] scene::Aabb bounds_of(std::span<const CasterPart> parts);

/// Triangles of one rigid frame under one hierarchy, float32 around an origin in that frame.
///
/// Small sets are one list of triangles, the fastest to trace. In those of more than
/// `flat_triangles`, meshes that stand more than once are stored once and instanced.
class CasterSet {
 public:
  CasterSet() = default;
  /// Errors: invalid_argument (an index out of range, more than 2^31 triangles, wider than 1e8 m),
  /// internal (Embree refused). Setup only.
  [[nodiscard]] static physics::Result<CasterSet> create(RTCDeviceTy* device,
                                                         std::span<const CasterPart> parts,
                                                         const glm::dvec3& origin_m,
                                                         std::uint64_t flat_triangles);

  /// Of a ball around the origin that holds every triangle.
  [[nodiscard]] float radius_m() const noexcept { return radius_m_; }

  /// Of the rays chosen by the bits of `wanted`, those that meet a face. Rays are relative to the
  /// origin.
  [[nodiscard]] std::uint32_t occluded(std::span<const CasterRay> rays,
                                       std::uint32_t wanted) const noexcept;
  /// Nearest faces, closer than limits_m[i] each. Only hits[i] with bit i of the result are
  /// written.
  [[nodiscard]] std::uint32_t nearest(std::span<const CasterRay> rays, std::uint32_t wanted,
                                      std::span<const float> limits_m,
                                      std::span<CasterHit> hits) const noexcept;

 private:
  /// Part of the flat list: triangles from `first` on, up to the next one's.
  struct FlatRange {
    std::uint32_t first = 0;
    std::uint32_t instance = 0;
  };
  struct Shared {
    std::uint32_t instance = 0;
    glm::mat3 normal_from_mesh{1.0F};  ///< inverse transpose; lengths are arbitrary
  };
  [[nodiscard]] physics::Result<void> add_flat(RTCDeviceTy* device,
                                               std::span<const CasterPart> parts,
                                               const glm::dvec3& origin_m);
  [[nodiscard]] physics::Result<void> add_shared(RTCDeviceTy* device,
                                                 std::span<const CasterPart> parts,
                                                 const glm::dvec3& origin_m);

  EmbreeScene scene_;            ///< null: nothing in it
  std::vector<FlatRange> flat_;  ///< geometry 0 of the scene, ascending by `first`
  std::vector<Shared> shared_;   ///< geometry 1 + i
  float radius_m_ = 0.0F;
};

}  // namespace emit::renderer
