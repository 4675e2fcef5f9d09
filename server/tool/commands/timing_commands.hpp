// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "emit/client/security.hpp"

/// Subcommands that measure and drive a daemon's timing; as in commands.hpp.
namespace emit::tool {

struct LatencyCommand {
  std::string url;  ///< frames
  std::string to;   ///< poses; empty: TCP to where the frames come from
  std::uint64_t frames = 1000;
  double rate_hz = 20.0;
  std::optional<std::uint32_t> entity;       ///< what is switched; absent: see --help
  std::optional<std::filesystem::path> log;  ///< its first pose is held
  double time_s = 0.0;
  double timeout_s = 10.0;
  std::uint32_t seed = 1;
  client::Security security;
  std::optional<std::filesystem::path> json;
};
int run_latency(const LatencyCommand& command);

struct TriggerCommand {
  std::string to;
  double rate_hz = 100.0;
  std::uint64_t frames = 0;  ///< 0: until interrupted
  bool stamp = false;
  std::filesystem::path key_file;  ///< empty: bare
  std::optional<std::filesystem::path> json;
};
int run_trigger(const TriggerCommand& command);

struct TraceCommand {
  std::string url;
  std::filesystem::path out;
};
int run_trace(const TraceCommand& command);

}  // namespace emit::tool
