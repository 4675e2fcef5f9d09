// SPDX-License-Identifier: Apache-2.0
// Judges glossy surfaces: the furnace, the sky in a lobe against sums over the hemisphere, the
// glint of the sun against the density of facets, and the terms of a pixel.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <vector>

#include "emit/physics/apparent_temperature.hpp"
#include "emit/physics/clear_sky.hpp"
#include "emit/physics/climate/climate.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/planck.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/surface/facets.hpp"
#include "support/renderer_scene.hpp"
#include "support/times.hpp"

namespace emit::test {
namespace {

const std::vector<scene::SpectralBand> kBands{{"3-5", 3.0, 5.0, {}}, {"8-12", 8.0, 12.0, {}}};
constexpr std::uint32_t kWidth = 64;
constexpr std::uint32_t kHeight = 48;

double black(const scene::SpectralBand& band, double kelvin) {
  return physics::band_radiance({band.lo_um, band.hi_um, {}}, physics::Kelvin(kelvin))
      .radiance_w_m2_sr;
}

/// Gloss of a constant index without absorption.
scene::Gloss gloss_of(double refractive_index, double facet_slope) {
  scene::Gloss gloss;
  gloss.wavelength_um = {10.0};
  gloss.refractive_index = {refractive_index};
  gloss.extinction_index = {0.0};
  gloss.facet_slope = facet_slope;
  return gloss;
}

scene::Gloss of_index(physics::IndexTable index, double facet_slope) {
  scene::Gloss gloss;
  gloss.index = index;
  gloss.facet_slope = facet_slope;
  return gloss;
}

scene::Gloss sea(double wind_m_s) {
  scene::Gloss gloss = of_index(physics::IndexTable::water, 0.05);
  gloss.sea = true;
  gloss.sea_wind_m_s = wind_m_s;
  return gloss;
}

scene::Gloss by_angle() {
  scene::Gloss gloss;
  gloss.angle_rad = {0.0, 0.9, 1.3};
  gloss.angle_emissivity_frac = {0.7, 0.6, 0.3};
  gloss.facet_slope = 0.2;
  gloss.lobe_frac = 0.6;
  return gloss;
}

std::vector<scene::Gloss> glosses() {
  return {gloss_of(1.5, 0.002),
          gloss_of(1.5, 0.3),
          gloss_of(8.0, 1.0),
          of_index(physics::IndexTable::water, 0.05),
          of_index(physics::IndexTable::window_glass, 0.01),
          sea(5.0),
          by_angle()};
}

/// Scenario whose faces hold their temperature, with one glossy material.
scene::ScenarioDesc held_scenario(const std::filesystem::path& gltf, double kelvin,
                                  const std::optional<scene::Gloss>& gloss) {
  scene::ScenarioDesc s = instant_scenario(gltf);
  s.bands = kBands;
  s.weather = {weather(0.0, 0.0, 200.0, 250.0)};
  s.materials[0].prescribed_k = kelvin;
  s.materials[0].emissivity_frac = 0.8;
  s.materials[0].foster_modes = {};
  s.materials[0].gloss = gloss;
  s.thermal.method = scene::ThermalMethod::cached;
  s.thermal.model = scene::ThermalModel::foster;
  s.thermal.spin_up_ns = 0;
  s.thermal.steps = 10;
  s.sensor.width_px = kWidth;
  s.sensor.height_px = kHeight;
  return s;
}

physics::Pose look(const glm::dvec3& from_m, const glm::dvec3& to_m) {
  return {from_m, physics::world_from_body_look_at(from_m, to_m)};
}

/// Planes of one frame.
struct Frame {
  std::vector<std::vector<float>> radiance;  ///< by band
  std::vector<float> depth_m;
  std::vector<std::vector<renderer::RadianceTerms>> terms;  ///< by pixel
};

Frame shot(const scene::ScenarioDesc& scenario, const physics::Pose& pose, bool terms = false) {
  renderer::OutputOptions output;
  output.depth = true;
  output.temperature = output.sun = output.sky = output.terms = terms;
  auto made = renderer::Renderer::create(scenario, {}, output);
  if (!made) {
    ADD_FAILURE() << made.error().text;
    return {};
  }
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = 600 * kSecondNs;
  request.sensor_pose = pose;
  const int slot = (*made)->submit(request);
  EXPECT_GE(slot, 0);
  const auto& view = (*made)->collect(static_cast<renderer::SlotIndex>(slot));
  EXPECT_FALSE(view.device_failed);
  EXPECT_EQ(view.stats.nonfinite_px, 0U);
  Frame frame;
  for (const auto& plane : view.radiance_w_m2_sr) {
    frame.radiance.emplace_back(plane.begin(), plane.end());
  }
  frame.depth_m.assign(view.depth_m.begin(), view.depth_m.end());
  for (std::uint32_t i = 0; terms && i < kWidth * kHeight; ++i) {
    frame.terms.push_back((*made)->radiance_terms(view, {i % kWidth, i / kWidth}, 1.0));
  }
  return frame;
}

/// Gives all bands a sky of one radiance, with air that neither takes nor gives on the way.
void set_even_sky(scene::ScenarioDesc& scenario, double kelvin) {
  scenario.atmosphere.enabled = true;
  scenario.atmosphere.bands.clear();
  for (const scene::SpectralBand& band : scenario.bands) {
    scene::BandAtmosphere air;
    air.band = band.name;
    air.table.range_m = {1000.0, 100000.0};
    air.table.elevation_rad = {0.0};
    air.table.transmittance_frac = {1.0, 1.0};
    air.table.path_radiance_w_m2_sr = {0.0, black(band, kelvin)};
    scenario.atmosphere.bands.push_back(air);
  }
  scenario.weather[0].environment_k = kelvin;
  // Find the long-wave irradiance at which there are no clouds.
  scenario.weather[0].air_k = 290.0;
  scenario.weather[0].longwave_down_w_m2 = physics::sky_longwave_w_m2(
      physics::Kelvin(290.0), physics::Kelvin(physics::usual_dew_point_k(290.0)), 0.0, {});
}

physics::SunPosition sun_of(const scene::ScenarioDesc& scenario) {
  return physics::sun_position(
      scenario.epoch_utc_ns + 600 * kSecondNs,
      {physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
       physics::Metres(scenario.place.height_m)});
}

TEST(Gloss, AClosedRoomOfOneTemperatureShowsABlackbody) {
  constexpr double kRoomK = 320.0;
  std::vector<Quad> room = box({-2.0, -1.5, 0.0}, {2.0, 1.5, 2.5});
  for (Quad& quad : room) std::swap(quad.b, quad.d);
  room.push_back(ground(2.0, 1.5));
  const auto gltf = write_quads("room", room);
  for (std::size_t g = 0; g < glosses().size(); ++g) {
    const auto scenario = held_scenario(gltf, kRoomK, glosses()[g]);
    for (const glm::dvec3& to_m : {glm::dvec3(2.0, 1.5, 0.0), glm::dvec3(-2.0, -1.5, 2.5)}) {
      const Frame frame = shot(scenario, look({0.0, 0.0, 1.2}, to_m));
      ASSERT_EQ(frame.radiance.size(), kBands.size());
      for (std::size_t b = 0; b < kBands.size(); ++b) {
        for (const float radiance : frame.radiance[b]) {
          ASSERT_NEAR(radiance / black(kBands[b], kRoomK), 1.0, 1e-4) << kBands[b].name << ' ' << g;
        }
      }
    }
  }
}

TEST(Gloss, UnderASkyOfItsTemperatureEverySurfaceIsABlackbody) {
  constexpr double kKelvin = 285.0;
  // A roof, its slopes and walls on level ground: every tilt to 90 degrees.
  std::vector<Quad> quads = box({-2.0, -2.0, 0.0}, {2.0, 2.0, 2.0});
  quads.push_back(ground(60.0, 60.0));
  quads.push_back({{-2.0, -2.0, 2.0}, {2.0, -2.0, 2.0}, {2.0, 0.0, 3.0}, {-2.0, 0.0, 3.0}});
  const auto gltf = write_quads("roof", quads);
  for (const auto method : {scene::ThermalMethod::cached, scene::ThermalMethod::per_frame}) {
    for (std::size_t g = 0; g < glosses().size(); ++g) {
      auto scenario = held_scenario(gltf, kKelvin, glosses()[g]);
      scenario.thermal.method = method;
      set_even_sky(scenario, kKelvin);
      const Frame frame = shot(scenario, look({6.0, -9.0, 4.0}, {0.0, 0.0, 1.0}));
      ASSERT_EQ(frame.radiance.size(), kBands.size());
      for (std::size_t b = 0; b < kBands.size(); ++b) {
        for (const float radiance : frame.radiance[b]) {
          ASSERT_NEAR(radiance / black(kBands[b], kKelvin), 1.0, 1e-4)
              << kBands[b].name << ' ' << g << (method == scene::ThermalMethod::cached);
        }
      }
    }
  }
}

TEST(Gloss, ASmallTargetOfTheSkysTemperatureIsABlackbodyToo) {
  constexpr double kKelvin = 285.0;
  auto scenario = held_scenario(write_quads("target", box({-2.0, -2.0, 0.0}, {2.0, 2.0, 2.0})),
                                kKelvin, gloss_of(1.5, 0.1));
  scenario.objects[0].entity_id = 7;
  scenario.sensor.fov_h_rad = 0.35;
  set_even_sky(scenario, kKelvin);
  const Frame frame = shot(scenario, look({150.0, -120.0, 30.0}, {0.0, 0.0, 5.0}));
  ASSERT_EQ(frame.radiance.size(), kBands.size());
  EXPECT_TRUE(std::ranges::any_of(frame.depth_m, [](float m) { return std::isfinite(m); }));
  for (std::size_t b = 0; b < kBands.size(); ++b) {
    for (const float radiance : frame.radiance[b]) {
      ASSERT_NEAR(radiance / black(kBands[b], kKelvin), 1.0, 1e-4) << kBands[b].name;
    }
  }
}

/// Fresnel's reflectance without absorption, by the angle of refraction.
double fresnel(double index, double cosine) {
  const double inside = std::sqrt(1.0 - (1.0 - cosine * cosine) / (index * index));
  const double s = (cosine - index * inside) / (cosine + index * inside);
  const double p = (index * cosine - inside) / (index * cosine + inside);
  return 0.5 * (s * s + p * p);
}

/// Smith's Lambda of GGX.
double lambda_ggx(double slope, double cosine) {
  const double tan2 = (1.0 - cosine * cosine) / (cosine * cosine);
  return 0.5 * (std::sqrt(1.0 + slope * slope * tan2) - 1.0);
}

TEST(Gloss, APanelReflectsTheSkyAroundItsMirrorDirection) {
  constexpr double kPanelK = 280.0;
  constexpr double kIndex = 3.0;
  constexpr double kSkyFrac = 0.7;
  double worst_k = 0.0;
  const physics::ApparentTemperature apparent({8.0, 12.0, {}});
  for (const double slope : {0.005, 0.1, 0.4}) {
    for (const double tilt_deg : {0.0, 40.0, 90.0}) {
      for (const double view_deg : {10.0, 50.0, 75.0}) {
        for (const double turn_deg : {0.0, 90.0, 180.0}) {
          const double tilt = tilt_deg * physics::kDegree;
          const glm::dvec3 normal(std::sin(tilt), 0.0, std::cos(tilt));
          const glm::dvec3 u(std::cos(tilt), 0.0, -std::sin(tilt));
          const glm::dvec3 v(0.0, 1.0, 0.0);
          const glm::dvec3 centre(0.0, 0.0, 50.0);
          auto scenario = held_scenario(write_quads("panel", {{centre - u - v, centre + u - v,
                                                               centre + u + v, centre - u + v}}),
                                        kPanelK, gloss_of(kIndex, slope));
          scenario.bands = {kBands[1]};
          scenario.sensor.fov_h_rad = 0.02;
          scenario.atmosphere.enabled = true;
          scene::BandAtmosphere air;
          air.band = "8-12";
          air.terms = {{1.0, 0.0}};
          air.vertical_transmittance_frac = kSkyFrac;
          scenario.atmosphere.bands = {air};
          scenario.weather[0].air_k = 290.0;
          scenario.weather[0].environment_k = 300.0;
          scenario.weather[0].longwave_down_w_m2 = physics::sky_longwave_w_m2(
              physics::Kelvin(290.0), physics::Kelvin(physics::usual_dew_point_k(290.0)), 0.0, {});
          const double angle = view_deg * physics::kDegree;
          const double turn = turn_deg * physics::kDegree;
          const glm::dvec3 side = std::cos(turn) * u + std::sin(turn) * v;
          const glm::dvec3 view = std::cos(angle) * normal + std::sin(angle) * side;
          const Frame frame = shot(scenario, look(centre + 5.0 * view, centre));
          ASSERT_EQ(frame.radiance.size(), 1U);
          // Sum what the lobe brings, direction by direction; the rest is emitted or diffuse.
          const double sky_w_m2_sr = black(scenario.bands[0], 290.0);
          const double ground_w_m2_sr = black(scenario.bands[0], 300.0);
          double lobe = 0.0;
          double share = 0.0;
          double even = 0.0;
          constexpr int kRings = 500;
          constexpr int kSectors = 180;
          // Slopes of facets, dense where they are many.
          for (int i = 0; i < kRings; ++i) {
            const double rest = std::pow(1.0 - (i + 0.5) / kRings, 3);
            const double weight = 3.0 * std::pow(1.0 - (i + 0.5) / kRings, 2);
            const double radius = slope * std::sqrt((1.0 - rest) / rest);
            for (int k = 0; k < kSectors; ++k) {
              const double azimuth = 2.0 * physics::kPi * (k + 0.5) / kSectors;
              const glm::dvec3 facet =
                  glm::normalize(normal - radius * (std::cos(azimuth) * u + std::sin(azimuth) * v));
              const double cosine = glm::dot(facet, view);
              if (cosine <= 0.0) continue;
              const glm::dvec3 from = 2.0 * cosine * facet - view;
              const double out = glm::dot(from, normal);
              if (out <= 0.0) continue;
              // The area of these facets that the viewer sees, per area that it sees.
              const double area =
                  weight * cosine / (glm::dot(facet, normal) * std::cos(angle)) / kRings /
                  kSectors / (1.0 + lambda_ggx(slope, std::cos(angle)) + lambda_ggx(slope, out));
              const double mass =
                  from.z > 0.0 ? physics::relative_air_mass(physics::Radians(std::asin(from.z)))
                               : 0.0;
              const double radiance =
                  from.z > 0.0 ? sky_w_m2_sr * (1.0 - std::pow(kSkyFrac, mass)) : ground_w_m2_sr;
              lobe += area * fresnel(kIndex, cosine) * radiance;
              share += area * fresnel(kIndex, cosine);
            }
          }
          for (int i = 0; i < 400; ++i) {
            const double z = -1.0 + 2.0 * (i + 0.5) / 400;
            const double mass =
                z > 0.0 ? physics::relative_air_mass(physics::Radians(std::asin(z))) : 0.0;
            const double radiance =
                z > 0.0 ? sky_w_m2_sr * (1.0 - std::pow(kSkyFrac, mass)) : ground_w_m2_sr;
            for (int k = 0; k < 180; ++k) {
              const double azimuth = 2.0 * physics::kPi * (k + 0.5) / 180;
              even += std::max(0.0, normal.x * std::sqrt(1.0 - z * z) * std::cos(azimuth) +
                                        normal.z * z) *
                      radiance * 4.0 / 400 / 180;
            }
          }
          // The body absorbs what gives the material's hemispherical emissivity.
          physics::LobeCurve reflectance{};
          for (std::size_t n = 0; n < physics::kLobeNodes; ++n) {
            reflectance[n] = fresnel(kIndex, physics::lobe_cosine(n));
          }
          const physics::Lobe model = physics::make_lobe(
              {physics::FacetSlopes::ggx, slope},
              {reflectance, reflectance, 1.0,
               std::min(1.0, 0.8 / physics::hemispherical_mean(physics::passed_frac(
                                       {physics::FacetSlopes::ggx, slope}, reflectance)))});
          const double emissivity = physics::lobe_at(model.emissivity_frac, std::cos(angle));
          const double expected = emissivity * black(scenario.bands[0], kPanelK) + lobe +
                                  (1.0 - emissivity - share) * even;
          const float shown = frame.radiance[0][24 * kWidth + 32];
          const double off_k = apparent.k(shown) - apparent.k(static_cast<float>(expected));
          if (std::abs(off_k) > std::abs(worst_k)) worst_k = off_k;
          // A round lobe stands for one that is long across the horizon, the more the wider it is.
          const double bar_k = slope < 0.01 ? 0.3 : slope < 0.2 ? 0.9 : 1.4;
          EXPECT_NEAR(off_k, 0.0, bar_k)
              << "slope " << slope << ", tilt " << tilt_deg << ", view " << view_deg << ", turn "
              << turn_deg << ", share " << share;
        }
      }
    }
  }
  RecordProperty("worst_k", std::to_string(worst_k));
}

/// Sun's part of a picture: the frame in sunlight less that without.
std::vector<double> sunlight(scene::ScenarioDesc scenario, const physics::Pose& pose,
                             std::size_t band) {
  scenario.weather[0].direct_normal_w_m2 = 700.0;
  const Frame lit = shot(scenario, pose);
  scenario.weather[0].direct_normal_w_m2 = 0.0;
  const Frame dark = shot(scenario, pose);
  std::vector<double> out;
  for (std::size_t i = 0; i < lit.radiance[band].size(); ++i) {
    out.push_back(double{lit.radiance[band][i]} - dark.radiance[band][i]);
  }
  return out;
}

/// Returns the in-band irradiance across the direction of the sun, from a white surface.
double sun_w_m2(const std::filesystem::path& gltf, std::size_t band) {
  auto white = held_scenario(gltf, 250.0, std::nullopt);
  white.materials[0].emissivity_frac = 0.01;
  const double elevation = sun_of(white).elevation.value();
  const auto plain = sunlight(white, look({0.0, 0.0, 40.0}, {0.01, 0.0, 0.0}), band);
  return plain[24 * kWidth + 32] * physics::kPi / 0.99 / std::sin(elevation);
}

TEST(Gloss, TheSeaGlintsAsCoxAndMunkSay) {
  const auto gltf = write_quads("sea", {ground(300.0, 300.0)});
  for (const std::size_t band : {0U, 1U}) {
    const double irradiance = sun_w_m2(gltf, band);
    ASSERT_GT(irradiance, 0.01);
    for (const double wind_m_s : {2.0, 5.0, 12.0}) {
      auto scenario = held_scenario(gltf, 288.0, sea(wind_m_s));
      scenario.materials[0].emissivity_frac = 1.0;  // all that enters the water stays there
      scenario.sensor.fov_h_rad = 0.35;
      const glm::dvec3 sun = sun_of(scenario).direction_enu;
      // Look at the middle of the glint, and past it.
      const glm::dvec3 mirror(sun.x, sun.y, -sun.z);
      for (const double past_rad : {0.0, 0.15}) {
        const glm::dvec3 from_m(0.0, 0.0, 60.0);
        const glm::dvec3 flat = glm::normalize(glm::dvec3(mirror.x, mirror.y, 0.0));
        const double down = std::asin(sun.z) + past_rad;
        const physics::Pose pose =
            look(from_m, from_m + std::cos(down) * flat - std::sin(down) * glm::dvec3(0, 0, 1));
        const auto shown = sunlight(scenario, pose, band);
        const Frame depth = shot(scenario, pose);
        double mean = 0.0;
        double expected = 0.0;
        const double variance = 0.003 + 0.00512 * wind_m_s;
        physics::Band spectral{kBands[band].lo_um, kBands[band].hi_um, {}};
        for (std::uint32_t i = 0; i < kWidth * kHeight; ++i) {
          const glm::dvec3 at_m = world_point(scenario.sensor, pose, i % kWidth, i / kWidth,
                                              static_cast<double>(depth.depth_m[i]));
          const glm::dvec3 view = glm::normalize(from_m - at_m);
          const glm::dvec3 half = glm::normalize(view + sun);
          const double tan2 = (1.0 - half.z * half.z) / (half.z * half.z);
          const double reflectance = physics::band_reflectance_frac(
              physics::optical_constants(physics::IndexTable::water), spectral,
              physics::Kelvin(physics::kSunTemperatureK), glm::dot(half, view));
          expected += irradiance * reflectance * std::exp(-tan2 / variance) /
                      (physics::kPi * variance) / (4.0 * view.z * std::pow(half.z, 4));
          mean += shown[i];
        }
        EXPECT_NEAR(mean / expected, 1.0, 0.01)
            << kBands[band].name << ", wind " << wind_m_s << ", past " << past_rad;
        RecordProperty(kBands[band].name + std::to_string(wind_m_s) + std::to_string(past_rad),
                       std::to_string(mean / expected));
      }
    }
  }
}

TEST(Gloss, AMirrorShowsTheSunAndItsShadowDoesNot) {
  const auto gltf = write_quads("mirror", {ground(300.0, 300.0)});
  const double irradiance = sun_w_m2(gltf, 0);
  auto scenario = held_scenario(gltf, 288.0, gloss_of(1.5, 0.001));
  scenario.bands = {kBands[0]};
  scenario.sensor.fov_h_rad = 0.02;
  const glm::dvec3 sun = sun_of(scenario).direction_enu;
  const glm::dvec3 from_m(0.0, 0.0, 10.0);
  const physics::Pose pose = look(from_m, from_m + glm::dvec3(sun.x, sun.y, -sun.z));
  const auto lit = sunlight(scenario, pose, 0);
  const double disc = physics::kPi * std::pow(std::sin(physics::kSunSemiAngleRad), 2);
  const double brightest = *std::ranges::max_element(lit);
  const double whole = fresnel(1.5, sun.z) * irradiance / disc;
  // The facets spread the disc a little.
  EXPECT_LT(brightest, 1.02 * whole);
  EXPECT_GT(brightest, 0.7 * whole);
  // The same with a roof between the sun and the mirror.
  const glm::dvec3 spot = from_m + glm::dvec3(sun.x, sun.y, -sun.z) * (10.0 / sun.z);
  const glm::dvec3 roof = spot + 20.0 * sun;
  auto shaded =
      held_scenario(write_quads("shaded",
                                {ground(40.0, 40.0),
                                 {roof + glm::dvec3(-4, -4, 0), roof + glm::dvec3(4, -4, 0),
                                  roof + glm::dvec3(4, 4, 0), roof + glm::dvec3(-4, 4, 0)}},
                                true),
                    288.0, gloss_of(1.5, 0.001));
  shaded.thermal.method = scene::ThermalMethod::per_frame;
  shaded.bands = {kBands[0]};
  shaded.sensor.fov_h_rad = 0.02;
  const auto dark = sunlight(shaded, pose, 0);
  EXPECT_LT(*std::ranges::max_element(dark), 1e-3 * whole);
}

TEST(Gloss, TermsOfAGlossyPixelAddUpToIt) {
  std::vector<Quad> quads = box({-2.0, -2.0, 0.0}, {2.0, 2.0, 2.0});
  quads.push_back(ground(60.0, 60.0));
  const auto gltf = write_quads("terms", quads);
  for (const auto method : {scene::ThermalMethod::cached, scene::ThermalMethod::per_frame}) {
    for (std::size_t g = 0; g < glosses().size(); ++g) {
      auto scenario = held_scenario(gltf, 285.0, glosses()[g]);
      scenario.thermal.method = method;
      scenario.weather[0].direct_normal_w_m2 = 700.0;
      set_even_sky(scenario, 270.0);
      const glm::dvec3 sun = sun_of(scenario).direction_enu;
      const glm::dvec3 from_m(9.0, -9.0, 5.0);
      for (const glm::dvec3& to_m :
           {glm::dvec3(0.0, 0.0, 1.0), from_m + glm::dvec3(sun.x, sun.y, -sun.z)}) {
        const Frame frame = shot(scenario, look(from_m, to_m), true);
        double most_glint = 0.0;
        for (std::size_t b = 0; b < kBands.size(); ++b) {
          for (std::size_t i = 0; i < frame.radiance[b].size(); ++i) {
            const renderer::RadianceTerms& terms = frame.terms[i][b];
            ASSERT_NEAR(terms.sum_w_m2_sr() / frame.radiance[b][i], 1.0, 1e-5)
                << kBands[b].name << ' ' << g << ' ' << i << ' ' << terms.glint_w_m2_sr;
            most_glint = std::max(most_glint, terms.glint_w_m2_sr);
          }
        }
        const bool before_the_sun = to_m.z != 1.0;
        EXPECT_GE(most_glint, before_the_sun ? 1e-6 : 0.0) << g;
      }
    }
  }
}

}  // namespace
}  // namespace emit::test
