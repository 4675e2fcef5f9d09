// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "tool/streams/metrics_parse.hpp"

namespace emit::tool {
namespace {

TEST(ParseMetrics, ReadsNamesLabelsAndValues) {
  const auto samples = parse_metrics(
      "# HELP a_total text\n# TYPE a_total counter\na_total 3\n\n"
      "b_bucket{le=\"+Inf\",stage=\"x \\\"y\\\" \\\\ \\n\"} 1.5e3\nc -0.5 1700000000\n");
  ASSERT_TRUE(samples) << samples.error().text;
  ASSERT_EQ(samples->size(), 3U);
  EXPECT_EQ((*samples)[0].name, "a_total");
  EXPECT_EQ((*samples)[0].value, 3.0);
  EXPECT_EQ((*samples)[1].label("le"), "+Inf");
  EXPECT_EQ((*samples)[1].label("stage"), "x \"y\" \\ \n");
  EXPECT_EQ((*samples)[1].value, 1500.0);
  EXPECT_EQ((*samples)[2].value, -0.5);
  EXPECT_EQ((*samples)[2].label("none"), "");
}

TEST(ParseMetrics, NamesTheLineThatIsNoMetric) {
  for (const char* bad : {"a{", "a{x} 1", "a{x=\"1} 1", "a", "a b", "{x=\"1\"} 1", "a{x=\"\\\""}) {
    const auto samples = parse_metrics(std::string("ok 1\n") + bad + "\n");
    ASSERT_FALSE(samples) << bad;
    EXPECT_TRUE(samples.error().text.starts_with("line 2: ")) << samples.error().text;
  }
}

TEST(QuantileBound, IsTheUpperEndOfTheBucket) {
  const std::vector<std::pair<double, double>> buckets{{0.001, 10}, {0.01, 99}, {HUGE_VAL, 100}};
  EXPECT_EQ(quantile_bound(buckets, 0.1), 0.001);
  EXPECT_EQ(quantile_bound(buckets, 0.5), 0.01);
  EXPECT_EQ(quantile_bound(buckets, 0.99), 0.01);
  EXPECT_TRUE(std::isinf(quantile_bound(buckets, 0.999)));
  EXPECT_EQ(quantile_bound({}, 0.5), 0.0);
  EXPECT_EQ(quantile_bound({{1.0, 0.0}}, 0.5), 0.0);
}

}  // namespace
}  // namespace emit::tool
