// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "airfield.hpp"
#include "emit/physics/constants.hpp"

namespace emit::scenegen {
namespace {

/// Adds a pair of wheels on an axle across the vehicle.
void add_wheels(MeshBuilder& b, double x, double half_track_m, double radius_m, double width_m) {
  b.material("rubber");
  for (const double side : {-1.0, 1.0}) {
    const double outer = side * half_track_m;
    const double inner = side * (half_track_m - width_m);
    b.tube({x, std::min(inner, outer), radius_m}, {x, std::max(inner, outer), radius_m}, radius_m,
           radius_m, 14);
  }
}

/// Returns a lorry with a box body, 8.4 x 2.5 x 3.4 m. The floor is 0.9 m above the ground.
SceneMesh truck() {
  MeshBuilder b("truck");
  b.material("painted_metal");
  b.box({-4.2, -1.25, 1.05}, {1.9, 1.25, 3.4});  // box body
  b.profile({{2.1, 0.55}, {4.1, 0.55}, {4.2, 1.6}, {3.85, 2.75}, {2.1, 2.85}}, -1.2, 1.2);  // cab
  b.material("glass");
  b.quad({4.205, 1.05, 1.62}, {3.86, 1.05, 2.70}, {3.86, -1.05, 2.70}, {4.205, -1.05, 1.62});
  b.quad({2.5, -1.21, 1.7}, {3.7, -1.21, 1.7}, {3.6, -1.21, 2.5}, {2.5, -1.21, 2.5});
  b.quad({3.7, 1.21, 1.7}, {2.5, 1.21, 1.7}, {2.5, 1.21, 2.5}, {3.6, 1.21, 2.5});
  b.material("steel_sheet");
  b.box({-4.0, -0.5, 0.75}, {3.9, 0.5, 1.05});  // frame
  b.box({-0.6, 0.75, 0.5}, {1.1, 1.15, 1.0});   // tank
  b.material("engine_warm");
  b.quad({4.16, -0.8, 0.7}, {4.16, 0.8, 0.7}, {4.21, 0.8, 1.45}, {4.21, -0.8, 1.45});  // radiator
  b.material("exhaust_hot");
  b.tube({2.0, -1.05, 1.0}, {2.0, -1.05, 3.2}, 0.09, 0.09, 10);
  add_wheels(b, 3.2, 1.22, 0.5, 0.32);
  add_wheels(b, -1.9, 1.22, 0.5, 0.5);
  add_wheels(b, -3.1, 1.22, 0.5, 0.5);
  return b.take();
}

SceneMesh fuel_truck() {
  MeshBuilder b("fuel_truck");
  b.material("painted_metal");
  b.profile({{2.4, 0.55}, {4.4, 0.55}, {4.5, 1.6}, {4.15, 2.65}, {2.4, 2.75}}, -1.2, 1.2);
  b.material("steel_sheet");
  b.box({-4.6, -0.5, 0.75}, {4.2, 0.5, 1.05});
  b.material("aluminium");
  b.lathe_x({{-4.6, 0.0},
             {-4.5, 0.6},
             {-4.2, 1.05},
             {-3.9, 1.15},
             {1.5, 1.15},
             {1.8, 1.05},
             {2.1, 0.6},
             {2.2, 0.0}},
            {0.0, 0.0, 2.1}, 20, 0.9);
  b.material("glass");
  b.quad({4.505, 1.05, 1.62}, {4.16, 1.05, 2.60}, {4.16, -1.05, 2.60}, {4.505, -1.05, 1.62});
  b.material("exhaust_hot");
  b.tube({2.25, -1.05, 1.0}, {2.25, -1.05, 3.0}, 0.08, 0.08, 10);
  add_wheels(b, 3.5, 1.22, 0.5, 0.32);
  add_wheels(b, -2.3, 1.22, 0.5, 0.5);
  add_wheels(b, -3.5, 1.22, 0.5, 0.5);
  return b.take();
}

SceneMesh car() {
  MeshBuilder b("car");
  b.material("painted_metal");
  b.profile({{-2.15, 0.35}, {2.15, 0.35}, {2.2, 0.7}, {0.95, 0.95}, {-2.0, 1.0}, {-2.2, 0.7}},
            -0.88, 0.88);
  b.profile({{-1.1, 1.4}, {-1.5, 0.98}, {0.95, 0.95}, {0.25, 1.4}}, -0.74, 0.74);
  b.material("glass");
  b.quad({0.97, 0.7, 0.98}, {0.29, 0.66, 1.38}, {0.29, -0.66, 1.38}, {0.97, -0.7, 0.98});
  b.quad({-1.2, -0.745, 1.02}, {0.55, -0.745, 1.02}, {0.2, -0.745, 1.34}, {-1.0, -0.745, 1.34});
  b.quad({0.55, 0.745, 1.02}, {-1.2, 0.745, 1.02}, {-1.0, 0.745, 1.34}, {0.2, 0.745, 1.34});
  b.material("engine_warm");
  b.quad({2.19, -0.5, 0.4}, {2.19, 0.5, 0.4}, {2.215, 0.5, 0.65}, {2.215, -0.5, 0.65});
  add_wheels(b, 1.35, 0.85, 0.32, 0.2);
  add_wheels(b, -1.3, 0.85, 0.32, 0.2);
  return b.take();
}

/// Adds a thin lifting surface from a plan outline (x, y), counter-clockwise seen from above.
void add_fin(MeshBuilder& b, const std::vector<glm::dvec2>& outline, double z_m,
             double thickness_m) {
  b.prism(outline, z_m - 0.5 * thickness_m, z_m + 0.5 * thickness_m);
}

/// Returns a single-engine jet, 11.4 m long, 8.6 m span, that stands on its wheels with the engine
/// running.
SceneMesh jet() {
  MeshBuilder b("jet");
  const glm::dvec3 axis(0.0, 0.0, 1.75);
  b.material("aluminium");
  b.lathe_x({{-5.2, 0.52},
             {-4.2, 0.66},
             {-2.0, 0.78},
             {0.5, 0.80},
             {2.5, 0.70},
             {4.2, 0.45},
             {5.4, 0.18},
             {5.9, 0.0}},
            axis, 24, 1.05);
  add_fin(b, {{-2.6, 0.5}, {1.2, 0.5}, {-1.2, 4.3}, {-2.4, 4.3}}, 1.65, 0.12);
  add_fin(b, {{-2.6, -0.5}, {-2.4, -4.3}, {-1.2, -4.3}, {1.2, -0.5}}, 1.65, 0.12);
  add_fin(b, {{-5.3, 0.4}, {-3.7, 0.4}, {-4.7, 2.1}, {-5.4, 2.1}}, 1.8, 0.09);
  add_fin(b, {{-5.3, -0.4}, {-5.4, -2.1}, {-4.7, -2.1}, {-3.7, -0.4}}, 1.8, 0.09);
  b.profile({{-5.4, 2.2}, {-3.2, 2.2}, {-4.7, 4.2}, {-5.5, 4.2}}, -0.06, 0.06);  // fin
  for (const double side : {-1.0, 1.0}) {                                        // intakes
    const double inner = side * 0.7;
    const double outer = side * 1.1;
    b.box({-1.5, std::min(inner, outer), 1.35}, {1.6, std::max(inner, outer), 2.0});
  }
  b.material("glass").lathe_x({{1.2, 0.0}, {1.5, 0.28}, {2.4, 0.42}, {3.4, 0.26}, {3.8, 0.0}},
                              {0.0, 0.0, 2.25}, 14, 1.1);
  b.material("engine_warm").tube({-5.2, 0, 1.75}, {-4.6, 0, 1.75}, 0.53, 0.64, 20, false, false);
  b.material("nozzle_hot");
  b.tube({-5.6, 0, 1.75}, {-5.2, 0, 1.75}, 0.44, 0.52, 20, false, false);
  // Add the glowing turbine that shows through the nozzle, facing aft.
  std::vector<glm::dvec3> disc;
  for (int i = 0; i < 20; ++i) {
    const double angle = -2.0 * physics::kPi * i / 20.0;
    disc.emplace_back(-5.45, 0.46 * std::cos(angle), 1.75 + 0.46 * std::sin(angle));
  }
  b.polygon(disc);
  b.material("steel_sheet");
  b.tube({3.0, 0, 0.4}, {3.0, 0, 1.4}, 0.07, 0.07, 8, false, false);
  b.tube({-1.2, 1.3, 0.4}, {-1.2, 1.1, 1.65}, 0.08, 0.08, 8, false, false);
  b.tube({-1.2, -1.3, 0.4}, {-1.2, -1.1, 1.65}, 0.08, 0.08, 8, false, false);
  b.material("rubber");
  b.tube({3.0, -0.1, 0.3}, {3.0, 0.1, 0.3}, 0.3, 0.3, 12);
  b.tube({-1.2, 1.2, 0.38}, {-1.2, 1.42, 0.38}, 0.38, 0.38, 12);
  b.tube({-1.2, -1.42, 0.38}, {-1.2, -1.2, 0.38}, 0.38, 0.38, 12);
  return b.take();
}

/// Returns a twin-engine airliner, 36 m long, 34 m span.
SceneMesh airliner() {
  MeshBuilder b("airliner");
  b.material("painted_metal");
  b.lathe_x({{-18.0, 0.3},
             {-14.0, 1.2},
             {-9.0, 1.95},
             {12.0, 1.95},
             {15.5, 1.6},
             {17.4, 0.7},
             {18.0, 0.0}},
            {0.0, 0.0, 3.9}, 24);
  b.material("aluminium");
  add_fin(b, {{-3.0, 1.5}, {3.5, 1.5}, {-3.6, 17.0}, {-5.4, 17.0}}, 3.2, 0.35);
  add_fin(b, {{-3.0, -1.5}, {-5.4, -17.0}, {-3.6, -17.0}, {3.5, -1.5}}, 3.2, 0.35);
  add_fin(b, {{-17.2, 0.6}, {-13.8, 0.6}, {-16.4, 6.2}, {-18.0, 6.2}}, 4.8, 0.2);
  add_fin(b, {{-17.2, -0.6}, {-18.0, -6.2}, {-16.4, -6.2}, {-13.8, -0.6}}, 4.8, 0.2);
  b.profile({{-17.4, 5.2}, {-12.2, 5.6}, {-16.4, 11.2}, {-18.4, 11.2}}, -0.14, 0.14);
  for (const double side : {-1.0, 1.0}) {
    b.material("painted_metal")
        .tube({-0.6, side * 5.6, 2.1}, {3.0, side * 5.6, 2.1}, 0.8, 1.0, 18, false, true);
    b.material("engine_warm").tube({-1.6, side * 5.6, 2.1}, {-0.6, side * 5.6, 2.1}, 0.5, 0.8, 18);
    b.material("rubber").tube({-1.5, side * 2.9 - 0.4, 0.55}, {-1.5, side * 2.9 + 0.4, 0.55}, 0.55,
                              0.55, 12);
    b.material("steel_sheet")
        .tube({-1.5, side * 2.9, 0.5}, {-1.5, side * 2.6, 3.2}, 0.18, 0.18, 8, false, false);
  }
  b.material("rubber").tube({13.0, -0.3, 0.4}, {13.0, 0.3, 0.4}, 0.4, 0.4, 12);
  b.material("steel_sheet").tube({13.0, 0, 0.4}, {13.0, 0, 2.2}, 0.12, 0.12, 8, false, false);
  b.material("glass").quad({16.72, -0.7, 4.62}, {16.72, 0.7, 4.62}, {15.9, 0.6, 5.16},
                           {15.9, -0.6, 5.16});
  return b.take();
}

Scene single(SceneMesh mesh) {
  Scene scene;
  scene.axes = Axes::vehicle;
  const std::string name = mesh.name;
  scene.place(scene.add_mesh(std::move(mesh)), name);
  return scene;
}

}  // namespace

std::vector<std::pair<std::string, Scene>> vehicle_scenes() {
  std::vector<std::pair<std::string, Scene>> scenes;
  scenes.emplace_back("truck", single(truck()));
  scenes.emplace_back("fuel_truck", single(fuel_truck()));
  scenes.emplace_back("car", single(car()));
  scenes.emplace_back("jet", single(jet()));
  scenes.emplace_back("airliner", single(airliner()));
  return scenes;
}

}  // namespace emit::scenegen
