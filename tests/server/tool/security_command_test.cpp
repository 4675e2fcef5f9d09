// SPDX-License-Identifier: Apache-2.0
// Options --tls-* and --key-file of emit's commands, against a daemon that asks for them.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <csignal>
#include <string>
#include <vector>

#include "support/certificates.hpp"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

TEST(CliSecurity, commands_prove_who_they_are) {
  const ScratchFolder folder;
  const Authority rig("rig authority");
  rig.write(folder.file("ca.pem"));
  rig.issue("emitd", "IP:127.0.0.1", folder.file("d.pem"), folder.file("d.key"));
  rig.issue("viewer", "DNS:viewer", folder.file("c.pem"), folder.file("c.key"));
  const auto key_file = [&](const std::string& name, char digit) {
    const std::string file = folder.write(name, std::string(64, digit));
    ::chmod(file.c_str(), 0600);
    return file;
  };
  const std::string key = key_file("right.keys", '1');
  const std::string wrong_key = key_file("wrong.keys", '2');
  const std::string config =
      folder.write("emitd.toml", canned_config(64, 48, "mode = \"ig-clock\"\nrate_hz = 50",
                                               "[tls]\ncertificate = \"d.pem\"\nkey = \"d.key\"\n"
                                               "client_ca = \"ca.pem\"\n"));
  DaemonProcess daemon(folder, {"--config", config, "--set", "host.key_file=" + key});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const std::string tcp = "tcp://" + daemon.control();
  const std::string udp = "udp://" + daemon.host_udp();
  const std::vector<std::string> tls = {"--tls-ca",   folder.file("ca.pem"),
                                        "--tls-cert", folder.file("c.pem"),
                                        "--tls-key",  folder.file("c.key")};
  const auto run = [&](std::vector<std::string> arguments, bool with_tls) {
    if (with_tls) arguments.insert(arguments.end(), tls.begin(), tls.end());
    return run_emit(arguments);
  };
  const std::string poses = folder.write(
      "poses.csv",
      "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz\n0,0,0,1,1,0,0,0\n0.01,0,0,1,1,0,0,0\n");

  const ProcessResult received = run({"receive", tcp, "--frames", "5"}, true);
  EXPECT_EQ(received.exit_code, 0) << received.err;
  EXPECT_EQ(run({"receive", "udp://" + daemon.control(), "--frames", "5"}, true).exit_code, 0);
  EXPECT_EQ(run({"receive", tcp, "--frames", "5"}, false).exit_code, 1);
  EXPECT_EQ(run({"receive", tcp, "--tls-cert", folder.file("c.pem")}, false).exit_code, 2);

  const ProcessResult keyed = run({"send", poses, "--to", udp, "--key-file", key}, false);
  EXPECT_EQ(keyed.exit_code, 0) << keyed.err;
  const ProcessResult agreed = run({"send", poses, "--to", udp, "--control", tcp}, true);
  EXPECT_EQ(agreed.exit_code, 0) << agreed.err;
  const ProcessResult wrong = run({"send", poses, "--to", udp, "--key-file", wrong_key}, false);
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_NE(wrong.err.find("no answer to the key"), std::string::npos) << wrong.err;
  EXPECT_EQ(run({"send", poses, "--to", udp}, true).exit_code, 2);
  EXPECT_EQ(run({"send", poses, "--to", tcp}, true).exit_code, 0);

  const ProcessResult recorded =
      run({"record", "--from", tcp, "--out", folder.file("run.mcap"), "--frames", "3"}, true);
  EXPECT_EQ(recorded.exit_code, 0) << recorded.err;
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
}

}  // namespace
}  // namespace emit::test
