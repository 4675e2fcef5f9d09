// SPDX-License-Identifier: Apache-2.0
// The thermal method "cached" samples a view as finely as it needs, and changes of detail do not
// show: from near, from far, and on the way between.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <glm/geometric.hpp>
#include <string>
#include <utility>
#include <vector>

#include "renderer/scene/gltf_builder.hpp"
#include "renderer/scene/sphere.hpp"
#include "support/cached_session.hpp"
#include "support/renderer_scene.hpp"

namespace emit::test {
namespace {

TEST(RendererCachedDetail, SamplesAreBoundedByThePixels) {
  // Expect that triangles are not cut far below a pixel, however small the tolerance is.
  auto scenario = cached_scenario(box_on_ground());
  const auto pose = looking({-6.0, -9.0, 7.0}, {-1.0, 0.0, 0.0});
  scenario.sensor.trajectory = {{0, pose}};
  scenario.thermal.tolerance_k = 0.001;
  const auto samples = [&](std::uint32_t fineness) {
    scenario.sensor.width_px = fineness * kWidth;
    scenario.sensor.height_px = fineness * kHeight;
    Session run(scenario);
    (void)run.frame_k(2 * kHourNs, pose);
    EXPECT_FALSE(run.renderer().scene_stats().samples_full);
    return static_cast<double>(run.renderer().scene_stats().samples);
  };
  const double coarse = samples(1);
  const double fine = samples(2);
  EXPECT_LT(coarse, 3.0 * kWidth * kHeight);
  EXPECT_GT(coarse, 0.5 * kWidth * kHeight);  // the limit stops the refinement
  EXPECT_LT(fine, 4.5 * coarse);
}

/// Returns the image that the centre of `picture` becomes when a camera that looks down on a plane
/// recedes to `farther` times its distance. It is interpolated bilinearly and leaves out one pixel
/// along the rim.
std::vector<double> receded_k(const std::vector<float>& picture, std::uint32_t width_px,
                              double farther) {
  const std::size_t width = width_px;
  const std::size_t height = picture.size() / width;
  const auto part = [farther](std::size_t i, std::size_t count) {
    const double middle = 0.5 * static_cast<double>(count);
    const double at = (static_cast<double>(i) + 0.5 - middle) * farther + middle - 0.5;
    return std::clamp(at, 0.0, static_cast<double>(count) - 1.001);
  };
  std::vector<double> out;
  for (std::size_t row = 1; row + 1 < height; ++row) {
    for (std::size_t column = 1; column + 1 < width; ++column) {
      const double u = part(column, width);
      const double v = part(row, height);
      const auto left = static_cast<std::size_t>(u);
      const auto top = static_cast<std::size_t>(v);
      const auto at_row = [&](std::size_t y) {
        return std::lerp(static_cast<double>(picture[y * width + left]),
                         static_cast<double>(picture[y * width + left + 1]),
                         u - static_cast<double>(left));
      };
      out.push_back(std::lerp(at_row(top), at_row(top + 1), v - static_cast<double>(top)));
    }
  }
  return out;
}

TEST(RendererCachedDetail, LevelsChangeWithoutAPop) {
  // Cast the shade of a plate high above, with a soft edge that has moved over the ground. Let the
  // camera recede to four times the distance.
  constexpr double kUpM = 60.0;
  constexpr double kNearM = 8.0;
  constexpr int kFrames = 400;
  const double farther = std::pow(4.0, 1.0 / kFrames);
  const std::int64_t now_ns = 3 * kHourNs;
  auto scenario = cached_scenario(write_quads("ground", {ground(14.0, 14.0)}));
  const glm::dvec3 sun = renderer::Environment(scenario).sun_at(now_ns).direction_enu;
  scene::ObjectDesc plate = scenario.objects.front();
  plate.name = "plate";
  plate.gltf = write_quads("plate", {ground(3.0, 3.0)});
  plate.instances.front().position_world_m = kUpM / sun.z * sun;
  scenario.objects.push_back(plate);
  scenario.sensor.width_px = 4 * kWidth;
  scenario.sensor.height_px = 4 * kHeight;
  const auto at = [&](int frame) {
    return looking({0.0, -0.01, kNearM * std::pow(farther, frame)}, {0.0, 0.0, 0.0});
  };
  for (int k = 0; k <= 20; ++k) {
    scenario.sensor.trajectory.push_back({now_ns + k * kSecondNs, at(k * kFrames / 20)});
  }
  Session run(scenario, {.ladder = renderer::Ladder::replayed});
  const std::size_t width = scenario.sensor.width_px;
  const auto most_apart_k = [&](const std::vector<double>& a, const std::vector<float>& b) {
    double most_k = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      const std::size_t pixel = (i / (width - 2) + 1) * width + i % (width - 2) + 1;
      most_k = std::max(most_k, std::abs(a[i] - static_cast<double>(b[pixel])));
    }
    return most_k;
  };
  std::vector<double> most_k;
  auto last = run.frame_k(now_ns, at(0));
  for (int frame = 1; frame <= kFrames; ++frame) {
    auto next = run.frame_k(now_ns, at(frame));
    most_k.push_back(most_apart_k(receded_k(last, scenario.sensor.width_px, farther), next));
    last = std::move(next);
  }
  double over_k = 0.0;
  for (std::size_t f = 5; f + 5 < most_k.size(); ++f) {
    std::array<double, 11> around_k{};
    std::copy_n(&most_k[f - 5], around_k.size(), around_k.begin());
    std::ranges::sort(around_k);
    over_k = std::max(over_k, most_k[f] - around_k[5]);
  }
  EXPECT_LT(over_k, scenario.thermal.tolerance_k);
  // Expect that coarser levels exist and would show if they were drawn earlier.
  const auto coarse = run.frame_k(now_ns, at(kFrames), 3);
  EXPECT_GT(most_apart_k(receded_k(coarse, scenario.sensor.width_px, 1.0), last),
            scenario.thermal.tolerance_k);
}

/// File with a ball of radius 1 m and smooth normals.
std::filesystem::path write_ball(std::uint32_t rings) {
  const scene::Mesh mesh = scene::sphere(rings, false);
  GltfText text;
  text.buffer.clear();
  const auto view = [&text](const auto& values) {
    const std::size_t bytes = values.size() * sizeof(values[0]);
    const std::string at = std::to_string(text.buffer.size());
    text.buffer.append(reinterpret_cast<const char*>(values.data()), bytes);
    return R"({"buffer":0,"byteOffset":)" + at + R"(,"byteLength":)" + std::to_string(bytes) + "}";
  };
  text.views = view(mesh.positions_m);
  text.views += "," + view(mesh.normals);
  text.views += "," + view(mesh.indices);
  const std::string vertices = std::to_string(mesh.positions_m.size());
  text.accessors = R"({"bufferView":0,"componentType":5126,"type":"VEC3","count":)" + vertices +
                   R"(},{"bufferView":1,"componentType":5126,"type":"VEC3","count":)" + vertices +
                   R"(},{"bufferView":2,"componentType":5125,"type":"SCALAR","count":)" +
                   std::to_string(mesh.indices.size()) + "}";
  text.primitive = R"({"attributes":{"POSITION":0,"NORMAL":1},"indices":2,"material":0})";
  text.materials = R"({"name":"surface"})";
  return write_file(test_folder() / "ball.gltf", text.json());
}

/// File with a hull and a turret that shades it. Each face consists of `parts` x `parts` squares.
std::filesystem::path write_vehicle(int parts) {
  auto faces = box({-1.0, -1.0, 0.0}, {1.0, 1.0, 0.6});
  const auto turret = box({-0.1, -0.4, 0.6}, {0.7, 0.4, 1.2});
  faces.insert(faces.end(), turret.begin(), turret.end());
  std::vector<Quad> squares;
  for (const Quad& face : faces) {
    const auto at = [&](int i, int j) {
      return face.a + (face.b - face.a) * (static_cast<double>(i) / parts) +
             (face.d - face.a) * (static_cast<double>(j) / parts);
    };
    for (int i = 0; i < parts; ++i) {
      for (int j = 0; j < parts; ++j) {
        squares.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
  }
  return write_quads("vehicle", squares);
}

/// Means over many images of small objects.
struct Shown {
  double mean_k = 0.0;
  double pixels = 0.0;
};

/// Renders nine objects of 1 m in a row, with the image shifted by parts of a pixel. With
/// `comes_near` the camera passes each of them later on.
Shown shown_from_afar(const std::filesystem::path& gltf, double thing_px, const glm::dvec3& from,
                      bool comes_near) {
  constexpr double kThingM = 1.0;
  constexpr double kApartM = 3.1;
  constexpr int kOnEitherSide = 4;
  constexpr int kShifts = 8;
  auto scenario = cached_scenario(gltf);
  scene::ObjectDesc& things = scenario.objects.front();
  things.scale = 0.5 * kThingM;
  const physics::Pose first = things.instances.front();
  things.instances.clear();
  std::vector<glm::dvec3> places_m;
  for (int i = -kOnEitherSide; i <= kOnEitherSide; ++i) {
    places_m.emplace_back(kApartM * i, 0.0, 2.0);
    things.instances.push_back(first);
    things.instances.back().position_world_m = places_m.back();
  }
  const double away_m =
      kThingM / thing_px * kWidth / (2.0 * std::tan(0.5 * scenario.sensor.fov_h_rad));
  const glm::dvec3 up = glm::normalize(glm::dvec3(0.0, -from.y * from.z, from.y * from.y));
  const auto far = [&](int right, int above) {
    const double step_m = kThingM / thing_px / kShifts;
    const glm::dvec3 at =
        places_m[kOnEitherSide] + step_m * right * glm::dvec3(1.0, 0.0, 0.0) + step_m * above * up;
    return looking(at + away_m * from, at);
  };
  const std::int64_t now_ns = 2 * kHourNs;
  scenario.sensor.trajectory = {{now_ns, far(0, 0)}};
  for (std::size_t i = 0; comes_near && i < places_m.size(); ++i) {
    const auto after_ns = static_cast<std::int64_t>(i + 1) * kSecondNs;
    scenario.sensor.trajectory.push_back(
        {now_ns + after_ns, looking(places_m[i] + 3.0 * from, places_m[i])});
  }
  Session run(scenario);
  Shown shown;
  for (int shift = 0; shift < kShifts * kShifts; ++shift) {
    for (const float k : run.frame_k(now_ns, far(shift % kShifts, shift / kShifts))) {
      if (std::isnan(k)) continue;
      shown.mean_k += static_cast<double>(k);
      shown.pixels += 1.0;
    }
  }
  shown.mean_k /= shown.pixels;
  return shown;
}

TEST(RendererCachedDetail, SmallThingsAreRightOnAverage) {
  // Compare objects that are finely sampled, because the camera comes near them, with objects that
  // are sampled for their few pixels.
  constexpr double kAreaFrac = 0.03;
  const double most_k = 2.0 * scene::ScenarioDesc{}.thermal.tolerance_k;
  const auto expect_alike = [&](const std::filesystem::path& gltf, double thing_px,
                                const glm::dvec3& from) {
    const Shown fine = shown_from_afar(gltf, thing_px, from, true);
    const Shown small = shown_from_afar(gltf, thing_px, from, false);
    ASSERT_GT(fine.pixels, 300.0);
    EXPECT_NEAR(small.mean_k, fine.mean_k, most_k);
    EXPECT_NEAR(small.pixels, fine.pixels, kAreaFrac * fine.pixels);
  };
  {
    SCOPED_TRACE("ball of three pixels");
    expect_alike(write_ball(40), 3.0, {0.0, 0.28, 0.96});
  }
  for (const double px : {3.0, 1.0}) {
    SCOPED_TRACE("vehicle, pixels: " + std::to_string(px));
    expect_alike(write_vehicle(16), px, {0.0, -0.96, 0.28});
  }
}

}  // namespace
}  // namespace emit::test
