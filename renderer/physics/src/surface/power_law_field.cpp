// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/surface/power_law_field.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <complex>
#include <random>
#include <span>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::physics {
namespace {

using Complex = std::complex<double>;

/// Product of finite numbers. The operator of the library looks for infinities too, which takes
/// most of the time.
Complex product(const Complex& a, const Complex& b) noexcept {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

/// Transforms a row in place, X_k = sum x_n exp(sign 2 pi i n k / N), by Cooley and Tukey's way
/// (1965). Nothing is scaled. @pre the length is a power of two
void transform_even(std::span<Complex> row, double sign) {
  const std::size_t n = row.size();
  // Put the values into the order of reversed bits.
  for (std::size_t i = 1, j = 0; i < n; ++i) {
    std::size_t bit = n >> 1U;
    for (; (j & bit) != 0; bit >>= 1U) j ^= bit;
    j |= bit;
    if (i < j) std::swap(row[i], row[j]);
  }
  // Join transforms of half the length.
  std::vector<Complex> turns(n / 2);
  for (std::size_t k = 0; k < turns.size(); ++k) {
    turns[k] = std::polar(1.0, sign * 2.0 * kPi * static_cast<double>(k) / static_cast<double>(n));
  }
  for (std::size_t length = 2; length <= n; length *= 2) {
    const std::size_t stride = n / length;
    for (std::size_t first = 0; first < n; first += length) {
      for (std::size_t k = 0; k < length / 2; ++k) {
        const Complex even = row[first + k];
        const Complex odd = product(row[first + k + length / 2], turns[k * stride]);
        row[first + k] = even + odd;
        row[first + k + length / 2] = even - odd;
      }
    }
  }
}

/// Does the same for three times a power of two too.
void transform(std::span<Complex> row, double sign) {
  const std::size_t n = row.size();
  if (n % 3 != 0) {
    transform_even(row, sign);
    return;
  }
  // Join the transforms of every third value.
  std::array<std::vector<Complex>, 3> parts;
  for (std::size_t part = 0; part < 3; ++part) {
    for (std::size_t i = part; i < n; i += 3) parts[part].push_back(row[i]);
    transform_even(parts[part], sign);
  }
  for (std::size_t k = 0; k < n; ++k) {
    const Complex turn =
        std::polar(1.0, sign * 2.0 * kPi * static_cast<double>(k) / static_cast<double>(n));
    const std::size_t i = k % (n / 3);
    row[k] = parts[0][i] + turn * (parts[1][i] + turn * parts[2][i]);
  }
}

/// Transforms all rows, then all columns of a square.
void transform_square(std::vector<Complex>& values, std::size_t side, double sign) {
  std::vector<Complex> column(side);
  for (std::size_t row = 0; row < side; ++row) {
    transform(std::span(values).subspan(row * side, side), sign);
  }
  for (std::size_t at = 0; at < side; ++at) {
    for (std::size_t row = 0; row < side; ++row) column[row] = values[row * side + at];
    transform(column, sign);
    for (std::size_t row = 0; row < side; ++row) values[row * side + at] = column[row];
  }
}

/// Returns the signed number of waves per period of a coefficient.
double waves_of(std::size_t index, std::size_t side) noexcept {
  const auto k = static_cast<double>(index);
  return index <= side / 2 ? k : k - static_cast<double>(side);
}

/// Share of a coefficient that a level keeps, by its waves per texel.
double kept_frac(double waves) noexcept {
  constexpr double kWholeWaves = 0.05;
  constexpr double kNoWaves = 0.3;
  const double part = std::clamp((waves - kWholeWaves) / (kNoWaves - kWholeWaves), 0.0, 1.0);
  return std::pow(std::cos(0.5 * kPi * part), 2);
}

}  // namespace

std::vector<FieldLevel> power_law_field(const PowerLaw& law, std::size_t side,
                                        std::size_t most_levels) {
  EMIT_CHECK(std::has_single_bit(side));
  EMIT_CHECK_OP(side, >=, std::size_t{4});
  EMIT_CHECK_OP(side, <=, std::size_t{4096});
  EMIT_CHECK_OP(law.shortest_m, >=, 2.0 * law.period_m / static_cast<double>(side));
  EMIT_CHECK_OP(law.shortest_m, <, law.longest_m);
  EMIT_CHECK_OP(law.longest_m, <=, law.period_m);
  // Take the phases of white noise: those of a real field fit each other.
  std::mt19937_64 random(law.seed);
  std::vector<Complex> spectrum(side * side);
  constexpr double kPerStep = 1.0 / 9007199254740992.0;  // 2^-53
  for (Complex& value : spectrum) {
    value = static_cast<double>(random() >> 11U) * kPerStep - 0.5;
  }
  transform_square(spectrum, side, -1.0);
  // Give each coefficient the size that the spectrum asks for.
  double power = 0.0;
  for (std::size_t y = 0; y < side; ++y) {
    for (std::size_t x = 0; x < side; ++x) {
      Complex& value = spectrum[y * side + x];
      const double waves = std::hypot(waves_of(x, side), waves_of(y, side));
      const double wavelength_m = waves > 0.0 ? law.period_m / waves : 0.0;
      const bool inside = wavelength_m >= law.shortest_m && wavelength_m <= law.longest_m;
      const double size = std::abs(value);
      value = inside && size > 0.0 ? value / size * std::pow(waves, -0.5 * law.slope) : 0.0;
      power += std::norm(value);
    }
  }
  const double scale = 1.0 / std::sqrt(power);
  for (Complex& value : spectrum) value *= scale;
  // Make each level from the coefficients that it can hold.
  std::vector<FieldLevel> levels;
  std::vector<std::size_t> sides;
  for (std::size_t now = side; now >= 4; now /= 2) {
    sides.push_back(now);
    if (now > 4) sides.push_back(now / 4 * 3);
  }
  if (sides.size() > most_levels) sides.resize(most_levels);
  for (const std::size_t now : sides) {
    FieldLevel level{.side = now, .variance = 0.0, .values = std::vector<float>(now * now)};
    std::vector<Complex> part(now * now);
    const double texel_frac = now == side ? 0.0 : 1.0 / static_cast<double>(now);
    for (std::size_t y = 0; y < now; ++y) {
      for (std::size_t x = 0; x < now; ++x) {
        const double wave_x = waves_of(x, now);
        const double wave_y = waves_of(y, now);
        // The coefficient at half the sampling rate stands for two of them: leave it out.
        if (2 * x == now || 2 * y == now) continue;
        const std::size_t from_x = wave_x < 0.0 ? side - (now - x) : x;
        const std::size_t from_y = wave_y < 0.0 ? side - (now - y) : y;
        const Complex value =
            spectrum[from_y * side + from_x] * kept_frac(texel_frac * std::hypot(wave_x, wave_y));
        part[y * now + x] = value;
        level.variance += std::norm(value);
      }
    }
    transform_square(part, now, 1.0);
    for (std::size_t i = 0; i < part.size(); ++i) {
      level.values[i] = static_cast<float>(part[i].real());
    }
    levels.push_back(std::move(level));
  }
  return levels;
}

}  // namespace emit::physics
