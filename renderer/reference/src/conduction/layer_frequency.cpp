// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/layer_frequency.hpp"

#include "emit/physics/check.hpp"

namespace emit::reference {

std::vector<std::complex<double>> periodic_response(const LayerMesh& mesh, double angular_per_s) {
  EMIT_CHECK_OP(angular_per_s, >, 0.0);
  using Complex = std::complex<double>;
  const auto conductance = mesh.conductance_w_m2_k();
  const std::size_t nodes = mesh.nodes();
  const std::size_t unknowns = nodes - (mesh.base_held() ? 1 : 0);

  // Eliminate from the base upwards. Everything below a node then acts as one complex ratio of the
  // node below to the node.
  std::vector<Complex> ratio(nodes, Complex(0.0, 0.0));  // T_i+1 = ratio_i T_i
  Complex diagonal(0.0, 0.0);                            // pivot of the row
  // Assemble the row of K + i w M and fold the rows below into its diagonal.
  for (std::size_t i = unknowns; i-- > 0;) {
    const double up = i > 0 ? conductance[i - 1] : 0.0;
    const double down = i + 1 < nodes ? conductance[i] : 0.0;
    diagonal = Complex(up + down, angular_per_s * mesh.mass_own()[i]);
    if (i + 1 < unknowns) {
      diagonal += Complex(-down, angular_per_s * mesh.mass_below()[i]) * ratio[i];
    }
    if (i > 0) ratio[i - 1] = -Complex(-up, angular_per_s * mesh.mass_above()[i]) / diagonal;
  }
  // Start with the flux of 1 W/m2 at the face and substitute downwards.
  std::vector<Complex> response;
  response.reserve(nodes);
  Complex node = 1.0 / diagonal;
  for (std::size_t i = 0; i < nodes; ++i) {
    response.push_back(node);
    node *= ratio[i];  // the ratio above a held base is zero
  }
  return response;
}

}  // namespace emit::reference
