// SPDX-License-Identifier: Apache-2.0
// Faces that rest on the interior of their body, against the heat balance of shell and interior.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "support/renderer_scene.hpp"
#include "support/times.hpp"

namespace emit::test {
namespace {

constexpr std::int64_t kMinuteNs = 60 * kSecondNs;
constexpr std::uint32_t kWidth = 48;
constexpr std::uint32_t kHeight = 40;
constexpr double kAirK = 260.0;
constexpr double kStartK = 300.0;
constexpr double kUpM = 4.0;
constexpr scene::Layer kSteel{0.0015, 50.0, 7850.0, 470.0};
constexpr scene::Layer kFilm{0.02, 0.16, 1.2, 1005.0};

/// Box of steel in the air, in a night whose sky and surroundings are as warm as the air. Box and
/// interior begin at kStartK.
scene::ScenarioDesc night(const scene::BodyInterior& interior) {
  std::vector<Quad> quads = box({-1.0, -1.0, kUpM - 1.0}, {1.0, 1.0, kUpM + 1.0});
  Quad bottom = ground(1.0, 1.0, kUpM - 1.0);
  std::swap(bottom.b, bottom.d);
  quads.push_back(bottom);
  scene::ScenarioDesc s = instant_scenario(write_quads("box", quads));
  s.objects[0].interior = interior;
  scene::Material& steel = s.materials[0];
  steel.layers = {kSteel, kFilm};
  steel.base = scene::BaseKind::body;
  steel.base_k = kAirK;
  steel.foster_modes = {};
  const double sky_w_m2 = physics::kStefanBoltzmannWPerM2K4 * std::pow(kAirK, 4.0);
  s.weather = {weather(0.0, 0.0, sky_w_m2, kAirK)};
  s.weather[0].wind_m_s = 2.0;
  s.weather[0].film_w_m2_k = 13.3;
  s.sensor.width_px = kWidth;
  s.sensor.height_px = kHeight;
  s.thermal.method = scene::ThermalMethod::cached;
  s.thermal.model = scene::ThermalModel::foster;
  s.thermal.initial_k = kStartK;
  s.thermal.spin_up_ns = 0;
  s.thermal.steps = 40;
  s.thermal.first_step_s = 20.0;
  s.thermal.spacing = scene::StepSpacing::geometric;
  s.thermal.lateral = false;  // all faces are alike, so that no heat passes between them
  return s;
}

/// Temperatures of shell and interior by explicit steps of a second.
struct Balance {
  double shell_k = kStartK;
  double interior_k = kStartK;  ///< in balance with shell and ventilation at the start

  void advance(const scene::BodyInterior& interior, double air_k, double sky_w_m2,
               double film_w_m2_k, std::int64_t seconds, double power_w_m2 = 0.0) {
    constexpr double kEmissivity = 0.9;
    const double shell_j_m2_k =
        kSteel.thickness_m * kSteel.density_kg_m3 * kSteel.specific_heat_j_kg_k +
        kFilm.thickness_m * kFilm.density_kg_m3 * kFilm.specific_heat_j_kg_k;
    const double inside_w_m2_k = 1.0 / (kSteel.thickness_m / kSteel.conductivity_w_m_k +
                                        kFilm.thickness_m / kFilm.conductivity_w_m_k);
    for (std::int64_t i = 0; i < seconds; ++i) {
      const double inwards_w_m2 = inside_w_m2_k * (shell_k - interior_k);
      const double emitted_w_m2 = physics::kStefanBoltzmannWPerM2K4 * std::pow(shell_k, 4.0);
      shell_k += (kEmissivity * (sky_w_m2 - emitted_w_m2) + film_w_m2_k * (air_k - shell_k) -
                  inwards_w_m2 + power_w_m2) /
                 shell_j_m2_k;
      interior_k += (inwards_w_m2 + interior.ventilation_w_m2_k * (air_k - interior_k)) /
                    interior.heat_j_m2_k;
    }
  }
};

double film_w_m2_k(const scene::ScenarioDesc& s) {
  const std::vector<std::int64_t> nodes_ns{0, kSecondNs};
  const auto intervals = renderer::surface_forcing(s, nodes_ns);
  EXPECT_TRUE(intervals.has_value());
  return intervals ? intervals->front().begin.film.stated_w_m2_k : 0.0;
}

class BodyRun {
 public:
  explicit BodyRun(const scene::ScenarioDesc& scenario) {
    renderer::OutputOptions output;
    output.temperature = true;
    auto made = renderer::Renderer::create(scenario, {}, output);
    if (!made) ADD_FAILURE() << made.error().text;
    if (made) renderer_ = std::move(*made);
  }
  [[nodiscard]] renderer::Renderer& renderer() { return *renderer_; }
  /// Temperature of the face of the box that a camera sees from there, by default of a side.
  float shell_k(std::int64_t now_ns, const glm::dvec3& from = {0.0, -6.0, kUpM}) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = now_ns;
    request.sensor_pose = {from, physics::world_from_body_look_at(from, {0.0, 0.0, kUpM})};
    const int slot = renderer_->submit(request);
    const auto& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot));
    EXPECT_FALSE(view.device_failed);
    const float k = view.temperature_k[kHeight / 2 * kWidth + kWidth / 2];
    renderer_->release(static_cast<renderer::SlotIndex>(slot));
    return k;
  }

 private:
  std::unique_ptr<renderer::Renderer> renderer_;
};

TEST(RendererBody, CoolsDownWithItsInteriorAsTheirHeatBalanceSays) {
  for (const scene::BodyInterior& interior :
       {scene::BodyInterior{}, scene::BodyInterior{40'000.0, 0.0},
        scene::BodyInterior{1'000.0, 20.0}}) {
    const auto scenario = night(interior);
    const double film = film_w_m2_k(scenario);
    for (const std::int64_t minutes : {20, 120, 360}) {
      SCOPED_TRACE(testing::Message() << interior.heat_j_m2_k << " J/m2K, " << minutes << " min");
      Balance truth;
      truth.interior_k = (8.0 * kStartK + interior.ventilation_w_m2_k * kAirK) /
                         (8.0 + interior.ventilation_w_m2_k);
      truth.advance(interior, kAirK, scenario.weather[0].longwave_down_w_m2, film, minutes * 60);
      BodyRun run(scenario);
      EXPECT_NEAR(run.shell_k(minutes * kMinuteNs), truth.shell_k, 0.4);
      // Frames advance it further.
      truth.advance(interior, kAirK, scenario.weather[0].longwave_down_w_m2, film, 120);
      EXPECT_NEAR(run.shell_k(minutes * kMinuteNs + 120 * kSecondNs), truth.shell_k, 0.4);
    }
  }
}

/// Steady temperatures of a shell of one roof, four sides and a bottom of one size, and of its
/// interior, under a sky that is colder than the air and all that stands around.
struct ColdSoak {
  double roof_k = 0.0;
  double side_k = 0.0;
  double interior_k = 0.0;
};
ColdSoak cold_soak(const scene::BodyInterior& interior, double air_k, double sky_w_m2,
                   double film_w_m2_k) {
  constexpr double kEmissivity = 0.9;
  const double inside_w_m2_k = 1.0 / (kSteel.thickness_m / kSteel.conductivity_w_m_k +
                                      kFilm.thickness_m / kFilm.conductivity_w_m_k);
  const double around_w_m2 = physics::kStefanBoltzmannWPerM2K4 * std::pow(air_k, 4.0);
  const auto face_k = [&](double sky_frac, double interior_k) {
    double low = 100.0;
    double high = 400.0;
    for (int i = 0; i < 60; ++i) {
      const double t = 0.5 * (low + high);
      const double gained = kEmissivity * (sky_frac * sky_w_m2 + (1.0 - sky_frac) * around_w_m2 -
                                           physics::kStefanBoltzmannWPerM2K4 * std::pow(t, 4.0)) +
                            film_w_m2_k * (air_k - t) + inside_w_m2_k * (interior_k - t);
      (gained > 0.0 ? low : high) = t;
    }
    return low;
  };
  ColdSoak out;
  double low = 100.0;
  double high = 400.0;
  for (int i = 0; i < 60; ++i) {
    out.interior_k = 0.5 * (low + high);
    const auto into = [&](double sky_frac) {
      return inside_w_m2_k * (face_k(sky_frac, out.interior_k) - out.interior_k);
    };
    const double gained = into(1.0) + 4.0 * into(0.5) + into(0.0) +
                          6.0 * interior.ventilation_w_m2_k * (air_k - out.interior_k);
    (gained > 0.0 ? low : high) = out.interior_k;
  }
  out.roof_k = face_k(1.0, out.interior_k);
  out.side_k = face_k(0.5, out.interior_k);
  return out;
}

TEST(RendererBody, ColdSoakedUnderAClearSkyItIsWhatItsBalanceSays) {
  constexpr double kColdK = 253.15;
  constexpr double kClearW_m2 = 165.0;
  const scene::BodyInterior interior;
  auto scenario = night(interior);
  scenario.weather[0].air_k = kColdK;
  scenario.weather[0].environment_k = kColdK;
  scenario.weather[0].longwave_down_w_m2 = kClearW_m2;
  scenario.materials[0].base_k = 293.15;  // does not count: the layers rest on the body
  scenario.materials[0].base_stated = false;
  const ColdSoak truth = cold_soak(interior, kColdK, kClearW_m2, film_w_m2_k(scenario));
  BodyRun run(scenario);
  constexpr std::int64_t kSoakedNs = 600 * kMinuteNs;
  EXPECT_NEAR(run.shell_k(kSoakedNs), truth.side_k, 0.4);
  EXPECT_NEAR(run.shell_k(kSoakedNs, {0.1, -0.1, kUpM + 6.0}), truth.roof_k, 0.4);
  // Roofs of vehicles lie 1 to 3 K below air of -20 C.
  EXPECT_GT(truth.roof_k, 250.0);
  EXPECT_LT(truth.roof_k, 252.0);
}

TEST(RendererBody, FollowsWeatherThatTheHostSends) {
  const scene::BodyInterior interior;
  const auto scenario = night(interior);
  const double film = film_w_m2_k(scenario);
  Balance truth;
  const double cold_w_m2 = scenario.weather[0].longwave_down_w_m2;
  truth.advance(interior, kAirK, cold_w_m2, film, 3600);
  BodyRun run(scenario);
  EXPECT_NEAR(run.shell_k(60 * kMinuteNs), truth.shell_k, 0.4);
  scene::WeatherSample warm = scenario.weather[0];
  constexpr double kWarmK = 290.0;
  warm.sim_time_ns = 60 * kMinuteNs;
  warm.air_k = kWarmK;
  warm.environment_k = kWarmK;
  warm.longwave_down_w_m2 = physics::kStefanBoltzmannWPerM2K4 * std::pow(kWarmK, 4.0);
  ASSERT_TRUE(run.renderer().apply_weather(warm));
  for (int minute = 61; minute <= 100; ++minute) {
    truth.advance(interior, kWarmK, warm.longwave_down_w_m2, film, 60);
    const float shell_k = run.shell_k(minute * kMinuteNs);
    if (minute <= 65) continue;
    EXPECT_NEAR(shell_k, truth.shell_k, 0.4) << minute;
  }
}

TEST(RendererBody, AnEngineWarmsTheInteriorAndTheParkedBodyCoolsDown) {
  using Kind = scene::PartCommand::Kind;
  constexpr double kPowerW_m2 = 300.0;
  const scene::BodyInterior interior{20'000.0, 0.5};
  auto scenario = night(interior);
  scenario.objects[0].entity_id = 7;
  scenario.objects[0].parts = {{1, "engine", scenario.materials[0].name, {}, {}}};
  const double film = film_w_m2_k(scenario);
  const double sky_w_m2 = scenario.weather[0].longwave_down_w_m2;
  Balance truth;
  truth.advance(interior, kAirK, sky_w_m2, film, 3600);
  BodyRun run(scenario);
  EXPECT_NEAR(run.shell_k(60 * kMinuteNs), truth.shell_k, 0.4);
  double hottest_k = 0.0;
  for (int minute = 61; minute <= 180; ++minute) {
    // Run the engine for an hour.
    const bool runs = minute <= 120;
    if (minute == 61 || minute == 121) {
      const scene::PartCommand command{runs ? Kind::power : Kind::off, runs ? kPowerW_m2 : 0.0};
      ASSERT_TRUE(run.renderer().apply_part((minute - 1) * kMinuteNs, {7, 1, command}));
    }
    truth.advance(interior, kAirK, sky_w_m2, film, 60, runs ? kPowerW_m2 : 0.0);
    const float shell_k = run.shell_k(minute * kMinuteNs);
    hottest_k = std::max(hottest_k, truth.shell_k);
    // Frames a minute apart lie on the lines between nodes.
    if (minute % 60 <= 5) continue;
    EXPECT_NEAR(shell_k, truth.shell_k, 0.5) << minute;
  }
  EXPECT_GT(hottest_k, kAirK + 15.0);
}

TEST(RendererBody, KeepsABaseThatTheUserStates) {
  auto scenario = night({});
  scenario.materials[0].base_stated = true;
  scenario.materials[0].base_k = 350.0;
  const float stated_k = BodyRun(scenario).shell_k(360 * kMinuteNs);
  EXPECT_GT(stated_k, kAirK + 15.0F);
  EXPECT_LT(BodyRun(night({})).shell_k(360 * kMinuteNs), stated_k - 10.0F);
}

}  // namespace
}  // namespace emit::test
