// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/matrix_double3x3.hpp>
#include <glm/ext/vector_double3.hpp>
#include <optional>

#include "emit/physics/units.hpp"

/// Places on and above the WGS-84 ellipsoid (NIMA TR8350.2, third edition, chapter 4). The
/// earth-centred, earth-fixed frame (ECEF) has x towards the prime meridian, z towards the north
/// pole. Any thread. RT-safe.
namespace emit::physics {

/// A geodetic place, WGS-84.
struct GeoPlace {
  Radians latitude;   ///< north positive
  Radians longitude;  ///< east positive
  Metres height;      ///< above the ellipsoid
};

/// Returns the ECEF position of a place, m. The formula is exact.
[[nodiscard]] glm::dvec3 ecef_m(const GeoPlace& place) noexcept;

/// Returns the place of an ECEF position. The latitude is found by Bowring's iteration (Survey
/// Review 28, 1985) until it stands still, so that ecef_m() of the result gives the position back.
/// The error is below 1e-12 rad and 1e-8 m from 10 km below the ellipsoid to 100 000 km above it,
/// poles included. The longitude is in [-pi, pi], and 0 on the axis.
[[nodiscard]] GeoPlace place_at_ecef(const glm::dvec3& position_ecef_m) noexcept;

/// Returns the rotation from the east-north-up frame at a place to ECEF. Its columns are east,
/// north and up.
[[nodiscard]] glm::dmat3 ecef_from_enu(const GeoPlace& place) noexcept;

/// A point of the ellipsoid with its normal. A point at height h has position + h normal.
struct EllipsoidPoint {
  glm::dvec3 position_ecef_m;
  glm::dvec3 up_ecef;  ///< unit length
};

/// The plane of the horizon at a place of the ellipsoid. A point of the ellipsoid is shown where
/// its east and north coordinates in the frame of the place are: the ellipsoidal orthographic
/// projection, method 9840 of EPSG guidance note 7-2. Scenes that span the frame of a place draw
/// their maps in it, because its inverse is closed.
class HorizonPlane {
 public:
  /// The height of the place does not count.
  explicit HorizonPlane(const GeoPlace& place) noexcept;
  /// Returns the point of the near side of the ellipsoid with these coordinates. It is exact.
  /// Empty: no point of the ellipsoid has them.
  [[nodiscard]] std::optional<EllipsoidPoint> ellipsoid_point(Metres east,
                                                              Metres north) const noexcept;

 private:
  glm::dmat3 ecef_from_enu_;
  glm::dvec3 origin_ecef_m_;
};

}  // namespace emit::physics
