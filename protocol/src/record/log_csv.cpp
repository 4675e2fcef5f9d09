// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/log_csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <vector>

#include "emit/protocol/control.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/record/pose_pcap.hpp"
#include "record/csv_file.hpp"
#include "record/log_message.hpp"

namespace emit::protocol {
namespace {

namespace fs = std::filesystem;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr const char* kPoseColumns = "east_m,north_m,up_m,qw,qx,qy,qz";
constexpr std::size_t kPoseCells = 7;
constexpr const char* kRateColumns =
    "velocity_east_m_s,velocity_north_m_s,velocity_up_m_s,rate_x_rad_s,rate_y_rad_s,rate_z_rad_s";
constexpr std::size_t kRateCells = 6;
constexpr const char* kViewColumns = "fov_h_rad,gimbal_yaw_rad,gimbal_pitch_rad,gimbal_roll_rad";
constexpr const char* kHostColumns =
    "source,run_id,host_run_id,log_time_ns,frame_number,sim_time_s";

std::string header_of(LogTable table) {
  switch (table) {
    case LogTable::seeker:
      return fmt::format("{},{},{},{}", kHostColumns, kPoseColumns, kRateColumns, kViewColumns);
    case LogTable::entities:
      return fmt::format("{},entity_id,on,teleport,{},{}", kHostColumns, kPoseColumns,
                         kRateColumns);
    case LogTable::frames:
      return fmt::format(
          "run_id,sequence,log_time_ns,frame_number,host_frame_number,sim_time_s,pose_sim_time_s,"
          "thermal_time_s,rendered,quality_level,radiance_crc32c,radiance_channel,trigger_number,"
          "slot_begin_ns,entities,flags,{},{}",
          fmt::join(kFrameFlagNames, ","), kPoseColumns);
    case LogTable::frame_entities:
      return fmt::format("run_id,sequence,frame_number,sim_time_s,entity_id,on,teleport,{}",
                         kPoseColumns);
    case LogTable::weather:
      return fmt::format(
          "{},direct_normal_w_m2,diffuse_horizontal_w_m2,longwave_down_w_m2,air_k,wind_m_s,"
          "cloud_frac,environment_k,film_w_m2_k,wind_from_deg,relative_humidity_frac,rain_mm_h",
          kHostColumns);
    case LogTable::parts:
      return fmt::format("{},entity_id,part_id,temperature_k,power_w_m2,throttle", kHostColumns);
    case LogTable::events:
      return "event,run_id,sequence,log_time_ns,command,missing_entries,scenario,scenario_sha256,"
             "software,device,pacing,first_time_s,text";
  }
  return {};
}

void put_pose(CsvFile& file, const v1::Pose& pose) {
  const v1::Vector3& at = pose.position_m();
  const v1::Quaternion& turn = pose.world_from_body();
  file.number(at.x()).number(at.y()).number(at.z());
  file.number(turn.w()).number(turn.x()).number(turn.y()).number(turn.z());
}

void put_rates(CsvFile& file, const v1::Pose& pose) {
  if (!pose.has_velocity_m_s() || !pose.has_angular_rate_rad_s()) {
    file.empty(kRateCells);
    return;
  }
  const v1::Vector3& velocity = pose.velocity_m_s();
  const v1::Vector3& rate = pose.angular_rate_rad_s();
  file.number(velocity.x()).number(velocity.y()).number(velocity.z());
  file.number(rate.x()).number(rate.y()).number(rate.z());
}

void put_view(CsvFile& file, const v1::HostFrame& frame) {
  frame.has_fov_h_rad() ? file.number(frame.fov_h_rad()) : file.empty();
  if (!frame.has_gimbal()) {
    file.empty(3);
    return;
  }
  const v1::Gimbal& gimbal = frame.gimbal();
  file.number(gimbal.yaw_rad()).number(gimbal.pitch_rad()).number(gimbal.roll_rad());
}

/// Place at which a host frame was found.
struct HostOrigin {
  std::string_view source;
  std::optional<std::uint64_t> run_id;      ///< the daemon's; absent outside a run of a journal
  std::optional<std::int64_t> log_time_ns;  ///< absent in a capture
};

/// Writes the tables that were asked for.
class Exporter {
 public:
  Result<void> open(const fs::path& in, const fs::path& out, std::optional<LogTable> only) {
    if (!only) {
      std::error_code error;
      fs::create_directories(out, error);
      if (error) {
        return make_error(ErrorCode::io,
                          fmt::format("{}: cannot write: {}", out.string(), error.message()));
      }
    }
    for (std::size_t i = 0; i < kLogTables; ++i) {
      const auto table = static_cast<LogTable>(i);
      if (only && *only != table) continue;
      auto file = CsvFile::create(only ? out : out / fmt::format("{}.csv", kLogTableNames[i]),
                                  std::span(&in, 1), header_of(table));
      if (!file) return tl::unexpected(file.error());
      files_[i].emplace(std::move(*file));
    }
    return {};
  }

  void host(const HostFrameData& frame, std::optional<std::int64_t> log_time_ns,
            std::string_view source) {
    to_proto(frame, host_message_);
    host(host_message_, {source, std::nullopt, log_time_ns});
  }

  void journal(const v1::JournalEntry& entry, std::int64_t log_time_ns) {
    const bool follows = entries_ > 0 && entry.sequence() == last_sequence_ + 1;
    const bool anew = entry.has_run_start() && entry.sequence() <= last_sequence_;
    if (entries_ > 0 && !follows && !anew) {
      event("missing", last_sequence_ + 1, log_time_ns,
            entry.sequence() > last_sequence_ ? entry.sequence() - last_sequence_ - 1 : 0);
    }
    ++entries_;
    last_sequence_ = entry.sequence();
    if (entry.has_run_start()) {
      run_id_ = entry.run_start().run_id();
      run_start(entry, log_time_ns);
    } else if (entry.has_command()) {
      command(entry, log_time_ns);
    } else if (entry.has_host_frame()) {
      host(entry.host_frame(), {"journal", run_id_, log_time_ns});
    } else if (entry.has_frame()) {
      frame(entry, log_time_ns);
    }
  }

  void cut_off(const std::string& text) {
    if (CsvFile* file = of(LogTable::events)) {
      file->text("cut_off");
      put_run(*file);
      file->empty(10).text(text).end_row();
    }
  }

  Result<void> finish(LogCsvSummary& summary) {
    for (std::size_t i = 0; i < kLogTables; ++i) {
      if (!files_[i]) continue;
      if (auto done = files_[i]->finish(); !done) return done;
      summary.rows[i] = files_[i]->rows();
    }
    return {};
  }

 private:
  CsvFile* of(LogTable table) {
    auto& file = files_[static_cast<std::size_t>(table)];
    return file ? &*file : nullptr;
  }
  void put_run(CsvFile& file) const {
    if (run_id_) {
      file.whole(*run_id_);
    } else {
      file.empty();
    }
  }

  static void put_origin(CsvFile& file, const v1::HostFrame& frame, const HostOrigin& origin) {
    file.text(origin.source);
    origin.run_id ? file.whole(*origin.run_id) : file.empty();
    file.whole(frame.run_id());
    origin.log_time_ns ? file.whole(*origin.log_time_ns) : file.empty();
    file.whole(frame.frame_number()).seconds(frame.sim_time_ns());
  }

  void host(const v1::HostFrame& frame, const HostOrigin& origin) {
    if (CsvFile* file = of(LogTable::seeker)) {
      put_origin(*file, frame, origin);
      put_pose(*file, frame.seeker());
      put_rates(*file, frame.seeker());
      put_view(*file, frame);
      file->end_row();
    }
    if (CsvFile* file = of(LogTable::entities)) {
      for (const v1::EntityState& state : frame.entities()) {
        put_origin(*file, frame, origin);
        file->whole(std::uint64_t{state.entity_id()}).flag(!state.off()).flag(state.teleport());
        if (state.has_pose()) {
          put_pose(*file, state.pose());
          put_rates(*file, state.pose());
        } else {
          file->empty(kPoseCells + kRateCells);
        }
        file->end_row();
      }
    }
    if (CsvFile* file = of(LogTable::parts)) {
      for (const v1::PartCommand& part : frame.parts()) {
        put_origin(*file, frame, origin);
        file->whole(std::uint64_t{part.entity_id()}).whole(std::uint64_t{part.part_id()});
        part.has_temperature_k() ? file->number(part.temperature_k()) : file->empty();
        part.has_power_w_m2() ? file->number(part.power_w_m2()) : file->empty();
        part.has_throttle() ? file->number(part.throttle()) : file->empty();
        file->end_row();
      }
    }
    CsvFile* file = of(LogTable::weather);
    if (file == nullptr || !frame.has_environment()) return;
    const v1::Environment& weather = frame.environment();
    put_origin(*file, frame, origin);
    file->number(weather.direct_normal_w_m2()).number(weather.diffuse_horizontal_w_m2());
    file->number(weather.longwave_down_w_m2()).number(weather.air_k()).number(weather.wind_m_s());
    file->number(weather.cloud_frac());
    weather.has_environment_k() ? file->number(weather.environment_k()) : file->empty();
    weather.has_film_w_m2_k() ? file->number(weather.film_w_m2_k()) : file->empty();
    weather.has_wind_from_deg() ? file->number(weather.wind_from_deg()) : file->empty();
    weather.has_relative_humidity_frac() ? file->number(weather.relative_humidity_frac())
                                         : file->empty();
    file->number(weather.rain_mm_h());
    file->end_row();
  }

  void frame(const v1::JournalEntry& entry, std::int64_t log_time_ns) {
    const v1::FrameDecision& decision = entry.frame();
    if (CsvFile* file = of(LogTable::frames)) {
      put_run(*file);
      file->whole(entry.sequence()).whole(log_time_ns).whole(decision.frame_number());
      file->whole(decision.host_frame_number()).seconds(decision.sim_time_ns());
      file->seconds(decision.pose_sim_time_ns()).seconds(decision.thermal_time_ns());
      file->flag(decision.rendered()).whole(std::uint64_t{decision.quality_rung()});
      file->text(fmt::format("{:08x}", decision.radiance_crc32c()));
      file->whole(std::uint64_t{decision.radiance_channel()}).whole(decision.trigger_number());
      file->whole(std::int64_t{decision.slot_begin_ns()});
      file->whole(static_cast<std::uint64_t>(decision.entities_size()));
      file->whole(std::uint64_t{decision.flags()});
      for (std::size_t bit = 0; bit < kFrameFlagNames.size(); ++bit) {
        file->flag(((decision.flags() >> bit) & 1U) != 0);
      }
      put_pose(*file, decision.sensor_pose());
      file->end_row();
    }
    CsvFile* file = of(LogTable::frame_entities);
    if (file == nullptr) return;
    for (const v1::EntityState& state : decision.entities()) {
      put_run(*file);
      file->whole(entry.sequence()).whole(decision.frame_number());
      file->seconds(decision.sim_time_ns()).whole(std::uint64_t{state.entity_id()});
      file->flag(!state.off()).flag(state.teleport());
      put_pose(*file, state.pose());
      file->end_row();
    }
  }

  void event(std::string_view name, std::uint64_t sequence, std::int64_t log_time_ns,
             std::uint64_t missing) {
    CsvFile* file = of(LogTable::events);
    if (file == nullptr) return;
    file->text(name);
    put_run(*file);
    file->whole(sequence).whole(log_time_ns).empty().whole(missing).empty(7).end_row();
  }

  void command(const v1::JournalEntry& entry, std::int64_t log_time_ns) {
    CsvFile* file = of(LogTable::events);
    if (file == nullptr) return;
    file->text("command");
    put_run(*file);
    file->whole(entry.sequence())
        .whole(log_time_ns)
        .text(command_name(static_cast<std::uint64_t>(entry.command().kind())));
    file->empty(8).end_row();
  }

  void run_start(const v1::JournalEntry& entry, std::int64_t log_time_ns) {
    CsvFile* file = of(LogTable::events);
    if (file == nullptr) return;
    const v1::RunStart& start = entry.run_start();
    file->text("run_start");
    put_run(*file);
    file->whole(entry.sequence()).whole(log_time_ns).empty(2);
    file->text(start.scenario_name()).text(start.scenario_sha256()).text(start.software());
    file->text(start.device()).text(start.pacing()).seconds(start.first_time_ns());
    file->empty().end_row();
  }

  std::array<std::optional<CsvFile>, kLogTables> files_;
  v1::HostFrame host_message_;
  std::optional<std::uint64_t> run_id_;
  std::uint64_t entries_ = 0;
  std::uint64_t last_sequence_ = 0;
};

Result<void> export_capture(const fs::path& in, const LogCsvOptions& options, Exporter& exporter,
                            LogCsvSummary& summary) {
  auto reader = PosePcapReader::open(in, options.host_port);
  if (!reader) return tl::unexpected(reader.error());
  while (true) {
    const auto more = reader->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    if (options.progress && !options.progress(0)) {
      return make_error(ErrorCode::internal, in.string() + ": stopped while exporting");
    }
    exporter.host(reader->host(), std::nullopt, "capture");
  }
  summary.notes = reader->notes();
  return {};
}

Result<void> export_mcap(const fs::path& in, const LogCsvOptions& options, Exporter& exporter,
                         LogCsvSummary& summary) {
  auto reader = McapReader::open(in);
  if (!reader) return tl::unexpected(reader.error());
  LogMessageDecoder decoder;
  std::uint64_t taken = 0;
  while (true) {
    const auto more = reader->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    if (options.progress && !options.progress(reader->message().file_offset)) {
      return make_error(ErrorCode::internal, in.string() + ": stopped while exporting");
    }
    const auto topic = decoder.decode(*reader);
    if (!topic) return tl::unexpected(topic.error());
    if (!*topic) continue;
    ++taken;
    const auto log_time_ns = static_cast<std::int64_t>(reader->message().log_time_ns);
    if (**topic == LogTopic::host) {
      exporter.host(decoder.host(), log_time_ns, "host");
    } else {
      exporter.journal(decoder.journal(), log_time_ns);
    }
  }
  if (taken == 0) {
    return make_error(ErrorCode::unsupported,
                      in.string() + ": holds neither a journal nor host frames of emitd");
  }
  summary.notes = reader->truncation();
  if (summary.notes) exporter.cut_off(*summary.notes);
  return {};
}

}  // namespace

Result<LogCsvSummary> export_log_csv(const fs::path& in, const fs::path& out,
                                     const LogCsvOptions& options) {
  // Open the input first: a wrong name makes no folder.
  const bool capture = PosePcapReader::is_capture(in);
  if (!capture) {
    if (auto reader = McapReader::open(in); !reader) return tl::unexpected(reader.error());
  }
  Exporter exporter;
  if (auto opened = exporter.open(in, out, options.table); !opened) {
    return tl::unexpected(opened.error());
  }
  LogCsvSummary summary;
  auto done = capture ? export_capture(in, options, exporter, summary)
                      : export_mcap(in, options, exporter, summary);
  if (done) done = exporter.finish(summary);
  if (!done) return tl::unexpected(done.error());
  return summary;
}

}  // namespace emit::protocol
