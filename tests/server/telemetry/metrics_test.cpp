// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <string>

#include "agents/context.hpp"
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

/// All objects that metrics are made from, without agents.
struct Sources {
  test::FakeClock clock;
  Context context{clock, 1u << 16, 4};
  StatusBoard board;
  DutyCycle duty;
  RealtimeReport realtime;
  std::optional<PtpStatus> ptp;

  [[nodiscard]] std::string text() const {
    MetricsSources sources;
    sources.counters = &context.counters;
    sources.times = &context.times;
    sources.clients = context.clients();
    sources.board = &board;
    sources.agents = {{"sender", &duty}};
    sources.build = {{"version", "1.2"}, {"device", "a \"b\" \\ c\nd"}};
    sources.prediction = &context.prediction;
    sources.realtime = &realtime;
    return metrics_text(sources, {7, true, 1.0, 1'500'000'000, 9'000'000'000, 4096, ptp});
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
  EXPECT_EQ(metrics.value("emitd_journal_memory_bytes"), 4096.0);
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

TEST(MetricsText, TellsOfTimingOnlyWhatThereIs) {
  Sources sources;
  EXPECT_TRUE(std::isnan(Exposition(sources.text()).value("emitd_ptp_up")));
  EXPECT_TRUE(std::isnan(Exposition(sources.text()).value("emitd_realtime_granted")));
  sources.ptp.emplace();
  EXPECT_EQ(Exposition(sources.text()).value("emitd_ptp_up"), 0.0);
  EXPECT_TRUE(std::isnan(Exposition(sources.text()).value("emitd_ptp_offset_seconds")));
  *sources.ptp = {true, PtpState::slave, -250, true, "0011aa.fffe.bbccdd"};
  sources.realtime.add({"fifo", "conductor", true, ""});
  sources.realtime.add({"lock_memory", "", false, "no"});
  sources.context.prediction.record(0.5, 0.002);
  sources.context.prediction.record(0.25, 0.004);
  sources.duty.beat(7'500'000'000);
  sources.context.clients()[2].begin(kKey);
  sources.board.note(event(EventKind::connected, kKey, 0, "127.0.0.1:5"));
  sources.context.clients()[2].jitter_ns.store(3'000);
  sources.context.times.jitter.record(15'000);
  sources.context.times.sim_age.record(15'000);
  sources.context.times.sampling.record(15'000);
  const Exposition metrics(sources.text());
  EXPECT_EQ(metrics.fault(), "");
  EXPECT_EQ(metrics.value("emitd_ptp_up"), 1.0);
  EXPECT_EQ(metrics.value("emitd_ptp_offset_seconds"), -250e-9);
  EXPECT_EQ(metrics.value("emitd_ptp_grandmaster_present"), 1.0);
  EXPECT_EQ(
      metrics.value("emitd_ptp_info", {{"state", "slave"}, {"grandmaster", "0011aa.fffe.bbccdd"}}),
      1.0);
  EXPECT_EQ(metrics.value("emitd_realtime_granted", {{"setting", "fifo"}, {"agent", "conductor"}}),
            1.0);
  EXPECT_EQ(metrics.value("emitd_realtime_granted", {{"setting", "lock_memory"}, {"agent", ""}}),
            0.0);
  EXPECT_EQ(metrics.value("emitd_prediction_error_metres_count"), 2.0);
  EXPECT_EQ(metrics.value("emitd_prediction_error_metres_sum"), 0.75);
  EXPECT_EQ(metrics.value("emitd_prediction_error_metres_bucket", {{"le", "0.2"}}), 0.0);
  EXPECT_EQ(metrics.value("emitd_prediction_error_metres_bucket", {{"le", "0.5"}}), 2.0);
  EXPECT_EQ(metrics.value("emitd_prediction_error_max_metres"), 0.5);
  EXPECT_EQ(metrics.value("emitd_prediction_error_max_radians"), 0.004);
  EXPECT_EQ(metrics.value("emitd_agent_heartbeat_age_seconds", {{"agent", "sender"}}), 1.5);
  EXPECT_EQ(metrics.value("emitd_client_jitter_seconds"), 3e-6);
  for (const char* name : {"delay_jitter", "sim_age", "sampling"}) {
    const std::string family = std::string("emitd_") + name + "_seconds";
    EXPECT_EQ(metrics.value(family + "_count"), 1.0) << name;
    EXPECT_EQ(metrics.value(family + "_bucket", {{"le", "2e-05"}}), 1.0) << name;
  }
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
  // Its place belongs to another connection now. The row of the old one, whose end was not
  // reported, is gone.
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
