// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double2.hpp>
#include <vector>

#include "alpha_mask.hpp"

namespace emit::scene {

/// Closed lines along which the bilinear opacity of one image equals the cutoff, in texels, closed
/// along the edges of the image too. They neither touch nor cross each other, and the kept side
/// lies on the same hand of all of them. The last point of a line is its first.
///
/// An image that repeats ends at 0 and at its width; its opacity there is the mean of both edges. A
/// clamped one goes on for ten thousand texels.
[[nodiscard]] std::vector<std::vector<glm::dvec2>> alpha_rings(const AlphaMask& mask);

}  // namespace emit::scene
