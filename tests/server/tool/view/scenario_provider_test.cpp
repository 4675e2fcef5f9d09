// SPDX-License-Identifier: Apache-2.0
// The viewer's thread without its window: overlays, levels, reports of pixels and jumps in time.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <thread>

#include "support/emit_process.hpp"
#include "tool/view/frame_provider.hpp"

namespace emit::test {
namespace {

using namespace tool::view;

class ViewScenario : public testing::Test {
 protected:
  void SetUp() override {
    SourceOptions options;
    options.source = "block-on-road";
    options.set = {"sensor.width_px=80", "sensor.height_px=64", "thermal.tolerance_k=4"};
    options.time_s = 12600.0;
    auto made = make_scenario_provider(options);
    ASSERT_TRUE(made) << made.error().text;
    provider_ = std::move(*made);
    control_.paused = true;
  }

  /// Sends the control and returns the first frame that satisfies `wanted`.
  ViewFrame frame_where(const auto& wanted) {
    provider_->control(control_);
    control_.jump_s = 0.0;
    control_.report_px.reset();
    ViewFrame frame;
    const auto start = std::chrono::steady_clock::now();
    while (std::chrono::steady_clock::now() - start < std::chrono::seconds(240)) {
      if (provider_->take(frame)) {
        if (wanted(frame)) return frame;
      } else if (const auto end = provider_->ended()) {
        ADD_FAILURE() << end->reason;
        return {};
      } else {
        std::this_thread::yield();
      }
    }
    ADD_FAILURE() << "no such frame";
    return {};
  }

  std::unique_ptr<FrameProvider> provider_;
  ViewControl control_;
};

TEST_F(ViewScenario, frames_hold_what_the_overlays_show) {
  const ViewFrame plain = frame_where([](const ViewFrame& frame) { return frame.serial > 0; });
  const std::size_t count = std::size_t{plain.width_px} * plain.height_px;
  ASSERT_EQ(plain.material.size(), count);
  ASSERT_EQ(plain.sun_cosine.size(), count);
  ASSERT_TRUE(plain.material_names);
  EXPECT_TRUE(plain.sample_px.empty());
  std::size_t lit = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (std::isnan(plain.sky_frac[i])) continue;
    EXPECT_LT(static_cast<std::size_t>(plain.material[i]), plain.material_names->size());
    lit += plain.sun_cosine[i] > 0.1F ? 1U : 0U;
  }
  EXPECT_GT(lit, count / 4) << "the road lies in the sun";

  control_.samples = true;
  const ViewFrame sampled =
      frame_where([](const ViewFrame& frame) { return !frame.sample_px.empty(); });
  EXPECT_GT(sampled.sample_px.size(), 50U);
  for (const std::uint32_t px : sampled.sample_px) {
    ASSERT_LT(px, count);
    EXPECT_FALSE(std::isnan(sampled.sky_frac[px])) << "samples lie on surfaces";
  }
  // The levels are those of the renderer's ladder, and a number too high is the last one.
  control_.quality_level = 2;
  EXPECT_EQ(
      frame_where([](const ViewFrame& frame) { return frame.quality_level > 0; }).quality_level, 2);
  control_.quality_level = 255;
  EXPECT_LT(
      frame_where([](const ViewFrame& frame) { return frame.quality_level > 2; }).quality_level,
      255);
}

TEST_F(ViewScenario, a_report_is_that_of_emit_explain) {
  control_.quality_level = 1;  // the report takes a frame of full quality all the same
  control_.report_px = {40, 40};
  const ViewFrame frame = frame_where([](const ViewFrame& each) { return each.report != nullptr; });
  ASSERT_TRUE(frame.report);
  std::string lines;
  for (const std::string& line : *frame.report) lines += line + "\n";
  const TemporaryFolder folder;
  const ProcessResult explained =
      run_emit({"explain", "block-on-road", "--time-s", "12600", "--px", "40,40", "--set",
                "sensor.width_px=80", "--set", "sensor.height_px=64", "--set",
                "thermal.tolerance_k=4", "--json", folder.file("e.json")});
  ASSERT_EQ(explained.exit_code, 0) << explained.err;
  const std::string json = read_text(folder.file("e.json"));
  const auto number = [&](const std::string& text, const std::string& behind) {
    const std::size_t at = text.find(behind);
    return at == std::string::npos ? NAN : std::stod(text.substr(at + behind.size()));
  };
  const double emission_w_m2_sr = number(json, "\"emission_w_m2_sr\": ");
  EXPECT_NEAR(number(lines, "emission "), emission_w_m2_sr, 2e-3 * emission_w_m2_sr) << lines;
  EXPECT_NEAR(number(lines, "surface "), number(json, "\"temperature_k\": "), 0.1) << lines;
  EXPECT_NE(json.find("\"material\": \"asphalt\""), std::string::npos) << json;
  EXPECT_NE(lines.find("material asphalt"), std::string::npos) << lines;
  EXPECT_NE(lines.find("at 12600.000 s  range "), std::string::npos) << lines;
}

TEST_F(ViewScenario, jumps_in_time_go_both_ways) {
  const auto at = [](double time_s) {
    return [=](const ViewFrame& frame) {
      return std::abs(1e-9 * static_cast<double>(frame.sim_time_ns) - time_s) < 1.0;
    };
  };
  const ViewFrame noon = frame_where(at(12600.0));
  control_.jump_s = 7200.0;
  const ViewFrame later = frame_where(at(19800.0));
  control_.jump_s = -7200.0;
  const ViewFrame again = frame_where(at(12600.0));
  double change_k = 0.0;
  double difference_k = 0.0;
  for (std::size_t i = 0; i < noon.temperature_k.size(); ++i) {
    if (std::isnan(noon.temperature_k[i])) continue;
    change_k = std::max(change_k, std::abs(double{later.temperature_k[i]} - noon.temperature_k[i]));
    difference_k =
        std::max(difference_k, std::abs(double{again.temperature_k[i]} - noon.temperature_k[i]));
  }
  EXPECT_GT(change_k, 2.0) << "shadows have moved";
  EXPECT_LT(difference_k, 0.05) << "the same instant has the same temperatures";
  EXPECT_NEAR(*provider_->solar_hour(later.sim_time_ns) - *provider_->solar_hour(noon.sim_time_ns),
              2.0, 1e-6);
}

}  // namespace
}  // namespace emit::test
