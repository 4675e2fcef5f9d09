// SPDX-License-Identifier: Apache-2.0
#include "emit/config/motion_controller.hpp"

#include <fmt/format.h>

#include <charconv>
#include <limits>

#include "resolve/resolve.hpp"

namespace emit::config {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

namespace {

constexpr std::string_view kMemoryForm = "memory:";
constexpr std::string_view kAcutrolForm = "acutrol:";

/// Reads a whole text as a number of bytes. Returns false if it is none that a file can have.
bool read_offset(std::string_view text, std::uint64_t& out) {
  const bool hexadecimal = text.starts_with("0x");
  if (hexadecimal) text.remove_prefix(2);
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), out, hexadecimal ? 16 : 10);
  constexpr std::uint64_t kMost = std::uint64_t{1} << 62U;
  return error == std::errc() && end == text.data() + text.size() && out <= kMost;
}

}  // namespace

Result<MemoryPlace> parse_memory_place(std::string_view text) {
  MemoryPlace out;
  const std::size_t at = text.rfind('@');
  if (at == std::string_view::npos || at < 2 || text.front() != '/' ||
      !read_offset(text.substr(at + 1), out.offset_bytes)) {
    return make_error(ErrorCode::config,
                      fmt::format("'{}' must be PATH@OFFSET: an absolute path and a number of "
                                  "bytes, such as /dev/shm/axes@0 or /dev/rfm0@0x1000",
                                  text));
  }
  if (out.offset_bytes % sizeof(std::uint64_t) != 0) {
    return make_error(ErrorCode::config,
                      fmt::format("'{}': the offset must be a multiple of 8 bytes", text));
  }
  out.file = std::string(text.substr(0, at));
  return out;
}

Result<MotionController> parse_motion_controller(std::string_view text) {
  MotionController out;
  std::string_view address = text;
  if (text.starts_with(kMemoryForm)) {
    auto place = parse_memory_place(text.substr(kMemoryForm.size()));
    if (!place) return tl::unexpected(std::move(place.error()));
    out.kind = MotionController::Kind::memory;
    out.memory = *std::move(place);
    return out;
  }
  if (text.starts_with(kAcutrolForm)) {
    out.kind = MotionController::Kind::acutrol;
    address.remove_prefix(kAcutrolForm.size());
  }
  if (!is_endpoint(address)) {
    return make_error(ErrorCode::config,
                      fmt::format("'{}' must be address:port, memory:PATH@OFFSET or "
                                  "acutrol:address:port",
                                  text));
  }
  out.address = std::string(address);
  return out;
}

}  // namespace emit::config
