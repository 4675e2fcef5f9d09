// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace emit::test {

/// True where the thread sanitizer is on: numeric loops run about 15 times slower, so tests whose
/// threads are also seen in a smaller problem take the smaller one.
#if defined(__SANITIZE_THREAD__)
inline constexpr bool kThreadSanitizer = true;
#else
inline constexpr bool kThreadSanitizer = false;
#endif

}  // namespace emit::test
