// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/planck.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "emit/physics/numerics/gauss_rule.hpp"

namespace emit::physics {
namespace {

constexpr int kPoints = 16;

const GaussRule<kPoints>& gauss() noexcept {
  static const GaussRule<kPoints> rule = gauss_legendre<kPoints>();
  return rule;
}

// Terms this many e-folds below the leading one are far below double rounding.
constexpr double kTailExponents = 60.0;
// Widest panel in x; 16 points integrate x^3/(e^x-1) over it to rounding.
constexpr double kPanelWidth = 3.0;
constexpr double kMinSearchK = 2.0;
constexpr double kMaxSearchK = 50000.0;

// Factor of physics.md eq. 7, 2 k^4 / (h^3 c^2) = c1 / c2^4: L is this times T^4 int R x^3/(e^x-1)
// dx.
const double kRadianceScale = kRadianceC1WUm4PerM2Sr / (kC2UmK * kC2UmK * kC2UmK * kC2UmK);

struct Integrals {
  double value = 0.0;       // int R x^3/(e^x-1) dx, divided by e^-origin
  double derivative = 0.0;  // int R x^4 e^x/(e^x-1)^2 dx, divided by e^-origin
};

/// Adds the integrals over one stretch of the band in which the response is linear in wavelength.
void add_stretch(double lo_um, double hi_um, double response_lo, double response_hi,
                 double temperature_k, double origin, Integrals& sum) noexcept {
  const double x_end = std::min(kC2UmK / (lo_um * temperature_k), origin + kTailExponents);
  double x = kC2UmK / (hi_um * temperature_k);
  if (!(x < x_end)) {
    return;
  }
  // Split the stretch into equal panels and sum 16 points on each.
  const double slope = (response_hi - response_lo) / (hi_um - lo_um);
  const int panels = static_cast<int>(std::ceil((x_end - x) / kPanelWidth));
  const GaussRule<kPoints>& rule = gauss();
  const double half = 0.5 * (x_end - x) / panels;
  for (int panel = 0; panel < panels; ++panel) {
    const double middle = x + half * (2 * panel + 1);
    for (std::size_t i = 0; i < kPoints; ++i) {
      const double at = middle + half * rule.node[i];
      const double response = slope == 0.0
                                  ? response_lo
                                  : response_lo + slope * (kC2UmK / (at * temperature_k) - lo_um);
      const double decay = -std::expm1(-at);
      const double term =
          rule.weight[i] * half * response * at * at * at * std::exp(origin - at) / decay;
      sum.value += term;
      sum.derivative += term * at / decay;
    }
  }
}

/// Calls `visit(lo, hi, response_lo, response_hi)` for each stretch inside the band, wavelengths in
/// um.
template <class Visit>
void for_each_stretch(const Band& band, Visit visit) {
  if (band.response.empty()) {
    visit(band.lo_um, band.hi_um, 1.0, 1.0);
    return;
  }
  for (std::size_t i = 1; i < band.response.size(); ++i) {
    const ResponsePoint& a = band.response[i - 1];
    const ResponsePoint& b = band.response[i];
    const double lo = std::max(a.wavelength_um, band.lo_um);
    const double hi = std::min(b.wavelength_um, band.hi_um);
    if (!(lo < hi) || (a.response_frac <= 0.0 && b.response_frac <= 0.0)) {
      continue;
    }
    const double slope = (b.response_frac - a.response_frac) / (b.wavelength_um - a.wavelength_um);
    visit(lo, hi, a.response_frac + slope * (lo - a.wavelength_um),
          a.response_frac + slope * (hi - a.wavelength_um));
  }
}

}  // namespace

double response_frac(const Band& band, double wavelength_um) noexcept {
  if (!(wavelength_um >= band.lo_um) || wavelength_um > band.hi_um) return 0.0;
  const std::vector<ResponsePoint>& curve = band.response;
  if (curve.empty()) return 1.0;
  if (wavelength_um < curve.front().wavelength_um || wavelength_um > curve.back().wavelength_um) {
    return 0.0;
  }
  std::size_t i = 1;
  while (i + 1 < curve.size() && wavelength_um > curve[i].wavelength_um) ++i;
  const ResponsePoint& a = curve[i - 1];
  const ResponsePoint& b = curve[i];
  return a.response_frac + (wavelength_um - a.wavelength_um) / (b.wavelength_um - a.wavelength_um) *
                               (b.response_frac - a.response_frac);
}

Result<void> validate(const Band& band) {
  if (!(band.lo_um > 0.0) || !(band.hi_um > band.lo_um) || !(band.hi_um <= 1000.0)) {
    return make_error(ErrorCode::invalid_argument,
                      "band limits must satisfy 0 < lo < hi <= 1000 um, got " +
                          std::to_string(band.lo_um) + " and " + std::to_string(band.hi_um));
  }
  if (band.response.size() == 1) {
    return make_error(ErrorCode::invalid_argument, "a response table needs at least two points");
  }
  for (std::size_t i = 0; i < band.response.size(); ++i) {
    const ResponsePoint& point = band.response[i];
    const std::string which = "response point " + std::to_string(i + 1);
    if (!(point.response_frac >= 0.0) || !(point.response_frac <= 1.0)) {
      return make_error(ErrorCode::invalid_argument, which + ": response must lie in 0..1");
    }
    if (!(point.wavelength_um > (i == 0 ? 0.0 : band.response[i - 1].wavelength_um)) ||
        !std::isfinite(point.wavelength_um)) {
      return make_error(ErrorCode::invalid_argument, which + ": wavelengths must ascend");
    }
  }
  bool any = false;
  for_each_stretch(
      band, [&any](double, double, double lo, double hi) { any = any || lo > 0.0 || hi > 0.0; });
  if (!any) {
    return make_error(ErrorCode::invalid_argument, "the response is zero throughout the band");
  }
  return {};
}

BandRadiance band_radiance(const Band& band, Kelvin temperature) noexcept {
  const double t = temperature.value();
  if (std::isnan(t)) {
    return {t, t, t};
  }
  if (t <= 0.0) {
    return {0.0, 0.0, -std::numeric_limits<double>::infinity()};
  }
  // Factor out e^-origin, the size of the largest term: ln L then survives underflow.
  double longest_um = 0.0;
  for_each_stretch(band, [&longest_um](double, double hi, double, double) {
    longest_um = std::max(longest_um, hi);
  });
  const double origin = kC2UmK / (longest_um * t);
  Integrals sum;
  for_each_stretch(band, [&](double lo, double hi, double response_lo, double response_hi) {
    add_stretch(lo, hi, response_lo, response_hi, t, origin, sum);
  });
  // Multiply by the decay in two halves, so that a denormal result keeps the bits it can.
  const double half_decay = std::exp(-0.5 * origin);
  const double t3 = t * t * t;
  BandRadiance result;
  result.radiance_w_m2_sr = half_decay * (kRadianceScale * t3 * t * sum.value) * half_decay;
  result.derivative_w_m2_sr_k = half_decay * (kRadianceScale * t3 * sum.derivative) * half_decay;
  result.log_radiance = std::log(kRadianceScale * t3 * t * sum.value) - origin;
  return result;
}

SpectralRadiance spectral_radiance(Micrometres wavelength, Kelvin temperature) noexcept {
  const double l = wavelength.value();
  const double l2 = l * l;
  return SpectralRadiance(kRadianceC1WUm4PerM2Sr /
                          (l2 * l2 * l * std::expm1(kC2UmK / (l * temperature.value()))));
}

std::optional<Kelvin> brightness_temperature(const Band& band, Radiance radiance) noexcept {
  const double wanted = radiance.value();
  if (!(wanted > 0.0) || !std::isfinite(wanted)) {
    return std::nullopt;
  }
  const double target = std::log(wanted);
  double low = kMinSearchK;
  double high = kMaxSearchK;
  if (target < band_radiance(band, Kelvin(low)).log_radiance ||
      target > band_radiance(band, Kelvin(high)).log_radiance) {
    return std::nullopt;
  }
  // Search by Newton over 1/T, where ln L is nearly straight, and keep inside the shrinking
  // bracket.
  double t = 300.0;
  for (int i = 0; i < 100; ++i) {
    const BandRadiance at = band_radiance(band, Kelvin(t));
    const double miss = at.log_radiance - target;
    (miss < 0.0 ? low : high) = t;
    // The slope is d ln L / d(1/T) = -T^2 L'/L. Bisect if L is too small for the ratio.
    double next = 0.5 * (low + high);
    if (at.radiance_w_m2_sr > 1e-290) {
      const double slope = t * t * at.derivative_w_m2_sr_k / at.radiance_w_m2_sr;
      const double candidate = 1.0 / (1.0 / t + miss / slope);
      if (candidate > low && candidate < high) {
        next = candidate;
      } else if (std::abs(candidate - t) <= 4e-16 * t) {
        break;
      }
    }
    const double moved = std::abs(next - t);
    t = next;
    if (moved <= 2e-15 * t) {
      break;
    }
  }
  return Kelvin(t);
}

}  // namespace emit::physics
