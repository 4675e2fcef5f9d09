// SPDX-License-Identifier: Apache-2.0
#include "apply_cut_out.hpp"

#include <fmt/format.h>

#include <utility>

namespace emit::scene {
namespace {

/// Distances in texels by which outlines may be off, in the order in which they are tried.
constexpr double kTolerancesPx[] = {0.2, 0.5, 1.0, 2.0, 4.0, 8.0};
constexpr std::size_t kMaxTriangles = 1'000'000;

}  // namespace

CutOut* CutOuts::find(std::uint32_t material, std::vector<std::string>& warnings) {
  if (material >= file_.model.materials.size()) return nullptr;
  const auto [entry, is_new] = cut_outs_.try_emplace(material);
  std::optional<CutOut>& cut_out = entry->second;
  if (is_new) {
    auto mask = read_alpha_mask(file_, static_cast<int>(material));
    if (!mask) {
      warnings.push_back(fmt::format(
          "{}: {}: what alphaMode MASK cuts out is taken as solid: {}", file_.name,
          element("material", static_cast<int>(material), file_.model.materials[material].name),
          mask.error().text));
    } else if (*mask) {
      cut_out.emplace(std::move(**mask));
    }
  }
  return cut_out ? &*cut_out : nullptr;
}

std::vector<std::string> apply_cut_out(CutOut& cut_out, const std::vector<glm::dvec2>& uv,
                                       CutSurface surface) {
  std::vector<std::string> messages;
  std::optional<CutTriangles> cut;
  double tolerance_px = 0.0;
  for (const double tried_px : kTolerancesPx) {
    tolerance_px = tried_px;
    cut = cut_out.cut(uv, surface.indices, tried_px);
    if (!cut || cut->corners.size() <= 3 * kMaxTriangles) break;
  }
  if (!cut || cut->corners.size() > 3 * kMaxTriangles) {
    messages.push_back("its image cuts out more than a million pieces: it is taken as solid");
    return messages;
  }
  if (tolerance_px > kTolerancesPx[0]) {
    messages.push_back(fmt::format(
        "what its image cuts out is within {} texels, because finer outlines have more than a "
        "million triangles",
        tolerance_px));
  }
  if (cut->uncut > 0) {
    messages.push_back(
        fmt::format("{} triangles could not be cut out and are taken as solid", cut->uncut));
  }
  std::vector<std::uint32_t> indices;
  indices.reserve(3 * cut->whole.size() + cut->corners.size());
  for (const std::uint32_t triangle : cut->whole) {
    for (std::size_t c = 0; c < 3; ++c) indices.push_back(surface.indices[3 * triangle + c]);
  }
  const bool has_normals = !surface.normals.empty();
  surface.positions.reserve(surface.positions.size() + cut->corners.size());
  for (const CutTriangles::Corner& corner : cut->corners) {
    glm::dvec3 position(0.0);
    glm::dvec3 normal(0.0);
    for (int c = 0; c < 3; ++c) {
      const std::uint32_t vertex =
          surface.indices[3 * corner.triangle + static_cast<std::size_t>(c)];
      position += corner.shares[c] * surface.positions[vertex];
      if (has_normals) normal += corner.shares[c] * glm::dvec3(surface.normals[vertex]);
    }
    indices.push_back(static_cast<std::uint32_t>(surface.positions.size()));
    surface.positions.push_back(position);
    if (has_normals) surface.normals.emplace_back(normal);
  }
  surface.indices = std::move(indices);
  return messages;
}

}  // namespace emit::scene
