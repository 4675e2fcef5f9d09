// SPDX-License-Identifier: Apache-2.0
#include "glb_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <glm/common.hpp>
#include <span>
#include <string>
#include <vector>

#include "foliage_image.hpp"

namespace emit::scenegen {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF buffers are little endian");

constexpr int kUnsignedShort = 5123;
constexpr int kUnsignedInt = 5125;
constexpr int kFloat = 5126;
constexpr int kArrayBuffer = 34962;
constexpr int kElementBuffer = 34963;
constexpr int kClampToEdge = 33071;

template <class Vector>
Vector gltf_from(Axes axes, const Vector& v) {
  // The axes are, map: x east -> -x, y north -> z, z up -> y; vehicle: x forward -> z, y left -> x,
  // z up -> y.
  return axes == Axes::map ? Vector(-v.x, v.z, v.y) : Vector(v.y, v.z, v.x);
}

class GlbBuffer {
 public:
  explicit GlbBuffer(Axes axes) : axes_(axes) {}

  int add_vectors(const std::vector<glm::vec3>& vectors, bool with_bounds) {
    std::vector<glm::vec3> turned(vectors.size());
    glm::vec3 lo(INFINITY);
    glm::vec3 hi(-INFINITY);
    for (std::size_t i = 0; i < vectors.size(); ++i) {
      // Adding zero turns -0 into 0, so that equal points have equal bytes.
      turned[i] = gltf_from(axes_, vectors[i]) + glm::vec3(0.0F);
      lo = glm::min(lo, turned[i]);
      hi = glm::max(hi, turned[i]);
    }
    const int view = add_view(std::as_bytes(std::span(turned)), kArrayBuffer);
    const std::string bounds =
        with_bounds ? fmt::format(R"(,"min":[{:.9g},{:.9g},{:.9g}],"max":[{:.9g},{:.9g},{:.9g}])",
                                  lo.x, lo.y, lo.z, hi.x, hi.y, hi.z)
                    : std::string();
    return add_accessor(view, kFloat, vectors.size(), "VEC3", bounds);
  }

  int add_texture_coordinates(const std::vector<glm::vec2>& uv) {
    const int view = add_view(std::as_bytes(std::span(uv)), kArrayBuffer);
    return add_accessor(view, kFloat, uv.size(), "VEC2", "");
  }

  /// Adds the bytes of an image and returns the index of their view.
  int add_image(std::span<const std::byte> data) { return add_view(data, 0); }

  int add_indices(const std::vector<std::uint32_t>& indices, std::size_t vertices) {
    if (vertices > 65535) {
      const int view = add_view(std::as_bytes(std::span(indices)), kElementBuffer);
      return add_accessor(view, kUnsignedInt, indices.size(), "SCALAR", "");
    }
    std::vector<std::uint16_t> narrow(indices.size());
    std::transform(indices.begin(), indices.end(), narrow.begin(),
                   [](std::uint32_t i) { return static_cast<std::uint16_t>(i); });
    const int view = add_view(std::as_bytes(std::span(narrow)), kElementBuffer);
    return add_accessor(view, kUnsignedShort, indices.size(), "SCALAR", "");
  }

  [[nodiscard]] const std::string& views() const { return views_; }
  [[nodiscard]] const std::string& accessors() const { return accessors_; }
  [[nodiscard]] const std::vector<std::byte>& bytes() const { return bytes_; }

 private:
  int add_view(std::span<const std::byte> data, int target) {
    views_ += fmt::format(R"({}{{"buffer":0,"byteOffset":{},"byteLength":{}{}}})",
                          views_.empty() ? "" : ",", bytes_.size(), data.size(),
                          target == 0 ? "" : fmt::format(R"(,"target":{})", target));
    bytes_.insert(bytes_.end(), data.begin(), data.end());
    bytes_.resize((bytes_.size() + 3) / 4 * 4);
    return view_count_++;
  }

  int add_accessor(int view, int type, std::size_t count, const char* shape,
                   const std::string& bounds) {
    accessors_ +=
        fmt::format(R"({}{{"bufferView":{},"componentType":{},"count":{},"type":"{}"{}}})",
                    accessors_.empty() ? "" : ",", view, type, count, shape, bounds);
    return accessor_count_++;
  }

  Axes axes_;
  std::vector<std::byte> bytes_;
  std::string views_;
  std::string accessors_;
  int view_count_ = 0;
  int accessor_count_ = 0;
};

struct MaterialKey {
  std::string name;
  bool double_sided = false;
  bool foliage = false;  ///< the image of foliage cuts it out
  bool operator==(const MaterialKey&) const = default;
};

std::size_t material_index(std::vector<MaterialKey>& materials, const Part& part) {
  const MaterialKey key{part.material, part.double_sided, !part.uv.empty()};
  const auto found = std::find(materials.begin(), materials.end(), key);
  const auto index = static_cast<std::size_t>(found - materials.begin());
  if (found == materials.end()) {
    materials.push_back(key);
  }
  return index;
}

std::string meshes_json(const Scene& scene, GlbBuffer& buffer,
                        std::vector<MaterialKey>& materials) {
  std::string meshes;
  for (const SceneMesh& mesh : scene.meshes) {
    std::string primitives;
    for (const Part& part : mesh.parts) {
      if (part.indices.empty()) {
        continue;
      }
      const int positions = buffer.add_vectors(part.positions_m, true);
      const int normals = buffer.add_vectors(part.normals, false);
      const int indices = buffer.add_indices(part.indices, part.positions_m.size());
      const std::string uv = part.uv.empty() ? std::string()
                                             : fmt::format(R"(,"TEXCOORD_0":{})",
                                                           buffer.add_texture_coordinates(part.uv));
      primitives += fmt::format(
          R"({}{{"attributes":{{"POSITION":{},"NORMAL":{}{}}},"indices":{},"material":{}}})",
          primitives.empty() ? "" : ",", positions, normals, uv, indices,
          material_index(materials, part));
    }
    meshes += fmt::format(R"({}{{"name":"{}","primitives":[{}]}})", meshes.empty() ? "" : ",",
                          mesh.name, primitives);
  }
  return meshes;
}

std::string nodes_json(const Scene& scene) {
  std::string nodes;
  for (const SceneNode& node : scene.nodes) {
    const glm::dvec3 t = gltf_from(scene.axes, node.position_m) + glm::dvec3(0.0);
    nodes +=
        fmt::format(R"({}{{"name":"{}","mesh":{})", nodes.empty() ? "" : ",", node.name, node.mesh);
    if (t != glm::dvec3(0.0)) {
      nodes += fmt::format(R"(,"translation":[{:.9g},{:.9g},{:.9g}])", t.x, t.y, t.z);
    }
    if (node.yaw_rad != 0.0) {
      nodes += fmt::format(R"(,"rotation":[0,{:.12g},0,{:.12g}])", std::sin(0.5 * node.yaw_rad),
                           std::cos(0.5 * node.yaw_rad));
    }
    nodes += "}";
  }
  return nodes;
}

void append_u32(std::string& out, std::size_t value) {
  const auto word = static_cast<std::uint32_t>(value);
  char bytes[sizeof word];
  std::memcpy(bytes, &word, sizeof word);
  out.append(bytes, sizeof word);
}

}  // namespace

physics::Result<GeneratedFile> write_glb(const std::filesystem::path& file, const Scene& scene) {
  GlbBuffer buffer(scene.axes);
  std::vector<MaterialKey> materials;
  const std::string meshes = meshes_json(scene, buffer, materials);
  std::string material_list;
  for (const MaterialKey& material : materials) {
    material_list += fmt::format(
        R"({}{{"name":"{}"{}{}}})", material_list.empty() ? "" : ",", material.name,
        material.double_sided ? R"(,"doubleSided":true)" : "",
        material.foliage
            ? R"(,"alphaMode":"MASK","pbrMetallicRoughness":{"baseColorTexture":{"index":0}})"
            : "");
  }
  std::string images;
  if (std::ranges::any_of(materials, &MaterialKey::foliage)) {
    images = fmt::format(
        R"("textures":[{{"source":0,"sampler":0}}],"samplers":[{{"wrapS":{0},"wrapT":{0}}}],)"
        R"("images":[{{"bufferView":{1},"mimeType":"image/png"}}],)",
        kClampToEdge, buffer.add_image(foliage_png()));
  }
  std::string node_list;
  for (std::size_t i = 0; i < scene.nodes.size(); ++i) {
    node_list += fmt::format("{}{}", i == 0 ? "" : ",", i);
  }
  std::string json =
      fmt::format(R"({{"asset":{{"version":"2.0","generator":"emit generate"}},"scene":0,)"
                  R"("scenes":[{{"nodes":[{}]}}],"nodes":[{}],"meshes":[{}],"materials":[{}],{})"
                  R"("accessors":[{}],"bufferViews":[{}],"buffers":[{{"byteLength":{}}}]}})",
                  node_list, nodes_json(scene), meshes, material_list, images, buffer.accessors(),
                  buffer.views(), buffer.bytes().size());
  json.resize((json.size() + 3) / 4 * 4, ' ');

  std::string head = "glTF";
  append_u32(head, 2);
  append_u32(head, 12 + 8 + json.size() + 8 + buffer.bytes().size());
  append_u32(head, json.size());
  head += "JSON";
  head += json;
  append_u32(head, buffer.bytes().size());
  head.append("BIN\0", 4);
  std::ofstream stream(file, std::ios::binary | std::ios::trunc);
  stream.write(head.data(), static_cast<std::streamsize>(head.size()));
  stream.write(reinterpret_cast<const char*>(buffer.bytes().data()),
               static_cast<std::streamsize>(buffer.bytes().size()));
  stream.close();
  if (!stream) {
    return physics::make_error(physics::ErrorCode::io, file.string() + ": writing failed");
  }
  GeneratedFile written;
  written.path = file;
  written.triangles = triangle_count(scene);
  written.bytes = head.size() + buffer.bytes().size();
  for (const SceneMesh& mesh : scene.meshes) {
    for (const Part& part : mesh.parts) {
      written.vertices += part.positions_m.size();
    }
  }
  return written;
}

}  // namespace emit::scenegen
