// SPDX-License-Identifier: Apache-2.0
#include "bench/stability/bench_stability_frames.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "bench/stability/bench_stability_frame_tests.hpp"
#include "emit/image/false_color.hpp"

namespace emit::tool {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

const std::vector<HostileFrames::Entry>& HostileFrames::entries() {
  using H = HostileFrames;
  static const std::vector<Entry> kEntries{
      {"frame-sun-at-horizon", &H::low_sun, "elevation 1e-6 to 2 deg, clear sky; model in double"},
      {"frame-sun-at-horizon-800", &H::strong_low_sun,
       "the same with 800 W/m2 of direct sun, which no sky lets through: what ignoring the sun "
       "below 0.5 deg could cost; model in double"},
      {"frame-grazing-sun", &H::grazing_sun,
       "faces 1e-6 to 0.1 rad from edge-on to the sun; model in double"},
      {"frame-grazing-view", &H::grazing_view,
       "camera 0.1 mm to 10 mm above the ground, level; model in double"},
      {"frame-coincident-faces", &H::coincident_faces,
       "ground and box drawn three times, once inside out; the same scene drawn once"},
      {"frame-zero-area", &H::degenerate_triangles,
       "points, lines and slivers of 1e-9 m among the triangles; the same scene without them"},
      {"frame-100km-from-origin", &H::far_from_origin,
       "scene and camera placed 100 km and 1000 km away; the same scene at the origin"},
      {"frame-100km-vertices", &H::far_vertices,
       "100 km in the file's own float32 vertices (8 mm resolution there); at the origin"},
      {"frame-depth-range-1e6", &H::depth_range,
       "near plane 0.1 m, a wall at 100 km; model in double"},
      {"frame-depth-range-near-part", &H::depth_range_near_part,
       "ground and box of that scene; the same without the wall"},
      {"frame-object-scale", &H::object_scale,
       "vertices times 1e3 and 1e-3, objects scaled back; the same unscaled"},
      {"frame-world-scale", &H::world_scale,
       "the whole world 1e-2 and 1e3 times as large; the same unscaled"},
      {"frame-history-of-a-year", &H::long_history,
       "1, 27 and 365 steps since a year ago; model in double"},
      {"frame-history-of-a-nanosecond", &H::short_history,
       "history of 0 ns, 1 ns, 1 ms; model in double"},
      {"frame-most-steps", &H::many_steps, "as many steps as the renderer takes; model in double"},
      {"frame-extreme-materials", &H::extreme_materials,
       "conductivity, thickness, emissivity, time constants and temperatures at their limits; "
       "model in double"},
      {"frame-obscurance-radius", &H::obscurance_radius,
       "open ground, radius 1e-6 m to 1e6 m; sky factor 0.5 by the model in double"},
      {"frame-taps-and-maps", &H::taps_and_maps,
       "1 to 256 taps, maps of 16 to 4096 px; model in double"},
      {"frame-hostile-weather", &H::hostile_weather,
       "NaN, Inf, negative and huge forcing: must stay finite and be flagged"},
      {"frame-hostile-camera", &H::hostile_camera,
       "0.001 and 170 deg wide, inside the box, under the ground, straight down"}};
  return kEntries;
}

World HostileFrames::yard() const {
  World world;
  world.parts = {level_part("ground", {0.0, 0.0, 0.0}, 30.0, 30.0),
                 level_part("slab", {4.0, 2.0, 0.4}, 1.0, 1.0)};
  for (FlatPart& part : box_parts({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0})) {
    world.parts.push_back(std::move(part));
  }
  world.scenario = plain_scenario(options_.width_px, options_.height_px);
  world.scenario.thermal.obscurance_radius_m = kNoObscuranceM;
  world.camera = looking_at({-8.0, -10.0, 7.0}, {0.5, 0.0, 0.5});
  return world;
}

Result<void> HostileFrames::picture(const StoredFrame& frame, const std::string& name) const {
  if (options_.picture_dir.empty()) return {};
  const auto range = image::percentile_range(frame.temperature_k, 1.0, 99.0);
  image::FalseColorOptions colors;
  if (range) {
    colors.min_value = range->min_value - 0.5;
    colors.max_value = range->max_value + 0.5;
  }
  colors.color_bar = true;
  const auto height = static_cast<std::uint32_t>(frame.temperature_k.size() / frame.width_px);
  const auto pixels = image::false_color(frame.temperature_k, frame.width_px, height, colors);
  if (!pixels) return tl::unexpected(pixels.error());
  std::string file = fmt::format("{}_{}.png", test_, name);
  std::replace(file.begin(), file.end(), ' ', '_');
  return image::write_png(options_.picture_dir / file, *pixels);
}

Result<StoredFrame> HostileFrames::frame(World& world, const std::string& name,
                                         const std::function<void(renderer::Renderer&)>& prepare) {
  const TemporaryFolder folder;
  if (auto ok = place_parts(world.parts, folder.path(), world.scenario); !ok) {
    return tl::unexpected(std::move(ok.error()));
  }
  auto stored =
      render_once(world.scenario, world.camera, world.time_ns, options_.gpu_index, prepare);
  if (!stored) {
    return tl::unexpected(std::move(stored.error()).with_context(test_ + ", " + name));
  }
  judge_.count(*stored);
  if (auto ok = picture(*stored, name); !ok) return tl::unexpected(std::move(ok.error()));
  return stored;
}

Result<void> HostileFrames::judged_by_model(World& world, const std::string& name) {
  const auto stored = frame(world, name);
  if (!stored) return tl::unexpected(stored.error());
  judge_.against_model(*stored, world.scenario, world.parts, world.time_ns, name);
  return {};
}

Result<void> HostileFrames::judged_by(World& world, const std::string& name,
                                      const StoredFrame& harmless) {
  const auto stored = frame(world, name);
  if (!stored) return tl::unexpected(stored.error());
  judge_.against_frame(*stored, harmless, name);
  return {};
}

Result<HostileFrameResult> HostileFrames::run(const std::string& test) {
  for (const Entry& entry : entries()) {
    if (test != entry.test) continue;
    test_ = test;
    if (auto ok = (this->*entry.check)(); !ok) return tl::unexpected(std::move(ok.error()));
    std::string note = entry.note;
    if (!extra_note_.empty()) note += "; " + extra_note_;
    return judge_.result(test, std::move(note));
  }
  return make_error(ErrorCode::invalid_argument, fmt::format("no test '{}'", test));
}

std::vector<std::string> hostile_frame_tests() {
  std::vector<std::string> names;
  for (const auto& entry : HostileFrames::entries()) names.emplace_back(entry.test);
  return names;
}

Result<std::vector<HostileFrameResult>> run_hostile_frames(const HostileFrameOptions& options) {
  const std::vector<std::string> tests =
      options.only.empty() ? hostile_frame_tests() : options.only;
  std::vector<HostileFrameResult> results;
  for (const std::string& test : tests) {
    auto result = HostileFrames(options).run(test);
    if (!result) return tl::unexpected(std::move(result.error()));
    results.push_back(std::move(*result));
    if (options.progress && !options.progress(static_cast<double>(results.size()) /
                                              static_cast<double>(tests.size()))) {
      return make_error(ErrorCode::internal, "interrupted");
    }
  }
  return results;
}

}  // namespace emit::tool
