// SPDX-License-Identifier: Apache-2.0
#include "airfield.hpp"

#include <cmath>
#include <random>

#include "emit/physics/constants.hpp"

namespace emit::scenegen {
namespace {

/// Random numbers that are the same with every library: the standard defines the engine, but not
/// the distributions.
class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  double between(double lo, double hi) {
    return lo + (hi - lo) * static_cast<double>(engine_()) / 4294967295.0;
  }

 private:
  std::mt19937 engine_;
};

void add_tree(MeshBuilder& builder, Random& random, double x, double y) {
  const double height = random.between(6.0, 14.0);
  const double radius = height * random.between(0.18, 0.28);
  const double trunk = 0.22 * height;
  builder.material("wood").tube({x, y, 0.0}, {x, y, trunk + 0.3}, 0.25, 0.2, 5, false, false);
  // A crown of three stacked truncated cones looks like a tree and costs 42 triangles.
  builder.material("foliage");
  const double turn = random.between(0.0, 2.0);
  builder.origin({x, y, 0.0}, turn);
  builder.tube({0, 0, trunk}, {0, 0, 0.55 * height}, 0.55 * radius, radius, 7, true, false);
  builder.tube({0, 0, 0.55 * height}, {0, 0, 0.85 * height}, radius, 0.6 * radius, 7, false, false);
  builder.tube({0, 0, 0.85 * height}, {0, 0, height}, 0.6 * radius, 0.0, 7, false, false);
  builder.origin({});
}

void add_fence(MeshBuilder& builder) {
  constexpr double kHalfM = 490.0;
  constexpr double kSpacingM = 10.0;
  builder.material("steel_sheet");
  const auto post = [&builder](double x, double y) {
    builder.tube({x, y, 0.0}, {x, y, 2.4}, 0.06, 0.06, 4, false, true);
  };
  for (double along = -kHalfM; along < kHalfM; along += kSpacingM) {
    post(along, -kHalfM);
    post(kHalfM, along);
    post(-along, kHalfM);
    post(-kHalfM, -along);
  }
  for (const double z : {0.3, 1.3, 2.3}) {
    const glm::dvec3 corners[] = {
        {-kHalfM, -kHalfM, z}, {kHalfM, -kHalfM, z}, {kHalfM, kHalfM, z}, {-kHalfM, kHalfM, z}};
    for (int side = 0; side < 4; ++side) {
      builder.tube(corners[side], corners[(side + 1) % 4], 0.03, 0.03, 4, false, false);
    }
  }
}

}  // namespace

void add_trees_and_fence(Scene& scene, std::uint32_t seed) {
  Random random(seed);
  MeshBuilder fence("fence");
  add_fence(fence);
  scene.place(scene.add_mesh(fence.take()), "fence");
  MeshBuilder trees("trees");
  for (int i = 0; i < 150; ++i) {  // a wood in the north
    add_tree(trees, random, random.between(-480.0, 480.0), random.between(300.0, 480.0));
  }
  for (int i = 0; i < 60; ++i) {  // an avenue outside the southern fence
    add_tree(trees, random, -590.0 + 20.0 * i + random.between(-3.0, 3.0),
             -520.0 + random.between(-6.0, 6.0));
  }
  for (int i = 0; i < 24; ++i) {  // single trees between the buildings
    add_tree(trees, random, random.between(-460.0, -330.0), random.between(20.0, 180.0));
  }
  scene.place(scene.add_mesh(trees.take()), "trees");
}

}  // namespace emit::scenegen
