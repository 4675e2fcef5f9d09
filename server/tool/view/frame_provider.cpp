// SPDX-License-Identifier: Apache-2.0
#include "tool/view/frame_provider.hpp"

#include <utility>

namespace emit::tool::view {

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

void FrameSlot::end(std::string reason, bool failure) {
  const std::lock_guard lock(mutex_);
  end_ = ViewEnd{std::move(reason), failure};
}

std::optional<ViewEnd> FrameSlot::ended() {
  const std::lock_guard lock(mutex_);
  return end_;
}

}  // namespace emit::tool::view
