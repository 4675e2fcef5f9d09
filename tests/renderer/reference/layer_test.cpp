// SPDX-License-Identifier: Apache-2.0
// The one-dimensional conduction solver by itself: order of convergence, conservation, steady
// states, and extreme input.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <string>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/reference/layer_frequency.hpp"
#include "emit/reference/layer_mesh.hpp"
#include "emit/reference/layer_solver.hpp"
#include "support/failed_check.hpp"

namespace emit {
namespace {

using reference::Base;
using reference::BaseKind;
using reference::FaceSegment;
using reference::FaceState;
using reference::LayerMesh;
using reference::LayerSolver;
using reference::MeshOptions;
using reference::ProfilePoint;
using reference::SolidLayer;
using reference::StepOptions;

constexpr double kEmissivity = 0.93;

/// Asphalt on gravel on soil. Conductivity and heat capacity jump at the interfaces.
const std::vector<SolidLayer> kGround{{0.03, 0.7, 1.9504e6}, {0.3, 1.5, 1.9e6}, {1.55, 1.2, 2.2e6}};
/// Layers with a contrast of 1000 in conductivity and 100 in heat capacity.
const std::vector<SolidLayer> kSandwich{
    {0.004, 50.0, 3.8e6}, {0.03, 0.04, 4.0e4}, {0.05, 1.28, 2.024e6}};

LayerMesh mesh_of(const std::vector<SolidLayer>& layers, const Base& base,
                  const MeshOptions& options = {}) {
  auto mesh = LayerMesh::build(layers, base, options);
  EXPECT_TRUE(mesh.has_value()) << mesh.error().text;
  return std::move(*mesh);
}

/// A smooth morning. The flux grows from the value that balances the start, so no stage sees a
/// jump.
class Morning final : public reference::FaceModel {
 public:
  [[nodiscard]] reference::FaceFlux at(double time_s, double face_k) const noexcept override {
    const double swing = std::sin(time_s * physics::kPi / 7200.0);
    const double start = physics::kStefanBoltzmannWPerM2K4 * kEmissivity * std::pow(290.0, 4);
    const double emission =
        physics::kStefanBoltzmannWPerM2K4 * kEmissivity * face_k * face_k * face_k * face_k;
    return {start + 700.0 * swing * swing + 13.3 * (290.0 - face_k) - emission,
            -13.3 - 4.0 * emission / face_k};
  }
};

double morning_k(const LayerMesh& mesh, double step_s, double depth_m) {
  StepOptions steps;
  steps.fixed_step_s = step_s;
  LayerSolver solver(mesh, steps);
  const ProfilePoint start[] = {{0.0, 290.0}};
  solver.start(start, 0.0);
  solver.advance(3600.0, Morning());
  return solver.temperature_k(depth_m);
}

class LayerStacks : public testing::TestWithParam<const std::vector<SolidLayer>*> {};
INSTANTIATE_TEST_SUITE_P(All, LayerStacks, testing::Values(&kGround, &kSandwich),
                         [](const auto& stack) {
                           return stack.param == &kGround ? "ground" : "sandwich";
                         });

TEST_P(LayerStacks, ConvergeInTimeWithSecondOrder) {
  const LayerMesh mesh = mesh_of(*GetParam(), {BaseKind::fixed_temperature, 290.0});
  for (const double depth_m : {0.0, 0.02}) {
    const double limit = morning_k(mesh, 3600.0 / 4096, depth_m);
    double error_before = 0.0;
    for (const double steps : {32.0, 64.0, 128.0}) {
      const double error = std::abs(morning_k(mesh, 3600.0 / steps, depth_m) - limit);
      if (error_before > 0.0) {
        const double order = std::log2(error_before / error);
        RecordProperty("order", std::to_string(order));
        EXPECT_GT(order, 1.8) << "depth " << depth_m << ", steps " << steps;
        EXPECT_LT(order, 3.5);
      }
      error_before = error;
    }
    EXPECT_LT(error_before, 0.01);
  }
}

TEST_P(LayerStacks, ConvergeInSpaceWithAtLeastSecondOrderAcrossInterfaces) {
  // Compare the face, the first layer, its interface and two depths below it.
  const double layer_m = GetParam()->front().thickness_m;
  const double depths_m[] = {0.0, 0.5 * layer_m, layer_m, 1.5 * layer_m, 2.5 * layer_m};
  const auto at_refine = [&](std::uint32_t refine) {
    MeshOptions options;
    options.shortest_time_s = 100.0;
    options.cells_per_length = 1.0;
    options.growth_frac = 0.2;
    options.min_cells = 3;
    options.refine = refine;
    const LayerMesh mesh = mesh_of(*GetParam(), {BaseKind::fixed_temperature, 290.0}, options);
    std::vector<double> values;
    for (const double depth_m : depths_m) values.push_back(morning_k(mesh, 20.0, depth_m));
    return values;
  };
  const auto limit = at_refine(32);
  double error_before = 0.0;
  for (const std::uint32_t refine : {2U, 4U, 8U}) {
    const auto values = at_refine(refine);
    double error = 0.0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      error = std::max(error, std::abs(values[i] - limit[i]));
    }
    if (error_before > 0.0) {
      const double order = std::log2(error_before / error);
      RecordProperty("order", std::to_string(order));
      EXPECT_GT(order, 1.8) << "refine " << refine;
    }
    error_before = error;
  }
  EXPECT_LT(error_before, 1e-4);
}

TEST_P(LayerStacks, StoreWhatFlowsIn) {
  for (const BaseKind kind : {BaseKind::fixed_temperature, BaseKind::adiabatic}) {
    const LayerMesh mesh = mesh_of(*GetParam(), {kind, 286.0});
    LayerSolver solver(mesh);
    const ProfilePoint start[] = {{0.0, 280.0}, {0.05, 291.0}};
    solver.start(start, 0.0);
    const double before = solver.stored_heat_j_m2();
    const FaceState night{300.0, 12.0, 281.0};
    const FaceState noon{900.0, 20.0, 295.0};
    solver.advance({0.0, 3600.0, night, noon}, kEmissivity);
    solver.advance({3600.0, 9000.0, night, night}, kEmissivity);  // a shadow makes the flux jump
    const double stored = solver.stored_heat_j_m2() - before;
    ASSERT_GT(std::abs(stored), 1.0e4);
    EXPECT_NEAR(solver.heat_in_j_m2() / stored, 1.0, 1e-9);
    // The flux of a held face follows from the balance. The change of heat must still add up.
    solver.advance_held(9600.0, 300.0, 310.0);
    EXPECT_NEAR(solver.heat_in_j_m2() / (solver.stored_heat_j_m2() - before), 1.0, 1e-9);
  }
}

TEST_P(LayerStacks, KeepTheirBalanceOverABaseThatMoves) {
  const LayerMesh mesh = mesh_of(*GetParam(), {BaseKind::fixed_temperature, 286.0});
  LayerSolver solver(mesh);
  const ProfilePoint start[] = {{0.0, 280.0}, {0.05, 291.0}};
  solver.start(start, 0.0);
  const double before = solver.stored_heat_j_m2();
  const FaceState night{300.0, 12.0, 281.0};
  const FaceState noon{900.0, 20.0, 295.0};
  solver.move_base(286.0, 2e-3);
  solver.advance({0.0, 3600.0, night, noon}, kEmissivity);
  solver.move_base(300.0, -1e-3);  // a jump, too
  solver.advance({3600.0, 9000.0, noon, noon}, kEmissivity);
  EXPECT_NEAR(solver.temperature_k(mesh.depth_m().back()), 300.0 - 5.4, 1e-9);
  const double stored = solver.stored_heat_j_m2() - before;
  ASSERT_GT(std::abs(stored), 1.0e4);
  EXPECT_NEAR(solver.heat_in_j_m2() / stored, 1.0, 1e-9);
}

TEST(LayerBase, RisesEvenlyAndTheSlabFollowsAsTheClosedFormSays) {
  // Insulated at its face, a slab over a base that rises at the rate r lags behind it by
  // r (L^2 - z^2)/(2 a), and takes the heat rho c L r from below.
  constexpr double kThickM = 0.1;
  constexpr double kConductivity = 1.2;
  constexpr double kCapacity = 2.0e6;
  constexpr double kRate = 1e-3;
  const LayerMesh mesh =
      mesh_of({{kThickM, kConductivity, kCapacity}}, {BaseKind::fixed_temperature, 280.0});
  LayerSolver solver(mesh);
  const ProfilePoint start[] = {{0.0, 280.0}};
  solver.start(start, 0.0);
  solver.move_base(280.0, kRate);
  const FaceState insulated{0.0, 0.0, 0.0};
  constexpr double kSettledS = 200'000.0;
  solver.advance({0.0, kSettledS, insulated, insulated}, 0.0);
  const double lag = kRate * kCapacity / (2.0 * kConductivity);
  for (const double depth_m : {0.0, 0.03, 0.07}) {
    EXPECT_NEAR(solver.temperature_k(depth_m),
                280.0 + kRate * kSettledS - lag * (kThickM * kThickM - depth_m * depth_m), 2e-3)
        << depth_m;
  }
  const double out_j_m2 = solver.heat_out_of_base_j_m2();
  solver.advance({kSettledS, kSettledS + 1000.0, insulated, insulated}, 0.0);
  EXPECT_NEAR((solver.heat_out_of_base_j_m2() - out_j_m2) / (-kCapacity * kThickM * kRate * 1000.0),
              1.0, 1e-5);
}

TEST_P(LayerStacks, InsulatedBodyTakesExactlyTheGivenHeat) {
  const LayerMesh mesh = mesh_of(*GetParam(), {BaseKind::adiabatic, 0.0});
  LayerSolver solver(mesh);
  const ProfilePoint start[] = {{0.0, 290.0}};
  solver.start(start, 0.0);
  const FaceState flux{500.0, 0.0, 0.0};
  const double before = solver.stored_heat_j_m2();
  solver.advance({0.0, 7200.0, flux, flux}, 0.0);
  EXPECT_NEAR((solver.stored_heat_j_m2() - before) / (500.0 * 7200.0), 1.0, 1e-9);
  EXPECT_NEAR(solver.heat_in_j_m2() / (500.0 * 7200.0), 1.0, 1e-12);
}

TEST_P(LayerStacks, SettleOnTheProfileOfTheirResistances) {
  const LayerMesh mesh = mesh_of(*GetParam(), {BaseKind::fixed_temperature, 286.0});
  LayerSolver solver(mesh);
  const ProfilePoint start[] = {{0.0, 300.0}};
  solver.start(start, 0.0);
  solver.advance_held(1.0e9, 310.0, 310.0);
  double depth_m = 0.0;
  for (const ProfilePoint& point : steady_profile(*GetParam(), 310.0, 286.0)) {
    depth_m = point.depth_m;
    EXPECT_NEAR(solver.temperature_k(depth_m), point.temperature_k, 1e-6) << depth_m;
  }
}

TEST_P(LayerStacks, StayAtRestAmongSurroundingsOfTheirOwnTemperature) {
  const LayerMesh mesh = mesh_of(*GetParam(), {BaseKind::fixed_temperature, 288.0});
  LayerSolver solver(mesh);
  const ProfilePoint start[] = {{0.0, 288.0}};
  solver.start(start, 0.0);
  const double sky = kEmissivity * physics::kStefanBoltzmannWPerM2K4 * std::pow(288.0, 4);
  const FaceState calm{sky, 15.0, 288.0};
  for (int hour = 0; hour < 24; ++hour) {
    solver.advance({hour * 3600.0, (hour + 1) * 3600.0, calm, calm}, kEmissivity);
  }
  EXPECT_NEAR(solver.face_k(), 288.0, 1e-9);
  EXPECT_LE(solver.counts().accepted, 24U);
}

TEST(LayerSolver, StepControlKeepsTheToleranceAfterAShadowEdge) {
  const LayerMesh mesh = mesh_of(kGround, {BaseKind::fixed_temperature, 286.15});
  const auto after_edge = [&](const StepOptions& options) {
    LayerSolver solver(mesh, options);
    const auto start = steady_profile(kGround, 300.0, 286.15);
    solver.start(start, 0.0);
    const FaceState sun{1000.0, 13.3, 295.0};
    const FaceState shade{400.0, 13.3, 295.0};
    std::vector<double> values;
    solver.advance({0.0, 3600.0, sun, sun}, kEmissivity);
    for (const double end_s : {3601.0, 3610.0, 3660.0, 4200.0, 7200.0}) {
      solver.advance({solver.time_s(), end_s, shade, shade}, kEmissivity);
      values.push_back(solver.face_k());
    }
    EXPECT_EQ(solver.counts().at_floor, 0U);
    EXPECT_EQ(solver.counts().newton_unconverged, 0U);
    return values;
  };
  StepOptions sharp;
  sharp.tolerance_k = 1e-7;
  const auto limit = after_edge(sharp);
  for (const double tolerance_k : {1e-2, 1e-3, 1e-4}) {
    StepOptions options;
    options.tolerance_k = tolerance_k;
    const auto values = after_edge(options);
    for (std::size_t i = 0; i < values.size(); ++i) {
      EXPECT_NEAR(values[i], limit[i], 5.0 * tolerance_k) << "sample " << i;
    }
  }
}

TEST(LayerSolver, RepeatsItselfExactlyWhateverRanBefore) {
  const LayerMesh mesh = mesh_of(kGround, {BaseKind::fixed_temperature, 286.15});
  LayerSolver used(mesh);
  LayerSolver fresh(mesh);
  const ProfilePoint start[] = {{0.0, 290.0}};
  const FaceState sun{1000.0, 13.3, 295.0};
  const FaceState other{100.0, 5.0, 270.0};
  used.start(start, 0.0);
  used.advance({0.0, 777.0, other, sun}, 0.5);
  for (LayerSolver* solver : {&used, &fresh}) {
    solver->start(start, 0.0);
    solver->advance({0.0, 600.0, sun, other}, kEmissivity);
    solver->advance({600.0, 1300.0, sun, sun}, kEmissivity);
  }
  EXPECT_EQ(used.face_k(), fresh.face_k());
  EXPECT_EQ(used.temperature_k(0.07), fresh.temperature_k(0.07));
}

TEST(LayerSolver, AnswersThePeriodicStateOfItsOwnMatrices) {
  // Frequency and time domain share mesh and matrices. A day's swing that starts on the periodic
  // state must therefore return to it.
  const LayerMesh mesh = mesh_of(kGround, {BaseKind::fixed_temperature, 290.0});
  const double angular = 2.0 * physics::kPi / 86400.0;
  const auto response = periodic_response(mesh, angular);
  struct Swing final : reference::FaceModel {
    double angular_per_s = 0.0;
    [[nodiscard]] reference::FaceFlux at(double time_s, double) const noexcept override {
      return {200.0 * std::cos(angular_per_s * time_s), 0.0};
    }
  } swing;
  swing.angular_per_s = angular;
  std::vector<double> nodes;
  for (const auto& z : response) nodes.push_back(290.0 + 200.0 * z.real());
  StepOptions options;
  options.tolerance_k = 1e-5;
  LayerSolver solver(mesh, options);
  solver.start_nodes(nodes, 0.0);
  for (const double part : {0.25, 0.5, 1.0}) {
    solver.advance(part * 86400.0, swing);
    const std::complex<double> turned =
        200.0 * response.front() * std::polar(1.0, 2.0 * physics::kPi * part);
    EXPECT_NEAR(solver.face_k(), 290.0 + turned.real(), 2e-3) << part;
  }
}

TEST(LayerSolver, DeepGroundIsNotReachedByTheRun) {
  const std::vector<SolidLayer> soil{{0.05, 1.2, 2.2e6}};
  MeshOptions options;
  options.horizon_s = 86400.0;
  const LayerMesh mesh = mesh_of(soil, {BaseKind::deep_ground, 285.0}, options);
  EXPECT_GT(mesh.depth_m().back(), 9.9 * std::sqrt(1.2 / 2.2e6 * 86400.0));
  LayerSolver solver(mesh, {.tolerance_k = 1e-4});
  const ProfilePoint start[] = {{0.0, 285.0}};
  solver.start(start, 0.0);
  const FaceState flux{100.0, 0.0, 0.0};
  solver.advance({0.0, 86400.0, flux, flux}, 0.0);
  const double rise = 200.0 * std::sqrt(86400.0 / (physics::kPi * 1.2 * 2.2e6));
  EXPECT_NEAR(solver.face_k() - 285.0, rise, 2e-3);
}

TEST(LayerSolver, SurvivesHostileBodiesStepsAndFluxes) {
  std::size_t cases = 0;
  for (const double thickness_m : {1e-4, 1e-2, 1.0}) {
    for (const double outer : {1e-4, 1.0, 1e5}) {
      for (const double inner : {1e-4, 1.0, 1e5}) {
        for (const double heat : {1e2, 1e8}) {
          for (const BaseKind kind :
               {BaseKind::fixed_temperature, BaseKind::adiabatic, BaseKind::deep_ground}) {
            const std::vector<SolidLayer> layers{{thickness_m, outer, heat},
                                                 {1.1 - thickness_m, inner, 2e6}};
            const LayerMesh mesh = mesh_of(layers, {kind, 250.0});
            LayerSolver solver(mesh);
            const ProfilePoint start[] = {{0.0, 400.0}, {0.5 * thickness_m, 200.0}};
            for (const double length_s : {1e-9, 1e-3, 60.0, 3.156e7}) {
              for (const double flux : {0.0, 1e6}) {
                solver.start(start, 1.0e8);
                const FaceState face{flux, 1000.0, 300.0};
                const FaceState dark{0.0, 0.0, 300.0};
                solver.advance({1.0e8, 1.0e8 + length_s, face, face}, 1.0);
                solver.advance({1.0e8 + length_s, 1.0e8 + 2.0 * length_s, dark, dark}, 0.02);
                ASSERT_TRUE(std::isfinite(solver.face_k()));
                // The face must not be hotter than the flux allows, nor colder than space.
                ASSERT_GT(solver.face_k(), 0.0);
                ASSERT_LT(solver.face_k(), 2100.0);
                ASSERT_TRUE(std::isfinite(solver.temperature_k(0.4 * thickness_m)));
                ++cases;
              }
            }
          }
        }
      }
    }
  }
  EXPECT_EQ(cases, 3U * 3U * 3U * 2U * 3U * 4U * 2U);
}

TEST(LayerMesh, NamesWhatIsWrong) {
  const auto text = [](std::vector<SolidLayer> layers, const MeshOptions& options = {}) {
    const auto mesh = LayerMesh::build(layers, {}, options);
    return mesh ? std::string() : mesh.error().text;
  };
  EXPECT_NE(text({}), "");
  EXPECT_NE(text({{0.1, 1.0, 1e6}, {0.1, 0.0, 1e6}}).find("layer 2: conductivity"),
            std::string::npos);
  EXPECT_NE(text({{-0.1, 1.0, 1e6}}).find("layer 1: thickness"), std::string::npos);
  EXPECT_NE(text({{0.1, 1.0, std::nan("")}}).find("heat capacity"), std::string::npos);
  MeshOptions fine;
  fine.growth_frac = 0.0;
  fine.shortest_time_s = 1e-12;
  EXPECT_NE(text({{1.0, 0.1, 1e6}}, fine).find("cells"), std::string::npos);
  EXPECT_EQ(text({{0.1, 1.0, 1e6}}), "");
}

TEST(LayerMesh, MassRowsArePositiveDominantAndAddUpToTheBody) {
  for (const auto* stack : {&kGround, &kSandwich}) {
    const LayerMesh mesh = mesh_of(*stack, {BaseKind::adiabatic, 0.0});
    double heat = 0.0;
    for (const SolidLayer& layer : *stack) heat += layer.thickness_m * layer.heat_capacity_j_m3_k;
    double sum = 0.0;
    for (std::size_t i = 0; i < mesh.nodes(); ++i) {
      EXPECT_GE(mesh.mass_above()[i], 0.0);
      EXPECT_GE(mesh.mass_below()[i], 0.0);
      EXPECT_GE(mesh.mass_own()[i], mesh.mass_above()[i] + mesh.mass_below()[i]);
      sum += mesh.mass_own()[i] + mesh.mass_above()[i] + mesh.mass_below()[i];
    }
    EXPECT_NEAR(sum / heat, 1.0, 1e-12);
  }
}

TEST(LayerSolver, InputAgainstTheContractStopsTheProgram) {
  const LayerMesh mesh = mesh_of(kGround, {BaseKind::fixed_temperature, 290.0});
  LayerSolver solver(mesh);
  const auto starts = [&](const std::vector<ProfilePoint>& profile) {
    return test::failed_check([&] { solver.start(profile, 0.0); });
  };
  EXPECT_NE(starts({}).find("!profile.empty()"), std::string::npos);
  EXPECT_NE(starts({{0.1, 290.0}, {0.0, 290.0}}).find("is_sorted"), std::string::npos);
  EXPECT_EQ(starts({{0.0, 290.0}}), "");
  const std::vector<double> nodes(mesh.nodes() - 1, 290.0);
  EXPECT_NE(test::failed_check([&] { solver.start_nodes(nodes, 0.0); }).find("node_k.size()"),
            std::string::npos);
  EXPECT_NE(test::failed_check([&] {
              (void)reference::periodic_response(mesh, 0.0);
            }).find("angular_per_s > 0.0 (0 > 0)"),
            std::string::npos);
  const FaceState face{100.0, 10.0, 290.0};
  EXPECT_DEATH(solver.advance({60.0, 120.0, face, face}, kEmissivity), "segment.start_s");
}

}  // namespace
}  // namespace emit
