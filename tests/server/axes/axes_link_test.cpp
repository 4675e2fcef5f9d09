// SPDX-License-Identifier: Apache-2.0
// Links to a controller that the test plays, by memory and by TCP.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "axes/acutrol_axes_link.hpp"
#include "axes/axes_memory.hpp"
#include "axes/memory_axes_link.hpp"
#include "axes/open_axes_link.hpp"
#include "net/socket.hpp"
#include "support/daemon_process.hpp"
#include "support/heap_counter.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using protocol::AxesCommand;
using protocol::AxesMode;
using protocol::AxesMonitor;
using protocol::AxesState;
using test::kMs;
using test::kSecondNs;
using ::testing::HasSubstr;

AxesCommand park(std::uint64_t counter) {
  AxesCommand out;
  out.counter = counter;
  out.mode = AxesMode::park;
  return out;
}

AxesMonitor report(std::uint64_t counter) {
  AxesMonitor out;
  out.counter = counter;
  out.time_ns = static_cast<std::int64_t>(counter);
  out.state = AxesState::parked;
  out.count = 3;
  return out;
}

TEST(MemoryAxesLink, hands_commands_and_reports_over_in_a_file) {
  const test::ScratchFolder folder;
  const config::MemoryPlace place{folder.file("axes"), 4096 + 8};
  Counters counters;
  auto controller = AxesMemory::open_or_make(place);
  ASSERT_TRUE(controller.has_value()) << controller.error().text;
  store_axes(controller->monitor(), report(5));
  auto link = MemoryAxesLink::open(place, counters);
  ASSERT_TRUE(link.has_value()) << link.error().text;
  EXPECT_EQ((*link)->fd(), -1);
  EXPECT_FALSE((*link)->receive(0).has_value()) << "what was there before is old";

  const std::uint64_t before = test::heap_request_count();
  (*link)->send(park(7), 0);
  AxesCommand command;
  std::uint64_t seen = 0;
  EXPECT_EQ(load_axes(controller->command(), seen, command).status, protocol::AxesLoadStatus::done);
  EXPECT_EQ(command.counter, 7U);
  store_axes(controller->monitor(), report(6));
  const auto monitor = (*link)->receive(0);
  EXPECT_EQ(test::heap_request_count(), before);
  ASSERT_TRUE(monitor.has_value());
  EXPECT_EQ(monitor->counter, 6U);
  EXPECT_FALSE((*link)->receive(0).has_value());
  EXPECT_EQ(counters.get(Counter::axes_commands), 1U);

  // The controller is at work: it is read when it has done.
  store_axes(controller->monitor(), report(7));
  controller->monitor().front() = 8;
  EXPECT_FALSE((*link)->receive(0).has_value());
  EXPECT_FALSE((*link)->receive(0).has_value());
  EXPECT_EQ(counters.get(Counter::axes_torn_reads), 2U);
  controller->monitor().front() = 7;
  EXPECT_TRUE((*link)->receive(0).has_value());
  // A report that is no message is counted once.
  store_axes(controller->monitor(), report(8));
  controller->monitor()[1] = 0;
  controller->monitor().front() = controller->monitor().back() = 9;
  EXPECT_FALSE((*link)->receive(0).has_value());
  EXPECT_FALSE((*link)->receive(0).has_value());
  EXPECT_EQ(counters.get(Counter::axes_reports_refused), 1U);
}

TEST(MemoryAxesLink, refuses_files_that_are_missing_or_too_small) {
  const test::ScratchFolder folder;
  Counters counters;
  EventLog events(4, counters);
  config::MotionConfig motion;
  motion.controller = "memory:" + folder.file("none") + "@0";
  auto missing = open_axes_link(motion, counters, events);
  ASSERT_FALSE(missing.has_value());
  EXPECT_THAT(missing.error().text, HasSubstr("motion.controller"));
  EXPECT_THAT(missing.error().text, HasSubstr("No such file"));

  const auto small = folder.file("small");
  std::ofstream(small) << std::string(551 + 64, 'x');
  for (const bool may_make : {false, true}) {
    const config::MemoryPlace place{small, 64};
    const auto opened = may_make ? AxesMemory::open_or_make(place) : AxesMemory::open(place);
    ASSERT_FALSE(opened.has_value());
    EXPECT_THAT(opened.error().text, HasSubstr("has 615 bytes, and the axes need 616"));
  }
  std::filesystem::resize_file(small, 616);
  EXPECT_TRUE(AxesMemory::open({small, 64}).has_value());
}

/// A controller at a TCP port, and a link to it on times that the test chooses.
class AcutrolAxesLinkTest : public ::testing::Test {
 protected:
  AcutrolAxesLinkTest() {
    const auto where = parse_host_port("127.0.0.1:0");
    auto listener = TcpListener::open(context_, *resolve(*where, Transport::tcp, true));
    EXPECT_TRUE(listener.has_value());
    listener_ = std::move(*listener);
    AcutrolHost::Axis axis;
    axis.limits = {-2.0, 2.0, 5.0, 50.0};
    auto link =
        AcutrolAxesLink::open("127.0.0.1:" + std::to_string(port()), {axis}, counters_, events_);
    EXPECT_TRUE(link.has_value());
    link_ = std::move(*link);
  }
  [[nodiscard]] std::uint16_t port() const { return listener_.local_address().port(); }

  void send() { link_->send(park(++counter_), now_ns_); }
  /// Sends until the connection stands, and takes it.
  void connect() {
    for (int i = 0; i < 1000 && link_->fd() < 0; ++i) {
      send();
      now_ns_ += 10 * kMs;
      ::poll(nullptr, 0, link_->fd() < 0 ? 1 : 0);
    }
    ASSERT_GE(link_->fd(), 0);
    ASSERT_TRUE(readable(listener_.fd()));
    SocketAddress peer;
    int error = 0;
    controller_ = listener_.accept(peer, error);
    ASSERT_TRUE(controller_);
  }
  static bool readable(int fd) {
    pollfd waits{fd, POLLIN, 0};
    return ::poll(&waits, 1, 30'000) == 1;
  }
  /// Returns what the controller got.
  std::string heard() {
    EXPECT_TRUE(readable(controller_.fd()));
    std::array<std::byte, 4096> space;
    const IoResult got = controller_.read_some(space);
    return {reinterpret_cast<const char*>(space.data()), got.bytes};
  }
  void say(const std::string& text) {
    EXPECT_EQ(controller_.write_some(std::as_bytes(std::span(text))).bytes, text.size());
    EXPECT_TRUE(readable(link_->fd()));
  }
  std::vector<EventKind> events() {
    std::vector<EventKind> out;
    while (const Event* event = events_.ring().front()) {
      out.push_back(event->kind);
      events_.ring().pop();
    }
    return out;
  }
  std::uint64_t count(Counter counter) { return counters_.get(counter); }

  Counters counters_;
  EventLog events_{64, counters_};
  const SocketContext context_;
  TcpListener listener_;
  TcpSocket controller_;
  std::unique_ptr<AcutrolAxesLink> link_;
  std::int64_t now_ns_ = 1'000'000'000'000;
  std::uint64_t counter_ = 0;
};

TEST_F(AcutrolAxesLinkTest, asks_and_takes_answers_in_pieces) {
  connect();
  EXPECT_EQ(heard(), ":R:P 1\r\n:R:R 1\r\n:interlock? 1\r\n");
  say("12.");
  EXPECT_FALSE(link_->receive(now_ns_).has_value());
  say("5\r\n0.0\r\nOpen\r\n");
  const auto monitor = link_->receive(now_ns_);
  ASSERT_TRUE(monitor.has_value());
  EXPECT_EQ(monitor->count, 1U);
  EXPECT_FALSE(link_->receive(now_ns_).has_value());
  EXPECT_EQ(events(), std::vector<EventKind>{EventKind::axes_connected});
}

TEST_F(AcutrolAxesLinkTest, a_silent_controller_blocks_nothing_and_is_called_again) {
  connect();
  heard();
  const std::uint64_t sent = count(Counter::axes_commands);
  const std::uint64_t before = test::heap_request_count();
  for (int i = 0; i < 90; ++i) {
    now_ns_ += 10 * kMs;
    send();
    EXPECT_FALSE(link_->receive(now_ns_).has_value());
  }
  EXPECT_EQ(test::heap_request_count(), before);
  EXPECT_EQ(count(Counter::axes_commands), sent);
  EXPECT_EQ(count(Counter::axes_rounds_left_out), 90U);
  EXPECT_EQ(count(Counter::axes_connections_lost), 0U);
  now_ns_ += kSecondNs;
  send();
  EXPECT_EQ(count(Counter::axes_connections_lost), 1U);
  connect();
  EXPECT_EQ(heard(), ":R:P 1\r\n:R:R 1\r\n:interlock? 1\r\n");
  say("12.5\r\n0.0\r\nOpen\r\n");
  EXPECT_TRUE(link_->receive(now_ns_).has_value());
  using enum EventKind;
  EXPECT_EQ(events(), (std::vector{axes_connected, axes_lost, axes_connected}));
}

TEST_F(AcutrolAxesLinkTest, a_closed_connection_is_made_again) {
  connect();
  controller_.close();
  ASSERT_TRUE(readable(link_->fd()));
  EXPECT_FALSE(link_->receive(now_ns_).has_value());
  EXPECT_EQ(link_->fd(), -1) << "a descriptor at its end would keep the agent awake";
  EXPECT_EQ(count(Counter::axes_connections_lost), 1U);
  send();
  EXPECT_GT(count(Counter::axes_send_errors), 0U);
  connect();
}

TEST_F(AcutrolAxesLinkTest, answers_out_of_order_end_the_connection) {
  connect();
  say("OK\r\n");
  EXPECT_FALSE(link_->receive(now_ns_).has_value());
  EXPECT_EQ(link_->fd(), -1);
  EXPECT_EQ(count(Counter::axes_connections_lost), 1U);
  EXPECT_EQ(count(Counter::axes_reports_refused), 1U);
}

TEST_F(AcutrolAxesLinkTest, the_motors_are_off_when_the_link_ends) {
  connect();
  heard();
  say("12.5\r\n0.0\r\nOpen\r\n");
  ASSERT_TRUE(link_->receive(now_ns_).has_value());
  send();
  EXPECT_THAT(heard(), HasSubstr(":interlock:close 1"));
  say("OK\r\n");  // the other answers do not come, and this one is not read
  AxesCommand off = park(++counter_);
  off.mode = AxesMode::off;
  link_->send(off, now_ns_);
  link_.reset();
  EXPECT_EQ(heard(), ":mode:off 1\r\n:interlock:open 1\r\n");
}

TEST_F(AcutrolAxesLinkTest, waits_for_a_controller_that_is_not_there) {
  const std::uint16_t was = port();
  listener_ = {};
  for (int i = 0; i < 500; ++i) {
    now_ns_ += 10 * kMs;
    send();
    EXPECT_FALSE(link_->receive(now_ns_).has_value());
  }
  EXPECT_EQ(link_->fd(), -1);
  EXPECT_EQ(count(Counter::axes_commands), 0U);
  EXPECT_EQ(count(Counter::axes_connections_lost), 0U);
  EXPECT_EQ(events(), std::vector<EventKind>{});
  const auto where = parse_host_port("127.0.0.1:" + std::to_string(was));
  auto listener = TcpListener::open(context_, *resolve(*where, Transport::tcp, true));
  ASSERT_TRUE(listener.has_value());
  listener_ = std::move(*listener);
  connect();
}

TEST(OpenAxesLink, names_the_key_when_the_form_is_wrong) {
  Counters counters;
  EventLog events(4, counters);
  for (const char* controller : {"table", "memory:axes", "acutrol:table", "memory:/x@3"}) {
    config::MotionConfig motion;
    motion.controller = controller;
    const auto link = open_axes_link(motion, counters, events);
    ASSERT_FALSE(link.has_value()) << controller;
    EXPECT_THAT(link.error().text, HasSubstr("motion.controller")) << controller;
  }
}

}  // namespace
}  // namespace emit::server
