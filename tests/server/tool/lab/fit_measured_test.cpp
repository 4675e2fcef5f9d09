// SPDX-License-Identifier: Apache-2.0
// `emit fit --measured` and `emit bench nature`: columns, messages, outputs.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <regex>
#include <sstream>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;

/// A day of dry ground that neither gains nor loses over a day. The numbers are made up; only a fit
/// has to work on them.
std::string logger_text(const std::string& header, double surface_swing_k = 12.0,
                        const std::vector<double>& surface_k = {}) {
  std::string text =
      "# Level field, 48.10 N, 11.50 E, 500 m; times are UTC of 2016-06-21.\n" + header + "\n";
  for (int i = 0; i <= 144; ++i) {
    const double phase = 2.0 * std::numbers::pi * i / 144.0;
    const double sun = std::max(0.0, 800.0 * std::sin(phase - 1.5));
    const double swing_k = surface_swing_k * std::sin(phase - 1.75);
    text +=
        fmt::format("{},{:.1f},{:.1f},{:.1f},{:.2f},{:.1f},{:.4f}\n", 600 * i, sun, 0.2 * sun,
                    320.0 + 15.0 * std::sin(phase - 2.2), 14.0 + 5.0 * std::sin(phase - 2.4),
                    2.5 + std::sin(phase - 2.0),
                    surface_k.empty() ? 289.0 + swing_k : surface_k[static_cast<std::size_t>(i)]);
  }
  return text;
}
constexpr char kHeader[] =
    "time_s,ghi_w_m2,reflected_w_m2,longwave_down_w_m2,air_c,wind_m_s,surface_k";

TEST(CliFitMeasured, writes_a_material_that_loads_and_all_outputs) {
  const TemporaryFolder folder;
  write_text(folder.file("day.csv"), logger_text(kHeader));
  const ProcessResult fit =
      run_emit({"fit", "--measured", folder.file("day.csv"), "--material", "soil", "--toml",
                folder.file("fitted.toml"), "--json", folder.file("fit.json"), "--plot",
                folder.file("fit.svg"), "--history", folder.file("fit.csv")});
  ASSERT_EQ(fit.exit_code, 0) << fit.err;
  EXPECT_THAT(fit.out, HasSubstr("inertia"));
  EXPECT_THAT(fit.out, HasSubstr("absorptance 0.800: reflected over incident sun"));
  EXPECT_THAT(read_text(folder.file("fit.json")), HasSubstr("\"standard_error\""));
  EXPECT_THAT(read_text(folder.file("fit.svg")), HasSubstr("measured"));
  EXPECT_THAT(read_text(folder.file("fit.csv")), HasSubstr("time_s,surface_k,before_k,fitted_k"));
  EXPECT_THAT(read_text(folder.file("fitted.toml")), HasSubstr("base = \"room\""));
  // The library that was written is one: a second fit starts from its numbers and changes little.
  const ProcessResult again =
      run_emit({"fit", "--measured", folder.file("day.csv"), "--material", "soil", "--library",
                folder.file("fitted.toml"), "--json", folder.file("again.json")});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(again.out, HasSubstr("stated by the material"));
}

TEST(CliFitMeasured, names_file_line_and_column_of_what_is_wrong) {
  const TemporaryFolder folder;
  const std::string file = folder.file("day.csv");
  const auto error_of = [&](const std::string& text, std::vector<std::string> more = {}) {
    write_text(file, text);
    more.insert(more.begin(), {"fit", "--measured", file});
    const ProcessResult result = run_emit(more);
    EXPECT_NE(result.exit_code, 0);
    return result.err;
  };
  EXPECT_THAT(error_of("time_s,ghi_w_m2,air_c,wind_m_s,surface_k\n0,0,1,1,280\n"),
              HasSubstr("day.csv:1: there is no column 'longwave_down_w_m2'"));
  std::string text = logger_text(kHeader);
  const std::size_t row = text.find("\n1200,");
  text.replace(row, 6, "\n1200,x");
  EXPECT_THAT(error_of(text), HasSubstr("day.csv:5:"));
  EXPECT_THAT(error_of(logger_text(kHeader, 900.0)), HasSubstr("surface_k"));
  EXPECT_THAT(error_of(logger_text(kHeader), {"--column", "aire_c=x"}), HasSubstr("'air_c'"));
  EXPECT_THAT(error_of(logger_text(kHeader), {"--material", "sol"}), HasSubstr("'soil'"));
  EXPECT_THAT(error_of(logger_text(kHeader).substr(0, 2000)), HasSubstr("h are needed"));
}

TEST(CliFitMeasured, reads_columns_of_other_names_and_units) {
  const TemporaryFolder folder;
  write_text(folder.file("day.csv"), logger_text(kHeader));
  write_text(folder.file("other.csv"), logger_text("time_s,G,reflected_w_m2,Ld,air_c,u,surface_k"));
  const ProcessResult first = run_emit({"fit", "--measured", folder.file("day.csv")});
  const ProcessResult other =
      run_emit({"fit", "--measured", folder.file("other.csv"), "--column", "ghi_w_m2=G", "--column",
                "longwave_down_w_m2=Ld", "--column", "wind_m_s=u"});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  ASSERT_EQ(other.exit_code, 0) << other.err;
  EXPECT_EQ(first.out.substr(first.out.find('\n')), other.out.substr(other.out.find('\n')));
}

TEST(CliFitMeasured, says_aloud_what_does_not_hold) {
  const TemporaryFolder folder;
  write_text(folder.file("day.csv"), logger_text(kHeader, 4.0));
  const ProcessResult cool =
      run_emit({"fit", "--measured", folder.file("day.csv"), "--surface", "moist grass"});
  ASSERT_EQ(cool.exit_code, 0) << cool.err;
  EXPECT_THAT(cool.out, HasSubstr("DOES NOT HOLD: the file speaks of 'grass'"));
  EXPECT_THAT(cool.out, HasSubstr("DOES NOT HOLD: the file speaks of 'moist'"));
  // A surface that stays as cool as that in the sun evaporates, whatever the file says.
  EXPECT_THAT(cool.out, HasSubstr("evaporation is likely"));
  const ProcessResult dry =
      run_emit({"fit", "--measured", folder.file("day.csv"), "--surface", "dry, snow-free"});
  EXPECT_EQ(dry.out.find("speaks of"), std::string::npos) << dry.out;
}

TEST(CliFitMeasured, names_a_sun_that_stands_elsewhere) {
  const TemporaryFolder folder;
  write_text(folder.file("day.csv"), logger_text(kHeader));
  const ProcessResult right = run_emit({"fit", "--measured", folder.file("day.csv")});
  EXPECT_EQ(right.out.find("its time is not UTC"), std::string::npos) << right.out;
  // Seven hours of local time are a hundred degrees of longitude.
  const ProcessResult local =
      run_emit({"fit", "--measured", folder.file("day.csv"), "--lon-deg=-95"});
  ASSERT_EQ(local.exit_code, 0) << local.err;
  EXPECT_THAT(local.out, HasSubstr("came while it stood below the horizon: its time is not UTC"));
  // Direct and diffuse sun that add up to half of the global one.
  std::istringstream lines(logger_text(kHeader));
  std::string text;
  for (std::string line; std::getline(lines, line);) {
    if (line[0] == '#') {
      text += line + "\n";
    } else if (line.starts_with("time_s")) {
      text += line + ",dni_w_m2,dhi_w_m2\n";
    } else {
      const std::size_t comma = line.find(',');
      const double global = std::stod(line.substr(comma + 1));
      text += fmt::format("{},{:.1f},{:.1f}\n", line, 0.0, 0.5 * global);
    }
  }
  write_text(folder.file("half.csv"), text);
  const ProcessResult half = run_emit({"fit", "--measured", folder.file("half.csv")});
  ASSERT_EQ(half.exit_code, 0) << half.err;
  EXPECT_THAT(half.out, HasSubstr("differs from the global sun by 50 % on average"));
}

TEST(CliFitMeasured, names_numbers_that_make_up_for_something_else) {
  const TemporaryFolder folder;
  // The surface is 30 K warmer than the weather explains.
  std::vector<double> warm_k;
  for (int i = 0; i <= 144; ++i) {
    warm_k.push_back(325.0 + 12.0 * std::sin(2.0 * std::numbers::pi * i / 144.0 - 1.75));
  }
  write_text(folder.file("warm.csv"), logger_text(kHeader, 0.0, warm_k));
  const ProcessResult warm =
      run_emit({"fit", "--measured", folder.file("warm.csv"), "--json", folder.file("warm.json")});
  ASSERT_EQ(warm.exit_code, 0) << warm.err;
  EXPECT_THAT(warm.out, HasSubstr("DOES NOT HOLD: "));
  EXPECT_THAT(read_text(folder.file("warm.json")), HasSubstr("\"kind\": \"fit\""));
}

/// Numbers behind a key of a JSON text, in order.
std::vector<double> json_numbers(const std::string& json, const std::string& key) {
  std::vector<double> out;
  const std::regex form("\"" + key + "\": (-?[0-9.e+-]+)");
  for (std::sregex_iterator at(json.begin(), json.end(), form); at != std::sregex_iterator();
       ++at) {
    out.push_back(std::stod((*at)[1]));
  }
  return out;
}

TEST(CliBenchNature, a_day_of_the_model_itself_is_met_and_its_numbers_are_found) {
  const TemporaryFolder folder;
  write_text(folder.file("any.csv"), logger_text(kHeader));
  ASSERT_EQ(run_emit({"fit", "--measured", folder.file("any.csv"), "--history",
                      folder.file("history.csv")})
                .exit_code,
            0);
  std::vector<double> model_k;
  std::istringstream history(read_text(folder.file("history.csv")));
  std::string line;
  std::getline(history, line);
  while (std::getline(history, line)) {
    model_k.push_back(std::stod(line.substr(line.find(',', line.find(',') + 1) + 1)));
  }
  ASSERT_EQ(model_k.size(), 145U);
  std::filesystem::create_directory(folder.file("days"));
  write_text(folder.file("days/a.csv"), logger_text(kHeader, 0.0, model_k));
  // The second day is 3 K warmer throughout.
  for (double& kelvin : model_k) kelvin += 3.0;
  write_text(folder.file("days/b.csv"), logger_text(kHeader, 0.0, model_k));
  const ProcessResult bench = run_emit({"bench", "nature", folder.file("days"), "--json",
                                        folder.file("n.json"), "--plot", folder.file("n.svg")},
                                       std::chrono::seconds(120));
  ASSERT_EQ(bench.exit_code, 0) << bench.err;
  const std::string json = read_text(folder.file("n.json"));
  const std::size_t second = json.find("\"day\": \"b.csv\"");
  ASSERT_NE(second, std::string::npos);
  const std::string a = json.substr(0, second);
  const std::string b = json.substr(second);
  EXPECT_LT(json_numbers(a, "rms_k").front(), 1e-3);
  EXPECT_NEAR(json_numbers(b, "bias_k").front(), -3.0, 1e-2);
  EXPECT_NEAR(json_numbers(b, "rms_k").front(), 3.0, 1e-2);
  // The fitted numbers of the first day are those of the library.
  const std::string fitted = a.substr(a.find("\"two_fitted\""));
  EXPECT_NEAR(json_numbers(fitted, "inertia_factor").front(), 1.0, 1e-2);
  EXPECT_EQ(json_numbers(a, "measured_in_band_frac").front(), 1.0);
  EXPECT_THAT(read_text(folder.file("n.svg")), HasSubstr("<polygon"));
  EXPECT_THAT(bench.out, HasSubstr("MISSED"));
}

TEST(CliBenchNature, moist_ground_evaporates_where_the_humidity_is_known) {
  const TemporaryFolder folder;
  // The same day of grass, with and without a column of the humidity.
  std::string with = logger_text(kHeader);
  std::istringstream lines(with);
  std::string moist;
  std::string line;
  while (std::getline(lines, line)) {
    if (line[0] == '#')
      moist += "# Moist grass.\n" + line + "\n";
    else
      moist += line + (line.starts_with("time_s") ? ",rh_pct\n" : ",65\n");
  }
  write_text(folder.file("moist.csv"), moist);
  write_text(folder.file("unknown.csv"), "# Moist grass.\n" + with);
  const auto report = [&](const std::string& name) {
    const ProcessResult bench = run_emit({"bench", "nature", folder.file(name), "--material",
                                          "lawn", "--json", folder.file("n.json")},
                                         std::chrono::seconds(120));
    EXPECT_EQ(bench.exit_code, 0) << bench.err;
    return read_text(folder.file("n.json"));
  };
  const std::string known = report("moist.csv");
  const std::string unknown = report("unknown.csv");
  EXPECT_THAT(known, HasSubstr("\"dry_layers_hold\": true"));
  EXPECT_THAT(known, HasSubstr("evaporation: humidity of the record"));
  EXPECT_THAT(known, HasSubstr("which is not measured"));
  EXPECT_THAT(unknown, HasSubstr("\"dry_layers_hold\": false"));
  EXPECT_THAT(unknown, HasSubstr("the record has no humidity"));
  // Evaporation cools the mean of the day by kelvins, in the reference and in the real-time model.
  const auto bias = [](const std::string& json, const std::string& part) {
    return json_numbers(json.substr(json.find("\"" + part + "\"")), "bias_k").front();
  };
  EXPECT_LT(bias(known, "nothing_fitted"), bias(unknown, "nothing_fitted") - 2.0);
  EXPECT_NEAR(bias(known, "nothing_fitted_real_time"), bias(known, "nothing_fitted"), 0.3);
}

TEST(CliBenchNature, dry_ground_loses_the_evaporation_that_was_measured) {
  const TemporaryFolder folder;
  std::istringstream lines(logger_text(kHeader));
  std::string measured;
  int row = 0;
  for (std::string line; std::getline(lines, line);) {
    if (line[0] == '#') {
      measured += line + "\n";
    } else if (line.starts_with("time_s")) {
      measured += line + ",latent_w_m2\n";
    } else {
      measured += line + (++row == 5 ? ",nan\n" : ",60\n");
    }
  }
  write_text(folder.file("measured.csv"), measured);
  write_text(folder.file("unknown.csv"), logger_text(kHeader));
  const auto report = [&](const std::string& name) {
    const ProcessResult bench = run_emit({"bench", "nature", folder.file(name), "--surface",
                                          "moist", "--json", folder.file("n.json")},
                                         std::chrono::seconds(120));
    EXPECT_EQ(bench.exit_code, 0) << bench.err;
    return bench.out + read_text(folder.file("n.json"));
  };
  const std::string known = report("measured.csv");
  const std::string unknown = report("unknown.csv");
  EXPECT_THAT(known, HasSubstr("evaporation: of the record (latent_w_m2)"));
  EXPECT_THAT(known, HasSubstr("latent_w_m2 is missing in 1 of "));
  EXPECT_THAT(known, HasSubstr("evaporation takes 60 W/m2 by day, measured: the ground loses it"));
  EXPECT_THAT(known, HasSubstr("\"dry_layers_hold\": true"));
  EXPECT_THAT(unknown, HasSubstr("\"dry_layers_hold\": false"));
  const auto bias = [](const std::string& json, const std::string& part) {
    return json_numbers(json.substr(json.find("\"" + part + "\"")), "bias_k").front();
  };
  EXPECT_LT(bias(known, "nothing_fitted"), bias(unknown, "nothing_fitted") - 1.0);
  EXPECT_NEAR(bias(known, "nothing_fitted_real_time"), bias(known, "nothing_fitted"), 0.3);
}

/// The day of logger_text() as a moist one, colder and windier, with a humidity in every row.
std::string moist_text(double colder_k, double wind_m_s) {
  std::istringstream lines(logger_text(kHeader));
  std::string out;
  std::string line;
  while (std::getline(lines, line)) {
    if (line[0] == '#' || line.starts_with("time_s")) {
      out += line + (line[0] == '#' ? "\n" : ",rh_pct\n");
      continue;
    }
    std::vector<std::string> cells;
    std::istringstream row(line);
    for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
    cells[4] = fmt::format("{}", std::stod(cells[4]) - colder_k);
    cells[5] = fmt::format("{}", std::stod(cells[5]) + wind_m_s);
    cells[6] = fmt::format("{}", std::stod(cells[6]) - colder_k);
    out += fmt::format("{},70\n", fmt::join(cells, ","));
  }
  return out;
}

TEST(CliBenchNature, a_moist_day_says_which_limits_it_passes) {
  const TemporaryFolder folder;
  const auto report = [&](const std::string& text, const std::string& material) {
    write_text(folder.file("day.csv"), text);
    const ProcessResult bench =
        run_emit({"bench", "nature", folder.file("day.csv"), "--material", material},
                 std::chrono::seconds(120));
    EXPECT_EQ(bench.exit_code, 0) << bench.err;
    return bench.out;
  };
  const std::string mild = report(moist_text(0.0, 0.0), "grass");
  for (const char* part : {"nothing fitted", "rms K", "bias K", "max by hour, nothing fitted"}) {
    EXPECT_THAT(mild, HasSubstr(part));
  }
  for (const char* part : {"DOES NOT HOLD: moist ground", "no humidity", "wind above 20"}) {
    EXPECT_EQ(mild.find(part), std::string::npos) << mild;
  }
  const std::string frosty = report(moist_text(15.0, 0.0), "grass");
  EXPECT_THAT(frosty, HasSubstr("DOES NOT HOLD: moist ground is below 0 C for "));
  EXPECT_THAT(report(moist_text(0.0, 20.0), "grass"),
              HasSubstr("less certain: wind above 20 m/s for "));
  EXPECT_THAT(report(moist_text(0.0, 0.0), "snow"),
              HasSubstr("DOES NOT HOLD: 'snow' is above 0 C"));
  EXPECT_THAT(report(logger_text(kHeader), "grass"),
              HasSubstr("DOES NOT HOLD: material 'grass' evaporates, but the record has no "
                        "humidity (rh_pct): it counts as dry layers"));
  // The fit says the same.
  write_text(folder.file("day.csv"), moist_text(15.0, 0.0));
  EXPECT_THAT(run_emit({"fit", "--measured", folder.file("day.csv"), "--material", "grass"}).out,
              HasSubstr("DOES NOT HOLD: moist ground is below 0 C for "));
}

TEST(CliBenchNature, names_what_it_cannot_read) {
  const TemporaryFolder folder;
  EXPECT_EQ(run_emit({"bench", "nature"}).exit_code, 2);
  const ProcessResult empty = run_emit({"bench", "nature", folder.path().string()});
  EXPECT_NE(empty.exit_code, 0);
  EXPECT_THAT(empty.err, HasSubstr("there is no .csv file"));
}

TEST(CliFitMeasured, refuses_options_that_do_not_belong_together) {
  const TemporaryFolder folder;
  write_text(folder.file("day.csv"), logger_text(kHeader));
  EXPECT_EQ(run_emit({"fit"}).exit_code, 2);
  EXPECT_EQ(run_emit({"fit", "box", "--measured", folder.file("day.csv")}).exit_code, 2);
  EXPECT_EQ(run_emit({"fit", "--measured", folder.file("day.csv"), "--material", "soil",
                      "--material", "sand"})
                .exit_code,
            2);
}

}  // namespace
}  // namespace emit::test
