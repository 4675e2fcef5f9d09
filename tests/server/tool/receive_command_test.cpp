// SPDX-License-Identifier: Apache-2.0
// Command emit receive against a daemon with canned frames.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>
#include <vector>

#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

TEST(CliReceive, silence_is_explained_once_by_the_daemons_pacing) {
  const ScratchFolder folder;
  DaemonProcess daemon(
      folder,
      {"--config", folder.write("emitd.toml", canned_config(64, 48, "mode = \"host-step\""))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const ProcessResult silent =
      run_emit({"receive", "tcp://" + daemon.control(), "--frames", "1", "--timeout-s", "0.5"});
  EXPECT_EQ(silent.exit_code, 1) << silent.err;
  const std::size_t hint =
      silent.err.find("emit: warning: no frame for 0.5 s: the daemon's pacing");
  ASSERT_NE(hint, std::string::npos) << silent.err;
  EXPECT_NE(silent.err.find("emit send", hint), std::string::npos) << silent.err;
  EXPECT_EQ(silent.err.find("emit: warning: no frame", hint + 1), std::string::npos) << silent.err;
}

TEST(CliReceive, shared_memory_works_like_every_other_transport) {
  const ScratchFolder folder;
  const std::string name = "cli-" + std::to_string(::getpid());
  DaemonProcess daemon(
      folder, {"--config", folder.write("emitd.toml",
                                        canned_config(320, 256, "mode = \"ig-clock\"\nrate_hz = 50",
                                                      "[stream]\nshm = \"" + name + "\"\n"))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  for (const std::string& url : {"shm://" + name, "tcp://" + daemon.control()}) {
    const std::string out = folder.file("out-" + url.substr(0, 3));
    const ProcessResult checked = run_emit({"receive", url, "--frames", "60", "--json", "-"});
    EXPECT_EQ(checked.exit_code, 0) << checked.err;
    EXPECT_EQ(json_value(checked.out, "frames"), "60") << checked.out;
    EXPECT_EQ(json_value(checked.out, "crc_errors"), "0");
    EXPECT_EQ(json_value(checked.out, "lost"), "0");
    EXPECT_EQ(json_value(checked.out, "unflagged_gaps"), "0");
    EXPECT_EQ(json_value(checked.out, "device"), "\"canned: test pattern\"");
    EXPECT_NE(checked.err.find("send start -> frame received: p50"), std::string::npos);
    const ProcessResult thirds =
        run_emit({"receive", url, "--every", "3", "--frames", "10", "--json", "-"});
    EXPECT_EQ(thirds.exit_code, 0) << thirds.err;
    EXPECT_EQ(json_value(thirds.out, "every_nth"), "3");
    EXPECT_EQ(json_value(thirds.out, "lost"), "0");
    EXPECT_EQ(json_value(thirds.out, "gaps"), "0") << "what it did not want is no gap";
    EXPECT_EQ(json_value(thirds.out, "unflagged_gaps"), "0");
    EXPECT_EQ(json_value(thirds.out, "reconnects"), "0");
    const ProcessResult saved = run_emit({"receive", url, "--frames", "3", "--out", out});
    EXPECT_EQ(saved.exit_code, 0) << saved.err;
    std::size_t files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(out)) {
      files += entry.path().extension() == ".exr" || entry.path().extension() == ".png" ? 1U : 0U;
    }
    EXPECT_EQ(files, 6U);
  }
  const ProcessResult band = run_emit({"receive", "shm://" + name, "--band", "none"});
  EXPECT_EQ(band.exit_code, 1);
  EXPECT_NE(band.err.find("no channel"), std::string::npos) << band.err;
  EXPECT_EQ(run_emit({"receive", "shm://a/b"}).exit_code, 2);
  const ProcessResult nobody = run_emit({"receive", "shm://" + name + "-x"});
  EXPECT_EQ(nobody.exit_code, 1);
  EXPECT_NE(nobody.err.find("no emitd on this host"), std::string::npos) << nobody.err;
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
}

TEST(CliReceive, TellsWhatHelpAgainstLossesWasGranted) {
  const ScratchFolder folder;
  // The frames are small, so that the socket holds all of them while a busy machine lets nobody
  // read.
  DaemonProcess daemon(
      folder, {"--config", folder.write("emitd.toml",
                                        canned_config(64, 48, "mode = \"ig-clock\"\nrate_hz = 50",
                                                      "[stream]\nfec_max_parity_frac = 0.25\n"))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const std::string url = "udp://" + daemon.control();
  const ProcessResult granted =
      run_emit({"receive", url, "--frames", "20", "--fec", "48+5", "--resend", "--json", "-"});
  EXPECT_EQ(granted.exit_code, 0) << granted.err;
  EXPECT_EQ(json_value(granted.out, "error_correction"), "\"48+5\"") << granted.out;
  EXPECT_EQ(json_value(granted.out, "resend"), "false") << "ig-clock";
  EXPECT_EQ(json_value(granted.out, "repaired"), "0");
  EXPECT_NE(granted.err.find("resend is not granted"), std::string::npos) << granted.err;
  const ProcessResult too_much = run_emit({"receive", url, "--frames", "1", "--fec", "8+4"});
  EXPECT_EQ(too_much.exit_code, 1);
  EXPECT_NE(too_much.err.find("stream.fec_max_parity_frac allows 0.25"), std::string::npos)
      << too_much.err;
  EXPECT_EQ(run_emit({"receive", url, "--fec", "lots"}).exit_code, 2);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
}

}  // namespace
}  // namespace emit::test
