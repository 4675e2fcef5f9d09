// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <string>

#include "support/daemon_process.hpp"

namespace emit::test {

/// Two network namespaces joined by a virtual cable: "here" is 192.0.2.1 and fd00:77::1, "there" is
/// 192.0.2.2 and fd00:77::2. A socket belongs to the namespace that was entered when it was made. A
/// process belongs to the one in which it was started. No privileges are needed where user
/// namespaces are open.
class TwoNetworks {
 public:
  static constexpr int kSkippedExit = 77;

  /// Sets up the networks. `obstacle_file` receives the reason of skip().
  explicit TwoNetworks(std::string obstacle_file) : obstacle_file_(std::move(obstacle_file)) {}

  /// Ends the process: the test is skipped.
  [[noreturn]] void skip(const std::string& reason) const {
    std::ofstream(obstacle_file_) << reason;
    ::_exit(kSkippedExit);
  }
  /// Returns an empty text when ready, else the reason why this machine cannot do it. It changes
  /// the whole process: see in_two_networks().
  std::string setup() {
    const uid_t uid = ::getuid();
    const gid_t gid = ::getgid();
    if (::unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) {
      return std::string("no user and network namespaces: ") + std::strerror(errno);
    }
    std::ofstream("/proc/self/setgroups") << "deny";
    std::ofstream("/proc/self/uid_map") << "0 " << uid << " 1";
    std::ofstream("/proc/self/gid_map") << "0 " << gid << " 1";
    here_ = ::open("/proc/self/ns/net", O_RDONLY | O_CLOEXEC);
    if (::unshare(CLONE_NEWNET) != 0) {
      return std::string("no second network namespace: ") + std::strerror(errno);
    }
    there_ = ::open("/proc/self/ns/net", O_RDONLY | O_CLOEXEC);
    enter_here();
    const std::string there =
        "/proc/" + std::to_string(::getpid()) + "/fd/" + std::to_string(there_);
    if (!run("ip link set lo up && ip link add cable0 type veth peer name cable1 && "
             "ip link set cable1 netns " +
             there +
             " && ip addr add 192.0.2.1/24 dev cable0 && "
             "ip addr add fd00:77::1/64 dev cable0 nodad && ip link set cable0 up")) {
      return "ip(8) cannot make a virtual cable here";
    }
    enter_there();
    const bool done =
        run("ip link set lo up && ip addr add 192.0.2.2/24 dev cable1 && "
            "ip addr add fd00:77::2/64 dev cable1 nodad && ip link set cable1 up");
    enter_here();
    return done ? "" : "ip(8) cannot set up the other end of the cable";
  }
  /// Sends everything that leaves "here" through this queueing discipline of tc(8). Skips the test
  /// where there is none.
  void shape(const std::string& discipline) {
    enter_here();
    if (!run("tc qdisc add dev cable0 root " + discipline)) {
      skip("tc(8) or this kernel has no '" + discipline + "'");
    }
  }
  void enter_here() { ::setns(here_, CLONE_NEWNET); }
  void enter_there() { ::setns(there_, CLONE_NEWNET); }

 private:
  static bool run(const std::string& command) {
    return std::system(("(" + command + ") 2>/dev/null").c_str()) == 0;
  }
  std::string obstacle_file_;
  int here_ = -1;
  int there_ = -1;
};

/// Runs `body` in a process of its own, with the two networks. Its expectations count for the test;
/// where there are no namespaces the test is skipped with the reason.
inline void in_two_networks(const std::function<void(TwoNetworks&)>& body) {
  const ScratchFolder folder;
  const pid_t child = ::fork();
  if (child == 0) {
    TwoNetworks networks(folder.file("obstacle"));
    if (const std::string obstacle = networks.setup(); !obstacle.empty()) networks.skip(obstacle);
    body(networks);
    std::fflush(nullptr);
    ::_exit(::testing::Test::HasFailure() ? 1 : 0);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  if (WIFEXITED(status) && WEXITSTATUS(status) == TwoNetworks::kSkippedExit) {
    GTEST_SKIP() << folder.read("obstacle");
  }
  EXPECT_TRUE(WIFEXITED(status)) << "signal " << WTERMSIG(status);
  EXPECT_EQ(WEXITSTATUS(status), 0) << "see above";
}

}  // namespace emit::test
