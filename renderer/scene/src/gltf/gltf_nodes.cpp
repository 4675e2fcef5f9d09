// SPDX-License-Identifier: Apache-2.0
#include "gltf_nodes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/ext/matrix_transform.hpp>
#include <glm/ext/quaternion_double.hpp>
#include <glm/gtc/quaternion.hpp>
#include <utility>

#include "emit/physics/check.hpp"
#include "gltf_accessor.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

glm::dmat4 compose(const glm::dvec3& translation, const glm::dquat& rotation,
                   const glm::dvec3& scale) {
  return glm::scale(glm::translate(glm::dmat4(1.0), translation) * glm::mat4_cast(rotation), scale);
}

bool all_finite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

/// Checks a property of a node; `values` is empty when the file leaves it out.
Result<void> check_property(const char* name, const std::vector<double>& values, std::size_t size) {
  if (!values.empty() && (values.size() != size || !all_finite(values))) {
    return make_error(ErrorCode::parse, fmt::format("{}: {} numbers instead of {} finite ones",
                                                    name, values.size(), size));
  }
  return {};
}

Result<glm::dquat> unit_quaternion(double x, double y, double z, double w) {
  const double norm = std::sqrt(x * x + y * y + z * z + w * w);
  if (!(norm > 1e-6)) {
    return make_error(ErrorCode::parse, "rotation: quaternion of length zero");
  }
  return glm::dquat(w / norm, x / norm, y / norm, z / norm);
}

Result<glm::dmat4> local_transform(const tinygltf::Node& node) {
  const std::pair<const char*, std::pair<const std::vector<double>*, std::size_t>> properties[] = {
      {"matrix", {&node.matrix, 16}},
      {"translation", {&node.translation, 3}},
      {"rotation", {&node.rotation, 4}},
      {"scale", {&node.scale, 3}}};
  for (const auto& [name, property] : properties) {
    if (auto checked = check_property(name, *property.first, property.second); !checked) {
      return tl::unexpected(checked.error());
    }
  }
  if (!node.matrix.empty()) {
    glm::dmat4 matrix(1.0);
    for (int i = 0; i < 16; ++i) {
      matrix[i / 4][i % 4] = node.matrix[static_cast<std::size_t>(i)];
    }
    if (matrix[0][3] != 0.0 || matrix[1][3] != 0.0 || matrix[2][3] != 0.0 || matrix[3][3] != 1.0) {
      return make_error(ErrorCode::parse, "matrix: the last row is not 0 0 0 1");
    }
    return matrix;
  }
  const auto& t = node.translation;
  const auto& r = node.rotation;
  const auto& s = node.scale;
  glm::dquat rotation(1.0, 0.0, 0.0, 0.0);
  if (!r.empty()) {
    const Result<glm::dquat> unit = unit_quaternion(r[0], r[1], r[2], r[3]);
    if (!unit) {
      return tl::unexpected(unit.error());
    }
    rotation = *unit;
  }
  return compose(t.empty() ? glm::dvec3(0.0) : glm::dvec3(t[0], t[1], t[2]), rotation,
                 s.empty() ? glm::dvec3(1.0) : glm::dvec3(s[0], s[1], s[2]));
}

bool exists(const tinygltf::Model& model, int node) {
  return node >= 0 && static_cast<std::size_t>(node) < model.nodes.size();
}

/// Nodes that are nobody's child.
std::vector<int> nodes_without_parent(const tinygltf::Model& model) {
  std::vector<bool> is_child(model.nodes.size(), false);
  for (const tinygltf::Node& node : model.nodes) {
    for (const int child : node.children) {
      if (exists(model, child)) {
        is_child[static_cast<std::size_t>(child)] = true;
      }
    }
  }
  std::vector<int> roots;
  for (std::size_t i = 0; i < is_child.size(); ++i) {
    if (!is_child[i]) {
      roots.push_back(static_cast<int>(i));
    }
  }
  return roots;
}

/// Root nodes of the scene shown.
Result<std::vector<int>> root_nodes(const tinygltf::Model& model) {
  if (model.scenes.empty()) return nodes_without_parent(model);
  const int scene = std::max(model.defaultScene, 0);
  if (static_cast<std::size_t>(scene) >= model.scenes.size()) {
    return make_error(ErrorCode::parse, fmt::format("scene {} does not exist", scene));
  }
  return model.scenes[static_cast<std::size_t>(scene)].nodes;
}

/// Values of one instancing attribute; empty when the file leaves it out.
Result<std::vector<float>> instance_attribute(const GltfFile& file, const tinygltf::Value& list,
                                              const char* name, int components) {
  if (!list.Has(name)) {
    return std::vector<float>{};
  }
  const tinygltf::Value& index = list.Get(name);
  if (!index.IsInt()) {
    return make_error(ErrorCode::parse, fmt::format("{}: not an accessor", name));
  }
  Result<std::vector<float>> values = read_floats(file.model, index.GetNumberAsInt(), components);
  if (!values) {
    return tl::unexpected(std::move(values.error()).with_context(name));
  }
  return values;
}

Result<std::vector<glm::dmat4>> read_instances(const GltfFile& file,
                                               const tinygltf::Value& extension) {
  if (!extension.Has("attributes") || !extension.Get("attributes").IsObject()) {
    return make_error(ErrorCode::parse, "no attributes");
  }
  const tinygltf::Value& list = extension.Get("attributes");
  const auto translations = instance_attribute(file, list, "TRANSLATION", 3);
  const auto rotations = instance_attribute(file, list, "ROTATION", 4);
  const auto scales = instance_attribute(file, list, "SCALE", 3);
  for (const auto* values : {&translations, &rotations, &scales}) {
    if (!*values) {
      return tl::unexpected(values->error());
    }
  }
  const std::size_t count =
      std::max({translations->size() / 3, rotations->size() / 4, scales->size() / 3});
  const auto agrees = [count](std::size_t size) { return size == 0 || size == count; };
  if (!agrees(translations->size() / 3) || !agrees(rotations->size() / 4) ||
      !agrees(scales->size() / 3)) {
    return make_error(ErrorCode::parse, "attributes differ in their number of elements");
  }
  std::vector<glm::dmat4> transforms;
  transforms.reserve(count);
  const auto vector_at = [](const std::vector<float>& values, std::size_t i, double fallback) {
    return values.empty()
               ? glm::dvec3(fallback)
               : glm::dvec3(glm::vec3(values[3 * i], values[3 * i + 1], values[3 * i + 2]));
  };
  for (std::size_t i = 0; i < count; ++i) {
    glm::dquat rotation(1.0, 0.0, 0.0, 0.0);
    if (!rotations->empty()) {
      const float* r = rotations->data() + 4 * i;
      const Result<glm::dquat> unit =
          unit_quaternion(static_cast<double>(r[0]), static_cast<double>(r[1]),
                          static_cast<double>(r[2]), static_cast<double>(r[3]));
      if (!unit) {
        return tl::unexpected(unit.error());
      }
      rotation = *unit;
    }
    transforms.push_back(
        compose(vector_at(*translations, i, 0.0), rotation, vector_at(*scales, i, 1.0)));
  }
  return transforms;
}

/// The nodes below `roots`, parents before children.
Result<std::vector<PlacedNode>> walk(const tinygltf::Model& model, const std::vector<int>& roots) {
  std::vector<PlacedNode> placed;
  std::vector<PlacedNode> open;
  std::vector<bool> visited(model.nodes.size(), false);
  for (auto root = roots.rbegin(); root != roots.rend(); ++root) {
    open.push_back({*root, glm::dmat4(1.0)});
  }
  while (!open.empty()) {
    PlacedNode current = open.back();
    open.pop_back();
    if (!exists(model, current.node)) {
      return make_error(ErrorCode::parse, fmt::format("node {} does not exist", current.node));
    }
    const auto index = static_cast<std::size_t>(current.node);
    const tinygltf::Node& node = model.nodes[index];
    const std::string context = element("node", current.node, node.name);
    if (visited[index]) {
      return make_error(ErrorCode::parse,
                        context + ": reached twice (a cycle or two parents); nodes must be a tree");
    }
    visited[index] = true;
    const Result<glm::dmat4> local = local_transform(node);
    if (!local) {
      return tl::unexpected(physics::Error(local.error()).with_context(context));
    }
    current.gltf_from_node = current.gltf_from_node * *local;
    placed.push_back(current);
    for (auto child = node.children.rbegin(); child != node.children.rend(); ++child) {
      if (!exists(model, *child)) {
        return make_error(ErrorCode::parse,
                          fmt::format("{}: child {} does not exist", context, *child));
      }
      open.push_back({*child, current.gltf_from_node});
    }
  }
  return placed;
}

}  // namespace

Result<std::vector<PlacedNode>> place_nodes(const GltfFile& file) {
  const Result<std::vector<int>> roots = root_nodes(file.model);
  if (!roots) {
    return tl::unexpected(roots.error());
  }
  return walk(file.model, *roots);
}

Result<std::vector<glm::dmat4>> all_node_transforms(const GltfFile& file) {
  const auto placed = walk(file.model, nodes_without_parent(file.model));
  if (!placed) {
    return tl::unexpected(placed.error());
  }
  // Nodes in a cycle hang below no root. They keep the identity.
  std::vector<glm::dmat4> transforms(file.model.nodes.size(), glm::dmat4(1.0));
  for (const PlacedNode& node : *placed) {
    transforms[static_cast<std::size_t>(node.node)] = node.gltf_from_node;
  }
  return transforms;
}

Result<std::vector<glm::dmat4>> node_instances(const GltfFile& file, int node_index) {
  EMIT_CHECK(exists(file.model, node_index));
  const tinygltf::Node& node = file.model.nodes[static_cast<std::size_t>(node_index)];
  const auto extension = node.extensions.find("EXT_mesh_gpu_instancing");
  if (extension == node.extensions.end()) {
    return std::vector<glm::dmat4>{glm::dmat4(1.0)};
  }
  Result<std::vector<glm::dmat4>> transforms = read_instances(file, extension->second);
  if (!transforms) {
    return tl::unexpected(
        std::move(transforms.error())
            .with_context(element("node", node_index, node.name) + ": EXT_mesh_gpu_instancing"));
  }
  return transforms;
}

}  // namespace emit::scene
