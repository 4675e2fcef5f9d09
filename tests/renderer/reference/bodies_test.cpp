// SPDX-License-Identifier: Apache-2.0
// Bodies of thin layers, sheets and joints in three dimensions, against closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/reference/solid_solver.hpp"
#include "emit/reference/voxel_model.hpp"
#include "solid_scenes.hpp"

namespace emit::reference {
namespace {

constexpr double kAirK = 300.0;

scene::Material material_of(const char* name, std::vector<scene::Layer> layers) {
  scene::Material material;
  material.name = name;
  material.layers = std::move(layers);
  material.base_k = kAirK;
  return material;
}

/// Drive of a face: absorbed flux and film.
struct Lit {
  double absorbed_w_m2 = 0.0;
  double film_w_m2_k = 0.0;
};

/// Steady temperatures of a model whose faces have films to air of one temperature and radiate
/// nothing.
class Steady {
 public:
  Steady(const TestScene& t, const VoxelOptions& options, double time_s,
         const std::function<Lit(const SolidFace&)>& lit) {
    auto model = VoxelModel::build(t.scenario, t.geometry, options);
    EXPECT_TRUE(model.has_value()) << (model ? "" : model.error().text);
    if (!model) return;
    SolidOptions solid;
    solid.tolerance_k = 0.02;
    solid.max_step_s = 1e9;
    auto solver = SolidSolver::create(
        model->grid(),
        [&](const SolidFace& face) {
          FaceCondition condition = model->condition(face);
          condition.emissivity_frac = 0.0;
          return condition;
        },
        solid);
    EXPECT_TRUE(solver.has_value()) << (solver ? "" : solver.error().text);
    if (!solver) return;
    std::vector<Lit> drives;
    for (const SolidFace& face : solver->faces()) drives.push_back(lit(face));
    solver->set_uniform(0.0, kAirK);
    const auto done =
        solver->advance(time_s, [&](double, std::span<const double>, const FaceDrive& out) {
          for (std::size_t f = 0; f < drives.size(); ++f) {
            out.absorbed_w_m2[f] = drives[f].absorbed_w_m2;
            out.film_w_m2_k[f] = drives[f].film_w_m2_k;
            out.air_k[f] = kAirK;
          }
        });
    EXPECT_TRUE(done.has_value()) << (done ? "" : done.error().text);
    finder_.emplace(model->grid(), solver->faces(), model->thickest_sheet_m());
    solver_.emplace(std::move(*solver));
  }

  /// Returns the rise above the air at a point of a face; NaN where there is none.
  [[nodiscard]] double rise_k(const glm::dvec3& point, const glm::dvec3& normal) const {
    if (!finder_) return std::nan("");
    const auto face = finder_->find(point, normal);
    return face ? solver_->face_k_at(*face, point) - kAirK : std::nan("");
  }
  [[nodiscard]] std::size_t nodes() const { return solver_ ? solver_->free_nodes() : 0; }

 private:
  std::optional<FaceFinder> finder_;
  std::optional<SolidSolver> solver_;
};

constexpr double kHalfSheetM = 0.12;

/// Returns a sheet of steel, 0.24 m by 0.01 m and 1 mm thick.
TestScene sheet_scene() {
  TestScene t;
  scene::Material steel = material_of("steel", {{0.0005, 50.0, 7800.0, 450.0}});
  steel.sheet = true;
  t.geometry.materials = {steel};
  scene::Mesh mesh;
  add_quad(mesh, {{{-kHalfSheetM, 0, 1},
                   {kHalfSheetM, 0, 1},
                   {kHalfSheetM, 0.01, 1},
                   {-kHalfSheetM, 0.01, 1}}});
  finish_mesh(t, std::move(mesh), 0);
  return t;
}

/// Returns the rise of a sheet whose half at x > 0 is lit, over the rise of a sheet that is lit
/// whole: the fin with insulated ends.
double fin(double x, double length) {
  const double end = std::cosh(kHalfSheetM / length);
  return x < 0.0 ? 0.5 * std::cosh((kHalfSheetM + x) / length) / end
                 : 1.0 - 0.5 * std::cosh((kHalfSheetM - x) / length) / end;
}

/// Returns the largest error of a half-lit sheet against the fin's closed form, of its rise when
/// lit whole, on both sides.
double fin_error(double refine) {
  constexpr double kFilm = 10.0;
  constexpr double kFlux = 400.0;
  VoxelOptions options;
  options.refine = refine;
  options.suns = {{glm::dvec3(0.0, 0.0, 1.0), 7200.0}};
  const Steady sheet(sheet_scene(), options, 1e4, [&](const SolidFace& face) -> Lit {
    if (face.axis != 2) return {};
    const double lit = std::clamp(face.high_m.x / (face.high_m.x - face.low_m.x), 0.0, 1.0);
    return {face.sign > 0 ? kFlux * lit : 0.0, kFilm};
  });
  const double length = std::sqrt(50.0 * 0.001 / (2.0 * kFilm));
  const double whole = kFlux / (2.0 * kFilm);
  double worst = 0.0;
  for (const double x : {-0.115, -0.1, -0.05, -0.02, 0.0, 0.03, 0.07, 0.11}) {
    for (const double side : {1.0, -1.0}) {
      const double rise = sheet.rise_k({x, 0.005, 1.0}, {0.0, 0.0, side});
      EXPECT_TRUE(std::isfinite(rise)) << x << ' ' << side;
      worst = std::max(worst, std::abs(rise / whole - fin(x, length)));
    }
  }
  return worst;
}

TEST(ReferenceBodies, SheetThatIsHalfLitIsAFin) {
  const double coarse = fin_error(1.0);
  const double fine = fin_error(2.0);
  RecordProperty("error_at_1", std::to_string(coarse));
  RecordProperty("order", std::to_string(std::log2(coarse / fine)));
  EXPECT_LT(coarse, 0.01);
  EXPECT_GT(std::log2(coarse / fine), 1.6);
}

/// Returns a cube with a skin of steel on 10 cm of foam.
TestScene skin_scene(double skin_m, double side_m) {
  TestScene t;
  t.geometry.materials = {
      material_of("panel", {{skin_m, 50.0, 7800.0, 450.0}, {0.1, 0.025, 40.0, 1400.0}})};
  scene::Mesh mesh;
  add_box(mesh, {0, 0, 0}, {side_m, side_m, side_m});
  finish_mesh(t, std::move(mesh), 0);
  return t;
}

/// Returns the largest error of a skin around an edge between a lit and a shaded face against an
/// endless membrane, of the rise far from the edge. The sides of the cube are nine lengths long.
double skin_error(double skin_m, double refine, std::size_t& nodes) {
  constexpr double kFilm = 19.0;
  constexpr double kFlux = 700.0;
  const double loss = kFilm + 0.025 / 0.1;
  const double length = std::sqrt(50.0 * skin_m / loss);
  const double whole = kFlux / loss;
  const double side_m = std::max(0.21, 9.0 * length);
  VoxelOptions options;
  options.refine = refine;
  const Steady cube(skin_scene(skin_m, side_m), options, 1e5, [&](const SolidFace& face) -> Lit {
    return {face.axis == 2 && face.sign > 0 ? kFlux : 0.0, kFilm};
  });
  double worst = 0.0;
  for (const double share : {0.0, 0.3, 1.0, 2.0, 3.0}) {
    const double away = share * length;
    const double middle = 0.5 * side_m;
    const double shaded = cube.rise_k({side_m, middle, side_m - away}, {1.0, 0.0, 0.0});
    const double lit = cube.rise_k({side_m - away, middle, side_m}, {0.0, 0.0, 1.0});
    EXPECT_TRUE(std::isfinite(shaded + lit));
    worst = std::max(worst, std::abs(shaded / whole - 0.5 * std::exp(-share)));
    worst = std::max(worst, std::abs(lit / whole - (1.0 - 0.5 * std::exp(-share))));
  }
  nodes = cube.nodes();
  return worst;
}

TEST(ReferenceBodies, SkinOfSteelOnFoamSpreadsHeatAroundAnEdgeAsAMembraneDoes) {
  for (const double skin_m : {0.0003, 0.001}) {
    std::size_t nodes = 0;
    const double worst = skin_error(skin_m, 0.5, nodes);
    RecordProperty("error_of_" + std::to_string(skin_m), std::to_string(worst));
    RecordProperty("nodes_of_" + std::to_string(skin_m), std::to_string(nodes));
    EXPECT_LT(worst, 0.025) << skin_m;
  }
}

constexpr double kColumnM = 0.4;
constexpr double kColumnW = 1.28;  ///< conductivity, W/(m K)

/// Returns the rise of an endless square column with a film on all four sides, of which the one at
/// y = kColumnM absorbs a flux: a series over cos(p (x - kColumnM / 2)) with p tan(p kColumnM / 2)
/// = film / conductivity, which is the film's condition at x = 0 and x = kColumnM.
double column_rise_k(double x, double y, double flux, double film) {
  const double half = 0.5 * kColumnM;
  double sum = 0.0;
  for (int n = 0; n < 60; ++n) {
    // Bisect for p within the branch of the tangent that rises from n pi to (n + 1/2) pi.
    double low = n * physics::kPi / half;
    double high = (n + 0.5) * physics::kPi / half;
    for (int i = 0; i < 80; ++i) {
      const double p = 0.5 * (low + high);
      (p * std::sin(p * half) * std::cos(p * half) <
               film / kColumnW * std::cos(p * half) * std::cos(p * half)
           ? low
           : high) = p;
    }
    const double p = 0.5 * (low + high);
    const double share = 2.0 * std::sin(p * half) / (p * half + 0.5 * std::sin(2.0 * p * half));
    // f = A e^(p (y - b)) + B e^(-p y) has the film at y = 0 and flux and film at y = b.
    const double ratio = (kColumnW * p - film) / (kColumnW * p + film);
    const double fade = std::exp(-p * kColumnM);
    const double a =
        flux * share / (kColumnW * p + film - (kColumnW * p - film) * ratio * fade * fade);
    const double f = a * (std::exp(p * (y - kColumnM)) + ratio * fade * std::exp(-p * y));
    sum += f * std::cos(p * (x - half));
  }
  return sum;
}

/// Returns the largest error of a column of concrete against the series, of its greatest rise.
double column_error(double refine) {
  constexpr double kFilm = 15.0;
  constexpr double kFlux = 500.0;
  TestScene t;
  t.geometry.materials = {material_of("concrete", {{0.5, kColumnW, 2300.0, 878.0}})};
  scene::Mesh mesh;
  add_box(mesh, {0, 0, 0}, {kColumnM, kColumnM, 0.02});
  finish_mesh(t, std::move(mesh), 0);
  VoxelOptions options;
  options.refine = refine;
  const Steady column(t, options, 1e7, [&](const SolidFace& face) -> Lit {
    if (face.axis == 2) return {};
    return {face.axis == 1 && face.sign > 0 ? kFlux : 0.0, kFilm};
  });
  double worst = 0.0;
  for (const double away : {0.0, 0.004, 0.02, 0.1, 0.2}) {
    const double lit = column.rise_k({away, kColumnM, 0.01}, {0.0, 1.0, 0.0});
    const double side = column.rise_k({0.0, kColumnM - away, 0.01}, {-1.0, 0.0, 0.0});
    EXPECT_TRUE(std::isfinite(lit + side));
    worst = std::max({worst, std::abs(lit - column_rise_k(away, kColumnM, kFlux, kFilm)),
                      std::abs(side - column_rise_k(0.0, kColumnM - away, kFlux, kFilm))});
  }
  return worst / column_rise_k(0.5 * kColumnM, kColumnM, kFlux, kFilm);
}

TEST(ReferenceBodies, CornerOfConcreteLitOnOneSideIsTheSeries) {
  const double coarse = column_error(0.5);
  const double fine = column_error(1.0);
  RecordProperty("error_at_half", std::to_string(coarse));
  RecordProperty("error_at_1", std::to_string(fine));
  RecordProperty("order", std::to_string(std::log2(coarse / fine)));
  EXPECT_LT(fine, 0.003);
  EXPECT_GT(std::log2(coarse / fine), 1.5);
}

/// Returns two slabs of 0.2 m by 0.2 m on each other: 5 cm of wood on 3 cm of concrete, whose
/// layers reach through both.
TestScene stack_scene() {
  TestScene t;
  t.geometry.materials = {material_of("concrete", {{0.5, 1.28, 2300.0, 878.0}}),
                          material_of("wood", {{0.5, 0.15, 600.0, 1600.0}})};
  scene::Mesh lower;
  add_box(lower, {0, 0, 0}, {0.2, 0.2, 0.03});
  finish_mesh(t, std::move(lower), 0);
  scene::Mesh upper;
  add_box(upper, {0, 0, 0.03}, {0.2, 0.2, 0.08});
  finish_mesh(t, std::move(upper), 1);
  t.geometry.instances[1].object = 1;
  t.scenario.objects.resize(2);
  t.scenario.objects[0].name = "floor";
  t.scenario.objects[1].name = "box";
  return t;
}

/// Returns the rise of the top of the stack with insulated sides, lit from above and cooled below.
double stack_rise_k(const TestScene& t, double flux, double film) {
  const Steady stack(t, {}, 1e7, [&](const SolidFace& face) -> Lit {
    if (face.axis != 2) return {};
    return face.sign > 0 ? Lit{flux, 0.0} : Lit{0.0, film};
  });
  return stack.rise_k({0.1, 0.1, 0.08}, {0.0, 0.0, 1.0});
}

TEST(ReferenceBodies, TouchingBodiesOfTwoMaterialsConductAsLayersInSeries) {
  const double rise = stack_rise_k(stack_scene(), 100.0, 10.0);
  EXPECT_NEAR(rise, 100.0 * (0.05 / 0.15 + 0.03 / 1.28 + 1.0 / 10.0), 0.01);
}

TEST(ReferenceBodies, ContactAddsItsResistanceByNameOfObjectOrMaterial) {
  TestScene t = stack_scene();
  const double joined = 100.0 * (0.05 / 0.15 + 0.03 / 1.28 + 1.0 / 10.0);
  for (const auto& between :
       {std::array<std::string, 2>{"box", "floor"}, {"concrete", "box"}, {"wood", "concrete"}}) {
    t.scenario.contacts = {{between, 0.05}};
    // The cells of the joint take the place of 0.2 mm of wood.
    EXPECT_NEAR(stack_rise_k(t, 100.0, 10.0), joined + 100.0 * (0.05 - 0.0002 / 0.15), 0.01);
  }
  t.scenario.contacts = {{{"box", "box"}, 0.05}};
  EXPECT_NEAR(stack_rise_k(t, 100.0, 10.0), joined, 0.01);
}

TEST(ReferenceBodies, PaintsOfOneBodyKeepTheirOpticsAndOtherLayersAreRefused) {
  TestScene t = skin_scene(0.001, 0.3);
  scene::Material painted = t.geometry.materials[0];
  painted.name = "painted";
  painted.emissivity_frac = 0.9;
  t.geometry.materials.push_back(painted);
  // The second quad of a box is its top.
  scene::Mesh& mesh = t.geometry.meshes[0];
  mesh.submeshes = {{0, 6, 0, false}, {6, 6, 1, false}, {12, 24, 0, false}};
  t.scenario.objects.resize(1);
  const auto model = VoxelModel::build(t.scenario, t.geometry, {});
  ASSERT_TRUE(model.has_value()) << model.error().text;
  auto solver = SolidSolver::create(
      model->grid(), [&](const SolidFace& face) { return model->condition(face); }, {});
  ASSERT_TRUE(solver.has_value());
  for (const SolidFace& face : solver->faces()) {
    const bool top = face.axis == 2 && face.sign > 0;
    ASSERT_EQ(model->face(face).material, top ? 1U : 0U);
  }
  t.geometry.materials[1].layers[0].thickness_m = 0.002;
  EXPECT_FALSE(VoxelModel::fits(t.scenario, t.geometry).has_value());
}

}  // namespace
}  // namespace emit::reference
