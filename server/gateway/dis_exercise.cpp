// SPDX-License-Identifier: Apache-2.0
#include "gateway/dis_exercise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <variant>

#include "emit/physics/check.hpp"
#include "emit/protocol/convert.hpp"

namespace emit::server {

namespace dis = protocol::dis;

namespace {

/// Bits of the appearance of platforms, munitions and other kinds (SISO-REF-010).
constexpr std::uint32_t kFrozen = 1U << 21U;
constexpr std::uint32_t kDeactivated = 1U << 23U;

/// Returns true for models whose attitude turns by the angular velocity.
bool turns(dis::DeadReckoningModel model) noexcept {
  using enum dis::DeadReckoningModel;
  return model == rpw || model == rvw || model == rpb || model == rvb;
}

dis::EntityId id_of(const std::string& text) {
  const auto numbers = config::parse_dis_id(text);
  EMIT_CHECK(numbers.has_value());
  return {(*numbers)[0], (*numbers)[1], (*numbers)[2]};
}

}  // namespace

DisExercise::DisExercise(const Options& options, Counters& counters, EventLog& events)
    : options_(options),
      counters_(counters),
      events_(events),
      earth_(origin_of(options.scenario)),
      period_ns_(static_cast<std::int64_t>(1e9 / options.dis.rate_hz)),
      timeout_ns_(std::llround(1e9 * options.dis.timeout_s)) {
  senders_.reserve(kMaxSenders);
  Entity seeker;
  seeker.id = id_of(options.dis.seeker);
  entities_.push_back(seeker);
  for (const config::DisEntityConfig& entity : options.dis.entities) {
    Entity out;
    out.id = id_of(entity.id);
    out.scenario_id = entity.entity;
    entities_.push_back(out);
  }
}

DisExercise::Sender* DisExercise::sender_of(const dis::EntityId& id) noexcept {
  const auto known = std::ranges::find_if(senders_, [&](const Sender& sender) {
    return sender.site == id.site && sender.application == id.application;
  });
  if (known != senders_.end()) return &*known;
  if (senders_.size() == kMaxSenders) return nullptr;
  Sender& sender = senders_.emplace_back();
  sender.site = id.site;
  sender.application = id.application;
  return &sender;
}

DisExercise::Entity* DisExercise::find(const dis::EntityId& id) noexcept {
  const auto found = std::ranges::find(entities_, id, &Entity::id);
  return found != entities_.end() ? &*found : nullptr;
}

void DisExercise::take(std::span<const std::byte> datagram, std::int64_t received_ns) noexcept {
  dis::Reader reader(datagram);
  dis::Pdu pdu;
  for (;;) {
    switch (reader.next(pdu)) {
      case dis::Step::pdu:
        if (options_.dis.exercise != 0 && reader.header().exercise_id != options_.dis.exercise) {
          counters_.add(Counter::gateway_packets_unused);
        } else if (const auto* state = std::get_if<dis::EntityState>(&pdu)) {
          take_state(*state, reader.header().timestamp, received_ns);
        } else if (const auto* update = std::get_if<dis::EntityStateUpdate>(&pdu)) {
          take_update(*update, reader.header().timestamp, received_ns);
        } else {
          counters_.add(Counter::gateway_packets_unused);
        }
        break;
      case dis::Step::other:
        counters_.add(Counter::gateway_packets_skipped);
        break;
      case dis::Step::refused:
        counters_.add(Counter::gateway_packets_refused);
        refuse(reader.fault());
        break;
      case dis::Step::broken:
        counters_.add(Counter::gateway_messages_refused);
        refuse(reader.fault());
        return;
      case dis::Step::end:
        return;
    }
  }
}

void DisExercise::refuse(const dis::Fault& fault) noexcept {
  std::array<char, dis::kFaultTextBytes> buffer;
  events_.push(EventKind::gateway_refused, fault.type, static_cast<std::uint64_t>(fault.kind),
               dis::fault_text(fault, buffer));
}

bool DisExercise::take_stamp(Entity& entity, std::uint32_t timestamp,
                             std::int64_t received_ns) noexcept {
  Sender* sender = sender_of(entity.id);
  if (sender == nullptr) {
    counters_.add(Counter::gateway_packets_unused);
    return false;
  }
  const dis::DisClock::Reading reading = sender->stamps.read(timestamp, received_ns);
  if (reading.order == dis::DisClock::Order::restart) sender->arrivals.clear();
  // Entities of one sender share stamps, so that the order counts for each entity by itself.
  const bool is_old = entity.came && reading.time_ns <= entity.stamp_ns &&
                      reading.order != dis::DisClock::Order::restart;
  if (is_old) {
    counters_.add(Counter::gateway_messages_old);
    return false;
  }
  static_cast<void>(sender->arrivals.arrived(reading.time_ns, received_ns));
  entity.sender = static_cast<std::size_t>(sender - senders_.data());
  entity.stamp_ns = reading.time_ns;
  entity.heard_ns = received_ns;
  return true;
}

void DisExercise::take_state(const dis::EntityState& state, std::uint32_t timestamp,
                             std::int64_t received_ns) noexcept {
  Entity* entity = find(state.entity_id);
  if (entity == nullptr) {
    counters_.add(Counter::gateway_packets_unused);
    return;
  }
  if (!take_stamp(*entity, timestamp, received_ns)) return;
  entity->motion = dis::motion_of(state);
  entity->frozen = (state.appearance & kFrozen) != 0;
  entity->on = (state.appearance & kDeactivated) == 0;
  entity->came = true;
}

void DisExercise::take_update(const dis::EntityStateUpdate& update, std::uint32_t timestamp,
                              std::int64_t received_ns) noexcept {
  Entity* entity = find(update.entity_id);
  // Only a whole state says by which model the entity goes on.
  if (entity == nullptr || !entity->came) {
    counters_.add(Counter::gateway_packets_unused);
    return;
  }
  if (!take_stamp(*entity, timestamp, received_ns)) return;
  entity->motion.position_ecef_m = update.location_ecef_m;
  entity->motion.body_from_ecef = dis::body_from_ecef(update.orientation);
  entity->motion.velocity_m_s = update.velocity_m_s;
  entity->frozen = (update.appearance & kFrozen) != 0;
  entity->on = (update.appearance & kDeactivated) == 0;
}

std::int64_t DisExercise::sender_time_ns(const Entity& entity, std::int64_t now_ns) const noexcept {
  return senders_[entity.sender].arrivals.sim_time_ns(now_ns);
}

bool DisExercise::is_silent(const Entity& entity, std::int64_t now_ns) const noexcept {
  return now_ns - entity.heard_ns > timeout_ns_;
}

bool DisExercise::place(const Entity& entity, std::int64_t now_ns, physics::Pose& pose,
                        std::optional<protocol::PoseRates>& rates) noexcept {
  const double since_s =
      entity.frozen ? 0.0
                    : 1e-9 * static_cast<double>(sender_time_ns(entity, now_ns) - entity.stamp_ns);
  const dis::Predicted at = dis::predict(entity.motion, since_s);
  pose.position_world_m = earth_.world_from_ecef_m(at.position_ecef_m);
  const glm::dmat3 world_from_ecef = earth_.world_from_ecef();
  pose.world_from_body =
      glm::normalize(glm::quat_cast(world_from_ecef * glm::transpose(at.body_from_ecef)));
  rates.reset();
  if (!entity.frozen) {
    rates = protocol::PoseRates{
        world_from_ecef * at.velocity_ecef_m_s,
        turns(entity.motion.model) ? entity.motion.angular_velocity_rad_s : glm::dvec3(0.0)};
  }
  if (protocol::check_pose(pose, rates) == protocol::DecodeStatus::ok) return true;
  counters_.add(Counter::gateway_packets_refused);
  events_.push(EventKind::gateway_refused, entity.id.entity, 0,
               "an entity is too far from the scenario, or too fast");
  return false;
}

bool DisExercise::next(protocol::HostFrameData& frame, std::int64_t now_ns) noexcept {
  Entity& seeker = entities_.front();
  if (!seeker.came) return false;
  // Somebody has set the clock back: the next frame is not due in hours.
  if (due_ns_ - now_ns > 2 * period_ns_) due_ns_ = now_ns;
  if (now_ns < due_ns_) return false;
  due_ns_ = now_ns - due_ns_ > period_ns_ ? now_ns + period_ns_ : due_ns_ + period_ns_;
  if (is_silent(seeker, now_ns)) return false;
  if (!place(seeker, now_ns, frame.seeker, frame.seeker_rates)) return false;
  const std::int64_t sender_ns = sender_time_ns(seeker, now_ns);
  if (run_id_ == 0) {
    run_id_ = static_cast<std::uint64_t>(now_ns);
    begin_ns_ = sender_ns;
  }
  // The clock of the sender is found to be slower or faster; simulation time does not go back.
  const std::int64_t wanted_ns = options_.first_time_ns + (sender_ns - begin_ns_);
  sim_time_ns_ = number_ == 0 ? wanted_ns : std::max(sim_time_ns_, wanted_ns);
  frame.frame_number = ++number_;
  frame.sim_time_ns = sim_time_ns_;
  frame.run_id = run_id_;
  frame.received_ns = now_ns;
  frame.environment.reset();
  frame.fov_h_rad.reset();
  frame.gimbal_rad.reset();
  frame.part_count = 0;
  frame.entity_count = 0;
  for (std::size_t i = 1; i < entities_.size(); ++i) {
    Entity& entity = entities_[i];
    // The exercise alone says what is there: an entity that it does not have is hidden too.
    const bool on = entity.came && entity.on && !is_silent(entity, now_ns);
    if (!on && entity.shown == false) continue;
    protocol::EntityStateData& out = frame.entities[frame.entity_count];
    out = {};
    out.entity_id = entity.scenario_id;
    out.on = on;
    out.has_pose = on;
    if (on && !place(entity, now_ns, out.pose, out.rates)) continue;
    out.teleport = on && entity.shown != true;
    entity.shown = on;
    ++frame.entity_count;
  }
  return true;
}

void DisExercise::report(const GatewayReport& report) noexcept {
  if (report.kind != GatewayReport::Kind::reset) return;
  for (Entity& entity : entities_) entity.shown.reset();
}

std::int64_t DisExercise::wake_at_ns() const noexcept {
  return entities_.front().came ? due_ns_ : std::numeric_limits<std::int64_t>::max();
}

}  // namespace emit::server
