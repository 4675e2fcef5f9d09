// SPDX-License-Identifier: Apache-2.0
// Where thermal samples on surfaces could go wrong: instances that share a mesh, casters that move,
// the change from one interval to the next, and ground under bodies.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "emit/scene/simplify.hpp"
#include "gpu/cached_session.hpp"
#include "gpu/renderer_scene.hpp"

namespace emit::test {
namespace {

glm::dvec3 to_sun(const scene::ScenarioDesc& scenario, double seconds) {
  return renderer::Environment(scenario).sun_at(std::llround(seconds * 1e9)).direction_enu;
}

/// Ground in squares so small that shade which comes after the warm-up finds samples, too.
std::vector<Quad> fine_ground(double half_m, double square_m) {
  std::vector<Quad> quads;
  const int squares = static_cast<int>(std::lround(2.0 * half_m / square_m));
  const glm::dvec3 x(square_m, 0.0, 0.0);
  const glm::dvec3 y(0.0, square_m, 0.0);
  for (int i = 0; i < squares; ++i) {
    for (int j = 0; j < squares; ++j) {
      const glm::dvec3 low(square_m * i - half_m, square_m * j - half_m, 0.0);
      quads.push_back({low, low + x, low + x + y, low + y});
    }
  }
  return quads;
}

/// Mean over the pixels that show something of what `shown` selects by pixel.
template <class Shown>
float mean_k(const std::vector<float>& frame, const Shown& shown) {
  double sum_k = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (std::isnan(frame[i]) || !shown(i)) continue;
    sum_k += static_cast<double>(frame[i]);
    ++count;
  }
  EXPECT_GT(count, 0);
  return static_cast<float>(sum_k / count);
}

TEST(RendererCachedBreaks, InstancesOfOneMeshHaveTheirOwnTemperatures) {
  // Two plates, one in the shade of a wall; a few pixels wide, where they share a mesh, and wider.
  const auto plate = write_quads("plate", {ground(1.0, 1.0)});
  const auto wall = write_quads("wall", box({2.0, -8.0, 0.0}, {3.0, 8.0, 4.0}));
  const glm::dvec3 open_m(-12.0, 0.0, 0.0);
  const glm::dvec3 middle_m(-6.0, 0.0, 0.0);
  const auto pose = looking(middle_m + glm::dvec3(-25.0, 0.0, 40.0), middle_m);
  const auto plates = [&](bool both, std::uint32_t fineness) {
    auto scenario = cached_scenario(plate);
    scene::ObjectDesc screen = scenario.objects.front();
    screen.name = "wall";
    screen.gltf = wall;
    scene::ObjectDesc& object = scenario.objects.front();
    const physics::Pose shaded = object.instances.front();
    object.instances.front().position_world_m = open_m;
    if (both) object.instances.push_back(shaded);
    scenario.objects.push_back(screen);
    scenario.sensor.trajectory = {{0, pose}};
    scenario.sensor.width_px *= fineness;
    scenario.sensor.height_px *= fineness;
    return scenario;
  };
  for (const std::uint32_t fineness : {1U, 4U}) {
    const auto scenario = plates(true, fineness);
    auto geometry = scene::load_scene(scenario);
    ASSERT_TRUE(geometry.has_value());
    const scene::DetailView view{
        {&pose.position_world_m, 1},
        2.0 * std::tan(0.5 * scenario.sensor.fov_h_rad) / scenario.sensor.width_px};
    const auto drawn = scene::separated(std::move(*geometry), view);
    ASSERT_EQ(drawn.instances[0].mesh == drawn.instances[1].mesh, fineness == 1);
    const auto frame = [&](bool both) {
      Session session(plates(both, fineness), true);
      auto picture = session.frame_k(2 * kHourNs, pose);
      return std::pair(std::move(picture), session.objects());
    };
    const auto [both_k, both_objects] = frame(true);
    const auto [alone_k, alone_objects] = frame(false);
    std::vector<float> shaded_k;
    int open_px = 0;
    for (std::size_t i = 0; i < both_k.size(); ++i) {
      if (both_objects[i] != 1.0F) continue;
      if (alone_objects[i] == 1.0F) {
        EXPECT_NEAR(both_k[i], alone_k[i], 0.1F) << i;
        ++open_px;
      } else {
        shaded_k.push_back(both_k[i]);
      }
    }
    ASSERT_GT(open_px, 10);
    ASSERT_GT(shaded_k.size(), 10U);
    const float open_k = mean_k(alone_k, [&](std::size_t i) { return alone_objects[i] == 1.0F; });
    const auto [low, high] = std::ranges::minmax(shaded_k);
    EXPECT_LT(high, open_k - 8.0F);
  }
}

TEST(RendererCachedBreaks, ShadeOfAPassingBodyIsItsMeanOverTheInterval) {
  // A plate flies over at constant speed; a place lies 8 s of an interval of 20 s in its shade.
  constexpr double kHalfLengthM = 4.0;
  constexpr double kHeightM = 10.0;
  constexpr double kSpeedMs = 1.0;
  constexpr double kOverOriginS = 7270.0;  // the middle of its shade is
  constexpr double kFromS = 7215.0;
  constexpr double kToS = 7325.0;
  auto scenario = cached_scenario(write_quads("ground", fine_ground(16.0, 0.5)));
  scene::ObjectDesc plate = scenario.objects.front();
  plate.name = "plate";
  plate.gltf = write_quads("plate", {ground(kHalfLengthM, 2.0)});
  plate.entity_id = 7;
  const glm::dvec3 sun = to_sun(scenario, kOverOriginS);
  const auto at = [&](double seconds) {
    physics::Pose pose = plate.instances.front();
    pose.position_world_m = kHeightM / sun.z * sun;
    pose.position_world_m.x += kSpeedMs * (seconds - kOverOriginS);
    return pose;
  };
  plate.trajectory = {{std::llround(kFromS * 1e9), at(kFromS)},
                      {std::llround(kToS * 1e9), at(kToS)}};
  plate.instances = {at(kFromS)};
  scenario.objects.push_back(plate);
  constexpr double kEyeM = 28.0;
  const auto pose = looking({0.0, -0.001, kEyeM}, {0.0, 0.0, 0.0});
  const double px_m = 2.0 * kEyeM * std::tan(0.5 * scenario.sensor.fov_h_rad) / kWidth;
  const auto check = [&](const std::vector<float>& frame, double seconds) {
    const std::int64_t now_ns = std::llround(seconds * 1e9);
    const double open_k = open_ground_k(scenario, now_ns);
    EXPECT_NEAR(frame[kWidth / 2], open_k, 0.02);
    const float* track_k = &frame[std::size_t{kHeight} / 2 * kWidth];
    for (std::uint32_t column = 0; column < kWidth; ++column) {
      const float before_k = track_k[column == 0 ? 0 : column - 1];
      EXPECT_NEAR(track_k[column], before_k, 0.1) << seconds << " s, column " << column;
      if (column % 12 != 0) continue;
      const double x_m = (column + 0.5 - 0.5 * kWidth) * px_m;
      const double middle_s = kOverOriginS + x_m / kSpeedMs;
      constexpr double kHalfS = kHalfLengthM / kSpeedMs;
      const double expected_k =
          open_ground_k(scenario, now_ns, Shade{middle_s - kHalfS, middle_s + kHalfS});
      EXPECT_NEAR(track_k[column], expected_k, 0.1) << seconds << " s, " << x_m << " m";
      EXPECT_LT(track_k[column], open_k - 0.2) << seconds << " s, " << x_m << " m";
    }
  };
  {
    Session run(scenario);
    std::vector<float> frame;
    for (double seconds = 7205.0; seconds <= 7305.0; seconds += 10.0) {
      frame = run.frame_k(std::llround(seconds * 1e9), pose);
    }
    check(frame, 7305.0);
  }
  // Likewise where the passage is part of the history that the warm-up integrates.
  check(Session(scenario).frame_k(7325 * kSecondNs, pose), 7325.0);
}

TEST(RendererCachedBreaks, MoreMaterialsThanAPixelCanNameAreRefused) {
  constexpr std::size_t kMaterials = 16385;
  const auto file = write_quads("many", {ground(1.0, 1.0)});
  std::ifstream in(file);
  std::string text((std::istreambuf_iterator<char>(in)), {});
  auto scenario = cached_scenario(file);
  const scene::Material material = scenario.materials.front();
  std::string materials = R"({"name":"surface"})";
  std::string primitives = R"({"attributes":{"POSITION":0},"material":0})";
  const auto replace = [&text](const std::string& from, const std::string& to) {
    ASSERT_NE(text.find(from), std::string::npos);
    text.replace(text.find(from), from.size(), to);
  };
  std::string more_materials = materials;
  std::string more_primitives = primitives;
  for (std::size_t i = 1; i < kMaterials; ++i) {
    const std::string number = std::to_string(i);
    more_materials += R"(,{"name":"m)" + number + R"("})";
    more_primitives += R"(,{"attributes":{"POSITION":0},"material":)" + number + "}";
    scenario.materials.push_back(material);
    scenario.materials.back().name = "m" + number;
  }
  replace(materials, more_materials);
  replace(primitives, more_primitives);
  std::ofstream(file) << text;
  const auto made = renderer::Renderer::create(scenario, {}, {});
  ASSERT_FALSE(made.has_value());
  EXPECT_EQ(made.error().code, physics::ErrorCode::config);
  EXPECT_NE(made.error().text.find("16385"), std::string::npos) << made.error().text;
  EXPECT_NE(made.error().text.find("16384"), std::string::npos) << made.error().text;
}

}  // namespace
}  // namespace emit::test
