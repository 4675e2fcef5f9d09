// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/nnls.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "emit/physics/check.hpp"

namespace emit::physics {
namespace {

/// Solves the least squares problem without constraints over the columns in `active`, by modified
/// Gram-Schmidt with one re-orthogonalisation. A column that depends on earlier ones gets zero.
std::vector<double> least_squares(std::span<const double> matrix, std::span<const double> rhs,
                                  std::size_t columns, const std::vector<std::size_t>& active) {
  const std::size_t rows = rhs.size();
  const std::size_t count = active.size();
  std::vector<std::vector<double>> q(count, std::vector<double>(rows));
  std::vector<double> r(count * count, 0.0);
  std::vector<bool> dependent(count, false);
  for (std::size_t j = 0; j < count; ++j) {
    double norm_before = 0.0;
    for (std::size_t i = 0; i < rows; ++i) {
      q[j][i] = matrix[i * columns + active[j]];
      norm_before += q[j][i] * q[j][i];
    }
    // Remove the components along the earlier columns; the second pass removes what rounding left.
    for (int pass = 0; pass < 2; ++pass) {
      for (std::size_t k = 0; k < j; ++k) {
        if (dependent[k]) continue;
        double dot = 0.0;
        for (std::size_t i = 0; i < rows; ++i) dot += q[k][i] * q[j][i];
        r[k * count + j] += dot;
        for (std::size_t i = 0; i < rows; ++i) q[j][i] -= dot * q[k][i];
      }
    }
    double norm = 0.0;
    for (const double value : q[j]) norm += value * value;
    norm = std::sqrt(norm);
    if (!(norm > 1e-13 * std::sqrt(norm_before))) {
      dependent[j] = true;
      continue;
    }
    r[j * count + j] = norm;
    for (double& value : q[j]) value /= norm;
  }
  // Solve the triangular system R x = Q^T b from the last row up.
  std::vector<double> x(count, 0.0);
  for (std::size_t j = count; j-- > 0;) {
    if (dependent[j]) continue;
    double value = 0.0;
    for (std::size_t i = 0; i < rows; ++i) value += q[j][i] * rhs[i];
    for (std::size_t k = j + 1; k < count; ++k) value -= r[j * count + k] * x[k];
    x[j] = value / r[j * count + j];
  }
  return x;
}

}  // namespace

std::vector<double> solve_nnls(std::span<const double> matrix, std::span<const double> rhs,
                               std::size_t columns) {
  EMIT_CHECK_OP(matrix.size(), ==, rhs.size() * columns);
  const std::size_t rows = rhs.size();
  std::vector<double> x(columns, 0.0);
  std::vector<bool> tried(columns, false);
  std::vector<std::size_t> active;
  std::vector<double> residual(rhs.begin(), rhs.end());
  double scale = 0.0;
  for (const double value : rhs) scale = std::max(scale, std::abs(value));

  for (std::size_t round = 0; round < 3 * columns + 3; ++round) {
    // Choose the column that lowers the residual most, relative to its own length.
    double best = 1e-12 * scale;
    std::size_t entering = columns;
    for (std::size_t j = 0; j < columns; ++j) {
      if (tried[j] || std::find(active.begin(), active.end(), j) != active.end()) continue;
      double gradient = 0.0;
      double norm = 0.0;
      for (std::size_t i = 0; i < rows; ++i) {
        gradient += matrix[i * columns + j] * residual[i];
        norm += matrix[i * columns + j] * matrix[i * columns + j];
      }
      gradient /= std::sqrt(std::max(norm, std::numeric_limits<double>::min()));
      if (gradient > best) {
        best = gradient;
        entering = j;
      }
    }
    if (entering == columns) break;
    active.push_back(entering);

    // Solve over the active columns until all their values are positive.
    while (!active.empty()) {
      const std::vector<double> candidate = least_squares(matrix, rhs, columns, active);
      if (candidate.back() <= 0.0 && active.back() == entering && x[entering] == 0.0) {
        // This column was chosen by rounding alone and does not help. Do not try it again.
        active.pop_back();
        tried[entering] = true;
        break;
      }
      // Move towards the candidate as far as all values stay non-negative.
      double step = 1.0;
      for (std::size_t k = 0; k < active.size(); ++k) {
        if (candidate[k] <= 0.0) {
          const double from = x[active[k]];
          step = std::min(step, from / (from - candidate[k]));
        }
      }
      for (std::size_t k = 0; k < active.size(); ++k) {
        x[active[k]] += step * (candidate[k] - x[active[k]]);
      }
      if (step >= 1.0) {
        std::fill(tried.begin(), tried.end(), false);
        break;
      }
      // Release the columns that have reached zero.
      std::erase_if(active, [&](std::size_t j) {
        if (x[j] > 1e-15 * scale) return false;
        x[j] = 0.0;
        return true;
      });
    }
    // Update the residual.
    for (std::size_t i = 0; i < rows; ++i) {
      residual[i] = rhs[i];
      for (const std::size_t j : active) residual[i] -= matrix[i * columns + j] * x[j];
    }
  }
  return x;
}

}  // namespace emit::physics
