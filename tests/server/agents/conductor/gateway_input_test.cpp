// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <vector>

#include "support/conductor_rig.hpp"

namespace emit::server {
namespace {

using test::kMs;

/// A conductor whose host frames come from a gateway.
class GatewayInputTest : public testing::Test {
 protected:
  std::vector<GatewayReport> reports() {
    std::vector<GatewayReport> out;
    while (const GatewayReport* report = rig_.context().gateway_reports.front()) {
      out.push_back(*report);
      rig_.context().gateway_reports.pop();
    }
    return out;
  }
  test::ConductorRig rig_{{}, std::nullopt, false, nullptr, 0, true};
};

TEST_F(GatewayInputTest, EveryImageIsReportedWithTheNumberOfItsHostFrame) {
  rig_.send_from_gateway(7, 10 * kMs);
  rig_.settle();
  rig_.send_from_gateway(8, 20 * kMs);
  rig_.settle();
  ASSERT_EQ(rig_.frames.size(), 2U);
  EXPECT_EQ(rig_.frames[1].header.host_frame_number, 8U);
  const auto got = reports();
  ASSERT_EQ(got.size(), 2U);
  EXPECT_EQ(got[0].kind, GatewayReport::Kind::published);
  EXPECT_EQ(got[0].host_frame_number, 7U);
  EXPECT_EQ(got[1].host_frame_number, 8U);
  EXPECT_TRUE(rig_.replies.empty()) << "there is nobody else to answer";
}

TEST_F(GatewayInputTest, WhatMakesNoImageIsReportedToo) {
  rig_.send_from_gateway(2, 10 * kMs);
  rig_.send_from_gateway(2, 10 * kMs);
  rig_.send_from_gateway(3, 5 * kMs);
  rig_.settle();
  rig_.command(CommandKind::stop);
  rig_.settle();
  rig_.send_from_gateway(4, 20 * kMs);
  rig_.settle();
  std::vector<GatewayReport::Kind> kinds;
  for (const GatewayReport& report : reports()) kinds.push_back(report.kind);
  using enum GatewayReport::Kind;
  EXPECT_THAT(kinds, testing::UnorderedElementsAre(refused, refused, published, unused));
}

TEST_F(GatewayInputTest, HostFramesOfOthersAreRefused) {
  rig_.send(1, 10 * kMs);
  rig_.settle();
  EXPECT_TRUE(rig_.frames.empty());
  ASSERT_EQ(rig_.replies.size(), 1U);
  EXPECT_EQ(rig_.replies[0].code, StatusCode::not_allowed);
  rig_.send_from_gateway(1, 10 * kMs);
  rig_.settle();
  EXPECT_EQ(rig_.frames.size(), 1U) << "and leave no trace";
}

TEST_F(GatewayInputTest, AnotherRunOfTheGatewayResetsTheRun) {
  rig_.send_from_gateway(100, 50 * kMs, 1);
  rig_.settle();
  rig_.send_from_gateway(1, 0, 2);
  rig_.settle();
  ASSERT_EQ(rig_.frames.size(), 2U);
  EXPECT_NE(rig_.frames[0].header.run_id, rig_.frames[1].header.run_id);
  EXPECT_EQ(rig_.frames[1].header.sim_time_ns, 0);
}

}  // namespace
}  // namespace emit::server
