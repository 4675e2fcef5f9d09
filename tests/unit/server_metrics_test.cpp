// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <string>

#include "app/context.hpp"
#include "support/exposition.hpp"
#include "support/fake_clock.hpp"
#include "telemetry/metrics_text.hpp"

namespace emit::server {
namespace {

using test::Exposition;

Event event(EventKind kind, std::uint64_t a, std::uint64_t b, std::string_view text) {
  Event out;
  out.kind = kind;
  out.a = a;
  out.b = b;
  std::copy_n(text.begin(), std::min(text.size(), out.text.size() - 1), out.text.begin());
  return out;
}

/// Everything that metrics are made from, without agents.
struct Sources {
  test::FakeClock clock;
  Context context{clock, 1u << 16, 4};
  StatusBoard board;
  DutyCycle duty;

  [[nodiscard]] std::string text() const {
    MetricsSources sources;
    sources.counters = &context.counters;
    sources.times = &context.times;
    sources.clients = context.clients();
    sources.board = &board;
    sources.agents = {{"sender", &duty}};
    sources.build = {{"version", "1.2"}, {"device", "a \"b\" \\ c\nd"}};
    return metrics_text(sources, {7, true, 1'500'000'000});
  }
};

constexpr std::uint32_t kKey = 3u << kConnectionPlaceBits | 2u;  // place 2, third use

TEST(Histogram, CountsIntoTheBucketWhoseUpperEndIsTheFirstNotBelow) {
  Histogram histogram;
  for (const std::int64_t ns : {-5, 0, 10'000, 10'001, 1'000'000}) histogram.record(ns);
  histogram.record(11'000'000'000);
  EXPECT_EQ(histogram.count(0), 3U);  // up to 10 us, ends included; no negative times
  EXPECT_EQ(histogram.count(1), 1U);
  EXPECT_EQ(histogram.count(6), 1U);
  EXPECT_EQ(histogram.count(Histogram::kBuckets - 1), 1U);
  EXPECT_EQ(histogram.sum_ns(), 10'000U + 10'001U + 1'000'000U + 11'000'000'000U);
}

TEST(MetricsText, IsSoundWhetherThereIsMuchToSayOrNothing) {
  Sources sources;
  EXPECT_EQ(Exposition(sources.text()).fault(), "");
  sources.context.counters.add(Counter::frames_sent, 41);
  sources.context.times.frame.record(3'000'000);
  sources.context.times.wait.record(20'000'000'000);
  sources.duty.record(2'000'000);
  sources.context.clients()[2].begin(kKey);
  sources.board.note(event(EventKind::connected, kKey, 0, "127.0.0.1:5"));
  DistinctTable warnings;
  static_cast<void>(warnings.note("event=refused text=\"x\\y\"", 5'000'000'000));
  static_cast<void>(warnings.note("event=refused text=\"x\\y\"", 6'000'000'000));
  sources.board.set_warnings(LogLevel::warn, warnings);
  const Exposition metrics(sources.text());
  EXPECT_EQ(metrics.fault(), "");
  EXPECT_EQ(metrics.value("emitd_frames_sent_total"), 41.0);
  EXPECT_EQ(metrics.value("emitd_run_info", {{"run_id", "7"}}), 1.0);
  EXPECT_EQ(metrics.value("emitd_ready"), 1.0);
  EXPECT_EQ(metrics.value("emitd_uptime_seconds"), 1.5);
  EXPECT_EQ(metrics.value("emitd_build_info", {{"device", "a \\\"b\\\" \\\\ c\\nd"}}), 1.0);
  EXPECT_EQ(metrics.value("emitd_frame_seconds_count"), 1.0);
  EXPECT_EQ(metrics.value("emitd_frame_seconds_sum"), 0.003);
  EXPECT_EQ(metrics.value("emitd_frame_seconds_bucket", {{"le", "0.002"}}), 0.0);
  EXPECT_EQ(metrics.value("emitd_frame_seconds_bucket", {{"le", "0.005"}}), 1.0);
  EXPECT_EQ(metrics.value("emitd_stage_seconds_bucket", {{"stage", "wait"}, {"le", "10"}}), 0.0);
  EXPECT_EQ(metrics.value("emitd_stage_seconds_bucket", {{"stage", "wait"}, {"le", "+Inf"}}), 1.0);
  EXPECT_EQ(metrics.value("emitd_agent_longest_turn_seconds", {{"agent", "sender"}}), 0.002);
  EXPECT_EQ(metrics.value("emitd_warnings_total", {{"level", "warn"}}), 2.0);
  EXPECT_EQ(metrics.value("emitd_warning_last_seconds", {{"level", "warn"}}), 6.0);
}

TEST(MetricsText, HasEveryCounterWithItsHelp) {
  const std::string text = Sources().text();
  for (const CounterLabel& label : kCounterLabels) {
    const std::string help =
        "# HELP emitd_" + std::string(label.name) + "_total " + std::string(label.label) + "\n";
    EXPECT_NE(text.find(help), std::string::npos) << help;
  }
}

TEST(MetricsText, ShowsClientsFromTheirConnectionToTheirEnd) {
  Sources sources;
  const auto frames = [&](const Exposition::Labels& labels) {
    return Exposition(sources.text()).value("emitd_client_frames_total", labels);
  };
  ClientCounts& counts = sources.context.clients()[2];
  counts.begin(kKey);
  sources.board.note(event(EventKind::connected, kKey, 0, "[::1]:40000"));
  sources.board.note(event(EventKind::hello, kKey, 2, "seen \x01\xff"));
  sources.board.note(event(EventKind::subscribed, kKey, 1, "udp"));
  counts.frames.store(9);
  EXPECT_EQ(frames({{"connection", "2.3"},
                    {"peer", "[::1]:40000"},
                    {"role", "client"},
                    {"software", "seen ??"},
                    {"channel", "1"},
                    {"transport", "udp"}}),
            9.0);
  // Its place is another's: the row of the old one, whose end was not told, is gone.
  counts.begin(kKey + (1u << kConnectionPlaceBits));
  EXPECT_TRUE(std::isnan(frames({})));
  sources.board.note(event(EventKind::connected, kKey + (1u << kConnectionPlaceBits), 0, "b"));
  EXPECT_EQ(frames({{"peer", "b"}}), 0.0);
  EXPECT_EQ(sources.board.clients().size(), 1U);
  counts.end();
  EXPECT_TRUE(std::isnan(frames({})));
}

}  // namespace
}  // namespace emit::server
