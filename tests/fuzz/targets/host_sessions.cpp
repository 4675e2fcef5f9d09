// SPDX-License-Identifier: Apache-2.0
// Fuzz target: authenticated host datagrams as the daemon receives them, and its answers as a host
// receives them. The input is a sequence of pieces, each behind a byte of instructions and its
// length (u16). Bits of the byte: 1 the piece is a payload that gets a genuine header and MAC of
// the session, 2 the MAC of the piece is corrected by the opening key, 4 by the session's key.
#include <memory>
#include <vector>

#include "agents/receiver/host_sessions.hpp"
#include "fuzz/fuzz_input.hpp"

namespace {

using namespace emit;
using server::HostSessions;
using Verdict = HostSessions::Verdict;

/// Peer that knows the key, so what it seals is genuine.
struct Peer {
  protocol::SessionMac mac = std::move(*protocol::SessionMac::create());
  protocol::SharedKey shared = protocol::make_shared_key({}, mac);
  protocol::SessionKey session{};
  std::uint64_t counter = 0;
  std::vector<std::byte> space = std::vector<std::byte>(70'000);
};

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Peer peer;
  static const protocol::SessionKey key{};
  // The table is kept from input to input, because creating it takes long. Each input is another
  // session, and the oldest sessions are forgotten.
  static auto sessions = std::move(*HostSessions::create(std::span(&key, 1), 0));
  static std::uint64_t session_id = 0;
  ++session_id;
  fuzz::InputReader input(fuzz::as_bytes(data, size));
  peer.counter = 0;
  bool challenged = false;
  const auto challenge_of = [&](const protocol::SessionHeader& open) {
    const auto challenge = sessions->challenge(open);
    const auto read = protocol::parse_session_datagram(challenge);
    fuzz::require(read && read->header.counter == open.counter, "a challenge echoes its opening");
    const auto content = protocol::parse_challenge(read->payload);
    fuzz::require(content.has_value(), "a challenge holds a nonce");
    peer.session = protocol::session_key(peer.shared, session_id, content->nonce, peer.mac);
    challenged = true;
  };
  while (!input.empty()) {
    const auto instructions = input.number<std::uint8_t>();
    const auto piece = input.bytes(input.number<std::uint16_t>());
    if ((instructions & 1) != 0) {
      peer.mac.set_key(peer.shared.open_key);
      const auto open = peer.mac.seal({protocol::SessionKind::open, peer.shared.id, session_id, 1},
                                      peer.space, 0);
      if (!challenged) challenge_of(sessions->take(open).header);
      std::copy(piece.begin(), piece.end(), peer.space.begin() + protocol::kSessionHeaderBytes);
      peer.mac.set_key(peer.session);
      const auto sealed = peer.mac.seal(
          {protocol::SessionKind::host_frame, peer.shared.id, session_id, ++peer.counter},
          peer.space, piece.size());
      fuzz::require(sealed.size() == piece.size() + 48 || piece.size() > 65'459,
                    "whatever fits is sealed");
      // A session stays while there are fewer than the table holds, and one host cannot exceed
      // that.
      if (!sealed.empty()) {
        const auto taken = sessions->take(sealed);
        fuzz::require(taken.verdict == Verdict::host_frame || taken.verdict == Verdict::replayed,
                      "what is genuine is taken");
        if (taken.verdict == Verdict::host_frame) {
          fuzz::require(std::ranges::equal(taken.payload, piece), "sealing changes no bit");
          fuzz::require(!sessions->answer(taken.place, taken.generation, 3).empty(),
                        "a session can be answered");
        }
      }
      continue;
    }
    std::vector<std::byte> datagram(piece.begin(), piece.end());
    if ((instructions & 6) != 0 && datagram.size() >= 48) {
      peer.mac.set_key((instructions & 2) != 0 ? peer.shared.open_key : peer.session);
      // The call seal() writes a header of its own. Seal the header that the input holds, to keep
      // it.
      if (auto read = protocol::parse_session_datagram(datagram)) {
        read->header.session_id = session_id;
        fuzz::require(!peer.mac.seal(read->header, datagram, read->payload.size()).empty(),
                      "what was read can be sealed");
      }
    }
    const auto taken = sessions->take(datagram);
    const auto sealed_by = [&](const protocol::SessionKey& by) {
      peer.mac.set_key(by);
      return peer.mac.verify(datagram);
    };
    if (taken.verdict == Verdict::host_frame || taken.verdict == Verdict::replayed) {
      fuzz::require(sealed_by(peer.session), "nothing passes without the key");
    }
    if (taken.verdict == Verdict::open) {
      fuzz::require(sealed_by(peer.shared.open_key), "nothing is answered without the key");
      static_cast<void>(sessions->challenge(taken.header));
    }
  }
  return 0;
}
