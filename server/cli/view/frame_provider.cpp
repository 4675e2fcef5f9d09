// SPDX-License-Identifier: Apache-2.0
#include "view/frame_provider.hpp"

#include <utility>

namespace emit::cli::view {

void FrameSlot::put(ViewFrame& frame) {
  const std::lock_guard lock(mutex_);
  frame.serial = ++serial_;
  std::swap(slot_, frame);
}

bool FrameSlot::take(ViewFrame& frame) {
  const std::lock_guard lock(mutex_);
  if (slot_.serial <= frame.serial) return false;
  std::swap(slot_, frame);
  return true;
}

void FrameSlot::end(std::string reason) {
  const std::lock_guard lock(mutex_);
  ended_ = true;
  reason_ = std::move(reason);
}

bool FrameSlot::ended(std::string& reason) {
  const std::lock_guard lock(mutex_);
  if (ended_) reason = reason_;
  return ended_;
}

}  // namespace emit::cli::view
