// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "emit/physics/limits.hpp"
#include "emit/protocol/fragment.hpp"

/// Forward error correction of a frame's fragments (docs/wire.md section 4): Reed-Solomon erasure
/// code over groups of fragments. Fragment i belongs to group i modulo the number of groups, so
/// that datagrams lost in a row fall into different groups. Of a group of k fragments and m parity
/// fragments any k are enough.
namespace emit::protocol {

/// Fragments with another layout than kFragmentVersion's: receivers that do not know them drop and
/// count them.
inline constexpr std::uint8_t kParityVersion = 2;
inline constexpr std::uint32_t kMaxFecData = physics::limits::kMaxFecData;
inline constexpr std::uint32_t kMaxFecParity = physics::limits::kMaxFecParity;
/// What is taken where only "with error correction" was said: at 1 % random loss fewer than one
/// frame of 1 MB in a thousand stays incomplete.
inline constexpr std::uint32_t kDefaultFecData = 48;
inline constexpr std::uint32_t kDefaultFecParity = 5;

/// What the two ends agree on when a client subscribes.
struct FecParams {
  std::uint32_t data_fragments = 0;    ///< of a group at most: 1 to kMaxFecData
  std::uint32_t parity_fragments = 0;  ///< of a group: 1 to kMaxFecParity; 0: no error correction

  [[nodiscard]] bool on() const noexcept { return parity_fragments != 0; }
  /// Off, or within the limits.
  [[nodiscard]] bool valid() const noexcept {
    return !on() || (data_fragments >= 1 && data_fragments <= kMaxFecData &&
                     parity_fragments <= kMaxFecParity);
  }
  friend bool operator==(const FecParams&, const FecParams&) = default;
};

/// How one frame's fragments fall into groups. Follows from the parameters, the length of the byte
/// stream and that of a fragment.
struct ParityGeometry {
  std::uint32_t total_bytes = 0;
  std::uint32_t fragment_bytes = 0;  ///< payload of every fragment but the last
  std::uint32_t fragments = 0;
  std::uint32_t groups = 0;
  std::uint32_t parity_fragments = 0;  ///< per group

  /// Precondition: params.on() and valid(); 0 < fragment_bytes <= total_bytes.
  [[nodiscard]] static ParityGeometry of(const FecParams& params, std::uint32_t total_bytes,
                                         std::uint32_t fragment_bytes) noexcept;
  /// Data fragments of a group. Precondition: group < groups.
  [[nodiscard]] std::uint32_t group_size(std::uint32_t group) const noexcept {
    return (fragments - group - 1) / groups + 1;
  }
  [[nodiscard]] std::uint32_t fragment(std::uint32_t group, std::uint32_t position) const noexcept {
    return group + position * groups;
  }
  /// Payload of a fragment; the code sees shorter ones filled up with zeros.
  [[nodiscard]] std::uint32_t bytes_of(std::uint32_t fragment) const noexcept {
    return fragment + 1 == fragments ? total_bytes - fragment * fragment_bytes : fragment_bytes;
  }
  [[nodiscard]] std::uint32_t parity_count() const noexcept { return groups * parity_fragments; }
  friend bool operator==(const ParityGeometry&, const ParityGeometry&) = default;
};

/// Bytes of parity that a frame of up to `max_total_bytes` can have, whatever its fragments.
[[nodiscard]] std::size_t max_parity_bytes(const FecParams& params,
                                           std::uint32_t max_total_bytes) noexcept;
/// Groups that such a frame can have.
[[nodiscard]] std::size_t max_parity_groups(const FecParams& params,
                                            std::uint32_t max_total_bytes) noexcept;

/// Header of a parity fragment, kFragmentHeaderBytes long; the payload follows.
struct ParityHeader {
  std::uint16_t stream_id = 0;
  std::uint32_t frame_id = 0;
  std::uint16_t group = 0;
  std::uint8_t index = 0;             ///< among the group's parity fragments
  std::uint8_t parity_fragments = 0;  ///< of each group
  std::uint32_t total_bytes = 0;      ///< of the frame's byte stream
  std::uint16_t payload_bytes = 0;    ///< as every data fragment but the last
  std::uint16_t groups = 0;
  std::int64_t sim_time_ns = 0;
};

/// RT-safe.
void encode(const ParityHeader& header, std::span<std::byte, kFragmentHeaderBytes> out) noexcept;
/// True when a datagram's header says that it is one of these. RT-safe.
[[nodiscard]] bool is_parity(std::span<const std::byte> header) noexcept;
/// Checks what one datagram alone can tell, given what was agreed. RT-safe.
[[nodiscard]] FragmentStatus decode_parity_header(std::span<const std::byte> header,
                                                  std::size_t payload_bytes,
                                                  const FecParams& agreed,
                                                  ParityHeader& out) noexcept;

/// Makes the parity datagrams of one frame after the other, in memory of its own.
/// Thread: one owner.  Real time: the constructor allocates, everything else is RT-safe.
class ParityEncoder {
 public:
  /// For frames cut like `like`. Precondition: params.on() and valid().
  ParityEncoder(const FecParams& params, const Fragmenter& like);
  ~ParityEncoder();
  ParityEncoder(ParityEncoder&&) noexcept;
  ParityEncoder& operator=(ParityEncoder&&) noexcept;

  /// Begins a frame.
  void begin() noexcept { encoded_groups_ = 0; }
  /// Goes on with the frame of `fragments`, at least one group, until about `budget_bytes` of the
  /// frame were read. True when every datagram is ready. Precondition: cut like the one before.
  bool encode_some(const Fragmenter& fragments, std::size_t budget_bytes) noexcept;

  [[nodiscard]] const ParityGeometry& geometry() const noexcept { return geometry_; }
  [[nodiscard]] std::uint32_t datagram_count() const noexcept { return geometry_.parity_count(); }
  /// Of every datagram.
  [[nodiscard]] std::uint32_t datagram_bytes() const noexcept {
    return geometry_.fragment_bytes + static_cast<std::uint32_t>(kFragmentHeaderBytes);
  }
  /// Consecutive datagrams, header and payload each, one behind the other. Neighbours belong to
  /// different groups. Precondition: encode_some() gave true.
  [[nodiscard]] std::span<const std::byte> datagrams(std::uint32_t first,
                                                     std::uint32_t count) const noexcept {
    return std::span(memory_).subspan(std::size_t{first} * datagram_bytes(),
                                      std::size_t{count} * datagram_bytes());
  }

 private:
  struct Code;
  void encode_group(const Fragmenter& fragments, std::uint32_t group) noexcept;

  ParityGeometry geometry_;
  std::uint32_t encoded_groups_ = 0;
  std::vector<std::byte> memory_;   // the datagrams, by index within the group, then by group
  std::vector<std::byte> scratch_;  // fragments that do not lie in one piece
  std::unique_ptr<Code> code_;
};

/// Brings back the missing fragments of a group.
/// Thread: one owner.  Real time: the constructor allocates, decode() is RT-safe.
class GroupDecoder {
 public:
  /// Precondition: params.on() and valid().
  explicit GroupDecoder(const FecParams& params);
  ~GroupDecoder();
  GroupDecoder(GroupDecoder&&) noexcept;
  GroupDecoder& operator=(GroupDecoder&&) noexcept;

  /// `data`: the group's fragments in order, null where missing; `parity`: likewise; `out`: where
  /// the missing ones go, in order. All of `bytes` length; `out` overlaps none of the others.
  /// False: fewer parity fragments than missing ones, or nothing is missing.
  [[nodiscard]] bool decode(std::size_t bytes, std::span<const std::byte* const> data,
                            std::span<const std::byte* const> parity,
                            std::span<std::byte* const> out) noexcept;

 private:
  struct Code;
  std::unique_ptr<Code> code_;
};

}  // namespace emit::protocol
