// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/cigi/writer.hpp"

#include <algorithm>

#include "cigi/field_io.hpp"
#include "cigi/ig_layouts.hpp"
#include "cigi/limits.hpp"
#include "cigi/packet_types.hpp"

namespace emit::protocol::cigi {

Writer::Writer(std::span<std::byte> memory, ByteOrder order) noexcept
    : memory_(memory), order_(order) {}

void Writer::clear() noexcept {
  used_ = 0;
  packets_ = 0;
}

Fault Writer::add(const Packet& packet) noexcept {
  Fault fault = check_limits(packet);
  fault.packet = packets_;
  fault.id = packet_id(packet);
  fault.offset = used_;
  if (fault) return fault;
  with_packet(packet, [&]<class P>(P each) {
    const bool first = P::kId == IgControl::kId || P::kId == StartOfFrame::kId;
    if (first != (packets_ == 0)) {
      fault.kind = first ? Fault::Kind::repeated : Fault::Kind::first_packet;
      return;
    }
    if (!first && P::kSender != sender_) {
      fault.kind = Fault::Kind::sender;
      return;
    }
    const std::size_t size = bytes_of(each);
    const std::size_t left = memory_.size() - used_;
    if (size > left) {
      fault.kind = Fault::Kind::no_space;
      fault.value = static_cast<double>(size);
      fault.highest = static_cast<double>(left);
      return;
    }
    const std::span<std::byte> bytes = memory_.subspan(used_, size);
    std::ranges::fill(bytes, std::byte{0});
    bytes[0] = std::byte{P::kId};
    bytes[1] = static_cast<std::byte>(size);
    FieldWriter io(bytes, order_);
    layout(io, each);
    if (first) {
      sender_ = P::kSender;
      io.number(2, kMajorVersion);
      io.bits(P::kSender == Sender::host ? kHostMinorAt : kIgMinorAt, 4, 4, kMinorVersion);
      io.number(6, kByteSwapMagic);
    }
    used_ += size;
    ++packets_;
  });
  return fault;
}

}  // namespace emit::protocol::cigi
