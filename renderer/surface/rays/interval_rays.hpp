// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <utility>
#include <vector>

#include "history/cloud_shade.hpp"
#include "history/entity_stand.hpp"
#include "history/environment.hpp"
#include "history/pose_history.hpp"
#include "surface/heat/surface_samples.hpp"
#include "surface/rays/caster_rays.hpp"

namespace emit::renderer {

/// Number of rays of a sample towards the sun over an interval: one packet, and all packets if the
/// rays of the first one disagree or an entity may pass.
inline constexpr std::size_t kPacketRays = CasterRays::kMaxRays;
inline constexpr std::size_t kSunRays = 4 * kPacketRays;

/// Sky that entities hide from a sample, mean over an interval, and the entity that hides most of
/// it.
struct HiddenSky {
  /// Share of the rays of hidden_sky() above the horizon that entities block, 0 to 1.
  float frac = 0.0F;
  std::uint32_t entity = 0;
  /// Irradiance that comes from the hot parts of entities (HotParts), W/m2.
  float hot_w_m2 = 0.0F;
};

/// Visible share of the sun's disc, mean over the part of an interval in which the sun stands
/// before the face. Clouds are left out.
struct SunShare {
  float frac = 0.0F;  ///< with the shade of everything
  /// Share with the shade of static geometry alone. On the surfaces of an entity it equals `frac`.
  float fixed_frac = 0.0F;
};

/// Rays of one interval: directions to the sun and placements of the entities at the instant of
/// each ray. Instants, places in the disc of the sun and lateral shifts are stratified together and
/// are the same for all samples, so that a penumbra comes out as a fine staircase and not as noise.
/// One thread may update it; const functions may then run on any thread.
class IntervalRays {
 public:
  /// Makes room for the entities. `entity_radius_m` has the radius of the geometry of each entity
  /// around the origin of its body. `sky` is the measure of the directions of hidden_sky(). It
  /// allocates.
  explicit IntervalRays(std::vector<float> entity_radius_m, SkyMeasure sky = SkyMeasure::cosine)
      : entity_radius_m_(std::move(entity_radius_m)),
        sky_(sky),
        stands_(entity_radius_m_.size()),
        placements_(entity_radius_m_.size() * kSunRays),
        middle_(entity_radius_m_.size()),
        reaches_(entity_radius_m_.size() * kSunRays / kPacketRays) {}

  /// Computes directions and placements for the interval [begin_ns, end_ns]. `turn` varies the
  /// pattern between intervals. `poses` are in the order of the radii. RT-safe.
  void update(std::int64_t begin_ns, std::int64_t end_ns, std::uint32_t turn,
              const Environment& environment, const EntityPoses& poses,
              const glm::dvec3& origin_world_m) noexcept;

  /// Sets the poses of the entities for which the views of the samples were found. Before that,
  /// and with an empty list, all stands are those of the anchor. It allocates.
  /// @pre `anchors` is empty or has an entry for every entity
  void anchor(std::vector<EntityAnchor> anchors);

  /// Switches to intervals of about a second. An entity that no ray of the first packet meets then
  /// passes too fast to matter, and the other packets are not sent for its sake.
  void take_short() noexcept { short_ = true; }

  /// Fixes the sun in the direction of the unit vector `to_sun` and removes all entities. RT-safe.
  void hold(const glm::dvec3& to_sun) noexcept;

  /// Returns the mean share of the sun's disc that a sample sees while the sun stands before its
  /// face. It is 0 if the sun never does so at the instants of the first packet. `blur_m` is the
  /// standard deviation of the starts of rays along the surface; it stands for the lateral
  /// conduction since the interval (physics.md eq. 21). Any thread; RT-safe.
  [[nodiscard]] SunShare sun_share(const CasterRays& rays, const SurfaceSample& sample,
                                   float start_offset_m, float blur_m) const noexcept;
  /// Returns the share with the shade of everything.
  [[nodiscard]] float sun_frac(const CasterRays& rays, const SurfaceSample& sample,
                               float start_offset_m, float blur_m) const noexcept {
    return sun_share(rays, sample, start_offset_m, blur_m).frac;
  }

  /// Returns the direct sun that broken clouds leave at a sample, mean over the interval, by the
  /// mean of the weather; 1 without such clouds. Any thread; RT-safe.
  [[nodiscard]] float cloud_sun(const SurfaceSample& sample) const noexcept {
    return clouds_.any() ? clouds_.by_mean(position_m(sample)) : 1.0F;
  }

  /// Returns whether cloud_sun() differs from 1.
  [[nodiscard]] bool clouds_pass() const noexcept { return clouds_.any(); }

  /// Bits of points of a face; see spots().
  struct Spots {
    std::uint32_t faced = 0;  ///< the sun stood before the face
    std::uint32_t lit = 0;    ///< and nothing hid it
    std::uint32_t open = 0;   ///< and no static geometry hid it
  };
  /// Sends one ray towards the sun for each of up to kPacketRays points. `face` gives their normal,
  /// material and entity; the points are in its frame. Any thread; RT-safe.
  [[nodiscard]] Spots spots(const CasterRays& rays, const SurfaceSample& face,
                            std::span<const glm::vec3> points_m,
                            float start_offset_m) const noexcept;

  /// Returns the sky that entities hide from a sample. It sends a fixed set of rays, spread by the
  /// measure of the sky. Static geometry in front of an entity is not looked at. The result is zero
  /// if no entity is near, and on the surfaces of entities. Any thread; RT-safe.
  [[nodiscard]] HiddenSky hidden_sky(const CasterRays& rays, const SurfaceSample& sample,
                                     float start_offset_m) const noexcept;

  /// Returns true if an entity may shade a sample within `around_m` of `centre_m`, or hide more
  /// than 1/16 of its sky. `own` is the entity in whose frame that place is, or -1. RT-safe.
  [[nodiscard]] bool touches(std::size_t entity, const glm::vec3& centre_m, float around_m,
                             std::int32_t own) const noexcept;

  /// Returns whether the sun is high enough to count (StepPlan::kMinSunElevationRad) at the instant
  /// of any ray.
  [[nodiscard]] bool sun_up() const noexcept { return sun_up_; }
  /// Returns the unit vector of the first ray, which points to the disc of the sun.
  [[nodiscard]] const glm::vec3& to_sun() const noexcept { return direction_[0]; }
  /// Returns the placement of an entity in the middle of the interval.
  [[nodiscard]] const EntityPlacement& placement(std::size_t entity) const noexcept {
    return placed(entity, middle_ray_);
  }
  /// Returns the placements of all entities in the middle of the interval.
  [[nodiscard]] std::span<const EntityPlacement> middle_placements() const noexcept {
    return middle_;
  }
  /// Returns whether an entity is in the scene and stands still over the whole interval.
  [[nodiscard]] bool stands(std::size_t entity) const noexcept;
  /// Returns the mean stand of an entity over the interval.
  [[nodiscard]] const EntityStand& stand(std::size_t entity) const noexcept {
    return stands_[entity];
  }
  /// Returns the outward normal of a sample in the middle of the interval, in world axes.
  [[nodiscard]] glm::vec3 normal(const SurfaceSample& sample) const noexcept;
  /// Returns the place of a sample in the middle of the interval, rel.
  [[nodiscard]] glm::vec3 position_m(const SurfaceSample& sample) const noexcept;

 private:
  [[nodiscard]] const EntityPlacement& placed(std::size_t entity, std::size_t ray) const noexcept {
    return placements_[entity * kSunRays + ray];
  }
  /// Returns the placements of an entity for the packet that begins with ray `first`.
  [[nodiscard]] std::span<const EntityPlacement> placed_in_packet(
      std::size_t entity, std::size_t first) const noexcept {
    return std::span(placements_).subspan(entity * kSunRays + first, kPacketRays);
  }

  /// Points a ray at its place in the disc around `to_sun` and sets its lateral shift.
  void aim(std::size_t ray, std::uint32_t turn, const glm::dvec3& to_sun) noexcept;

  /// Returns false if no ray of a packet that starts within `apart_m` of `start_m` can hit the
  /// entity.
  [[nodiscard]] bool comes_near(const glm::vec3& start_m, float apart_m, std::size_t entity,
                                std::size_t packet) const noexcept;

  /// Returns true if an entity that moves, or is not always in the scene, can block a ray that is
  /// not in the first packet.
  [[nodiscard]] bool may_pass(const SurfaceSample& sample, const glm::vec3& start_m,
                              float apart_m) const noexcept;

  /// Path of a place in the frame of an entity while a packet is sent: its position at the first
  /// instant, and the distance that it may have from there at other instants.
  struct Carried {
    glm::vec3 at_m{0.0F};
    float way_m = 0.0F;
  };
  /// Returns the path of a place; a static place does not move.
  [[nodiscard]] Carried carried(const glm::vec3& at_body_m, std::int32_t entity,
                                std::size_t packet) const noexcept;

  /// Sends ray `first` + k from start k, against static geometry and entities. `first` begins a
  /// packet.
  [[nodiscard]] Spots send(const CasterRays& rays, const SurfaceSample& face,
                           std::span<const glm::vec3> starts_m, std::size_t first) const noexcept;

  /// Ball that holds an entity at all its placements while a packet is sent.
  struct Reach {
    glm::vec3 centre_m{0.0F};
    float way_m = 0.0F;      ///< largest distance of the origin of the body from the centre
    float radius_m = -1.0F;  ///< negative: the entity is not in the scene
    bool changes = false;    ///< it moves, turns, or is away for a part of the interval
  };
  [[nodiscard]] const Reach& reach(std::size_t entity, std::size_t packet) const noexcept {
    return reaches_[packet * entity_radius_m_.size() + entity];
  }
  /// Computes the balls, and how far the directions of each packet spread.
  void bound_packets() noexcept;

  CloudShade clouds_;
  std::vector<float> entity_radius_m_;
  SkyMeasure sky_ = SkyMeasure::cosine;
  std::vector<EntityAnchor> anchors_;        ///< by entity, or empty
  std::vector<EntityStand> stands_;          ///< by entity
  std::vector<EntityPlacement> placements_;  ///< by entity, then ray
  std::vector<EntityPlacement> middle_;      ///< by entity
  std::vector<Reach> reaches_;               ///< by packet, then entity
  std::array<glm::vec3, kSunRays> direction_{};
  /// Largest distance of a direction from the first one of its packet.
  std::array<float, kSunRays / kPacketRays> spread_sine_{};
  std::array<glm::vec2, kSunRays> spread_{};  ///< lateral shifts: unit normal deviates
  std::size_t middle_ray_ = 0;
  bool short_ = false;
  bool any_entity_on_ = false;
  bool sun_up_ = false;
};

}  // namespace emit::renderer
