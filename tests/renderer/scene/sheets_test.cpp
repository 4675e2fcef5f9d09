// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "emit/scene/sheets.hpp"

namespace emit::scene {
namespace {

constexpr Layer kSteel{0.001, 50.0, 7850.0, 470.0};
constexpr Layer kAir{0.02, 0.16, 1.2, 1005.0};
constexpr Layer kConcrete{0.1, 1.28, 2300.0, 878.0};

Material material(std::vector<Layer> layers) {
  Material out;
  out.name = "thing";
  out.emissivity_frac = 0.3;
  out.layers = std::move(layers);
  out.base_k = 350.0;
  out.core_conductance_w_m2_k = 8.0;
  out.modes = {{100.0, 0.5}, {1000.0, 0.5}};
  out.foster_modes = {{462.0, 0.125}};
  out.foster_fit = FosterFit{};
  return out;
}

TEST(SheetOf, is_half_of_the_body_without_what_lies_behind_it) {
  const auto sheet = sheet_of(material({kSteel, kAir}));
  ASSERT_TRUE(sheet);
  EXPECT_TRUE(sheet->sheet);
  EXPECT_NE(sheet->name, "thing");
  ASSERT_EQ(sheet->layers.size(), 1U);
  EXPECT_EQ(sheet->layers[0].thickness_m, 0.0005);
  EXPECT_EQ(sheet->layers[0].density_kg_m3, kSteel.density_kg_m3);
  EXPECT_EQ(sheet->emissivity_frac, 0.3);
  EXPECT_EQ(sheet->core_conductance_w_m2_k, 8.0);
  ASSERT_EQ(sheet->modes.size(), 1U);
  EXPECT_NEAR(sheet->modes[0].tau_s, 0.0005 * 7850.0 * 470.0 / 19.0, 1e-9);
  EXPECT_EQ(sheet->modes[0].weight_frac, 1.0);
  Material no_film = material({kSteel, kAir});
  no_film.core_conductance_w_m2_k.reset();
  EXPECT_NEAR(*sheet_of(no_film)->core_conductance_w_m2_k, 0.16 / 0.02, 1e-9);
  EXPECT_TRUE(sheet->foster_modes.empty());
  EXPECT_FALSE(sheet->foster_fit);
}

TEST(SheetOf, is_nothing_where_heat_takes_long_to_get_through) {
  EXPECT_FALSE(sheet_of(material({kConcrete})));
  // The steel lies in front of a layer that is no gas.
  EXPECT_FALSE(sheet_of(material({kSteel, kConcrete, kAir})));
  EXPECT_FALSE(sheet_of(material({kAir, kSteel})));
  EXPECT_FALSE(sheet_of(material({})));
  Material hot = material({kSteel});
  hot.prescribed_k = 400.0;
  EXPECT_FALSE(sheet_of(hot));
}

/// Makes four faces of a tetrahedron, or the first `count` of them.
Mesh tetrahedron(std::uint32_t count, std::uint32_t material_index, bool double_sided) {
  Mesh mesh;
  mesh.positions_m = {
      {0.0F, 0.0F, 0.0F}, {1.0F, 0.0F, 0.0F}, {0.0F, 1.0F, 0.0F}, {0.0F, 0.0F, 1.0F}};
  mesh.normals.assign(4, glm::vec3(0.0F, 0.0F, 1.0F));
  mesh.indices = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
  mesh.indices.resize(3 * std::size_t{count});
  mesh.submeshes = {{0, 3 * count, material_index, double_sided}};
  for (const glm::vec3& p : mesh.positions_m) mesh.bounds.add(glm::dvec3(p));
  return mesh;
}

TEST(AdoptSheets, gives_open_double_sided_thin_faces_a_material_of_their_own) {
  SceneGeometry geometry;
  geometry.materials = {material({kConcrete}), material({kSteel, kAir}), material({kSteel})};
  geometry.meshes = {tetrahedron(3, 1, true),   // a tent
                     tetrahedron(4, 1, true),   // a can: nobody gets to its inside
                     tetrahedron(3, 1, false),  // drawn from one side
                     tetrahedron(3, 0, true),   // a concrete shell
                     tetrahedron(1, 1, true)};  // a sign
  adopt_sheets(geometry);
  ASSERT_EQ(geometry.materials.size(), 4U);  // that of material 2 is not in use
  EXPECT_TRUE(geometry.materials[3].sheet);
  EXPECT_EQ(geometry.materials[3].layers.size(), 1U);
  EXPECT_FALSE(geometry.materials[1].sheet);
  std::vector<std::uint32_t> used;
  for (const Mesh& mesh : geometry.meshes) used.push_back(mesh.submeshes[0].material);
  EXPECT_EQ(used, (std::vector<std::uint32_t>{3, 1, 1, 0, 3}));
  for (const std::size_t m : {0U, 1U, 3U, 4U})
    EXPECT_TRUE(geometry.meshes[m].submeshes[0].double_sided);
}

TEST(AdoptSheets, leaves_a_scene_without_them_as_it_is) {
  SceneGeometry geometry;
  geometry.materials = {material({kSteel})};
  geometry.meshes = {tetrahedron(3, 0, false)};
  adopt_sheets(geometry);
  EXPECT_EQ(geometry.materials.size(), 1U);
  EXPECT_EQ(geometry.meshes[0].submeshes[0].material, 0U);
}

}  // namespace
}  // namespace emit::scene
