// SPDX-License-Identifier: Apache-2.0
#include "axes/acutrol_host.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "axes/acutrol_table.hpp"
#include "emit/physics/constants.hpp"
#include "motion/table_simulator.hpp"
#include "support/heap_counter.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using physics::kDegree;
using protocol::AxesCommand;
using protocol::AxesMode;
using protocol::AxesMonitor;
using protocol::AxesState;
using test::kMs;
using test::kSecondNs;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

std::vector<std::string> split(std::string_view text) {
  std::vector<std::string> out;
  LineSplitter splitter;
  while (splitter.next(text)) out.emplace_back(splitter.line());
  return out;
}

/// A host of two axes against answers that the test writes, or against a simulated controller.
class AcutrolHostTest : public ::testing::Test {
 protected:
  AcutrolHostTest() {
    AcutrolHost::Axis axis;
    axis.limits = {-2.0, 2.0, 5.0, 50.0};
    auto made = AcutrolHost::create({axis, {axis.limits, 0.5}}, counters_, events_);
    EXPECT_TRUE(made.has_value());
    host_.emplace(std::move(*made));
    host_->start();
    TableSimulator::Options options;
    TableSimulator::Axis simulated;
    simulated.dynamics.limits = axis.limits;
    options.axes.assign(2, simulated);
    auto table = TableSimulator::create(options);
    EXPECT_TRUE(table.has_value());
    table_.emplace(std::move(*table));
  }

  /// Returns the lines for a command of this mode, in which the axes are to be at `demand_rad`.
  std::string lines(AxesMode mode, double demand_rad = 0.0) {
    AxesCommand command;
    command.counter = ++counter_;
    command.mode = mode;
    command.time_ns = now_ns_;
    command.count = mode == AxesMode::follow ? 2 : 0;
    for (auto& motion : command.axes) motion.angle_rad = demand_rad;
    return std::string(host_->lines(command, now_ns_));
  }
  std::optional<AxesMonitor> take(std::string_view bytes) {
    host_->take(bytes, now_ns_);
    return host_->monitor();
  }
  /// Lets the simulated controller step and answer, with a way of half a millisecond in each
  /// direction, and returns what the host makes of it.
  std::optional<AxesMonitor> turn(AxesMode mode, double demand_rad = 0.0) {
    const std::string asked = lines(mode, demand_rad);
    now_ns_ += kMs / 2;
    EXPECT_TRUE(table_->take(controller_.command(now_ns_), now_ns_));
    controller_.update(table_->step(now_ns_));
    std::string answers;
    for (const std::string& line : split(asked)) answers += controller_.answer(line, now_ns_);
    now_ns_ += kMs / 2;
    return take(answers);
  }
  AxesMonitor run(AxesMode mode, int turns, double demand_rad = 0.0) {
    AxesMonitor last;
    for (int i = 0; i < turns; ++i) {
      const auto monitor = turn(mode, demand_rad);
      EXPECT_TRUE(monitor.has_value());
      if (monitor) last = *monitor;
    }
    return last;
  }
  std::uint64_t count(Counter counter) { return counters_.get(counter); }

  Counters counters_;
  EventLog events_{16, counters_};
  std::optional<AcutrolHost> host_;
  std::optional<TableSimulator> table_;
  AcutrolTable controller_{2};
  std::int64_t now_ns_ = 1'000'000'000'000;
  std::uint64_t counter_ = 100;
};

TEST_F(AcutrolHostTest, reads_before_it_moves_and_starts_where_the_axes_are) {
  EXPECT_THAT(split(lines(AxesMode::park)), ElementsAre(":R:P 1", ":R:R 1", ":R:P 2", ":R:R 2",
                                                        ":interlock? 1", ":interlock? 2"));
  now_ns_ += 4 * kMs;
  const auto monitor = take("A 30.5\r\nB 1.0\r\nC -20\r\nD 0\r\nOpen\r\nOpen\r\n");
  ASSERT_TRUE(monitor.has_value());
  EXPECT_EQ(monitor->state, AxesState::motors_off);
  EXPECT_EQ(monitor->time_ns, now_ns_ - 2 * kMs) << "half of the round trip before the arrival";
  EXPECT_EQ(monitor->command_counter, 101U);
  EXPECT_EQ(monitor->count, 2U);
  EXPECT_NEAR(monitor->measured[0].angle_rad, 30.5 * kDegree, 1e-12);
  EXPECT_NEAR(monitor->measured[0].rate_rad_s, 1.0 * kDegree, 1e-12);
  EXPECT_NEAR(monitor->measured[1].angle_rad, -20.0 * kDegree, 1e-12);
  EXPECT_FALSE(host_->monitor().has_value()) << "once";
  EXPECT_THAT(split(lines(AxesMode::park)),
              ElementsAre(":D:P 1,30.500000", ":mode:position 1", ":interlock:close 1",
                          ":D:P 2,-20.000000", ":mode:position 2", ":interlock:close 2", ":R:P 1",
                          ":R:R 1", ":R:P 2", ":R:R 2", ":interlock? 1", ":interlock? 2"));
  const auto started = take("OK\nOK\nOK\nOK\nOK\nOK\n30.5\n0\n-20\n0\nClose\nClose\n");
  ASSERT_TRUE(started.has_value());
  EXPECT_EQ(started->state, AxesState::parking);
  now_ns_ += kMs;
  const auto asked = split(lines(AxesMode::follow, 0.1));
  EXPECT_THAT(asked, ElementsAre(":D:P 1,5.729578", ":R:P 1", ":R:R 1", ":D:P 2,5.729578", ":R:P 2",
                                 ":R:R 2", ":interlock? 1"));
}

TEST_F(AcutrolHostTest, parks_follows_and_switches_off_a_simulated_table) {
  AxesMonitor monitor = run(AxesMode::park, 4000);
  EXPECT_EQ(monitor.state, AxesState::parked);
  EXPECT_NEAR(monitor.measured[0].angle_rad, 0.0, 1e-3);
  EXPECT_NEAR(monitor.measured[1].angle_rad, 0.5, 1e-3);
  // It sets off at once, and says that it follows when the axes are there.
  EXPECT_EQ(run(AxesMode::follow, 2, 0.5).state, AxesState::capturing);
  monitor = run(AxesMode::follow, 4000, 0.5);
  EXPECT_EQ(monitor.state, AxesState::following);
  EXPECT_NEAR(monitor.measured[0].angle_rad, 0.5, 1e-3);
  EXPECT_NEAR(monitor.demanded[0].angle_rad, 0.5, 1e-12);
  // The way to park is a soft one: within a fifth of rate and acceleration.
  double last_rate = 0.0;
  for (int i = 0; i < 3000; ++i) {
    const auto parking = turn(AxesMode::park);
    ASSERT_TRUE(parking.has_value());
    const double rate = parking->demanded[0].rate_rad_s;
    EXPECT_LE(std::abs(rate), 1.0 + 1e-9);
    EXPECT_LE(std::abs(rate - last_rate), 10.0 * 1e-3 + 1e-9);
    last_rate = rate;
    monitor = *parking;
  }
  EXPECT_EQ(monitor.state, AxesState::parked);
  EXPECT_NEAR(monitor.measured[0].angle_rad, 0.0, 1e-3);
  EXPECT_EQ(run(AxesMode::off, 3).state, AxesState::motors_off);
  EXPECT_EQ(controller_.command(now_ns_).mode, AxesMode::off);
  EXPECT_THAT(lines(AxesMode::off), Not(HasSubstr(":mode:off"))) << "once is enough";
  EXPECT_EQ(controller_.errors(), 0U);
  EXPECT_EQ(count(Counter::axes_reports_refused), 0U);
}

TEST_F(AcutrolHostTest, an_opened_interlock_is_a_fault_until_the_host_switches_off) {
  run(AxesMode::follow, 2000, 0.3);
  table_->set_fault(1, AxisFault::runaway);
  AxesMonitor monitor = run(AxesMode::follow, 500, 0.3);
  EXPECT_EQ(monitor.state, AxesState::fault);
  EXPECT_NE(monitor.faulty_axes, 0U);
  table_->set_fault(1, AxisFault::none);
  monitor = run(AxesMode::park, 500);
  EXPECT_EQ(monitor.state, AxesState::fault) << "nobody has ended it";
  host_->start();  // neither does a new connection
  EXPECT_EQ(run(AxesMode::follow, 100, 0.3).state, AxesState::fault);
  monitor = run(AxesMode::off, 3);
  EXPECT_EQ(monitor.state, AxesState::motors_off);
  EXPECT_EQ(monitor.faulty_axes, 0U);
  EXPECT_EQ(run(AxesMode::follow, 4000, 0.3).state, AxesState::following);
  EXPECT_EQ(events_.ring().front()->kind, EventKind::axes_refused);
}

TEST_F(AcutrolHostTest, a_fault_that_lasts_comes_back_after_the_host_has_switched_off) {
  run(AxesMode::follow, 2000, 0.3);
  table_->set_fault(0, AxisFault::stuck);
  run(AxesMode::follow, 1000, 1.5);
  run(AxesMode::off, 3);
  const AxesMonitor monitor = run(AxesMode::follow, 3000, -1.5);
  EXPECT_EQ(monitor.state, AxesState::fault);
}

TEST_F(AcutrolHostTest, waits_for_interlocks_that_close_slowly_but_not_for_ever) {
  for (const bool closes : {true, false}) {
    host_->start();
    lines(AxesMode::park);
    take("1\n0\n1\n0\nOpen\nOpen\n");
    lines(AxesMode::park);
    take("OK\nOK\nOK\nOK\nOK\nOK\n1\n0\n1\n0\nClose\nOpen\n");
    for (int i = 0; i < 40; ++i) {
      now_ns_ += 100 * kMs;
      EXPECT_THAT(lines(AxesMode::park), Not(HasSubstr(":D:P"))) << "the axes stay";
      const auto monitor = take("1\n0\n1\n0\nClose\nOpen\n");
      ASSERT_TRUE(monitor.has_value());
      EXPECT_EQ(monitor->state, AxesState::motors_off);
    }
    now_ns_ += closes ? kMs : 2 * kSecondNs;
    lines(AxesMode::park);
    const auto monitor = take(closes ? "1\n0\n1\n0\nClose\nClose\n" : "1\n0\n1\n0\nClose\nOpen\n");
    ASSERT_TRUE(monitor.has_value());
    EXPECT_EQ(monitor->state, closes ? AxesState::parking : AxesState::fault);
    EXPECT_EQ(monitor->faulty_axes, closes ? 0U : 2U);
  }
}

TEST_F(AcutrolHostTest, an_error_switches_all_motors_off_and_names_the_axis) {
  run(AxesMode::follow, 1000, 0.3);
  lines(AxesMode::follow, 0.3);
  const auto monitor = take("OK\n1\n0\nERROR parameter out of range 7\n1\n0\nClose\n");
  ASSERT_TRUE(monitor.has_value()) << "the axes were measured all the same";
  EXPECT_EQ(monitor->state, AxesState::fault);
  EXPECT_EQ(monitor->faulty_axes, 2U);
  const Event* event = events_.ring().front();
  ASSERT_NE(event, nullptr);
  EXPECT_EQ(event->kind, EventKind::axes_refused);
  EXPECT_EQ(event->a, 2U);
  EXPECT_STREQ(event->text.data(), "ERROR parameter out of range 7");
  const std::string off = lines(AxesMode::follow, 0.3);
  EXPECT_THAT(off, HasSubstr(":mode:off 1\r\n:interlock:open 1\r\n:mode:off 2"));
  EXPECT_THAT(off, Not(HasSubstr("reset")));
  EXPECT_THAT(off, Not(HasSubstr(":D:P")));
  // It is said again when that is refused too.
  take("OK\nOK\nERROR\nOK\n1\n0\n1\n0\nOpen\nOpen\n");
  EXPECT_THAT(lines(AxesMode::follow, 0.3), HasSubstr(":mode:off 1"));
  take("OK\nOK\nOK\nOK\n1\n0\n1\n0\nOpen\nOpen\n");
  EXPECT_THAT(lines(AxesMode::follow, 0.3), Not(HasSubstr(":mode:off 1")));
}

TEST_F(AcutrolHostTest, waits_for_its_answers_and_counts_what_it_leaves_out) {
  EXPECT_NE(lines(AxesMode::park), "");
  now_ns_ += 10 * kMs;
  EXPECT_EQ(lines(AxesMode::park), "");
  EXPECT_EQ(lines(AxesMode::park), "");
  EXPECT_EQ(count(Counter::axes_rounds_left_out), 2U);
  EXPECT_TRUE(host_->waits_since(now_ns_ - 5 * kMs));
  EXPECT_FALSE(host_->waits_since(now_ns_ - 15 * kMs));
  EXPECT_FALSE(take("1\n0\n1\n").has_value());
  EXPECT_EQ(lines(AxesMode::park), "");
  const auto monitor = take("0\nOpen\nOpen\n");
  ASSERT_TRUE(monitor.has_value());
  EXPECT_EQ(monitor->command_counter, 101U) << "of the command that was sent";
  EXPECT_NE(lines(AxesMode::park), "");
}

TEST_F(AcutrolHostTest, switching_off_does_not_wait) {
  run(AxesMode::follow, 1000, 0.3);
  lines(AxesMode::follow, 0.3);  // nobody answers
  EXPECT_THAT(split(lines(AxesMode::off)),
              ElementsAre(":mode:off 1", ":interlock:open 1", ":mode:off 2", ":interlock:open 2"));
  EXPECT_EQ(lines(AxesMode::off), "") << "it is said once";
  const auto monitor = take("OK\n1\n0\nOK\n1\n0\nClose\nOK\nOK\nOK\nOK\n");
  ASSERT_TRUE(monitor.has_value());
  EXPECT_EQ(monitor->state, AxesState::motors_off);
  EXPECT_THAT(lines(AxesMode::off), Not(HasSubstr(":mode:off")));
}

TEST_F(AcutrolHostTest, refuses_rounds_with_malformed_answers) {
  for (const char* answers : {"what\n0\n1\n0\nOpen\nOpen\n", "nan\n0\n1\n0\nOpen\nOpen\n",
                              "1e9\n0\n1\n0\nOpen\nOpen\n", "1\n0\n1\n0\nOpen\nmaybe\n"}) {
    const std::uint64_t refused = count(Counter::axes_reports_refused);
    host_->start();
    lines(AxesMode::park);
    EXPECT_FALSE(take(answers).has_value()) << answers;
    EXPECT_EQ(count(Counter::axes_reports_refused), refused + 1) << answers;
    EXPECT_FALSE(host_->order_lost()) << answers;
    // The next round is a new one.
    lines(AxesMode::park);
    EXPECT_TRUE(take("1\n0\n1\n0\nOpen\nOpen\n").has_value()) << answers;
  }
}

TEST_F(AcutrolHostTest, notices_answers_out_of_order) {
  for (const char* answers : {"OK\n", "1\n0\n1\n0\nOpen\nOK\n", "1\n0\n1\n0\n5.0\n"}) {
    host_->start();
    lines(AxesMode::park);
    EXPECT_FALSE(take(answers).has_value()) << answers;
    EXPECT_TRUE(host_->order_lost()) << answers;
  }
  host_->start();
  EXPECT_FALSE(host_->order_lost());
  // One answer too many behind a round makes the round doubtful.
  lines(AxesMode::park);
  EXPECT_FALSE(take("7\n1\n0\n1\nOpen\nOpen\nOpen\n").has_value());
  // An answer of a demand that is a number is one too many in front.
  host_->start();
  run(AxesMode::follow, 1000, 0.3);
  lines(AxesMode::follow, 0.3);
  EXPECT_FALSE(take("7\nOK\n1\n0\nOK\n1\n0\nClose\n").has_value());
  EXPECT_TRUE(host_->order_lost());
}

TEST_F(AcutrolHostTest, a_lost_connection_is_begun_where_the_axes_are) {
  run(AxesMode::follow, 3000, 0.3);
  lines(AxesMode::follow, 0.3);
  host_->take("OK\n1.", now_ns_);
  host_->start();
  EXPECT_THAT(lines(AxesMode::follow, 0.3), Not(HasSubstr(":D:P")));
  EXPECT_TRUE(take("17\n0\n17\n0\nClose\nClose\n").has_value());
  EXPECT_THAT(lines(AxesMode::follow, 0.3), HasSubstr(":D:P 1,17.000000"));
}

TEST_F(AcutrolHostTest, allocates_nothing) {
  run(AxesMode::park, 100);
  const std::string reads = "OK\r\n10.5\r\n0.25\r\nOK\r\n-3.5\r\n0.125\r\nClose\r\n";
  AxesCommand command;
  command.mode = AxesMode::follow;
  command.count = 2;
  const std::uint64_t before = test::heap_request_count();
  int monitors = 0;
  for (int i = 0; i < 1000; ++i) {
    now_ns_ += kMs;
    command.axes[0].angle_rad = 0.001 * i + 1e-7;
    static_cast<void>(host_->lines(command, now_ns_));
    host_->take(reads, now_ns_);
    monitors += host_->monitor().has_value() ? 1 : 0;
  }
  EXPECT_EQ(test::heap_request_count(), before);
  EXPECT_EQ(monitors, 1000);
}

TEST_F(AcutrolHostTest, refuses_axes_that_are_none) {
  EXPECT_FALSE(AcutrolHost::create({}, counters_, events_).has_value());
  EXPECT_FALSE(AcutrolHost::create({{{1.0, 0.0, 1.0, 1.0}, 0.0}}, counters_, events_).has_value());
  EXPECT_FALSE(
      AcutrolHost::create(std::vector<AcutrolHost::Axis>(6), counters_, events_).has_value());
}

TEST(AcutrolTable, understands_both_forms_and_refuses_the_rest) {
  AcutrolTable table(2);
  AxesMonitor monitor;
  monitor.count = 2;
  monitor.measured[1] = {0.5, 0.25, 0.0};
  table.update(monitor);
  const auto answer = [&](std::string_view line) { return std::string(table.answer(line, 5)); };
  EXPECT_EQ(answer(":R:P 2"), "ACUTROL 28.647890\r\n");
  EXPECT_EQ(answer(" :READ:RATE? 2 "), "ACUTROL 14.323945\r\n");
  EXPECT_EQ(answer(":mode:position 1"), "ACUTROL OK\r\n");
  EXPECT_EQ(answer(":D:P 1, -12.5"), "ACUTROL OK\r\n");
  EXPECT_EQ(answer(":interlock:close 1"), "ACUTROL OK\r\n");
  EXPECT_EQ(answer(":interlock? 1"), "ACUTROL Close\r\n");
  EXPECT_EQ(answer(":interlock? 2"), "ACUTROL Open\r\n");
  EXPECT_EQ(table.command(6).mode, AxesMode::off) << "the other axis is off";
  EXPECT_EQ(table.errors(), 0U);
  for (const char* line :
       {"", "x", ":R:P", ":R:P 3", ":R:P 0", ":R:P x", ":D:P 1", ":D:P 1,", ":D:P 1,1e9",
        ":D:P 1,nan", ":R:P 1,5", ":jump 1", ":interlock:reset 1"}) {
    EXPECT_THAT(answer(line), ::testing::StartsWith("ACUTROL ERROR")) << line;
  }
  EXPECT_EQ(table.errors(), 13U);
}

TEST(AcutrolTable, goes_on_between_demands_and_rests_when_they_stop) {
  AcutrolTable table(1);
  for (const char* line : {":M:P 1", ":I:C 1"}) static_cast<void>(table.answer(line, 0));
  static_cast<void>(table.answer(":D:P 1,10", 10 * kMs));
  static_cast<void>(table.answer(":D:P 1,11", 20 * kMs));
  const AxesCommand& command = table.command(25 * kMs);
  EXPECT_EQ(command.mode, AxesMode::follow);
  EXPECT_NEAR(command.axes[0].angle_rad, 11.5 * kDegree, 1e-9);
  EXPECT_NEAR(command.axes[0].rate_rad_s, 100.0 * kDegree, 1e-9);
  static_cast<void>(table.command(200 * kMs));
  EXPECT_NEAR(command.axes[0].angle_rad, 11.0 * kDegree, 1e-9);
  EXPECT_EQ(command.axes[0].rate_rad_s, 0.0);
  // A leap within a millisecond gives no rate.
  static_cast<void>(table.answer(":D:P 1,-5e7", 201 * kMs));
  static_cast<void>(table.answer(":D:P 1,5e7", 202 * kMs));
  static_cast<void>(table.command(203 * kMs));
  EXPECT_EQ(protocol::check(command), protocol::AxesFault::none);
  EXPECT_EQ(command.axes[0].rate_rad_s, 0.0);
}

}  // namespace
}  // namespace emit::server
