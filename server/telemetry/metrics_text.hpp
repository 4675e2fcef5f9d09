// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "host/realtime.hpp"
#include "rt/client_counts.hpp"
#include "rt/counters.hpp"
#include "rt/histogram.hpp"
#include "rt/motion_times.hpp"
#include "rt/prediction_error.hpp"
#include "telemetry/duty_cycle.hpp"
#include "telemetry/ptp_status.hpp"
#include "telemetry/status_board.hpp"

namespace emit::server {

/// Metrics in Prometheus' text format, version 0.0.4. Names begin with `emitd_`.
class MetricsText {
 public:
  using Labels = std::vector<std::pair<std::string_view, std::string>>;

  /// Begins a metric; `type`: counter, gauge or histogram. Samples follow.
  void family(std::string_view name, std::string_view type, std::string_view help);
  void sample(const Labels& labels, std::uint64_t value);
  void sample(const Labels& labels, double value);
  /// Buckets, sum (seconds) and count.
  void histogram(const Labels& labels, const Histogram& histogram);

  [[nodiscard]] const std::string& text() const noexcept { return text_; }

 private:
  void line(std::string_view suffix, const Labels& labels, std::string_view value);

  std::string name_;
  std::string text_;
};

/// Sources of the numbers. All of them are atomic, fixed after start or behind a lock.
struct MetricsSources {
  const Counters* counters = nullptr;
  const FrameTimes* times = nullptr;
  const PredictionErrors* prediction = nullptr;  ///< null: left out
  const MotionTimes* motion = nullptr;           ///< likewise
  const RealtimeReport* realtime = nullptr;      ///< likewise
  std::span<const ClientCounts> clients;
  const StatusBoard* board = nullptr;
  NamedDutyCycles agents;
  MetricsText::Labels build;  ///< labels of emitd_build_info
};
/// Values that change with the moment of the scrape.
struct MetricsMoment {
  std::uint64_t run_id = 0;
  bool ready = false;
  double warmed_up_frac = 0.0;  ///< 0 .. 1
  std::int64_t uptime_ns = 0;
  std::int64_t now_ns = 0;                 ///< monotonic
  std::uint64_t journal_memory_bytes = 0;  ///< Context::journal_memory_bytes
  std::optional<PtpStatus> ptp;            ///< absent: not asked for
};

[[nodiscard]] std::string metrics_text(const MetricsSources& sources, const MetricsMoment& moment);

}  // namespace emit::server
