// SPDX-License-Identifier: Apache-2.0
// A texel of the geometry buffer that shows no surface.
#include "shared/bindings.glsl.h"

layout(location = 0) out uvec4 surface;

void main() {
  surface = uvec4(floatBitsToUint(EMIT_SKY_DEPTH_M), 0u, 0u, 0u);
}
