// SPDX-License-Identifier: Apache-2.0
#include "telemetry/progress.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "support/fake_clock.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using emit::test::kSecondNs;

/// Progress whose clock and output are the test's.
struct Rig {
  explicit Rig(bool terminal, std::uint64_t total = 100)
      : progress("warm-up", total, clock,
                 {terminal, [this](std::string_view text) { written.emplace_back(text); }}) {}
  test::FakeClock clock;
  std::vector<std::string> written;
  Progress progress;
};

TEST(Progress, a_log_gets_a_line_every_three_seconds_with_the_time_left) {
  Rig rig(false);
  for (std::uint64_t done = 1; done <= 99; ++done) {
    rig.clock.advance(kSecondNs / 2);
    rig.progress.advance_to(done);
  }
  ASSERT_EQ(rig.written.size(), 16U) << "49.5 s";
  EXPECT_EQ(rig.written[0], "warm-up 6 %, about 47 s left\n");
  EXPECT_EQ(rig.written[10], "warm-up 66 %, about 17 s left\n");
  rig.clock.advance(kSecondNs / 2);
  rig.progress.advance_to(100);
  rig.progress.finish();
  ASSERT_EQ(rig.written.size(), 17U);
  EXPECT_EQ(rig.written.back(), "warm-up done after 50 s\n");
}

TEST(Progress, short_work_leaves_a_log_alone) {
  Rig rig(false);
  for (const std::uint64_t done : {30U, 60U, 100U}) {
    rig.clock.advance(kSecondNs * 9 / 10);
    rig.progress.advance_to(done);
  }
  rig.progress.finish();
  EXPECT_TRUE(rig.written.empty());
}

TEST(Progress, lines_of_a_work_of_hours_move_apart) {
  Rig rig(false, 36'000);
  for (std::uint64_t second = 1; second < 36'000; ++second) {
    rig.clock.advance(kSecondNs);
    rig.progress.advance_to(second);
  }
  EXPECT_GT(rig.written.size(), 100U);
  EXPECT_LT(rig.written.size(), 400U) << "a line every three seconds would be 12000";
  EXPECT_TRUE(std::ranges::any_of(rig.written, [](const std::string& line) {
    return line.find(" h left\n") != std::string::npos;
  }));
}

TEST(Progress, work_that_has_done_nothing_says_no_time) {
  Rig rig(false);
  rig.clock.advance(5 * kSecondNs);
  rig.progress.advance_to(0);
  ASSERT_EQ(rig.written.size(), 1U);
  EXPECT_EQ(rig.written[0], "warm-up 0 %\n");
}

TEST(Progress, a_terminal_gets_a_bar_that_is_drawn_ten_times_a_second_and_cleared) {
  Rig rig(true);
  for (std::uint64_t done = 1; done <= 50; ++done) {
    rig.clock.advance(kSecondNs / 50);
    rig.progress.advance_to(done);
  }
  EXPECT_EQ(rig.written.size(), 10U) << "one second";
  EXPECT_EQ(rig.written.back(),
            "\rwarm-up [#############.................] 46 %, about 1 s left\x1b[K");
  rig.progress.finish();
  EXPECT_EQ(rig.written.back(), "\r\x1b[K");
  const std::size_t count = rig.written.size();
  rig.clock.advance(kSecondNs);
  rig.progress.advance_to(60);
  EXPECT_EQ(rig.written.size(), count) << "a finished bar is not drawn again";
}

TEST(Progress, more_parts_than_the_total_are_all_of_it) {
  Rig rig(true, 0);
  rig.progress.advance_to(7);
  ASSERT_EQ(rig.written.size(), 1U);
  EXPECT_NE(rig.written[0].find("100 %"), std::string::npos);
}

TEST(ProgressMeter, what_is_no_share_counts_as_the_nearer_end) {
  test::FakeClock clock;
  const ProgressMeter meter(clock);
  clock.advance(4 * kSecondNs);
  EXPECT_EQ(meter.report(-1.0).done_percent, 0);
  EXPECT_EQ(meter.report(0.0 / 0.0).done_percent, 0);
  EXPECT_EQ(meter.report(2.0).done_percent, 100);
  EXPECT_DOUBLE_EQ(*meter.report(0.25).left_s, 12.0);
}

TEST(ProgressText, durations_have_the_unit_that_a_reader_wants) {
  EXPECT_EQ(duration_text(0.4), "0 s");
  EXPECT_EQ(duration_text(89.0), "89 s");
  EXPECT_EQ(duration_text(240.0), "4 min");
  EXPECT_EQ(duration_text(6480.0), "1.8 h");
}

}  // namespace
}  // namespace emit::server
