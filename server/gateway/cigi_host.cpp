// SPDX-License-Identifier: Apache-2.0
#include "gateway/cigi_host.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <type_traits>
#include <utility>
#include <variant>

#include "emit/physics/constants.hpp"
#include "emit/protocol/codec.hpp"
#include "emit/protocol/convert.hpp"

namespace emit::server {

namespace cigi = protocol::cigi;
using cigi::IgMode;

namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kMinuteNs = 60 * kSecondNs;
/// A frame that takes longer does not keep the host from hearing of emitd.
constexpr std::int64_t kLongestWaitNs = 5'000'000'000;
/// A clock of the host that is off by less than this beyond its minutes is not set.
constexpr std::int64_t kClockSlackNs = kSecondNs;

CigiEntities::Options entity_options(const CigiHost::Options& options) {
  CigiEntities::Options out;
  out.seeker = static_cast<std::uint16_t>(options.cigi.seeker);
  out.view = static_cast<std::uint16_t>(options.cigi.view);
  out.predicted = !options.synchronous;
  for (const config::CigiEntityConfig& entity : options.cigi.entities) {
    out.entities.emplace_back(static_cast<std::uint16_t>(entity.id), entity.entity);
  }
  for (const config::CigiPartConfig& part : options.cigi.parts) {
    CigiPart::Joint joint;
    joint.entity_id = static_cast<std::uint16_t>(part.id);
    joint.part_id = static_cast<std::uint8_t>(part.part);
    joint.scenario_id = part.entity;
    if (part.on_part >= 0) joint.on_part = static_cast<std::uint8_t>(part.on_part);
    joint.place_m = part.joint_m;
    joint.yaw_pitch_roll_rad = part.joint_yaw_pitch_roll_deg * physics::kDegree;
    out.parts.push_back(joint);
  }
  out.known = [scenario = options.scenario](std::uint32_t id) {
    return scenario == nullptr ||
           std::ranges::any_of(scenario->objects, [id](const scene::ObjectDesc& object) {
             return object.entity_id == id;
           });
  };
  return out;
}

/// Returns the POSIX instant of a date and a time of day without its seconds, s UTC.
/// @pre the date exists, as the reader makes sure
std::int64_t utc_minute_s_of(const cigi::CelestialSphereControl& packet) noexcept {
  using namespace std::chrono;
  const std::uint32_t date = packet.date_mmddyyyy;
  const sys_days day{year{static_cast<int>(date % 10000)} / static_cast<int>(date / 1'000'000) /
                     static_cast<int>(date / 10000 % 100)};
  return seconds(sys_seconds(day).time_since_epoch()).count() + 3600 * packet.hour_utc +
         60 * packet.minute_utc;
}

}  // namespace

CigiHost::CigiHost(const Options& options, std::unique_ptr<SceneQuery> scene, Counters& counters,
                   EventLog& events)
    : options_(options),
      counters_(counters),
      events_(events),
      earth_(origin_of(options.scenario)),
      scene_(std::move(scene)),
      period_ns_(static_cast<std::int64_t>(1e9 / options.rate_hz)),
      clock_(options.synchronous ? period_ns_ : 0),
      entities_(earth_, scene_.get(), entity_options(options)),
      queries_(earth_, entities_, scene_.get()),
      weather_(options.scenario),
      picture_(static_cast<std::uint16_t>(options.cigi.view),
               options.scenario != nullptr ? options.scenario->display : scene::DisplayOptions{},
               options.picture),
      heat_(options.scenario, options.cigi.entities) {}

void CigiHost::take(std::span<const std::byte> datagram, std::int64_t received_ns) noexcept {
  cigi::Reader reader(datagram, cigi::Sender::host);
  cigi::Packet packet;
  if (reader.next(packet) != cigi::Step::packet) {
    counters_.add(Counter::gateway_messages_refused);
    refuse(reader.fault());
    return;
  }
  version_ = reader.version();
  order_ = reader.byte_order();
  if (!take_control(std::get<cigi::IgControl>(packet), received_ns)) return;
  bool more = true;
  while (more) {
    switch (reader.next(packet)) {
      case cigi::Step::packet:
        take_packet(packet);
        break;
      case cigi::Step::refused:
        counters_.add(Counter::gateway_packets_refused);
        refuse(reader.fault());
        break;
      case cigi::Step::broken:
        counters_.add(Counter::gateway_packets_refused);
        refuse(reader.fault());
        more = false;
        break;
      case cigi::Step::end:
        more = false;
        break;
    }
  }
  counters_.add(Counter::gateway_packets_skipped, reader.skipped_packets());
  tell_unknown_entities();
  entities_.place_in_scene();
  frame_pending_ = entities_.has_seeker();
  if (!frame_pending_ && !std::exchange(told_no_seeker_, true)) {
    constexpr std::string_view kWhy = "no image: the entity that carries the sensor has no pose";
    tell(kWhy);
    events_.push(EventKind::gateway_refused, 0, 0, kWhy);
  }
}

bool CigiHost::take_control(const cigi::IgControl& control, std::int64_t received_ns) noexcept {
  received_ns_ = received_ns;
  if (control.mode == IgMode::standby) {
    host_frame_ = control.host_frame;
    if (mode_ != IgMode::standby) {
      mode_ = IgMode::standby;
      database_ = 0;
      forget();
      events_.push(EventKind::gateway_mode, static_cast<std::uint64_t>(mode_));
    }
    return false;
  }
  if (mode_ == IgMode::standby) {
    begin_run(received_ns, options_.first_time_ns);
    events_.push(EventKind::gateway_mode, static_cast<std::uint64_t>(control.mode));
  }
  mode_ = control.mode;
  if (!take_time(control, received_ns)) return false;
  host_frame_ = control.host_frame;
  entities_.set_time(clock_.time_ns());
  take_database(control.database);
  return true;
}

bool CigiHost::take_time(const cigi::IgControl& control, std::int64_t received_ns) noexcept {
  CigiClock::Verdict verdict = clock_.take(control);
  if (verdict == CigiClock::Verdict::restart) {
    // The host has begun anew without saying so.
    begin_run(received_ns, options_.first_time_ns);
    verdict = clock_.take(control);
  }
  switch (verdict) {
    case CigiClock::Verdict::accept:
      return true;
    case CigiClock::Verdict::repeated:
    case CigiClock::Verdict::old:
      counters_.add(Counter::gateway_messages_old);
      return false;
    case CigiClock::Verdict::timeless:
    case CigiClock::Verdict::restart:
      break;
  }
  counters_.add(Counter::gateway_messages_refused);
  if (!std::exchange(told_timeless_, true)) {
    tell("message without a time stamp: asynchronous operation needs one");
    events_.push(EventKind::gateway_refused, 0, 0,
                 "IG Control without a valid time stamp, which asynchronous operation needs");
  }
  return false;
}

void CigiHost::take_database(std::int8_t wanted) noexcept {
  if (options_.cigi.database == 0) return;  // emitd says that the loading is its own business
  const auto mine = static_cast<std::int8_t>(options_.cigi.database);
  if (wanted > 0 && wanted != mine) {
    database_ = cigi::kDatabaseMissing;
  } else if (wanted > 0 && database_ != mine) {
    database_ = static_cast<std::int8_t>(-mine);
    database_told_ = true;
  } else if (wanted == 0 && database_told_) {
    // The host knows that the database is loaded, which it was from the start.
    database_ = mine;
    database_told_ = false;
  }
}

void CigiHost::begin_run(std::int64_t received_ns, std::int64_t first_time_ns) noexcept {
  forget();
  clock_.start(first_time_ns);
  run_id_ = static_cast<std::uint64_t>(received_ns);
}

void CigiHost::forget() noexcept {
  entities_.clear();
  queries_.clear();
  weather_.clear();
  heat_.clear();
  picture_.clear();
  told_count_ = 0;
  sky_.reset();
  fov_h_rad_.reset();
  told_no_seeker_ = told_timeless_ = false;
  frame_pending_ = false;
  awaits_ = false;
}

void CigiHost::take_packet(const cigi::Packet& packet) noexcept {
  const auto ask = [this](const auto& request) {
    if (!queries_.take(request, host_frame_)) {
      counters_.add(Counter::gateway_questions_dropped);
      no_effect(request, "too many questions wait for answers");
    }
  };
  std::visit(
      [&](const auto& in) {
        using T = std::decay_t<decltype(in)>;
        if constexpr (std::is_same_v<T, cigi::EntityControl> ||
                      std::is_same_v<T, cigi::EntityPosition> ||
                      std::is_same_v<T, cigi::EntityControl40>) {
          if (!entities_.take(in)) no_effect(in, "too many entities");
        } else if constexpr (std::is_same_v<T, cigi::RateControl>) {
          if (!entities_.take(in))
            no_effect(in, "no such entity or part, or rates of an attached entity");
        } else if constexpr (std::is_same_v<T, cigi::ViewControl>) {
          if (!entities_.take(in)) no_effect(in, "another view than the sensor's");
        } else if constexpr (std::is_same_v<T, cigi::AtmosphereControl>) {
          if (!weather_.take(in)) no_effect(in, "air temperature or wind is out of range");
        } else if constexpr (std::is_same_v<T, cigi::WeatherControl>) {
          if (!weather_.take(in)) no_effect(in, "only global cloud layers 1 to 3 count");
        } else if constexpr (std::is_same_v<T, cigi::ComponentControl>) {
          if (!weather_.take(in) && !heat_.take(in))
            no_effect(in, "unknown component, or out of range");
        } else if constexpr (std::is_same_v<T, cigi::CelestialSphereControl>) {
          take_sky(in);
        } else if constexpr (std::is_same_v<T, cigi::HatHotRequest> ||
                             std::is_same_v<T, cigi::LosSegmentRequest> ||
                             std::is_same_v<T, cigi::LosVectorRequest> ||
                             std::is_same_v<T, cigi::PositionRequest>) {
          ask(in);
        } else if constexpr (std::is_same_v<T, cigi::ShortComponentControl>) {
          if (!heat_.take(in)) no_effect(in, "unknown component, or out of range");
        } else if constexpr (std::is_same_v<T, cigi::EarthReferenceModel>) {
          if (in.custom_enabled) no_effect(in, "the ellipsoid stays WGS-84");
        } else if constexpr (std::is_same_v<T, cigi::SensorControl>) {
          take_sensor(in);
        } else if constexpr (std::is_same_v<T, cigi::ViewDefinition>) {
          take_view(in);
        } else if constexpr (std::is_same_v<T, cigi::ArticulatedPartControl> ||
                             std::is_same_v<T, cigi::ShortArticulatedPartControl>) {
          if (!entities_.take(in)) no_effect(in, "cigi.parts does not have this part");
        } else if constexpr (std::is_same_v<T, cigi::AnimationControl>) {
          no_effect(in, "entities have no animations");
        } else if constexpr (std::is_same_v<T, cigi::AccelerationControl>) {
          no_effect(in, "accelerations come from the differences of rates");
        } else if constexpr (std::is_same_v<T, cigi::EnvironmentalRegionControl>) {
          no_effect(in, "there are no regions");
        } else if constexpr (std::is_same_v<T, cigi::EnvironmentalConditionsRequest>) {
          no_effect(in, "there is no answer to this question");
        }
      },
      packet);
}

void CigiHost::take_sky(const cigi::CelestialSphereControl& packet) noexcept {
  if (!packet.sun_enabled) no_effect(packet, "the sun stays on");
  // A host may set the minutes itself, so that a sun which stands still without it would be wrong.
  if (!packet.ephemeris_enabled) no_effect(packet, "time of day goes on by itself");
  if (!packet.date_valid || options_.scenario == nullptr) return;
  // Hosts send the packet again and again. Only another time of day sets the clock.
  const bool is_known =
      sky_ && sky_->date_mmddyyyy == packet.date_mmddyyyy && sky_->hour_utc == packet.hour_utc &&
      sky_->minute_utc == packet.minute_utc && sky_->second_utc == packet.second_utc;
  sky_ = packet;
  if (is_known) return;
  // Version 3.3 counts whole minutes, so that a clock within the minute is right.
  const std::int64_t width_ns = version_ == cigi::Version::v3_3 ? kMinuteNs : 0;
  // Whole nanoseconds end in the year 2262, and dates do not.
  const std::int64_t epoch_s = options_.scenario->epoch_utc_ns / kSecondNs;
  const std::int64_t wanted_s = utc_minute_s_of(packet) - epoch_s;
  if (std::abs(wanted_s) >= protocol::kMaxSimTimeNs / kSecondNs) {
    no_effect(packet, "the date is too far from that of the scenario");
    return;
  }
  const std::int64_t wanted_ns = wanted_s * kSecondNs +
                                 std::llround(1e9 * double{packet.second_utc}) -
                                 options_.scenario->epoch_utc_ns % kSecondNs;
  const std::int64_t ahead_ns = clock_.time_ns() - wanted_ns;
  if (ahead_ns >= -kClockSlackNs && ahead_ns < width_ns + kClockSlackNs) return;
  clock_.shift(-ahead_ns);
  entities_.shift(-ahead_ns);
  // Another time is another run, in which everything stands where it stood.
  ++run_id_;
  entities_.mark_all(true);
  weather_.mark();
  heat_.mark_all();
  events_.push(EventKind::gateway_time, static_cast<std::uint64_t>(clock_.time_ns()));
}

void CigiHost::tell_unknown_entities() noexcept {
  while (const auto id = entities_.take_unknown()) {
    counters_.add(Counter::gateway_unknown_entities);
    std::array<char, 96> text{};
    const int length =
        std::snprintf(text.data(), text.size(), "entity %u: the scenario has none of this number",
                      static_cast<unsigned>(*id));
    tell({text.data(), static_cast<std::size_t>(length)});
    events_.push(EventKind::gateway_refused, *id, 0,
                 {text.data(), static_cast<std::size_t>(length)});
  }
}

void CigiHost::no_effect(std::uint16_t packet_id, std::string_view why) noexcept {
  counters_.add(Counter::gateway_packets_unused);
  // Reasons are literals, so that their places tell them apart.
  const std::pair<std::uint16_t, const char*> told(packet_id, why.data());
  const auto end = told_.begin() + static_cast<std::ptrdiff_t>(told_count_);
  if (told_count_ == kMaxTold || std::find(told_.begin(), end, told) != end) return;
  told_[told_count_++] = told;
  std::array<char, 128> text{};
  const std::string_view name = cigi::packet_name(packet_id, version_);
  const int length =
      std::snprintf(text.data(), text.size(), "%.*s: %.*s", static_cast<int>(name.size()),
                    name.data(), static_cast<int>(why.size()), why.data());
  const std::string_view whole(text.data(),
                               std::min(static_cast<std::size_t>(length), text.size() - 1));
  tell(whole);
  events_.push(EventKind::gateway_refused, packet_id, 0, whole);
}

void CigiHost::refuse(const cigi::Fault& fault) noexcept {
  std::array<char, cigi::kFaultTextBytes> buffer;
  const std::string_view text = cigi::fault_text(fault, buffer);
  events_.push(EventKind::gateway_refused, fault.id, static_cast<std::uint64_t>(fault.kind), text);
  tell(text);
}

void CigiHost::tell(std::string_view text) noexcept {
  if (text_count_ == kMaxTexts) {
    counters_.add(Counter::gateway_texts_dropped);
    return;
  }
  texts_[text_count_++] = cigi::ImageGeneratorMessage::make(0, text);
}

bool CigiHost::next(protocol::HostFrameData& frame, std::int64_t /*now_ns*/) noexcept {
  if (!std::exchange(frame_pending_, false)) return false;
  frame.frame_number = clock_.number();
  frame.sim_time_ns = clock_.time_ns();
  frame.run_id = run_id_;
  frame.received_ns = received_ns_;
  entities_.fill(frame);
  frame.environment = weather_.take_change(frame.sim_time_ns);
  frame.fov_h_rad = fov_h_rad_;
  frame.gimbal_rad.reset();
  heat_.fill(frame);
  if (!check(frame)) {
    // The next frame tells all that this one would have told.
    entities_.mark_all(false);
    weather_.mark();
    heat_.mark_all();
    return false;
  }
  if (options_.synchronous) {
    awaits_ = true;
    awaited_number_ = frame.frame_number;
    awaited_since_ns_ = received_ns_;
  }
  return true;
}

bool CigiHost::check(protocol::HostFrameData& frame) noexcept {
  const auto is_sound = [](const physics::Pose& pose, const auto& rates) {
    return protocol::check_pose(pose, rates) == protocol::DecodeStatus::ok;
  };
  // Rates beyond the limits help no prediction, and the pose holds without them.
  const auto drop_wild_rates = [&](const physics::Pose& pose, auto& rates) {
    if (is_sound(pose, rates) || !is_sound(pose, std::optional<protocol::PoseRates>())) return;
    rates.reset();
    counters_.add(Counter::gateway_packets_refused);
    no_effect(cigi::RateControl::kWire.of(version_).id, "the rates are too great");
  };
  if (std::abs(frame.sim_time_ns) > protocol::kMaxSimTimeNs) {
    counters_.add(Counter::gateway_messages_refused);
    no_effect(cigi::IgControl::kWire.of(version_).id,
              "its time is too far from that of the scenario");
    return false;
  }
  drop_wild_rates(frame.seeker, frame.seeker_rates);
  if (!is_sound(frame.seeker, frame.seeker_rates)) {
    counters_.add(Counter::gateway_packets_refused);
    no_effect(place_id(), "the sensor is too far away");
    return false;
  }
  std::uint32_t kept = 0;
  for (std::uint32_t i = 0; i < frame.entity_count; ++i) {
    protocol::EntityStateData& state = frame.entities[i];
    if (state.has_pose) drop_wild_rates(state.pose, state.rates);
    if (state.has_pose && !is_sound(state.pose, state.rates)) {
      counters_.add(Counter::gateway_packets_refused);
      no_effect(place_id(), "an entity is too far away");
      continue;
    }
    if (kept != i) frame.entities[kept] = state;
    ++kept;
  }
  frame.entity_count = kept;
  return true;
}

void CigiHost::report(const GatewayReport& report) noexcept {
  if (report.kind == GatewayReport::Kind::reset) {
    // The host does not send again what it has sent once.
    entities_.mark_all(true);
    weather_.mark();
    heat_.mark_all();
    awaits_ = false;
    return;
  }
  if (awaits_ && report.host_frame_number >= awaited_number_) awaits_ = false;
}

bool CigiHost::waits(std::int64_t now_ns) const noexcept {
  return awaits_ && now_ns - awaited_since_ns_ < kLongestWaitNs;
}

std::int64_t CigiHost::wake_at_ns() const noexcept {
  return awaits_ ? std::max(due_ns_, awaited_since_ns_ + kLongestWaitNs) : due_ns_;
}

std::span<const std::byte> CigiHost::message(std::int64_t now_ns) noexcept {
  // Somebody has set the clock back: the next frame is not due in hours.
  if (due_ns_ - now_ns > 2 * period_ns_) due_ns_ = now_ns;
  if (now_ns < due_ns_ || waits(now_ns)) return {};
  // A message that is late shifts the ones after it; none is sent to catch up.
  due_ns_ =
      due_ns_ == 0 || now_ns - due_ns_ > period_ns_ ? now_ns + period_ns_ : due_ns_ + period_ns_;
  cigi::Writer writer(memory_, version_, order_);
  cigi::StartOfFrame start;
  start.database = mode_ == IgMode::standby ? std::int8_t{0} : database_;
  start.mode = mode_;
  start.timestamp_valid = true;
  start.ig_frame = ++ig_frame_;
  start.timestamp_ticks = cigi::timestamp_ticks(now_ns);
  start.last_host_frame = host_frame_;
  static_cast<void>(writer.add(start));  // an empty message has room
  for (std::size_t i = 0; i < text_count_; ++i) static_cast<void>(writer.add(texts_[i]));
  text_count_ = 0;
  picture_.answer(writer, ig_frame_);
  const CigiQueries::Answered answered = queries_.answer(writer);
  counters_.add(Counter::gateway_answers, answered.answers);
  counters_.add(Counter::gateway_questions_dropped, answered.dropped);
  return writer.message();
}

}  // namespace emit::server
