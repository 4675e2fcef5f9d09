// SPDX-License-Identifier: Apache-2.0
#include "surface/run/sampled_scene.hpp"

#include <algorithm>
#include <utility>

#include "emit/physics/check.hpp"

namespace emit::renderer {
namespace {

/// Rise of apparent temperature in K that a tenth of the sun's light causes by reflection between 3
/// and 5 um, on a surface of 300 K.
constexpr float kSunK = 5.0F;

}  // namespace

std::vector<DrawnMesh> make_drawn_meshes(const scene::SceneGeometry& geometry,
                                         const SurfaceModel& model,
                                         std::span<const SampleVertex> first) {
  EMIT_CHECK_OP(first.size(), ==, model.drawn_samples);
  std::vector<scene::Mesh> meshes;
  for (std::size_t m = 0; m < geometry.meshes.size(); ++m) {
    meshes.push_back(refined_copy(geometry.meshes[m], model.meshes[m], geometry.materials));
  }
  // Judge levels by the shown temperature, with reflected sunlight counted in.
  std::vector<float> value_k(first.size());
  std::ranges::transform(first, value_k.begin(), [](const SampleVertex& vertex) {
    return vertex.offset_k + kSunK * vertex.sun_frac;
  });
  std::vector<VertexValues> values(meshes.size());
  for (std::size_t i = 0; i < geometry.instances.size(); ++i) {
    const std::uint32_t m = geometry.instances[i].mesh;
    values[m].push_back(
        std::span(value_k).subspan(model.first_sample[i], meshes[m].positions_m.size()));
  }
  return drawn_meshes(std::move(meshes), values);
}

SampledScene take_sampled_scene(const scene::SceneGeometry& geometry, SurfaceModel& model) {
  EMIT_CHECK_OP(model.drawn.size(), ==, geometry.meshes.size());
  SampledScene scene{geometry, {}, {}, {}, {}};
  scene::SceneGeometry& out = scene.geometry;
  // Group the instances by mesh.
  std::vector<std::uint32_t> order(out.instances.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::stable_sort(order, {}, [&](std::uint32_t i) { return out.instances[i].mesh; });
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    out.instances[i] = geometry.instances[order[i]];
    scene.first_sample.push_back(model.first_sample[order[i]]);
  }
  // Replace the triangles and vertices of each mesh by the refined ones, in the order of clusters.
  for (std::size_t m = 0; m < out.meshes.size(); ++m) {
    out.meshes[m] = refined_copy(geometry.meshes[m], model.meshes[m], geometry.materials);
    out.meshes[m].indices = std::move(model.drawn[m].indices);
    scene.levels.push_back(std::move(model.drawn[m].levels));
  }
  model.drawn.clear();
  for (std::uint32_t i = 0; i < model.drawn_samples; ++i) {
    scene.sky_frac.push_back(model.samples.samples[i].sky_frac);
  }
  const auto of_entity = [](const SurfaceSample& sample) { return sample.entity >= 0; };
  if (std::ranges::none_of(model.samples.samples, of_entity)) return scene;
  for (std::uint32_t i = 0; i < model.drawn_samples; ++i) {
    const SurfaceSample& sample = model.samples.samples[i];
    scene.hull.emplace_back(0.5F * sample.hull_open_frac, sample.hull_tilt_frac);
  }
  return scene;
}

}  // namespace emit::renderer
