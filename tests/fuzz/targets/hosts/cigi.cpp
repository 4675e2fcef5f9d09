// SPDX-License-Identifier: Apache-2.0
// Fuzz target: one CIGI message of a host or of an image generator, version 3.3 or 4.0.
#include <algorithm>
#include <array>
#include <vector>

#include "emit/protocol/cigi.hpp"
#include "fuzz/fuzz_input.hpp"

namespace {

using namespace emit;
using namespace emit::protocol::cigi;

/// Checks that a packet was written to the bytes that it was read from, apart from reserved bits,
/// which the writer leaves at 0, and from the tail of a packet that is longer than its definition.
void check_canonical(std::span<const std::byte> read, std::span<const std::byte> written) {
  fuzz::require(written.size() <= read.size(), "a packet does not grow");
  // A text may drop its padding, and a longer packet its tail. Their sizes differ then.
  if (written.size() != read.size()) return;
  for (std::size_t i = 0; i < written.size(); ++i) {
    fuzz::require(((read[i] ^ written[i]) & written[i]) == std::byte{0},
                  "a packet differs from what was read in reserved bits alone");
  }
}

void check_message(std::span<const std::byte> message, Sender sender) {
  Reader reader(message, sender);
  std::vector<std::byte> memory(message.size());
  std::vector<Packet> packets;
  // The writer begins when version and byte order are known.
  Writer writer(memory, reader.version(), reader.byte_order());
  Packet packet;
  Step step = Step::packet;
  for (std::size_t steps = 0; step == Step::packet || step == Step::refused; ++steps) {
    fuzz::require(steps <= message.size() / 8, "a message has an end");
    step = reader.next(packet);
    std::array<char, kFaultTextBytes> text;
    if (step != Step::packet) {
      fuzz::require(step == Step::end || reader.fault(), "what is refused has a fault");
      fuzz::require(fault_text(reader.fault(), text).size() < text.size(), "a text fits");
      continue;
    }
    const std::size_t before = writer.message().size();
    fuzz::require(!writer.add(packet), "an accepted packet can be said again");
    check_canonical(reader.packet_bytes(), writer.message().subspan(before));
    packets.push_back(packet);
  }
  Reader again(writer.message(), sender);
  for (const Packet& each : packets) {
    fuzz::require(again.next(packet) == Step::packet && packet == each,
                  "what was said again is the same");
  }
  if (!packets.empty()) {
    fuzz::require(again.next(packet) == Step::end && again.byte_order() == reader.byte_order() &&
                      again.version() == reader.version(),
                  "nothing was added");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = fuzz::as_bytes(data, size);
  check_message(bytes, Sender::host);
  check_message(bytes, Sender::ig);
  return 0;
}
