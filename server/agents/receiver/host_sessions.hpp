// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/host_session.hpp"

namespace emit::server {

/// The daemon's end of authenticated host datagrams (docs/wire.md, "Host sessions"). It holds the
/// known keys, the running sessions and the counters seen in each.
///
/// A session's key is derived from a shared key, the host's session id and the daemon's nonce. The
/// nonce is new at every start and whenever a session is forgotten, so that no recorded datagram is
/// ever accepted again. A datagram with a wrong MAC changes nothing here. Thread: one owner. Real
/// time: RT-safe except for adding and removing keys.
class HostSessions {
 public:
  static constexpr std::size_t kMaxSessions = 32;

  enum class Verdict : std::uint8_t {
    host_frame,   ///< genuine and new
    open,         ///< genuine; wants challenge()
    bare,         ///< no session datagram
    unknown_key,  ///< no key has this id
    bad_mac,
    replayed,  ///< genuine, but its counter was seen before or is too old
  };
  struct Taken {
    Verdict verdict = Verdict::bare;
    bool began = false;  ///< first one of its session
    protocol::SessionHeader header;
    std::span<const std::byte> payload;
    /// Names the session for answer().
    std::uint32_t place = 0;
    std::uint32_t generation = 0;
  };

  /// Creates the sessions. `file_keys` are those of host.key_file. `max_agreed_keys` is the largest
  /// number of keys that add_key() may add. Errors (internal): no cryptography, no randomness.
  [[nodiscard]] static physics::Result<std::unique_ptr<HostSessions>> create(
      std::span<const protocol::SessionKey> file_keys, std::size_t max_agreed_keys);

  [[nodiscard]] Taken take(std::span<const std::byte> datagram) noexcept;
  /// Returns the answer to `open`. It is valid until the next call.
  [[nodiscard]] std::span<const std::byte> challenge(const protocol::SessionHeader& open) noexcept;

  /// Returns the memory for an answer's payload, of at most kMaxAnswerBytes.
  static constexpr std::size_t kMaxAnswerBytes = 512;
  [[nodiscard]] std::span<std::byte> answer_payload() noexcept;
  /// Seals the answer. The result is empty when the session is gone. It is valid until the next
  /// call.
  [[nodiscard]] std::span<const std::byte> answer(std::uint32_t place, std::uint32_t generation,
                                                  std::size_t payload_bytes) noexcept;

  /// Adds a key agreed over the TLS connection `owner`. It is known until remove_key().
  void add_key(std::uint32_t owner, const protocol::SessionKey& key);
  void remove_key(std::uint32_t owner) noexcept;

 private:
  static constexpr std::uint32_t kNobody = ~std::uint32_t{0};
  struct Key {
    std::uint32_t owner = kNobody;
    protocol::SharedKey shared;
  };
  struct Session {
    explicit Session(protocol::SessionMac its_mac) : mac(std::move(its_mac)) {}
    bool used = false;
    std::uint64_t key_id = 0;
    std::uint64_t session_id = 0;
    std::uint32_t generation = 0;
    std::uint64_t last_use = 0;
    std::uint64_t answers = 0;
    protocol::SessionMac mac;
    protocol::ReplayWindow window;
  };

  HostSessions(protocol::SessionMac work_mac, std::vector<Session> sessions);
  [[nodiscard]] const Key* find_key(std::uint64_t id) const noexcept;
  [[nodiscard]] Session* find(const protocol::SessionHeader& header) noexcept;
  Session& begin(const protocol::SessionHeader& header, const protocol::SessionKey& key) noexcept;
  void forget(Session& session) noexcept;
  bool renew_nonce() noexcept;

  protocol::SessionMac mac_;
  std::vector<Key> keys_;
  std::vector<Session> sessions_;
  protocol::SessionNonce nonce_{};
  std::uint64_t uses_ = 0;
  std::array<std::byte,
             protocol::kSessionHeaderBytes + kMaxAnswerBytes + protocol::kSessionTagBytes>
      out_{};
};

}  // namespace emit::server
