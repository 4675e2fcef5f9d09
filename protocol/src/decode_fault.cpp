// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/decode_fault.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "emit/protocol/codec.hpp"

namespace emit::protocol {
namespace {

/// Appends formatted text to a buffer of fixed size and drops what does not fit.
class FixedText {
 public:
  explicit FixedText(std::span<char> buffer) : buffer_(buffer) {}
  template <class... Arguments>
  void add(fmt::format_string<Arguments...> format, Arguments&&... arguments) noexcept {
    const auto result = fmt::format_to_n(buffer_.data() + used_, buffer_.size() - used_, format,
                                         std::forward<Arguments>(arguments)...);
    used_ += std::min(result.size, buffer_.size() - used_);
  }
  [[nodiscard]] std::string_view text() const noexcept { return {buffer_.data(), used_}; }

 private:
  std::span<char> buffer_;
  std::size_t used_ = 0;
};

void add_place(DecodeStatus status, const DecodeFault& fault, FixedText& out) noexcept {
  out.add("{}", to_string(status));
  if (fault.kind == DecodeFault::Kind::none) return;
  switch (fault.part) {
    case DecodeFault::Part::message:
    case DecodeFault::Part::environment:
      break;  // the status or the field says it
    case DecodeFault::Part::seeker:
      out.add(": seeker");
      break;
    case DecodeFault::Part::entity:
      out.add(": entity {}", fault.entity_id);
      break;
  }
  if (fault.kind == DecodeFault::Kind::repeated) {
    out.add(" stands in the frame twice");
  } else {
    out.add(": {}", fault.field);
  }
}

}  // namespace

std::string_view fault_place(DecodeStatus status, const DecodeFault& fault,
                             std::span<char> buffer) noexcept {
  FixedText out(buffer);
  add_place(status, fault, out);
  return out.text();
}

std::string_view fault_text(DecodeStatus status, const DecodeFault& fault,
                            std::span<char> buffer) noexcept {
  FixedText out(buffer);
  add_place(status, fault, out);
  if (fault.kind == DecodeFault::Kind::missing) {
    out.add(" is missing");
  } else if (fault.kind == DecodeFault::Kind::out_of_range) {
    out.add(" is {}, must be {} to {}", fault.value, fault.lowest, fault.highest);
  }
  return out.text();
}

}  // namespace emit::protocol
