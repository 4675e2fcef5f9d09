// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <span>
#include <utility>
#include <vector>

#include "emit/physics/planck.hpp"
#include "support/cached_session.hpp"

/// Small targets: black plates of known temperature in front of black ground, without air, seen
/// from above. A plate has the energy of its solid angle, however it falls on the pixels.
namespace emit {
namespace {

using test::kHeight;
using test::kWidth;

constexpr double kGroundK = 290.0;
constexpr double kPlateK = 350.0;
constexpr double kHotK = 450.0;
constexpr double kEyeUpM = 1000.0;
constexpr double kFovRad = 0.05;
const double kPixelRad = 2.0 * std::tan(0.5 * kFovRad) / kWidth;
constexpr std::uint8_t kLevels = 12;

double radiance(double kelvin) {
  return physics::band_radiance({8.0, 12.0, {}}, physics::Kelvin(kelvin)).radiance_w_m2_sr;
}

/// Square plate that faces up.
struct Plate {
  double side_px = 1.0;
  double range_m = 500.0;
  glm::dvec2 at_px{0.0};  ///< right and down of the middle of the image
  double kelvin = kPlateK;
  bool on = true;

  [[nodiscard]] double side_m() const { return side_px * kPixelRad * range_m; }
  /// Solid angle times radiance above the ground, over the square of the pixel's angle.
  [[nodiscard]] double energy() const {
    const glm::dvec2 tan = at_px * kPixelRad;
    const double near_px = std::pow(1.0 + glm::dot(tan, tan), -1.5);
    return side_px * side_px * near_px * (radiance(kelvin) - radiance(kGroundK));
  }
};

struct Picture {
  std::vector<float> radiance;
  std::vector<float> temperature_k;
  std::vector<float> depth_m;
  std::vector<float> object;
  std::vector<float> coverage_frac;
  std::uint32_t plain_targets = 0;
};

/// Renderer of ground, other static quads and plates, which are entities 1, 2, ... Each plate is a
/// metre wide in its file, so that its scale is its side.
class Sky {
 public:
  explicit Sky(const std::vector<Plate>& plates, std::vector<test::Quad> still = {},
               double limit_px = scene::kMaxSmallTargetPx, bool ground = true) {
    if (ground) still.push_back(test::ground(200.0, 200.0));
    scene::ScenarioDesc s = test::cached_scenario(test::write_quads("still", still));
    s.sensor.fov_h_rad = kFovRad;
    s.sensor.small_target_px = limit_px;
    s.materials[0].emissivity_frac = 1.0;
    s.materials[0].prescribed_k = kGroundK;
    const auto plate_file = test::write_quads("plate", {test::ground(0.5, 0.5)}, true);
    for (std::size_t i = 0; i < plates.size(); ++i) {
      scene::Material material = s.materials[0];
      material.name = "plate" + std::to_string(i);
      material.prescribed_k = plates[i].kelvin;
      s.materials.push_back(material);
      scene::ObjectDesc object = s.objects.front();
      object.name = object.material = material.name;
      object.gltf = plate_file;
      object.entity_id = static_cast<std::uint32_t>(i + 1);
      object.scale = plates[i].side_m();
      object.instances.front().position_world_m = position(plates[i]);
      s.objects.push_back(object);
    }
    renderer::OutputOptions output;
    output.temperature = output.depth = output.object = output.coverage = true;
    output.ladder = renderer::Ladder::replayed;
    auto made = renderer::Renderer::create(s, {}, output);
    if (made) {
      renderer_ = std::move(*made);
    } else {
      ADD_FAILURE() << made.error().text;
    }
  }

  /// Picture of the plates at other places; their sides follow from the constructor.
  Picture show(const std::vector<Plate>& plates, std::uint8_t level = 0,
               const scene::PixelRect& window = {}) {
    time_ns_ += 1'000'000;
    for (std::size_t i = 0; i < plates.size(); ++i) {
      const renderer::EntityUpdate update{
          static_cast<std::uint32_t>(i + 1),
          {position(plates[i]), physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0)},
          plates[i].on,
          true};
      EXPECT_EQ(renderer_->apply_entities(time_ns_, {&update, 1}), 1U);
    }
    renderer::FrameRequest request;
    request.sim_time_ns = request.thermal_time_ns = time_ns_;
    request.quality_level = level;
    request.window_px = window;
    request.sensor_pose = {{0.0, 0.0, kEyeUpM}, down()};
    const int slot = renderer_->submit(request);
    const auto& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot));
    EXPECT_FALSE(view.device_failed);
    EXPECT_EQ(view.stats.nonfinite_px, 0U);
    EXPECT_EQ(view.stats.clamped_px, 0U);
    const auto copy = [](std::span<const float> plane) {
      return std::vector<float>(plane.begin(), plane.end());
    };
    Picture out{copy(view.radiance_w_m2_sr[0]), copy(view.temperature_k), copy(view.depth_m),
                copy(view.object_id),           copy(view.coverage_frac), view.stats.plain_targets};
    renderer_->release(static_cast<renderer::SlotIndex>(slot));
    return out;
  }

  /// Energy of all plates above what lies behind them, in the unit of Plate::energy().
  double energy(std::vector<Plate> plates, std::uint8_t level = 0) {
    const Picture with = show(plates, level);
    for (Plate& plate : plates) plate.on = false;
    const Picture without = show(plates, level);
    double sum = 0.0;
    for (std::size_t i = 0; i < with.radiance.size(); ++i) {
      const glm::dvec2 tan = kPixelRad * (glm::dvec2(i % kWidth, i / kWidth) + 0.5 -
                                          0.5 * glm::dvec2(kWidth, kHeight));
      sum += static_cast<double>(with.radiance[i] - without.radiance[i]) *
             std::pow(1.0 + glm::dot(tan, tan), -1.5);
    }
    return sum;
  }

 private:
  static glm::dquat down() {
    return physics::world_from_body_heading_pitch_roll(0.0, -0.5 * physics::kPi, 0.0);
  }
  static glm::dvec3 position(const Plate& plate) {
    const glm::dvec3 ray(plate.at_px * kPixelRad, 1.0);
    return glm::dvec3(0.0, 0.0, kEyeUpM) +
           glm::mat3_cast(down()) *
               (glm::transpose(physics::sensor_from_body()) * (ray * plate.range_m));
  }

  std::unique_ptr<renderer::Renderer> renderer_;
  std::int64_t time_ns_ = 0;
};

TEST(SmallTarget, KeepsItsEnergyWhileItDriftsAtAnySizeAndQualityLevel) {
  for (const double side_px : {0.02, 0.3, 2.6, 11.0, 27.0}) {
    Plate plate{.side_px = side_px};
    Sky sky({plate});
    for (std::uint8_t level = 0; level < kLevels; ++level) {
      plate.at_px += glm::dvec2(0.37, 0.23);
      EXPECT_NEAR(sky.energy({plate}, level) / plate.energy(), 1.0, 2e-3)
          << side_px << " px, level " << int{level};
    }
  }
}

TEST(SmallTarget, OneSamplePerPixelLosesIt) {
  Plate plate{.side_px = 0.4, .at_px = {0.1, 0.1}};  // a pixel's corner lies at the middle
  Sky sky({plate}, {}, 0.0);
  EXPECT_EQ(sky.energy({plate}), 0.0);
}

TEST(SmallTarget, LiesWhereItIs) {
  // A plate of a pixel on the border of two pixels gives each its share.
  Plate plate{.side_px = 1.0, .at_px = {3.25, 5.5}};
  Sky sky({plate});
  const Picture with = sky.show({plate});
  plate.on = false;
  const Picture without = sky.show({plate});
  const double more = radiance(kPlateK) - radiance(kGroundK);
  const std::size_t pixel = (kHeight / 2 + 5) * kWidth + kWidth / 2 + 2;
  EXPECT_NEAR(with.radiance[pixel] - without.radiance[pixel], 0.25 * more, 0.01 * more);
  EXPECT_NEAR(with.radiance[pixel + 1] - without.radiance[pixel + 1], 0.75 * more, 0.01 * more);
  std::size_t changed = 0;
  for (std::size_t i = 0; i < with.radiance.size(); ++i) {
    changed += std::abs(with.radiance[i] - without.radiance[i]) > 1e-3 ? 1U : 0U;
  }
  EXPECT_EQ(changed, 2U);
}

TEST(SmallTarget, ThoseWithoutAWindowAreCounted) {
  // Each plate lies on a pixel's corner, so it is lost without a window.
  std::vector<Plate> plates;
  for (int i = 0; i < 40; ++i) {
    plates.push_back({.side_px = 0.4, .at_px = {3.0 * (i % 8 - 4), 3.0 * (i / 8 - 2)}});
  }
  Sky sky(plates);
  EXPECT_EQ(sky.show(plates).plain_targets, 8U);
  for (std::size_t i = 32; i < plates.size(); ++i) plates[i].on = false;
  const Picture fewer = sky.show(plates);
  EXPECT_EQ(fewer.plain_targets, 0U);
  EXPECT_NEAR(sky.energy(plates), 32.0 * plates[20].energy(), 0.01 * 32.0 * plates[20].energy());
  // A target that is not in the image needs no window.
  for (std::size_t i = 32; i < plates.size(); ++i) {
    plates[i].on = true;
    plates[i].at_px.y = 3.0 * kHeight;
  }
  EXPECT_EQ(sky.show(plates).plain_targets, 0U);
}

TEST(SmallTarget, NeighboursInOnePixelAddUp) {
  const std::vector<Plate> plates{{.side_px = 0.4, .range_m = 400.0, .at_px = {0.3, 0.4}},
                                  {.side_px = 0.3, .at_px = {0.75, 0.5}, .kelvin = kHotK},
                                  {.side_px = 0.1, .at_px = {0.5, 0.85}}};
  Sky sky(plates);
  const double sum = plates[0].energy() + plates[1].energy() + plates[2].energy();
  EXPECT_NEAR(sky.energy(plates) / sum, 1.0, 3e-3);
}

TEST(SmallTarget, TheNearerHidesTheFarther) {
  // The nearer plate covers the other, then half of it.
  Plate near{.side_px = 0.8, .range_m = 300.0, .at_px = {0.1, 0.2}};
  Plate far{.side_px = 0.5, .range_m = 500.0, .at_px = {0.1, 0.2}, .kelvin = kHotK};
  Sky sky({far, near});
  EXPECT_NEAR(sky.energy({far, near}) / near.energy(), 1.0, 3e-3);
  far.at_px.x += 0.4;
  EXPECT_NEAR(sky.energy({far, near}) / (near.energy() + 0.5 * far.energy()), 1.0, 1e-2);
}

TEST(SmallTarget, ARidgeHidesItsPart) {
  // A large plate at ground temperature hides everything to the left of the middle of the image.
  const double up_m = kEyeUpM - 200.0;
  const test::Quad ridge{
      {-30.0, -30.0, up_m}, {0.0, -30.0, up_m}, {0.0, 30.0, up_m}, {-30.0, 30.0, up_m}};
  Plate plate{.side_px = 0.6, .at_px = {0.0, 0.5}};
  Sky sky({plate}, {ridge});
  for (const double shown_frac : {0.0, 0.2, 0.5, 0.9, 1.0}) {
    plate.at_px.x = (shown_frac - 0.5) * plate.side_px;
    EXPECT_NEAR(sky.energy({plate}) / plate.energy(), shown_frac, 0.02) << shown_frac;
  }
}

TEST(SmallTarget, CrossesTheBorderOfTheImageWithoutAJump) {
  Plate plate{.side_px = 3.0, .at_px = {0.5 * kWidth - 2.0, 0.3}};
  Sky sky({plate});
  double last = sky.energy({plate}) / plate.energy();
  EXPECT_NEAR(last, 1.0, 3e-3);
  for (; plate.at_px.x < 0.5 * kWidth + 2.0; plate.at_px.x += 0.1) {
    const double inside_px =
        std::clamp(0.5 * kWidth - plate.at_px.x + 0.5 * plate.side_px, 0.0, plate.side_px);
    const double frac = sky.energy({plate}) / plate.energy();
    EXPECT_NEAR(frac, inside_px / plate.side_px, 0.01) << plate.at_px.x;
    EXPECT_LT(std::abs(frac - last), 0.1 / plate.side_px + 0.01);
    last = frac;
  }
}

TEST(SmallTarget, ShowsInFrontOfTheSky) {
  Plate plate{.side_px = 0.5, .at_px = {20.2, 10.1}};  // beside the ground
  Sky sky({plate}, {test::ground(1.0, 1.0)}, scene::kMaxSmallTargetPx, false);
  const double frac = radiance(kPlateK) / (radiance(kPlateK) - radiance(kGroundK));
  EXPECT_NEAR(sky.energy({plate}) / plate.energy(), frac, 3e-3 * frac);
}

TEST(SmallTarget, OtherPlanesHoldTheNearestTargetOfAPixel) {
  const std::vector<Plate> plates{
      {.side_px = 0.2, .range_m = 500.0, .at_px = {0.3, 0.4}, .kelvin = kHotK},
      {.side_px = 0.2, .range_m = 400.0, .at_px = {0.7, 0.4}}};
  Sky sky(plates);
  const Picture picture = sky.show(plates);
  const std::size_t pixel = kHeight / 2 * kWidth + kWidth / 2;
  EXPECT_EQ(picture.object[pixel], 3.0F);  // the ground is object 1
  EXPECT_NEAR(picture.temperature_k[pixel], kPlateK, 1e-2);
  EXPECT_NEAR(picture.depth_m[pixel], 400.0, 0.1);
  EXPECT_NEAR(picture.coverage_frac[pixel], 0.08, 1e-3);
  EXPECT_EQ(picture.object[pixel + 1], 1.0F);
  EXPECT_EQ(picture.coverage_frac[pixel + 1], 0.0F);
  EXPECT_NEAR(picture.depth_m[pixel + 1], kEyeUpM, 0.1);
}

TEST(SmallTarget, ALargeBodyIsDrawnAsBefore) {
  Plate plate{.side_px = 40.0, .at_px = {0.3, 0.4}};
  Picture with;
  {
    Sky sky({plate});
    with = sky.show({plate});
  }
  Sky plain({plate}, {}, 0.0);
  EXPECT_EQ(with.radiance, plain.show({plate}).radiance);
}

TEST(SmallTarget, AWindowOfTheImageHoldsTheBitsOfTheWhole) {
  Plate plate{.side_px = 5.3, .at_px = {0.3, 0.4}};
  Sky sky({plate});
  for (const std::uint8_t level : std::vector<std::uint8_t>{0, 6, 10}) {
    const Picture whole = sky.show({plate}, level);
    const scene::PixelRect window{40, 30, 9, 12};  // it cuts the target
    const Picture part = sky.show({plate}, level, window);
    for (std::uint32_t y = window.y_px; y < window.y_px + window.height_px; ++y) {
      const std::size_t first = y * kWidth + window.x_px;
      EXPECT_EQ(std::memcmp(&whole.radiance[first], &part.radiance[first],
                            window.width_px * sizeof(float)),
                0)
          << "row " << y << ", level " << int{level};
    }
  }
}

TEST(SmallTarget, MoreThanTheWindowsHoldStayInTheImage) {
  // Forty plates of three pixels: 32 have windows, and the others one sample per pixel.
  std::vector<Plate> plates;
  for (int i = 0; i < 40; ++i) {
    plates.push_back({.side_px = 3.0, .at_px = {8.0 * (i % 8) - 27.0, 8.0 * (i / 8) - 15.0}});
  }
  Sky sky(plates);
  double sum = 0.0;
  for (const Plate& plate : plates) sum += plate.energy();
  EXPECT_NEAR(sky.energy(plates) / sum, 1.0, 0.01);
}

TEST(SmallTarget, TheShadowOfABodyThatFliesHighLiesWhereTheSunSays) {
  // A plate of 8 m flies 120 m above the ground, beside the picture; its umbra is 6 m wide.
  constexpr double kUpM = 120.0;
  scene::ScenarioDesc s =
      test::cached_scenario(test::write_quads("still", {test::ground(300.0, 300.0)}));
  s.sensor.fov_h_rad = 0.2;
  s.materials[0].prescribed_k = kGroundK;
  scene::ObjectDesc object = s.objects.front();
  object.name = "plate";
  object.gltf = test::write_quads("plate", {test::ground(0.5, 0.5)}, true);
  object.entity_id = 1;
  object.scale = 8.0;
  const glm::dvec3 sun = test::to_sun(s, 0.0);
  ASSERT_GT(sun.z, 0.3);
  object.instances.front().position_world_m = kUpM / sun.z * sun;
  s.objects.push_back(object);
  renderer::OutputOptions output;
  output.sun = true;
  const auto made = renderer::Renderer::create(s, {}, output);
  ASSERT_TRUE(made) << made.error().text;
  renderer::FrameRequest request;
  request.sensor_pose = {
      {0.0, 0.0, 100.0},
      physics::world_from_body_heading_pitch_roll(0.0, -0.5 * physics::kPi, 0.0)};
  const int slot = (*made)->submit(request);
  const auto& view = (*made)->collect(static_cast<renderer::SlotIndex>(slot));
  const auto cosine_at = [&](std::uint32_t x, std::uint32_t y) {
    return view.sun_cosine[std::size_t{y} * kWidth + x];
  };
  EXPECT_NEAR(cosine_at(kWidth / 2, kHeight / 2), 0.0, 1e-3);
  for (const auto& [x, y] : {std::pair(1U, 1U), std::pair(kWidth - 2, kHeight - 2)}) {
    EXPECT_NEAR(cosine_at(x, y), sun.z, 1e-3);
  }
  (*made)->release(static_cast<renderer::SlotIndex>(slot));
}

}  // namespace
}  // namespace emit
