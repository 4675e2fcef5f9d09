// SPDX-License-Identifier: Apache-2.0
// Tests of the GLSL physics functions on the device, against double on the CPU.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <vector>

#include "emit/physics/csv.hpp"
#include "emit/physics/equilibrium.hpp"
#include "emit/physics/surface_balance.hpp"
#include "gpu_rows.hpp"
#include "support/oracle_check.hpp"

namespace emit {
namespace {

using test::run_oracle;
using verify::Device;
using verify::Precision;

TEST(ShaderLib, EquilibriumTemperatureOfEveryRowWithinAMillikelvin) {
  const auto run = run_oracle("equilibrium", "quartic_roots.csv", Precision::float32, Device::gpu);
  const auto t = run.column("Ts");
  for (std::size_t i = 0; i < t.got.size(); ++i) {
    EXPECT_NEAR(t.got[i], t.expected[i], 1e-3) << "row " << i;
  }
}

TEST(ShaderLib, BalanceOfTheWorkedExampleWithinAMillikelvin) {
  const auto run = run_oracle("balance", "golden_example.csv", Precision::float32, Device::gpu);
  for (const char* name : {"E_abs", "Ta", "Ts", "Ts_conv"}) {
    const auto c = run.column(name);
    for (std::size_t i = 0; i < c.got.size(); ++i) {
      EXPECT_NEAR(c.got[i], c.expected[i], 1e-3) << name << " row " << i;
    }
  }
}

TEST(ShaderLib, BandRadianceWithinOneInTenThousandFrom200KelvinUp) {
  const auto run =
      run_oracle("band-radiance", "planck_inband.csv", Precision::float32, Device::gpu);
  const auto temperature = *run.expected.numbers("T_K");
  for (const char* name : {"L_3_5", "L_3.4_4.1", "L_8_12", "L_7.7_9.3"}) {
    const auto c = run.column(name);
    for (std::size_t i = 0; i < c.got.size(); ++i) {
      if (temperature[i] >= 200.0) {
        EXPECT_NEAR(c.got[i] / c.expected[i], 1.0, 1e-4)
            << name << " at " << temperature[i] << " K";
      } else {
        // The row is colder than any scene: the table is coarser there, and the radiance almost
        // zero.
        EXPECT_NEAR(c.got[i], c.expected[i], 1e-3 * c.expected[i] + 1e-30)
            << name << " at " << temperature[i] << " K";
      }
    }
  }
}

/// Columns of an evaluated model.
physics::CsvTable air_rows(const char* model, const std::filesystem::path& table,
                           Precision precision, Device device) {
  verify::EvaluateRequest request;
  request.model = model;
  request.table = table;
  request.precision = precision;
  request.device = device;
  const auto result = verify::evaluate(request);
  EXPECT_TRUE(result) << result.error().text;
  auto rows = physics::CsvTable::parse(result ? *result : "", "result");
  EXPECT_TRUE(rows) << rows.error().text;
  return std::move(*rows);
}

TEST(ShaderLib, AirAgreesWithItsTwinAndWithTheModel) {
  const auto folder = std::filesystem::path(EMIT_TEST_BINARY_DIR) / "shader_lib_test";
  std::filesystem::create_directories(folder);
  std::ofstream paths(folder / "path.csv");
  paths << "model,vis_km,band,source,h_sensor_m,h_target_m,range_m\n";
  std::ofstream skies(folder / "sky.csv");
  skies << "model,vis_km,band,h_sensor_m,elevation_deg\n";
  std::ofstream lit_paths(folder / "lit_path.csv");
  lit_paths << "model,vis_km,band,source,h_sensor_m,h_target_m,range_m,sun_elevation_deg,"
               "sun_azimuth_deg\n";
  std::ofstream lit_skies(folder / "lit_sky.csv");
  lit_skies << "model,vis_km,band,h_sensor_m,elevation_deg,sun_elevation_deg,sun_azimuth_deg\n";
  for (const char* band : {"3-5", "8-12"}) {
    for (const double sensor_m : {70.0, 4000.0}) {
      for (const double sun_deg : {-3.0, 4.0, 50.0}) {
        for (const double azimuth_deg : {0.0, 20.0, 170.0}) {
          for (const double range_m : {30.0, 9000.0}) {
            lit_paths << "us_standard,10," << band << ",300K," << sensor_m << ',' << sensor_m + 25.0
                      << ',' << range_m << ',' << sun_deg << ',' << azimuth_deg << '\n';
          }
          for (const double elevation_deg : {1.0, 30.0}) {
            lit_skies << "us_standard,10," << band << ',' << sensor_m << ',' << elevation_deg << ','
                      << sun_deg << ',' << azimuth_deg << '\n';
          }
        }
      }
    }
  }
  lit_paths.close();
  lit_skies.close();
  std::ofstream suns(folder / "sun.csv");
  suns << "model,vis_km,band,sun_elevation_deg\n";
  for (const char* band : {"3-5", "3.4-4.1", "8-12", "7.7-9.3"}) {
    for (const double sensor_m : {0.0, 70.0, 2000.0, 9000.0}) {
      for (const double target_m : {0.0, 500.0, 4300.0}) {
        for (const double beyond_m : {3.0, 200.0, 6000.0, 40000.0}) {
          for (const char* source : {"300K", "800K", "sun", "flat"}) {
            paths << "midlatitude_summer,23," << band << ',' << source << ',' << sensor_m << ','
                  << target_m << ',' << std::hypot(beyond_m, target_m - sensor_m) << '\n';
          }
        }
      }
      for (const double elevation_deg : {-0.2, 0.5, 5.0, 30.0, 90.0}) {
        skies << "midlatitude_summer,23," << band << ',' << sensor_m << ',' << elevation_deg
              << '\n';
      }
    }
    for (const double elevation_deg : {-1.0, 5.0, 20.0, 70.0}) {
      suns << "midlatitude_summer,23," << band << ',' << elevation_deg << '\n';
    }
  }
  paths.close();
  skies.close();
  suns.close();
  struct Case {
    const char* model;
    const char* file;
    std::vector<const char*> columns;
  };
  for (const Case& c : {Case{"air-path", "path.csv", {"tau_band", "path_radiance_w_m2_sr"}},
                        Case{"air-sky", "sky.csv", {"tau_flat", "tau_sun", "sky_radiance_w_m2_sr"}},
                        Case{"air-path", "lit_path.csv", {"tau_band", "path_radiance_w_m2_sr"}},
                        Case{"air-sky", "lit_sky.csv", {"tau_sun", "sky_radiance_w_m2_sr"}},
                        Case{"air-sun", "sun.csv", {"e_ground_w_m2"}}}) {
    const auto exact = air_rows(c.model, folder / c.file, Precision::float64, Device::cpu);
    const auto twin = air_rows(c.model, folder / c.file, Precision::float32, Device::cpu);
    const auto shader = air_rows(c.model, folder / c.file, Precision::float32, Device::gpu);
    for (const char* name : c.columns) {
      const auto want = *exact.numbers(name);
      const auto close = *twin.numbers(name);
      const auto got = *shader.numbers(name);
      ASSERT_EQ(got.size(), want.size());
      for (std::size_t i = 0; i < want.size(); ++i) {
        EXPECT_NEAR(got[i], close[i], 2e-4 * close[i] + 1e-7) << c.model << ' ' << name << i;
        // The table between its nodes.
        const double bound = name[0] == 't' ? 0.012 : 0.05 * want[i] + 1e-9;
        EXPECT_NEAR(got[i], want[i], bound) << c.model << ' ' << name << ' ' << i;
      }
    }
  }
}

TEST(ShaderLib, RelaxationAtEveryQueryWithinTwoMillikelvin) {
  const auto run = run_oracle("relaxation", "relax_queries.csv", Precision::float32, Device::gpu);
  const auto t = run.column("T_K");
  for (std::size_t i = 0; i < t.got.size(); ++i) {
    EXPECT_NEAR(t.got[i], t.expected[i], 2e-3) << "row " << i;
  }
}

TEST(ShaderLib, EquilibriumOfAMillionRandomSurfacesIsFiniteAndWithinAMillikelvin) {
  // The inputs are lambda 0.02..400, d 1e-4..1, eps 0.02..1, Ta 0..1000, Tc 200..400. One in four
  // draws lies on an edge.
  constexpr std::size_t kRows = 1000000;
  constexpr std::size_t kStride = 7;
  std::mt19937_64 random(20260621);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto draw = [&] {
    const double u = unit(random);
    return u < 0.125 ? 0.0 : u > 0.875 ? 1.0 : (u - 0.125) / 0.75;
  };
  const auto logarithmic = [&](double lo, double hi) { return lo * std::pow(hi / lo, draw()); };
  std::vector<float> rows;
  rows.reserve(kRows * kStride);
  for (std::size_t i = 0; i < kRows; ++i) {
    const bool film = i % 4 == 0;
    for (const double v :
         {logarithmic(0.02, 400.0), logarithmic(1e-4, 1.0), logarithmic(0.02, 1.0), 1000.0 * draw(),
          200.0 + 200.0 * draw(), film ? 100.0 * draw() : 0.0, 230.0 + 100.0 * draw()}) {
      rows.push_back(static_cast<float>(v));
    }
  }
  verify::GpuRows job;
  job.shader = "passes/evaluate_equilibrium.comp";
  job.inputs = rows;
  job.input_stride = kStride;
  job.output_stride = 2;
  const auto got = verify::run_gpu_rows(job);
  ASSERT_TRUE(got.has_value()) << got.error().text;
  ASSERT_EQ(got->size(), 2 * kRows);

  double worst_k = 0.0;
  std::size_t worst_row = 0;
  std::size_t not_finite = 0;
  for (std::size_t i = 0; i < kRows; ++i) {
    const auto at = [&](std::size_t column) {
      return static_cast<double>(rows[i * kStride + column]);
    };
    const auto balance = physics::surface_balance(
        physics::environment_input_w_m2(at(2), at(3)),
        physics::SurfaceExchange<double>{at(2), at(0) / at(1), at(4), at(5), at(6)});
    const float t = (*got)[2 * i];
    if (!std::isfinite(t)) {
      ++not_finite;
      continue;
    }
    const double miss =
        std::abs(static_cast<double>(t) - physics::solve_equilibrium(balance).temperature_k);
    if (miss > worst_k) {
      worst_k = miss;
      worst_row = i;
    }
  }
  EXPECT_EQ(not_finite, 0U);
  EXPECT_LE(worst_k, 1e-3) << "row " << worst_row;
}

TEST(ShaderLib, SourcesThatGiveNoTemperatureStayFinite) {
  // The columns are lambda, d, eps, Ta, Tc, hc, Tair; the rows no emission, no source, a negative
  // source and a foil.
  const std::vector<float> rows = {1,   1,     0, 300, 300, 0, 0,  //
                                   1,   1,     1, 0,   0,   0, 0,  //
                                   1,   1,     1, 0,   -90, 0, 0,  //
                                   400, 1e-4F, 0, 0,   0,   0, 0};
  verify::GpuRows job;
  job.shader = "passes/evaluate_equilibrium.comp";
  job.inputs = rows;
  job.input_stride = 7;
  job.output_stride = 2;
  const auto got = verify::run_gpu_rows(job);
  ASSERT_TRUE(got.has_value()) << got.error().text;
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_TRUE(std::isfinite((*got)[2 * i])) << i;
    EXPECT_GE((*got)[2 * i], 0.0F) << i;
  }
  EXPECT_NEAR((*got)[0], 300.0F, 0.01F);
}

}  // namespace
}  // namespace emit
