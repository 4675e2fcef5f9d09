// SPDX-License-Identifier: Apache-2.0
// The three-dimensional solver against closed forms, against the one-dimensional one, and against
// its own energy balance.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/reference/layer_solver.hpp"
#include "emit/reference/solid_grid.hpp"
#include "emit/reference/solid_lateral.hpp"
#include "emit/reference/solid_solver.hpp"
#include "support/failed_check.hpp"
#include "support/sanitizer.hpp"

namespace emit::reference {
namespace {

constexpr double kPi = physics::kPi;
constexpr SolidMaterial kAsphalt{0.7, 2120.0 * 920.0};
constexpr SolidMaterial kConcrete{1.28, 2300.0 * 878.0};

std::vector<double> uniform_lines(double low, double high, std::size_t cells) {
  std::vector<double> lines;
  for (std::size_t i = 0; i <= cells; ++i) {
    lines.push_back(low + (high - low) * static_cast<double>(i) / static_cast<double>(cells));
  }
  return lines;
}

SolidGrid cuboid(std::array<std::vector<double>, 3> lines, SolidMaterial material) {
  SolidGrid grid;
  grid.lines_m = std::move(lines);
  grid.materials = {material};
  grid.cells.assign(grid.count(0) * grid.count(1) * grid.count(2), 0);
  return grid;
}

FaceCondition adiabatic(const SolidFace&) {
  return {};
}
void no_drive(double, std::span<const double>, const FaceDrive&) {}

/// Test of a cosine along every axis of an insulated cube, which fades as a whole: T = e^(-3 a pi^2
/// t) cos cos cos.
struct Mode {
  double error_k = 0.0;
  double estimate_k = 0.0;
};
Mode cosine_error(std::size_t cells, std::size_t steps, LinearSolver linear) {
  const SolidMaterial material{1.0, 1000.0};
  const auto lines = uniform_lines(0.0, 1.0, cells);
  SolidOptions options;
  options.tolerance_k = 1e-6;
  options.linear = linear;
  auto solver = SolidSolver::create(cuboid({lines, lines, lines}, material), adiabatic, options);
  EXPECT_TRUE(solver.has_value());
  const auto shape = [](const glm::dvec3& p) {
    return 10.0 * std::cos(kPi * p.x) * std::cos(kPi * p.y) * std::cos(kPi * p.z);
  };
  solver->set_temperature(0.0, [&](const glm::dvec3& p) { return 300.0 + shape(p); });
  const double end_s = 30.0;
  Mode result;
  for (std::size_t i = 1; i <= steps; ++i) {
    const auto estimate =
        solver->step(end_s * static_cast<double>(i) / static_cast<double>(steps), no_drive);
    EXPECT_TRUE(estimate.has_value());
    result.estimate_k += *estimate;
  }
  const double fade = std::exp(-3.0 * kPi * kPi * 1e-3 * end_s);
  for (std::size_t i = 0; i < solver->nodes_m().size(); ++i) {
    const double exact = 300.0 + fade * shape(solver->nodes_m()[i]);
    result.error_k = std::max(result.error_k, std::abs(solver->node_k()[i] - exact));
  }
  return result;
}

TEST(ReferenceSolid, ErrorFallsWithTheSquareOfTheCellLength) {
  const double coarse = cosine_error(8, 256, LinearSolver::ldlt).error_k;
  const double fine = cosine_error(16, 256, LinearSolver::cg).error_k;
  EXPECT_GT(std::log2(coarse / fine), 1.8) << coarse << " K, " << fine << " K";
  RecordProperty("order_space", std::to_string(std::log2(coarse / fine)));
}

TEST(ReferenceSolid, ErrorFallsWithTheSquareOfTheStep) {
  // Compare with many steps on the same grid. The difference is the error in time.
  const SolidMaterial material{1.0, 1000.0};
  const auto final_k = [&](std::size_t steps) {
    SolidOptions options;
    options.tolerance_k = 1e-7;
    auto solver = SolidSolver::create(
        cuboid({uniform_lines(0.0, 1.0, 12), {0.0, 1.0}, uniform_lines(0.0, 0.2, 10)}, material),
        [](const SolidFace& face) {
          const bool top = face.axis == 2 && face.sign > 0;
          return FaceCondition{top ? FaceKind::exposed : FaceKind::adiabatic, 0.9, 0.0};
        },
        options);
    EXPECT_TRUE(solver.has_value());
    solver->set_uniform(0.0, 300.0);
    const auto faces = solver->faces();
    const DriveFunction drive = [faces](double t, std::span<const double>, const FaceDrive& out) {
      for (std::size_t f = 0; f < faces.size(); ++f) {
        // Start without a kink: the order must be that of the scheme, not of the start.
        out.absorbed_w_m2[f] = 413.0 + 300.0 * std::pow(std::sin(t / 40.0), 3) * faces[f].low_m.x;
        out.film_w_m2_k[f] = 12.0;
        out.air_k[f] = 300.0;
      }
    };
    for (std::size_t i = 1; i <= steps; ++i) {
      EXPECT_TRUE(solver->step(60.0 * static_cast<double>(i) / static_cast<double>(steps), drive)
                      .has_value());
    }
    return std::vector<double>(solver->node_k().begin(), solver->node_k().end());
  };
  const auto truth = final_k(512);
  const auto worst = [&](const std::vector<double>& k) {
    double error = 0.0;
    for (std::size_t i = 0; i < k.size(); ++i) error = std::max(error, std::abs(k[i] - truth[i]));
    return error;
  };
  const double coarse = worst(final_k(16));
  const double fine = worst(final_k(32));
  EXPECT_GT(std::log2(coarse / fine), 1.8) << coarse << " K, " << fine << " K";
  EXPECT_LT(fine, 0.02);
  RecordProperty("order_time", std::to_string(std::log2(coarse / fine)));
}

TEST(ReferenceSolid, BothLinearSolversGiveTheSameTemperatures) {
  const Mode direct = cosine_error(8, 16, LinearSolver::ldlt);
  const Mode iterated = cosine_error(8, 16, LinearSolver::cg);
  EXPECT_NEAR(direct.error_k, iterated.error_k, 1e-6);
}

/// A wall of concrete that stands on asphalt. It is lit from above and by a flux that moves along
/// it.
class Corner {
 public:
  explicit Corner(double tolerance_k) {
    GradedLines x;
    x.fixed_m = {0.0, 0.3, 0.4, 0.8};
    x.wishes = {{0.3, 0.3, 0.003}, {0.4, 0.4, 0.003}};
    x.max_size_m = 0.05;
    x.growth_frac = 0.15;
    GradedLines z = x;
    z.fixed_m = {-0.16, -0.15, 0.0, 0.2};
    z.wishes = {{0.0, 0.0, 0.003}, {0.2, 0.2, 0.003}};
    grid_.lines_m = {graded_lines(x), {0.0, 1.0}, graded_lines(z)};
    grid_.materials = {kAsphalt, kConcrete};
    grid_.fixed_cell_k = {293.15};
    grid_.cells.assign(grid_.count(0) * grid_.count(2), kVoidCell);
    for (std::size_t k = 0; k < grid_.count(2); ++k) {
      const double middle_z = 0.5 * (grid_.lines_m[2][k] + grid_.lines_m[2][k + 1]);
      for (std::size_t i = 0; i < grid_.count(0); ++i) {
        const double middle_x = 0.5 * (grid_.lines_m[0][i] + grid_.lines_m[0][i + 1]);
        std::uint16_t& cell = grid_.cells[grid_.index(i, 0, k)];
        if (middle_z < -0.15) {
          cell = kFixedCell;
        } else if (middle_z < 0.0) {
          cell = 0;
        } else if (middle_x > 0.3 && middle_x < 0.4) {
          cell = 1;
        }
      }
    }
    SolidOptions options;
    options.tolerance_k = tolerance_k;
    options.first_step_s = 1.0;
    options.max_step_s = 120.0;
    auto made = SolidSolver::create(
        grid_,
        [](const SolidFace& face) {
          const bool rim =
              face.axis == 1 || (face.outside_cell == kOutsideGrid && face.high_m.z <= 0.0);
          return FaceCondition{rim ? FaceKind::adiabatic : FaceKind::exposed, 0.9, 0.0};
        },
        options);
    EXPECT_TRUE(made.has_value());
    solver = std::make_unique<SolidSolver>(std::move(*made));
    solver->set_uniform(0.0, 293.15);
  }
  [[nodiscard]] DriveFunction drive() const {
    return [faces = solver->faces()](double t, std::span<const double>, const FaceDrive& out) {
      for (std::size_t f = 0; f < faces.size(); ++f) {
        const bool lit = faces[f].axis == 2 && faces[f].centre_m().x < 0.3 - 1e-5 * t;
        out.absorbed_w_m2[f] = 350.0 + (lit ? 500.0 : 0.0);
        out.film_w_m2_k[f] = 13.3;
        out.air_k[f] = 292.0;
      }
    };
  }
  std::unique_ptr<SolidSolver> solver;

 private:
  SolidGrid grid_;
};

TEST(ReferenceSolid, HeatStoredIsHeatThatFlowedIn) {
  Corner corner(0.01);
  const double before_j = corner.solver->heat_j();
  ASSERT_TRUE(corner.solver->advance(3600.0, corner.drive()).has_value());
  const double stored_j = corner.solver->heat_j() - before_j;
  EXPECT_GT(std::abs(stored_j), 1e4);
  EXPECT_NEAR(corner.solver->heat_in_j() / stored_j, 1.0, 1e-6);
}

TEST(ReferenceSolid, GoingOnFromASavedStateGivesTheSameBits) {
  Corner whole(0.01);
  SolidState saved;
  ASSERT_TRUE(whole.solver
                  ->advance(1800.0, whole.drive(),
                            [&](double) {
                              if (whole.solver->stats().steps == 20) saved = whole.solver->state();
                              return true;
                            })
                  .has_value());
  ASSERT_GT(whole.solver->stats().steps, 25U);
  Corner resumed(0.01);
  ASSERT_TRUE(resumed.solver->restore(saved).has_value());
  ASSERT_TRUE(resumed.solver->advance(1800.0, resumed.drive()).has_value());
  const auto a = whole.solver->node_k();
  const auto b = resumed.solver->node_k();
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) ASSERT_EQ(a[i], b[i]) << "node " << i;
}

TEST(ReferenceSolid, FarFromEdgesItIsTheOneDimensionalSolution) {
  Corner corner(0.005);
  ASSERT_TRUE(corner.solver->advance(3600.0, corner.drive()).has_value());
  std::size_t left = 0;
  for (std::size_t f = 0; f < corner.solver->faces().size(); ++f) {
    const auto& face = corner.solver->faces()[f];
    if (face.axis == 2 && face.low_m.x == 0.0) left = f;
  }
  const std::vector<SolidLayer> layers{{0.15, 0.7, 2120.0 * 920.0}};
  const auto mesh = LayerMesh::build(layers, {BaseKind::fixed_temperature, 293.15});
  ASSERT_TRUE(mesh.has_value());
  LayerSolver one(*mesh, {.tolerance_k = 1e-4});
  const std::vector<ProfilePoint> profile{{0.0, 293.15}};
  one.start(profile, 0.0);
  const FaceState face{850.0, 13.3, 292.0};
  one.advance({0.0, 3600.0, face, face}, 0.9);
  EXPECT_GT(one.face_k(), 305.0);
  EXPECT_NEAR(corner.solver->face_k_at(left, {0.0, 0.5, 0.0}), one.face_k(), 0.02);
}

TEST(ReferenceSolid, GridAndMaterialsAreChecked) {
  SolidGrid grid =
      cuboid({uniform_lines(0, 1, 2), uniform_lines(0, 1, 2), uniform_lines(0, 1, 2)}, kConcrete);
  SolidGrid bad = grid;
  bad.lines_m[1][1] = bad.lines_m[1][0];
  EXPECT_FALSE(SolidSolver::create(bad, adiabatic, {}).has_value());
  bad = grid;
  bad.cells[3] = 4;
  EXPECT_FALSE(SolidSolver::create(bad, adiabatic, {}).has_value());
  bad = grid;
  bad.cells[3] = kFixedCell;
  EXPECT_FALSE(SolidSolver::create(bad, adiabatic, {}).has_value());
  bad = grid;
  bad.materials[0].conductivity_w_m_k = 0.0;
  EXPECT_FALSE(SolidSolver::create(bad, adiabatic, {}).has_value());
  EXPECT_TRUE(SolidSolver::create(grid, adiabatic, {}).has_value());
}

struct LateralRow {
  LateralCase c;
  double rise_k = 0.0;
};
std::vector<LateralRow> lateral_rows() {
  std::ifstream in(std::string(EMIT_TEST_SOURCE_DIR) + "/data/oracles/cond_lateral.csv");
  EXPECT_TRUE(in.good());
  std::vector<LateralRow> rows;
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#' || line.starts_with("kind")) continue;
    std::stringstream cells(line);
    std::string kind;
    std::getline(cells, kind, ',');
    std::vector<double> v;
    for (std::string cell; std::getline(cells, cell, ',');) v.push_back(std::stod(cell));
    LateralRow row;
    row.c.patch = kind == "half_plane"          ? LitPatch::half_plane
                  : kind == "moving_half_plane" ? LitPatch::moving_half_plane
                  : kind == "strip"             ? LitPatch::strip
                                                : LitPatch::rectangle;
    row.c.conductivity_w_m_k = v[0];
    row.c.heat_capacity_j_m3_k = v[1];
    row.c.flux_w_m2 = v[2];
    row.c.half_x_m = v[3];
    row.c.half_y_m = v[4];
    row.c.speed_m_s = v[5];
    row.c.x_m = v[6];
    row.c.y_m = v[7];
    row.c.depth_m = v[8];
    row.c.time_s = v[9];
    row.rise_k = v[10];
    rows.push_back(row);
  }
  return rows;
}
double full_sun_k(const LateralCase& c) {
  const double a = c.conductivity_w_m_k / c.heat_capacity_j_m3_k;
  return 2.0 * c.flux_w_m2 / c.conductivity_w_m_k * std::sqrt(a * c.time_s / kPi);
}

TEST(ReferenceSolidLateral, EveryRowWithinOnePerCentOfTheFullSunRise) {
  auto rows = lateral_rows();
  ASSERT_EQ(rows.size(), 72U);
  if (test::kThreadSanitizer) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < rows.size(); i += 12) rows[kept++] = rows[i];
    rows.resize(kept);
  }
  std::vector<LateralCase> cases;
  for (const LateralRow& row : rows) cases.push_back(row.c);
  const auto rises = lateral_rises_k(cases, 1.0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_NEAR(rises[i], rows[i].rise_k, 0.01 * full_sun_k(rows[i].c)) << "row " << i;
  }
}

TEST(ReferenceSolidLateral, ErrorFallsWithRefinement) {
  if (test::kThreadSanitizer) GTEST_SKIP() << "convergence is judged without the sanitizer";
  std::vector<LateralCase> cases;
  std::vector<LateralRow> plane;
  for (const LateralRow& row : lateral_rows()) {
    if (row.c.patch == LitPatch::rectangle) continue;
    plane.push_back(row);
    cases.push_back(row.c);
  }
  const auto rms = [&](double refine) {
    const auto rises = lateral_rises_k(cases, refine);
    double sum = 0.0;
    for (std::size_t i = 0; i < plane.size(); ++i) {
      sum += std::pow((rises[i] - plane[i].rise_k) / full_sun_k(plane[i].c), 2);
    }
    return std::sqrt(sum / static_cast<double>(plane.size()));
  };
  const double coarse = rms(0.5);
  const double fine = rms(1.0);
  EXPECT_GT(std::log2(coarse / fine), 1.8) << coarse << ", " << fine;
}

TEST(ReferenceSolidGrid, NeedsTwoFixedPlacesThatStayApart) {
  GradedLines wanted;
  EXPECT_NE(test::failed_check([&] { (void)graded_lines(wanted); }).find("fixed_m.empty()"),
            std::string::npos);
  wanted.fixed_m = {0.0, 1e-4};
  EXPECT_NE(test::failed_check([&] { (void)graded_lines(wanted, 1e-3); }).find("(1 >= 2)"),
            std::string::npos);
  EXPECT_EQ(test::failed_check([&] { (void)graded_lines(wanted, 1e-5); }), "");
}

}  // namespace
}  // namespace emit::reference
