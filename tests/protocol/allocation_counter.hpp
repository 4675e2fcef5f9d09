// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

namespace emit::test {

/// Calls of operator new in the whole program so far. Linking allocation_counter.cpp replaces it.
[[nodiscard]] std::uint64_t allocation_count() noexcept;

}  // namespace emit::test
