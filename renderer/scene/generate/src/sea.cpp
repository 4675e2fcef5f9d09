// SPDX-License-Identifier: Apache-2.0
#include "sea.hpp"

namespace emit::scenegen {
namespace {

Scene water() {
  constexpr double kHalfM = 4000.0;
  constexpr std::uint32_t kCells = 40;
  Scene scene;
  MeshBuilder b("sea");
  b.material("sea");
  b.grid_quad({-kHalfM, -kHalfM, 0.0}, {kHalfM, -kHalfM, 0.0}, {kHalfM, kHalfM, 0.0},
              {-kHalfM, kHalfM, 0.0}, kCells, kCells);
  scene.place(scene.add_mesh(b.take()), "sea");
  return scene;
}

Scene ship() {
  Scene scene;
  scene.axes = Axes::vehicle;
  MeshBuilder b("ship");
  // Hull, from 2.5 m below the water line to the deck.
  b.material("vehicle_grey");
  b.prism({{-30.0, -4.0},
           {15.0, -4.5},
           {24.0, -2.8},
           {30.0, 0.0},
           {24.0, 2.8},
           {15.0, 4.5},
           {-30.0, 4.0}},
          -2.5, 3.6);
  // Deck house with a bridge, mast and a gun.
  b.box({-16.0, -3.4, 3.6}, {9.0, 3.4, 6.4}, MeshBuilder::kTop | MeshBuilder::kSides);
  b.box({-2.0, -3.0, 6.4}, {8.0, 3.0, 7.4}, MeshBuilder::kSides);
  b.material("window").box({-2.0, -3.0, 7.4}, {8.0, 3.0, 8.4}, MeshBuilder::kSides);
  b.material("vehicle_grey").box({-2.3, -3.3, 8.4}, {8.3, 3.3, 8.8});
  b.tube({0.0, 0.0, 8.8}, {0.0, 0.0, 16.0}, 0.35, 0.15, 12);
  b.box({-1.0, -2.0, 12.0}, {0.6, 2.0, 12.5});
  b.tube({18.0, 0.0, 3.6}, {18.0, 0.0, 5.4}, 1.5, 1.2, 20);
  b.tube({18.5, 0.0, 5.0}, {23.5, 0.0, 5.6}, 0.12, 0.12, 10);
  // Funnel.
  b.material("painted_metal")
      .box({-13.0, -1.8, 6.4}, {-8.0, 1.8, 9.6}, MeshBuilder::kTop | MeshBuilder::kSides);
  // Boat on the after deck.
  b.material("rubber").lathe_x({{-26.0, 0.0}, {-25.8, 0.5}, {-21.0, 0.5}, {-19.5, 0.0}},
                               {0.0, 0.0, 4.2}, 16);
  scene.place(scene.add_mesh(b.take()), "ship");
  return scene;
}

}  // namespace

std::vector<std::pair<std::string, Scene>> sea_scenes() {
  std::vector<std::pair<std::string, Scene>> out;
  out.emplace_back("sea", water());
  out.emplace_back("ship", ship());
  return out;
}

}  // namespace emit::scenegen
