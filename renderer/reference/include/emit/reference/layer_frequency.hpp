// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <complex>
#include <vector>

#include "emit/reference/layer_mesh.hpp"

namespace emit::reference {

/// Steady periodic response of the meshed body: complex temperature of every node for a flux of
/// 1 W/m2 exp(i w t) into the face, K m2/W, from the very matrices the time solver steps:
/// (K + i w M) T = e_0. The first entry is the impedance Z of the face. The base is at rest or
/// without flux. Any thread. @pre angular_per_s > 0.
[[nodiscard]] std::vector<std::complex<double>> periodic_response(const LayerMesh& mesh,
                                                                  double angular_per_s);

}  // namespace emit::reference
