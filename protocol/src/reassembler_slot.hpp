// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstring>
#include <new>
#include <vector>

#include "bit_range.hpp"
#include "emit/protocol/reassembler.hpp"

/// State that the reassembler keeps of frames and streams.
namespace emit::protocol {

inline constexpr std::size_t kWordBytes = sizeof(float);
inline constexpr std::size_t kHeaderWords = kFrameHeaderBytes / kWordBytes;
inline constexpr std::size_t kPixelAlignment = 64;
static_assert(kFrameHeaderBytes % kPixelAlignment == 0, "pixels start aligned");

/// Deleter of the frame memory.
struct AlignedDelete {
  void operator()(std::byte* bytes) const noexcept {
    ::operator delete[](bytes, std::align_val_t{kPixelAlignment});
  }
};
using AlignedBytes = std::unique_ptr<std::byte[], AlignedDelete>;

/// Returns the distance between two frame ids, which wrap. It is positive when `a` comes after `b`.
[[nodiscard]] inline std::int32_t frame_distance(std::uint32_t a, std::uint32_t b) noexcept {
  return static_cast<std::int32_t>(a - b);
}

/// Buffer and state of one frame.
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
  std::size_t prefix_bytes = 0;     // number of bytes that arrived in order from the front
  std::uint16_t payload_bytes = 0;  // payload length of the newest fragment in order
  std::size_t summed_bytes = 0;     // number of bytes from the front that crc32c covers
  std::uint32_t crc32c = 0;         // CRC-32C of the pixels among them
  bool end_seen = false;            // true when the last byte arrived
  std::uint64_t arrivals = 0;       // number of data and parity fragments taken
  std::uint32_t repaired = 0;       // number of fragments restored by error correction
  std::uint32_t resent = 0;
  ReceivedFrame frame;

  // Parity fragments received, by group.
  std::vector<std::byte> parity_bytes;        // payloads, by index within the group, then by group
  std::vector<std::uint32_t> parity_arrived;  // one bit per parity fragment
  bool has_parity = false;
  ParityGeometry geometry;  // valid with has_parity

  /// Continues the CRC over a payload while it is in the cache. finish_sum() covers payloads that
  /// come out of order.
  void sum(std::size_t offset, std::span<const std::byte> payload) noexcept {
    // Every byte up to here belongs to the first header or the pixels, however long the padding is.
    // length of the longest padding and the second header.
    constexpr std::size_t kMaxTrailerBytes = 2 * kFrameHeaderBytes;
    const std::size_t certain_end =
        std::max<std::size_t>(total_bytes, kMaxTrailerBytes) - kMaxTrailerBytes;
    const std::size_t end = std::min(offset + payload.size(), certain_end);
    if (offset != summed_bytes || end <= offset) return;
    const std::size_t begin = std::max(offset, kFrameHeaderBytes);
    if (begin < end) {
      crc32c = protocol::crc32c(payload.subspan(begin - offset, end - begin), crc32c);
    }
    summed_bytes = end;
  }
  /// Returns the CRC-32C of all pixels.
  [[nodiscard]] std::uint32_t finish_sum(std::size_t pixel_bytes) const noexcept {
    const std::size_t begin = std::max(summed_bytes, kFrameHeaderBytes);
    return protocol::crc32c({bytes.get() + begin, kFrameHeaderBytes + pixel_bytes - begin}, crc32c);
  }
  /// Returns true when every word of the range has arrived.
  [[nodiscard]] bool has_words(std::size_t begin, std::size_t count) const noexcept {
    return bits::count_set(received, begin, count) == count;
  }
  [[nodiscard]] bool all_received() const noexcept {
    return received_words == total_bytes / kWordBytes;
  }
  /// Returns true when a fragment of the frame's geometry has arrived.
  [[nodiscard]] bool has_fragment(std::uint32_t fragment) const noexcept {
    return has_words(std::size_t{fragment} * geometry.fragment_bytes / kWordBytes,
                     geometry.bytes_of(fragment) / kWordBytes);
  }
  /// Returns the memory of a parity fragment's payload.
  [[nodiscard]] std::byte* parity(std::uint32_t group, std::uint32_t index) noexcept {
    return parity_bytes.data() +
           (std::size_t{index} * geometry.groups + group) * geometry.fragment_bytes;
  }
};

/// State of one stream.
struct Reassembler::Stream {
  std::uint16_t id = 0;
  bool has_finished = false;
  std::uint32_t finished_id = 0;  // id of the newest frame that left
  std::uint32_t far_behind = 0;   // number of fragments in a row from far behind finished_id
  bool has_delivered = false;
  std::uint32_t delivered_id = 0;  // id of the newest frame that was handed out
  bool has_geometry = false;
  FrameHeader geometry;  // header of the newest frame whose header was known
};

}  // namespace emit::protocol
