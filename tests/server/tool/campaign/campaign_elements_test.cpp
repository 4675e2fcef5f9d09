// SPDX-License-Identifier: Apache-2.0
#include "tool/campaign/campaign_elements.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>

#include "support/emit_process.hpp"
#include "tool/campaign/result_row.hpp"

namespace emit::tool {
namespace {

using emit::test::TemporaryFolder;
using emit::test::write_text;

/// 2014-06-21T06:00:00Z.
constexpr std::int64_t kEpochNs = 1'403'330'400'000'000'000;

std::string text_of(const CampaignElement& element) {
  std::string text;
  for (const auto& [key, value] : element.conditions) text += key + "=" + value + " ";
  return text + std::to_string(std::llround(element.time_s));
}

physics::Result<config::CampaignDesc> load(const std::string& text) {
  const TemporaryFolder folder;
  write_text(folder.file("c.toml"), text);
  return config::load_campaign(folder.file("c.toml"));
}

TEST(CampaignElements, the_grid_has_every_combination_and_the_last_axis_changes_fastest) {
  const auto campaign = load(R"(
scenario = "box"
times = "06:00,07:00"
[[vary]]
key = "weather.wind_m_s"
from = 1
to = 3
count = 2
[[vary]]
keys = ["weather.linke_turbidity", "place.height_m"]
values = [[3, 0.0], [5, 500.0]]
)");
  ASSERT_TRUE(campaign.has_value()) << campaign.error().text;
  const auto elements = campaign_elements(*campaign, kEpochNs);
  ASSERT_TRUE(elements.has_value()) << elements.error().text;
  ASSERT_EQ(elements->size(), 8U);
  EXPECT_EQ(text_of((*elements)[0]),
            "weather.wind_m_s=1.0 weather.linke_turbidity=3 place.height_m=0.0 0");
  EXPECT_EQ(text_of((*elements)[1]),
            "weather.wind_m_s=1.0 weather.linke_turbidity=3 place.height_m=0.0 3600");
  EXPECT_EQ(text_of((*elements)[7]),
            "weather.wind_m_s=3.0 weather.linke_turbidity=5 place.height_m=500.0 3600");
}

TEST(CampaignElements, a_latin_hypercube_has_one_value_in_every_stratum) {
  constexpr std::size_t kSamples = 37;
  const auto points = latin_hypercube(kSamples, 3, 5);
  ASSERT_EQ(points.size(), kSamples);
  for (std::size_t d = 0; d < 3; ++d) {
    std::set<int> strata;
    for (const auto& point : points) strata.insert(static_cast<int>(point[d] * kSamples));
    EXPECT_EQ(strata.size(), kSamples);
  }
  // The dimensions are shuffled apart, and another seed gives other points.
  EXPECT_NE(points[0][0], points[0][1]);
  EXPECT_NE(points, latin_hypercube(kSamples, 3, 6));
  EXPECT_EQ(points, latin_hypercube(kSamples, 3, 5));
}

TEST(CampaignElements, samples_lie_between_their_limits_and_logarithmic_ones_spread_by_ratio) {
  const auto campaign = load(R"(
scenario = "box"
samples = 100
[[vary]]
key = "time"
values = ["12:00"]
[[sample]]
key = "weather.wind_m_s"
low = 0.1
high = 10
logarithmic = true
)");
  ASSERT_TRUE(campaign.has_value()) << campaign.error().text;
  const auto elements = campaign_elements(*campaign, kEpochNs);
  ASSERT_TRUE(elements.has_value()) << elements.error().text;
  ASSERT_EQ(elements->size(), 100U);
  std::size_t below_one = 0;
  for (const CampaignElement& element : *elements) {
    const double value = std::stod(element.conditions.at(0).second);
    EXPECT_GE(value, 0.1);
    EXPECT_LT(value, 10.0);
    below_one += value < 1.0 ? 1U : 0U;
    EXPECT_EQ(element.time_s, 21'600.0);
  }
  EXPECT_EQ(below_one, 50U);
}

TEST(CampaignElements, faults_name_file_line_and_key) {
  for (const auto& [text, expected] :
       {std::pair{"scenario = \"box\"\ntimes = \"0\"\nsampels = 3\n",
                  "c.toml:3:1: unknown key 'sampels', did you mean 'samples'?"},
        std::pair{"times = \"0\"\n", "key 'scenario' is missing"},
        std::pair{"scenario = \"box\"\n", "the time is given 0 times"},
        std::pair{"scenario = \"box\"\ntimes = \"0\"\n[[vary]]\nkey = \"a\"\n",
                  "c.toml:3:1: an axis needs either 'values' or 'from', 'to' and 'count'"},
        std::pair{"scenario = \"box\"\ntimes = \"0\"\nset = [\"a\"]\n", "'a' is not KEY=VALUE"},
        std::pair{"scenario = \"box\"\ntimes = \"0\"\nsamples = 4\n",
                  "'samples' and the tables [[sample]] belong together"},
        std::pair{"scenario = \"box\"\ntimes = \"0\"\n[[vary]]\nkeys = [\"a\", \"b\"]\nvalues = "
                  "[[1]]\n",
                  "1 values for 2 keys"},
        std::pair{"scenario = \"bax\"\ntimes = \"0\"\n", "bax"}}) {
    const auto campaign = load(text);
    ASSERT_FALSE(campaign.has_value()) << text;
    EXPECT_NE(campaign.error().text.find(expected), std::string::npos) << campaign.error().text;
  }
}

TEST(ResultRows, a_file_is_read_only_by_its_identity_and_when_it_is_complete) {
  const TemporaryFolder folder;
  ResultRow row;
  row.set("element", std::string("3"));
  row.set("text, with \"quotes\"", std::string("a,b \"c\""));
  row.set("value", 0.1);
  ASSERT_TRUE(write_result_row(folder.file("r.csv"), "one", row).has_value());
  const auto read = read_result_row(folder.file("r.csv"), "one");
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->cells(), row.cells());
  EXPECT_EQ(read->number("value"), 0.1);
  EXPECT_TRUE(std::isnan(read->number("element,")));
  EXPECT_FALSE(read_result_row(folder.file("r.csv"), "two").has_value());
  const std::string text = test::read_text(folder.file("r.csv"));
  write_text(folder.file("r.csv"), text.substr(0, text.size() - 5));
  EXPECT_FALSE(read_result_row(folder.file("r.csv"), "one").has_value());
}

}  // namespace
}  // namespace emit::tool
