// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <compare>

#include "emit/physics/constants.hpp"

/// Quantity types for interfaces: a number with its unit. Construction is explicit, value() is the
/// only way back to a double, and only quantities of one kind add. Inner loops and GPU structs use
/// raw numbers with the unit in the name instead. Any thread. RT-safe.
namespace emit::physics {

/// A quantity of the kind `Tag`. Differences and scalings keep the kind; ratios are plain numbers.
template <class Tag>
class Quantity {
 public:
  constexpr Quantity() noexcept = default;
  constexpr explicit Quantity(double value) noexcept : value_(value) {}

  /// Returns the number in the unit that the type is named after.
  [[nodiscard]] constexpr double value() const noexcept { return value_; }

  [[nodiscard]] friend constexpr Quantity operator+(Quantity a, Quantity b) noexcept {
    return Quantity(a.value_ + b.value_);
  }
  [[nodiscard]] friend constexpr Quantity operator-(Quantity a, Quantity b) noexcept {
    return Quantity(a.value_ - b.value_);
  }
  [[nodiscard]] friend constexpr Quantity operator-(Quantity a) noexcept {
    return Quantity(-a.value_);
  }
  [[nodiscard]] friend constexpr Quantity operator*(Quantity a, double s) noexcept {
    return Quantity(a.value_ * s);
  }
  [[nodiscard]] friend constexpr Quantity operator*(double s, Quantity a) noexcept {
    return Quantity(s * a.value_);
  }
  [[nodiscard]] friend constexpr Quantity operator/(Quantity a, double s) noexcept {
    return Quantity(a.value_ / s);
  }
  [[nodiscard]] friend constexpr double operator/(Quantity a, Quantity b) noexcept {
    return a.value_ / b.value_;
  }
  constexpr Quantity& operator+=(Quantity b) noexcept {
    value_ += b.value_;
    return *this;
  }
  constexpr Quantity& operator-=(Quantity b) noexcept {
    value_ -= b.value_;
    return *this;
  }
  friend constexpr auto operator<=>(Quantity, Quantity) noexcept = default;

 private:
  double value_ = 0.0;
};

using Kelvin = Quantity<struct KelvinTag>;
using Metres = Quantity<struct MetresTag>;
using Micrometres = Quantity<struct MicrometresTag>;
using Radians = Quantity<struct RadiansTag>;
/// Radiance in a band, W m-2 sr-1.
using Radiance = Quantity<struct RadianceTag>;
/// Spectral radiance, W m-2 sr-1 um-1.
using SpectralRadiance = Quantity<struct SpectralRadianceTag>;

/// Converts degrees to a Radians quantity.
[[nodiscard]] constexpr Radians degrees(double angle_deg) noexcept {
  return Radians(angle_deg * kDegree);
}
/// Converts a Radians quantity to degrees.
[[nodiscard]] constexpr double to_degrees(Radians angle) noexcept {
  return angle.value() / kDegree;
}

/// Literals of the quantities: 300.0_K, 1.5_m, 4_um, 0.1_rad, 45_deg. Use them by `using namespace
/// emit::physics::literals;`.
inline namespace literals {
constexpr Kelvin operator""_K(long double v) noexcept {
  return Kelvin(static_cast<double>(v));
}
constexpr Kelvin operator""_K(unsigned long long v) noexcept {
  return Kelvin(static_cast<double>(v));
}
constexpr Metres operator""_m(long double v) noexcept {
  return Metres(static_cast<double>(v));
}
constexpr Metres operator""_m(unsigned long long v) noexcept {
  return Metres(static_cast<double>(v));
}
constexpr Micrometres operator""_um(long double v) noexcept {
  return Micrometres(static_cast<double>(v));
}
constexpr Micrometres operator""_um(unsigned long long v) noexcept {
  return Micrometres(static_cast<double>(v));
}
constexpr Radians operator""_rad(long double v) noexcept {
  return Radians(static_cast<double>(v));
}
constexpr Radians operator""_deg(long double v) noexcept {
  return degrees(static_cast<double>(v));
}
constexpr Radians operator""_deg(unsigned long long v) noexcept {
  return degrees(static_cast<double>(v));
}
}  // namespace literals

}  // namespace emit::physics
