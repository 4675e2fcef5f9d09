// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

#include "rt/fd.hpp"

namespace emit::server {

/// Reports the state of the daemon to a service manager: the datagrams of sd_notify(3) to
/// $NOTIFY_SOCKET. Without that variable every call does nothing. Thread: any. Never blocks; a
/// manager that does not read loses messages.
class ServiceNotifier {
 public:
  /// Makes a notifier without a service manager.
  ServiceNotifier() = default;
  /// Makes a notifier from the variables NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID.
  [[nodiscard]] static ServiceNotifier from_environment();
  /// @param address  path, or @name for an abstract socket; others turn it off.
  ServiceNotifier(std::string_view address, std::int64_t watchdog_ns);

  [[nodiscard]] bool active() const noexcept { return static_cast<bool>(socket_); }
  /// Returns the time without alive() after which the manager ends the daemon; 0: it does not wait.
  [[nodiscard]] std::int64_t watchdog_ns() const noexcept { return watchdog_ns_; }

  void ready(std::string_view status) const noexcept;
  void alive() const noexcept { send("WATCHDOG=1"); }
  void stopping() const noexcept { send("STOPPING=1\nSTATUS=stopping"); }
  /// Reports a status text. With `extend_s` > 0 starting or stopping may take so much longer from
  /// now on.
  void status(std::string_view text, std::int64_t extend_s = 0) const noexcept;

 private:
  void send(std::string_view text) const noexcept;

  Fd socket_;
  std::int64_t watchdog_ns_ = 0;
};

}  // namespace emit::server
