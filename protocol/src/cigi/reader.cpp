// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/cigi/reader.hpp"

#include <cstdint>

#include "cigi/field_io.hpp"
#include "cigi/limits.hpp"
#include "cigi/packet_types.hpp"

namespace emit::protocol::cigi {
namespace {

constexpr std::size_t kVersionBytes = 8;  ///< version and magic number lie in these
constexpr std::size_t kFirstPacketBytes = 24;
static_assert(IgControl::kWire.v3_3.bytes == kFirstPacketBytes &&
              IgControl::kWire.v4_0.bytes == kFirstPacketBytes &&
              StartOfFrame::kWire.v3_3.bytes == kFirstPacketBytes &&
              StartOfFrame::kWire.v4_0.bytes == kFirstPacketBytes);

[[nodiscard]] unsigned byte_of(std::span<const std::byte> bytes, std::size_t at) noexcept {
  return std::to_integer<unsigned>(bytes[at]);
}

[[nodiscard]] constexpr std::size_t header_bytes(Version version) noexcept {
  return version == Version::v3_3 ? 2 : 4;
}

/// Returns whether a message begins with a size of 24 and the id 0 (host) or 0xFFFF (image
/// generator) as words of 16 bits, as all versions after CIGI 3 do.
[[nodiscard]] bool begins_like_v4(std::span<const std::byte> bytes) noexcept {
  const bool size = byte_of(bytes, 0) + byte_of(bytes, 1) == kFirstPacketBytes &&
                    (byte_of(bytes, 0) == 0 || byte_of(bytes, 1) == 0);
  return size && byte_of(bytes, 2) == byte_of(bytes, 3) &&
         (byte_of(bytes, 2) == 0 || byte_of(bytes, 2) == 0xFF);
}

}  // namespace

Reader::Reader(std::span<const std::byte> message, Sender sender) noexcept
    : message_(message), sender_(sender) {
  broken_ = !open();
}

std::size_t Reader::stated_bytes() const noexcept {
  if (version_ == Version::v3_3) return byte_of(message_, offset_ + 1);
  std::uint16_t size = 0;
  FieldReader(message_, order_).number(offset_, size);
  return size;
}

std::uint16_t Reader::stated_id() const noexcept {
  // A packet of 3.3 begins with its id, so that even one byte tells it.
  const std::size_t needed = version_ == Version::v3_3 ? 1 : header_bytes(version_);
  if (message_.size() - offset_ < needed) return 0;
  if (version_ == Version::v3_3) return static_cast<std::uint16_t>(byte_of(message_, offset_));
  std::uint16_t id = 0;
  FieldReader(message_, order_).number(offset_ + 2, id);
  return id;
}

bool Reader::fail(Fault::Kind kind, double value, double lowest, double highest) noexcept {
  fault_ = {.kind = kind,
            .packet = number_,
            .id = stated_id(),
            .version = version_,
            .offset = offset_,
            .field = "",
            .value = value,
            .lowest = lowest,
            .highest = highest};
  return false;
}

Step Reader::refuse(Fault::Kind kind) noexcept {
  static_cast<void>(fail(kind));
  return Step::refused;
}

bool Reader::open() noexcept {
  if (message_.size() < kVersionBytes) {
    return fail(Fault::Kind::too_short, static_cast<double>(message_.size()),
                static_cast<double>(kFirstPacketBytes));
  }
  // The version comes first: older and later versions have other sizes.
  return begins_like_v4(message_) ? open_v4() : open_v3();
}

bool Reader::open_v3() noexcept {
  const bool host = sender_ == Sender::host;
  if (byte_of(message_, 0) != (host ? IgControl::kWire.v3_3.id : StartOfFrame::kWire.v3_3.id)) {
    return fail(Fault::Kind::first_packet);
  }
  const unsigned major = byte_of(message_, 2);
  const unsigned minor = byte_of(message_, host ? kHostMinorAt : kIgMinorAt) >> 4;
  if (major != 3 || minor != 3) {
    return fail(Fault::Kind::version, major, major == 3 ? minor : 0.0);
  }
  if (!check_size()) return false;
  std::uint16_t magic = 0;
  FieldReader(message_, ByteOrder::big).number(6, magic);
  if (magic != kByteSwapMagic && magic != 0x0080) return fail(Fault::Kind::byte_order, magic);
  order_ = magic == kByteSwapMagic ? ByteOrder::big : ByteOrder::little;
  return true;
}

bool Reader::open_v4() noexcept {
  version_ = Version::v4_0;
  order_ = byte_of(message_, 0) == 0 ? ByteOrder::big : ByteOrder::little;
  const bool host = sender_ == Sender::host;
  if (stated_id() != (host ? IgControl::kWire.v4_0.id : StartOfFrame::kWire.v4_0.id)) {
    return fail(Fault::Kind::first_packet);
  }
  const unsigned major = byte_of(message_, 4);
  const unsigned minor = byte_of(message_, 7) >> 4;
  if (major != 4 || minor != 0) return fail(Fault::Kind::version, major, minor);
  return check_size();
}

bool Reader::check_size() noexcept {
  const std::size_t left = message_.size() - offset_;
  const std::size_t header = header_bytes(version_);
  if (left < header) {
    return fail(Fault::Kind::too_short, static_cast<double>(left), static_cast<double>(header));
  }
  const std::size_t stated = stated_bytes();
  const auto size = static_cast<double>(stated);
  if (stated < header) return fail(Fault::Kind::size_zero, size);
  if (stated % 8 != 0) return fail(Fault::Kind::size_alignment, size);
  if (stated > left) {
    return fail(Fault::Kind::size_beyond_end, size, 0.0, static_cast<double>(left));
  }
  bool sound = true;
  with_packet_type(stated_id(), version_, [&]<class P>(const P*) {
    const std::size_t needed = P::kWire.of(version_).bytes;
    if (stated < needed) {
      sound = fail(Fault::Kind::size_of_packet, size, static_cast<double>(needed));
    }
  });
  return sound;
}

Step Reader::read_known(Packet& packet) noexcept {
  Step step = Step::end;
  with_packet_type(stated_id(), version_, [&]<class P>(const P*) {
    if (P::kSender != sender_) {
      step = refuse(Fault::Kind::sender);
      return;
    }
    if (begins_message<P>() && offset_ > 0) {
      step = refuse(Fault::Kind::repeated);
      return;
    }
    P read;
    // No layout reads the tail of a packet that is longer than its definition.
    FieldReader io(bytes_, order_);
    copy_fields(io, read, version_);
    if (!io.text_ended()) {
      step = refuse(Fault::Kind::text);
      return;
    }
    const Packet full(read);
    if (const Fault fault = check_limits(full)) {
      step = refuse(fault.kind);
      fault_.field = fault.field;
      fault_.value = fault.value;
      fault_.lowest = fault.lowest;
      fault_.highest = fault.highest;
      return;
    }
    packet = full;
    step = Step::packet;
  });
  return step;
}

Step Reader::next(Packet& packet) noexcept {
  while (!broken_) {
    if (offset_ == message_.size()) return Step::end;
    if (!check_size()) {
      broken_ = true;
      break;
    }
    const std::size_t size = stated_bytes();
    bytes_ = message_.subspan(offset_, size);
    Step step = read_known(packet);
    if (step == Step::refused && offset_ == 0) {
      // The first packet holds for all others, so that nothing of the message is left.
      broken_ = true;
      step = Step::broken;
    }
    if (step == Step::refused) ++refused_;
    const bool skipped = step == Step::end;
    if (skipped) {
      ++skipped_;
      if (user_defined(stated_id(), version_)) ++user_defined_;
    }
    offset_ += size;
    ++number_;
    if (!skipped) return step;
  }
  return Step::broken;
}

}  // namespace emit::protocol::cigi
