// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "emit/reference/solid_solver.hpp"
#include "solid_mesh.hpp"

namespace emit::reference {

/// Solver of (K + diag(shift)) x = b on the free nodes, where K is the conductance network. The
/// method is conjugate gradients. The preconditioner is an incomplete Cholesky factor per block of
/// nodes, or a complete LDLT factor of an earlier shift. Sums run over fixed chunks, so the result
/// does not depend on the number of threads.
class SolidLinear {
 public:
  SolidLinear(const SolidMesh& mesh, LinearSolver kind);
  ~SolidLinear();
  SolidLinear(SolidLinear&&) noexcept;
  SolidLinear& operator=(SolidLinear&&) noexcept;

  /// Builds the preconditioner for this shift, one value per free node, W/K. Returns false if the
  /// matrix is not positive definite.
  [[nodiscard]] bool factorise(std::span<const double> shift);
  /// Solves for `x`; all spans have one value per free node. It stops when the preconditioned
  /// residual is below `tolerance` everywhere. Returns the number of iterations, or -1 if the
  /// iteration did not converge.
  [[nodiscard]] int solve(std::span<const double> shift, std::span<const double> b,
                          std::span<double> x, double tolerance);
  /// Computes out = -K t on the free nodes. `t` holds all nodes.
  void flow(std::span<const double> t, std::span<double> out) const;

 private:
  struct Direct;
  struct Sums {
    double dot = 0.0;
    double greatest = 0.0;
  };
  [[nodiscard]] std::size_t block_begin(std::size_t block) const noexcept;
  [[nodiscard]] Sums precondition();
  [[nodiscard]] double multiply(std::span<const double> shift);

  const SolidMesh* mesh_;
  std::size_t blocks_ = 1;
  std::vector<double> inverse_pivot_;
  std::unique_ptr<Direct> direct_;
  std::vector<double> residual_;
  std::vector<double> preconditioned_;
  std::vector<double> direction_;
  std::vector<double> product_;
  std::vector<Sums> partial_;
};

}  // namespace emit::reference
