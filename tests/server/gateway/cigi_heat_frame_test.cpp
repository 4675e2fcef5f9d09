// SPDX-License-Identifier: Apache-2.0
// A CIGI host heats a part, and the image shows its temperature.
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <memory>

#include "agents/messages.hpp"
#include "gateway/cigi_host.hpp"
#include "support/part_plate.hpp"

namespace emit::server {
namespace {

namespace cigi = protocol::cigi;
using test::at_ns;

class CigiHeatFrame : public testing::TestWithParam<cigi::Version> {};

TEST_P(CigiHeatFrame, ComponentControlSetsTheTemperatureThatTheImageShows) {
  constexpr double kHotK = 420.0;
  constexpr double kFrameS = 0.5;
  const scene::ScenarioDesc scenario = test::plate_world({});
  Counters counters;
  EventLog events(64, counters);
  CigiHost::Options options;
  options.scenario = &scenario;
  options.cigi.entities = {{.id = 12, .entity = 7}};
  options.first_time_ns = at_ns(0.0);
  options.synchronous = true;
  options.rate_hz = 1.0 / kFrameS;
  CigiHost gateway(options, nullptr, counters, events);
  test::Session run(scenario);
  const auto frame = std::make_unique<protocol::HostFrameData>();
  double shown_k = 0.0;
  for (std::uint32_t k = 0; k < 12; ++k) {
    std::array<std::byte, 1024> memory;
    cigi::Writer writer(memory, GetParam(), cigi::ByteOrder::little);
    cigi::IgControl control;
    control.mode = cigi::IgMode::operate;
    control.host_frame = k + 1;
    ASSERT_FALSE(writer.add(control));
    cigi::EntityControl seeker;
    seeker.state = cigi::EntityState::active;
    ASSERT_FALSE(GetParam() == cigi::Version::v3_3 ? writer.add(seeker)
                                                   : writer.add(cigi::EntityPosition{}));
    if (k == 4) {
      cigi::ComponentControl part;
      part.instance_id = 12;
      part.component_id = 1;
      part.component_state = CigiHeat::kTemperatureK;
      part.data[0] = std::bit_cast<std::uint32_t>(static_cast<float>(kHotK));
      ASSERT_FALSE(writer.add(part));
    }
    gateway.take(writer.message(), k);
    ASSERT_TRUE(gateway.next(*frame, k));
    for (const protocol::PartCommandData& part : frame->part_span()) {
      const TimedPart timed = timed_part(part, frame->sim_time_ns);
      EXPECT_TRUE(run.renderer().apply_part(timed.sim_time_ns, timed.update));
    }
    shown_k = test::middle_k(run, 1e-9 * static_cast<double>(frame->sim_time_ns - at_ns(0.0)));
    if (k < 4) {
      EXPECT_NEAR(shown_k, test::kAirK, 0.2);
    }
  }
  EXPECT_NEAR(shown_k, kHotK, 0.1);
}

INSTANTIATE_TEST_SUITE_P(Versions, CigiHeatFrame,
                         testing::Values(cigi::Version::v3_3, cigi::Version::v4_0),
                         [](const auto& each) {
                           return each.param == cigi::Version::v3_3 ? "V33" : "V40";
                         });

}  // namespace
}  // namespace emit::server
