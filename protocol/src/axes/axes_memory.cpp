// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/axes_memory.hpp"

#include <atomic>
#include <bit>
#include <limits>

#include "emit/physics/check.hpp"

namespace emit::protocol {
namespace {

static_assert(std::endian::native == std::endian::little, "blocks are shared as they are");
static_assert(std::atomic_ref<std::uint64_t>::is_always_lock_free,
              "a lock of one process does not hold another one off");

/// Place of the axes in a block.
constexpr std::size_t kAxesAtWord = 6;
constexpr std::size_t kWordsPerAxis = 3;

constexpr std::uint64_t pair(std::uint32_t low, std::uint32_t high) noexcept {
  return low | std::uint64_t{high} << 32U;
}
constexpr std::uint32_t low(std::uint64_t word) noexcept {
  return static_cast<std::uint32_t>(word);
}
constexpr std::uint32_t high(std::uint64_t word) noexcept {
  return static_cast<std::uint32_t>(word >> 32U);
}

/// Copies words into a block. The first and the last of them are the counter.
template <std::size_t Words>
void publish(std::span<std::uint64_t, Words> block,
             const std::array<std::uint64_t, Words>& words) noexcept {
  // Each store is seen after those before it: whoever reads a word of this message also finds its
  // counter in the first word, and whoever finds its counter in the last word reads all of it.
  for (std::size_t i = 0; i < Words; ++i) {
    std::atomic_ref(block[i]).store(words[i], std::memory_order_release);
  }
}

/// Copies the words of a message that is new. The two counters are equal when none was written
/// meanwhile.
template <std::size_t Words>
AxesLoadStatus copy(std::span<std::uint64_t, Words> block, std::uint64_t seen,
                    std::array<std::uint64_t, Words>& words) noexcept {
  const auto word = [&](std::size_t i) {
    return std::atomic_ref(block[i]).load(std::memory_order_acquire);
  };
  words[Words - 1] = word(Words - 1);
  if (words[Words - 1] == seen || words[Words - 1] == 0) return AxesLoadStatus::nothing;
  for (std::size_t i = 1; i + 1 < Words; ++i) words[i] = word(i);
  words[0] = word(0);
  return words[0] == words[Words - 1] ? AxesLoadStatus::done : AxesLoadStatus::torn;
}

template <std::size_t Words>
void put_axes(std::array<std::uint64_t, Words>& words, std::size_t at,
              std::span<const AxisMotion> axes) noexcept {
  for (const AxisMotion& axis : axes) {
    words[at++] = std::bit_cast<std::uint64_t>(axis.angle_rad);
    words[at++] = std::bit_cast<std::uint64_t>(axis.rate_rad_s);
    words[at++] = std::bit_cast<std::uint64_t>(axis.acceleration_rad_s2);
  }
}

template <std::size_t Words>
void get_axes(const std::array<std::uint64_t, Words>& words, std::size_t at,
              std::span<AxisMotion> axes) noexcept {
  for (AxisMotion& axis : axes) {
    axis.angle_rad = std::bit_cast<double>(words[at++]);
    axis.rate_rad_s = std::bit_cast<double>(words[at++]);
    axis.acceleration_rad_s2 = std::bit_cast<double>(words[at++]);
  }
}

/// Returns an enumerator; one that no message has for numbers that do not fit into it.
template <class Enum>
Enum enumerator(std::uint32_t number) noexcept {
  return static_cast<Enum>(number <= std::numeric_limits<std::uint8_t>::max() ? number : 0);
}

/// Reads a message by `read(words, out)`, which returns its version and number of axes.
template <std::size_t Words, class Message, class Read>
AxesLoad load(std::span<std::uint64_t, Words> block, std::uint64_t& seen, Message& out,
              const Read& read) noexcept {
  std::array<std::uint64_t, Words> words;
  if (const AxesLoadStatus status = copy(block, seen, words); status != AxesLoadStatus::done) {
    return {status, AxesFault::none};
  }
  seen = words[0];
  AxesFault fault = AxesFault::none;
  Message message;
  if (low(words[1]) != kAxesMemoryVersion) {
    fault = AxesFault::version;
  } else if (low(words[5]) > kMaxAxes) {
    fault = AxesFault::axes;
  } else {
    read(words, message);
    fault = check(message);
  }
  if (fault != AxesFault::none) return {AxesLoadStatus::refused, fault};
  out = message;
  return {AxesLoadStatus::done, AxesFault::none};
}

template <std::size_t Words>
std::uint64_t last_word(std::span<std::uint64_t, Words> block) noexcept {
  return std::atomic_ref(block[Words - 1]).load(std::memory_order_acquire);
}

}  // namespace

void store_axes(AxesCommandBlock block, const AxesCommand& command) noexcept {
  EMIT_CHECK_OP(command.count, <=, kMaxAxes);
  std::array<std::uint64_t, kAxesCommandWords> words{};
  words.front() = words.back() = command.counter;
  words[1] = pair(kAxesMemoryVersion, static_cast<std::uint32_t>(command.mode));
  words[2] = static_cast<std::uint64_t>(command.time_ns);
  words[3] = static_cast<std::uint64_t>(command.sim_time_ns);
  words[4] = pair(command.period_us, command.timeout_ms);
  words[5] = pair(static_cast<std::uint32_t>(command.count), 0);
  put_axes(words, kAxesAtWord, std::span(command.axes).first(command.count));
  publish(block, words);
}

void store_axes(AxesMonitorBlock block, const AxesMonitor& monitor) noexcept {
  EMIT_CHECK_OP(monitor.count, <=, kMaxAxes);
  std::array<std::uint64_t, kAxesMonitorWords> words{};
  words.front() = words.back() = monitor.counter;
  words[1] = pair(kAxesMemoryVersion, static_cast<std::uint32_t>(monitor.state));
  words[2] = static_cast<std::uint64_t>(monitor.time_ns);
  words[3] = monitor.command_counter;
  words[4] = pair(monitor.limited_axes, monitor.faulty_axes);
  words[5] = pair(static_cast<std::uint32_t>(monitor.count), monitor.timed_out ? 1 : 0);
  put_axes(words, kAxesAtWord, std::span(monitor.measured).first(monitor.count));
  put_axes(words, kAxesAtWord + kMaxAxes * kWordsPerAxis,
           std::span(monitor.demanded).first(monitor.count));
  publish(block, words);
}

AxesLoad load_axes(AxesCommandBlock block, std::uint64_t& seen, AxesCommand& out) noexcept {
  return load(block, seen, out,
              [](const std::array<std::uint64_t, kAxesCommandWords>& words, AxesCommand& message) {
                message.counter = words[0];
                message.mode = enumerator<AxesMode>(high(words[1]));
                message.time_ns = static_cast<std::int64_t>(words[2]);
                message.sim_time_ns = static_cast<std::int64_t>(words[3]);
                message.period_us = low(words[4]);
                message.timeout_ms = high(words[4]);
                message.count = low(words[5]);
                get_axes(words, kAxesAtWord, std::span(message.axes).first(message.count));
              });
}

AxesLoad load_axes(AxesMonitorBlock block, std::uint64_t& seen, AxesMonitor& out) noexcept {
  return load(block, seen, out,
              [](const std::array<std::uint64_t, kAxesMonitorWords>& words, AxesMonitor& message) {
                message.counter = words[0];
                message.state = enumerator<AxesState>(high(words[1]));
                message.time_ns = static_cast<std::int64_t>(words[2]);
                message.command_counter = words[3];
                message.limited_axes = low(words[4]);
                message.faulty_axes = high(words[4]);
                message.count = low(words[5]);
                message.timed_out = high(words[5]) != 0;
                get_axes(words, kAxesAtWord, std::span(message.measured).first(message.count));
                get_axes(words, kAxesAtWord + kMaxAxes * kWordsPerAxis,
                         std::span(message.demanded).first(message.count));
              });
}

std::uint64_t latest_counter(AxesCommandBlock block) noexcept {
  return last_word(block);
}

std::uint64_t latest_counter(AxesMonitorBlock block) noexcept {
  return last_word(block);
}

}  // namespace emit::protocol
