// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>

#include "history/environment.hpp"
#include "history/part_history.hpp"
#include "history/pose_history.hpp"

namespace emit::renderer {

/// Sun, weather, poses of the entities and drives of their parts, which a surface follows. All must
/// outlive the call that gets them.
struct WorldInputs {
  const Environment& environment;
  std::span<const PoseHistory> entities;
  std::span<const PartHistory> parts{};  ///< ascending by entity
};

}  // namespace emit::renderer
