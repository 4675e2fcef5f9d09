// SPDX-License-Identifier: Apache-2.0
#include "gltf_mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <numeric>
#include <optional>
#include <unordered_map>
#include <utility>

#include "../cut/apply_cut_out.hpp"
#include "../cut/edge_points.hpp"
#include "emit/physics/check.hpp"
#include "emit/scene/gltf_import.hpp"
#include "gltf_accessor.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Smallest area of a triangle, relative to its longest edge squared. A smaller triangle has no
/// direction in float32.
constexpr double kZeroAreaFrac = 1e-12;

/// Largest coordinate, in the units of the mesh. Beyond it the squares and products of float32
/// arithmetic overflow, on the device too; nothing on Earth is as large.
constexpr double kMaxCoordinate = 1e9;

/// A mesh that lies farther from its origin than this, and farther than it is wide, gets an origin
/// of its own: below, float32 resolves half a millimetre.
constexpr double kFarCoordinate = 4096.0;

struct Soup {
  std::vector<glm::vec3> positions_m;
  std::vector<glm::vec3> normals;  ///< empty: to be computed
  std::vector<std::uint32_t> indices;
};

/// Triangles of a primitive that have one material.
struct RawPart {
  std::uint32_t material = kNoGltfMaterial;
  std::vector<std::uint32_t> indices;  ///< whole triangles
};

/// A primitive as the file has it, and where it goes.
struct RawPrimitive {
  std::string context;  ///< "mesh 0 'hangar' primitive 1"
  std::vector<glm::dvec3> positions;
  std::vector<glm::vec3> normals;      ///< empty: to be computed
  std::vector<std::uint32_t> indices;  ///< whole triangles
  std::vector<RawPart> parts;          ///< of an image of materials; empty: there is none
  std::vector<EdgePoint> edge_points;  ///< where that image has cut edges
  std::uint32_t material = kNoGltfMaterial;
  bool double_sided = false;
  bool has_indices = false;  ///< false: equal vertices may stand more than once
  bool is_cut = false;       ///< pieces without area are of the cut, not of the file
  double max_stored = 0.0;   ///< largest coordinate in the file; 0: stored as whole numbers
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

/// Makes a triangle list of a list, strip or fan. The winding of odd strip triangles is turned
/// back.
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

/// Keeps one vertex per distinct position and normal, and no unused one.
Soup deduplicated(const Soup& soup) {
  Soup out;
  out.indices.reserve(soup.indices.size());
  std::unordered_map<VertexKey, std::uint32_t, VertexHash> seen;
  seen.reserve(soup.positions_m.size());
  for (const std::uint32_t index : soup.indices) {
    VertexKey key{};
    // Adding +0 turns -0 into +0, which is the same place and the same normal.
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

/// Gives each triangle its own normal, as the specification asks for primitives without normals.
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

/// Gives the triangles of a primitive without normals those of their own planes, before a cut makes
/// pieces of them that are too small to have a direction.
void flatten(RawPrimitive& raw, std::vector<glm::dvec2>& uv) {
  if (!raw.normals.empty()) return;
  std::vector<glm::dvec3> positions;
  std::vector<glm::dvec2> flat_uv;
  for (std::size_t i = 0; i + 2 < raw.indices.size(); i += 3) {
    const glm::dvec3& a = raw.positions[raw.indices[i]];
    const glm::dvec3 area =
        glm::cross(raw.positions[raw.indices[i + 1]] - a, raw.positions[raw.indices[i + 2]] - a);
    const double length = glm::length(area);
    for (std::size_t c = 0; c < 3; ++c) {
      positions.push_back(raw.positions[raw.indices[i + c]]);
      flat_uv.push_back(uv[raw.indices[i + c]]);
      raw.normals.emplace_back(length > 0.0 ? area / length : glm::dvec3(0.0));
    }
  }
  raw.positions = std::move(positions);
  uv = std::move(flat_uv);
  raw.indices.resize(raw.positions.size());
  std::iota(raw.indices.begin(), raw.indices.end(), 0U);
  raw.has_indices = false;
}

/// Makes normals unit length. Normals without direction (zero, infinite or not a number) are made
/// from the adjacent faces, weighted by area. Returns their number.
std::uint64_t repair_normals(Soup& soup) {
  std::uint64_t repaired = 0;
  std::vector<glm::dvec3> face_sum;
  for (std::size_t v = 0; v < soup.normals.size(); ++v) {
    const double length = glm::length(glm::dvec3(soup.normals[v]));
    if (length > 1e-6 && std::isfinite(length)) {
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

/// Moves the vertices of a skinned primitive to where the joints put them. Triangles that a
/// mirroring joint turns inside out get their winding back.
void apply_matrices(const std::vector<glm::dmat4>& gltf_from_bind, RawPrimitive& raw) {
  std::vector<double> handedness(raw.positions.size());
  for (std::size_t v = 0; v < raw.positions.size(); ++v) {
    const glm::dmat4& matrix = gltf_from_bind[v];
    raw.positions[v] = glm::dvec3(matrix * glm::dvec4(raw.positions[v], 1.0));
    const glm::dmat3 linear(matrix);
    handedness[v] = glm::determinant(linear);
    if (raw.normals.empty()) continue;
    // The cofactor matrix is the inverse transpose without the division, which may fail.
    const glm::dvec3 n(raw.normals[v]);
    const glm::dvec3 turned = n.x * glm::cross(linear[1], linear[2]) +
                              n.y * glm::cross(linear[2], linear[0]) +
                              n.z * glm::cross(linear[0], linear[1]);
    const double length = glm::length(turned);
    raw.normals[v] = length > 0.0 && std::isfinite(length)
                         ? glm::vec3(turned / (handedness[v] < 0.0 ? -length : length))
                         : glm::vec3(0.0F);
  }
  for (std::size_t i = 0; i + 2 < raw.indices.size(); i += 3) {
    const double sum = handedness[raw.indices[i]] + handedness[raw.indices[i + 1]] +
                       handedness[raw.indices[i + 2]];
    if (sum < 0.0) std::swap(raw.indices[i + 1], raw.indices[i + 2]);
  }
}

Result<void> check_coordinates(const std::vector<glm::dvec3>& positions) {
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const glm::dvec3 size = glm::abs(positions[i]);
    if (!(std::max({size.x, size.y, size.z}) <= kMaxCoordinate)) {
      return make_error(ErrorCode::unsupported,
                        fmt::format("POSITION: element {} lies beyond {:g}", i, kMaxCoordinate));
    }
  }
  return {};
}

Result<void> read_positions(const tinygltf::Model& model, int accessor, RawPrimitive& raw) {
  const Result<std::vector<float>> values = read_floats(model, accessor, 3);
  if (!values) {
    return tl::unexpected(physics::Error(values.error()).with_context("POSITION"));
  }
  raw.positions.resize(values->size() / 3);
  double largest = 0.0;
  for (std::size_t i = 0; i < raw.positions.size(); ++i) {
    raw.positions[i] =
        glm::dvec3(glm::vec3((*values)[3 * i], (*values)[3 * i + 1], (*values)[3 * i + 2]));
    const glm::dvec3 size = glm::abs(raw.positions[i]);
    largest = std::max({largest, size.x, size.y, size.z});
  }
  const bool whole_numbers = model.accessors[static_cast<std::size_t>(accessor)].componentType !=
                             TINYGLTF_COMPONENT_TYPE_FLOAT;
  raw.max_stored = whole_numbers ? 0.0 : largest;
  return check_coordinates(raw.positions);
}

/// Fills in what the accessors hold.
Result<void> read_geometry(const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                           int mode, RawPrimitive& raw) {
  if (auto read = read_positions(model, primitive.attributes.at("POSITION"), raw); !read) {
    return read;
  }
  if (const auto normal = primitive.attributes.find("NORMAL");
      normal != primitive.attributes.end()) {
    const Result<std::vector<float>> normals =
        read_floats(model, normal->second, 3, NonFinite::keep);
    if (!normals) {
      return tl::unexpected(physics::Error(normals.error()).with_context("NORMAL"));
    }
    raw.normals = to_vectors(*normals);
    if (raw.normals.size() != raw.positions.size()) {
      return make_error(ErrorCode::parse, fmt::format("NORMAL: {} elements for {} vertices",
                                                      raw.normals.size(), raw.positions.size()));
    }
  }
  const Result<std::vector<std::uint32_t>> list =
      read_indices(model, primitive.indices, raw.positions.size());
  if (!list) {
    return tl::unexpected(list.error());
  }
  Result<std::vector<std::uint32_t>> triangles = to_triangle_list(*list, mode);
  if (!triangles) {
    return tl::unexpected(triangles.error());
  }
  raw.indices = std::move(*triangles);
  raw.has_indices = primitive.indices >= 0;
  return {};
}

/// Coordinates in the image of a mask; empty where the primitive has none of that number.
Result<std::vector<glm::dvec2>> read_texture_coordinates(const tinygltf::Model& model,
                                                         const tinygltf::Primitive& primitive,
                                                         int set) {
  const std::string name = fmt::format("TEXCOORD_{}", set);
  const auto found = primitive.attributes.find(name);
  std::vector<glm::dvec2> uv;
  if (found == primitive.attributes.end()) return uv;
  const Result<std::vector<float>> values = read_floats(model, found->second, 2);
  if (!values) return tl::unexpected(physics::Error(values.error()).with_context(name));
  uv.reserve(values->size() / 2);
  for (std::size_t i = 0; i + 1 < values->size(); i += 2) {
    uv.emplace_back((*values)[i], (*values)[i + 1]);
  }
  return uv;
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

/// Largest number of indices in a mesh: draw calls count them in 32 bits.
constexpr std::size_t kMaxMeshIndices = std::size_t{1} << 31U;

/// Cuts a primitive by the mask and by the image of materials that its material has.
Result<void> cut_primitive(const GltfFile& file, const tinygltf::Primitive& primitive,
                           CutOuts& cut_outs, RawPrimitive& raw,
                           std::vector<std::string>& warnings) {
  const auto warn = [&](const std::string& text) {
    warnings.push_back(fmt::format("{}: {}: {}", file.name, raw.context, text));
  };
  /// Texture coordinates of a cut; none where the primitive has no such attribute.
  const auto coordinates = [&](const CutOut& cut_out,
                               const char* otherwise) -> Result<std::vector<glm::dvec2>> {
    auto uv = read_texture_coordinates(file.model, primitive, cut_out.frame().tex_coord);
    if (uv && uv->size() != raw.positions.size()) {
      warn(fmt::format("without TEXCOORD_{}, {}", cut_out.frame().tex_coord, otherwise));
      uv->clear();
    }
    return uv;
  };
  CutOut* const mask = cut_outs.mask(raw.material, warnings);
  RegionCut* const regions = cut_outs.regions(raw.material);
  std::vector<glm::dvec2> uv;
  if (mask != nullptr) {
    auto read = coordinates(*mask, "what its image cuts out is taken as solid");
    if (!read) return tl::unexpected(std::move(read.error()));
    uv = std::move(*read);
  }
  std::vector<glm::dvec2> region_uv;
  if (regions != nullptr) {
    auto read = coordinates(regions->cut_out, "its image of materials has no effect");
    if (!read) return tl::unexpected(std::move(read.error()));
    region_uv = std::move(*read);
  }
  if (!uv.empty()) {
    // A mask that shares its coordinates with the image of materials hands them on.
    const bool same = regions == nullptr || region_uv.empty() || region_uv == uv;
    flatten(raw, uv);
    const AppliedCut applied = apply_cut_out(*mask, raw.indices, {raw.positions, raw.normals, uv});
    for (const std::string& message : applied.messages) warn(message);
    if (applied.done) {
      raw.indices = applied.parts.empty() ? std::vector<std::uint32_t>{} : applied.parts[0].indices;
      raw.is_cut = true;
    }
    raw.has_indices = false;
    if (!same) {
      warn("its image of materials has no effect, because its mask has other texture coordinates");
      return {};
    }
    if (!region_uv.empty()) region_uv = std::move(uv);
  }
  if (region_uv.empty()) return {};
  flatten(raw, region_uv);
  AppliedCut applied =
      apply_cut_out(regions->cut_out, raw.indices, {raw.positions, raw.normals, region_uv});
  for (const std::string& message : applied.messages) warn(message);
  if (!applied.done) return {};
  constexpr double kMaxUnlikeFrac = 0.05;
  if (applied.unlike_frac > kMaxUnlikeFrac) {
    warn(
        fmt::format("{:.0f} % of its surface show colours in '{}' that are unlike all of the "
                    "legend; each takes the nearest one",
                    100.0 * applied.unlike_frac, regions->name));
  }
  for (CutPart& part : applied.parts) {
    raw.parts.push_back({regions->first_material + part.part, std::move(part.indices)});
  }
  raw.edge_points = std::move(applied.edge_points);
  raw.indices.clear();
  raw.has_indices = false;
  raw.is_cut = true;
  return {};
}

/// Reads one primitive; nothing when it is of a kind that is skipped.
Result<std::optional<RawPrimitive>> read_primitive(const GltfFile& file,
                                                   const tinygltf::Primitive& primitive,
                                                   const std::string& context, const SkinPose* skin,
                                                   CutOuts& cut_outs,
                                                   std::vector<std::string>& warnings) {
  const auto warn = [&](const std::string& text) {
    warnings.push_back(fmt::format("{}: {}: {}", file.name, context, text));
  };
  const int mode = primitive.mode < 0 ? TINYGLTF_MODE_TRIANGLES : primitive.mode;
  if (mode < TINYGLTF_MODE_TRIANGLES) {
    warn("points and lines are skipped");
    return std::optional<RawPrimitive>{};
  }
  if (mode > TINYGLTF_MODE_TRIANGLE_FAN) {
    return make_error(ErrorCode::parse, fmt::format("mode {} does not exist", primitive.mode));
  }
  if (primitive.attributes.count("POSITION") == 0) {
    warn("skipped, it has no POSITION");
    return std::optional<RawPrimitive>{};
  }
  const tinygltf::Model& model = file.model;
  RawPrimitive raw;
  raw.context = context;
  if (primitive.material >= 0) {
    const auto material = static_cast<std::size_t>(primitive.material);
    if (material >= model.materials.size()) {
      return make_error(ErrorCode::parse,
                        fmt::format("material {} does not exist", primitive.material));
    }
    raw.material = static_cast<std::uint32_t>(primitive.material);
    raw.double_sided = model.materials[material].doubleSided;
  }
  if (!primitive.targets.empty()) {
    warn("morph targets are not applied");
  }
  if (auto read = read_geometry(model, primitive, mode, raw); !read) {
    return tl::unexpected(read.error());
  }
  if (skin != nullptr) {
    auto matrices = vertex_matrices(model, primitive, *skin, raw.positions.size());
    if (!matrices) return tl::unexpected(std::move(matrices.error()));
    if (matrices->gltf_from_bind.empty()) {
      warn("it has no JOINTS_0 and WEIGHTS_0: the skin is ignored");
      matrices->gltf_from_bind.assign(raw.positions.size(), skin->gltf_from_node);
    }
    if (matrices->without_weight > 0) {
      warn(fmt::format("{} vertices have no weight and follow their first joint",
                       matrices->without_weight));
    }
    apply_matrices(matrices->gltf_from_bind, raw);
    if (auto checked = check_coordinates(raw.positions); !checked) {
      return tl::unexpected(checked.error());
    }
  }
  if (auto cut = cut_primitive(file, primitive, cut_outs, raw, warnings); !cut) {
    return tl::unexpected(std::move(cut.error()));
  }
  return std::optional<RawPrimitive>{std::move(raw)};
}

double float32_step(double coordinate) {
  const auto value = static_cast<float>(coordinate);
  return static_cast<double>(std::nextafter(value, std::numeric_limits<float>::infinity()) - value);
}

/// The origin that a mesh gets: the middle of its vertices where they lie far away, else zero. It
/// is a multiple of the float32 step there, so that taking it off rounds nothing.
glm::dvec3 origin_of(const std::vector<RawPrimitive>& primitives) {
  Aabb box;
  for (const RawPrimitive& raw : primitives) {
    for (const std::uint32_t index : raw.indices) box.add(raw.positions[index]);
    for (const RawPart& part : raw.parts) {
      for (const std::uint32_t index : part.indices) box.add(raw.positions[index]);
    }
  }
  glm::dvec3 origin(0.0);
  if (box.empty()) return origin;
  const glm::dvec3 extent = box.max_m - box.min_m;
  const double width = std::max({extent.x, extent.y, extent.z});
  for (int axis = 0; axis < 3; ++axis) {
    const double middle = 0.5 * (box.min_m[axis] + box.max_m[axis]);
    if (std::abs(middle) <= std::max(kFarCoordinate, width)) continue;
    const double step = float32_step(std::abs(middle) + 0.5 * width);
    origin[axis] = step * std::round(middle / step);
  }
  return origin;
}

/// Appends the triangles of a primitive that have one material to the mesh and gives the number of
/// those left out.
Result<std::uint64_t> add_part(const GltfFile& file, const RawPrimitive& raw, RawPart part,
                               const glm::dvec3& origin, Mesh& mesh,
                               std::vector<std::string>& warnings) {
  const auto warn = [&](const std::string& text) {
    warnings.push_back(fmt::format("{}: {}: {}", file.name, raw.context, text));
  };
  Soup soup;
  soup.normals = raw.normals;
  soup.indices = std::move(part.indices);
  soup.positions_m.reserve(raw.positions.size());
  for (const glm::dvec3& position : raw.positions) {
    soup.positions_m.emplace_back(position - origin);
  }
  std::uint64_t dropped = drop_zero_area(soup);
  if (raw.is_cut) dropped = 0;
  if (dropped > 0) {
    warn(fmt::format("{} triangles of zero area dropped", dropped));
  }
  if (soup.indices.empty()) {
    return dropped;
  }
  if (soup.normals.empty()) {
    soup = with_flat_normals(soup);
  } else {
    if (const std::uint64_t repaired = repair_normals(soup); repaired > 0) {
      warn(fmt::format("{} normals without direction replaced by those of their triangles",
                       repaired));
    }
    if (!raw.has_indices) {
      soup = deduplicated(soup);
    }
  }
  if (mesh.indices.size() + soup.indices.size() > kMaxMeshIndices) {
    return make_error(ErrorCode::unsupported, "more than 2^31 indices in one mesh");
  }
  append(mesh, soup, part.material, raw.double_sided);
  return dropped;
}

/// Appends one primitive to the mesh and gives the number of triangles left out.
Result<std::uint64_t> add_primitive(const GltfFile& file, RawPrimitive raw,
                                    const glm::dvec3& origin, Mesh& mesh,
                                    std::vector<std::string>& warnings) {
  std::vector<RawPart> parts = std::move(raw.parts);
  if (parts.empty()) parts.push_back({raw.material, std::move(raw.indices)});
  std::uint64_t dropped = 0;
  for (RawPart& part : parts) {
    const auto added = add_part(file, raw, std::move(part), origin, mesh, warnings);
    if (!added) return added;
    dropped += *added;
  }
  return dropped;
}

/// Lets all primitives have the points on their edges that images of materials have cut.
void share_cut_edges(std::vector<RawPrimitive>& primitives) {
  const bool is_cut = std::ranges::any_of(
      primitives, [](const RawPrimitive& raw) { return !raw.edge_points.empty(); });
  if (!is_cut) return;
  std::vector<EdgeSurface> surfaces;
  for (RawPrimitive& raw : primitives) {
    EdgeSurface surface{raw.positions, raw.normals, raw.edge_points, {}};
    if (raw.parts.empty()) surface.triangles.push_back(&raw.indices);
    for (RawPart& part : raw.parts) surface.triangles.push_back(&part.indices);
    surfaces.push_back(surface);
  }
  share_edge_points(surfaces);
}

}  // namespace

Result<ConvertedMesh> convert_mesh(const GltfFile& file, int mesh_index, const SkinPose* skin,
                                   CutOuts& cut_outs, std::vector<std::string>& warnings) {
  EMIT_CHECK_OP(static_cast<std::size_t>(mesh_index), <, file.model.meshes.size());
  const tinygltf::Mesh& source = file.model.meshes[static_cast<std::size_t>(mesh_index)];
  ConvertedMesh converted;
  Mesh& mesh = converted.mesh;
  mesh.name = source.name.empty() ? fmt::format("mesh {}", mesh_index) : source.name;
  const std::string mesh_context = element("mesh", mesh_index, source.name);
  std::vector<RawPrimitive> primitives;
  for (std::size_t p = 0; p < source.primitives.size(); ++p) {
    const std::string context = fmt::format("{} primitive {}", mesh_context, p);
    Result<std::optional<RawPrimitive>> raw =
        read_primitive(file, source.primitives[p], context, skin, cut_outs, warnings);
    if (!raw) {
      return tl::unexpected(std::move(raw.error()).with_context(context));
    }
    if (*raw) primitives.push_back(std::move(**raw));
  }
  share_cut_edges(primitives);
  converted.origin_m = origin_of(primitives);
  for (RawPrimitive& raw : primitives) {
    converted.max_coordinate = std::max(converted.max_coordinate, raw.max_stored);
    const std::string context = raw.context;
    const Result<std::uint64_t> dropped =
        add_primitive(file, std::move(raw), converted.origin_m, mesh, warnings);
    if (!dropped) {
      return tl::unexpected(physics::Error(dropped.error()).with_context(context));
    }
    converted.dropped_triangles += *dropped;
  }
  if (converted.max_coordinate > 0.0) {
    converted.resolution = float32_step(converted.max_coordinate);
  }
  update_bounds(mesh);
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
