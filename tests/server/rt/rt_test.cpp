// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <poll.h>

#include <cstdint>
#include <cstring>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "agents/runner.hpp"
#include "app/sha256.hpp"
#include "rt/byte_ring.hpp"
#include "rt/clock.hpp"
#include "rt/counters.hpp"
#include "rt/shortage.hpp"
#include "rt/spsc_ring.hpp"
#include "telemetry/log.hpp"

namespace emit::server {
namespace {

TEST(SpscRing, RefusesWhenFullAndKeepsOrder) {
  SpscRing<int> ring(3);
  ASSERT_EQ(ring.capacity(), 4U);
  for (int i = 0; i < 4; ++i) {
    EXPECT_TRUE(ring.push(i));
  }
  EXPECT_FALSE(ring.push(99));
  EXPECT_EQ(ring.free(), 0U);
  for (int i = 0; i < 4; ++i) {
    const int* value = ring.front();
    ASSERT_NE(value, nullptr);
    EXPECT_EQ(*value, i);
    ring.pop();
  }
  EXPECT_EQ(ring.front(), nullptr);
}

TEST(SpscRing, CarriesEveryElementBetweenTwoThreads) {
  SpscRing<std::uint64_t> ring(16);
  constexpr std::uint64_t kCount = 200'000;
  std::thread producer([&] {
    for (std::uint64_t i = 0; i < kCount;) {
      if (ring.push(i)) {
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  });
  std::uint64_t expected = 0;
  while (expected < kCount) {
    if (const auto* value = ring.front()) {
      ASSERT_EQ(*value, expected);
      ++expected;
      ring.pop();
    } else {
      std::this_thread::yield();
    }
  }
  producer.join();
}

TEST(Shortage, EndsOnceForWhoFoundNothing) {
  Shortage shortage;
  EXPECT_FALSE(shortage.end()) << "nobody looked";
  EXPECT_EQ(shortage.look([] { return std::optional<int>(7); }), 7);
  EXPECT_FALSE(shortage.end()) << "it was there";
  EXPECT_FALSE(shortage.look([] { return std::optional<int>(); }));
  EXPECT_TRUE(shortage.end());
  EXPECT_FALSE(shortage.end());
}

TEST(Shortage, SeesWhatIsGivenBetweenTheLookAndTheWord) {
  Shortage shortage;
  int looks = 0;
  const auto found = shortage.look([&] {
    // The giver comes after the first look and finds that nobody wants anything.
    if (looks++ == 0) {
      EXPECT_FALSE(shortage.end());
      return std::optional<int>();
    }
    return std::optional<int>(1);
  });
  EXPECT_TRUE(found.has_value());
}

/// Agent that works a set number of times and looks at its doorbell when it is about to rest.
class RestingAgent final : public Agent {
 public:
  explicit RestingAgent(Doorbell& bell) : Agent(bell) {}
  [[nodiscard]] std::string_view name() const noexcept override { return "resting"; }
  int do_work(std::int64_t /*now_ns*/) noexcept override {
    if (work_ == 0) {
      done_.store(true);
      done_.notify_one();
      return 0;
    }
    --work_;
    return 1;
  }
  [[nodiscard]] std::int64_t rest_ns() const noexcept override {
    ++rests_;
    doorbell().ring();
    pollfd bell{doorbell().fd(), POLLIN, 0};
    rung_ = rung_ || ::poll(&bell, 1, 0) != 0;
    return 1;
  }
  void wait() { done_.wait(false); }
  [[nodiscard]] int rests() const { return rests_; }
  [[nodiscard]] bool rung() const { return rung_; }

 private:
  int work_ = 3;
  std::atomic<bool> done_{false};
  mutable int rests_ = 0;
  mutable bool rung_ = false;
};

TEST(AgentRunner, LetsAnAgentRestOnceBehindItsWorkWhileRingsWakeNobody) {
  Doorbell bell;
  RestingAgent agent(bell);
  const SystemClock clock;
  AgentRunner runner(agent, clock);
  ASSERT_TRUE(runner.start_thread());
  agent.wait();
  runner.stop();
  EXPECT_EQ(agent.rests(), 1);
  EXPECT_FALSE(agent.rung()) << "it is awake: no write to its descriptor";
}

TEST(ByteRing, CarriesRecordsOfAnyLengthBetweenTwoThreads) {
  ByteRing ring(4096);
  constexpr std::uint32_t kCount = 50'000;
  const auto length_of = [](std::uint32_t i) { return 4 + (i * 2654435761U >> 8) % 1500; };
  std::thread producer([&] {
    for (std::uint32_t i = 0; i < kCount;) {
      const auto memory = ring.claim(length_of(i));
      if (memory.empty()) {
        std::this_thread::yield();
        continue;
      }
      std::memset(memory.data(), static_cast<int>(i & 0xFF), memory.size());
      std::memcpy(memory.data(), &i, sizeof(i));
      ring.commit();
      ++i;
    }
  });
  for (std::uint32_t i = 0; i < kCount;) {
    const auto record = ring.front();
    if (record.empty()) {
      std::this_thread::yield();
      continue;
    }
    std::uint32_t number = 0;
    std::memcpy(&number, record.data(), sizeof(number));
    ASSERT_EQ(number, i);
    ASSERT_EQ(record.size(), length_of(i));
    ASSERT_EQ(record.back(), record.size() > 4 ? static_cast<std::byte>(i & 0xFF) : record.back());
    ring.pop();
    ++i;
  }
  producer.join();
}

TEST(ByteRing, RefusesARecordLargerThanItself) {
  ByteRing ring(4096);
  EXPECT_TRUE(ring.claim(5000).empty());
  EXPECT_FALSE(ring.claim(3000).empty());
}

TEST(Counters, HaveDistinctNames) {
  std::set<std::string_view> names;
  for (const auto& label : kCounterLabels) {
    EXPECT_TRUE(names.insert(label.name).second) << label.name;
    EXPECT_FALSE(label.label.empty());
  }
}

TEST(SystemClock, PutsKernelStampsOnTheClockOfTai) {
  const SystemClock clock;
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  const std::int64_t utc_ns = std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
  const std::int64_t tai_ns = clock.tai_ns();
  const std::int64_t difference_ns = tai_ns - clock.tai_from_kernel_stamp_ns(utc_ns);
  EXPECT_GE(difference_ns, 0);
  EXPECT_LT(difference_ns, 500'000'000) << "only the time between the two reads";
}

TEST(DistinctTable, WritesARepeatedLineAtPowersOfTen) {
  DistinctTable table;
  std::vector<int> written;
  for (int i = 1; i <= 1000; ++i) {
    const std::string line = table.note("same", i);
    if (!line.empty()) {
      EXPECT_EQ(line, i == 1 ? "same" : "same repeats=" + std::to_string(i));
      written.push_back(i);
    }
  }
  EXPECT_EQ(written, (std::vector<int>{1, 10, 100, 1000}));
  EXPECT_EQ(table.entries().at("same").count, 1000U);
  EXPECT_EQ(table.entries().at("same").first_ns, 1);
  EXPECT_EQ(table.entries().at("same").last_ns, 1000);
}

TEST(DistinctTable, WritesOneLineForEverythingThatNoLongerFits) {
  DistinctTable table;
  for (std::size_t i = 0; i < DistinctTable::kMaxEntries; ++i) {
    EXPECT_FALSE(table.note("line " + std::to_string(i), 1).empty());
  }
  std::vector<std::string> written;
  for (int i = 0; i < 5000; ++i) {
    std::string line = table.note("chosen by a peer " + std::to_string(i), 2);
    if (!line.empty()) {
      written.push_back(std::move(line));
    }
  }
  const std::string overflow(DistinctTable::kOverflowText);
  EXPECT_EQ(written,
            (std::vector<std::string>{overflow, overflow + " repeats=10", overflow + " repeats=100",
                                      overflow + " repeats=1000"}));
  EXPECT_LE(table.entries().size(), DistinctTable::kMaxEntries + 1);
  for (int i = 0; i < 9; ++i) {
    const bool last = !table.note("line 7", 3).empty();
    EXPECT_EQ(last, i == 8) << "what is in the table goes on being counted for itself";
  }
}

TEST(Log, KeepsWhatPeersSayOnOneLine) {
  Event event;
  event.kind = EventKind::hello;
  const std::string evil = "x\"\nlevel=error fake";
  std::memcpy(event.text.data(), evil.data(), evil.size());
  const EventText line = describe(event);
  EXPECT_EQ(line.text.find('\n'), std::string::npos);
  EXPECT_NE(line.text.find("x??level"), std::string::npos);
}

// The digests are the examples of FIPS 180-4.
TEST(Sha256, MatchesPublishedDigests) {
  const auto digest = [](const std::string& text, std::size_t times = 1) {
    Sha256 hash;
    for (std::size_t i = 0; i < times; ++i) {
      hash.update(std::as_bytes(std::span(text)));
    }
    return hash.finish();
  };
  EXPECT_EQ(digest(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(digest("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(digest("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(digest("aaaaaaaaaa", 100'000),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

}  // namespace
}  // namespace emit::server
