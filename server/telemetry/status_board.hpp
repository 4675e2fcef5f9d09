// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "telemetry/event.hpp"
#include "telemetry/log.hpp"

namespace emit::server {

/// State that housekeeping collects from the agents' events and that other threads ask for:
/// connections and warnings. Thread: any. It takes a lock, so agents must not use it.
class StatusBoard {
 public:
  struct Client {
    std::string peer;
    std::string role;  ///< empty before its hello
    std::string software;
    std::string channel;    ///< index; empty: not subscribed
    std::string transport;  ///< "tcp" or "udp"; empty: not subscribed
  };
  struct Warning {
    LogLevel level = LogLevel::warn;
    std::string text;
    DistinctTable::Entry entry;
  };

  /// Takes what the event says about connections; others change nothing.
  void note(const Event& event);
  /// The table as it stands now, in place of that level's earlier one.
  void set_warnings(LogLevel level, const DistinctTable& table);

  /// Returns the clients by key of the connection.
  [[nodiscard]] std::map<std::uint32_t, Client> clients() const;
  [[nodiscard]] std::vector<Warning> warnings() const;

 private:
  mutable std::mutex mutex_;
  std::map<std::uint32_t, Client> clients_;
  std::map<LogLevel, std::vector<Warning>> warnings_;
};

}  // namespace emit::server
