// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <memory>
#include <thread>

#include "emit/client/client.hpp"
#include "emit/protocol/record/capture_reader.hpp"
#include "net/socket.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/streams/pose_log.hpp"
#include "tool/streams/stream_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"

namespace emit::tool {
namespace {

struct SendOptions {
  std::filesystem::path log;
  std::string to;
  std::string control;   ///< with step over UDP: where frames can be watched
  double rate_hz = 0.0;  ///< 0: as recorded
  bool step = false;
  bool as_captured = false;
  std::uint64_t frames = 0;  ///< 0: all
  std::uint64_t every = 1;
  double timeout_s = 60.0;
  std::optional<std::uint64_t> run_id;  ///< absent: from the wall clock
  std::uint16_t host_port = 7001;       ///< of captures: where the host's datagrams went
  std::optional<std::filesystem::path> json;
  client::Security security;
};

using Clock = std::chrono::steady_clock;

struct Refusals {
  std::uint64_t total = 0;
  std::map<std::uint32_t, std::uint64_t> by_code;

  /// Prints each code once: a bad log would otherwise flood the terminal.
  void note(const client::ServerStatus& status) {
    if (status.ok()) return;
    ++total;
    if (++by_code[status.code] == 1) {
      warn(fmt::format("daemon refused host frame {}: {}", status.host_frame_number, status.text));
    }
  }
};

physics::Result<void> drain_statuses(client::HostClient& host, Refusals& refusals,
                                     std::int64_t timeout_ns) {
  while (true) {
    const auto status = host.receive_status(timeout_ns);
    if (!status) return tl::unexpected(status.error());
    if (!*status) return {};
    refusals.note(**status);
    timeout_ns = 0;
  }
}

/// Run ids of this sending: the log's own would meet those of an earlier sending, which emitd takes
/// for the same run, or refuses once another has replaced it (wire.md section 5).
class RunIds {
 public:
  explicit RunIds(std::optional<std::uint64_t> first)
      : next_(first.value_or(
            static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(
                                           std::chrono::system_clock::now().time_since_epoch())
                                           .count()))) {}

  /// The id to send under: a new one whenever the log's changes.
  std::uint64_t of(std::uint64_t in_log) {
    if (!started_ || in_log_ != in_log) {
      started_ = true;
      in_log_ = in_log;
      current_ = next_++;
    }
    return current_;
  }
  [[nodiscard]] std::uint64_t current() const noexcept { return current_; }

 private:
  std::uint64_t next_;
  std::uint64_t current_ = 0;
  bool started_ = false;
  std::uint64_t in_log_ = 0;
};

/// Waits until a frame made from this pose, or a newer one, has arrived; false on timeout.
physics::Result<bool> wait_for_frame(client::FrameClient& watcher, client::HostClient& host,
                                     Refusals& refusals, std::uint64_t host_frame_number,
                                     double timeout_s) {
  const auto end = Clock::now() + std::chrono::duration<double>(timeout_s);
  const std::uint64_t refused_before = refusals.total;
  while (Clock::now() < end && !InterruptGuard::interrupted()) {
    const auto frame = watcher.receive(50'000'000);
    if (!frame) return tl::unexpected(frame.error());
    if (*frame != nullptr && (*frame)->header.host_frame_number >= host_frame_number) return true;
    if (*frame == nullptr) {
      if (auto drained = drain_statuses(host, refusals, 0); !drained) {
        return tl::unexpected(drained.error());
      }
      if (refusals.total > refused_before) return true;  // no frame comes of a refused pose
    }
  }
  return false;
}

/// Sends the datagrams of a capture as they are, at the times of the capture or at --rate.
int send_as_captured(const SendOptions& command, const client::Url& url) {
  if (url.scheme != client::Url::Scheme::udp || command.step || command.every > 1) {
    return fail(kExitUsage, "--as-captured sends over udp, without --step and --every");
  }
  if (!protocol::CaptureReader::is_capture(command.log)) {
    return fail(kExitUsage,
                fmt::format("--as-captured: {} is no pcap or pcapng file", command.log.string()));
  }
  auto capture = protocol::CaptureReader::open(command.log, command.host_port);
  if (!capture) return fail(capture.error());
  const auto where = server::resolve({url.host, url.port}, server::Transport::udp, false);
  if (!where) return fail(where.error());
  const server::SocketContext context;
  auto socket = server::UdpSocket::open(context, *where);
  if (!socket) return fail(socket.error());

  const InterruptGuard interrupt;
  std::uint64_t sent = 0;
  std::uint64_t failed = 0;
  std::optional<std::int64_t> first_ns;
  const auto start = Clock::now();
  while (!InterruptGuard::interrupted() && (command.frames == 0 || sent < command.frames)) {
    const auto more = capture->next();
    if (!more) return fail(more.error());
    if (!*more) break;
    if (command.rate_hz > 0.0) {
      std::this_thread::sleep_until(start +
                                    std::chrono::nanoseconds(static_cast<std::int64_t>(
                                        static_cast<double>(sent) * 1e9 / command.rate_hz)));
    } else {
      const auto time_ns = capture->time_ns();
      if (!time_ns) {
        return fail(kExitUsage, fmt::format("{}: packet {} has no time: give --rate",
                                            command.log.string(), capture->packet()));
      }
      if (!first_ns) first_ns = time_ns;
      std::this_thread::sleep_until(start + std::chrono::nanoseconds(*time_ns - *first_ns));
    }
    const bool done = socket->send_to(capture->payload(), *where).status == server::IoStatus::done;
    ++(done ? sent : failed);
  }
  if (const auto notes = capture->notes()) warn(*notes);
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  fmt::print(text_stream(command.json), "{} datagrams sent in {:.3f} s, {} refused by the system\n",
             sent, seconds, failed);
  if (command.json) {
    Json json = Json::object();
    json.set("sent", sent).set("seconds", seconds).set("failed", failed);
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  return sent > 0 && failed == 0 ? kExitOk : kExitFailure;
}

int run(const SendOptions& command) {
  const auto url = client::parse_url(command.to);
  if (!url) return fail(kExitUsage, url.error().text);
  if (command.as_captured) return send_as_captured(command, *url);
  const bool udp = url->scheme == client::Url::Scheme::udp;
  if (command.step && udp && command.control.empty()) {
    return fail(kExitUsage, "--step over udp needs --control tcp://host:port to watch the frames");
  }
  if (udp && command.security.tls() && command.security.key_file.empty() &&
      command.control.empty()) {
    return fail(kExitUsage, "--tls-* over udp needs --control tcp://host:port to agree on a key");
  }
  auto log = PoseLog::open(command.log, command.host_port);
  if (!log) return fail(log.error());

  std::unique_ptr<client::FrameClient> watcher;
  if (command.step) {
    auto connected =
        client::FrameClient::connect(command.control.empty() ? command.to : command.control,
                                     client::kConnectTimeoutNs, command.security);
    if (!connected) return fail_call(connected.error());
    watcher = std::move(*connected);
    if (auto subscribed = watcher->subscribe({}); !subscribed) return fail(subscribed.error());
  }
  client::Security security = command.security;
  security.control = command.control;
  auto connected = client::HostClient::connect(command.to, client::kConnectTimeoutNs, security);
  if (!connected) return fail_call(connected.error());
  client::HostClient& host = **connected;

  const InterruptGuard interrupt;
  Refusals refusals;
  RunIds run_ids(command.run_id);
  std::uint64_t seen = 0;
  std::uint64_t sent = 0;
  std::int64_t first_sim_ns = 0;
  const auto start = Clock::now();
  auto frame = std::make_unique<protocol::HostFrameData>();
  while (!InterruptGuard::interrupted() && (command.frames == 0 || sent < command.frames)) {
    const auto more = log->next();
    if (!more) return fail(more.error());
    if (!*more) break;
    if (seen++ % command.every != 0) continue;
    *frame = log->host();
    frame->run_id = run_ids.of(frame->run_id);
    if (command.every > 1) frame->frame_number = sent + 1;
    if (sent == 0) first_sim_ns = frame->sim_time_ns;
    if (!command.step) {
      const auto offset = command.rate_hz > 0.0
                              ? std::chrono::nanoseconds(static_cast<std::int64_t>(
                                    static_cast<double>(sent) * 1e9 / command.rate_hz))
                              : std::chrono::nanoseconds(frame->sim_time_ns - first_sim_ns);
      std::this_thread::sleep_until(start + offset);
    }
    if (auto done = host.send(*frame); !done) return fail(done.error());
    ++sent;
    if (command.step) {
      const auto arrived =
          wait_for_frame(*watcher, host, refusals, frame->frame_number, command.timeout_s);
      if (!arrived) return fail(arrived.error());
      if (!*arrived && !InterruptGuard::interrupted()) {
        return fail(kExitFailure, fmt::format("no frame for host frame {} within {:g} s",
                                              frame->frame_number, command.timeout_s));
      }
    } else if (auto drained = drain_statuses(host, refusals, 0); !drained) {
      return fail(drained.error());
    }
  }
  // Refusals of the last poses are still on their way.
  if (auto drained = drain_statuses(host, refusals, 200'000'000); !drained) {
    warn(drained.error().text);
  }
  if (const auto notes = log->notes()) warn(*notes);
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  fmt::print(text_stream(command.json), "{} poses sent in {:.3f} s, {} refused\n", sent, seconds,
             refusals.total);
  if (command.json) {
    Json codes = Json::object();
    for (const auto& [code, count] : refusals.by_code) codes.set(fmt::format("{}", code), count);
    Json json = Json::object();
    json.set("sent", sent)
        .set("run_id", run_ids.current())
        .set("seconds", seconds)
        .set("refused", refusals.total);
    json.set("refused_by_code", std::move(codes));
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  if (sent == 0) {
    return fail(kExitFailure, fmt::format("{}: no host frame in the log", command.log.string()));
  }
  return refusals.total > 0 ? kExitFailure : kExitOk;
}

void add_options(CommandLine& line, SendOptions& options) {
  line.path("log", options.log,
            "MCAP log with host frames, journal, CSV with poses (*.csv), or a pcap/pcapng capture "
            "of a host's datagrams")
      .required();
  line.option("--to", options.to, "udp://host:port (host port) or tcp://host:port (control port)")
      .required()
      .type_name("URL");
  line.option("--rate", options.rate_hz, "Poses a second; default: as the log's sim times say")
      .type_name("HZ")
      .positive();
  line.flag("--step", options.step,
            "Wait until the daemon has sent the frame before the next pose");
  line.count("--frames", options.frames, "Send at most this many poses; 0: all");
  line.count("--every", options.every, "Send every Nth pose, numbered anew").positive();
  line.option("--control", options.control,
              "With udp: control port to watch the frames (--step) and to agree on a key over "
              "TLS (--tls-*), tcp://host:port")
      .type_name("URL");
  line.path("--key-file", options.security.key_file,
            "udp: pre-shared key (its first line) for the MAC of every datagram, as in the "
            "daemon's host.key_file");
  add_security(line, options.security);
  line.option("--host-port", options.host_port, "Capture: UDP port the host sent to")
      .type_name("PORT")
      .in_range(1, 65535)
      .show_default();
  line.flag("--as-captured", options.as_captured,
            "Capture: send the datagrams to --host-port as they are, of any protocol (CIGI, DIS), "
            "at the times of the capture or at --rate");
  line.option("--run-id", options.run_id,
              "Host run id, not 0; another run in the log counts up. Default: from the clock, "
              "so that a run that follows another needs no reset")
      .type_name("N")
      .positive();
  line.seconds("--timeout-s", options.timeout_s, "With --step: longest wait for a frame")
      .positive()
      .show_default();
  add_json(line, options.json);
}

}  // namespace

void add_send(CommandLine& tool) {
  tool.command<SendOptions>(
      {.name = "send",
       .text = "Host stand-in: plays the poses of a log to a daemon",
       .example = "emit send airfield.mcap --to udp://127.0.0.1:7001 --rate 200"},
      add_options, run);
}

}  // namespace emit::tool
