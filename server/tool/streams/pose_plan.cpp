// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/pose_plan.hpp"

#include <algorithm>
#include <glm/geometric.hpp>

namespace emit::tool {

PosePlan::PosePlan(std::uint64_t poses, std::optional<std::uint64_t> count)
    : poses_(poses), fixed_(count.has_value()) {
  left_ = std::clamp<std::uint64_t>(count.value_or(kFirstGuess), 1, poses);
}

std::optional<std::uint64_t> PosePlan::next() {
  if (left_ == 0) return std::nullopt;
  if (played_ == 0) {
    current_ = left_ == 1 ? poses_ - 1 : 0;
  } else {
    const std::uint64_t ahead = poses_ - 1 - current_;
    current_ += std::max<std::uint64_t>(1, (ahead + left_ / 2) / left_);
  }
  ++played_;
  --left_;
  return current_;
}

void PosePlan::limit_to(std::uint64_t left) {
  if (fixed_) return;
  const std::uint64_t ahead = poses_ - 1 - current_;
  const std::uint64_t least = played_ < kMinimum ? kMinimum - played_ : (ahead > 0 ? 1U : 0U);
  const std::uint64_t wanted = std::clamp(left, std::min(least, ahead), ahead);
  left_ = limited_ ? std::min(left_, wanted) : wanted;
  limited_ = true;
}

std::vector<Departure> find_departures(const scene::ScenarioDesc& scenario, double min_stay_s) {
  constexpr double kSamePlaceM = 0.01;
  std::vector<Departure> departures;
  for (const auto& object : scenario.objects) {
    if (object.entity_id == 0) continue;
    const auto& keys = object.trajectory;
    std::optional<Departure> newest;
    for (std::size_t i = 0; i < keys.size();) {
      std::size_t last = i;
      while (last + 1 < keys.size() && keys[last + 1].on == keys[i].on &&
             glm::distance(keys[last + 1].pose.position_world_m, keys[i].pose.position_world_m) <
                 kSamePlaceM) {
        ++last;
      }
      const double stay_s =
          1e-9 * static_cast<double>(keys[last].sim_time_ns - keys[i].sim_time_ns);
      if (keys[i].on && last + 1 < keys.size() && stay_s >= min_stay_s) {
        newest = Departure{object.name, keys[i].sim_time_ns, keys[last].sim_time_ns};
      }
      i = last + 1;
    }
    if (newest) departures.push_back(*newest);
  }
  return departures;
}

}  // namespace emit::tool
