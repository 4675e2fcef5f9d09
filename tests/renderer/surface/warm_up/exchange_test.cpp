// SPDX-License-Identifier: Apache-2.0
// Radiation between surfaces settles in the warm-up, whatever share of it comes back.
#include "surface/warm_up/surface_exchange.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "emit/physics/constants.hpp"
#include "history/foster_setup.hpp"
#include "renderer/surface/surface_scene.hpp"
#include "support/times.hpp"
#include "surface/run/cached_surface.hpp"
#include "surface/warm_up/fixed_point_mixer.hpp"

namespace emit::renderer {
namespace {

using emit::test::kSecondNs;
using physics::kReferenceK;
constexpr double kHotK = 400.0;

/// Closed box of 2 m whose faces look inwards: the floor has a temperature of its own, and walls
/// and ceiling are of foam.
class ClosedBox {
 public:
  explicit ClosedBox(double emissivity_frac, std::uint32_t steps = 24) {
    scenario_.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
    scenario_.epoch_utc_ns = 1'403'330'400 * kSecondNs;  // 2014-06-21 06:00 UTC
    scenario_.thermal.model = scene::ThermalModel::foster;
    scenario_.thermal.method = scene::ThermalMethod::cached;
    scenario_.thermal.steps = steps;
    scenario_.thermal.spacing = scene::StepSpacing::geometric;
    scenario_.thermal.history_start_ns = -48 * 3600 * kSecondNs;
    scenario_.thermal.lateral = false;
    scene::WeatherSample still;
    still.film_w_m2_k = 0.0;
    scenario_.weather = {still};
    scene::Material floor;
    floor.name = "floor";
    floor.emissivity_frac = emissivity_frac;
    floor.prescribed_k = kHotK;
    scene::Material foam = floor;
    foam.name = "foam";
    foam.prescribed_k.reset();
    foam.layers = {{0.1, 0.01, 20.0, 500.0}};
    foam.base_k = kHotK;
    foam.solar_absorptance_frac = 0.5;
    scenario_.materials = {floor, foam};
    scenario_.default_material = "foam";
    // A box seen from outside becomes one seen from inside when its triangles turn round.
    scene::Mesh box = test::box_mesh(glm::vec3(-1.0F), glm::vec3(1.0F));
    box.closed = false;
    for (std::size_t i = 0; i < box.indices.size(); i += 3) {
      std::swap(box.indices[i + 1], box.indices[i + 2]);
    }
    for (glm::vec3& normal : box.normals) normal = -normal;
    constexpr std::uint32_t kFloorBegin = 24;  // the fifth of six faces of two triangles each
    box.submeshes = {
        {0, kFloorBegin, 1, false}, {kFloorBegin, 6, 0, false}, {kFloorBegin + 6, 6, 1, false}};
    scene_.add_static(std::move(box));
    scene_.geometry.materials = scenario_.materials;
    scene_.geometry.instances[0].world_bounds = scene_.geometry.meshes[0].bounds;
    scenario_.objects.resize(1);
  }

  /// Warms the box up.
  void warm_up() {
    environment_.emplace(scenario_);
    auto networks = build_foster_materials(scenario_, scene_.geometry.materials);
    ASSERT_TRUE(networks.has_value()) << networks.error().text;
    auto surface =
        CachedSurface::create(scenario_, scene_.geometry, {-1},
                              std::span(*networks).first(networks->size() - 1), kReferenceK);
    ASSERT_TRUE(surface.has_value()) << surface.error().text;
    surface_ = std::move(*surface);
    history_.emplace(scenario_.thermal.steps,
                     make_foster(scenario_, std::move(*networks), *environment_, kReferenceK));
    StepPlan plan(scenario_.thermal);
    const RefineView view{{{{0.0, 0.0, 0.0}, {}}}, 5e-2};
    ASSERT_TRUE(surface_->prepare(3600 * kSecondNs, view, {*environment_, {}}, plan, *history_,
                                  std::nullopt, {}));
  }
  [[nodiscard]] const SurfaceModel& model() const { return surface_->model(); }
  [[nodiscard]] double temperature_k(std::size_t sample) const {
    return kReferenceK + static_cast<double>(surface_->vertices(0)[sample].offset_k);
  }

 private:
  scene::ScenarioDesc scenario_;
  test::SurfaceScene scene_;
  std::optional<Environment> environment_;
  std::optional<SurfaceHistory> history_;
  std::unique_ptr<CachedSurface> surface_;
};

TEST(SurfaceExchange, AClosedBoxHasOneTemperatureWhateverItsEmissivity) {
  for (const double emissivity_frac : {0.9, 0.3, 0.1}) {
    ClosedBox box(emissivity_frac);
    ASSERT_NO_FATAL_FAILURE(box.warm_up());
    const SurfaceModel& model = box.model();
    ASSERT_GT(model.samples.samples.size(), 20U);
    ASSERT_EQ(model.samples.samples.size(), model.drawn_samples);
    EXPECT_EQ(model.exchange_left_w_m2, 0.0);
    double most_off_k = 0.0;
    for (std::size_t s = 0; s < model.samples.samples.size(); ++s) {
      const SurfaceSample& sample = model.samples.samples[s];
      EXPECT_LT(sample.sky_frac + sample.far_frac, 1e-6F);
      most_off_k = std::max(most_off_k, std::abs(box.temperature_k(s) - kHotK));
    }
    EXPECT_LT(most_off_k, 0.1) << "emissivity " << emissivity_frac;
  }
}

/// Iterates x = c + share * P x, where P cycles the unknowns, until the largest step is below
/// `limit`. Returns the number of evaluations.
int iterate(double share, bool mixed, double limit, std::vector<float>& x) {
  FixedPointMixer mixer;
  const std::size_t n = x.size();
  for (int i = 1; i <= 100'000; ++i) {
    std::vector<float> g(n);
    double most = 0.0;
    for (std::size_t k = 0; k < n; ++k) {
      // Unknowns lose different shares, so that no single factor mends the iteration.
      const double loss = 0.5 + 0.5 * static_cast<double>(k % 5) / 4.0;
      const double others = static_cast<double>(x[(k + 1) % n]) + x[(k + n - 1) % n];
      g[k] = static_cast<float>(1.0 + (1.0 - (1.0 - share) * loss) * 0.5 * others);
      most = std::max(most, static_cast<double>(std::abs(g[k] - x[k])));
    }
    if (most < limit) return i;
    if (mixed) mixer.mix(x, g);
    x = g;
  }
  return 100'000;
}

TEST(FixedPointMixer, NeedsFarFewerStepsThanPlainIteration) {
  constexpr double kLimit = 2e-5;
  for (const double share : {0.5, 0.9, 0.99}) {
    std::vector<float> plain(40, 0.0F);
    std::vector<float> mixed(40, 0.0F);
    const int plain_steps = iterate(share, false, kLimit, plain);
    const int mixed_steps = iterate(share, true, kLimit, mixed);
    EXPECT_LT(mixed_steps, plain_steps) << share;
    if (share > 0.95) {
      EXPECT_LT(mixed_steps, plain_steps / 5) << share;
    }
    for (std::size_t k = 0; k < plain.size(); ++k) {
      EXPECT_NEAR(mixed[k], plain[k], kLimit / (1.0 - share) * 4.0) << share;
    }
  }
}

TEST(FixedPointMixer, KeepsAPointThatIsReached) {
  FixedPointMixer mixer;
  const std::array<float, 3> x{1.0F, -2.0F, 3.0F};
  for (int i = 0; i < 8; ++i) {
    std::array<float, 3> g = x;
    mixer.mix(x, g);
    EXPECT_EQ(g, x);
  }
}

}  // namespace
}  // namespace emit::renderer
