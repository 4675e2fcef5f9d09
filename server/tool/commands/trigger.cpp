// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <time.h>

#include <array>
#include <cerrno>
#include <chrono>

#include "emit/client/client.hpp"
#include "emit/protocol/trigger.hpp"
#include "emit/protocol/trigger_seal.hpp"
#include "net/key_file.hpp"
#include "net/socket.hpp"
#include "rt/clock.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

struct TriggerOptions {
  std::string to;
  double rate_hz = 100.0;
  std::uint64_t frames = 0;  ///< 0: until interrupted
  bool stamp = false;
  std::filesystem::path key_file;  ///< empty: bare
  std::optional<std::filesystem::path> json;
};

int run(const TriggerOptions& command) {
  const auto url = client::parse_url(command.to);
  if (!url) return fail(kExitUsage, url.error().text);
  if (url->scheme != client::Url::Scheme::udp) {
    return fail(kExitUsage, fmt::format("{}: triggers go by udp://host:port", command.to));
  }
  const auto address = server::resolve({url->host, url->port}, server::Transport::udp, false);
  if (!address) return fail(address.error());
  std::optional<protocol::TriggerSeal> seal;
  if (!command.key_file.empty()) {
    const auto keys = server::read_key_file(command.key_file);
    if (!keys) return fail(keys.error());
    auto made = protocol::TriggerSeal::create(*keys);
    if (!made) return fail(made.error());
    seal = std::move(*made);
  }
  const server::SocketContext context;
  auto socket = server::UdpSocket::open(context, *address);
  if (!socket) return fail(socket.error());

  const InterruptGuard interrupt;
  const server::SystemClock clock;
  protocol::Trigger trigger;
  trigger.run_id = static_cast<std::uint64_t>(clock.tai_ns());
  Progress progress("triggers", command.frames == 0 ? 1 : command.frames);
  const std::int64_t start_ns = clock.tai_ns();
  std::uint64_t failed = 0;
  while (!InterruptGuard::interrupted() &&
         (command.frames == 0 || trigger.number < command.frames)) {
    const std::int64_t due_ns =
        start_ns +
        static_cast<std::int64_t>(static_cast<double>(trigger.number) * 1e9 / command.rate_hz);
    const timespec due{static_cast<time_t>(due_ns / 1'000'000'000),
                       static_cast<long>(due_ns % 1'000'000'000)};
    // The timer is absolute, so that a late trigger does not delay those behind it.
    if (::clock_nanosleep(CLOCK_TAI, TIMER_ABSTIME, &due, nullptr) == EINTR) continue;
    ++trigger.number;
    trigger.edge_ns = command.stamp || seal ? clock.tai_ns() : 0;
    std::array<std::byte, protocol::kSealedTriggerBytes> space;
    std::span<const std::byte> bytes(space);
    if (!seal) {
      protocol::encode(trigger, std::span(space).first<protocol::kTriggerBytes>());
      bytes = bytes.first(protocol::kTriggerBytes);
    } else if (!seal->seal(trigger, space)) {
      return fail(kExitFailure, "the cryptographic library failed");
    }
    if (socket->send_to(bytes, *address).status != server::IoStatus::done) ++failed;
    if (command.frames != 0) progress.advance_to(trigger.number);
  }
  progress.finish();
  const double seconds = static_cast<double>(clock.tai_ns() - start_ns) * 1e-9;
  fmt::print(text_stream(command.json),
             "{} triggers sent in {:.3f} s, {} not taken by the kernel\n", trigger.number - failed,
             seconds, failed);
  if (command.json) {
    Json json = Json::object();
    json.set("sent", trigger.number - failed).set("failed", failed).set("seconds", seconds);
    json.set("rate_hz", command.rate_hz);
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  return failed > 0 ? kExitFailure : kExitOk;
}

void add_options(CommandLine& line, TriggerOptions& options) {
  line.option("to", options.to, "udp://host:port of trigger.udp").required().type_name("URL");
  line.option("--rate", options.rate_hz, "Triggers a second, by an absolute timer on CLOCK_TAI")
      .type_name("HZ")
      .in_range(0.01, 10'000.0)
      .show_default();
  line.count("--frames", options.frames, "Triggers to send; 0: until interrupted");
  line.flag("--stamp", options.stamp, "Say in each when it was sent, so that its delay is judged");
  line.path(
      "--key-file", options.key_file,
      "A MAC in each by the file's first key, as in the daemon's host.key_file; implies --stamp");
  add_json(line, options.json);
}

}  // namespace

void add_trigger(CommandLine& tool) {
  tool.command<TriggerOptions>(
      {.name = "trigger",
       .text = "Sync source stand-in: sends triggers to pacing.mode = \"trigger\"",
       .example = "emit trigger udp://127.0.0.1:7003 --rate 100 --frames 1000"},
      add_options, run);
}

}  // namespace emit::tool
