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

/// Nodes per block: large enough that the couplings dropped between blocks hardly matter, small
/// enough to feed a handful of threads.
constexpr std::size_t kBlockNodes = 32768;
constexpr std::size_t kMaxBlocks = 256;
constexpr int kMaxIterations = 2000;
/// Below these sizes a direct factor is taken as the preconditioner (chosen by judgement, not by a
/// benchmark).
constexpr std::size_t kDirectPlane = 40000;
constexpr std::size_t kDirectSolid = 3000;

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

struct SolidLinear::Direct {
  Eigen::SparseMatrix<double> matrix;  // lower triangle
  std::vector<Eigen::Index> diagonal;  // places of the diagonal in matrix.valuePtr()
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>, Eigen::Lower> factor;
};

SolidLinear::SolidLinear(const SolidMesh& mesh, LinearSolver kind) : mesh_(&mesh) {
  const std::size_t n = mesh.free_count;
  blocks_ = std::clamp<std::size_t>(n / kBlockNodes, 1, kMaxBlocks);
  for (auto* vector : {&residual_, &preconditioned_, &direction_, &product_}) vector->resize(n);
  partial_.resize(blocks_);
  if (kind == LinearSolver::automatic) {
    kind = n <= (mesh.plane ? kDirectPlane : kDirectSolid) ? LinearSolver::ldlt : LinearSolver::cg;
  }
  if (kind == LinearSolver::cg) {
    inverse_pivot_.resize(n);
    return;
  }
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
  // Lower triangle by columns: the diagonal comes first.
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
  // A grid has no triangles of links: without fill only the pivots differ from the matrix.
  std::vector<char> good(blocks_, 1);
  for_blocks(blocks_, [&](std::size_t block) {
    const std::size_t begin = block_begin(block);
    const std::size_t end = block_begin(block + 1);
    for (std::size_t i = begin; i < end; ++i) {
      double pivot = mesh.conductance_sum_w_k[i] + shift[i];
      for (std::uint32_t at = mesh.row_start[i]; at < mesh.upper_start[i]; ++at) {
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
  for_blocks(blocks_, [&](std::size_t block) {
    const std::size_t begin = block_begin(block);
    const std::size_t end = block_begin(block + 1);
    double* z = preconditioned_.data();
    for (std::size_t i = begin; i < end; ++i) {
      double sum = residual_[i];
      for (std::uint32_t at = mesh.row_start[i]; at < mesh.upper_start[i]; ++at) {
        const std::uint32_t column = mesh.columns[at];
        if (column >= begin) sum += mesh.conductance_w_k[at] * z[column];
      }
      z[i] = sum * inverse_pivot_[i];
    }
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
  std::copy(b.begin(), b.end(), residual_.begin());
  std::fill(x.begin(), x.end(), 0.0);
  Sums now = precondition();
  if (!std::isfinite(now.greatest) || !std::isfinite(now.dot)) return -1;
  double rho = now.dot;
  std::copy(preconditioned_.begin(), preconditioned_.end(), direction_.begin());
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    // The preconditioned residual stands for the error left in x.
    if (!(now.greatest > tolerance)) {
      // What is left is known well enough to be worth adding.
      for_blocks(blocks_, [&](std::size_t block) {
        for (std::size_t i = block_begin(block); i < block_begin(block + 1); ++i) {
          x[i] += preconditioned_[i];
        }
      });
      return iteration;
    }
    const double curvature = multiply(shift);
    if (!(curvature > 0.0)) return -1;
    const double alpha = rho / curvature;
    for_blocks(blocks_, [&](std::size_t block) {
      for (std::size_t i = block_begin(block); i < block_begin(block + 1); ++i) {
        x[i] += alpha * direction_[i];
        residual_[i] -= alpha * product_[i];
      }
    });
    now = precondition();
    if (!std::isfinite(now.dot)) return -1;
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
