// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <utility>

#include "airfield.hpp"
#include "emit/physics/constants.hpp"
#include "random.hpp"

namespace emit::scenegen {
namespace {

constexpr double kRunwaySouth = -272.5;
constexpr double kRunwayNorth = -227.5;

/// Joints are sealed with bitumen.
constexpr const char* kJoint = "asphalt_new";

/// Material of one slab: most are worn, some are the oldest, some were replaced.
const char* slab_material(Random& random) {
  const std::uint32_t draw = random.below(10);
  return draw < 5   ? "concrete_pavement_worn"
         : draw < 8 ? "concrete_pavement_old"
                    : "concrete_pavement";
}

/// Fills a rectangle with cells of one material, which keeps triangles in shape.
void add_cells(GroundPlan& plan, double x0, double y0, double x1, double y1, int columns, int rows,
               const char* material) {
  plan.slabs(x0, y0, x1, y1, columns, rows, 0.0, material, [&](int, int) { return material; });
}

/// Adds fields far around the fence for views from high above, and the grass within it.
void add_fields(GroundPlan& plan) {
  plan.rectangle(-3000.0, -3000.0, 3000.0, 3000.0, "grass");
  plan.rectangle(-3000.0, 700.0, -600.0, 1900.0, "soil");
  plan.rectangle(900.0, 600.0, 2400.0, 3000.0, "soil");
  plan.rectangle(-1500.0, -2200.0, 400.0, -900.0, "soil");
  plan.rectangle(1100.0, -1700.0, 3000.0, -600.0, "soil");
  plan.rectangle(-560.0, 720.0, 160.0, 1500.0, "crops");
  plan.rectangle(200.0, 720.0, 860.0, 1300.0, "crops");
  plan.rectangle(-2700.0, -1300.0, -1560.0, -500.0, "crops");
  add_cells(plan, -500.0, -500.0, 500.0, 500.0, 8, 8, "grass");
  // The strip beside the runway is mown, and vehicles have worn its edge.
  add_cells(plan, -490.0, -340.0, 490.0, -160.0, 8, 1, "lawn");
  plan.polygon(
      {{-60.0, -168.0}, {-16.0, -150.0}, {-14.0, -134.0}, {-34.0, -128.0}, {-66.0, -140.0}},
      "soil");
  plan.polygon({{118.0, -82.0}, {150.0, -84.0}, {162.0, -70.0}, {134.0, -62.0}, {116.0, -66.0}},
               "soil");
  // A track of gravel follows the fence.
  constexpr double kTrackM = 480.0;
  const std::array<glm::dvec2, 5> corners = {glm::dvec2(-kTrackM, -kTrackM),
                                             {kTrackM, -kTrackM},
                                             {kTrackM, kTrackM},
                                             {-kTrackM, kTrackM},
                                             {-kTrackM, -kTrackM}};
  for (std::size_t side = 0; side < 4; ++side) {
    const glm::dvec2 low = glm::min(corners[side], corners[side + 1]) - 2.0;
    const glm::dvec2 high = glm::max(corners[side], corners[side + 1]) + 2.0;
    plan.rectangle(low.x, low.y, high.x, high.y, "gravel");
  }
}

void add_runway(GroundPlan& plan, Random& random) {
  plan.rectangle(-495.0, kRunwaySouth - 7.5, 495.0, kRunwayNorth + 7.5, "gravel");
  add_cells(plan, -360.0, kRunwaySouth, 360.0, kRunwayNorth, 12, 2, "asphalt");
  for (int i = 0; i < 14; ++i) {  // repairs, in lanes of the paver
    const double x = std::round(random.between(-350.0, 310.0));
    const double y = kRunwaySouth + 4.5 * random.below(10);
    plan.rectangle(x, y, x + std::round(random.between(8.0, 40.0)), y + 4.5, "asphalt_new");
  }
  for (const double west : {-480.0, 360.0}) {  // both ends are concrete
    plan.slabs(west, kRunwaySouth, west + 120.0, kRunwayNorth, 16, 6, 0.0, kJoint,
               [&](int, int) { return slab_material(random); });
  }
}

/// Adds the rounded inner corner of two taxiways: `x`, `y` is where their edges meet, and the
/// corner opens towards `east` and `north`, each 1 or -1.
void add_fillet(GroundPlan& plan, double x, double y, double east, double north) {
  constexpr double kRadiusM = 20.0;
  constexpr int kSteps = 6;
  std::vector<glm::dvec2> corners = {{x, y}};
  for (int i = 0; i <= kSteps; ++i) {
    const double angle = 0.5 * physics::kPi * i / kSteps;
    corners.emplace_back(x + east * kRadiusM * (1.0 - std::cos(angle)),
                         y + north * kRadiusM * (1.0 - std::sin(angle)));
  }
  plan.polygon(std::move(corners), "asphalt");
}

void add_taxiways(GroundPlan& plan, Random& random) {
  for (const double x : {-400.0, 0.0, 400.0}) {
    add_cells(plan, x - 12.0, kRunwayNorth, x + 12.0, -110.0, 1, 5, "asphalt");
    for (const double side : {-1.0, 1.0}) {
      add_fillet(plan, x + 12.0 * side, kRunwayNorth, side, 1.0);
      add_fillet(plan, x + 12.0 * side, -110.0, side, -1.0);
    }
  }
  add_cells(plan, -480.0, -110.0, 480.0, -90.0, 24, 1, "asphalt");
  for (const double x : {-100.0, 100.0}) {
    add_cells(plan, x - 12.0, -90.0, x + 12.0, 20.0, 1, 5, "asphalt");
    for (const double side : {-1.0, 1.0}) {
      add_fillet(plan, x + 12.0 * side, -90.0, side, 1.0);
      add_fillet(plan, x + 12.0 * side, 20.0, side, -1.0);
    }
  }
  for (int i = 0; i < 10; ++i) {
    const double x = std::round(random.between(-440.0, 420.0));
    const double y = -110.0 + 5.0 * random.below(4);
    plan.rectangle(x, y, x + std::round(random.between(5.0, 24.0)), y + 5.0, "asphalt_new");
  }
}

/// Adds repairs, a trench and sealed cracks to the asphalt of the apron.
void add_apron_repairs(GroundPlan& plan, Random& random) {
  for (const auto& [x0, y0, x1, y1] : {std::array{-36.0, 50.0, -22.0, 57.0},
                                       {21.0, 46.0, 37.0, 51.0},
                                       {24.0, 85.0, 33.0, 91.5},
                                       {-112.0, 52.0, -92.0, 66.0},
                                       {-26.0, 24.0, -6.0, 29.0},
                                       {86.0, 76.0, 99.0, 98.0},
                                       {180.0, 60.0, 205.0, 66.0},
                                       {-205.0, 96.0, -176.0, 104.0},
                                       {96.0, 26.0, 104.0, 38.0}}) {
    plan.rectangle(x0, y0, x1, y1, "asphalt_new");
  }
  plan.band({{-38.0, 22.0}, {-38.0, 62.0}, {-30.0, 76.0}, {-30.0, 93.0}}, 1.2, "asphalt_new");
  for (int i = 0; i < 12; ++i) {
    // A crack goes on in its direction and turns a little at each bend.
    glm::dvec2 at(random.between(-75.0, 75.0), random.between(24.0, 60.0));
    double heading = random.below(2) == 0 ? random.between(-0.4, 0.4) : random.between(1.1, 1.9);
    std::vector<glm::dvec2> points = {at};
    const std::uint32_t bends = 4 + random.below(4);
    for (std::uint32_t bend = 0; bend < bends; ++bend) {
      heading += random.between(-0.45, 0.45);
      at += random.between(1.6, 3.6) * glm::dvec2(std::cos(heading), std::sin(heading));
      points.push_back(at);
    }
    plan.band(points, 0.12, kJoint);
  }
}

void add_apron(GroundPlan& plan, Random& random) {
  add_cells(plan, -220.0, 20.0, 220.0, 138.0, 12, 3, "asphalt");
  add_apron_repairs(plan, random);
  const auto slab = [&](int, int) { return slab_material(random); };
  for (const double x : {-140.0, -60.0, 60.0, 140.0}) {  // stands of the airliners
    plan.slabs(x - 18.75, 62.0, x + 18.75, 122.0, 5, 8, 0.04, kJoint, slab);
  }
  plan.slabs(-220.0, 138.0, 220.0, 146.0, 44, 1, 0.04, kJoint, slab);  // before the hangars
  for (const double x : {-150.0, -50.0, 50.0, 150.0}) {
    plan.rectangle(x - 22.0, 146.0, x + 22.0, 190.0, "concrete_pavement");  // hangar floors
  }
  // Add the service bay beside the place of the demo's truck.
  plan.slabs(-40.0, 95.0, 40.0, 115.0, 16, 4, 0.04, kJoint, slab);
}

void add_roads(GroundPlan& plan) {
  plan.rectangle(-490.0, 225.0, 490.0, 233.0, "asphalt");
  plan.rectangle(236.0, 60.0, 244.0, 229.0, "asphalt");
  plan.rectangle(215.0, 60.0, 244.0, 68.0, "asphalt");
  plan.rectangle(280.0, 150.0, 360.0, 200.0, "asphalt");  // car park
  plan.rectangle(244.0, 170.0, 285.0, 178.0, "asphalt");
  plan.rectangle(-330.0, 70.0, -270.0, 110.0, "gravel");  // fuel farm
  plan.rectangle(-275.0, 84.0, -215.0, 92.0, "asphalt");
}

}  // namespace

void add_ground(Scene& scene, std::uint32_t seed) {
  Random random(seed);
  GroundPlan plan;
  add_fields(plan);
  add_runway(plan, random);
  add_taxiways(plan, random);
  add_apron(plan, random);
  add_roads(plan);
  add_tyre_marks(plan, seed);
  add_markings(plan);
  scene.place(scene.add_mesh(plan.mesh("ground")), "ground");
}

}  // namespace emit::scenegen
