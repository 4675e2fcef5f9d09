// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

namespace emit::reference {

/// The sun's disc as seen from a point.
struct SunDisc {
  glm::dvec3 to_centre{0.0, 0.0, 1.0};  ///< unit
  double semi_angle_rad = 0.0;          ///< below pi/4
  double limb_darkening_frac = 0.0;     ///< linear: I = 1 - u (1 - mu); 0: uniform
};

struct DiscShare {
  double visible_frac = 1.0;
  double error_frac = 0.0;  ///< 0: integrated between all its breaks
};

/// Visible share of the disc behind triangles whose corners are given relative to the point.
/// Everything is projected from the point onto the plane across the disc's axis, where great
/// circles are straight. The disc is cut into parallel chords; on each the covered intervals are
/// exact, and so is the integral over the solid angle (with limb darkening: 16-point Gauss). Across
/// the chords 16-point Gauss runs between all breaks: corners, outlines crossing each other and
/// outlines meeting the rim; this leaves about 1e-12. With more than kMaxDiscOutlines outlines
/// within the disc the breaks are given up for evenly spaced chords, and the error is estimated by
/// halving their number.
/// `normal`: outward normal of the point's own surface, whose tangent plane covers what lies below
/// it; zero: none. Any thread; allocates.
inline constexpr std::size_t kMaxDiscOutlines = 192;
[[nodiscard]] DiscShare visible_disc_share(std::span<const std::array<glm::dvec3, 3>> triangles,
                                           const glm::dvec3& normal, const SunDisc& disc);

/// Brightness of the disc at an angle from its centre, relative to that of the centre.
/// @pre 0 <= angle_rad <= disc.semi_angle_rad
[[nodiscard]] double disc_brightness_frac(const SunDisc& disc, double angle_rad) noexcept;

}  // namespace emit::reference
