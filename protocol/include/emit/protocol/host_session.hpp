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

/// Authenticated host datagrams (docs/wire.md section 11): header, payload, MAC. The MAC is keyed
/// BLAKE2b (RFC 7693) with a 32-byte key and a 16-byte tag. HMAC was not taken because OpenSSL 3.0
/// allocates memory for each of its messages.
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

/// Kind of a session datagram.
enum class SessionKind : std::uint8_t {
  open = 1,        ///< the host asks for the nonce; no payload
  challenge = 2,   ///< the daemon sends the nonce and whether it knows the session
  host_frame = 3,  ///< the host sends an emit.v1.HostFrame
  answer = 4,      ///< the daemon sends an emit.v1.Status
};

/// Header of a session datagram.
struct SessionHeader {
  SessionKind kind = SessionKind::open;
  std::uint64_t key_id = 0;
  std::uint64_t session_id = 0;
  std::uint64_t counter = 0;
};

/// Session datagram as received. Nothing of it is verified.
struct SessionDatagram {
  SessionHeader header;
  std::span<const std::byte> payload;
};
/// Splits a datagram into header and payload. Returns nothing when it is no session datagram of
/// this version. The MAC is not checked. RT-safe.
[[nodiscard]] std::optional<SessionDatagram> parse_session_datagram(
    std::span<const std::byte> datagram) noexcept;

/// Payload of a challenge.
struct Challenge {
  SessionNonce nonce{};
  bool session_known = false;
};
/// Writes the payload of a challenge. RT-safe.
[[nodiscard]] std::array<std::byte, kChallengeBytes> encode(const Challenge& challenge) noexcept;
/// Reads the payload of a challenge. Returns nothing when the length is wrong. RT-safe.
[[nodiscard]] std::optional<Challenge> parse_challenge(std::span<const std::byte> payload) noexcept;

/// Makes and checks MACs.
/// Thread: one owner.  Real time: create() allocates, everything else is RT-safe.
class SessionMac {
 public:
  /// Creates an object without a key. Errors (internal): the cryptographic library lacks the
  /// algorithm.
  [[nodiscard]] static physics::Result<SessionMac> create();
  SessionMac(SessionMac&&) noexcept;
  SessionMac& operator=(SessionMac&&) noexcept;
  ~SessionMac();

  /// Sets the key that the functions below use.
  void set_key(const SessionKey& key) noexcept;
  /// Puts a header and a tag around the payload that lies at space[kSessionHeaderBytes], and
  /// returns the datagram. Returns an empty span when it does not fit.
  [[nodiscard]] std::span<const std::byte> seal(const SessionHeader& header,
                                                std::span<std::byte> space,
                                                std::size_t payload_bytes) noexcept;
  /// Writes the MAC of any bytes. Returns false when the cryptographic library failed.
  [[nodiscard]] bool tag(std::span<const std::byte> bytes,
                         std::span<std::byte, kSessionTagBytes> out) noexcept;
  /// Returns true when the datagram's last bytes are the MAC of all before them. The comparison
  /// takes constant time.
  [[nodiscard]] bool verify(std::span<const std::byte> datagram) noexcept;
  /// Derives a key for `purpose` from the key set and `context` (docs/wire.md section 11).
  [[nodiscard]] SessionKey derive(std::string_view purpose,
                                  std::span<const std::byte> context) noexcept;

 private:
  struct Impl;
  explicit SessionMac(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// Shared key and the values derived from it.
struct SharedKey {
  SessionKey key{};
  SessionKey open_key{};  ///< key of the MAC of open and challenge
  std::uint64_t id = 0;
};
/// Derives the values of a shared key. The call changes the key of `mac`. RT-safe.
[[nodiscard]] SharedKey make_shared_key(const SessionKey& key, SessionMac& mac) noexcept;
/// Returns the key of the MAC of one session's host frames and answers. The call changes the key of
/// `mac`. RT-safe.
[[nodiscard]] SessionKey session_key(const SharedKey& shared, std::uint64_t session_id,
                                     const SessionNonce& nonce, SessionMac& mac) noexcept;

/// Record of the counters seen, which refuses repeated datagrams (RFC 4303 section 3.4.3). Each
/// counter passes once. A late one passes while it is fewer than kSpan behind the highest.
/// Thread: one owner.  Real time: RT-safe.
class ReplayWindow {
 public:
  static constexpr std::uint64_t kSpan = 1024;
  /// Takes a counter and returns whether it passes. Returns false for 0, for a counter seen before
  /// and for one that is too old. Call it only with counters whose MAC was right.
  [[nodiscard]] bool accept(std::uint64_t counter) noexcept;

 private:
  static constexpr std::uint64_t kWords = 2 * kSpan / 64;
  std::uint64_t highest_ = 0;
  std::array<std::uint64_t, kWords> seen_{};
};

/// Largest number of keys in a key file.
inline constexpr std::size_t kMaxFileKeys = 16;
/// Reads the keys of a key file: 64 hexadecimal digits a line, at most kMaxFileKeys keys. Empty
/// lines and lines that begin with `#` are ignored.
/// Errors (config) name the line: wrong length, a character that is no hexadecimal digit, a
/// repeated key, too many keys or none.
[[nodiscard]] physics::Result<std::vector<SessionKey>> parse_key_file(std::string_view text);

}  // namespace emit::protocol
