// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <optional>

#include "emit/physics/check.hpp"

namespace emit::server {

/// Poses closer together than this count as one: differences over less would be noise.
inline constexpr std::int64_t kLeastIntervalNs = 500'000;

/// Place of a body at an instant of simulation time.
struct TimedPoint {
  std::int64_t sim_time_ns = 0;
  glm::dvec3 position_m{0.0};              ///< world
  std::optional<glm::dvec3> velocity_m_s;  ///< world; absent: it is differenced
  bool teleport = false;                   ///< no motion led here
};

/// Motion of a point, predicted from its latest places with constant acceleration: from given
/// velocities and their difference, else by the parabola through three places.
///
/// Fixed size. RT-safe.
class PointCourse {
 public:
  struct State {
    glm::dvec3 position_m{0.0};
    glm::dvec3 velocity_m_s{0.0};
    glm::dvec3 acceleration_m_s2{0.0};
  };

  /// Adds a place. One that is older than the newest is dropped. One of the same instant says that
  /// time stands: the point stands there. One within kLeastIntervalNs replaces the newest.
  void push(const TimedPoint& point) noexcept;
  void clear() noexcept { count_ = 0; }
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  /// Returns the motion at an instant near the newest place.
  /// @pre !empty()
  [[nodiscard]] State at(std::int64_t sim_time_ns) const noexcept;

 private:
  std::array<TimedPoint, 3> points_;  ///< the oldest first
  std::size_t count_ = 0;
};

/// Slope at the end of the parabola through three values, and its curvature.
struct Parabola {
  glm::dvec3 slope{0.0};
  glm::dvec3 curvature{0.0};
};
/// Returns the parabola whose mean slopes over two spans, one behind the other, are given.
/// @pre both spans are positive
[[nodiscard]] Parabola parabola(const glm::dvec3& first_mean, double first_s,
                                const glm::dvec3& last_mean, double last_s) noexcept;

}  // namespace emit::server
