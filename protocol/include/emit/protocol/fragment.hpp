// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "emit/physics/limits.hpp"
#include "emit/protocol/frame_header.hpp"

/// UDP fragments of a frame (docs/wire.md section 4). Each fragment describes itself.
///
/// The byte stream of one frame is: frame header (384 bytes), pixels, 0 to 383 zero bytes, the
/// frame header again. The zero bytes keep the second header within the last fragment, so one lost
/// fragment never costs both headers.
namespace emit::protocol {

inline constexpr std::uint32_t kFragmentMagic = 0x474D4645;  ///< "EFMG" as bytes E F M G
inline constexpr std::uint8_t kFragmentVersion = 1;
inline constexpr std::size_t kFragmentHeaderBytes = 32;
/// Smallest and largest payload of a fragment, bytes. The smallest one holds the frame header; the
/// largest one fills a UDP datagram over IPv4.
inline constexpr std::uint32_t kMinFragmentPayloadBytes = physics::limits::kFragmentPayloadBytes.lo;
inline constexpr std::uint32_t kMaxFragmentPayloadBytes = physics::limits::kFragmentPayloadBytes.hi;
/// Largest number of pixel bytes whose byte stream a 32-bit offset can address.
inline constexpr std::uint32_t kMaxFragmentedPixelBytes = 0xFFFFFFFF - 1283;

/// Flags of a fragment, at byte 5 of its header.
enum FragmentFlags : std::uint8_t {
  kFragmentFirst = 1u << 0,  ///< the payload begins with the frame header
  kFragmentLast = 1u << 1,   ///< the payload ends with the frame header
  kFragmentParity =
      1u << 2,  ///< the payload is error correction, not a part of the frame (parity.hpp)
  kFragmentResent = 1u << 3,  ///< the fragment is sent again because the receiver asked for it
};

/// Header of one fragment.
struct FragmentHeader {
  std::uint8_t flags = 0;       ///< FragmentFlags; unknown bits are ignored
  std::uint16_t stream_id = 0;  ///< number of the stream, from Subscribed
  std::uint32_t frame_id = 0;   ///< counter of the frames sent on this stream; it wraps
  /// Position of the payload in the frame's byte stream, a multiple of 4.
  std::uint32_t byte_offset = 0;
  std::uint32_t total_bytes = 0;    ///< length of the frame's byte stream, a multiple of 4
  std::uint16_t payload_bytes = 0;  ///< length of the payload, a multiple of 4, not 0
  std::uint16_t row = 0;            ///< first image row with a pixel in the payload
  std::int64_t sim_time_ns = 0;     ///< simulation time, as in the frame header
};

/// Result of taking one fragment. Every value but `accepted` is a reason why it was dropped.
enum class FragmentStatus : std::uint8_t {
  accepted,
  short_input,  ///< fewer bytes than a header has, or than the header announces
  wrong_magic,
  wrong_version,
  bad_length,  ///< the payload length is 0, no multiple of 4, or not what the datagram holds
  bad_offset,  ///< the offset is no multiple of 4, or the payload reaches beyond total_bytes
  oversize,    ///< total_bytes is too small for a frame or over the receiver's limit
  duplicate,   ///< every byte has arrived before
  overlap,     ///< some bytes have arrived before, so one of the two fragments is wrong
  /// Total, simulation time or first/last flag contradict the frame's other fragments.
  inconsistent,
  late,       ///< the frame was already handed out or pushed out
  no_buffer,  ///< the consumer holds every buffer
  too_many_streams,
  bad_parity,  ///< the geometry is not the agreed one, or none was agreed
};
inline constexpr std::size_t kFragmentStatusCount = 14;
/// Returns the English name of a status, for messages. RT-safe.
[[nodiscard]] std::string_view to_string(FragmentStatus status) noexcept;

/// Writes a fragment header. RT-safe.
void encode(const FragmentHeader& header, std::span<std::byte, kFragmentHeaderBytes> out) noexcept;

/// Decodes the header of a datagram, which is header and payload, and checks everything that a
/// single datagram can show. RT-safe.
[[nodiscard]] FragmentStatus decode_fragment_header(std::span<const std::byte> datagram,
                                                    FragmentHeader& out) noexcept;
/// Decodes a header whose payload of `payload_bytes` bytes lies elsewhere, with the same checks.
/// RT-safe.
[[nodiscard]] FragmentStatus decode_fragment_header(std::span<const std::byte> header,
                                                    std::size_t payload_bytes,
                                                    FragmentHeader& out) noexcept;
/// Returns the stream id that a fragment or parity fragment carries, or nothing when the datagram
/// is neither. The other fields are not checked. RT-safe.
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
/// Every fragment but the last has the same size, so one call with UDP_SEGMENT = datagram_bytes()
/// sends consecutive ones. The object refers to the caller's memory, which must outlive it.
/// Thread: any number of threads may call const functions.  Real time: RT-safe.
class Fragmenter {
 public:
  /// Description of the frame and of the fragment size.
  struct Params {
    std::uint16_t stream_id = 0;
    std::uint32_t frame_id = 0;
    std::int64_t sim_time_ns = 0;
    std::uint32_t row_bytes = 0;  ///< length of an image row (width_px * 4); 0 leaves `row` 0
    /// Largest payload. It is clamped to [kMinFragmentPayloadBytes, kMaxFragmentPayloadBytes] and
    /// rounded down to a multiple of 4.
    std::uint32_t max_payload_bytes = 1440;
  };
  /// Parts of one datagram. Piece 0 is the fragment header in the caller's memory; parts of the
  /// frame header and the pixels follow.
  struct Pieces {
    std::array<std::span<const std::byte>, 5> piece;
    std::uint32_t count = 0;
    std::uint32_t bytes = 0;  ///< length of the datagram
  };

  /// Cuts the frame that consists of `frame_header`, as encode(FrameHeader) wrote it, and `pixels`.
  /// @pre pixels.size() is a multiple of 4 and at most kMaxFragmentedPixelBytes
  Fragmenter(const Params& params, std::span<const std::byte, kFrameHeaderBytes> frame_header,
             std::span<const std::byte> pixels) noexcept;

  [[nodiscard]] std::uint32_t fragment_count() const noexcept { return fragment_count_; }
  [[nodiscard]] std::uint32_t total_bytes() const noexcept { return total_bytes_; }
  /// Returns the length of every datagram but the last: the segment size for UDP_SEGMENT.
  [[nodiscard]] std::uint32_t datagram_bytes() const noexcept {
    return payload_bytes_ + static_cast<std::uint32_t>(kFragmentHeaderBytes);
  }
  /// Returns the payload length of every fragment but the last. A frame of one fragment has this
  /// length.
  [[nodiscard]] std::uint32_t payload_bytes() const noexcept {
    return std::min(payload_bytes_, total_bytes_);
  }
  [[nodiscard]] const Params& params() const noexcept { return params_; }

  /// Writes the header of fragment `index` into `header_memory` and returns the parts of the
  /// datagram. The calls may come in any order.
  /// @param more_flags  kFragmentResent or 0
  /// @pre index < fragment_count()
  [[nodiscard]] Pieces pieces(std::uint32_t index,
                              std::span<std::byte, kFragmentHeaderBytes> header_memory,
                              std::uint8_t more_flags = 0) const noexcept;
  /// Returns the payload of a fragment that consists of pixels alone, in the caller's memory.
  /// Returns an empty span for every other fragment.
  [[nodiscard]] std::span<const std::byte> pixels_of(std::uint32_t index) const noexcept;

 private:
  Params params_;
  std::span<const std::byte, kFrameHeaderBytes> frame_header_;
  std::span<const std::byte> pixels_;
  std::uint32_t payload_bytes_ = 0;  // length of every payload but the last
  std::uint32_t padding_bytes_ = 0;
  std::uint32_t total_bytes_ = 0;
  std::uint32_t fragment_count_ = 0;
};

}  // namespace emit::protocol
