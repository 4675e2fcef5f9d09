// SPDX-License-Identifier: Apache-2.0
#include "statue_shape.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/ext/vector_double2.hpp>
#include <glm/geometric.hpp>

namespace emit::scenegen {
namespace {

using glm::dvec2;
using glm::dvec3;

/// Returns a smooth minimum with a fillet of about k metres.
double blend(double a, double b, double k) {
  const double h = std::max(k - std::abs(a - b), 0.0) / k;
  return std::min(a, b) - 0.25 * h * h * k;
}

/// Returns the distance to a limb: a capsule whose radius changes from ra at a to rb at b.
double limb(const dvec3& p, const dvec3& a, const dvec3& b, double ra, double rb) {
  const dvec3 along = b - a;
  const double t = std::clamp(glm::dot(p - a, along) / glm::dot(along, along), 0.0, 1.0);
  return glm::length(p - a - t * along) - glm::mix(ra, rb, t);
}

/// Returns the first-order distance to an ellipsoid.
double ellipsoid(const dvec3& p, const dvec3& centre, const dvec3& radii) {
  const dvec3 q = (p - centre) / radii;
  const double k0 = glm::length(q);
  const double k1 = glm::length(q / radii);
  return k1 < 1e-9 ? -std::min({radii.x, radii.y, radii.z}) : k0 * (k0 - 1.0) / k1;
}

/// Returns 1 inside [lo, hi], falling to 0 over `soft` on either side.
double window(double value, double lo, double hi, double soft) {
  return std::clamp((value - lo) / soft + 1.0, 0.0, 1.0) *
         std::clamp((hi - value) / soft + 1.0, 0.0, 1.0);
}

class SeatedFigure final : public SignedDistance {
 public:
  [[nodiscard]] double at(const dvec3& p) const noexcept override {
    double d = pedestal(p);
    // The bounding sphere is near enough far from the figure.
    const double sphere = glm::length(p - dvec3(0.0, -0.1, 1.45)) - 1.55;
    if (sphere > 0.5) {
      return std::min(d, sphere);
    }
    d = blend(d, clothed(p), 0.05);
    d = blend(d, bare(p), 0.03);
    return d;
  }

 private:
  static double pedestal(const dvec3& p) {
    const double radius = glm::length(dvec2(p));
    const double angle = std::atan2(p.y, p.x);
    const double petals = 0.05 * std::abs(std::sin(10.0 * angle)) * window(p.z, 0.10, 0.30, 0.08);
    const double rounding = 0.06;
    const dvec2 side(radius - (1.12 + petals - rounding), std::abs(p.z - 0.16) - (0.18 - rounding));
    return glm::length(glm::max(side, dvec2(0.0))) + std::min(std::max(side.x, side.y), 0.0) -
           rounding;
  }

  /// Returns the distance to trunk, shoulders, upper arms and legs, under a robe whose folds shade
  /// each other.
  static double clothed(const dvec3& p) {
    double d = ellipsoid(p, {0.0, 0.10, 0.62}, {0.56, 0.44, 0.34});
    d = blend(d, limb(p, {0.0, 0.14, 0.75}, {0.0, 0.10, 1.45}, 0.36, 0.37), 0.20);
    d = blend(d, limb(p, {-0.40, 0.10, 1.64}, {0.40, 0.10, 1.64}, 0.20, 0.20), 0.15);
    // The knees point outwards, the shins cross in front, the right one on top.
    d = blend(d, limb(p, {-0.30, 0.05, 0.58}, {-0.86, -0.36, 0.52}, 0.27, 0.20), 0.10);
    d = blend(d, limb(p, {0.30, 0.05, 0.58}, {0.86, -0.36, 0.52}, 0.27, 0.20), 0.10);
    d = blend(d, limb(p, {-0.86, -0.36, 0.50}, {0.22, -0.66, 0.46}, 0.18, 0.13), 0.06);
    d = blend(d, limb(p, {0.86, -0.36, 0.52}, {-0.18, -0.60, 0.66}, 0.18, 0.12), 0.05);
    // The sleeves of the upper arms hang wide.
    d = blend(d, limb(p, {-0.55, 0.08, 1.60}, {-0.74, -0.02, 1.12}, 0.16, 0.17), 0.08);
    d = blend(d, limb(p, {0.55, 0.08, 1.60}, {0.80, -0.12, 1.20}, 0.16, 0.17), 0.08);
    const double near = window(d, -0.1, 0.1, 0.3);
    if (near > 0.0) {
      const double sway = 0.35 * std::sin(2.5 * p.x + 1.0) + 0.5 * std::abs(p.x);
      const double chest = window(p.z, 0.80, 1.70, 0.10);
      const double lap = window(p.z, 0.30, 0.75, 0.08);
      const double folds = 0.016 * chest * std::sin(34.0 * (p.z + sway)) +
                           0.011 * lap * std::sin(46.0 * (p.y + 0.4 * p.x * p.x) + 4.0 * p.z);
      d += near * folds;
    }
    // A sash runs from the left shoulder to the right hip.
    const double band = std::abs(glm::dot(p - dvec3(0.0, 0.1, 1.2), dvec3(0.64, 0.0, 0.77))) - 0.09;
    const double trunk = limb(p, {0.0, 0.14, 0.75}, {0.0, 0.10, 1.45}, 0.40, 0.42);
    return blend(d, std::max(trunk, band), 0.03);
  }

  static double bare(const dvec3& p) {
    double d = limb(p, {0.0, 0.07, 1.72}, {0.0, 0.03, 2.02}, 0.14, 0.12);
    d = blend(d, head(p), 0.05);
    // The left forearm and hand lie in the lap.
    d = std::min(d, limb(p, {-0.74, -0.04, 1.10}, {-0.22, -0.46, 0.88}, 0.11, 0.08));
    d = blend(d, ellipsoid(p, {-0.06, -0.50, 0.86}, {0.16, 0.11, 0.05}), 0.04);
    // The right forearm is raised, with the palm forward.
    double right = limb(p, {0.80, -0.14, 1.18}, {0.66, -0.52, 1.56}, 0.11, 0.075);
    right = blend(right, ellipsoid(p, {0.65, -0.56, 1.68}, {0.09, 0.045, 0.11}), 0.04);
    for (int finger = 0; finger < 4; ++finger) {
      const double x = 0.585 + 0.043 * finger;
      const double tip = 1.89 - 0.02 * std::abs(finger - 1.5);
      right = blend(right, limb(p, {x, -0.56, 1.74}, {x, -0.575, tip}, 0.021, 0.016), 0.012);
    }
    right = blend(right, limb(p, {0.58, -0.57, 1.66}, {0.53, -0.60, 1.78}, 0.024, 0.018), 0.015);
    return std::min(d, right);
  }

  static double head(const dvec3& p) {
    double d = ellipsoid(p, {0.0, 0.0, 2.20}, {0.22, 0.25, 0.29});
    d = blend(d, limb(p, {0.0, -0.24, 2.24}, {0.0, -0.275, 2.15}, 0.018, 0.032), 0.02);  // nose
    for (const double side : {-1.0, 1.0}) {
      d = blend(d, limb(p, {side * 0.225, 0.02, 2.26}, {side * 0.235, 0.02, 2.07}, 0.04, 0.03),
                0.02);
      // The eye sockets are a smooth maximum with the outside of a sphere.
      d = -blend(-d, glm::length(p - dvec3(side * 0.085, -0.245, 2.245)) - 0.045, 0.03);
    }
    d = -blend(-d, limb(p, {-0.05, -0.245, 2.06}, {0.05, -0.245, 2.06}, 0.012, 0.012),
               0.02);  // mouth
    const double hair = blend(ellipsoid(p, {0.0, 0.04, 2.27}, {0.235, 0.25, 0.25}),
                              glm::length(p - dvec3(0.0, 0.05, 2.53)) - 0.12, 0.06);
    const double curls = 0.012 * std::sin(70.0 * p.x) * std::sin(70.0 * p.y) * std::sin(70.0 * p.z);
    const double hairline = p.y < -0.02 ? 2.33 + 0.35 * (-0.02 - p.y) : 2.12;
    return blend(d, std::max(hair + curls, hairline - p.z), 0.012);
  }
};

}  // namespace

StatueShape statue_shape() {
  return {std::make_unique<SeatedFigure>(), {-1.4, -1.4, -0.15}, {1.4, 1.4, 2.85}, 2.65};
}

}  // namespace emit::scenegen
