// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/geodesy.hpp"

#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/constants.hpp"

namespace emit::physics {
namespace {

constexpr double kEccentricity2 = kWgs84Flattening * (2.0 - kWgs84Flattening);
constexpr double kSemiMinorM = kWgs84SemiMajorM * (1.0 - kWgs84Flattening);
constexpr double kSecondEccentricity2 =
    kEccentricity2 / ((1.0 - kWgs84Flattening) * (1.0 - kWgs84Flattening));
// Two steps reach double precision near the surface, four at any height that is tested.
constexpr int kBowringSteps = 6;

}  // namespace

glm::dvec3 ecef_m(const GeoPlace& place) noexcept {
  const double slat = std::sin(place.latitude.value());
  const double clat = std::cos(place.latitude.value());
  const double slon = std::sin(place.longitude.value());
  const double clon = std::cos(place.longitude.value());
  const double normal_m = kWgs84SemiMajorM / std::sqrt(1.0 - kEccentricity2 * slat * slat);
  const double height_m = place.height.value();
  return {(normal_m + height_m) * clat * clon, (normal_m + height_m) * clat * slon,
          (normal_m * (1.0 - kEccentricity2) + height_m) * slat};
}

GeoPlace place_at_ecef(const glm::dvec3& position_ecef_m) noexcept {
  const double axis_distance_m = std::hypot(position_ecef_m.x, position_ecef_m.y);
  const double z_m = position_ecef_m.z;
  // The reduced latitude starts as that of the geocentric direction.
  double reduced_rad = std::atan2(kWgs84SemiMajorM * z_m, kSemiMinorM * axis_distance_m);
  double latitude_rad = 0.0;
  for (int step = 0; step < kBowringSteps; ++step) {
    const double s = std::sin(reduced_rad);
    const double c = std::cos(reduced_rad);
    latitude_rad = std::atan2(z_m + kSecondEccentricity2 * kSemiMinorM * s * s * s,
                              axis_distance_m - kEccentricity2 * kWgs84SemiMajorM * c * c * c);
    reduced_rad =
        std::atan2((1.0 - kWgs84Flattening) * std::sin(latitude_rad), std::cos(latitude_rad));
  }
  const double slat = std::sin(latitude_rad);
  const double clat = std::cos(latitude_rad);
  // This form of the height has no quotient, so that it holds at the poles and at the equator.
  const double height_m = axis_distance_m * clat + z_m * slat -
                          kWgs84SemiMajorM * std::sqrt(1.0 - kEccentricity2 * slat * slat);
  const double longitude_rad =
      axis_distance_m > 0.0 ? std::atan2(position_ecef_m.y, position_ecef_m.x) : 0.0;
  return {Radians(latitude_rad), Radians(longitude_rad), Metres(height_m)};
}

glm::dmat3 ecef_from_enu(const GeoPlace& place) noexcept {
  const double slat = std::sin(place.latitude.value());
  const double clat = std::cos(place.latitude.value());
  const double slon = std::sin(place.longitude.value());
  const double clon = std::cos(place.longitude.value());
  return {glm::dvec3(-slon, clon, 0.0), glm::dvec3(-slat * clon, -slat * slon, clat),
          glm::dvec3(clat * clon, clat * slon, slat)};
}

HorizonPlane::HorizonPlane(const GeoPlace& place) noexcept
    : ecef_from_enu_(ecef_from_enu(place)),
      origin_ecef_m_(ecef_m({place.latitude, place.longitude, Metres(0.0)})) {}

std::optional<EllipsoidPoint> HorizonPlane::ellipsoid_point(Metres east,
                                                            Metres north) const noexcept {
  constexpr glm::dvec3 kInverseAxes2(1.0 / (kWgs84SemiMajorM * kWgs84SemiMajorM),
                                     1.0 / (kWgs84SemiMajorM * kWgs84SemiMajorM),
                                     1.0 / (kSemiMinorM * kSemiMinorM));
  const glm::dvec3 offset = ecef_from_enu_[0] * east.value() + ecef_from_enu_[1] * north.value();
  const glm::dvec3& up = ecef_from_enu_[2];
  // The vertical line origin + offset + u up meets the ellipsoid where a u^2 + 2 b u + c = 0. The
  // origin lies on the ellipsoid, and its normal is up, which leaves only the square of the offset
  // in c: no large numbers cancel.
  const double a = glm::dot(up, kInverseAxes2 * up);
  const double b = glm::dot(up, kInverseAxes2 * (origin_ecef_m_ + offset));
  const double c = glm::dot(offset, kInverseAxes2 * offset);
  const double root2 = b * b - a * c;
  if (!(root2 >= 0.0)) return std::nullopt;
  const double u_m = -c / (b + std::sqrt(root2));
  const glm::dvec3 position = origin_ecef_m_ + offset + u_m * up;
  return EllipsoidPoint{position, glm::normalize(kInverseAxes2 * position)};
}

}  // namespace emit::physics
