// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <utility>
#include <vector>

#include "history/environment.hpp"
#include "history/pose_history.hpp"
#include "surface/heat/surface_samples.hpp"
#include "surface/rays/caster_rays.hpp"

namespace emit::renderer {

/// Rays of a sample towards the sun over an interval: one packet, and all of them where its rays
/// disagree or an entity may pass.
inline constexpr std::size_t kPacketRays = CasterRays::kMaxRays;
inline constexpr std::size_t kSunRays = 4 * kPacketRays;

/// Share of a sample's sky behind entities, mean over an interval, and the one that hides most.
struct HiddenSky {
  float frac = 0.0F;
  std::uint32_t mover = 0;
};

/// Visible share of the sun's disc, mean over an interval: by all that shades, and by what stands
/// still; on an entity's own surfaces the same.
struct SunShare {
  float frac = 0.0F;
  float fixed_frac = 0.0F;
};

/// Where the sun and the entities stand when each ray of an interval is sent: instants, places in
/// the sun's disc and lateral shifts are stratified together, the same for all samples, so that a
/// penumbra comes out as a fine staircase and not as noise.
class IntervalRays {
 public:
  /// By entity: the radius of its geometry around the body's origin, in m. `sky` says which
  /// directions hidden_sky() weighs.
  explicit IntervalRays(std::vector<float> mover_radius_m, SkyMeasure sky = SkyMeasure::cosine)
      : mover_radius_m_(std::move(mover_radius_m)),
        sky_(sky),
        placements_(mover_radius_m_.size() * kSunRays),
        reaches_(mover_radius_m_.size() * kSunRays / kPacketRays) {}

  /// Directions and places for [begin_ns, end_ns]; `turn` varies the pattern between intervals.
  /// `poses` in the order of the radii. RT-safe.
  void update(std::int64_t begin_ns, std::int64_t end_ns, std::uint32_t turn,
              const Environment& environment, const EntityPoses& poses,
              const glm::dvec3& origin_world_m) noexcept;

  /// For intervals of about a second: an entity that none of a packet's rays meet passes too fast
  /// to matter, and is not sought with the others.
  void take_short() noexcept { short_ = true; }

  /// The sun stands still in the direction of the unit vector `to_sun`, and no entity is there.
  void hold(const glm::dvec3& to_sun) noexcept;

  /// Mean share of the sun's disc that the sample sees while the sun stands before its face; 0 if
  /// it never does. `blur_m`: standard deviation of the origin along the surface, which stands for
  /// the lateral conduction since then. Any thread; RT-safe.
  [[nodiscard]] SunShare sun_share(const CasterRays& rays, const SurfaceSample& sample,
                                   float start_offset_m, float blur_m) const noexcept;
  [[nodiscard]] float sun_frac(const CasterRays& rays, const SurfaceSample& sample,
                               float start_offset_m, float blur_m) const noexcept {
    return sun_share(rays, sample, start_offset_m, blur_m).frac;
  }

  /// Points of a face by bits.
  struct Spots {
    std::uint32_t faced = 0;  ///< the sun stood before the face
    std::uint32_t lit = 0;    ///< and was not hidden
    std::uint32_t open = 0;   ///< and was not hidden by what stands still
  };
  /// One ray of the interval for each of up to kPacketRays points. `face` gives their normal,
  /// material and entity; points in its frame. Any thread; RT-safe.
  [[nodiscard]] Spots spots(const CasterRays& rays, const SurfaceSample& face,
                            std::span<const glm::vec3> points_m,
                            float start_offset_m) const noexcept;

  /// Rays of a fixed set that are spread by the sky's measure. Zero where no entity is near. Any
  /// thread; RT-safe.
  [[nodiscard]] HiddenSky hidden_sky(const CasterRays& rays, const SurfaceSample& sample,
                                     float start_offset_m) const noexcept;

  /// True where an entity may shade a sample within `around_m` of `centre_m`, or hide more than
  /// 1/16 of its sky. `own`: the entity in whose frame that is, or -1. RT-safe.
  [[nodiscard]] bool touches(std::size_t mover, const glm::vec3& centre_m, float around_m,
                             std::int32_t own) const noexcept;

  [[nodiscard]] bool sun_up() const noexcept { return sun_up_; }
  /// Unit vector to the sun, of the first ray.
  [[nodiscard]] const glm::vec3& to_sun() const noexcept { return direction_[0]; }
  /// Where an entity stands in the middle of the interval.
  [[nodiscard]] const MoverPlacement& placement(std::size_t mover) const noexcept {
    return placed(mover, middle_ray_);
  }
  /// Outward normal of the sample in the middle of the interval, axes of the rays.
  [[nodiscard]] glm::vec3 normal(const SurfaceSample& sample) const noexcept;

 private:
  [[nodiscard]] const MoverPlacement& placed(std::size_t mover, std::size_t ray) const noexcept {
    return placements_[mover * kSunRays + ray];
  }
  /// Where an entity stands for each ray of the packet that begins with ray `first`.
  [[nodiscard]] std::span<const MoverPlacement> placed_in_packet(std::size_t mover,
                                                                 std::size_t first) const noexcept {
    return std::span(placements_).subspan(mover * kSunRays + first, kPacketRays);
  }

  /// Sends a ray to its place in the disc around `to_sun`.
  void aim(std::size_t ray, std::uint32_t turn, const glm::dvec3& to_sun) noexcept;

  /// False where no ray of the packet that starts within `apart_m` of `start_m` can meet the
  /// entity.
  [[nodiscard]] bool comes_near(const glm::vec3& start_m, float apart_m, std::size_t mover,
                                std::size_t packet) const noexcept;

  /// True where an entity that moves or is not always there can meet a ray other than those of the
  /// first packet.
  [[nodiscard]] bool may_pass(const SurfaceSample& sample, const glm::vec3& start_m,
                              float apart_m) const noexcept;

  /// A place in an entity's frame while a packet is sent: the first instant's, and how far it may
  /// lie from that at others.
  struct Carried {
    glm::vec3 at_m{0.0F};
    float way_m = 0.0F;
  };
  [[nodiscard]] Carried carried(const glm::vec3& at_body_m, std::int32_t mover,
                                std::size_t packet) const noexcept;

  /// Sends ray `first` + k from start k; `first` begins a packet.
  [[nodiscard]] Spots send(const CasterRays& rays, const SurfaceSample& face,
                           std::span<const glm::vec3> starts_m, std::size_t first) const noexcept;

  /// Ball that holds an entity wherever it stands while a packet is sent.
  struct Reach {
    glm::vec3 centre_m{0.0F};
    float way_m = 0.0F;      ///< of its body's origin from the centre
    float radius_m = -1.0F;  ///< negative: it is not there
    bool changes = false;    ///< it moves, turns, or is not there for some of the interval
  };
  [[nodiscard]] const Reach& reach(std::size_t mover, std::size_t packet) const noexcept {
    return reaches_[packet * mover_radius_m_.size() + mover];
  }
  /// Gathers the balls and how far the directions of each packet spread.
  void bound_packets() noexcept;

  std::vector<float> mover_radius_m_;
  SkyMeasure sky_ = SkyMeasure::cosine;
  std::vector<MoverPlacement> placements_;  ///< by entity, then ray
  std::vector<Reach> reaches_;              ///< by packet, then entity
  std::array<glm::vec3, kSunRays> direction_{};
  std::array<float, kSunRays / kPacketRays> spread_sine_{};  ///< from a packet's first direction
  std::array<glm::vec2, kSunRays> spread_{};                 ///< unit normal deviates
  std::size_t middle_ray_ = 0;
  bool short_ = false;
  bool any_mover_on_ = false;
  bool sun_up_ = false;
};

}  // namespace emit::renderer
