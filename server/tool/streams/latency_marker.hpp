// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace emit::tool {

/// Detects from pixels alone whether a switched entity shows. It learns from images of both states
/// which pixels differ, then judges images. Thread: one owner. Setup only.
class PictureMarker {
 public:
  /// Learns from an image known to show the state. All images have one size.
  void learn(std::span<const float> pixels, bool on);
  /// Ends learning. It returns false when no pixel separates the states in all images.
  [[nodiscard]] bool ready();
  /// Returns the number of pixels that separate the states.
  [[nodiscard]] std::size_t pixels() const noexcept { return telling_.size(); }
  /// Returns the state of an image. The result is empty when at least half of those pixels are
  /// close to neither state, as in a partial frame.
  [[nodiscard]] std::optional<bool> shows(std::span<const float> pixels) const;

 private:
  struct Extent {
    std::vector<float> least;
    std::vector<float> most;
    void add(std::span<const float> pixels);
  };
  struct Telling {
    std::size_t index = 0;
    float middle = 0.0F;
    bool on_is_brighter = false;
    float margin = 0.0F;  ///< half the gap between the states
  };
  Extent on_;
  Extent off_;
  std::vector<Telling> telling_;
};

}  // namespace emit::tool
