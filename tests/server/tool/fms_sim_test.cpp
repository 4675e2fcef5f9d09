// SPDX-License-Identifier: Apache-2.0
// Command emit fms-sim with a host of the test's own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <thread>

#include "emit/protocol/axes.hpp"
#include "net/socket.hpp"
#include "rt/clock.hpp"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"
#include "support/times.hpp"

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

/// Returns the place that a simulator prints when it is ready; "" when it does not.
std::string address_of(const ToolProcess& simulator, const std::string& key = "axes_udp") {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  std::string said;
  while (said.find('\n') == std::string::npos && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    said = simulator.out();
  }
  const std::string ready = "ready " + key + "=";
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

/// Lines by hand, as a terminal would send them.
TEST(CliFmsSim, answers_acutrol_lines_and_turns_an_axis) {
  ScratchFolder folder;
  ToolProcess simulator(folder, "fms", {"fms-sim", "--acutrol", "127.0.0.1:0", "--axes", "1"});
  const std::string address = address_of(simulator, "axes_acutrol");
  ASSERT_NE(address, "") << simulator.err();
  const server::SocketContext context;
  const auto target =
      server::resolve(*server::parse_host_port(address), server::Transport::tcp, false);
  auto host = server::TcpSocket::connect(context, *target, kLongNs);
  ASSERT_TRUE(host.has_value());
  const auto ask = [&](const std::string& command) {
    const std::string line = command + "\n";
    EXPECT_EQ(host->write_some(std::as_bytes(std::span(line))).bytes, line.size());
    std::string answer;
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (answer.find('\n') == std::string::npos && std::chrono::steady_clock::now() < end) {
      std::array<char, 256> space;
      const auto got = host->read_some(std::as_writable_bytes(std::span(space)));
      if (got.status == server::IoStatus::done) answer.append(space.data(), got.bytes);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return answer;
  };
  EXPECT_EQ(ask(":interlock? 1"), "ACUTROL Open\r\n");
  EXPECT_EQ(ask(":D:P 1, 0"), "ACUTROL OK\r\n");
  EXPECT_EQ(ask(":mode:position 1"), "ACUTROL OK\r\n");
  EXPECT_EQ(ask(":interlock:close 1"), "ACUTROL OK\r\n");
  EXPECT_EQ(ask(":demand:position 1, 10.0"), "ACUTROL OK\r\n");
  double degrees = 0.0;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (std::abs(degrees - 10.0) > 0.01 && std::chrono::steady_clock::now() < end) {
    degrees = std::stod("0" + ask(":R:P 1").substr(8));
  }
  EXPECT_NEAR(degrees, 10.0, 0.01);
  EXPECT_EQ(ask(":interlock? 1"), "ACUTROL Close\r\n");
  EXPECT_THAT(ask(":R:P 2"), HasSubstr("ERROR"));
  EXPECT_EQ(ask(":interlock:open 1"), "ACUTROL OK\r\n");
  simulator.signal(SIGINT);
  EXPECT_EQ(simulator.wait(), 0) << simulator.err();
  EXPECT_THAT(simulator.err(), HasSubstr("fms-sim: following"));
  EXPECT_THAT(simulator.out(), HasSubstr("1 malformed"));
}

TEST(CliFmsSim, makes_its_memory_and_refuses_wrong_places) {
  ScratchFolder folder;
  const ProcessResult made =
      run_emit({"fms-sim", "--memory", folder.file("axes") + "@0x40", "--seconds", "0.05"});
  EXPECT_EQ(made.exit_code, 0) << made.err;
  EXPECT_THAT(made.out, HasSubstr("ready axes_memory=" + folder.file("axes") + "@64"));
  EXPECT_EQ(std::filesystem::file_size(folder.file("axes")), 64U + 552U);
  const ProcessResult small =
      run_emit({"fms-sim", "--memory", folder.file("axes") + "@72", "--seconds", "0.05"});
  EXPECT_EQ(small.exit_code, 1);
  EXPECT_THAT(small.err, HasSubstr("has 616 bytes, and the axes need 624"));
  for (const char* place : {"axes@0", "/dev/shm/axes", "/dev/shm/axes@4"}) {
    const ProcessResult result = run_emit({"fms-sim", "--memory", place, "--seconds", "0.05"});
    EXPECT_EQ(result.exit_code, 2) << place;
    EXPECT_THAT(result.err, HasSubstr(place)) << place;
  }
  EXPECT_EQ(run_emit({"fms-sim", "--acutrol", "127.0.0.1:0", "--memory", "/x@0"}).exit_code, 2);
  EXPECT_EQ(run_emit({"fms-sim", "--acutrol", "nowhere", "--seconds", "0.05"}).exit_code, 2);
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
