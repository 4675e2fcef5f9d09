// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/axes.hpp"

#include <google/protobuf/arena.h>

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"
#include "emit/v1/axes.pb.h"

namespace emit::protocol {
namespace {

/// Memory of one message with all axes, bytes.
constexpr std::size_t kAxesArenaBytes = std::size_t{64} << 10U;

bool within(double value, double limit) noexcept {
  return std::abs(value) <= limit;  // false for NaN
}

bool valid_instant(std::int64_t time_ns) noexcept {
  return time_ns >= 0 && time_ns <= kMaxAxesTimeNs;
}

bool valid(const AxisMotion& axis) noexcept {
  return within(axis.angle_rad, kMaxAxisRad) && within(axis.rate_rad_s, kMaxAxisRadS) &&
         within(axis.acceleration_rad_s2, kMaxAxisRadS2);
}

bool valid(std::span<const AxisMotion> axes) noexcept {
  return std::ranges::all_of(axes, [](const AxisMotion& axis) { return valid(axis); });
}

AxisMotion values_of(const v1::AxisValues& axis) noexcept {
  return {axis.angle_rad(), axis.rate_rad_s(), axis.acceleration_rad_s2()};
}

void set(const AxisMotion& values, v1::AxisValues& out) noexcept {
  out.set_angle_rad(values.angle_rad);
  out.set_rate_rad_s(values.rate_rad_s);
  out.set_acceleration_rad_s2(values.acceleration_rad_s2);
}

}  // namespace

std::string_view to_string(AxesState state) noexcept {
  switch (state) {
    case AxesState::motors_off:
      return "motors off";
    case AxesState::parking:
      return "parking";
    case AxesState::parked:
      return "parked";
    case AxesState::capturing:
      return "capturing";
    case AxesState::following:
      return "following";
    case AxesState::fault:
      return "fault";
  }
  return "unknown state";
}

std::string_view to_string(AxesFault fault) noexcept {
  switch (fault) {
    case AxesFault::none:
      return "none";
    case AxesFault::size:
      return "wrong size";
    case AxesFault::malformed:
      return "malformed";
    case AxesFault::version:
      return "wrong version";
    case AxesFault::axes:
      return "wrong number of axes";
    case AxesFault::value:
      return "value out of range";
  }
  return "unknown fault";
}

AxesFault check(const AxesCommand& command) noexcept {
  switch (command.mode) {
    case AxesMode::off:
    case AxesMode::park:
      break;
    case AxesMode::follow:
      if (command.count == 0) return AxesFault::axes;
      break;
    default:
      return AxesFault::malformed;
  }
  if (command.count > kMaxAxes) return AxesFault::axes;
  const bool in_range = command.timeout_ms >= 1 && command.timeout_ms <= kMaxAxesTimeoutMs &&
                        valid_instant(command.time_ns) &&
                        valid(std::span(command.axes).first(command.count));
  return in_range ? AxesFault::none : AxesFault::value;
}

AxesFault check(const AxesMonitor& monitor) noexcept {
  if (monitor.state < AxesState::motors_off || monitor.state > AxesState::fault) {
    return AxesFault::malformed;
  }
  if (monitor.count > kMaxAxes) return AxesFault::axes;
  const bool in_range = valid_instant(monitor.time_ns) &&
                        valid(std::span(monitor.measured).first(monitor.count)) &&
                        valid(std::span(monitor.demanded).first(monitor.count));
  return in_range ? AxesFault::none : AxesFault::value;
}

struct AxesCodec::Impl {
  std::unique_ptr<char[]> block = std::make_unique<char[]>(kAxesArenaBytes);
  google::protobuf::Arena arena{[this] {
    google::protobuf::ArenaOptions options;
    options.initial_block = block.get();
    options.initial_block_size = kAxesArenaBytes;
    return options;
  }()};
  std::array<std::byte, kMaxAxesBytes> bytes{};

  template <class Message>
  Message& fresh() noexcept {
    arena.Reset();
    return *google::protobuf::Arena::CreateMessage<Message>(&arena);
  }
  template <class Message>
  std::span<const std::byte> write(const Message& message) noexcept {
    const std::size_t size = message.ByteSizeLong();
    EMIT_CHECK_OP(size, <=, bytes.size());
    message.SerializeWithCachedSizesToArray(
        reinterpret_cast<google::protobuf::uint8*>(bytes.data()));
    return std::span(bytes).first(size);
  }
  template <class Message>
  AxesFault read(std::span<const std::byte> from, Message& message) noexcept {
    if (from.size() > kMaxAxesBytes) return AxesFault::size;
    if (!message.ParseFromArray(from.data(), static_cast<int>(from.size()))) {
      return AxesFault::malformed;
    }
    return message.protocol_version() == kAxesVersion ? AxesFault::none : AxesFault::version;
  }
};

AxesCodec::AxesCodec() : impl_(std::make_unique<Impl>()) {}
AxesCodec::~AxesCodec() = default;
AxesCodec::AxesCodec(AxesCodec&&) noexcept = default;
AxesCodec& AxesCodec::operator=(AxesCodec&&) noexcept = default;

std::span<const std::byte> AxesCodec::encode(const AxesCommand& command) noexcept {
  EMIT_CHECK_OP(command.count, <=, kMaxAxes);
  auto& message = impl_->fresh<v1::AxesCommand>();
  message.set_protocol_version(kAxesVersion);
  message.set_counter(command.counter);
  message.set_time_ns(command.time_ns);
  message.set_sim_time_ns(command.sim_time_ns);
  message.set_period_us(command.period_us);
  message.set_timeout_ms(command.timeout_ms);
  message.set_mode(static_cast<v1::AxesCommand::Mode>(command.mode));
  for (std::size_t i = 0; i < command.count; ++i) set(command.axes[i], *message.add_axes());
  return impl_->write(message);
}

std::span<const std::byte> AxesCodec::encode(const AxesMonitor& monitor) noexcept {
  EMIT_CHECK_OP(monitor.count, <=, kMaxAxes);
  auto& message = impl_->fresh<v1::AxesMonitor>();
  message.set_protocol_version(kAxesVersion);
  message.set_counter(monitor.counter);
  message.set_time_ns(monitor.time_ns);
  message.set_command_counter(monitor.command_counter);
  message.set_state(static_cast<v1::AxesMonitor::State>(monitor.state));
  message.set_limited_axes(monitor.limited_axes);
  message.set_faulty_axes(monitor.faulty_axes);
  message.set_timed_out(monitor.timed_out);
  for (std::size_t i = 0; i < monitor.count; ++i) {
    set(monitor.measured[i], *message.add_measured());
    set(monitor.demanded[i], *message.add_demanded());
  }
  return impl_->write(message);
}

AxesFault AxesCodec::decode(std::span<const std::byte> bytes, AxesCommand& out) noexcept {
  auto& message = impl_->fresh<v1::AxesCommand>();
  if (const AxesFault fault = impl_->read(bytes, message); fault != AxesFault::none) return fault;
  if (!v1::AxesCommand::Mode_IsValid(message.mode())) return AxesFault::malformed;
  const auto count = static_cast<std::size_t>(message.axes_size());
  if (count > kMaxAxes) return AxesFault::axes;
  AxesCommand read = {message.counter(),
                      message.time_ns(),
                      message.sim_time_ns(),
                      message.period_us(),
                      message.timeout_ms(),
                      static_cast<AxesMode>(message.mode()),
                      count,
                      {}};
  for (std::size_t i = 0; i < count; ++i) {
    read.axes[i] = values_of(message.axes(static_cast<int>(i)));
  }
  const AxesFault fault = check(read);
  if (fault == AxesFault::none) out = read;
  return fault;
}

AxesFault AxesCodec::decode(std::span<const std::byte> bytes, AxesMonitor& out) noexcept {
  auto& message = impl_->fresh<v1::AxesMonitor>();
  if (const AxesFault fault = impl_->read(bytes, message); fault != AxesFault::none) return fault;
  if (!v1::AxesMonitor::State_IsValid(message.state())) return AxesFault::malformed;
  const auto count = static_cast<std::size_t>(message.measured_size());
  if (count > kMaxAxes || message.demanded_size() != message.measured_size()) {
    return AxesFault::axes;
  }
  AxesMonitor read = {message.counter(),
                      message.time_ns(),
                      message.command_counter(),
                      static_cast<AxesState>(message.state()),
                      message.limited_axes(),
                      message.faulty_axes(),
                      message.timed_out(),
                      count,
                      {},
                      {}};
  for (std::size_t i = 0; i < count; ++i) {
    read.measured[i] = values_of(message.measured(static_cast<int>(i)));
    read.demanded[i] = values_of(message.demanded(static_cast<int>(i)));
  }
  const AxesFault fault = check(read);
  if (fault == AxesFault::none) out = read;
  return fault;
}

}  // namespace emit::protocol
