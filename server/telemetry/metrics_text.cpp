// SPDX-License-Identifier: Apache-2.0
#include "telemetry/metrics_text.hpp"

#include <fmt/format.h>

#include "rt/connection_key.hpp"

namespace emit::server {
namespace {

double seconds(std::int64_t ns) {
  return static_cast<double>(ns) / 1e9;  // rounded once: bounds of buckets stay short
}

std::string escaped(std::string_view text, bool quotes) {
  std::string out;
  for (const char c : text) {
    if (c == '\\') {
      out += "\\\\";
    } else if (c == '\n') {
      out += "\\n";
    } else if (c == '"' && quotes) {
      out += "\\\"";
    } else if (static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) >= 0x7F) {
      out += '?';  // peers choose some of the text: the whole has to stay UTF-8
    } else {
      out += c;
    }
  }
  return out;
}

void add_state(MetricsText& out, const MetricsSources& sources, const MetricsMoment& moment) {
  out.family("build_info", "gauge", "Version and scene of the daemon; always 1");
  out.sample(sources.build, std::uint64_t{1});
  out.family("run_info", "gauge", "Identifier of the run, which changes at every reset; always 1");
  out.sample({{"run_id", std::to_string(moment.run_id)}}, std::uint64_t{1});
  out.family("ready", "gauge", "1 while host frames are taken");
  out.sample({}, std::uint64_t{moment.ready ? 1U : 0U});
  out.family("warmed_up_ratio", "gauge", "Share of the start's warm-up that is done, 0 to 1");
  out.sample({}, moment.warmed_up_frac);
  out.family("uptime_seconds", "gauge", "Time since the daemon began");
  out.sample({}, seconds(moment.uptime_ns));
  out.family("journal_memory_bytes", "gauge",
             "Memory of the run's journal entries, kept for recorders that connect later");
  out.sample({}, moment.journal_memory_bytes);
}

void add_counters(MetricsText& out, const Counters& counters) {
  for (std::size_t i = 0; i < kCounterCount; ++i) {
    const CounterLabel& label = kCounterLabels[i];
    out.family(fmt::format("{}_total", label.name), "counter", label.label);
    out.sample({}, counters.get(static_cast<Counter>(i)));
  }
}

void add_times(MetricsText& out, const FrameTimes& times) {
  out.family(
      "stage_seconds", "histogram",
      "Time of frames by stage: wait (pose received to start of rendering), render, readback, "
      "send (first to last byte, per client)");
  out.histogram({{"stage", "wait"}}, times.wait);
  out.histogram({{"stage", "render"}}, times.render);
  out.histogram({{"stage", "readback"}}, times.readback);
  out.histogram({{"stage", "send"}}, times.send);
  out.family("frame_seconds", "histogram",
             "Time of frames from the start of rendering to pixels in memory");
  out.histogram({}, times.frame);
  out.family("pose_to_last_byte_seconds", "histogram",
             "Delay from the arrival of a pose to the last byte of its frame, per client");
  out.histogram({}, times.pose_to_last_byte);
  out.family(
      "delay_jitter_seconds", "histogram",
      "Difference between the pose_to_last_byte delays of two consecutive frames, per client");
  out.histogram({}, times.jitter);
  out.family(
      "sim_age_seconds", "histogram",
      "Simulation time passed since the instant a frame shows, at its last byte, per client");
  out.histogram({}, times.sim_age);
  out.family("sampling_seconds", "histogram",
             "ig-clock, trigger: time a pose waited for the slot that used it");
  out.histogram({}, times.sampling);
}

void add_prediction(MetricsText& out, const PredictionErrors& errors) {
  out.family("prediction_error_metres", "histogram",
             "Distance of predicted sensor poses from the truth that came later");
  out.histogram({}, errors.position);
  out.family("prediction_error_radians", "histogram",
             "Angle between predicted sensor attitudes and the truth that came later");
  out.histogram({}, errors.attitude);
  out.family("prediction_error_max_metres", "gauge", "Largest prediction_error_metres so far");
  out.sample({}, errors.max_position_m.load(std::memory_order_relaxed));
  out.family("prediction_error_max_radians", "gauge", "Largest prediction_error_radians so far");
  out.sample({}, errors.max_attitude_rad.load(std::memory_order_relaxed));
}

void add_motion(MetricsText& out, const MotionTimes& times) {
  out.family("motion_late_seconds", "histogram",
             "Time from the instant at which a command of the motion simulator was due to sending");
  out.histogram({}, times.late);
  out.family("motion_feedback_age_seconds", "histogram",
             "Age of measurements of the motion simulator when they arrive");
  out.histogram({}, times.age);
  out.family("motion_axis_error_radians", "histogram",
             "Difference of measured and commanded angle, of the axis with the largest one");
  out.histogram({}, times.error.histogram);
  out.family("motion_axis_error_max_radians", "gauge", "Largest motion_axis_error_radians so far");
  out.sample({}, times.error.max.load(std::memory_order_relaxed));
  out.family("motion_pointing_error_pixels", "histogram",
             "Error of direction in the centre of a projected image, after its shift");
  out.histogram({}, times.pointing.histogram);
  out.family("motion_pointing_error_max_pixels", "gauge",
             "Largest motion_pointing_error_pixels so far");
  out.sample({}, times.pointing.max.load(std::memory_order_relaxed));
}

void add_realtime(MetricsText& out, const RealtimeReport& report) {
  out.family("realtime_granted", "gauge",
             "1 where the host grants what [realtime] asks for, 0 where it refuses; nothing where "
             "nothing is asked");
  for (const RealtimeReport::Item& item : report.items()) {
    out.sample({{"setting", item.setting}, {"agent", item.agent}},
               std::uint64_t{item.granted ? 1U : 0U});
  }
}

void add_ptp(MetricsText& out, const PtpStatus& ptp) {
  out.family("ptp_up", "gauge", "1 while ptp4l answers on clock.ptp_socket");
  out.sample({}, std::uint64_t{ptp.up ? 1U : 0U});
  if (!ptp.up) return;
  out.family("ptp_offset_seconds", "gauge", "Offset of the PTP clock from its master");
  out.sample({}, seconds(ptp.offset_ns));
  out.family("ptp_grandmaster_present", "gauge", "1 while ptp4l follows another clock");
  out.sample({}, std::uint64_t{ptp.grandmaster_present ? 1U : 0U});
  out.family("ptp_info", "gauge", "Port state and grandmaster; always 1");
  out.sample({{"state", std::string(to_string(ptp.state))}, {"grandmaster", ptp.grandmaster}},
             std::uint64_t{1});
}

void add_agents(MetricsText& out, const MetricsSources& sources, const MetricsMoment& moment) {
  const auto each = [&](std::string_view name, std::string_view type, std::string_view help,
                        const auto& value) {
    out.family(name, type, help);
    for (const auto& [agent, duty] : sources.agents) out.sample({{"agent", agent}}, value(*duty));
  };
  each("agent_turns_total", "counter", "Turns of an agent",
       [](const DutyCycle& duty) { return duty.cycles(); });
  each("agent_long_turns_total", "counter", "Turns of an agent that took longer than 1 ms",
       [](const DutyCycle& duty) { return duty.over_threshold(); });
  each("agent_busy_seconds_total", "counter", "Time an agent worked",
       [](const DutyCycle& duty) { return seconds(duty.busy_ns()); });
  each("agent_longest_turn_seconds", "gauge", "Longest turn of an agent so far",
       [](const DutyCycle& duty) { return seconds(duty.max_ns()); });
  each("agent_heartbeat_age_seconds", "gauge", "Time since an agent last came round its loop",
       [&](const DutyCycle& duty) { return seconds(duty.silent_ns(moment.now_ns)); });
}

void add_clients(MetricsText& out, const MetricsSources& sources) {
  struct Row {
    MetricsText::Labels labels;
    const ClientCounts* counts;
  };
  std::vector<Row> rows;
  for (const auto& [key, client] : sources.board->clients()) {
    const std::uint32_t place = connection_place(key);
    if (place >= sources.clients.size() ||
        sources.clients[place].connection.load(std::memory_order_acquire) != key) {
      continue;  // gone meanwhile
    }
    rows.push_back({{{"connection", connection_name(key)},
                     {"peer", client.peer},
                     {"role", client.role},
                     {"software", client.software},
                     {"channel", client.channel},
                     {"transport", client.transport}},
                    &sources.clients[place]});
  }
  const auto each = [&](std::string_view name, std::string_view type, std::string_view help,
                        const auto& value) {
    out.family(name, type, help);
    for (const Row& row : rows) out.sample(row.labels, value(*row.counts));
  };
  each("client_frames_total", "counter", "Frames sent completely to a connection",
       [](const ClientCounts& c) { return c.frames.load(std::memory_order_relaxed); });
  each("client_skipped_total", "counter",
       "Frames skipped for a connection: it was slow, or an image missed its number",
       [](const ClientCounts& c) { return c.skipped.load(std::memory_order_relaxed); });
  each("client_delay_seconds", "gauge",
       "Delay of a connection's last frame, from the pose's arrival to the last byte",
       [](const ClientCounts& c) { return seconds(c.delay_ns.load(std::memory_order_relaxed)); });
  each("client_jitter_seconds", "gauge",
       "Smoothed jitter (RFC 3550) of client_delay_seconds, as in the frame headers",
       [](const ClientCounts& c) { return seconds(c.jitter_ns.load(std::memory_order_relaxed)); });
}

void add_warnings(MetricsText& out, const StatusBoard& board) {
  const auto warnings = board.warnings();
  const auto labels = [](const StatusBoard::Warning& warning) {
    return MetricsText::Labels{{"level", warning.level == LogLevel::error ? "error" : "warn"},
                               {"text", warning.text}};
  };
  out.family("warnings_total", "counter", "Distinct warnings and errors, as in the log");
  for (const auto& warning : warnings) out.sample(labels(warning), warning.entry.count);
  out.family("warning_last_seconds", "gauge",
             "When a warning came last, seconds of TAI since 1970");
  for (const auto& warning : warnings) out.sample(labels(warning), seconds(warning.entry.last_ns));
}

}  // namespace

void MetricsText::family(std::string_view name, std::string_view type, std::string_view help) {
  name_ = fmt::format("emitd_{}", name);
  text_ += fmt::format("# HELP {} {}\n# TYPE {} {}\n", name_, escaped(help, false), name_, type);
}

void MetricsText::line(std::string_view suffix, const Labels& labels, std::string_view value) {
  text_ += name_;
  text_ += suffix;
  char separator = '{';
  for (const auto& [label, content] : labels) {
    text_ += fmt::format("{}{}=\"{}\"", separator, label, escaped(content, true));
    separator = ',';
  }
  text_ += fmt::format("{} {}\n", labels.empty() ? "" : "}", value);
}

void MetricsText::sample(const Labels& labels, std::uint64_t value) {
  line("", labels, std::to_string(value));
}

void MetricsText::sample(const Labels& labels, double value) {
  line("", labels, fmt::format("{}", value));
}

void MetricsText::histogram(const Labels& labels, const Histogram& histogram) {
  Labels with_bound = labels;
  with_bound.emplace_back("le", "");
  std::uint64_t count = 0;
  for (std::size_t i = 0; i < Histogram::kBuckets; ++i) {
    count += histogram.count(i);
    with_bound.back().second = i < Histogram::kUpperNs.size()
                                   ? fmt::format("{}", seconds(Histogram::kUpperNs[i]))
                                   : std::string("+Inf");
    line("_bucket", with_bound, std::to_string(count));
  }
  line("_sum", labels, fmt::format("{}", static_cast<double>(histogram.sum_ns()) / 1e9));
  line("_count", labels, std::to_string(count));
}

std::string metrics_text(const MetricsSources& sources, const MetricsMoment& moment) {
  MetricsText out;
  add_state(out, sources, moment);
  add_counters(out, *sources.counters);
  add_times(out, *sources.times);
  if (sources.prediction != nullptr) add_prediction(out, *sources.prediction);
  if (sources.motion != nullptr) add_motion(out, *sources.motion);
  add_agents(out, sources, moment);
  if (sources.realtime != nullptr) add_realtime(out, *sources.realtime);
  if (moment.ptp) add_ptp(out, *moment.ptp);
  add_clients(out, sources);
  add_warnings(out, *sources.board);
  return out.text();
}

}  // namespace emit::server
