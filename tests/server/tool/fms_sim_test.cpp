// SPDX-License-Identifier: Apache-2.0
// Command emit fms-sim with a host of the test's own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <functional>
#include <string>
#include <thread>

#include "emit/protocol/axes.hpp"
#include "net/socket.hpp"
#include "rt/clock.hpp"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using protocol::AxesMode;
using protocol::AxesMonitor;
using protocol::AxesState;
using ::testing::HasSubstr;

/// A host that commands three axes to turn slowly.
class FmsHost {
 public:
  explicit FmsHost(const std::string& address) {
    const auto where = server::parse_host_port(address);
    const auto target = server::resolve(*where, server::Transport::udp, false);
    auto socket = server::UdpSocket::open(context_, *target);
    EXPECT_TRUE(socket.has_value() && socket->connect(*target).has_value());
    socket_ = std::move(*socket);
  }
  void send(AxesMode mode) {
    protocol::AxesCommand command;
    command.counter = ++counter_;
    command.time_ns = clock_.tai_ns();
    command.timeout_ms = 200;
    command.mode = mode;
    command.count = 3;
    const double time_s = 1e-9 * static_cast<double>(command.time_ns - start_ns_);
    for (auto& axis : command.axes) axis = {0.05 * time_s, 0.05, 0.0};
    static_cast<void>(socket_.send(codec_.encode(command)));
  }
  /// Sends commands, or is silent, until the controller reports what is wanted.
  [[nodiscard]] bool wait(std::optional<AxesMode> mode,
                          const std::function<bool(const AxesMonitor&)>& wanted) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (std::chrono::steady_clock::now() < end) {
      if (mode) send(*mode);
      std::array<std::byte, protocol::kMaxAxesBytes> space;
      for (;;) {
        const server::IoResult got = socket_.receive(space);
        if (got.status != server::IoStatus::done) break;
        AxesMonitor monitor;
        EXPECT_EQ(codec_.decode(std::span(space).first(got.bytes), monitor),
                  protocol::AxesFault::none);
        EXPECT_GT(monitor.counter, last_counter_);
        last_counter_ = monitor.counter;
        if (wanted(monitor)) return true;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return false;
  }

 private:
  const server::SystemClock clock_;
  const server::SocketContext context_;
  server::UdpSocket socket_;
  protocol::AxesCodec codec_;
  const std::int64_t start_ns_ = clock_.tai_ns();
  std::uint64_t counter_ = 0;
  std::uint64_t last_counter_ = 0;
};

/// Returns the address that a simulator prints when it is ready; "" when it does not.
std::string address_of(const ToolProcess& simulator) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  std::string said;
  while (said.find('\n') == std::string::npos && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    said = simulator.out();
  }
  const std::string ready = "ready axes_udp=";
  if (said.rfind(ready, 0) != 0) return "";
  return said.substr(ready.size(), said.find('\n') - ready.size());
}

std::function<bool(const AxesMonitor&)> in_state(AxesState state) {
  return [state](const AxesMonitor& monitor) { return monitor.state == state; };
}

TEST(CliFmsSim, follows_a_host_and_parks_without_it) {
  ScratchFolder folder;
  ToolProcess simulator(folder, "fms", {"fms-sim", "--listen", "127.0.0.1:0", "--axes", "3"});
  const std::string address = address_of(simulator);
  ASSERT_NE(address, "") << simulator.err();
  FmsHost host(address);
  EXPECT_TRUE(host.wait(AxesMode::follow, [](const AxesMonitor& monitor) {
    return monitor.state == AxesState::following && monitor.count == 3 &&
           std::abs(monitor.measured[2].angle_rad - monitor.demanded[2].angle_rad) < 1e-3;
  }));
  EXPECT_TRUE(host.wait(std::nullopt, [](const AxesMonitor& monitor) {
    return monitor.state == AxesState::parking && monitor.timed_out;
  }));
  EXPECT_TRUE(host.wait(AxesMode::follow, in_state(AxesState::following)));
  EXPECT_TRUE(host.wait(AxesMode::park, in_state(AxesState::parked)));
  EXPECT_TRUE(host.wait(AxesMode::off, in_state(AxesState::motors_off)));
  simulator.signal(SIGINT);
  EXPECT_EQ(simulator.wait(), 0) << simulator.err();
  EXPECT_THAT(simulator.out(), HasSubstr("0 malformed, 1 timeouts"));
  EXPECT_THAT(simulator.err(), HasSubstr("fms-sim: parking, the host is silent"));
}

TEST(CliFmsSim, an_axis_that_runs_away_opens_the_interlock) {
  ScratchFolder folder;
  ToolProcess simulator(
      folder, "fms",
      {"fms-sim", "--listen", "127.0.0.1:0", "--axes", "3", "--fault", "1:runaway@0"});
  const std::string address = address_of(simulator);
  ASSERT_NE(address, "") << simulator.err();
  FmsHost host(address);
  EXPECT_TRUE(host.wait(AxesMode::follow, [](const AxesMonitor& monitor) {
    return monitor.state == AxesState::fault && monitor.faulty_axes == 2;
  }));
}

TEST(CliFmsSim, refuses_faults_that_name_no_axis) {
  for (const char* fault : {"5:stuck@1", "x", "1:melted@1", "1:stuck", "1:stuck@-1", "1:stuck@1s",
                            "4294967296:stuck@1", "1:stuck@inf", " 1:stuck@1"}) {
    const ProcessResult result = run_emit({"fms-sim", "--fault", fault, "--seconds", "0.1"});
    EXPECT_EQ(result.exit_code, 2) << fault;
    EXPECT_THAT(result.err, HasSubstr("must be AXIS:stuck")) << fault;
  }
}

}  // namespace
}  // namespace emit::test
