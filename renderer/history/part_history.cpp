// SPDX-License-Identifier: Apache-2.0
#include "history/part_history.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"

namespace emit::renderer {

using scene::PartCommand;

PartHistory::PartHistory(const scene::PartDesc& part, std::size_t entity, std::uint32_t material)
    : id_(part.id), curve_(part.curve), entity_(entity), material_(material) {
  steps_.reserve(part.commands.size() + kMaxCommands);
  events_ns_.reserve(steps_.capacity());
  for (const scene::TimedPartCommand& key : part.commands) push(key.sim_time_ns, key.command);
  scripted_ = steps_;
}

void PartHistory::push(std::int64_t from_ns, const PartCommand& command) noexcept {
  const double begin_k = steps_.empty() ? curve_.cold_k : behind_k(steps_.back(), from_ns);
  steps_.push_back({from_ns, command, begin_k});
  events_ns_.push_back(from_ns);
}

bool PartHistory::append(std::int64_t sim_time_ns, const PartCommand& command) noexcept {
  if (live_ && sim_time_ns < newest_live_ns_) return false;
  // Let the host replace what the scenario has planned from here on.
  const auto at_or_later = [sim_time_ns](const Step& step) { return step.from_ns >= sim_time_ns; };
  if (!live_ || (!steps_.empty() && steps_.back().from_ns == sim_time_ns)) {
    std::erase_if(steps_, at_or_later);
    events_ns_.resize(steps_.size());
  }
  live_ = true;
  newest_live_ns_ = sim_time_ns;
  if (!steps_.empty() && steps_.back().command == command) return true;
  ++revision_;
  if (steps_.size() == steps_.capacity()) {
    steps_.erase(steps_.begin());
    events_ns_.erase(events_ns_.begin());
  }
  push(sim_time_ns, command);
  return true;
}

void PartHistory::reset() noexcept {
  if (live_) ++revision_;
  live_ = false;
  steps_.assign(scripted_.begin(), scripted_.end());
  events_ns_.clear();
  for (const Step& step : steps_) events_ns_.push_back(step.from_ns);
}

double PartHistory::target_k(const Step& step) const noexcept {
  switch (step.command.kind) {
    case PartCommand::Kind::temperature:
      return step.command.value;
    case PartCommand::Kind::throttle:
      return curve_.idle_k + step.command.value * (curve_.full_k - curve_.idle_k);
    case PartCommand::Kind::power:
    case PartCommand::Kind::off:
      break;
  }
  return curve_.cold_k;
}

double PartHistory::behind_k(const Step& step, std::int64_t at_ns) const noexcept {
  const double target_k = this->target_k(step);
  if (step.command.kind == PartCommand::Kind::temperature) return target_k;
  const double tau_s = target_k > step.begin_k ? curve_.up_s : curve_.down_s;
  const double gone_s = static_cast<double>(std::max<std::int64_t>(0, at_ns - step.from_ns)) * 1e-9;
  const double left = tau_s > 0.0 ? std::exp(-gone_s / tau_s) : 0.0;
  return target_k + (step.begin_k - target_k) * left;
}

std::size_t PartHistory::first_after(std::int64_t at_ns) const noexcept {
  return static_cast<std::size_t>(std::ranges::upper_bound(events_ns_, at_ns) - events_ns_.begin());
}

PartHeat PartHistory::at(std::int64_t sim_time_ns) const noexcept {
  const std::size_t after = first_after(sim_time_ns);
  if (after == 0) return {};
  const Step& step = steps_[after - 1];
  switch (step.command.kind) {
    case PartCommand::Kind::power:
      return {step.command.value, 0.0, 0.0};
    case PartCommand::Kind::off:
      // Let a part with a curve cool by it, because the engine behind it does. Others are let go.
      if (!curve_.given) return {};
      break;
    case PartCommand::Kind::temperature:
    case PartCommand::Kind::throttle:
      break;
  }
  return {0.0, kHeldContactW_m2K, behind_k(step, sim_time_ns)};
}

std::optional<double> PartHistory::throttle_frac(std::int64_t sim_time_ns) const noexcept {
  const std::size_t after = first_after(sim_time_ns);
  if (after == 0 || !curve_.given) return std::nullopt;
  const Step& step = steps_[after - 1];
  if (step.command.kind != PartCommand::Kind::throttle) return std::nullopt;
  const double span_k = curve_.full_k - curve_.idle_k;
  if (span_k == 0.0) return step.command.value;
  return std::clamp((behind_k(step, sim_time_ns) - curve_.idle_k) / span_k, 0.0, 1.0);
}

PartHeatSpan PartHistory::over(std::int64_t begin_ns, std::int64_t end_ns) const noexcept {
  EMIT_DCHECK_OP(begin_ns, <, end_ns);
  PartHeatSpan out{at(begin_ns - 1), at(end_ns - 1)};
  // Take the mean of the power over the steps of the interval.
  double energy_ns = 0.0;
  for (std::size_t i = first_after(end_ns - 1); i-- > 0;) {
    const std::int64_t from_ns = std::max(begin_ns, steps_[i].from_ns);
    const std::int64_t to_ns =
        i + 1 < steps_.size() ? std::min(end_ns, steps_[i + 1].from_ns) : end_ns;
    if (steps_[i].command.kind == PartCommand::Kind::power) {
      energy_ns += steps_[i].command.value * static_cast<double>(to_ns - from_ns);
    }
    if (from_ns == begin_ns) break;
  }
  out.begin.power_w_m2 = energy_ns / static_cast<double>(end_ns - begin_ns);
  out.end.power_w_m2 = out.begin.power_w_m2;
  return out;
}

bool PartHistory::changes(std::int64_t begin_ns, std::int64_t end_ns) const noexcept {
  const std::size_t after = first_after(begin_ns);
  if (after < steps_.size() && steps_[after].from_ns <= end_ns) return true;
  if (after == 0 || at(begin_ns).contact_w_m2_k == 0.0) return false;
  const Step& step = steps_[after - 1];
  return std::abs(behind_k(step, begin_ns) - target_k(step)) > kSettledK;
}

}  // namespace emit::renderer
