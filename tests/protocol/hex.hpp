// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cctype>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/check.hpp"

namespace emit::test {

/// Converts hexadecimal digits to bytes: "4F0a" gives two bytes.
/// @pre the text has an even number of digits, all hexadecimal
inline std::vector<std::byte> from_hex(std::string_view text) {
  EMIT_CHECK_OP(text.size() % 2, ==, 0U);
  EMIT_CHECK(std::ranges::all_of(text, [](unsigned char c) { return std::isxdigit(c) != 0; }));
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i + 1 < text.size(); i += 2) {
    bytes.push_back(static_cast<std::byte>(std::stoi(std::string(text.substr(i, 2)), nullptr, 16)));
  }
  return bytes;
}

/// Converts bytes to lower-case hexadecimal digits.
inline std::string to_hex(std::span<const std::byte> bytes) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text;
  for (const std::byte byte : bytes) {
    text += kDigits[std::to_integer<std::size_t>(byte) >> 4];
    text += kDigits[std::to_integer<std::size_t>(byte) & 15u];
  }
  return text;
}

}  // namespace emit::test
