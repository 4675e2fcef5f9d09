// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

namespace emit::test {

/// Returns the number of requests for heap memory in the whole program so far, from any thread and
/// library: malloc and its relatives, which operator new calls. Linking heap_counter.cpp replaces
/// them. Under a sanitizer, which replaces them itself, only operator new is counted.
[[nodiscard]] std::uint64_t heap_request_count() noexcept;

}  // namespace emit::test
