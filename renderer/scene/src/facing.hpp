// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/scene/gltf_import.hpp"

namespace emit::scene {

/// Makes normals and winding of a model agree, and warns of each mesh it changes. Winding decides
/// which side of a triangle is seen and lit, normals decide how it is lit, so a model in which they
/// contradict each other would be dark, or not there at all.
///
/// Geometry decides which of the two is right, for each connected surface with a contradiction:
/// ground (most of the surface is level) faces up, a surface that encloses or spans a volume faces
/// outwards, anything else keeps the winding of the greater part of its area. Surfaces without a
/// contradiction are left alone. Closed bodies whose fronts all look inwards, and single-sided
/// ground that is seen only from below, get a warning.
///
/// The model's axes are those of glTF: +y is up. Setup only: about a second per million triangles.
void mend_facing(GltfModel& model);

}  // namespace emit::scene
