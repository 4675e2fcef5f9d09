// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double2.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float3.hpp>

#include "history/environment.hpp"

namespace emit::renderer {

/// Shade of broken clouds over an interval: the mean of the direct sun at a place by the mean over
/// the layer. Clouds that pass within the interval are averaged along their way, so that a long
/// interval takes no instant for all of its time. Without clouds it is 1 everywhere.
/// One thread may update it; const functions may then run on any thread. RT-safe.
class CloudShade {
 public:
  /// Places along the way of the clouds at most. Where they are farther apart than the texels of
  /// the field, each stands for the mean around it.
  static constexpr std::size_t kMostTaps = 256;

  /// Sets the interval. Instants at which the sun does not count are left out. `origin_world_m` is
  /// the origin of the places.
  void update(std::int64_t begin_ns, std::int64_t end_ns, const Environment& environment,
              const glm::dvec3& origin_world_m) noexcept;
  /// Takes the clouds away.
  void clear() noexcept { count_ = 0; }

  /// Returns whether clouds count in the interval.
  [[nodiscard]] bool any() const noexcept { return count_ != 0; }
  /// Returns the direct sun at a place by the mean over the layer, >= 0.
  [[nodiscard]] float by_mean(const glm::vec3& place_m) const noexcept;

 private:
  struct Tap {
    glm::dvec2 tile{0.0};            ///< where the sun's ray from the origin meets the layer
    glm::dvec2 tiles_per_m_up{0.0};  ///< change with the height of the place
    physics::CloudLight light;
  };
  const physics::CloudField* field_ = nullptr;
  std::size_t count_ = 0;
  double width_tiles_ = 0.0;
  double base_m_ = 0.0;  ///< of the layer, above the origin of the places
  std::array<Tap, kMostTaps> taps_;
};

}  // namespace emit::renderer
