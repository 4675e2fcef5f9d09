// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// Finds, for every sample near a convex edge, the points at the same distance from the edge on the
/// neighbouring faces (its partners), evaluates them and appends one patch that holds them all.
/// Until samples are numbered, Partner::sample is an index into that patch, and a partner's own
/// first_seen and partners[0].sample are the patch and the vertex it belongs to. Setup only.
void add_partners(const SurfaceInputs& inputs, const PatchSampler& sampler,
                  std::vector<SurfacePatch>& patches);

}  // namespace emit::renderer
