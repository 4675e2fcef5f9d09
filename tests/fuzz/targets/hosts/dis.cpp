// SPDX-License-Identifier: Apache-2.0
// Fuzz target: one datagram of DIS, versions 6 and 7, with the clock and the dead reckoning of its
// PDUs.
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "emit/protocol/dis.hpp"
#include "fuzz/fuzz_input.hpp"

namespace {

using namespace emit;
using namespace emit::protocol::dis;

/// Checks that a PDU was written to the bytes that it was read from, apart from reserved bits and
/// the status of version 7, which the writer leaves at 0, the family, and bytes behind the fields.
void check_canonical(std::span<const std::byte> read, std::span<const std::byte> written) {
  fuzz::require(written.size() <= read.size(), "a PDU does not grow");
  for (std::size_t i = 12; i < written.size(); ++i) {
    fuzz::require(((read[i] ^ written[i]) & written[i]) == std::byte{0},
                  "a PDU differs from what was read in reserved bits alone");
  }
}

void check_again(const Reader& reader, const Pdu& pdu) {
  std::vector<VariableParameter> parameters;
  for (std::size_t i = 0; i < reader.parameters().size(); ++i) {
    parameters.push_back(reader.parameters()[i]);
  }
  std::vector<std::byte> memory(reader.pdu_bytes().size());
  Writer writer(memory, reader.header().version, reader.header().exercise_id);
  fuzz::require(!writer.add(pdu, reader.header().timestamp, parameters),
                "an accepted PDU can be said again");
  check_canonical(reader.pdu_bytes(), writer.datagram());
  Reader again(writer.datagram());
  Pdu same;
  fuzz::require(again.next(same) == Step::pdu && same == pdu, "what was said again is the same");
  fuzz::require(again.parameters().size() == parameters.size(), "with all parameters");
  fuzz::require(again.next(same) == Step::end, "nothing was added");
}

void check_prediction(const EntityState& state) {
  for (const double dt_s : {-0.5, 0.0, 1e-9, 0.01, 10.0}) {
    const Predicted p = predict(motion_of(state), dt_s);
    bool finite = true;
    for (int i = 0; i < 3; ++i) {
      finite =
          finite && std::isfinite(p.position_ecef_m[i]) && std::isfinite(p.velocity_ecef_m_s[i]);
      for (int k = 0; k < 3; ++k) finite = finite && std::isfinite(p.body_from_ecef[i][k]);
    }
    fuzz::require(finite, "a prediction is finite");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Reader reader(fuzz::as_bytes(data, size));
  DisClock clock;
  std::int64_t received_ns = 0;
  std::optional<std::int64_t> latest_ns;
  Pdu pdu;
  Step step = Step::pdu;
  for (std::size_t steps = 0; step != Step::end && step != Step::broken; ++steps) {
    fuzz::require(steps <= size / 12 + 1, "a datagram has an end");
    step = reader.next(pdu);
    if (step == Step::refused || step == Step::broken) {
      std::array<char, kFaultTextBytes> text;
      fuzz::require(static_cast<bool>(reader.fault()), "what is refused has a fault");
      fuzz::require(fault_text(reader.fault(), text).size() < text.size(), "a text fits");
    }
    if (step != Step::pdu) continue;
    check_again(reader, pdu);
    if (const auto* state = std::get_if<EntityState>(&pdu)) check_prediction(*state);
    received_ns += static_cast<std::int64_t>(reader.header().exercise_id) * 40'000'000'000;
    const auto reading = clock.read(reader.header().timestamp, received_ns);
    using Order = DisClock::Order;
    if (reading.order == Order::first) {
      fuzz::require(!latest_ns.has_value(), "one stamp is the first");
    } else if (reading.order == Order::duplicate) {
      fuzz::require(reading.time_ns == latest_ns.value(), "a duplicate has the latest time");
    } else if (reading.order == Order::late) {
      fuzz::require(reading.time_ns < latest_ns.value(), "a late stamp is older");
    } else {
      fuzz::require(reading.time_ns > latest_ns.value(), "time goes on");
    }
    if (reading.order != Order::late) latest_ns = reading.time_ns;
  }
  return 0;
}
