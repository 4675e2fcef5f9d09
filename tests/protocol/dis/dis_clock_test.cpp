// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>

#include "emit/protocol/dis.hpp"

namespace emit::protocol::dis {
namespace {

constexpr std::int64_t kHourNs = 3'600'000'000'000;
constexpr std::int64_t kSecondNs = 1'000'000'000;
/// Half a unit of a stamp, and half a nanosecond of rounding.
constexpr std::int64_t kStampErrorNs = 840;

using Order = DisClock::Order;

TEST(DisStamps, UnitsAreAnHourThroughTwoToTheThirtyFirstMinusOne) {
  EXPECT_EQ(units_to_ns(0), 0);
  EXPECT_EQ(units_to_ns(1), 1676);  // 1676.38 ns
  EXPECT_EQ(units_to_ns(kUnitsPerHour), kHourNs);
  EXPECT_EQ(units_to_ns(1000 * kUnitsPerHour), 1000 * kHourNs);
  // The closed form in long double, whose 64 bits of mantissa are enough here.
  for (const std::int64_t units : {1'234'567LL, 2'000'000'001LL, 87'654'321'987'654LL}) {
    const long double exact = static_cast<long double>(units) * 3.6e12L / 2147483647.0L;
    EXPECT_LE(std::abs(static_cast<long double>(units_to_ns(units)) - exact), 0.51L) << units;
  }
}

TEST(DisStamps, StampsOfTimesComeBackWithinHalfAUnit) {
  EXPECT_EQ(timestamp_of(0, false), 0U);
  EXPECT_EQ(timestamp_of(0, true), 1U);
  EXPECT_EQ(timestamp_of(kHourNs, true), 1U);
  EXPECT_EQ(timestamp_of(kHourNs / 2, false), 0x4000'0000U << 1);
  EXPECT_FALSE(is_absolute(0xFFFF'FFFEU));
  EXPECT_TRUE(is_absolute(0x0000'0001U));
  std::mt19937_64 random(3);
  for (int i = 0; i < 1000; ++i) {
    const auto time_ns = static_cast<std::int64_t>(random() % (kHourNs - 1000));
    DisClock clock;
    const auto reading = clock.read(timestamp_of(time_ns, i % 2 == 0), 0);
    EXPECT_LE(std::abs(reading.time_ns - time_ns), kStampErrorNs);
    EXPECT_EQ(reading.order, Order::first);
  }
  EXPECT_EQ(timestamp_of(-kSecondNs, false), timestamp_of(kHourNs - kSecondNs, false));
}

TEST(DisClock, TimeGoesOnOverTheHourWithoutDrift) {
  DisClock clock;
  std::int64_t last_ns = -1;
  // Ten days at 5 s, on which rounded steps would gather an error of up to 0.15 s.
  for (std::int64_t i = 0; i < 10 * 24 * 720; ++i) {
    const std::int64_t time_ns = 17 * kSecondNs + i * 5 * kSecondNs + i;
    const auto reading = clock.read(timestamp_of(time_ns, true), time_ns + 3);
    ASSERT_EQ(reading.order, i == 0 ? Order::first : Order::next);
    ASSERT_LE(std::abs(reading.time_ns - time_ns), kStampErrorNs) << i;
    ASSERT_GT(reading.time_ns, last_ns);
    last_ns = reading.time_ns;
  }
}

TEST(DisClock, LostPdusShiftNothing) {
  std::mt19937_64 random(5);
  DisClock all;
  DisClock few;
  std::int64_t time_ns = 3'599 * kSecondNs;
  static_cast<void>(few.read(timestamp_of(time_ns, false), time_ns));
  for (int i = 0; i < 20'000; ++i) {
    const auto whole = all.read(timestamp_of(time_ns, false), time_ns);
    if (random() % 50 == 0) {
      // The times agree to the nanosecond although the other clock saw one stamp of fifty.
      EXPECT_EQ(few.read(timestamp_of(time_ns, false), time_ns).time_ns, whole.time_ns);
    }
    time_ns += static_cast<std::int64_t>(random() % (4 * kSecondNs)) + 2000;
  }
}

TEST(DisClock, TheLocalClockSaysHowManyHoursASilentSenderLetPass) {
  for (const std::int64_t silence_s : {1'700, 1'900, 2'500, 3'600, 7'300, 100'000}) {
    DisClock clock;
    const std::int64_t begin_ns = 1'234 * kSecondNs;
    static_cast<void>(clock.read(timestamp_of(begin_ns, true), 50));
    const std::int64_t end_ns = begin_ns + silence_s * kSecondNs;
    // The local clock runs 1 % fast and the PDU came 80 ms late.
    const auto local_ns =
        static_cast<std::int64_t>(1.01e9 * static_cast<double>(silence_s)) + 80'000'000;
    const auto reading = clock.read(timestamp_of(end_ns, true), local_ns);
    EXPECT_EQ(reading.order, Order::next) << silence_s;
    EXPECT_LE(std::abs(reading.time_ns - end_ns), kStampErrorNs) << silence_s;
  }
}

TEST(DisClock, DuplicatesAndLateStampsAreRecognised) {
  DisClock clock;
  const auto at = [](double second) {
    return timestamp_of(static_cast<std::int64_t>(second * 1e9), false);
  };
  static_cast<void>(clock.read(at(3599.0), 0));
  const auto newest = clock.read(at(3601.0), 2 * kSecondNs);
  EXPECT_EQ(newest.order, Order::next);
  const auto again = clock.read(at(3601.0), 2 * kSecondNs + 5);
  EXPECT_EQ(again.order, Order::duplicate);
  EXPECT_EQ(again.time_ns, newest.time_ns);
  // This one lies in front of the full hour, behind which the newest is.
  const auto late = clock.read(at(3599.5), 2 * kSecondNs + 10);
  EXPECT_EQ(late.order, Order::late);
  EXPECT_NEAR(static_cast<double>(late.time_ns), 3599.5e9, 1000.0);
  const auto next = clock.read(at(3601.5), 2 * kSecondNs + 500'000'000);
  EXPECT_EQ(next.order, Order::next);
  EXPECT_NEAR(static_cast<double>(next.time_ns), 3601.5e9, 1000.0);
}

TEST(DisClock, AClockThatWasSetGoesOnByTheLocalClock) {
  DisClock clock;
  const auto at = [](double second, bool absolute) {
    return timestamp_of(static_cast<std::int64_t>(second * 1e9), absolute);
  };
  static_cast<void>(clock.read(at(100.0, false), 0));
  const auto before = clock.read(at(110.0, false), 10 * kSecondNs);
  const auto back = clock.read(at(3.0, false), 12 * kSecondNs);
  EXPECT_EQ(back.order, Order::restart);
  EXPECT_EQ(back.time_ns, before.time_ns + 2 * kSecondNs);
  const auto after = clock.read(at(4.0, false), 13 * kSecondNs);
  EXPECT_EQ(after.order, Order::next);
  EXPECT_NEAR(static_cast<double>(after.time_ns - back.time_ns), 1e9, 2000.0);
  // A sender that changes the kind of its stamps sets its clock too, even at the same number.
  const auto other = clock.read(at(4.0, true), 13 * kSecondNs);
  EXPECT_EQ(other.order, Order::restart);
  EXPECT_GT(other.time_ns, after.time_ns);
  EXPECT_EQ(clock.read(at(4.0, true), 13 * kSecondNs).order, Order::duplicate);
}

TEST(DisClock, TheFullHourIsTheBeginningOfTheNext) {
  DisClock clock;
  const auto last = clock.read(0xFFFF'FFFDU, 0);  // one unit in front of the full hour
  const auto full = clock.read(0xFFFF'FFFFU, 1676);
  EXPECT_EQ(full.order, Order::next);
  EXPECT_EQ(full.time_ns, kHourNs);
  EXPECT_EQ(last.time_ns, kHourNs - 1676);
  EXPECT_EQ(clock.read(0x0000'0001U, 1676).order, Order::duplicate);
  DisClock fresh;
  EXPECT_EQ(fresh.read(0xFFFF'FFFFU, 0).time_ns, 0);
}

}  // namespace
}  // namespace emit::protocol::dis
