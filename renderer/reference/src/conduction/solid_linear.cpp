// SPDX-License-Identifier: Apache-2.0
#include "solid_linear.hpp"
#include "emit/threads/parallel.hpp"

#include <tbb/blocked_range.h>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>

namespace emit::reference {
namespace {

/// Number of nodes of a block. It is large enough that the couplings dropped between blocks hardly
/// matter, and small enough to feed a handful of threads.
constexpr std::size_t kBlockNodes = 32768;
constexpr std::size_t kMaxBlocks = 256;
constexpr int kMaxIterations = 2000;
/// Largest numbers of nodes for which a direct factor is the preconditioner, in a plane and in a
/// solid. They were chosen by judgement, not by a benchmark.
constexpr std::size_t kDirectPlane = 40000;
constexpr std::size_t kDirectSolid = 3000;

/// Calls body(block) for every block, in parallel.
template <class Body>
void for_blocks(std::size_t blocks, const Body& body) {
  threads::parallel_ranges(
      tbb::blocked_range<std::size_t>(0, blocks, 1),
      [&](const auto& range) {
        for (std::size_t block = range.begin(); block != range.end(); ++block) body(block);
      },
      tbb::simple_partitioner());
}

}  // namespace

/// Sparse direct factor of the whole matrix.
struct SolidLinear::Direct {
  Eigen::SparseMatrix<double> matrix;  // only the lower triangle
  std::vector<Eigen::Index> diagonal;  // places of the diagonal entries in matrix.valuePtr()
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> factor;
};

SolidLinear::SolidLinear(const SolidMesh& mesh, LinearSolver kind) : mesh_(&mesh) {
  const std::size_t n = mesh.free_count;
  blocks_ = std::clamp<std::size_t>(n / kBlockNodes, 1, kMaxBlocks);
  for (auto* vector : {&residual_, &preconditioned_, &direction_, &product_}) vector->resize(n);
  partial_.resize(blocks_);
  // Choose the preconditioner by the size of the problem.
  if (kind == LinearSolver::automatic) {
    kind = n <= (mesh.plane ? kDirectPlane : kDirectSolid) ? LinearSolver::ldlt : LinearSolver::cg;
  }
  if (kind == LinearSolver::cg) {
    inverse_pivot_.resize(n);
    return;
  }
  // Fill the lower triangle and analyse its pattern once. Only the diagonal changes later.
  direct_ = std::make_unique<Direct>();
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(4 * n);
  for (std::size_t row = 0; row < n; ++row) {
    const auto r = static_cast<int>(row);
    entries.emplace_back(r, r, mesh.conductance_sum_w_k[row]);
    for (std::uint32_t at = mesh.row_start[row]; at < mesh.upper_start[row]; ++at) {
      entries.emplace_back(r, static_cast<int>(mesh.columns[at]), -mesh.conductance_w_k[at]);
    }
  }
  direct_->matrix.resize(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(n));
  direct_->matrix.setFromTriplets(entries.begin(), entries.end());
  // Note the place of the diagonal: it comes first in each column of a lower triangle.
  for (std::size_t row = 0; row < n; ++row) {
    direct_->diagonal.push_back(direct_->matrix.outerIndexPtr()[row]);
  }
  direct_->factor.analyzePattern(direct_->matrix);
}

SolidLinear::~SolidLinear() = default;
SolidLinear::SolidLinear(SolidLinear&&) noexcept = default;
SolidLinear& SolidLinear::operator=(SolidLinear&&) noexcept = default;

std::size_t SolidLinear::block_begin(std::size_t block) const noexcept {
  return block * mesh_->free_count / blocks_;
}

bool SolidLinear::factorise(std::span<const double> shift) {
  const SolidMesh& mesh = *mesh_;
  if (direct_) {
    for (std::size_t i = 0; i < mesh.free_count; ++i) {
      direct_->matrix.valuePtr()[direct_->diagonal[i]] = mesh.conductance_sum_w_k[i] + shift[i];
    }
    direct_->factor.factorize(direct_->matrix);
    return direct_->factor.info() == Eigen::Success;
  }
  // Factorise each block without fill. A grid has no triangles of links, so only the pivots differ
  // from the matrix.
  std::vector<char> good(blocks_, 1);
  for_blocks(blocks_, [&](std::size_t block) {
    const std::size_t begin = block_begin(block);
    const std::size_t end = block_begin(block + 1);
    for (std::size_t i = begin; i < end; ++i) {
      double pivot = mesh.conductance_sum_w_k[i] + shift[i];
      for (std::uint32_t at = mesh.row_start[i]; at < mesh.upper_start[i]; ++at) {
        // Drop couplings to other blocks.
        if (mesh.columns[at] < begin) continue;
        const double g = mesh.conductance_w_k[at];
        pivot -= g * g * inverse_pivot_[mesh.columns[at]];
      }
      if (!(pivot > 0.0)) good[block] = 0;
      inverse_pivot_[i] = 1.0 / pivot;
    }
  });
  return std::find(good.begin(), good.end(), 0) == good.end();
}

SolidLinear::Sums SolidLinear::precondition() {
  const SolidMesh& mesh = *mesh_;
  if (direct_) {
    const auto n = static_cast<Eigen::Index>(mesh.free_count);
    const Eigen::Map<const Eigen::VectorXd> r(residual_.data(), n);
    Eigen::Map<Eigen::VectorXd> z(preconditioned_.data(), n);
    z = direct_->factor.solve(r);
    return {r.dot(z), z.lpNorm<Eigen::Infinity>()};
  }
  // Solve both triangles of each block, and sum the product and the greatest value on the way.
  for_blocks(blocks_, [&](std::size_t block) {
    const std::size_t begin = block_begin(block);
    const std::size_t end = block_begin(block + 1);
    double* z = preconditioned_.data();
    // Substitute forward.
    for (std::size_t i = begin; i < end; ++i) {
      double sum = residual_[i];
      for (std::uint32_t at = mesh.row_start[i]; at < mesh.upper_start[i]; ++at) {
        const std::uint32_t column = mesh.columns[at];
        if (column >= begin) sum += mesh.conductance_w_k[at] * z[column];
      }
      z[i] = sum * inverse_pivot_[i];
    }
    // Substitute backward.
    Sums sums;
    for (std::size_t i = end; i-- > begin;) {
      double sum = 0.0;
      for (std::uint32_t at = mesh.upper_start[i]; at < mesh.row_start[i + 1]; ++at) {
        const std::uint32_t column = mesh.columns[at];
        if (column < end) sum += mesh.conductance_w_k[at] * z[column];
      }
      z[i] += sum * inverse_pivot_[i];
      sums.dot += residual_[i] * z[i];
      sums.greatest = std::max(sums.greatest, std::abs(z[i]));
    }
    partial_[block] = sums;
  });
  // Add the sums in the order of the blocks, so that the result does not depend on the threads.
  Sums total;
  for (const Sums& sums : partial_) {
    total.dot += sums.dot;
    total.greatest = std::max(total.greatest, sums.greatest);
  }
  return total;
}

double SolidLinear::multiply(std::span<const double> shift) {
  const SolidMesh& mesh = *mesh_;
  const std::size_t n = mesh.free_count;
  // Apply the matrix to the direction and sum their product.
  for_blocks(blocks_, [&](std::size_t block) {
    double dot = 0.0;
    for (std::size_t i = block_begin(block); i < block_begin(block + 1); ++i) {
      double sum = (mesh.conductance_sum_w_k[i] + shift[i]) * direction_[i];
      for (std::uint32_t at = mesh.row_start[i]; at < mesh.row_start[i + 1]; ++at) {
        const std::uint32_t column = mesh.columns[at];
        if (column < n) sum -= mesh.conductance_w_k[at] * direction_[column];
      }
      product_[i] = sum;
      dot += sum * direction_[i];
    }
    partial_[block].dot = dot;
  });
  double total = 0.0;
  for (const Sums& sums : partial_) total += sums.dot;
  return total;
}

int SolidLinear::solve(std::span<const double> shift, std::span<const double> b,
                       std::span<double> x, double tolerance) {
  // Start conjugate gradients from the guess zero.
  std::copy(b.begin(), b.end(), residual_.begin());
  std::fill(x.begin(), x.end(), 0.0);
  Sums now = precondition();
  if (!std::isfinite(now.greatest) || !std::isfinite(now.dot)) return -1;
  double rho = now.dot;
  std::copy(preconditioned_.begin(), preconditioned_.end(), direction_.begin());
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    // Stop on the preconditioned residual, which stands for the error left in x.
    if (!(now.greatest > tolerance)) {
      // Add it: it is known well enough to improve the result.
      for_blocks(blocks_, [&](std::size_t block) {
        for (std::size_t i = block_begin(block); i < block_begin(block + 1); ++i) {
          x[i] += preconditioned_[i];
        }
      });
      return iteration;
    }
    const double curvature = multiply(shift);
    if (!(curvature > 0.0)) return -1;
    // Step along the direction.
    const double alpha = rho / curvature;
    for_blocks(blocks_, [&](std::size_t block) {
      for (std::size_t i = block_begin(block); i < block_begin(block + 1); ++i) {
        x[i] += alpha * direction_[i];
        residual_[i] -= alpha * product_[i];
      }
    });
    now = precondition();
    if (!std::isfinite(now.dot)) return -1;
    // Choose the next direction, conjugate to the ones before.
    const double beta = now.dot / rho;
    rho = now.dot;
    for_blocks(blocks_, [&](std::size_t block) {
      for (std::size_t i = block_begin(block); i < block_begin(block + 1); ++i) {
        direction_[i] = preconditioned_[i] + beta * direction_[i];
      }
    });
  }
  return -1;
}

void SolidLinear::flow(std::span<const double> t, std::span<double> out) const {
  const SolidMesh& mesh = *mesh_;
  for_blocks(blocks_, [&](std::size_t block) {
    for (std::size_t i = block_begin(block); i < block_begin(block + 1); ++i) {
      double sum = 0.0;
      for (std::uint32_t at = mesh.row_start[i]; at < mesh.row_start[i + 1]; ++at) {
        sum += mesh.conductance_w_k[at] * (t[mesh.columns[at]] - t[i]);
      }
      out[i] = sum;
    }
  });
}

}  // namespace emit::reference
