// SPDX-License-Identifier: Apache-2.0
// Fuzz target: answers of a controller that speaks the ACUTROL command language, in pieces that end
// with '|'. The same bytes are lines to a simulated controller.
#include <string_view>

#include "axes/acutrol_host.hpp"
#include "axes/acutrol_table.hpp"
#include "fuzz/fuzz_input.hpp"

namespace {

using namespace emit;
using protocol::AxesMode;

/// Modes of the commands, one after the other.
constexpr std::array kModes = {AxesMode::park,   AxesMode::park,   AxesMode::park, AxesMode::follow,
                               AxesMode::follow, AxesMode::follow, AxesMode::park, AxesMode::off};

void answer_as_controller(std::string_view bytes) {
  server::AcutrolTable table(2);
  server::LineSplitter splitter;
  std::int64_t now_ns = 0;
  while (splitter.next(bytes)) {
    now_ns += 1'000'000;
    const std::string_view answer = table.answer(splitter.line(), now_ns);
    fuzz::require(answer.ends_with("\r\n"), "each line has an answer");
    fuzz::require(protocol::check(table.command(now_ns)) == protocol::AxesFault::none,
                  "commands to the table are sound");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view bytes(reinterpret_cast<const char*>(data), size);
  answer_as_controller(bytes);

  server::Counters counters;
  server::EventLog events(16, counters);
  server::AcutrolHost::Axis axis;
  axis.limits = {-2.0, 2.0, 5.0, 50.0};
  auto made = server::AcutrolHost::create({axis}, counters, events);
  fuzz::require(made.has_value(), "the axes are sound");
  server::AcutrolHost& host = *made;
  host.start();
  protocol::AxesCommand command;
  std::int64_t now_ns = 1'000'000'000;
  for (std::size_t turn = 0; !bytes.empty() && turn < 64; ++turn) {
    const std::size_t piece = std::min(bytes.find('|'), bytes.size());
    command.counter = turn + 1;
    command.mode = kModes[turn % kModes.size()];
    command.count = command.mode == AxesMode::follow ? 1 : 0;
    command.axes[0].angle_rad = 0.01 * static_cast<double>(turn);
    const std::string_view lines = host.lines(command, now_ns);
    fuzz::require(lines.empty() || lines.ends_with("\r\n"), "lines are whole");
    now_ns += 1'000'000;
    host.take(bytes.substr(0, piece), now_ns);
    bytes.remove_prefix(std::min(piece + 1, bytes.size()));
    if (const auto monitor = host.monitor()) {
      fuzz::require(protocol::check(*monitor) == protocol::AxesFault::none && monitor->count == 1,
                    "reports are sound");
      fuzz::require(monitor->time_ns < now_ns && monitor->command_counter <= command.counter,
                    "reports are of the past");
    }
    if (host.order_lost()) host.start();
  }
  return 0;
}
