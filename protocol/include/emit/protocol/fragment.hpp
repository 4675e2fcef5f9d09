// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "emit/protocol/frame_header.hpp"

/// UDP fragments of a frame: each one describes itself (docs/wire.md).
///
/// Byte stream of one frame: frame header (320), pixels, 0..319 zero bytes, frame header again. The
/// zero bytes keep the second header within the last fragment, so one lost fragment never costs it.
namespace emit::protocol {

inline constexpr std::uint32_t kFragmentMagic = 0x474D4645;  ///< "EFMG" as bytes E F M G
inline constexpr std::uint8_t kFragmentVersion = 1;
inline constexpr std::size_t kFragmentHeaderBytes = 32;
/// Smallest payload: the frame header fits into fragment 0. Largest: a UDP datagram over IPv4.
inline constexpr std::uint32_t kMinFragmentPayloadBytes = 320;
inline constexpr std::uint32_t kMaxFragmentPayloadBytes = 65472;

enum FragmentFlags : std::uint8_t {
  kFragmentFirst = 1u << 0,  ///< begins with the frame header
  kFragmentLast = 1u << 1,   ///< ends with the frame header
  kFragmentParity =
      1u << 2,  ///< holds no part of the frame but of its error correction (parity.hpp)
  kFragmentResent = 1u << 3,  ///< sent again because the receiver asked for it
};

struct FragmentHeader {
  std::uint8_t flags = 0;           ///< FragmentFlags; bits not known are ignored
  std::uint16_t stream_id = 0;      ///< given in Subscribed
  std::uint32_t frame_id = 0;       ///< counts frames sent on this stream by one, wraps
  std::uint32_t byte_offset = 0;    ///< of the payload in the frame's byte stream; multiple of 4
  std::uint32_t total_bytes = 0;    ///< of the frame's byte stream; multiple of 4
  std::uint16_t payload_bytes = 0;  ///< multiple of 4, not 0
  std::uint16_t row = 0;            ///< first image row with a pixel in the payload
  std::int64_t sim_time_ns = 0;     ///< as in the frame header
};

enum class FragmentStatus : std::uint8_t {
  accepted,
  short_input,  ///< fewer bytes than a header, or than the header announces
  wrong_magic,
  wrong_version,
  bad_length,    ///< payload length 0, not a multiple of 4, or not what the datagram holds
  bad_offset,    ///< offset not a multiple of 4, or payload reaches beyond total_bytes
  oversize,      ///< total_bytes too small for a frame or over the receiver's limit
  duplicate,     ///< every byte is already there
  overlap,       ///< some bytes are already there: one of the two is wrong
  inconsistent,  ///< total, sim time or first/last flag contradict the frame's other fragments
  late,          ///< of a frame that was already handed out or pushed out
  no_buffer,     ///< every buffer is held by the consumer
  too_many_streams,
  bad_parity,  ///< of another geometry than was agreed, or none was agreed
};
inline constexpr std::size_t kFragmentStatusCount = 14;
[[nodiscard]] std::string_view to_string(FragmentStatus status) noexcept;

/// RT-safe.
void encode(const FragmentHeader& header, std::span<std::byte, kFragmentHeaderBytes> out) noexcept;

/// Checks everything that one datagram alone can tell; `datagram` is header + payload. RT-safe.
[[nodiscard]] FragmentStatus decode_fragment_header(std::span<const std::byte> datagram,
                                                    FragmentHeader& out) noexcept;
/// The same for a header whose payload, that many bytes, lies elsewhere.
[[nodiscard]] FragmentStatus decode_fragment_header(std::span<const std::byte> header,
                                                    std::size_t payload_bytes,
                                                    FragmentHeader& out) noexcept;
/// Whose stream a fragment, also one of parity, says that it is of; empty where it is none. The
/// rest is not looked at. RT-safe.
[[nodiscard]] std::optional<std::uint16_t> stream_of_fragment(
    std::span<const std::byte> datagram) noexcept;

/// Returns the payload of every fragment but the last where this much is asked for: within
/// [kMinFragmentPayloadBytes, kMaxFragmentPayloadBytes] and a multiple of 4.
[[nodiscard]] constexpr std::uint32_t granted_fragment_payload_bytes(
    std::uint32_t wanted_bytes) noexcept {
  return std::clamp(wanted_bytes, kMinFragmentPayloadBytes, kMaxFragmentPayloadBytes) &
         ~std::uint32_t{3};
}

/// Cuts a frame into fragments without copying pixels.
///
/// Every fragment but the last has the same size, so consecutive ones go out in one call with
/// UDP_SEGMENT = datagram_bytes(). Refers to the caller's memory, which must outlive its use.
/// Thread: const functions any.  Real time: RT-safe.
class Fragmenter {
 public:
  struct Params {
    std::uint16_t stream_id = 0;
    std::uint32_t frame_id = 0;
    std::int64_t sim_time_ns = 0;
    std::uint32_t row_bytes = 0;  ///< width_px * 4; 0 leaves `row` 0
    /// Clamped to [kMinFragmentPayloadBytes, kMaxFragmentPayloadBytes] and cut to a multiple of 4.
    std::uint32_t max_payload_bytes = 1440;
  };
  /// Piece 0 is the fragment header in the caller's memory; then parts of frame header and pixels.
  struct Pieces {
    std::array<std::span<const std::byte>, 5> piece;
    std::uint32_t count = 0;
    std::uint32_t bytes = 0;  ///< of the datagram
  };

  /// `frame_header`: as encode(FrameHeader) wrote it. Precondition: pixels.size() is a multiple of
  /// 4 and at most 2^32 - 1284.
  Fragmenter(const Params& params, std::span<const std::byte, kFrameHeaderBytes> frame_header,
             std::span<const std::byte> pixels) noexcept;

  [[nodiscard]] std::uint32_t fragment_count() const noexcept { return fragment_count_; }
  [[nodiscard]] std::uint32_t total_bytes() const noexcept { return total_bytes_; }
  /// Of every fragment but the last: the segment size for UDP_SEGMENT.
  [[nodiscard]] std::uint32_t datagram_bytes() const noexcept {
    return payload_bytes_ + static_cast<std::uint32_t>(kFragmentHeaderBytes);
  }
  /// Payload of every fragment but the last; of the only one.
  [[nodiscard]] std::uint32_t payload_bytes() const noexcept {
    return std::min(payload_bytes_, total_bytes_);
  }
  [[nodiscard]] const Params& params() const noexcept { return params_; }

  /// Writes fragment `index`'s header into `header_memory` and points at its parts; any order.
  /// Precondition: index < fragment_count().
  /// `more_flags`: kFragmentResent or 0.
  [[nodiscard]] Pieces pieces(std::uint32_t index,
                              std::span<std::byte, kFragmentHeaderBytes> header_memory,
                              std::uint8_t more_flags = 0) const noexcept;
  /// Payload of a fragment that consists of pixels alone, where they lie; empty for the others.
  [[nodiscard]] std::span<const std::byte> pixels_of(std::uint32_t index) const noexcept;

 private:
  Params params_;
  std::span<const std::byte, kFrameHeaderBytes> frame_header_;
  std::span<const std::byte> pixels_;
  std::uint32_t payload_bytes_ = 0;  // of every fragment but the last
  std::uint32_t padding_bytes_ = 0;
  std::uint32_t total_bytes_ = 0;
  std::uint32_t fragment_count_ = 0;
};

}  // namespace emit::protocol
