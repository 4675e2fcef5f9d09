// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <glm/ext/vector_double3.hpp>
#include <span>

namespace emit::server {

/// A vector at an instant.
struct FitSample {
  double time_s = 0.0;
  glm::dvec3 value{0.0};
};

/// Returns the value and the first three derivatives at `at_s` of the polynomial that lies closest
/// to the samples in the least-squares sense. The polynomial is a sum of polynomials that are
/// orthogonal over the samples (Forsythe, J. SIAM 5, 1957), which needs no matrix and does not lose
/// digits. Fewer samples than degree + 1 lower the degree.
/// @pre there is a sample; the times ascend; degree is 0 to 6
[[nodiscard]] std::array<glm::dvec3, 4> fit_at(std::span<const FitSample> samples,
                                               std::size_t degree, double at_s);

}  // namespace emit::server
