// SPDX-License-Identifier: Apache-2.0
// The port takes triggers from some senders only.
#include <gtest/gtest.h>
#include <poll.h>

#include <optional>
#include <vector>

#include "emit/protocol/trigger_seal.hpp"
#include "net/trigger_port.hpp"
#include "support/fake_clock.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using emit::test::kSecondNs;

protocol::SessionKey key_of(unsigned char seed) {
  protocol::SessionKey key;
  key.fill(std::byte{seed});
  return key;
}

/// A port on the loopback interface and a sync source.
class Port : public ::testing::Test {
 protected:
  void open(std::vector<protocol::SessionKey> keys) {
    auto port = TriggerPort::open("127.0.0.1:0", "", keys, clock_, counters_);
    ASSERT_TRUE(port.has_value()) << port.error().text;
    port_ = std::move(*port);
  }

  /// Returns the port's result for a datagram once it has arrived.
  std::optional<ReceivedTrigger> take(std::span<const std::byte> bytes) {
    EXPECT_EQ(source_.send_to(bytes, port_->address()).status, IoStatus::done);
    pollfd wait{port_->fd(), POLLIN, 0};
    EXPECT_EQ(::poll(&wait, 1, 20'000), 1);
    return port_->next();
  }
  std::optional<ReceivedTrigger> take_bare(const protocol::Trigger& trigger) {
    std::array<std::byte, protocol::kTriggerBytes> bytes;
    protocol::encode(trigger, bytes);
    return take(bytes);
  }
  std::optional<ReceivedTrigger> take_sealed(const protocol::Trigger& trigger, unsigned char key) {
    const std::vector<protocol::SessionKey> keys{key_of(key)};
    auto seal = std::move(*protocol::TriggerSeal::create(keys));
    std::array<std::byte, protocol::kSealedTriggerBytes> bytes;
    EXPECT_TRUE(seal.seal(trigger, bytes));
    return take(bytes);
  }
  std::uint64_t count(Counter counter) const { return counters_.get(counter); }

  test::FakeClock clock_;
  Counters counters_;
  SocketContext context_;
  UdpSocket source_ = std::move(*UdpSocket::open_bound(context_, numeric_address("127.0.0.1", 0)));
  std::unique_ptr<TriggerPort> port_;
};

TEST_F(Port, WithoutKeysTakesBareTriggers) {
  open({});
  const auto taken = take_bare({7, 1, 0});
  ASSERT_TRUE(taken.has_value());
  EXPECT_EQ(taken->trigger.run_id, 7U);
  EXPECT_FALSE(take_sealed({7, 2, clock_.tai_ns()}, 1).has_value());
  EXPECT_EQ(count(Counter::triggers_refused), 1U) << "it has nothing to check the MAC by";
  EXPECT_EQ(count(Counter::triggers_unauthenticated), 0U);
  EXPECT_EQ(port_->take_unauthenticated(), "");
}

TEST_F(Port, WithKeysTakesOnlyWhatOneOfThemSealed) {
  open({key_of(1), key_of(2)});
  EXPECT_FALSE(take_bare({7, 1, clock_.tai_ns()}).has_value());
  EXPECT_FALSE(take_sealed({7, 1, clock_.tai_ns()}, 3).has_value());
  EXPECT_EQ(count(Counter::triggers_unauthenticated), 2U);
  EXPECT_EQ(count(Counter::triggers_refused), 0U);
  EXPECT_EQ(port_->take_unauthenticated(), "127.0.0.1");
  EXPECT_EQ(port_->take_unauthenticated(), "") << "told once";
  for (const unsigned char key : {std::uint8_t{1}, std::uint8_t{2}}) {
    const auto taken = take_sealed({7, key, clock_.tai_ns()}, key);
    ASSERT_TRUE(taken.has_value());
    EXPECT_EQ(taken->trigger.number, key);
  }
  EXPECT_EQ(port_->take_unauthenticated(), "");
  EXPECT_EQ(count(Counter::triggers), 4U);
}

TEST_F(Port, WithKeysTakesNothingThatWasRecorded) {
  open({key_of(1)});
  const std::int64_t now_ns = clock_.tai_ns();
  EXPECT_TRUE(take_sealed({7, 1, now_ns - kSecondNs}, 1).has_value());
  EXPECT_TRUE(take_sealed({7, 2, now_ns + kSecondNs}, 1).has_value()) << "its clock is ahead";
  EXPECT_FALSE(take_sealed({7, 3, now_ns - kSecondNs - 1}, 1).has_value());
  EXPECT_FALSE(take_sealed({7, 4, now_ns + kSecondNs + 1}, 1).has_value());
  EXPECT_FALSE(take_sealed({7, 5, 0}, 1).has_value()) << "says no instant";
  EXPECT_EQ(count(Counter::triggers_stale), 3U);
  EXPECT_EQ(count(Counter::triggers_unauthenticated), 0U);
}

}  // namespace
}  // namespace emit::server
