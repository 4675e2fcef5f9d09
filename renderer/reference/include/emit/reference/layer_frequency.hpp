// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <complex>
#include <vector>

#include "emit/reference/layer_mesh.hpp"

namespace emit::reference {

/// Returns the steady periodic response of a meshed stack of layers: the complex temperature of
/// every node, in K m2/W, for a flux of 1 W/m2 exp(i w t) into the face. It solves (K + i w M)
/// T = e_0 with the very matrices that the time solver steps. The first entry is the impedance Z of
/// the face. The base is held at rest, or has no flux if it is adiabatic. Any thread.
/// @pre angular_per_s > 0.
[[nodiscard]] std::vector<std::complex<double>> periodic_response(const LayerMesh& mesh,
                                                                  double angular_per_s);

}  // namespace emit::reference
