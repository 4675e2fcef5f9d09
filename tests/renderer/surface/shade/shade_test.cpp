// SPDX-License-Identifier: Apache-2.0
// Shade of entities: entity shadow depth maps, the response of materials, and exposure tiles.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <optional>
#include <vector>

#include "emit/physics/constants.hpp"
#include "history/foster_setup.hpp"
#include "renderer/surface/surface_scene.hpp"
#include "support/times.hpp"
#include "surface/shade/exposure_tiles.hpp"

namespace emit::renderer {
namespace {

using emit::test::kSecondNs;
constexpr std::int64_t kNoonNs = 4 * 3600 * kSecondNs;
using physics::kReferenceK;
constexpr float kHalfM = 2.0F;
constexpr float kHeightM = 3.0F;

scene::ScenarioDesc place() {
  scene::ScenarioDesc s;
  s.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
  s.epoch_utc_ns = 1'403'330'400 * kSecondNs;  // 2014-06-21 06:00 UTC
  scene::Material stone;
  stone.name = "stone";
  stone.layers = {{0.15, 0.7, 2120, 920}, {0.3, 1.5, 2000, 950}};
  stone.solar_absorptance_frac = 0.8;
  stone.emissivity_frac = 0.9;
  stone.base_k = 286.15;
  stone.modes = {{300.0, 0.5}, {5000.0, 0.5}};
  scene::Material steel = stone;
  steel.name = "steel";
  steel.layers = {{0.003, 45.0, 7850, 480}, {0.05, 0.04, 30, 1000}};
  scene::Material wood = stone;
  wood.name = "wood";
  wood.layers = {{0.03, 0.14, 600, 1700}};
  s.materials = {stone, steel, wood};
  s.default_material = "stone";
  s.thermal.model = scene::ThermalModel::foster;
  return s;
}

/// A level plate over level ground.
class ShadeTest : public ::testing::Test {
 protected:
  ShadeTest() : scenario_(place()), environment_(scenario_) {
    scene_.add_static(test::level_mesh(glm::vec3(-50.0F), glm::vec3(50.0F), 0.0F));
    scene_.add_entity(test::level_mesh(glm::vec3(-kHalfM), glm::vec3(kHalfM), 0.0F));
    auto rays = CasterRays::create(scene_.geometry);
    EXPECT_TRUE(rays.has_value());
    rays_.emplace(std::move(*rays));
    const scene::Aabb box = scene_.geometry.meshes.back().bounds;
    shadow_maps_ = EntityShadowMaps({&box, 1});
    auto networks = build_foster_materials(scenario_, scenario_.materials);
    EXPECT_TRUE(networks.has_value());
    heat_.emplace(FosterHeat(std::span(*networks).first(3), kReferenceK, 0.02));
    scene::ObjectDesc plate;
    plate.entity_id = 7;
    entities_.emplace_back(plate, pose_at(0.0, kHeightM));
  }
  [[nodiscard]] static physics::Pose pose_at(double east_m, double up_m) {
    physics::Pose pose;
    pose.position_world_m = {east_m, 0.0, up_m};
    return pose;
  }
  [[nodiscard]] glm::dvec3 to_sun(std::int64_t now_ns) const {
    return environment_.sun_at(now_ns).direction_enu;
  }
  [[nodiscard]] ExposureTiles::Inputs inputs() {
    return {environment_, entities_, *rays_, workers_, shadow_maps_, glm::dvec3(0.0)};
  }
  /// Runs the tiles as frames do, ten a second.
  void run_to(ExposureTiles& shade, std::int64_t from_ns, std::int64_t until_ns,
              const SurfaceSamples& all, const ExposureTiles::Inputs& inputs) {
    for (std::int64_t t = from_ns; t < until_ns;) {
      t = std::min(t + kSecondNs / 10, until_ns);
      inputs.shadow_maps.begin_frame();
      shade.run(t, all, inputs);
    }
  }
  /// Returns samples of the ground, a metre apart.
  [[nodiscard]] static SurfaceSamples ground() {
    SurfaceSamples all;
    for (int y = -20; y <= 20; ++y) {
      for (int x = -20; x <= 20; ++x) {
        SurfaceSample& sample = all.samples.emplace_back();
        sample.position_m = glm::vec3(x, y, 0.0F);
        sample.normal = glm::vec3(0.0F, 0.0F, 1.0F);
      }
    }
    return all;
  }
  [[nodiscard]] ExposureTiles tiles(const SurfaceSamples& all, float tolerance_k = 0.1F) {
    return {all,
            static_cast<std::uint32_t>(all.samples.size()),
            ShadeResponse(*heat_, scenario_.materials.size(), {12.0, 305.0}),
            entities_.size(),
            0,
            tolerance_k};
  }
  /// Returns the distance of a point of the ground from the edge of the plate's shadow, positive
  /// inside.
  [[nodiscard]] double inside_m(const glm::vec3& point_m, double east_m,
                                std::int64_t now_ns) const {
    const glm::dvec3 sun = to_sun(now_ns);
    const glm::dvec3 aside_m =
        glm::dvec3(point_m) + kHeightM / sun.z * sun - glm::dvec3(east_m, 0.0, kHeightM);
    return kHalfM - std::max(std::abs(aside_m.x), std::abs(aside_m.y));
  }

  scene::ScenarioDesc scenario_;
  Environment environment_;
  test::SurfaceScene scene_;
  std::optional<CasterRays> rays_;
  std::optional<SampleHeat> heat_;
  threads::WorkerPool workers_{2};
  EntityShadowMaps shadow_maps_;
  std::vector<PoseHistory> entities_;
};

TEST_F(ShadeTest, AnEntityShadowMapIsDarkBehindItsBodyOnly) {
  const glm::vec3 sun(to_sun(kNoonNs));
  (void)shadow_maps_.look(0, sun, EntityShadowMaps::kSharpRad, *rays_, workers_);
  const EntityPlacement high{glm::mat3(1.0F), {0.0F, 0.0F, kHeightM}, true};
  const PlacedShadowMap placed = shadow_maps_.place(0, high, sun);
  const auto shaded_frac = [&](const glm::vec3& point_m) {
    const glm::vec4 p(point_m, 1.0F);
    const float depth_m = glm::dot(placed.depth_m, p);
    return shadow_maps_.shaded_frac(0, glm::dot(placed.column, p), glm::dot(placed.row, p), depth_m,
                                    penumbra_texels(placed, depth_m));
  };
  int dark = 0;
  for (float x = -8.0F; x <= 8.0F; x += 0.17F) {
    for (float y = -8.0F; y <= 8.0F; y += 0.19F) {
      const glm::vec3 point_m(x, y, 0.0F);
      const double inside = inside_m(point_m, 0.0, kNoonNs);
      if (std::abs(inside) < 0.12) continue;
      EXPECT_EQ(shaded_frac(point_m), inside > 0.0 ? 1.0F : 0.0F) << x << ' ' << y;
      dark += inside > 0.0 ? 1 : 0;
      // The mirrored point lies on the same line on the sun's side of the plate.
      EXPECT_EQ(shaded_frac(point_m + (kHeightM / sun.z + 1.0F) * sun), 0.0F);
    }
  }
  EXPECT_GT(dark, 300);
  // A point on the edge sees half of the disc, however many looks are taken at a time.
  const glm::vec3 edge_m = glm::vec3(kHalfM, 0.0F, kHeightM) - kHeightM / sun.z * sun;
  EXPECT_NEAR(shaded_frac(edge_m), 0.5F, 0.35F);
  const glm::vec4 p(edge_m, 1.0F);
  float sum = 0.0F;
  for (std::uint32_t first = 0; first < 5; ++first) {
    sum += shadow_maps_.shaded_frac(0, glm::dot(placed.column, p), glm::dot(placed.row, p),
                                    glm::dot(placed.depth_m, p),
                                    penumbra_texels(placed, glm::dot(placed.depth_m, p)), first, 5);
  }
  EXPECT_FLOAT_EQ(sum, shaded_frac(edge_m));
}

TEST_F(ShadeTest, AnEntityShadowMapIsMadeAnewWhereTheBodyHasTurnedToTheSun) {
  const glm::vec3 sun(to_sun(kNoonNs));
  (void)shadow_maps_.look(0, sun, EntityShadowMaps::kSharpRad, *rays_, workers_);
  EXPECT_EQ(shadow_maps_.revision(0), 1U);
  const auto turned = [&](float rad) { return glm::normalize(sun + glm::vec3(rad, 0.0F, 0.0F)); };
  EXPECT_TRUE(shadow_maps_.look(0, turned(3e-3F), EntityShadowMaps::kSharpRad, *rays_, workers_));
  EXPECT_EQ(shadow_maps_.revision(0), 1U);
  EXPECT_TRUE(
      shadow_maps_.look(0, turned(1.5e-2F), EntityShadowMaps::kSmearedRad, *rays_, workers_));
  EXPECT_EQ(shadow_maps_.revision(0), 1U);
  EXPECT_TRUE(shadow_maps_.look(0, turned(1.5e-2F), EntityShadowMaps::kSharpRad, *rays_, workers_));
  EXPECT_EQ(shadow_maps_.revision(0), 2U);
  // So many updates are allowed per frame. After that a map that is nearly right is used.
  for (int i = 2; i < EntityShadowMaps::kLooksPerFrame; ++i) {
    const float rad = 0.02F * static_cast<float>(i);
    EXPECT_TRUE(shadow_maps_.look(0, turned(rad), EntityShadowMaps::kSharpRad, *rays_, workers_));
  }
  const auto looks = static_cast<std::uint32_t>(EntityShadowMaps::kLooksPerFrame);
  EXPECT_EQ(shadow_maps_.revision(0), looks);
  EXPECT_TRUE(shadow_maps_.look(0, turned(0.15F), EntityShadowMaps::kSharpRad, *rays_, workers_));
  EXPECT_FALSE(shadow_maps_.look(0, turned(0.5F), EntityShadowMaps::kSharpRad, *rays_, workers_));
  EXPECT_EQ(shadow_maps_.revision(0), looks);
  shadow_maps_.begin_frame();
  EXPECT_TRUE(shadow_maps_.look(0, turned(0.5F), EntityShadowMaps::kSharpRad, *rays_, workers_));
  EXPECT_EQ(shadow_maps_.revision(0), looks + 1);
}

TEST_F(ShadeTest, AShadowLiesInTheSunsDirectionWhateverTheOutlineIsOf) {
  // A turn of 15 mrad would shift the shadow by 4 m at 300 m.
  constexpr float kFarM = 300.0F;
  const glm::vec3 sun(to_sun(kNoonNs));
  const glm::vec3 before = glm::normalize(sun + glm::vec3(1e-2F, 1e-2F, 0.0F));
  (void)shadow_maps_.look(0, before, EntityShadowMaps::kSharpRad, *rays_, workers_);
  const EntityPlacement high{glm::mat3(1.0F), {0.0F, 0.0F, kFarM}, true};
  const PlacedShadowMap placed = shadow_maps_.place(0, high, sun);
  for (const float up_m : {kFarM - 1.0F, 0.5F * kFarM, 0.0F}) {
    const glm::vec3 behind_m = high.position_m - (kFarM - up_m) / sun.z * sun;
    for (const float aside : {-0.95F, 0.0F, 0.95F}) {
      const glm::vec4 p(behind_m + aside * glm::vec3(kHalfM, 0.0F, 0.0F), 1.0F);
      constexpr float kMiddle = 0.5F * EntityShadowMaps::kSide;
      const float at = glm::length(glm::vec2(glm::dot(placed.column, p) - kMiddle,
                                             glm::dot(placed.row, p) - kMiddle)) *
                       placed.texel_m;
      const glm::vec3 across = glm::vec3(kHalfM, 0.0F, 0.0F);
      const float expected_m = std::abs(aside) * glm::length(across - glm::dot(across, sun) * sun);
      EXPECT_NEAR(at, expected_m, 0.05F) << up_m << ' ' << aside;
      EXPECT_NEAR(glm::dot(placed.depth_m, p), (kFarM - up_m) / sun.z, 0.05F * kFarM);
    }
  }
}

TEST_F(ShadeTest, FourExponentialsFollowTheModel) {
  const ResponseConditions around{12.0, 305.0};
  const ShadeResponse response(*heat_, scenario_.materials.size(), around);
  std::vector<double> times_s;
  for (double t = 0.5; t < 3600.0; t *= 1.3) times_s.push_back(t);
  std::vector<double> expected(times_s.size());
  for (std::uint32_t m = 0; m < scenario_.materials.size(); ++m) {
    heat_->step_response(m, around, times_s, expected);
    ASSERT_GT(expected.back(), 1e-3);
    for (std::size_t j = 0; j < times_s.size(); ++j) {
      double sum_k = 0.0;
      for (glm::length_t k = 0; k < 4; ++k) {
        const float weight_k = response.weights_k()[m][k];
        EXPECT_GE(weight_k, 0.0F);
        sum_k -= static_cast<double>(weight_k) *
                 std::expm1(-times_s[j] / ShadeResponse::kTauS[static_cast<std::size_t>(k)]);
      }
      EXPECT_NEAR(sum_k / ShadeResponse::kFullSunWM2, expected[j], 0.15 * expected[j])
          << scenario_.materials[m].name << ' ' << times_s[j] << " s";
    }
  }
}

TEST_F(ShadeTest, TheStepResponseIsThatOfTheModelsOwnSteps) {
  // The face is in balance with its surroundings, first without and then with some sun.
  HeatInterval interval = heat_->sized_interval();
  SurfaceForcing forcing;
  constexpr double kAroundK = 300.0;
  const double exitance = physics::kStefanBoltzmannWPerM2K4 * std::pow(kAroundK, 4.0);
  forcing.longwave_w_m2 = forcing.environment_w_m2 = exitance;
  forcing.film = physics::stated_film(12.0);
  forcing.air_k = kAroundK;
  constexpr double kSunWM2 = 20.0;
  forcing.sun_w_m2 = {0.0, 0.0, kSunWM2};
  interval.forcing = {forcing, forcing, 5.0};
  heat_->prepare(interval);
  SurfaceSample sample;
  const glm::vec3 up(0.0F, 0.0F, 1.0F);
  SampleState lit;
  lit.modes_k[0] = 14.0;
  SampleState dark = lit;
  for (int i = 1; i <= 60; ++i) {
    SampleDrive drive;
    drive.sun_frac = 1.0F;
    const float lit_k = heat_->advance(sample, up, interval, drive, lit).offset_k;
    drive.sun_frac = 0.0F;
    const float dark_k = heat_->advance(sample, up, interval, drive, dark).offset_k;
    const double time_s = 5.0 * i;
    double expected = 0.0;
    heat_->step_response(0, {12.0, kAroundK}, {&time_s, 1}, {&expected, 1});
    if (i % 10 != 0) continue;
    EXPECT_NEAR((lit_k - dark_k) / kSunWM2, expected, 0.03 * expected) << time_s << " s";
  }
}

TEST_F(ShadeTest, TilesHoldWhatWasShadedByItsAge) {
  const SurfaceSamples all = ground();
  ExposureTiles shade = tiles(all);
  shade.restart(kNoonNs, entities_);
  constexpr std::int64_t kStaysNs = 30 * kSecondNs;
  shade.run(kNoonNs + kStaysNs, all, inputs());
  const auto mean_flux = [&](std::int64_t now_ns) {
    return environment_.forcing_at(now_ns, environment_.sun_at(now_ns)).direct_normal_w_m2 /
           ShadeResponse::kFullSunWM2;
  };
  const double flux_frac = mean_flux(kNoonNs);
  const auto check = [&](double age_s) {
    int inside = 0;
    int used = 0;
    for (const ExposureTiles::ExposureTile& tile : shade.tiles()) {
      if (!tile.used) continue;
      ++used;
      EXPECT_NEAR(tile.plane_m, -rays_->origin_world_m().z, 1e-3);
      for (std::uint32_t y = 0; y < ExposureTiles::kSide; y += 5) {
        for (std::uint32_t x = 0; x < ExposureTiles::kSide; x += 5) {
          const glm::vec3 at_m(tile.first_m + tile.texel_m * glm::vec2(x, y), tile.plane_m);
          const double inside_m =
              this->inside_m(at_m + glm::vec3(rays_->origin_world_m()), 0.0, kNoonNs);
          if (std::abs(inside_m) < 0.15) continue;
          const glm::vec4 found = tile.left_frac * tile.shade[y * ExposureTiles::kSide + x];
          for (glm::length_t k = 0; k < 4; ++k) {
            const double tau_s = ShadeResponse::kTauS[static_cast<std::size_t>(k)];
            // Tiles take turns within a step.
            const double early = -std::expm1(-30.2 / tau_s) * std::exp(-age_s / tau_s);
            EXPECT_NEAR(found[k], inside_m > 0.0 ? flux_frac * early : 0.0, 0.012)
                << at_m.x << ' ' << at_m.y << ", mode " << k;
          }
          inside += inside_m > 0.0 ? 1 : 0;
        }
      }
    }
    return std::pair(inside, used);
  };
  const auto [inside, used] = check(0.0);
  EXPECT_GT(inside, 100);
  EXPECT_GE(used, 2);
  // Vertices have the same values.
  int vertices = 0;
  for (std::size_t i = 0; i < all.samples.size(); ++i) {
    const double inside_m = this->inside_m(
        all.samples[i].position_m + glm::vec3(rays_->origin_world_m()), 0.0, kNoonNs);
    if (std::abs(inside_m) < 0.15) continue;
    double expected_k = 0.0;
    for (glm::length_t k = 0; k < 4; ++k) {
      expected_k -= static_cast<double>(shade.response().weights_k()[0][k]) * flux_frac *
                    std::expm1(-30.1 / ShadeResponse::kTauS[static_cast<std::size_t>(k)]);
    }
    EXPECT_NEAR(shade.vertices_k()[i], inside_m > 0.0 ? expected_k : 0.0, 0.02 * expected_k);
    vertices += inside_m > 0.0 ? 1 : 0;
  }
  EXPECT_GE(vertices, 9);
  // The plate goes far away. The rest decays, and tiles with nothing left are released.
  ASSERT_TRUE(entities_[0].append(kNoonNs + kStaysNs, pose_at(500.0, kHeightM), true, true));
  shade.run(kNoonNs + kStaysNs + 20 * kSecondNs, all, inputs());
  (void)check(20.0);
  shade.run(kNoonNs + kStaysNs + 7200 * kSecondNs, all, inputs());
  for (const ExposureTiles::ExposureTile& tile : shade.tiles()) EXPECT_FALSE(tile.used);
  for (const float vertex_k : shade.vertices_k()) EXPECT_NEAR(vertex_k, 0.0F, 1e-4F);
  EXPECT_FALSE(shade.short_of_tiles());
}

TEST_F(ShadeTest, WhatPassesShadesForAsLongAsItTakes) {
  // The plate is 4 m long and moves at 8 m/s, so it passes in half a second.
  const SurfaceSamples all = ground();
  ExposureTiles shade = tiles(all);
  shade.restart(kNoonNs, entities_);
  for (int i = 0; i <= 40; ++i) {
    ASSERT_TRUE(entities_[0].append(kNoonNs + i * (kSecondNs / 10),
                                    pose_at(-16.0 + 0.8 * i, kHeightM), true, false));
  }
  const std::int64_t end_ns = kNoonNs + 4 * kSecondNs;
  run_to(shade, kNoonNs, end_ns, all, inputs());
  const double flux_frac =
      environment_.forcing_at(end_ns, environment_.sun_at(end_ns)).direct_normal_w_m2 /
      ShadeResponse::kFullSunWM2;
  int met = 0;
  for (const ExposureTiles::ExposureTile& tile : shade.tiles()) {
    if (!tile.used) continue;
    for (std::uint32_t y = 3; y < ExposureTiles::kSide; y += 7) {
      for (std::uint32_t x = 3; x < ExposureTiles::kSide; x += 7) {
        const glm::vec3 at_m(tile.first_m + tile.texel_m * glm::vec2(x, y), tile.plane_m);
        const glm::vec3 world_m = at_m + glm::vec3(rays_->origin_world_m());
        // The middle of the plate passed at that place.
        const glm::dvec3 sun = to_sun(kNoonNs + 2 * kSecondNs);
        const double east_m = world_m.x + kHeightM / sun.z * sun.x;
        const double north_m = world_m.y + kHeightM / sun.z * sun.y;
        if (std::abs(north_m) > kHalfM - 0.15 || std::abs(east_m) > 11.0) continue;
        // The plate stood there before the motion began.
        if (std::abs(east_m) < kHalfM + 0.15) continue;
        // The slowest mode has decayed by hardly anything.
        EXPECT_NEAR(tile.left_frac.w * tile.shade[y * ExposureTiles::kSide + x].w,
                    flux_frac * 0.5 / ShadeResponse::kTauS[3], 0.1 * flux_frac * 0.5 / 1000.0)
            << east_m << ' ' << north_m;
        ++met;
      }
    }
  }
  EXPECT_GT(met, 100);
}

TEST_F(ShadeTest, WhereThereAreTooFewTilesItSays) {
  // The plate jumps from place to place, too fast for anything to decay.
  const SurfaceSamples all = ground();
  ExposureTiles shade = tiles(all, 0.01F);
  shade.restart(kNoonNs, entities_);
  bool was_short = false;
  constexpr int kAcross = 12;
  for (int i = 0; i < kAcross * kAcross; ++i) {
    const std::int64_t now_ns = kNoonNs + (i + 1) * kSecondNs;
    const double east_m = -44.0 + 8.0 * (i % kAcross);
    physics::Pose pose = pose_at(east_m, kHeightM);
    pose.position_world_m.y = -44.0 + 8.0 * (i / kAcross);
    ASSERT_TRUE(entities_[0].append(now_ns, pose, true, true));
    shade.run(now_ns, all, inputs());
    was_short = was_short || shade.short_of_tiles();
    // Places that are in the shade now have tiles all the same.
    float most_k = 0.0F;
    for (const float vertex_k : shade.vertices_k()) most_k = std::max(most_k, vertex_k);
    if (std::abs(east_m) < 15.0 && std::abs(pose.position_world_m.y) < 15.0) {
      EXPECT_GT(most_k, 0.1F);
    }
  }
  EXPECT_TRUE(was_short);
  shade.run(kNoonNs + (kAcross * kAcross + 15) * kSecondNs, all, inputs());
  shade.run(kNoonNs + (kAcross * kAcross + 16) * kSecondNs, all, inputs());
  EXPECT_FALSE(shade.short_of_tiles());
}

TEST_F(ShadeTest, WhatStandsWhereItStoodTakesNoTilesFromOthers) {
  // There are more parked vehicles than tiles, and one that arrives.
  const SurfaceSamples all = ground();
  constexpr int kParked = 40;
  test::SurfaceScene scene;
  scene.add_static(test::level_mesh(glm::vec3(-200.0F), glm::vec3(200.0F), 0.0F));
  std::vector<scene::Aabb> boxes;
  std::vector<PoseHistory> entities;
  for (int i = 0; i <= kParked; ++i) {
    scene.add_entity(test::level_mesh(glm::vec3(-kHalfM), glm::vec3(kHalfM), 0.0F));
    boxes.push_back(scene.geometry.meshes.back().bounds);
    scene::ObjectDesc plate;
    plate.entity_id = static_cast<std::uint32_t>(7 + i);
    physics::Pose pose = pose_at(-150.0 + 15.0 * (i % 8), kHeightM);
    pose.position_world_m.y = -150.0 + 15.0 * (i / 8);
    entities.emplace_back(plate, pose);
  }
  const auto rays = CasterRays::create(scene.geometry);
  ASSERT_TRUE(rays.has_value());
  EntityShadowMaps shadow_maps(boxes);
  ExposureTiles shade(all, static_cast<std::uint32_t>(all.samples.size()),
                      ShadeResponse(*heat_, scenario_.materials.size(), {12.0, 305.0}),
                      entities.size(), 0, 0.1F);
  shade.restart(kNoonNs, entities);
  const ExposureTiles::Inputs inputs{environment_, entities, *rays, workers_, shadow_maps};
  run_to(shade, kNoonNs, kNoonNs + 2 * kSecondNs, all, inputs);
  EXPECT_FALSE(shade.short_of_tiles());
  ASSERT_TRUE(entities.back().append(kNoonNs + 2 * kSecondNs, pose_at(0.0, kHeightM), true, true));
  run_to(shade, kNoonNs + 2 * kSecondNs, kNoonNs + 12 * kSecondNs, all, inputs);
  const float most_k = *std::ranges::max_element(shade.vertices_k());
  EXPECT_GT(most_k, 0.5F);
}

TEST_F(ShadeTest, AfterAJumpTheLastMinuteIsMadeUpForAndTheRestIsOlder) {
  const SurfaceSamples all = ground();
  const auto vertices_after = [&](std::int64_t seconds_at_a_time) {
    std::vector<PoseHistory> entities{PoseHistory({}, pose_at(0.0, kHeightM))};
    EntityShadowMaps shadow_maps = shadow_maps_;
    ExposureTiles shade = tiles(all);
    shade.restart(kNoonNs, entities);
    const ExposureTiles::Inputs inputs{environment_, entities, *rays_, workers_, shadow_maps};
    shade.run(kNoonNs + 30 * kSecondNs, all, inputs);
    EXPECT_TRUE(entities[0].append(kNoonNs + 30 * kSecondNs, pose_at(500.0, kHeightM), true, true));
    for (std::int64_t s = 30; s < 330; s += seconds_at_a_time) {
      shade.run(kNoonNs + (s + seconds_at_a_time) * kSecondNs, all, inputs);
    }
    return std::vector<float>(shade.vertices_k().begin(), shade.vertices_k().end());
  };
  const auto step_by_step = vertices_after(1);
  const auto at_once = vertices_after(300);
  EXPECT_GT(*std::ranges::max_element(step_by_step), 0.1F);
  for (std::size_t i = 0; i < step_by_step.size(); ++i) {
    EXPECT_NEAR(at_once[i], step_by_step[i], 2e-3F) << i;
  }
}

TEST_F(ShadeTest, FasterSimTimeMakesNearlyTheSame) {
  // The plate comes by at 2 m/s, stops for a while and goes on.
  const SurfaceSamples all = ground();
  const auto east_m = [](double s) {
    return s < 8.0 ? -16.0 + 2.0 * s : s < 18.0 ? 0.0 : 2.0 * (s - 18.0);
  };
  const auto vertices_after = [&](std::int64_t step_ns) {
    std::vector<PoseHistory> entities{PoseHistory({}, pose_at(east_m(0.0), kHeightM))};
    for (int i = 0; i <= 260; ++i) {
      EXPECT_TRUE(entities[0].append(kNoonNs + i * (kSecondNs / 10),
                                     pose_at(east_m(0.1 * i), kHeightM), true, false));
    }
    EntityShadowMaps shadow_maps = shadow_maps_;
    ExposureTiles shade = tiles(all);
    shade.restart(kNoonNs, entities);
    constexpr std::int64_t kEndNs = 26 * kSecondNs;
    for (std::int64_t t = 0; t < kEndNs;) {
      t = std::min(t + step_ns, kEndNs);
      shadow_maps.begin_frame();
      shade.run(kNoonNs + t, all, {environment_, entities, *rays_, workers_, shadow_maps});
    }
    EXPECT_FALSE(shade.short_of_tiles());
    return std::vector<float>(shade.vertices_k().begin(), shade.vertices_k().end());
  };
  const auto real_time = vertices_after(kSecondNs / 50);
  const float most_k = *std::ranges::max_element(real_time);
  EXPECT_GT(most_k, 1.0F);
  // Some of these steps are made up for in windows that are as long as a normal step of a tile.
  for (const std::int64_t step_ns : {26 * ExposureTiles::kTurnNs, 4 * ExposureTiles::kStepNs,
                                     39 * ExposureTiles::kTurnNs, kSecondNs, 2 * kSecondNs}) {
    const auto faster = vertices_after(step_ns);
    double squares = 0.0;
    for (std::size_t i = 0; i < faster.size(); ++i) {
      EXPECT_NEAR(faster[i], real_time[i], 0.2F * most_k) << i;
      squares += std::pow(static_cast<double>(faster[i] - real_time[i]), 2.0);
    }
    EXPECT_LT(std::sqrt(squares / static_cast<double>(faster.size())), 0.03 * most_k);
  }
}

TEST_F(ShadeTest, WhatIsTooFastForItsPlacesIsLeftOutAndSaidWhereItMatters) {
  const SurfaceSamples all = ground();
  const auto vertices_at = [&](double speed_m_s) {
    std::vector<PoseHistory> entities{PoseHistory({}, pose_at(-100.0, kHeightM))};
    for (int i = 0; i <= 10; ++i) {
      EXPECT_TRUE(entities[0].append(kNoonNs + i * (kSecondNs / 10),
                                     pose_at(-100.0 + 0.1 * i * speed_m_s, kHeightM), true, false));
    }
    EntityShadowMaps shadow_maps = shadow_maps_;
    ExposureTiles shade = tiles(all, 0.01F);
    shade.restart(kNoonNs, entities);
    shade.run(kNoonNs + kSecondNs / 5, all,
              {environment_, entities, *rays_, workers_, shadow_maps});
    for (const ExposureTiles::ExposureTile& tile : shade.tiles()) EXPECT_FALSE(tile.used);
    return shade.short_of_tiles();
  };
  EXPECT_TRUE(vertices_at(150.0));
  EXPECT_FALSE(vertices_at(3e4));
}

TEST_F(ShadeTest, BackInTimeTilesAreForgottenAndFramesSaySo) {
  const SurfaceSamples all = ground();
  ExposureTiles shade = tiles(all);
  shade.restart(kNoonNs, entities_);
  ASSERT_TRUE(entities_[0].append(kNoonNs, pose_at(1.0, kHeightM), true, true));
  shade.run(kNoonNs + 10 * kSecondNs, all, inputs());
  EXPECT_GT(*std::ranges::max_element(shade.vertices_k()), 1.0F);
  EXPECT_FALSE(shade.short_of_tiles());
  shade.run(kNoonNs + 5 * kSecondNs, all, inputs());
  for (const float vertex_k : shade.vertices_k()) EXPECT_NEAR(vertex_k, 0.0F, 1e-4F);
  EXPECT_TRUE(shade.short_of_tiles());
  // A second run of the same instant is not a step back in time.
  shade.run(kNoonNs + 8 * kSecondNs, all, inputs());
  const float most_k = *std::ranges::max_element(shade.vertices_k());
  EXPECT_GT(most_k, 0.3F);
  shade.run(kNoonNs + 8 * kSecondNs, all, inputs());
  EXPECT_EQ(*std::ranges::max_element(shade.vertices_k()), most_k);
}

TEST_F(ShadeTest, LongShadowsHaveTilesToo) {
  // The sun stands 8 degrees high in the evening.
  const SurfaceSamples all = ground();
  std::int64_t low_ns = kNoonNs;
  while (to_sun(low_ns).z > 0.15) low_ns += 60 * kSecondNs;
  ASSERT_GT(to_sun(low_ns).z, 0.1);
  ExposureTiles shade = tiles(all);
  shade.restart(low_ns, entities_);
  physics::Pose pose;
  pose.position_world_m = kHeightM / to_sun(low_ns).z * to_sun(low_ns);
  ASSERT_TRUE(entities_[0].append(low_ns, pose, true, true));
  shade.run(low_ns + 10 * kSecondNs, all, inputs());
  EXPECT_FALSE(shade.short_of_tiles());
  float found_k = 0.0F;
  for (std::size_t i = 0; i < all.samples.size(); ++i) {
    const glm::dvec2 at_m(all.samples[i].position_m + glm::vec3(rays_->origin_world_m()));
    if (glm::length(at_m) < 1.0) {
      found_k = std::max(found_k, shade.vertices_k()[i]);
    }
  }
  EXPECT_GT(found_k, 0.05F);
}

TEST_F(ShadeTest, RaysBelongToOneTileEachOnSlopingGround) {
  test::SurfaceScene scene;
  scene::Mesh slope = test::level_mesh(glm::vec3(-50.0F), glm::vec3(50.0F), 0.0F);
  for (glm::vec3& p : slope.positions_m) p.z = 0.02F * p.x;
  slope.bounds = {};
  for (const glm::vec3& p : slope.positions_m) slope.bounds.add(glm::dvec3(p));
  scene.add_static(slope);
  scene.add_entity(test::level_mesh(glm::vec3(-kHalfM), glm::vec3(kHalfM), 0.0F));
  const auto rays = CasterRays::create(scene.geometry);
  ASSERT_TRUE(rays.has_value());
  const SurfaceSamples all = ground();
  ExposureTiles shade = tiles(all);
  shade.restart(kNoonNs, entities_);
  for (int i = 0; i <= 100; ++i) {
    ASSERT_TRUE(entities_[0].append(kNoonNs + i * (kSecondNs / 10),
                                    pose_at(-10.0 + 0.2 * i, kHeightM), true, false));
  }
  shade.run(kNoonNs + 10 * kSecondNs, all,
            {environment_, entities_, *rays, workers_, shadow_maps_});
  std::vector<float> planes_m;
  for (const ExposureTiles::ExposureTile& tile : shade.tiles()) {
    if (tile.used) planes_m.push_back(tile.plane_m);
  }
  ASSERT_GE(planes_m.size(), 6U);
  std::ranges::sort(planes_m);
  // The planes would be 0.16 m apart if each tile had its own.
  EXPECT_EQ(std::ranges::unique(planes_m).begin() - planes_m.begin(), 1);
}

TEST_F(ShadeTest, WhatStandsBetweenTheSunAndTheEntityIsNotInItsShade) {
  SurfaceSamples all = ground();
  const glm::vec3 sun(to_sun(kNoonNs));
  const glm::vec3 plate_m(1.0F, 0.0F, kHeightM);
  const glm::vec3 origin_m(rays_->origin_world_m());
  // The samples lie along the ray through the plate's middle: below it, and above.
  const std::size_t first = all.samples.size();
  for (const float way_m : {-1.0F, -0.3F, 0.3F}) {
    SurfaceSample& sample = all.samples.emplace_back();
    sample.position_m = plate_m + way_m * sun - origin_m;
    sample.normal = sun;
  }
  ExposureTiles shade = tiles(all);
  shade.restart(kNoonNs, entities_);
  ASSERT_TRUE(entities_[0].append(kNoonNs, pose_at(1.0, kHeightM), true, true));
  shade.run(kNoonNs + 10 * kSecondNs, all, inputs());
  EXPECT_GT(shade.vertices_k()[first], 1.0F);
  EXPECT_GT(shade.vertices_k()[first + 1], 1.0F);
  EXPECT_EQ(shade.vertices_k()[first + 2], 0.0F);
}

TEST_F(ShadeTest, OneThreadMakesWhatManyMake) {
  const SurfaceSamples all = ground();
  std::vector<float> first;
  for (const unsigned int threads : {1U, 3U}) {
    threads::WorkerPool workers(threads);
    EntityShadowMaps shadow_maps = shadow_maps_;
    ExposureTiles shade = tiles(all);
    shade.restart(kNoonNs, entities_);
    shade.run(kNoonNs + 5 * kSecondNs, all,
              {environment_, entities_, *rays_, workers, shadow_maps});
    const std::vector<float> found(shade.vertices_k().begin(), shade.vertices_k().end());
    if (first.empty()) first = found;
    EXPECT_EQ(found, first);
  }
}

}  // namespace
}  // namespace emit::renderer
