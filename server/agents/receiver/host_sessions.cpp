// SPDX-License-Identifier: Apache-2.0
#include "agents/receiver/host_sessions.hpp"

#include <sys/random.h>

#include <algorithm>

namespace emit::server {

using protocol::SessionHeader;
using protocol::SessionKind;

HostSessions::HostSessions(protocol::SessionMac work_mac, std::vector<Session> sessions)
    : mac_(std::move(work_mac)), sessions_(std::move(sessions)) {}

physics::Result<std::unique_ptr<HostSessions>> HostSessions::create(
    std::span<const protocol::SessionKey> file_keys, std::size_t max_agreed_keys) {
  auto work_mac = protocol::SessionMac::create();
  if (!work_mac) return tl::unexpected(std::move(work_mac.error()));
  std::vector<Session> places;
  for (std::size_t i = 0; i < kMaxSessions; ++i) {
    auto mac = protocol::SessionMac::create();
    if (!mac) return tl::unexpected(std::move(mac.error()));
    places.emplace_back(std::move(*mac));
  }
  std::unique_ptr<HostSessions> made(new HostSessions(std::move(*work_mac), std::move(places)));
  made->keys_.reserve(file_keys.size() + max_agreed_keys);
  for (const protocol::SessionKey& key : file_keys) made->add_key(kNobody, key);
  if (!made->renew_nonce()) {
    return physics::make_error(physics::ErrorCode::internal, "the system has no random numbers");
  }
  return made;
}

bool HostSessions::renew_nonce() noexcept {
  return ::getrandom(nonce_.data(), nonce_.size(), 0) == static_cast<ssize_t>(nonce_.size());
}

const HostSessions::Key* HostSessions::find_key(std::uint64_t id) const noexcept {
  const auto found = std::find_if(keys_.begin(), keys_.end(),
                                  [id](const Key& key) { return key.shared.id == id; });
  return found != keys_.end() ? &*found : nullptr;
}

HostSessions::Session* HostSessions::find(const SessionHeader& header) noexcept {
  const auto found = std::find_if(sessions_.begin(), sessions_.end(), [&](const Session& session) {
    return session.used && session.session_id == header.session_id &&
           session.key_id == header.key_id;
  });
  return found != sessions_.end() ? &*found : nullptr;
}

HostSessions::Taken HostSessions::take(std::span<const std::byte> datagram) noexcept {
  Taken out;
  const auto read = protocol::parse_session_datagram(datagram);
  if (!read) return out;
  out.header = read->header;
  out.payload = read->payload;
  out.verdict = Verdict::unknown_key;
  const Key* key = find_key(read->header.key_id);
  if (key == nullptr) return out;

  out.verdict = Verdict::bad_mac;
  if (read->header.kind == SessionKind::open) {
    mac_.set_key(key->shared.open_key);
    if (read->payload.empty() && mac_.verify(datagram)) out.verdict = Verdict::open;
    return out;
  }
  if (read->header.kind != SessionKind::host_frame) return out;
  Session* session = find(read->header);
  if (session == nullptr) {
    const protocol::SessionKey fresh =
        protocol::session_key(key->shared, read->header.session_id, nonce_, mac_);
    mac_.set_key(fresh);
    if (!mac_.verify(datagram)) return out;
    session = &begin(read->header, fresh);
    out.began = true;
  } else if (!session->mac.verify(datagram)) {
    return out;
  }
  if (!session->window.accept(read->header.counter)) {
    out.verdict = Verdict::replayed;
    return out;
  }
  session->last_use = ++uses_;
  out.verdict = Verdict::host_frame;
  out.place = static_cast<std::uint32_t>(session - sessions_.data());
  out.generation = session->generation;
  return out;
}

HostSessions::Session& HostSessions::begin(const SessionHeader& header,
                                           const protocol::SessionKey& key) noexcept {
  auto place = std::find_if(sessions_.begin(), sessions_.end(),
                            [](const Session& session) { return !session.used; });
  if (place == sessions_.end()) {
    place = std::min_element(
        sessions_.begin(), sessions_.end(),
        [](const Session& a, const Session& b) { return a.last_use < b.last_use; });
    forget(*place);
  }
  place->used = true;
  place->key_id = header.key_id;
  place->session_id = header.session_id;
  ++place->generation;
  place->answers = 0;
  place->window = {};
  place->mac.set_key(key);
  return *place;
}

void HostSessions::forget(Session& session) noexcept {
  session.used = false;
  session.mac.set_key({});
  // Take a new nonce, because a recording of this session could begin it again under the old one.
  static_cast<void>(renew_nonce());
}

std::span<const std::byte> HostSessions::challenge(const SessionHeader& open) noexcept {
  const Key* key = find_key(open.key_id);
  if (key == nullptr) return {};
  const auto payload = protocol::encode({nonce_, find(open) != nullptr});
  std::copy(payload.begin(), payload.end(), out_.begin() + protocol::kSessionHeaderBytes);
  mac_.set_key(key->shared.open_key);
  return mac_.seal({SessionKind::challenge, open.key_id, open.session_id, open.counter}, out_,
                   payload.size());
}

std::span<std::byte> HostSessions::answer_payload() noexcept {
  return std::span(out_).subspan(protocol::kSessionHeaderBytes, kMaxAnswerBytes);
}

std::span<const std::byte> HostSessions::answer(std::uint32_t place, std::uint32_t generation,
                                                std::size_t payload_bytes) noexcept {
  if (place >= sessions_.size()) return {};
  Session& session = sessions_[place];
  if (!session.used || session.generation != generation) return {};
  return session.mac.seal(
      {SessionKind::answer, session.key_id, session.session_id, ++session.answers}, out_,
      payload_bytes);
}

void HostSessions::add_key(std::uint32_t owner, const protocol::SessionKey& key) {
  keys_.push_back({owner, protocol::make_shared_key(key, mac_)});
}

void HostSessions::remove_key(std::uint32_t owner) noexcept {
  const auto found = std::find_if(keys_.begin(), keys_.end(),
                                  [owner](const Key& key) { return key.owner == owner; });
  if (owner == kNobody || found == keys_.end()) return;
  for (Session& session : sessions_) {
    if (session.used && session.key_id == found->shared.id) forget(session);
  }
  keys_.erase(found);
}

}  // namespace emit::server
