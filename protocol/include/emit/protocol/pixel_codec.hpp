// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

/// Codec of PixelEncoding::shuffled_lz4 (docs/wire.md section 3). The pixels are cut into blocks of
/// kBlockBytes. A block holds all first bytes of its values, then all second ones and so on,
/// compressed by LZ4. The coding is lossless, bit for bit.
namespace emit::protocol {

/// Encodes the pixels of one image after the other.
/// Thread: one owner.  Real time: the constructor allocates, everything else is RT-safe.
class PixelEncoder {
 public:
  /// Length of a block before compression, bytes.
  static constexpr std::size_t kBlockBytes = 64u << 10;

  /// Allocates memory for the largest image and for LZ4.
  /// @pre max_pixel_bytes is a multiple of 4
  explicit PixelEncoder(std::size_t max_pixel_bytes);

  /// Begins an image. `pixels` must stay unchanged until done(). RT-safe.
  /// @pre pixels.size() is a multiple of 4
  void begin(std::span<const std::byte> pixels) noexcept;
  /// Encodes one more block. Returns true when none is left. RT-safe.
  bool encode_block() noexcept;
  /// Returns true when every block is encoded, or when the encoding was given up because it grew.
  [[nodiscard]] bool done() const noexcept { return taken_ == pixels_.size(); }
  /// Returns the encoded image after done(). The span is empty when the encoding is not smaller
  /// than the image. RT-safe.
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept;

 private:
  std::vector<std::byte> state_;
  std::vector<std::byte> shuffled_;
  // capacity_ bytes; not initialised, so no page is touched before it is needed.
  std::unique_ptr<std::byte[]> out_;
  std::size_t capacity_ = 0;
  std::span<const std::byte> pixels_;
  std::size_t taken_ = 0;
  std::size_t made_ = 0;
  bool grew_ = false;  // true when the encoding is not smaller than the image
};

/// Decodes images.
/// Thread: one owner.  Real time: the constructor allocates, decode() is RT-safe.
class PixelDecoder {
 public:
  PixelDecoder() : shuffled_(PixelEncoder::kBlockBytes) {}
  /// Decodes an image. Returns false when `encoded` is no encoded image of exactly the size of
  /// `pixels`; the contents of `pixels` are then void. It never writes beyond `pixels`. RT-safe.
  [[nodiscard]] bool decode(std::span<const std::byte> encoded,
                            std::span<std::byte> pixels) noexcept;

 private:
  std::vector<std::byte> shuffled_;
};

}  // namespace emit::protocol
