// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "emit/scene/inspect.hpp"
#include "emit/scene/mesh.hpp"
#include "renderer/scene/gltf_builder.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using test::GltfText;
using test::test_folder;
using test::write_file;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

Material named(const std::string& name) {
  Material material;
  material.name = name;
  material.emissivity_frac = 0.9;
  return material;
}

/// Returns a pose that is level and heads north.
physics::Pose north(const glm::dvec3& position = {0, 0, 0}) {
  return {position, glm::dquat(0.0, std::sqrt(0.5), std::sqrt(0.5), 0.0)};
}

ScenarioDesc scenario_of(const std::filesystem::path& gltf) {
  ScenarioDesc scenario;
  scenario.file = "test.toml";
  scenario.materials = {named("asphalt"), named("concrete"), named("steel")};
  scenario.default_material = "concrete";
  ObjectDesc object;
  object.name = "thing";
  object.gltf = gltf;
  object.instances = {north()};
  scenario.objects = {object};
  return scenario;
}

ScenarioDesc one_triangle(const std::string& materials = "",
                          const std::string& primitive_end = "") {
  GltfText text;
  text.materials = materials;
  text.primitive = R"({"attributes":{"POSITION":0},"indices":1)" + primitive_end + "}";
  return scenario_of(write_file(test_folder() / "thing.gltf", text.json()));
}

glm::dvec3 world_point(const SceneGeometry& scene, const glm::dvec3& gltf_m) {
  return glm::dvec3(scene.instances.at(0).world_from_mesh * glm::dvec4(gltf_m, 1.0));
}
void expect_near(const glm::dvec3& a, const glm::dvec3& b) {
  EXPECT_LT(glm::length(a - b), 1e-9) << "(" << a.x << ", " << a.y << ", " << a.z << ")";
}

TEST(SceneOrientation, default_pose_stands_upright_with_gltf_forward_to_the_north) {
  const auto scene = load_scene(one_triangle());
  ASSERT_TRUE(scene) << scene.error().text;
  expect_near(world_point(*scene, {0, 1, 0}), {0, 0, 1});   // up stays up
  expect_near(world_point(*scene, {0, 0, 1}), {0, 1, 0});   // forward points north
  expect_near(world_point(*scene, {1, 0, 0}), {-1, 0, 0});  // left points west
}

TEST(SceneOrientation, body_axes_are_forward_right_down) {
  const glm::dmat4 body = body_from_gltf();
  expect_near(glm::dvec3(body * glm::dvec4(0, 0, 1, 0)), {1, 0, 0});
  expect_near(glm::dvec3(body * glm::dvec4(-1, 0, 0, 0)), {0, 1, 0});
  expect_near(glm::dvec3(body * glm::dvec4(0, -1, 0, 0)), {0, 0, 1});
  EXPECT_DOUBLE_EQ(glm::determinant(body), 1.0);
}

TEST(SceneOrientation, heading_turns_clockwise_and_pitch_lifts_the_nose) {
  ScenarioDesc scenario = one_triangle();
  scenario.objects[0].instances[0].position_world_m = {100, 200, 5};
  scenario.objects[0].instances[0].world_from_body =
      physics::world_from_body_heading_pitch_roll(std::acos(0.0), 0.0, 0.0);
  const auto east = load_scene(scenario);
  ASSERT_TRUE(east);
  expect_near(world_point(*east, {0, 0, 1}), {101, 200, 5});
  expect_near(world_point(*east, {1, 0, 0}), {100, 201, 5});
  scenario.objects[0].instances[0].world_from_body =
      physics::world_from_body_heading_pitch_roll(0.0, 0.5, 0.0);
  const auto climbing = load_scene(scenario);
  ASSERT_TRUE(climbing);
  EXPECT_GT(world_point(*climbing, {0, 0, 1}).z, 5.4);
}

TEST(SceneOrientation, scale_applies_to_the_geometry_not_to_the_place) {
  ScenarioDesc scenario = one_triangle();
  scenario.objects[0].scale = 3.0;
  scenario.objects[0].instances[0].position_world_m = {10, 0, 0};
  const auto scene = load_scene(scenario);
  ASSERT_TRUE(scene);
  expect_near(world_point(*scene, {0, 1, 0}), {10, 0, 3});
}

TEST(SceneOrientation, a_model_is_turned_and_offset_in_its_body) {
  ScenarioDesc scenario = one_triangle();
  ObjectDesc& object = scenario.objects[0];
  // The model's nose lies along glTF +x, which is left. A quarter turn to the right brings it
  // forward.
  object.model_rotation_rad = {std::acos(0.0), 0.0, 0.0};
  object.model_offset_m = {0.0, 2.0, -1.0};
  object.scale = 3.0;
  const auto turned = load_scene(scenario);
  ASSERT_TRUE(turned);
  expect_near(world_point(*turned, {0, 0, 0}), {2, 0, 1});  // right is east, and up
  expect_near(world_point(*turned, {1, 0, 0}), {2, 3, 1});
  expect_near(world_point(*turned, {0, 1, 0}), {2, 0, 4});
  object.model_offset_m = {0.0, 0.0, 0.0};
  object.scale = 1.0;
  object.model_rotation_rad = {0.0, std::acos(0.0), 0.0};
  expect_near(world_point(*load_scene(scenario), {0, 0, 1}), {0, 0, 1});  // nose up
  object.model_rotation_rad = {0.0, 0.0, std::acos(0.0)};
  expect_near(world_point(*load_scene(scenario), {-1, 0, 0}), {0, 0, -1});  // right side down
}

TEST(LoadScene, materials_map_by_table_then_object_then_name_then_default) {
  const std::string materials = R"({"name":"paint"},{"name":"steel"},{"name":"unknown"})";
  const auto material_of = [&](int gltf, auto change) {
    ScenarioDesc scenario = one_triangle(materials, R"(,"material":)" + std::to_string(gltf));
    change(scenario.objects[0]);
    const auto scene = load_scene(scenario);
    EXPECT_TRUE(scene);
    return scene->materials.at(scene->meshes.at(0).submeshes.at(0).material).name;
  };
  const auto nothing = [](ObjectDesc&) {};
  EXPECT_EQ(material_of(1, nothing), "steel");
  EXPECT_EQ(material_of(2, nothing), "concrete");
  EXPECT_EQ(material_of(0, [](ObjectDesc& o) { o.material_map["paint"] = "asphalt"; }), "asphalt");
  EXPECT_EQ(material_of(1, [](ObjectDesc& o) { o.material = "asphalt"; }), "asphalt");
  EXPECT_EQ(material_of(1,
                        [](ObjectDesc& o) {
                          o.material = "asphalt";
                          o.material_map["steel"] = "steel";
                        }),
            "steel");
}

TEST(LoadScene, default_material_is_entry_zero_and_its_use_is_warned_of) {
  const auto scene = load_scene(one_triangle(R"({"name":"unobtainium"})", R"(,"material":0)"));
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene->materials.at(0).name, "concrete");
  EXPECT_EQ(scene->meshes.at(0).submeshes.at(0).material, 0U);
  EXPECT_THAT(scene->warnings,
              Contains(AllOf(HasSubstr("thing.gltf"), HasSubstr("'unobtainium'"))));
  EXPECT_EQ(scene->mappings.at(0).by, MappedBy::fallback);
}

TEST(LoadScene, keys_of_the_map_that_no_material_has_are_warned_of) {
  const auto warnings_of = [](const std::string& key, const std::string& materials) {
    ScenarioDesc scenario = one_triangle(materials, materials.empty() ? "" : R"(,"material":0)");
    scenario.objects[0].material_map = {{key, "asphalt"}};
    const auto scene = load_scene(scenario);
    EXPECT_TRUE(scene);
    return scene ? scene->warnings : std::vector<std::string>();
  };
  const std::string materials = R"({"name":"concrete"},{"name":"wheel"})";
  EXPECT_THAT(warnings_of("Concrete", materials),
              Contains(AllOf(HasSubstr("object 'thing'"), HasSubstr("thing.gltf"),
                             HasSubstr("'Concrete', did you mean 'concrete'?"))));
  EXPECT_THAT(warnings_of("glass", materials), Contains(HasSubstr("it has 'concrete', 'wheel'")));
  EXPECT_THAT(warnings_of("glass", ""), Contains(HasSubstr("the file has no materials")));
  EXPECT_THAT(warnings_of("wheel", materials), Not(Contains(HasSubstr("material_map"))));
}

TEST(LoadScene, an_object_without_triangles_is_warned_of) {
  GltfText text;
  text.scenes = R"({"nodes":[]},{"nodes":[0]})";
  const auto scene = load_scene(scenario_of(write_file(test_folder() / "thing.gltf", text.json())));
  ASSERT_TRUE(scene);
  EXPECT_THAT(scene->warnings,
              Contains(AllOf(HasSubstr("object 'thing'"), HasSubstr("no triangles"))));
}

TEST(LoadScene, endings_of_files_may_be_upper_case) {
  const GltfText text;
  EXPECT_TRUE(load_scene(scenario_of(write_file(test_folder() / "THING.GLTF", text.json()))));
}

TEST(LoadScene, materials_in_use_that_are_more_than_dry_layers_are_warned_of_by_name) {
  ScenarioDesc scenario = one_triangle(R"({"name":"steel"})", R"(,"material":0)");
  EXPECT_TRUE(load_scene(scenario)->warnings.empty());
  for (Material& material : scenario.materials) material.dry_layers_valid = false;
  const auto scene = load_scene(scenario);
  ASSERT_TRUE(scene);
  ASSERT_EQ(scene->warnings.size(), 1U);
  EXPECT_THAT(scene->warnings[0],
              AllOf(HasSubstr("material 'steel'"), HasSubstr("dry_layers_valid = false")));
}

TEST(LoadScene, evaporation_that_does_not_hold_is_warned_of) {
  ScenarioDesc scenario = one_triangle(R"({"name":"steel"})", R"(,"material":0)");
  scenario.thermal.model = ThermalModel::foster;
  scenario.clear_sky.air_mean_k = 290.0;
  for (Material& material : scenario.materials) material.surface_resistance_s_m = 70.0;
  EXPECT_TRUE(load_scene(scenario)->warnings.empty());
  // The air goes below freezing.
  scenario.clear_sky.air_mean_k = 276.0;
  auto scene = load_scene(scenario);
  ASSERT_EQ(scene->warnings.size(), 1U);
  EXPECT_THAT(scene->warnings[0], AllOf(HasSubstr("'steel' evaporates"), HasSubstr("270.0 K")));
  // A table states no humidity, or states it.
  physics::WeatherSample row;
  row.air_k = 290.0;
  scenario.weather = {row};
  scene = load_scene(scenario);
  ASSERT_EQ(scene->warnings.size(), 1U);
  EXPECT_THAT(scene->warnings[0], AllOf(HasSubstr("relative_humidity_frac"), HasSubstr("282.")));
  scenario.weather[0].relative_humidity_frac = 0.5;
  EXPECT_TRUE(load_scene(scenario)->warnings.empty());
  // Soil dries.
  for (Material& material : scenario.materials) material.surface_resistance_s_m = 0.0;
  scene = load_scene(scenario);
  ASSERT_EQ(scene->warnings.size(), 1U);
  EXPECT_THAT(scene->warnings[0], HasSubstr("drying needs 'readily_evaporable_mm'"));
  // The published model leaves evaporation out.
  scenario.thermal.model = ThermalModel::emit2014;
  scene = load_scene(scenario);
  ASSERT_EQ(scene->warnings.size(), 1U);
  EXPECT_THAT(scene->warnings[0], HasSubstr("emit2014"));
}

TEST(LoadScene, clutter_of_a_material_that_nothing_has_is_warned_of) {
  ScenarioDesc scenario = one_triangle("", "");
  scenario.materials.resize(2);
  scenario.materials[0].name = "concrete";
  scenario.materials[1].name = "grass";
  scenario.materials[0].clutter.emplace();
  scenario.default_material = "concrete";
  auto scene = load_scene(scenario);
  ASSERT_TRUE(scene.has_value()) << scene.error().text;
  EXPECT_THAT(scene->warnings, Not(Contains(HasSubstr("[[clutter]]"))));
  scenario.materials[1].clutter.emplace();
  scene = load_scene(scenario);
  ASSERT_TRUE(scene.has_value());
  EXPECT_THAT(scene->warnings, Contains(AllOf(HasSubstr("[[clutter]] of 'grass' has no effect"))));
}

TEST(LoadScene, unknown_library_names_are_configuration_errors) {
  ScenarioDesc scenario = one_triangle();
  scenario.objects[0].material = "ashpalt";
  auto scene = load_scene(scenario);
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::config);
  EXPECT_THAT(scene.error().text, AllOf(HasSubstr("'thing'"), HasSubstr("'ashpalt'")));
  scenario = one_triangle();
  scenario.default_material = "concret";
  EXPECT_THAT(load_scene(scenario).error().text, HasSubstr("'concret'"));
}

TEST(LoadScene, objects_of_one_file_share_meshes_unless_their_materials_differ) {
  ScenarioDesc scenario = one_triangle();
  scenario.objects[0].instances = {north(), north({5, 0, 0}), north({10, 0, 0})};
  ObjectDesc second = scenario.objects[0];
  second.name = "second";
  second.entity_id = 4;
  second.instances = {north({0, 50, 0})};
  ObjectDesc third = second;
  third.name = "third";
  third.entity_id = 5;
  third.material = "steel";
  scenario.objects.push_back(second);
  scenario.objects.push_back(third);
  const auto scene = load_scene(scenario);
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene->instances.size(), 5U);
  EXPECT_EQ(scene->meshes.size(), 2U);
  EXPECT_EQ(scene->triangles, 5U);
  EXPECT_EQ(scene->instances[2].placement, 2U);
  EXPECT_EQ(scene->instances[3].entity_id, 4U);
  EXPECT_NEAR(scene->static_bounds.max_m.x, 10.0, 1e-9);
  EXPECT_NEAR(scene->bounds.max_m.y, 50.0, 1e-9);
}

TEST(LoadScene, entities_need_one_placement_and_their_own_id) {
  ScenarioDesc scenario = one_triangle();
  scenario.objects[0].entity_id = 7;
  scenario.objects.push_back(scenario.objects[0]);
  EXPECT_THAT(load_scene(scenario).error().text, HasSubstr("entity id 7 is used twice"));
  scenario.objects.pop_back();
  scenario.objects[0].instances.push_back(north());
  EXPECT_THAT(load_scene(scenario).error().text, HasSubstr("2 placements"));
}

TEST(LoadScene, broken_file_names_the_object) {
  const auto scene = load_scene(scenario_of("/nowhere/ghost.glb"));
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, ErrorCode::config) << "the scenario names it";
  EXPECT_THAT(scene.error().text, AllOf(HasSubstr("'thing'"), HasSubstr("ghost.glb")));
}

TEST(InspectGltf, sums_up_what_the_loader_sees) {
  const ScenarioDesc scenario =
      one_triangle(R"({"name":"steel"},{"name":"odd \"one\""})", R"(,"material":1)");
  const auto summary = inspect_gltf(scenario.objects[0].gltf, scenario.materials);
  ASSERT_TRUE(summary);
  EXPECT_EQ(summary->triangles, 1U);
  EXPECT_EQ(summary->vertices, 3U);
  EXPECT_EQ(summary->nodes, 1U);
  ASSERT_EQ(summary->materials.size(), 2U);
  EXPECT_EQ(summary->materials[0].library_material, "steel");
  EXPECT_DOUBLE_EQ(summary->materials[1].area_m2, 0.5);
  EXPECT_THAT(summary->warnings, Contains(HasSubstr("is not in the library")));
  // A unit of glTF up is a unit of body up, which is -z.
  EXPECT_NEAR(summary->bounds_body.min_m.z, -1.0, 1e-9);
  EXPECT_THAT(to_text(*summary), HasSubstr("triangles   1"));
  EXPECT_THAT(to_json(*summary), HasSubstr(R"("gltf_material": "odd \"one\"")"));
}

TEST(InspectGltf, tells_which_faces_are_sheets) {
  ScenarioDesc scenario =
      one_triangle(R"({"name":"steel","doubleSided":true})", R"(,"material":0)");
  const auto sheets = [&] {
    const auto summary = inspect_gltf(scenario.objects[0].gltf, scenario.materials);
    return summary ? summary->materials[0].sheet_triangles : 99U;
  };
  scenario.materials[2].layers = {{0.001, 50.0, 7850.0, 470.0}};
  EXPECT_EQ(sheets(), 1U);
  const auto summary = inspect_gltf(scenario.objects[0].gltf, scenario.materials);
  EXPECT_THAT(to_text(*summary), HasSubstr("double sided: 1 triangles are sheets"));
  EXPECT_THAT(to_json(*summary), HasSubstr(R"("sheet_triangles": 1)"));
  scenario.materials[2].layers[0].conductivity_w_m_k = 0.1;
  EXPECT_EQ(sheets(), 0U);
}

}  // namespace
}  // namespace emit::scene
