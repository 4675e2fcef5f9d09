// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "support/daemon_process.hpp"

namespace emit::server {
namespace {

std::string field(const std::filesystem::path& status, const std::string& name) {
  std::ifstream in(status);
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with(name + ":\t")) return line.substr(name.size() + 2);
  }
  return "absent";
}

// The test shows the effect only if root starts it. Any other user has no privileges to drop, and
// the same holds.
TEST(DaemonPrivileges, NoThreadKeepsACapabilityOrMayGainOne) {
  test::ScratchFolder folder;
  const std::string config = folder.write(
      "emitd.toml",
      test::canned_config(64, 48, "mode = \"host-step\"", "[metrics]\nlisten = \"127.0.0.1:0\"\n"));
  test::DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const std::filesystem::path tasks = "/proc/" + std::to_string(daemon.pid()) + "/task";
  const auto count = [&tasks] {
    return std::distance(std::filesystem::directory_iterator(tasks), {});
  };
  // The daemon is ready when its ports are open. Some threads may still be starting.
  constexpr auto kPatience = std::chrono::seconds(20);
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (count() < 7 && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  int threads = 0;
  for (const auto& task : std::filesystem::directory_iterator(tasks)) {
    ++threads;
    const auto status = task.path() / "status";
    for (const char* set : {"CapEff", "CapPrm", "CapInh", "CapAmb"}) {
      EXPECT_EQ(field(status, set), "0000000000000000") << set << " of " << field(status, "Name");
    }
    EXPECT_EQ(field(status, "NoNewPrivs"), "1") << field(status, "Name");
  }
  EXPECT_GE(threads, 7) << "agents, main and metrics";
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0);
  EXPECT_NE(folder.read("stderr").find("capabilities_kept=none"), std::string::npos);
}

}  // namespace
}  // namespace emit::server
