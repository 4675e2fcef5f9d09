// SPDX-License-Identifier: Apache-2.0
#include "support/renderer_scene.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include "emit/physics/constants.hpp"

namespace emit::test {

Quad ground(double half_east_m, double half_north_m, double up_m) {
  return {{-half_east_m, -half_north_m, up_m},
          {half_east_m, -half_north_m, up_m},
          {half_east_m, half_north_m, up_m},
          {-half_east_m, half_north_m, up_m}};
}

std::vector<Quad> box(const glm::dvec3& l, const glm::dvec3& h) {
  return {{{l.x, l.y, h.z}, {h.x, l.y, h.z}, {h.x, h.y, h.z}, {l.x, h.y, h.z}},   // top
          {{l.x, l.y, l.z}, {h.x, l.y, l.z}, {h.x, l.y, h.z}, {l.x, l.y, h.z}},   // south
          {{h.x, h.y, l.z}, {l.x, h.y, l.z}, {l.x, h.y, h.z}, {h.x, h.y, h.z}},   // north
          {{l.x, h.y, l.z}, {l.x, l.y, l.z}, {l.x, l.y, h.z}, {l.x, h.y, h.z}},   // west
          {{h.x, l.y, l.z}, {h.x, h.y, l.z}, {h.x, h.y, h.z}, {h.x, l.y, h.z}}};  // east
}

std::filesystem::path write_quads(const std::string& name, const std::vector<Quad>& quads,
                                  bool double_sided) {
  const auto* info = testing::UnitTest::GetInstance()->current_test_info();
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "emit_renderer" /
                                       (std::string(info->test_suite_name()) + "." + info->name());
  std::filesystem::create_directories(folder);

  std::vector<float> positions;
  for (const Quad& q : quads) {
    for (const glm::dvec3& p : {q.a, q.b, q.c, q.a, q.c, q.d}) {
      // Convert to the axes of glTF for an object that heads north: x is west, y is up, z is north.
      positions.push_back(static_cast<float>(-p.x));
      positions.push_back(static_cast<float>(p.z));
      positions.push_back(static_cast<float>(p.y));
    }
  }
  const std::size_t bytes = positions.size() * sizeof(float);
  std::ofstream binary(folder / (name + ".bin"), std::ios::binary);
  binary.write(reinterpret_cast<const char*>(positions.data()),
               static_cast<std::streamsize>(bytes));
  std::ofstream json(folder / (name + ".gltf"));
  json
      << R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
      << R"("materials":[{"name":"surface")" << (double_sided ? R"(,"doubleSided":true)" : "")
      << R"(}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},)"
      << R"("material":0}]}],"accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":)"
      << positions.size() / 3 << R"(}],"bufferViews":[{"buffer":0,"byteLength":)" << bytes
      << R"(}],"buffers":[{"byteLength":)" << bytes << R"(,"uri":")" << name << R"(.bin"}]})";
  return folder / (name + ".gltf");
}

void park_vehicle(scene::ScenarioDesc& scenario, std::int64_t leaves_ns) {
  scene::ObjectDesc vehicle = scenario.objects.front();
  vehicle.name = "vehicle";
  vehicle.gltf = write_quads("vehicle", box({-1.5, -1.0, 0.3}, {1.5, 1.0, 2.0}));
  vehicle.entity_id = 7;
  const physics::Pose parked = vehicle.instances.front();
  physics::Pose away = parked;
  away.position_world_m += glm::dvec3(300.0, 0.0, 0.0);
  vehicle.trajectory = {{0, parked, true, false},
                        {leaves_ns, parked, true, false},
                        {leaves_ns + 1'000'000'000, away, true, true}};
  scenario.objects.push_back(vehicle);
}

scene::WeatherSample weather(double direct_w_m2, double diffuse_w_m2, double longwave_w_m2,
                             double environment_k) {
  scene::WeatherSample sample;
  sample.direct_normal_w_m2 = direct_w_m2;
  sample.diffuse_horizontal_w_m2 = diffuse_w_m2;
  sample.longwave_down_w_m2 = longwave_w_m2;
  sample.air_k = environment_k;
  sample.environment_k = environment_k;
  return sample;
}

scene::ScenarioDesc instant_scenario(const std::filesystem::path& gltf) {
  scene::ScenarioDesc scenario;
  scenario.name = "test";
  scenario.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
  scenario.epoch_utc_ns = 1403330400LL * 1'000'000'000;  // 2014-06-21 06:00 UTC
  scenario.weather = {weather(800.0, 100.0, 340.0, 295.0)};
  scenario.atmosphere.enabled = false;
  scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  scene::Material material;
  material.name = "surface";
  material.solar_absorptance_frac = 0.8;
  material.emissivity_frac = 0.9;
  material.layers = {{0.1, 1.0, 2000.0, 900.0}};
  material.base_k = 290.0;
  material.modes = {{1e-3, 0.5}, {1e-3, 0.5}};
  scenario.materials = {material};
  scenario.default_material = "surface";
  scene::ObjectDesc object;
  object.name = "world";
  object.gltf = gltf;
  object.instances = {
      {glm::dvec3(0.0), physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0)}};
  scenario.objects = {object};
  scenario.sensor.name = "camera";
  scenario.sensor.width_px = 320;
  scenario.sensor.height_px = 256;
  scenario.sensor.fov_h_rad = 40.0 * physics::kDegree;
  scenario.sensor.near_m = 0.1;
  scenario.thermal.method = scene::ThermalMethod::per_frame;
  scenario.thermal.steps = 1;
  scenario.thermal.spacing = scene::StepSpacing::uniform;
  return scenario;
}

glm::dvec3 world_point(const scene::SensorDesc& sensor, const physics::Pose& pose, std::uint32_t x,
                       std::uint32_t y, double depth_m) {
  const double tan_h = std::tan(0.5 * sensor.fov_h_rad);
  const double tan_v = tan_h * sensor.height_px / sensor.width_px;
  const glm::dvec3 ray_sensor{((x + 0.5) / sensor.width_px * 2.0 - 1.0) * tan_h,
                              ((y + 0.5) / sensor.height_px * 2.0 - 1.0) * tan_v, 1.0};
  return pose.position_world_m +
         glm::mat3_cast(pose.world_from_body) *
             (glm::transpose(physics::sensor_from_body()) * (ray_sensor * depth_m));
}

}  // namespace emit::test
