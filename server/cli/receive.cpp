// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "commands.hpp"
#include "console.hpp"
#include "frame_files.hpp"
#include "interrupt.hpp"
#include "io/client.hpp"
#include "json.hpp"
#include "stream_report.hpp"

namespace emit::cli {
namespace {

using Clock = std::chrono::steady_clock;

physics::Result<void> save(const std::filesystem::path& directory,
                           const server::ReceivedFrame& frame,
                           const server::ChannelDescription& channel, const ColorLimits& limits,
                           std::optional<ApparentTemperature>& apparent) {
  FramePlanes planes;
  planes.width_px = frame.header.width_px;
  planes.height_px = frame.header.height_px;
  const bool temperature = frame.header.quantity == protocol::PixelQuantity::temperature_k;
  (temperature ? planes.temperature_k : planes.radiance_w_m2_sr) = frame.pixels;
  // The band of a channel does not change: one table serves every frame.
  if (!temperature && !apparent) {
    if (const auto band = channel.spectral_band()) apparent.emplace(*band);
  }
  planes.apparent = apparent ? &*apparent : nullptr;
  planes.metadata = {frame.header.sim_time_ns,
                     frame.header.frame_number,
                     frame.header.pose,
                     channel.band,
                     channel.band_lo_um,
                     channel.band_hi_um,
                     temperature ? "K" : "W m-2 sr-1",
                     channel.response};
  return write_frame_files(directory, planes, limits);
}

void print_losses(std::FILE* out, const server::ReceiveCounters& c, const StreamReport& report) {
  fmt::print(out,
             "frames: {} complete, {} partial, {} lost, {} announced gaps ({} frames skipped), "
             "{} CRC errors, {} datagrams dropped by the kernel, {} bad datagrams\n",
             c.received, c.partial, c.lost, c.gaps, c.skipped, c.crc_errors, c.os_drops,
             c.bad_datagrams);
  fmt::print(out,
             "flags: {} late, {} repeated, {} stale, {} degraded, {} extrapolated, {} nonfinite, "
             "{} clamped\n",
             report.flagged(protocol::kFlagLate), report.flagged(protocol::kFlagRepeated),
             report.flagged(protocol::kFlagStale), report.flagged(protocol::kFlagDegraded),
             report.flagged(protocol::kFlagExtrapolated), report.flagged(protocol::kFlagNonFinite),
             report.flagged(protocol::kFlagClamped));
}

}  // namespace

int run_receive(const ReceiveCommand& command) {
  if (command.out) {
    if (auto made = make_directory(*command.out); !made) return fail(made.error());
  }
  if (const auto url = server::parse_frame_url(command.url); !url) {
    return fail(kExitUsage, url.error().text);
  }
  if (!(command.max_k > command.min_k)) return fail(kExitUsage, "--max-k must exceed --min-k");
  auto connected =
      server::FrameClient::connect(command.url, server::kConnectTimeoutNs, command.security);
  if (!connected) return fail(connected.error());
  server::FrameClient& client = **connected;

  server::SubscribeOptions options;
  options.channel_kind = command.channel_kind;
  options.sensor = command.sensor;
  options.band = command.band;
  options.every_frame = command.every_frame;
  options.multicast_group = command.multicast_group;
  // Checks are made while the pixels are looked at first; writing files takes longer than the
  // daemon waits.
  options.in_place = !command.out;
  const auto channel = client.subscribe(options);
  if (!channel) return fail(channel.error());
  fmt::print(stderr, "emit: {} ({}), scenario {}, {}\n", client.server().software,
             client.server().device, client.server().scenario, channel_text(*channel));
  if (const auto band = channel->spectral_band(); band && command.out) {
    fmt::print(stderr, "emit: colours show apparent temperature, {}\n",
               conversion_text(*band, channel->response.has_value()));
  }
  if (client.server().tai_offset_unset) {
    warn("the daemon's kernel has no TAI offset: its instants are UTC");
  }
  if (const std::string advice = client.receive_buffer_advice(); !advice.empty()) warn(advice);

  std::optional<ApparentTemperature> apparent;
  const InterruptGuard interrupt;
  StreamReport report;
  ProgressBar progress("frames", command.frames == 0 ? 1 : command.frames);
  const auto timeout =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(command.timeout_s));
  auto last_frame = Clock::now();
  const auto start = last_frame;
  std::string ended;
  int exit_code = kExitOk;
  while (!InterruptGuard::interrupted() &&
         (command.frames == 0 || report.frames() < command.frames)) {
    constexpr std::int64_t kPollNs = 200'000'000;
    const auto received = client.receive(kPollNs);
    for (const auto& status : client.take_statuses()) {
      if (!status.ok()) warn(fmt::format("daemon: {}", status.text));
    }
    if (!received) {
      ended = received.error().text;
      break;
    }
    if (*received == nullptr) {
      if (Clock::now() - last_frame > timeout) {
        ended = fmt::format("no frame for {:g} s", command.timeout_s);
        break;
      }
      continue;
    }
    last_frame = Clock::now();
    report.add(**received);
    if (command.out) {
      const auto saved =
          save(*command.out, **received, *channel, {command.min_k, command.max_k}, apparent);
      if (!saved) return fail(saved.error());
    }
    if (command.frames != 0) progress.advance_to(report.frames());
  }
  progress.finish();
  const double seconds = std::chrono::duration<double>(last_frame - start).count();

  const server::ReceiveCounters& counters = client.counters();
  print_losses(text_stream(command.json), counters, report);
  fmt::print(text_stream(command.json), "{}{}{}{}",
             latency_line("pose received -> frame received", report.pose_to_received_ms()),
             latency_line("send start -> frame received", report.send_to_received_ms()),
             report.stage_table(),
             histogram_text(report.pose_to_received_ms().empty() ? report.send_to_received_ms()
                                                                 : report.pose_to_received_ms(),
                            "ms"));
  // Without --frames the end of the stream is the expected end.
  if (!ended.empty() && (command.frames != 0 || report.frames() == 0)) {
    exit_code = fail(kExitFailure, fmt::format("{} of {} frames received: {}", report.frames(),
                                               command.frames, ended));
  }
  if (counters.lost > 0 || report.unflagged_gaps() > 0 || counters.crc_errors > 0 ||
      counters.partial > 0) {
    exit_code = fail(
        kExitFailure,
        fmt::format("{} frames lost, {} gaps not flagged, {} partial, {} CRC errors", counters.lost,
                    report.unflagged_gaps(), counters.partial, counters.crc_errors));
  }
  if (command.json) {
    Json json = Json::object();
    json.set("url", command.url).set("device", client.server().device);
    json.set("scenario", client.server().scenario).set("channel", channel->name);
    json.set("band", channel->band).set("width", channel->width_px);
    json.set("height", channel->height_px).set("frames", report.frames()).set("seconds", seconds);
    json.set("counters", counters_json(counters)).set("flags", report.flags_json());
    json.set("unflagged_gaps", report.unflagged_gaps());
    json.set("pose_to_received_ms", latency_json(report.pose_to_received_ms()));
    json.set("send_to_received_ms", latency_json(report.send_to_received_ms()));
    json.set("stages", report.stages_json());
    json.set("receive_buffer_bytes", client.receive_buffer_bytes());
    json.set("receive_buffer_advice", client.receive_buffer_advice());
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  return exit_code;
}

}  // namespace emit::cli
