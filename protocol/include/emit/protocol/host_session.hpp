// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

/// Authenticated host datagrams (docs/wire.md, "Host sessions"): header, payload, MAC. The MAC is
/// keyed BLAKE2b (RFC 7693) with a 32-byte key and a 16-byte tag; HMAC of OpenSSL 3.0 takes memory
/// for every message, this does not.
namespace emit::protocol {

inline constexpr std::uint32_t kSessionMagic = 0x53484D45;  // "EMHS"
inline constexpr std::uint8_t kSessionVersion = 1;
inline constexpr std::size_t kSessionHeaderBytes = 32;
inline constexpr std::size_t kSessionTagBytes = 16;
inline constexpr std::size_t kSessionNonceBytes = 16;
inline constexpr std::size_t kChallengeBytes = kSessionNonceBytes + 1;
/// Largest payload: one UDP datagram over IPv4.
inline constexpr std::size_t kMaxSessionPayloadBytes =
    65507 - kSessionHeaderBytes - kSessionTagBytes;

using SessionKey = std::array<std::byte, 32>;
using SessionNonce = std::array<std::byte, kSessionNonceBytes>;

enum class SessionKind : std::uint8_t {
  open = 1,        ///< host: asks for the nonce; no payload
  challenge = 2,   ///< daemon: the nonce, and whether it knows the session
  host_frame = 3,  ///< host: an emit.v1.HostFrame
  answer = 4,      ///< daemon: an emit.v1.Status
};

struct SessionHeader {
  SessionKind kind = SessionKind::open;
  std::uint64_t key_id = 0;
  std::uint64_t session_id = 0;
  std::uint64_t counter = 0;
};

/// As it stands in the datagram, nothing verified yet.
struct SessionDatagram {
  SessionHeader header;
  std::span<const std::byte> payload;
};
/// Empty: not a datagram of this kind and version. RT-safe.
[[nodiscard]] std::optional<SessionDatagram> parse_session_datagram(
    std::span<const std::byte> datagram) noexcept;

struct Challenge {
  SessionNonce nonce{};
  bool session_known = false;
};
[[nodiscard]] std::array<std::byte, kChallengeBytes> encode(const Challenge& challenge) noexcept;
[[nodiscard]] std::optional<Challenge> parse_challenge(std::span<const std::byte> payload) noexcept;

/// Makes and checks MACs. Thread: one owner. Real time: create() allocates, the rest is RT-safe.
class SessionMac {
 public:
  /// Errors (internal): the cryptographic library lacks the algorithm.
  [[nodiscard]] static physics::Result<SessionMac> create();
  SessionMac(SessionMac&&) noexcept;
  SessionMac& operator=(SessionMac&&) noexcept;
  ~SessionMac();

  void set_key(const SessionKey& key) noexcept;
  /// Puts header and tag around a payload that lies at space[kSessionHeaderBytes]. Empty: it does
  /// not fit.
  [[nodiscard]] std::span<const std::byte> seal(const SessionHeader& header,
                                                std::span<std::byte> space,
                                                std::size_t payload_bytes) noexcept;
  /// The MAC of any bytes. False: the cryptographic library failed.
  [[nodiscard]] bool tag(std::span<const std::byte> bytes,
                         std::span<std::byte, kSessionTagBytes> out) noexcept;
  /// True when the datagram's last bytes are the MAC of all before them. In constant time.
  [[nodiscard]] bool verify(std::span<const std::byte> datagram) noexcept;
  /// A key for `purpose` from this one's and `context`.
  [[nodiscard]] SessionKey derive(std::string_view purpose,
                                  std::span<const std::byte> context) noexcept;

 private:
  struct Impl;
  explicit SessionMac(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// What follows from one shared key.
struct SharedKey {
  SessionKey key{};
  SessionKey open_key{};  ///< of open and challenge
  std::uint64_t id = 0;
};
[[nodiscard]] SharedKey make_shared_key(const SessionKey& key, SessionMac& mac) noexcept;
/// Key of host frames and answers of one session.
[[nodiscard]] SessionKey session_key(const SharedKey& shared, std::uint64_t session_id,
                                     const SessionNonce& nonce, SessionMac& mac) noexcept;

/// Counters seen: each passes once, late ones while they are fewer than kSpan behind the highest
/// (RFC 4303 section 3.4.3). RT-safe.
class ReplayWindow {
 public:
  static constexpr std::uint64_t kSpan = 1024;
  /// False: 0, seen before, or too old. Call it only with counters whose MAC was right.
  [[nodiscard]] bool accept(std::uint64_t counter) noexcept;

 private:
  static constexpr std::uint64_t kWords = 2 * kSpan / 64;
  std::uint64_t highest_ = 0;
  std::array<std::uint64_t, kWords> seen_{};
};

/// Keys of a key file: 64 hexadecimal digits a line, at most kMaxFileKeys; empty lines and `#`
/// lines are ignored. Errors (config), naming the line.
inline constexpr std::size_t kMaxFileKeys = 16;
[[nodiscard]] physics::Result<std::vector<SessionKey>> parse_key_file(std::string_view text);

}  // namespace emit::protocol
