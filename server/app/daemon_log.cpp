// SPDX-License-Identifier: Apache-2.0
#include "app/daemon_log.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "emit/physics/check.hpp"
#include "emit/version.hpp"

namespace emit::server {

using physics::Error;

physics::Result<void> DaemonLog::open(const config::LogConfig& config,
                                      const std::function<void(const std::string&)>& on_line) {
  if (on_line) {
    log_ = make_log(on_line);
    return {};
  }
  auto log = make_log(config);
  if (!log) {
    return tl::unexpected<Error>(std::move(log.error()));
  }
  log_ = std::move(*log);
  return {};
}

void DaemonLog::write(LogLevel level, const std::string& text) {
  EMIT_CHECK(log_ != nullptr);
  log_->write(level, text);
}

void DaemonLog::warn(const std::string& text) {
  if (const std::string line = distinct_.note(text, clock_.tai_ns()); !line.empty()) {
    write(LogLevel::warn, line);
  }
  board_.set_warnings(LogLevel::warn, distinct_);
}

void DaemonLog::software(const ProcessNames& names, const std::filesystem::path& scenario_file,
                         const SourceInfo& source) {
  write(LogLevel::info,
        fmt::format("software=\"{}\" commit={} device=\"{}\" scenario=\"{}\" pacing={} "
                    "channels={} width_px={} height_px={}",
                    names.software, kCommit, names.device, scenario_file.string(), names.pacing,
                    context_.channels.size(), source.width_px, source.height_px));
}

void DaemonLog::journal(const Recorder::Opened& opened) {
  if (!opened.older.empty()) {
    write(LogLevel::info, fmt::format("event=journal_kept file={}", opened.older.string()));
  }
  if (!opened.off.empty()) {
    warn(
        fmt::format("event=journal_off why=\"{}\" effect=\"no journal is written, every entry "
                    "counts as dropped\" remedy=\"make room and start again, or set "
                    "journal.required to have the start refused\"",
                    opened.off));
  }
}

void DaemonLog::scene(const renderer::SceneStats& scene) {
  if (scene.instances > 0) {
    write(LogLevel::info,
          fmt::format("event=scene triangles={} instances={} samples={} sample_bytes={}",
                      scene.triangles, scene.instances, scene.samples, scene.sample_bytes));
  }
  for (std::string text : scene.warnings) {
    std::ranges::replace(text, '"', '\'');
    warn(fmt::format("event=scene_warning text=\"{}\"", text));
  }
  for (const std::string& text : renderer::warm_up_warnings(scene)) {
    warn(fmt::format("event=scene_warning text=\"{}\"", text));
  }
}

void DaemonLog::outputs(const std::vector<Channel>& channels,
                        const std::vector<Picture>& pictures) {
  for (const Channel& channel : channels) {
    const Picture& picture = pictures[channel.picture];
    if (!picture.chain) {
      continue;
    }
    write(LogLevel::info,
          fmt::format("event=output channel=\"{}\" steps={:#04x} width_px={} height_px={}",
                      channel.name, channel.output_steps, channel.width_px, channel.height_px));
    if (const std::uint64_t outside_px = picture.chain->outside_px(); outside_px > 0) {
      warn(fmt::format("event=output_outside channel=\"{}\" pixels={} of={} value_w_m2_sr={}",
                       channel.name, outside_px, picture.pixels(), picture.output.outside_w_m2_sr));
    }
  }
}

void DaemonLog::shared_memory(const config::StreamConfig& stream) {
  write(LogLevel::info, fmt::format("event=shm url=shm://{} slots={} mode={:04o}", stream.shm,
                                    stream.shm_slots, stream.shm_mode));
}

void DaemonLog::congestion_control(const CongestionControl& tcp) {
  if (tcp.chosen.starts_with("bbr")) {
    warn(
        fmt::format("event=bbr_kept congestion_control={} effect=\"frames over TCP are spread out "
                    "and may come late\" remedy=\"allow reno: "
                    "net.ipv4.tcp_allowed_congestion_control\"",
                    tcp.chosen));
    return;
  }
  write(LogLevel::info, fmt::format("event=tcp congestion_control={}{}", tcp.chosen,
                                    tcp.chosen == tcp.system ? "" : " instead_of=" + tcp.system));
}

void DaemonLog::tai_offset() {
  if (clock_.tai_offset_unset()) {
    warn(
        "event=tai_offset_unset effect=\"wall instants are UTC\" "
        "remedy=\"let ntpd, chronyd or phc2sys set the kernel's TAI offset\"");
  }
}

void DaemonLog::warming_up(double done_frac) {
  if (!warm_up_meter_) warm_up_meter_.emplace(clock_);
  if (const auto report = warm_up_meter_->due(done_frac)) {
    write(LogLevel::info,
          fmt::format("event=warm_up done_percent={}{} text=\"{}\"", report->done_percent,
                      report->left_s ? fmt::format(" left_s={:.0f}", *report->left_s) : "",
                      progress_text("warm-up", *report)));
  }
}

void DaemonLog::ptp(PtpMonitor::Change change, const PtpMonitor& monitor) {
  switch (change) {
    case PtpMonitor::Change::none:
      return;
    case PtpMonitor::Change::went_down:
      write(LogLevel::warn,
            "event=ptp_silent effect=\"nobody says whether the clock follows its master\" "
            "remedy=\"ptp4l, clock.ptp_socket and who may write to it\"");
      return;
    case PtpMonitor::Change::went_up:
    case PtpMonitor::Change::state:
      break;
  }
  const PtpStatus status = monitor.status();
  write(LogLevel::info, fmt::format("event=ptp state={} grandmaster={} offset_ns={}",
                                    to_string(status.state), status.grandmaster, status.offset_ns));
}

void DaemonLog::summary(const NamedDutyCycles& agents) {
  std::string counters = "event=counters";
  for (std::size_t i = 0; i < kCounterCount; ++i) {
    const std::uint64_t value = context_.counters.get(static_cast<Counter>(i));
    if (value != 0) {
      counters += fmt::format(" {}={}", kCounterLabels[i].name, value);
    }
  }
  write(LogLevel::info, counters);
  for (const auto& [name, duty] : agents) {
    write(LogLevel::info,
          fmt::format("event=duty_cycle agent={} turns={} busy_ms={:.1f} max_turn_us={} "
                      "turns_over_1ms={}",
                      name, duty->cycles(), static_cast<double>(duty->busy_ns()) * 1e-6,
                      duty->max_ns() / 1000, duty->over_threshold()));
  }
}

void DaemonLog::housekeep() {
  note_clock_step();
  take_events();
}

void DaemonLog::note_clock_step() {
  if (const std::int64_t step_ns = clock_watch_.look(); step_ns != 0 && log_) {
    context_.counters.add(Counter::clock_steps);
    write(LogLevel::warn,
          fmt::format("event=clock_step by_ms={:.3f}", static_cast<double>(step_ns) * 1e-6));
  }
}

void DaemonLog::take_events() {
  bool warned = false;
  for (EventLog* events :
       {&context_.conductor_events, &context_.receiver_events, &context_.render_events,
        &context_.sender_events, &context_.recorder_events, &context_.metrics_events,
        &context_.motion_events, &context_.gateway_events, &context_.console_events}) {
    while (const Event* event = events->ring().front()) {
      const EventText line = describe(*event);
      board_.note(*event);
      events->ring().pop();
      warned = warned || line.distinct;
      if (!log_) {
        continue;
      }
      DistinctTable& table = line.level == LogLevel::error ? errors_ : distinct_;
      const std::string text = line.distinct ? table.note(line.text, clock_.tai_ns()) : line.text;
      if (!text.empty()) {
        write(line.level, text);
      }
    }
  }
  if (warned) {
    board_.set_warnings(LogLevel::warn, distinct_);
    board_.set_warnings(LogLevel::error, errors_);
  }
}

void DaemonLog::finish(std::int64_t limit_ns) {
  EMIT_CHECK(log_ != nullptr);
  taken_ = log_->finish(limit_ns);
}

}  // namespace emit::server
