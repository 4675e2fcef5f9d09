// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <memory>
#include <string>

#include "agents/conductor/conductor.hpp"
#include "agents/render/render_agent.hpp"
#include "agents/sender/sender.hpp"
#include "agents/sender/shm_client.hpp"
#include "agents/sender/socket_client.hpp"
#include "net/socket.hpp"
#include "rt/fd.hpp"
#include "support/fake_clock.hpp"
#include "support/heap_counter.hpp"
#include "support/output_files.hpp"

namespace emit::server {
namespace {

// The agents on the way of a frame, from the host's input to the last byte sent.
TEST(SteadyState, NoAgentOnTheFramePathAllocates) {
  const test::FakeClock clock;
  Context context(clock, 1u << 20, 4);
  const std::optional<scene::ScenarioDesc> no_scenario;
  const ScenarioTracks tracks(no_scenario);
  // One channel shows the image as it is, the other one has every step of an output.
  const test::OutputFiles files;
  scene::ScenarioDesc scenario;
  scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  scenario.channels = {{"all", scene::ChannelKind::projector, "8-12"},
                       {"driven", scene::ChannelKind::projector, "8-12", {4, 4, 40, 30}}};
  scene::ChannelOutput& output = scenario.channels[1].output;
  output.mirror = scene::PictureMirror::both;
  output.rotate_deg = 90;
  output.apply_shift = true;
  output.distortion_file = files.map("map.exr", {30, 40}, [](double x, double y) {
    return protocol::ImagePoint{x, y};
  });
  output.nuc_file = files.exr("nuc.exr", {30, 40},
                              {{"gain", [](double, double) { return 1.0; }},
                               {"offset", [](double, double) { return 0.5; }}});
  output.optics = {.spot = scene::SpotKind::airy, .airy_px = 0.5, .vignetting = true};
  output.detector = {.netd_k = 0.1,
                     .photon_frac = 0.5,
                     .row_noise_k = 0.1,
                     .column_noise_k = 0.1,
                     .gain_spread_frac = 0.01};
  scenario.sensor.fov_h_rad = 0.2;
  scenario.sensor.width_px = 64;
  scenario.sensor.height_px = 48;
  output.drive_table_file = files.text("drive.csv", "radiance_w_m2_sr,drive\n0,0\n50,1000\n");
  config::SourceConfig source;
  source.canned_width_px = 64;
  source.canned_height_px = 48;
  source.canned_frames = 4;
  RenderAgent render(context, [&] { return make_canned_source(source, 7, 1); });
  Conductor conductor(context, tracks, {});
  ASSERT_TRUE(render.on_start() && conductor.on_start());
  auto table = *make_channels(scenario, *render.source_info());
  context.channels = std::move(table.channels);
  context.pictures = std::move(table.pictures);
  config::StreamConfig stream;
  stream.shm = "test-allocation-" + std::to_string(::getpid());
  auto shm = ShmClient::create(stream, context.channels, {}, 1);
  ASSERT_TRUE(shm.has_value()) << shm.error().text;
  const auto reader = ShmObject::open(stream.shm);  // or nothing would be copied
  ASSERT_TRUE(reader.has_value()) << reader.error().text;
  Sender sender(context, 4, 4, false, {shm->get()});
  ASSERT_TRUE(sender.on_start());

  int pair[2] = {-1, -1};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pair), 0);
  auto near = TcpSocket::adopt(SocketContext(), pair[0]);
  ASSERT_TRUE(near.has_value());
  const Fd far(pair[1]);
  SocketClient::Params params;
  params.channel = &context.channels.front();
  params.tcp_socket = &*near;
  SocketClient client(std::move(params));
  ASSERT_TRUE(context.to_sender.push({ClientCommand::Kind::add, 0, &client}));

  std::array<std::byte, 65536> sink;
  const auto frame = [&](std::uint64_t number) {
    HostInput& input = context.host_inputs.claim_reserved();
    input.kind = HostInput::Kind::frame;
    input.frame.frame_number = number;
    input.frame.sim_time_ns = static_cast<std::int64_t>(number);
    input.frame.entity_count = 8;
    for (std::uint32_t i = 0; i < 8; ++i) {
      input.frame.entities[i].entity_id = i;
      input.frame.entities[i].has_pose = true;
    }
    context.host_inputs.commit();
    for (int turn = 0; turn < 4; ++turn) {
      conductor.do_work(clock.tai_ns());
      render.do_work(clock.tai_ns());
      conductor.do_work(clock.tai_ns());
      sender.do_work(clock.tai_ns());
      while (::recv(far.get(), sink.data(), sink.size(), MSG_DONTWAIT) > 0) {
      }
    }
    while (!context.journal.front().empty()) {
      context.journal.pop();
    }
  };
  for (std::uint64_t number = 1; number <= 20; ++number) {
    frame(number);
  }
  const std::uint64_t before = test::heap_request_count();
  for (std::uint64_t number = 21; number <= 520; ++number) {
    frame(number);
  }
  EXPECT_EQ(test::heap_request_count() - before, 0U);
  EXPECT_EQ(context.counters.get(Counter::frames_sent), 2 * 520U);
  EXPECT_EQ(context.counters.get(Counter::frames_shared), 520U);
  sender.on_stop();
  render.on_stop();
}

}  // namespace
}  // namespace emit::server
