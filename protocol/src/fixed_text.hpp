// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <span>
#include <string_view>
#include <utility>

namespace emit::protocol {

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

}  // namespace emit::protocol
