// SPDX-License-Identifier: Apache-2.0
#include "bench/frame_time/paired_frames.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "emit/physics/check.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

using physics::Result;

std::vector<double> ratios(std::span<const double> over, std::span<const double> under) {
  std::vector<double> out;
  for (std::size_t i = 0; i < over.size(); ++i) out.push_back(over[i] / under[i]);
  return out;
}

double median(std::span<const double> values) {
  Samples samples;
  for (const double value : values) samples.add(value);
  return samples.median();
}

}  // namespace

renderer::FrameRequest SceneRunner::request(std::uint32_t frame) const {
  renderer::FrameRequest request;
  request.frame_number = frame;
  request.sim_time_ns = observation_ns(*scenario_) + std::llround(1e9 * frame / kRateHz);
  request.thermal_time_ns = request.sim_time_ns;
  request.sensor_pose = renderer_->scenario_pose_at(observation_ns(*scenario_));
  return request;
}

Result<double> SceneRunner::frame_ms() {
  const auto frame = renderer_->render(request(next_frame_++));
  if (!frame) return tl::unexpected(frame.error());
  return frame->frame_ms;
}

Result<SceneRunner> SceneRunner::start(const scene::ScenarioDesc& scenario,
                                       std::uint32_t settle_frames, int gpu_index) {
  const auto start = std::chrono::steady_clock::now();
  auto renderer = RendererThread::create(scenario, gpu_index);
  if (!renderer) return tl::unexpected(std::move(renderer.error()));
  SceneRunner runner(scenario, std::move(*renderer));
  runner.setup_s_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const auto warm_up_s = runner.renderer_->warm_up(runner.request(0));
  if (!warm_up_s) return tl::unexpected(warm_up_s.error());
  runner.warm_up_s_ = *warm_up_s;
  for (std::uint32_t i = 0; i < settle_frames; ++i) {
    const auto shown = runner.frame_ms();
    if (!shown) return tl::unexpected(shown.error());
  }
  return runner;
}

Result<Rounds> take_turns(std::array<SceneRunner*, 3> runners, std::uint32_t rounds) {
  // All runners show the same sim times, whatever a has shown before.
  std::uint32_t first = 0;
  for (const SceneRunner* runner : runners) first = std::max(first, runner->next_frame());
  for (SceneRunner* runner : runners) runner->skip_to(first);
  Rounds out;
  for (std::uint32_t round = 0; round <= rounds; ++round) {
    for (std::size_t turn = 0; turn < runners.size(); ++turn) {
      const std::size_t who = (turn + round) % runners.size();
      const auto frame_ms = runners[who]->frame_ms();
      if (!frame_ms) return tl::unexpected(frame_ms.error());
      if (round > 0) out[who].push_back(*frame_ms);  // the first may have to catch up
    }
  }
  return out;
}

bool PairedRatio::within(double limit_ratio) const noexcept {
  return ratio <= std::max(limit_ratio, 1.0 + self_spread);
}

PairedRatio paired_ratio(std::span<const double> a_ms, std::span<const double> twin_ms,
                         std::span<const double> b_ms) {
  EMIT_CHECK_OP(a_ms.size(), >=, 3U);
  EMIT_CHECK_OP(twin_ms.size(), ==, a_ms.size());
  EMIT_CHECK_OP(b_ms.size(), ==, a_ms.size());
  const auto is_positive = [](double ms) { return ms > 0.0; };
  EMIT_CHECK(std::ranges::all_of(a_ms, is_positive));
  EMIT_CHECK(std::ranges::all_of(twin_ms, is_positive));
  EMIT_CHECK(std::ranges::all_of(b_ms, is_positive));
  PairedRatio out;
  out.pairs = a_ms.size();
  out.ratio = median(ratios(b_ms, a_ms));
  const std::vector<double> self = ratios(twin_ms, a_ms);
  out.self_ratio = median(self);
  const std::size_t third = self.size() / 3;
  for (std::size_t i = 0; i < 3; ++i) {
    const double part = median(std::span(self).subspan(i * third, third));
    out.self_spread = std::max(out.self_spread, std::abs(part - 1.0));
  }
  return out;
}

Result<VariantResult> compare_variants(const scene::ScenarioDesc& plain,
                                       std::span<const SceneVariant> variants,
                                       const VariantOptions& options) {
  const auto runner_of = [&](const scene::ScenarioDesc& scenario, std::uint32_t first_frame) {
    auto runner = SceneRunner::start(scenario, SceneRunner::kSettleFrames, options.gpu_index);
    if (runner) runner->skip_to(first_frame);
    return runner;
  };
  Progress progress(options.label, variants.size());
  // The plain scene and its twin are the same for all variants.
  std::vector<SceneRunner> still;
  for (int i = 0; i < 2; ++i) {
    auto runner =
        runner_of(plain, static_cast<std::uint32_t>(options.time_s * SceneRunner::kRateHz));
    if (!runner) return tl::unexpected(std::move(runner.error()));
    still.push_back(std::move(*runner));
  }
  VariantResult out;
  out.device = still[0].device();
  for (std::size_t i = 0; i < variants.size(); ++i) {
    progress.advance_to(i + 1);
    auto runner = runner_of(variants[i].scenario, still[0].next_frame());
    if (!runner) return tl::unexpected(std::move(runner.error()));
    const auto rounds = take_turns({&still[0], &still[1], &*runner}, options.pairs);
    if (!rounds) return tl::unexpected(rounds.error());
    const auto& [plain_ms, twin_ms, with_ms] = *rounds;
    if (i == 0) {
      VariantTimes& alone = out.times.emplace_back();
      for (const double ms : plain_ms) alone.frame_ms.add(ms);
      alone.pairs = {.pairs = plain_ms.size(), .ratio = 1.0, .self_ratio = 1.0};
      alone.warm_up_s = still[0].warm_up_s();
    }
    VariantTimes& times = out.times.emplace_back();
    for (const double ms : with_ms) times.frame_ms.add(ms);
    times.pairs = paired_ratio(plain_ms, twin_ms, with_ms);
    times.warm_up_s = runner->warm_up_s();
  }
  return out;
}

}  // namespace emit::tool
