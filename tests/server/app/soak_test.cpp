// SPDX-License-Identifier: Apache-2.0
// Hours of streaming: memory stays where it is, and whatever is missing is flagged.
// EMIT_SOAK_S sets the length in seconds; an hour otherwise.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "emit/client/client.hpp"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::ScratchFolder;
using test::ToolProcess;
using Clock = std::chrono::steady_clock;

double resident_mib(pid_t pid) {
  std::ifstream statm("/proc/" + std::to_string(pid) + "/statm");
  std::uint64_t all_pages = 0;
  std::uint64_t resident_pages = 0;
  statm >> all_pages >> resident_pages;
  return static_cast<double>(resident_pages) * static_cast<double>(::sysconf(_SC_PAGESIZE)) /
         (1 << 20);
}

/// Memory of a process over time.
struct Memory {
  std::string name;
  pid_t pid = -1;
  std::vector<double> at_s;
  std::vector<double> mib;

  void sample(double now_s) {
    at_s.push_back(now_s);
    mib.push_back(resident_mib(pid));
  }
  /// Returns the slope by least squares over the second half: memory that is taken once, on the
  /// way, is no leak.
  [[nodiscard]] double slope_mib_per_h() const {
    const std::size_t from = at_s.size() / 2;
    const auto count = static_cast<double>(at_s.size() - from);
    double t_mean = 0.0;
    double m_mean = 0.0;
    for (std::size_t i = from; i < at_s.size(); ++i) {
      t_mean += at_s[i] / count;
      m_mean += mib[i] / count;
    }
    double above = 0.0;
    double below = 0.0;
    for (std::size_t i = from; i < at_s.size(); ++i) {
      above += (at_s[i] - t_mean) * (mib[i] - m_mean);
      below += (at_s[i] - t_mean) * (at_s[i] - t_mean);
    }
    return below > 0.0 ? 3600.0 * above / below : 0.0;
  }
};

TEST(Soak, MemoryStaysFlatAndEveryGapIsFlagged) {
  const char* text = std::getenv("EMIT_SOAK_S");
  const double length_s = text != nullptr ? std::strtod(text, nullptr) : 3600.0;
  ASSERT_GE(length_s, 10.0) << "EMIT_SOAK_S";
  const std::string name = "soak-" + std::to_string(::getpid());
  ScratchFolder folder;
  DaemonProcess daemon(
      folder, {"--config",
               folder.write("emitd.toml",
                            canned_config(640, 512, "mode = \"ig-clock\"\nrate_hz = 200",
                                          "[stream]\nshm = \"" + name + "\"\n[journal]\nfile = \"" +
                                              folder.file("journal.mcap") + "\"\n"))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  auto host = client::HostClient::connect("udp://" + daemon.host_udp());
  ASSERT_TRUE(host.has_value());

  struct Receiver {
    std::string label;
    std::vector<std::string> more;
    std::string url;
    std::unique_ptr<ToolProcess> process;
  };
  std::array<Receiver, 4> receivers{
      {{"tcp", {}, "tcp://" + daemon.control(), nullptr},
       {"udp", {}, "udp://" + daemon.control(), nullptr},
       {"shm", {}, "shm://" + name, nullptr},
       {"fifth", {"--every", "5"}, "tcp://" + daemon.control(), nullptr}}};
  std::vector<Memory> memories{{"emitd", daemon.pid(), {}, {}}};
  for (Receiver& receiver : receivers) {
    std::vector<std::string> arguments{"receive", receiver.url, "--json",
                                       folder.file(receiver.label + ".json")};
    arguments.insert(arguments.end(), receiver.more.begin(), receiver.more.end());
    receiver.process = std::make_unique<ToolProcess>(folder, receiver.label, arguments);
    ASSERT_TRUE(receiver.process->says("channel 0")) << receiver.process->err();
    memories.push_back({receiver.label, receiver.process->pid(), {}, {}});
  }
  // One client after the other connects, takes a few frames and leaves without a message.
  const auto start = Clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(Clock::now() - start).count(); };
  const double run_s = std::min(300.0, length_s / 8.0);  // the host restarts after each
  std::uint64_t poses = 0;
  std::uint64_t visitors = 0;
  double sampled_s = 0.0;
  while (seconds() < length_s) {
    protocol::HostFrameData pose;
    pose.run_id = 1 + static_cast<std::uint64_t>(seconds() / run_s);
    pose.frame_number = ++poses;
    pose.sim_time_ns = static_cast<std::int64_t>(seconds() * 1e9);
    ASSERT_TRUE((*host)->send(pose).has_value());
    if (poses % 100 == 0) {
      auto visitor = client::FrameClient::connect("tcp://" + daemon.control());
      ASSERT_TRUE(visitor.has_value()) << visitor.error().text;
      ASSERT_TRUE((*visitor)->subscribe({}).has_value());
      ASSERT_TRUE((*visitor)->receive(5'000'000'000).has_value());
      ++visitors;
    }
    if (seconds() - sampled_s >= std::min(10.0, length_s / 40.0)) {
      sampled_s = seconds();
      for (Memory& memory : memories) memory.sample(sampled_s);
      ASSERT_FALSE(daemon.ended()) << folder.read("stderr");
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  for (Receiver& receiver : receivers) {
    receiver.process->signal(SIGINT);
    const int code = receiver.process->wait();
    const std::string json = folder.read(receiver.label + ".json");
    // The machine is to blame for losses where the kernel dropped datagrams for want of room in
    // this process's buffer. The next frame has to report them all the same.
    if (test::json_value(json, "os_drops") == "0") {
      EXPECT_EQ(code, 0) << receiver.label << receiver.process->err();
      EXPECT_EQ(test::json_value(json, "lost"), "0") << receiver.label;
    }
    EXPECT_EQ(test::json_value(json, "unflagged_gaps"), "0") << receiver.label;
    EXPECT_EQ(test::json_value(json, "crc_errors"), "0") << receiver.label;
    std::printf("%-6s frames %s, lost %s, skipped %s, unflagged gaps %s, os drops %s\n",
                receiver.label.c_str(), test::json_value(json, "frames").c_str(),
                test::json_value(json, "lost").c_str(), test::json_value(json, "skipped").c_str(),
                test::json_value(json, "unflagged_gaps").c_str(),
                test::json_value(json, "os_drops").c_str());
  }
  // The limit is 2 MiB within the test, whatever its length, because heaps settle.
  const double limit_mib_per_h = 2.0 * 3600.0 / std::min(length_s, 3600.0);
  for (const Memory& memory : memories) {
    ASSERT_GE(memory.mib.size(), 4U);
    std::printf("%-6s %.1f MiB at first, %.1f at the end, slope %.2f MiB/h\n", memory.name.c_str(),
                memory.mib.front(), memory.mib.back(), memory.slope_mib_per_h());
    EXPECT_LT(memory.slope_mib_per_h(), limit_mib_per_h) << memory.name;
  }
  std::printf("%.0f s, %llu visitors\n", seconds(), static_cast<unsigned long long>(visitors));
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
}

}  // namespace
}  // namespace emit::server
