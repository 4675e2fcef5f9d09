// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "agents/context.hpp"
#include "agents/receiver/receiver.hpp"
#include "app/liveness.hpp"
#include "console/console_server.hpp"
#include "console/console_state.hpp"
#include "console/console_tap.hpp"
#include "console/explainer.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "telemetry/duty_cycle.hpp"
#include "telemetry/status_board.hpp"

namespace emit::server {

/// The operator's console of the daemon: what pages are told, from the parts of the daemon that it
/// reads, and what becomes of their commands. Threads: main makes and destroys it; all else happens
/// on the thread of the ConsoleServer.
class ConsoleEndpoint {
 public:
  /// Parts of the daemon that the answers read. All of them outlive the endpoint.
  struct Parts {
    Context& context;
    ConsoleTap& tap;
    JournalTap& journal;
    const std::vector<std::string>& explain_command;  ///< DaemonOptions::explain_command
    const Liveness& liveness;
    const StatusBoard& board;
    const Receiver& receiver;            ///< it decides which peers may ask
    const NamedDutyCycles& duty_cycles;  ///< of all agents; fixed by now
  };

  /// Opens console.listen and starts the thread.
  /// Errors: config (no address, or one that other hosts reach without protection), io (address in
  /// use); they name the key and the file.
  [[nodiscard]] static physics::Result<std::unique_ptr<ConsoleEndpoint>> open(
      const config::DaemonConfig& config, const Parts& parts, ConsoleFacts facts);

  /// Returns what a browser opens.
  [[nodiscard]] std::string url() const;

 private:
  ConsoleEndpoint(const config::DaemonConfig& config, const Parts& parts, ConsoleFacts facts)
      : config_(config), parts_(parts), facts_(std::move(facts)) {}
  [[nodiscard]] ConsoleServer::Answers answers();
  [[nodiscard]] bool may_command(bool local) const noexcept;
  [[nodiscard]] bool admits(const SocketAddress& peer) const;
  [[nodiscard]] std::string status(std::size_t pages) const;
  [[nodiscard]] std::string take_command(CommandKind command, bool local, std::uint32_t page);
  [[nodiscard]] std::string explain(ExplainRequest request);

  const config::DaemonConfig& config_;
  Parts parts_;
  ConsoleFacts facts_;
  std::unique_ptr<Explainer> explainer_;   ///< null: nothing can be explained
  std::unique_ptr<ConsoleServer> server_;  ///< its thread reads all of the above
};

}  // namespace emit::server
