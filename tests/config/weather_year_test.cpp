// SPDX-License-Identifier: Apache-2.0
// Weather files of building simulation.
#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <numbers>
#include <sstream>

#include "config/config_support.hpp"
#include "emit/config/weather_planes.hpp"
#include "emit/physics/climate/rain.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/sun.hpp"
#include "tables/weather_year.hpp"

namespace emit::config::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::int64_t kHourNs = 3'600'000'000'000;
constexpr int kMonthDays[12] = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
constexpr const char* kEpwHead =
    "LOCATION,Somewhere,XX,YYY,made,0,40.0,-105.0,-7.0,1500.0\n"
    "DESIGN CONDITIONS,0\nTYPICAL/EXTREME PERIODS,0\nGROUND TEMPERATURES,0\n"
    "HOLIDAYS/DAYLIGHT SAVINGS,No,0,0,0\nCOMMENTS 1,\"a, b\"\nCOMMENTS 2,\n"
    "DATA PERIODS,1,1,Data,Sunday,1/1,12/31\n";
constexpr const char* kScenario =
    "epoch_utc = 2024-06-21T07:00:00Z\n"
    "[place]\nlat_deg = 40.0\nlon_deg = -105.0\nheight_m = 1500\n[weather]\nfile = \"w.epw\"\n";

/// One record of the made year.
struct Hour {
  int year = 0;
  int month = 1;
  int day = 1;
  int hour = 1;  ///< 1 to 24
  double air_c = 0.0;
  double longwave_w_m2 = 300.0;
  double beam_w_m2 = 0.0;
  double diffuse_w_m2 = 0.0;
  double rain_mm = 0.0;
  double rain_h = 1.0;
};

/// A year whose sun comes from 7 h to 17 h, in whole numbers, and whose air warms by the hour.
/// Years change from month to month, as in typical years.
std::vector<Hour> made_year() {
  std::vector<Hour> out;
  for (int month = 1; month <= 12; ++month) {
    for (int day = 1; day <= kMonthDays[month - 1]; ++day) {
      for (int hour = 1; hour <= 24; ++hour) {
        Hour record{1990 + month % 3, month, day, hour};
        record.air_c = hour + 0.1 * month;
        const double height = std::sin((hour - 7.5) * std::numbers::pi / 10.0);
        if (hour > 7 && hour <= 17) {
          record.beam_w_m2 = std::round(850.0 * std::sqrt(height) * (day % 3 == 0 ? 0.2 : 1.0));
          record.diffuse_w_m2 = std::round(120.0 * height);
        }
        out.push_back(record);
      }
    }
  }
  return out;
}

std::string epw(const std::vector<Hour>& hours) {
  std::string out = kEpwHead;
  for (const Hour& h : hours) {
    out += fmt::format(
        "{},{},{},{},0,?9,{},-5,50,85000,0,0,{},0,{},{},0,0,0,0,180,3.5,5,5,20,20000,9,0,10,0,0,88,"
        "0,{},{}\n",
        h.year, h.month, h.day, h.hour, h.air_c, h.longwave_w_m2, h.beam_w_m2, h.diffuse_w_m2,
        h.rain_mm, h.rain_h);
  }
  return out;
}

const scene::WeatherSample& row_at(const scene::ScenarioDesc& scenario, double hours) {
  const auto found = std::ranges::find(scenario.weather, std::llround(hours * 3.6e12),
                                       &scene::WeatherSample::sim_time_ns);
  EXPECT_NE(found, scenario.weather.end()) << hours;
  return *found;
}

/// Average over an hour of what is linear between the rows.
double average(const scene::ScenarioDesc& scenario, double from_h,
               double scene::WeatherSample::*member) {
  double sum = 0.0;
  for (int quarter = 0; quarter < 4; ++quarter) {
    sum += 0.125 * (row_at(scenario, from_h + 0.25 * quarter).*member +
                    row_at(scenario, from_h + 0.25 * (quarter + 1)).*member);
  }
  return sum;
}

TEST_F(ConfigTest, epw_hours_end_where_they_say_and_keep_their_averages) {
  write("w.epw", epw(made_year()));
  const auto loaded = scenario(kScenario);
  ASSERT_TRUE(loaded) << loaded.error().text;
  EXPECT_THAT(loaded->warnings, IsEmpty());
  // The epoch is midnight of local standard time. The air of 15:00 is there at 15:00.
  EXPECT_NEAR(row_at(*loaded, 15.0).air_k, 273.15 + 15.6, 1e-9);
  EXPECT_NEAR(row_at(*loaded, 14.5).air_k, 273.15 + 15.1, 1e-9);
  EXPECT_NEAR(row_at(*loaded, -24.0 * 21.0 + 15.0).air_k, 273.15 + 15.5, 1e-9) << "31 May";
  EXPECT_NEAR(row_at(*loaded, 15.0).longwave_down_w_m2, 300.0, 1e-9);
  EXPECT_EQ(row_at(*loaded, 15.0).cloud_frac, 0.0);
  // Every hour of ten days keeps its sun, which nothing shows at night.
  const auto hours = made_year();
  double worst_w_m2 = 0.0;
  for (int day = 0; day < 10; ++day) {
    for (int hour = 1; hour <= 24; ++hour) {
      const auto wanted = std::ranges::find_if(hours, [&](const Hour& h) {
        return h.month == 6 && h.day == 21 - day && h.hour == hour;
      });
      const double from_h = -24.0 * day + hour - 1;
      worst_w_m2 = std::max(
          {worst_w_m2,
           std::abs(average(*loaded, from_h, &scene::WeatherSample::direct_normal_w_m2) -
                    wanted->beam_w_m2),
           std::abs(average(*loaded, from_h, &scene::WeatherSample::diffuse_horizontal_w_m2) -
                    wanted->diffuse_w_m2)});
    }
  }
  EXPECT_LT(worst_w_m2, 0.2);
  for (const scene::WeatherSample& row : loaded->weather) {
    ASSERT_GE(row.direct_normal_w_m2, 0.0);
    ASSERT_LT(row.direct_normal_w_m2, 1400.0);
  }
}

TEST_F(ConfigTest, epw_every_hour_of_the_year_is_that_of_the_file) {
  const auto hours = made_year();
  write("w.epw", epw(hours));
  // The epoch is new year, local standard time, of a year without a leap day.
  const auto loaded = scenario(
      "epoch_utc = 2023-01-01T07:00:00Z\n[place]\nlat_deg = 40.0\nlon_deg = -105.0\n"
      "height_m = 1500\n[weather]\nfile = \"w.epw\"\n");
  ASSERT_TRUE(loaded) << loaded.error().text;
  const auto first = std::ranges::lower_bound(loaded->weather, std::int64_t{0}, {},
                                              &scene::WeatherSample::sim_time_ns);
  ASSERT_EQ(first->sim_time_ns, 0);
  ASSERT_EQ(hours.size(), 8760U);
  double beam_off = 0.0;
  double beam_sum = 0.0;
  double diffuse_off = 0.0;
  double diffuse_sum = 0.0;
  for (std::size_t i = 0; i < hours.size(); ++i) {
    const auto* rows = &*(first + static_cast<std::ptrdiff_t>(4 * i));
    // Values of an instant are there at the end of their hour.
    ASSERT_EQ(rows[4].sim_time_ns, static_cast<std::int64_t>(i + 1) * kHourNs);
    ASSERT_NEAR(rows[4].air_k, physics::kZeroCelsiusK + hours[i].air_c, 1e-9) << i;
    ASSERT_NEAR(rows[4].longwave_down_w_m2, 300.0, 1e-9) << i;
    ASSERT_NEAR(rows[4].wind_m_s, 3.5, 1e-9) << i;
    ASSERT_NEAR(*rows[4].wind_from_rad, std::numbers::pi, 1e-9) << i;
    const auto mean = [&](double scene::WeatherSample::*member) {
      return 0.125 * (rows[0].*member + rows[4].*member) +
             0.25 * (rows[1].*member + rows[2].*member + rows[3].*member);
    };
    beam_off += std::abs(mean(&scene::WeatherSample::direct_normal_w_m2) - hours[i].beam_w_m2);
    diffuse_off +=
        std::abs(mean(&scene::WeatherSample::diffuse_horizontal_w_m2) - hours[i].diffuse_w_m2);
    beam_sum += hours[i].beam_w_m2;
    diffuse_sum += hours[i].diffuse_w_m2;
  }
  EXPECT_LT(beam_off, 1e-3 * beam_sum);
  EXPECT_LT(diffuse_off, 1e-3 * diffuse_sum);
}

TEST_F(ConfigTest, epw_rain_falls_in_its_hour) {
  auto hours = made_year();
  for (Hour& h : hours) {
    if (h.month == 6 && h.day == 21 && h.hour == 14) h.rain_mm = 6.0;
    if (h.month == 6 && h.day == 22 && h.hour == 1) h.rain_mm = 999.0;  // missing
  }
  write("w.epw", epw(hours));
  const auto loaded = scenario(kScenario);
  ASSERT_TRUE(loaded) << loaded.error().text;
  const physics::RainDepth depth(loaded->weather);
  const auto fallen_mm = [&](double from_h, double to_h) {
    return depth.at_mm(std::llround(to_h * 3.6e12)) - depth.at_mm(std::llround(from_h * 3.6e12));
  };
  EXPECT_NEAR(fallen_mm(13.0, 14.0), 6.0, 1e-9);
  EXPECT_NEAR(fallen_mm(13.0, 13.25), 1.5, 1e-9);
  EXPECT_NEAR(fallen_mm(0.0, 13.0) + fallen_mm(14.0, 48.0), 0.0, 1e-9);
  // Older files end before it.
  std::string text = epw(hours);
  for (std::size_t at = 0; (at = text.find(",88,0,", at)) != std::string::npos;) {
    const std::size_t end = text.find('\n', at);
    text.erase(at, end - at);
  }
  write("w.epw", text);
  const auto old = scenario(kScenario);
  ASSERT_TRUE(old) << old.error().text;
  EXPECT_TRUE(physics::RainDepth(old->weather).is_dry());
}

TEST_F(ConfigTest, epw_rain_of_several_hours_falls_over_them) {
  auto hours = made_year();
  for (Hour& h : hours) {
    if (h.month != 6 || h.day != 21) continue;
    // 6 mm from 6 h to 12 h, and 4 mm from 12 h to 18 h of which an hour states 1 mm for itself.
    if (h.hour == 12) h.rain_mm = 6.0, h.rain_h = 6.0;
    if (h.hour == 15) h.rain_mm = 1.0;
    if (h.hour == 18) h.rain_mm = 4.0, h.rain_h = 6.0;
    if (h.hour == 20) h.rain_mm = 2.0, h.rain_h = 99.0;  // its time is missing
  }
  write("w.epw", epw(hours));
  const auto loaded = scenario(kScenario);
  ASSERT_TRUE(loaded) << loaded.error().text;
  const physics::RainDepth depth(loaded->weather);
  const auto fallen_mm = [&](double from_h, double to_h) {
    return depth.at_mm(std::llround(to_h * 3.6e12)) - depth.at_mm(std::llround(from_h * 3.6e12));
  };
  for (int hour = 6; hour < 12; ++hour) {
    EXPECT_NEAR(fallen_mm(hour, hour + 1.0), 1.0, 1e-9) << hour;
  }
  EXPECT_NEAR(fallen_mm(12.0, 13.0), 0.5, 1e-9);
  EXPECT_NEAR(fallen_mm(14.0, 15.0), 1.5, 1e-9);
  EXPECT_NEAR(fallen_mm(12.0, 18.0), 4.0, 1e-9);
  EXPECT_NEAR(fallen_mm(19.0, 20.0), 2.0, 1e-9);
  EXPECT_THAT(loaded->warnings,
              ::testing::Contains(::testing::HasSubstr("2 records state rain of more than 1 h")));
}

TEST_F(ConfigTest, planes_see_the_sun_of_a_year) {
  const auto file = write("w.epw", epw(made_year()));
  const std::vector<WeatherPlane> planes{
      {0.0, 0.0}, {180.0, 90.0}, {90.0, 90.0}, {270.0, 90.0}, {0.0, 180.0}};
  const auto course = weather_on_planes(file, {}, planes, 900.0);
  ASSERT_TRUE(course) << course.error().text;
  ASSERT_EQ(course->instants.size(), 365U * 96U + 1U);
  // Level ground gets all of the diffuse light, walls half of it, a ceiling none.
  double diffuse_kwh_m2 = 0.0;
  for (const Hour& h : made_year()) diffuse_kwh_m2 += h.diffuse_w_m2 / 1000.0;
  EXPECT_NEAR(course->sums[0].sky_kwh_m2, diffuse_kwh_m2, 0.02 * diffuse_kwh_m2);
  EXPECT_NEAR(course->sums[1].sky_kwh_m2, 0.5 * course->sums[0].sky_kwh_m2, 1e-6);
  EXPECT_EQ(course->sums[4].beam_kwh_m2, 0.0);
  EXPECT_NEAR(course->sums[4].sky_kwh_m2, 0.0, 1e-9);
  for (const PlaneInstant& at : course->instants) {
    const double hour = std::fmod(at.time_s / 3600.0, 24.0);
    // The sun is in the east before noon, at this meridian of the zone. No plane has more than it.
    const bool morning = hour > 8.0 && hour < 11.0;
    const bool afternoon = hour > 13.0 && hour < 16.0;
    ASSERT_TRUE(!morning || at.planes[3].beam_w_m2 == 0.0) << at.time_s;
    ASSERT_TRUE(!afternoon || at.planes[2].beam_w_m2 == 0.0) << at.time_s;
    for (const PlaneIrradiance& plane : at.planes) {
      ASSERT_LE(plane.beam_w_m2, at.direct_normal_w_m2 + 1e-9);
    }
    ASSERT_NEAR(
        at.planes[0].beam_w_m2,
        at.direct_normal_w_m2 * std::max(0.0, std::sin(at.sun_elevation_deg * physics::kDegree)),
        1e-6);
  }
  // A table needs a place.
  const auto table = write("w.csv",
                           "time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,wind_m_s\n"
                           "0,500,50,300,290,3\n3600,500,50,300,290,3\n");
  const auto refused = weather_on_planes(table, {}, planes, 900.0);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("has no place"));
  WeatherOrigin origin;
  origin.epoch_utc_ns = 1'718'971'200'000'000'000;  // 21 June 2024, noon, on the equator
  const auto noon = weather_on_planes(table, origin, planes, 1800.0);
  ASSERT_TRUE(noon) << noon.error().text;
  ASSERT_EQ(noon->instants.size(), 3U);
  EXPECT_NEAR(noon->instants[0].planes[0].beam_w_m2, 500.0 * std::cos(23.44 * physics::kDegree),
              1.0);
}

TEST_F(ConfigTest, epw_days_go_on_into_other_years_and_over_leap_days) {
  write("w.epw", epw(made_year()));
  const auto loaded = scenario(
      "epoch_utc = 2024-02-28T07:00:00Z\n[place]\nlat_deg = 40.0\nlon_deg = -105.0\n"
      "height_m = 1500\n[weather]\nfile = \"w.epw\"\n");
  ASSERT_TRUE(loaded) << loaded.error().text;
  EXPECT_NEAR(row_at(*loaded, 24.0 + 15.0).air_k, 273.15 + 15.2, 1e-9) << "29 February";
  EXPECT_NEAR(row_at(*loaded, 48.0 + 15.0).air_k, 273.15 + 15.3, 1e-9) << "1 March";
  EXPECT_NEAR(row_at(*loaded, -59.0 * 24.0 + 15.0).air_k, 273.15 + 16.2, 1e-9) << "31 December";
}

/// A year without long-wave irradiance, by either code, and without the air of four hours.
class EpwGaps : public ConfigTest, public ::testing::WithParamInterface<double> {};
INSTANTIATE_TEST_SUITE_P(Codes, EpwGaps, ::testing::Values(9999.0, 0.0));
TEST_P(EpwGaps, are_filled_and_said) {
  auto hours = made_year();
  for (Hour& h : hours) {
    h.longwave_w_m2 = GetParam();
    if (h.month == 6 && h.day == 21 && h.hour >= 10 && h.hour < 14) h.air_c = 99.9;
  }
  write("w.epw", epw(hours));
  const auto loaded = scenario(kScenario);
  ASSERT_TRUE(loaded) << loaded.error().text;
  EXPECT_NEAR(row_at(*loaded, 12.0).air_k, 273.15 + 12.6, 1e-9);
  const scene::WeatherSample noon = row_at(*loaded, 12.0);
  ASSERT_TRUE(noon.relative_humidity_frac.has_value());
  EXPECT_NEAR(
      *noon.relative_humidity_frac,
      physics::saturation_over_water_pa(268.15) / physics::saturation_over_water_pa(noon.air_k),
      1e-9);
  // Dew point -5 C and half the sky covered.
  EXPECT_GT(row_at(*loaded, 12.0).longwave_down_w_m2, 250.0);
  EXPECT_LT(row_at(*loaded, 12.0).longwave_down_w_m2, 380.0);
  EXPECT_THAT(loaded->warnings,
              ElementsAre(AllOf(HasSubstr("w.epw: 4 missing values of air"),
                                HasSubstr("the longest gap over 4 h from line 41")),
                          HasSubstr("w.epw: the long-wave irradiance of 8760 records")));
}

TEST_F(ConfigTest, epw_missing_sun_follows_the_hours_beside_it) {
  auto hours = made_year();
  double was_w_m2 = 0.0;
  for (Hour& h : hours) {
    if (h.month != 6 || h.day != 20 || h.hour != 12) continue;
    was_w_m2 = h.beam_w_m2;
    h.beam_w_m2 = h.diffuse_w_m2 = 9999.0;
  }
  write("w.epw", epw(hours));
  const auto loaded = scenario(kScenario);
  ASSERT_TRUE(loaded) << loaded.error().text;
  EXPECT_NEAR(average(*loaded, -24.0 + 11.0, &scene::WeatherSample::direct_normal_w_m2), was_w_m2,
              0.05 * was_w_m2);
  EXPECT_NEAR(average(*loaded, -24.0 + 12.0, &scene::WeatherSample::direct_normal_w_m2), was_w_m2,
              0.5)
      << "the next hour keeps its average, which is the same by symmetry";
  // The day stands in both years that are laid out.
  EXPECT_THAT(loaded->warnings, ElementsAre(HasSubstr("4 missing averages of sun or sky light")));
}

TEST_F(ConfigTest, epw_sun_of_the_night_is_left_out_and_said) {
  auto hours = made_year();
  for (Hour& h : hours) {
    if (h.hour == 23) h.beam_w_m2 = 500.0;
  }
  write("w.epw", epw(hours));
  const auto loaded = scenario(kScenario);
  ASSERT_TRUE(loaded) << loaded.error().text;
  EXPECT_EQ(average(*loaded, 22.0, &scene::WeatherSample::direct_normal_w_m2), 0.0);
  EXPECT_THAT(loaded->warnings,
              ElementsAre(HasSubstr("182.5 kWh m-2 a year of sun and sky light")));
}

TEST_F(ConfigTest, epw_of_another_place_or_of_one_other_year_is_said) {
  auto hours = made_year();
  for (Hour& h : hours) h.year = 1995;
  write("w.epw", epw(hours));
  const auto loaded = scenario(
      "epoch_utc = 2024-06-21T07:00:00Z\n[place]\nlat_deg = 48.0\nlon_deg = 11.0\n"
      "[weather]\nfile = \"w.epw\"\n");
  ASSERT_TRUE(loaded) << loaded.error().text;
  EXPECT_THAT(loaded->warnings,
              ElementsAre(HasSubstr("the weather is of Somewhere (40.00, -105.00, 1500 m)"),
                          HasSubstr("all days are of 1995, and stand for those of 2024")));
}

TEST_F(ConfigTest, epw_faults_name_line_and_column) {
  const std::string good = epw(made_year());
  const auto fault = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    write("w.epw", text);
    return scenario_error(kScenario);
  };
  EXPECT_THAT(
      fault("1991,1,1,3,0", "1991,1,1,4,0"),
      HasSubstr("w.epw:11: the record ends at 4 h of 01-01, where 3 h of 01-01 comes next"));
  EXPECT_THAT(fault("1991,1,1,3,0", "1991,2,30,3,0"), HasSubstr("month 2 and day 30 are no date"));
  EXPECT_THAT(fault("1991,1,1,3,0,?9,3.1", "1991,1,1,3,0,?9,warm"),
              HasSubstr("w.epw:11: 'dry bulb' (column 7) holds 'warm'"));
  EXPECT_THAT(fault("1991,1,1,3,0,?9,3.1", "1991,1,1,3,0,?9,75"),
              HasSubstr("'dry bulb' (column 7) holds 75, must be -93.15 .. 66.85"));
  EXPECT_THAT(fault("DATA PERIODS", "DATA"), HasSubstr("no line 'DATA PERIODS'"));
  EXPECT_THAT(fault("DATA PERIODS,1,1", "DATA PERIODS,1,7"), HasSubstr("7 records per hour"));
  EXPECT_THAT(fault("40.0,-105.0", "140.0,-105.0"), HasSubstr("'latitude' is 140"));
  write("w.epw", good.substr(0, good.size() / 2));
  EXPECT_THAT(scenario_error(kScenario), HasSubstr("w.epw"));
}

TEST_F(ConfigTest, tmy3_columns_are_found_by_name) {
  std::string text =
      "724666,\"DENVER/CENTENNIAL\",CO,-7.0,39.733,-105.0,1500\n"
      "Date (MM/DD/YYYY),Time (HH:MM),ETR (W/m^2),DNI (W/m^2),DHI (W/m^2),Dry-bulb (C),"
      "Dew-point (C),Wspd (m/s),OpqCld (tenths)\n";
  for (const Hour& h : made_year()) {
    text += fmt::format("{:02}/{:02}/{},{:02}:00,0,{},{},{},-5,3.5,-9900\n", h.month, h.day, h.year,
                        h.hour, h.beam_w_m2, h.diffuse_w_m2, h.air_c);
  }
  write("w.epw", text);
  const auto loaded = scenario(kScenario);
  ASSERT_TRUE(loaded) << loaded.error().text;
  EXPECT_NEAR(row_at(*loaded, 15.0).air_k, 273.15 + 15.6, 1e-9);
  EXPECT_NEAR(average(*loaded, 11.0, &scene::WeatherSample::direct_normal_w_m2), 169.0, 0.2);
  EXPECT_THAT(loaded->warnings, ElementsAre(HasSubstr("the long-wave irradiance of 8760 records")));
  text.replace(text.find("DNI (W/m^2)"), 11, "Beam");
  write("w.epw", text);
  EXPECT_THAT(scenario_error(kScenario), HasSubstr("w.epw:2: column 'DNI (W/m^2)' is missing"));
}

// Weather-driver cases of ASHRAE 140: real files, and another program's irradiance of planes.
class WeatherDriver : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const auto folder =
        std::filesystem::path(EMIT_TEST_SOURCE_DIR) / "../../shared/nature/ashrae140";
    const auto file = folder / (std::string(GetParam()) + ".epw");
    if (!std::filesystem::exists(file)) GTEST_SKIP() << "no reference data beside the source tree";
    file_ = file;
    auto year = load_weather_year(file);
    ASSERT_TRUE(year) << year.error().text;
    year_ = std::move(*year);
    std::ifstream in(folder / (std::string(GetParam()) + ".reference.txt"));
    reference_ = {std::istreambuf_iterator<char>(in), {}};
    scenario_.place = {year_.lat_deg * physics::kDegree, year_.lon_deg * physics::kDegree,
                       year_.height_m};
    // 1 January of a year without a leap day, local standard time.
    scenario_.epoch_utc_ns = 1'483'228'800LL * 1'000'000'000 - std::llround(year_.zone_h * 3.6e12);
    scenario_.weather = weather_of_year(year_, "w", scenario_, warnings_);
  }

  /// Returns a list of numbers "name=[a, b, ...]" of the reference; empty: there is none.
  [[nodiscard]] std::vector<double> reference(const std::string& name) const {
    const std::size_t at = reference_.find("\n" + name + "=[");
    if (at == std::string::npos) return {};
    const std::size_t begin = reference_.find('[', at) + 1;
    std::string list = reference_.substr(begin, reference_.find(']', begin) - begin);
    std::ranges::replace(list, ',', ' ');
    std::istringstream in(list);
    return {std::istream_iterator<double>(in), {}};
  }
  /// Returns what the file says for an instant when a straight line joins the middles of hours, as
  /// the other program has it.
  [[nodiscard]] double straight(double hours, std::optional<double> YearRecord::*member) const {
    const double place = hours - 0.5;
    const double before = std::floor(place);
    const auto value = [&](double index) {
      const auto i = static_cast<std::size_t>(std::clamp(index, 0.0, 8759.0));
      return *(year_.records[i].*member);
    };
    return std::lerp(value(before), value(before + 1.0), place - before);
  }

  std::filesystem::path file_;
  WeatherYear year_;
  std::string reference_;
  scene::ScenarioDesc scenario_;
  std::vector<std::string> warnings_;
};

TEST_P(WeatherDriver, PlanesSeeTheSunOfAnotherProgram) {
  const physics::GeoPlace place{physics::degrees(year_.lat_deg), physics::degrees(year_.lon_deg),
                                physics::Metres(year_.height_m)};
  constexpr int kSamples = 101;
  int planes = 0;
  for (const int azimuth_deg : {0, 90, 180, 270, 315, 45}) {
    for (const int tilt_deg : {0, 30, 90}) {
      const auto wanted = reference(fmt::format("azi{:03}til{:02}.H", azimuth_deg, tilt_deg));
      if (wanted.empty()) continue;
      ++planes;
      ASSERT_EQ(wanted.size(), std::size_t{kSamples});
      const double tilt = tilt_deg * physics::kDegree;
      const double azimuth = (180.0 + azimuth_deg) * physics::kDegree;  // from north, clockwise
      const glm::dvec3 normal(std::sin(tilt) * std::sin(azimuth),
                              std::sin(tilt) * std::cos(azimuth), std::cos(tilt));
      const auto irradiance = [&](double hours) {
        const auto sun =
            physics::sun_position(scenario_.epoch_utc_ns + std::llround(hours * 3.6e12), place);
        return straight(hours, &YearRecord::direct_normal_w_m2) *
                   std::max(0.0, glm::dot(normal, sun.direction_enu)) +
               straight(hours, &YearRecord::diffuse_horizontal_w_m2) * 0.5 * (1.0 + std::cos(tilt));
      };
      double ours = 0.0;
      double theirs = 0.0;
      double squares = 0.0;
      for (int i = 0; i < kSamples; ++i) {
        const double sum = irradiance(87.6 * i);
        ours += sum / kSamples;
        theirs += wanted[static_cast<std::size_t>(i)] / kSamples;
        squares += std::pow(sum - wanted[static_cast<std::size_t>(i)], 2.0) / kSamples;
      }
      EXPECT_NEAR(ours, theirs, 0.03 * theirs) << azimuth_deg << " " << tilt_deg;
      EXPECT_LT(std::sqrt(squares), 9.0) << azimuth_deg << " " << tilt_deg;
    }
  }
  EXPECT_EQ(planes, 10);
}

TEST_P(WeatherDriver, PlanesOfASimulationAreThoseOfAnotherProgram) {
  // A simulation follows the clear sky within an hour, where the other program has a straight line
  // between the middles of hours. Means differ less than instants.
  std::vector<WeatherPlane> planes;
  std::vector<std::vector<double>> wanted;
  for (const int azimuth_deg : {0, 90, 180, 270, 315, 45}) {
    for (const int tilt_deg : {0, 30, 90}) {
      auto values = reference(fmt::format("azi{:03}til{:02}.H", azimuth_deg, tilt_deg));
      if (values.empty()) continue;
      planes.push_back({std::fmod(180.0 + azimuth_deg, 360.0), static_cast<double>(tilt_deg)});
      wanted.push_back(std::move(values));
    }
  }
  ASSERT_EQ(planes.size(), 10U);
  const auto course = weather_on_planes(file_, {}, planes, 315'360.0);
  ASSERT_TRUE(course) << course.error().text;
  ASSERT_EQ(course->instants.size(), wanted.front().size());
  for (std::size_t p = 0; p < planes.size(); ++p) {
    double ours = 0.0;
    double theirs = 0.0;
    double squares = 0.0;
    for (std::size_t i = 0; i < wanted[p].size(); ++i) {
      const PlaneIrradiance& plane = course->instants[i].planes[p];
      const double sum = plane.beam_w_m2 + plane.sky_w_m2;
      ours += sum;
      theirs += wanted[p][i];
      squares += std::pow(sum - wanted[p][i], 2.0);
    }
    const double count = static_cast<double>(wanted[p].size());
    const double rms_w_m2 = std::sqrt(squares / count);
    std::printf("%s azimuth %3.0f tilt %2.0f: mean %6.1f, reference %6.1f W/m2, RMS %5.1f\n",
                GetParam(), planes[p].azimuth_deg, planes[p].tilt_deg, ours / count, theirs / count,
                rms_w_m2);
    EXPECT_NEAR(ours, theirs, 0.04 * theirs) << p;
    EXPECT_LT(rms_w_m2, 36.0) << p;
  }
}

TEST_P(WeatherDriver, EveryHourKeepsWhatTheFileSays) {
  const auto first = std::ranges::lower_bound(scenario_.weather, std::int64_t{0}, {},
                                              &scene::WeatherSample::sim_time_ns);
  ASSERT_EQ(first->sim_time_ns, 0);
  double beam_off = 0.0;
  double diffuse_off = 0.0;
  double beam_sum = 0.0;
  std::size_t worse = 0;
  for (std::size_t hour = 0; hour < year_.records.size() && hour < 8700; ++hour) {
    const YearRecord& record = year_.records[hour];
    const auto* rows = &*(first + static_cast<std::ptrdiff_t>(4 * hour));
    const auto mean = [&](double scene::WeatherSample::*member) {
      return 0.125 * (rows[0].*member + rows[4].*member) +
             0.25 * (rows[1].*member + rows[2].*member + rows[3].*member);
    };
    const double beam = mean(&scene::WeatherSample::direct_normal_w_m2);
    const double off = std::abs(beam - *record.direct_normal_w_m2);
    worse += off > 1.0 + 0.005 * *record.direct_normal_w_m2 ? 1U : 0U;
    beam_off += off;
    beam_sum += *record.direct_normal_w_m2;
    diffuse_off += std::abs(mean(&scene::WeatherSample::diffuse_horizontal_w_m2) -
                            *record.diffuse_horizontal_w_m2);
    ASSERT_NEAR(rows[4].air_k, *record.air_k, 1e-9) << record.line;
    ASSERT_NEAR(rows[4].longwave_down_w_m2, *record.longwave_down_w_m2, 1e-9) << record.line;
    ASSERT_NEAR(rows[4].wind_m_s, *record.wind_m_s, 1e-9) << record.line;
    ASSERT_EQ(rows[4].wind_from_rad.has_value(), record.wind_from_deg.has_value()) << record.line;
    if (record.wind_from_deg) {
      const double turn_rad =
          *rows[4].wind_from_rad - *record.wind_from_deg * std::numbers::pi / 180.0;
      ASSERT_NEAR(std::remainder(turn_rad, 2.0 * std::numbers::pi), 0.0, 1e-9) << record.line;
    }
  }
  // A few hours of sunrise and sunset have more sun than their height allows.
  EXPECT_LT(beam_off, 0.002 * beam_sum);
  EXPECT_LT(diffuse_off / static_cast<double>(year_.records.size()), 0.05);
  EXPECT_LT(worse, 40U);
  EXPECT_LE(warnings_.size(), 1U) << warnings_.front();
}
INSTANTIATE_TEST_SUITE_P(Cases, WeatherDriver, ::testing::Values("WD100", "WD200", "WD400"));

}  // namespace
}  // namespace emit::config::testing
