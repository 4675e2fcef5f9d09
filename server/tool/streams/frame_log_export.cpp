// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/frame_log_export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/record/frame_log.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/log_range.hpp"
#include "emit/v1/control.pb.h"
#include "emit/v1/frame.pb.h"
#include "tool/support/frame_files.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::Result;

/// Checksum of a frame in the journal, and the channel whose image has it.
struct JournalledImage {
  std::uint32_t channel = 0;
  std::uint32_t crc32c = 0;
};
/// The key is run and number of a frame.
using JournalledImages = std::map<std::pair<std::uint64_t, std::uint64_t>, JournalledImage>;

Result<JournalledImages> read_journal(const std::filesystem::path& file) {
  JournalledImages out;
  auto log = protocol::LogReader::open(file);
  if (!log) return tl::unexpected(log.error());
  std::uint64_t run_id = 0;
  for (;;) {
    const auto more = log->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) return out;
    if (log->topic() != protocol::LogTopic::journal) continue;
    const v1::JournalEntry& entry = log->journal();
    if (entry.has_run_start()) run_id = entry.run_start().run_id();
    if (!entry.has_frame()) continue;
    out[{run_id, entry.frame().frame_number()}] = {entry.frame().radiance_channel(),
                                                   entry.frame().radiance_crc32c()};
  }
}

/// Chooses the run whose images are in the range.
Result<std::uint64_t> choose(const std::filesystem::path& file, const protocol::LogRange& range,
                             const FrameExportOptions& options) {
  std::vector<protocol::LogRunChoice> runs;
  auto log = protocol::FrameLogReader::open(file);
  if (!log) return tl::unexpected(log.error());
  for (;;) {
    const auto more = log->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    const v1::RecordedFrame& frame = log->frame();
    auto run = std::ranges::find(runs, frame.run_id(), &protocol::LogRunChoice::run_id);
    if (run == runs.end()) run = runs.insert(run, {frame.run_id(), std::nullopt, true});
    protocol::LogSpan::extend(run->sim_time, frame.sim_time_ns());
  }
  if (runs.empty()) {
    return physics::make_error(
        ErrorCode::invalid_argument,
        fmt::format("{}: holds no images; emit record --with-frames records them", file.string()));
  }
  const auto chosen = protocol::choose_run(file, runs, range, options.run_id);
  if (!chosen) return tl::unexpected(chosen.error());
  return runs[*chosen].run_id;
}

Result<void> write_image(const std::filesystem::path& folder, const v1::RecordedFrame& frame,
                         std::span<const float> pixels) {
  const auto header = protocol::decode_frame_header(std::as_bytes(std::span(frame.header())));
  if (!header) return tl::unexpected(header.error());
  FramePlanes planes;
  planes.width_px = frame.width_px();
  planes.height_px = frame.height_px();
  plane_of(planes, header->quantity) = pixels;
  planes.window_px = {header->window_x_px, header->window_y_px, header->width_px,
                      header->height_px};
  planes.output_steps = header->output_steps;
  planes.applied_shift_x_px = header->applied_shift_x_px;
  planes.applied_shift_y_px = header->applied_shift_y_px;
  planes.sensor_width_px = header->sensor_width_px;
  planes.sensor_height_px = header->sensor_height_px;
  planes.metadata = recorded_metadata(frame, *header);
  return write_frame_exr(folder / fmt::format("frame_{:06}.exr", frame.frame_number()), planes);
}

}  // namespace

image::FrameMetadata recorded_metadata(const v1::RecordedFrame& frame,
                                       const protocol::FrameHeader& header) {
  const v1::ChannelInfo& channel = frame.channel();
  std::vector<physics::ResponsePoint> response;
  const int samples = std::min(channel.response_um_size(), channel.response_frac_size());
  for (int i = 0; i < samples; ++i) {
    response.push_back({channel.response_um(i), channel.response_frac(i)});
  }
  return {frame.sim_time_ns(),  frame.frame_number(), header.pose,  channel.band(),
          channel.band_lo_um(), channel.band_hi_um(), frame.unit(), response,
          header.fov_h_rad};
}

Result<FrameExportSummary> export_log_frames(const std::filesystem::path& file,
                                             const std::filesystem::path& folder,
                                             const FrameExportOptions& options) {
  const auto range = protocol::LogRange::make(options.from_ns, options.to_ns);
  if (!range) return tl::unexpected(range.error());
  const auto run_id = choose(file, *range, options);
  if (!run_id) return tl::unexpected(run_id.error());
  const auto journal = read_journal(file);
  if (!journal) return tl::unexpected(journal.error());
  auto log = protocol::FrameLogReader::open(file);
  if (!log) return tl::unexpected(log.error());
  FrameExportSummary summary;
  for (;;) {
    const auto more = log->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    const v1::RecordedFrame& frame = log->frame();
    const std::int64_t at_ns = frame.sim_time_ns();
    if (frame.run_id() != *run_id || at_ns < range->from_ns || at_ns > range->to_ns) continue;
    if (options.progress && !options.progress(summary.images)) {
      return physics::make_error(ErrorCode::internal, file.string() + ": stopped while exporting");
    }
    const auto journalled = journal->find({*run_id, frame.frame_number()});
    if (journalled != journal->end() && journalled->second.channel == frame.channel().index()) {
      ++summary.compared;
      if (journalled->second.crc32c != frame.crc32c() && summary.differ++ == 0) {
        summary.first_differing = frame.frame_number();
      }
    }
    if (auto written = write_image(folder, frame, log->pixels()); !written) {
      return tl::unexpected(written.error());
    }
    ++summary.images;
  }
  summary.truncation = log->truncation();
  return summary;
}

}  // namespace emit::tool
