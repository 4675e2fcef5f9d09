// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "emit/scenegen/generate.hpp"
#include "ground_plan.hpp"
#include "mesh_builder.hpp"

/// Plan of the airfield, metres, x east and y north of the reference point:
///   runway     y -272.5 .. -227.5, x -480 .. 480      taxiway  y -110 .. -90, x -480 .. 480
///   links      x -400, 0, 400 between them            apron    x -220 .. 220, y 20 .. 140
///   hangars    y 146 .. 190, x -150, -50, 50, 150     tower    x 250, y 100
///   car park   x 280 .. 360, y 150 .. 200             fuel farm x -300, y 90
///   fence along x, y = +-490; trees in the north and along the fence; fields out to 3 km.
/// The middle of the apron is asphalt, with repairs, a trench and sealed cracks; stands, service
/// bay and runway ends are concrete slabs of several ages. Paint, rubber and joints are cut into
/// the ground.
namespace emit::scenegen {

/// Adds the ground: grass, asphalt, concrete, markings and marks of wear. The same seed gives the
/// same slabs, repairs and tyre marks.
void add_ground(Scene& scene, std::uint32_t seed);
/// Adds the rubber that tyres have left on runway and taxiways to a plan of the ground.
void add_tyre_marks(GroundPlan& plan, std::uint32_t seed);
/// Adds painted markings to a plan of the ground, above everything else.
void add_markings(GroundPlan& plan);
/// Adds the buildings.
void add_buildings(Scene& scene);
/// Adds trees and the fence. The same seed gives the same trees.
void add_trees_and_fence(Scene& scene, std::uint32_t seed);

/// Returns file stem and scene of each vehicle. The origin is on the ground under the middle of the
/// vehicle, +x is forward.
[[nodiscard]] std::vector<std::pair<std::string, Scene>> vehicle_scenes();

}  // namespace emit::scenegen
