// SPDX-License-Identifier: Apache-2.0
// The renderer against closed forms: geometry, shade, obscurance, thermal state and radiance.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/physics/equilibrium.hpp"
#include "emit/physics/planck.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/surface_balance.hpp"
#include "support/renderer_scene.hpp"

namespace emit::test {
namespace {

constexpr std::int64_t kHourNs = 3'600'000'000'000;

struct Rendered {
  std::vector<float> radiance;
  std::vector<float> temperature_k;
  std::vector<float> depth_m;
  std::vector<float> object;
  renderer::FrameStats stats;
};

class Scene {
 public:
  explicit Scene(const scene::ScenarioDesc& scenario) : scenario_(scenario) {
    renderer::OutputOptions output;
    output.temperature = output.depth = output.object = true;
    auto made = renderer::Renderer::create(scenario, {}, output);
    if (made) {
      renderer_ = std::move(*made);
    } else {
      ADD_FAILURE() << made.error().text;
    }
  }
  renderer::Renderer& operator*() { return *renderer_; }
  renderer::Renderer* operator->() { return renderer_.get(); }

  Rendered render(const physics::Pose& pose, std::int64_t sim_time_ns) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = sim_time_ns;
    request.sensor_pose = pose;
    const int slot = renderer_->submit(request);
    EXPECT_GE(slot, 0);
    const auto& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot));
    EXPECT_FALSE(view.device_failed);
    const auto copy = [](std::span<const float> s) {
      return std::vector<float>(s.begin(), s.end());
    };
    Rendered out{copy(view.radiance_w_m2_sr[0]), copy(view.temperature_k), copy(view.depth_m),
                 copy(view.object_id), view.stats};
    renderer_->release(static_cast<renderer::SlotIndex>(slot));
    EXPECT_EQ(out.stats.nonfinite_px, 0U);
    return out;
  }

 private:
  scene::ScenarioDesc scenario_;
  std::unique_ptr<renderer::Renderer> renderer_;
};

physics::Pose looking(const glm::dvec3& from, const glm::dvec3& at) {
  return {from, physics::world_from_body_look_at(from, at)};
}

glm::dvec3 sun_at(const scene::ScenarioDesc& s, std::int64_t sim_time_ns) {
  return physics::sun_position(s.epoch_utc_ns + sim_time_ns, {physics::Radians(s.place.lat_rad),
                                                              physics::Radians(s.place.lon_rad),
                                                              physics::Metres(s.place.height_m)})
      .direction_enu;
}

double equilibrium_k(const scene::Material& m, const scene::WeatherSample& w, double cos_incidence,
                     double sun_frac, double sky_frac) {
  physics::SurfaceFluxes<double> in;
  in.direct_w_m2 = physics::direct_on_face_w_m2(w.direct_normal_w_m2, cos_incidence);
  in.diffuse_w_m2 = physics::diffuse_input_w_m2(w.diffuse_horizontal_w_m2);
  in.environment_w_m2 = physics::environment_input_w_m2(m.emissivity_frac, *w.environment_k);
  in.longwave_w_m2 = physics::longwave_input_w_m2(w.longwave_down_w_m2, *w.environment_k);
  in.sun_frac = sun_frac;
  in.sky_frac = sky_frac;
  const double absorbed =
      physics::absorbed_flux_w_m2(in, m.solar_absorptance_frac, m.emissivity_frac);
  const physics::SurfaceExchange<double> exchange{
      m.emissivity_frac, m.layers[0].conductivity_w_m_k / m.layers[0].thickness_m, m.base_k, 0.0,
      0.0};
  return physics::solve_equilibrium(physics::surface_balance(absorbed, exchange)).temperature_k;
}

TEST(RendererGeometry, depth_and_object_match_a_plane_seen_at_an_angle) {
  auto scenario = instant_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  Scene scene(scenario);
  const auto pose = looking({3.0, -8.0, 6.0}, {0.0, 0.0, 0.0});
  const auto frame = scene.render(pose, kHourNs);
  for (std::uint32_t y = 0; y < 256; y += 5) {
    for (std::uint32_t x = 0; x < 320; x += 5) {
      const std::size_t i = y * 320 + x;
      ASSERT_EQ(frame.object[i], 1.0F);
      // Expect the pixel's point on the ground. Depth in float32 leaves 1 mm at 10 m.
      ASSERT_NEAR(world_point(scenario.sensor, pose, x, y, frame.depth_m[i]).z, 0.0, 1e-3);
    }
  }
}

TEST(RendererGeometry, the_first_row_is_the_top_of_the_image) {
  auto scenario = instant_scenario(write_quads("plane", {ground(500.0, 500.0)}));
  Scene scene(scenario);
  const auto frame = scene.render(looking({0.0, 0.0, 2.0}, {0.0, 100.0, 2.0}), kHourNs);
  EXPECT_TRUE(std::isinf(frame.depth_m[10 * 320 + 160]));  // sky above
  EXPECT_LT(frame.depth_m[250 * 320 + 160], 10.0F);        // ground below
  EXPECT_TRUE(std::isnan(frame.temperature_k[10 * 320 + 160]));
}

TEST(RendererThermal, an_open_plane_reaches_the_equilibrium_of_eq_5) {
  auto scenario = instant_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  Scene scene(scenario);
  const auto frame = scene.render(looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0}), 3 * kHourNs);
  const double expected = equilibrium_k(scenario.materials[0], scenario.weather[0],
                                        sun_at(scenario, 3 * kHourNs).z, 1.0, 0.5);
  for (std::size_t i = 0; i < frame.temperature_k.size(); ++i) {
    // Allow 2 mK for the quartic in float32 (0.2 mK) and for the sun's cosine from a 16-bit normal.
    ASSERT_NEAR(frame.temperature_k[i], expected, 2e-3) << i;
  }
}

TEST(RendererThermal, a_surface_without_history_keeps_its_initial_temperature) {
  auto scenario = instant_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  scenario.materials[0].initial_k = 301.25;
  scenario.thermal.steps = 9;
  Scene scene(scenario);
  const auto frame = scene.render(looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0}), 0);
  for (const float t : frame.temperature_k) ASSERT_NEAR(t, 301.25F, 1e-4F);
}

TEST(RendererThermal, splitting_the_history_changes_an_unshaded_surface_by_little) {
  auto scenario = instant_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  scenario.materials[0].modes = {{609.0, 0.547}, {7259.0, 0.453}};
  scenario.weather = {weather(300.0, 60.0, 330.0, 291.0), weather(800.0, 110.0, 350.0, 297.0)};
  scenario.weather[1].sim_time_ns = 3 * kHourNs;
  const auto pose = looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0});
  std::vector<float> centre;
  for (const std::uint32_t steps : {24U, 48U, 96U}) {
    scenario.thermal.steps = steps;
    Scene scene(scenario);
    centre.push_back(scene.render(pose, 3 * kHourNs).temperature_k[128 * 320 + 160]);
  }
  // The drive is linear inside an interval, so the method is of second order: each halving divides
  // the error by four.
  EXPECT_NEAR(centre[0], centre[2], 0.02F);
  EXPECT_LT(std::abs(centre[1] - centre[2]), 0.4F * std::abs(centre[0] - centre[2]) + 1e-4F);
}

TEST(RendererShadow, the_box_casts_its_shadow_where_the_sun_says) {
  const glm::dvec3 low{-1.0, -1.0, 0.0};
  const glm::dvec3 high{1.0, 1.0, 2.0};
  std::vector<Quad> quads = box(low, high);
  quads.push_back(ground(30.0, 30.0));
  for (const std::int64_t hour : {1, 3, 5, 9}) {
    auto scenario = instant_scenario(write_quads("box", quads));
    // Use one interval of a second, in which the sun hardly moves and the shade is that of the
    // instant.
    scenario.thermal.history_start_ns = hour * kHourNs - 1'000'000'000;
    scenario.thermal.obscurance_radius_m = 0.001;
    Scene scene(scenario);
    const auto pose = looking({-7.0, 9.0, 9.0}, {0.0, 0.0, 0.0});
    const auto frame = scene.render(pose, hour * kHourNs);
    const glm::dvec3 sun = sun_at(scenario, hour * kHourNs);
    const auto& m = scenario.materials[0];
    const double lit_k = equilibrium_k(m, scenario.weather[0], sun.z, 1.0, 0.5);
    const double dark_k = equilibrium_k(m, scenario.weather[0], sun.z, 0.0, 0.5);
    ASSERT_GT(lit_k - dark_k, 5.0);
    // A texel of the map is about 2 cm wide here. The filter spreads an edge over one texel on
    // either side, and the sun's disc spreads it by another 1 cm.
    const double edge_m = 0.06 / sun.z;
    int lit = 0;
    int dark = 0;
    for (std::uint32_t y = 0; y < 256; ++y) {
      for (std::uint32_t x = 0; x < 320; ++x) {
        const std::size_t i = y * 320 + x;
        const glm::dvec3 p = world_point(scenario.sensor, pose, x, y, frame.depth_m[i]);
        if (std::abs(p.z) > 5e-3) continue;
        // Find the part of the ray towards the sun that lies inside the box's shaft, slab by slab.
        const auto blocked = [&](double grow_m) {
          double enter = 0.0;
          double leave = 1e9;
          for (glm::length_t axis = 0; axis < 3; ++axis) {
            const double a = (low[axis] - grow_m - p[axis]) / sun[axis];
            const double b = (high[axis] + grow_m - p[axis]) / sun[axis];
            enter = std::max(enter, std::min(a, b));
            leave = std::min(leave, std::max(a, b));
          }
          return enter < leave;
        };
        const bool surely_dark = blocked(-edge_m);
        const bool surely_lit = !blocked(edge_m);
        if (surely_dark) {
          ASSERT_NEAR(frame.temperature_k[i], dark_k, 0.05) << hour << ":" << x << "," << y;
          ++dark;
        } else if (surely_lit) {
          ASSERT_NEAR(frame.temperature_k[i], lit_k, 0.05) << hour << ":" << x << "," << y;
          ++lit;
        }
      }
    }
    EXPECT_GT(dark, 300) << hour;
    EXPECT_GT(lit, 10000) << hour;
  }
}

TEST(RendererShadow, a_parked_caster_that_left_leaves_a_cool_print) {
  auto scenario = instant_scenario(write_quads("plane", {ground(30.0, 30.0)}));
  scenario.materials[0].modes = {{609.0, 0.547}, {7259.0, 0.453}};
  scenario.thermal.steps = 27;
  scenario.thermal.spacing = scene::StepSpacing::geometric;
  scene::ObjectDesc truck;
  truck.name = "truck";
  truck.entity_id = 7;
  truck.gltf = write_quads("truck", box({-1.0, -2.0, 0.0}, {1.0, 2.0, 2.5}));
  const glm::dquat north = physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0);
  truck.instances = {{glm::dvec3(0.0), north}};
  const std::int64_t left_ns = 3 * kHourNs - 60'000'000'000;
  truck.trajectory = {
      {0, {glm::dvec3(0.0), north}, true, false},
      {left_ns, {glm::dvec3(0.0), north}, true, false},
      {left_ns + 10'000'000'000, {glm::dvec3(0.0, 100.0, 0.0), north}, true, false}};
  scenario.objects.push_back(truck);
  Scene scene(scenario);
  const auto pose = looking({0.0, 0.0, 20.0}, {0.0, 0.0, 0.0});
  const auto frame = scene.render(pose, 3 * kHourNs);
  const float under = frame.temperature_k[128 * 320 + 160];
  const float open = frame.temperature_k[128 * 320 + 10];
  EXPECT_EQ(frame.object[128 * 320 + 160], 1.0F);  // the truck is gone, the ground is seen
  EXPECT_LT(under, open - 10.0F);
}

/// Share of pixels whose temperatures differ by more than a limit. A few pixels always do, because
/// maps of other extents put the sharp edges along an entity's foot on other texels.
double share_apart(const Rendered& a, const Rendered& b, double limit_k) {
  std::size_t apart = 0;
  for (std::size_t i = 0; i < a.temperature_k.size(); ++i) {
    if (std::isnan(a.temperature_k[i]) && std::isnan(b.temperature_k[i])) continue;  // sky
    if (!(std::abs(a.temperature_k[i] - b.temperature_k[i]) <= limit_k)) ++apart;
  }
  return static_cast<double>(apart) / static_cast<double>(a.temperature_k.size());
}

scene::ObjectDesc parked_truck(scene::Trajectory trajectory) {
  scene::ObjectDesc truck;
  truck.name = "truck";
  truck.entity_id = 7;
  truck.gltf = write_quads("truck", box({-1.0, -2.0, 0.0}, {1.0, 2.0, 2.5}));
  truck.instances = {trajectory.front().pose};
  truck.trajectory = std::move(trajectory);
  return truck;
}
physics::Pose north_at(double east_m, double north_m) {
  return {{east_m, north_m, 0.0}, physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0)};
}

TEST(RendererShadow, casters_of_the_past_count_in_full_though_nothing_as_high_is_there_now) {
  auto scenario = instant_scenario(write_quads("plane", {ground(2.4, 2.4)}));
  scenario.materials[0].modes = {{609.0, 0.547}, {7259.0, 0.453}};
  scenario.thermal.steps = 13;
  scenario.thermal.spacing = scene::StepSpacing::geometric;
  const std::int64_t off_ns = 3 * kHourNs - 300'000'000'000;
  scenario.objects.push_back(parked_truck(
      {{0, north_at(0.0, 0.0), true, false}, {off_ns, north_at(0.0, 0.0), false, false}}));
  const auto pose = looking({0.0, 0.0, 8.0}, {0.0, 0.0, 0.0});
  const auto alone = Scene(scenario).render(pose, 3 * kHourNs);
  // Add a mast out of sight that is as high as the truck was. Its own shadow stays out of sight
  // too.
  scene::ObjectDesc mast;
  mast.name = "mast";
  mast.gltf = write_quads("mast", box({28.0, 28.0, 0.0}, {28.2, 28.2, 4.0}));
  mast.instances = {north_at(0.0, 0.0)};
  scenario.objects.push_back(mast);
  const auto beside_mast = Scene(scenario).render(pose, 3 * kHourNs);
  // Use a small ground, so that its own extent along the light does not hold the truck.
  double coldest_k = 1e9;
  double hottest_k = 0.0;
  for (std::size_t i = 0; i < alone.temperature_k.size(); ++i) {
    if (std::isnan(alone.temperature_k[i])) continue;
    coldest_k = std::min<double>(coldest_k, alone.temperature_k[i]);
    hottest_k = std::max<double>(hottest_k, alone.temperature_k[i]);
  }
  EXPECT_LT(coldest_k, hottest_k - 10.0);
  EXPECT_LT(share_apart(alone, beside_mast, 1.0), 0.003);
}

TEST(RendererShadow, a_teleport_leaves_the_shade_before_it) {
  auto scenario = instant_scenario(write_quads("plane", {ground(60.0, 60.0)}));
  scenario.materials[0].modes = {{609.0, 0.547}, {7259.0, 0.453}};
  scenario.thermal.steps = 13;
  const std::int64_t jump_ns = 3 * kHourNs - 300'000'000'000;
  const auto pose = looking({0.0, 0.0, 20.0}, {0.0, 0.0, 0.0});
  const auto at_origin_until = [&](scene::Keyframe then) {
    auto with_truck = scenario;
    with_truck.objects.push_back(
        parked_truck({{0, north_at(0.0, 0.0), true, false}, std::move(then)}));
    return Scene(with_truck).render(pose, 3 * kHourNs);
  };
  const auto switched_off = at_origin_until({jump_ns, north_at(0.0, 0.0), false, false});
  const auto teleported = at_origin_until({jump_ns, north_at(50.0, 50.0), true, true});
  EXPECT_LT(share_apart(teleported, switched_off, 1.0), 0.003);
}

/// A crate of 2 m on level ground, as entity 3 at the origin.
scene::ScenarioDesc crate_on_plane(const glm::dquat& attitude) {
  auto scenario = instant_scenario(write_quads("plane", {ground(30.0, 30.0)}));
  scene::ObjectDesc crate;
  crate.name = "crate";
  crate.entity_id = 3;
  crate.gltf = write_quads("crate", box({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0}));
  crate.instances = {{glm::dvec3(0.0), attitude}};
  scenario.objects.push_back(crate);
  return scenario;
}

TEST(RendererShadow, a_live_pose_moves_the_caster_from_then_on) {
  const glm::dquat north = physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0);
  const scene::ScenarioDesc scenario = crate_on_plane(north);
  Scene scene(scenario);
  const auto pose = looking({0.0, 0.0, 20.0}, {0.0, 0.0, 0.0});
  EXPECT_EQ(scene.render(pose, kHourNs).object[128 * 320 + 160], 2.0F);
  const renderer::EntityUpdate away{3, {{5.0, 0.0, 0.0}, north}, true, true};
  EXPECT_EQ(scene->apply_entities(kHourNs, {&away, 1}), 1U);
  const renderer::EntityUpdate unknown{99, {}, true, false};
  EXPECT_EQ(scene->apply_entities(kHourNs, {&unknown, 1}), 0U);
  EXPECT_EQ(scene.render(pose, kHourNs).object[128 * 320 + 160], 1.0F);
  const renderer::EntityUpdate off{3, {{0.0, 0.0, 0.0}, north}, false, true};
  EXPECT_EQ(scene->apply_entities(2 * kHourNs, {&off, 1}), 1U);
  EXPECT_EQ(scene.render(pose, 2 * kHourNs).object[128 * 320 + 160], 1.0F);
  scene->reset();
  EXPECT_EQ(scene.render(pose, kHourNs).object[128 * 320 + 160], 2.0F);
}

TEST(RendererShadow, what_is_foreseen_is_drawn_as_if_it_were_so_and_leaves_no_trace) {
  const glm::dquat north = physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0);
  const scene::ScenarioDesc scenario = crate_on_plane(north);
  const auto pose = looking({0.0, 0.0, 20.0}, {0.0, 0.0, 0.0});
  constexpr std::int64_t kNextNs = kHourNs + 10'000'000;
  const renderer::EntityUpdate here{3, {{0.0, 0.0, 0.0}, north}, true, false};
  const renderer::EntityUpdate there{3, {{1.5, 0.0, 0.0}, north}, true, false};
  // One renderer foresees the place, the other one gets it from its host.
  Scene foresees(scenario);
  ASSERT_EQ(foresees->apply_entities(kHourNs, {&here, 1}), 1U);
  const auto before = foresees.render(pose, kHourNs);
  foresees->foresee_entities(kNextNs, {&there, 1});
  const auto ahead = foresees.render(pose, kNextNs);
  // The host says otherwise.
  ASSERT_EQ(foresees->apply_entities(kNextNs, {&here, 1}), 1U);
  EXPECT_EQ(foresees.render(pose, kNextNs).object, before.object);
  Scene told(scenario);
  ASSERT_EQ(told->apply_entities(kHourNs, {&here, 1}), 1U);
  ASSERT_EQ(told->apply_entities(kNextNs, {&there, 1}), 1U);
  const auto wanted = told.render(pose, kNextNs);
  EXPECT_EQ(ahead.object, wanted.object);
  EXPECT_EQ(share_apart(ahead, wanted, 0.01), 0.0) << "its shadow is there too";
  EXPECT_GT(share_apart(ahead, before, 1.0), 0.003);
}

/// Share f_i that a temperature stands for. With long-wave flux alone, surroundings near 0 K and
/// negligible conduction the equilibrium is eps sigma T^4 = 2 f_i eps L_down.
scene::ScenarioDesc obscurance_scenario(const std::vector<Quad>& quads, double radius_m) {
  auto scenario = instant_scenario(write_quads("world", quads));
  scenario.weather = {weather(0.0, 0.0, 400.0, 1.0)};
  scenario.materials[0].layers = {{1.0, 1e-6, 2000.0, 900.0}};
  scenario.thermal.obscurance_radius_m = radius_m;
  return scenario;
}
double sky_frac(double temperature_k) {
  return physics::kStefanBoltzmannWPerM2K4 * std::pow(temperature_k, 4) / 800.0;
}

TEST(RendererObscurance, concave_is_below_flat_is_below_convex) {
  // Look from above at a step up at x = 0 and a drop at x = 2.
  std::vector<Quad> quads = {
      {{-10, -10, 1}, {0, -10, 1}, {0, 10, 1}, {-10, 10, 1}},  // upper floor
      {{0, -10, 0}, {0, 10, 0}, {0, 10, 1}, {0, -10, 1}},      // its wall, facing east
      {{0, -10, 0}, {10, -10, 0}, {10, 10, 0}, {0, 10, 0}}};   // lower floor
  auto scenario = obscurance_scenario(quads, 0.5);
  Scene scene(scenario);
  const auto pose = looking({0.0, 0.0, 9.0}, {0.0, 0.0, 0.0});
  const auto frame = scene.render(pose, kHourNs);
  double concave = 0.0;
  double convex = 0.0;
  double flat = 0.0;
  for (std::uint32_t x = 0; x < 320; ++x) {
    const std::size_t i = 128 * 320 + x;
    const glm::dvec3 p = world_point(scenario.sensor, pose, x, 128, frame.depth_m[i]);
    const double f = sky_frac(frame.temperature_k[i]);
    if (p.z < 0.5 && p.x > 0.05 && p.x < 0.1) concave = f;
    if (p.z > 0.5 && p.x < -0.05 && p.x > -0.1) convex = f;
    if (p.z < 0.5 && p.x > 1.5 && p.x < 1.6) flat = f;
  }
  EXPECT_NEAR(flat, 0.5, 1e-3);
  EXPECT_LT(concave, flat - 0.1);
  EXPECT_GT(convex, flat + 0.1);
}

TEST(RendererObscurance, a_tilted_plane_is_flat) {
  auto scenario = obscurance_scenario({ground(500.0, 500.0)}, 0.5);
  Scene scene(scenario);
  const auto frame = scene.render(looking({0.0, -6.0, 3.0}, {0.0, 0.0, 0.0}), kHourNs);
  for (std::uint32_t y = 20; y < 236; ++y) {
    for (std::uint32_t x = 20; x < 300; ++x) {
      // Allow for perspective, which makes the depths of a pair differ by (radius / distance)^2.
      ASSERT_NEAR(sky_frac(frame.temperature_k[y * 320 + x]), 0.5, 0.02);
    }
  }
}

TEST(RendererObscurance, follows_the_open_volume_of_a_ball_beside_a_wall_and_a_drop) {
  // The closed form is the open share of a ball whose centre lies on flat ground at s = u R from an
  // infinite wall (concave) or a drop (convex). The wall takes half of the spherical cap beyond it,
  // and the drop opens it. The wall is taller than the ball, but not so tall that its top counts as
  // something else in front.
  const double radius_m = 1.0;
  std::vector<Quad> quads = {{{-10, -10, 1.5}, {0, -10, 1.5}, {0, 10, 1.5}, {-10, 10, 1.5}},
                             {{0, -10, 0}, {0, 10, 0}, {0, 10, 1.5}, {0, -10, 1.5}},
                             {{0, -10, 0}, {10, -10, 0}, {10, 10, 0}, {0, 10, 0}}};
  auto scenario = obscurance_scenario(quads, radius_m);
  scenario.sensor.fov_h_rad = 8.0 * physics::kDegree;
  Scene scene(scenario);
  const auto pose = looking({0.0, 0.0, 40.0}, {0.0, 0.0, 0.0});
  const auto frame = scene.render(pose, kHourNs);
  double worst = 0.0;
  int compared = 0;
  for (std::uint32_t x = 0; x < 320; ++x) {
    const std::size_t i = 128 * 320 + x;
    const glm::dvec3 p = world_point(scenario.sensor, pose, x, 128, frame.depth_m[i]);
    const double u = std::abs(p.x) / radius_m;
    if (u < 0.02 || u > 1.5) continue;
    const double cap_frac = u < 1.0 ? (1.0 - u) * (1.0 - u) * (2.0 + u) / 4.0 : 0.0;
    const double expected = p.z < 1.0 ? 0.5 - 0.5 * cap_frac : 0.5 + 0.5 * cap_frac;
    worst = std::max(worst, std::abs(sky_frac(frame.temperature_k[i]) - expected));
    ++compared;
  }
  EXPECT_GT(compared, 100);
  EXPECT_LT(worst, 0.03);  // the error of 13 pairs of lines
}

TEST(RendererRadiance, a_black_surface_without_air_radiates_planck_in_band) {
  auto scenario = instant_scenario(write_quads("plane", {ground(50.0, 50.0)}));
  scenario.bands = {{"8-12", 8.0, 12.0, {}}, {"3-5", 3.0, 5.0, {}}};
  scenario.materials[0].prescribed_k = 600.0;
  scenario.materials[0].band_emissivity = {{"8-12", 1.0}, {"3-5", 1.0}};
  Scene scene(scenario);
  const auto frame = scene.render(looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0}), kHourNs);
  const double expected =
      physics::band_radiance({8.0, 12.0, {}}, physics::Kelvin(600.0)).radiance_w_m2_sr;
  for (const float l : frame.radiance) ASSERT_NEAR(l / expected, 1.0, 1e-4);
}

TEST(RendererRadiance, an_isothermal_world_looks_like_a_blackbody) {
  // Give surface, surroundings, air and sky one temperature, so that emissivity and range cannot
  // matter.
  auto scenario = instant_scenario(write_quads("plane", {ground(500.0, 500.0)}));
  scenario.weather = {
      weather(0.0, 0.0, physics::kStefanBoltzmannWPerM2K4 * std::pow(300.0, 4), 300.0)};
  scenario.materials[0].prescribed_k = 300.0;
  scenario.materials[0].band_emissivity = {{"8-12", 0.6}};
  scenario.atmosphere.enabled = true;
  scenario.atmosphere.bands = {{"8-12", {{0.7, 0.2}, {0.3, 4.0}}, 1e-30}};  // opaque sky
  Scene scene(scenario);
  const auto frame = scene.render(looking({0.0, 0.0, 5.0}, {0.0, 100.0, 0.0}), kHourNs);
  const double expected =
      physics::band_radiance({8.0, 12.0, {}}, physics::Kelvin(300.0)).radiance_w_m2_sr;
  for (const float l : frame.radiance) ASSERT_NEAR(l / expected, 1.0, 2e-4);
}

TEST(RendererReplay, the_same_requests_give_the_same_bits) {
  std::vector<Quad> quads = box({-1, -1, 0}, {1, 1, 2});
  quads.push_back(ground(30.0, 30.0));
  auto scenario = instant_scenario(write_quads("box", quads));
  scenario.thermal.steps = 9;
  const auto pose = looking({-7.0, 9.0, 9.0}, {0.0, 0.0, 0.0});
  Scene a(scenario);
  const auto first = a.render(pose, 3 * kHourNs);
  Scene b(scenario);
  const auto other = b.render(pose, 2 * kHourNs);
  EXPECT_NE(first.radiance, other.radiance);
  EXPECT_EQ(first.radiance, b.render(pose, 3 * kHourNs).radiance);
}

TEST(RendererSlots, submit_refuses_when_all_slots_are_in_use) {
  auto scenario = instant_scenario(write_quads("plane", {ground(5.0, 5.0)}));
  renderer::OutputOptions output;
  output.slots = 2;
  auto made = renderer::Renderer::create(scenario, {}, output);
  ASSERT_TRUE(made) << made.error().text;
  renderer::FrameRequest request;
  request.sensor_pose = looking({0.0, -5.0, 5.0}, {0.0, 0.0, 0.0});
  const int a = (*made)->submit(request);
  const int b = (*made)->submit(request);
  EXPECT_EQ((*made)->submit(request), -1);
  EXPECT_GE(std::min(a, b), 0);
  EXPECT_NE(a, b);
  (void)(*made)->collect(static_cast<renderer::SlotIndex>(a));
  (*made)->release(static_cast<renderer::SlotIndex>(a));
  EXPECT_EQ((*made)->submit(request), a);
}

TEST(RendererCreate, reports_limits_and_missing_devices_clearly) {
  auto scenario = instant_scenario(write_quads("plane", {ground(5.0, 5.0)}));
  scenario.thermal.filter_taps = 100000;
  const auto bad_taps = renderer::Renderer::create(scenario, {}, {});
  ASSERT_FALSE(bad_taps);
  EXPECT_EQ(bad_taps.error().code, physics::ErrorCode::config);
  scenario.thermal.filter_taps = 32;
  renderer::DeviceOptions device;
  device.gpu_index = 1000;
  const auto no_device = renderer::Renderer::create(scenario, device, {});
  ASSERT_FALSE(no_device);
  EXPECT_EQ(no_device.error().code, physics::ErrorCode::gpu);
  EXPECT_NE(no_device.error().text.find("1000"), std::string::npos);
}

}  // namespace
}  // namespace emit::test
