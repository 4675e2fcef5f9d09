// SPDX-License-Identifier: Apache-2.0
// Shipped scenarios against stored images. The references belong to Mesa llvmpipe: on another
// device the comparison is skipped. EMIT_UPDATE_GOLDENS=1 rewrites them
// (deploy/scripts/update_goldens.sh).
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "emit/config/load.hpp"
#include "emit/image/exr_image.hpp"
#include "emit/renderer/renderer.hpp"

namespace emit::test {
namespace {

/// Tolerances: a pixel counts as off beyond abs + rel |reference|. Temperatures repeat to float32
/// rounding on one machine; 10 mK leaves room for another vector width. `allowed_frac` pixels may
/// be off because an edge fell on the other side of a pixel or a shadow texel.
struct Tolerance {
  double abs;
  double rel;
  double allowed_frac;
};
constexpr Tolerance kTemperatureK{0.01, 0.0, 0.002};
constexpr Tolerance kRadianceWPerM2Sr{0.002, 2e-4, 0.002};

struct Case {
  const char* scenario;
  const char* method;
  double time_s;
  const char* model = "emit2014";
  std::vector<std::string> overrides = {};
  [[nodiscard]] std::string name() const { return std::string(scenario) + "_" + method; }
};
void PrintTo(const Case& c, std::ostream* out) {
  *out << c.name();
}

class Golden : public testing::TestWithParam<Case> {};

void compare(const image::ExrImage& image, const image::ExrImage& reference, const char* channel,
             const Tolerance& tolerance) {
  const auto* a = image.find(channel);
  const auto* b = reference.find(channel);
  ASSERT_TRUE(a != nullptr && b != nullptr) << channel;
  ASSERT_EQ(a->pixels.size(), b->pixels.size());
  std::size_t off = 0;
  double worst = 0.0;
  for (std::size_t i = 0; i < a->pixels.size(); ++i) {
    const double x = a->pixels[i];
    const double y = b->pixels[i];
    if (std::isnan(x) && std::isnan(y)) continue;
    const double difference = std::abs(x - y);
    if (!(difference <= tolerance.abs + tolerance.rel * std::abs(y))) ++off;
    if (difference > worst) worst = difference;
  }
  EXPECT_LE(static_cast<double>(off),
            tolerance.allowed_frac * static_cast<double>(a->pixels.size()))
      << channel << ": " << off << " pixels off, the worst by " << worst;
}

TEST_P(Golden, matches_the_stored_image) {
  const Case& param = GetParam();
  // Everything that the images depend on and that scenarios leave to the defaults.
  std::vector<std::string> overrides = {"sensor.width_px=320",
                                        "sensor.height_px=256",
                                        std::string("thermal.model=") + param.model,
                                        std::string("thermal.method=") + param.method,
                                        "thermal.history_start_s=0",
                                        "thermal.steps=13",
                                        "thermal.spacing=uniform",
                                        "thermal.first_step_s=20",
                                        "thermal.tolerance_k=0.1",
                                        "thermal.shadow_map_px=1024",
                                        "thermal.max_cascades=1",
                                        "thermal.blocker_taps=8",
                                        "thermal.filter_taps=32",
                                        "thermal.max_samples=1000000",
                                        "material[asphalt].base_k=293.15",
                                        "material[concrete].base_k=293.15",
                                        "material[stone].base_k=293.15"};
  for (const std::string& each : param.overrides) overrides.push_back(each);
  auto scenario = config::load_scenario(std::filesystem::path(EMIT_TEST_SHARE_DIR) / "scenarios" /
                                            (std::string(param.scenario) + ".toml"),
                                        overrides);
  ASSERT_TRUE(scenario) << scenario.error().text;
  renderer::OutputOptions output;
  output.temperature = true;
  auto renderer = renderer::Renderer::create(*scenario, {}, output);
  ASSERT_TRUE(renderer) << renderer.error().text;

  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = std::llround(param.time_s * 1e9);
  request.sensor_pose = (*renderer)->scenario_sensor_pose_at(request.sim_time_ns);
  const int slot = (*renderer)->submit(request);
  ASSERT_GE(slot, 0);
  const auto& frame = (*renderer)->collect(static_cast<renderer::SlotIndex>(slot));
  EXPECT_FALSE(frame.device_failed);
  EXPECT_EQ(frame.stats.nonfinite_px, 0U);

  image::ExrImage image;
  image.width_px = frame.width_px;
  image.height_px = frame.height_px;
  image.add("radiance", frame.radiance_w_m2_sr[0]);
  image.add("temperature", frame.temperature_k);
  const std::filesystem::path file =
      std::filesystem::path(EMIT_TEST_SOURCE_DIR) / "golden" / "refs" / (param.name() + ".exr");
  if (std::getenv("EMIT_UPDATE_GOLDENS") != nullptr) {
    const auto written = image::write_exr(file, image);
    ASSERT_TRUE(written) << written.error().text;
    GTEST_SKIP() << "rewrote " << file;
  }
  if ((*renderer)->device_name().find("llvmpipe") == std::string::npos) {
    GTEST_SKIP() << "the references belong to llvmpipe, this is " << (*renderer)->device_name();
  }
  const auto reference = image::read_exr(file);
  ASSERT_TRUE(reference) << reference.error().text;
  compare(image, *reference, "temperature", kTemperatureK);
  compare(image, *reference, "radiance", kRadianceWPerM2Sr);
  if (HasFailure()) {
    const auto failed = std::filesystem::path(testing::TempDir()) / (param.name() + "_failed.exr");
    if (image::write_exr(failed, image)) std::printf("wrote %s\n", failed.c_str());
  }
}

INSTANTIATE_TEST_SUITE_P(
    Scenarios, Golden,
    testing::Values(Case{"box", "per-frame", 12600.0}, Case{"block-on-road", "per-frame", 12600.0},
                    Case{"ribbed", "per-frame", 7200.0}, Case{"box", "cached", 12600.0},
                    Case{"block-on-road", "cached", 12600.0}, Case{"ribbed", "cached", 7200.0},
                    // Clouds stand in the sky and shade the road; they need heat in layers.
                    Case{"fair-weather",
                         "cached",
                         12600.0,
                         "foster",
                         {"sensor.width_px=160", "sensor.height_px=128"}}),
    [](const auto& case_info) {
      std::string name = case_info.param.name();
      for (char& c : name) c = c == '-' ? '_' : c;
      return name;
    });

}  // namespace
}  // namespace emit::test
