// SPDX-License-Identifier: Apache-2.0
// A campaign on a cluster of one node that the test starts itself: an element that is killed, one
// that fails, the resumption, and the numbers of a local run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>
#include <thread>

#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;

constexpr const char* kNode = EMIT_TEST_SOURCE_DIR "/support/slurm_node.sh";
constexpr std::size_t kElements = 5;
constexpr std::chrono::seconds kLimit{240};

/// Slurm of this machine alone. `conf` is empty where its programs are missing.
class SlurmNode {
 public:
  explicit SlurmNode(std::string folder) : folder_(std::move(folder)) {
    const ProcessResult started = run_process({kNode, "start", folder_, "2"});
    installed = started.exit_code != 77;
    said = started.err;
    if (started.exit_code == 0) conf = folder_ + "/slurm.conf";
  }
  ~SlurmNode() { static_cast<void>(run_process({kNode, "stop", folder_})); }
  SlurmNode(const SlurmNode&) = delete;
  SlurmNode& operator=(const SlurmNode&) = delete;

  bool installed = false;
  std::string conf;
  std::string said;

 private:
  std::string folder_;
};

/// The columns of a table that do not depend on the machine: those before warm_up_s.
std::string numbers_of(const std::string& text) {
  std::istringstream in(text);
  std::string out;
  std::ptrdiff_t columns = -1;
  for (std::string line; std::getline(in, line);) {
    if (columns < 0) {
      const auto end = line.begin() + static_cast<std::ptrdiff_t>(line.find("warm_up_s"));
      columns = std::count(line.begin(), end, ',');
    }
    std::size_t end = 0;
    for (std::ptrdiff_t i = 0; i < columns; ++i) end = line.find(',', end) + 1;
    out += line.substr(0, end) + "\n";
  }
  return out;
}

TEST(CampaignSlurm,
     a_killed_and_a_failing_element_are_resumed_and_give_the_numbers_of_a_local_run) {
  const ScratchFolder folder;
  // munge wants its socket to be in reach of all users.
  std::filesystem::permissions(
      folder.path(), std::filesystem::perms::group_exec | std::filesystem::perms::others_exec,
      std::filesystem::perm_options::add);
  const SlurmNode node(folder.file("node"));
  if (!node.installed) GTEST_SKIP() << node.said << "Debian: slurmctld slurmd slurm-client munge";
  ASSERT_NE(node.conf, "") << node.said;
  ASSERT_EQ(::setenv("SLURM_CONF", node.conf.c_str(), 1), 0);
  ASSERT_EQ(run_emit({"generate", "box", "--out", folder.path().string()}).exit_code, 0);
  std::string rows;
  for (std::size_t i = 0; i < kElements; ++i) {
    rows += fmt::format("[{}.0, \"{}\"], ", i + 1,
                        folder.file(i + 1 < kElements ? "box.glb" : "lost.glb"));
  }
  const std::string campaign =
      folder.write("c.toml",
                   "scenario = \"box\"\ntimes = \"10:30\"\n"
                   "set = [\"sensor.width_px=64\", \"sensor.height_px=48\", \"thermal.steps=5\"]\n"
                   "[[vary]]\nkeys = [\"weather.wind_m_s\", \"object[0].gltf\"]\nvalues = [" +
                       rows +
                       "]\n[truth]\nkind = \"none\"\n[run]\nretries = 1\n"
                       "[slurm]\ncpus = 1\nmemory_mib = 1000\n");
  const auto elements = folder.path() / "slurm" / "elements";
  ToolProcess first(folder, "first",
                    {"campaign", campaign, "--out", folder.file("slurm"), "--slurm", "--json",
                     folder.file("first.json")});

  // Kill the first element that runs.
  std::string task;
  while (task.empty() && !first.ended()) {
    const ProcessResult queue = run_process({"squeue", "-h", "-r", "-t", "R", "-o", "%i"});
    task = queue.out.substr(0, queue.out.find('\n'));
  }
  const std::size_t place = task.find('_');
  ASSERT_NE(place, std::string::npos) << task << first.err();
  const std::size_t killed = std::stoul(task.substr(place + 1));
  ASSERT_LT(killed + 1, kElements) << "the one that fails";
  ASSERT_EQ(run_process({"scancel", "--signal=KILL", "--full", task}).exit_code, 0);
  ASSERT_EQ(first.wait(kLimit), 1) << first.out() << first.err();
  // The second array holds what the first one left: the killed element and the failing one.
  EXPECT_EQ(folder.read("slurm/slurm/array-001.list"),
            fmt::format("{}\n{}\n", killed, kElements - 1));
  const std::string summary = folder.read("first.json");
  EXPECT_EQ(json_value(summary, "done"), fmt::format("{}", kElements - 1));
  EXPECT_EQ(json_value(summary, "tries"), "2");
  EXPECT_THAT(first.err(), HasSubstr("lost.glb: cannot be read"));
  EXPECT_THAT(folder.read("slurm/report.html"), HasSubstr("Elements without result"));

  // The same command does what is left when the file is in its place.
  std::filesystem::copy_file(folder.file("box.glb"), folder.file("lost.glb"));
  const ProcessResult second =
      run_emit({"campaign", campaign, "--out", folder.file("slurm"), "--slurm"}, kLimit);
  EXPECT_EQ(second.exit_code, 0) << second.out << second.err;
  EXPECT_THAT(second.out,
              HasSubstr(fmt::format("{} done ({} of them before)", kElements, kElements - 1)));
  const ProcessResult local =
      run_emit({"campaign", campaign, "--out", folder.file("local"), "--jobs", "2"}, kLimit);
  EXPECT_EQ(local.exit_code, 0) << local.out << local.err;
  EXPECT_EQ(numbers_of(folder.read("slurm/results.csv")),
            numbers_of(folder.read("local/results.csv")));
  ASSERT_EQ(::unsetenv("SLURM_CONF"), 0);
}

}  // namespace
}  // namespace emit::test
