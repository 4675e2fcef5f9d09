// SPDX-License-Identifier: Apache-2.0
#include "tool/support/statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "bench/frame_time/paired_frames.hpp"
#include "tool/support/console.hpp"

namespace emit::tool {
namespace {

TEST(CliStatistics, percentiles_are_nearest_rank) {
  Samples samples;
  for (int i = 100; i >= 1; --i) samples.add(i);
  EXPECT_EQ(samples.percentile(0.0), 1.0);
  EXPECT_EQ(samples.percentile(0.5), 50.0);
  EXPECT_EQ(samples.percentile(0.99), 99.0);
  EXPECT_EQ(samples.percentile(0.999), 100.0);
  EXPECT_EQ(samples.percentile(1.0), 100.0);
}

TEST(CliStatistics, the_median_of_an_even_count_is_the_mean_of_the_middle_two) {
  Samples samples;
  for (const double value : {4.0, 1.0, 3.0, 2.0}) samples.add(value);
  EXPECT_EQ(samples.median(), 2.5);
  EXPECT_EQ(samples.mean(), 2.5);
  EXPECT_EQ(samples.max(), 4.0);
  EXPECT_EQ(samples.sum(), 10.0);
}

TEST(CliStatistics, limited_samples_keep_an_even_choice_and_exact_sums) {
  Samples samples(64);
  Samples all;
  for (int i = 0; i < 10'000; ++i) {
    const double value = (i * 7919) % 10'000;
    samples.add(value);
    all.add(value);
  }
  EXPECT_LE(samples.values().size(), 64U);
  EXPECT_GE(samples.values().size(), 32U);
  EXPECT_EQ(samples.count(), 10'000U);
  EXPECT_EQ(samples.max(), 9999.0);
  EXPECT_EQ(samples.sum(), all.sum());
  EXPECT_EQ(samples.mean(), all.mean());
  EXPECT_NEAR(samples.median(), all.median(), 2000.0);
  // Every 256th sample is kept from the first on, so nothing of the end is missing.
  EXPECT_EQ(samples.values().front(), all.values().front());
  EXPECT_EQ(samples.values().back(), all.values()[(10'000 - 1) / 256 * 256]);
}

TEST(CliStatistics, no_samples_give_nan_rather_than_a_number) {
  const Samples samples;
  EXPECT_TRUE(std::isnan(samples.median()));
  EXPECT_TRUE(std::isnan(samples.percentile(0.99)));
  EXPECT_TRUE(std::isnan(samples.max()));
  EXPECT_EQ(histogram_text(samples, "ms"), "");
}

TEST(CliStatistics, the_histogram_counts_every_sample_once) {
  Samples samples;
  for (int i = 0; i < 7; ++i) samples.add(0.3);
  for (int i = 0; i < 5; ++i) samples.add(40.0);
  const std::string text = histogram_text(samples, "ms");
  EXPECT_NE(text.find("0.2 .. 0.5"), std::string::npos) << text;
  EXPECT_NE(text.find("20 .. 50"), std::string::npos) << text;
  EXPECT_NE(text.find(" 7 ####"), std::string::npos) << text;
  EXPECT_NE(text.find(" 5 ####"), std::string::npos) << text;
}

TEST(CliStatistics, samples_of_zero_and_below_stay_in_the_first_bin) {
  Samples samples;
  samples.add(0.0);
  samples.add(-1.0);
  const std::string text = histogram_text(samples, "ms");
  EXPECT_NE(text.find(" 2 ####"), std::string::npos) << text;
}

TEST(CliPairedRatio, a_machine_that_slows_down_in_the_middle_changes_no_ratio) {
  std::vector<double> a;
  std::vector<double> twin;
  std::vector<double> b;
  for (int i = 0; i < 30; ++i) {
    const double busy = i < 13 ? 1.0 : 3.0;
    a.push_back(busy * 10.0);
    twin.push_back(busy * 10.0);
    b.push_back(busy * 10.15);
  }
  const PairedRatio pairs = paired_ratio(a, twin, b);
  EXPECT_EQ(pairs.pairs, 30U);
  EXPECT_NEAR(pairs.ratio, 1.015, 1e-12);
  EXPECT_NEAR(pairs.self_ratio, 1.0, 1e-12);
  EXPECT_NEAR(pairs.self_spread, 0.0, 1e-12);
  EXPECT_TRUE(pairs.within(1.02));
  EXPECT_FALSE(pairs.within(1.01));
}

TEST(CliPairedRatio, the_limit_counts_as_met_only_as_far_as_a_run_lies_from_itself) {
  const std::vector<double> a(30, 10.0);
  std::vector<double> twin(30, 10.0);
  for (std::size_t i = 20; i < 30; ++i) twin[i] = 9.6;  // the last third
  const PairedRatio near = paired_ratio(a, twin, std::vector<double>(30, 10.3));
  EXPECT_NEAR(near.self_spread, 0.04, 1e-12);
  EXPECT_TRUE(near.within(1.02));
  EXPECT_FALSE(paired_ratio(a, twin, std::vector<double>(30, 10.5)).within(1.02));
}

TEST(CliTable, columns_are_as_wide_as_their_widest_cell) {
  TextTable table({"name", "n"});
  table.add({"a", "100"});
  EXPECT_EQ(table.to_string(), "name    n\na     100\n");
}

}  // namespace
}  // namespace emit::tool
