// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "emit/physics/error.hpp"
#include "net/fault_injector.hpp"
#include "net/socket.hpp"

namespace emit::client {

/// A bad network between two UDP ports of this host: takes datagrams at a port of its own and
/// passes them on to another, with faults, on a thread of its own. For tests and `emit bench
/// stream`.
class FaultRelay {
 public:
  /// Errors: io.
  [[nodiscard]] static physics::Result<std::unique_ptr<FaultRelay>> start(
      const server::NetworkFaults& faults);
  ~FaultRelay();
  FaultRelay(const FaultRelay&) = delete;
  FaultRelay& operator=(const FaultRelay&) = delete;

  /// Sets the port of 127.0.0.1 to which datagrams go from now on. Before, they wait.
  void forward_to(std::uint16_t port) noexcept { to_port_.store(port); }
  /// Returns the port on which the relay takes datagrams.
  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  /// Ends the thread; what waits is gone. counts() are complete after it.
  void stop();
  [[nodiscard]] const server::FaultInjector::Counts& counts() const noexcept {
    return injector_.counts();
  }
  /// Datagrams that the kernel dropped here, or refused to take on: losses that are not injected.
  [[nodiscard]] std::uint64_t own_losses() const noexcept { return own_losses_.load(); }

 private:
  FaultRelay(const server::NetworkFaults& faults, server::SocketContext context,
             server::UdpSocket in, server::UdpSocket out);
  void run();
  int receive();
  int pass_on();

  server::FaultInjector injector_;
  server::SocketContext context_;
  server::UdpSocket in_;
  server::UdpSocket out_;
  std::uint16_t port_ = 0;
  std::vector<std::byte> data_;
  std::uint32_t drops_seen_ = 0;
  std::atomic<std::uint16_t> to_port_{0};
  std::atomic<std::uint64_t> own_losses_{0};
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace emit::client
