// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace emit::server {

/// Answer of an ACUTROL controller to one line.
struct AcutrolAnswer {
  enum class Kind : std::uint8_t {
    ok,      ///< the last word is OK
    number,  ///< `value` is the last word that is a number
    closed,  ///< interlock, from the last word: closed, so that the motors are on
    open,    ///< interlock: open
    fault,   ///< interlock: something has opened it
    error,   ///< a word begins with ERR
    other,   ///< nothing of that
  };
  Kind kind = Kind::other;
  double value = 0.0;  ///< finite
};

/// Reads an answer without its end of line. Words stand between spaces, tabs, commas, semicolons
/// and signs of equality. Words before the last one may be a header. Letters may be small or
/// capital. RT-safe.
[[nodiscard]] AcutrolAnswer parse_acutrol_answer(std::string_view line) noexcept;

/// Cuts bytes as they arrive into lines, which end with LF, CR or both. Empty lines are left out.
/// Fixed size. RT-safe.
class LineSplitter {
 public:
  static constexpr std::size_t kMostChars = 256;

  /// Takes bytes from the front of `bytes` up to the end of the next line. Returns true if there is
  /// one; line() is it until the next call. A line longer than kMostChars is cut to that many.
  bool next(std::string_view& bytes) noexcept;
  [[nodiscard]] std::string_view line() const noexcept { return {chars_.data(), size_}; }
  void clear() noexcept {
    size_ = 0;
    ended_ = false;
  }

 private:
  std::array<char, kMostChars> chars_{};
  std::size_t size_ = 0;
  bool ended_ = false;  ///< chars_ hold a whole line
};

}  // namespace emit::server
