// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "wire_bytes.hpp"

/// Building blocks of the MCAP format: little endian; strings and arrays begin with their length in
/// bytes, a u32.
namespace emit::protocol::mcap {

inline constexpr std::array<std::byte, 8> kMagic{std::byte{0x89}, std::byte{'M'}, std::byte{'C'},
                                                 std::byte{'A'},  std::byte{'P'}, std::byte{'0'},
                                                 std::byte{0x0D}, std::byte{0x0A}};

/// Kind of a record.
enum class Opcode : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  attachment = 0x09,
  attachment_index = 0x0A,
  statistics = 0x0B,
  metadata = 0x0C,
  metadata_index = 0x0D,
  summary_offset = 0x0E,
  data_end = 0x0F,
};
inline constexpr std::size_t kRecordPrefixBytes = 9;  // length of opcode and u64 record length
// Length of a message's fields in front of its data.
inline constexpr std::size_t kMessageFieldBytes = 22;

/// Appends fields to a buffer.
class Output {
 public:
  template <class T>
  void number(T value) {
    const std::size_t at = bytes_.size();
    bytes_.resize(at + sizeof(T));
    wire::put(std::span(bytes_), at, value);
  }
  void raw(std::span<const std::byte> data) {
    bytes_.insert(bytes_.end(), data.begin(), data.end());
  }
  void string(std::string_view text) {
    number(static_cast<std::uint32_t>(text.size()));
    raw(std::as_bytes(std::span(text)));
  }
  /// Begins a record. end_record() fills in its length.
  [[nodiscard]] std::size_t begin_record(Opcode opcode) {
    number(static_cast<std::uint8_t>(opcode));
    return begin_block<std::uint64_t>();
  }
  void end_record(std::size_t block) { end_block<std::uint64_t>(block); }
  /// Begins a block with a length prefix, for arrays and maps. end_block() fills in its length.
  template <class Length>
  [[nodiscard]] std::size_t begin_block() {
    number(Length{0});
    return bytes_.size();
  }
  template <class Length>
  void end_block(std::size_t block) {
    wire::put(std::span(bytes_), block - sizeof(Length),
              static_cast<Length>(bytes_.size() - block));
  }
  [[nodiscard]] std::size_t size() const noexcept { return bytes_.size(); }
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return bytes_; }
  void clear() noexcept { bytes_.clear(); }

 private:
  std::vector<std::byte> bytes_;
};

/// Takes fields off a record. After the first one that does not fit, ok() is false and all further
/// fields are empty or 0.
class Input {
 public:
  explicit Input(std::span<const std::byte> bytes) noexcept : rest_(bytes) {}
  template <class T>
  [[nodiscard]] T number() noexcept {
    const auto field = raw(sizeof(T));
    return ok_ ? wire::get<T>(field, 0) : T{};
  }
  [[nodiscard]] std::span<const std::byte> raw(std::uint64_t count) noexcept {
    if (!ok_ || count > rest_.size()) {
      ok_ = false;
      return {};
    }
    const auto taken = rest_.first(static_cast<std::size_t>(count));
    rest_ = rest_.subspan(static_cast<std::size_t>(count));
    return taken;
  }
  [[nodiscard]] std::string string() {
    const auto text = raw(number<std::uint32_t>());
    return {reinterpret_cast<const char*>(text.data()), text.size()};
  }
  [[nodiscard]] std::span<const std::byte> rest() const noexcept { return rest_; }
  [[nodiscard]] bool ok() const noexcept { return ok_; }

 private:
  std::span<const std::byte> rest_;
  bool ok_ = true;
};

}  // namespace emit::protocol::mcap
