// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/solid_lateral.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "emit/physics/constants.hpp"
#include "emit/reference/solid_grid.hpp"
#include "emit/reference/solid_solver.hpp"
#include "emit/threads/parallel.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

// Lengths of the grid in diffusion lengths sqrt(a t) of the whole run. kReach is how far the solid
// extends beyond everything of interest: exp(-5^2/4) of a unit step arrives there. kFinest is the
// cell near edges and the face.
constexpr double kReach = 5.0;
constexpr double kFinest = 0.06;
constexpr double kGrowth = 0.16;
constexpr double kGrowthRectangle = 0.22;  // coarser, because the cells of three axes multiply
constexpr double kCoarsest = 1.0;
/// Number of steps at refine = 1. They end at t (n/N)^3, because the face starts as the root of
/// time.
constexpr double kSteps = 20.0;

/// Returns the share of [low, high] inside [from, to].
double covered(double low, double high, double from, double to) {
  return std::clamp((std::min(high, to) - std::max(low, from)) / (high - low), 0.0, 1.0);
}

/// Checks the ranges of a case.
bool valid(const LateralCase& c) {
  const bool patch = (c.patch != LitPatch::strip && c.patch != LitPatch::rectangle) ||
                     (c.half_x_m > 0.0 && (c.patch == LitPatch::strip || c.half_y_m > 0.0));
  return c.conductivity_w_m_k > 0.0 && c.heat_capacity_j_m3_k > 0.0 && c.time_s > 0.0 &&
         c.depth_m >= 0.0 && patch && std::isfinite(c.flux_w_m2) && std::isfinite(c.x_m) &&
         std::isfinite(c.y_m) && std::isfinite(c.speed_m_s) && std::isfinite(c.depth_m) &&
         std::isfinite(c.time_s);
}

/// Grid, drive and run of one case.
class LateralModel {
 public:
  LateralModel(const LateralCase& c, double refine)
      : c_(c),
        refine_(refine),
        length_m_(std::sqrt(c.conductivity_w_m_k / c.heat_capacity_j_m3_k * c.time_s)) {}

  Result<double> run() const {
    // Build the grid of one material.
    SolidGrid grid;
    grid.materials = {{c_.conductivity_w_m_k, c_.heat_capacity_j_m3_k}};
    grid.lines_m = {x_lines(), y_lines(), z_lines()};
    grid.cells.assign(grid.count(0) * grid.count(1) * grid.count(2), 0);
    // Scale the tolerance to the rise under a fully lit face, 2 q sqrt(t / (pi k rho c)).
    const double full_k = 2.0 * std::abs(c_.flux_w_m2) / c_.conductivity_w_m_k *
                          std::sqrt(length_m_ * length_m_ / physics::kPi);
    SolidOptions options;
    options.tolerance_k = std::max(1e-4 * full_k, 1e-12);
    auto solver = SolidSolver::create(
        grid,
        [](const SolidFace& face) {
          const bool lit = face.axis == 2 && face.sign < 0;
          return FaceCondition{lit ? FaceKind::exposed : FaceKind::adiabatic, 0.0, 0.0};
        },
        options);
    if (!solver) return tl::unexpected(std::move(solver.error()));
    const auto faces = solver->faces();
    // Light every face by the share of it that lies in the patch.
    const DriveFunction drive = [&](double time_s, std::span<const double>, const FaceDrive& out) {
      for (std::size_t f = 0; f < faces.size(); ++f) {
        out.absorbed_w_m2[f] = c_.flux_w_m2 * lit_frac(faces[f], time_s);
        out.film_w_m2_k[f] = 0.0;
        out.air_k[f] = 0.0;
      }
    };
    solver->set_uniform(0.0, 0.0);
    // Take steps that grow with the cube of their number.
    const double steps = std::ceil(kSteps * refine_);
    for (double n = 1.0; n <= steps; n += 1.0) {
      const double share = n / steps;
      const auto done = solver->step(c_.time_s * share * share * share, drive);
      if (!done) return tl::unexpected(done.error());
    }
    // Read the node at the point; the grid has a line there on every axis.
    const glm::dvec3 point(at_x(), at_y(), c_.depth_m);
    const auto nodes = solver->nodes_m();
    std::size_t nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const glm::dvec3 d = nodes[i] - point;
      const double away = d.x * d.x + d.y * d.y + d.z * d.z;
      if (away < least) {
        least = away;
        nearest = i;
      }
    }
    return solver->node_k()[nearest];
  }

 private:
  [[nodiscard]] bool half_plane() const {
    return c_.patch == LitPatch::half_plane || c_.patch == LitPatch::moving_half_plane;
  }
  // Mirror the point: strip and rectangle are symmetric, so one half or quarter is solved.
  [[nodiscard]] double at_x() const { return half_plane() ? c_.x_m : std::abs(c_.x_m); }
  [[nodiscard]] double at_y() const {
    return c_.patch == LitPatch::rectangle ? std::abs(c_.y_m) : 0.0;
  }

  // Common rules of all three axes.
  [[nodiscard]] GradedLines lines() const {
    GradedLines wanted;
    wanted.growth_frac = c_.patch == LitPatch::rectangle ? kGrowthRectangle : kGrowth;
    wanted.max_size_m = kCoarsest * length_m_;
    wanted.refine = refine_;
    return wanted;
  }
  // Ask for the finest cells between two places.
  void fine(GradedLines& wanted, double low, double high) const {
    wanted.wishes.push_back({low, high, kFinest * length_m_});
  }

  // Be fine where the edge lies or passes, and put lines at the edge and at the point.
  [[nodiscard]] std::vector<double> x_lines() const {
    GradedLines wanted = lines();
    const double x = at_x();
    if (half_plane()) {
      const double end = c_.patch == LitPatch::moving_half_plane ? c_.speed_m_s * c_.time_s : 0.0;
      const double low = std::min({0.0, end, x});
      const double high = std::max({0.0, end, x});
      wanted.fixed_m = {low - kReach * length_m_, 0.0, x, high + kReach * length_m_};
      fine(wanted, std::min(0.0, end), std::max(0.0, end));
    } else {
      wanted.fixed_m = {0.0, c_.half_x_m, x, std::max(c_.half_x_m, x) + kReach * length_m_};
      fine(wanted, c_.half_x_m, c_.half_x_m);
    }
    wanted.wishes.push_back({x, x, 3.0 * kFinest * length_m_});
    return graded_lines(wanted, 1e-7 * length_m_);
  }
  [[nodiscard]] std::vector<double> y_lines() const {
    if (c_.patch != LitPatch::rectangle) return {0.0, length_m_};
    GradedLines wanted = lines();
    wanted.fixed_m = {0.0, c_.half_y_m, at_y(), std::max(c_.half_y_m, at_y()) + kReach * length_m_};
    fine(wanted, c_.half_y_m, c_.half_y_m);
    wanted.wishes.push_back({at_y(), at_y(), 3.0 * kFinest * length_m_});
    return graded_lines(wanted, 1e-7 * length_m_);
  }
  [[nodiscard]] std::vector<double> z_lines() const {
    GradedLines wanted = lines();
    wanted.fixed_m = {0.0, c_.depth_m, c_.depth_m + kReach * length_m_};
    fine(wanted, 0.0, 0.0);
    wanted.wishes.push_back({c_.depth_m, c_.depth_m, 3.0 * kFinest * length_m_});
    return graded_lines(wanted, 1e-7 * length_m_);
  }

  [[nodiscard]] double lit_frac(const SolidFace& face, double time_s) const {
    constexpr double kFar = std::numeric_limits<double>::infinity();
    switch (c_.patch) {
      case LitPatch::half_plane:
        return covered(face.low_m.x, face.high_m.x, 0.0, kFar);
      case LitPatch::moving_half_plane:
        return covered(face.low_m.x, face.high_m.x, c_.speed_m_s * time_s, kFar);
      case LitPatch::strip:
        return covered(face.low_m.x, face.high_m.x, 0.0, c_.half_x_m);
      case LitPatch::rectangle:
        return covered(face.low_m.x, face.high_m.x, 0.0, c_.half_x_m) *
               covered(face.low_m.y, face.high_m.y, 0.0, c_.half_y_m);
    }
    return 0.0;
  }

  const LateralCase& c_;
  double refine_;
  double length_m_;
};

}  // namespace

Result<double> lateral_rise_k(const LateralCase& c, double refine) {
  if (!valid(c) || !(refine >= 0.25 && refine <= 16.0)) {
    return make_error(ErrorCode::invalid_argument,
                      "lateral conduction: conductivity, heat capacity, time and the patch must be "
                      "positive, refine within 0.25..16");
  }
  return LateralModel(c, refine).run();
}

std::vector<double> lateral_rises_k(std::span<const LateralCase> cases, double refine) {
  std::vector<double> rises(cases.size(), std::numeric_limits<double>::quiet_NaN());
  threads::parallel_indices(std::size_t{0}, cases.size(), [&](std::size_t i) {
    if (const auto rise = lateral_rise_k(cases[i], refine)) rises[i] = *rise;
  });
  return rises;
}

}  // namespace emit::reference
