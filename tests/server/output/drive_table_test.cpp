// SPDX-License-Identifier: Apache-2.0
#include "output/drive_table.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "support/output_files.hpp"

namespace emit::server {
namespace {

using Point = DriveTable::Point;

float drive_of(const DriveTable& table, float radiance, std::uint32_t* beyond = nullptr) {
  std::vector<float> values{radiance};
  const std::uint32_t count = table.apply(values);
  if (beyond != nullptr) *beyond = count;
  return values[0];
}

TEST(DriveTable, IsExactAtItsPointsAndLinearBetweenThem) {
  const std::vector<Point> points{
      {0.0, 100.0}, {1.0, 200.0}, {4.0, 800.0}, {5.0, 800.0}, {9.0, 4095.0}};
  const auto table = DriveTable::make(points);
  ASSERT_TRUE(table.has_value()) << table.error().text;
  for (const Point& point : points) {
    std::uint32_t beyond = 9;
    EXPECT_EQ(drive_of(*table, static_cast<float>(point.radiance_w_m2_sr), &beyond),
              static_cast<float>(point.drive));
    EXPECT_EQ(beyond, 0U) << "the ends belong to the table";
  }
  EXPECT_EQ(drive_of(*table, 0.5F), 150.0F);
  EXPECT_EQ(drive_of(*table, 2.5F), 500.0F);
  EXPECT_EQ(drive_of(*table, 4.5F), 800.0F);
  EXPECT_EQ(drive_of(*table, 7.0F), 2447.5F);
}

TEST(DriveTable, ClampsAndCountsBeyondItsEnds) {
  const auto table = DriveTable::make(std::vector<Point>{{10.0, 4000.0}, {20.0, 96.0}});
  ASSERT_TRUE(table.has_value());
  std::vector<float> values{9.999F, 10.0F, 15.0F, 20.0F, 20.001F, 1e30F, -1e30F, NAN};
  EXPECT_EQ(table->apply(values), 5U);
  EXPECT_EQ(values,
            (std::vector<float>{4000.0F, 4000.0F, 2048.0F, 96.0F, 96.0F, 96.0F, 4000.0F, 4000.0F}));
}

TEST(DriveTable, FindsTheSegmentOfEveryValueOfUnevenTables) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> exponent(-6.0, 3.0);
  for (int round = 0; round < 40; ++round) {
    // Radiances over nine decades, so that many points share a part of the look-up.
    std::vector<double> radiances(static_cast<std::size_t>(2 + round * 7));
    for (double& radiance : radiances)
      radiance = static_cast<float>(std::pow(10.0, exponent(random)));
    std::sort(radiances.begin(), radiances.end());
    radiances.erase(std::unique(radiances.begin(), radiances.end()), radiances.end());
    std::vector<Point> points;
    double drive = 0.0;
    for (const double radiance : radiances) {
      drive += exponent(random) + 6.0;
      points.push_back({radiance, static_cast<float>(drive)});
    }
    const auto table = DriveTable::make(points);
    ASSERT_TRUE(table.has_value()) << table.error().text;
    std::uniform_int_distribution<std::size_t> any(0, points.size() - 2);
    std::uniform_real_distribution<double> frac(0.0, 1.0);
    for (int i = 0; i < 500; ++i) {
      const std::size_t k = any(random);
      const auto value = static_cast<float>(
          points[k].radiance_w_m2_sr +
          frac(random) * (points[k + 1].radiance_w_m2_sr - points[k].radiance_w_m2_sr));
      // The closed form, in double and by a search of its own.
      std::size_t s = 0;
      while (s + 2 < points.size() && points[s + 1].radiance_w_m2_sr <= value) ++s;
      const Point& a = points[s];
      const Point& b = points[s + 1];
      const double expected = a.drive + (value - a.radiance_w_m2_sr) * (b.drive - a.drive) /
                                            (b.radiance_w_m2_sr - a.radiance_w_m2_sr);
      ASSERT_NEAR(drive_of(*table, value), expected, 1e-6 * drive) << value;
    }
  }
}

TEST(DriveTable, ReadsACsvFileAndNamesTheLineAtFault) {
  test::OutputFiles folder;
  const auto error_of = [&](const std::string& text) {
    const auto table = DriveTable::read(folder.text("t.csv", text));
    return table ? std::string("none") : table.error().text;
  };
  const std::string head = "# bench of May\nradiance_w_m2_sr,drive\n";
  EXPECT_EQ(error_of(head + "0,0\n1,10\n"), "none");
  EXPECT_NE(error_of(head + "0,0\n2,10\n2,20\n").find("t.csv:5: "), std::string::npos);
  EXPECT_NE(error_of(head + "0,0\n2,10\n2,20\n").find("is not above 2"), std::string::npos);
  EXPECT_NE(error_of(head + "0,0\n2,10\n3,5\n").find("t.csv:5: 3 W m-2 sr-1 to 5: 'drive' falls"),
            std::string::npos)
      << error_of(head + "0,0\n2,10\n3,5\n");
  EXPECT_NE(error_of(head + "0,9\n1,9\n2,5\n3,6\n").find("'drive' rises after it fell"),
            std::string::npos);
  EXPECT_NE(error_of(head + "0,0\n").find("2 to 65536 points, not 1"), std::string::npos);
  EXPECT_NE(error_of(head + "0,0\n1,nan\n").find("t.csv:4:3: 'nan' must be a finite number"),
            std::string::npos)
      << error_of(head + "0,0\n1,nan\n");
  EXPECT_NE(error_of("radiance,drive\n0,0\n1,1\n").find("radiance_w_m2_sr"), std::string::npos);
  EXPECT_NE(error_of(head + "0,0\n1e300,1\n").find("not within the range of float32"),
            std::string::npos);
}

}  // namespace
}  // namespace emit::server
