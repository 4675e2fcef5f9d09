// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "emit/physics/csv.hpp"
#include "emit/verify/evaluate.hpp"
#include "result_writer.hpp"

namespace emit::verify {
namespace {

using physics::ErrorCode;
using testing::HasSubstr;

TEST(ResultWriter, DigitsRoundTripAndNanHasNoSign) {
  const std::vector<double> exact[] = {{0.1, -std::numeric_limits<double>::quiet_NaN()}};
  EXPECT_EQ(write_csv("T", exact), "T\n0.10000000000000001\nnan\n");
  const std::vector<float> single[] = {{0.1F}, {std::numeric_limits<float>::infinity()}};
  EXPECT_EQ(write_csv("a,b", single), "a,b\n0.100000001,inf\n");
}

class Evaluate : public testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) {
    const auto folder = std::filesystem::path(EMIT_TEST_BINARY_DIR) / "evaluate_test" /
                        testing::UnitTest::GetInstance()->current_test_info()->name();
    std::filesystem::create_directories(folder);
    std::ofstream(folder / name, std::ios::binary) << text;
    return folder / name;
  }
  EvaluateRequest request(const std::string& model, const std::string& table) {
    EvaluateRequest r;
    r.model = model;
    r.table = write("in.csv", table);
    return r;
  }
};

TEST_F(Evaluate, ListsItsModels) {
  std::vector<std::string_view> names;
  for (const ModelInfo& model : models()) names.push_back(model.name);
  EXPECT_THAT(names, testing::UnorderedElementsAre(
                         "equilibrium", "balance", "band-radiance", "relaxation", "sun-position",
                         "sun-disc", "wall-shadow", "sky-view", "conduction-slab",
                         "conduction-semi-infinite", "conduction-layered", "conduction-lateral",
                         "surface-history", "air-path", "fog-path", "air-sky", "air-sun"));
}

TEST_F(Evaluate, FogGivesOneRowForEachRowAndNamesWhatItDoesNotKnow) {
  const std::string path = "kind,visibility_m,top_m,band,h_sensor_m,h_target_m,range_m\n";
  // A line of sight from 100 m to the ground lies in the fog from half-way on.
  const auto rows =
      evaluate(request("fog-path", path + "heavy_advection,200,50,8-12,100,0,200\n"
                                          "heavy_advection,200,50,8-12,100,60,nan\n"));
  ASSERT_TRUE(rows.has_value()) << rows.error().text;
  EXPECT_THAT(*rows, HasSubstr(",100,100,0.1068"));
  EXPECT_THAT(*rows, testing::EndsWith(",nan,nan,nan\n"));
  for (const auto& [row, fault] :
       {std::pair{"smog,200,50,8-12,0,0,1\n", "in.csv:2: column 'kind': 'smog'"},
        std::pair{"heavy_advection,0,50,8-12,0,0,1\n", "in.csv:2: column 'visibility_m'"},
        std::pair{"heavy_advection,200,50,12-8,0,0,1\n", "in.csv:2: column 'band': '12-8'"}}) {
    const auto bad = evaluate(request("fog-path", path + row));
    ASSERT_FALSE(bad.has_value()) << row;
    EXPECT_THAT(bad.error().text, HasSubstr(fault));
  }
}

TEST_F(Evaluate, AirGivesOneRowForEachRowAndNamesWhatItDoesNotKnow) {
  const std::string path = "model,vis_km,band,source,h_sensor_m,h_target_m,range_m\n";
  const auto clear = evaluate(request("air-path", path + "tropical,23,8-12,300K,5,5,0\n"
                                                         "tropical,23,8-12,flat,5,5,nan\n"));
  ASSERT_TRUE(clear.has_value()) << clear.error().text;
  EXPECT_THAT(*clear, testing::StartsWith("tau_band,path_radiance_w_m2_sr\n"));
  EXPECT_THAT(*clear, testing::EndsWith("\nnan,nan\n"));
  for (const auto& [row, fault] :
       {std::pair{"martian,23,8-12,flat,0,0,1\n", "in.csv:2: column 'model': 'martian'"},
        std::pair{"tropical,23,1-2,flat,0,0,1\n", "in.csv:2: column 'band': '1-2'"},
        std::pair{"tropical,0.1,8-12,flat,0,0,1\n", "in.csv:2: column 'vis_km'"},
        std::pair{"tropical,23,8-12,lamp,0,0,1\n", "in.csv:2: column 'source': 'lamp'"}}) {
    const auto bad = evaluate(request("air-path", path + row));
    ASSERT_FALSE(bad.has_value()) << row;
    EXPECT_THAT(bad.error().text, HasSubstr(fault));
  }
  const auto sky = evaluate(
      request("air-sky", "model,vis_km,band,h_sensor_m,elevation_deg\nus_standard,5,3-5,2,90\n"));
  ASSERT_TRUE(sky.has_value()) << sky.error().text;
  EXPECT_THAT(*sky, testing::StartsWith("tau_flat,tau_sun,sky_radiance_w_m2_sr\n0."));
  // A sun adds what the air scatters: nothing at night, and most of it near the sun.
  const std::string lit =
      "model,vis_km,band,h_sensor_m,elevation_deg,sun_elevation_deg,sun_azimuth_deg\n";
  const auto radiance = [&](const std::string& row) {
    const auto text = evaluate(request("air-sky", lit + row));
    EXPECT_TRUE(text) << text.error().text;
    return physics::CsvTable::parse(*text, "result")->numbers("sky_radiance_w_m2_sr")->at(0);
  };
  const double night = radiance("us_standard,5,3-5,2,30,-5,0\n");
  const double away = radiance("us_standard,5,3-5,2,30,40,90\n");
  const double near = radiance("us_standard,5,3-5,2,30,40,0\n");
  EXPECT_GT(away, 1.005 * night);
  EXPECT_GT(near, 1.5 * away);
  EXPECT_EQ(radiance("us_standard,5,8-12,2,30,40,0\n"), radiance("us_standard,5,8-12,2,30,-5,0\n"));
  EXPECT_TRUE(std::isnan(radiance("us_standard,5,3-5,2,30,95,0\n")));
  const auto half = evaluate(
      request("air-sky",
              "model,vis_km,band,h_sensor_m,elevation_deg,sun_elevation_deg\nus_standard,5,3-5,2,"
              "90,30\n"));
  ASSERT_FALSE(half.has_value());
  EXPECT_THAT(half.error().text, HasSubstr("sun_azimuth_deg"));
  const auto sun =
      evaluate(request("air-sun", "model,vis_km,band,sun_elevation_deg\nus_standard,5,3-5,-1\n"));
  ASSERT_TRUE(sun.has_value()) << sun.error().text;
  EXPECT_EQ(*sun, "e_ground_w_m2\n0\n");
}

TEST_F(Evaluate, RowsKeepTheirOrderAndExtraColumnsAreIgnored) {
  const auto result =
      evaluate(request("equilibrium",
                       "note,Tair,hc,Tc,Ta,eps,d,lambda\r\nhot,300,0,300,300,1,1,1\r\n"
                       "cold,300,0,250,250,0.5,0.1,2\r\n"));
  ASSERT_TRUE(result.has_value()) << result.error().text;
  EXPECT_EQ(*result, "Ts\n300\n250\n");
}

TEST_F(Evaluate, UndefinedRowsAreNanAndTheOthersAreNot) {
  const std::string header = "lambda,d,eps,Ta,Tc,hc,Tair\n";
  const auto result = evaluate(request(
      "equilibrium", header + "1,0,1,300,300,0,300\n1,1,1,nan,300,0,300\n1,1,1,0,-50,0,300\n"
                              "1,1,1,300,300,0,300\n1,1,1,300,300,nan,300\n0,1,1,300,300,0,300\n"));
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(*result, "Ts\nnan\nnan\nnan\n300\nnan\n300\n");
}

TEST_F(Evaluate, BalanceReadsBothSensesOfTheAlbedoColumn) {
  const std::string header =
      "S_d,S_i,R_e,R_LW,alb,alb_reading,beta,f_d,f_i,eps,lambda,d,Tc,hc,Tair\n";
  const auto result = evaluate(
      request("balance", header + "1000,0,0,0,0.75,albedo,0.5,0.5,0.5,0.9,1,0.1,300,0,300\n"
                                  "1000,0,0,0,0.75,absorptivity,0.5,0.5,0.5,0.9,1,0.1,300,0,300\n"
                                  "0,0,-4000,0,0.75,albedo,0,0,0,0.9,1,0.1,300,20,300\n"));
  ASSERT_TRUE(result.has_value()) << result.error().text;
  EXPECT_THAT(*result, testing::StartsWith("E_abs,Ta,Ts,Ts_conv\n62.5,"));
  EXPECT_THAT(*result, HasSubstr("\n187.5,"));
  // The surface emits more than conduction can supply, so there is no radiative and no plain
  // equilibrium temperature.
  EXPECT_THAT(*result, HasSubstr("\n-4000,nan,nan,"));
  EXPECT_THAT(*result, testing::Not(testing::EndsWith("nan\n")));

  const auto bad = evaluate(request("balance", header + "1,0,0,0,0.75,maybe,0,1,1,1,1,1,1,1,1\n"));
  ASSERT_FALSE(bad.has_value());
  EXPECT_THAT(bad.error().text, HasSubstr("in.csv:2: column 'alb_reading': 'maybe'"));
}

TEST_F(Evaluate, BandRadianceIsZeroAtZeroAndNanBelow) {
  auto r = request("band-radiance", "T_K\n0\n-1\nnan\n");
  EXPECT_EQ(*evaluate(r),
            "L_3_5,L_3.4_4.1,L_8_12,L_7.7_9.3\n0,0,0,0\nnan,nan,nan,nan\nnan,nan,nan,nan\n");
  r.precision = Precision::float32;
  EXPECT_EQ(*evaluate(r),
            "L_3_5,L_3.4_4.1,L_8_12,L_7.7_9.3\n0,0,0,0\nnan,nan,nan,nan\nnan,nan,nan,nan\n");
}

const char* const kCaseHeader = "case,kind,n,tau1,tau2,tau3,w1,w2,w3,x0_1,x0_2,x0_3\n";

TEST_F(Evaluate, RelaxationHoldsTheDriveOutsideItsNodes) {
  // The time constant is so short that the state equals the drive, which shows the drive in use at
  // each time.
  auto r = request("relaxation",
                   "t_s,case\n5,c\n15,c\n25,c\n99,c\n5,l\n15,l\n20,l\n99,l\n-1,l\n0,l\nnan,l\n");
  r.cases = write("cases.csv", std::string(kCaseHeader) +
                                   "c,const,1,1e-3,1,1,1,0,0,250,0,0\n"
                                   "l,linear,1,1e-3,1,1,1,0,0,250,0,0\n");
  r.nodes = write("nodes.csv", "case,t_s,u_K\nc,10,300\nl,20,320\nc,20,310\nl,10,300\nother,0,1\n");
  const auto result = evaluate(r);
  ASSERT_TRUE(result.has_value()) << result.error().text;
  auto lines = physics::CsvTable::parse(*result, "out");
  const auto t = *lines->numbers("T_K");
  ASSERT_EQ(t.size(), 11U);
  EXPECT_NEAR(t[0], 300.0, 1e-9);  // the first node's drive holds before it
  EXPECT_NEAR(t[1], 300.0, 1e-9);  // constant from node to node
  EXPECT_NEAR(t[2], 310.0, 1e-9);
  EXPECT_NEAR(t[3], 310.0, 1e-9);  // the last node's drive holds after it
  EXPECT_NEAR(t[4], 300.0, 1e-9);
  EXPECT_NEAR(t[5], 310.0 - 0.002, 1e-9);  // the state follows a ramp one tau behind
  EXPECT_NEAR(t[6], 320.0 - 0.002, 1e-9);
  EXPECT_NEAR(t[7], 320.0, 1e-9);
  EXPECT_TRUE(std::isnan(t[8]));  // the time is before that of the given state
  EXPECT_EQ(t[9], 250.0);
  EXPECT_TRUE(std::isnan(t[10]));
}

TEST_F(Evaluate, RelaxationTakesTwoNodesAtOneInstantAsAJump) {
  auto r = request("relaxation", "case,t_s\na,9.999\na,10.5\n");
  r.cases = write("cases.csv", std::string(kCaseHeader) + "a,linear,1,1e-3,1,1,1,0,0,300,0,0\n");
  r.nodes = write("nodes.csv", "case,t_s,u_K\na,0,300\na,10,300\na,10,320\na,20,320\n");
  const auto t = *physics::CsvTable::parse(*evaluate(r), "out")->numbers("T_K");
  EXPECT_NEAR(t[0], 300.0, 1e-9);
  EXPECT_NEAR(t[1], 320.0, 1e-9);
}

TEST_F(Evaluate, RelaxationErrorsNameFileLineAndCase) {
  auto r = request("relaxation", "case,t_s\nx,1\n");
  EXPECT_EQ(evaluate(r).error().code, ErrorCode::invalid_argument);
  EXPECT_THAT(evaluate(r).error().text, HasSubstr("--cases"));
  r.nodes = write("nodes.csv", "case,t_s,u_K\n");
  const auto with_case = [&](const std::string& line) {
    r.cases = write("cases.csv", kCaseHeader + line);
    return evaluate(r).error().text;
  };
  EXPECT_THAT(with_case("a,const,1,1,1,1,1,0,0,300,0,0\n"),
              HasSubstr("in.csv:2: case 'x' is not in"));
  EXPECT_THAT(with_case("x,const,1,1,1,1,1,0,0,300,0,0\n"), HasSubstr("nodes.csv"));
  EXPECT_THAT(with_case("x,step,1,1,1,1,1,0,0,300,0,0\n"), HasSubstr("cases.csv:2: column 'kind'"));
  EXPECT_THAT(with_case("x,const,4,1,1,1,1,0,0,300,0,0\n"), HasSubstr("column 'n'"));
  EXPECT_THAT(with_case("x,const,2,1,0,1,1,0,0,300,0,0\n"), HasSubstr("column 'tau2'"));
}

TEST_F(Evaluate, BadUsageIsTold) {
  auto unknown = request("warp", "a\n1\n");
  EXPECT_EQ(evaluate(unknown).error().code, ErrorCode::invalid_argument);
  EXPECT_THAT(evaluate(unknown).error().text, HasSubstr("equilibrium, balance"));

  auto doubled = request("band-radiance", "T_K\n300\n");
  doubled.device = Device::gpu;
  EXPECT_EQ(evaluate(doubled).error().code, ErrorCode::invalid_argument);
  EXPECT_THAT(evaluate(doubled).error().text, HasSubstr("--precision float32 --device gpu"));

  auto sun = request("sun-position", "year\n2026\n");
  sun.precision = Precision::float32;
  EXPECT_EQ(evaluate(sun).error().code, ErrorCode::invalid_argument);

  auto missing = request("band-radiance", "T\n300\n");
  EXPECT_EQ(evaluate(missing).error().code, ErrorCode::invalid_argument);
  EXPECT_THAT(evaluate(missing).error().text, HasSubstr("column 'T_K' is missing"));
  missing.table = "/nonexistent.csv";
  EXPECT_EQ(evaluate(missing).error().code, ErrorCode::not_found);
}

TEST_F(Evaluate, EmptyTablesGiveAHeaderOnly) {
  EXPECT_EQ(*evaluate(request("band-radiance", "T_K\n")), "L_3_5,L_3.4_4.1,L_8_12,L_7.7_9.3\n");
}

}  // namespace
}  // namespace emit::verify
