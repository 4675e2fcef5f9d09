// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "axes/acutrol_host.hpp"
#include "axes/axes_link.hpp"
#include "axes/line_connection.hpp"

namespace emit::server {

/// TCP connection to a controller that speaks the ACUTROL command language (docs/motion.md). It is
/// made without waiting, and made again, at most once a second, when it is lost: closed by the
/// controller, without an answer for a second, or with answers out of order.
class AcutrolAxesLink final : public AxesLink {
 public:
  /// @param controller  "address:port"
  /// Errors: config, io (the address has no meaning), invalid_argument (axes).
  [[nodiscard]] static physics::Result<std::unique_ptr<AcutrolAxesLink>> open(
      const std::string& controller, const std::vector<AcutrolHost::Axis>& axes, Counters& counters,
      EventLog& events);

  [[nodiscard]] std::optional<protocol::AxesMonitor> receive(std::int64_t now_ns) noexcept override;
  /// A command without a connection is counted (axes_send_errors).
  void send(const protocol::AxesCommand& command, std::int64_t now_ns) noexcept override;
  [[nodiscard]] int fd() const noexcept override { return connection_.fd(); }

 private:
  AcutrolAxesLink(std::string controller, const SocketAddress& address, AcutrolHost host,
                  Counters& counters, EventLog& events)
      : controller_(std::move(controller)),
        connection_(address),
        host_(std::move(host)),
        counters_(counters),
        events_(events) {}
  [[nodiscard]] bool connected(std::int64_t now_ns) noexcept;
  void lose(std::string_view why) noexcept;

  std::string controller_;
  LineConnection connection_;
  AcutrolHost host_;
  Counters& counters_;
  EventLog& events_;
};

}  // namespace emit::server
