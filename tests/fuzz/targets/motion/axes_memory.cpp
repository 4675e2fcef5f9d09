// SPDX-License-Identifier: Apache-2.0
// Fuzz target: the blocks of memory between a host and the controller of a motion simulator.
#include "emit/protocol/axes_memory.hpp"

#include <array>
#include <cstring>

#include "fuzz/fuzz_input.hpp"

namespace {

using namespace emit;
using protocol::AxesLoadStatus;

/// Reads what a block holds, and checks that a message that is taken can be said again.
template <class Message, std::size_t Words>
void look(std::span<std::uint64_t, Words> block) {
  Message message;
  message.counter = 7;
  std::uint64_t seen = 0;
  const protocol::AxesLoad load = protocol::load_axes(block, seen, message);
  const std::uint64_t last = protocol::latest_counter(block);
  switch (load.status) {
    case AxesLoadStatus::nothing:
      fuzz::require(last == 0, "a block with a counter has a message");
      break;
    case AxesLoadStatus::torn:
      fuzz::require(block.front() != block.back() && seen == 0, "a torn block has two counters");
      break;
    case AxesLoadStatus::refused:
      fuzz::require(load.fault != protocol::AxesFault::none && seen == last,
                    "what is refused has a reason and is seen");
      break;
    case AxesLoadStatus::done:
      fuzz::require(protocol::check(message) == protocol::AxesFault::none && seen == last &&
                        message.counter == last,
                    "what is taken passes the checks");
      break;
  }
  if (load.status != AxesLoadStatus::done) {
    fuzz::require(message.counter == 7, "what is not taken changes nothing");
    return;
  }
  std::array<std::uint64_t, Words> again{};
  protocol::store_axes(std::span(again), message);
  Message read;
  seen = 0;
  fuzz::require(protocol::load_axes(std::span(again), seen, read).status == AxesLoadStatus::done &&
                    read.counter == message.counter && read.count == message.count,
                "what is taken can be said again");
  fuzz::require(protocol::load_axes(block, seen, read).status == AxesLoadStatus::nothing,
                "a message is taken once");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::array<std::uint64_t, protocol::kAxesMonitorWords> words{};
  std::memcpy(words.data(), data, std::min(size, sizeof(words)));
  look<protocol::AxesMonitor>(std::span(words));
  look<protocol::AxesCommand>(std::span(words).first<protocol::kAxesCommandWords>());
  return 0;
}
