// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <vector>

#include "emit/client/client.hpp"
#include "net/socket_address.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/streams/error_correction.hpp"
#include "tool/streams/stream_options.hpp"
#include "tool/streams/stream_report.hpp"
#include "tool/streams/stream_subscription.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

struct ReceiveOptions {
  std::string url;
  std::uint64_t frames = 0;  ///< 0: until interrupted or the daemon ends
  std::optional<std::filesystem::path> out;
  std::optional<std::filesystem::path> json;
  std::string channel_name;
  std::string channel_kind;
  std::string band;
  std::string sensor;
  std::string multicast_group;
  std::optional<protocol::FecParams> fec;  ///< absent: the daemon's choice
  bool compress = false;
  bool resend = false;
  double timeout_s = 10.0;
  bool every_frame = false;
  std::uint32_t every_nth = 1;
  bool reconnect = false;
  double min_k = 280.0;
  double max_k = 330.0;
  std::string png_of = "apparent";
  client::Security security;
};

using Clock = std::chrono::steady_clock;

physics::Result<void> save(const std::filesystem::path& directory,
                           const client::ReceivedFrame& frame,
                           const client::ChannelDescription& channel, const PngStyle& style,
                           std::optional<ApparentTemperature>& apparent) {
  FramePlanes planes;
  planes.width_px = frame.header.width_px;
  planes.height_px = frame.header.height_px;
  planes.window_px = {frame.header.window_x_px, frame.header.window_y_px, frame.header.width_px,
                      frame.header.height_px};
  planes.sensor_width_px = frame.header.sensor_width_px;
  planes.sensor_height_px = frame.header.sensor_height_px;
  planes.output_steps = frame.header.output_steps;
  planes.applied_shift_x_px = frame.header.applied_shift_x_px;
  planes.applied_shift_y_px = frame.header.applied_shift_y_px;
  plane_of(planes, frame.header.quantity) = frame.pixels;
  // The band of a channel does not change: one table serves every frame.
  if (frame.header.quantity == protocol::PixelQuantity::radiance_w_m2_sr && !apparent) {
    if (const auto band = channel.spectral_band()) apparent.emplace(*band);
  }
  std::vector<float> valid;
  if (frame.missing_px > 0) {
    valid.resize(frame.pixels.size());
    for (std::size_t i = 0; i < valid.size(); ++i) {
      valid[i] = frame.validity.pixel(i) ? 1.0F : 0.0F;
    }
    planes.valid = valid;
  }
  planes.apparent = apparent ? &*apparent : nullptr;
  planes.metadata = {frame.header.sim_time_ns,
                     frame.header.frame_number,
                     frame.header.pose,
                     channel.band,
                     channel.band_lo_um,
                     channel.band_hi_um,
                     std::string(pixel_unit(frame.header.quantity)),
                     channel.response,
                     frame.header.fov_h_rad};
  return write_frame_files(directory, planes, style);
}

void print_losses(std::FILE* out, const client::ReceiveCounters& c, const StreamReport& report) {
  fmt::print(out,
             "frames: {} complete, {} partial, {} lost, {} announced gaps ({} frames skipped), "
             "{} CRC errors, {} datagrams dropped by the kernel, {} bad, {} of others\n",
             c.received, c.partial, c.lost, c.gaps, c.skipped, c.crc_errors, c.os_drops,
             c.bad_datagrams, c.foreign_datagrams);
  if (c.repaired + c.unrepairable + c.resend_requests > 0) {
    fmt::print(out,
               "repair: {} fragments brought back by error correction ({} frames whole by it, {} "
               "groups beyond it), {} resent on {} requests\n",
               c.repaired, c.repaired_frames, c.unrepairable, c.resent, c.resend_requests);
  }
  fmt::print(out,
             "flags: {} late, {} repeated, {} stale, {} degraded, {} extrapolated, {} nonfinite, "
             "{} clamped\n",
             report.flagged(protocol::kFlagLate), report.flagged(protocol::kFlagRepeated),
             report.flagged(protocol::kFlagStale), report.flagged(protocol::kFlagDegraded),
             report.flagged(protocol::kFlagExtrapolated), report.flagged(protocol::kFlagNonFinite),
             report.flagged(protocol::kFlagClamped));
  fmt::print(out, "{}", report.motion_line());
}

/// Exit code of arguments that make no sense together, after a message; kExitOk when they do.
int check(const ReceiveOptions& command) {
  if (const auto url = client::parse_frame_url(command.url); !url) {
    return fail(kExitUsage, url.error().text);
  }
  if (!command.multicast_group.empty() &&
      !server::numeric_address(command.multicast_group, 0).is_multicast()) {
    return fail(kExitUsage,
                fmt::format("--multicast: '{}' is not a group", command.multicast_group));
  }
  if (!(command.max_k > command.min_k)) return fail(kExitUsage, "--max-k must exceed --min-k");
  return kExitOk;
}

client::SubscribeOptions subscription(const ReceiveOptions& command) {
  client::SubscribeOptions options;
  options.channel_name = command.channel_name;
  options.channel_kind = command.channel_kind;
  options.sensor = command.sensor;
  options.band = command.band;
  options.every_frame = command.every_frame;
  options.every_nth = command.every_nth;
  options.multicast_group = command.multicast_group;
  options.fec = command.fec;
  options.resend = command.resend;
  options.compression = command.compress;
  // Pixels are checked while they are read for the first time. Writing files takes longer than the
  // daemon waits for a reader in place.
  options.in_place = !command.out;
  return options;
}

/// Receives until enough frames came, the stream ended or the user interrupts, then reports.
class Reception {
 public:
  Reception(const ReceiveOptions& command, StreamSubscription& stream)
      : command_(command),
        stream_(stream),
        terms_(stream.client().terms()),
        report_(terms_.every_nth) {}

  int run() {
    greet();
    warn_of_terms();
    if (auto received = receive(); !received) return fail(received.error());
    print_report();
    const int exit_code = judge();
    if (command_.json) {
      if (auto done = write_json(*command_.json, json()); !done) return fail(done.error());
    }
    return exit_code;
  }

 private:
  void greet() const;
  void warn_of_terms() const;
  /// Errors: those of writing the frames. The end of the stream is not one: it is kept in ended_.
  physics::Result<void> receive();
  /// One turn of receive(); false ends it.
  physics::Result<bool> receive_next();
  bool connect_again();
  /// Says once why no frame may have come for a while.
  void hint_at_silence();
  void print_report() const;
  /// Exit code, after a message where something was lost.
  [[nodiscard]] int judge() const;
  [[nodiscard]] Json json() const;
  [[nodiscard]] Clock::duration timeout() const {
    return std::chrono::duration_cast<Clock::duration>(
        std::chrono::duration<double>(command_.timeout_s));
  }

  const ReceiveOptions& command_;
  StreamSubscription& stream_;
  client::StreamTerms terms_;
  StreamReport report_;
  std::optional<ApparentTemperature> apparent_;  ///< of the channel's band, once it is needed
  Clock::time_point start_;
  Clock::time_point last_frame_;
  bool hinted_ = false;  ///< hint_at_silence() has said its text
  std::string ended_;    ///< why the stream ended; empty: it was not its end that ended receive()
};

void Reception::greet() const {
  const client::FrameClient& client = stream_.client();
  fmt::print(stderr, "emit: {} ({}), scenario {}, {}\n", client.server().software,
             client.server().device, client.server().scenario, channel_text(stream_.channel()));
  constexpr auto kRadiance = protocol::PixelQuantity::radiance_w_m2_sr;
  const bool radiance = stream_.channel().quantity.value_or(kRadiance) == kRadiance;
  if (const auto band = stream_.channel().spectral_band(); band && command_.out && radiance) {
    fmt::print(stderr, "emit: colours show apparent temperature, {}\n",
               conversion_text(*band, stream_.channel().response.has_value()));
  }
  if (client.server().tai_offset_unset) {
    warn("the daemon's kernel has no TAI offset: its instants are UTC");
  }
  if (const std::string advice = client.receive_buffer_advice(); !advice.empty()) warn(advice);
}

void Reception::warn_of_terms() const {
  if (terms_.udp_port != 0) {
    fmt::print(stderr, "emit: error correction {}, resend {}\n", to_string(terms_.fec),
               terms_.resend ? "on" : "off");
  }
  if (command_.resend && !terms_.resend) {
    warn(
        "resend is not granted: it needs udp:// without a group, a daemon in host-step, and "
        "stream.resend_max_frac above 0");
  }
  if (command_.compress && !terms_.compression) {
    warn("compression is not granted: it needs tcp:// and stream.compression of the daemon");
  }
  if (command_.fec && command_.fec->on() && !terms_.fec.on()) {
    warn("error correction needs udp:// and a daemon that knows it");
  }
}

bool Reception::connect_again() {
  warn(ended_ + "; connecting again");
  const auto again = stream_.reopen(
      [&] { return !InterruptGuard::interrupted() && Clock::now() - last_frame_ < timeout(); });
  if (!again) {
    ended_ += fmt::format("; not connected again: {}", again.error().text);
    return false;
  }
  ended_.clear();
  report_.begin_connection();
  apparent_.reset();
  greet();
  return true;
}

void Reception::hint_at_silence() {
  constexpr std::chrono::seconds kSilence(2);
  if (hinted_ || Clock::now() - last_frame_ < std::min<Clock::duration>(kSilence, timeout()))
    return;
  hinted_ = true;
  const std::string_view pacing = stream_.client().server().pacing;
  const std::string waited = fmt::format("no frame for {:g} s", std::min(2.0, command_.timeout_s));
  if (pacing == "host-step") {
    warn(waited +
         ": the daemon's pacing is host-step, which makes a frame for each host pose; without a "
         "host, `emit send LOG --to udp://HOST:PORT` sends poses");
  } else if (pacing == "trigger") {
    warn(waited +
         ": the daemon's pacing is trigger, which makes a frame for each trigger; without a "
         "source, `emit trigger udp://HOST:PORT` sends triggers");
  } else {
    warn(waited +
         ": the daemon may be stopped (STOP), or wait for the first host pose (`emit send`)");
  }
}

physics::Result<bool> Reception::receive_next() {
  constexpr std::int64_t kPollNs = 200'000'000;
  const auto received = stream_.client().receive(kPollNs);
  for (const auto& status : stream_.client().take_statuses()) {
    if (!status.ok()) warn(fmt::format("daemon: {}", status.text));
  }
  if (!received) {
    ended_ = received.error().text;
    return command_.reconnect && connect_again();
  }
  if (*received == nullptr) {
    hint_at_silence();
    if (Clock::now() - last_frame_ > timeout()) {
      ended_ = fmt::format("no frame for {:g} s", command_.timeout_s);
      return false;
    }
    return true;
  }
  last_frame_ = Clock::now();
  report_.add(**received);
  if (command_.out) {
    const auto saved =
        save(*command_.out, **received, stream_.channel(),
             {command_.min_k, command_.max_k, png_quantity(command_.png_of)}, apparent_);
    if (!saved) return tl::unexpected(saved.error());
  }
  return true;
}

physics::Result<void> Reception::receive() {
  const InterruptGuard interrupt;
  Progress progress("frames", command_.frames == 0 ? 1 : command_.frames);
  start_ = last_frame_ = Clock::now();
  while (!InterruptGuard::interrupted() &&
         (command_.frames == 0 || report_.frames() < command_.frames)) {
    const auto goes_on = receive_next();
    if (!goes_on) return tl::unexpected(goes_on.error());
    if (!*goes_on) break;
    if (command_.frames != 0) progress.advance_to(report_.frames());
  }
  return {};
}

void Reception::print_report() const {
  std::FILE* const out = text_stream(command_.json);
  print_losses(out, stream_.counters(), report_);
  if (report_.sent_pixel_bytes() < report_.pixel_bytes()) {
    fmt::print(out, "compressed: {:.2f} to 1\n",
               static_cast<double>(report_.pixel_bytes()) /
                   static_cast<double>(report_.sent_pixel_bytes()));
  }
  if (stream_.reconnects() > 0) {
    fmt::print(out, "connected again {} times, {} runs of the daemon\n", stream_.reconnects(),
               report_.runs());
  }
  fmt::print(out, "{}{}{}{}",
             latency_line("pose received -> frame received", report_.pose_to_received_ms()),
             latency_line("send start -> frame received", report_.send_to_received_ms()),
             report_.stage_table(),
             histogram_text(report_.pose_to_received_ms().empty() ? report_.send_to_received_ms()
                                                                  : report_.pose_to_received_ms(),
                            "ms"));
}

int Reception::judge() const {
  int exit_code = kExitOk;
  // Without --frames the end of the stream is the expected end.
  if (!ended_.empty() && (command_.frames != 0 || report_.frames() == 0)) {
    exit_code = fail(kExitFailure, fmt::format("{} of {} frames received: {}", report_.frames(),
                                               command_.frames, ended_));
  } else if (!ended_.empty()) {
    warn(ended_);
  }
  const client::ReceiveCounters counters = stream_.counters();
  if (counters.lost > 0 || report_.unflagged_gaps() > 0 || counters.crc_errors > 0 ||
      counters.partial > 0) {
    exit_code = fail(
        kExitFailure,
        fmt::format("{} frames lost, {} gaps not flagged, {} partial, {} CRC errors", counters.lost,
                    report_.unflagged_gaps(), counters.partial, counters.crc_errors));
  }
  return exit_code;
}

Json Reception::json() const {
  const client::FrameClient& client = stream_.client();
  const client::ChannelDescription& channel = stream_.channel();
  Json json = Json::object();
  json.set("url", command_.url).set("device", client.server().device);
  json.set("scenario", client.server().scenario).set("channel", channel.name);
  json.set("band", channel.band).set("width", channel.width_px);
  json.set("height", channel.height_px);
  json.set("window_x", channel.window_x_px).set("window_y", channel.window_y_px);
  json.set("window_width", channel.window_width_px).set("window_height", channel.window_height_px);
  json.set("output", output_text(channel.output_steps));
  json.set("sensor_width", channel.sensor_width_px);
  json.set("sensor_height", channel.sensor_height_px).set("frames", report_.frames());
  json.set("seconds", std::chrono::duration<double>(last_frame_ - start_).count());
  json.set("compression", terms_.compression);
  json.set("pixel_bytes", report_.pixel_bytes());
  json.set("sent_pixel_bytes", report_.sent_pixel_bytes());
  json.set("error_correction", to_string(terms_.fec)).set("resend", terms_.resend);
  json.set("counters", counters_json(stream_.counters())).set("flags", report_.flags_json());
  json.set("motion", report_.motion_json());
  json.set("unflagged_gaps", report_.unflagged_gaps());
  json.set("every_nth", terms_.every_nth).set("reconnects", stream_.reconnects());
  json.set("runs", report_.runs());
  json.set("pose_to_received_ms", latency_json(report_.pose_to_received_ms()));
  json.set("send_to_received_ms", latency_json(report_.send_to_received_ms()));
  json.set("interval_ms", latency_json(report_.interval_ms()));
  json.set("stages", report_.stages_json());
  json.set("receive_buffer_bytes", client.receive_buffer_bytes());
  json.set("receive_buffer_advice", client.receive_buffer_advice());
  return json;
}

int run(const ReceiveOptions& command) {
  if (command.out) {
    if (auto made = make_directory(*command.out); !made) return fail(made.error());
  }
  if (const int code = check(command); code != kExitOk) return code;
  auto stream = StreamSubscription::open(command.url, subscription(command), command.security);
  if (!stream) return fail_call(stream.error());
  return Reception(command, *stream).run();
}

void add_options(CommandLine& line, ReceiveOptions& options) {
  line.option("url", options.url,
              "Control address of the daemon; the scheme chooses how frames travel: "
              "tcp://host:port or udp://host:port; shm://name: shared memory of a daemon on "
              "this host that has stream.shm = \"name\"")
      .required()
      .type_name("URL");
  line.count("--frames", options.frames, "Stop after this many; 0: until interrupted");
  line.output_folder("--out", options.out,
                     "Folder for frame_NNNNNN.exr and .png (apparent temperatures by the band's "
                     "response where the "
                     "daemon tells it, else as of a rectangular band)");
  line.option("--name", options.channel_name, "Channel; default: the first that fits")
      .type_name("NAME");
  line.option("--channel", options.channel_kind, "Channel kind; default: any")
      .one_of({"injection", "projector"});
  line.option("--band", options.band, "Band; default: any").type_name("NAME");
  line.option("--sensor", options.sensor, "Sensor; default: any").type_name("NAME");
  line.option("--multicast", options.multicast_group, "UDP: group to join instead of unicast")
      .type_name("ADDRESS");
  line.seconds("--timeout-s", options.timeout_s, "Give up when no frame comes for this long")
      .positive()
      .show_default();
  add_error_correction(line, options.fec);
  line.flag("--resend", options.resend,
            "UDP, daemon in host-step: ask for fragments that are missing");
  line.flag("--compress", options.compress,
            "TCP: frames losslessly compressed (stream.compression of the daemon)");
  line.flag("--every-frame", options.every_frame, "TCP, shm: end rather than skip frames");
  line.option("--every", options.every_nth,
              "Only frames 1, 1 + N, 1 + 2 N, ... of a run; those left out are no gap")
      .type_name("N")
      .in_range(1U, 1000U)
      .show_default();
  line.flag("--reconnect", options.reconnect,
            "When the stream ends, connect again and go on, until no frame came for --timeout-s");
  add_security(line, options.security);
  add_png_of(line, options.png_of, false);
  line.option("--min-k", options.min_k, "Lower limit of the PNG's colours").show_default();
  line.option("--max-k", options.max_k, "Upper limit of the PNG's colours").show_default();
  add_json(line, options.json);
}

}  // namespace

void add_receive(CommandLine& tool) {
  tool.command<ReceiveOptions>(
      {.name = "receive",
       .text = "Receive frames, check sequence and CRC, print the latency histogram; exits 1 when "
               "frames "
               "were lost or a gap was not flagged",
       .example = "emit receive tcp://127.0.0.1:7000 --frames 100 --out frames"},
      add_options, run);
}

}  // namespace emit::tool
