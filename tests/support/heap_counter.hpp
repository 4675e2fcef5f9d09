// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

namespace emit::test {

/// Requests for heap memory in the whole program so far, by whatever thread and library: malloc and
/// its relatives, which operator new calls. Linking heap_counter.cpp replaces them. Under a
/// sanitizer, which does so itself, operator new alone is counted.
[[nodiscard]] std::uint64_t heap_request_count() noexcept;

}  // namespace emit::test
