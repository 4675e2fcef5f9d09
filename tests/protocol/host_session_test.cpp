// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/host_session.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <random>
#include <set>
#include <string>

#include "support/heap_counter.hpp"

namespace emit::protocol {
namespace {

SessionKey key_of(unsigned char seed) {
  SessionKey key;
  for (std::size_t i = 0; i < key.size(); ++i) key[i] = static_cast<std::byte>(seed + i);
  return key;
}

struct Sealed {
  std::vector<std::byte> space = std::vector<std::byte>(256);
  std::span<std::byte> bytes;
};

Sealed seal(SessionMac& mac, const SessionHeader& header, std::string_view payload) {
  Sealed out;
  std::memcpy(out.space.data() + kSessionHeaderBytes, payload.data(), payload.size());
  const auto sealed = mac.seal(header, out.space, payload.size());
  out.bytes = std::span(out.space).first(sealed.size());
  return out;
}

class HostSession : public ::testing::Test {
 protected:
  SessionMac mac_ = std::move(*SessionMac::create());
  const SessionHeader header_{SessionKind::host_frame, 0x1122334455667788, 7, 42};
};

TEST_F(HostSession, WhatIsSealedIsVerifiedAndReadBack) {
  mac_.set_key(key_of(1));
  const Sealed sealed = seal(mac_, header_, "pose");
  ASSERT_EQ(sealed.bytes.size(), kSessionHeaderBytes + 4 + kSessionTagBytes);
  EXPECT_TRUE(mac_.verify(sealed.bytes));
  const auto read = parse_session_datagram(sealed.bytes);
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->header.kind, SessionKind::host_frame);
  EXPECT_EQ(read->header.key_id, header_.key_id);
  EXPECT_EQ(read->header.session_id, 7U);
  EXPECT_EQ(read->header.counter, 42U);
  EXPECT_EQ(std::memcmp(read->payload.data(), "pose", 4), 0);
  EXPECT_EQ(read->payload.size(), 4U);
}

TEST_F(HostSession, TheBytesOnTheWireAreTheDocumentedOnes) {
  mac_.set_key(key_of(1));
  const Sealed sealed = seal(mac_, header_, "");
  const unsigned char head[kSessionHeaderBytes] = {
      'E', 'M', 'H', 'S', 1, 3, 0, 0, 0x88, 0x77, 0x66, 0x55, 0x44, 0x33, 0x22, 0x11,
      7,   0,   0,   0,   0, 0, 0, 0, 42,   0,    0,    0,    0,    0,    0,    0};
  EXPECT_EQ(std::memcmp(sealed.bytes.data(), head, sizeof head), 0);
}

// The expected tag is that of Python's hashlib.blake2b(key=..., digest_size=16), which implements
// RFC 7693.
TEST_F(HostSession, TheTagIsKeyedBlake2b) {
  SessionKey key;
  for (std::size_t i = 0; i < key.size(); ++i) key[i] = static_cast<std::byte>(i);
  mac_.set_key(key);
  const Sealed sealed = seal(mac_, {SessionKind::host_frame, 1, 2, 3}, "emitd");
  std::string hex;
  for (const std::byte byte : sealed.bytes.last(kSessionTagBytes)) {
    constexpr char kDigits[] = "0123456789abcdef";
    hex += kDigits[std::to_integer<unsigned>(byte) >> 4U];
    hex += kDigits[std::to_integer<unsigned>(byte) & 15U];
  }
  EXPECT_EQ(hex, "6a6bec76850c42ebcdadd288aa5bfe0a");
}

TEST_F(HostSession, EveryBitIsCovered) {
  mac_.set_key(key_of(1));
  const Sealed sealed = seal(mac_, header_, "0123456789");
  for (std::size_t bit = 0; bit < sealed.bytes.size() * 8; ++bit) {
    sealed.bytes[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
    EXPECT_FALSE(mac_.verify(sealed.bytes)) << "bit " << bit;
    sealed.bytes[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
  }
  EXPECT_TRUE(mac_.verify(sealed.bytes));
}

TEST_F(HostSession, AShorterOneAndOneByAnotherKeyAreRefused) {
  mac_.set_key(key_of(1));
  const Sealed sealed = seal(mac_, header_, "0123456789");
  for (std::size_t length = 0; length < sealed.bytes.size(); ++length) {
    EXPECT_FALSE(mac_.verify(sealed.bytes.first(length))) << length;
  }
  mac_.set_key(key_of(2));
  EXPECT_FALSE(mac_.verify(sealed.bytes));
}

TEST_F(HostSession, OtherMagicVersionKindAndLengthAreNoSessionDatagram) {
  mac_.set_key(key_of(1));
  const Sealed sealed = seal(mac_, header_, "x");
  for (const std::size_t at : {0U, 4U, 5U}) {
    const std::byte kept = sealed.bytes[at];
    sealed.bytes[at] = std::byte{9};
    EXPECT_FALSE(parse_session_datagram(sealed.bytes).has_value()) << at;
    sealed.bytes[at] = kept;
  }
  EXPECT_FALSE(parse_session_datagram(sealed.bytes.first(47)).has_value());
  EXPECT_TRUE(parse_session_datagram(sealed.bytes.first(48)).has_value());
}

TEST_F(HostSession, KeysDifferByPurposeSessionAndNonce) {
  const SharedKey shared = make_shared_key(key_of(1), mac_);
  const SharedKey other = make_shared_key(key_of(2), mac_);
  SessionNonce nonce{};
  std::set<SessionKey> keys{shared.key, shared.open_key, other.open_key};
  keys.insert(session_key(shared, 1, nonce, mac_));
  keys.insert(session_key(shared, 2, nonce, mac_));
  keys.insert(session_key(other, 1, nonce, mac_));
  nonce[15] = std::byte{1};
  keys.insert(session_key(shared, 1, nonce, mac_));
  EXPECT_EQ(keys.size(), 7U);
  EXPECT_NE(shared.id, other.id);
  EXPECT_EQ(session_key(shared, 1, nonce, mac_), session_key(shared, 1, nonce, mac_));
}

TEST_F(HostSession, MacsTakeNoMemory) {
  mac_.set_key(key_of(1));
  Sealed sealed = seal(mac_, header_, "0123456789");
  const SharedKey shared = make_shared_key(key_of(1), mac_);
  const std::uint64_t before = test::heap_request_count();
  for (std::uint64_t i = 1; i <= 100; ++i) {
    mac_.set_key(session_key(shared, i, {}, mac_));
    SessionHeader header = header_;
    header.counter = i;
    const auto bytes = mac_.seal(header, sealed.space, 100);
    EXPECT_TRUE(mac_.verify(bytes));
  }
  EXPECT_EQ(test::heap_request_count() - before, 0U);
}

TEST_F(HostSession, AnOversizedPayloadIsNotSealed) {
  mac_.set_key(key_of(1));
  std::vector<std::byte> space(70'000);
  EXPECT_EQ(mac_.seal(header_, space, kMaxSessionPayloadBytes).size(), 65507U);
  EXPECT_TRUE(mac_.seal(header_, space, kMaxSessionPayloadBytes + 1).empty());
  EXPECT_TRUE(mac_.seal(header_, std::span(space).first(100), 53).empty());
}

TEST(HostSessionChallenge, RoundTrip) {
  Challenge challenge;
  challenge.nonce[3] = std::byte{9};
  challenge.session_known = true;
  const auto read = parse_challenge(encode(challenge));
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->nonce, challenge.nonce);
  EXPECT_TRUE(read->session_known);
  const auto encoded = encode(challenge);
  EXPECT_FALSE(parse_challenge(std::span(encoded).first(16)).has_value());
}

TEST(ReplayWindow, EachCounterPassesOnce) {
  ReplayWindow window;
  EXPECT_FALSE(window.accept(0));
  for (std::uint64_t i = 1; i < 5000; ++i) {
    EXPECT_TRUE(window.accept(i));
    EXPECT_FALSE(window.accept(i));
  }
}

TEST(ReplayWindow, LateOnesPassWithinTheSpan) {
  ReplayWindow window;
  EXPECT_TRUE(window.accept(5000));
  EXPECT_TRUE(window.accept(5000 - ReplayWindow::kSpan + 1));
  EXPECT_FALSE(window.accept(5000 - ReplayWindow::kSpan));
  EXPECT_FALSE(window.accept(1));
  EXPECT_TRUE(window.accept(4999));
  EXPECT_FALSE(window.accept(4999));
}

TEST(ReplayWindow, TheLastCounterPassesAndNothingWrapsAround) {
  constexpr std::uint64_t kLast = ~std::uint64_t{0};
  ReplayWindow window;
  EXPECT_TRUE(window.accept(kLast - 1));
  EXPECT_TRUE(window.accept(kLast));
  EXPECT_FALSE(window.accept(kLast));
  EXPECT_FALSE(window.accept(0));
  EXPECT_FALSE(window.accept(1));
  EXPECT_TRUE(window.accept(kLast - 5));
}

// The window agrees with one that remembers all counters.
TEST(ReplayWindow, JudgesLikeAPlainSet) {
  std::mt19937_64 random(11);
  ReplayWindow window;
  std::set<std::uint64_t> seen;
  std::uint64_t highest = 0;
  std::uint64_t base = 1;
  for (int i = 0; i < 200'000; ++i) {
    base += random() % 5 == 0 ? random() % (random() % 50 == 0 ? 5000 : 3) : 0;
    const std::uint64_t counter = base + random() % 1600;
    const bool late = counter <= highest && highest - counter >= ReplayWindow::kSpan;
    const bool expected = !late && seen.insert(counter).second;
    ASSERT_EQ(window.accept(counter), expected) << i << ": " << counter << " after " << highest;
    highest = std::max(highest, counter);
  }
}

TEST(KeyFile, KeysAreReadAndFaultsNamedWithoutShowingThem) {
  const std::string key(64, 'a');
  std::string file = "# rig 3\r\n\n";
  file.append(key).append("\r\n  ").append(64, '0').append("  ");
  const auto read = parse_key_file(file);
  ASSERT_TRUE(read.has_value()) << read.error().text;
  ASSERT_EQ(read->size(), 2U);
  EXPECT_EQ((*read)[0][31], std::byte{0xAA});
  EXPECT_EQ((*read)[1][0], std::byte{0});
  const auto fault = [](const std::string& text) { return parse_key_file(text).error().text; };
  EXPECT_EQ(fault(""), "no key in it");
  EXPECT_EQ(fault(std::string("\n").append(key, 1)), "line 2: a key has 64 hexadecimal digits");
  EXPECT_EQ(fault(key.substr(1).append("g")), "line 1: a key has hexadecimal digits only");
  EXPECT_EQ(fault(std::string(key).append("\n").append(key)), "line 2: a key twice");
}

}  // namespace
}  // namespace emit::protocol
