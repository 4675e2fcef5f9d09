// SPDX-License-Identifier: Apache-2.0
// Diagrams of the benches: bars of a tornado plot.
#include "tool/support/svg_plot.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>
#include <string>

namespace emit::test {
namespace {

using ::testing::HasSubstr;

/// Bars of a document: left edge and width in pixels, in the order of the file.
std::vector<std::pair<double, double>> bars_of(const std::string& svg) {
  const std::regex bar(R"re(<rect x="([-0-9.]+)" y="[-0-9.]+" width="([-0-9.]+)" height="14")re");
  std::vector<std::pair<double, double>> out;
  for (std::sregex_iterator at(svg.begin(), svg.end(), bar), end; at != end; ++at) {
    out.emplace_back(std::stod((*at)[1]), std::stod((*at)[2]));
  }
  return out;
}

TEST(SvgTornado, bars_go_from_zero_to_both_sides_in_proportion) {
  const tool::Tornado tornado{
      .title = "a & b",
      .label = "K",
      .bars = {
          {.label = "wind <fast>", .title = "", .at_low = -2.0, .at_high = 1.0, .note = "2.1 K"},
          {.label = "sun", .title = "", .at_low = 0.5, .at_high = -0.5, .note = ""}}};
  const std::string svg = tool::svg_document(std::vector{tornado});
  EXPECT_THAT(svg, HasSubstr("a &amp; b"));
  EXPECT_THAT(svg, HasSubstr("wind &lt;fast&gt;"));
  EXPECT_THAT(svg, HasSubstr("2.1 K"));
  const auto bars = bars_of(svg);
  ASSERT_EQ(bars.size(), 4U);
  EXPECT_NEAR(bars[0].second, 2.0 * bars[1].second, 0.2);
  EXPECT_NEAR(bars[1].second, 2.0 * bars[2].second, 0.2);
  EXPECT_NEAR(bars[0].first + bars[0].second, bars[1].first, 0.2) << "both meet at zero";
  EXPECT_NEAR(bars[2].first, bars[1].first, 0.2) << "a low end may shift upwards";
  EXPECT_NEAR(bars[3].first + bars[3].second, bars[1].first, 0.2);
}

TEST(SvgTornado, without_bars_it_is_a_document_all_the_same) {
  EXPECT_THAT(tool::svg_document(std::vector<tool::Tornado>{{}}), HasSubstr("</svg>"));
}

}  // namespace
}  // namespace emit::test
