// SPDX-License-Identifier: Apache-2.0
#include "telemetry/status_board.hpp"

#include "rt/connection_key.hpp"

namespace emit::server {

void StatusBoard::note(const Event& event) {
  const auto key = static_cast<std::uint32_t>(event.a);
  const std::lock_guard lock(mutex_);
  switch (event.kind) {
    case EventKind::connected:
      // Events get lost when a ring is full: whoever had the place before is gone in any case.
      std::erase_if(clients_, [&](const auto& entry) {
        return connection_place(entry.first) == connection_place(key);
      });
      clients_[key].peer = printable_text(event);
      break;
    case EventKind::hello:
      clients_[key].role = role_name(event.b);
      clients_[key].software = printable_text(event);
      break;
    case EventKind::subscribed:
      clients_[key].channel = std::to_string(event.b);
      clients_[key].transport = printable_text(event);
      break;
    case EventKind::disconnected:
      clients_.erase(key);
      break;
    default:
      break;
  }
}

void StatusBoard::set_warnings(LogLevel level, const DistinctTable& table) {
  std::vector<Warning> warnings;
  for (const auto& [text, entry] : table.entries()) warnings.push_back({level, text, entry});
  const std::lock_guard lock(mutex_);
  warnings_[level] = std::move(warnings);
}

std::map<std::uint32_t, StatusBoard::Client> StatusBoard::clients() const {
  const std::lock_guard lock(mutex_);
  return clients_;
}

std::vector<StatusBoard::Warning> StatusBoard::warnings() const {
  const std::lock_guard lock(mutex_);
  std::vector<Warning> all;
  for (const auto& [level, warnings] : warnings_) {
    all.insert(all.end(), warnings.begin(), warnings.end());
  }
  return all;
}

}  // namespace emit::server
