// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace emit::tool {

/// Tells from pixels alone whether something that was switched shows: learns from pictures of both
/// states which pixels tell, then judges pictures. One thread, setup only.
class PictureMarker {
 public:
  /// A picture known to show the state; all of one size.
  void learn(std::span<const float> pixels, bool on);
  /// Ends learning. False: no pixel tells the states apart in all pictures learnt.
  [[nodiscard]] bool ready();
  /// Pixels that tell.
  [[nodiscard]] std::size_t pixels() const noexcept { return telling_.size(); }
  /// Empty: half of the telling pixels or more are closer to neither, as in a partial frame.
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
