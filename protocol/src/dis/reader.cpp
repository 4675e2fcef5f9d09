// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/dis/reader.hpp"

#include "dis/layouts.hpp"

namespace emit::protocol::dis {

bool Reader::take_header() noexcept {
  const std::size_t left = datagram_.size() - offset_;
  if (left < kHeaderBytes) {
    fault_ = {.kind = Fault::Kind::too_short,
              .pdu = number_,
              .offset = offset_,
              .value = static_cast<double>(left),
              .lowest = static_cast<double>(kHeaderBytes)};
    return false;
  }
  header_ = {};
  const BigEndianReader io(datagram_.subspan(offset_, kHeaderBytes));
  layout(io, header_);
  if (header_.length < kHeaderBytes || header_.length > left) {
    fault_ = {.kind = Fault::Kind::length,
              .pdu = number_,
              .type = header_.type,
              .offset = offset_,
              .value = static_cast<double>(header_.length),
              .lowest = static_cast<double>(kHeaderBytes),
              .highest = static_cast<double>(left)};
    return false;
  }
  bytes_ = datagram_.subspan(offset_, header_.length);
  return true;
}

Step Reader::refuse(Fault fault) noexcept {
  fault_ = fault;
  fault_.pdu = number_;
  fault_.type = header_.type;
  fault_.offset = offset_;
  return Step::refused;
}

Step Reader::read_body(Pdu& pdu) noexcept {
  if (header_.version != 6 && header_.version != 7) {
    return refuse({.kind = Fault::Kind::version, .value = static_cast<double>(header_.version)});
  }
  Step step = Step::pdu;
  const bool known = with_pdu_type(header_.type, [&]<class P>(const P*) {
    P read;
    std::size_t needed = P::kBytes;
    if (bytes_.size() >= needed) {
      const BigEndianReader io(bytes_);
      layout(io, read);
      needed = bytes_of(read);
    }
    if (bytes_.size() < needed) {
      step = refuse({.kind = Fault::Kind::size_of_pdu,
                     .value = static_cast<double>(bytes_.size()),
                     .lowest = static_cast<double>(needed)});
      return;
    }
    const Pdu full(read);
    if (const Fault fault = check_limits(full)) {
      step = refuse(fault);
      return;
    }
    parameters_ = VariableParameters(bytes_.subspan(P::kBytes, needed - P::kBytes));
    pdu = full;
  });
  return known ? step : Step::other;
}

void Reader::skip_padding() noexcept {
  // No PDU begins with 0, which would be its version.
  while (offset_ % 8 != 0 && offset_ < datagram_.size() && datagram_[offset_] == std::byte{0}) {
    ++offset_;
  }
}

Step Reader::next(Pdu& pdu) noexcept {
  parameters_ = {};
  if (broken_) return Step::broken;
  if (offset_ == datagram_.size()) return Step::end;
  if (!take_header()) {
    broken_ = true;
    return Step::broken;
  }
  const Step step = read_body(pdu);
  offset_ += header_.length;
  ++number_;
  skip_padding();
  return step;
}

}  // namespace emit::protocol::dis
