// SPDX-License-Identifier: Apache-2.0
#pragma once
#if defined(__x86_64__)
#include <emmintrin.h>
#endif

#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>

/// Eight doubles side by side (lanes.hpp), in registers of 16 or 32 bytes. Functions with the wider
/// registers work only where all of this is inlined into a function with [[gnu::target("avx2")]],
/// since a call would pass vectors by other rules. Any thread. RT-safe.
namespace emit::physics {

inline constexpr std::size_t kWideLanes = 8;

/// Vectors of the compiler that fill one register.
template <std::size_t kBytes>
struct RegisterOf {
  static constexpr std::size_t kCount = kWideLanes * sizeof(double) / kBytes;
  using Numbers [[gnu::vector_size(kBytes)]] = double;
  using Bits [[gnu::vector_size(kBytes)]] = long long;
};

/// Outcome of a comparison: all bits of a lane are set where it holds.
template <std::size_t kBytes>
struct WideFlags {
  using Register = RegisterOf<kBytes>;
  using Bits = typename Register::Bits;
  std::array<Bits, Register::kCount> bits{};

  WideFlags() = default;
  [[gnu::always_inline]] explicit WideFlags(bool all) noexcept {
    for (Bits& each : bits) each = Bits{} - (all ? 1 : 0);
  }

  [[gnu::always_inline]] friend WideFlags operator|(const WideFlags& a,
                                                    const WideFlags& b) noexcept {
    WideFlags out = a;
    for (std::size_t i = 0; i < Register::kCount; ++i) out.bits[i] |= b.bits[i];
    return out;
  }
  [[gnu::always_inline]] friend WideFlags operator&(const WideFlags& a,
                                                    const WideFlags& b) noexcept {
    WideFlags out = a;
    for (std::size_t i = 0; i < Register::kCount; ++i) out.bits[i] &= b.bits[i];
    return out;
  }
  /// Returns true if no lane is set.
  [[gnu::always_inline]] friend bool none_of(const WideFlags& flags) noexcept {
    Bits any = flags.bits[0];
    for (std::size_t i = 1; i < Register::kCount; ++i) any |= flags.bits[i];
    long long joined = 0;
    for (std::size_t i = 0; i < kBytes / sizeof(double); ++i) joined |= any[i];
    return joined == 0;
  }
};

/// Eight doubles. Operators work lane by lane, with the bits of the scalar operation.
template <std::size_t kBytes>
class WideLanes {
 public:
  using value_type = double;
  using Register = RegisterOf<kBytes>;
  using Numbers = typename Register::Numbers;
  using Bits = typename Register::Bits;
  using Flags = WideFlags<kBytes>;

  WideLanes() = default;
  /// Takes the same number in every lane.
  template <class Number>
  requires std::is_arithmetic_v<Number>
  // NOLINTNEXTLINE(google-explicit-constructor): formulae mix lanes and constants
  [[gnu::always_inline]] WideLanes(Number all) noexcept {
    for (Numbers& each : numbers_) each = Numbers{} + static_cast<double>(all);
  }
  /// Takes one number a lane.
  [[gnu::always_inline]] explicit WideLanes(const std::array<double, kWideLanes>& all) noexcept {
    for (std::size_t l = 0; l < kWideLanes; ++l)
      numbers_[l / kPerRegister][l % kPerRegister] = all[l];
  }

  [[gnu::always_inline]] double operator[](std::size_t lane) const noexcept {
    return numbers_[lane / kPerRegister][lane % kPerRegister];
  }

  [[gnu::always_inline]] friend WideLanes operator+(const WideLanes& a,
                                                    const WideLanes& b) noexcept {
    WideLanes out = a;
    return out += b;
  }
  [[gnu::always_inline]] friend WideLanes operator-(const WideLanes& a,
                                                    const WideLanes& b) noexcept {
    WideLanes out = a;
    return out -= b;
  }
  [[gnu::always_inline]] friend WideLanes operator*(const WideLanes& a,
                                                    const WideLanes& b) noexcept {
    WideLanes out = a;
    for (std::size_t i = 0; i < Register::kCount; ++i) out.numbers_[i] *= b.numbers_[i];
    return out;
  }
  [[gnu::always_inline]] friend WideLanes operator/(const WideLanes& a,
                                                    const WideLanes& b) noexcept {
    WideLanes out = a;
    for (std::size_t i = 0; i < Register::kCount; ++i) out.numbers_[i] /= b.numbers_[i];
    return out;
  }
  [[gnu::always_inline]] WideLanes& operator+=(const WideLanes& b) noexcept {
    for (std::size_t i = 0; i < Register::kCount; ++i) numbers_[i] += b.numbers_[i];
    return *this;
  }
  [[gnu::always_inline]] WideLanes& operator-=(const WideLanes& b) noexcept {
    for (std::size_t i = 0; i < Register::kCount; ++i) numbers_[i] -= b.numbers_[i];
    return *this;
  }
  [[gnu::always_inline]] friend Flags operator<(const WideLanes& a, const WideLanes& b) noexcept {
    Flags out;
    for (std::size_t i = 0; i < Register::kCount; ++i) {
      out.bits[i] = Bits(a.numbers_[i] < b.numbers_[i]);
    }
    return out;
  }
  [[gnu::always_inline]] friend Flags operator>(const WideLanes& a, const WideLanes& b) noexcept {
    return b < a;
  }
  [[gnu::always_inline]] friend WideLanes select(const Flags& flags, const WideLanes& yes,
                                                 const WideLanes& no) noexcept {
    WideLanes out;
    for (std::size_t i = 0; i < Register::kCount; ++i) {
      out.numbers_[i] = Numbers((flags.bits[i] & Bits(yes.numbers_[i])) |
                                (~flags.bits[i] & Bits(no.numbers_[i])));
    }
    return out;
  }
  [[gnu::always_inline]] friend WideLanes abs(const WideLanes& a) noexcept {
    constexpr long long kAllButSign = 0x7fff'ffff'ffff'ffff;
    WideLanes out = a;
    for (Numbers& each : out.numbers_) each = Numbers(Bits(each) & kAllButSign);
    return out;
  }
  [[gnu::always_inline]] friend WideLanes sqrt(const WideLanes& a) noexcept {
    WideLanes out = a;
    for (Numbers& each : out.numbers_) {
#if defined(__x86_64__)
      // A loop over std::sqrt would stay scalar, because each call may set errno.
      for (std::size_t i = 0; i < kPerRegister; i += 2) {
        const __m128d root = _mm_sqrt_pd(__m128d{each[i], each[i + 1]});
        each[i] = root[0];
        each[i + 1] = root[1];
      }
#else
      for (std::size_t i = 0; i < kPerRegister; ++i) each[i] = std::sqrt(each[i]);
#endif
    }
    return out;
  }
  [[gnu::always_inline]] friend WideLanes exp(const WideLanes& a) noexcept {
    WideLanes out = a;
    for (Numbers& each : out.numbers_) {
      for (std::size_t i = 0; i < kPerRegister; ++i) each[i] = std::exp(each[i]);
    }
    return out;
  }

 private:
  static constexpr std::size_t kPerRegister = kWideLanes / Register::kCount;

  std::array<Numbers, Register::kCount> numbers_{};
};

}  // namespace emit::physics
