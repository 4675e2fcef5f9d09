// SPDX-License-Identifier: Apache-2.0
#include "tool/support/renderer_thread.hpp"

#include <cmath>
#include <utility>

#include "tool/support/interrupt.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

using Clock = std::chrono::steady_clock;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

}  // namespace

RendererThread::RendererThread() : thread_([this] { loop(); }) {}

RendererThread::~RendererThread() {
  call([this] { renderer_.reset(); });
  {
    const std::scoped_lock lock(mutex_);
    ends_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void RendererThread::loop() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return job_ != nullptr || ends_; });
    if (ends_) return;
    (*job_)();
    job_ = nullptr;
    changed_.notify_all();
  }
}

void RendererThread::call(const std::function<void()>& job) {
  std::unique_lock lock(mutex_);
  job_ = &job;
  changed_.notify_all();
  changed_.wait(lock, [this] { return job_ == nullptr; });
}

Result<std::unique_ptr<RendererThread>> RendererThread::create(const scene::ScenarioDesc& scenario,
                                                               int gpu_index,
                                                               renderer::Ladder ladder,
                                                               bool temperature) {
  std::unique_ptr<RendererThread> thread(new RendererThread());
  Result<void> made;
  thread->call([&] {
    renderer::OutputOptions output;
    output.slots = 2;
    output.ladder = ladder;
    output.temperature = temperature;
    auto created = renderer::Renderer::create(scenario, {gpu_index, false}, output);
    if (created) {
      thread->renderer_ = std::move(*created);
    } else {
      made = tl::unexpected(std::move(created.error()));
    }
  });
  if (!made) return tl::unexpected(std::move(made.error()));
  return thread;
}

Result<double> RendererThread::warm_up(const renderer::FrameRequest& first) {
  Result<void> ready;
  const auto start = Clock::now();
  call([&] {
    Progress progress("warm-up", kShareParts);
    ready = renderer_->warm_up(first, share_of(progress));
  });
  if (InterruptGuard::interrupted()) return make_error(ErrorCode::io, "interrupted");
  if (!ready) return tl::unexpected(std::move(ready.error()));
  return std::chrono::duration<double>(Clock::now() - start).count();
}

Result<TimedFrame> RendererThread::timed(const std::function<int(Clock::time_point)>& submit,
                                         std::vector<float>* temperature_k) {
  if (InterruptGuard::interrupted()) return make_error(ErrorCode::io, "interrupted");
  TimedFrame out;
  int slot = -1;
  bool failed = false;
  call([&] {
    const auto start = Clock::now();
    slot = submit(start);
    if (slot < 0) return;
    const auto index = static_cast<renderer::SlotIndex>(slot);
    const renderer::FrameView& view = renderer_->collect(index);
    out.frame_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    out.coarse = view.stats.coarse.any();
    out.quality_level = view.quality_level;
    failed = view.device_failed;
    if (temperature_k != nullptr) {
      temperature_k->assign(view.temperature_k.begin(), view.temperature_k.end());
    }
    renderer_->release(index);
  });
  if (slot < 0) return make_error(ErrorCode::internal, "the renderer has no free slot");
  if (failed) return make_error(ErrorCode::gpu, "the device reported an error");
  return out;
}

Result<TimedFrame> RendererThread::render(const renderer::FrameRequest& request,
                                          std::vector<float>* temperature_k) {
  return timed([&](Clock::time_point) { return renderer_->submit(request); }, temperature_k);
}

void RendererThread::apply_entities(std::int64_t sim_time_ns,
                                    std::span<const renderer::EntityUpdate> updates) {
  call([&] { renderer_->apply_entities(sim_time_ns, updates); });
}

void RendererThread::apply_weather(const scene::WeatherSample& sample) {
  call([&] { renderer_->apply_weather(sample); });
}

Result<TimedFrame> RendererThread::render_within(renderer::FrameRequest request, double budget_ms) {
  double level_ms = 0.0;
  const auto frame = timed([&](Clock::time_point start) {
    const auto quality_levels = renderer_->expected_levels(request);
    const std::chrono::duration<double, std::milli> spent = Clock::now() - start;
    const std::size_t quality_level =
        policy_.choose(quality_levels, std::llround(1e6 * (budget_ms - spent.count())));
    level_ms = quality_levels[quality_level].frame_ms;
    request.quality_level = static_cast<std::uint8_t>(quality_level);
    return renderer_->submit(request);
  });
  if (frame) policy_.finished(std::llround(1e6 * frame->frame_ms), level_ms);
  return frame;
}

}  // namespace emit::tool
