// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "bench/accuracy/accuracy_benches.hpp"
#include "bench/accuracy/converged_history.hpp"
#include "bench/stability/bench_stability_scene.hpp"
#include "emit/image/false_color.hpp"
#include "emit/physics/constants.hpp"
#include "emit/verify/stability.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {
namespace {

struct ThermalTruthOptions {
  std::optional<std::filesystem::path> json;
  std::string method = "cached";
  std::uint32_t steps = 90;
  std::uint32_t width_px = 320;
  std::uint32_t height_px = 256;
  std::optional<std::filesystem::path> pictures;
  int gpu_index = -1;
};

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::int64_t kSecondNs = 1'000'000'000;
// The history begins at 08:00 local time with the vehicle parked. It drives off after three hours,
// and the image shows its print two minutes later.
constexpr std::int64_t kLeavesNs = 10'800 * kSecondNs;
constexpr std::int64_t kAwayNs = kLeavesNs + 10 * kSecondNs;
constexpr std::int64_t kShownNs = kLeavesNs + 120 * kSecondNs;
/// Ages of the print, s.
constexpr std::array<std::int64_t, 4> kPrintAges{60, 120, 600, 3600};
constexpr std::int64_t kLongestStepS = 200;
constexpr double kDriveM = 120.0;
const glm::dvec3 kBoxLowM{-3.0, -1.25, 0.0};
const glm::dvec3 kBoxHighM{3.0, 1.25, 2.5};
/// Number of intervals of the history in double: 5 s each.
constexpr std::uint32_t kTrueSteps = 2184;
/// Number of rays over the sun's disc.
constexpr int kDiscRays = 24;
/// Obscurance radius that is too small to cover a neighbouring pixel: the sky factor is that of a
/// flat face.
constexpr double kNoObscuranceM = 1e-6;

/// One row; errors in kelvin over pixels.
struct Row {
  std::string test;
  Samples errors_k;
  std::vector<std::pair<std::string, Json>> keys;
  std::string note;
};

class ThermalTruth {
 public:
  explicit ThermalTruth(const ThermalTruthOptions& command)
      : command_(command), progress_("bench thermal-truth", kWork) {}

  int run() {
    if (folder_.path().empty()) {
      return fail(physics::Error{ErrorCode::io, "no temporary folder can be created"});
    }
    using Step = Result<void> (ThermalTruth::*)();
    // The cached method knows that the vehicle hides part of the sky, so its reference must know
    // too.
    const Step print = cached() ? &ThermalTruth::fading_print : &ThermalTruth::parked_and_left;
    for (const Step step :
         {&ThermalTruth::split, &ThermalTruth::moved_camera, print, &ThermalTruth::restart}) {
      if (auto ok = (this->*step)(); !ok) return fail(ok.error());
    }
    progress_.finish();
    return write();
  }

 private:
  static constexpr std::uint64_t kWork = 39;

  [[nodiscard]] bool cached() const { return command_.method == "cached"; }
  /// Makes ground and a vehicle that stood there since the history began.
  Result<scene::ScenarioDesc> parking_lot();
  [[nodiscard]] physics::Pose camera() const {
    return looking_at({4.0, -12.0, 9.0}, {0.0, 1.5, 0.0});
  }
  Result<StoredFrame> tick(Result<StoredFrame> frame);
  Result<void> picture(const StoredFrame& frame, const std::string& name) const;

  Result<void> split();
  Result<void> split_frames(bool overcast, const std::vector<std::uint32_t>& steps,
                            Samples& errors);
  Result<void> moved_camera();
  Result<void> parked_and_left();
  Result<void> fading_print();
  Result<void> restart();
  int write();

  static void compare(const StoredFrame& a, const StoredFrame& b, Samples& errors);

  const ThermalTruthOptions& command_;
  InterruptGuard interrupt_;
  Progress progress_;
  TemporaryFolder folder_;
  std::uint64_t done_ = 0;
  std::string device_;
  std::vector<Row> rows_;
};

Result<scene::ScenarioDesc> ThermalTruth::parking_lot() {
  scene::ScenarioDesc scenario = plain_scenario(command_.width_px, command_.height_px);
  if (cached()) scenario.thermal.method = scene::ThermalMethod::cached;
  scenario.thermal.steps = command_.steps;
  scenario.thermal.shadow_map_px = 1024;
  scenario.thermal.obscurance_radius_m = kNoObscuranceM;
  FlatPart vehicle;
  vehicle.name = "vehicle";
  for (const FlatPart& part : box_parts(kBoxLowM, kBoxHighM)) {
    vehicle.faces.insert(vehicle.faces.end(), part.faces.begin(), part.faces.end());
  }
  const std::vector<FlatPart> parts{level_part("ground", {0.0, 0.0, 0.0}, 40.0, 40.0), vehicle};
  if (auto ok = place_parts(parts, folder_.path(), scenario); !ok) {
    return tl::unexpected(std::move(ok.error()));
  }
  scene::ObjectDesc& moving = scenario.objects[1];
  moving.entity_id = 1;
  physics::Pose parked = moving.instances.front();
  physics::Pose away = parked;
  away.position_world_m.x += kDriveM;
  moving.trajectory = {{scenario.thermal.history_start_ns, parked, true, false},
                       {kLeavesNs, parked, true, false},
                       {kAwayNs, away, true, false}};
  return scenario;
}

Result<StoredFrame> ThermalTruth::tick(Result<StoredFrame> frame) {
  progress_.advance_to(++done_);
  if (InterruptGuard::interrupted()) return make_error(ErrorCode::io, "interrupted");
  if (frame) device_ = frame->device;
  return frame;
}

Result<void> ThermalTruth::picture(const StoredFrame& frame, const std::string& name) const {
  if (!command_.pictures) return {};
  image::FalseColorOptions colors;
  if (const auto range = image::percentile_range(frame.temperature_k, 1.0, 99.0)) {
    colors.min_value = range->min_value - 0.5;
    colors.max_value = range->max_value + 0.5;
  }
  colors.color_bar = true;
  const auto height = static_cast<std::uint32_t>(frame.temperature_k.size() / frame.width_px);
  const auto pixels = image::false_color(frame.temperature_k, frame.width_px, height, colors);
  if (!pixels) return tl::unexpected(pixels.error());
  return image::write_png(*command_.pictures / (name + ".png"), *pixels);
}

void ThermalTruth::compare(const StoredFrame& a, const StoredFrame& b, Samples& errors) {
  for (std::size_t i = 0; i < a.temperature_k.size(); ++i) {
    if (!(a.object_id[i] > 0.0F && b.object_id[i] > 0.0F)) continue;
    const double error_k = std::abs(static_cast<double>(a.temperature_k[i]) - b.temperature_k[i]);
    // An error of NaN must not pass for agreement.
    errors.add(std::isfinite(error_k) ? error_k : std::numeric_limits<double>::infinity());
  }
}

/// Compares frames with ever more steps with the frame with the fewest. Under a constant sky more
/// steps only split intervals. Under the sun they also sample sun and shade more finely.
Result<void> ThermalTruth::split_frames(bool overcast, const std::vector<std::uint32_t>& steps,
                                        Samples& errors) {
  auto scenario = parking_lot();
  if (!scenario) return tl::unexpected(std::move(scenario.error()));
  scenario->sensor.width_px = std::min(command_.width_px, 160U);
  scenario->sensor.height_px = std::min(command_.height_px, 128U);
  scenario->thermal.shadow_map_px = 256;
  if (overcast) {
    scene::WeatherSample sample;
    sample.diffuse_horizontal_w_m2 = 180.0;
    sample.longwave_down_w_m2 = 370.0;
    sample.air_k = 289.0;
    scenario->weather = {sample};
  }
  std::optional<StoredFrame> first;
  for (const std::uint32_t count : steps) {
    scenario->thermal.steps = count;
    const auto frame = tick(render_once(*scenario, camera(), kShownNs, command_.gpu_index));
    if (!frame) return tl::unexpected(frame.error());
    if (first) {
      compare(*frame, *first, errors);
    } else {
      first = *frame;
    }
  }
  return {};
}

Result<void> ThermalTruth::split() {
  // The equilibria are those of faces in the sun, in the shade and with intermittent shade, at the
  // nodes of the renderer's own intervals.
  auto scenario = parking_lot();
  if (!scenario) return tl::unexpected(std::move(scenario.error()));
  constexpr std::uint32_t kNodes = 27;
  const PointHistory nodes(*scenario, kShownNs, kNodes);
  std::vector<verify::DriveHistory> histories;
  const std::array<std::pair<const char*, glm::dvec3>, 3> faces{
      {{"level", {0.0, 0.0, 1.0}},
       {"facing east", {1.0, 0.0, 0.0}},
       {"facing south", {0.0, -1.0, 0.0}}}};
  const std::array<std::vector<double>, 3> taus{
      {{609.0, 7259.0}, {141.0, 2634.0}, {5.0, 908.0, 3e6}}};
  const std::array<std::vector<double>, 3> weights{
      {{0.547, 0.453}, {0.324, 0.676}, {0.2, 0.5, 0.3}}};
  for (const auto& [face, normal] : faces) {
    for (const char* shade : {"sun", "shade", "passing shadow"}) {
      for (std::size_t m = 0; m < taus.size(); ++m) {
        verify::DriveHistory h;
        h.name = fmt::format("{}, {}, tau {} s", face, shade, taus[m].front());
        h.start_k = scenario->thermal.initial_k;
        h.tau_s = taus[m];
        h.weight_frac = weights[m];
        for (std::size_t i = 0; i <= kNodes; ++i) {
          const bool lit = std::string_view(shade) == "sun" ||
                           (std::string_view(shade) == "passing shadow" && (i / 5) % 2 == 0);
          h.node_s.push_back(nodes.node_s(i));
          h.drive_k.push_back(
              nodes.equilibrium_k(i, scenario->materials[0], normal, lit ? 1.0 : 0.0));
        }
        histories.push_back(std::move(h));
      }
    }
  }
  const std::vector<std::uint32_t> counts{1, 2, 3, 10, 30, 100, 300, 1000};
  const auto report = verify::sweep_split(histories, counts, command_.gpu_index);
  if (!report) return tl::unexpected(report.error());
  Row row{.test = "split", .errors_k = {}, .keys = {}, .note = {}};
  Json by_count = Json::object();
  for (std::size_t i = 0; i < counts.size(); ++i) {
    row.errors_k.add(report->results[i].max_error_k);
    by_count.set(fmt::format("{}", counts[i]), report->results[i].max_error_k);
  }
  Samples steady;
  // Samples of the cached method remember every step of the warm-up.
  std::vector<std::uint32_t> counts_of_frames{4, 40, 400};
  if (!cached()) counts_of_frames.push_back(4000);
  if (auto ok = split_frames(true, counts_of_frames, steady); !ok) return ok;
  Samples clear;
  if (auto ok = split_frames(false, {27, 54, 108, 216}, clear); !ok) return ok;
  row.keys = {{"relaxation_max_error_k_by_splits", std::move(by_count)},
              {"frames_steady_sky_max_error_k", steady.max()},
              {"frames_steady_sky_p99_error_k", steady.percentile(0.99)},
              {"frames_sun_max_error_k", clear.max()},
              {"frames_sun_p99_error_k", clear.percentile(0.99)}};
  for (const double error_k : steady.values()) row.errors_k.add(error_k);
  row.note =
      "27 recorded histories with their intervals cut 1 to 1000 times, and whole frames under a "
      "steady sky with 4 to 4000 steps (cached: 400); frames_sun_*: 27 against 54 to 216 steps in "
      "the sun, where "
      "more steps also sample sun and shade more finely";
  rows_.push_back(std::move(row));
  return {};
}

Result<void> ThermalTruth::moved_camera() {
  const auto scenario = parking_lot();
  if (!scenario) return tl::unexpected(scenario.error());
  auto still = open_renderer(*scenario, command_.gpu_index);
  if (!still) return tl::unexpected(std::move(still.error()));
  std::vector<StoredFrame> seen;
  for (int i = 0; i < 4; ++i) {
    auto frame = tick(render_next(**still, camera(), kShownNs + i * 20 * kSecondNs));
    if (!frame) return tl::unexpected(std::move(frame.error()));
    seen.push_back(std::move(*frame));
  }
  still->reset();
  auto turning = open_renderer(*scenario, command_.gpu_index);
  if (!turning) return tl::unexpected(std::move(turning.error()));
  Row row{.test = "moved-camera", .errors_k = {}, .keys = {}, .note = {}};
  const std::array<physics::Pose, 4> poses{
      camera(), looking_at({4.0, -12.0, 9.0}, {40.0, -60.0, 30.0}),
      looking_at({-30.0, 20.0, 2.0}, {-60.0, 20.0, 2.0}), camera()};
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto frame = tick(
        render_next(**turning, poses[i], kShownNs + static_cast<std::int64_t>(i) * 20 * kSecondNs));
    if (!frame) return tl::unexpected(frame.error());
    if (i + 1 == poses.size()) compare(*frame, seen.back(), row.errors_k);
  }
  row.note =
      "the last of four frames, 20 s apart: camera turned away and moved in between, against "
      "a camera that stood still";
  rows_.push_back(std::move(row));
  return {};
}

/// Returns true when a ray from `p` along `d` meets the vehicle's box moved by `shift_m` east.
bool meets_box(const glm::dvec3& p, const glm::dvec3& d, double shift_m) {
  double near = 0.0;
  double far = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    const double shift = axis == 0 ? shift_m : 0.0;
    const double a = (kBoxLowM[axis] + shift - p[axis]) / d[axis];
    const double b = (kBoxHighM[axis] + shift - p[axis]) / d[axis];
    near = std::max(near, std::min(a, b));
    far = std::min(far, std::max(a, b));
  }
  return near < far;
}

/// Visible share of the sun's disc at every point and interval, by rays in double.
class BoxShade {
 public:
  BoxShade(const scene::ScenarioDesc& scenario, const PointHistory& history) {
    const double tan_disc = std::tan(physics::kSunSemiAngleRad);
    for (std::size_t i = 0; i < history.intervals(); ++i) {
      const std::int64_t t = history.middle_ns(i);
      const glm::dvec3 sun = direction_to_sun(scenario, t);
      const glm::dvec3 u = glm::normalize(glm::cross(sun, glm::dvec3(0.0, 0.0, 1.0)));
      const glm::dvec3 v = glm::cross(u, sun);
      Instant instant;
      instant.shift_m =
          kDriveM *
          std::clamp(static_cast<double>(t - kLeavesNs) / (kAwayNs - kLeavesNs), 0.0, 1.0);
      for (int k = 0; k < kDiscRays; ++k) {
        const double r = tan_disc * std::sqrt((k + 0.5) / kDiscRays);
        const double angle_rad = 2.399963229728653 * k;
        instant.rays[static_cast<std::size_t>(k)] =
            glm::normalize(sun + r * (std::cos(angle_rad) * u + std::sin(angle_rad) * v));
      }
      instants_.push_back(instant);
    }
  }

  [[nodiscard]] double sun_frac(const glm::dvec3& p, std::size_t interval) const {
    const Instant& instant = instants_[interval];
    int open = 0;
    for (const glm::dvec3& ray : instant.rays) open += meets_box(p, ray, instant.shift_m) ? 0 : 1;
    return static_cast<double>(open) / kDiscRays;
  }

 private:
  struct Instant {
    double shift_m = 0.0;
    std::array<glm::dvec3, kDiscRays> rays;
  };
  std::vector<Instant> instants_;
};

Result<void> ThermalTruth::parked_and_left() {
  const auto scenario = parking_lot();
  if (!scenario) return tl::unexpected(scenario.error());
  const auto frame = tick(render_once(*scenario, camera(), kShownNs, command_.gpu_index));
  if (!frame) return tl::unexpected(frame.error());
  if (auto ok = picture(*frame, "parked-and-left"); !ok) return ok;

  const PointHistory history(*scenario, kShownNs, kTrueSteps);
  const BoxShade shade(*scenario, history);
  Row row{.test = "parked-and-left", .errors_k = {}, .keys = {}, .note = {}};
  Samples sunlit;
  Samples core;
  Samples edge;
  double deepest_k = 0.0;
  const double never_shaded_k = history.temperature_k(scenario->materials[0], {0.0, 0.0, 1.0},
                                                      [](std::size_t) { return 1.0; });
  constexpr std::size_t kStride = 3;
  const std::size_t width = frame->width_px;
  std::vector<double> fractions(history.intervals());
  for (std::size_t i = 0; i < frame->temperature_k.size(); ++i) {
    // Only every third pixel of the ground counts, in both directions.
    if (frame->object_id[i] != 1.0F || (i % width) % kStride != 0 || (i / width) % kStride != 0) {
      continue;
    }
    const glm::dvec3 p = point_of_pixel(scenario->sensor, camera(), i, frame->depth_m[i]);
    for (std::size_t k = 0; k < fractions.size(); ++k) fractions[k] = shade.sun_frac(p, k);
    const double truth_k = history.temperature_k(scenario->materials[0], {0.0, 0.0, 1.0},
                                                 [&](std::size_t k) { return fractions[k]; });
    const double error_k = std::abs(frame->temperature_k[i] - truth_k);
    row.errors_k.add(error_k);
    deepest_k = std::max(deepest_k, never_shaded_k - truth_k);
    // The place was shaded all the time until the vehicle left, never, or part of the time.
    const auto parked =
        static_cast<std::size_t>(static_cast<double>(fractions.size()) *
                                 static_cast<double>(kLeavesNs) / static_cast<double>(kShownNs));
    const auto [least, most] = std::minmax_element(
        fractions.begin(), fractions.begin() + static_cast<std::ptrdiff_t>(parked));
    (*most == 0.0 ? core : *least == 1.0 ? sunlit : edge).add(error_k);
  }
  if (core.empty() || sunlit.empty() || edge.empty()) {
    return make_error(ErrorCode::internal, "the print is not in the picture");
  }
  row.keys = {
      {"core_max_error_k", core.max()},          {"sunlit_max_error_k", sunlit.max()},
      {"swept_max_error_k", edge.max()},         {"swept_p99_error_k", edge.percentile(0.99)},
      {"pixels_compared", row.errors_k.count()}, {"print_depth_k", deepest_k}};
  row.note = fmt::format(
      "ground two minutes after a vehicle drove off that had stood for three hours, {} uniform "
      "steps, against {} steps of 5 s in double with {} rays over the sun's disc; swept: what its "
      "shadow moved over",
      command_.steps, kTrueSteps, kDiscRays);
  rows_.push_back(std::move(row));
  return {};
}

/// Runs one renderer from before the vehicle left. Its samples follow the parked vehicle's shade,
/// while the sun moves on.
Result<void> ThermalTruth::fading_print() {
  const auto scenario = parking_lot();
  if (!scenario) return tl::unexpected(scenario.error());
  auto truth = ConvergedHistory::create(*scenario);
  if (!truth) return tl::unexpected(std::move(truth.error()));
  ConvergedOptions options;
  options.pixels = 5'000;
  options.progress = [](double) { return !InterruptGuard::interrupted(); };
  auto running = open_renderer(*scenario, command_.gpu_index);
  if (!running) return tl::unexpected(std::move(running.error()));
  auto before = render_next(**running, camera(), kLeavesNs - 60 * kSecondNs);
  if (!before) return tl::unexpected(std::move(before.error()));
  std::int64_t shown_s = 0;
  for (const std::int64_t left_s : kPrintAges) {
    // Samples are carried on from frame to frame, a few minutes at most.
    while (shown_s + kLongestStepS < left_s) {
      shown_s += kLongestStepS;
      const auto passed = render_next(**running, camera(), kLeavesNs + shown_s * kSecondNs);
      if (!passed) return tl::unexpected(passed.error());
    }
    shown_s = left_s;
    const std::int64_t now_ns = kLeavesNs + left_s * kSecondNs;
    const auto frame = tick(render_next(**running, camera(), now_ns));
    if (!frame) return tl::unexpected(frame.error());
    if (auto ok = picture(*frame, fmt::format("print-{}-s", left_s)); !ok) return ok;
    const auto pixels = truth->picture(
        {now_ns, camera(), frame->width_px, command_.height_px, scenario->sensor.fov_h_rad},
        options);
    if (!pixels) return tl::unexpected(pixels.error());
    Row row{.test = "parked-and-left", .errors_k = {}, .keys = {}, .note = {}};
    for (const ConvergedPixel& pixel : *pixels) {
      if (pixel.outline) continue;
      const double error_k = std::abs(static_cast<double>(frame->temperature_k[pixel.pixel]) -
                                      static_cast<double>(pixel.temperature_k));
      row.errors_k.add(std::isfinite(error_k) ? error_k : std::numeric_limits<double>::infinity());
    }
    row.keys = {{"left_s", left_s}, {"pixels_compared", row.errors_k.count()}};
    row.note = fmt::format(
        "where a vehicle has stood for three hours, {} s after it drove off, one renderer running "
        "since a minute before, against {}",
        left_s, truth->describe(options));
    rows_.push_back(std::move(row));
  }
  return {};
}

Result<void> ThermalTruth::restart() {
  const auto scenario = parking_lot();
  if (!scenario) return tl::unexpected(scenario.error());
  auto running = open_renderer(*scenario, command_.gpu_index);
  if (!running) return tl::unexpected(std::move(running.error()));
  std::optional<StoredFrame> last;
  for (int i = 0; i < 6; ++i) {
    auto frame = tick(render_next(**running, camera(), kShownNs - (5 - i) * 40 * kSecondNs));
    if (!frame) return tl::unexpected(std::move(frame.error()));
    last = std::move(*frame);
  }
  running->reset();
  const auto fresh = tick(render_once(*scenario, camera(), kShownNs, command_.gpu_index));
  if (!fresh) return tl::unexpected(fresh.error());
  Row row{.test = "restart", .errors_k = {}, .keys = {}, .note = {}};
  compare(*fresh, *last, row.errors_k);
  row.note =
      "a fresh renderer against one that ran for 200 s up to the same instant, past the "
      "vehicle's departure";
  rows_.push_back(std::move(row));
  return {};
}

int ThermalTruth::write() {
  TextTable table({"test", "max K", "p99 K", "pixels"});
  Json results = Json::array();
  for (Row& row : rows_) {
    table.add({row.test, fmt::format("{:.4g}", row.errors_k.max()),
               fmt::format("{:.4g}", row.errors_k.percentile(0.99)),
               fmt::format("{}", row.errors_k.count())});
    Json json = Json::object();
    json.set("test", row.test).set("max_error_k", row.errors_k.max());
    json.set("p99_error_k", row.errors_k.percentile(0.99));
    json.set("method", command_.method).set("steps", command_.steps);
    for (auto& [key, value] : row.keys) json.set(key, std::move(value));
    json.set("note", row.note);
    results.push(std::move(json));
  }
  if (command_.json != std::filesystem::path("-")) {
    fmt::print("{}, commit {}, method {}\n{}", device_, kCommit, command_.method,
               table.to_string());
  }
  if (!command_.json) return kExitOk;
  Json json = Json::object();
  json.set("device", device_).set("commit", kCommit).set("suite", "thermal-truth");
  json.set("results", std::move(results));
  if (auto written = write_json(*command_.json, json); !written) return fail(written.error());
  return kExitOk;
}

int run(const ThermalTruthOptions& command) {
  return ThermalTruth(command).run();
}

void add_options(CommandLine& line, ThermalTruthOptions& options) {
  line.option("--method", options.method, "thermal.method to judge")
      .one_of({"per-frame", "cached"})
      .show_default();
  line.option("--steps", options.steps, "History steps").in_range(1U, 4096U).show_default();
  add_image_size(line, options.width_px, options.height_px);
  line.output_folder("--pictures", options.pictures, "Existing folder for the judged frames as PNG",
                     CommandLine::OutputFolder::exists);
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_bench_thermal_truth(CommandLine& bench) {
  bench.command<ThermalTruthOptions>(
      {.name = "thermal-truth",
       .text =
           "Split steps, a moved camera, a parked vehicle's print and a restart: what the thermal "
           "history must not depend on, and what it must show",
       .example = "emit bench thermal-truth --json truth.json"},
      add_options, run);
}

}  // namespace emit::tool
