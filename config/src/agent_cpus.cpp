// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

#include "emit/config/daemon_config.hpp"

namespace emit::config {
namespace {

using physics::ErrorCode;
using physics::make_error;

constexpr std::array<std::string_view, 7> kAgents{"receiver", "conductor", "render", "sender",
                                                  "recorder", "motion",    "gateway"};

std::string_view trimmed(std::string_view text) noexcept {
  const std::size_t from = text.find_first_not_of(' ');
  return from == std::string_view::npos ? std::string_view{}
                                        : text.substr(from, text.find_last_not_of(' ') - from + 1);
}

std::optional<std::uint32_t> cpu(std::string_view text) noexcept {
  std::uint32_t value = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = read.ec == std::errc() && read.ptr == text.data() + text.size();
  return whole && value < kMaxCpus ? std::optional(value) : std::nullopt;
}

}  // namespace

physics::Result<std::vector<AgentCpus>> parse_agent_cpus(std::string_view text) {
  std::vector<AgentCpus> out;
  while (!trimmed(text).empty()) {
    const std::size_t comma = text.find(',');
    const std::string_view part = trimmed(text.substr(0, comma));
    text = comma == std::string_view::npos ? std::string_view{} : text.substr(comma + 1);
    const std::size_t equals = part.find('=');
    const std::string_view agent = trimmed(part.substr(0, equals));
    if (equals == std::string_view::npos || std::ranges::find(kAgents, agent) == kAgents.end()) {
      return make_error(ErrorCode::config,
                        fmt::format("'cpus': '{}' is not AGENT=CORE or AGENT=FIRST-LAST with an "
                                    "agent of {}",
                                    part, fmt::join(kAgents, ", ")));
    }
    const std::string_view cores = trimmed(part.substr(equals + 1));
    const std::size_t dash = cores.find('-');
    const auto first = cpu(cores.substr(0, dash));
    const auto last = dash == std::string_view::npos ? first : cpu(cores.substr(dash + 1));
    if (!first || !last || *first > *last) {
      return make_error(
          ErrorCode::config,
          fmt::format("'cpus': '{}' is not a core or FIRST-LAST, below {}", cores, kMaxCpus));
    }
    if (std::ranges::find(out, agent, &AgentCpus::agent) != out.end()) {
      return make_error(ErrorCode::config, fmt::format("'cpus': {} stands there twice", agent));
    }
    AgentCpus entry{std::string(agent), {}};
    for (std::uint32_t core = *first; core <= *last; ++core) entry.cpus.push_back(core);
    out.push_back(std::move(entry));
  }
  return out;
}

}  // namespace emit::config
