// SPDX-License-Identifier: Apache-2.0
#include "gltf_mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <unordered_map>
#include <utility>

#include "emit/scene/gltf_import.hpp"
#include "gltf_accessor.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Relative to the longest edge squared: below this a triangle has no direction in float32.
constexpr double kZeroAreaFrac = 1e-12;

/// In the units of the mesh. Beyond it the squares and products of float32 arithmetic overflow, on
/// the device too; nothing on Earth is as large.
constexpr float kMaxCoordinate = 1e9F;

struct Soup {
  std::vector<glm::vec3> positions_m;
  std::vector<glm::vec3> normals;  ///< empty: to be computed
  std::vector<std::uint32_t> indices;
};

glm::dvec3 area_vector(const std::vector<glm::vec3>& p, const std::uint32_t* triangle) {
  const glm::dvec3 a(p[triangle[0]]);
  return 0.5 * glm::cross(glm::dvec3(p[triangle[1]]) - a, glm::dvec3(p[triangle[2]]) - a);
}

bool has_no_area(const std::vector<glm::vec3>& p, const std::uint32_t* triangle) {
  const glm::dvec3 a(p[triangle[0]]);
  const glm::dvec3 b(p[triangle[1]]);
  const glm::dvec3 c(p[triangle[2]]);
  const double longest =
      std::max({glm::dot(b - a, b - a), glm::dot(c - b, c - b), glm::dot(a - c, a - c)});
  return !(glm::length(area_vector(p, triangle)) > kZeroAreaFrac * longest);
}

std::vector<glm::vec3> to_vectors(const std::vector<float>& values) {
  std::vector<glm::vec3> vectors(values.size() / 3);
  for (std::size_t i = 0; i < vectors.size(); ++i) {
    vectors[i] = glm::vec3(values[3 * i], values[3 * i + 1], values[3 * i + 2]);
  }
  return vectors;
}

/// Triangle lists out of strips and fans; the winding of odd strip triangles is turned back.
Result<std::vector<std::uint32_t>> to_triangle_list(const std::vector<std::uint32_t>& in,
                                                    int mode) {
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    if (in.size() % 3 != 0) {
      return make_error(ErrorCode::parse,
                        fmt::format("{} vertices are not whole triangles", in.size()));
    }
    return in;
  }
  if (in.size() < 3) {
    return make_error(ErrorCode::parse, fmt::format("{} vertices make no triangle", in.size()));
  }
  std::vector<std::uint32_t> out;
  out.reserve(3 * (in.size() - 2));
  for (std::size_t i = 0; i + 2 < in.size(); ++i) {
    if (mode == TINYGLTF_MODE_TRIANGLE_FAN) {
      out.insert(out.end(), {in[0], in[i + 1], in[i + 2]});
    } else if (i % 2 == 0) {
      out.insert(out.end(), {in[i], in[i + 1], in[i + 2]});
    } else {
      out.insert(out.end(), {in[i + 1], in[i], in[i + 2]});
    }
  }
  return out;
}

std::uint64_t drop_zero_area(Soup& soup) {
  std::vector<std::uint32_t> kept;
  kept.reserve(soup.indices.size());
  for (std::size_t i = 0; i < soup.indices.size(); i += 3) {
    if (!has_no_area(soup.positions_m, &soup.indices[i])) {
      kept.insert(kept.end(), soup.indices.begin() + static_cast<std::ptrdiff_t>(i),
                  soup.indices.begin() + static_cast<std::ptrdiff_t>(i + 3));
    }
  }
  const std::uint64_t dropped = (soup.indices.size() - kept.size()) / 3;
  soup.indices = std::move(kept);
  return dropped;
}

struct VertexKey {
  std::array<std::uint32_t, 6> bits;
  bool operator==(const VertexKey&) const = default;
};
struct VertexHash {
  std::size_t operator()(const VertexKey& key) const noexcept {
    std::uint64_t hash = 0xcbf29ce484222325ULL;
    for (const std::uint32_t word : key.bits) {
      hash = (hash ^ word) * 0x100000001b3ULL;
      hash ^= hash >> 29U;
    }
    return static_cast<std::size_t>(hash);
  }
};

/// One vertex per distinct position and normal; unused ones vanish.
Soup deduplicated(const Soup& soup) {
  Soup out;
  out.indices.reserve(soup.indices.size());
  std::unordered_map<VertexKey, std::uint32_t, VertexHash> seen;
  seen.reserve(soup.positions_m.size());
  for (const std::uint32_t index : soup.indices) {
    VertexKey key{};
    // -0 and 0 are one place, and one normal.
    const glm::vec3 position_m = soup.positions_m[index] + glm::vec3(0.0F);
    const glm::vec3 normal = soup.normals[index] + glm::vec3(0.0F);
    std::memcpy(key.bits.data(), &position_m, sizeof(glm::vec3));
    std::memcpy(key.bits.data() + 3, &normal, sizeof(glm::vec3));
    const auto [entry, is_new] =
        seen.emplace(key, static_cast<std::uint32_t>(out.positions_m.size()));
    if (is_new) {
      out.positions_m.push_back(position_m);
      out.normals.push_back(normal);
    }
    out.indices.push_back(entry->second);
  }
  return out;
}

/// Flat shading, as the specification asks where a primitive has no normals.
Soup with_flat_normals(const Soup& soup) {
  Soup out;
  out.positions_m.reserve(soup.indices.size());
  for (std::size_t i = 0; i < soup.indices.size(); i += 3) {
    const glm::vec3 normal(glm::normalize(area_vector(soup.positions_m, &soup.indices[i])));
    for (std::size_t corner = 0; corner < 3; ++corner) {
      out.indices.push_back(static_cast<std::uint32_t>(out.positions_m.size()));
      out.positions_m.push_back(soup.positions_m[soup.indices[i + corner]]);
      out.normals.push_back(normal);
    }
  }
  return deduplicated(out);
}

/// Makes normals unit length; those without direction are taken from the adjacent faces.
std::uint64_t repair_normals(Soup& soup) {
  std::uint64_t repaired = 0;
  std::vector<glm::dvec3> face_sum;
  for (std::size_t v = 0; v < soup.normals.size(); ++v) {
    const double length = glm::length(glm::dvec3(soup.normals[v]));
    if (length > 1e-6) {
      soup.normals[v] = glm::vec3(glm::dvec3(soup.normals[v]) / length);
      continue;
    }
    if (face_sum.empty()) {
      face_sum.assign(soup.positions_m.size(), glm::dvec3(0.0));
      for (std::size_t i = 0; i < soup.indices.size(); i += 3) {
        const glm::dvec3 area = area_vector(soup.positions_m, &soup.indices[i]);
        for (std::size_t corner = 0; corner < 3; ++corner) {
          face_sum[soup.indices[i + corner]] += area;
        }
      }
    }
    const double sum = glm::length(face_sum[v]);
    soup.normals[v] = sum > 0.0 ? glm::vec3(face_sum[v] / sum) : glm::vec3(0.0F, 1.0F, 0.0F);
    ++repaired;
  }
  return repaired;
}

Result<Soup> read_geometry(const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                           int mode) {
  Soup soup;
  const auto position = primitive.attributes.find("POSITION");
  const Result<std::vector<float>> positions = read_floats(model, position->second, 3);
  if (!positions) {
    return tl::unexpected(physics::Error(positions.error()).with_context("POSITION"));
  }
  for (std::size_t i = 0; i < positions->size(); ++i) {
    if (std::abs((*positions)[i]) > kMaxCoordinate) {
      return make_error(ErrorCode::unsupported, fmt::format("POSITION: element {} lies beyond {:g}",
                                                            i / 3, kMaxCoordinate));
    }
  }
  soup.positions_m = to_vectors(*positions);
  if (const auto normal = primitive.attributes.find("NORMAL");
      normal != primitive.attributes.end()) {
    const Result<std::vector<float>> normals = read_floats(model, normal->second, 3);
    if (!normals) {
      return tl::unexpected(physics::Error(normals.error()).with_context("NORMAL"));
    }
    soup.normals = to_vectors(*normals);
    if (soup.normals.size() != soup.positions_m.size()) {
      return make_error(ErrorCode::parse,
                        fmt::format("NORMAL: {} elements for {} vertices", soup.normals.size(),
                                    soup.positions_m.size()));
    }
  }
  const Result<std::vector<std::uint32_t>> raw =
      read_indices(model, primitive.indices, soup.positions_m.size());
  if (!raw) {
    return tl::unexpected(raw.error());
  }
  Result<std::vector<std::uint32_t>> list = to_triangle_list(*raw, mode);
  if (!list) {
    return tl::unexpected(list.error());
  }
  soup.indices = std::move(*list);
  return soup;
}

void append(Mesh& mesh, const Soup& soup, std::uint32_t material, bool double_sided) {
  const auto base = static_cast<std::uint32_t>(mesh.positions_m.size());
  const auto first = static_cast<std::uint32_t>(mesh.indices.size());
  const auto count = static_cast<std::uint32_t>(soup.indices.size());
  mesh.positions_m.insert(mesh.positions_m.end(), soup.positions_m.begin(), soup.positions_m.end());
  mesh.normals.insert(mesh.normals.end(), soup.normals.begin(), soup.normals.end());
  mesh.indices.reserve(mesh.indices.size() + count);
  for (const std::uint32_t index : soup.indices) {
    mesh.indices.push_back(base + index);
  }
  mesh.submeshes.push_back({first, count, material, double_sided});
}

constexpr std::size_t kMaxMeshIndices = std::size_t{1} << 31U;

/// One primitive; nothing is appended when it is of a kind that is skipped.
Result<std::uint64_t> add_primitive(const GltfFile& file, const tinygltf::Primitive& primitive,
                                    const std::string& context, Mesh& mesh,
                                    std::vector<std::string>& warnings) {
  const auto warn = [&](const std::string& text) {
    warnings.push_back(fmt::format("{}: {}: {}", file.name, context, text));
  };
  const int mode = primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
  if (mode < TINYGLTF_MODE_TRIANGLES) {
    warn("points and lines are skipped");
    return std::uint64_t{0};
  }
  if (mode > TINYGLTF_MODE_TRIANGLE_FAN) {
    return make_error(ErrorCode::parse, fmt::format("mode {} does not exist", primitive.mode));
  }
  if (primitive.attributes.count("POSITION") == 0) {
    warn("skipped, it has no POSITION");
    return std::uint64_t{0};
  }
  const tinygltf::Model& model = file.model;
  if (primitive.material >= 0 &&
      static_cast<std::size_t>(primitive.material) >= model.materials.size()) {
    return make_error(ErrorCode::parse,
                      fmt::format("material {} does not exist", primitive.material));
  }
  if (!primitive.targets.empty()) {
    warn("morph targets are not applied");
  }
  Result<Soup> soup = read_geometry(model, primitive, mode);
  if (!soup) {
    return tl::unexpected(soup.error());
  }
  const std::uint64_t dropped = drop_zero_area(*soup);
  if (dropped > 0) {
    warn(fmt::format("{} triangles of zero area dropped", dropped));
  }
  if (soup->indices.empty()) {
    return dropped;
  }
  if (soup->normals.empty()) {
    *soup = with_flat_normals(*soup);
  } else {
    if (const std::uint64_t repaired = repair_normals(*soup); repaired > 0) {
      warn(fmt::format("{} normals without direction replaced", repaired));
    }
    if (primitive.indices < 0) {
      *soup = deduplicated(*soup);
    }
  }
  if (mesh.indices.size() + soup->indices.size() > kMaxMeshIndices) {
    return make_error(ErrorCode::unsupported, "more than 2^31 indices in one mesh");
  }
  const bool has_material = primitive.material >= 0;
  append(mesh, *soup,
         has_material ? static_cast<std::uint32_t>(primitive.material) : kNoGltfMaterial,
         has_material && model.materials[static_cast<std::size_t>(primitive.material)].doubleSided);
  return dropped;
}

}  // namespace

Result<ConvertedMesh> convert_mesh(const GltfFile& file, int mesh_index,
                                   std::vector<std::string>& warnings) {
  const tinygltf::Mesh& source = file.model.meshes[static_cast<std::size_t>(mesh_index)];
  ConvertedMesh converted;
  converted.mesh.name = source.name.empty() ? fmt::format("mesh {}", mesh_index) : source.name;
  const std::string mesh_context = element("mesh", mesh_index, source.name);
  for (std::size_t p = 0; p < source.primitives.size(); ++p) {
    const std::string context = fmt::format("{} primitive {}", mesh_context, p);
    const Result<std::uint64_t> dropped =
        add_primitive(file, source.primitives[p], context, converted.mesh, warnings);
    if (!dropped) {
      return tl::unexpected(physics::Error(dropped.error()).with_context(context));
    }
    converted.dropped_triangles += *dropped;
  }
  for (const std::uint32_t index : converted.mesh.indices) {
    converted.mesh.bounds.add(glm::dvec3(converted.mesh.positions_m[index]));
  }
  converted.mesh.closed = is_closed_surface(converted.mesh);
  return converted;
}

Mesh mirrored_copy(const Mesh& mesh) {
  Mesh mirrored = mesh;
  mirrored.name += " (mirrored)";
  for (glm::vec3& position : mirrored.positions_m) {
    position.x = -position.x;
  }
  for (glm::vec3& normal : mirrored.normals) {
    normal.x = -normal.x;
  }
  for (std::size_t i = 0; i + 2 < mirrored.indices.size(); i += 3) {
    std::swap(mirrored.indices[i + 1], mirrored.indices[i + 2]);
  }
  mirrored.bounds = transformed(mesh.bounds, mesh_from_mirrored());
  return mirrored;
}

glm::dmat4 mesh_from_mirrored() noexcept {
  glm::dmat4 matrix(1.0);
  matrix[0][0] = -1.0;
  return matrix;
}

}  // namespace emit::scene
