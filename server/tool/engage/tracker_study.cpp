// SPDX-License-Identifier: Apache-2.0
#include "tool/engage/tracker_study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/scene/trajectory.hpp"
#include "tool/engage/json_line.hpp"
#include "tool/engage/line_pipe.hpp"
#include "tool/engage/python_program.hpp"
#include "tool/engage/study_pictures.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/subprocess.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Scenario of the truth and of the templates, with the camera of both.
struct StudySet {
  scene::ScenarioDesc truth;
  scene::ScenarioDesc forecast;
  scene::ScenarioDesc dark;  ///< the forecast without direct sun
  std::size_t band = 0;
  physics::Pose camera;
  std::vector<std::int64_t> sim_times_ns;
};

Result<StudySet> load(const TrackerStudyOptions& options) {
  StudySet out;
  ScenarioChoice choice = options.truth;
  const auto read = [&choice](scene::ScenarioDesc& target) -> Result<void> {
    auto scenario = load_scenario_choice(choice);
    if (!scenario) return tl::unexpected(scenario.error());
    target = std::move(*scenario);
    target.thermal.state_file.clear();
    return {};
  };
  if (auto done = read(out.truth); !done) return tl::unexpected(done.error());
  choice.set.insert(choice.set.end(), options.forecast.begin(), options.forecast.end());
  if (auto done = read(out.forecast); !done) return tl::unexpected(done.error());
  choice.set.emplace_back("weather.cloud_frac=1");
  if (auto done = read(out.dark); !done) return tl::unexpected(done.error());
  const auto band = find_band(out.truth, options.band);
  if (!band) return tl::unexpected(band.error());
  out.band = *band;
  if (out.truth.sensor.trajectory.empty()) {
    return make_error(ErrorCode::config, "the scenario's sensor has no position");
  }
  const auto start_ns = static_cast<std::int64_t>(std::llround(1e9 * options.start_s));
  const glm::dvec3 from =
      scene::trajectory_at(out.truth.sensor.trajectory, start_ns).pose.position_world_m -
      options.look_at_m;
  const glm::dvec3 level = glm::normalize(glm::dvec3(from.x, from.y, 0.0));
  out.camera.position_world_m =
      options.look_at_m + options.range_m * (std::cos(options.depression_rad) * level +
                                             glm::dvec3(0, 0, std::sin(options.depression_rad)));
  out.camera.world_from_body =
      physics::world_from_body_look_at(out.camera.position_world_m, options.look_at_m);
  const auto steps = static_cast<int>(std::floor(options.length_s / options.step_s + 1e-9));
  for (int i = 0; i <= steps; ++i) {
    out.sim_times_ns.push_back(
        static_cast<std::int64_t>(std::llround(1e9 * (options.start_s + i * options.step_s))));
  }
  return out;
}

std::string picture_name(std::string_view kind, std::size_t index) {
  return fmt::format("{}_{:02}.npy", kind, index);
}

/// Returns the picture with plain shadows. A surface in the sun looks as it does without any
/// shadow, a surface out of the sun as it does without sun, and the sun of the moment decides.
StudyPicture plain_shadows(const StudyPicture& lit, const StudyPicture& dark,
                           const std::vector<double>& sun_frac) {
  StudyPicture out = lit;
  for (std::size_t i = 0; i < sun_frac.size(); ++i) {
    out.radiance_w_m2_sr[i] =
        static_cast<float>(sun_frac[i] * static_cast<double>(lit.radiance_w_m2_sr[i]) +
                           (1.0 - sun_frac[i]) * static_cast<double>(dark.radiance_w_m2_sr[i]));
  }
  return out;
}

Result<void> write_all(const TrackerStudyOptions& options, std::string_view kind,
                       const std::vector<StudyPicture>& pictures) {
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    if (auto done = write_npy(options.work / picture_name(kind, i), pictures[i]); !done) {
      return done;
    }
  }
  return {};
}

Result<void> write_png(const TrackerStudyOptions& options, const StudySet& set,
                       const ApparentTemperature& apparent, const StudyPicture& picture,
                       const std::string& name) {
  const scene::SpectralBand& band = set.truth.bands[set.band];
  FramePlanes planes;
  planes.width_px = picture.width_px;
  planes.height_px = picture.height_px;
  planes.radiance_w_m2_sr = picture.radiance_w_m2_sr;
  planes.apparent = &apparent;
  planes.metadata = {0,          1,          set.camera,   band.name,
                     band.lo_um, band.hi_um, "W m-2 sr-1", scene::spectral_band(band).response};
  return write_frame_png(options.out / name, planes,
                         {set.truth.display.min_k, set.truth.display.max_k});
}

/// Renders truth and templates, and writes them for the matching program. Returns the noise of the
/// detector as radiance.
Result<double> render_all(const TrackerStudyOptions& options, const StudySet& set,
                          TrackerStudy& study) {
  const std::size_t count = set.sim_times_ns.size();
  Progress progress("pictures of the tracker study", 2 * count + 4);
  const auto truth = render_pictures(set.truth, set.band, set.camera, set.sim_times_ns);
  if (!truth) return tl::unexpected(truth.error());
  if (auto done = write_all(options, "truth", *truth); !done) return tl::unexpected(done.error());
  progress.advance_to(2);
  const auto thermal = render_pictures(set.forecast, set.band, set.camera, set.sim_times_ns);
  if (!thermal) return tl::unexpected(thermal.error());
  if (auto done = write_all(options, "thermal", *thermal); !done) {
    return tl::unexpected(done.error());
  }
  progress.advance_to(4);
  std::vector<StudyPicture> plain;
  std::vector<StudyPicture> none;
  for (std::size_t i = 0; i < count; ++i) {
    const std::int64_t now_ns = set.sim_times_ns[i];
    auto lit = render_unshadowed(set.forecast, set.band, set.camera, now_ns);
    if (!lit) return tl::unexpected(lit.error());
    progress.advance_to(5 + 2 * i);
    const auto dark = render_unshadowed(set.dark, set.band, set.camera, now_ns);
    if (!dark) return tl::unexpected(dark.error());
    const auto shares = sun_shares(set.forecast, set.camera, now_ns);
    if (!shares) return tl::unexpected(shares.error());
    plain.push_back(plain_shadows(*lit, *dark, *shares));
    none.push_back(std::move(*lit));
    progress.advance_to(6 + 2 * i);
  }
  progress.finish();
  if (auto done = write_all(options, "plain", plain); !done) return tl::unexpected(done.error());
  if (auto done = write_all(options, "none", none); !done) return tl::unexpected(done.error());

  const ApparentTemperature apparent(scene::spectral_band(set.truth.bands[set.band]));
  const std::pair<std::string, const StudyPicture*> shown[] = {
      {"study_truth_begin.png", &truth->front()},
      {"study_truth_end.png", &truth->back()},
      {"study_thermal_end.png", &thermal->back()},
      {"study_plain_end.png", &plain.back()},
      {"study_none_end.png", &none.back()}};
  for (const auto& [name, picture] : shown) {
    if (auto done = write_png(options, set, apparent, *picture, name); !done) {
      return tl::unexpected(done.error());
    }
    study.pictures.push_back(name);
  }
  double mean = 0.0;
  for (const float value : truth->front().radiance_w_m2_sr) mean += static_cast<double>(value);
  mean /= static_cast<double>(truth->front().radiance_w_m2_sr.size());
  return options.noise_k / apparent.kelvin_per_radiance(mean);
}

/// Reads one line of the matching program into the study.
Result<void> take_line(const std::string& text, const TrackerStudyOptions& options,
                       TrackerStudy& study) {
  const auto object = JsonLine::parse(text);
  if (!object) return tl::unexpected(object.error());
  const auto model = object->text("model");
  const auto kind = object->text("kind");
  if (!model || !kind) return tl::unexpected((model ? kind : model).error());
  const auto series = std::ranges::find_if(
      study.series, [&model](const StudySeries& each) { return to_string(each.model) == *model; });
  if (series == study.series.end()) {
    return make_error(ErrorCode::protocol, fmt::format("'{}' is no model", *model));
  }
  MatchFigures figures;
  double index = 0.0;
  double templates = 0.0;
  const std::pair<const char*, double*> fields[] = {{"index", &index},
                                                    {"templates", &templates},
                                                    {"rms_px", &figures.rms_px},
                                                    {"median_px", &figures.median_px},
                                                    {"lost_frac", &figures.lost_frac},
                                                    {"correlation", &figures.correlation}};
  for (const auto& [key, target] : fields) {
    const auto value = object->number(key);
    if (!value) return tl::unexpected(value.error());
    *target = *value;
  }
  figures.time_s = index * options.step_s;
  study.templates = static_cast<std::uint32_t>(templates);
  (*kind == "stored" ? series->stored : series->predicted).push_back(figures);
  return {};
}

Result<void> match(const TrackerStudyOptions& options, std::size_t count, double noise_w_m2_sr,
                   TrackerStudy& study) {
  auto program = python_program("emit_client.tracker_study");
  if (!program) return tl::unexpected(program.error());
  for (const std::string& word :
       {std::string("--folder"), options.work.string(), std::string("--pictures"),
        fmt::format("{}", count), std::string("--noise-w-m2-sr"),
        fmt::format("{:.17g}", noise_w_m2_sr), std::string("--template-px"),
        fmt::format("{}", options.template_px), std::string("--search-px"),
        fmt::format("{}", options.search_px)}) {
    program->push_back(word);
  }
  auto lines = LinePipe::open();
  if (!lines) return tl::unexpected(lines.error());
  const auto log = options.work / "tracker_study.log";
  auto process = Subprocess::start(*program, log, lines->write_end());
  if (!process) return tl::unexpected(process.error());
  lines->close_write_end();
  const std::size_t expected = 2 * count * std::size(kShadowModels);
  Progress progress("matches", expected);
  for (std::size_t taken = 0; taken < expected;) {
    if (InterruptGuard::interrupted()) return make_error(ErrorCode::io, "interrupted");
    const auto line = lines->next(std::chrono::milliseconds(500));
    if (!line) {
      return make_error(ErrorCode::io, fmt::format("the matching program: {}; see {}",
                                                   line.error().text, log.string()));
    }
    if (!*line) continue;
    if (auto done = take_line(**line, options, study); !done) return done;
    progress.advance_to(++taken);
  }
  progress.finish();
  return {};
}

}  // namespace

std::string_view to_string(ShadowModel model) noexcept {
  switch (model) {
    case ShadowModel::thermal:
      return "thermal";
    case ShadowModel::plain:
      return "plain";
    case ShadowModel::none:
      return "none";
  }
  return "";
}

Result<TrackerStudy> run_tracker_study(const TrackerStudyOptions& options) {
  const auto set = load(options);
  if (!set) return tl::unexpected(set.error());
  TrackerStudy study;
  study.band = set->truth.bands[set->band].name;
  study.start_s = options.start_s;
  study.template_px = options.template_px;
  study.search_px = options.search_px;
  study.noise_k = options.noise_k;
  study.forecast = options.forecast;
  for (const ShadowModel model : kShadowModels) study.series.push_back({model, {}, {}});
  const auto noise_w_m2_sr = render_all(options, *set, study);
  if (!noise_w_m2_sr) return tl::unexpected(noise_w_m2_sr.error());
  if (auto done = match(options, set->sim_times_ns.size(), *noise_w_m2_sr, study); !done) {
    return tl::unexpected(done.error());
  }
  return study;
}

Json study_json(const TrackerStudy& study) {
  Json json = Json::object();
  json.set("band", study.band).set("start_s", study.start_s);
  json.set("templates", study.templates).set("template_px", study.template_px);
  json.set("search_px", study.search_px).set("noise_k", study.noise_k);
  Json forecast = Json::array();
  for (const std::string& text : study.forecast) forecast.push(text);
  json.set("forecast", std::move(forecast));
  const auto list = [](const std::vector<MatchFigures>& figures) {
    Json out = Json::array();
    for (const MatchFigures& each : figures) {
      Json one = Json::object();
      one.set("time_s", each.time_s).set("rms_px", each.rms_px).set("median_px", each.median_px);
      one.set("lost_frac", each.lost_frac).set("correlation", each.correlation);
      out.push(std::move(one));
    }
    return out;
  };
  Json models = Json::object();
  for (const StudySeries& series : study.series) {
    Json one = Json::object();
    one.set("predicted", list(series.predicted)).set("stored", list(series.stored));
    models.set(to_string(series.model), std::move(one));
  }
  json.set("models", std::move(models));
  return json;
}

std::vector<Plot> study_plots(const TrackerStudy& study) {
  std::vector<Plot> out;
  for (const bool stored : {false, true}) {
    Plot plot;
    plot.title = stored ? "Template stored at the begin" : "Template predicted for the time";
    plot.x.label = "time, min";
    plot.y.label = "matching error, RMS, px";
    for (const StudySeries& series : study.series) {
      PlotSeries shown;
      shown.label = series.model == ShadowModel::none
                        ? "no shadows"
                        : fmt::format("{} shadows", to_string(series.model));
      shown.line = true;
      shown.emphasis = series.model == ShadowModel::thermal;
      for (const MatchFigures& figures : stored ? series.stored : series.predicted) {
        shown.points.push_back(
            {figures.time_s / 60.0, figures.rms_px, fmt::format("{:.2f} px", figures.rms_px)});
      }
      plot.series.push_back(std::move(shown));
    }
    out.push_back(std::move(plot));
  }
  return out;
}

}  // namespace emit::tool
