// SPDX-License-Identifier: Apache-2.0
#include "tool/scenes/preview_sheet.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>

#include "emit/image/false_color.hpp"
#include "emit/physics/constants.hpp"
#include "emit/scene/mesh.hpp"
#include "tool/offline/offline_frames.hpp"
#include "tool/support/frame_files.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// A view of the sheet: the direction from the scene to the camera.
struct SheetView {
  const char* name;
  double azimuth_deg;  ///< clockwise from north
  double elevation_deg;
};
constexpr std::array<SheetView, 4> kViews{{{"FRONT LEFT", -35.0, 20.0},
                                           {"REAR RIGHT", 145.0, 20.0},
                                           {"SIDE", 90.0, 6.0},
                                           {"ABOVE", 180.0, 70.0}}};

constexpr std::uint32_t kHeadPx = 24;  ///< text above the columns
constexpr std::uint32_t kGapPx = 4;    ///< between pictures
constexpr image::Rgb kWhite{235, 235, 235};

/// Box around what the sheet shows.
Result<scene::Aabb> box_of(const scene::ScenarioDesc& scenario, const std::string& focus) {
  const auto geometry = scene::load_scene(scenario);
  if (!geometry) return tl::unexpected(geometry.error());
  scene::Aabb all;
  scene::Aabb raised;
  std::vector<std::string> names;
  for (std::uint32_t i = 0; i < scenario.objects.size(); ++i) {
    scene::Aabb object;
    for (const scene::Instance& instance : geometry->instances) {
      if (instance.object == i) object.add(instance.world_bounds);
    }
    if (object.empty()) continue;
    names.push_back(scenario.objects[i].name);
    if (scenario.objects[i].name == focus) return object;
    all.add(object);
    // Ground is wide and flat; what stands on it is what one wants to see.
    constexpr double kFlatFrac = 0.05;
    const glm::dvec3 size_m = object.max_m - object.min_m;
    if (size_m.z > kFlatFrac * std::max(size_m.x, size_m.y)) raised.add(object);
  }
  if (!focus.empty()) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("--focus: no object is named '{}'; the scenario has {}", focus,
                                  fmt::join(names, ", ")));
  }
  if (all.empty()) return make_error(ErrorCode::config, "the scenario has no geometry");
  return raised.empty() ? all : raised;
}

/// Camera that has the box in its picture.
physics::Pose camera_of(const SheetView& view, const scene::Aabb& box,
                        const scene::SensorDesc& sensor) {
  const glm::dvec3 middle_m = 0.5 * (box.min_m + box.max_m);
  const double radius_m = 0.5 * glm::distance(box.min_m, box.max_m);
  const double half_h_rad = 0.5 * sensor.fov_h_rad;
  const double half_v_rad = std::atan(std::tan(half_h_rad) * sensor.height_px / sensor.width_px);
  const double away_m = radius_m / std::sin(std::min(half_h_rad, half_v_rad));
  const double azimuth = view.azimuth_deg * physics::kDegree;
  const double elevation = view.elevation_deg * physics::kDegree;
  physics::Pose pose;
  pose.position_world_m =
      middle_m + away_m * glm::dvec3(std::sin(azimuth) * std::cos(elevation),
                                     std::cos(azimuth) * std::cos(elevation), std::sin(elevation));
  pose.world_from_body = physics::world_from_body_look_at(pose.position_world_m, middle_m);
  return pose;
}

/// Text in the letters that the built-in font has.
std::string capitals(const std::string& text) {
  std::string out;
  for (const char c : text) {
    out += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  }
  return out;
}

/// Copies a picture into the sheet.
void paste(const image::RgbImage& picture, std::uint32_t x_px, std::uint32_t y_px,
           image::RgbImage& sheet) {
  for (std::uint32_t y = 0; y < picture.height_px; ++y) {
    const auto* from = picture.rgb.data() + std::size_t{3} * y * picture.width_px;
    auto* to = sheet.rgb.data() + 3 * (std::size_t{y_px + y} * sheet.width_px + x_px);
    std::copy(from, from + std::size_t{3} * picture.width_px, to);
  }
}

/// Apparent temperatures of one picture, K.
struct SheetPicture {
  std::size_t view = 0;
  std::size_t time = 0;
  std::size_t band = 0;  ///< place in the plan
  std::vector<float> kelvin;
};

/// Renders the views of one time, with a warm-up of its own: to carry a large surface on from
/// morning to night would take longer.
Result<void> render_time(const scene::ScenarioDesc& scenario, const PreviewPlan& plan,
                         const scene::Aabb& box, std::size_t time,
                         std::span<const ApparentTemperature> tables,
                         std::vector<SheetPicture>& pictures) {
  std::vector<OfflineShot> shots;
  for (const SheetView& view : kViews) {
    OfflineShot shot;
    shot.sim_time_ns = std::llround(1e9 * plan.times_s[time]);
    shot.sensor_pose = camera_of(view, box, scenario.sensor);
    shot.jump = true;
    shots.push_back(shot);
  }
  renderer::OutputOptions output;
  output.slots = 2;
  auto frames = OfflineFrames::create(scenario, shots, output, plan.gpu_index);
  if (!frames) return tl::unexpected(std::move(frames.error()));
  for (std::size_t v = 0; v < shots.size(); ++v) {
    const auto view = (*frames)->next();
    if (!view) return tl::unexpected(view.error());
    for (std::size_t b = 0; b < plan.bands.size(); ++b) {
      pictures.push_back({v, time, b, tables[b].kelvin((*view)->radiance_w_m2_sr[plan.bands[b]])});
    }
  }
  return {};
}

Result<std::vector<SheetPicture>> render_pictures(const scene::ScenarioDesc& scenario,
                                                  const PreviewPlan& plan, const scene::Aabb& box) {
  std::vector<ApparentTemperature> tables;
  for (const std::size_t band : plan.bands) {
    tables.emplace_back(scene::spectral_band(scenario.bands[band]));
  }
  std::vector<SheetPicture> pictures;
  for (std::size_t time = 0; time < plan.times_s.size(); ++time) {
    auto rendered = render_time(scenario, plan, box, time, tables, pictures);
    if (!rendered) return tl::unexpected(std::move(rendered.error()));
  }
  return pictures;
}

}  // namespace

Result<void> write_preview_sheet(scene::ScenarioDesc scenario, const PreviewPlan& plan,
                                 const std::filesystem::path& file) {
  scenario.sensor.width_px = plan.width_px;
  scenario.sensor.height_px = plan.height_px;
  const auto box = box_of(scenario, plan.focus);
  if (!box) return tl::unexpected(box.error());
  const auto pictures = render_pictures(scenario, plan, *box);
  if (!pictures) return tl::unexpected(pictures.error());
  const std::size_t columns = plan.bands.size() * plan.times_s.size();
  image::RgbImage sheet;
  sheet.width_px = static_cast<std::uint32_t>(columns) * (plan.width_px + kGapPx);
  sheet.height_px = kHeadPx + static_cast<std::uint32_t>(kViews.size()) * (plan.height_px + kGapPx);
  sheet.rgb.assign(std::size_t{3} * sheet.width_px * sheet.height_px, 24);
  for (std::size_t b = 0; b < plan.bands.size(); ++b) {
    // Pictures of a band share their colours, so that hours can be compared.
    std::vector<float> values;
    for (const SheetPicture& picture : *pictures) {
      if (picture.band == b) {
        values.insert(values.end(), picture.kelvin.begin(), picture.kelvin.end());
      }
    }
    const auto range = image::percentile_range(values, 1.0, 99.5);
    image::FalseColorOptions colors;
    colors.min_value = range ? range->min_value : 280.0;
    colors.max_value = std::max(range ? range->max_value : 330.0, colors.min_value + 1.0);
    for (const SheetPicture& picture : *pictures) {
      if (picture.band != b) continue;
      const auto column = static_cast<std::uint32_t>(b * plan.times_s.size() + picture.time);
      const auto row = static_cast<std::uint32_t>(picture.view);
      auto drawn = image::false_color(picture.kelvin, plan.width_px, plan.height_px, colors);
      if (!drawn) return tl::unexpected(drawn.error());
      image::draw_text(*drawn, kViews[picture.view].name, 4, 4, kWhite);
      const std::uint32_t x_px = column * (plan.width_px + kGapPx);
      paste(*drawn, x_px, kHeadPx + row * (plan.height_px + kGapPx), sheet);
      if (row > 0) continue;
      const double hour_of_day =
          std::fmod(1e-9 * static_cast<double>(scenario.epoch_utc_ns) / 3600.0 +
                        plan.times_s[picture.time] / 3600.0,
                    24.0);
      const int minutes = static_cast<int>(std::lround(
                              60.0 * (hour_of_day < 0.0 ? hour_of_day + 24.0 : hour_of_day))) %
                          1440;
      image::draw_text(sheet,
                       capitals(fmt::format("{} um  {:02}:{:02} UTC  {:.0f}-{:.0f} K",
                                            scenario.bands[plan.bands[b]].name, minutes / 60,
                                            minutes % 60, colors.min_value, colors.max_value)),
                       static_cast<std::int32_t>(x_px) + 4, 6, kWhite);
    }
  }
  return image::write_png(file, sheet);
}

}  // namespace emit::tool
