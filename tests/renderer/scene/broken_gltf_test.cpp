// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "emit/scene/gltf_import.hpp"
#include "renderer/scene/gltf_builder.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using test::GltfText;
using test::packed;
using test::test_folder;
using test::write_file;
using testing::HasSubstr;

std::string error_of(const std::filesystem::path& file) {
  const physics::Result<GltfModel> model = import_gltf(file);
  EXPECT_FALSE(model) << "loaded although broken";
  return model ? std::string() : model.error().text;
}

struct Broken {
  const char* name;
  std::function<void(GltfText&)> damage;
  const char* expected;  ///< part of the message, which names the element
};

class BrokenGltf : public testing::TestWithParam<Broken> {};

TEST_P(BrokenGltf, is_refused_with_the_element_named) {
  GltfText text;
  GetParam().damage(text);
  const std::string error = error_of(write_file(test_folder() / "bad.gltf", text.json()));
  EXPECT_THAT(error, HasSubstr("bad.gltf"));
  EXPECT_THAT(error, HasSubstr(GetParam().expected));
}

void put(std::string& text, const std::string& from, const std::string& to) {
  text.replace(text.find(from), from.size(), to);
}

const Broken kBroken[] = {
    {"index_out_of_range", [](GltfText& t) { t.buffer.replace(40, 2, packed<std::uint16_t>({7})); },
     "mesh 0 'part' primitive 0: accessor 1: index 7 >= 3 vertices"},
    {"accessor_beyond_view", [](GltfText& t) { put(t.accessors, R"("count":3)", R"("count":4)"); },
     "accessor 0: 4 elements of 12 bytes from byte 0 exceed bufferView 0 of 36 bytes"},
    {"huge_count", [](GltfText& t) { put(t.accessors, R"("count":3)", R"("count":4000000000)"); },
     "accessor 0: 4000000000 elements"},
    {"huge_count_without_view",
     [](GltfText& t) {
       put(t.accessors, R"("bufferView":0,"componentType":5126,"count":3)",
           R"("componentType":5126,"count":4000000000)");
     },
     "accessor 0: 4000000000 elements without a bufferView"},
    {"coordinate_beyond_arithmetic",
     [](GltfText& t) { t.buffer.replace(16, 4, packed<float>({2e9F})); },
     "mesh 0 'part' primitive 0: POSITION: element 1 lies beyond 1e+09"},
    {"view_beyond_buffer",
     [](GltfText& t) { put(t.views, R"("byteLength":36)", R"("byteLength":3600)"); },
     "bufferView 0: bytes 0 + 3600 exceed buffer 0"},
    {"view_offset_overflows",
     [](GltfText& t) { put(t.views, R"("byteOffset":0)", R"("byteOffset":18446744073709551615)"); },
     "bufferView 0"},
    {"missing_view",
     [](GltfText& t) { put(t.accessors, R"("bufferView":0)", R"("bufferView":9)"); },
     "bufferView 9 does not exist"},
    {"missing_buffer", [](GltfText& t) { put(t.views, R"("buffer":0)", R"("buffer":3)"); },
     "bufferView 0: buffer 3 does not exist"},
    {"missing_accessor",
     [](GltfText& t) { put(t.primitive, R"("POSITION":0)", R"("POSITION":5)"); },
     "POSITION: accessor 5 does not exist"},
    {"missing_material",
     [](GltfText& t) { put(t.primitive, R"("indices":1)", R"("indices":1,"material":2)"); },
     "mesh 0 'part' primitive 0: material 2 does not exist"},
    {"missing_mesh", [](GltfText& t) { t.nodes = R"({"name":"lost","mesh":4})"; },
     "node 0 'lost': mesh 4 does not exist"},
    {"missing_child", [](GltfText& t) { t.nodes = R"({"mesh":0,"children":[8]})"; },
     "node 0: child 8 does not exist"},
    {"node_cycle", [](GltfText& t) { t.nodes = R"({"children":[1]},{"children":[0],"mesh":0})"; },
     "node 0: reached twice"},
    {"two_parents",
     [](GltfText& t) { t.nodes = R"({"children":[1,2]},{"children":[2]},{"name":"c","mesh":0})"; },
     "node 2 'c': reached twice"},
    {"missing_scene", [](GltfText& t) { t.extra = R"("scene":3,)"; }, "scene 3 does not exist"},
    {"missing_scene_node", [](GltfText& t) { t.scenes = R"({"nodes":[6]})"; },
     "node 6 does not exist"},
    {"short_matrix", [](GltfText& t) { t.nodes = R"({"mesh":0,"matrix":[1,0,0,0]})"; },
     "node 0: matrix: 4 numbers"},
    {"zero_quaternion", [](GltfText& t) { t.nodes = R"({"mesh":0,"rotation":[0,0,0,0]})"; },
     "node 0: rotation"},
    {"not_finite_position",
     [](GltfText& t) { t.buffer.replace(12, 4, packed<std::uint32_t>({0x7fc00000U})); },
     "POSITION: accessor 0: element 1 is not finite"},
    {"wrong_component_type",
     [](GltfText& t) { put(t.accessors, R"("type":"VEC3")", R"("type":"VEC2")"); },
     "POSITION: accessor 0: 2 components"},
    {"float_indices",
     [](GltfText& t) { put(t.accessors, R"("componentType":5123)", R"("componentType":5126)"); },
     "accessor 1: not a list of unsigned indices"},
    {"fewer_normals",
     [](GltfText& t) {
       t.accessors += R"(,{"bufferView":0,"componentType":5126,"count":2,"type":"VEC3"})";
       put(t.primitive, R"("POSITION":0)", R"("POSITION":0,"NORMAL":2)");
     },
     "NORMAL: 2 elements for 3 vertices"},
    {"partial_triangle",
     [](GltfText& t) {
       put(t.accessors, R"("componentType":5123,"count":3)", R"("componentType":5123,"count":2)");
     },
     "2 vertices are not whole triangles"},
    {"unknown_mode",
     [](GltfText& t) { put(t.primitive, R"("indices":1)", R"("indices":1,"mode":9)"); },
     "mode 9 does not exist"},
    {"required_extension",
     [](GltfText& t) { t.extra = R"("extensionsRequired":["KHR_draco_mesh_compression"],)"; },
     "'KHR_draco_mesh_compression' is not supported"},
    {"missing_external_buffer", [](GltfText& t) { t.buffer_uri = "absent.bin"; }, "absent.bin"},
    {"sparse_index_out_of_range",
     [](GltfText& t) {
       t.buffer += packed<std::uint16_t>({9, 0}) + packed<float>({0, 3, 0});
       t.views += R"(,{"buffer":0,"byteOffset":44,"byteLength":2},
                      {"buffer":0,"byteOffset":48,"byteLength":12})";
       put(t.accessors, R"("type":"VEC3")",
           R"("type":"VEC3","sparse":{"count":1,"indices":{"bufferView":2,"componentType":5123},)"
           R"("values":{"bufferView":3}})");
     },
     "accessor 0: sparse index 9 >= 3 elements"},
    {"deep_nesting",
     [](GltfText& t) {
       t.extra = R"("extras":)" + std::string(5000, '[') + std::string(5000, ']') + ",";
     },
     "nested deeper"},
};

INSTANTIATE_TEST_SUITE_P(All, BrokenGltf, testing::ValuesIn(kBroken),
                         [](const auto& instance) { return std::string(instance.param.name); });

TEST(BrokenGltfFile, missing_file_is_not_found) {
  const physics::Result<GltfModel> model = import_gltf("/nowhere/ghost.glb");
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().code, ErrorCode::not_found);
  EXPECT_THAT(model.error().text, HasSubstr("ghost.glb"));
}

TEST(BrokenGltfFile, text_that_is_not_json_is_refused) {
  const std::filesystem::path folder = test_folder();
  EXPECT_THAT(error_of(write_file(folder / "a.gltf", "hello there")), HasSubstr("a.gltf"));
  EXPECT_THAT(error_of(write_file(folder / "b.gltf", "")), HasSubstr("b.gltf"));
  EXPECT_THAT(error_of(write_file(folder / "c.gltf", "[1,2,3]")), HasSubstr("c.gltf"));
  EXPECT_THAT(error_of(write_file(folder / "d.gltf", R"({"meshes":[)")), HasSubstr("d.gltf"));
}

std::string whole_glb() {
  GltfText text;
  std::string json = text.json();
  const std::size_t uri = json.find(R"(,"uri":")");
  json.erase(uri, json.find('"', uri + 8) + 1 - uri);
  return test::glb(json, text.buffer);
}

TEST(BrokenGltfFile, binary_file_cut_off_anywhere_is_refused) {
  const std::filesystem::path folder = test_folder();
  const std::string whole = whole_glb();
  for (std::size_t size = 0; size < whole.size(); size += 13) {
    const std::filesystem::path file = write_file(folder / "cut.glb", whole.substr(0, size));
    EXPECT_THAT(error_of(file), HasSubstr("cut.glb")) << size << " bytes";
  }
}

TEST(BrokenGltfFile, binary_file_with_a_byte_changed_never_crashes) {
  const std::filesystem::path folder = test_folder();
  const std::string whole = whole_glb();
  std::size_t refused = 0;
  for (std::size_t i = 0; i < whole.size(); i += 3) {
    std::string changed = whole;
    changed[i] = static_cast<char>(changed[i] ^ 0x15);
    const physics::Result<GltfModel> model =
        import_gltf(write_file(folder / "changed.glb", changed));
    if (!model) {
      ++refused;
      EXPECT_THAT(model.error().text, HasSubstr("changed.glb"));
    }
  }
  EXPECT_GT(refused, whole.size() / 3 / 4);
}

}  // namespace
}  // namespace emit::scene
