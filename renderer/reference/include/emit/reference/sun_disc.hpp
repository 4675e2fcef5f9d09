// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

namespace emit::reference {

/// Disc of the sun as a point sees it.
struct SunDisc {
  glm::dvec3 to_centre{0.0, 0.0, 1.0};  ///< unit vector to the centre of the disc
  double semi_angle_rad = 0.0;          ///< radius of the disc, below pi/4
  double limb_darkening_frac = 0.0;     ///< u of the linear law I = 1 - u (1 - mu); 0 is uniform
};

/// Visible share of a disc, with an estimate of its error.
struct DiscShare {
  double visible_frac = 1.0;
  double error_frac = 0.0;  ///< 0 if the share was integrated between all its breaks
};

/// Largest number of outlines within the disc for which visible_disc_share() integrates between all
/// breaks.
inline constexpr std::size_t kMaxDiscOutlines = 192;
/// Returns the visible share of the disc behind triangles, whose corners are given relative to the
/// point.
/// The point projects everything onto the plane across the disc's axis, in which great circles are
/// straight. The disc is cut into parallel chords. The covered intervals of a chord are exact, and
/// so is the integral over the solid angle (with limb darkening: 16-point Gauss). Across the chords
/// 16-point Gauss runs between all breaks, which are the corners, the crossings of two outlines and
/// the points at which outlines meet the rim; this leaves an error of about 1e-12. With more than
/// kMaxDiscOutlines outlines within the disc, evenly spaced chords replace the breaks, and the
/// error is estimated by halving their number.
/// `normal` is the outward normal of the point's own surface, whose tangent plane covers what lies
/// below it; a zero vector stands for no surface. Any thread. Allocates.
[[nodiscard]] DiscShare visible_disc_share(std::span<const std::array<glm::dvec3, 3>> triangles,
                                           const glm::dvec3& normal, const SunDisc& disc);

/// Returns the brightness of the disc at an angle from its centre, relative to that of the centre.
/// @pre 0 <= angle_rad <= disc.semi_angle_rad.
[[nodiscard]] double disc_brightness_frac(const SunDisc& disc, double angle_rad) noexcept;

}  // namespace emit::reference
