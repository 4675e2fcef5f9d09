// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/error_correction.hpp"

#include <fmt/format.h>

#include <charconv>

namespace emit::tool {

physics::Result<protocol::FecParams> parse_error_correction(const std::string& text) {
  if (text == "off") return protocol::FecParams{};
  protocol::FecParams fec;
  const char* const end = text.data() + text.size();
  const auto data = std::from_chars(text.data(), end, fec.data_fragments);
  if (data.ec == std::errc() && data.ptr != end && *data.ptr == '+') {
    const auto parity = std::from_chars(data.ptr + 1, end, fec.parity_fragments);
    if (parity.ec == std::errc() && parity.ptr == end && fec.on() && fec.valid()) return fec;
  }
  return physics::make_error(
      physics::ErrorCode::invalid_argument,
      fmt::format("'{}' is not K+M with K of 1 to {} and M of 1 to {}, nor off", text,
                  protocol::kMaxFecData, protocol::kMaxFecParity));
}

std::string to_string(const protocol::FecParams& fec) {
  return fec.on() ? fmt::format("{}+{}", fec.data_fragments, fec.parity_fragments) : "off";
}

}  // namespace emit::tool
