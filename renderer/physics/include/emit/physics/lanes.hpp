// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <type_traits>
#include <utility>

/// One source for scalars and for SIMD lanes: templates over `Real` take float, double, or several
/// doubles side by side (a class with these operators). Every lane has the bits of the scalar
/// result, because each operation is that of IEEE 754, in the same order. Any thread. RT-safe.
namespace emit::physics {

template <class Real>
struct ScalarOf {
  using Type = typename Real::value_type;
};
template <>
struct ScalarOf<float> {
  using Type = float;
};
template <>
struct ScalarOf<double> {
  using Type = double;
};
/// Type of one lane.
template <class Real>
using Scalar = typename ScalarOf<Real>::Type;

/// Result of a comparison: bool for scalars, a flag per lane for lanes.
template <class Real>
using Mask = decltype(std::declval<Real>() < std::declval<Real>());

/// Returns `yes` where the flag is set and `no` elsewhere. Both are computed.
template <class Flags, class Real>
[[nodiscard]] constexpr Real choose(const Flags& flags, const Real& yes, const Real& no) noexcept {
  if constexpr (std::is_same_v<Flags, bool>) {
    return flags ? yes : no;
  } else {
    return select(flags, yes, no);
  }
}

/// Returns true if no flag is set.
template <class Flags>
[[nodiscard]] constexpr bool none(const Flags& flags) noexcept {
  if constexpr (std::is_same_v<Flags, bool>) {
    return !flags;
  } else {
    return none_of(flags);
  }
}

/// Returns the flags that are set in either.
template <class Flags>
[[nodiscard]] constexpr Flags either(const Flags& a, const Flags& b) noexcept {
  return Flags(a | b);
}

/// Returns the flags that are set in both.
template <class Flags>
[[nodiscard]] constexpr Flags both(const Flags& a, const Flags& b) noexcept {
  return Flags(a & b);
}

}  // namespace emit::physics
