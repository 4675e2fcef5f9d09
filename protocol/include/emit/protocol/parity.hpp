// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "emit/physics/check.hpp"
#include "emit/protocol/fragment.hpp"

/// Forward error correction of a frame's fragments (docs/wire.md section 4): a Reed-Solomon erasure
/// code over groups of fragments. Fragment i belongs to group i modulo the number of groups, so
/// datagrams lost in a row fall into different groups. Any k fragments restore a group of k data
/// and m parity fragments.
namespace emit::protocol {

/// Version byte of parity fragments. Their layout differs from kFragmentVersion's, so receivers
/// that do not know them drop and count them.
inline constexpr std::uint8_t kParityVersion = 2;
inline constexpr std::uint32_t kMaxFecData = physics::limits::kMaxFecData;
inline constexpr std::uint32_t kMaxFecParity = physics::limits::kMaxFecParity;
/// Default group, taken where a client asks for error correction without numbers. At 1 % random
/// loss fewer than one frame of 1 MB in a thousand stays incomplete.
inline constexpr std::uint32_t kDefaultFecData = 48;
inline constexpr std::uint32_t kDefaultFecParity = 5;

/// Parameters of the error correction, which the two ends agree on when a client subscribes.
struct FecParams {
  /// Largest number of data fragments in a group: 1 to kMaxFecData.
  std::uint32_t data_fragments = 0;
  /// Parity fragments in a group: 1 to kMaxFecParity; 0: no error correction.
  std::uint32_t parity_fragments = 0;

  [[nodiscard]] bool on() const noexcept { return parity_fragments != 0; }
  /// Returns true when the error correction is off or its numbers are within the limits.
  [[nodiscard]] bool valid() const noexcept {
    return !on() || (data_fragments >= 1 && data_fragments <= kMaxFecData &&
                     parity_fragments <= kMaxFecParity);
  }
  friend bool operator==(const FecParams&, const FecParams&) = default;
};

/// Distribution of one frame's fragments over groups. It follows from the parameters, the length of
/// the byte stream and that of a fragment.
struct ParityGeometry {
  std::uint32_t total_bytes = 0;
  std::uint32_t fragment_bytes = 0;  ///< length of every payload but the last
  std::uint32_t fragments = 0;
  std::uint32_t groups = 0;
  std::uint32_t parity_fragments = 0;  ///< parity fragments in each group

  /// Computes the distribution. RT-safe.
  /// @pre params.on() && params.valid() && 0 < fragment_bytes <= total_bytes
  [[nodiscard]] static ParityGeometry of(const FecParams& params, std::uint32_t total_bytes,
                                         std::uint32_t fragment_bytes) noexcept;
  /// Returns the number of data fragments in a group.
  /// @pre group < groups
  [[nodiscard]] std::uint32_t group_size(std::uint32_t group) const noexcept {
    EMIT_DCHECK_OP(group, <, groups);
    return (fragments - group - 1) / groups + 1;
  }
  /// Returns the index within the frame of the fragment at a position of a group.
  [[nodiscard]] std::uint32_t fragment(std::uint32_t group, std::uint32_t position) const noexcept {
    return group + position * groups;
  }
  /// Returns the payload length of a fragment. The code treats shorter ones as filled up with
  /// zeros.
  [[nodiscard]] std::uint32_t bytes_of(std::uint32_t fragment) const noexcept {
    return fragment + 1 == fragments ? total_bytes - fragment * fragment_bytes : fragment_bytes;
  }
  /// Returns the number of parity fragments of the frame.
  [[nodiscard]] std::uint32_t parity_count() const noexcept { return groups * parity_fragments; }
  friend bool operator==(const ParityGeometry&, const ParityGeometry&) = default;
};

/// Returns the largest number of parity bytes of a frame of up to `max_total_bytes`, for any
/// fragment length. RT-safe.
/// @pre params.on() && params.valid()
[[nodiscard]] std::size_t max_parity_bytes(const FecParams& params,
                                           std::uint32_t max_total_bytes) noexcept;
/// Returns the largest number of groups of a frame of up to `max_total_bytes`, for any fragment
/// length. RT-safe.
/// @pre params.on() && params.valid()
[[nodiscard]] std::size_t max_parity_groups(const FecParams& params,
                                            std::uint32_t max_total_bytes) noexcept;

/// Header of a parity fragment. It takes kFragmentHeaderBytes; the payload follows.
struct ParityHeader {
  std::uint16_t stream_id = 0;
  std::uint32_t frame_id = 0;
  std::uint16_t group = 0;
  std::uint8_t index = 0;             ///< index among the group's parity fragments
  std::uint8_t parity_fragments = 0;  ///< parity fragments in each group
  std::uint32_t total_bytes = 0;      ///< length of the frame's byte stream
  /// Payload length, the same as that of every data fragment but the last.
  std::uint16_t payload_bytes = 0;
  std::uint16_t groups = 0;
  std::int64_t sim_time_ns = 0;
};

/// Writes the header of a parity fragment. RT-safe.
void encode(const ParityHeader& header, std::span<std::byte, kFragmentHeaderBytes> out) noexcept;
/// Returns true when a datagram's header is that of a parity fragment. RT-safe.
[[nodiscard]] bool is_parity(std::span<const std::byte> header) noexcept;
/// Decodes the header of a parity fragment and checks everything that a single datagram can show,
/// given the agreed parameters. RT-safe.
/// @pre agreed.valid()
[[nodiscard]] FragmentStatus decode_parity_header(std::span<const std::byte> header,
                                                  std::size_t payload_bytes,
                                                  const FecParams& agreed,
                                                  ParityHeader& out) noexcept;

/// Makes the parity datagrams of one frame after the other, in memory of its own.
/// Thread: one owner.  Real time: the constructor allocates, everything else is RT-safe.
class ParityEncoder {
 public:
  /// Prepares for frames that are cut like `like`: the same total and payload length.
  /// @pre params.on() && params.valid()
  ParityEncoder(const FecParams& params, const Fragmenter& like);
  ~ParityEncoder();
  ParityEncoder(ParityEncoder&&) noexcept;
  ParityEncoder& operator=(ParityEncoder&&) noexcept;

  /// Begins a frame. The datagrams of the frame before become invalid.
  void begin() noexcept { encoded_groups_ = 0; }
  /// Encodes at least one more group of the frame of `fragments`, and further ones until about
  /// `budget_bytes` of the frame were read. Returns true when every datagram is ready.
  /// @pre total_bytes() and payload_bytes() of `fragments` are those of the constructor's `like`
  bool encode_some(const Fragmenter& fragments, std::size_t budget_bytes) noexcept;

  [[nodiscard]] const ParityGeometry& geometry() const noexcept { return geometry_; }
  [[nodiscard]] std::uint32_t datagram_count() const noexcept { return geometry_.parity_count(); }
  /// Returns the length of every datagram.
  [[nodiscard]] std::uint32_t datagram_bytes() const noexcept {
    return geometry_.fragment_bytes + static_cast<std::uint32_t>(kFragmentHeaderBytes);
  }
  /// Returns consecutive datagrams, one behind the other, each with header and payload. Neighbours
  /// belong to different groups.
  /// @pre encode_some() returned true for this frame, and first + count <= datagram_count()
  [[nodiscard]] std::span<const std::byte> datagrams(std::uint32_t first,
                                                     std::uint32_t count) const noexcept {
    EMIT_CHECK_OP(encoded_groups_, ==, geometry_.groups);
    EMIT_CHECK_OP(std::uint64_t{first} + count, <=, datagram_count());
    return std::span(memory_).subspan(std::size_t{first} * datagram_bytes(),
                                      std::size_t{count} * datagram_bytes());
  }

 private:
  struct Code;
  void encode_group(const Fragmenter& fragments, std::uint32_t group) noexcept;

  ParityGeometry geometry_;
  std::uint32_t encoded_groups_ = 0;
  std::vector<std::byte> memory_;   // the datagrams, by index within the group, then by group
  std::vector<std::byte> scratch_;  // fragments that do not lie in one piece in the frame
  std::unique_ptr<Code> code_;
};

/// Restores the missing fragments of a group.
/// Thread: one owner.  Real time: the constructor allocates, decode() is RT-safe.
class GroupDecoder {
 public:
  /// Prepares for groups of these parameters.
  /// @pre params.on() && params.valid()
  explicit GroupDecoder(const FecParams& params);
  ~GroupDecoder();
  GroupDecoder(GroupDecoder&&) noexcept;
  GroupDecoder& operator=(GroupDecoder&&) noexcept;

  /// Restores the missing fragments of one group. Returns false when fewer parity fragments than
  /// missing ones are present, or when nothing is missing. All memory is `bytes` long.
  /// @param data    the group's fragments in order, null where missing
  /// @param parity  the group's parity fragments in order, null where missing
  /// @param out     memory for the missing fragments, in order; it overlaps none of the inputs
  [[nodiscard]] bool decode(std::size_t bytes, std::span<const std::byte* const> data,
                            std::span<const std::byte* const> parity,
                            std::span<std::byte* const> out) noexcept;

 private:
  struct Code;
  std::unique_ptr<Code> code_;
};

}  // namespace emit::protocol
