// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/surface/optical_constants.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "emit/physics/check.hpp"

namespace emit::physics {
namespace {

/// G. M. Hale and M. R. Querry, Optical constants of water in the 200-nm to 200-um wavelength
/// region, Appl. Opt. 12, 555-563, 1973.
constexpr std::array<OpticalConstants, 112> kWater{{
    {2, 1.306, 0.0011},    {2.2, 1.296, 0.000289}, {2.4, 1.279, 0.000956}, {2.6, 1.242, 0.00317},
    {2.65, 1.219, 0.0067}, {2.7, 1.188, 0.019},    {2.75, 1.157, 0.059},   {2.8, 1.142, 0.115},
    {2.85, 1.149, 0.185},  {2.9, 1.201, 0.268},    {2.95, 1.292, 0.298},   {3, 1.371, 0.272},
    {3.05, 1.426, 0.24},   {3.1, 1.467, 0.192},    {3.15, 1.483, 0.135},   {3.2, 1.478, 0.0924},
    {3.25, 1.467, 0.061},  {3.3, 1.45, 0.0368},    {3.35, 1.432, 0.0261},  {3.4, 1.42, 0.0195},
    {3.45, 1.41, 0.0132},  {3.5, 1.4, 0.0094},     {3.6, 1.385, 0.00515},  {3.7, 1.374, 0.0036},
    {3.8, 1.364, 0.0034},  {3.9, 1.357, 0.0038},   {4, 1.351, 0.0046},     {4.1, 1.346, 0.00562},
    {4.2, 1.342, 0.00688}, {4.3, 1.338, 0.00845},  {4.4, 1.334, 0.0103},   {4.5, 1.332, 0.0134},
    {4.6, 1.33, 0.0147},   {4.7, 1.33, 0.0157},    {4.8, 1.33, 0.015},     {4.9, 1.328, 0.0137},
    {5, 1.325, 0.0124},    {5.1, 1.322, 0.0111},   {5.2, 1.317, 0.0101},   {5.3, 1.312, 0.0098},
    {5.4, 1.305, 0.0103},  {5.5, 1.298, 0.0116},   {5.6, 1.289, 0.0142},   {5.7, 1.277, 0.0203},
    {5.8, 1.262, 0.033},   {5.9, 1.248, 0.0622},   {6, 1.265, 0.107},      {6.1, 1.319, 0.131},
    {6.2, 1.363, 0.088},   {6.3, 1.357, 0.057},    {6.4, 1.347, 0.0449},   {6.5, 1.339, 0.0392},
    {6.6, 1.334, 0.0356},  {6.7, 1.329, 0.0337},   {6.8, 1.324, 0.0327},   {6.9, 1.321, 0.0322},
    {7, 1.317, 0.032},     {7.2, 1.312, 0.0321},   {7.4, 1.307, 0.0324},   {7.6, 1.302, 0.0328},
    {7.8, 1.297, 0.0335},  {8, 1.291, 0.0343},     {8.2, 1.286, 0.0351},   {8.4, 1.281, 0.0361},
    {8.6, 1.275, 0.0372},  {8.8, 1.269, 0.0385},   {9, 1.262, 0.0399},     {9.2, 1.255, 0.0415},
    {9.4, 1.247, 0.0433},  {9.6, 1.239, 0.0454},   {9.8, 1.229, 0.0479},   {10, 1.218, 0.0508},
    {10.5, 1.185, 0.0662}, {11, 1.153, 0.0968},    {11.5, 1.126, 0.142},   {12, 1.111, 0.199},
    {12.5, 1.123, 0.259},  {13, 1.146, 0.305},     {13.5, 1.177, 0.343},   {14, 1.21, 0.37},
    {14.5, 1.241, 0.388},  {15, 1.27, 0.402},      {15.5, 1.297, 0.414},   {16, 1.325, 0.422},
    {16.5, 1.351, 0.428},  {17, 1.376, 0.429},     {17.5, 1.401, 0.429},   {18, 1.423, 0.426},
    {18.5, 1.443, 0.421},  {19, 1.461, 0.414},     {19.5, 1.476, 0.404},   {20, 1.48, 0.393},
    {21, 1.487, 0.382},    {22, 1.5, 0.373},       {23, 1.511, 0.367},     {24, 1.521, 0.361},
    {25, 1.531, 0.356},    {26, 1.539, 0.35},      {27, 1.545, 0.344},     {28, 1.549, 0.338},
    {29, 1.551, 0.333},    {30, 1.551, 0.328},     {32, 1.546, 0.324},     {34, 1.536, 0.329},
    {36, 1.527, 0.343},    {38, 1.522, 0.361},     {40, 1.519, 0.385},     {42, 1.522, 0.409},
    {44, 1.53, 0.436},     {46, 1.541, 0.462},     {48, 1.555, 0.488},     {50, 1.587, 0.514},
}};

/// M. Rubin, Optical properties of soda lime silica glasses, Solar Energy Materials 12, 275-288,
/// 1985: the formula for n and the table of k of clear glass to 4.6 um, the infrared table beyond.
constexpr std::array<OpticalConstants, 56> kWindowGlass{{
    {2, 1.5013, 4.423e-06},   {2.5, 1.4938, 6.324e-06}, {2.7, 1.4904, 1.02e-05},
    {2.8, 1.4887, 6.495e-05}, {3, 1.4849, 7.432e-05},   {3.5, 1.4745, 0.0001065},
    {4, 1.4625, 0.000106},    {4.2, 1.4573, 0.0001435}, {4.4, 1.4519, 0.0002247},
    {4.6, 1.4461, 0.0007437}, {5, 1.397, 0.003},        {6, 1.323, 0.005},
    {7, 1.152, 0.008},        {8, 0.939, 0.028},        {8.2, 0.822, 0.061},
    {8.4, 0.624, 0.216},      {8.5, 0.613, 0.354},      {8.7, 0.684, 0.543},
    {9, 0.736, 0.759},        {9.2, 0.812, 0.938},      {9.4, 0.971, 1.123},
    {9.5, 1.085, 1.187},      {9.6, 1.209, 1.232},      {9.8, 1.479, 1.24},
    {10, 1.707, 1.123},       {10.5, 1.956, 0.809},     {11, 1.994, 0.485},
    {11.5, 1.864, 0.286},     {12, 1.733, 0.222},       {12.5, 1.612, 0.244},
    {13, 1.606, 0.306},       {13.5, 1.615, 0.304},     {14, 1.615, 0.28},
    {14.5, 1.558, 0.269},     {15, 1.554, 0.299},       {15.5, 1.546, 0.288},
    {16, 1.511, 0.278},       {16.5, 1.468, 0.288},     {17, 1.433, 0.309},
    {17.5, 1.401, 0.322},     {18, 1.328, 0.329},       {18.5, 1.216, 0.382},
    {19, 1.108, 0.521},       {19.5, 1.069, 0.76},      {20, 1.177, 0.966},
    {21, 1.519, 1.223},       {22, 1.931, 1.216},       {23, 2.196, 0.988},
    {24, 2.263, 0.746},       {25, 2.223, 0.582},       {27, 2.139, 0.462},
    {30, 2.035, 0.381},       {35, 1.96, 0.421},        {40, 1.969, 0.487},
    {45, 2.033, 0.538},       {50, 2.099, 0.545},
}};

}  // namespace

std::span<const OpticalConstants> optical_constants(IndexTable table) noexcept {
  switch (table) {
    case IndexTable::water:
      return kWater;
    case IndexTable::window_glass:
      return kWindowGlass;
    case IndexTable::none:
      break;
  }
  return {};
}

Result<void> validate(std::span<const OpticalConstants> table) {
  const auto fail = [](std::string text) {
    return make_error(ErrorCode::invalid_argument, std::move(text));
  };
  if (table.empty()) return fail("the table of optical constants has no entry");
  for (std::size_t i = 0; i < table.size(); ++i) {
    const OpticalConstants& entry = table[i];
    if (!(entry.wavelength_um > (i == 0 ? 0.0 : table[i - 1].wavelength_um))) {
      return fail(fmt::format("wavelength {} of the optical constants does not ascend", i + 1));
    }
    if (!(entry.refractive_index > 0.0)) {
      return fail(fmt::format("refractive index {} is not above 0", i + 1));
    }
    if (!(entry.extinction_index >= 0.0)) {
      return fail(fmt::format("extinction index {} is below 0", i + 1));
    }
  }
  return {};
}

OpticalConstants constants_at(std::span<const OpticalConstants> table,
                              double wavelength_um) noexcept {
  EMIT_DCHECK(!table.empty());
  const auto after =
      std::ranges::lower_bound(table, wavelength_um, {}, &OpticalConstants::wavelength_um);
  if (after == table.begin()) return table.front();
  if (after == table.end()) return table.back();
  const OpticalConstants& low = *(after - 1);
  const double share =
      (wavelength_um - low.wavelength_um) / (after->wavelength_um - low.wavelength_um);
  return {wavelength_um, std::lerp(low.refractive_index, after->refractive_index, share),
          std::lerp(low.extinction_index, after->extinction_index, share)};
}

double fresnel_reflectance_frac(double refractive_index, double extinction_index,
                                double cosine) noexcept {
  const double c = std::clamp(cosine, 0.0, 1.0);
  const double sine2 = 1.0 - c * c;
  // a and b are the real and the imaginary part of the root of (n - i k)^2 - sin^2.
  const double real =
      refractive_index * refractive_index - extinction_index * extinction_index - sine2;
  const double length = std::hypot(real, 2.0 * refractive_index * extinction_index);
  const double a = std::sqrt(std::max(0.0, 0.5 * (length + real)));
  const double across = (length + c * c - 2.0 * a * c) / (length + c * c + 2.0 * a * c);
  const double tilted = length * c * c + sine2 * sine2;
  const double step = 2.0 * a * c * sine2;
  // The ratio is that of its limit at grazing incidence.
  const double ratio = tilted + step > 0.0 ? (tilted - step) / (tilted + step) : 1.0;
  return 0.5 * across * (1.0 + ratio);
}

double band_reflectance_frac(std::span<const OpticalConstants> table, const Band& band,
                             Kelvin source, double cosine) noexcept {
  constexpr int kPoints = 128;
  double sum = 0.0;
  double weights = 0.0;
  for (int i = 0; i < kPoints; ++i) {
    const double um = band.lo_um + (band.hi_um - band.lo_um) * (i + 0.5) / kPoints;
    const double weight =
        response_frac(band, um) * spectral_radiance(Micrometres(um), source).value();
    const OpticalConstants at = constants_at(table, um);
    sum += weight * fresnel_reflectance_frac(at.refractive_index, at.extinction_index, cosine);
    weights += weight;
  }
  return weights > 0.0 ? sum / weights : 0.0;
}

}  // namespace emit::physics
