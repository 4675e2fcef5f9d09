// SPDX-License-Identifier: Apache-2.0
#include "bench/stability/bench_stability_scene.hpp"

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include "emit/physics/constants.hpp"
#include "emit/physics/relaxation.hpp"
#include "emit/physics/step_nodes.hpp"
#include "emit/physics/surface_balance.hpp"
#include "emit/physics/weather.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

Result<void> write_file(const std::filesystem::path& file, const void* data, std::size_t bytes) {
  std::ofstream out(file, std::ios::binary);
  out.write(static_cast<const char*>(data), static_cast<std::streamsize>(bytes));
  out.close();
  if (!out) return make_error(ErrorCode::io, fmt::format("cannot write '{}'", file.string()));
  return {};
}

Result<std::filesystem::path> write_part(const FlatPart& part, std::size_t number,
                                         const std::filesystem::path& folder) {
  std::vector<float> positions;
  for (const FlatFace& face : part.faces) {
    for (const std::size_t corner : {0U, 1U, 2U, 0U, 2U, 3U}) {
      // The part is level and heads north: glTF x is west, y is up, z is north.
      const glm::dvec3 p = (face.corners[corner] - part.placed_at_m) / part.scale;
      for (const double v : {-p.x, p.z, p.y}) positions.push_back(static_cast<float>(v));
    }
  }
  const std::size_t bytes = positions.size() * sizeof(float);
  const std::string name = fmt::format("part{}", number);
  if (auto ok = write_file(folder / (name + ".bin"), positions.data(), bytes); !ok) {
    return tl::unexpected(std::move(ok.error()));
  }
  const std::string json = fmt::format(
      R"({{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],)"
      R"("materials":[{{"name":"m"}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},)"
      R"("material":0}}]}}],"accessors":[{{"bufferView":0,"componentType":5126,"type":"VEC3",)"
      R"("count":{}}}],"bufferViews":[{{"buffer":0,"byteLength":{}}}],)"
      R"("buffers":[{{"byteLength":{},"uri":"{}.bin"}}]}})",
      positions.size() / 3, bytes, bytes, name);
  const std::filesystem::path file = folder / (name + ".gltf");
  if (auto ok = write_file(file, json.data(), json.size()); !ok) {
    return tl::unexpected(std::move(ok.error()));
  }
  return file;
}

physics::GeoPlace place_of(const scene::ScenarioDesc& scenario) {
  return {physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
          physics::Metres(scenario.place.height_m)};
}

physics::SunPosition sun_at(const scene::ScenarioDesc& scenario, std::int64_t sim_time_ns) {
  return physics::sun_position(scenario.epoch_utc_ns + sim_time_ns, place_of(scenario));
}

physics::Forcing forcing_at(const scene::ScenarioDesc& scenario, std::int64_t sim_time_ns) {
  if (scenario.weather.empty()) {
    return physics::forcing_from_clear_sky(scenario.clear_sky, place_of(scenario),
                                           sun_at(scenario, sim_time_ns),
                                           scenario.epoch_utc_ns + sim_time_ns);
  }
  return physics::at_place(physics::forcing_from_rows(scenario.weather, sim_time_ns),
                           place_of(scenario), sun_at(scenario, sim_time_ns));
}

}  // namespace

FlatPart level_part(std::string name, const glm::dvec3& c, double e, double n) {
  FlatPart part;
  part.name = std::move(name);
  part.faces = {{{glm::dvec3(c.x - e, c.y - n, c.z), glm::dvec3(c.x + e, c.y - n, c.z),
                  glm::dvec3(c.x + e, c.y + n, c.z), glm::dvec3(c.x - e, c.y + n, c.z)}}};
  return part;
}

FlatPart tilted_part(std::string name, const glm::dvec3& centre_m, const glm::dvec3& normal,
                     double half_m) {
  const glm::dvec3 helper =
      std::abs(normal.z) < 0.9 ? glm::dvec3(0.0, 0.0, 1.0) : glm::dvec3(0.0, 1.0, 0.0);
  const glm::dvec3 u = glm::normalize(glm::cross(helper, normal)) * half_m;
  const glm::dvec3 v = glm::cross(normal, u);
  FlatPart part;
  part.name = std::move(name);
  part.faces = {{{centre_m - u - v, centre_m + u - v, centre_m + u + v, centre_m - u + v}}};
  part.normal = normal;
  return part;
}

std::vector<FlatPart> box_parts(const glm::dvec3& l, const glm::dvec3& h) {
  const auto part = [](std::string name, const FlatFace& face, const glm::dvec3& normal) {
    FlatPart p;
    p.name = std::move(name);
    p.faces = {face};
    p.normal = normal;
    return p;
  };
  using P = glm::dvec3;
  std::vector<FlatPart> parts{
      part("top", {{P(l.x, l.y, h.z), P(h.x, l.y, h.z), P(h.x, h.y, h.z), P(l.x, h.y, h.z)}},
           {0, 0, 1}),
      part("south", {{P(l.x, l.y, l.z), P(h.x, l.y, l.z), P(h.x, l.y, h.z), P(l.x, l.y, h.z)}},
           {0, -1, 0}),
      part("north", {{P(h.x, h.y, l.z), P(l.x, h.y, l.z), P(l.x, h.y, h.z), P(h.x, h.y, h.z)}},
           {0, 1, 0}),
      part("west", {{P(l.x, h.y, l.z), P(l.x, l.y, l.z), P(l.x, l.y, h.z), P(l.x, h.y, h.z)}},
           {-1, 0, 0}),
      part("east", {{P(h.x, l.y, l.z), P(h.x, h.y, l.z), P(h.x, h.y, h.z), P(h.x, l.y, h.z)}},
           {1, 0, 0})};
  parts[0].open = true;
  return parts;
}

TemporaryFolder::TemporaryFolder() {
  std::error_code error;
  std::string pattern =
      (std::filesystem::temp_directory_path(error) / "emit-bench-XXXXXX").string();
  if (!error && ::mkdtemp(pattern.data()) != nullptr) path_ = pattern;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code error;
  if (!path_.empty()) std::filesystem::remove_all(path_, error);
}

scene::ScenarioDesc plain_scenario(std::uint32_t width_px, std::uint32_t height_px) {
  scene::ScenarioDesc scenario;
  scenario.name = "generated";
  scenario.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
  scenario.epoch_utc_ns = 1403330400LL * 1'000'000'000;  // 2014-06-21 06:00 UTC
  scenario.atmosphere.enabled = false;
  scenario.bands = {{"8-12", 8.0, 12.0, {}}, {"3-5", 3.0, 5.0, {}}};
  scene::Material material;
  material.name = "surface";
  material.solar_absorptance_frac = 0.75;
  material.emissivity_frac = 0.93;
  material.layers = {{0.15, 0.7, 2100.0, 920.0}};
  material.base_k = 293.15;
  material.modes = {{609.0, 0.547}, {7259.0, 0.453}};
  scenario.materials = {material};
  scenario.default_material = "surface";
  scenario.sensor.name = "camera";
  scenario.sensor.width_px = width_px;
  scenario.sensor.height_px = height_px;
  scenario.sensor.fov_h_rad = 40.0 * physics::kDegree;
  scenario.sensor.near_m = 0.1;
  scenario.thermal.method = scene::ThermalMethod::per_frame;
  scenario.thermal.steps = 9;
  scenario.thermal.shadow_map_px = 512;
  scenario.thermal.max_cascades = 2;
  scenario.thermal.initial_k = 290.0;
  return scenario;
}

Result<void> place_parts(std::span<const FlatPart> parts, const std::filesystem::path& folder,
                         scene::ScenarioDesc& scenario) {
  if (folder.empty()) return make_error(ErrorCode::io, "no temporary folder can be created");
  scenario.objects.clear();
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto file = write_part(parts[i], i, folder);
    if (!file) return tl::unexpected(file.error());
    scene::ObjectDesc object;
    object.name = parts[i].name;
    object.gltf = *file;
    object.material = parts[i].material;
    object.scale = parts[i].scale;
    object.instances = {
        {parts[i].placed_at_m, physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0)}};
    scenario.objects.push_back(std::move(object));
  }
  return {};
}

Result<std::unique_ptr<renderer::Renderer>> open_renderer(const scene::ScenarioDesc& scenario,
                                                          int gpu_index) {
  renderer::OutputOptions output;
  output.temperature = output.depth = output.object = true;
  output.slots = 2;
  return renderer::Renderer::create(scenario, {gpu_index, false}, output);
}

Result<StoredFrame> render_next(renderer::Renderer& renderer, const physics::Pose& sensor,
                                std::int64_t sim_time_ns) {
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = sim_time_ns;
  request.sensor_pose = sensor;
  const int slot = renderer.submit(request);
  if (slot < 0) return make_error(ErrorCode::internal, "the renderer has no free slot");
  const renderer::FrameView& view = renderer.collect(static_cast<renderer::SlotIndex>(slot));
  StoredFrame frame;
  frame.width_px = view.width_px;
  frame.device = renderer.device_name();
  for (const auto& plane : view.radiance_w_m2_sr) {
    frame.radiance_w_m2_sr.emplace_back(plane.begin(), plane.end());
  }
  frame.temperature_k.assign(view.temperature_k.begin(), view.temperature_k.end());
  frame.depth_m.assign(view.depth_m.begin(), view.depth_m.end());
  frame.object_id.assign(view.object_id.begin(), view.object_id.end());
  frame.stats = view.stats;
  const bool failed = view.device_failed;
  renderer.release(static_cast<renderer::SlotIndex>(slot));
  if (failed) return make_error(ErrorCode::gpu, "the device reported an error");
  return frame;
}

Result<StoredFrame> render_once(const scene::ScenarioDesc& scenario, const physics::Pose& sensor,
                                std::int64_t sim_time_ns, int gpu_index,
                                const std::function<void(renderer::Renderer&)>& prepare) {
  auto renderer = open_renderer(scenario, gpu_index);
  if (!renderer) return tl::unexpected(std::move(renderer.error()));
  if (prepare) prepare(**renderer);
  return render_next(**renderer, sensor, sim_time_ns);
}

physics::Pose looking_at(const glm::dvec3& eye_m, const glm::dvec3& target_m) {
  return {eye_m, physics::world_from_body_look_at(eye_m, target_m)};
}

glm::dvec3 point_of_pixel(const scene::SensorDesc& sensor, const physics::Pose& pose,
                          std::size_t pixel, double depth_m) {
  const double tan_h = std::tan(0.5 * sensor.fov_h_rad);
  const double tan_v = tan_h * sensor.height_px / sensor.width_px;
  const double x = static_cast<double>(pixel % sensor.width_px) + 0.5;
  const double y = static_cast<double>(pixel / sensor.width_px) + 0.5;
  const glm::dvec3 ray{(x / sensor.width_px * 2.0 - 1.0) * tan_h,
                       (y / sensor.height_px * 2.0 - 1.0) * tan_v, 1.0};
  return pose.position_world_m +
         glm::mat3_cast(pose.world_from_body) *
             (glm::transpose(physics::sensor_from_body()) * (ray * depth_m));
}

PointHistory::PointHistory(const scene::ScenarioDesc& scenario, std::int64_t sim_time_ns,
                           std::uint32_t steps)
    : initial_k_(scenario.thermal.initial_k) {
  std::vector<std::int64_t> times_ns(steps + 1);
  physics::uniform_step_nodes(scenario.thermal.history_start_ns, sim_time_ns, times_ns);
  for (const std::int64_t t : times_ns) {
    nodes_.push_back({t, sun_at(scenario, t), forcing_at(scenario, t)});
  }
}

double PointHistory::equilibrium_k(std::size_t node, const scene::Material& material,
                                   const glm::dvec3& normal, double sun_frac) const {
  const physics::SunPosition& sun = nodes_[node].sun;
  const physics::Forcing& forcing = nodes_[node].forcing;
  const double eps = material.emissivity_frac;
  const double direct_w_m2 =
      sun.elevation.value() > 0.0
          ? forcing.direct_normal_w_m2 * std::max(0.0, glm::dot(normal, sun.direction_enu))
          : 0.0;
  const physics::SurfaceFluxes<double> fluxes{
      .direct_w_m2 = direct_w_m2,
      .diffuse_w_m2 = physics::diffuse_input_w_m2(forcing.diffuse_horizontal_w_m2),
      .environment_w_m2 = physics::environment_input_w_m2(eps, forcing.environment_k),
      .longwave_w_m2 =
          physics::longwave_input_w_m2(forcing.longwave_down_w_m2, forcing.environment_k),
      .cloud_frac = forcing.cloud_frac,
      .sun_frac = sun_frac,
      .sky_frac = 0.5};
  physics::SurfaceExchange<double> exchange;
  exchange.emissivity_frac = eps;
  exchange.core_k = material.base_k;
  if (!material.layers.empty()) {
    exchange.core_conductance_w_m2_k =
        material.layers[0].conductivity_w_m_k / material.layers[0].thickness_m;
  }
  const double absorbed_w_m2 =
      physics::absorbed_flux_w_m2(fluxes, material.solar_absorptance_frac, eps);
  return physics::solve_equilibrium(physics::surface_balance(absorbed_w_m2, exchange))
      .temperature_k;
}

double PointHistory::temperature_k(const scene::Material& material, const glm::dvec3& normal,
                                   const std::function<double(std::size_t)>& sun_frac) const {
  if (material.prescribed_k) return *material.prescribed_k;
  std::vector<double> states(material.modes.size(), material.initial_k.value_or(initial_k_));
  for (std::size_t i = 0; i < intervals(); ++i) {
    const double share = sun_frac(i);
    const double u0 = equilibrium_k(i, material, normal, share);
    const double u1 = equilibrium_k(i + 1, material, normal, share);
    for (std::size_t m = 0; m < states.size(); ++m) {
      const auto gains =
          physics::relaxation_gains(node_s(i + 1) - node_s(i), material.modes[m].tau_s);
      states[m] = physics::relax_linear(states[m], u0, u1, gains);
    }
  }
  double sum_k = 0.0;
  for (std::size_t m = 0; m < states.size(); ++m) {
    sum_k += material.modes[m].weight_frac * states[m];
  }
  return sum_k;
}

std::optional<std::int64_t> sun_rises_through_ns(const scene::ScenarioDesc& scenario,
                                                 std::int64_t from_ns, double elevation_rad) {
  constexpr std::int64_t kStrideNs = 600'000'000'000;
  const auto above = [&](std::int64_t t) {
    return sun_at(scenario, t).elevation.value() - elevation_rad;
  };
  for (std::int64_t low = from_ns; low < from_ns + 144 * kStrideNs; low += kStrideNs) {
    if (!(above(low) < 0.0 && above(low + kStrideNs) >= 0.0)) continue;
    std::int64_t high = low + kStrideNs;
    while (high - low > 1) {
      const std::int64_t middle = low + (high - low) / 2;
      (above(middle) < 0.0 ? low : high) = middle;
    }
    return high;
  }
  return std::nullopt;
}

glm::dvec3 direction_to_sun(const scene::ScenarioDesc& scenario, std::int64_t sim_time_ns) {
  return sun_at(scenario, sim_time_ns).direction_enu;
}

}  // namespace emit::tool
