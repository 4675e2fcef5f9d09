// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <glm/detail/qualifier.hpp>
#include <glm/ext/matrix_double4x4.hpp>
#include <glm/ext/quaternion_double.hpp>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

/// Conversion of plain data to bytes and back, little endian, without padding. Files and hashes of
/// their contents use it. Types may be numbers, glm vectors, matrices and quaternions, arrays and
/// vectors of such types, and structs that have a function `visit_members(value, visitor)`. This
/// function passes every member to the visitor, for const and for mutable values.
namespace emit::renderer {

static_assert(std::endian::native == std::endian::little, "files are little endian");

/// FNV-1a hash of 64 bits over the inputs of a run. It detects accidental changes, not forgery.
class Fnv64 {
 public:
  void put(const void* data, std::size_t bytes) noexcept {
    const auto* at = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < bytes; ++i) value_ = (value_ ^ at[i]) * 0x100000001b3ULL;
  }
  [[nodiscard]] std::uint64_t value() const noexcept { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ULL;
};

/// Sink of put_value() that counts the bytes only.
class ByteCount {
 public:
  void put(const void*, std::size_t bytes) noexcept { count_ += bytes; }
  [[nodiscard]] std::size_t count() const noexcept { return count_; }

 private:
  std::size_t count_ = 0;
};

template <class T>
concept Number = std::is_arithmetic_v<T> || std::is_enum_v<T>;
/// A number whose bytes in memory are its bytes in a file, so that rows of them are copied whole.
template <class T>
concept PlainNumber = Number<T> && !std::same_as<T, bool>;

/// Passes the bytes of a value to a sink with put(data, bytes). Strings and vectors are preceded by
/// their size as u64; a bool takes one byte.
template <class Sink, Number T>
void put_value(Sink& sink, const T& value) {
  sink.put(&value, sizeof(value));
}
template <class Sink>
void put_value(Sink& sink, const bool& value) {
  const auto byte = static_cast<std::uint8_t>(value);
  sink.put(&byte, 1);
}
template <class Sink, glm::length_t N, Number T, glm::qualifier Q>
void put_value(Sink& sink, const glm::vec<N, T, Q>& value) {
  for (glm::length_t i = 0; i < N; ++i) put_value(sink, value[i]);
}
template <class Sink>
void put_value(Sink& sink, const glm::dmat4& value) {
  for (glm::length_t i = 0; i < 4; ++i) put_value(sink, value[i]);
}
template <class Sink>
void put_value(Sink& sink, const glm::dquat& value) {
  for (const double part : {value.w, value.x, value.y, value.z}) put_value(sink, part);
}
template <class Sink>
void put_value(Sink& sink, const std::string& value) {
  put_value(sink, static_cast<std::uint64_t>(value.size()));
  sink.put(value.data(), value.size());
}
template <class Sink, class T, std::size_t N>
void put_value(Sink& sink, const std::array<T, N>& value);
template <class Sink, class T>
void put_value(Sink& sink, const std::vector<T>& value);
/// Passes the bytes of items to a sink without their number.
template <class Sink, class T>
void put_items(Sink& sink, std::span<const T> items) {
  if constexpr (PlainNumber<T>) {
    sink.put(items.data(), items.size_bytes());
  } else {
    for (const T& item : items) put_value(sink, item);
  }
}
template <class Sink, class T>
requires requires(const T& value) {
  visit_members(value, [](const auto&) {});
}
void put_value(Sink& sink, const T& value) {
  visit_members(value, [&sink](const auto& member) { put_value(sink, member); });
}
template <class Sink, class T, std::size_t N>
void put_value(Sink& sink, const std::array<T, N>& value) {
  put_items(sink, std::span<const T>(value));
}
template <class Sink, class T>
void put_value(Sink& sink, const std::vector<T>& value) {
  put_value(sink, static_cast<std::uint64_t>(value.size()));
  put_items(sink, std::span<const T>(value));
}

/// Reader of what put_value() has written. Once a value is missing, ok() is false and nothing more
/// is read. Memory is taken only for as much as the bytes can hold.
class ByteSource {
 public:
  explicit ByteSource(std::span<const std::byte> bytes) : left_(bytes) {}
  [[nodiscard]] bool ok() const noexcept { return ok_; }
  [[nodiscard]] bool at_end() const noexcept { return left_.empty(); }
  [[nodiscard]] std::size_t left() const noexcept { return left_.size(); }

  void take(void* data, std::size_t bytes) noexcept {
    if (!ok_ || bytes > left_.size()) {
      ok_ = false;
      return;
    }
    if (bytes == 0) return;
    std::memcpy(data, left_.data(), bytes);
    left_ = left_.subspan(bytes);
  }
  /// Marks the data as wrong.
  void fail() noexcept { ok_ = false; }

 private:
  std::span<const std::byte> left_;
  bool ok_ = true;
};

/// Reads a value; it is unspecified unless source.ok() afterwards. A bool must be 0 or 1.
template <Number T>
void take_value(ByteSource& source, T& value) {
  source.take(&value, sizeof(value));
}
inline void take_value(ByteSource& source, bool& value) {
  std::uint8_t byte = 0;
  source.take(&byte, 1);
  if (byte > 1) source.fail();
  value = byte == 1;
}
template <glm::length_t N, Number T, glm::qualifier Q>
void take_value(ByteSource& source, glm::vec<N, T, Q>& value) {
  for (glm::length_t i = 0; i < N; ++i) take_value(source, value[i]);
}
template <class T, std::size_t N>
void take_value(ByteSource& source, std::array<T, N>& value);
template <class T>
void take_value(ByteSource& source, std::vector<T>& value);
template <class T>
requires requires(T& value) {
  visit_members(value, [](auto&) {});
}
void take_value(ByteSource& source, T& value) {
  visit_members(value, [&source](auto& member) { take_value(source, member); });
}
/// Reads what put_items() has written.
template <class T>
void take_items(ByteSource& source, std::span<T> items) {
  if constexpr (PlainNumber<T>) {
    source.take(items.data(), items.size_bytes());
  } else {
    for (T& item : items) take_value(source, item);
  }
}
template <class T, std::size_t N>
void take_value(ByteSource& source, std::array<T, N>& value) {
  take_items(source, std::span<T>(value));
}
template <class T>
void take_value(ByteSource& source, std::vector<T>& value) {
  std::uint64_t count = 0;
  take_value(source, count);
  // Refuse a count that the bytes cannot hold, before any memory is taken for it.
  ByteCount each;
  put_value(each, T{});
  if (!source.ok() || count > source.left() / each.count()) {
    source.fail();
    return;
  }
  value.resize(count);
  take_items(source, std::span<T>(value));
}

}  // namespace emit::renderer
