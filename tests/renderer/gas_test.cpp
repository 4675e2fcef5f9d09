// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <random>
#include <span>
#include <utility>
#include <vector>

#include "emit/physics/planck.hpp"
#include "support/cached_session.hpp"

/// Hot gas, flares and smoke in the picture, seen from above over black ground of known
/// temperature, without air, against closed forms.
namespace emit {
namespace {

using test::kHeight;
using test::kWidth;

constexpr double kGroundK = 290.0;
constexpr double kEyeUpM = 1000.0;
constexpr double kFovRad = 0.05;
const double kPixelRad = 2.0 * std::tan(0.5 * kFovRad) / kWidth;
constexpr std::uint32_t kEntity = 7;

double radiance(double kelvin) {
  return physics::band_radiance({8.0, 12.0, {}}, physics::Kelvin(kelvin)).radiance_w_m2_sr;
}

/// Scenario of black ground, with one entity that is a plate of that size, facing up.
scene::ScenarioDesc over_ground(double plate_m = 0.001, double plate_k = kGroundK) {
  scene::ScenarioDesc s =
      test::cached_scenario(test::write_quads("still", {test::ground(200.0, 200.0)}));
  s.weather = {test::weather(0.0, 0.0, 400.0, kGroundK)};
  s.weather[0].air_k = kGroundK;
  s.sensor.fov_h_rad = kFovRad;
  s.materials[0].emissivity_frac = 1.0;
  s.materials[0].prescribed_k = kGroundK;
  scene::Material plate = s.materials[0];
  plate.name = "plate";
  plate.prescribed_k = plate_k;
  s.materials.push_back(plate);
  scene::ObjectDesc object = s.objects.front();
  object.name = object.material = "plate";
  object.gltf = test::write_quads("plate", {test::ground(0.5, 0.5)}, true);
  object.entity_id = kEntity;
  object.scale = plate_m;
  s.objects.push_back(object);
  return s;
}

/// Renderer of such a scenario that looks down from above the origin.
class Eye {
 public:
  explicit Eye(const scene::ScenarioDesc& scenario, bool terms = false) {
    renderer::OutputOptions output;
    output.temperature = output.depth = output.sun = output.sky = output.terms = terms;
    output.ladder = renderer::Ladder::replayed;
    auto made = renderer::Renderer::create(scenario, {}, output);
    if (made) {
      renderer_ = std::move(*made);
    } else {
      ADD_FAILURE() << made.error().text;
    }
  }
  /// Moves the entity to a place, by pixels right and down of the middle at a height.
  void place(const glm::dvec2& at_px, double up_m, std::int64_t time_ns, bool on = true) {
    const glm::dvec3 ray(at_px * kPixelRad, 1.0);
    const glm::dvec3 at_m = glm::dvec3(0.0, 0.0, kEyeUpM) +
                            glm::mat3_cast(down()) * (glm::transpose(physics::sensor_from_body()) *
                                                      (ray * (kEyeUpM - up_m)));
    const renderer::EntityUpdate update{
        kEntity, {at_m, physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0)}, on, true};
    EXPECT_EQ(renderer_->apply_entities(time_ns, {&update, 1}), 1U);
  }
  void drive(std::uint32_t part, const scene::PartCommand& command, std::int64_t time_ns) {
    EXPECT_TRUE(renderer_->apply_part(time_ns, {kEntity, part, command}));
  }
  std::vector<float> show(std::int64_t time_ns, std::uint8_t level = 0,
                          const scene::PixelRect& window = {}) {
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = time_ns;
    request.quality_level = level;
    request.window_px = window;
    request.sensor_pose = {{0.0, 0.0, kEyeUpM}, down()};
    const int slot = renderer_->submit(request);
    const auto& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot));
    EXPECT_FALSE(view.device_failed);
    EXPECT_EQ(view.stats.nonfinite_px, 0U);
    std::vector<float> out(view.radiance_w_m2_sr[0].begin(), view.radiance_w_m2_sr[0].end());
    if (!view.incoming_w_m2_sr.empty()) {
      const glm::uvec2 px(kWidth / 2 + 2, kHeight / 2 + 1);
      terms_ = renderer_->radiance_terms(view, px, 1.0).front();
      pixel_w_m2_sr_ = view.radiance_w_m2_sr[0][px.y * kWidth + px.x];
    }
    renderer_->release(static_cast<renderer::SlotIndex>(slot));
    return out;
  }
  [[nodiscard]] const renderer::RadianceTerms& terms() const { return terms_; }
  [[nodiscard]] double pixel_w_m2_sr() const { return pixel_w_m2_sr_; }

 private:
  static glm::dquat down() {
    return physics::world_from_body_heading_pitch_roll(0.0, -0.5 * physics::kPi, 0.0);
  }
  std::unique_ptr<renderer::Renderer> renderer_;
  renderer::RadianceTerms terms_;
  double pixel_w_m2_sr_ = 0.0;
};

/// Radiant intensity that a picture shows above the ground, W sr-1, of what is at a height.
double intensity_w_sr(const std::vector<float>& picture, double up_m) {
  double sum = 0.0;
  for (std::size_t i = 0; i < picture.size(); ++i) {
    const glm::dvec2 tan =
        kPixelRad * (glm::dvec2(i % kWidth, i / kWidth) + 0.5 - 0.5 * glm::dvec2(kWidth, kHeight));
    sum += (picture[i] - radiance(kGroundK)) * std::pow(1.0 + glm::dot(tan, tan), -1.5);
  }
  return sum * std::pow(kPixelRad * (kEyeUpM - up_m), 2);
}

constexpr double kIntensityW_sr = 300.0;

scene::FlareDesc flare(double radius_px, double up_m) {
  scene::FlareDesc out;
  out.object = "plate";
  out.intensity_w_sr = {{"8-12", kIntensityW_sr}};
  out.radius_m = radius_px * kPixelRad * (kEyeUpM - up_m);
  out.rise_s = 0.0;
  out.burn_s = 1e5;
  return out;
}

TEST(Flare, HasItsIntensityAtAnySizePlaceAndQualityLevel) {
  constexpr double kUpM = 300.0;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> phase(-3.0, 3.0);
  for (const double radius_px : {0.02, 0.1, 0.3, 0.8, 1.7, 4.0, 9.0, 14.0}) {
    scene::ScenarioDesc s = over_ground();
    s.gas.flares = {flare(radius_px, kUpM)};
    Eye eye(s);
    std::int64_t time_ns = 0;
    for (int i = 0; i < 24; ++i) {
      eye.place({phase(random), phase(random)}, kUpM, time_ns += 1'000'000);
      const auto picture = eye.show(time_ns, static_cast<std::uint8_t>(i % 12));
      EXPECT_NEAR(intensity_w_sr(picture, kUpM) / kIntensityW_sr, 1.0, 3e-3)
          << radius_px << " px, level " << i % 12;
    }
  }
}

TEST(Flare, BurnsFromTheInstantAtWhichItsEntityAppears) {
  scene::ScenarioDesc s = over_ground();
  s.gas.flares = {flare(3.0, 300.0)};
  s.gas.flares[0].rise_s = 1.0;
  s.gas.flares[0].burn_s = 2.0;
  s.gas.flares[0].fall_s = 2.0;
  s.objects.back().on = false;
  Eye eye(s);
  constexpr std::int64_t kS = 1'000'000'000;
  EXPECT_NEAR(intensity_w_sr(eye.show(2 * kS), 300.0) / kIntensityW_sr, 0.0, 3e-3);
  eye.place({}, 300.0, 10 * kS, true);
  for (const auto& [after_s, share] :
       {std::pair{0.25, 0.25}, {1.0, 1.0}, {2.9, 1.0}, {4.0, 0.5}, {5.1, 0.0}}) {
    const auto picture = eye.show(10 * kS + static_cast<std::int64_t>(after_s * 1e9));
    EXPECT_NEAR(intensity_w_sr(picture, 300.0) / kIntensityW_sr, share, 3e-3) << after_s;
  }
  // It burns anew when it appears again, however many jumps its host makes.
  eye.place({}, 300.0, 20 * kS, false);
  eye.place({}, 300.0, 30 * kS, true);
  for (int i = 1; i <= 300; ++i) eye.place({0.01 * i, 0.0}, 300.0, 30 * kS + i * 5'000'000);
  const auto again = eye.show(30 * kS + 1'500'000'000);
  EXPECT_NEAR(intensity_w_sr(again, 300.0) / kIntensityW_sr, 1.0, 3e-3);
}

TEST(Flare, BehindABodyIsHiddenAndInFrontOfItIsNot) {
  // The plate is 2 pixels wide, so that it is averaged over its pixels; its flare is smaller.
  constexpr double kUpM = 300.0;
  const double plate_m = 2.0 * kPixelRad * (kEyeUpM - kUpM);
  for (const double flare_up_m : {-20.0, 20.0}) {
    scene::ScenarioDesc s = over_ground(plate_m);
    // The flare hangs below or above the plate, on an entity of its own.
    scene::ObjectDesc carrier = s.objects.back();
    carrier.name = "carrier";
    carrier.entity_id = 8;
    carrier.scale = 1e-3;
    carrier.instances.front().position_world_m = {0.0, 0.0, kUpM + flare_up_m};
    s.objects.push_back(carrier);
    s.gas.flares = {flare(0.4, kUpM)};
    s.gas.flares[0].object = "carrier";
    Eye eye(s);
    eye.place({}, kUpM, 1'000'000);
    const double seen_w_sr = intensity_w_sr(eye.show(1'000'000), kUpM + flare_up_m);
    EXPECT_NEAR(seen_w_sr / kIntensityW_sr, flare_up_m > 0.0 ? 1.0 : 0.0, 0.01) << flare_up_m;
  }
}

scene::FireDesc fire(double absorption_per_m, double kelvin) {
  scene::FireDesc out;
  out.diameter_m = 8.0;
  out.heat_release_w = 50e6;
  out.kelvin = kelvin;
  out.absorption_per_m = absorption_per_m;
  return out;
}

TEST(Gas, AsWarmAsWhatLiesBehindItIsNotSeen) {
  // A furnace: fire, cold exhaust and smoke at the temperature of the ground, of all depths.
  for (const double depth : {0.01, 1.0, 30.0}) {
    scene::ScenarioDesc s = over_ground();
    s.gas.fires = {fire(depth, kGroundK)};
    scene::PlumeDesc plume;
    plume.object = "plate";
    plume.full = plume.idle = {.exit_k = kGroundK, .exit_m_s = 100.0};
    plume.soot_per_m = depth;
    s.gas.plumes = {plume};
    scene::SmokeDesc smoke;
    smoke.rate_g_s = 100.0 * depth;
    s.gas.smokes = {smoke};
    Eye eye(s);
    eye.place({2.0, 1.0}, 0.01, 1'000'000);  // higher up the air is colder
    const auto picture = eye.show(1'000'000);
    for (const float pixel : picture) {
      ASSERT_NEAR(pixel / radiance(kGroundK), 1.0, 1e-4) << depth;
    }
  }
}

TEST(Gas, AsWarmAsAllAroundItIsNotSeenThroughAirThatAbsorbsItsLight) {
  // Air, ground and exhaust of one temperature: the air takes more of the exhaust's spectrum than
  // of the ground's, and neither is seen.
  scene::ScenarioDesc s = over_ground();
  s.bands = {{"3-5", 3.0, 5.0, {}}};
  s.place.height_m = 0.0;
  s.atmosphere.enabled = true;
  scene::BandAtmosphere air;
  air.band = "3-5";
  air.model = physics::AirSpec{};
  s.atmosphere.bands = {air};
  scene::PlumeDesc plume;
  plume.object = "plate";
  plume.radius_m = 1.0;
  plume.full = plume.idle = {.exit_k = 1200.0, .exit_m_s = 400.0};
  plume.exhaust = {0.12, 0.12};
  Eye clear(s);
  clear.place({2.0, 1.0}, 0.01, 1'000'000);
  const auto without = clear.show(1'000'000);
  s.gas.plumes = {plume};
  float hottest = 0.0F;
  for (const double exit_k : {kGroundK, 1200.0}) {
    s.gas.plumes[0].full.exit_k = s.gas.plumes[0].idle.exit_k = exit_k;
    Eye eye(s);
    eye.place({2.0, 1.0}, 0.01, 1'000'000);
    const auto with = eye.show(1'000'000);
    for (std::size_t i = 0; i < with.size(); ++i) {
      const float ratio = with[i] / without[i];
      hottest = std::max(hottest, ratio);
      // Air higher up is up to some kelvins colder than the exhaust: a thousandth of the contrast.
      if (exit_k == kGroundK) {
        ASSERT_NEAR(ratio, 1.0F, 2e-3F) << i % kWidth << "," << i / kWidth;
      }
    }
  }
  EXPECT_GT(hottest, 1.5F);
}

TEST(Gas, OpaqueShowsItsOwnTemperature) {
  scene::ScenarioDesc s = over_ground();
  s.gas.fires = {fire(60.0, 900.0)};
  Eye eye(s);
  const auto picture = eye.show(1'000'000);
  const float brightest = *std::max_element(picture.begin(), picture.end());
  EXPECT_NEAR(brightest / radiance(900.0), 1.0, 5e-3);
}

TEST(Gas, ThinHasTheIntensityOfItsVolume) {
  // A flame is a cone of Gaussian sections: their area is 2 pi sigma^2, and sigma falls from a
  // quarter of the diameter to 0.3 of that. Thin gas shows absorption times volume.
  constexpr double kPerM = 1e-4;
  const double height_m = 0.235 * std::pow(50e3, 0.4) - 1.02 * 8.0;
  const double volume_m3 = 2.0 * physics::kPi * 4.0 * height_m * (1.0 - 0.7 + 0.49 / 3.0);
  const double expected_w_sr = kPerM * volume_m3 * (radiance(900.0) - radiance(kGroundK));
  scene::ScenarioDesc s = over_ground();
  s.gas.fires = {fire(kPerM, 900.0)};
  Eye eye(s);
  EXPECT_NEAR(intensity_w_sr(eye.show(1'000'000), 0.5 * height_m) / expected_w_sr, 1.0, 0.015);
}

TEST(Gas, SmokeWeakensByBeerAndLambert) {
  // Cold smoke over warm ground: the missing intensity is mass times extinction. All of it is
  // younger than a second, so that none has faded.
  constexpr double kExtinctionM2_g = 2e-3;
  scene::ScenarioDesc s = over_ground();
  s.weather[0].air_k = 230.0;
  scene::SmokeDesc smoke;
  smoke.start_ns = 0;
  smoke.stop_ns = 1'000'000'000;
  smoke.rate_g_s = 200.0;
  smoke.radius_m = 6.0;
  smoke.extinction_m2_g = kExtinctionM2_g;
  smoke.position_m = {0.0, 0.0, 100.0};
  s.gas.smokes = {smoke};
  Eye eye(s);
  const double air_k = 230.0 - 0.65;
  const double expected_w_sr = 200.0 * kExtinctionM2_g * (radiance(air_k) - radiance(kGroundK));
  EXPECT_NEAR(intensity_w_sr(eye.show(1'000'000'000), 100.0) / expected_w_sr, 1.0, 0.01);
}

TEST(Plume, SmallOnesKeepTheirIntensityWhileTheyCloseIn) {
  // A sooty plume of some thickness, from many pixels down to a fiftieth of one: its intensity is
  // that of its area.
  double first = 0.0;
  for (double scale = 0.1; scale > 0.0005; scale *= 0.5) {
    scene::ScenarioDesc s = over_ground();
    scene::PlumeDesc plume;
    plume.object = "plate";
    plume.radius_m = scale;
    plume.full = plume.idle = {.exit_k = 900.0, .exit_m_s = 300.0};
    plume.soot_per_m = 1.0 / scale;
    plume.exhaust = {0.0, 0.0};
    s.gas.plumes = {plume};
    Eye eye(s);
    // The picture without it has the same rounding.
    eye.place({}, 50.0, 500'000, false);
    const auto without = eye.show(500'000);
    double sum = 0.0;
    constexpr int kPhases = 5;
    for (int i = 0; i < kPhases; ++i) {
      const std::int64_t time_ns = (i + 1) * 1'000'000;
      eye.place({0.37 * i, 8.0 * scale / kPixelRad / kEyeUpM + 0.23 * i}, 50.0, time_ns);
      auto picture = eye.show(time_ns);
      for (std::size_t k = 0; k < picture.size(); ++k) {
        picture[k] += static_cast<float>(radiance(kGroundK)) - without[k];
      }
      sum += intensity_w_sr(picture, 50.0) / kPhases;
    }
    const double by_area = sum / (scale * scale);
    if (first == 0.0) first = by_area;
    EXPECT_NEAR(by_area / first, 1.0, 0.15) << scale << " m";
  }
}

TEST(Plume, FollowsTheThrottleOfItsPart) {
  scene::ScenarioDesc s = over_ground(1.0);
  s.materials[1].prescribed_k.reset();
  s.objects[1].parts = {{.id = 3,
                         .name = "nozzle",
                         .material = "plate",
                         .curve = {.given = true, .idle_k = 500.0, .full_k = 900.0},
                         .commands = {}}};
  scene::PlumeDesc plume;
  plume.object = "plate";
  plume.part = "nozzle";
  plume.full = {.exit_k = 1200.0, .exit_m_s = 600.0};
  plume.idle = {.exit_k = 600.0, .exit_m_s = 200.0};
  plume.soot_per_m = 0.2;
  plume.nozzle_body_m = {-3.0, 0.0, 0.0};
  s.gas.plumes = {plume};
  Eye eye(s);
  eye.place({}, 50.0, 1'000'000);
  // Nothing has driven the part yet: there is no plume. Then it idles, and runs at full power.
  const double off_w_sr = intensity_w_sr(eye.show(2'000'000), 50.0);
  using Kind = scene::PartCommand::Kind;
  eye.drive(3, {Kind::throttle, 0.0}, 3'000'000);
  const double idle_w_sr = intensity_w_sr(eye.show(4'000'000), 50.0) - off_w_sr;
  eye.drive(3, {Kind::throttle, 1.0}, 5'000'000);
  const double full_w_sr = intensity_w_sr(eye.show(6'000'000), 50.0) - off_w_sr;
  EXPECT_GT(idle_w_sr, 5.0);
  EXPECT_GT(full_w_sr, 2.0 * idle_w_sr);
  eye.drive(3, {Kind::off, 0.0}, 7'000'000);
  EXPECT_LT(intensity_w_sr(eye.show(8'000'000), 50.0) - off_w_sr, 0.5 * idle_w_sr);
}

TEST(Gas, TermsOfAPixelAddUpToIt) {
  scene::ScenarioDesc s = over_ground();
  s.materials[0].emissivity_frac = 0.9;
  s.gas.fires = {fire(0.4, 900.0)};
  s.gas.flares = {flare(6.0, 0.0)};
  Eye eye(s, true);
  eye.place({4.0, 1.0}, 20.0, 1'000'000);
  (void)eye.show(1'000'000);
  EXPECT_LT(eye.terms().gas_frac, 0.9);
  EXPECT_GT(eye.terms().gas_w_m2_sr, 1.0);
  EXPECT_NEAR(eye.terms().sum_w_m2_sr() / eye.pixel_w_m2_sr(), 1.0, 1e-5);
}

TEST(Gas, AWindowHasTheBitsOfTheWholePicture) {
  scene::ScenarioDesc s = over_ground();
  s.gas.fires = {fire(0.4, 900.0)};
  s.gas.flares = {flare(2.0, 0.0)};
  Eye eye(s);
  eye.place({4.0, 1.0}, 20.0, 1'000'000);
  const auto whole = eye.show(1'000'000);
  const scene::PixelRect window{37, 25, 30, 41};
  const auto part = eye.show(1'000'000, 0, window);
  for (std::uint32_t y = window.y_px; y < window.y_px + window.height_px; ++y) {
    for (std::uint32_t x = window.x_px; x < window.x_px + window.width_px; ++x) {
      ASSERT_EQ(part[y * kWidth + x], whole[y * kWidth + x]) << x << "," << y;
    }
  }
}

}  // namespace
}  // namespace emit
