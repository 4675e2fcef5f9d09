// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <string>

#include "emit/physics/error.hpp"

namespace emit::client {

struct HttpAnswer {
  int status = 0;
  std::string body;
};

/// One request to `url` (http://host:port/path; without a path: /metrics), blocking. `timeout_ns`
/// is for all of it. Errors: invalid_argument (the URL), io (refused, timeout, more than
/// kMaxHttpBytes), protocol (no HTTP).
[[nodiscard]] physics::Result<HttpAnswer> http_get(const std::string& url, std::int64_t timeout_ns);

inline constexpr std::size_t kMaxHttpBytes = std::size_t{4} << 20U;

}  // namespace emit::client
