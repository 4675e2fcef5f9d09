// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/conduction_column.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace emit::physics {
namespace {

using Vector = FosterState<double>;
using Matrix = ColumnModes::Matrix;

/// Slices of a layer over which integrals over depth are summed.
constexpr std::size_t kSlices = 24;
/// Share that a lump keeps where another face owns its material.
constexpr double kLeastShare = 1.0 / 64.0;
/// Rounds of Jacobi rotations. Four unknowns are diagonal to rounding after six of them.
constexpr int kRounds = 30;

double dot(const Vector& a, const Vector& b, std::size_t count) noexcept {
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) sum += a[i] * b[i];
  return sum;
}

/// Diagonalises a symmetric matrix in place by Jacobi rotations. Columns of `vectors` are the
/// eigenvectors. They keep small eigenvalues of positive definite matrices to relative accuracy.
void diagonalise(Matrix& a, Matrix& vectors, std::size_t count) noexcept {
  for (std::size_t i = 0; i < count; ++i) {
    vectors[i].fill(0.0);
    vectors[i][i] = 1.0;
  }
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t p = 0; p + 1 < count; ++p) {
      for (std::size_t q = p + 1; q < count; ++q) {
        if (std::abs(a[p][q]) <= 1e-18 * std::sqrt(std::abs(a[p][p] * a[q][q]))) continue;
        const double theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
        const double t =
            std::copysign(1.0, theta) / (std::abs(theta) + std::sqrt(theta * theta + 1.0));
        const double c = 1.0 / std::sqrt(t * t + 1.0);
        const double s = t * c;
        for (std::size_t k = 0; k < count; ++k) {
          const double x = a[k][p];
          const double y = a[k][q];
          a[k][p] = c * x - s * y;
          a[k][q] = s * x + c * y;
        }
        for (std::size_t k = 0; k < count; ++k) {
          const double x = a[p][k];
          const double y = a[q][k];
          a[p][k] = c * x - s * y;
          a[q][k] = s * x + c * y;
        }
        for (std::size_t k = 0; k < count; ++k) {
          const double x = vectors[k][p];
          const double y = vectors[k][q];
          vectors[k][p] = c * x - s * y;
          vectors[k][q] = s * x + c * y;
        }
      }
    }
  }
}

/// Calls visit(depth_m, sideways_w_k, shares) for thin slices of a stack, from the surface inwards.
/// `shares` are the hat functions of the lumps there.
template <class Visit>
void each_slice(std::span<const StackLayer> layers, const ConductionColumn& column,
                const Visit& visit) {
  // Find the resistance of each lump from the surface, scaled to that of the layers.
  Vector at{};
  double total = 0.0;
  for (std::size_t l = 0; l < column.count; ++l) {
    at[l] = total;
    total += 1.0 / column.conductance_w_m2_k[l];
  }
  double of_layers = 0.0;
  for (const StackLayer& layer : layers) of_layers += layer.thickness_m / layer.conductivity_w_m_k;
  const double scale = total / of_layers;
  double depth_m = 0.0;
  double resistance = 0.0;
  for (const StackLayer& layer : layers) {
    const double step_m = layer.thickness_m / kSlices;
    for (std::size_t k = 0; k < kSlices; ++k) {
      const double here = resistance + scale * 0.5 * step_m / layer.conductivity_w_m_k;
      Vector shares{};
      for (std::size_t l = 0; l < column.count; ++l) {
        const double next = l + 1 < column.count ? at[l + 1] : total;
        if (here < at[l] || here > next) continue;
        const double on = (here - at[l]) / (next - at[l]);
        shares[l] = 1.0 - on;
        if (l + 1 < column.count) shares[l + 1] = on;
        break;
      }
      visit(depth_m + 0.5 * step_m, layer.conductivity_w_m_k * step_m, shares);
      depth_m += step_m;
      resistance += scale * step_m / layer.conductivity_w_m_k;
    }
  }
}

}  // namespace

ConductionColumn column_of_network(const FosterNetwork& network) noexcept {
  ConductionColumn column;
  const std::size_t count = network.count;
  if (count == 0) return column;
  // Start with the drive of the modes, in coordinates in which their matrix is diag(1 / tau_i).
  std::array<Vector, kMaxFosterModes> q{};
  double drive = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const NetworkMode& mode = network.modes[i];
    q[0][i] = std::sqrt(mode.resistance_m2k_w / mode.tau_s);
    drive += mode.resistance_m2k_w / mode.tau_s;
  }
  for (double& value : q[0]) value /= std::sqrt(drive);
  column.heat_j_m2_k[0] = 1.0 / drive;
  double above = 0.0;  // conductance to the lump above
  for (std::size_t l = 0; l < count; ++l) {
    Vector next{};
    for (std::size_t i = 0; i < count; ++i) next[i] = q[l][i] / network.modes[i].tau_s;
    const double diagonal_per_s = dot(q[l], next, count);
    // Orthogonalise twice against all before, which rounding would need once in a thousand.
    for (int pass = 0; pass < 2; ++pass) {
      for (std::size_t k = 0; k <= l; ++k) {
        const double on = dot(q[k], next, count);
        for (std::size_t i = 0; i < count; ++i) next[i] -= on * q[k][i];
      }
    }
    const double heat = column.heat_j_m2_k[l];
    const double below = diagonal_per_s * heat - above;
    const double length_per_s = std::sqrt(dot(next, next, count));
    column.count = l + 1;
    column.conductance_w_m2_k[l] = std::max(below, std::numeric_limits<double>::min());
    if (l + 1 == count || !(below > 1e-12 * diagonal_per_s * heat) ||
        !(length_per_s > 1e-12 * diagonal_per_s)) {
      break;
    }
    // The off-diagonal entry of C^-1/2 G C^-1/2 gives the next heat capacity.
    column.heat_j_m2_k[l + 1] = below * below / (length_per_s * length_per_s * heat);
    for (std::size_t i = 0; i < count; ++i) q[l + 1][i] = -next[i] / length_per_s;
    above = below;
  }
  return column;
}

ColumnModes modes_of_column(const ConductionColumn& column) noexcept {
  ColumnModes out;
  const std::size_t count = column.count;
  if (count == 0) return out;
  const Vector& heat = column.heat_j_m2_k;
  const Vector& g = column.conductance_w_m2_k;
  Matrix matrix{};
  for (std::size_t l = 0; l < count; ++l) {
    matrix[l][l] = ((l > 0 ? g[l - 1] : 0.0) + g[l]) / heat[l];
    if (l + 1 == count) break;
    matrix[l][l + 1] = matrix[l + 1][l] = -g[l] / std::sqrt(heat[l] * heat[l + 1]);
  }
  Matrix vectors{};
  diagonalise(matrix, vectors, count);
  std::array<std::size_t, kMaxFosterModes> order{};
  std::iota(order.begin(), order.begin() + count, std::size_t{0});
  std::sort(order.begin(), order.begin() + count,
            [&](std::size_t a, std::size_t b) { return matrix[a][a] > matrix[b][b]; });
  out.network.count = count;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t from = order[i];
    const double rate_per_s = matrix[from][from];
    // A mode that the surface hardly moves has a tiny resistance, and the lumps hold its multiples.
    const double least = 1e-12;
    double on_surface = vectors[0][from];
    if (std::abs(on_surface) < least) on_surface = std::copysign(least, on_surface);
    out.network.modes[i] = {1.0 / rate_per_s, on_surface * on_surface / (heat[0] * rate_per_s)};
    for (std::size_t l = 0; l < count; ++l) {
      out.lump_from_mode[l][i] = vectors[l][from] / on_surface * std::sqrt(heat[0] / heat[l]);
      out.mode_from_lump[i][l] = vectors[l][from] * on_surface * std::sqrt(heat[l] / heat[0]);
    }
    out.base_shares[i] = on_surface * vectors[count - 1][from] * g[count - 1] /
                         (std::sqrt(heat[0] * heat[count - 1]) * rate_per_s);
  }
  return out;
}

ColumnDepths depths_of_column(std::span<const StackLayer> layers, const ConductionColumn& column) {
  ColumnDepths out;
  each_slice(layers, column, [&](double depth_m, double sideways_w_k, const Vector& shares) {
    for (std::size_t l = 0; l < column.count; ++l) {
      out.sideways_w_k[l] += shares[l] * sideways_w_k;
      out.depth_m[l] += shares[l] * sideways_w_k * depth_m;
    }
  });
  for (std::size_t l = 0; l < column.count; ++l) {
    if (out.sideways_w_k[l] > 0.0) out.depth_m[l] /= out.sideways_w_k[l];
  }
  return out;
}

FosterState<double> ColumnDepths::above(std::span<const StackLayer> layers,
                                        const ConductionColumn& column, double cut_m) const {
  FosterState<double> out{};
  each_slice(layers, column, [&](double at_m, double slice_w_k, const Vector& shares) {
    if (at_m > cut_m) return;
    for (std::size_t l = 0; l < column.count; ++l) out[l] += shares[l] * slice_w_k;
  });
  for (std::size_t l = 0; l < column.count; ++l) {
    out[l] = sideways_w_k[l] > 0.0 ? out[l] / sideways_w_k[l] : 0.0;
  }
  return out;
}

ConductionColumn cut_column(std::span<const StackLayer> layers, const ConductionColumn& column,
                            double cut_m) {
  const ColumnDepths depths = depths_of_column(layers, column);
  FosterState<double> share = depths.above(layers, column, cut_m);
  for (double& each : share) each = std::max(each, kLeastShare);
  double depth_m = 0.0;
  for (const StackLayer& layer : layers) depth_m += layer.thickness_m;
  ConductionColumn out = column;
  for (std::size_t l = 0; l < column.count; ++l) {
    const double below =
        l + 1 < column.count ? share[l + 1] : (cut_m < depth_m ? kLeastShare : 1.0);
    out.heat_j_m2_k[l] *= share[l];
    out.conductance_w_m2_k[l] *= std::sqrt(share[l] * below);
  }
  return out;
}

}  // namespace emit::physics
