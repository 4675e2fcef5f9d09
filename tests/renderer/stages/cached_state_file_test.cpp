// SPDX-License-Identifier: Apache-2.0
// thermal.state_file: a run that reads the state of a warm-up shows the frames of the run that
// wrote it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <vector>

#include "support/renderer_scene.hpp"
#include "support/times.hpp"

namespace emit::test {
namespace {

using emit::test::kSecondNs;
constexpr std::int64_t kHourNs = 3600 * kSecondNs;

physics::Pose looking(const glm::dvec3& from, const glm::dvec3& at) {
  return {from, physics::world_from_body_look_at(from, at)};
}

/// Scenario with a box on open ground and a vehicle that has left.
scene::ScenarioDesc saved_scenario(const std::filesystem::path& state_file) {
  auto quads = box({-1.0, -1.0, 0.0}, {1.0, 1.0, 2.0});
  quads.push_back(ground(12.0, 12.0));
  scene::ScenarioDesc s = instant_scenario(write_quads("box", quads));
  s.weather.clear();
  s.materials[0].layers = {{0.15, 0.7, 2120, 920}, {1.85, 1.2, 1900, 1158}};
  s.materials[0].base_k = 286.15;
  s.sensor.width_px = 96;
  s.sensor.height_px = 80;
  const physics::Pose pose = looking({3.0, -9.0, 6.0}, {0.0, 0.0, 0.0});
  s.sensor.trajectory = {{2 * kHourNs, pose, true, false}};
  s.thermal.method = scene::ThermalMethod::cached;
  s.thermal.model = scene::ThermalModel::foster;
  s.thermal.spin_up_ns = 24 * kHourNs;
  s.thermal.steps = 12;
  s.thermal.spacing = scene::StepSpacing::geometric;
  s.thermal.tolerance_k = 0.5;
  s.thermal.state_file = state_file;
  scene::ObjectDesc vehicle = s.objects.front();
  vehicle.name = "vehicle";
  vehicle.gltf = write_quads("vehicle", box({-0.8, -0.5, 0.1}, {0.8, 0.5, 1.0}));
  vehicle.entity_id = 7;
  physics::Pose spot = vehicle.instances.front();
  spot.position_world_m += glm::dvec3(3.0, -2.0, 0.0);
  physics::Pose away = spot;
  away.position_world_m.x += 200.0;
  vehicle.parts = {{1, "hull", s.materials[0].name, {}, {}}};
  s.materials[0].base = scene::BaseKind::body;  // both objects have an interior
  vehicle.trajectory = {{0, spot, true, false},
                        {2 * kHourNs + 5 * kSecondNs, spot, true, false},
                        {2 * kHourNs + 6 * kSecondNs, away, true, true}};
  s.objects.push_back(vehicle);
  return s;
}

struct WarmUp {
  physics::Result<void> result;
  std::size_t reports = 0;  ///< number of progress reports; 0 when nothing was computed
};

class Session {
 public:
  explicit Session(const scene::ScenarioDesc& scenario) {
    renderer::OutputOptions output;
    output.temperature = true;
    auto made = renderer::Renderer::create(scenario, {}, output);
    if (made) {
      renderer_ = std::move(*made);
    } else {
      ADD_FAILURE() << made.error().text;
    }
  }
  [[nodiscard]] renderer::FrameRequest request(double seconds) const {
    renderer::FrameRequest out;
    out.sim_time_ns = out.thermal_time_ns = 2 * kHourNs + std::llround(1e9 * seconds);
    out.sensor_pose = renderer_->scenario_sensor_pose_at(2 * kHourNs);
    return out;
  }
  WarmUp warm_up(const renderer::FrameRequest& first) {
    WarmUp out;
    out.result = renderer_->warm_up(first, [&out](double) {
      ++out.reports;
      return true;
    });
    return out;
  }
  WarmUp warm_up() { return warm_up(request(0.0)); }
  /// Renders a frame and returns all its planes, one after the other.
  [[nodiscard]] std::vector<float> frame(const renderer::FrameRequest& request) {
    const int slot = renderer_->submit(request);
    const auto& view = renderer_->collect(static_cast<renderer::SlotIndex>(slot));
    EXPECT_FALSE(view.device_failed);
    std::vector<float> out(view.temperature_k.begin(), view.temperature_k.end());
    for (const auto& plane : view.radiance_w_m2_sr) {
      out.insert(out.end(), plane.begin(), plane.end());
    }
    renderer_->release(static_cast<renderer::SlotIndex>(slot));
    return out;
  }
  /// Renders frames over the end of three intervals, while the vehicle leaves.
  [[nodiscard]] std::vector<std::vector<float>> frames() {
    std::vector<std::vector<float>> out;
    for (const double seconds : {0.0, 2.0, 5.5, 8.0, 30.0, 65.0}) {
      out.push_back(frame(request(seconds)));
    }
    return out;
  }
  [[nodiscard]] renderer::Renderer& renderer() { return *renderer_; }

 private:
  std::unique_ptr<renderer::Renderer> renderer_;
};

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

std::filesystem::path fresh_file() {
  const auto file =
      std::filesystem::path(testing::TempDir()) /
      (std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + ".emitstate");
  std::filesystem::remove(file);
  return file;
}

TEST(RendererStateFile, ARunThatReadsItShowsBitForBitWhatTheOneThatWroteItShows) {
  const auto file = fresh_file();
  const auto scenario = saved_scenario(file);
  std::vector<std::vector<float>> written;
  std::uint64_t samples = 0;
  {
    Session run(scenario);
    const WarmUp warm = run.warm_up();
    ASSERT_TRUE(warm.result) << warm.result.error().text;
    EXPECT_GT(warm.reports, 0U);
    written = run.frames();
    samples = run.renderer().scene_stats().samples;
  }
  ASSERT_TRUE(std::filesystem::exists(file));
  EXPECT_GT(samples, 300U);
  Session run(scenario);
  const WarmUp warm = run.warm_up();
  ASSERT_TRUE(warm.result) << warm.result.error().text;
  EXPECT_EQ(warm.reports, 0U);  // the surface was not sampled
  EXPECT_EQ(run.renderer().scene_stats().samples, samples);
  const auto read = run.frames();
  for (std::size_t i = 0; i < written.size(); ++i) EXPECT_TRUE(same_bits(written[i], read[i])) << i;
  EXPECT_FALSE(same_bits(written[0], written[5]));
  std::filesystem::remove(file);
}

TEST(RendererStateFile, WithoutFileTheFramesAreTheSame) {
  const auto file = fresh_file();
  auto scenario = saved_scenario(file);
  const auto with = Session(scenario).frames();
  scenario.thermal.state_file.clear();
  const auto without = Session(scenario).frames();
  for (std::size_t i = 0; i < with.size(); ++i) EXPECT_TRUE(same_bits(with[i], without[i])) << i;
  std::filesystem::remove(file);
}

TEST(RendererStateFile, OneThatDoesNotFitIsRefusedWithTheReasonAndKept) {
  const auto file = fresh_file();
  const auto scenario = saved_scenario(file);
  ASSERT_TRUE(Session(scenario).warm_up().result);
  const auto written = std::filesystem::last_write_time(file);
  struct Case {
    const char* reason;
    std::function<void(scene::ScenarioDesc&)> change;
  };
  const std::vector<Case> cases{
      {"scene geometry", [](auto& s) { s.objects[0].scale = 1.01; }},
      {"scene geometry",
       [](auto& s) { s.objects[1].trajectory[0].pose.position_world_m.x += 0.1; }},
      {"scene geometry",
       [](auto& s) {
         s.objects[1].parts[0].commands = {{0, {scene::PartCommand::Kind::power, 100.0}}};
       }},
      {"scene geometry", [](auto& s) { s.objects[1].interior.heat_j_m2_k += 1.0; }},
      {"scene geometry", [](auto& s) { s.objects[0].interior.ventilation_w_m2_k += 0.1; }},
      {"materials", [](auto& s) { s.materials[0].base = scene::BaseKind::room; }},
      {"materials", [](auto& s) { s.materials[0].solar_absorptance_frac -= 0.01; }},
      {"materials", [](auto& s) { s.materials[0].layers[1].conductivity_w_m_k += 0.1; }},
      {"place or date", [](auto& s) { s.place.lat_rad += 1e-6; }},
      {"place or date", [](auto& s) { s.epoch_utc_ns += 60 * kSecondNs; }},
      {"weather", [](auto& s) { s.clear_sky.wind_m_s += 0.5; }},
      {"weather", [](auto& s) { s.weather = {weather(500.0, 80.0, 300.0, 290.0)}; }},
      {"thermal options", [](auto& s) { s.thermal.tolerance_k = 0.4; }},
      {"thermal options", [](auto& s) { s.thermal.steps = 13; }},
      {"thermal options", [](auto& s) { s.thermal.lateral = !s.thermal.lateral; }},
      {"sensor format", [](auto& s) { s.sensor.width_px = 128; }},
      {"sensor format", [](auto& s) { s.sensor.fov_h_rad *= 1.1; }},
      {"trajectory", [](auto& s) { s.sensor.trajectory[0].pose.position_world_m.z += 0.5; }},
  };
  for (const Case& each : cases) {
    auto other = scenario;
    each.change(other);
    const WarmUp warm = Session(other).warm_up();
    ASSERT_FALSE(warm.result) << each.reason;
    EXPECT_EQ(warm.result.error().code, physics::ErrorCode::config);
    EXPECT_NE(warm.result.error().text.find(each.reason), std::string::npos)
        << each.reason << ": " << warm.result.error().text;
    EXPECT_NE(warm.result.error().text.find(file.string()), std::string::npos);
    EXPECT_EQ(warm.reports, 0U);
  }
  const auto refused = [&](const char* reason, auto&& change_request) {
    Session run(scenario);
    renderer::FrameRequest first = run.request(0.0);
    change_request(run, first);
    const WarmUp warm = run.warm_up(first);
    ASSERT_FALSE(warm.result) << reason;
    EXPECT_NE(warm.result.error().text.find(reason), std::string::npos) << warm.result.error().text;
  };
  refused("this run starts at", [](Session&, renderer::FrameRequest& first) {
    first.sim_time_ns = first.thermal_time_ns -= 60 * kSecondNs;
  });
  refused("serves runs that start up to 900 s later; this run starts at",
          [](Session&, renderer::FrameRequest& first) {
            first.sim_time_ns = first.thermal_time_ns += 940 * kSecondNs;
          });
  refused("refined for other places of the camera", [](Session&, renderer::FrameRequest& first) {
    first.sensor_pose.position_world_m.x += 3.0;
  });
  refused("input of the host", [&](Session& run, renderer::FrameRequest&) {
    const renderer::EntityUpdate update{7, scenario.objects[1].instances[0], true, false};
    EXPECT_EQ(run.renderer().apply_entities(kHourNs, {&update, 1}), 1U);
  });
  refused("input of the host", [&](Session& run, renderer::FrameRequest&) {
    EXPECT_TRUE(
        run.renderer().apply_part(kHourNs, {7, 1, {scene::PartCommand::Kind::temperature, 330.0}}));
  });
  EXPECT_EQ(std::filesystem::last_write_time(file), written);
  EXPECT_TRUE(Session(scenario).warm_up().result);  // the file is still valid
  std::filesystem::remove(file);
}

TEST(RendererStateFile, ARunThatStartsLaterShowsWhatOneShowsThatWentOnToThere) {
  const auto file = fresh_file();
  const auto scenario = saved_scenario(file);
  const std::vector<double> later_s{7.0, 65.0, 240.0, 905.0};
  std::vector<std::vector<float>> went_on;
  {
    Session run(scenario);
    ASSERT_TRUE(run.warm_up().result);
    for (const double seconds : later_s) {
      // Go there in small steps, as a daemon does.
      for (double at_s = seconds - 6.9; at_s < seconds; at_s += 0.7) {
        ASSERT_TRUE(run.renderer().carry_on(run.request(at_s)));
        (void)run.frame(run.request(at_s));
      }
      went_on.push_back(run.frame(run.request(seconds)));
    }
  }
  for (std::size_t i = 0; i < later_s.size(); ++i) {
    Session run(scenario);
    const WarmUp warm = run.warm_up(run.request(later_s[i]));
    ASSERT_TRUE(warm.result) << warm.result.error().text;
    const auto shown = run.frame(run.request(later_s[i]));
    // Frames update the shadow maps of entities, which shows for seconds after one has left.
    if (later_s[i] > 60.0) {
      EXPECT_TRUE(same_bits(shown, went_on[i])) << later_s[i];
      continue;
    }
    for (std::size_t p = 0; p < shown.size(); ++p) {
      if (std::isnan(shown[p])) continue;
      ASSERT_NEAR(shown[p], went_on[i][p], 0.05F) << later_s[i] << " s, value " << p;
    }
  }
  EXPECT_FALSE(same_bits(went_on[1], went_on[3]));
  std::filesystem::remove(file);
}

TEST(RendererStateFile, PosesOfTheHostAfterItsInstantDoNotMatterToIt) {
  const auto file = fresh_file();
  const auto scenario = saved_scenario(file);
  ASSERT_TRUE(Session(scenario).warm_up().result);
  Session run(scenario);
  const renderer::EntityUpdate update{7, scenario.objects[1].instances[0], true, false};
  EXPECT_EQ(run.renderer().apply_entities(2 * kHourNs + 3 * kSecondNs, {&update, 1}), 1U);
  const WarmUp warm = run.warm_up(run.request(65.0));
  EXPECT_TRUE(warm.result) << warm.result.error().text;
  EXPECT_EQ(run.frame(run.request(65.0)).empty(), false);
  std::filesystem::remove(file);
}

TEST(RendererStateFile, CarryingOnReportsAndStops) {
  const auto file = fresh_file();
  const auto scenario = saved_scenario(file);
  Session run(scenario);
  ASSERT_TRUE(run.warm_up().result);
  std::vector<double> done;
  ASSERT_TRUE(run.renderer().carry_on(run.request(600.0), [&done](double frac) {
    done.push_back(frac);
    return true;
  }));
  EXPECT_GT(done.size(), 10U);
  EXPECT_TRUE(std::ranges::is_sorted(done));
  const auto stopped = run.renderer().carry_on(run.request(900.0), [](double) { return false; });
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().code, physics::ErrorCode::internal);
  std::filesystem::remove(file);
}

TEST(RendererStateFile, BandsDoNotMatterToIt) {
  const auto file = fresh_file();
  auto scenario = saved_scenario(file);
  ASSERT_TRUE(Session(scenario).warm_up().result);
  scenario.bands = {{"3-5", 3.0, 5.0, {}}};
  Session other(scenario);
  const WarmUp warm = other.warm_up();
  ASSERT_TRUE(warm.result) << warm.result.error().text;
  EXPECT_EQ(warm.reports, 0U);
  const auto shown = other.frame(other.request(0.0));
  scenario.thermal.state_file.clear();
  Session afresh(scenario);
  ASSERT_TRUE(afresh.warm_up().result);
  EXPECT_TRUE(same_bits(shown, afresh.frame(afresh.request(0.0))));
  std::filesystem::remove(file);
}

TEST(RendererStateFile, AnotherLibraryEntryOrNameDoesNotMatter) {
  const auto file = fresh_file();
  auto scenario = saved_scenario(file);
  ASSERT_TRUE(Session(scenario).warm_up().result);
  scenario.name = "renamed";
  scenario.materials.push_back(scenario.materials[0]);
  scenario.materials.back().name = "unused";
  scenario.materials.back().emissivity_frac = 0.5;
  scenario.display.max_k += 10.0;
  const WarmUp warm = Session(scenario).warm_up();
  EXPECT_TRUE(warm.result) << warm.result.error().text;
  EXPECT_EQ(warm.reports, 0U);
  std::filesystem::remove(file);
}

TEST(RendererStateFile, GoingBackInTimeStartsAfreshAndLeavesTheFileAsItIs) {
  const auto file = fresh_file();
  const auto scenario = saved_scenario(file);
  Session run(scenario);
  ASSERT_TRUE(run.warm_up().result);
  const auto written = std::filesystem::last_write_time(file);
  const auto first = run.frame(run.request(0.0));
  (void)run.frame(run.request(-3600.0));  // the test fails when the frame is refused
  EXPECT_EQ(std::filesystem::last_write_time(file), written);
  (void)run.frame(run.request(90.0));
  EXPECT_TRUE(same_bits(first, run.frame(run.request(0.0))));
  std::filesystem::remove(file);
}

TEST(RendererStateFile, AJumpOfTheThermalTimeIsFlaggedOnTheFrameThatPreparesTheSurfaceAnew) {
  auto scenario = saved_scenario(fresh_file());
  scenario.thermal.state_file.clear();
  Session run(scenario);
  ASSERT_TRUE(run.warm_up().result);
  for (const double seconds : {0.0, 30.0, -1800.0, -1790.0, 1800.0, 1801.0}) {
    const bool jumps = seconds == -1800.0 || seconds == 1800.0;
    const int slot = run.renderer().submit(run.request(seconds));
    ASSERT_GE(slot, 0);
    const auto& view = run.renderer().collect(static_cast<renderer::SlotIndex>(slot));
    EXPECT_EQ(view.stats.rewarm_s > 0.0, jumps) << seconds;
    EXPECT_EQ(view.stats.coarse.any(), jumps) << seconds;
    run.renderer().release(static_cast<renderer::SlotIndex>(slot));
  }
}

TEST(RendererStateFile, AFolderThatIsNotThereIsToldBeforeTheWork) {
  const auto scenario = saved_scenario(fresh_file() / "none" / "x.emitstate");
  const WarmUp warm = Session(scenario).warm_up();
  ASSERT_FALSE(warm.result);
  EXPECT_EQ(warm.result.error().code, physics::ErrorCode::io);
  EXPECT_EQ(warm.reports, 0U);
}

}  // namespace
}  // namespace emit::test
