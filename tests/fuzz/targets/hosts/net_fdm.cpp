// SPDX-License-Identifier: Apache-2.0
// Fuzz target: one "native FDM" datagram of FlightGear.
#include <array>
#include <cmath>

#include "emit/protocol/net_fdm.hpp"
#include "fuzz/fuzz_input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  using namespace emit::protocol::net_fdm;
  const auto datagram = fuzz::as_bytes(data, size);
  State state{.altitude_m = 4711.0};
  const State before = state;
  if (const Fault fault = decode(datagram, state)) {
    std::array<char, kFaultTextBytes> text;
    fuzz::require(fault_text(fault, text).size() < text.size(), "a text fits");
    fuzz::require(state == before, "a refused datagram changes nothing");
    return 0;
  }
  fuzz::require(size == kBytes || size == kTankBytes, "a datagram has one of two sizes");
  std::array<std::byte, kBytes> written;
  encode(state, written);
  for (std::size_t i = sizeof(kVersion); i < kBytes; ++i) {
    const std::size_t from = i < kTanksAt ? i : i + size - kBytes;
    fuzz::require(written[i] == std::byte{0} || written[i] == datagram[from],
                  "what was read is written to the same bytes");
  }
  State again;
  fuzz::require(!decode(written, again) && again == state, "what was written is the same");
  const glm::dvec3 rates = body_rates_rad_s(state);
  for (int i = 0; i < 3; ++i) fuzz::require(std::isfinite(rates[i]), "rates are finite");
  return 0;
}
