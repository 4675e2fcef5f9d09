// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/latency_marker.hpp"

#include <algorithm>
#include <cmath>

namespace emit::tool {

void PictureMarker::Extent::add(std::span<const float> pixels) {
  if (least.empty()) {
    least.assign(pixels.begin(), pixels.end());
    most = least;
    return;
  }
  for (std::size_t i = 0; i < std::min(pixels.size(), least.size()); ++i) {
    least[i] = std::min(least[i], pixels[i]);
    most[i] = std::max(most[i], pixels[i]);
  }
}

void PictureMarker::learn(std::span<const float> pixels, bool on) {
  (on ? on_ : off_).add(pixels);
}

bool PictureMarker::ready() {
  telling_.clear();
  const std::size_t count = std::min(on_.least.size(), off_.least.size());
  // The widest gap sets the scale: pixels that change by a hundredth of it are shadow or noise.
  float widest = 0.0F;
  const auto gap = [&](std::size_t i) {
    return std::max(on_.least[i] - off_.most[i], off_.least[i] - on_.most[i]);
  };
  for (std::size_t i = 0; i < count; ++i) widest = std::max(widest, gap(i));
  if (!(widest > 0.0F)) return false;
  for (std::size_t i = 0; i < count; ++i) {
    if (gap(i) < 0.1F * widest) continue;
    const bool brighter = on_.least[i] > off_.most[i];
    const float low = brighter ? off_.most[i] : on_.most[i];
    const float high = brighter ? on_.least[i] : off_.least[i];
    telling_.push_back({i, 0.5F * (low + high), brighter, 0.5F * (high - low)});
  }
  return true;
}

std::optional<bool> PictureMarker::shows(std::span<const float> pixels) const {
  std::size_t on = 0;
  std::size_t off = 0;
  for (const Telling& each : telling_) {
    if (each.index >= pixels.size()) return std::nullopt;
    const float beyond = pixels[each.index] - each.middle;
    if (std::abs(beyond) < 0.5F * each.margin) continue;
    ((beyond > 0.0F) == each.on_is_brighter ? on : off) += 1;
  }
  // An image is trusted only if nine in ten pixels agree.
  const std::size_t most = std::max(on, off);
  if (2 * (on + off) < telling_.size() || 10 * most < 9 * (on + off)) return std::nullopt;
  return on > off;
}

}  // namespace emit::tool
