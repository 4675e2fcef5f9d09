// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstdint>

/// Sleeping on a word of memory that processes share. RT-safe.
namespace emit::server {

/// Wakes everybody who sleeps on the word; one system call, whoever sleeps.
void futex_wake_all(std::atomic<std::uint32_t>& word) noexcept;

/// Sleeps while the word holds `expected`, at most `timeout_ns`; may return early. Read-only memory
/// will do.
void futex_wait(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                std::int64_t timeout_ns) noexcept;

}  // namespace emit::server
