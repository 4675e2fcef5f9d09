// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "emit/scene/gltf_import.hpp"
#include "renderer/scene/gltf_builder.hpp"

namespace emit::scene {
namespace {

using test::GltfText;
using test::packed;
using test::test_folder;
using test::write_file;
using testing::HasSubstr;

GltfModel load_file(const std::filesystem::path& file) {
  physics::Result<GltfModel> model = import_gltf(file);
  EXPECT_TRUE(model) << (model ? "" : model.error().text);
  return model ? std::move(*model) : GltfModel{};
}
GltfModel load(const GltfText& text) {
  return load_file(write_file(test_folder() / "model.gltf", text.json()));
}

glm::dvec3 corner(const GltfModel& model, std::size_t placement, std::size_t index) {
  const GltfPlacement& p = model.placements.at(placement);
  const Mesh& mesh = model.meshes.at(p.mesh);
  return glm::dvec3(p.gltf_from_mesh *
                    glm::dvec4(glm::dvec3(mesh.positions_m.at(mesh.indices.at(index))), 1.0));
}
/// Returns the unit normal of a placed triangle by its winding.
glm::dvec3 facing(const GltfModel& model, std::size_t placement, std::size_t triangle) {
  const glm::dvec3 a = corner(model, placement, 3 * triangle);
  return glm::normalize(glm::cross(corner(model, placement, 3 * triangle + 1) - a,
                                   corner(model, placement, 3 * triangle + 2) - a));
}
void expect_near(const glm::dvec3& a, const glm::dvec3& b, double tolerance = 1e-6) {
  EXPECT_LT(glm::length(a - b), tolerance) << "(" << a.x << ", " << a.y << ", " << a.z << ")";
}

TEST(GltfImport, embedded_buffer_with_16_bit_indices_loads) {
  const GltfModel model = load({});
  ASSERT_EQ(model.meshes.size(), 1U);
  EXPECT_EQ(model.meshes[0].name, "part");
  EXPECT_EQ(model.meshes[0].indices.size(), 3U);
  EXPECT_EQ(model.placements.at(0).node, "root");
  EXPECT_EQ(model.meshes[0].submeshes.at(0).material, kNoGltfMaterial);
  expect_near(facing(model, 0, 0), {0, 0, 1});
}

TEST(GltfImport, missing_normals_become_flat_ones) {
  const GltfModel model = load({});
  for (const glm::vec3& normal : model.meshes.at(0).normals) {
    expect_near(glm::dvec3(normal), {0, 0, 1});
  }
}

TEST(GltfImport, external_buffer_file_loads_relative_to_the_model) {
  const std::filesystem::path folder = test_folder();
  GltfText text;
  text.buffer_uri = "shape%20one.bin";
  write_file(folder / "shape one.bin", text.buffer);
  const GltfModel model = load_file(write_file(folder / "model.gltf", text.json()));
  EXPECT_EQ(model.meshes.at(0).indices.size(), 3U);
}

TEST(GltfImport, binary_container_loads) {
  GltfText text;
  std::string json = text.json();
  const std::size_t uri = json.find(R"(,"uri":")");
  json.erase(uri, json.find('"', uri + 8) + 1 - uri);
  const GltfModel model =
      load_file(write_file(test_folder() / "model.glb", test::glb(json, text.buffer)));
  EXPECT_EQ(model.meshes.at(0).indices.size(), 3U);
}

TEST(GltfImport, geometry_without_indices_gets_shared_vertices) {
  GltfText text;
  text.buffer = packed<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 0, 0, 1, 1, 0, 0, 1, 0});
  text.views = R"({"buffer":0,"byteLength":72})";
  text.accessors = R"({"bufferView":0,"componentType":5126,"count":6,"type":"VEC3"})";
  text.primitive = R"({"attributes":{"POSITION":0}})";
  const GltfModel model = load(text);
  EXPECT_EQ(model.meshes.at(0).indices.size(), 6U);
  EXPECT_EQ(model.meshes.at(0).positions_m.size(), 4U);
}

TEST(GltfImport, indices_of_8_and_32_bits_load) {
  GltfText small;
  small.buffer = packed<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}) + packed<std::uint8_t>({0, 1, 2, 0});
  small.views = R"({"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":3})";
  small.accessors = R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                       {"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"})";
  expect_near(facing(load(small), 0, 0), {0, 0, 1});
  GltfText large;
  large.buffer = packed<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}) + packed<std::uint32_t>({0, 2, 1});
  large.views = R"({"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":12})";
  large.accessors = R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                       {"bufferView":1,"componentType":5125,"count":3,"type":"SCALAR"})";
  expect_near(facing(load(large), 0, 0), {0, 0, -1});
}

GltfText five_points(int mode) {
  GltfText text;
  text.buffer = packed<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0});
  if (mode == 6) {  // a fan runs around its first point
    text.buffer = packed<float>({0, 0, 0, 2, 0, 0, 2, 1, 0, 1, 2, 0, 0, 2, 0});
  }
  text.views = R"({"buffer":0,"byteLength":60})";
  text.accessors = R"({"bufferView":0,"componentType":5126,"count":5,"type":"VEC3"})";
  text.primitive = R"({"attributes":{"POSITION":0},"mode":)" + std::to_string(mode) + "}";
  return text;
}

TEST(GltfImport, strips_and_fans_keep_one_facing) {
  for (const int mode : {5, 6}) {
    const GltfModel model = load(five_points(mode));
    ASSERT_EQ(model.meshes.at(0).indices.size(), 9U) << "mode " << mode;
    for (std::size_t triangle = 0; triangle < 3; ++triangle) {
      expect_near(facing(model, 0, triangle), {0, 0, 1});
    }
  }
}

TEST(GltfImport, lines_are_skipped_with_a_warning_that_names_them) {
  GltfText text = five_points(3);
  const GltfModel model = load(text);
  EXPECT_TRUE(model.meshes.empty());
  EXPECT_THAT(model.warnings, testing::Contains(HasSubstr("mesh 0 'part' primitive 0")));
}

TEST(GltfImport, node_hierarchies_multiply_from_the_root_down) {
  GltfText text;
  text.nodes =
      R"({"name":"a","translation":[10,0,0],"rotation":[0,0,0.70710678,0.70710678],"children":[1]},
         {"name":"b","translation":[1,0,0],"children":[2]},
         {"name":"c","matrix":[2,0,0,0, 0,2,0,0, 0,0,2,0, 0,0,5,1],"mesh":0})";
  const GltfModel model = load(text);
  EXPECT_EQ(model.nodes, 3U);
  // The corner (1,0,0) is doubled and lifted, shifted by (1,0,0), turned by 90 degrees, and shifted
  // by (10,0,0).
  expect_near(corner(model, 0, 1), {10, 3, 5});
}

TEST(GltfImport, mirroring_node_keeps_fronts_in_front) {
  GltfText text;
  text.nodes = R"({"mesh":0,"scale":[-1,1,1]},{"mesh":0})";
  text.scenes = R"({"nodes":[0,1]})";
  const GltfModel model = load(text);
  ASSERT_EQ(model.placements.size(), 2U);
  for (std::size_t p = 0; p < 2; ++p) {
    expect_near(facing(model, p, 0), {0, 0, 1});
    EXPECT_GT(glm::determinant(model.placements[p].gltf_from_mesh), 0.0);
  }
  // The mirrored triangle reaches to -1 in x.
  EXPECT_NEAR(std::min(corner(model, 0, 1).x, corner(model, 0, 2).x), -1.0, 1e-9);
}

TEST(GltfImport, default_scene_is_shown) {
  GltfText text;
  text.nodes = R"({"mesh":0,"name":"first"},{"mesh":0,"name":"second"})";
  text.scenes = R"({"nodes":[0]},{"nodes":[1]})";
  text.extra = R"("scene":1,)";
  const GltfModel model = load(text);
  ASSERT_EQ(model.placements.size(), 1U);
  EXPECT_EQ(model.placements[0].node, "second");
}

TEST(GltfImport, primitives_keep_their_materials_and_sides) {
  GltfText text;
  text.materials = R"({"name":"steel"},{"doubleSided":true})";
  // The three triangles lie one above the other, because in one plane they would be cut.
  text.buffer += packed<float>({0, 0, 1, 1, 0, 1, 0, 1, 1, 0, 0, 2, 1, 0, 2, 0, 1, 2});
  text.views += R"(,{"buffer":0,"byteOffset":44,"byteLength":72})";
  text.accessors += R"(,{"bufferView":2,"componentType":5126,"count":3,"type":"VEC3"},
      {"bufferView":2,"byteOffset":36,"componentType":5126,"count":3,"type":"VEC3"})";
  text.meshes = R"({"name":"part","primitives":[
      {"attributes":{"POSITION":0},"indices":1,"material":1},
      {"attributes":{"POSITION":2},"indices":1,"material":0},
      {"attributes":{"POSITION":3},"indices":1}]})";
  const GltfModel model = load(text);
  const std::vector<Submesh>& submeshes = model.meshes.at(0).submeshes;
  ASSERT_EQ(submeshes.size(), 3U);
  EXPECT_EQ(model.materials.at(0).name, "steel");
  EXPECT_EQ(model.materials.at(1).name, "material 1");
  EXPECT_EQ(submeshes[0].material, 1U);
  EXPECT_TRUE(submeshes[0].double_sided);
  EXPECT_EQ(submeshes[1].material, 0U);
  EXPECT_FALSE(submeshes[1].double_sided);
  EXPECT_EQ(submeshes[2].material, kNoGltfMaterial);
  EXPECT_EQ(submeshes[1].first_index, 3U);
}

TEST(GltfImport, interleaved_buffers_load_by_their_stride) {
  GltfText text;
  text.buffer = packed<float>({0, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0, 2, 0, 1, 0, 0, 0, 2});
  text.views = R"({"buffer":0,"byteLength":72,"byteStride":24})";
  text.accessors = R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                      {"bufferView":0,"byteOffset":12,"componentType":5126,"count":3,"type":"VEC3"})";
  text.primitive = R"({"attributes":{"POSITION":0,"NORMAL":1}})";
  const GltfModel model = load(text);
  expect_near(corner(model, 0, 2), {0, 1, 0});
  expect_near(glm::dvec3(model.meshes.at(0).normals.at(0)), {0, 0, 1});
}

TEST(GltfImport, quantised_positions_are_scaled) {
  GltfText text;
  text.extra = R"("extensionsRequired":["KHR_mesh_quantization"],)";
  text.buffer = packed<std::int16_t>({0, 0, 0, 0, 32767, 0, 0, 0, 0, -32768, 0, 0});
  text.views = R"({"buffer":0,"byteLength":24,"byteStride":8})";
  text.accessors =
      R"({"bufferView":0,"componentType":5122,"normalized":true,"count":3,"type":"VEC3"})";
  text.primitive = R"({"attributes":{"POSITION":0}})";
  const GltfModel model = load(text);
  expect_near(corner(model, 0, 1), {1, 0, 0});
  expect_near(corner(model, 0, 2), {0, -1, 0});
}

TEST(GltfImport, sparse_elements_replace_the_base) {
  GltfText text;
  text.buffer += packed<std::uint16_t>({2, 0}) + packed<float>({0, 3, 0});
  text.views += R"(,{"buffer":0,"byteOffset":44,"byteLength":2},
                    {"buffer":0,"byteOffset":48,"byteLength":12})";
  text.accessors = R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","sparse":
      {"count":1,"indices":{"bufferView":2,"componentType":5123},"values":{"bufferView":3}}},
      {"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"})";
  const GltfModel model = load(text);
  expect_near(corner(model, 0, 1), {1, 0, 0});
  expect_near(corner(model, 0, 2), {0, 3, 0});
}

TEST(GltfImport, instancing_extension_places_each_instance) {
  GltfText text;
  text.buffer += packed<float>({5, 0, 0, 0, 7, 0});
  text.views += R"(,{"buffer":0,"byteOffset":44,"byteLength":24})";
  text.accessors += R"(,{"bufferView":2,"componentType":5126,"count":2,"type":"VEC3"})";
  text.nodes = R"({"mesh":0,"translation":[0,0,1],
      "extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":2}}}})";
  const GltfModel model = load(text);
  ASSERT_EQ(model.placements.size(), 2U);
  expect_near(corner(model, 0, 0), {5, 0, 1});
  expect_near(corner(model, 1, 0), {0, 7, 1});
}

TEST(GltfImport, zero_area_triangles_are_dropped_and_counted) {
  GltfText text;
  text.buffer = packed<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}) +
                packed<std::uint16_t>({0, 1, 2, 0, 0, 1, 1, 2, 2}) + std::string(2, '\0');
  text.views = R"({"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":18})";
  text.accessors = R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                      {"bufferView":1,"componentType":5123,"count":9,"type":"SCALAR"})";
  const GltfModel model = load(text);
  EXPECT_EQ(model.meshes.at(0).indices.size(), 3U);
  EXPECT_EQ(model.dropped_triangles, 2U);
  EXPECT_THAT(model.warnings, testing::Contains(HasSubstr("2 triangles of zero area")));
}

TEST(GltfImport, missing_pictures_do_not_matter) {
  GltfText text;
  text.extra = R"("images":[{"uri":"nowhere.png"}],"textures":[{"source":0}],)";
  text.materials = R"({"name":"m","pbrMetallicRoughness":{"baseColorTexture":{"index":0}}})";
  EXPECT_EQ(load(text).meshes.size(), 1U);
}

TEST(GltfImport, shipped_example_files_load) {
  const std::filesystem::path folder =
      std::filesystem::path(EMIT_TEST_SOURCE_DIR) / "data" / "gltf";
  const GltfModel external = load_file(folder / "wedge.gltf");
  EXPECT_EQ(external.meshes.at(0).indices.size(), 24U);
  EXPECT_EQ(external.materials.at(0).name, "concrete");
  EXPECT_EQ(load_file(folder / "wedge_embedded.gltf").meshes.at(0).indices.size(), 24U);
}

}  // namespace
}  // namespace emit::scene
