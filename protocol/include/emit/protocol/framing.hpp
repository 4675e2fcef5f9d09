// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "emit/protocol/frame_header.hpp"

/// Records on a TCP connection: 12-byte header, then the body (docs/wire.md).
namespace emit::protocol {

inline constexpr std::uint32_t kRecordMagic = 0x43524D45;  ///< "EMRC" as bytes E M R C
inline constexpr std::uint8_t kRecordVersion = 1;
inline constexpr std::size_t kRecordHeaderBytes = 12;
inline constexpr std::uint32_t kDefaultMaxControlBytes = 1u << 20;

/// What the body is. A receiver skips records of a kind that it does not know.
enum class RecordKind : std::uint8_t {
  control = 1,  ///< Protobuf emit.v1.ControlRecord
  frame = 2,    ///< frame header (320 bytes) + pixels, encoded as it says
  host_frame =
      3,       ///< Protobuf emit.v1.HostFrame without the envelope: no allocation at the receiver
  resend = 4,  ///< resend.hpp: fragments that a client is missing; no allocation either
};

/// RT-safe.
void encode_record_header(RecordKind kind, std::uint32_t body_bytes,
                          std::span<std::byte, kRecordHeaderBytes> out) noexcept;

enum class ParseStatus : std::uint8_t {
  record,         ///< `record` is filled
  need_more,      ///< hand over more bytes
  wrong_magic,    ///< not this protocol, or the stream lost its framing
  wrong_version,  ///< peer speaks another record version
  oversize,       ///< length over the limit of its kind
};
[[nodiscard]] std::string_view to_string(ParseStatus status) noexcept;

struct Record {
  RecordKind kind{};                ///< may hold a value outside the enum
  std::span<const std::byte> body;  ///< points into the parser
  /// Frames: CRC-32C of what follows the frame header, summed as it arrived.
  std::uint32_t payload_crc32c = 0;
};

struct RecordLimits {
  std::uint32_t max_control_bytes = kDefaultMaxControlBytes;  ///< every kind but frame
  std::uint32_t max_frame_bytes = 0;  ///< body of a frame record; 0 = frames are refused
};

/// Cuts a byte stream into records.
///
/// Thread: one owner.  Real time: the constructor allocates, everything else is RT-safe.
/// @code
///   auto space = parser.writable();  // never empty unless an error is pending
///   parser.commit(read(fd, space));
///   while (parser.next(record) == ParseStatus::record) use(record.body);
/// @endcode
class RecordParser {
 public:
  /// Allocates two of the largest record, so that bytes are moved at most once per record.
  explicit RecordParser(const RecordLimits& limits);

  /// Free space behind the bytes held. Invalidates earlier record bodies. Empty after an error.
  /// Precondition for progress: next() was called until it gave need_more.
  [[nodiscard]] std::span<std::byte> writable() noexcept;

  /// `count` bytes of writable() were filled. Precondition: count <= writable().size().
  void commit(std::size_t count) noexcept;

  /// Takes the next record off. An error is final until reset(): the framing is lost.
  [[nodiscard]] ParseStatus next(Record& record) noexcept;

  /// The header at fault after wrong_version (its version) or oversize (its length).
  [[nodiscard]] std::uint32_t offending_value() const noexcept { return offending_value_; }

  /// Bytes of an unfinished record held: not 0 at the end of a stream means it was cut.
  [[nodiscard]] std::size_t pending_bytes() const noexcept { return end_ - begin_; }

  /// What the record begun still lacks; 0 while its header is not complete. As of the last next().
  [[nodiscard]] std::size_t missing_bytes() const noexcept { return missing_; }

  /// Forgets everything, for a new connection.
  void reset() noexcept;

 private:
  [[nodiscard]] std::uint32_t limit_of(RecordKind kind) const noexcept;
  void sum(RecordKind kind, std::size_t body_bytes) noexcept;

  RecordLimits limits_;
  std::size_t capacity_;
  std::unique_ptr<std::byte[]> buffer_;
  std::size_t begin_ = 0;   // first byte not yet taken
  std::size_t end_ = 0;     // behind the last byte held
  std::size_t summed_ = 0;  // bytes of the record at begin_ that payload_crc32c_ has passed
  std::uint32_t payload_crc32c_ = 0;
  std::size_t missing_ = 0;
  ParseStatus error_ = ParseStatus::need_more;
  std::uint32_t offending_value_ = 0;
};

/// Frame of a frame record or of a file: header and pixels, pointing into the body.
struct FrameView {
  FrameHeader header;
  /// Unaligned: header.payload_bytes bytes or, encoded, header.encoded_bytes.
  std::span<const std::byte> pixels;
};

/// Errors (protocol): as decode_frame_header, and a body whose length differs from 320 +
/// payload_bytes or, encoded, encoded_bytes, which is less. Does not check the payload CRC.
[[nodiscard]] physics::Result<FrameView> decode_frame_record(std::span<const std::byte> body);

/// CRC-32C of raw pixels equals the header's. RT-safe.
[[nodiscard]] bool payload_crc_matches(const FrameView& frame) noexcept;

}  // namespace emit::protocol
