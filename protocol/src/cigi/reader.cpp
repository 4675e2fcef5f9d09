// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/cigi/reader.hpp"

#include <algorithm>
#include <type_traits>
#include <utility>

#include "cigi/field_io.hpp"
#include "cigi/ig_layouts.hpp"
#include "cigi/limits.hpp"
#include "cigi/packet_types.hpp"

namespace emit::protocol::cigi {
namespace {

constexpr std::size_t kHeaderBytes = 2;
constexpr std::size_t kVersionBytes = 8;  ///< version and magic number lie in these
constexpr std::size_t kFirstPacketBytes = IgControl::kBytes;
static_assert(StartOfFrame::kBytes == kFirstPacketBytes);

[[nodiscard]] unsigned byte_of(std::span<const std::byte> bytes, std::size_t at) noexcept {
  return std::to_integer<unsigned>(bytes[at]);
}

/// Returns the major version of a message after CIGI 3, or 0. Such a message begins with a size of
/// 24 and the id 0 (host) or 0xFFFF (image generator) as words of 16 bits, and has its version at
/// byte 4.
[[nodiscard]] unsigned later_version(std::span<const std::byte> bytes) noexcept {
  const bool size = byte_of(bytes, 0) + byte_of(bytes, 1) == 24 &&
                    (byte_of(bytes, 0) == 0 || byte_of(bytes, 1) == 0);
  const bool id = byte_of(bytes, 2) == byte_of(bytes, 3) &&
                  (byte_of(bytes, 2) == 0 || byte_of(bytes, 2) == 0xFF);
  return size && id ? byte_of(bytes, 4) : 0;
}

}  // namespace

Reader::Reader(std::span<const std::byte> message, Sender sender) noexcept
    : message_(message), sender_(sender) {
  broken_ = !open();
}

bool Reader::fail(Fault::Kind kind, double value, double lowest, double highest) noexcept {
  fault_ = {.kind = kind,
            .packet = number_,
            .id = offset_ < message_.size() ? std::to_integer<std::uint8_t>(message_[offset_])
                                            : std::uint8_t{0},
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
  if (const unsigned later = later_version(message_); later > kMajorVersion) {
    return fail(Fault::Kind::version, later);
  }
  const bool host = sender_ == Sender::host;
  if (byte_of(message_, 0) != (host ? IgControl::kId : StartOfFrame::kId)) {
    return fail(Fault::Kind::first_packet);
  }
  const unsigned major = byte_of(message_, 2);
  const unsigned minor = byte_of(message_, host ? kHostMinorAt : kIgMinorAt) >> 4;
  if (major != kMajorVersion || minor != kMinorVersion) {
    return fail(Fault::Kind::version, major, major == kMajorVersion ? minor : 0.0);
  }
  if (!check_size()) return false;
  std::uint16_t magic = 0;
  FieldReader(message_, ByteOrder::big).number(6, magic);
  if (magic != kByteSwapMagic && magic != 0x0080) return fail(Fault::Kind::byte_order, magic);
  order_ = magic == kByteSwapMagic ? ByteOrder::big : ByteOrder::little;
  return true;
}

bool Reader::check_size() noexcept {
  const std::size_t left = message_.size() - offset_;
  if (left < kHeaderBytes) {
    return fail(Fault::Kind::too_short, static_cast<double>(left),
                static_cast<double>(kHeaderBytes));
  }
  const std::size_t stated = byte_of(message_, offset_ + 1);
  const auto size = static_cast<double>(stated);
  if (stated < kHeaderBytes) return fail(Fault::Kind::size_zero, size);
  if (stated % 8 != 0) return fail(Fault::Kind::size_alignment, size);
  if (stated > left) {
    return fail(Fault::Kind::size_beyond_end, size, 0.0, static_cast<double>(left));
  }
  bool sound = true;
  with_packet_type(std::to_integer<std::uint8_t>(message_[offset_]), [&]<class P>(const P*) {
    if (stated < P::kBytes) {
      sound = fail(Fault::Kind::size_of_packet, size, static_cast<double>(P::kBytes));
    }
  });
  return sound;
}

Step Reader::read_known(Packet& packet) noexcept {
  Step step = Step::end;
  with_packet_type(std::to_integer<std::uint8_t>(bytes_[0]), [&]<class P>(const P*) {
    if (P::kSender != sender_) {
      step = refuse(Fault::Kind::sender);
      return;
    }
    if ((P::kId == IgControl::kId || P::kId == StartOfFrame::kId) && offset_ > 0) {
      step = refuse(Fault::Kind::repeated);
      return;
    }
    P read;
    // The tail of a packet that is longer than its definition belongs to another version.
    FieldReader io(bytes_.first(std::min(bytes_.size(), largest_bytes<P>())), order_);
    layout(io, read);
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
    const std::size_t size = byte_of(message_, offset_ + 1);
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
      if (byte_of(message_, offset_) >= kFirstUserDefinedId) ++user_defined_;
    }
    offset_ += size;
    ++number_;
    if (!skipped) return step;
  }
  return Step::broken;
}

}  // namespace emit::protocol::cigi
