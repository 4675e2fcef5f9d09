// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "support/daemon_process.hpp"

namespace emit::test {
namespace {

// An integrator's project is built against an installed tree alone, and its program talks to a
// daemon.
TEST(OutsideProject, BuildsAgainstTheInstalledClientAndTalksToADaemon) {
  const ScratchFolder folder;
  const std::string log = folder.file("build.log");
  const auto run = [&](const std::string& command) {
    return std::system((command + " >> '" + log + "' 2>&1").c_str());
  };
  const std::string prefix = folder.file("prefix");
  const std::string build = folder.file("build");
  ASSERT_EQ(
      run(std::string(EMIT_TEST_CMAKE) +
          " --install '" EMIT_TEST_BINARY_DIR "' --component client --prefix '" + prefix + "'"),
      0)
      << folder.read("build.log");
  ASSERT_EQ(run(std::string(EMIT_TEST_CMAKE) +
                " -G Ninja -S '" EMIT_TEST_SOURCE_DIR "/server/client/outside_project' -B '" +
                build + "' -DCMAKE_PREFIX_PATH='" + prefix +
                "' -DCMAKE_CXX_COMPILER='" EMIT_TEST_CXX_COMPILER
                "' -DCMAKE_CXX_FLAGS='" EMIT_TEST_CXX_FLAGS "'"),
            0)
      << folder.read("build.log");
  ASSERT_EQ(run(std::string(EMIT_TEST_CMAKE) + " --build '" + build + "'"), 0)
      << folder.read("build.log");

  DaemonProcess daemon(
      folder,
      {"--config", folder.write("daemon.toml", canned_config(64, 48, "mode = \"host-step\""))});
  ASSERT_TRUE(daemon.wait_ready()) << daemon.err();
  EXPECT_EQ(run("'" + build + "/outside' tcp://" + daemon.control()), 0)
      << folder.read("build.log");
  const std::string said = folder.read("build.log");
  EXPECT_NE(said.find("frame 5: host frame 5, 3072 pixels"), std::string::npos) << said;
}

}  // namespace
}  // namespace emit::test
