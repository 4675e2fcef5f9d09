// SPDX-License-Identifier: Apache-2.0
// Scene files as exporters and converters write them: sources, containers, skins, units.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>

#include "emit/scene/gltf_import.hpp"
#include "emit/scene/inspect.hpp"
#include "renderer/scene/gltf_builder.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using test::GltfText;
using test::packed;
using test::test_folder;
using test::write_file;
using testing::AllOf;
using testing::Contains;
using testing::Each;
using testing::HasSubstr;
using testing::Not;

GltfModel load(const std::string& json, const std::string& name = "model.gltf") {
  auto model = import_gltf(write_file(test_folder() / name, json));
  EXPECT_TRUE(model) << (model ? "" : model.error().text);
  return model ? std::move(*model) : GltfModel{};
}
GltfModel load(const GltfText& text) {
  return load(text.json());
}
physics::Error error_of(const std::string& json, const std::string& name = "model.gltf") {
  const auto model = import_gltf(write_file(test_folder() / name, json));
  EXPECT_FALSE(model) << "loaded although broken";
  return model ? physics::Error{} : model.error();
}
std::string replaced(std::string text, const std::string& from, const std::string& to) {
  EXPECT_NE(text.find(from), std::string::npos) << from;
  return text.replace(text.find(from), from.size(), to);
}
glm::dvec3 placed_point(const GltfModel& model, std::size_t placement, std::size_t vertex) {
  const GltfPlacement& p = model.placements.at(placement);
  return glm::dvec3(p.gltf_from_mesh *
                    glm::dvec4(glm::dvec3(model.meshes.at(p.mesh).positions_m.at(vertex)), 1.0));
}
Aabb bounds_of(const GltfModel& model) {
  Aabb box;
  for (const GltfPlacement& p : model.placements) {
    for (const std::uint32_t i : model.meshes[p.mesh].indices) {
      box.add(glm::dvec3(p.gltf_from_mesh *
                         glm::dvec4(glm::dvec3(model.meshes[p.mesh].positions_m[i]), 1.0)));
    }
  }
  return box;
}

// Buffers ---------------------------------------------------------------------------------------

TEST(GltfBuffers, sources_longer_than_the_buffer_load) {
  const std::filesystem::path folder = test_folder();
  GltfText external;
  external.buffer_uri = "shape.bin";
  write_file(folder / "shape.bin", external.buffer + std::string(40, '\x7f'));
  const auto model = import_gltf(write_file(folder / "model.gltf", external.json()));
  ASSERT_TRUE(model) << model.error().text;
  EXPECT_EQ(model->meshes.at(0).indices.size(), 3U);
  EXPECT_THAT(model->warnings, testing::IsEmpty());

  GltfText embedded;
  embedded.buffer_uri =
      "data:application/octet-stream;base64," + test::base64(embedded.buffer + std::string(8, 'x'));
  EXPECT_EQ(load(embedded).meshes.at(0).indices.size(), 3U);
}

TEST(GltfBuffers, data_uris_of_any_media_type_load) {
  for (const std::string type : {"application/gltf-buffer", "application/x-thing", ""}) {
    GltfText text;
    text.buffer_uri = "data:" + type + ";base64," + test::base64(text.buffer);
    EXPECT_EQ(load(text).meshes.at(0).indices.size(), 3U) << type;
  }
}

TEST(GltfBuffers, names_with_escapes_blanks_and_backslashes_are_found) {
  for (const auto& [uri, file] :
       {std::pair{"a%20b.bin", "a b.bin"}, std::pair{"a b.bin", "a b.bin"},
        std::pair{"100%.bin", "100%.bin"}, std::pair{R"(data\\a.bin)", "data/a.bin"}}) {
    const std::filesystem::path folder = test_folder();
    GltfText text;
    text.buffer_uri = uri;
    std::filesystem::create_directories((folder / file).parent_path());
    write_file(folder / file, text.buffer);
    EXPECT_TRUE(import_gltf(write_file(folder / "model.gltf", text.json()))) << uri;
  }
}

TEST(GltfBuffers, sources_that_are_too_short_are_named) {
  const std::filesystem::path folder = test_folder();
  GltfText text;
  text.buffer_uri = "short.bin";
  write_file(folder / "short.bin", text.buffer.substr(0, 30));
  const auto model = import_gltf(write_file(folder / "model.gltf", text.json()));
  ASSERT_FALSE(model);
  EXPECT_THAT(model.error().text, AllOf(HasSubstr("model.gltf"),
                                        HasSubstr("buffer 0: byteLength is 44, but 'short.bin'"),
                                        HasSubstr("30 bytes")));
  EXPECT_EQ(model.error().code, ErrorCode::parse);
}

TEST(GltfBuffers, uris_of_other_machines_are_refused_by_name) {
  GltfText text;
  text.buffer_uri = "https://example.org/a.bin";
  EXPECT_THAT(error_of(text.json()).text,
              HasSubstr("buffer 0: 'https://example.org/a.bin' is not"));
}

TEST(GltfBuffers, no_message_holds_a_data_uri) {
  const std::string uri = "data:application/octet-stream;base64," + std::string(4000, 'Q');
  GltfText shorter;
  shorter.buffer = std::string(9000, '\0');
  shorter.buffer_uri = uri;
  GltfText no_base64;
  no_base64.buffer_uri = "data:application/octet-stream," + std::string(4000, 'Q');
  GltfText broken_view;
  broken_view.buffer_uri = uri;
  broken_view.views = R"({"buffer":0,"byteOffset":0,"byteLength":99999},
                         {"buffer":0,"byteOffset":36,"byteLength":6})";
  const std::string whole = replaced(GltfText{}.json(), R"("buffers":[)",
                                     R"("buffers":[{"byteLength":3000,"uri":")" + uri + R"("},)");
  for (const std::string& json :
       {shorter.json(), no_base64.json(), broken_view.json(), whole.substr(0, whole.size() - 400),
        whole.substr(0, whole.find(uri) + 3000),
        replaced(whole, R"("byteLength":3000)", "\"x\"")}) {
    const std::string text = error_of(json).text;
    EXPECT_THAT(text, HasSubstr("model.gltf"));
    EXPECT_THAT(text, Not(HasSubstr("QQQQ")));
    EXPECT_LT(text.size(), 600U) << text;
  }
}

TEST(GltfBuffers, text_with_a_byte_order_mark_loads) {
  EXPECT_EQ(load("\xef\xbb\xbf" + GltfText{}.json()).meshes.at(0).indices.size(), 3U);
}

TEST(GltfBuffers, a_binary_file_may_have_external_buffers_too) {
  const std::filesystem::path folder = test_folder();
  GltfText text;
  std::string json = text.json();
  const std::size_t uri = json.find(R"(,"uri":")");
  json.erase(uri, json.find('"', uri + 8) + 1 - uri);
  json = replaced(json, R"("buffers":[{"byteLength":44})",
                  R"("buffers":[{"byteLength":36},{"byteLength":6,"uri":"more.bin"})");
  json = replaced(json, R"({"buffer":0,"byteOffset":36,"byteLength":6})",
                  R"({"buffer":1,"byteOffset":0,"byteLength":6})");
  write_file(folder / "more.bin", packed<std::uint16_t>({0, 1, 2}));
  const auto model =
      import_gltf(write_file(folder / "model.glb", test::glb(json, text.buffer.substr(0, 36))));
  ASSERT_TRUE(model) << model.error().text;
  EXPECT_EQ(model->meshes.at(0).indices.size(), 3U);
}

// Versions --------------------------------------------------------------------------------------

TEST(GltfVersion, other_versions_are_refused_with_their_number) {
  const std::string first = R"({"asset":{"version":"1.0"},"scene":"s","scenes":{"s":{"nodes":[]}},
      "nodes":{},"meshes":{},"accessors":{},"bufferViews":{},"buffers":{}})";
  const physics::Error error = error_of(first, "old.gltf");
  EXPECT_EQ(error.code, ErrorCode::unsupported);
  EXPECT_THAT(error.text, AllOf(HasSubstr("old.gltf"), HasSubstr("1.0"), HasSubstr("glTF 2.0")));
  const std::string json = GltfText{}.json();
  EXPECT_THAT(error_of(replaced(json, "\"2.0\"", "\"3.1\"")).text, HasSubstr("3.1"));
  EXPECT_THAT(error_of(replaced(json, "\"2.0\"", "\"2.0\",\"minVersion\":\"2.4\"")).text,
              HasSubstr("minVersion is 2.4"));
  EXPECT_THAT(error_of(replaced(json, "\"2.0\"", "2.0")).text, HasSubstr("version is missing"));
  EXPECT_THAT(error_of(R"({"scenes":[]})").text, HasSubstr("asset"));
  std::string binary = test::glb(json, "");
  binary[4] = 1;
  EXPECT_THAT(error_of(binary, "old.glb").text, HasSubstr("glTF version 1"));
}

// EXT_meshopt_compression -----------------------------------------------------------------------

/// Adds one compressed view to a file and gives its number.
class MeshoptFile {
 public:
  explicit MeshoptFile(std::string extension) : extension_(std::move(extension)) {}

  int add(const std::vector<unsigned char>& data, std::size_t count, std::size_t stride,
          const std::string& mode, const std::string& filter = "") {
    const std::size_t offset = buffer_.size();
    buffer_.append(reinterpret_cast<const char*>(data.data()), data.size());
    buffer_.resize((buffer_.size() + 3) / 4 * 4);
    const std::string stride_text =
        mode == "ATTRIBUTES" ? ",\"byteStride\":" + std::to_string(stride) : "";
    views_ += std::string(views_.empty() ? "" : ",") + R"({"buffer":1,"byteOffset":)" +
              std::to_string(fallback_) + R"(,"byteLength":)" + std::to_string(count * stride) +
              stride_text + R"(,"extensions":{")" + extension_ + R"(":{"buffer":0,"byteOffset":)" +
              std::to_string(offset) + R"(,"byteLength":)" + std::to_string(data.size()) +
              R"(,"byteStride":)" + std::to_string(stride) + R"(,"count":)" +
              std::to_string(count) + R"(,"mode":")" + mode + "\"" +
              (filter.empty() ? "" : R"(,"filter":")" + filter + "\"") + "}}}";
    fallback_ += count * stride;
    return views_count_++;
  }
  [[nodiscard]] std::string json(const std::string& accessors, const std::string& primitive) const {
    return R"({"asset":{"version":"2.0"},"extensionsRequired":[")" + extension_ +
           R"(","KHR_mesh_quantization"],"extensionsUsed":[")" + extension_ +
           R"("],"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],"meshes":[{"primitives":[)" +
           primitive + R"(]}],"accessors":[)" + accessors + R"(],"bufferViews":[)" + views_ +
           R"(],"buffers":[{"byteLength":)" + std::to_string(buffer_.size()) +
           R"(,"uri":"data:application/octet-stream;base64,)" + test::base64(buffer_) +
           R"("},{"byteLength":)" + std::to_string(fallback_) + R"(,"extensions":{")" + extension_ +
           R"(":{"fallback":true}}}]})";
  }

 private:
  std::string extension_;
  std::string buffer_;
  std::string views_;
  std::size_t fallback_ = 0;
  int views_count_ = 0;
};

std::vector<unsigned char> encoded_vertices(const void* data, std::size_t count,
                                            std::size_t stride) {
  std::vector<unsigned char> out(meshopt_encodeVertexBufferBound(count, stride));
  meshopt_encodeVertexVersion(0);
  out.resize(meshopt_encodeVertexBuffer(out.data(), out.size(), data, count, stride));
  return out;
}
std::vector<unsigned char> encoded_triangles(const std::vector<std::uint32_t>& indices,
                                             std::size_t vertices) {
  std::vector<unsigned char> out(meshopt_encodeIndexBufferBound(indices.size(), vertices));
  out.resize(meshopt_encodeIndexBuffer(out.data(), out.size(), indices.data(), indices.size()));
  return out;
}
std::vector<unsigned char> encoded_sequence(const std::vector<std::uint32_t>& indices,
                                            std::size_t vertices) {
  std::vector<unsigned char> out(meshopt_encodeIndexSequenceBound(indices.size(), vertices));
  out.resize(meshopt_encodeIndexSequence(out.data(), out.size(), indices.data(), indices.size()));
  return out;
}

/// A grid of n by n fields of one metre in the plane z = 0.
struct Grid {
  std::vector<glm::vec3> positions;
  std::vector<std::uint32_t> indices;
  explicit Grid(std::uint32_t n) {
    for (std::uint32_t y = 0; y <= n; ++y) {
      for (std::uint32_t x = 0; x <= n; ++x) {
        positions.emplace_back(static_cast<float>(x), static_cast<float>(y), 0.0F);
      }
    }
    for (std::uint32_t y = 0; y < n; ++y) {
      for (std::uint32_t x = 0; x < n; ++x) {
        const std::uint32_t at = y * (n + 1) + x;
        for (const std::uint32_t i : {at, at + 1, at + n + 2, at, at + n + 2, at + n + 1}) {
          indices.push_back(i);
        }
      }
    }
  }
};

TEST(GltfMeshopt, vertices_and_triangles_come_out_as_they_went_in) {
  const Grid grid(20);
  for (const std::string extension : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
    for (const std::string mode : {"TRIANGLES", "INDICES"}) {
      MeshoptFile file(extension);
      const std::size_t count = grid.positions.size();
      file.add(encoded_vertices(grid.positions.data(), count, 12), count, 12, "ATTRIBUTES");
      file.add(mode == "TRIANGLES" ? encoded_triangles(grid.indices, count)
                                   : encoded_sequence(grid.indices, count),
               grid.indices.size(), 4, mode);
      const GltfModel model = load(file.json(
          R"({"bufferView":0,"componentType":5126,"count":441,"type":"VEC3"},
             {"bufferView":1,"componentType":5125,"count":2400,"type":"SCALAR"})",
          R"({"attributes":{"POSITION":0},"indices":1})"));
      ASSERT_EQ(model.meshes.size(), 1U) << extension << ' ' << mode;
      EXPECT_EQ(model.meshes[0].indices.size(), 2400U);
      const Aabb box = bounds_of(model);
      EXPECT_EQ(box.min_m, glm::dvec3(0, 0, 0));
      EXPECT_EQ(box.max_m, glm::dvec3(20, 20, 0));
    }
  }
}

TEST(GltfMeshopt, filters_give_back_normals_and_floats) {
  const Grid grid(4);
  const std::size_t count = grid.positions.size();
  MeshoptFile file("EXT_meshopt_compression");
  std::vector<std::uint32_t> exponents(3 * count);
  meshopt_encodeFilterExp(exponents.data(), count, 12, 20, &grid.positions[0].x);
  file.add(encoded_vertices(exponents.data(), count, 12), count, 12, "ATTRIBUTES", "EXPONENTIAL");
  const std::vector<glm::vec4> normals(count, glm::vec4(0.6F, 0.0F, 0.8F, 0.0F));
  std::vector<std::int8_t> octahedral(4 * count);
  meshopt_encodeFilterOct(octahedral.data(), count, 4, 8, &normals[0].x);
  file.add(encoded_vertices(octahedral.data(), count, 4), count, 4, "ATTRIBUTES", "OCTAHEDRAL");
  file.add(encoded_triangles(grid.indices, count), grid.indices.size(), 4, "TRIANGLES");
  const GltfModel model = load(file.json(
      R"({"bufferView":0,"componentType":5126,"count":25,"type":"VEC3"},
         {"bufferView":1,"componentType":5120,"normalized":true,"count":25,"type":"VEC3"},
         {"bufferView":2,"componentType":5125,"count":96,"type":"SCALAR"})",
      R"({"attributes":{"POSITION":0,"NORMAL":1},"indices":2})"));
  ASSERT_EQ(model.meshes.size(), 1U);
  EXPECT_NEAR(bounds_of(model).max_m.y, 4.0, 1e-4);
  for (const glm::vec3& normal : model.meshes[0].normals) {
    EXPECT_NEAR(normal.x, 0.6F, 0.02F);
    EXPECT_NEAR(normal.z, 0.8F, 0.02F);
  }
}

TEST(GltfMeshopt, rotations_of_instances_may_be_filtered) {
  MeshoptFile file("EXT_meshopt_compression");
  const Grid grid(1);
  file.add(encoded_vertices(grid.positions.data(), 4, 12), 4, 12, "ATTRIBUTES");
  const std::vector<glm::vec4> turns(4, glm::vec4(0.0F, 0.0F, std::sqrt(0.5F), std::sqrt(0.5F)));
  std::vector<std::int16_t> packed_turns(16);
  meshopt_encodeFilterQuat(packed_turns.data(), 4, 8, 16, &turns[0].x);
  file.add(encoded_vertices(packed_turns.data(), 4, 8), 4, 8, "ATTRIBUTES", "QUATERNION");
  file.add(encoded_triangles(grid.indices, 4), 6, 4, "TRIANGLES");
  std::string json = file.json(
      R"({"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},
         {"bufferView":1,"componentType":5122,"normalized":true,"count":4,"type":"VEC4"},
         {"bufferView":2,"componentType":5125,"count":6,"type":"SCALAR"})",
      R"({"attributes":{"POSITION":0},"indices":2})");
  json = replaced(json, R"({"mesh":0})",
                  R"({"mesh":0,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":
                     {"ROTATION":1}}}})");
  const GltfModel model = load(json);
  ASSERT_EQ(model.placements.size(), 4U);
  // A quarter turn about z moves x to y.
  const glm::dvec3 x = glm::dvec3(model.placements[2].gltf_from_mesh[0]);
  EXPECT_NEAR(x.y, 1.0, 1e-3);
}

TEST(GltfMeshopt, what_cannot_be_decoded_names_view_and_extension) {
  const Grid grid(2);
  const std::size_t count = grid.positions.size();
  const std::vector<unsigned char> good = encoded_vertices(grid.positions.data(), count, 12);
  const auto text_of = [&](const std::vector<unsigned char>& data, std::size_t elements,
                           std::size_t stride, const std::string& mode, const std::string& filter) {
    MeshoptFile file("EXT_meshopt_compression");
    file.add(data, elements, stride, mode, filter);
    return error_of(file.json(R"({"bufferView":0,"componentType":5126,"count":9,"type":"VEC3"})",
                              R"({"attributes":{"POSITION":0}})"))
        .text;
  };
  const auto names = AllOf(HasSubstr("bufferView 0"), HasSubstr("EXT_meshopt_compression"));
  std::vector<unsigned char> cut(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(10));
  EXPECT_THAT(text_of(cut, count, 12, "ATTRIBUTES", ""), AllOf(names, HasSubstr("malformed")));
  std::vector<unsigned char> newer = good;
  newer[0] = 0xa1;
  EXPECT_THAT(text_of(newer, count, 12, "ATTRIBUTES", ""), AllOf(names, HasSubstr("version 1")));
  std::vector<unsigned char> other = good;
  other[0] = 0x00;
  EXPECT_THAT(text_of(other, count, 12, "ATTRIBUTES", ""), names);
  EXPECT_THAT(text_of(good, 1U << 28U, 12, "ATTRIBUTES", ""), AllOf(names, HasSubstr("268435456")));
  EXPECT_THAT(text_of(encoded_triangles(grid.indices, count), 24, 3, "TRIANGLES", ""),
              AllOf(names, HasSubstr("byteStride 3")));
  EXPECT_THAT(text_of(good, count, 12, "MESHLETS", ""), AllOf(names, HasSubstr("MESHLETS")));
  EXPECT_THAT(text_of(good, count, 12, "ATTRIBUTES", "COLOR"), AllOf(names, HasSubstr("COLOR")));
  EXPECT_THAT(text_of(good, count, 12, "ATTRIBUTES", "OCTAHEDRAL"),
              AllOf(names, HasSubstr("does not fit")));
  EXPECT_THAT(text_of(encoded_triangles(grid.indices, count), 23, 4, "TRIANGLES", ""),
              AllOf(names, HasSubstr("whole triangles")));
}

// Skins -----------------------------------------------------------------------------------------

/// A triangle of two joints. Joint 1 stands at (0, 2, 0) under a parent that doubles; vertex 0
/// follows joint 0, vertex 1 joint 1, vertex 2 both by half.
GltfText skinned() {
  GltfText text;
  text.buffer = packed<float>({0, 0, 0, 1, 0, 0, 0, 1, 0}) +
                packed<float>({0, 0, 1, 0, 0, 1, 0, 0, 1}) +
                packed<std::uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}) +
                packed<float>({1, 0, 0, 0, 3, 0, 0, 0, 1, 1, 0, 0}) +
                packed<float>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}) +
                packed<float>({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1});
  text.views = R"({"buffer":0,"byteOffset":0,"byteLength":36},
                  {"buffer":0,"byteOffset":36,"byteLength":36},
                  {"buffer":0,"byteOffset":72,"byteLength":12},
                  {"buffer":0,"byteOffset":84,"byteLength":48},
                  {"buffer":0,"byteOffset":132,"byteLength":128})";
  text.accessors = R"({"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                      {"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"},
                      {"bufferView":2,"componentType":5121,"count":3,"type":"VEC4"},
                      {"bufferView":3,"componentType":5126,"count":3,"type":"VEC4"},
                      {"bufferView":4,"componentType":5126,"count":2,"type":"MAT4"})";
  text.primitive = R"({"attributes":{"POSITION":0,"NORMAL":1,"JOINTS_0":2,"WEIGHTS_0":3}})";
  text.nodes = R"({"name":"rig","scale":[2,2,2],"children":[1,2]},
                  {"name":"hip"},{"name":"head","translation":[0,2,0]},
                  {"name":"body","mesh":0,"skin":0,"translation":[70,5,0],"scale":[9,9,9]})";
  text.scenes = R"({"nodes":[0,3]})";
  text.extra = R"("skins":[{"name":"s","joints":[1,2],"inverseBindMatrices":4}],)";
  return text;
}

TEST(GltfSkin, vertices_follow_their_joints_and_not_their_node) {
  const GltfModel model = load(skinned());
  ASSERT_EQ(model.placements.size(), 1U);
  const auto expect_at = [&](std::size_t vertex, const glm::dvec3& place) {
    EXPECT_LT(glm::distance(placed_point(model, 0, vertex), place), 1e-5) << vertex;
  };
  // The hip is a scale of 2. The head adds 2 * (2 - 1) in y.
  expect_at(0, {0, 0, 0});
  expect_at(1, {2, 2, 0});
  expect_at(2, {0, 3, 0});
  EXPECT_THAT(model.warnings, Contains(AllOf(HasSubstr("node 3 'body'"), HasSubstr("joints"))));
}

TEST(GltfSkin, mirroring_joints_keep_fronts_in_front) {
  GltfText text = skinned();
  text.nodes = replaced(text.nodes, R"("scale":[2,2,2])", R"("scale":[-2,2,2])");
  const GltfModel model = load(text);
  const Mesh& mesh = model.meshes.at(0);
  const auto at = [&](std::size_t corner) {
    return glm::dvec3(mesh.positions_m.at(mesh.indices.at(corner)));
  };
  EXPECT_GT(glm::cross(at(1) - at(0), at(2) - at(0)).z, 0.0);
  EXPECT_GT(mesh.normals.at(0).z, 0.9F);
  EXPECT_NEAR(bounds_of(model).min_m.x, -2.0, 1e-5);
}

TEST(GltfSkin, joints_outside_of_the_scene_count_and_wrong_ones_are_named) {
  GltfText text = skinned();
  text.scenes = R"({"nodes":[3]})";
  EXPECT_NEAR(bounds_of(load(text)).max_m.y, 3.0, 1e-5);
  const auto broken = [&](const std::string& from, const std::string& to) {
    return error_of(replaced(skinned().json(), from, to)).text;
  };
  EXPECT_THAT(broken(R"("joints":[1,2])", R"("joints":[1,9])"), HasSubstr("skin 0 's': joint 1"));
  EXPECT_THAT(broken(R"("joints":[1,2])", R"("joints":[1])"), HasSubstr("JOINTS_0: element 1"));
  EXPECT_THAT(broken(R"("skin":0)", R"("skin":4)"), HasSubstr("skin 4 does not exist"));
  EXPECT_THAT(broken(R"("count":2,"type":"MAT4")", R"("count":1,"type":"MAT4")"),
              HasSubstr("inverseBindMatrices: 1 matrices for 2 joints"));
}

// Units and places ------------------------------------------------------------------------------

TEST(GltfScale, small_bodies_of_whole_numbers_keep_their_size) {
  for (const double extent_m : {1.0, 0.06, 0.001, 1e-5}) {
    GltfText text;
    text.extra = R"("extensionsRequired":["KHR_mesh_quantization"],)";
    text.buffer = packed<std::uint16_t>({0, 0, 0, 0, 65535, 0, 0, 0, 0, 65535, 0, 0});
    text.views = R"({"buffer":0,"byteLength":24,"byteStride":8})";
    text.accessors = R"({"bufferView":0,"componentType":5123,"count":3,"type":"VEC3"})";
    text.primitive = R"({"attributes":{"POSITION":0}})";
    const std::string scale = std::to_string(extent_m * 1e6 / 65535.0) + "e-6";
    text.nodes = R"({"mesh":0,"scale":[)" + scale + "," + scale + "," + scale + "]}";
    const GltfModel model = load(text);
    ASSERT_EQ(model.placements.size(), 1U) << extent_m;
    EXPECT_NEAR(bounds_of(model).max_m.x, extent_m, 0.05 * extent_m);
    EXPECT_THAT(model.warnings, testing::IsEmpty());
  }
}

TEST(GltfScale, flattened_placements_are_still_left_out) {
  for (const std::string scale : {"[1,0,1]", "[0,0,0]", "[1,1,1e-12]"}) {
    GltfText text;
    text.nodes = R"({"mesh":0,"scale":)" + scale + "}";
    const GltfModel model = load(text);
    EXPECT_TRUE(model.placements.empty()) << scale;
    EXPECT_THAT(model.warnings, Contains(HasSubstr("zero volume")));
  }
}

TEST(GltfFarCoordinates, vertices_get_an_origin_near_them_and_a_warning) {
  const float x = 12958095.0F;
  const float z = -4865499.5F;
  GltfText text;
  text.buffer = packed<float>({x, 0, z, x + 8, 0, z, x, 2, z}) + packed<std::uint16_t>({0, 1, 2}) +
                std::string(2, '\0');
  const GltfModel model = load(text);
  for (const glm::vec3& p : model.meshes.at(0).positions_m) {
    EXPECT_LT(glm::length(p), 10.0F);
  }
  EXPECT_EQ(placed_point(model, 0, model.meshes[0].indices[1]), glm::dvec3(glm::vec3(x + 8, 0, z)));
  EXPECT_THAT(model.warnings,
              Contains(AllOf(HasSubstr("mesh 0 'part'"), HasSubstr("1.3e+07"), HasSubstr("1 m"))));
  GltfText near;
  near.buffer = packed<float>({500, 0, 0, 501, 0, 0, 500, 1, 0}) +
                packed<std::uint16_t>({0, 1, 2}) + std::string(2, '\0');
  const GltfModel untouched = load(near);
  EXPECT_EQ(untouched.meshes.at(0).bounds.min_m.x, 500.0);
  EXPECT_THAT(untouched.warnings, testing::IsEmpty());
}

// Normals, scenes, materials --------------------------------------------------------------------

TEST(GltfNormals, values_that_are_no_numbers_are_made_from_the_triangles) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 0.0F}) {
    GltfText text;
    text.buffer += packed<float>({0, 0, 1, 0, bad, bad, 0, 0, 1});
    text.views += R"(,{"buffer":0,"byteOffset":44,"byteLength":36})";
    text.accessors += R"(,{"bufferView":2,"componentType":5126,"count":3,"type":"VEC3"})";
    text.primitive = R"({"attributes":{"POSITION":0,"NORMAL":2},"indices":1})";
    const GltfModel model = load(text);
    for (const glm::vec3& normal : model.meshes.at(0).normals) {
      EXPECT_EQ(normal, glm::vec3(0, 0, 1));
    }
    EXPECT_THAT(model.warnings,
                Contains(AllOf(HasSubstr("mesh 0 'part' primitive 0"), HasSubstr("1 normals"))));
  }
}

TEST(GltfScene, an_empty_scene_is_warned_of) {
  GltfText text;
  text.scenes = R"({"name":"blank","nodes":[]},{"nodes":[0]})";
  EXPECT_THAT(load(text).warnings,
              Contains(AllOf(HasSubstr("scene 0 'blank' has no triangles"), HasSubstr("other"))));
  GltfText lines;
  lines.primitive = R"({"attributes":{"POSITION":0},"mode":1})";
  EXPECT_THAT(load(lines).warnings, Contains(HasSubstr("has no triangles")));
}

TEST(GltfMaterials, what_is_not_shown_is_said) {
  GltfText text;
  text.materials = R"({"name":"leaf","alphaMode":"MASK","pbrMetallicRoughness":
                        {"baseColorTexture":{"index":0}}},
                      {"name":"glass","alphaMode":"BLEND"},
                      {"name":"unused","alphaMode":"MASK"},{"name":"plain"})";
  text.extra = R"("textures":[{"source":0}],"images":[{"uri":"nowhere.png"}],)";
  text.meshes = R"({"name":"part","primitives":[
        {"attributes":{"POSITION":0,"COLOR_0":0},"indices":1,"material":0}]},
      {"primitives":[{"attributes":{"POSITION":0},"indices":1,"material":1}]},
      {"primitives":[{"attributes":{"POSITION":0},"indices":1,"material":3}]})";
  text.nodes = R"({"mesh":0},{"mesh":1,"translation":[0,0,1]},{"mesh":2,"translation":[0,0,2]})";
  text.scenes = R"({"nodes":[0,1,2]})";
  const std::vector<std::string> warnings = load(text).warnings;
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr("MASK"), HasSubstr("'leaf'"), HasSubstr("solid"),
                                       HasSubstr("nowhere.png"))));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr("BLEND"), HasSubstr("'glass'"))));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr("textures"), HasSubstr("'leaf'"))));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr("vertex colours"), HasSubstr("mesh 0 'part'"))));
  EXPECT_THAT(warnings, Each(AllOf(HasSubstr("model.gltf"), Not(HasSubstr("unused")))));
  const auto summary = inspect_gltf(write_file(test_folder() / "model.gltf", text.json()), {});
  ASSERT_TRUE(summary);
  EXPECT_THAT(to_text(*summary), AllOf(HasSubstr("textures"), HasSubstr("vertex colours")));
}

}  // namespace
}  // namespace emit::scene
