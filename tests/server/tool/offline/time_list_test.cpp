// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/time_list.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace emit::tool {
namespace {

constexpr std::int64_t kHourNs = 3'600'000'000'000;
/// 2014-06-21T06:00:00Z.
constexpr ClockOfDay kSix{1'403'330'400'000'000'000, 0.0};

std::vector<double> times(const std::string& text, const ClockOfDay& clock = kSix) {
  const auto parsed = parse_times(text, clock);
  EXPECT_TRUE(parsed.has_value()) << (parsed ? "" : parsed.error().text);
  return parsed.value_or(std::vector<double>());
}

TEST(TimeList, a_range_has_both_ends) {
  const std::vector<double> list = times("06:00..20:00/10min");
  ASSERT_EQ(list.size(), 85U);
  EXPECT_EQ(list.front(), 0.0);
  EXPECT_EQ(list[1], 600.0);
  EXPECT_EQ(list.back(), 50'400.0);
}

TEST(TimeList, a_step_that_does_not_fit_ends_before_the_last) {
  EXPECT_EQ(times("0..100/30"), (std::vector<double>{0.0, 30.0, 60.0, 90.0}));
  const std::vector<double> tenths = times("0..1/0.1s");
  ASSERT_EQ(tenths.size(), 11U);
  EXPECT_EQ(tenths[3], 0.3) << "rounding of sums is not in file names";
}

TEST(TimeList, lists_are_sorted_and_have_every_instant_once) {
  EXPECT_EQ(times("07:00, 3600, 06:30:15.5,0..7200/1h"),
            (std::vector<double>{0.0, 1815.5, 3600.0, 7200.0}));
}

TEST(TimeList, hours_behind_24_are_those_of_later_days) {
  EXPECT_EQ(times("26:00"), (std::vector<double>{20 * 3600.0}));
  EXPECT_EQ(times("00:00..48:00/1d"), (std::vector<double>{-6 * 3600.0, 18 * 3600.0, 42 * 3600.0}));
}

TEST(TimeList, the_clock_may_run_ahead_of_utc) {
  ClockOfDay summer = kSix;
  summer.utc_offset_h = 2.0;  // the epoch is 08:00
  EXPECT_EQ(times("06:00,08:00", summer), (std::vector<double>{-7200.0, 0.0}));
  // The day of the epoch is that of the clock: 23:00 UTC is 01:00 of the next day.
  ClockOfDay late{kSix.epoch_utc_ns + 17 * kHourNs, 2.0};
  EXPECT_EQ(times("01:00", late), (std::vector<double>{0.0}));
  ClockOfDay before_1970{-kHourNs, 0.0};
  EXPECT_EQ(times("23:30", before_1970), (std::vector<double>{1800.0}));
}

TEST(TimeList, what_is_wrong_is_quoted) {
  for (const char* text :
       {"", "noon", "6:0x", "06:60", "06:00:61", "1:2:3:4", "-06:00", "06:00..20:00",
        "06:00..20:00/0min", "06:00..20:00/-1h", "06:00..20:00/ten", "20:00..06:00/1h", "0..1e9/1s",
        "1e12", "0,,1", "nan", "06.5:00"}) {
    const auto parsed = parse_times(text, kSix);
    ASSERT_FALSE(parsed.has_value()) << text;
    EXPECT_EQ(parsed.error().code, physics::ErrorCode::invalid_argument) << text;
  }
  EXPECT_NE(
      parse_times("1,20:00..06:00/1h", kSix).error().text.find("'20:00..06:00/1h': the range"),
      std::string::npos);
}

}  // namespace
}  // namespace emit::tool
