// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/framing.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "emit/physics/check.hpp"
#include "wire_bytes.hpp"

namespace emit::protocol {

void encode_record_header(RecordKind kind, std::uint32_t body_bytes,
                          std::span<std::byte, kRecordHeaderBytes> out) noexcept {
  wire::put(out, 0, kRecordMagic);
  wire::put(out, 4, kRecordVersion);
  wire::put(out, 5, static_cast<std::uint8_t>(kind));
  wire::put(out, 6, std::uint16_t{0});
  wire::put(out, 8, body_bytes);
}

std::string_view to_string(ParseStatus status) noexcept {
  switch (status) {
    case ParseStatus::record:
      return "record";
    case ParseStatus::need_more:
      return "need more bytes";
    case ParseStatus::wrong_magic:
      return "wrong record magic";
    case ParseStatus::wrong_version:
      return "wrong record version";
    case ParseStatus::oversize:
      return "record over the size limit";
  }
  return "unknown";
}

RecordParser::RecordParser(const RecordLimits& limits)
    : limits_(limits),
      capacity_(2 * (kRecordHeaderBytes +
                     std::size_t{std::max(limits.max_control_bytes, limits.max_frame_bytes)})),
      buffer_(std::make_unique_for_overwrite<std::byte[]>(capacity_)) {}

std::uint32_t RecordParser::limit_of(RecordKind kind) const noexcept {
  return kind == RecordKind::frame ? limits_.max_frame_bytes : limits_.max_control_bytes;
}

std::span<std::byte> RecordParser::writable() noexcept {
  if (error_ != ParseStatus::need_more) return {};
  if (begin_ == end_) {
    begin_ = end_ = 0;
  } else if (begin_ >= capacity_ / 2) {
    // Half the buffer holds any record, so the bytes held always fit in front.
    std::memmove(buffer_.get(), buffer_.get() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
  }
  return {buffer_.get() + end_, capacity_ - end_};
}

void RecordParser::commit(std::size_t count) noexcept {
  EMIT_CHECK_OP(count, <=, capacity_ - end_);
  end_ += count;
}

ParseStatus RecordParser::next(Record& record) noexcept {
  if (error_ != ParseStatus::need_more) return error_;
  missing_ = 0;
  if (end_ - begin_ < kRecordHeaderBytes) return ParseStatus::need_more;
  const std::span<const std::byte> held{buffer_.get() + begin_, end_ - begin_};
  offending_value_ = wire::get<std::uint32_t>(held, 0);
  if (offending_value_ != kRecordMagic) return error_ = ParseStatus::wrong_magic;
  offending_value_ = wire::get<std::uint8_t>(held, 4);
  if (offending_value_ != kRecordVersion) return error_ = ParseStatus::wrong_version;
  const auto kind = static_cast<RecordKind>(wire::get<std::uint8_t>(held, 5));
  const auto length = wire::get<std::uint32_t>(held, 8);
  offending_value_ = length;
  if (length > limit_of(kind)) return error_ = ParseStatus::oversize;
  offending_value_ = 0;
  sum(kind, length);
  if (held.size() - kRecordHeaderBytes < length) {
    missing_ = kRecordHeaderBytes + length - held.size();
    return ParseStatus::need_more;
  }
  record.kind = kind;
  record.body = held.subspan(kRecordHeaderBytes, length);
  record.payload_crc32c = std::exchange(payload_crc32c_, 0);
  summed_ = 0;
  begin_ += kRecordHeaderBytes + length;
  return ParseStatus::record;
}

/// Continues the CRC over the pixels that have just arrived, while they are in the cache.
void RecordParser::sum(RecordKind kind, std::size_t body_bytes) noexcept {
  constexpr std::size_t kFirst = kRecordHeaderBytes + kFrameHeaderBytes;
  const std::size_t from = std::max(summed_, kFirst);
  const std::size_t to = std::min(end_ - begin_, kRecordHeaderBytes + body_bytes);
  if (kind != RecordKind::frame || to <= from) return;
  payload_crc32c_ = crc32c({buffer_.get() + begin_ + from, to - from}, payload_crc32c_);
  summed_ = to;
}

void RecordParser::reset() noexcept {
  begin_ = end_ = 0;
  summed_ = 0;
  missing_ = 0;
  payload_crc32c_ = 0;
  error_ = ParseStatus::need_more;
  offending_value_ = 0;
}

physics::Result<FrameView> decode_frame_record(std::span<const std::byte> body) {
  auto header = decode_frame_header(body);
  if (!header) return tl::unexpected(std::move(header).error());
  const auto pixels = body.subspan(kFrameHeaderBytes);
  const bool raw = header->encoding == PixelEncoding::raw;
  const std::uint64_t announced = raw ? header->payload_bytes : header->encoded_bytes;
  if (!raw && announced >= header->payload_bytes) {
    return physics::make_error(physics::ErrorCode::protocol,
                               fmt::format("frame {}: {} bytes encode {} bytes of pixels",
                                           header->frame_number, announced, header->payload_bytes));
  }
  if (pixels.size() != announced) {
    return physics::make_error(physics::ErrorCode::protocol,
                               fmt::format("frame {}: {} bytes follow the header, {} announced",
                                           header->frame_number, pixels.size(), announced));
  }
  return FrameView{*header, pixels};
}

bool payload_crc_matches(const FrameView& frame) noexcept {
  return crc32c(frame.pixels) == frame.header.payload_crc32c;
}

}  // namespace emit::protocol
