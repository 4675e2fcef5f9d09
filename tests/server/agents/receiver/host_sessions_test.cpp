// SPDX-License-Identifier: Apache-2.0
#include "agents/receiver/host_sessions.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "agents/receiver/peer_limits.hpp"
#include "rt/token_bucket.hpp"
#include "support/heap_counter.hpp"

namespace emit::server {
namespace {

using protocol::SessionKind;
using Verdict = HostSessions::Verdict;
using Bytes = std::vector<std::byte>;

protocol::SessionKey key_of(unsigned char seed) {
  protocol::SessionKey key;
  key.fill(std::byte{seed});
  return key;
}

/// A host that knows a key and the daemon's challenge.
class Peer {
 public:
  Peer(const protocol::SessionKey& key, std::uint64_t session_id)
      : shared_(protocol::make_shared_key(key, mac_)), session_id_(session_id) {}

  Bytes open(std::uint64_t echo) {
    mac_.set_key(shared_.open_key);
    return seal(SessionKind::open, echo, "");
  }
  bool take(std::span<const std::byte> challenge) {
    mac_.set_key(shared_.open_key);
    const auto read = protocol::parse_session_datagram(challenge);
    if (!mac_.verify(challenge) || !read || read->header.kind != SessionKind::challenge)
      return false;
    const auto content = protocol::parse_challenge(read->payload);
    known_ = content->session_known;
    key_ = protocol::session_key(shared_, session_id_, content->nonce, mac_);
    return true;
  }
  Bytes frame(std::uint64_t counter, const std::string& payload = "pose") {
    mac_.set_key(key_);
    return seal(SessionKind::host_frame, counter, payload);
  }
  bool verify(std::span<const std::byte> answer) {
    mac_.set_key(key_);
    return mac_.verify(answer);
  }
  [[nodiscard]] bool known() const { return known_; }

 private:
  Bytes seal(SessionKind kind, std::uint64_t counter, const std::string& payload) {
    Bytes out(protocol::kSessionHeaderBytes + payload.size() + protocol::kSessionTagBytes);
    std::transform(payload.begin(), payload.end(), out.begin() + protocol::kSessionHeaderBytes,
                   [](char c) { return static_cast<std::byte>(c); });
    static_cast<void>(mac_.seal({kind, shared_.id, session_id_, counter}, out, payload.size()));
    return out;
  }

  protocol::SessionMac mac_ = std::move(*protocol::SessionMac::create());
  protocol::SharedKey shared_;
  std::uint64_t session_id_;
  protocol::SessionKey key_{};
  bool known_ = false;
};

std::unique_ptr<HostSessions> daemon(std::vector<protocol::SessionKey> keys) {
  return std::move(*HostSessions::create(keys, 4));
}

void connect(HostSessions& sessions, Peer& peer) {
  const auto taken = sessions.take(peer.open(5));
  ASSERT_EQ(taken.verdict, Verdict::open);
  ASSERT_TRUE(peer.take(sessions.challenge(taken.header)));
}

TEST(HostSessions, AHostThatAnswersTheChallengeIsHeard) {
  const auto sessions = daemon({key_of(1), key_of(2)});
  Peer peer(key_of(2), 77);
  connect(*sessions, peer);
  EXPECT_FALSE(peer.known());
  const Bytes first = peer.frame(1);
  const auto taken = sessions->take(first);
  ASSERT_EQ(taken.verdict, Verdict::host_frame);
  EXPECT_TRUE(taken.began);
  EXPECT_EQ(taken.payload.size(), 4U);
  EXPECT_FALSE(sessions->take(peer.frame(3)).began);
  EXPECT_EQ(sessions->take(peer.frame(2)).verdict, Verdict::host_frame) << "late";
  EXPECT_EQ(sessions->take(first).verdict, Verdict::replayed);
  EXPECT_EQ(sessions->take(peer.frame(3)).verdict, Verdict::replayed);
  EXPECT_TRUE(peer.verify(sessions->answer(taken.place, taken.generation, 0)));
  EXPECT_TRUE(sessions->answer(taken.place, taken.generation + 1, 0).empty());
  connect(*sessions, peer);
  EXPECT_TRUE(peer.known());
}

TEST(HostSessions, WhatIsNotGenuineIsToldApart) {
  const auto sessions = daemon({key_of(1)});
  Peer stranger(key_of(9), 5);
  EXPECT_EQ(sessions->take(stranger.open(1)).verdict, Verdict::unknown_key);
  EXPECT_EQ(sessions->take({}).verdict, Verdict::bare);
  EXPECT_EQ(sessions->take(Bytes(100)).verdict, Verdict::bare);
  Peer peer(key_of(1), 5);
  EXPECT_EQ(sessions->take(peer.frame(1)).verdict, Verdict::bad_mac) << "not challenged yet";
  connect(*sessions, peer);
  Bytes forged = peer.frame(1);
  forged[40] ^= std::byte{1};
  EXPECT_EQ(sessions->take(forged).verdict, Verdict::bad_mac);
  forged = peer.open(1);
  forged.back() ^= std::byte{1};
  EXPECT_EQ(sessions->take(forged).verdict, Verdict::bad_mac);
  // An answer of the daemon is sent back to it.
  const auto challenge = sessions->challenge(sessions->take(peer.open(1)).header);
  EXPECT_EQ(sessions->take(Bytes(challenge.begin(), challenge.end())).verdict, Verdict::bad_mac);
  EXPECT_EQ(sessions->take(peer.frame(1)).verdict, Verdict::host_frame);
}

TEST(HostSessions, ADaemonStartedAnewTakesNothingRecorded) {
  const auto before = daemon({key_of(1)});
  Peer peer(key_of(1), 5);
  connect(*before, peer);
  const Bytes recorded = peer.frame(1);
  ASSERT_EQ(before->take(recorded).verdict, Verdict::host_frame);
  const auto after = daemon({key_of(1)});
  EXPECT_EQ(after->take(recorded).verdict, Verdict::bad_mac);
}

TEST(HostSessions, ASessionThatWasForgottenCannotBeReplayed) {
  const auto sessions = daemon({key_of(1)});
  Peer oldest(key_of(1), 1);
  connect(*sessions, oldest);
  const Bytes recorded = oldest.frame(1);
  ASSERT_TRUE(sessions->take(recorded).began);
  for (std::uint64_t i = 2; i <= HostSessions::kMaxSessions + 1; ++i) {
    Peer peer(key_of(1), i);
    connect(*sessions, peer);
    ASSERT_TRUE(sessions->take(peer.frame(1)).began);
  }
  EXPECT_EQ(sessions->take(recorded).verdict, Verdict::bad_mac);
  EXPECT_EQ(sessions->take(oldest.frame(2)).verdict, Verdict::bad_mac);
  connect(*sessions, oldest);
  EXPECT_FALSE(oldest.known());
  EXPECT_EQ(sessions->take(oldest.frame(1)).verdict, Verdict::host_frame);
}

TEST(HostSessions, AnAgreedKeyEndsWithItsConnection) {
  const auto sessions = daemon({});
  sessions->add_key(3, key_of(1));
  Peer peer(key_of(1), 5);
  connect(*sessions, peer);
  const Bytes recorded = peer.frame(1);
  ASSERT_EQ(sessions->take(recorded).verdict, Verdict::host_frame);
  sessions->remove_key(4);
  EXPECT_EQ(sessions->take(peer.frame(2)).verdict, Verdict::host_frame);
  sessions->remove_key(3);
  EXPECT_EQ(sessions->take(peer.frame(3)).verdict, Verdict::unknown_key);
  sessions->add_key(3, key_of(1));
  EXPECT_EQ(sessions->take(recorded).verdict, Verdict::bad_mac);
}

TEST(HostSessions, DatagramsTakeNoMemory) {
  const auto sessions = daemon({key_of(1)});
  Peer peer(key_of(1), 5);
  connect(*sessions, peer);
  std::vector<Bytes> frames;
  for (std::uint64_t i = 1; i <= 50; ++i) frames.push_back(peer.frame(i));
  Bytes forged = frames[0];
  forged.back() ^= std::byte{1};
  const Bytes opening = peer.open(9);
  const std::uint64_t before = test::heap_request_count();
  for (const Bytes& frame : frames) {
    const auto taken = sessions->take(frame);
    EXPECT_EQ(taken.verdict, Verdict::host_frame);
    EXPECT_FALSE(sessions->answer(taken.place, taken.generation, 10).empty());
    EXPECT_EQ(sessions->take(forged).verdict, Verdict::bad_mac);
    EXPECT_FALSE(sessions->challenge(sessions->take(opening).header).empty());
  }
  EXPECT_EQ(test::heap_request_count() - before, 0U);
}

TEST(TokenBucket, LetsTheRateThroughAndAQuarterSecondAtOnce) {
  TokenBucket bucket(1000);
  std::int64_t now_ns = 5'000'000'000;
  int passed = 0;
  while (bucket.take(now_ns)) ++passed;
  EXPECT_EQ(passed, 250);
  for (int i = 0; i < 5000; ++i) {
    now_ns += 500'000;
    passed += bucket.take(now_ns) ? 1 : 0;
  }
  EXPECT_EQ(passed, 250 + 2500);
  EXPECT_FALSE(bucket.take(now_ns - 1'000'000'000)) << "time went back";
  now_ns += 3'600'000'000'000;
  passed = 0;
  while (bucket.take(now_ns)) ++passed;
  EXPECT_EQ(passed, 250) << "nothing is saved up";
}

TEST(TokenBucket, OneASecondStillPasses) {
  TokenBucket bucket(1);
  EXPECT_TRUE(bucket.take(0));
  EXPECT_FALSE(bucket.take(999'999'999));
  EXPECT_TRUE(bucket.take(1'000'000'000));
}

TEST(PeerLimits, EachAddressHasItsOwn) {
  config::AccessConfig access;
  access.max_host_frames_hz = 4;
  access.max_control_records_hz = 8;
  PeerLimits limits(access);
  const protocol::IpAddress a = *protocol::parse_ip("192.0.2.1");
  const protocol::IpAddress b = *protocol::parse_ip("192.0.2.2");
  EXPECT_TRUE(limits.take_host_frame(a, 4000, 1));
  EXPECT_FALSE(limits.take_host_frame(a, 4000, 2));
  EXPECT_TRUE(limits.take_host_frame(b, 4000, 3));
  EXPECT_TRUE(limits.take_control_record(a, 4000, 4));
  EXPECT_TRUE(limits.take_control_record(a, 4000, 5));
  EXPECT_FALSE(limits.take_control_record(a, 4000, 6));
  EXPECT_FALSE(limits.take_host_frame(b, 4000, 7));
  EXPECT_TRUE(limits.take_host_frame(a, 4000, 250'000'001));
  EXPECT_FALSE(limits.take_host_frame(a, 4001, 250'000'002));  // another port changes nothing
}

TEST(PeerLimits, OnThisHostEachSocketHasItsOwn) {
  config::AccessConfig access;
  access.max_host_frames_hz = 4;
  PeerLimits limits(access);
  const protocol::IpAddress here = *protocol::parse_ip("127.0.0.1");
  EXPECT_TRUE(limits.take_host_frame(here, 4000, 1));
  EXPECT_FALSE(limits.take_host_frame(here, 4000, 2));
  EXPECT_TRUE(limits.take_host_frame(here, 4001, 3));
}

}  // namespace
}  // namespace emit::server
