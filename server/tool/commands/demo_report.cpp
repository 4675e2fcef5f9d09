// SPDX-License-Identifier: Apache-2.0
#include "tool/commands/demo_report.hpp"

#include <fmt/format.h>

#include "tool/support/console.hpp"

namespace emit::tool {

std::string demo_tables(const std::vector<DemoClientView>& clients) {
  std::string text;
  for (const auto& [name, client] : clients) {
    text += fmt::format("\nTiming, {} client ({}, band {}):\n{}", name, client->channel().kind,
                        client->channel().band, client->report().stage_table());
  }
  TextTable losses({"client", "frames", "partial", "lost", "gaps", "unflagged", "late", "repeated",
                    "stale", "degraded", "CRC errors", "OS drops"});
  for (const auto& [name, client] : clients) {
    const auto& counters = client->counters();
    const auto& report = client->report();
    const auto number = [](std::uint64_t value) { return fmt::format("{}", value); };
    losses.add({name, number(report.frames()), number(counters.partial), number(counters.lost),
                number(counters.gaps), number(report.unflagged_gaps()),
                number(report.flagged(protocol::kFlagLate)),
                number(report.flagged(protocol::kFlagRepeated)),
                number(report.flagged(protocol::kFlagStale)),
                number(report.flagged(protocol::kFlagDegraded)), number(counters.crc_errors),
                number(counters.os_drops)});
  }
  return text + "\nLosses:\n" + losses.to_string();
}

Json demo_json(const DemoResults& results, const std::vector<DemoClientView>& clients) {
  Json json = Json::object();
  json.set("device", results.device).set("scenario", results.scenario);
  json.set("poses_in_log", results.poses_in_log);
  json.set("poses_played", results.poses_udp + results.poses_tcp);
  json.set("poses_udp", results.poses_udp).set("poses_tcp", results.poses_tcp);
  json.set("frames_written", results.frames_written);
  json.set("frames_after_departure", results.frames_after_departure);
  json.set("first_frame_ms", results.first_frame_ms).set("total_s", results.total_s);
  Json list = Json::array();
  for (const auto& [name, client] : clients) {
    Json entry = Json::object();
    entry.set("client", name).set("channel", client->channel().kind);
    entry.set("band", client->channel().band).set("frames", client->report().frames());
    entry.set("width", client->channel().width_px).set("height", client->channel().height_px);
    entry.set("unflagged_gaps", client->report().unflagged_gaps());
    entry.set("counters", counters_json(client->counters()));
    entry.set("flags", client->report().flags_json());
    entry.set("stages", client->report().stages_json());
    list.push(std::move(entry));
  }
  json.set("clients", std::move(list));
  Json replay = Json::object();
  replay.set("frames", results.replay.frames).set("mismatches", results.replay.mismatches);
  replay.set("received_compared", results.replay_client_compared);
  replay.set("received_mismatches", results.replay_client_mismatches);
  replay.set("bit_identical",
             results.replay.mismatches == 0 && results.replay_client_mismatches == 0);
  json.set("replay", std::move(replay));
  return json;
}

std::vector<std::string> demo_losses(const std::vector<DemoClientView>& clients,
                                     std::vector<std::string>& warnings) {
  std::vector<std::string> failures;
  for (const auto& [name, client] : clients) {
    const auto& counters = client->counters();
    const std::uint64_t unflagged = client->report().unflagged_gaps();
    if (counters.crc_errors > 0) {
      failures.push_back(fmt::format("{}: {} frames with a wrong CRC", name, counters.crc_errors));
    }
    if (const auto degraded = client->report().flagged(protocol::kFlagDegraded); degraded > 0) {
      warnings.push_back(fmt::format(
          "{}: {} of {} frames are flagged degraded: they show less than the scenario's quality",
          name, degraded, client->report().frames()));
    }
    if (counters.lost == 0 && counters.partial == 0 && counters.gaps == 0 && unflagged == 0)
      continue;
    const std::string text =
        fmt::format("{}: {} frames lost, {} partial, {} announced gaps, {} gaps not flagged", name,
                    counters.lost, counters.partial, counters.gaps, unflagged);
    const std::string advice = client->advice();
    if (advice.empty()) {
      failures.push_back(text);
    } else {
      warnings.push_back(text + "; " + advice);
    }
  }
  return failures;
}

std::vector<std::string> demo_shortfalls(const DemoResults& results,
                                         const std::vector<Departure>& departures) {
  constexpr std::uint64_t kMinFrames = 3;
  std::vector<std::string> failures;
  if (results.frames_written < kMinFrames) {
    failures.push_back(fmt::format("{} frames were written, the demo shows at least {}",
                                   results.frames_written, kMinFrames));
  }
  if (!departures.empty() && results.frames_after_departure == 0) {
    failures.push_back(fmt::format(
        "no written frame shows the scene after {} left at sim time {:.1f} s",
        departures.front().object, 1e-9 * static_cast<double>(departures.front().left_ns)));
  }
  return failures;
}

}  // namespace emit::tool
