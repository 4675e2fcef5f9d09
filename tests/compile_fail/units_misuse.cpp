// SPDX-License-Identifier: Apache-2.0
// Compiles as it stands; with one of the macros it must not (see check_compile_fail.cmake).
#include "emit/physics/units.hpp"

using namespace emit::physics::literals;
using emit::physics::Kelvin;

Kelvin warmer(Kelvin t) {
#if defined(EMIT_MISUSE_MIXED_SUM)
  return t + 1.0_m;
#elif defined(EMIT_MISUSE_BARE_DOUBLE)
  return t + 1.0;
#elif defined(EMIT_MISUSE_IMPLICIT)
  t = 300.0;
  return t;
#elif defined(EMIT_MISUSE_TO_DOUBLE)
  const double bare = t;
  return Kelvin(bare);
#elif defined(EMIT_MISUSE_COMPARE)
  return t < 1.0_um ? t : t + 1.0_K;
#else
  return t + 1.0_K;
#endif
}
