// SPDX-License-Identifier: Apache-2.0
#include "tool/scenes/material_guess.hpp"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "tool/scenes/scene_check.hpp"

namespace emit::tool {
namespace {

std::vector<scene::Material> library() {
  std::vector<scene::Material> out;
  for (const char* name :
       {"asphalt", "concrete", "rubber", "glass", "steel", "painted_metal", "wood", "foliage",
        "aircraft_skin", "grass", "fabric", "roof_concrete", "steel_sheet"}) {
    out.emplace_back().name = name;
  }
  return out;
}

TEST(MaterialGuess, words_of_modellers_find_the_library) {
  const std::vector<scene::Material> materials = library();
  for (const auto& [name, material] :
       {std::pair{"Tyre_Front.001", "rubber"}, std::pair{"CarPaint", "painted_metal"},
        std::pair{"WindowGlass", "glass"}, std::pair{"frontwindscreen", "glass"},
        std::pair{"MAT_Wheel_Rims", "steel"}, std::pair{"Leaves2", "foliage"},
        std::pair{"fuselage skin", "aircraft_skin"}, std::pair{"Asphalt_Wet", "asphalt"},
        std::pair{"truck_canvas", "fabric"}, std::pair{"SteelBeam", "steel"}}) {
    EXPECT_EQ(guess_material(name, materials).material, material) << name;
    EXPECT_FALSE(guess_material(name, materials).exact) << name;
  }
}

TEST(MaterialGuess, names_of_the_library_are_no_guess) {
  const MaterialGuess guess = guess_material("concrete", library());
  EXPECT_TRUE(guess.exact);
  EXPECT_EQ(guess.material, "concrete");
}

TEST(MaterialGuess, what_says_nothing_or_is_not_in_the_library_is_not_guessed) {
  const std::vector<scene::Material> materials = library();
  // "ice" stands in "device", "sea" in "seal", and no library material is water.
  for (const char* name : {"", "material 3", "Device", "seal_A", "Water", "red"}) {
    EXPECT_EQ(guess_material(name, materials).material, "") << name;
  }
}

TEST(LikelyScale, sizes_of_other_units_come_near_those_of_vehicles) {
  for (const double likely_m : {0.3, 4.5, 12.0, 60.0}) EXPECT_EQ(likely_scale(likely_m), 1.0);
  EXPECT_EQ(likely_scale(450.0), 0.01);
  EXPECT_EQ(likely_scale(4500.0), 0.001);
  EXPECT_EQ(likely_scale(0.0045), 1000.0);
}

}  // namespace
}  // namespace emit::tool
