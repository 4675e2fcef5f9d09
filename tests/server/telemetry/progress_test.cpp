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

/// Progress whose clock and terminal are the test's.
struct Rig {
  explicit Rig(std::uint64_t total = 100)
      : progress("warm-up", total, clock,
                 [this](std::string_view text) { written.emplace_back(text); }) {}
  test::FakeClock clock;
  std::vector<std::string> written;
  Progress progress;
};

/// Lines that the daemon's log has of a work of `total` parts, each of which takes `part_ns`.
std::vector<std::string> log_lines(std::uint64_t total, std::int64_t part_ns) {
  test::FakeClock clock;
  ProgressMeter meter(clock);
  std::vector<std::string> lines;
  for (std::uint64_t done = 1; done < total; ++done) {
    clock.advance(part_ns);
    if (const auto report = meter.due(static_cast<double>(done) / static_cast<double>(total))) {
      lines.push_back(progress_text("warm-up", *report));
    }
  }
  return lines;
}

TEST(ProgressMeter, a_log_gets_a_line_every_three_seconds_with_the_time_left) {
  const std::vector<std::string> lines = log_lines(100, kSecondNs / 2);
  ASSERT_EQ(lines.size(), 16U) << "49.5 s";
  EXPECT_EQ(lines[0], "warm-up 6 %, about 47 s left");
  EXPECT_EQ(lines[10], "warm-up 66 %, about 17 s left");
}

TEST(ProgressMeter, short_work_leaves_a_log_alone) {
  EXPECT_TRUE(log_lines(3, kSecondNs * 9 / 10).empty());
}

TEST(ProgressMeter, lines_of_a_work_of_hours_move_apart) {
  const std::vector<std::string> lines = log_lines(36'000, kSecondNs);
  EXPECT_GT(lines.size(), 100U);
  EXPECT_LT(lines.size(), 400U) << "a line every three seconds would be 12000";
  EXPECT_TRUE(std::ranges::any_of(
      lines, [](const std::string& line) { return line.ends_with(" h left"); }));
}

TEST(ProgressMeter, work_that_has_done_nothing_says_no_time) {
  test::FakeClock clock;
  ProgressMeter meter(clock);
  clock.advance(5 * kSecondNs);
  const auto report = meter.due(0.0);
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(progress_text("warm-up", *report), "warm-up 0 %");
}

TEST(Progress, without_a_terminal_nothing_is_written) {
  testing::internal::CaptureStderr();  // a file, as in a log
  {
    Progress progress("warm-up", 100);
    for (std::uint64_t done = 0; done <= 100; ++done) progress.advance_to(done);
    progress.clear();
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TEST(Progress, lines_of_the_caller_find_the_terminal_clear) {
  Rig rig;
  rig.progress.advance_to(10);
  rig.progress.clear();
  ASSERT_EQ(rig.written.size(), 2U);
  EXPECT_EQ(rig.written.back(), "\r\x1b[K");
  rig.progress.clear();
  EXPECT_EQ(rig.written.size(), 2U) << "there is no bar to take away";
  rig.progress.advance_to(11);
  EXPECT_NE(rig.written.back().find("11 %"), std::string::npos) << "drawn at once";
}

TEST(Progress, a_terminal_gets_a_bar_that_is_drawn_ten_times_a_second_and_cleared) {
  Rig rig;
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
  Rig rig(0);
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
