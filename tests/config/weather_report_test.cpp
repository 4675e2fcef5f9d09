// SPDX-License-Identifier: Apache-2.0
// Reports about weather files.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "config/config_support.hpp"
#include "emit/config/weather_report.hpp"

namespace emit::config::testing {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

/// Records of an EPW file at 40 N, 105 W, UTC-7.
class EpwText {
 public:
  void add_day(int year, int month, int day, double beam_w_m2, int from_hour, int to_hour,
               const std::string& air = "10") {
    for (int hour = 1; hour <= 24; ++hour) {
      const double beam = hour >= from_hour && hour <= to_hour ? beam_w_m2 : 0.0;
      text_ += fmt::format(
          "{},{},{},{},0,?9,{},-5,50,85000,0,0,300,0,{},20,0,0,0,0,180,{},5,5,20,20000,9,0,10,0,0,"
          "88,0,0,1\n",
          year, month, day, hour, air, beam, hour / 4.0);
    }
  }
  [[nodiscard]] std::string text() const {
    return "LOCATION,Somewhere,XX,YYY,made,0,40.0,-105.0,-7.0,1500.0\n"
           "DATA PERIODS,1,1,Data,Sunday,1/1,12/31\n" +
           text_;
  }

 private:
  std::string text_;
};

const WeatherColumn* column_of(const WeatherReport& report, const std::string& name) {
  const auto found = std::ranges::find(report.columns, name, &WeatherColumn::name);
  return found == report.columns.end() ? nullptr : &*found;
}

TEST_F(ConfigTest, weather_report_of_an_epw_says_what_was_read) {
  EpwText file;
  file.add_day(1991, 6, 1, 500.0, 9, 16);
  file.add_day(1991, 6, 2, 500.0, 9, 16, "99.9");
  file.add_day(1984, 7, 1, 0.0, 1, 1);
  const auto report = report_weather(write("w.epw", file.text()));
  ASSERT_TRUE(report) << report.error().text;
  EXPECT_EQ(report->format, WeatherReport::Format::epw);
  EXPECT_EQ(report->site, "Somewhere");
  EXPECT_EQ(report->records, 72U);
  EXPECT_EQ(report->spacing_s, 3600.0);
  EXPECT_EQ(report->first, "1991-06-01 01:00");
  EXPECT_EQ(report->last, "1984-07-01 24:00");
  EXPECT_THAT(report->years, ElementsAre(1984, 1991));
  const WeatherColumn* air = column_of(*report, "air");
  ASSERT_NE(air, nullptr);
  EXPECT_EQ(air->missing, 24U);
  EXPECT_NEAR(air->mean, 283.15, 1e-9);
  const WeatherColumn* wind = column_of(*report, "wind");
  ASSERT_NE(wind, nullptr);
  EXPECT_EQ(wind->least, 0.25);
  EXPECT_EQ(wind->most, 6.0);
  ASSERT_THAT(report->gaps, SizeIs(2));
  EXPECT_EQ(report->gaps[0].from, "1991-06-02 24:00");
  EXPECT_EQ(report->gaps[0].to, "1984-07-01 01:00");
  EXPECT_EQ(report->gaps[1].from, "1984-07-01 24:00");
  EXPECT_EQ(report->gaps[1].to, "1991-06-01 01:00");
  EXPECT_THAT(report->notes, Contains(HasSubstr("it has 3 days of a year")));
  ASSERT_THAT(report->months, SizeIs(2));
  EXPECT_NEAR(report->months[0].beam_kwh_m2_day, 4.0, 1e-9);
  EXPECT_NEAR(report->months[0].beam_w_m2[8], 500.0, 1e-9);
  EXPECT_EQ(report->months[0].beam_w_m2[7], 0.0);
  EXPECT_TRUE(std::ranges::any_of(report->notes, [](const std::string& note) {
    return note.find("24 missing values of air") != std::string::npos;
  }));
}

TEST_F(ConfigTest, weather_report_holds_the_beam_against_the_height_of_the_sun) {
  // The sun is up at 40 N on 21 December from 7:20 to 16:40. Of ten hours of beam, the one that
  // ends at 24 has none, and those that end at 8 and 17 have a part of it.
  EpwText file;
  file.add_day(1991, 12, 21, 400.0, 8, 17);
  const auto good = report_weather(write("good.epw", file.text()));
  ASSERT_TRUE(good) << good.error().text;
  EXPECT_TRUE(good->has_sun);
  EXPECT_EQ(good->beam_below_horizon, 0U);
  std::size_t records = 0;
  for (const WeatherSunBin& bin : good->sun_bins) {
    records += bin.records;
    EXPECT_EQ(bin.most_w_m2, 400.0);
    EXPECT_LT(bin.from_deg, 26.6) << "the sun's height at noon is 26.6 degrees";
  }
  EXPECT_EQ(records, 10U);
  EpwText late;
  late.add_day(1991, 12, 21, 400.0, 15, 20);
  const auto bad = report_weather(write("bad.epw", late.text()));
  ASSERT_TRUE(bad) << bad.error().text;
  EXPECT_EQ(bad->beam_below_horizon, 3U) << "18, 19 and 20 h";
  EXPECT_NEAR(bad->beam_below_horizon_kwh_m2, 1.2, 1e-9);
}

TEST_F(ConfigTest, weather_report_of_a_table_needs_a_place_for_the_sun) {
  // Rows every half hour over a day from midnight of local standard time, with a gap and with
  // beam at every hour.
  std::string text = "time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,wind_m_s,cloud_frac\n";
  for (int i = 0; i <= 48; ++i) {
    if (i > 10 && i < 20) continue;
    text += fmt::format("{},100,10,300,{},3,0\n", 1800 * i, 280.0 + i);
  }
  const auto file = write("w.csv", text);
  const auto without = report_weather(file);
  ASSERT_TRUE(without) << without.error().text;
  EXPECT_FALSE(without->has_sun);
  EXPECT_EQ(without->records, 40U);
  EXPECT_EQ(without->spacing_s, 1800.0);
  ASSERT_THAT(without->gaps, SizeIs(1));
  EXPECT_EQ(without->gaps[0].from, "18000 s");
  EXPECT_EQ(without->gaps[0].to, "36000 s");
  EXPECT_THAT(without->rows, SizeIs(40));
  // 2024-03-20, when the sun is up for half of the day.
  WeatherOrigin origin;
  origin.place = {40.0 * std::numbers::pi / 180.0, -105.0 * std::numbers::pi / 180.0, 1500.0};
  origin.epoch_utc_ns = 1'710'918'000'000'000'000;  // 07:00 UTC
  const auto with = report_weather(file, origin);
  ASSERT_TRUE(with) << with.error().text;
  EXPECT_TRUE(with->has_sun);
  // The sun rises at 6:05 and sets at 18:10. Rows from 0:00 to 5:00 are before it, and from 18:30
  // to 24:00 after it. The intervals at the gap and at sunset touch the day.
  EXPECT_NEAR(static_cast<double>(with->beam_below_horizon), 22.0, 1.0);
  EXPECT_NEAR(with->beam_below_horizon_kwh_m2, 1.1, 0.1);
}

TEST_F(ConfigTest, weather_report_names_file_and_line_of_what_is_wrong) {
  const auto report = report_weather(write("w.csv", "time_s,air_k\n0,abc\n"));
  ASSERT_FALSE(report);
  EXPECT_THAT(report.error().text, HasSubstr("w.csv"));
  EXPECT_FALSE(report_weather(folder_ / "none.epw"));
}

}  // namespace
}  // namespace emit::config::testing
