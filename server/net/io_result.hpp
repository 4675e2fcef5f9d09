// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>

namespace emit::server {

/// `busy`: another thread is inside the connection's TLS session; again soon.
enum class IoStatus : std::uint8_t { done, would_block, busy, closed, failed };
struct IoResult {
  IoStatus status = IoStatus::done;
  std::size_t bytes = 0;
  int error = 0;  ///< errno of failed
};

}  // namespace emit::server
