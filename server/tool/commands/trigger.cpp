// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <time.h>

#include <array>
#include <cerrno>
#include <chrono>

#include "tool/support/console.hpp"
#include "emit/protocol/trigger.hpp"
#include "emit/protocol/trigger_seal.hpp"
#include "tool/support/interrupt.hpp"
#include "emit/client/client.hpp"
#include "net/key_file.hpp"
#include "net/socket.hpp"
#include "tool/support/json.hpp"
#include "rt/clock.hpp"
#include "tool/commands/timing_commands.hpp"

namespace emit::tool {

int run_trigger(const TriggerCommand& command) {
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
  ProgressBar progress("triggers", command.frames == 0 ? 1 : command.frames);
  const std::int64_t start_ns = clock.tai_ns();
  std::uint64_t failed = 0;
  while (!InterruptGuard::interrupted() &&
         (command.frames == 0 || trigger.number < command.frames)) {
    const std::int64_t due_ns =
        start_ns +
        static_cast<std::int64_t>(static_cast<double>(trigger.number) * 1e9 / command.rate_hz);
    const timespec due{static_cast<time_t>(due_ns / 1'000'000'000),
                       static_cast<long>(due_ns % 1'000'000'000)};
    // By an absolute timer: a late trigger does not delay those behind it.
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

}  // namespace emit::tool
