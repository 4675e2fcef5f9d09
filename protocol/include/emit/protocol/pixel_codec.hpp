// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

/// PixelEncoding::shuffled_lz4, docs/wire.md section 3: pixels in blocks of kBlockBytes, of each
/// block first all first bytes of its values, then all second ones and so on, compressed by LZ4.
/// Lossless, bit for bit.
namespace emit::protocol {

class PixelEncoder {
 public:
  static constexpr std::size_t kBlockBytes = 64u << 10;

  /// Takes the memory: that of the largest picture, and LZ4's. Precondition: a multiple of 4.
  explicit PixelEncoder(std::size_t max_pixel_bytes);

  /// Starts a picture, whose pixels stay as they are until done(). RT-safe.
  void begin(std::span<const std::byte> pixels) noexcept;
  /// Encodes one more block; true when there is none left. RT-safe.
  bool encode_block() noexcept;
  [[nodiscard]] bool done() const noexcept { return taken_ == pixels_.size(); }
  /// After done(): empty where the picture did not become smaller. RT-safe.
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept;

 private:
  std::vector<std::byte> state_;
  std::vector<std::byte> shuffled_;
  std::unique_ptr<std::byte[]> out_;  // of capacity_: no page is touched before it is needed
  std::size_t capacity_ = 0;
  std::span<const std::byte> pixels_;
  std::size_t taken_ = 0;
  std::size_t made_ = 0;
  bool grew_ = false;  // does not fit into what the picture itself takes
};

class PixelDecoder {
 public:
  PixelDecoder() : shuffled_(PixelEncoder::kBlockBytes) {}
  /// False: not an encoded picture of exactly that size. Never writes beyond `pixels`; what it has
  /// written then is void. RT-safe.
  [[nodiscard]] bool decode(std::span<const std::byte> encoded,
                            std::span<std::byte> pixels) noexcept;

 private:
  std::vector<std::byte> shuffled_;
};

}  // namespace emit::protocol
