// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using Arguments = std::vector<std::string>;

/// A command line that would work but for its output OUT, and the option that names it.
struct OutputCase {
  std::string option;
  Arguments arguments;
  bool folder = false;
};

/// Every output of every command. Nothing listens on the addresses, so that a command that went on
/// would complain of something else.
const std::vector<OutputCase>& output_cases() {
  static const std::vector<OutputCase> cases = [] {
    std::vector<OutputCase> out;
    const auto add = [&out](const Arguments& command, const Arguments& files,
                            const Arguments& folders = {}) {
      for (const bool folder : {false, true}) {
        for (const std::string& option : folder ? folders : files) {
          Arguments arguments;
          bool given = false;
          for (const std::string& word : command) {
            const bool own = word == option;
            arguments.push_back(word);
            given = given || own;
          }
          if (given) {
            const auto at = std::find(arguments.begin(), arguments.end(), option);
            *(at + 1) = "OUT";
          } else {
            arguments.push_back(option);
            arguments.emplace_back("OUT");
          }
          out.push_back({option, arguments, folder});
        }
      }
    };
    add({"render", "box", "--time-s", "12600", "--out", "GOOD"}, {"--out", "--png", "--json"});
    add({"solve", "box", "--time-s", "3600", "--out", "GOOD"}, {"--out", "--png", "--json"},
        {"--checkpoint"});
    add({"solve", "box", "--time-s", "3600", "--at", "no.csv"}, {"--at-out"});
    add({"demo", "--out", "GOOD"}, {"--json"}, {"--out"});
    add({"engage", "--out", "GOOD"}, {"--json"}, {"--out"});
    add({"receive", "tcp://127.0.0.1:1"}, {"--json"}, {"--out"});
    add({"record", "--from", "tcp://127.0.0.1:1", "--out", "GOOD"}, {"--out", "--json"});
    add({"replay", "no.mcap", "--scenario", "box"}, {"--json"}, {"--out"});
    add({"log", "info", "no.mcap"}, {"--json"});
    add({"log", "cut", "no.mcap", "--out", "GOOD"}, {"--out", "--json"});
    add({"log", "merge", "a.mcap", "b.mcap", "--out", "GOOD"}, {"--out", "--json"});
    add({"log", "export", "csv", "no.mcap", "--table", "frames", "--out", "GOOD"},
        {"--out", "--json"});
    add({"log", "export", "csv", "no.mcap"}, {}, {"--out"});
    add({"log", "export", "exr", "no.mcap", "--out", "GOOD"}, {"--json"}, {"--out"});
    add({"log", "export", "foxglove", "no.mcap", "--out", "GOOD"}, {"--json", "--out"});
    add({"fit", "block-on-road"}, {"--out", "--toml", "--json"});
    add({"fit", "--measured", "no.csv"}, {"--plot", "--history"});
    add({"generate", "box", "--out", "GOOD"}, {}, {"--out"});
    add({"make-log", "airfield", "--out", "GOOD"}, {"--out"});
    add({"export", "gnss", "no.mcap", "--scenario", "box", "--format", "nmea", "--out", "GOOD"},
        {"--out", "--json"});
    add({"send", "no.mcap", "--to", "udp://127.0.0.1:9"}, {"--json"});
    add({"latency", "tcp://127.0.0.1:1"}, {"--json"});
    add({"fms-sim", "--seconds", "0.1"}, {"--json"});
    add({"stat", "http://127.0.0.1:1"}, {"--json"});
    add({"trace", "http://127.0.0.1:1", "--out", "GOOD"}, {"--out"});
    add({"compare", "a.exr", "b.exr"}, {"--json"});
    add({"inspect", "no.glb"}, {"--json"});
    add({"weather", "no.csv"}, {"--json", "--plot"});
    add({"materials"}, {"--json", "--plot"});
    add({"probe", "box", "--at", "0,0,0", "--time-s", "0"}, {"--out", "--plot"});
    add({"explain", "box", "--time-s", "0", "--px", "0,0"}, {"--json", "--html"});
    add({"campaign", "no.toml", "--out", "GOOD"}, {"--json"}, {"--out"});
    add({"scene", "check", "box"}, {"--json"});
    add({"scene", "preview", "box", "--out", "GOOD"}, {"--out"});
    add({"scene", "terrain", "no.tif"}, {}, {"--out"});
    add({"doctor"}, {"--json"});
    add({"man"}, {}, {"--out"});
    add({"completion", "bash"}, {"--out"});
    add({"bench", "paper"}, {"--json"});
    add({"bench", "error-vs-time"}, {"--json", "--csv", "--plot"}, {"--figures"});
    add({"bench", "stream"}, {"--json"});
    add({"bench", "isolation"}, {"--json"});
    add({"bench", "output"}, {"--json"});
    add({"bench", "stability"}, {"--json"}, {"--pictures"});
    add({"bench", "convergence"}, {"--json", "--plot"});
    add({"bench", "thermal-truth"}, {"--json"}, {"--pictures"});
    add({"bench", "scaling"}, {"--json"});
    add({"bench", "crowd"}, {"--json"});
    add({"bench", "clutter"}, {"--json"});
    add({"bench", "gas"}, {"--json"});
    add({"bench", "uncertainty"}, {"--json", "--plot"});
    add({"bench", "turn"}, {"--json"});
    add({"bench", "live"}, {"--json"});
    add({"bench", "budget"}, {"--json"});
    add({"bench", "subpixel"}, {"--json"});
    add({"bench", "nature", "no.csv"}, {"--json", "--plot"});
    return out;
  }();
  return cases;
}

ProcessResult run_with(const OutputCase& tried, const std::string& out,
                       const TemporaryFolder& folder) {
  Arguments arguments = tried.arguments;
  for (std::string& word : arguments) {
    if (word == "OUT") word = out;
    if (word == "GOOD") word = folder.file("good");
  }
  return run_emit(arguments, std::chrono::seconds(20));
}

class CliOutput : public testing::TestWithParam<OutputCase> {};

TEST_P(CliOutput, that_cannot_be_written_ends_the_command_at_once) {
  const TemporaryFolder folder;
  write_text(folder.file("file"), "kept");
  const std::string out = folder.file(GetParam().folder ? "file/below" : "none/x");
  const ProcessResult result = run_with(GetParam(), out, folder);
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_NE(result.err.find(GetParam().option + ": "), std::string::npos) << result.err;
  EXPECT_NE(result.err.find(out), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("cannot write: "), std::string::npos) << result.err;
  EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
  EXPECT_FALSE(std::filesystem::exists(folder.file("good")));
  EXPECT_EQ(read_text(folder.file("file")), "kept");
}
INSTANTIATE_TEST_SUITE_P(Options, CliOutput, testing::ValuesIn(output_cases()));

/// The help of every command names its outputs; each of them is in the table above.
TEST(CliOutputs, none_is_left_out_of_the_test) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_emit({"man", "--out", folder.path().string()}).exit_code, 0);
  std::size_t json_options = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    const std::string page = read_text(entry.path().string());
    if (page.find("\n\\fB\\-\\-json\\fR \\fIFILE\\fR\n") != std::string::npos) ++json_options;
  }
  const auto tested = std::ranges::count_if(
      output_cases(), [](const OutputCase& tried) { return tried.option == "--json"; });
  // The trigger command opens a device of its own and is run by other tests.
  EXPECT_EQ(json_options, static_cast<std::size_t>(tested) + 1);
}

TEST(CliOutputs, an_existing_file_survives_a_run_that_fails_later) {
  const TemporaryFolder folder;
  const std::string kept = folder.file("kept");
  for (const Arguments& arguments :
       {Arguments{"render", "no-such-scenario", "--time-s", "0", "--out", kept, "--json", kept},
        Arguments{"solve", "no-such-scenario", "--time-s", "0", "--out", kept},
        Arguments{"record", "--from", "tcp://127.0.0.1:1", "--out", kept},
        Arguments{"make-log", "no-such-scenario", "--out", kept},
        Arguments{"log", "cut", "no.mcap", "--out", kept},
        Arguments{"receive", "tcp://127.0.0.1:1", "--frames", "1", "--json", kept},
        Arguments{"bench", "budget", "--scene", "no-such-scenario", "--json", kept}}) {
    write_text(kept, "kept");
    EXPECT_NE(run_emit(arguments).exit_code, 0) << arguments.front();
    EXPECT_EQ(read_text(kept), "kept") << arguments.front();
  }
}

TEST(CliOutputs, every_file_of_several_frames_is_checked) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.file("1"));
  const ProcessResult result = run_emit(
      {"render", "box", "--time-s", "1", "--time-s", "2", "--out", folder.file("{time}/x.exr")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find(folder.file("2/x.exr")), std::string::npos) << result.err;
}

}  // namespace
}  // namespace emit::test
