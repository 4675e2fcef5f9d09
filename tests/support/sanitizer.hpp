// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace emit::test {

/// True where the thread sanitizer is on. Numeric loops run about 15 times slower there, so tests
/// that show their threads in a smaller problem take the smaller one.
#if defined(__SANITIZE_THREAD__)
inline constexpr bool kThreadSanitizer = true;
#else
inline constexpr bool kThreadSanitizer = false;
#endif

}  // namespace emit::test
