// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/cigi/writer.hpp"

#include <algorithm>

#include "cigi/field_io.hpp"
#include "cigi/limits.hpp"
#include "cigi/packet_types.hpp"

namespace emit::protocol::cigi {

Writer::Writer(std::span<std::byte> memory, Version version, ByteOrder order) noexcept
    : memory_(memory), version_(version), order_(order) {}

void Writer::clear() noexcept {
  used_ = 0;
  packets_ = 0;
}

Fault Writer::add(const Packet& packet) noexcept {
  Fault fault = check_version(packet, version_);
  if (!fault) fault = check_limits(packet);
  fault.packet = packets_;
  fault.id = packet_id(packet, version_);
  fault.version = version_;
  fault.offset = used_;
  if (fault) return fault;
  with_packet(packet, [&]<class P>(P each) {
    constexpr bool first = begins_message<P>();
    if (first != (packets_ == 0)) {
      fault.kind = first ? Fault::Kind::repeated : Fault::Kind::first_packet;
      return;
    }
    if (!first && P::kSender != sender_) {
      fault.kind = Fault::Kind::sender;
      return;
    }
    const std::size_t size = bytes_of(each, version_);
    const std::size_t left = memory_.size() - used_;
    if (size > left) {
      fault.kind = Fault::Kind::no_space;
      fault.value = static_cast<double>(size);
      fault.highest = static_cast<double>(left);
      return;
    }
    const std::span<std::byte> bytes = memory_.subspan(used_, size);
    std::ranges::fill(bytes, std::byte{0});
    FieldWriter io(bytes, order_);
    copy_fields(io, each, version_);
    if (version_ == Version::v3_3) {
      bytes[0] = static_cast<std::byte>(P::kWire.v3_3.id);
      bytes[1] = static_cast<std::byte>(size);
    } else {
      io.number(0, static_cast<std::uint16_t>(size));
      io.number(2, P::kWire.v4_0.id);
    }
    if constexpr (first) {
      sender_ = P::kSender;
      if (version_ == Version::v3_3) {
        io.number(2, std::uint8_t{3});
        io.bits(P::kSender == Sender::host ? kHostMinorAt : kIgMinorAt, 4, 4, 3u);
        io.number(6, kByteSwapMagic);
      } else {
        io.number(4, std::uint8_t{4});  // the minor version is 0
      }
    }
    used_ += size;
    ++packets_;
  });
  return fault;
}

}  // namespace emit::protocol::cigi
