// SPDX-License-Identifier: Apache-2.0
// Weather tables that are incomplete: gaps, and spans that the thermal simulation needs.
#include <fmt/format.h>

#include <cmath>

#include "config/config_support.hpp"
#include "emit/physics/climate/rain.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"

namespace emit::config::testing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::int64_t kHourNs = 3'600'000'000'000;
constexpr const char* kHeader =
    "time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,wind_m_s,cloud_frac\n";
constexpr const char* kFile =
    "[place]\nlat_deg = 48.56\nlon_deg = 11.26\n[weather]\nfile = \"w.csv\"\n";
/// A simulation that begins two days before the history.
constexpr const char* kShort = "[thermal]\nhistory_start_s = 0\n";
constexpr const char* kMidnight = "epoch_utc = 2014-06-21T00:00:00Z\n";

/// Weather of a clear day by the models themselves, hourly, at the default place.
std::string clear_day(double from_h, double to_h, const physics::ClearSky& model,
                      double offset_s = 0.0) {
  constexpr std::int64_t kEpochNs = 1'403'308'800'000'000'000;  // 2014-06-21T00:00:00Z
  const physics::GeoPlace place{physics::Radians(48.56 * 0.017453292519943295),
                                physics::Radians(11.26 * 0.017453292519943295),
                                physics::Metres(0.0)};
  std::string out = kHeader;
  for (double h = from_h; h <= to_h; h += 1.0) {
    const double time_s = 3600.0 * h + offset_s;
    const std::int64_t utc_ns = kEpochNs + std::llround(time_s * 1e9);
    const auto f =
        physics::forcing_from_clear_sky(model, place, physics::sun_position(utc_ns, place), utc_ns);
    out += fmt::format("{},{},{},{},{},{},{}\n", time_s, f.direct_normal_w_m2,
                       f.diffuse_horizontal_w_m2, f.longwave_down_w_m2, f.air_k, f.wind_m_s,
                       f.cloud_frac);
  }
  return out;
}

class Weather : public ConfigTest {
 protected:
  scene::ScenarioDesc load(const std::string& csv, const std::string& more = kShort) {
    write("w.csv", csv);
    auto loaded = scenario(kMidnight + std::string(kFile) + more);
    EXPECT_TRUE(loaded.has_value()) << loaded.error().text;
    if (!loaded) return {};
    for (std::string& text : loaded->warnings) text = without_folder(text);
    return std::move(*loaded);
  }
};

TEST_F(Weather, a_table_that_reaches_back_is_taken_as_it_stands) {
  const auto loaded = load(clear_day(-48, 24, {}));
  EXPECT_EQ(loaded.weather.size(), 73U);
  EXPECT_THAT(loaded.warnings, IsEmpty());
}

TEST_F(Weather, gaps_are_named_with_the_usual_spacing) {
  std::string csv = clear_day(-48, 4, {});
  const std::string later = clear_day(20, 24, {});
  csv += later.substr(later.find('\n') + 1);
  const auto loaded = load(csv);
  EXPECT_THAT(loaded.warnings,
              ElementsAre(AllOf(HasSubstr("w.csv: the weather has no rows from 14400 s to 72000 s "
                                          "(16 h)"),
                                HasSubstr("the usual spacing is 3600 s (60 min)"))));
}

TEST_F(Weather, pauses_of_steady_weather_and_short_ones_are_no_gaps) {
  std::string csv = kHeader;
  for (const int time_s : {-172800, -600, 0, 600, 1800, 2400, 80000}) {
    csv += fmt::format("{},0,0,{},290,2,0\n", time_s, time_s == 600 ? 340 : 330);
  }
  EXPECT_THAT(load(csv).warnings, IsEmpty());
}

TEST_F(Weather, one_row_is_constant_weather_at_all_times) {
  const auto loaded = load(std::string(kHeader) + "5000,0,0,330,290,2,0\n");
  EXPECT_EQ(loaded.weather.size(), 1U);
  EXPECT_THAT(loaded.warnings, IsEmpty());
}

TEST_F(Weather, rain_of_the_first_row_has_no_begin_and_is_named) {
  const auto table = [](double from_h, double first_mm_h, double second_mm_h) {
    std::string csv =
        "time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,wind_m_s,cloud_frac,rain_mm_h\n";
    for (double h = from_h; h <= 24.0; h += 1.0) {
      const double mm_h = h == from_h ? first_mm_h : h == from_h + 1.0 ? second_mm_h : 0.0;
      csv += fmt::format("{},0,0,330,290,2,0,{}\n", 3600.0 * h, mm_h);
    }
    return csv;
  };
  const auto rain_mm = [](const scene::ScenarioDesc& loaded) {
    return physics::RainDepth(loaded.weather).at_mm(24 * kHourNs);
  };
  const auto is_named = HasSubstr("states rain of 2.5 mm/h, which is left out");
  const auto whole = load(table(-48, 2.5, 4.0));
  EXPECT_THAT(whole.warnings,
              ElementsAre(AllOf(HasSubstr("w.csv: the first row (-172800 s)"), is_named)));
  EXPECT_DOUBLE_EQ(rain_mm(whole), 4.0);
  // The rows that the models make before the table are dry, and rain of the first row does not
  // reach back into them.
  const auto late = load(table(6, 2.5, 4.0));
  ASSERT_EQ(late.warnings.size(), 2U);
  EXPECT_THAT(late.warnings[0], AllOf(HasSubstr("w.csv: the first row (21600 s)"), is_named));
  EXPECT_DOUBLE_EQ(rain_mm(late), 4.0);
  // Rain of later rows is complete, and one row is rain at all times.
  EXPECT_THAT(load(table(-48, 0.0, 4.0)).warnings, IsEmpty());
  const auto one = load(table(24, 2.5, 0.0));
  EXPECT_THAT(one.warnings, IsEmpty());
  EXPECT_DOUBLE_EQ(rain_mm(one), 60.0);
}

/// Test that the models go on from the table: where the models made the table, they are found
/// again.
TEST_F(Weather, what_a_table_lacks_before_its_first_row_the_clear_sky_models_make) {
  const physics::ClearSky model{.linke_turbidity = 3.5,
                                .air_mean_k = 268.0,
                                .air_amplitude_k = 4.0,
                                .dew_point_k = 260.0,
                                .wind_m_s = 5.0,
                                .cloud_frac = 0.25,
                                .wind_from_rad = std::nullopt};
  const auto loaded = load(clear_day(0, 24, model));
  ASSERT_GT(loaded.weather.size(), 200U);
  EXPECT_EQ(loaded.weather.front().sim_time_ns, -48 * kHourNs);
  EXPECT_NEAR(loaded.clear_sky.air_mean_k, 268.0, 1e-6);
  EXPECT_NEAR(loaded.clear_sky.air_amplitude_k, 4.0, 1e-6);
  EXPECT_NEAR(loaded.clear_sky.dew_point_k, 260.0, 0.5);
  EXPECT_NEAR(loaded.clear_sky.wind_m_s, 5.0, 1e-9);
  EXPECT_NEAR(loaded.clear_sky.cloud_frac, 0.25, 0.01);
  // A noon before the table is as sunny and as warm as the one within.
  const auto before = physics::forcing_from_rows(loaded.weather, -12 * kHourNs);
  const auto within = physics::forcing_from_rows(loaded.weather, 12 * kHourNs);
  EXPECT_NEAR(before.direct_normal_w_m2, within.direct_normal_w_m2, 10.0);
  EXPECT_NEAR(before.air_k, within.air_k, 0.1);
  EXPECT_NEAR(before.longwave_down_w_m2, within.longwave_down_w_m2, 3.0);
  EXPECT_THAT(
      loaded.warnings,
      ElementsAre(AllOf(HasSubstr("w.csv: the weather covers 0 s to 86400 s (2014-06-21T00:00:00Z "
                                  "to 2014-06-22T00:00:00Z)"),
                        HasSubstr("needs it from -172800 s (2014-06-19T00:00:00Z)"),
                        HasSubstr("The clear-sky models make the weather before 0 s"))));
}

TEST_F(Weather, what_the_models_make_keeps_the_vapour_of_the_table) {
  std::string csv =
      "time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,wind_m_s,cloud_frac,"
      "relative_humidity_frac\n";
  for (int hour = 0; hour <= 24; ++hour) {
    csv += fmt::format("{},0,0,330,290,2,0,0.55\n", hour * 3600);
  }
  const auto loaded = load(csv);
  ASSERT_EQ(loaded.weather.front().sim_time_ns, -48 * kHourNs);
  for (const scene::WeatherSample& row : loaded.weather) {
    ASSERT_TRUE(row.relative_humidity_frac.has_value()) << row.sim_time_ns;
    EXPECT_LE(*row.relative_humidity_frac, 1.0);
    EXPECT_NEAR(*row.relative_humidity_frac * physics::saturation_over_water_pa(row.air_k),
                0.55 * physics::saturation_over_water_pa(290.0), 1e-6);
  }
}

TEST_F(Weather, a_completed_table_prints_and_loads_to_the_same_values) {
  const auto first = load(clear_day(0, 24, {}));
  const auto second = load_scenario(write("printed.toml", print_scenario(first)), {}, options_);
  ASSERT_TRUE(second.has_value()) << second.error().text;
  EXPECT_EQ(print_scenario(*second), print_scenario(first));
  EXPECT_THAT(second->warnings, IsEmpty());
}

TEST_F(Weather, stated_parameters_of_the_models_hold) {
  const auto loaded =
      load(clear_day(0, 24, {}), "wind_m_s = 9\nair_mean_k = 280\n" + std::string(kShort));
  EXPECT_EQ(loaded.clear_sky.wind_m_s, 9.0);
  EXPECT_EQ(loaded.clear_sky.air_mean_k, 280.0);
  EXPECT_EQ(loaded.weather.front().wind_m_s, 9.0);
}

TEST_F(Weather, the_published_model_needs_no_more_than_the_history) {
  const auto loaded =
      load(clear_day(0, 24, {}), "[thermal]\nmodel = \"emit2014\"\nhistory_start_s = 0\n");
  EXPECT_EQ(loaded.weather.size(), 25U);
  EXPECT_THAT(loaded.warnings, IsEmpty());
  const auto late =
      load(clear_day(0, 24, {}), "[thermal]\nmodel = \"emit2014\"\nhistory_start_s = -7200\n");
  EXPECT_EQ(late.weather.front().sim_time_ns, -2 * kHourNs);
  EXPECT_THAT(late.warnings, ElementsAre(HasSubstr("needs it from -7200 s")));
}

TEST_F(Weather, a_table_of_another_year_is_named_and_the_models_stand_in) {
  constexpr double kYearS = 365.0 * 86400.0;
  const auto next = load(clear_day(0, 23, {}, kYearS));
  EXPECT_THAT(next.warnings, ElementsAre(HasSubstr("w.csv: the weather covers 31536000 s to "
                                                   "31618800 s (2015-06-21T00:00:00Z to")));
  EXPECT_GT(physics::forcing_from_rows(next.weather, 12 * kHourNs).direct_normal_w_m2, 600.0);
  for (const double years : {-1.0, 20.0}) {
    const auto far = load(clear_day(0, 23, {}, years * kYearS));
    EXPECT_TRUE(far.weather.empty());
    EXPECT_NEAR(far.clear_sky.air_mean_k, 290.0, 0.5);
    EXPECT_THAT(far.warnings,
                ElementsAre(HasSubstr("The clear-sky models make all of the weather")));
  }
}

}  // namespace
}  // namespace emit::config::testing
