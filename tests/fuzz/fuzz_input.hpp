// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <span>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

/// Helpers of the fuzz targets. Under libFuzzer the data lie in heap memory of their exact size, so
/// that the address sanitizer sees a read beyond the end.
namespace emit::fuzz {

[[nodiscard]] inline std::span<const std::byte> as_bytes(const std::uint8_t* data,
                                                         std::size_t size) {
  return {reinterpret_cast<const std::byte*>(data), size};
}

/// Ends the process as a finding when a decoder broke a promise.
inline void require(bool holds, const char* promise) {
  if (holds) return;
  std::fprintf(stderr, "broken: %s\n", promise);
  std::abort();
}

/// Cuts an input into numbers and pieces. It returns zeros and empty pieces at the end.
class InputReader {
 public:
  explicit InputReader(std::span<const std::byte> bytes) : left_(bytes) {}
  [[nodiscard]] bool empty() const noexcept { return left_.empty(); }

  /// Returns the next number, in the byte order of this machine (little endian).
  template <class T>
  [[nodiscard]] T number() {
    T value{};
    const auto part = bytes(sizeof value);
    std::memcpy(&value, part.data(), part.size());
    return value;
  }
  [[nodiscard]] std::span<const std::byte> bytes(std::size_t count) {
    const auto part = left_.first(std::min(count, left_.size()));
    left_ = left_.subspan(part.size());
    return part;
  }
  [[nodiscard]] std::span<const std::byte> rest() { return bytes(left_.size()); }

 private:
  std::span<const std::byte> left_;
};

}  // namespace emit::fuzz
