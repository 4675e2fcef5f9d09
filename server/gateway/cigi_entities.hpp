// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "emit/physics/frames.hpp"
#include "emit/protocol/cigi/host_packets.hpp"
#include "emit/protocol/cigi/host_packets4.hpp"
#include "emit/protocol/host_frame.hpp"
#include "gateway/cigi_part.hpp"
#include "gateway/georeference.hpp"
#include "gateway/scene_query.hpp"

namespace emit::server {

/// Entities of a CIGI host with their parents, parts, rates and clamps, and the view that is the
/// sensor.
/// What a host does not send again keeps its last value.
///
/// Thread: one owner. Real time: RT-safe after construction.
class CigiEntities {
 public:
  /// Largest number of entities, of the scenario or not.
  static constexpr std::size_t kMaxEntities = 2048;
  /// Parents above an entity that are followed.
  static constexpr int kMaxParents = 16;

  struct Options {
    std::uint16_t seeker = 0;  ///< entity that carries the sensor until View Control says otherwise
    std::uint16_t view = 0;    ///< view that is the sensor
    /// A frame shows where things are by then, so that an entity which the host does not send again
    /// has to be said to stand.
    bool predicted = false;
    /// Entities of the host with their number in the scenario. Others have the same number there.
    std::vector<std::pair<std::uint16_t, std::uint32_t>> entities;
    /// Articulated parts, each of them an entity of the scenario.
    std::vector<CigiPart::Joint> parts;
    /// Says whether the scenario has an entity.
    std::function<bool(std::uint32_t entity_id)> known;
  };
  /// `scene` may be null: nothing is clamped to the ground then. Both arguments outlive the object.
  CigiEntities(const Georeference& earth, SceneQuery* scene, Options options);

  /// Forgets every entity, and the offsets of the view.
  void clear() noexcept;
  /// Marks every entity, so that the next frames carry all of them.
  /// @param jump  also says that they are there at once
  void mark_all(bool jump) noexcept;
  /// Moves on to the simulation time of the next packets. Entities with rates move with it.
  void set_time(std::int64_t time_ns) noexcept { time_ns_ = time_ns; }
  /// Shifts the time of all packets so far.
  void shift(std::int64_t by_ns) noexcept;

  /// Takes a packet. Returns false where it has no effect: there is no room for one more entity.
  bool take(const protocol::cigi::EntityControl& packet) noexcept;
  /// The two halves of Entity Control in version 4.0. An entity has a pose once the first has come,
  /// and is seen once the second says so.
  bool take(const protocol::cigi::EntityPosition& packet) noexcept;
  bool take(const protocol::cigi::EntityControl40& packet) noexcept;
  /// Moves a part about its joint. Returns false where it has no effect: no such part.
  bool take(const protocol::cigi::ArticulatedPartControl& packet) noexcept;
  bool take(const protocol::cigi::ShortArticulatedPartControl& packet) noexcept;
  /// The entity moves by these rates until Entity Control says where it is; a part until other
  /// rates come. Returns false where it has no effect: no such entity or part, or an attached
  /// entity.
  bool take(const protocol::cigi::RateControl& packet) noexcept;
  /// Returns false where it has no effect: another view, or a group of views.
  bool take(const protocol::cigi::ViewControl& packet) noexcept;

  /// Returns true where the entity that carries the sensor has a pose.
  [[nodiscard]] bool has_seeker() const noexcept { return seeker_pose().has_value(); }
  /// Writes sensor and moved entities into a host frame, at most kMaxEntitiesPerFrame of them.
  /// Those without room come with the next frames. Entities that the scenario does not have are
  /// left out.
  /// @pre has_seeker()
  void fill(protocol::HostFrameData& frame) noexcept;
  /// Moves the entities of the scene for rays to where they are now.
  void place_in_scene() noexcept;

  /// Returns the pose of an entity of the host; none: unknown, destroyed, or its parents are.
  [[nodiscard]] std::optional<physics::Pose> pose_of(std::uint16_t id) const noexcept;
  [[nodiscard]] std::optional<physics::Pose> pose_of_part(std::uint16_t entity_id,
                                                          std::uint8_t part_id) const noexcept;
  /// Returns the pose of the sensor; none: its entity has none.
  [[nodiscard]] std::optional<physics::Pose> seeker_pose() const noexcept;
  /// Returns the parent of an entity; none: it has none.
  [[nodiscard]] std::optional<std::uint16_t> parent_of(std::uint16_t id) const noexcept;
  /// Returns the number that the host has for an entity of the scenario, or for the one whose part
  /// it is.
  [[nodiscard]] std::uint16_t host_id_of(std::uint32_t entity_id) const noexcept;
  /// Returns an entity that the scenario does not have, which the host has sent since the last
  /// call; each comes once.
  [[nodiscard]] std::optional<std::uint16_t> take_unknown() noexcept;

 private:
  struct Entity {
    std::uint16_t id = 0;
    std::optional<std::size_t> part;  ///< in `parts_`; none: an entity of the host
    protocol::cigi::EntityControl control;
    std::optional<protocol::cigi::RateControl> rates;
    std::int64_t time_ns = 0;     ///< of its place and of the way below
    glm::dvec3 way_world_m{0.0};  ///< by rates, since the host said where it is
    glm::dquat turn_body{1.0, 0.0, 0.0, 0.0};
    int repeats = 0;  ///< frames that say once more that it stands
    std::uint32_t scenario_id = 0;
    bool has_place = false;  ///< the host has said where it is
    bool known = false;      ///< the scenario has it
    bool told = false;       ///< take_unknown() has given it
    bool changed = false;    ///< its own packets came since the last fill()
    bool marked = false;     ///< a frame must still carry it
    bool jumps = true;       ///< the next update is a jump
  };
  /// Returns the entity, made anew if there is none; null: there is no room.
  [[nodiscard]] Entity* find_or_make(std::uint16_t id) noexcept;
  [[nodiscard]] Entity* find(std::uint16_t id) noexcept;
  [[nodiscard]] const Entity* find(std::uint16_t id) const noexcept;
  /// Returns the entity that stands for a part; null: there is no such part.
  [[nodiscard]] Entity* find_part(std::uint16_t entity_id, std::uint8_t part_id) noexcept;
  [[nodiscard]] static bool hangs(const Entity& entity) noexcept {
    return entity.part || entity.control.attached;
  }
  /// Returns what carries an entity that hangs on another one; null: it is unknown.
  [[nodiscard]] const Entity* carrier_of(const Entity& entity) const noexcept;
  void after_part_packet(Entity& entity) noexcept;
  [[nodiscard]] std::optional<physics::Pose> pose_of(const Entity& entity,
                                                     int parents) const noexcept;
  [[nodiscard]] physics::Pose pose_on_earth(const Entity& entity) const noexcept;
  /// Returns the pose that the host has said last.
  [[nodiscard]] physics::Pose said_pose(const Entity& entity) const noexcept;
  /// Adds the way by its rates up to now to the entity.
  void move_on(Entity& entity) noexcept;
  [[nodiscard]] bool is_moving(const Entity& entity) const noexcept {
    if (entity.part) return parts_[*entity.part].is_moving(time_ns_);
    return entity.rates && !entity.control.attached && entity.time_ns != time_ns_;
  }
  [[nodiscard]] std::optional<protocol::PoseRates> rates_of(
      const Entity& entity, const physics::Pose& pose) const noexcept;
  [[nodiscard]] bool has_moved(const Entity& entity) const noexcept;
  /// Returns true where the entity or what carries it jumps.
  [[nodiscard]] bool jumps_with(const Entity& entity) const noexcept;
  [[nodiscard]] bool is_on(const Entity& entity) const noexcept;

  const Georeference& earth_;
  SceneQuery* scene_;
  Options options_;
  std::vector<CigiPart> parts_;
  std::vector<Entity> entities_;  ///< parts first; reserved at the start
  static constexpr std::uint16_t kNone = 0xffff;
  std::unique_ptr<std::array<std::uint16_t, 65536>> places_;  ///< by id, in `entities_`
  std::int64_t time_ns_ = 0;
  std::size_t next_ = 0;  ///< where the next frame goes on among those that are marked
  std::uint16_t carrier_ = 0;
  glm::dvec3 view_offset_body_m_{0.0};
  glm::dvec3 view_yaw_pitch_roll_rad_{0.0};
};

}  // namespace emit::server
