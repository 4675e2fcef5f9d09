// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "tool/streams/journal_replay.hpp"
#include "tool/streams/pose_plan.hpp"
#include "tool/streams/stream_client.hpp"
#include "tool/support/json.hpp"

namespace emit::tool {

/// The results hold all that a run of the demo found out.
struct DemoResults {
  std::string scenario;
  std::string device;
  std::uint64_t poses_in_log = 0;
  std::uint64_t poses_udp = 0;
  std::uint64_t poses_tcp = 0;
  std::uint64_t frames_written = 0;
  std::uint64_t frames_after_departure = 0;
  double first_frame_ms = 0.0;
  double total_s = 0.0;
  JournalReplaySummary replay;
  std::uint64_t replay_client_mismatches = 0;  ///< received pixels that differ from the replay's
  std::uint64_t replay_client_compared = 0;
};

struct DemoClientView {
  std::string name;  ///< e.g. "tcp injection"
  const StreamClient* client = nullptr;
};

[[nodiscard]] std::string demo_tables(const std::vector<DemoClientView>& clients);
[[nodiscard]] Json demo_json(const DemoResults& results,
                             const std::vector<DemoClientView>& clients);

/// Losses that fail the demo: every one over TCP; over UDP those that the receive buffer does not
/// excuse, where `warnings` gets a line instead.
[[nodiscard]] std::vector<std::string> demo_losses(const std::vector<DemoClientView>& clients,
                                                   std::vector<std::string>& warnings);

/// The demo promises at least three frames, one of them after an entity has left where the scenario
/// has a departure. Each promise that it did not keep is one line; none is left when all was shown.
[[nodiscard]] std::vector<std::string> demo_shortfalls(const DemoResults& results,
                                                       const std::vector<Departure>& departures);

}  // namespace emit::tool
