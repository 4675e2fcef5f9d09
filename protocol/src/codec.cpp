// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/codec.hpp"

#include <google/protobuf/arena.h>

#include <array>
#include <limits>

#include "emit/protocol/convert.hpp"
#include "emit/v1/host.pb.h"
#include "emit/v1/status.pb.h"
#include "wire_bytes.hpp"

namespace emit::protocol {
namespace {

// Length of the arena, bytes. It holds the largest parsed host frame: 128 entities of about 270
// bytes each, and 32 parts.
constexpr std::size_t kArenaBytes = std::size_t{128} << 10;

/// Arena with memory of its own, to which it returns after every message, so that it does not
/// allocate.
class FixedArena {
 public:
  FixedArena() : block_(std::make_unique<char[]>(kArenaBytes)), arena_(options(block_.get())) {}
  [[nodiscard]] v1::HostFrame* fresh_host_frame() noexcept {
    arena_.Reset();
    return google::protobuf::Arena::CreateMessage<v1::HostFrame>(&arena_);
  }

 private:
  static google::protobuf::ArenaOptions options(char* block) {
    google::protobuf::ArenaOptions result;
    result.initial_block = block;
    result.initial_block_size = kArenaBytes;
    return result;
  }
  std::unique_ptr<char[]> block_;
  google::protobuf::Arena arena_;
};

/// Reads a varint at `at` and moves `at` behind it. Returns false when the varint is cut off or too
/// long.
bool read_varint(std::span<const std::byte> bytes, std::size_t& at, std::uint64_t& value) noexcept {
  value = 0;
  for (unsigned shift = 0; shift < 64; shift += 7) {
    if (at == bytes.size()) return false;
    const auto byte = std::to_integer<std::uint64_t>(bytes[at++]);
    value |= (byte & 0x7Fu) << shift;
    if ((byte & 0x80u) == 0) return true;
  }
  return false;
}

/// Fields of a host frame that are read before Protobuf parses it.
struct Outline {
  std::uint64_t protocol_version = 0;
  std::uint64_t entities = 0;
  std::uint64_t parts = 0;
};

/// Reads the top-level fields before Protobuf parses the message. The version is then known even
/// where a newer layout would not parse, and the number of entities bounds the memory. Returns
/// false when the bytes are no message.
bool read_outline(std::span<const std::byte> bytes, Outline& outline, HostFrameData& out) noexcept {
  enum WireType : std::uint64_t { kVarint = 0, kFixed64 = 1, kDelimited = 2, kFixed32 = 5 };
  std::size_t at = 0;
  while (at < bytes.size()) {
    std::uint64_t tag = 0;
    std::uint64_t value = 0;
    if (!read_varint(bytes, at, tag)) return false;
    const std::uint64_t field = tag >> 3;
    const std::size_t left = bytes.size() - at;
    switch (tag & 7u) {
      case kVarint:
        if (!read_varint(bytes, at, value)) return false;
        if (field == v1::HostFrame::kProtocolVersionFieldNumber) {
          outline.protocol_version = value & 0xFFFFFFFFu;  // a uint32, cut as Protobuf cuts it
        } else if (field == v1::HostFrame::kFrameNumberFieldNumber) {
          out.frame_number = value;
        } else if (field == v1::HostFrame::kRunIdFieldNumber) {
          out.run_id = value;
        }
        break;
      case kFixed64:
        if (left < 8) return false;
        if (field == v1::HostFrame::kSimTimeNsFieldNumber) {
          out.sim_time_ns = wire::get<std::int64_t>(bytes, at);
        }
        at += 8;
        break;
      case kDelimited:
        if (!read_varint(bytes, at, value) || value > bytes.size() - at) return false;
        at += static_cast<std::size_t>(value);
        if (field == v1::HostFrame::kEntitiesFieldNumber) ++outline.entities;
        if (field == v1::HostFrame::kPartsFieldNumber) ++outline.parts;
        break;
      case kFixed32:
        if (left < 4) return false;
        at += 4;
        break;
      default:
        return false;  // proto3 has no groups
    }
  }
  return true;
}

DecodeFault out_of_range(DecodeFault::Part part, const char* field, double value, double lowest,
                         double highest) noexcept {
  return {DecodeFault::Kind::out_of_range, part, 0, field, value, lowest, highest, 0};
}

}  // namespace

bool looks_like_status(std::span<const std::byte> bytes) noexcept {
  std::size_t at = 0;
  std::uint64_t tag = 0;
  std::uint64_t value = 0;
  constexpr auto kVarintTag = [](std::uint64_t field) { return field << 3; };
  constexpr auto kDelimitedTag = [](std::uint64_t field) { return (field << 3) | 2U; };
  return read_varint(bytes, at, tag) && tag == kVarintTag(v1::Status::kCodeFieldNumber) &&
         read_varint(bytes, at, value) && read_varint(bytes, at, tag) &&
         tag == kDelimitedTag(v1::Status::kTextFieldNumber);
}

std::string_view to_string(DecodeStatus status) noexcept {
  switch (status) {
    case DecodeStatus::ok:
      return "ok";
    case DecodeStatus::wrong_version:
      return "wrong protocol version";
    case DecodeStatus::oversize:
      return "too large or too many entities";
    case DecodeStatus::malformed:
      return "malformed message";
    case DecodeStatus::invalid_pose:
      return "invalid pose";
    case DecodeStatus::invalid_environment:
      return "invalid environment";
    case DecodeStatus::invalid_view:
      return "invalid view";
    case DecodeStatus::invalid_part:
      return "invalid part";
  }
  return "unknown";
}

struct HostFrameDecoder::Impl {
  FixedArena arena;
};

HostFrameDecoder::HostFrameDecoder() : impl_(std::make_unique<Impl>()) {}
HostFrameDecoder::~HostFrameDecoder() = default;
HostFrameDecoder::HostFrameDecoder(HostFrameDecoder&&) noexcept = default;
HostFrameDecoder& HostFrameDecoder::operator=(HostFrameDecoder&&) noexcept = default;

DecodeStatus decode_host_frame(std::span<const std::byte> bytes, HostFrameDecoder& decoder,
                               HostFrameData& out) noexcept {
  out.frame_number = 0;
  out.sim_time_ns = 0;
  out.run_id = 0;
  out.entity_count = 0;
  DecodeFault& fault = decoder.fault_;
  fault = {};
  if (bytes.size() > kMaxHostFrameBytes) {
    fault = out_of_range(DecodeFault::Part::message, "bytes", static_cast<double>(bytes.size()),
                         0.0, static_cast<double>(kMaxHostFrameBytes));
    return DecodeStatus::oversize;
  }
  Outline outline;
  if (!read_outline(bytes, outline, out)) return DecodeStatus::malformed;
  if (outline.protocol_version != kProtocolVersion) {
    fault = out_of_range(DecodeFault::Part::message, "protocol_version",
                         static_cast<double>(outline.protocol_version), kProtocolVersion,
                         kProtocolVersion);
    return DecodeStatus::wrong_version;
  }
  if (outline.entities > kMaxEntitiesPerFrame) {
    fault = out_of_range(DecodeFault::Part::message, "number of entities",
                         static_cast<double>(outline.entities), 0.0,
                         static_cast<double>(kMaxEntitiesPerFrame));
    return DecodeStatus::oversize;
  }
  if (outline.parts > kMaxPartsPerFrame) {
    fault = out_of_range(DecodeFault::Part::message, "number of parts",
                         static_cast<double>(outline.parts), 0.0,
                         static_cast<double>(kMaxPartsPerFrame));
    return DecodeStatus::oversize;
  }
  v1::HostFrame* message = decoder.impl_->arena.fresh_host_frame();
  if (!message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) {
    return DecodeStatus::malformed;
  }
  return from_proto(*message, out, &fault);
}

std::span<const std::byte> host_frame_in_control_record(std::span<const std::byte> body) noexcept {
  constexpr std::uint64_t kHostFrameTag = (6u << 3) | 2u;  // tag of ControlRecord.host_frame
  std::size_t at = 0;
  std::uint64_t tag = 0;
  std::uint64_t length = 0;
  if (!read_varint(body, at, tag) || tag != kHostFrameTag || !read_varint(body, at, length) ||
      length != body.size() - at) {
    return {};
  }
  return body.subspan(at);
}

struct HostFrameEncoder::Impl {
  FixedArena arena;
  // Encoded message. It is large enough: 128 entities with rates take less than 200 bytes each.
  std::array<std::byte, kMaxHostFrameBytes> bytes;
};

HostFrameEncoder::HostFrameEncoder() : impl_(std::make_unique<Impl>()) {}
HostFrameEncoder::~HostFrameEncoder() = default;
HostFrameEncoder::HostFrameEncoder(HostFrameEncoder&&) noexcept = default;
HostFrameEncoder& HostFrameEncoder::operator=(HostFrameEncoder&&) noexcept = default;

std::span<const std::byte> HostFrameEncoder::encode(const HostFrameData& frame) noexcept {
  v1::HostFrame* message = impl_->arena.fresh_host_frame();
  to_proto(frame, *message);
  const std::size_t size = message->ByteSizeLong();
  if (size > impl_->bytes.size()) return {};
  message->SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(impl_->bytes.data()));
  return std::span(impl_->bytes).first(size);
}

}  // namespace emit::protocol
