// SPDX-License-Identifier: Apache-2.0
#include "crc.hpp"

#include <array>
#include <cstring>

#include "emit/physics/check.hpp"
#include "emit/protocol/frame_header.hpp"
#include "wire_bytes.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace emit::protocol {
namespace {

constexpr std::uint32_t kCastagnoliReflected = 0x82F63B78;
constexpr std::uint32_t kIeeeReflected = 0xEDB88320;

/// Tables for a CRC of eight bytes a step.
using SliceTable = std::array<std::array<std::uint32_t, 256>, 8>;

/// Computes the tables of a polynomial. Table k gives the effect of a byte that is followed by k
/// zero bytes.
constexpr SliceTable make_slices(std::uint32_t polynomial) {
  SliceTable table{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t crc = byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1u) != 0 ? polynomial : 0u);
    table[0][byte] = crc;
  }
  for (std::size_t slice = 1; slice < 8; ++slice) {
    for (std::size_t byte = 0; byte < 256; ++byte) {
      const std::uint32_t before = table[slice - 1][byte];
      table[slice][byte] = (before >> 8) ^ table[0][before & 0xFFu];
    }
  }
  return table;
}

constexpr SliceTable kCastagnoliSlices = make_slices(kCastagnoliReflected);
constexpr SliceTable kIeeeSlices = make_slices(kIeeeReflected);

std::uint32_t crc_by_slices(const SliceTable& table, std::span<const std::byte> bytes,
                            std::uint32_t crc) noexcept {
  crc = ~crc;
  std::size_t at = 0;
  for (; at + 8 <= bytes.size(); at += 8) {
    const std::uint64_t word = wire::get<std::uint64_t>(bytes, at) ^ crc;
    crc = table[7][word & 0xFFu] ^ table[6][(word >> 8) & 0xFFu] ^ table[5][(word >> 16) & 0xFFu] ^
          table[4][(word >> 24) & 0xFFu] ^ table[3][(word >> 32) & 0xFFu] ^
          table[2][(word >> 40) & 0xFFu] ^ table[1][(word >> 48) & 0xFFu] ^ table[0][word >> 56];
  }
  for (; at < bytes.size(); ++at) {
    crc = (crc >> 8) ^ table[0][(crc ^ std::to_integer<std::uint32_t>(bytes[at])) & 0xFFu];
  }
  return ~crc;
}

#if defined(__x86_64__)

// Length of one of three independent streams, bytes. The instruction takes three cycles but starts
// every cycle, so three streams keep it busy.
constexpr std::size_t kStreamBytes = 4096;

/// Tables that move a CRC register over kStreamBytes zero bytes by four look-ups, one per register
/// byte.
using ShiftTable = std::array<std::array<std::uint32_t, 256>, 4>;

constexpr ShiftTable make_shift(std::size_t zero_bytes) {
  // The shift is linear, so the images of the 32 unit registers determine it.
  std::array<std::uint32_t, 32> image{};
  for (std::size_t bit = 0; bit < 32; ++bit) image[bit] = std::uint32_t{1} << bit;
  // Start with the shift by one byte and double it: `image` holds the shift by `step` bytes.
  for (auto& value : image) value = (value >> 8) ^ kCastagnoliSlices[0][value & 0xFFu];
  auto apply = [](const std::array<std::uint32_t, 32>& matrix, std::uint32_t value) {
    std::uint32_t sum = 0;
    for (std::size_t bit = 0; bit < 32; ++bit) {
      if (((value >> bit) & 1u) != 0) sum ^= matrix[bit];
    }
    return sum;
  };
  for (std::size_t step = 1; step < zero_bytes; step *= 2) {
    std::array<std::uint32_t, 32> doubled{};
    for (std::size_t bit = 0; bit < 32; ++bit) doubled[bit] = apply(image, image[bit]);
    image = doubled;
  }
  ShiftTable table{};
  for (std::size_t byte = 0; byte < 4; ++byte) {
    for (std::uint32_t value = 0; value < 256; ++value) {
      table[byte][value] = apply(image, value << (8 * byte));
    }
  }
  return table;
}
static_assert((kStreamBytes & (kStreamBytes - 1)) == 0, "make_shift doubles");
constexpr ShiftTable kShift = make_shift(kStreamBytes);

/// Moves a CRC register over kStreamBytes zero bytes.
std::uint32_t shift_stream(std::uint32_t crc) noexcept {
  return kShift[0][crc & 0xFFu] ^ kShift[1][(crc >> 8) & 0xFFu] ^ kShift[2][(crc >> 16) & 0xFFu] ^
         kShift[3][crc >> 24];
}

std::uint64_t load_u64(const std::byte* from) noexcept {
  std::uint64_t word = 0;
  std::memcpy(&word, from, sizeof word);
  return word;
}

#endif

}  // namespace

std::uint32_t crc32c_portable(std::span<const std::byte> bytes, std::uint32_t crc) noexcept {
  return crc_by_slices(kCastagnoliSlices, bytes, crc);
}

std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t crc) noexcept {
  return crc_by_slices(kIeeeSlices, bytes, crc);
}

#if defined(__x86_64__)

bool has_crc32c_instruction() noexcept {
  return __builtin_cpu_supports("sse4.2") != 0;
}

__attribute__((target("sse4.2"))) std::uint32_t crc32c_hardware(std::span<const std::byte> bytes,
                                                                std::uint32_t crc) noexcept {
  EMIT_DCHECK(has_crc32c_instruction());
  const std::byte* at = bytes.data();
  std::size_t left = bytes.size();
  std::uint64_t first = static_cast<std::uint32_t>(~crc);
  while (left >= 3 * kStreamBytes) {
    std::uint64_t second = 0;
    std::uint64_t third = 0;
    for (std::size_t i = 0; i < kStreamBytes; i += 8) {
      first = _mm_crc32_u64(first, load_u64(at + i));
      second = _mm_crc32_u64(second, load_u64(at + kStreamBytes + i));
      third = _mm_crc32_u64(third, load_u64(at + 2 * kStreamBytes + i));
    }
    first = shift_stream(static_cast<std::uint32_t>(first)) ^ second;
    first = shift_stream(static_cast<std::uint32_t>(first)) ^ third;
    at += 3 * kStreamBytes;
    left -= 3 * kStreamBytes;
  }
  for (; left >= 8; left -= 8, at += 8) first = _mm_crc32_u64(first, load_u64(at));
  auto tail = static_cast<std::uint32_t>(first);
  for (; left > 0; --left, ++at) tail = _mm_crc32_u8(tail, std::to_integer<std::uint8_t>(*at));
  return ~tail;
}

bool has_crc32c_folding() noexcept {
  return has_crc32c_instruction() && __builtin_cpu_supports("avx2") != 0 &&
         __builtin_cpu_supports("vpclmulqdq") != 0;
}

bool has_crc32c_wide_folding() noexcept {
  return has_crc32c_folding() && __builtin_cpu_supports("avx512f") != 0;
}

namespace {

/// Returns x^n modulo the polynomial, reflected like the registers: the highest bit is x^0.
constexpr std::uint32_t power_of_x(unsigned n) {
  std::uint32_t value = 0x80000000;
  for (unsigned i = 0; i < n; ++i) {
    value = (value >> 1) ^ ((value & 1u) != 0 ? kCastagnoliReflected : 0u);
  }
  return value;
}

/// Returns the factor that moves half a lane over `bits` bits of the message. The low half of a
/// lane moves 32 bits more, the high half 32 bits less (Gopal et al., Fast CRC Computation for
/// Generic Polynomials Using PCLMULQDQ, 2009). The shift by one makes up for the product of
/// reflected factors, which is one bit short.
constexpr long long fold_factor(unsigned bits) {
  return static_cast<long long>(std::uint64_t{power_of_x(bits)} << 1);
}

constexpr std::size_t kFoldBytes = 128;

/// Moves lanes over kFoldBytes bytes and adds the next 32 bytes.
__attribute__((target("avx2,vpclmulqdq"))) inline __m256i fold(__m256i lanes, __m256i factors,
                                                               const std::byte* next) noexcept {
  return _mm256_xor_si256(_mm256_xor_si256(_mm256_clmulepi64_epi128(lanes, factors, 0x00),
                                           _mm256_clmulepi64_epi128(lanes, factors, 0x11)),
                          _mm256_loadu_si256(reinterpret_cast<const __m256i*>(next)));
}

constexpr std::size_t kWideFoldBytes = 2 * kFoldBytes;

__attribute__((target("avx512f,vpclmulqdq"))) inline __m512i load_wide(
    const std::byte* from) noexcept {
  return _mm512_loadu_si512(from);
}

/// Moves lanes over kWideFoldBytes bytes and adds the next 64 bytes.
__attribute__((target("avx512f,vpclmulqdq"))) inline __m512i fold_wide(
    __m512i lanes, __m512i factors, const std::byte* next) noexcept {
  return _mm512_xor_si512(_mm512_xor_si512(_mm512_clmulepi64_epi128(lanes, factors, 0x00),
                                           _mm512_clmulepi64_epi128(lanes, factors, 0x11)),
                          load_wide(next));
}

/// Returns the CRC of the lanes, which are a message with the same remainder as the one folded into
/// them.
__attribute__((target("sse4.2"))) inline std::uint32_t sum_of_lanes(
    std::span<const std::byte> lanes) noexcept {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < lanes.size(); i += 8) sum = _mm_crc32_u64(sum, load_u64(&lanes[i]));
  return ~static_cast<std::uint32_t>(sum);
}

}  // namespace

__attribute__((target("avx512f,vpclmulqdq,sse4.2"))) std::uint32_t crc32c_wide_folding(
    std::span<const std::byte> bytes, std::uint32_t crc) noexcept {
  EMIT_DCHECK(has_crc32c_wide_folding());
  if (bytes.size() < 2 * kWideFoldBytes) return crc32c_folding(bytes, crc);
  constexpr unsigned kBits = 8 * kWideFoldBytes;
  const __m512i factors =
      _mm512_set_epi64(fold_factor(kBits - 32), fold_factor(kBits + 32), fold_factor(kBits - 32),
                       fold_factor(kBits + 32), fold_factor(kBits - 32), fold_factor(kBits + 32),
                       fold_factor(kBits - 32), fold_factor(kBits + 32));
  const std::byte* at = bytes.data();
  const __m512i start = _mm512_set_epi64(0, 0, 0, 0, 0, 0, 0, static_cast<std::uint32_t>(~crc));
  __m512i a = _mm512_xor_si512(load_wide(at), start);
  __m512i b = load_wide(at + 64);
  __m512i c = load_wide(at + 128);
  __m512i d = load_wide(at + 192);
  std::size_t left = bytes.size() - kWideFoldBytes;
  for (at += kWideFoldBytes; left >= kWideFoldBytes; left -= kWideFoldBytes, at += kWideFoldBytes) {
    a = fold_wide(a, factors, at);
    b = fold_wide(b, factors, at + 64);
    c = fold_wide(c, factors, at + 128);
    d = fold_wide(d, factors, at + 192);
  }
  alignas(64) std::array<std::byte, kWideFoldBytes> lanes;
  _mm512_store_si512(lanes.data(), a);
  _mm512_store_si512(lanes.data() + 64, b);
  _mm512_store_si512(lanes.data() + 128, c);
  _mm512_store_si512(lanes.data() + 192, d);
  return crc32c_hardware({at, left}, sum_of_lanes(lanes));
}

__attribute__((target("avx2,vpclmulqdq,sse4.2"))) std::uint32_t crc32c_folding(
    std::span<const std::byte> bytes, std::uint32_t crc) noexcept {
  EMIT_DCHECK(has_crc32c_folding());
  if (bytes.size() < 2 * kFoldBytes) return crc32c_hardware(bytes, crc);
  // Eight lanes stand side by side. Memory is read from front to back, which suits the prefetchers.
  constexpr unsigned kBits = 8 * kFoldBytes;
  const __m256i factors = _mm256_set_epi64x(fold_factor(kBits - 32), fold_factor(kBits + 32),
                                            fold_factor(kBits - 32), fold_factor(kBits + 32));
  const std::byte* at = bytes.data();
  const __m256i zero = _mm256_setzero_si256();
  const __m256i start = _mm256_set_epi64x(0, 0, 0, static_cast<std::uint32_t>(~crc));
  __m256i a = _mm256_xor_si256(fold(zero, factors, at), start);
  __m256i b = fold(zero, factors, at + 32);
  __m256i c = fold(zero, factors, at + 64);
  __m256i d = fold(zero, factors, at + 96);
  std::size_t left = bytes.size() - kFoldBytes;
  for (at += kFoldBytes; left >= kFoldBytes; left -= kFoldBytes, at += kFoldBytes) {
    a = fold(a, factors, at);
    b = fold(b, factors, at + 32);
    c = fold(c, factors, at + 64);
    d = fold(d, factors, at + 96);
  }
  alignas(32) std::array<std::byte, kFoldBytes> lanes;
  _mm256_store_si256(reinterpret_cast<__m256i*>(lanes.data()), a);
  _mm256_store_si256(reinterpret_cast<__m256i*>(lanes.data() + 32), b);
  _mm256_store_si256(reinterpret_cast<__m256i*>(lanes.data() + 64), c);
  _mm256_store_si256(reinterpret_cast<__m256i*>(lanes.data() + 96), d);
  return crc32c_hardware({at, left}, sum_of_lanes(lanes));
}

#else

bool has_crc32c_instruction() noexcept {
  return false;
}

bool has_crc32c_folding() noexcept {
  return false;
}

bool has_crc32c_wide_folding() noexcept {
  return false;
}

std::uint32_t crc32c_wide_folding(std::span<const std::byte> bytes, std::uint32_t crc) noexcept {
  return crc32c_portable(bytes, crc);
}

std::uint32_t crc32c_folding(std::span<const std::byte> bytes, std::uint32_t crc) noexcept {
  return crc32c_portable(bytes, crc);
}

std::uint32_t crc32c_hardware(std::span<const std::byte> bytes, std::uint32_t crc) noexcept {
  return crc32c_portable(bytes, crc);
}

#endif

std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t crc) noexcept {
  static const auto best = has_crc32c_wide_folding()  ? crc32c_wide_folding
                           : has_crc32c_folding()     ? crc32c_folding
                           : has_crc32c_instruction() ? crc32c_hardware
                                                      : crc32c_portable;
  return best(bytes, crc);
}

}  // namespace emit::protocol
