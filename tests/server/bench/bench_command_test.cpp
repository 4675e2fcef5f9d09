// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

std::vector<double> numbers_of(const std::string& json, const std::string& key) {
  std::vector<double> out;
  const std::string name = "\"" + key + "\": ";
  for (std::size_t at = json.find(name); at != std::string::npos; at = json.find(name, at + 1)) {
    const char* text = json.c_str() + at + name.size();
    char* end = nullptr;
    const double value = std::strtod(text, &end);
    if (end != text) out.push_back(value);  // null is no number
  }
  return out;
}

TEST(CliBench, TheReferenceSolversConvergeWithSecondOrder) {
  const TemporaryFolder folder;
  const ProcessResult run = run_emit(
      {"bench", "convergence", "--plot", folder.file("c.svg"), "--json", folder.file("c.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string json = read_text(folder.file("c.json"));
  EXPECT_EQ(json_value(json, "suite"), "\"convergence\"");
  const std::vector<double> orders = numbers_of(json, "order");
  EXPECT_EQ(orders.size(), 15U);
  for (const double order : orders) EXPECT_GT(order, 1.8);
  const std::vector<double> errors = numbers_of(json, "max_error_k");
  ASSERT_EQ(errors.size(), 19U);
  for (const double error : errors) EXPECT_GT(error, 0.0);
  const std::string svg = read_text(folder.file("c.svg"));
  EXPECT_NE(svg.find("second order"), std::string::npos);
  EXPECT_NE(svg.find("3 dimensions, space"), std::string::npos);
}

TEST(CliBench, ScalingComparesEachCaseWithTheOneBefore) {
  const TemporaryFolder folder;
  const ProcessResult run = run_emit({"bench", "scaling", "--quick", "--pairs", "15",
                                      "--per-frame-frames", "1", "--json", folder.file("s.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string json = read_text(folder.file("s.json"));
  EXPECT_EQ(json_value(json, "suite"), "\"scaling\"");
  // There are two cases of each axis, with both methods except for the samples.
  const std::vector<double> values = numbers_of(json, "value");
  ASSERT_EQ(values.size(), 18U) << run.out;
  const std::vector<double> known(values.begin(), values.end() - 2);
  EXPECT_EQ(known, (std::vector<double>{27, 54, 27, 54, 1e4, 1e5, 1e4, 1e5, 3072, 12288, 3072,
                                        12288, 10, 100, 10, 100}));
  EXPECT_LT(values[16], values[17]);
  EXPECT_EQ(numbers_of(json, "samples").back(), values.back());
  EXPECT_EQ(numbers_of(json, "ratio_to_previous").size(), 9U);
  EXPECT_EQ(numbers_of(json, "self_ratio_spread").size(), 5U);
  EXPECT_EQ(numbers_of(json, "limit_ratio"), (std::vector<double>{1.02, 1.5, 1.1}));
  for (const double ms : numbers_of(json, "frame_ms_median")) EXPECT_GT(ms, 0.0);
  const std::vector<double> instances = numbers_of(json, "instances");
  ASSERT_EQ(instances.size(), 18U);
  EXPECT_GE(instances[13] - instances[12], 90.0);
}

TEST(CliBench, ACrowdIsMeasuredBesideTheSceneWithoutIt) {
  const TemporaryFolder folder;
  const ProcessResult run = run_emit({"bench",       "crowd",
                                      "--instances", "20",
                                      "--pairs",     "15",
                                      "--set",       "thermal.tolerance_k=50",
                                      "--set",       "thermal.steps=3",
                                      "--set",       "thermal.spin_up_s=600",
                                      "--set",       "thermal.history_start_s=-600",
                                      "--set",       "thermal.shadow_map_px=256",
                                      "--set",       "thermal.lateral=false",
                                      "--set",       "thermal.exchange=false",
                                      "--set",       "sensor.width_px=32",
                                      "--set",       "sensor.height_px=24",
                                      "--json",      folder.file("c.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string json = read_text(folder.file("c.json"));
  EXPECT_EQ(json_value(json, "suite"), "\"crowd\"");
  const std::vector<double> instances = numbers_of(json, "instances");
  ASSERT_EQ(instances.size(), 2U);
  EXPECT_EQ(instances[1] - instances[0], 20.0);
  const std::vector<double> triangles = numbers_of(json, "triangles");
  EXPECT_GE(triangles[1] - triangles[0], 20'000.0);
  const std::vector<double> samples = numbers_of(json, "samples");
  EXPECT_GT(samples[1], samples[0]);
  for (const double mib : numbers_of(json, "sample_mib")) EXPECT_GT(mib, 0.0);
  EXPECT_EQ(numbers_of(json, "ratio").size(), 1U);
  EXPECT_EQ(numbers_of(json, "frame_ms_median").size(), 2U);
}

TEST(CliBench, ClutterIsMeasuredBesideEvenMaterials) {
  const TemporaryFolder folder;
  const ProcessResult run = run_emit(
      {"bench", "clutter", "--scenario", "box", "--pairs", "15", "--set", "thermal.tolerance_k=50",
       "--set", "thermal.steps=3", "--set", "thermal.history_start_s=-600", "--set",
       "sensor.width_px=64", "--set", "sensor.height_px=48", "--json", folder.file("c.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string json = read_text(folder.file("c.json"));
  EXPECT_EQ(json_value(json, "suite"), "\"clutter\"");
  EXPECT_EQ(numbers_of(json, "ratio").size(), 3U);
  for (const double ms : numbers_of(json, "frame_ms_median")) EXPECT_GT(ms, 0.0);
}

TEST(CliBench, GasIsMeasuredBesideTheSceneWithoutIt) {
  const TemporaryFolder folder;
  // Gas leaves the surfaces as they are, so that one warm-up serves all of the scenes.
  const ProcessResult run =
      run_emit({"bench", "gas", "--pairs", "15", "--set", "thermal.tolerance_k=50", "--set",
                "thermal.steps=3", "--set", "thermal.history_start_s=-600", "--set",
                "thermal.state_file=" + folder.file("surface.state"), "--set", "sensor.width_px=24",
                "--set", "sensor.height_px=18", "--json", folder.file("g.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string json = read_text(folder.file("g.json"));
  EXPECT_EQ(json_value(json, "suite"), "\"gas\"");
  EXPECT_EQ(numbers_of(json, "puffs"), (std::vector<double>{0, 20, 4, 144, 12, 180}));
  EXPECT_EQ(numbers_of(json, "ratio").size(), 6U);
  for (const double ms : numbers_of(json, "frame_ms_median")) EXPECT_GT(ms, 0.0);
}

TEST(CliBench, UncertaintyMovesEveryInputBothWays) {
  const TemporaryFolder folder;
  const ProcessResult run =
      run_emit({"bench", "uncertainty", "box", "--set", "thermal.tolerance_k=20", "--set",
                "thermal.steps=6", "--set", "sensor.width_px=24", "--set", "sensor.height_px=18",
                "--json", folder.file("u.json"), "--plot", folder.file("u.svg")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string json = read_text(folder.file("u.json"));
  EXPECT_EQ(json_value(json, "suite"), "\"uncertainty\"");
  const std::vector<double> all_k = numbers_of(json, "all_inputs_rms_k");
  ASSERT_FALSE(all_k.empty());
  for (const double k : all_k) {
    EXPECT_GT(k, 1.0);
    EXPECT_LT(k, 20.0);
  }
  // Nearly every one of the twelve inputs moves the mean, and its ends move it opposite ways.
  const std::vector<double> low_k = numbers_of(json, "delta_low_k");
  const std::vector<double> high_k = numbers_of(json, "delta_high_k");
  ASSERT_EQ(low_k.size(), all_k.size());
  ASSERT_EQ(high_k.size(), all_k.size());
  std::size_t opposite = 0;
  for (std::size_t i = 0; i < low_k.size(); ++i) opposite += low_k[i] * high_k[i] < 0.0 ? 1U : 0U;
  EXPECT_GE(12 * opposite, 9 * all_k.size()) << json;
  EXPECT_NE(read_text(folder.file("u.svg")).find("film of the air"), std::string::npos);
}

TEST(CliBench, LossyStreamsSayWhatCameAndNothingOfItIsWrong) {
  const TemporaryFolder folder;
  const ProcessResult run =
      run_emit({"bench", "stream", "--loss", "0.01", "--frames", "300", "--width", "256",
                "--height", "128", "--fec", "24+4", "--json", folder.file("s.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err << run.out;
  const std::string json = read_text(folder.file("s.json"));
  for (const char* transport : {"udp", "udp-fec", "udp-resend"}) {
    EXPECT_NE(json.find("\"transport\": \"" + std::string(transport) + "\""), std::string::npos)
        << transport;
  }
  const std::vector<double> whole = numbers_of(json, "whole_frac");
  ASSERT_EQ(whole.size(), 3U);
  EXPECT_LT(whole[0], 0.8);
  EXPECT_GT(whole[1], 0.97);
  EXPECT_GT(whole[2], 0.99);
  const std::vector<double> repaired = numbers_of(json, "repaired");
  ASSERT_EQ(repaired.size(), 3U);
  EXPECT_EQ(repaired[0], 0.0);
  EXPECT_GT(repaired[2], 0.0);
  EXPECT_GT(numbers_of(json, "resent")[1], 0.0);
  EXPECT_GT(numbers_of(json, "partial").front(), 60.0);
  EXPECT_EQ(numbers_of(json, "unflagged"), (std::vector<double>{0, 0, 0}));
  EXPECT_EQ(numbers_of(json, "wrong_px"), (std::vector<double>{0, 0, 0}));
  EXPECT_EQ(json_value(json, "fec"), "\"off\"");
  EXPECT_NE(json.find("\"fec\": \"24+4\""), std::string::npos);
  EXPECT_EQ(run_emit({"bench", "stream", "--loss", "0.01", "--fec", "24+40"}).exit_code, 2);
}

TEST(CliBench, StreamMeasuresEveryTransportBesideBareSockets) {
  const TemporaryFolder folder;
  const ProcessResult run =
      run_emit({"bench", "stream", "--frames", "40", "--rate", "50", "--width", "64", "--height",
                "48", "--repeats", "1", "--json", folder.file("s.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err << run.out;
  const std::string json = read_text(folder.file("s.json"));
  EXPECT_EQ(json_value(json, "suite"), "\"stream\"");
  EXPECT_GT(json_value(json, "yardstick_congestion_control").size(), 2U);
  for (const char* transport :
       {"tcp", "udp", "shm", "tls", "mixed", "bare-tcp-paced", "bare-tcp", "bare-tcp-crc",
        "bare-udp", "zeromq", "zeromq-crc", "iperf3", "iceoryx", "iceoryx-crc"}) {
    EXPECT_NE(json.find("\"transport\": \"" + std::string(transport) + "\""), std::string::npos)
        << transport;
  }
  // There are five contenders at a fixed rate, then each alone. A contender that is not installed
  // has null and a reason.
  EXPECT_EQ(numbers_of(json, "clients"),
            (std::vector<double>{4, 4, 4, 4, 4, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1}));
  EXPECT_EQ(numbers_of(json, "rate_hz"), std::vector<double>(5, 50));
  EXPECT_EQ(numbers_of(json, "lost"), std::vector<double>(17, 0));
  EXPECT_EQ(numbers_of(json, "unflagged_gaps"), std::vector<double>(4, 0));
  EXPECT_EQ(numbers_of(json, "crc_errors"), std::vector<double>(4, 0));
  EXPECT_EQ(numbers_of(json, "p999_us").size(), 5U);
  EXPECT_EQ(numbers_of(json, "own_p999_us").size(), 5U) << "the bare loop's beside the daemon's";
  EXPECT_EQ(numbers_of(json, "ratio").size(), 4U);
  EXPECT_EQ(numbers_of(json, "bare-tcp-crc").size(), 1U) << "TCP beside a loop that sums too";
  EXPECT_NE(run.out.find(" of bare-tcp-crc"), std::string::npos);
  EXPECT_GE(numbers_of(json, "gbit_s").size(), 11U);
  // The suite measures iceoryx when it is installed.
  EXPECT_EQ(json.find("iox-roudi does not start"), std::string::npos);
  EXPECT_EQ(json.find("iox-roudi has no chunks"), std::string::npos);
}

TEST(CliBench, StreamMeasuresOnlyWhatIsNamed) {
  const TemporaryFolder folder;
  const ProcessResult run =
      run_emit({"bench", "stream", "--only", "tcp", "--only", "bare-tcp", "--width", "64",
                "--height", "48", "--repeats", "2", "--json", folder.file("s.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err << run.out;
  const std::string json = read_text(folder.file("s.json"));
  EXPECT_EQ(json_value(json, "device"), "\"canned: test pattern\"");
  EXPECT_EQ(numbers_of(json, "clients"), (std::vector<double>{1, 1}));
  EXPECT_NE(json.find("\"transport\": \"tcp\""), std::string::npos);
  EXPECT_NE(json.find("\"transport\": \"bare-tcp\""), std::string::npos);
  EXPECT_EQ(numbers_of(json, "ratio").size(), 1U);
  EXPECT_EQ(json.find("zeromq"), std::string::npos) << "not even as something to compare with";
  EXPECT_EQ(run_emit({"bench", "stream", "--only", "pigeon"}).exit_code, 2);
  EXPECT_EQ(run_emit({"bench", "stream", "--only", "tcp", "--repeats", "0"}).exit_code, 2);
  EXPECT_EQ(run_emit({"bench", "stream", "--only", "tcp", "--loss", "0.01"}).exit_code, 2);
  EXPECT_EQ(run_emit({"bench", "stream", "--only", "tcp", "--transport", "udp"}).exit_code, 2);
}

TEST(CliBench, OutputMeasuresEveryStepBesideACopy) {
  const TemporaryFolder folder;
  const ProcessResult run = run_emit({"bench", "output", "--rounds", "3", "--width", "64",
                                      "--height", "48", "--json", folder.file("o.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err << run.out;
  const std::string json = read_text(folder.file("o.json"));
  EXPECT_EQ(json_value(json, "suite"), "\"output\"");
  const auto ratios = numbers_of(json, "ratio_to_copy");
  ASSERT_EQ(ratios.size(), 15U);
  EXPECT_EQ(ratios[0], 1.0) << "the copy";
  for (const double ratio : ratios) EXPECT_GT(ratio, 0.0);
  EXPECT_EQ(numbers_of(json, "median_ms").size(), 15U);
}

TEST(CliBench, IsolationComparesPairsOfRunsBesideARunAgainstItself) {
  const TemporaryFolder folder;
  const ProcessResult run = run_emit({"bench", "isolation", "--frames", "20", "--rate", "100",
                                      "--width", "64", "--height", "48", "--clients", "3",
                                      "--pairs", "2", "--json", folder.file("i.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err << run.out;
  const std::string json = read_text(folder.file("i.json"));
  EXPECT_EQ(json_value(json, "suite"), "\"isolation\"");
  EXPECT_EQ(json_value(json, "test"), "\"stopped-and-flooding\"");
  EXPECT_EQ(json_value(json, "clients"), "3");
  EXPECT_EQ(json_value(json, "pairs"), "2");
  EXPECT_EQ(json_value(json, "lost"), "0");
  EXPECT_EQ(json_value(json, "unflagged_gaps"), "0");
  EXPECT_GE(numbers_of(json, "frames").at(0), 3.0 * 20 * 2 * 3);
  EXPECT_GT(numbers_of(json, "ratio").at(0), 0.0);
  EXPECT_GT(numbers_of(json, "self_ratio").at(0), 0.0);
  EXPECT_GT(numbers_of(json, "flood_records").at(0), 0.0);
  EXPECT_EQ(json_value(json, "met"), "null") << "two pairs judge nothing";
  EXPECT_NE(run.out.find("not judged with fewer than 15 pairs"), std::string::npos);
}

TEST(CliBench, TurnFlagsJumpsToPlacesNobodyAnnounced) {
  const TemporaryFolder folder;
  const ProcessResult run =
      run_emit({"bench", "turn", "--scene", "box", "--set", "thermal.tolerance_k=2", "--runs", "2",
                "--frames", "8", "--width", "64", "--height", "48", "--budget", "0.01", "--json",
                folder.file("t.json")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string json = read_text(folder.file("t.json"));
  EXPECT_EQ(json_value(json, "suite"), "\"turn\"");
  EXPECT_EQ(numbers_of(json, "frames"), (std::vector<double>{16, 16, 16, 16}));
  EXPECT_EQ(numbers_of(json, "coarse_frames"), (std::vector<double>{0, 16, 0, 16}));
  // No quality is shed without a deadline. A deadline that no frame meets is missed every time.
  const std::vector<double> shed = numbers_of(json, "shed_frames");
  ASSERT_EQ(shed.size(), 4U);
  EXPECT_EQ(shed[0] + shed[1], 0.0);
  EXPECT_EQ(numbers_of(json, "late_frames"), (std::vector<double>{0, 0, 16, 16}));
  for (const double ratio : numbers_of(json, "ratio")) EXPECT_GE(ratio, 1.0);
}

TEST(CliBench, LiveNeedsAnEntityThatMoves) {
  const ProcessResult run = run_emit(
      {"bench", "live", "--scene", "box", "--seconds", "1", "--width", "64", "--height", "48"});
  EXPECT_EQ(run.exit_code, 78) << run.err;
  EXPECT_NE(run.err.find("box: no entity moves"), std::string::npos) << run.err;
}

/// bench.sh in a tree of its own, where `emit bench SUITE` is a line of shell.
class BenchScript {
 public:
  explicit BenchScript(const std::string& emit) {
    namespace fs = std::filesystem;
    for (const char* sub : {"deploy/scripts", "build/release/bin", "path"}) {
      fs::create_directories(folder_.path() / sub);
    }
    fs::copy(EMIT_TEST_SOURCE_DIR "/../deploy/scripts/bench.sh",
             folder_.path() / "deploy/scripts/bench.sh");
    add_program("path/cmake", "exit 0");
    add_program("build/release/bin/emit", emit);
  }
  [[nodiscard]] ProcessResult run(const std::vector<std::string>& arguments) const {
    std::vector<std::string> command{"env", "PATH=" + folder_.file("path") + ":" + getenv("PATH"),
                                     folder_.file("deploy/scripts/bench.sh"), "--no-install"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return run_process(command);
  }
  [[nodiscard]] std::string result(const std::string& name) const {
    return read_text(folder_.file("out/bench/" + name));
  }

 private:
  void add_program(const std::string& name, const std::string& text) const {
    write_text(folder_.file(name), "#!/bin/sh\n" + text + "\n");
    std::filesystem::permissions(folder_.file(name), std::filesystem::perms::owner_all);
  }
  TemporaryFolder folder_;
};

TEST(BenchScript, SaysWhichSuitesFailedWithOrWithoutAResult) {
  const BenchScript script(R"(suite=$2
[ "$suite" = turn ] && echo 'turn: killed' >&2 && exit 75
[ "$suite" = error-vs-time ] && [ "$5" = --plot ] && echo '<svg/>' > "$6"
echo "table of $suite"
echo "{\"suite\": \"$suite\"}" > "$4"
[ "$suite" != budget ])");
  const ProcessResult run = script.run({"turn", "error-vs-time", "budget"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_NE(run.err.find("turn: killed"), std::string::npos);
  const std::string json = script.result("bench.json");
  EXPECT_NE(json.find(R"("failed": [{"suite": "turn", "exit_code": 75}, )"
                      R"({"suite": "budget", "exit_code": 1}],)"),
            std::string::npos)
      << json;
  EXPECT_NE(json.find(R"({"suite": "error-vs-time"})"), std::string::npos);
  EXPECT_NE(json.find(R"({"suite": "budget"})"), std::string::npos);
  const std::string table = script.result("bench.md");
  EXPECT_NE(table.find("## emit bench turn (failed: exit 75)\nno result\n"), std::string::npos);
  EXPECT_NE(table.find("## emit bench budget (failed: exit 1)\n```\ntable of budget\n"),
            std::string::npos);
  EXPECT_NE(table.find("## emit bench error-vs-time\n"), std::string::npos);
  EXPECT_NE(table.find("![error-vs-time](error-vs-time.svg)"), std::string::npos);
  EXPECT_EQ(script.result("error-vs-time.svg"), "<svg/>\n");

  const ProcessResult whole = script.run({"stream"});
  EXPECT_EQ(whole.exit_code, 0) << whole.err;
  EXPECT_NE(script.result("bench.json").find("\"failed\": [],"), std::string::npos);
}

TEST(BenchScript, EndsAsAWholeWhenItIsInterrupted) {
  // The suite itself ends in good order.
  const BenchScript script("echo \"$2\" >> \"$(dirname \"$4\")/began\"; kill -TERM $PPID");
  EXPECT_EQ(script.run({"turn", "budget"}).exit_code, 130);
  EXPECT_EQ(script.result("began"), "turn\n");
}

}  // namespace
}  // namespace emit::test
