// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/host_session.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "wire_bytes.hpp"

namespace emit::protocol {

std::optional<SessionDatagram> parse_session_datagram(
    std::span<const std::byte> datagram) noexcept {
  if (datagram.size() < kSessionHeaderBytes + kSessionTagBytes ||
      wire::get<std::uint32_t>(datagram, 0) != kSessionMagic ||
      wire::get<std::uint8_t>(datagram, 4) != kSessionVersion) {
    return std::nullopt;
  }
  const auto kind = wire::get<std::uint8_t>(datagram, 5);
  if (kind < static_cast<std::uint8_t>(SessionKind::open) ||
      kind > static_cast<std::uint8_t>(SessionKind::answer)) {
    return std::nullopt;
  }
  SessionDatagram out;
  out.header.kind = static_cast<SessionKind>(kind);
  out.header.key_id = wire::get<std::uint64_t>(datagram, 8);
  out.header.session_id = wire::get<std::uint64_t>(datagram, 16);
  out.header.counter = wire::get<std::uint64_t>(datagram, 24);
  out.payload = datagram.subspan(kSessionHeaderBytes,
                                 datagram.size() - kSessionHeaderBytes - kSessionTagBytes);
  return out;
}

std::array<std::byte, kChallengeBytes> encode(const Challenge& challenge) noexcept {
  std::array<std::byte, kChallengeBytes> out{};
  std::copy(challenge.nonce.begin(), challenge.nonce.end(), out.begin());
  out.back() = challenge.session_known ? std::byte{1} : std::byte{0};
  return out;
}

std::optional<Challenge> parse_challenge(std::span<const std::byte> payload) noexcept {
  if (payload.size() != kChallengeBytes) return std::nullopt;
  Challenge out;
  std::copy_n(payload.begin(), kSessionNonceBytes, out.nonce.begin());
  out.session_known = payload.back() == std::byte{1};
  return out;
}

SharedKey make_shared_key(const SessionKey& key, SessionMac& mac) noexcept {
  SharedKey out;
  out.key = key;
  mac.set_key(key);
  out.open_key = mac.derive("emitd host open", {});
  const SessionKey name = mac.derive("emitd host key id", {});
  out.id = wire::get<std::uint64_t>(name, 0);
  return out;
}

SessionKey session_key(const SharedKey& shared, std::uint64_t session_id, const SessionNonce& nonce,
                       SessionMac& mac) noexcept {
  std::array<std::byte, sizeof session_id + kSessionNonceBytes> context;
  wire::put(std::span<std::byte>(context), 0, session_id);
  std::copy(nonce.begin(), nonce.end(), context.begin() + sizeof session_id);
  mac.set_key(shared.key);
  return mac.derive("emitd host session", context);
}

bool ReplayWindow::accept(std::uint64_t counter) noexcept {
  if (counter == 0) return false;
  const std::uint64_t word = counter / 64;
  if (counter > highest_) {
    const std::uint64_t first = highest_ / 64 + 1;
    // Clear the words that the window moves into. They hold counters that are too old.
    for (std::uint64_t i = 0; i < kWords && i + first <= word; ++i) {
      seen_[(word - i) % kWords] = 0;
    }
    highest_ = counter;
  } else if (highest_ - counter >= kSpan) {
    return false;
  }
  const std::uint64_t bit = std::uint64_t{1} << (counter % 64);
  std::uint64_t& bits = seen_[word % kWords];
  if ((bits & bit) != 0) return false;
  bits |= bit;
  return true;
}

physics::Result<std::vector<SessionKey>> parse_key_file(std::string_view text) {
  std::vector<SessionKey> keys;
  const auto digit = [](char c) -> int {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
  };
  std::size_t number = 0;
  while (!text.empty()) {
    ++number;
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    const auto is_blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
    while (!line.empty() && is_blank(line.back())) line.remove_suffix(1);
    while (!line.empty() && is_blank(line.front())) line.remove_prefix(1);
    if (line.empty() || line.front() == '#') continue;
    SessionKey key;
    // The text is a secret, so messages name only the line.
    const auto bad = [&](std::string_view why) {
      return physics::make_error(physics::ErrorCode::config,
                                 fmt::format("line {}: {}", number, why));
    };
    if (line.size() != 2 * key.size()) return bad("a key has 64 hexadecimal digits");
    for (std::size_t i = 0; i < key.size(); ++i) {
      const int high = digit(line[2 * i]);
      const int low = digit(line[2 * i + 1]);
      if (high < 0 || low < 0) return bad("a key has hexadecimal digits only");
      key[i] = static_cast<std::byte>(high * 16 + low);
    }
    if (keys.size() == kMaxFileKeys) return bad(fmt::format("more than {} keys", kMaxFileKeys));
    if (std::find(keys.begin(), keys.end(), key) != keys.end()) return bad("a key twice");
    keys.push_back(key);
  }
  if (keys.empty()) return physics::make_error(physics::ErrorCode::config, "no key in it");
  return keys;
}

}  // namespace emit::protocol
