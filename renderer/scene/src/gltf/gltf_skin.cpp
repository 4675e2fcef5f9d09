// SPDX-License-Identifier: Apache-2.0
#include "gltf_skin.hpp"

#include <fmt/format.h>

#include <utility>

#include "gltf_accessor.hpp"

namespace emit::scene {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// A primitive may have several sets of four joints; no exporter writes more than two.
constexpr int kMaxSets = 8;

/// Values of one attribute of four components; empty where the primitive does not have it.
Result<std::vector<float>> read_set(const tinygltf::Model& model,
                                    const tinygltf::Primitive& primitive, const std::string& name,
                                    std::size_t vertices) {
  const auto attribute = primitive.attributes.find(name);
  if (attribute == primitive.attributes.end()) return std::vector<float>{};
  Result<std::vector<float>> values = read_floats(model, attribute->second, 4);
  if (!values) return tl::unexpected(std::move(values.error()).with_context(name));
  if (values->size() != 4 * vertices) {
    return make_error(ErrorCode::parse, fmt::format("{}: {} elements for {} vertices", name,
                                                    values->size() / 4, vertices));
  }
  return values;
}

Result<std::vector<glm::dmat4>> inverse_bind_matrices(const GltfFile& file,
                                                      const tinygltf::Skin& skin) {
  std::vector<glm::dmat4> matrices(skin.joints.size(), glm::dmat4(1.0));
  if (skin.inverseBindMatrices < 0) return matrices;
  const auto values = read_floats(file.model, skin.inverseBindMatrices, 16);
  if (!values) {
    return tl::unexpected(physics::Error(values.error()).with_context("inverseBindMatrices"));
  }
  if (values->size() < 16 * matrices.size()) {
    return make_error(ErrorCode::parse,
                      fmt::format("inverseBindMatrices: {} matrices for {} joints",
                                  values->size() / 16, matrices.size()));
  }
  for (std::size_t j = 0; j < matrices.size(); ++j) {
    for (std::size_t i = 0; i < 16; ++i) {
      matrices[j][static_cast<int>(i / 4)][static_cast<int>(i % 4)] =
          static_cast<double>((*values)[16 * j + i]);
    }
  }
  return matrices;
}

}  // namespace

Result<SkinPose> read_skin(const GltfFile& file, int skin_index,
                           const std::vector<glm::dmat4>& gltf_from_node) {
  const tinygltf::Model& model = file.model;
  if (skin_index < 0 || static_cast<std::size_t>(skin_index) >= model.skins.size()) {
    return make_error(ErrorCode::parse, fmt::format("skin {} does not exist", skin_index));
  }
  const tinygltf::Skin& skin = model.skins[static_cast<std::size_t>(skin_index)];
  const std::string context = element("skin", skin_index, skin.name);
  Result<std::vector<glm::dmat4>> matrices = inverse_bind_matrices(file, skin);
  if (!matrices) return tl::unexpected(std::move(matrices.error()).with_context(context));
  for (std::size_t j = 0; j < skin.joints.size(); ++j) {
    const int node = skin.joints[j];
    if (node < 0 || static_cast<std::size_t>(node) >= gltf_from_node.size()) {
      return make_error(ErrorCode::parse,
                        fmt::format("{}: joint {}: node {} does not exist", context, j, node));
    }
    (*matrices)[j] = gltf_from_node[static_cast<std::size_t>(node)] * (*matrices)[j];
  }
  return SkinPose{std::move(*matrices), glm::dmat4(1.0)};
}

Result<VertexMatrices> vertex_matrices(const tinygltf::Model& model,
                                       const tinygltf::Primitive& primitive, const SkinPose& pose,
                                       std::size_t vertices) {
  VertexMatrices out;
  std::vector<double> sums;
  std::vector<std::size_t> first_joints;
  for (int set = 0; set < kMaxSets; ++set) {
    const auto joints = read_set(model, primitive, fmt::format("JOINTS_{}", set), vertices);
    if (!joints) return tl::unexpected(joints.error());
    const auto weights = read_set(model, primitive, fmt::format("WEIGHTS_{}", set), vertices);
    if (!weights) return tl::unexpected(weights.error());
    if (joints->empty() || weights->empty()) break;
    if (set == 0) {
      out.gltf_from_bind.assign(vertices, glm::dmat4(0.0));
      sums.assign(vertices, 0.0);
      first_joints.assign(vertices, 0);
    }
    for (std::size_t i = 0; i < joints->size(); ++i) {
      const double weight = static_cast<double>((*weights)[i]);
      const float joint = (*joints)[i];
      if (!(joint >= 0.0F) || joint >= static_cast<float>(pose.gltf_from_bind.size())) {
        if (weight == 0.0) continue;
        return make_error(ErrorCode::parse,
                          fmt::format("JOINTS_{}: element {}: joint {} of a skin with {}", set,
                                      i / 4, joint, pose.gltf_from_bind.size()));
      }
      const auto j = static_cast<std::size_t>(joint);
      if (set == 0 && i % 4 == 0) first_joints[i / 4] = j;
      out.gltf_from_bind[i / 4] += weight * pose.gltf_from_bind[j];
      sums[i / 4] += weight;
    }
  }
  for (std::size_t v = 0; v < out.gltf_from_bind.size(); ++v) {
    if (sums[v] > 0.0) {
      out.gltf_from_bind[v] *= 1.0 / sums[v];
    } else if (!pose.gltf_from_bind.empty()) {
      out.gltf_from_bind[v] = pose.gltf_from_bind[first_joints[v]];
      ++out.without_weight;
    }
  }
  return out;
}

}  // namespace emit::scene
