// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>

#include "history/environment.hpp"
#include "history/pose_history.hpp"

namespace emit::renderer {

/// Sun, weather and poses of the entities, which a surface follows. Both must outlive the call that
/// gets them.
struct WorldInputs {
  const Environment& environment;
  std::span<const PoseHistory> entities;
};

}  // namespace emit::renderer
