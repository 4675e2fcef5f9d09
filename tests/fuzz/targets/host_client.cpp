// SPDX-License-Identifier: Apache-2.0
// Fuzz target: a host that reads the daemon's answers over TCP. The input is the daemon's bytes.
#include "fuzz/daemon_peer.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  auto connection = fuzz::connect_to(fuzz::as_bytes(data, size), protocol::PeerRole::host);
  if (!connection) return 0;
  const auto host = client::make_tcp_host(std::move(*connection));
  for (;;) {
    const auto status = host->receive_status(0);
    if (!status || !*status) break;
  }
  return 0;
}
