// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/geometric.hpp>

#include "emit/scene/gltf_import.hpp"
#include "renderer/scene/shape_model.hpp"

namespace emit::scene {
namespace {

using test::PlacedTriangle;
using test::Shape;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

GltfModel load(std::initializer_list<std::pair<std::string, Shape>> shapes) {
  auto model = import_gltf(
      test::write_file(test::test_folder() / "model.gltf", test::text_of(shapes).json()));
  EXPECT_TRUE(model) << (model ? "" : model.error().text);
  return model ? std::move(*model) : GltfModel{};
}

/// Expects that front and normals of every triangle look away from the middle of the box, or up on
/// the ground.
void expect_right(const GltfModel& model) {
  for (const PlacedTriangle& t : test::triangles_of(model)) {
    EXPECT_GT(glm::dot(t.area, t.normal), 0.0);
    const glm::dvec3 outwards = t.corner[0] + t.corner[1] + t.corner[2] - glm::dvec3(0, 3, 0);
    const bool is_ground =
        std::abs(t.corner[0].y) + std::abs(t.corner[1].y) < 1e-9 && std::abs(t.corner[0].x) > 1.5;
    EXPECT_GT(is_ground ? t.area.y : glm::dot(t.area, outwards), 0.0);
  }
}

TEST(Facing, right_models_are_left_alone) {
  const GltfModel model =
      load({{"ground", Shape::ground(-9, -9, 9, 9)}, {"house", Shape::box(true)}});
  expect_right(model);
  EXPECT_THAT(model.warnings, IsEmpty());
}

TEST(Facing, normals_and_winding_of_a_body_are_turned_outwards) {
  for (const bool with_floor : {true, false}) {
    for (const auto& [name, house] :
         {std::pair{"normals", Shape::box(with_floor).turn_normals()},
          std::pair{"winding", Shape::box(with_floor).turn_winding()},
          std::pair{"every second winding", Shape::box(with_floor).turn_winding(2)}}) {
      const GltfModel model = load({{"ground", Shape::ground(-9, -9, 9, 9)}, {"house", house}});
      expect_right(model);
      EXPECT_THAT(model.warnings, Contains(AllOf(HasSubstr("model.gltf"), HasSubstr("mesh 'house'"),
                                                 HasSubstr("normals against their winding"))))
          << name;
      EXPECT_EQ(model.warnings.size(), 1U) << name;
    }
  }
}

TEST(Facing, walls_that_are_meshes_of_their_own_make_one_body) {
  const Shape box = Shape::box(false);
  Shape roof;
  Shape walls;
  for (std::size_t i = 0; i < box.positions.size(); ++i) {
    Shape& part = i < 6 ? roof : walls;
    part.positions.push_back(box.positions[i]);
    part.normals.push_back(box.normals[i]);
  }
  const GltfModel model = load({{"ground", Shape::ground(-9, -9, 9, 9)},
                                {"roof", roof.turn_winding()},
                                {"walls", walls.turn_normals()}});
  expect_right(model);
  EXPECT_THAT(model.warnings, Contains(HasSubstr("mesh 'roof'")));
  EXPECT_THAT(model.warnings, Contains(HasSubstr("mesh 'walls'")));
}

TEST(Facing, ground_with_a_contradiction_faces_up) {
  for (const Shape& ground :
       {Shape::ground(-9, -9, 9, 9).turn_normals(), Shape::ground(-9, -9, 9, 9).turn_winding()}) {
    const GltfModel model = load({{"ground", ground}, {"house", Shape::box(true)}});
    expect_right(model);
    EXPECT_THAT(model.warnings, Contains(HasSubstr("mesh 'ground'")));
  }
}

TEST(Facing, ground_that_is_seen_from_below_only_is_warned_of) {
  const GltfModel model =
      load({{"ground", Shape::ground(-9, -9, 9, 9).turn_winding().turn_normals()},
            {"house", Shape::box(true)}});
  EXPECT_THAT(model.warnings,
              Contains(AllOf(HasSubstr("mesh 'ground'"), HasSubstr("2 triangles face down"))));
}

TEST(Facing, a_body_that_looks_inwards_altogether_is_warned_of) {
  const GltfModel model = load({{"ground", Shape::ground(-9, -9, 9, 9)},
                                {"house", Shape::box(true).turn_winding().turn_normals()}});
  EXPECT_THAT(model.warnings, Contains(AllOf(HasSubstr("mesh 'house'"), HasSubstr("12 triangles"),
                                             HasSubstr("inwards"))));
}

TEST(Facing, the_inner_skin_of_a_hollow_body_is_not_warned_of) {
  for (const bool with_floor : {true, false}) {
    Shape skin = Shape::box(true).turn_winding().turn_normals();
    for (auto& position : skin.positions) {
      position.x *= 0.5F;
      position.y = 0.1F + 0.5F * position.y;
      position.z *= 0.5F;
    }
    const GltfModel model = load({{"ground", Shape::ground(-9, -9, 9, 9)},
                                  {"house", Shape::box(with_floor)},
                                  {"skin", skin}});
    EXPECT_THAT(model.warnings, IsEmpty()) << with_floor;
  }
}

TEST(Facing, single_walls_keep_their_winding) {
  Shape wall;
  wall.add_quad({-1, 0, 0}, {1, 0, 0}, {1, 2, 0}, {-1, 2, 0});
  const GltfModel model = load({{"wall", wall.turn_normals()}});
  for (const PlacedTriangle& t : test::triangles_of(model)) {
    EXPECT_GT(t.area.z, 0.0);
    EXPECT_GT(t.normal.z, 0.0);
  }
  EXPECT_THAT(model.warnings, Contains(HasSubstr("mesh 'wall'")));
}

}  // namespace
}  // namespace emit::scene
