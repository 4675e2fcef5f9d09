// SPDX-License-Identifier: Apache-2.0
// Fuzz target: a recorder that reads the journal over TCP. The input is the daemon's bytes.
#include "fuzz/daemon_peer.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  auto connection = fuzz::connect_to(fuzz::as_bytes(data, size), protocol::PeerRole::recorder);
  if (!connection) return 0;
  const auto recorder = client::make_recorder(std::move(*connection));
  v1::JournalEntry entry;
  for (;;) {
    const auto more = recorder->receive(entry, 0);
    if (!more || !*more) break;
    fuzz::require(entry.IsInitialized(), "an entry is whole");
  }
  static_cast<void>(recorder->closed());
  return 0;
}
