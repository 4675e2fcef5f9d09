// SPDX-License-Identifier: Apache-2.0
// Fuzz target: an answer of ptp4l's management socket, behind its domain and sequence number.
#include "fuzz/fuzz_input.hpp"
#include "telemetry/ptp_status.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  fuzz::InputReader input(fuzz::as_bytes(data, size));
  const auto domain = input.number<std::uint8_t>();
  const auto sequence = input.number<std::uint16_t>();
  server::PtpStatus status;
  const auto answer = server::take_ptp_answer(input.rest(), domain, sequence, status);
  fuzz::require(status.state <= server::PtpState::slave, "a state that there is");
  fuzz::require(
      answer != server::PtpAnswer::none || (status.grandmaster.empty() && status.offset_ns == 0 &&
                                            status.state == server::PtpState::unknown),
      "what is no answer changes nothing");
  fuzz::require(answer != server::PtpAnswer::time_status || status.grandmaster.size() == 18,
                "an identity has its form");
  return 0;
}
