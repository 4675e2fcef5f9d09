// SPDX-License-Identifier: Apache-2.0
#include "tool/engage/engage_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <iterator>

#include "emit/physics/constants.hpp"
#include "tool/engage/flight_plots.hpp"
#include "tool/report/html_page.hpp"
#include "tool/support/console.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {
namespace {

Samples samples_of(const LoopRecord& record, const std::function<double(const LoopFrame&)>& value) {
  Samples out;
  for (const LoopFrame& frame : record.frames) {
    const double one = value(frame);
    if (std::isfinite(one)) out.add(one);
  }
  return out;
}

double rms_of(const Samples& samples) {
  double sum = 0.0;
  for (const double value : samples.values()) sum += value * value;
  return samples.count() > 0 ? std::sqrt(sum / static_cast<double>(samples.count())) : NAN;
}

double percentile_of(const Samples& samples, double share) {
  return samples.count() > 0 ? samples.percentile(share) : NAN;
}

std::uint64_t count_of(const LoopRecord& record,
                       const std::function<bool(const LoopFrame&)>& which) {
  return static_cast<std::uint64_t>(std::ranges::count_if(record.frames, which));
}

Json vector_json(const glm::dvec3& v) {
  Json out = Json::array();
  out.push(v.x).push(v.y).push(v.z);
  return out;
}

/// Key figures of a flight. Those of angles are of frames farther than kFarM from the target.
struct Figures {
  std::uint64_t found = 0;
  std::uint64_t degraded = 0;
  Samples residual_px;  ///< optical axis against the true direction
  Samples measured_px;  ///< measured against the true direction
  Samples pointing_px;  ///< of the motion simulator
  Samples delay_ms;
  Samples lift_m_s2;
  double pose_error_m = 0.0;  ///< host's pose against the frame's
  double pose_error_rad = 0.0;
};

Figures figures_of(const EngageResults& results) {
  const LoopRecord& record = *results.flight;
  Figures out;
  out.found = count_of(record, [](const LoopFrame& f) { return f.answer && f.answer->found; });
  out.degraded =
      count_of(record, [](const LoopFrame& f) { return (f.flags & protocol::kFlagDegraded) != 0; });
  const bool guided = results.outcome.has_value();
  out.residual_px = samples_of(record, [&](const LoopFrame& f) {
    return guided && f.truth.range_m > kFarM
               ? results.focal_px * std::tan(f.truth.boresight_error_rad)
               : NAN;
  });
  out.measured_px = samples_of(record, [&](const LoopFrame& f) {
    return f.truth.range_m > kFarM ? measured_error_px(f, results.focal_px) : NAN;
  });
  out.pointing_px = samples_of(record, [](const LoopFrame& f) { return f.pointing_error_px; });
  out.delay_ms = samples_of(record, [](const LoopFrame& f) { return f.loop_delay_ms; });
  out.lift_m_s2 = samples_of(record, [](const LoopFrame& f) { return f.truth.lift_m_s2; });
  for (const LoopFrame& f : record.frames) {
    out.pose_error_m = std::max(out.pose_error_m, glm::length(f.host_pose.position_world_m -
                                                              f.frame_pose.position_world_m));
    const glm::dquat& a = f.host_pose.world_from_body;
    const glm::dquat& b = f.frame_pose.world_from_body;
    const glm::dquat turn = glm::conjugate(a) * b;
    out.pose_error_rad =
        std::max(out.pose_error_rad,
                 2.0 * std::asin(std::min(1.0, glm::length(glm::dvec3(turn.x, turn.y, turn.z)))));
  }
  return out;
}

/// One row of the table of key figures.
struct Row {
  std::string name;
  std::string value;
};

std::vector<Row> rows_of(const EngageResults& results) {
  std::vector<Row> rows{{"scenario", results.scenario}};
  if (!results.flight) return rows;
  rows.push_back({"host", results.host});
  rows.push_back({"seeker", results.seeker});
  rows.push_back({"device", results.device});
  const LoopRecord& record = *results.flight;
  const Figures figures = figures_of(results);
  // A figure of no values says so.
  const auto measured = [&](std::string name, const Samples& of, std::string text) {
    rows.push_back({std::move(name), of.count() > 0 ? std::move(text) : "nothing was measured"});
  };
  const std::string mode =
      results.real_time ? "real time with a motion simulator" : "lock-step, without wall clock";
  rows.push_back(
      {"loop", fmt::format("{}, {:g} Hz, band {}", mode, results.rate_hz, results.band)});
  if (results.outcome) {
    rows.push_back(
        {"miss distance",
         fmt::format("{:.3f} m at {:.3f} s{}", results.outcome->miss_m, results.outcome->closest_s,
                     results.outcome->on_ground ? " (ended on the ground)" : "")});
    measured(fmt::format("pointing residual of the head beyond {:g} m, RMS / p99 / most", kFarM),
             figures.residual_px,
             fmt::format("{:.2f} / {:.2f} / {:.2f} px", rms_of(figures.residual_px),
                         percentile_of(figures.residual_px, 0.99),
                         percentile_of(figures.residual_px, 1.0)));
    measured(fmt::format("measured line of sight beyond {:g} m, error, median / p99", kFarM),
             figures.measured_px,
             fmt::format("{:.3f} / {:.2f} px", percentile_of(figures.measured_px, 0.5),
                         percentile_of(figures.measured_px, 0.99)));
    measured("greatest lateral acceleration", figures.lift_m_s2,
             fmt::format("{:.1f} m/s2", percentile_of(figures.lift_m_s2, 1.0)));
  }
  rows.push_back({"frames with the target found",
                  fmt::format("{} of {}", figures.found, record.frames.size())});
  rows.push_back({"frames flagged degraded", fmt::format("{}", figures.degraded)});
  if (results.real_time) {
    measured("pointing error of the motion simulator, RMS / p99 / most", figures.pointing_px,
             fmt::format("{:.3f} / {:.3f} / {:.3f} px", rms_of(figures.pointing_px),
                         percentile_of(figures.pointing_px, 0.99),
                         percentile_of(figures.pointing_px, 1.0)));
  } else {
    rows.push_back(
        {"greatest difference of pose and frame",
         fmt::format("{:.2g} m, {:.2g} rad", figures.pose_error_m, figures.pose_error_rad)});
  }
  measured(
      "loop delay, pose to answer, median / p99 / most", figures.delay_ms,
      fmt::format("{:.1f} / {:.1f} / {:.1f} ms", percentile_of(figures.delay_ms, 0.5),
                  percentile_of(figures.delay_ms, 0.99), percentile_of(figures.delay_ms, 1.0)));
  rows.push_back({"frames a second of wall time",
                  fmt::format("{:.1f}", static_cast<double>(record.frames.size()) /
                                            std::max(record.wall_s, 1e-9))});
  return rows;
}

std::string base64(const std::string& bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t word = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      word = word << 8U | (i + j < bytes.size() ? static_cast<unsigned char>(bytes[i + j]) : 0U);
    }
    for (std::size_t j = 0; j < 4; ++j) {
      out += i + j <= bytes.size() ? kDigits[word >> (18U - 6U * j) & 63U] : '=';
    }
  }
  return out;
}

physics::Result<std::string> film_html(const std::filesystem::path& folder,
                                       const LoopRecord& record, bool guided) {
  std::string out = "<div class=\"film\">\n";
  for (const FilmPicture& picture : record.film) {
    std::ifstream file(folder / picture.file, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    constexpr std::size_t kSizeAt = 16;  // width and height of a PNG, big endian
    if (bytes.size() < kSizeAt + 8) {
      return physics::make_error(
          physics::ErrorCode::io,
          fmt::format("{}: cannot be read", (folder / picture.file).string()));
    }
    const auto size_at = [&bytes](std::size_t at) {
      std::uint32_t value = 0;
      for (std::size_t i = 0; i < 4; ++i) {
        value = value << 8U | static_cast<unsigned char>(bytes[at + i]);
      }
      return value;
    };
    const std::uint32_t width = size_at(kSizeAt);
    const std::uint32_t height = size_at(kSizeAt + 4);
    out += fmt::format(
        "<figure><svg viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\">"
        "<image width=\"{0}\" height=\"{1}\" href=\"data:image/png;base64,{2}\"/>",
        width, height, base64(bytes));
    if (picture.answer && picture.answer->found) {
      out += fmt::format(
          "<g class=\"mark\" transform=\"translate({:.2f} {:.2f})\"><path d=\"M-14 0H-5M5 0H14M0 "
          "-14V-5M0 5V14\"/></g>",
          picture.answer->x_px, picture.answer->y_px);
    }
    out += fmt::format("</svg><figcaption>{:.2f} s{}</figcaption></figure>\n", picture.time_s,
                       guided ? fmt::format(", {:.0f} m to the target", picture.range_m) : "");
  }
  return out + "</div>\n";
}

}  // namespace

Json engage_json(const EngageResults& results) {
  Json json = Json::object();
  json.set("scenario", results.scenario).set("host", results.host).set("seeker", results.seeker);
  json.set("device", results.device).set("real_time", results.real_time);
  if (results.flight) {
    const LoopRecord& record = *results.flight;
    const Figures figures = figures_of(results);
    Json flight = Json::object();
    flight.set("rate_hz", results.rate_hz).set("channel", results.channel);
    flight.set("band", results.band).set("focal_px", results.focal_px);
    flight.set("poses", record.poses).set("frames", record.frames.size());
    flight.set("answers", record.answers).set("target_found_frames", figures.found);
    flight.set("unmatched_answers", record.unmatched_answers);
    flight.set("degraded_frames", figures.degraded).set("ended_by_host", record.ended);
    if (results.outcome) {
      flight.set("miss_m", results.outcome->miss_m);
      flight.set("miss_offset_m", vector_json(results.outcome->miss_offset_m));
      flight.set("closest_approach_s", results.outcome->closest_s);
      flight.set("on_ground", results.outcome->on_ground);
      flight.set("angles_beyond_m", kFarM);
      flight.set("pointing_residual_rms_px", rms_of(figures.residual_px));
      flight.set("pointing_residual_p99_px", percentile_of(figures.residual_px, 0.99));
      flight.set("pointing_residual_max_px", percentile_of(figures.residual_px, 1.0));
      flight.set("measured_error_median_px", percentile_of(figures.measured_px, 0.5));
      flight.set("measured_error_p99_px", percentile_of(figures.measured_px, 0.99));
      flight.set("max_lift_m_s2", percentile_of(figures.lift_m_s2, 1.0));
    }
    if (!results.real_time) {
      flight.set("pose_difference_max_m", figures.pose_error_m);
      flight.set("pose_difference_max_rad", figures.pose_error_rad);
    }
    if (!record.frames.empty()) {
      flight.set("last_position_m", vector_json(record.frames.back().host_pose.position_world_m));
    }
    json.set("flight", std::move(flight));
    Json times = Json::object();
    times.set("wall_s", record.wall_s);
    times.set("frames_per_s", static_cast<double>(record.frames.size()) / record.wall_s);
    times.set("loop_delay_median_ms", percentile_of(figures.delay_ms, 0.5));
    times.set("loop_delay_p99_ms", percentile_of(figures.delay_ms, 0.99));
    times.set("loop_delay_max_ms", percentile_of(figures.delay_ms, 1.0));
    json.set("times", std::move(times));
    if (results.real_time) {
      Json motion = Json::object();
      motion.set("pointing_frames", figures.pointing_px.count());
      motion.set("pointing_error_rms_px", rms_of(figures.pointing_px));
      motion.set("pointing_error_p99_px", percentile_of(figures.pointing_px, 0.99));
      motion.set("pointing_error_max_px", percentile_of(figures.pointing_px, 1.0));
      motion.set("motion_fault_frames", count_of(record, [](const LoopFrame& f) {
                   return (f.flags & protocol::kFlagMotionFault) != 0;
                 }));
      json.set("motion", std::move(motion));
    }
  }
  if (results.study) json.set("tracker_study", study_json(*results.study));
  return json;
}

physics::Result<void> write_frames_csv(const std::filesystem::path& file,
                                       const EngageResults& results) {
  std::ofstream stream(file, std::ios::binary);
  stream << "time_s,east_m,north_m,up_m,qw,qx,qy,qz,range_m,found,x_px,y_px,quality,"
            "boresight_error_px,measured_error_px,command_m_s2,lift_m_s2,angle_of_attack_deg,"
            "speed_m_s,loop_delay_ms,flags,pointing_error_px\n";
  for (const LoopFrame& f : results.flight->frames) {
    const glm::dvec3& p = f.host_pose.position_world_m;
    const glm::dquat& q = f.host_pose.world_from_body;
    const bool found = f.answer && f.answer->found;
    stream << fmt::format("{:.6f},{:.6f},{:.6f},{:.6f},{:.12f},{:.12f},{:.12f},{:.12f},", f.time_s,
                          p.x, p.y, p.z, q.w, q.x, q.y, q.z);
    stream << fmt::format("{:.4f},{:d},", f.truth.range_m, found);
    stream << (found ? fmt::format("{:.4f},{:.4f},{:.4f},", f.answer->x_px, f.answer->y_px,
                                   f.answer->quality)
                     : ",,,");
    stream << fmt::format("{:.5f},{:.5f},{:.5f},{:.5f},{:.5f},{:.4f},{:.3f},{},{:.5f}\n",
                          results.focal_px * std::tan(f.truth.boresight_error_rad),
                          measured_error_px(f, results.focal_px), f.truth.command_m_s2,
                          f.truth.lift_m_s2, f.truth.angle_of_attack_rad / physics::kDegree,
                          glm::length(f.truth.velocity_m_s), f.loop_delay_ms, f.flags,
                          f.pointing_error_px);
  }
  stream.flush();
  if (!stream) {
    return physics::make_error(physics::ErrorCode::io,
                               fmt::format("{}: cannot be written", file.string()));
  }
  return {};
}

std::string engage_text(const EngageResults& results) {
  std::string out;
  for (const Row& row : rows_of(results)) out += fmt::format("{:<60} {}\n", row.name, row.value);
  return out;
}

physics::Result<void> write_engage_html(const std::filesystem::path& file,
                                        const std::filesystem::path& folder,
                                        const EngageResults& results) {
  std::string out;
  out += fmt::format("<h1>Closed loop on {}</h1>\n<table>\n", html_escaped(results.scenario));
  for (const Row& row : rows_of(results)) {
    out += fmt::format("<tr><td>{}</td><td>{}</td></tr>\n", html_escaped(row.name),
                       html_escaped(row.value));
  }
  out += "</table>\n";
  if (results.flight) {
    out += "<h2>What the seeker saw</h2>\n";
    out += fmt::format(
        "<p>Apparent temperature in the band {}. The cross marks where the seeker found its "
        "target.</p>\n",
        html_escaped(results.band));
    const auto film = film_html(folder, *results.flight, results.outcome.has_value());
    if (!film) return tl::unexpected(film.error());
    out += *film;
    out += "<h2>Flight</h2>\n" + svg_document(flight_plots(results));
  }
  if (results.study) {
    out += "<h2>Matching error of a correlation tracker</h2>\n";
    out += fmt::format(
        "<p>{} templates of {} x {} pixels are searched within {} pixels of their places in "
        "pictures with thermal shadows (band {}, noise {:.0f} mK). Left: the template is predicted "
        "for the time of the picture. Right: the template is that of the first picture's "
        "time.</p>\n",
        results.study->templates, results.study->template_px, results.study->template_px,
        results.study->search_px, html_escaped(results.study->band), 1e3 * results.study->noise_k);
    out += svg_document(study_plots(*results.study));
  }
  constexpr const char* kStyle =
      ".film { display: flex; flex-wrap: wrap; gap: 10px; }\n"
      "figure { margin: 0; }\nfigcaption { font-size: 13px; color: #555; }\n"
      ".mark path { stroke: #0ff; stroke-width: 1.2; fill: none; }\n";
  return write_html(file, html_page("emit engage", kStyle, out));
}

}  // namespace emit::tool
