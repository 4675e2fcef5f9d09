// SPDX-License-Identifier: Apache-2.0
// Surfaces that were simplified for their distance are lit as they were before.
#include "surface/rays/surface_detail.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/scene/simplify.hpp"
#include "history/foster_setup.hpp"
#include "support/times.hpp"
#include "surface/run/cached_surface.hpp"

namespace emit::renderer {
namespace {

using emit::test::kSecondNs;
using physics::kReferenceK;
constexpr float kHeightM = 0.01F;
constexpr float kPerM = 12.0F;  // of both waves

glm::vec3 wave_normal(float x, float y) {
  return glm::normalize(glm::vec3(-kHeightM * kPerM * std::cos(kPerM * x) * std::cos(kPerM * y),
                                  kHeightM * kPerM * std::sin(kPerM * x) * std::sin(kPerM * y),
                                  1.0F));
}

/// Makes gentle waves over [-1, 1]^2, in cells of a centimetre, 5 m up and turned. `unit` is the
/// length of the mesh's own unit, m.
scene::SceneGeometry waves(float unit_m = 1.0F) {
  constexpr std::uint32_t kCells = 200;
  scene::Mesh mesh;
  for (std::uint32_t j = 0; j <= kCells; ++j) {
    for (std::uint32_t i = 0; i <= kCells; ++i) {
      const float x = -1.0F + 2.0F * static_cast<float>(i) / kCells;
      const float y = -1.0F + 2.0F * static_cast<float>(j) / kCells;
      mesh.positions_m.emplace_back(x, y, kHeightM * std::sin(kPerM * x) * std::cos(kPerM * y));
      mesh.normals.push_back(wave_normal(x, y));
      mesh.positions_m.back() /= unit_m;
      mesh.bounds.add(glm::dvec3(mesh.positions_m.back()));
      if (i == kCells || j == kCells) continue;
      const std::uint32_t a = j * (kCells + 1) + i;
      for (const std::uint32_t v : {a, a + 1, a + kCells + 2, a, a + kCells + 2, a + kCells + 1}) {
        mesh.indices.push_back(v);
      }
    }
  }
  mesh.submeshes = {{0, static_cast<std::uint32_t>(mesh.indices.size()), 0, false}};
  scene::SceneGeometry geometry;
  geometry.triangles = mesh.indices.size() / 3;
  scene::Instance instance;
  instance.world_from_mesh = glm::rotate(glm::translate(glm::dmat4(1.0), glm::dvec3(0.0, 0.0, 5.0)),
                                         0.3, glm::dvec3(1.0, 1.0, 0.0));
  instance.world_from_mesh = glm::scale(instance.world_from_mesh, glm::dvec3(unit_m));
  instance.world_bounds = scene::transformed(mesh.bounds, instance.world_from_mesh);
  geometry.static_bounds = geometry.bounds = instance.world_bounds;
  geometry.meshes.push_back(std::move(mesh));
  geometry.instances.push_back(instance);
  scene::Material stone;
  stone.name = "stone";
  stone.layers = {{0.15, 0.7, 2120, 920}, {0.3, 1.5, 2000, 950}};
  stone.base_k = 286.15;
  stone.solar_absorptance_frac = 0.7;
  stone.emissivity_frac = 0.95;
  geometry.materials = {stone};
  return geometry;
}

const std::array<glm::dvec3, 1> kEyes{glm::dvec3(0.0, -8.0, 13.0)};
constexpr double kDetailPixelRad = 1e-3;

scene::SceneGeometry coarse_waves(float unit_m = 1.0F) {
  scene::SceneGeometry full = waves(unit_m);
  const std::vector<double> errors = scene::simplify_errors(full, {kEyes, kDetailPixelRad});
  return scene::simplified(std::move(full), errors);
}

SurfaceDetail detail_of(scene::SceneGeometry full, const scene::SceneGeometry& coarse) {
  CasterRays rays = CasterRays::create(full).value();
  return {std::move(full), std::move(rays), coarse};
}

TEST(SurfaceDetail, GivesPlacesAndNormalsOfTheFullSurface) {
  const scene::SceneGeometry coarse = coarse_waves();
  ASSERT_LT(coarse.triangles, 20'000U);
  const SurfaceDetail detail = detail_of(waves(), coarse);
  ASSERT_TRUE(detail.has(0));
  EXPECT_FALSE(detail_of(waves(), waves()).has(0));
  for (float x = -0.9F; x < 0.9F; x += 0.07F) {
    const glm::vec3 near_m(x, 0.4F * x, kHeightM);
    const auto place = detail.place(0, near_m, {0.0F, 0.0F, 1.0F}, 0.03F);
    ASSERT_TRUE(place.has_value());
    EXPECT_LT(glm::distance(place->normal, wave_normal(near_m.x, near_m.y)), 2e-3F);
    const float height_m = kHeightM * std::sin(kPerM * near_m.x) * std::cos(kPerM * near_m.y);
    EXPECT_LT(glm::distance(place->position_m, glm::vec3(near_m.x, near_m.y, height_m)), 3e-4F);
    // One place is too far away, and one faces the other way.
    EXPECT_FALSE(detail.place(0, near_m + glm::vec3(0.0F, 0.0F, 0.1F), {0.0F, 0.0F, 1.0F}, 0.03F));
    EXPECT_FALSE(detail.place(0, near_m, {0.0F, 0.0F, -1.0F}, 0.03F));
  }
}

/// Returns the greatest difference between the interpolated normals of the drawn surface, in the
/// middle of its triangles, and the waves' own. The worst `left_out` of them do not count.
float normals_error(bool with_detail, double left_out, float unit_m = 1.0F) {
  scene::ScenarioDesc scenario;
  scenario.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
  scenario.epoch_utc_ns = 1'403'330'400 * kSecondNs;  // 2014-06-21 06:00 UTC
  scenario.thermal.model = scene::ThermalModel::foster;
  scenario.thermal.steps = 4;
  scenario.thermal.lateral = false;
  scene::SceneGeometry full = waves(unit_m);
  scenario.materials = full.materials;
  scenario.default_material = "stone";
  scene::SceneGeometry coarse = coarse_waves(unit_m);
  const Environment environment(scenario);
  auto networks = build_foster_materials(scenario, full.materials);
  std::optional<SurfaceDetail> detail;
  if (with_detail) detail = detail_of(std::move(full), coarse);
  scenario.objects.resize(1);
  auto surface = CachedSurface::create(scenario, std::move(coarse), {-1},
                                       std::span(*networks).first(networks->size() - 1),
                                       kReferenceK, std::move(detail));
  if (!surface) return -1.0F;
  SurfaceHistory history(scenario.thermal.steps,
                         make_foster(scenario, std::move(*networks), environment, kReferenceK));
  StepPlan plan(scenario.thermal);
  RefineView view;
  view.pixel_rad = kDetailPixelRad;
  for (const glm::dvec3& eye : kEyes) view.eyes.push_back({eye, {}});
  if (!(*surface)->prepare(7200 * kSecondNs, view, {environment, {}}, plan, history, std::nullopt,
                           {})) {
    return -1.0F;
  }
  const SampledScene drawn = (*surface)->take_drawn_scene();
  const scene::Mesh& mesh = drawn.geometry.meshes[0];
  std::vector<float> errors;
  // Coarser levels of detail follow behind the only submesh.
  for (std::size_t i = 0; i < mesh.submeshes[0].index_count; i += 3) {
    glm::vec3 middle_m(0.0F);
    glm::vec3 normal(0.0F);
    for (std::size_t k = 0; k < 3; ++k) {
      middle_m += mesh.positions_m[mesh.indices[i + k]] / 3.0F;
      normal += mesh.normals[mesh.indices[i + k]];
    }
    errors.push_back(glm::distance(glm::normalize(normal),
                                   wave_normal(unit_m * middle_m.x, unit_m * middle_m.y)));
  }
  std::ranges::sort(errors);
  return errors[static_cast<std::size_t>((1.0 - left_out) *
                                         static_cast<double>(errors.size() - 1))];
}

TEST(SurfaceDetail, SamplesOfASimplifiedSurfaceFaceAsItDid) {
  const float with_rad = normals_error(true, 0.02);
  EXPECT_GT(with_rad, 0.0F);
  EXPECT_LT(with_rad, 0.02F);
  EXPECT_GT(normals_error(false, 0.02), 2.0F * with_rad);
  // The result does not depend on the unit of the mesh.
  EXPECT_NEAR(normals_error(true, 0.02, 0.01F), with_rad, 0.004F);
}

}  // namespace
}  // namespace emit::renderer
