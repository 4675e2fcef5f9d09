// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "emit/protocol/frame_header.hpp"

/// Records on a TCP connection: a 12-byte header, then the body (docs/wire.md section 2).
namespace emit::protocol {

inline constexpr std::uint32_t kRecordMagic = 0x43524D45;  ///< "EMRC" as bytes E M R C
inline constexpr std::uint8_t kRecordVersion = 1;
inline constexpr std::size_t kRecordHeaderBytes = 12;
/// Default limit of the body of every record that holds no frame, bytes.
inline constexpr std::uint32_t kDefaultMaxControlBytes = 1u << 20;

/// Kind of a record's body. A receiver skips records of an unknown kind.
enum class RecordKind : std::uint8_t {
  control = 1,  ///< Protobuf emit.v1.ControlRecord
  frame = 2,    ///< frame header (384 bytes), then the pixels in the encoding that it names
  /// Protobuf emit.v1.HostFrame without the envelope; the receiver allocates nothing for it.
  host_frame = 3,
  /// Request for missing fragments (resend.hpp); the receiver allocates nothing for it.
  resend = 4,
};

/// Writes a record header for a body of `body_bytes` bytes. RT-safe.
void encode_record_header(RecordKind kind, std::uint32_t body_bytes,
                          std::span<std::byte, kRecordHeaderBytes> out) noexcept;

/// Result of RecordParser::next().
enum class ParseStatus : std::uint8_t {
  record,         ///< a record was taken off
  need_more,      ///< more bytes are needed
  wrong_magic,    ///< the peer speaks another protocol, or the stream lost its framing
  wrong_version,  ///< the peer speaks another record version
  oversize,       ///< the length exceeds the limit of its kind
};
/// Returns the English name of a status, for messages. RT-safe.
[[nodiscard]] std::string_view to_string(ParseStatus status) noexcept;

/// One record, as RecordParser::next() returns it.
struct Record {
  RecordKind kind{};                ///< kind of the body; it may hold a value outside the enum
  std::span<const std::byte> body;  ///< body of the record, in the parser's memory
  /// CRC-32C of the bytes behind the frame header of a frame record, computed as they arrived; 0
  /// for other kinds.
  std::uint32_t payload_crc32c = 0;
};

/// Largest body lengths that a parser accepts.
struct RecordLimits {
  std::uint32_t max_control_bytes = kDefaultMaxControlBytes;  ///< limit of every kind but frame
  std::uint32_t max_frame_bytes = 0;  ///< limit of a frame record; 0 refuses frames
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
  /// Allocates two times the largest record, so that bytes are moved at most once per record.
  explicit RecordParser(const RecordLimits& limits);

  /// Returns the free space behind the bytes held. The call makes earlier record bodies invalid.
  /// The span is empty after an error. It is never empty after next() returned need_more.
  [[nodiscard]] std::span<std::byte> writable() noexcept;

  /// Takes over the first `count` bytes of writable(), which the caller has filled.
  /// @pre count is at most the size of the span that writable() returned
  void commit(std::size_t count) noexcept;

  /// Takes the next record off the bytes held. An error is final until reset(), because the framing
  /// is lost.
  [[nodiscard]] ParseStatus next(Record& record) noexcept;

  /// Returns the field at fault: the magic after wrong_magic, the version after wrong_version, the
  /// length after oversize.
  [[nodiscard]] std::uint32_t offending_value() const noexcept { return offending_value_; }

  /// Returns the number of bytes held of an unfinished record. A value other than 0 at the end of a
  /// stream means that the stream was cut.
  [[nodiscard]] std::size_t pending_bytes() const noexcept { return end_ - begin_; }

  /// Returns how many bytes the unfinished record still lacks, as of the last next(); 0 while its
  /// header is not complete.
  [[nodiscard]] std::size_t missing_bytes() const noexcept { return missing_; }

  /// Forgets everything, for a new connection.
  void reset() noexcept;

 private:
  [[nodiscard]] std::uint32_t limit_of(RecordKind kind) const noexcept;
  void sum(RecordKind kind, std::size_t body_bytes) noexcept;

  RecordLimits limits_;
  std::size_t capacity_;
  std::unique_ptr<std::byte[]> buffer_;
  std::size_t begin_ = 0;   // index of the first byte not yet taken
  std::size_t end_ = 0;     // index behind the last byte held
  std::size_t summed_ = 0;  // bytes of the record at begin_ that payload_crc32c_ covers
  std::uint32_t payload_crc32c_ = 0;
  std::size_t missing_ = 0;
  ParseStatus error_ = ParseStatus::need_more;
  std::uint32_t offending_value_ = 0;
};

/// Frame of a frame record or of a file. Its pixels point into the body.
struct FrameView {
  FrameHeader header;
  /// Pixels, not aligned: header.payload_bytes bytes or, when encoded, header.encoded_bytes.
  std::span<const std::byte> pixels;
};

/// Decodes the body of a frame record. The CRC of the pixels is not checked.
/// Errors (protocol): those of decode_frame_header(), a body length that differs from 384 +
/// payload_bytes (encoded: 384 + encoded_bytes), or an encoding that is not smaller than the
/// pixels.
[[nodiscard]] physics::Result<FrameView> decode_frame_record(std::span<const std::byte> body);

/// Returns true when the CRC-32C of a frame's raw pixels equals the one in its header. RT-safe.
[[nodiscard]] bool payload_crc_matches(const FrameView& frame) noexcept;

}  // namespace emit::protocol
