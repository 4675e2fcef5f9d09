// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <functional>
#include <memory>
#include <string>

#include "emit/physics/error.hpp"
#include "net/socket_address.hpp"

namespace emit::server {

/// Answers GET /metrics, /trace, /healthz and /readyz over HTTP, one request a connection, on a
/// thread of its own that no agent waits for. Bounded: kMaxConnections at a time, further ones are
/// closed at once; kMaxRequestBytes of request; kTimeoutNs for a request and its answer.
class MetricsServer {
 public:
  static constexpr int kMaxConnections = 16;
  static constexpr std::size_t kMaxRequestBytes = 8192;
  static constexpr std::int64_t kTimeoutNs = 5'000'000'000;

  /// Called on the server's thread.
  struct Answers {
    std::function<std::string()> metrics;  ///< body of /metrics
    std::function<std::string()> trace;    ///< body of /trace, JSON
    std::function<bool()> healthy;         ///< /healthz: 200 or 503
    /// /readyz: 503 and this reason, or 200 where it is empty.
    std::function<std::string()> why_not_ready;
    /// Whether this peer may ask; others are closed at once.
    std::function<bool(const SocketAddress&)> admits;
  };

  /// Opens the port and starts the thread. Errors (io): address in use and so on, naming it.
  [[nodiscard]] static physics::Result<std::unique_ptr<MetricsServer>> start(
      const SocketAddress& address, Answers answers);
  /// Ends with whatever is under way cut off.
  ~MetricsServer();

  [[nodiscard]] SocketAddress address() const noexcept;

 private:
  struct Impl;
  explicit MetricsServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::server
