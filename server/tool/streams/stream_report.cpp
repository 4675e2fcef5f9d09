// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/stream_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"

namespace emit::tool {
namespace {

struct FlagName {
  protocol::FrameFlags flag;
  const char* name;
};
constexpr std::array<FlagName, 16> kFlagNames{{{protocol::kFlagLate, "late"},
                                               {protocol::kFlagRepeated, "repeated"},
                                               {protocol::kFlagStale, "stale"},
                                               {protocol::kFlagDegraded, "degraded"},
                                               {protocol::kFlagPartial, "partial"},
                                               {protocol::kFlagHold, "hold"},
                                               {protocol::kFlagNonFinite, "nonfinite"},
                                               {protocol::kFlagClamped, "clamped"},
                                               {protocol::kFlagExtrapolated, "extrapolated"},
                                               {protocol::kFlagGapBefore, "gap_before"},
                                               {protocol::kFlagCanned, "canned"},
                                               {protocol::kFlagTimeUnset, "time_unset"},
                                               {protocol::kFlagTriggerFault, "trigger_fault"},
                                               {protocol::kFlagCorrupt, "corrupt"},
                                               {protocol::kFlagLostBefore, "lost_before"},
                                               {protocol::kFlagMotionFault, "motion_fault"}}};

}  // namespace

StreamReport::StreamReport(std::uint32_t every_nth) : every_nth_(every_nth) {
  for (Samples& stage : stages_) stage = Samples(kMaxSamples);  // copies would lose their memory
}

void StreamReport::add(const client::ReceivedFrame& frame) {
  const protocol::FrameHeader& header = frame.header;
  const bool continues = last_run_ != 0 && header.run_id == last_run_;
  // A frame that was late for its number may stand anywhere between two others.
  const std::uint64_t missing = (header.frame_number - last_number_ - 1) / every_nth_;
  if (continues && missing > frame.frames_lost_before &&
      (header.flags & protocol::kFlagGapBefore) == 0) {
    ++unflagged_gaps_;
  }
  runs_ += header.run_id != newest_run_ ? 1U : 0U;
  newest_run_ = last_run_ = header.run_id;
  last_number_ = header.frame_number;
  ++frames_;
  pixel_bytes_ += header.payload_bytes;
  sent_pixel_bytes_ += frame.encoded_bytes != 0 ? frame.encoded_bytes : header.payload_bytes;
  for (std::size_t bit = 0; bit < flag_counts_.size(); ++bit) {
    flag_counts_[bit] += (header.flags >> bit) & 1U;
  }

  motion_frames_ += header.motion_state != protocol::MotionState::none ? 1U : 0U;
  if ((header.output_steps & protocol::kOutputShifted) != 0) {
    ++shifted_frames_;
    largest_shift_px_ = std::max(largest_shift_px_,
                                 std::hypot(header.applied_shift_x_px, header.applied_shift_y_px));
  }
  if (header.motion_state == protocol::MotionState::following && header.motion_faults == 0 &&
      header.display_ns != 0 && std::isfinite(header.pointing_error_px)) {
    const double error_px = header.pointing_error_px;
    pointing_px_.add(error_px);
    pointing_squares_px2_ += error_px * error_px;
  }

  const auto add_span = [](Samples& samples, std::int64_t from_ns, std::int64_t to_ns) {
    if (from_ns > 0 && to_ns > 0) samples.add(1e-6 * static_cast<double>(to_ns - from_ns));
  };
  add_span(interval_ms_, last_byte_ns_, frame.last_byte_ns);
  last_byte_ns_ = frame.last_byte_ns;
  // A repeated frame's render instants are those of the image shown before, so they are not
  // counted.
  if ((header.flags & protocol::kFlagRepeated) == 0) {
    add_span(stages_[kQueue], header.host_received_ns, header.render_start_ns);
    add_span(stages_[kRender], header.render_start_ns, header.render_end_ns);
    add_span(stages_[kReadback], header.render_end_ns, header.readback_end_ns);
    add_span(stages_[kHandOver], header.readback_end_ns, header.send_start_ns);
    add_span(stages_[kTotal], header.host_received_ns, frame.last_byte_ns);
    add_span(ready_ms_, header.readback_end_ns, frame.last_byte_ns);
  }
  add_span(stages_[kTransport], header.send_start_ns, frame.last_byte_ns);
}

std::uint64_t StreamReport::flagged(protocol::FrameFlags flag) const {
  return flag_counts_[static_cast<std::size_t>(std::countr_zero(static_cast<std::uint32_t>(flag)))];
}

std::string StreamReport::motion_line() const {
  if (motion_frames_ == 0) return {};
  const std::string pointing =
      pointing_px_.empty()
          ? std::string("no pointing error is known")
          : fmt::format(
                "pointing error RMS {:.4f}  p99 {:.4f}  max {:.4f} px  ({} frames)",
                std::sqrt(pointing_squares_px2_ / static_cast<double>(pointing_px_.count())),
                pointing_px_.percentile(0.99), pointing_px_.max(), pointing_px_.count());
  const std::string shifts =
      shifted_frames_ == 0
          ? std::string()
          : fmt::format("; emitd moved the pixels by up to {:.3f} px", largest_shift_px_);
  return fmt::format("motion simulator: {} of {} frames flagged; {}{}\n",
                     flagged(protocol::kFlagMotionFault), motion_frames_, pointing, shifts);
}

Json StreamReport::motion_json() const {
  Json json = Json::object();
  json.set("frames", motion_frames_).set("flagged", flagged(protocol::kFlagMotionFault));
  json.set("pointing_frames", pointing_px_.count());
  json.set("shifted_frames", shifted_frames_).set("largest_shift_px", largest_shift_px_);
  if (!pointing_px_.empty()) {
    json.set("pointing_rms_px",
             std::sqrt(pointing_squares_px2_ / static_cast<double>(pointing_px_.count())));
    json.set("pointing_p99_px", pointing_px_.percentile(0.99));
    json.set("pointing_max_px", pointing_px_.max());
  }
  return json;
}

std::string StreamReport::stage_table() const {
  TextTable table({"stage", "median ms", "p99 ms", "max ms", "frames"});
  for (std::size_t i = 0; i < kStages; ++i) {
    const Samples& samples = stages_[i];
    if (samples.empty()) {
      table.add({kNames[i], "-", "-", "-", "0"});
      continue;
    }
    table.add({kNames[i], fmt::format("{:.3f}", samples.median()),
               fmt::format("{:.3f}", samples.percentile(0.99)),
               fmt::format("{:.3f}", samples.max()), fmt::format("{}", samples.count())});
  }
  return table.to_string();
}

Json StreamReport::stages_json() const {
  Json json = Json::object();
  for (std::size_t i = 0; i < kStages; ++i) json.set(kKeys[i], latency_json(stages_[i]));
  return json;
}

Json StreamReport::flags_json() const {
  Json json = Json::object();
  for (const auto& [flag, name] : kFlagNames) json.set(name, flagged(flag));
  return json;
}

Json latency_json(const Samples& samples_ms) {
  Json json = Json::object();
  json.set("count", samples_ms.count()).set("p50", samples_ms.percentile(0.5));
  json.set("p99", samples_ms.percentile(0.99)).set("p999", samples_ms.percentile(0.999));
  json.set("max", samples_ms.max());
  return json;
}

std::string latency_line(const std::string& name, const Samples& samples_ms) {
  if (samples_ms.empty()) return fmt::format("{}: no samples\n", name);
  return fmt::format("{}: p50 {:.3f}  p99 {:.3f}  p99.9 {:.3f}  max {:.3f} ms  ({} frames)\n", name,
                     samples_ms.percentile(0.5), samples_ms.percentile(0.99),
                     samples_ms.percentile(0.999), samples_ms.max(), samples_ms.count());
}

Json counters_json(const client::ReceiveCounters& c) {
  Json json = Json::object();
  json.set("received", c.received).set("partial", c.partial).set("lost", c.lost);
  json.set("gaps", c.gaps).set("skipped", c.skipped).set("crc_errors", c.crc_errors);
  json.set("os_drops", c.os_drops).set("bad_datagrams", c.bad_datagrams);
  json.set("foreign_datagrams", c.foreign_datagrams);
  json.set("late", c.late).set("repeated", c.repeated);
  json.set("repaired", c.repaired).set("repaired_frames", c.repaired_frames);
  json.set("unrepairable", c.unrepairable).set("resent", c.resent);
  json.set("resend_requests", c.resend_requests);
  return json;
}

std::string channel_text(const client::ChannelDescription& channel) {
  const std::string output = output_text(channel.output_steps);
  return fmt::format("channel {} '{}' ({}, sensor {}, band {} {:g}-{:g} um, {}x{}{}{})",
                     channel.index, channel.name, channel.kind, channel.sensor, channel.band,
                     channel.band_lo_um, channel.band_hi_um, channel.width_px, channel.height_px,
                     output.empty() ? "" : "; ", output);
}

}  // namespace emit::tool
