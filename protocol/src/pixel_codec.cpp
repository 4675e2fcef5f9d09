// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/pixel_codec.hpp"

#include <lz4.h>

#include <algorithm>
#include <cstring>

#include "emit/physics/check.hpp"
#include "wire_bytes.hpp"

namespace emit::protocol {
namespace {

constexpr std::size_t kValueBytes = 4;
constexpr std::size_t kLengthBytes = 4;

/// Writes all first bytes of the values, then all second ones and so on.
void shuffle(std::span<const std::byte> values, std::byte* out) noexcept {
  const std::size_t count = values.size() / kValueBytes;
  const std::byte* in = values.data();
  for (std::size_t i = 0; i < count; ++i) {
    out[i] = in[kValueBytes * i];
    out[count + i] = in[kValueBytes * i + 1];
    out[2 * count + i] = in[kValueBytes * i + 2];
    out[3 * count + i] = in[kValueBytes * i + 3];
  }
}

/// Reverses shuffle().
void unshuffle(const std::byte* in, std::span<std::byte> values) noexcept {
  const std::size_t count = values.size() / kValueBytes;
  std::byte* out = values.data();
  for (std::size_t i = 0; i < count; ++i) {
    out[kValueBytes * i] = in[i];
    out[kValueBytes * i + 1] = in[count + i];
    out[kValueBytes * i + 2] = in[2 * count + i];
    out[kValueBytes * i + 3] = in[3 * count + i];
  }
}

char* chars(std::byte* bytes) noexcept {
  return reinterpret_cast<char*>(bytes);
}
const char* chars(const std::byte* bytes) noexcept {
  return reinterpret_cast<const char*>(bytes);
}

}  // namespace

PixelEncoder::PixelEncoder(std::size_t max_pixel_bytes)
    : state_(static_cast<std::size_t>(LZ4_sizeofState())),
      shuffled_(kBlockBytes),
      out_(std::make_unique_for_overwrite<std::byte[]>(max_pixel_bytes)),
      capacity_(max_pixel_bytes) {
  EMIT_CHECK_OP(max_pixel_bytes % kValueBytes, ==, 0U);
}

void PixelEncoder::begin(std::span<const std::byte> pixels) noexcept {
  EMIT_CHECK_OP(pixels.size() % kValueBytes, ==, 0U);
  pixels_ = pixels;
  taken_ = 0;
  made_ = 0;
  grew_ = pixels.size() > capacity_;
  if (grew_) {
    taken_ = pixels_.size();
  }
}

bool PixelEncoder::encode_block() noexcept {
  if (done()) {
    return true;
  }
  const auto block = pixels_.subspan(taken_, std::min(kBlockBytes, pixels_.size() - taken_));
  shuffle(block, shuffled_.data());
  const std::size_t limit = pixels_.size() - 1;  // the encoding must be smaller than the image
  const std::size_t room = limit > made_ + kLengthBytes ? limit - made_ - kLengthBytes : 0;
  const int length = LZ4_compress_fast_extState(
      state_.data(), chars(shuffled_.data()), chars(out_.get() + made_ + kLengthBytes),
      static_cast<int>(block.size()), static_cast<int>(std::min(room, 2 * kBlockBytes)), 1);
  if (length <= 0) {
    grew_ = true;
    taken_ = pixels_.size();
    return true;
  }
  wire::put(std::span(out_.get(), capacity_), made_, static_cast<std::uint32_t>(length));
  made_ += kLengthBytes + static_cast<std::size_t>(length);
  taken_ += block.size();
  return done();
}

std::span<const std::byte> PixelEncoder::bytes() const noexcept {
  return grew_ ? std::span<const std::byte>() : std::span<const std::byte>(out_.get(), made_);
}

bool PixelDecoder::decode(std::span<const std::byte> encoded,
                          std::span<std::byte> pixels) noexcept {
  if (pixels.size() % kValueBytes != 0) {
    return false;
  }
  for (std::size_t done = 0; done < pixels.size();) {
    const auto block =
        pixels.subspan(done, std::min(PixelEncoder::kBlockBytes, pixels.size() - done));
    if (encoded.size() < kLengthBytes) {
      return false;
    }
    const auto length = wire::get<std::uint32_t>(encoded, 0);
    encoded = encoded.subspan(kLengthBytes);
    if (length > encoded.size() || length > 2 * PixelEncoder::kBlockBytes) {
      return false;
    }
    const int made = LZ4_decompress_safe(chars(encoded.data()), chars(shuffled_.data()),
                                         static_cast<int>(length), static_cast<int>(block.size()));
    if (made < 0 || static_cast<std::size_t>(made) != block.size()) {
      return false;
    }
    unshuffle(shuffled_.data(), block);
    encoded = encoded.subspan(length);
    done += block.size();
  }
  return encoded.empty();
}

}  // namespace emit::protocol
