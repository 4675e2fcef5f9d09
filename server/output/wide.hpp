// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Loops over pixels are compiled twice, for every x86-64 processor and for those with AVX2. The
/// body is one function template; products and sums are never fused, so both give the same bits.
#if defined(__x86_64__)
#define EMIT_WIDE_TARGET __attribute__((target("avx2")))
#else
#define EMIT_WIDE_TARGET
#endif
#define EMIT_LOOP_BODY __attribute__((always_inline)) inline

namespace emit::server {

/// Returns whether the processor runs what EMIT_WIDE_TARGET compiles. RT-safe.
[[nodiscard]] inline bool has_wide() noexcept {
#if defined(__x86_64__)
  static const bool has = __builtin_cpu_supports("avx2") != 0;
  return has;
#else
  return false;
#endif
}

}  // namespace emit::server
