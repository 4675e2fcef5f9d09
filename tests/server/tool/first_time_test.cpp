// SPDX-License-Identifier: Apache-2.0
// A run whose poses begin hours after the scenario's epoch, from the daemon to the replay.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <thread>

#include "client/http_get.hpp"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"
#include "support/exposition.hpp"
#include "support/times.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::chrono::seconds kLong{280};

/// Record of a daemon whose poses begin four hours after the epoch.
struct FirstRun {
  std::string log;
  double warmed_up_again = -1.0;
  std::string journal;
};

FirstRun run_daemon(const ScratchFolder& folder, const std::string& first_time) {
  FirstRun run;
  run.journal = folder.file("journal.mcap");
  folder.write("world.toml",
               "epoch_utc = 2020-06-21T06:00:00Z\n[place]\nlat_deg = 48.0\nlon_deg = 11.0\n"
               "[[object]]\ngltf = \"share:scenes/box.glb\"\n"
               "[sensor]\nposition_m = [-6.0, -5.0, 5.0]\nlook_at_m = [0.0, 0.0, 0.5]\n"
               "width_px = 32\nheight_px = 24\n[thermal]\nmethod = \"cached\"\n"
               "max_samples = 2000\nhistory_start_s = 0\n");
  DaemonProcess daemon(
      folder,
      {"--config", folder.write("emitd.toml", "scenario = \"world.toml\"\n[source]\n" + first_time +
                                                  "[host]\nudp = \"127.0.0.1:0\"\n"
                                                  "[control]\ntcp = \"127.0.0.1:0\"\n"
                                                  "[journal]\nfile = \"journal.mcap\"\n"
                                                  "[metrics]\nlisten = \"127.0.0.1:0\"\n")});
  EXPECT_TRUE(daemon.wait_ready(kLong)) << folder.read("stderr");
  const ProcessResult sent =
      run_emit({"send",
                folder.write("poses.csv",
                             "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz\n"
                             "14400,0,0,10,0,0.7071067811865476,0.7071067811865476,0\n"
                             "14400.005,1,0,10,0,0.7071067811865476,0.7071067811865476,0\n"),
                "--to", "udp://" + daemon.host_udp()},
               kLong);
  EXPECT_EQ(sent.exit_code, 0) << sent.out << sent.err;
  // Wait for both frames; the first one may warm the surface up.
  Exposition metrics("");
  const auto end = std::chrono::steady_clock::now() + kLong;
  do {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    const auto answer = client::http_get("http://" + daemon.metrics() + "/metrics", kLongNs);
    EXPECT_TRUE(answer.has_value()) << answer.error().text;
    metrics = Exposition(answer ? answer->body : "");
  } while (metrics.value("emitd_frames_submitted_total") != 2.0 &&
           std::chrono::steady_clock::now() < end);
  run.warmed_up_again = metrics.value("emitd_frames_warmed_up_total");
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0);
  run.log = folder.read("stderr");
  return run;
}

TEST(FirstTime, the_surface_is_warmed_up_for_the_first_pose) {
  ScratchFolder folder;
  const FirstRun run = run_daemon(folder, "first_time_s = 14400\n");
  EXPECT_EQ(run.warmed_up_again, 0.0) << run.log;
  EXPECT_THAT(run.log, Not(HasSubstr("the thermal history begins")));
  EXPECT_THAT(run.log, Not(HasSubstr("event=warmed_up_again")));
  // The journal says when the run began, so that its replay warms up once too.
  const ProcessResult replay =
      run_emit({"replay", run.journal, "--scenario", folder.file("world.toml")}, kLong);
  EXPECT_EQ(replay.exit_code, 0) << replay.out << replay.err;
  EXPECT_THAT(replay.out, HasSubstr("bit-identical"));
  EXPECT_THAT(replay.err, Not(HasSubstr("the thermal history begins")));
}

TEST(FirstTime, without_it_the_log_names_the_short_history) {
  ScratchFolder folder;
  const FirstRun run = run_daemon(folder, "");
  EXPECT_THAT(run.log, HasSubstr("the thermal history begins at 0 s"));
}

}  // namespace
}  // namespace emit::test
