// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "airfield.hpp"
#include "emit/physics/constants.hpp"

namespace emit::scenegen {
namespace {

/// Returns a hangar, open towards -y, with two leaves pushed aside. The origin is on the ground in
/// the middle of the doorway.
SceneMesh hangar() {
  constexpr double kHalfWidthM = 21.0;
  constexpr double kDepthM = 42.0;
  constexpr double kWallM = 7.0;
  constexpr double kRiseM = 7.0;
  constexpr int kArcSteps = 12;
  MeshBuilder b("hangar");
  b.material("steel_sheet", true);
  std::vector<glm::dvec2> arc;
  for (int i = 0; i <= kArcSteps; ++i) {
    const double angle = physics::kPi * i / kArcSteps;
    arc.emplace_back(kHalfWidthM * std::cos(angle), kWallM + kRiseM * std::sin(angle));
  }
  for (std::size_t i = 0; i + 1 < arc.size(); ++i) {
    b.quad({arc[i].x, kDepthM, arc[i].y}, {arc[i + 1].x, kDepthM, arc[i + 1].y},
           {arc[i + 1].x, 0.0, arc[i + 1].y}, {arc[i].x, 0.0, arc[i].y});
  }
  b.quad({kHalfWidthM, 0, 0}, {kHalfWidthM, kDepthM, 0}, {kHalfWidthM, kDepthM, kWallM},
         {kHalfWidthM, 0, kWallM});
  b.quad({-kHalfWidthM, kDepthM, 0}, {-kHalfWidthM, 0, 0}, {-kHalfWidthM, 0, kWallM},
         {-kHalfWidthM, kDepthM, kWallM});
  for (const double y : {0.0, kDepthM}) {  // gables above the doorway and at the back
    for (std::size_t i = 0; i + 1 < arc.size(); ++i) {
      b.polygon({{0.0, y, kWallM}, {arc[i].x, y, arc[i].y}, {arc[i + 1].x, y, arc[i + 1].y}});
    }
  }
  b.quad({kHalfWidthM, kDepthM, 0}, {-kHalfWidthM, kDepthM, 0}, {-kHalfWidthM, kDepthM, kWallM},
         {kHalfWidthM, kDepthM, kWallM});
  b.material("painted_metal");
  b.box({-kHalfWidthM, -0.4, 0.0}, {-kHalfWidthM + 8.0, -0.1, kWallM});
  b.box({kHalfWidthM - 8.0, -0.4, 0.0}, {kHalfWidthM, -0.1, kWallM});
  return b.take();
}

SceneMesh tower() {
  MeshBuilder b("tower");
  const auto ring = [](double radius) {
    std::vector<glm::dvec2> outline;
    for (int i = 0; i < 8; ++i) {
      const double angle = physics::kPi * (2.0 * i + 1.0) / 8.0;
      outline.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
    }
    return outline;
  };
  b.material("concrete");
  b.box({-9.0, -7.0, 0.0}, {9.0, 7.0, 4.0});
  b.prism(ring(3.4), 4.0, 24.0, MeshBuilder::kSides);
  b.prism(ring(5.2), 24.0, 25.2);
  b.material("glass").prism(ring(4.7), 25.2, 28.4, MeshBuilder::kSides);
  b.material("steel_sheet").prism(ring(5.4), 28.4, 29.2);
  b.tube({0, 0, 29.2}, {0, 0, 36.0}, 0.12, 0.05, 6, false, true);
  return b.take();
}

SceneMesh terminal() {
  MeshBuilder b("terminal");
  b.material("concrete");
  b.box({-28.0, -9.0, 0.0}, {28.0, 9.0, 3.2}, MeshBuilder::kSides);
  b.material("glass").box({-27.8, -8.8, 3.2}, {27.8, 8.8, 6.4}, MeshBuilder::kSides);
  b.material("steel_sheet").box({-29.0, -10.5, 6.4}, {29.0, 10.0, 7.2});
  b.material("concrete");
  for (int i = 0; i < 4; ++i) {  // plant on the roof
    const double x = -20.0 + 13.0 * i;
    b.box({x, -3.0, 7.2}, {x + 4.0, 1.0, 9.0}, MeshBuilder::kTop | MeshBuilder::kSides);
  }
  return b.take();
}

SceneMesh fuel_farm() {
  MeshBuilder b("fuel_farm");
  b.material("painted_metal");
  for (int i = 0; i < 3; ++i) {
    const double x = -18.0 + 18.0 * i;
    b.tube({x, 0, 0}, {x, 0, 8.0}, 6.0, 6.0, 24, false, false);
    b.tube({x, 0, 8.0}, {x, 0, 9.2}, 6.0, 0.0, 24, false, false);
  }
  b.material("concrete");
  b.box({-28.0, -12.0, 0.0}, {28.0, -11.6, 1.2});
  b.box({-28.0, 11.6, 0.0}, {28.0, 12.0, 1.2});
  return b.take();
}

SceneMesh light_pole() {
  MeshBuilder b("light_pole");
  b.material("steel_sheet");
  b.tube({0, 0, 0}, {0, 0, 16.0}, 0.25, 0.12, 8, false, false);
  b.box({-1.6, -0.25, 15.8}, {1.6, 0.25, 16.3});
  return b.take();
}

/// Returns crates and jersey barriers for the apron.
SceneMesh clutter() {
  MeshBuilder b("clutter");
  b.material("concrete");
  for (int i = 0; i < 10; ++i) {
    const double x = -30.0 + 6.0 * i;
    b.profile({{x, 0.0}, {x + 2.4, 0.0}, {x + 2.2, 0.9}, {x + 0.2, 0.9}}, 0.0, 0.45);
  }
  b.material("wood");
  b.box({34.0, -1.0, 0.0}, {36.2, 1.2, 1.6}, MeshBuilder::kTop | MeshBuilder::kSides);
  b.box({37.0, -0.6, 0.0}, {38.8, 1.2, 1.2}, MeshBuilder::kTop | MeshBuilder::kSides);
  return b.take();
}

}  // namespace

void add_buildings(Scene& scene) {
  const std::uint32_t hangar_mesh = scene.add_mesh(hangar());
  int number = 1;
  for (const double x : {-150.0, -50.0, 50.0, 150.0}) {
    scene.place(hangar_mesh, "hangar_" + std::to_string(number++), {x, 147.0, 0.0});
  }
  scene.place(scene.add_mesh(tower()), "tower", {258.0, 100.0, 0.0});
  scene.place(scene.add_mesh(terminal()), "terminal", {320.0, 110.0, 0.0});
  scene.place(scene.add_mesh(fuel_farm()), "fuel_farm", {-300.0, 90.0, 0.0});
  const std::uint32_t pole = scene.add_mesh(light_pole());
  for (int i = 0; i < 6; ++i) {
    scene.place(pole, "light_pole_" + std::to_string(i + 1), {-200.0 + 80.0 * i, 134.0, 0.0});
  }
  scene.place(scene.add_mesh(clutter()), "clutter", {-60.0, 128.0, 0.0});
}

}  // namespace emit::scenegen
