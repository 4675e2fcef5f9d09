// SPDX-License-Identifier: Apache-2.0
// A motion simulator in the loop with real programs: emit fms-sim, emitd, emit send, emit receive
// and the replay of the journal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>
#include <chrono>
#include <cmath>
#include <csignal>
#include <functional>
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

constexpr std::chrono::seconds kMotionLimit{120};

/// Waits until `done` holds. Returns false if it does not within the limit.
bool wait_until(const std::function<bool()>& done) {
  const auto end = std::chrono::steady_clock::now() + kMotionLimit;
  while (!done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return true;
}

/// Poses at 100 Hz of a seeker that swings about north.
std::string swinging_poses(int seconds) {
  std::string out = "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz\n";
  for (int i = 0; i < 100 * seconds; ++i) {
    const double half_rad = 0.5 * 0.1 * std::sin(0.02 * i);
    // World from body for a heading: half a turn about the axis between north and east.
    const double c = std::sqrt(0.5) * (std::cos(half_rad) + std::sin(half_rad));
    const double s = std::sqrt(0.5) * (std::cos(half_rad) - std::sin(half_rad));
    out += fmt::format("{:.3f},0,-8,1,0,{:.15g},{:.15g},0\n", 0.01 * i, c, s);
  }
  return out;
}

/// Starts a table of three axes, and returns the end of its "ready KEY=" line; "" when it does not
/// start.
std::string start_table(const ToolProcess& table, const std::string& key) {
  const std::string ready = "ready " + key + "=";
  if (!wait_until([&] { return table.out().find('\n') != std::string::npos; })) return "";
  if (table.out().rfind(ready, 0) != 0) return "";
  return table.out().substr(ready.size(), table.out().find('\n') - ready.size());
}

/// Writes the configuration of a daemon with a world of one box and a controller. Returns its name.
std::string write_daemon(const ScratchFolder& folder, const std::string& motion) {
  folder.write("world.toml",
               "epoch_utc = 2020-06-21T06:00:00Z\n[place]\nlat_deg = 48.0\nlon_deg = 11.0\n"
               "[[object]]\ngltf = \"share:scenes/box.glb\"\n[[channel]]\nname = \"shown\"\n"
               "kind = \"projector\"\nband = \"8-12\"\nwindow_px = [4, 4, 24, 16]\n"
               "mirror = \"horizontal\"\nrotate_deg = 90\napply_shift = true\n"
               "drive_table_file = \"drive.csv\"\n"
               "[sensor]\nposition_m = [0.0, -8.0, 1.0]\nlook_at_m = [0.0, 0.0, 1.0]\n"
               "width_px = 32\nheight_px = 24\n[thermal]\nmethod = \"cached\"\n"
               "max_samples = 2000\n");
  folder.write("drive.csv", "radiance_w_m2_sr,drive\n0,0\n30,1000\n60,4095\n");
  std::string axes;
  for (int i = 0; i < 3; ++i) {
    axes += "{ min_deg = -100, max_deg = 100, rate_deg_s = 300, acceleration_deg_s2 = 5000 }, ";
  }
  return folder.write("emitd.toml",
                      "scenario = \"world.toml\"\n[pacing]\nmode = \"ig-clock\"\n"
                      "rate_hz = 50\n[motion]\n" +
                          motion + "\nfeedback_timeout_ms = 1000\naxes = [" + axes +
                          "]\n[host]\nudp = \"127.0.0.1:0\"\n"
                          "[control]\ntcp = \"127.0.0.1:0\"\n"
                          "[journal]\nfile = \"journal.mcap\"\n"
                          "[metrics]\nlisten = \"127.0.0.1:0\"\n");
}

TEST(MotionRun, a_real_loop_follows_is_flagged_when_it_does_not_and_replays) {
  ScratchFolder folder;
  ToolProcess table(folder, "fms", {"fms-sim", "--listen", "127.0.0.1:0", "--axes", "3"});
  const std::string controller = start_table(table, "axes_udp");
  ASSERT_NE(controller, "") << table.err();
  DaemonProcess daemon(folder,
                       {"--config", write_daemon(folder, "controller = \"" + controller + "\"")});
  ASSERT_TRUE(daemon.wait_ready(kMotionLimit)) << folder.read("stderr");
  const auto metric = [&](const std::string& name) {
    const auto answer = client::http_get("http://" + daemon.metrics() + "/metrics", kLongNs);
    return answer ? Exposition(answer->body).value(name) : -1.0;
  };

  // The axes follow the host, and the error of direction gets known.
  ToolProcess receiver(
      folder, "receive",
      {"receive", "tcp://" + daemon.control(), "--json", folder.file("receive.json")});
  ToolProcess host(folder, "send",
                   {"send", folder.write("poses.csv", swinging_poses(100)), "--to",
                    "udp://" + daemon.host_udp()});
  EXPECT_TRUE(wait_until([&] { return metric("emitd_motion_pointing_error_pixels_count") > 50.0; }))
      << folder.read("stderr");
  // They park when it stops, and frames say so.
  host.signal(SIGINT);
  const double flagged = metric("emitd_frames_motion_fault_total");
  EXPECT_TRUE(wait_until([&] { return metric("emitd_axes_host_silences_total") >= 1.0; }));
  EXPECT_TRUE(wait_until([&] { return metric("emitd_frames_motion_fault_total") > flagged; }));

  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0);
  EXPECT_THAT(folder.read("stderr"), HasSubstr("event=motion state=following faults=none"));
  EXPECT_THAT(folder.read("stderr"), HasSubstr("faults=no_host"));
  EXPECT_EQ(receiver.wait(), 0) << receiver.err();
  const std::string report = folder.read("receive.json");
  EXPECT_GT(std::stoi("0" + json_value(report, "pointing_frames")), 0) << report;
  EXPECT_GT(std::stoi("0" + json_value(report, "shifted_frames")), 0) << report;
  // The daemon switches the motors off when it ends.
  EXPECT_TRUE(wait_until([&] { return table.err().rfind("motors off") != std::string::npos; }))
      << table.err();
  table.signal(SIGINT);
  EXPECT_EQ(table.wait(), 0);
  const ProcessResult replayed =
      run_emit({"replay", folder.file("journal.mcap"), "--scenario", folder.file("world.toml")},
               kMotionLimit);
  EXPECT_EQ(replayed.exit_code, 0) << replayed.out << replayed.err;
  EXPECT_THAT(replayed.out, HasSubstr("0 differ from the recording"));
}

/// A way to the controller: option of the simulator, key of its ready line, and what emitd is told.
struct Way {
  std::string option;
  std::string place;
  std::string key;
  std::string prefix;
  std::string rate;
};

TEST(MotionRun, memory_and_acutrol_commands_do_the_same) {
  const ScratchFolder shared;
  for (const Way& way :
       {Way{"--memory", shared.file("axes") + "@128", "axes_memory", "memory:", "rate_hz = 1000"},
        Way{"--acutrol", "127.0.0.1:0", "axes_acutrol", "acutrol:", "rate_hz = 100"}}) {
    SCOPED_TRACE(way.option);
    ScratchFolder folder;
    ToolProcess table(folder, "fms" + way.option,
                      {"fms-sim", way.option, way.place, "--axes", "3"});
    const std::string controller = start_table(table, way.key);
    ASSERT_NE(controller, "") << table.err();
    DaemonProcess daemon(
        folder, {"--config", write_daemon(folder, "controller = \"" + way.prefix + controller +
                                                      "\"\n" + way.rate)});
    ASSERT_TRUE(daemon.wait_ready(kMotionLimit)) << folder.read("stderr");
    const auto metric = [&](const std::string& name) {
      const auto answer = client::http_get("http://" + daemon.metrics() + "/metrics", kLongNs);
      return answer ? Exposition(answer->body).value(name) : -1.0;
    };
    ToolProcess host(folder, "send" + way.option,
                     {"send", folder.write("poses.csv", swinging_poses(100)), "--to",
                      "udp://" + daemon.host_udp()});
    EXPECT_TRUE(wait_until([&] {
      return metric("emitd_motion_pointing_error_pixels_count") > 50.0;
    })) << folder.read("stderr")
        << table.err();
    EXPECT_EQ(metric("emitd_axes_reports_refused_total"), 0.0);
    EXPECT_EQ(metric("emitd_axes_connections_lost_total"), 0.0);
    EXPECT_GT(metric("emitd_axes_reports_total"), 100.0);
    host.signal(SIGINT);
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.wait(), 0);
    EXPECT_THAT(folder.read("stderr"), HasSubstr("event=motion state=following faults=none"));
    // The daemon switches the motors off when it ends.
    EXPECT_TRUE(wait_until([&] { return table.err().rfind("motors off") != std::string::npos; }))
        << table.err();
    table.signal(SIGINT);
    EXPECT_EQ(table.wait(), 0);
    EXPECT_THAT(table.out(), HasSubstr("0 malformed"));
  }
}

}  // namespace
}  // namespace emit::test
