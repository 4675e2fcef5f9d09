// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

/// Codec of the messages between a host and the controller of a flight motion simulator (Protobuf
/// emit.v1.AxesCommand and emit.v1.AxesMonitor, docs/wire.md section 12).
namespace emit::protocol {

inline constexpr std::uint32_t kAxesVersion = 1;
inline constexpr std::uint16_t kDefaultAxesPort = 7010;
/// Largest number of axes: three of the unit under test, two of the target.
inline constexpr std::size_t kMaxAxes = 5;
/// Largest encoded message, bytes. A longer one is refused.
inline constexpr std::size_t kMaxAxesBytes = 1024;
/// Largest magnitudes of a demand. Larger ones are refused.
inline constexpr double kMaxAxisRad = 1e6;
inline constexpr double kMaxAxisRadS = 1e5;
inline constexpr double kMaxAxisRadS2 = 1e8;
/// Latest instant of a command, ns TAI: in the year 2096. Instants before 1970 are refused too.
inline constexpr std::int64_t kMaxAxesTimeNs = 4'000'000'000'000'000'000;
/// Longest timeout of a command, ms. The shortest is 1 ms.
inline constexpr std::uint32_t kMaxAxesTimeoutMs = 60'000;

/// Angle of an axis with its first two derivatives (emit.v1.AxisValues).
struct AxisMotion {
  double angle_rad = 0.0;
  double rate_rad_s = 0.0;
  double acceleration_rad_s2 = 0.0;
};

/// The values are those of emit.v1.AxesCommand.Mode and emit.v1.AxesMonitor.State.
enum class AxesMode : std::uint8_t { off = 1, park = 2, follow = 3 };
enum class AxesState : std::uint8_t {
  motors_off = 1,
  parking = 2,
  parked = 3,
  capturing = 4,
  following = 5,
  fault = 6,
};
/// Returns the English name of a state, for messages. RT-safe.
[[nodiscard]] std::string_view to_string(AxesState state) noexcept;

/// Contents of emit.v1.AxesCommand; its fields are documented there.
struct AxesCommand {
  std::uint64_t counter = 0;
  std::int64_t time_ns = 0;
  std::int64_t sim_time_ns = 0;
  std::uint32_t period_us = 0;
  std::uint32_t timeout_ms = 100;
  AxesMode mode = AxesMode::off;
  std::size_t count = 0;  ///< axes in use; 0 is allowed for off and park
  std::array<AxisMotion, kMaxAxes> axes{};
};

/// Contents of emit.v1.AxesMonitor; its fields are documented there.
struct AxesMonitor {
  std::uint64_t counter = 0;
  std::int64_t time_ns = 0;
  std::uint64_t command_counter = 0;
  AxesState state = AxesState::motors_off;
  std::uint32_t limited_axes = 0;
  std::uint32_t faulty_axes = 0;
  bool timed_out = false;
  std::size_t count = 0;
  std::array<AxisMotion, kMaxAxes> measured{};
  std::array<AxisMotion, kMaxAxes> demanded{};
};

/// Reason why bytes are no valid message.
enum class AxesFault : std::uint8_t {
  none,
  size,       ///< more than kMaxAxesBytes
  malformed,  ///< not the Protobuf message, or an enumerator that does not exist
  version,    ///< protocol_version is not kAxesVersion
  axes,       ///< more than kMaxAxes, none to follow, or not as many demanded as measured
  value,      ///< a number is not finite or too large, or timeout or instant are out of range
};
/// Returns the English name of a fault, for messages. RT-safe.
[[nodiscard]] std::string_view to_string(AxesFault fault) noexcept;

/// Returns what a receiver has to refuse in the contents of a message: an enumerator that does not
/// exist (malformed), a number of axes (axes), or a number out of range (value). RT-safe.
[[nodiscard]] AxesFault check(const AxesCommand& command) noexcept;
[[nodiscard]] AxesFault check(const AxesMonitor& monitor) noexcept;

/// Encodes and decodes messages in memory that it uses again for every one.
/// Thread: one owner.  Real time: the constructor allocates, the rest is RT-safe for messages
/// without unknown fields.
class AxesCodec {
 public:
  AxesCodec();
  ~AxesCodec();
  AxesCodec(AxesCodec&&) noexcept;
  AxesCodec& operator=(AxesCodec&&) noexcept;

  /// Returns the encoded message. It is valid until the next call.
  /// @pre at most kMaxAxes axes
  [[nodiscard]] std::span<const std::byte> encode(const AxesCommand& command) noexcept;
  [[nodiscard]] std::span<const std::byte> encode(const AxesMonitor& monitor) noexcept;

  /// Decodes and checks a message. `out` is written only when the result is none.
  [[nodiscard]] AxesFault decode(std::span<const std::byte> bytes, AxesCommand& out) noexcept;
  [[nodiscard]] AxesFault decode(std::span<const std::byte> bytes, AxesMonitor& out) noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
