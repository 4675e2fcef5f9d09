// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

/// Spans of time in nanoseconds that the tests share.
namespace emit::test {

inline constexpr std::int64_t kMs = 1'000'000;
inline constexpr std::int64_t kSecondNs = 1'000'000'000;
/// Limit of a wait that normally ends at once. Only a fault reaches it.
inline constexpr std::int64_t kLongNs = 30 * kSecondNs;

}  // namespace emit::test
