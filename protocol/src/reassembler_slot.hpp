// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstring>
#include <new>
#include <vector>

#include "bit_range.hpp"
#include "emit/protocol/reassembler.hpp"

/// What the reassembler keeps of frames and streams.
namespace emit::protocol {

inline constexpr std::size_t kWordBytes = sizeof(float);
inline constexpr std::size_t kHeaderWords = kFrameHeaderBytes / kWordBytes;
inline constexpr std::size_t kPixelAlignment = 64;
static_assert(kFrameHeaderBytes % kPixelAlignment == 0, "pixels start aligned");

struct AlignedDelete {
  void operator()(std::byte* bytes) const noexcept {
    ::operator delete[](bytes, std::align_val_t{kPixelAlignment});
  }
};
using AlignedBytes = std::unique_ptr<std::byte[], AlignedDelete>;

/// Frame ids wrap: positive when `a` comes after `b`.
[[nodiscard]] inline std::int32_t frame_distance(std::uint32_t a, std::uint32_t b) noexcept {
  return static_cast<std::int32_t>(a - b);
}

struct Reassembler::Slot {
  enum class State : std::uint8_t { free, open, ready, held };
  AlignedBytes bytes;
  std::vector<std::uint64_t> received;  // one bit per four bytes
  State state = State::free;
  Stream* stream = nullptr;
  std::uint32_t frame_id = 0;
  std::uint32_t total_bytes = 0;
  std::int64_t sim_time_ns = 0;
  std::size_t received_words = 0;
  std::uint64_t opened_at = 0;
  std::size_t prefix_bytes = 0;     // that arrived in order
  std::uint16_t payload_bytes = 0;  // of a fragment, as the newest in order had it
  std::size_t summed_bytes = 0;     // from the front, what `crc32c` covers: fragments in order
  std::uint32_t crc32c = 0;         // of the pixels among them
  bool end_seen = false;            // the last byte arrived
  std::uint64_t arrivals = 0;       // fragments of either kind taken
  std::uint32_t repaired = 0;       // fragments
  std::uint32_t resent = 0;
  ReceivedFrame frame;

  // Error correction: what came of it, by group.
  std::vector<std::byte> parity_bytes;        // payloads, by index within the group, then by group
  std::vector<std::uint32_t> parity_arrived;  // one bit per parity fragment
  bool has_parity = false;
  ParityGeometry geometry;  // valid with has_parity

  /// Sums a payload while it is in the cache; what comes out of order is summed by finish_sum().
  void sum(std::size_t offset, std::span<const std::byte> payload) noexcept {
    // Up to here every byte is the first header's or a pixel's, however long the padding is.
    constexpr std::size_t kMostBehind = 2 * kFrameHeaderBytes;  // padding and second header
    const std::size_t sure = std::max<std::size_t>(total_bytes, kMostBehind) - kMostBehind;
    const std::size_t end = std::min(offset + payload.size(), sure);
    if (offset != summed_bytes || end <= offset) return;
    const std::size_t begin = std::max(offset, kFrameHeaderBytes);
    if (begin < end) {
      crc32c = protocol::crc32c(payload.subspan(begin - offset, end - begin), crc32c);
    }
    summed_bytes = end;
  }
  [[nodiscard]] std::uint32_t finish_sum(std::size_t pixel_bytes) const noexcept {
    const std::size_t begin = std::max(summed_bytes, kFrameHeaderBytes);
    return protocol::crc32c({bytes.get() + begin, kFrameHeaderBytes + pixel_bytes - begin}, crc32c);
  }
  [[nodiscard]] bool has_words(std::size_t begin, std::size_t count) const noexcept {
    return bits::count_set(received, begin, count) == count;
  }
  [[nodiscard]] bool all_received() const noexcept {
    return received_words == total_bytes / kWordBytes;
  }
  [[nodiscard]] bool has_fragment(std::uint32_t fragment) const noexcept {
    return has_words(std::size_t{fragment} * geometry.fragment_bytes / kWordBytes,
                     geometry.bytes_of(fragment) / kWordBytes);
  }
  [[nodiscard]] std::byte* parity(std::uint32_t group, std::uint32_t index) noexcept {
    return parity_bytes.data() +
           (std::size_t{index} * geometry.groups + group) * geometry.fragment_bytes;
  }
};

struct Reassembler::Stream {
  std::uint16_t id = 0;
  bool has_finished = false;
  std::uint32_t finished_id = 0;  // newest frame that left
  std::uint32_t far_behind = 0;   // fragments in a row from far behind it
  bool has_delivered = false;
  std::uint32_t delivered_id = 0;  // newest frame that was handed out
  bool has_geometry = false;
  FrameHeader geometry;  // of the newest frame whose header was known
};

}  // namespace emit::protocol
