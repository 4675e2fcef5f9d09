// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/sky/mie.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "emit/physics/check.hpp"

namespace emit::physics {

MieEfficiencies mie_efficiencies(double size_parameter, double refractive_index,
                                 double extinction_index) {
  EMIT_DCHECK(size_parameter > 0.0 && refractive_index > 0.0 && extinction_index >= 0.0);
  using Complex = std::complex<double>;
  const double x = size_parameter;
  const Complex index(refractive_index, -extinction_index);
  const Complex inside = index * x;
  const auto terms = static_cast<std::size_t>(x + 4.05 * std::cbrt(x) + 2.0);
  // The downward recurrence forgets its start beyond |m x|, within some cube roots of that.
  const double size_inside = std::abs(inside);
  const auto first = static_cast<std::size_t>(std::max(static_cast<double>(terms), size_inside) +
                                              8.0 * std::cbrt(size_inside) + 16.0);
  std::vector<Complex> derivative(first + 1);
  for (std::size_t n = first; n > 0; --n) {
    const Complex step = static_cast<double>(n) / inside;
    derivative[n - 1] = step - 1.0 / (derivative[n] + step);
  }
  // Run psi and chi upwards; xi = psi + i chi goes with the time factor of n - i k.
  double psi_before = std::cos(x);
  double psi = std::sin(x);
  double chi_before = -std::sin(x);
  double chi = std::cos(x);
  MieEfficiencies out;
  Complex a_before;
  Complex b_before;
  for (std::size_t i = 1; i <= terms; ++i) {
    const auto n = static_cast<double>(i);
    const double psi_next = (2.0 * n - 1.0) / x * psi - psi_before;
    const double chi_next = (2.0 * n - 1.0) / x * chi - chi_before;
    psi_before = psi;
    psi = psi_next;
    chi_before = chi;
    chi = chi_next;
    const Complex xi(psi, chi);
    const Complex xi_before(psi_before, chi_before);
    const Complex of_a = derivative[i] / index + n / x;
    const Complex of_b = derivative[i] * index + n / x;
    const Complex a = (of_a * psi - psi_before) / (of_a * xi - xi_before);
    const Complex b = (of_b * psi - psi_before) / (of_b * xi - xi_before);
    out.extinction += (2.0 * n + 1.0) * (a + b).real();
    out.scattering += (2.0 * n + 1.0) * (std::norm(a) + std::norm(b));
    out.asymmetry += (2.0 * n + 1.0) / (n * (n + 1.0)) * (a * std::conj(b)).real();
    if (i > 1) {
      out.asymmetry +=
          (n - 1.0) * (n + 1.0) / n * (a_before * std::conj(a) + b_before * std::conj(b)).real();
    }
    a_before = a;
    b_before = b;
  }
  out.asymmetry *= 2.0 / out.scattering;
  out.extinction *= 2.0 / (x * x);
  out.scattering *= 2.0 / (x * x);
  return out;
}

}  // namespace emit::physics
