// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "bench/accuracy/accuracy_benches.hpp"
#include "bench/stability/bench_stability_scene.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/planck.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {
namespace {

struct SubpixelOptions {
  std::optional<std::filesystem::path> json;
  std::uint32_t phases = 1000;
  std::uint32_t pairs = 60;
  std::uint32_t seed = 20140621;
  int gpu_index = -1;
};

using physics::Result;

/// A black box of this size and temperature, seen from above in front of black ground without air.
/// Its image has the energy that its faces' solid angles give, wherever it stands and however it is
/// turned.
const glm::dvec3 kBoxM{0.4, 0.2, 0.15};
constexpr double kBoxK = 340.0;
constexpr double kGroundK = 290.0;
constexpr std::uint32_t kEntity = 1;
constexpr double kFovRad = 2.0 * physics::kDegree;
constexpr std::uint32_t kWidthPx = 128;
constexpr std::uint32_t kHeightPx = 96;
constexpr double kEyeUpM = 32'000.0;
constexpr double kGroundHalfM = 6'000.0;
/// Size of the image in which the cost of a target is measured.
constexpr std::uint32_t kCostWidthPx = 640;
constexpr std::uint32_t kCostHeightPx = 512;

/// Length of the box's longest edge, seen broadside, in pixels.
constexpr std::array<double, 11> kSizesPx{0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5.6, 8.0, 16.0, 32.0};
/// The box closes in from the first size, by this share of its range a frame, and drifts.
constexpr double kClosingFrac = 0.01;
constexpr glm::dvec2 kDriftPx{0.037, 0.023};
constexpr std::uint32_t kApproaches = 4;
/// Other quality levels, and the sampling at pixel centres, get this share of the phases.
constexpr std::uint32_t kFewerPhases = 10;
/// An image with less than this share of its energy is absent.
constexpr double kAbsentFrac = 0.1;
constexpr std::uint8_t kLevels = 12;

/// One line of the result.
struct Row {
  double size_px = 0.0;
  std::string method;
  std::uint32_t quality_level = 0;
  std::uint32_t frames = 0;
  double sum_square = 0.0;
  std::uint32_t absent = 0;
  double step_frac = 0.0;
  std::optional<double> cost_frac;  ///< what one target adds to the time of a frame

  [[nodiscard]] double rms_frac() const { return std::sqrt(sum_square / frames); }
  [[nodiscard]] double absent_frac() const { return static_cast<double>(absent) / frames; }
};

double radiance_w_m2_sr(double kelvin) {
  return physics::band_radiance({8.0, 12.0, {}}, physics::Kelvin(kelvin)).radiance_w_m2_sr;
}

/// A pose of the box: offset from the middle of the image, range and attitude.
struct Stand {
  glm::dvec2 offset_px{0.0};
  double range_m = 0.0;
  glm::dquat turn{1.0, 0.0, 0.0, 0.0};
};

/// Solid angle of a triangle seen from the origin (Van Oosterom and Strackee 1983). The edges are
/// taken first, because distant corners have almost one direction.
double solid_angle_sr(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const double triple = glm::dot(a, glm::cross(b - a, c - a));
  const double la = glm::length(a);
  const double lb = glm::length(b);
  const double lc = glm::length(c);
  const double below =
      la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb;
  return 2.0 * std::atan2(std::abs(triple), below);
}

/// A world with the box, and the renderer that shows it.
class BoxWorld {
 public:
  static Result<std::unique_ptr<BoxWorld>> create(bool windows, std::uint32_t width_px,
                                                  std::uint32_t height_px, int gpu_index) {
    std::unique_ptr<BoxWorld> world(new BoxWorld(windows, width_px, height_px));
    if (auto ok = world->start(gpu_index); !ok) return tl::unexpected(std::move(ok.error()));
    return world;
  }

  /// Range at which the box's longest edge, seen broadside, is `size_px` long.
  [[nodiscard]] double range_m(double size_px) const { return kBoxM.x / (size_px * pixel_rad_); }
  [[nodiscard]] const std::string& device() const { return renderer_->device_name(); }

  /// Energy of the box above the ground in a frame, divided by what its faces send.
  Result<double> energy_frac(const Stand& stand, std::uint8_t level) {
    place(stand, true);
    auto sum = sum_over_ground(level);
    if (!sum) return sum;
    const double more = radiance_w_m2_sr(kBoxK) - radiance_w_m2_sr(kGroundK);
    return *sum / (more * box_sr(stand));
  }
  /// Time of a frame with the box or without it.
  Result<double> frame_ms(const Stand& stand, bool on) {
    place(stand, on);
    const auto begin = std::chrono::steady_clock::now();
    auto sum = show(0, [](const renderer::FrameView&) { return 0.0; });
    if (!sum) return sum;
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
    return took.count();
  }

 private:
  BoxWorld(bool windows, std::uint32_t width_px, std::uint32_t height_px)
      : scenario_(plain_scenario(width_px, height_px)),
        pixel_rad_(2.0 * std::tan(0.5 * kFovRad) / kWidthPx),
        eye_({0.0, 0.0, kEyeUpM},
             physics::world_from_body_heading_pitch_roll(0.0, -0.5 * physics::kPi, 0.0)) {
    scenario_.bands.resize(1);
    // A pixel is as wide in every image, so that the box has the same size at the same range.
    scenario_.sensor.fov_h_rad = 2.0 * std::atan(0.5 * width_px * pixel_rad_);
    if (!windows) scenario_.sensor.small_target_px = 0.0;
    scenario_.thermal.method = scene::ThermalMethod::cached;
    scene::Material& ground = scenario_.materials.front();
    ground.emissivity_frac = 1.0;
    ground.prescribed_k = kGroundK;
    scene::Material box = ground;
    box.name = "box";
    box.prescribed_k = kBoxK;
    scenario_.materials.push_back(box);
  }

  Result<void> start(int gpu_index) {
    FlatPart box;
    box.name = box.material = "box";
    const glm::dvec3 l = -0.5 * kBoxM;
    const glm::dvec3 h = 0.5 * kBoxM;
    for (const FlatPart& face : box_parts(l, h)) {
      box.faces.insert(box.faces.end(), face.faces.begin(), face.faces.end());
    }
    box.faces.push_back({{glm::dvec3(l.x, h.y, l.z), glm::dvec3(h.x, h.y, l.z),
                          glm::dvec3(h.x, l.y, l.z), glm::dvec3(l.x, l.y, l.z)}});
    faces_ = box.faces;
    const std::array<FlatPart, 2> parts{
        level_part("ground", glm::dvec3(0.0), kGroundHalfM, kGroundHalfM), box};
    if (auto placed = place_parts(parts, folder_.path(), scenario_); !placed) return placed;
    scenario_.objects.back().entity_id = kEntity;
    renderer::OutputOptions output;
    output.ladder = renderer::Ladder::replayed;
    output.slots = 2;
    auto made = renderer::Renderer::create(scenario_, {gpu_index, false}, output);
    if (!made) return tl::unexpected(std::move(made.error()));
    renderer_ = std::move(*made);
    place({{0.0, 0.0}, 0.5 * kEyeUpM}, false);
    if (auto ready = renderer_->warm_up(request(0)); !ready) return ready;
    // Keep the ground alone, whose radiance is the same at every level.
    auto shown = show(0, [this](const renderer::FrameView& view) {
      ground_.assign(view.radiance_w_m2_sr[0].begin(), view.radiance_w_m2_sr[0].end());
      return 0.0;
    });
    return shown ? Result<void>() : tl::unexpected(std::move(shown.error()));
  }

  /// Moves the box, or takes it out of the scene.
  void place(const Stand& stand, bool on) {
    time_ns_ += kFrameNs;
    const glm::dvec3 ray(stand.offset_px * pixel_rad_, 1.0);
    centre_m_ = glm::mat3_cast(eye_.world_from_body) *
                (glm::transpose(physics::sensor_from_body()) * (ray * stand.range_m));
    const renderer::EntityUpdate update{
        kEntity, {eye_.position_world_m + centre_m_, stand.turn}, on, true};
    renderer_->reset();
    (void)renderer_->apply_entities(time_ns_, {&update, 1});
  }

  [[nodiscard]] renderer::FrameRequest request(std::uint8_t level) const {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = time_ns_;
    request.sensor_pose = eye_;
    request.quality_level = level;
    return request;
  }

  /// Shows a frame and returns what `read` finds in it.
  template <class Read>
  Result<double> show(std::uint8_t level, const Read& read) {
    const int slot = renderer_->submit(request(level));
    if (slot < 0) {
      return physics::make_error(physics::ErrorCode::internal, "the renderer has no free slot");
    }
    const auto& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot));
    const double result = read(view);
    const bool failed = view.device_failed;
    renderer_->release(static_cast<renderer::SlotIndex>(slot));
    if (failed) return physics::make_error(physics::ErrorCode::gpu, "the device reported an error");
    return result;
  }

  /// Radiance above the ground times the solid angle of each pixel.
  Result<double> sum_over_ground(std::uint8_t level) {
    return show(level, [this](const renderer::FrameView& view) {
      const glm::dvec2 half(0.5 * view.width_px, 0.5 * view.height_px);
      double sum = 0.0;
      for (std::size_t i = 0; i < ground_.size(); ++i) {
        const float more = view.radiance_w_m2_sr[0][i] - ground_[i];
        if (more == 0.0F) continue;
        const glm::dvec2 at(static_cast<double>(i % view.width_px) + 0.5,
                            static_cast<double>(i / view.width_px) + 0.5);
        const glm::dvec2 ray = pixel_rad_ * (at - half);
        sum += static_cast<double>(more) * pixel_rad_ * pixel_rad_ /
               std::pow(1.0 + glm::dot(ray, ray), 1.5);
      }
      return sum;
    });
  }

  /// Solid angle of the box, which is convex: that of the faces that face the camera.
  [[nodiscard]] double box_sr(const Stand& stand) const {
    const glm::dmat3 world_from_file =
        glm::mat3_cast(stand.turn) *
        glm::transpose(glm::mat3_cast(physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0)));
    double sum_sr = 0.0;
    for (const FlatFace& face : faces_) {
      std::array<glm::dvec3, 4> p;
      for (std::size_t k = 0; k < p.size(); ++k)
        p[k] = centre_m_ + world_from_file * face.corners[k];
      if (glm::dot(glm::cross(p[1] - p[0], p[2] - p[0]), p[0]) >= 0.0) continue;
      sum_sr += solid_angle_sr(p[0], p[1], p[2]) + solid_angle_sr(p[0], p[2], p[3]);
    }
    return sum_sr;
  }

  static constexpr std::int64_t kFrameNs = 1'000'000;

  TemporaryFolder folder_;
  scene::ScenarioDesc scenario_;
  double pixel_rad_;
  physics::Pose eye_;
  std::vector<FlatFace> faces_;
  std::unique_ptr<renderer::Renderer> renderer_;
  std::vector<float> ground_;
  std::int64_t time_ns_ = 0;
  glm::dvec3 centre_m_{0.0};
};

/// Random stands of the box.
class Stands {
 public:
  explicit Stands(std::uint32_t seed) : random_(seed) {}
  /// A stand near the middle of the image, at any phase and in any attitude.
  Stand next(double range_m) {
    std::uniform_real_distribution<double> place(-8.0, 8.0);
    std::normal_distribution<double> normal;
    Stand stand;
    stand.offset_px = {place(random_), place(random_)};
    stand.range_m = range_m;
    stand.turn = glm::normalize(
        glm::dquat(normal(random_), normal(random_), normal(random_), normal(random_)));
    return stand;
  }

 private:
  std::mt19937 random_;
};

class SubpixelBench {
 public:
  explicit SubpixelBench(const SubpixelOptions& command)
      : command_(command), progress_("bench subpixel", 2 + 1 + kLevels) {}

  Result<void> run() {
    for (const bool windows : {true, false}) {
      auto world = BoxWorld::create(windows, kWidthPx, kHeightPx, command_.gpu_index);
      if (!world) return tl::unexpected(std::move(world.error()));
      device_ = (*world)->device();
      progress_.advance_to(++done_);
      for (std::uint8_t level = 0; level < (windows ? kLevels : 1); ++level) {
        if (auto ok = judge(**world, windows ? "window" : "centre", level); !ok) return ok;
        progress_.advance_to(++done_);
      }
    }
    return measure_cost();
  }

  int write() {
    progress_.finish();
    TextTable table(
        {"size px", "method", "level", "frames", "RMS %", "absent %", "step %", "cost %"});
    Json results = Json::array();
    for (const Row& row : rows_) {
      table.add({fmt::format("{:g}", row.size_px), row.method, fmt::format("{}", row.quality_level),
                 fmt::format("{}", row.frames), fmt::format("{:.3f}", 100.0 * row.rms_frac()),
                 fmt::format("{:.1f}", 100.0 * row.absent_frac()),
                 fmt::format("{:.3f}", 100.0 * row.step_frac),
                 row.cost_frac ? fmt::format("{:.1f}", 100.0 * *row.cost_frac) : "-"});
      Json json = Json::object();
      json.set("size_px", row.size_px).set("method", row.method);
      json.set("quality_level", row.quality_level).set("rms_energy_error_frac", row.rms_frac());
      json.set("absent_frac", row.absent_frac()).set("step_frac", row.step_frac);
      json.set("frames", row.frames);
      json.set("cost_frac", row.cost_frac ? Json(*row.cost_frac) : Json(nullptr));
      results.push(std::move(json));
    }
    fmt::print(text_stream(command_.json), "{}, commit {}, seed {}\n{}", device_, kCommit,
               command_.seed, table.to_string());
    if (!command_.json) return kExitOk;
    Json json = Json::object();
    json.set("device", device_).set("commit", kCommit).set("suite", "subpixel");
    json.set("seed", command_.seed).set("frame_ms_without", alone_ms_);
    json.set("results", std::move(results));
    if (auto written = write_json(*command_.json, json); !written) return fail(written.error());
    return kExitOk;
  }

 private:
  /// Measures random stands, then the steps of a box that closes in.
  Result<void> judge(BoxWorld& world, const char* method, std::uint8_t level) {
    const bool whole = level == 0 && std::string_view(method) == "window";
    Stands stands(command_.seed + level);
    const std::size_t first = rows_.size();
    for (const double size_px : kSizesPx) {
      Row row;
      row.size_px = size_px;
      row.method = method;
      row.quality_level = level;
      row.frames = std::max(1U, whole ? command_.phases : command_.phases / kFewerPhases);
      for (std::uint32_t i = 0; i < row.frames; ++i) {
        const auto frac = world.energy_frac(stands.next(world.range_m(size_px)), level);
        if (!frac) return tl::unexpected(frac.error());
        row.sum_square += (*frac - 1.0) * (*frac - 1.0);
        row.absent += *frac < kAbsentFrac ? 1U : 0U;
        if (InterruptGuard::interrupted()) {
          return physics::make_error(physics::ErrorCode::internal, "interrupted");
        }
      }
      rows_.push_back(row);
    }
    for (std::uint32_t i = 0; i < (whole ? kApproaches : 1); ++i) {
      if (auto ok = approach(world, stands.next(0.0), level, first); !ok) return ok;
    }
    return {};
  }

  /// Lets the box close in, and files the change of its energy from frame to frame under the next
  /// size.
  Result<void> approach(BoxWorld& world, Stand stand, std::uint8_t level, std::size_t first_row) {
    std::optional<double> last;
    std::size_t size = 0;
    const double end_m = world.range_m(std::sqrt(2.0) * kSizesPx.back());
    for (stand.range_m = world.range_m(kSizesPx.front()); stand.range_m > end_m;
         stand.range_m *= 1.0 - kClosingFrac) {
      stand.offset_px += kDriftPx;
      if (stand.offset_px.x > 8.0) stand.offset_px.x -= 16.0;
      if (stand.offset_px.y > 8.0) stand.offset_px.y -= 16.0;
      const auto frac = world.energy_frac(stand, level);
      if (!frac) return tl::unexpected(frac.error());
      while (size + 1 < kSizesPx.size() &&
             stand.range_m < world.range_m(std::sqrt(kSizesPx[size] * kSizesPx[size + 1]))) {
        ++size;
      }
      double& step_frac = rows_[first_row + size].step_frac;
      if (last) step_frac = std::max(step_frac, std::abs(*frac - *last));
      last = *frac;
    }
    return {};
  }

  /// Measures what one box adds to the time of a frame, by frames with and without it in turn.
  Result<void> measure_cost() {
    auto world = BoxWorld::create(true, kCostWidthPx, kCostHeightPx, command_.gpu_index);
    if (!world) return tl::unexpected(std::move(world.error()));
    Stands stands(command_.seed);
    Samples alone_ms;
    for (std::size_t i = 0; i < kSizesPx.size(); ++i) {
      Samples ratios;
      for (std::uint32_t pair = 0; pair < command_.pairs; ++pair) {
        const Stand stand = stands.next((*world)->range_m(kSizesPx[i]));
        const auto without = (*world)->frame_ms(stand, false);
        if (!without) return tl::unexpected(without.error());
        const auto with = (*world)->frame_ms(stand, true);
        if (!with) return tl::unexpected(with.error());
        alone_ms.add(*without);
        ratios.add(*with / *without);
      }
      rows_[i].cost_frac = ratios.median() - 1.0;
    }
    alone_ms_ = alone_ms.median();
    return {};
  }

  const SubpixelOptions& command_;
  Progress progress_;
  std::uint64_t done_ = 0;
  std::string device_;
  std::vector<Row> rows_;
  double alone_ms_ = 0.0;
};

int run(const SubpixelOptions& command) {
  const InterruptGuard interrupt;
  SubpixelBench bench(command);
  if (auto done = bench.run(); !done) return fail(done.error());
  return bench.write();
}

void add_options(CommandLine& line, SubpixelOptions& options) {
  line.option("--phases", options.phases,
              "Places and attitudes of each size at full quality; a tenth at other levels")
      .in_range(1U, 1'000'000U)
      .show_default();
  line.option("--pairs", options.pairs, "Frames with and without a target, for its cost")
      .in_range(15U, 100'000U)
      .show_default();
  line.option("--seed", options.seed, "Draws other cases").type_name("N").show_default();
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_bench_subpixel(CommandLine& bench) {
  bench.command<SubpixelOptions>({.name = "subpixel",
                                  .text = "Energy of small and distant targets against the solid "
                                          "angle of their faces, while they drift, turn and close "
                                          "in, at every quality level; and what one costs",
                                  .example = "emit bench subpixel --json subpixel.json"},
                                 add_options, run);
}

}  // namespace emit::tool
