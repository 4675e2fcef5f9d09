// SPDX-License-Identifier: Apache-2.0
#include "tool/foxglove/foxglove_export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <map>
#include <memory>
#include <set>
#include <utility>

#include "emit/image/false_color.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/record/frame_log.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/log_outline.hpp"
#include "emit/protocol/record/log_range.hpp"
#include "emit/protocol/record/part_file.hpp"
#include "emit/v1/control.pb.h"
#include "emit/v1/frame.pb.h"
#include "tool/foxglove/recorded_place.hpp"
#include "tool/streams/frame_log_export.hpp"
#include "tool/support/frame_files.hpp"

namespace emit::tool {
namespace {

namespace fs = std::filesystem;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr const char* kPoseTopic = "/seeker/pose";
constexpr const char* kLocationTopic = "/seeker/location";
constexpr const char* kTransformTopic = "/tf";
constexpr const char* kEventTopic = "/events";
constexpr const char* kFrameTopic = "/frames";
constexpr const char* kSeekerFrame = "seeker";

/// Run that is exported, and the range of its simulation time.
struct Chosen {
  bool journal = false;
  std::uint64_t run_id = 0;
  protocol::LogRange range;
  std::shared_ptr<const v1::Recording> recording;
  std::optional<std::string> truncation;  ///< tail of the log that a crash cut off
  std::uint64_t messages = 0;             ///< of the whole log, for the progress

  [[nodiscard]] bool holds(std::int64_t sim_time_ns) const noexcept {
    return sim_time_ns >= range.from_ns && sim_time_ns <= range.to_ns;
  }
};

Result<Chosen> choose(const fs::path& file, const FoxgloveOptions& options) {
  const auto range = protocol::LogRange::make(options.from_ns, options.to_ns);
  if (!range) return tl::unexpected(range.error());
  const auto outline = protocol::outline_log(file);
  if (!outline) return tl::unexpected(outline.error());
  if (outline->damage) return tl::unexpected(*outline->damage);
  Chosen out;
  out.range = *range;
  out.journal = !outline->runs.empty();
  std::vector<protocol::LogRunChoice> runs;
  for (const protocol::LogRunOutline& run : outline->runs) {
    runs.push_back({run.run_id, run.sim_time, run.has_start});
  }
  if (!out.journal) {
    for (const protocol::LogHostRunOutline& run : outline->host_runs) {
      runs.push_back({run.run_id, run.sim_time, true});
    }
  }
  if (runs.empty()) {
    return make_error(ErrorCode::unsupported,
                      file.string() + ": holds neither a journal nor host frames of emitd");
  }
  const auto place = protocol::choose_run(file, runs, *range, options.run_id);
  if (!place) return tl::unexpected(place.error());
  out.run_id = runs[*place].run_id;
  if (out.journal) out.recording = outline->runs[*place].recording;
  for (const protocol::LogTopicOutline& topic : outline->topics) out.messages += topic.messages;
  out.truncation = outline->truncation;
  return out;
}

/// Names and colours with which the images of a channel are shown.
struct ChannelLook {
  std::string topic;  ///< name in front of those of its topics
  std::string frame;  ///< frame of reference, as sensors have it
  /// Converts radiance for the preview; empty: the preview shows the pixels themselves.
  std::optional<ApparentTemperature> apparent;
  std::optional<image::ValueRange> limits;  ///< of the preview; absent: no finite pixel
  std::string unit;                         ///< of the limits
};

/// Reads images of the chosen run within the range. Thread: one owner.
class ImageCursor {
 public:
  static Result<ImageCursor> open(const fs::path& file, const Chosen& chosen) {
    auto log = protocol::FrameLogReader::open(file);
    if (!log) return tl::unexpected(log.error());
    return ImageCursor(std::move(*log), chosen);
  }
  /// Moves to the next image. Returns false at the end.
  Result<bool> next() {
    for (;;) {
      const auto more = log_.next();
      if (!more || !*more) return more;
      if (log_.frame().run_id() != chosen_->run_id) continue;
      if (!chosen_->holds(log_.frame().sim_time_ns())) continue;
      auto header = protocol::decode_frame_header(std::as_bytes(std::span(log_.frame().header())));
      if (!header) return tl::unexpected(header.error());
      header_ = *header;
      return true;
    }
  }
  [[nodiscard]] const v1::RecordedFrame& frame() const noexcept { return log_.frame(); }
  [[nodiscard]] const protocol::FrameHeader& header() const noexcept { return header_; }
  [[nodiscard]] std::span<const float> pixels() const noexcept { return log_.pixels(); }

 private:
  ImageCursor(protocol::FrameLogReader log, const Chosen& chosen)
      : log_(std::move(log)), chosen_(&chosen) {}
  protocol::FrameLogReader log_;
  const Chosen* chosen_;
  protocol::FrameHeader header_;
};

using Looks = std::map<std::uint32_t, ChannelLook>;  // by index of the channel

/// Extends the limits of a channel's preview by those of one image.
void widen(ChannelLook& look, const ImageCursor& image) {
  constexpr double kLowPercent = 0.5;
  constexpr double kHighPercent = 99.5;
  auto range = image::percentile_range(image.pixels(), kLowPercent, kHighPercent);
  if (!range) return;
  if (look.apparent) {
    range = {look.apparent->kelvin(range->min_value), look.apparent->kelvin(range->max_value)};
  }
  if (!look.limits) look.limits = *range;
  look.limits->min_value = std::min(look.limits->min_value, range->min_value);
  look.limits->max_value = std::max(look.limits->max_value, range->max_value);
}

/// Finds the channels whose images the log holds, and the limits of their previews over all images.
Result<Looks> survey(const fs::path& file, const Chosen& chosen) {
  Looks looks;
  auto images = ImageCursor::open(file, chosen);
  if (!images) return tl::unexpected(images.error());
  for (;;) {
    const auto more = images->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    const v1::ChannelInfo& channel = images->frame().channel();
    auto look = looks.find(channel.index());
    if (look == looks.end()) {
      look = looks.emplace(channel.index(), ChannelLook{}).first;
      look->second.topic = "/camera/" + channel.name();
      look->second.unit = images->frame().unit();
      const auto band = spectral_band(recorded_metadata(images->frame(), images->header()));
      if (band && images->header().quantity == protocol::PixelQuantity::radiance_w_m2_sr) {
        look->second.apparent.emplace(*band);
        look->second.unit = "K";
      }
    }
    widen(look->second, *images);
  }
  for (auto& [index, look] : looks) {
    if (looks.size() == 1) look.topic = "/camera";
    look.frame = look.topic.substr(1);
    if (look.limits && !(look.limits->max_value > look.limits->min_value)) {
      // An even image has no range of its own. Any width shows it.
      const double half = std::max(1e-3 * std::abs(look.limits->min_value), 1e-6);
      look.limits->min_value -= half;
      look.limits->max_value += half;
    }
  }
  return looks;
}

/// Returns the pose of a sensor's axes (x right, y down, z along the boresight) for that of its
/// body.
physics::Pose sensor_axes(const physics::Pose& body) {
  const glm::dmat3 body_from_sensor = glm::transpose(physics::sensor_from_body());
  return {body.position_world_m, body.world_from_body * glm::quat_cast(body_from_sensor)};
}

/// Returns the pinhole camera of an image; nothing where its pixels do not lie as in the sensor's
/// image, or where its field of view is not known.
std::optional<PinholeCamera> camera_of(const protocol::FrameHeader& header) {
  if ((header.output_steps & protocol::kOutputMoved) != 0 || !(header.fov_h_rad > 0.0F)) {
    return std::nullopt;
  }
  const double sensor_width_px =
      header.sensor_width_px > 0 ? header.sensor_width_px : header.width_px;
  const double sensor_height_px =
      header.sensor_height_px > 0 ? header.sensor_height_px : header.height_px;
  PinholeCamera out;
  out.width_px = header.width_px;
  out.height_px = header.height_px;
  out.focal_px = 0.5 * sensor_width_px / std::tan(0.5 * double{header.fov_h_rad});
  const bool shifted = (header.output_steps & protocol::kOutputShifted) != 0;
  const double shift_x_px = shifted ? header.applied_shift_x_px : 0.0;
  const double shift_y_px = shifted ? header.applied_shift_y_px : 0.0;
  // The middle of the sensor's image, counted from the centre of the window's first pixel.
  out.centre_px = {0.5 * sensor_width_px - header.window_x_px - 0.5 + shift_x_px,
                   0.5 * sensor_height_px - header.window_y_px - 0.5 + shift_y_px};
  return out;
}

std::string flag_text(std::uint32_t flags) {
  std::vector<std::string_view> names;
  for (std::size_t bit = 0; bit < protocol::kFrameFlagNames.size(); ++bit) {
    if (((flags >> bit) & 1U) != 0) names.push_back(protocol::kFrameFlagNames[bit]);
  }
  return names.empty() ? "no flag" : fmt::format("{}", fmt::join(names, ", "));
}

std::string command_text(v1::Command::Kind kind) {
  switch (kind) {
    case v1::Command::KIND_START:
      return "command: start";
    case v1::Command::KIND_STOP:
      return "command: stop";
    case v1::Command::KIND_HOLD:
      return "command: hold";
    case v1::Command::KIND_STEP:
      return "command: step";
    case v1::Command::KIND_RESET:
      return "command: reset";
    default:
      return "command: unknown";
  }
}

/// Writes the messages of the chosen run.
class Exporter {
 public:
  Exporter(FoxgloveFile& file, const Chosen& chosen, const Looks& looks,
           const FoxgloveImages& which, std::int64_t epoch_ns,
           const std::optional<physics::GeoPlace>& origin)
      : file_(file), chosen_(chosen), looks_(looks), which_(which), epoch_ns_(epoch_ns) {
    if (origin) {
      ecef_from_world_ = physics::ecef_from_enu(*origin);
      origin_ecef_m_ = physics::ecef_m(*origin);
    }
  }

  /// Takes the pose of the seeker that the host sent. Entities are taken from it where there is no
  /// journal to say how they were shown.
  Result<void> host(const protocol::HostFrameData& frame) {
    auto stamp = reach(frame.sim_time_ns);
    if (!stamp) return tl::unexpected(stamp.error());
    if (!*stamp) return {};
    Result<void> done = file_.pose(kPoseTopic, **stamp, frame.seeker);
    if (done) done = file_.transform(kTransformTopic, **stamp, kSeekerFrame, frame.seeker);
    if (done && ecef_from_world_) {
      const glm::dvec3 at_ecef_m =
          origin_ecef_m_ + *ecef_from_world_ * frame.seeker.position_world_m;
      done =
          file_.location(kLocationTopic, **stamp, kSeekerFrame, physics::place_at_ecef(at_ecef_m));
    }
    if (!done || chosen_.journal) return done;
    for (const protocol::EntityStateData& state : frame.entity_span()) {
      done = entity(**stamp, state.entity_id, state.on, state.has_pose ? &state.pose : nullptr);
      if (!done) return done;
    }
    return {};
  }

  Result<void> journal(const v1::JournalEntry& entry) {
    note_sequence(entry);
    if (entry.has_run_start()) {
      const v1::RunStart& start = entry.run_start();
      begin_ = fmt::format("run {} of {}: {}, pacing {}, {}", start.run_id(), start.software(),
                           start.scenario_name(), start.pacing(), start.device());
      return {};
    }
    if (entry.has_command()) {
      waiting_.emplace_back(EventLevel::info, command_text(entry.command().kind()));
      return {};
    }
    if (entry.has_host_frame()) {
      if (protocol::from_proto(entry.host_frame(), host_) == protocol::DecodeStatus::ok) {
        return host(host_);
      }
      ++unreadable_;
      return {};
    }
    return entry.has_frame() ? frame(entry.frame()) : Result<void>{};
  }

  Result<void> image(const ImageCursor& image) {
    const v1::RecordedFrame& frame = image.frame();
    const protocol::FrameHeader& header = image.header();
    auto stamp = reach(frame.sim_time_ns());
    if (!stamp) return tl::unexpected(stamp.error());
    if (!*stamp) return {};
    const ChannelLook& look = looks_.at(frame.channel().index());
    Result<void> done = describe(**stamp, frame, look);
    if (done) {
      done = file_.transform(kTransformTopic, **stamp, look.frame, sensor_axes(header.pose));
    }
    if (const auto camera = camera_of(header); camera && done) {
      done = file_.calibration(look.topic + "/calibration", **stamp, look.frame, *camera);
    } else if (!camera) {
      ++without_camera_;
    }
    if (done && which_.values) {
      done =
          file_.image(look.topic + "/image", **stamp, look.frame, frame.width_px(), image.pixels());
    }
    if (!done || !which_.preview || !look.limits) return done;
    image::FalseColorOptions colors;
    colors.min_value = look.limits->min_value;
    colors.max_value = look.limits->max_value;
    const std::vector<float> kelvins =
        look.apparent ? look.apparent->kelvin(image.pixels()) : std::vector<float>{};
    const auto picture =
        image::false_color(look.apparent ? std::span<const float>(kelvins) : image.pixels(),
                           frame.width_px(), frame.height_px(), colors);
    if (!picture) return tl::unexpected(picture.error());
    return file_.image(look.topic + "/preview", **stamp, look.frame, *picture);
  }

  /// Writes the events that no later frame came for.
  Result<void> finish() {
    if (chosen_.truncation) waiting_.emplace_back(EventLevel::error, *chosen_.truncation);
    return last_stamp_ns_ ? flush(*last_stamp_ns_) : Result<void>{};
  }

  [[nodiscard]] std::uint64_t without_camera() const noexcept { return without_camera_; }
  /// Returns how many host frames and poses hold numbers that are none, and were left out.
  [[nodiscard]] std::uint64_t unreadable() const noexcept { return unreadable_; }

 private:
  /// Returns the stamp of an instant, or nothing outside the range, and writes the events that
  /// waited for one. Errors: io; invalid_argument (before 1970).
  Result<std::optional<std::int64_t>> reach(std::int64_t sim_time_ns) {
    if (!chosen_.holds(sim_time_ns)) {
      if (!last_stamp_ns_) waiting_.clear();
      return std::optional<std::int64_t>{};
    }
    const std::int64_t stamp_ns = epoch_ns_ + sim_time_ns;
    if (stamp_ns < 0) {
      return make_error(
          ErrorCode::invalid_argument,
          fmt::format("simulation time {:.9f} s is before 1970, for which MCAP has no "
                      "time: --from-s leaves it out",
                      1e-9 * static_cast<double>(sim_time_ns)));
    }
    last_stamp_ns_ = std::max(last_stamp_ns_.value_or(stamp_ns), stamp_ns);
    if (auto done = flush(stamp_ns); !done) return tl::unexpected(done.error());
    return std::optional<std::int64_t>{stamp_ns};
  }

  Result<void> flush(std::int64_t stamp_ns) {
    if (!begin_.empty()) waiting_.emplace(waiting_.begin(), EventLevel::info, std::move(begin_));
    begin_.clear();
    for (const auto& [level, text] : waiting_) {
      if (auto done = file_.event(kEventTopic, stamp_ns, level, "emitd", text); !done) return done;
    }
    waiting_.clear();
    return {};
  }

  void note_sequence(const v1::JournalEntry& entry) {
    if (last_sequence_ && entry.sequence() > *last_sequence_ + 1) {
      waiting_.emplace_back(EventLevel::warning,
                            fmt::format("the journal lacks its entries {} to {}",
                                        *last_sequence_ + 1, entry.sequence() - 1));
    }
    last_sequence_ = entry.sequence();
  }

  Result<void> frame(const v1::FrameDecision& decision) {
    if (chosen_.holds(decision.sim_time_ns()) && decision.flags() != flags_) {
      flags_ = decision.flags();
      waiting_.emplace_back(
          flags_ == 0 ? EventLevel::info : EventLevel::warning,
          fmt::format("frame {} and following: {}", decision.frame_number(), flag_text(flags_)));
    }
    auto stamp = reach(decision.sim_time_ns());
    if (!stamp) return tl::unexpected(stamp.error());
    if (!*stamp) return {};
    Result<void> done = file_.frame(kFrameTopic, **stamp, decision);
    if (done && looks_.empty()) {
      if (const auto pose = pose_of(decision.sensor_pose())) {
        done = file_.transform(kTransformTopic, **stamp, "camera", sensor_axes(*pose));
      } else {
        ++unreadable_;
      }
    }
    for (const v1::EntityState& state : decision.entities()) {
      if (!done) return done;
      const auto pose = pose_of(state.pose());
      if (state.has_pose() && !pose) ++unreadable_;
      done = entity(**stamp, state.entity_id(), !state.off(),
                    state.has_pose() && pose ? &*pose : nullptr);
    }
    return done;
  }

  Result<void> entity(std::int64_t stamp_ns, std::uint32_t id, bool on, const physics::Pose* pose) {
    const auto [known, is_new] = shown_.try_emplace(id, true);
    if (known->second != on) {
      known->second = on;
      waiting_.emplace_back(EventLevel::info, fmt::format("entity {}: {}", id, on ? "on" : "off"));
      if (auto done = flush(stamp_ns); !done) return done;
    }
    if (pose == nullptr) return {};
    return file_.transform(kTransformTopic, stamp_ns, fmt::format("entity_{}", id), *pose);
  }

  static std::optional<physics::Pose> pose_of(const v1::Pose& in) {
    physics::Pose out;
    std::optional<protocol::PoseRates> rates;
    if (protocol::from_proto(in, out, rates) != protocol::DecodeStatus::ok) return std::nullopt;
    return out;
  }

  /// Says once what the pixels of a channel are.
  Result<void> describe(std::int64_t stamp_ns, const v1::RecordedFrame& frame,
                        const ChannelLook& look) {
    if (!described_.insert(frame.channel().index()).second) return {};
    std::string text =
        fmt::format("{}: channel {}, {} x {} px in {}", look.topic, frame.channel().name(),
                    frame.width_px(), frame.height_px(), frame.unit());
    if (frame.channel().band_hi_um() > 0.0) {
      text += fmt::format(", band {} from {:g} to {:g} um", frame.channel().band(),
                          frame.channel().band_lo_um(), frame.channel().band_hi_um());
    }
    if (which_.preview && look.limits) {
      text += fmt::format("; preview from {:.6g} to {:.6g} {}", look.limits->min_value,
                          look.limits->max_value, look.unit);
    }
    return file_.event(kEventTopic, stamp_ns, EventLevel::info, "emitd", text);
  }

  FoxgloveFile& file_;
  const Chosen& chosen_;
  const Looks& looks_;
  FoxgloveImages which_;
  std::int64_t epoch_ns_;
  std::optional<glm::dmat3> ecef_from_world_;  // absent: the place is not known
  glm::dvec3 origin_ecef_m_{0.0};
  protocol::HostFrameData host_;
  std::string begin_;  // of the run, until there is an instant for it
  std::vector<std::pair<EventLevel, std::string>> waiting_;
  std::optional<std::int64_t> last_stamp_ns_;
  std::optional<std::uint64_t> last_sequence_;
  std::uint32_t flags_ = 0;
  std::map<std::uint32_t, bool> shown_;  // by entity
  std::set<std::uint32_t> described_;
  std::uint64_t without_camera_ = 0;
  std::uint64_t unreadable_ = 0;
};

/// Reads host frames and journal entries of the chosen run.
class EntryCursor {
 public:
  static Result<EntryCursor> open(const fs::path& file, const Chosen& chosen) {
    auto log = protocol::LogReader::open(file);
    if (!log) return tl::unexpected(log.error());
    return EntryCursor(std::move(*log), chosen);
  }
  /// Moves to the next entry. Returns false at the end.
  Result<bool> next() {
    for (;;) {
      const auto more = log_.next();
      if (!more || !*more) return more;
      ++read_;
      const bool journal = log_.topic() == protocol::LogTopic::journal;
      if (journal != chosen_->journal) continue;
      if (!journal) {
        if (log_.host().run_id != chosen_->run_id) continue;
        sim_time_ns_ = log_.host().sim_time_ns;
        return true;
      }
      const v1::JournalEntry& entry = log_.journal();
      if (entry.has_run_start()) in_run_ = entry.run_start().run_id() == chosen_->run_id;
      if (!in_run_) continue;
      if (entry.has_host_frame()) sim_time_ns_ = entry.host_frame().sim_time_ns();
      if (entry.has_frame()) sim_time_ns_ = entry.frame().sim_time_ns();
      return true;
    }
  }
  /// Returns the simulation time of the newest entry that has one, ns; absent: none had.
  [[nodiscard]] std::optional<std::int64_t> sim_time_ns() const noexcept { return sim_time_ns_; }
  [[nodiscard]] std::uint64_t read() const noexcept { return read_; }
  Result<void> give(Exporter& to) const {
    return chosen_->journal ? to.journal(log_.journal()) : to.host(log_.host());
  }

 private:
  EntryCursor(protocol::LogReader log, const Chosen& chosen)
      : log_(std::move(log)), chosen_(&chosen) {}
  protocol::LogReader log_;
  const Chosen* chosen_;
  bool in_run_ = false;
  std::uint64_t read_ = 0;
  std::optional<std::int64_t> sim_time_ns_;
};

/// Gives entries and images to the exporter in the order of simulation time.
Result<void> run(const fs::path& file, const Chosen& chosen, bool with_images, Exporter& exporter,
                 const FoxgloveOptions& options) {
  auto entries = EntryCursor::open(file, chosen);
  if (!entries) return tl::unexpected(entries.error());
  auto images = ImageCursor::open(file, chosen);
  if (!images) return tl::unexpected(images.error());
  auto more_entries = entries->next();
  auto more_images = with_images ? images->next() : Result<bool>(false);
  std::uint64_t shown = 0;
  while (more_entries && more_images && (*more_entries || *more_images)) {
    const bool take_image =
        *more_images &&
        (!*more_entries ||
         (entries->sim_time_ns() && images->frame().sim_time_ns() < *entries->sim_time_ns()));
    if (take_image) {
      if (auto done = exporter.image(*images); !done) return done;
      ++shown;
      more_images = images->next();
    } else {
      if (auto done = entries->give(exporter); !done) return done;
      more_entries = entries->next();
    }
    const double total = static_cast<double>(std::max<std::uint64_t>(chosen.messages, 1));
    if (options.progress &&
        !options.progress(static_cast<double>(entries->read() + shown) / total)) {
      return make_error(ErrorCode::internal, file.string() + ": stopped while exporting");
    }
  }
  if (!more_entries) return tl::unexpected(more_entries.error());
  if (!more_images) return tl::unexpected(more_images.error());
  return {};
}

}  // namespace

Result<FoxgloveSummary> export_foxglove(const fs::path& log, const fs::path& out,
                                        const FoxgloveOptions& options) {
  auto part = protocol::PartFile::begin(out, std::span(&log, 1));
  if (!part) return tl::unexpected(part.error());
  FoxgloveSummary summary;
  const auto chosen = choose(log, options);
  if (!chosen) return tl::unexpected(chosen.error());
  summary.run_id = chosen->run_id;
  if (chosen->truncation) summary.notes.push_back(*chosen->truncation);
  const RecordedPlace place =
      chosen->recording ? recorded_place(*chosen->recording) : RecordedPlace{};
  if (!place.epoch_utc_ns) {
    summary.notes.emplace_back(
        "the log does not hold the scenario's epoch: stamps count from 1970-01-01");
  }
  summary.epoch_utc_ns = place.epoch_utc_ns.value_or(0);
  const bool with_images = chosen->journal && (options.images.values || options.images.preview);
  auto looks = with_images ? survey(log, *chosen) : Result<Looks>(Looks{});
  if (!looks) return tl::unexpected(looks.error());
  auto file = FoxgloveFile::create(part->path(), options.software);
  if (!file) return tl::unexpected(file.error());
  Exporter exporter(*file, *chosen, *looks, options.images, summary.epoch_utc_ns, place.origin);
  Result<void> done = run(log, *chosen, with_images, exporter, options);
  if (done) done = exporter.finish();
  if (done) done = file->close();
  if (done) done = part->commit();
  if (!done) return tl::unexpected(done.error());
  if (exporter.without_camera() > 0) {
    summary.notes.push_back(
        fmt::format("{} images have no calibration: they are mirrored, rotated or distorted, or "
                    "their field of view is not known",
                    exporter.without_camera()));
  }
  if (exporter.unreadable() > 0) {
    summary.notes.push_back(fmt::format(
        "{} host frames and poses of the journal were left out: their numbers are out of range",
        exporter.unreadable()));
  }
  summary.topics = file->topics();
  return summary;
}

}  // namespace emit::tool
