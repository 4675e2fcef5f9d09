// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

class CliHelp : public testing::TestWithParam<const char*> {};

TEST_P(CliHelp, every_command_explains_itself_with_an_example) {
  const ProcessResult result = run_emit({GetParam(), "--help"});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("--help"), std::string::npos);
  EXPECT_NE(result.out.find("Example: emit "), std::string::npos) << result.out;
}
INSTANTIATE_TEST_SUITE_P(Commands, CliHelp,
                         testing::Values("render", "receive", "send", "stat", "record", "replay",
                                         "demo", "engage", "view", "compare", "inspect", "evaluate",
                                         "generate", "log", "make-log", "bench", "latency",
                                         "trigger", "trace", "solve", "fit", "fms-sim", "man",
                                         "export", "weather", "materials", "probe", "explain",
                                         "campaign", "scene", "doctor"));

TEST(CliUsage, commands_of_emit_lab_are_those_of_emit) {
  const std::string folder = EMIT_TEST_BIN_DIR;
  const std::string help = run_emit({"--help"}).out;
  EXPECT_EQ(run_process({folder + "/emit-lab", "--help"}).out, help);
  for (const char* command : {"bench", "evaluate", "fit", "materials", "man", "completion"}) {
    EXPECT_NE(help.find(std::string("\n  ") + command + " "), std::string::npos) << command;
    EXPECT_EQ(run_emit({command, "--help"}).out,
              run_process({folder + "/emit-lab", command, "--help"}).out);
  }
}

TEST(CliUsage, without_emit_lab_its_commands_say_what_to_build) {
  const TemporaryFolder folder;
  std::filesystem::copy_file(std::string(EMIT_TEST_BIN_DIR) + "/emit", folder.file("emit"));
  const ProcessResult result = run_process({folder.file("emit"), "bench", "paper"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(
      result.err.find("emit-lab: No such file or directory; `emit bench` is a command of that "
                      "program, which is built by"),
      std::string::npos)
      << result.err;
}

TEST(CliUsage, version_names_tool_and_number) {
  const ProcessResult result = run_emit({"--version"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_EQ(result.out.rfind("emit ", 0), 0U) << result.out;
}

TEST(CliUsage, folders_are_shown_as_folders) {
  for (const auto& [command, option] :
       {std::pair{"demo", "--out DIR=emit-demo "}, std::pair{"receive", "--out DIR "},
        std::pair{"replay", "--out DIR "}, std::pair{"generate", "--out DIR REQUIRED"},
        std::pair{"solve", "--checkpoint DIR "}}) {
    EXPECT_NE(run_emit({command, "--help"}).out.find(option), std::string::npos) << command;
  }
}

TEST(CliUsage, evaluate_says_which_models_are_double_on_the_cpu_only) {
  const std::string help = run_emit({"evaluate", "--help"}).out;
  const auto is_marked = [&](const std::string& model) {
    const std::size_t at = help.find("\n  " + model + ": ");
    return help.substr(at + 1, help.find('\n', at + 1) - at).find("on the cpu in float64 only") !=
           std::string::npos;
  };
  EXPECT_TRUE(is_marked("conduction-slab"));
  EXPECT_TRUE(is_marked("sun-position"));
  EXPECT_FALSE(is_marked("equilibrium"));
  EXPECT_FALSE(is_marked("sky-view"));
}

TEST(CliUsage, help_lists_the_exit_codes) {
  const ProcessResult result = run_emit({"--help"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_NE(result.out.find("78 bad configuration"), std::string::npos);
  EXPECT_NE(result.out.find("75 the device was lost"), std::string::npos);
  EXPECT_NE(result.out.find("serve"), std::string::npos);
}

TEST(CliUsage, serve_help_is_the_daemons_own) {
  const ProcessResult result = run_emit({"serve", "--help"});
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_NE(result.out.find("--config"), std::string::npos) << result.out;
}

TEST(CliUsage, thermal_truth_judges_the_method_that_scenarios_use) {
  const ProcessResult result = run_emit({"bench", "thermal-truth", "--help"});
  EXPECT_NE(result.out.find("{per-frame,cached}=cached"), std::string::npos) << result.out;
}

class CliBadUsage : public testing::TestWithParam<std::vector<std::string>> {};

TEST_P(CliBadUsage, exits_with_2) {
  const ProcessResult result = run_emit(GetParam());
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_FALSE(result.err.empty());
  EXPECT_TRUE(result.out.empty()) << result.out;
}
INSTANTIATE_TEST_SUITE_P(
    Cases, CliBadUsage,
    testing::Values(
        std::vector<std::string>{}, std::vector<std::string>{"no-such-command"},
        std::vector<std::string>{"render", "box"},
        std::vector<std::string>{"render", "box", "--time-s", "noon", "--out", "x.exr"},
        std::vector<std::string>{"render", "box", "--time-s", "1", "--out", "x.exr", "--channel",
                                 "colour"},
        std::vector<std::string>{"compare", "a.exr"},
        std::vector<std::string>{"receive", "http://localhost:1"},
        std::vector<std::string>{"receive", "tcp://localhost"},
        std::vector<std::string>{"receive", "tcp://localhost:1", "--every", "0"},
        std::vector<std::string>{"receive", "tcp://localhost:1", "--every", "1001"},
        std::vector<std::string>{"receive", "udp://localhost:1", "--multicast", "8.8.8.8"},
        std::vector<std::string>{"record", "--from", "udp://localhost:1", "--out", "x.mcap"},
        std::vector<std::string>{"stat", "tcp://localhost:7002"},
        std::vector<std::string>{"stat", "http://localhost"},
        std::vector<std::string>{"send", "x.mcap", "--to", "nowhere"},
        std::vector<std::string>{"send", "x.mcap", "--to", "udp://127.0.0.1:1", "--step"},
        std::vector<std::string>{"replay", "x.mcap", "--scenario", "box", "--speed", "0"},
        std::vector<std::string>{"evaluate", "equilibrium"},
        std::vector<std::string>{"evaluate", "equilibrium", "x.csv", "--precision", "half"},
        std::vector<std::string>{"generate", "castle", "--out", "."},
        std::vector<std::string>{"bench"}, std::vector<std::string>{"bench", "speed"},
        std::vector<std::string>{"bench", "paper", "--frames", "1"}));

TEST(CliUsage, what_is_wrong_is_named) {
  EXPECT_NE(run_emit({"recieve", "tcp://localhost:1"}).err.find("no command 'recieve'"),
            std::string::npos);
  EXPECT_NE(run_emit({"bench", "speed", "--quick"}).err.find("no command 'bench speed'"),
            std::string::npos);
  for (const char* rate : {"0", "-1", "nan", "inf", "fast"}) {
    const ProcessResult result =
        run_emit({"send", "x.mcap", "--to", "udp://localhost:1", "--rate", rate});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_NE(result.err.find(std::string(rate) + " is not a number above 0"), std::string::npos)
        << result.err;
  }
}

/// A mistyped word and what the tool takes it for.
struct Mistake {
  std::vector<std::string> arguments;
  std::string suggestion;
};

class CliMistyped : public testing::TestWithParam<Mistake> {};

TEST_P(CliMistyped, gets_a_suggestion_in_one_line) {
  const ProcessResult result = run_emit(GetParam().arguments);
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("did you mean '" + GetParam().suggestion + "'?"), std::string::npos)
      << result.err;
  EXPECT_EQ(result.err.find('\n'), result.err.size() - 1) << result.err;
}
INSTANTIATE_TEST_SUITE_P(
    Words, CliMistyped,
    testing::Values(Mistake{{"rendr"}, "render"},
                    Mistake{{"recieve", "tcp://localhost:1"}, "receive"},
                    Mistake{{"bench", "papre", "--json", "x"}, "bench paper"},
                    Mistake{{"bench", "thermal-trut"}, "bench thermal-truth"},
                    Mistake{{"render", "box", "--tim-s", "1", "--out", "x"}, "--time-s"},
                    Mistake{{"render", "box", "--time-s", "1", "--uot=x"}, "--out"},
                    Mistake{{"bench", "paper", "--sceen", "box"}, "--scene"},
                    Mistake{{"man", "bnech"}, "emit-bench"}, Mistake{{"--vesion"}, "--version"},
                    Mistake{{"serve", "--confg", "x.toml"}, "--config"},
                    Mistake{{"serve", "--st=pacing.rate_hz=3"}, "--set"},
                    Mistake{{"serve", "--chekc"}, "--check"},
                    Mistake{{"evaluate", "equilibrium", "x.csv", "--device", "gup"}, "gpu"},
                    Mistake{{"generate", "statu", "--out", "."}, "statue"},
                    Mistake{{"generate", "box", "--out", ".", "--set", "size=1"}, "size_m"}));

/// A mistyped name in a scenario's place or in its keys, which is bad configuration.
class CliMistypedName : public testing::TestWithParam<Mistake> {};

TEST_P(CliMistypedName, gets_a_suggestion) {
  const ProcessResult result = run_emit(GetParam().arguments);
  EXPECT_NE(result.exit_code, 0);
  EXPECT_NE(result.err.find("did you mean '" + GetParam().suggestion + "'?"), std::string::npos)
      << result.err;
}
INSTANTIATE_TEST_SUITE_P(
    Names, CliMistypedName,
    testing::Values(Mistake{{"render", "airfeild", "--time-s", "0", "--out", "x.exr"}, "airfield"},
                    Mistake{{"render", "box", "--time-s", "0", "--out", "x.exr", "--set",
                             "default_material=asphlt"},
                            "asphalt"},
                    Mistake{{"render", "box", "--time-s", "0", "--out", "x.exr", "--set",
                             "thermal.surroundings_material=gras"},
                            "grass"},
                    Mistake{{"render", "box", "--time-s", "0", "--out", "x.exr", "--set",
                             "object[bxo].scale=2"},
                            "box"},
                    Mistake{{"render", "box", "--time-s", "0", "--out", "x.exr", "--band", "8-21"},
                            "8-12"},
                    Mistake{{"fit", "box", "--material", "asphlt"}, "asphalt"}));

class CliBadArgument
    : public testing::TestWithParam<std::pair<std::vector<std::string>, std::string>> {};

TEST_P(CliBadArgument, is_one_line_of_the_common_form_that_names_the_help) {
  const auto& [arguments, help] = GetParam();
  const ProcessResult result = run_emit(arguments);
  EXPECT_EQ(result.exit_code, 2) << result.err;
  const std::string prefix = help == "emit serve" ? "emit serve: error: " : "emit: error: ";
  EXPECT_EQ(result.err.rfind(prefix, 0), 0U) << result.err;
  EXPECT_NE(result.err.find("`" + help + " --help`"), std::string::npos) << result.err;
  EXPECT_EQ(result.err.find('\n'), result.err.size() - 1) << result.err;
}
using Arguments = std::vector<std::string>;
INSTANTIATE_TEST_SUITE_P(
    Cases, CliBadArgument,
    testing::Values(
        std::pair{Arguments{}, "emit"}, std::pair{Arguments{"bench"}, "emit bench"},
        std::pair{Arguments{"render"}, "emit render"},
        std::pair{Arguments{"render", "box", "--out", "x.exr"}, "emit render"},
        std::pair{Arguments{"render", "box", "--time-s", "noon", "--out", "x.exr"}, "emit render"},
        std::pair{Arguments{"render", "box", "--out"}, "emit render"},
        std::pair{Arguments{"render", "box", "more", "--time-s", "1", "--out", "x.exr"},
                  "emit render"},
        std::pair{Arguments{"render", "box", "-x"}, "emit render"},
        std::pair{Arguments{"receive", "tcp://localhost:1", "--every", "0"}, "emit receive"},
        std::pair{Arguments{"bench", "paper", "--frames", "1"}, "emit bench paper"},
        std::pair{Arguments{"serve"}, "emit serve"},
        std::pair{Arguments{"serve", "emitd.toml"}, "emit serve"},
        std::pair{Arguments{"serve", "--config"}, "emit serve"},
        std::pair{Arguments{"serve", "--config", "x.toml", "--set"}, "emit serve"},
        std::pair{Arguments{"serve", "--check=1"}, "emit serve"}));

TEST(CliUsage, generate_lists_the_scenes_that_it_knows) {
  const std::string help = run_emit({"generate", "--help"}).out;
  for (const char* scene : {"box", "statue", "block-on-road", "ribbed", "airfield", "sea", "all"}) {
    EXPECT_NE(help.find(scene), std::string::npos) << help;
  }
}

TEST(CliUsage, the_daemons_help_has_an_example_and_names_the_profiles) {
  const std::string help = run_emit({"serve", "--help"}).out;
  EXPECT_NE(help.find("Example: emit serve --config "), std::string::npos) << help;
  EXPECT_NE(help.find("share/emit/profiles"), std::string::npos) << help;
}

/// Files of one format under a name that promises another.
class CliWrongExtension : public testing::TestWithParam<std::vector<std::string>> {};

TEST_P(CliWrongExtension, is_refused_before_any_work) {
  const ProcessResult result = run_emit(GetParam());
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_NE(result.err.find("the name ends with '"), std::string::npos) << result.err;
}
INSTANTIATE_TEST_SUITE_P(
    Commands, CliWrongExtension,
    testing::Values(std::vector<std::string>{"render", "box", "--time-s", "1", "--out", "x.png"},
                    std::vector<std::string>{"render", "box", "--time-s", "1", "--out",
                                             "{time}.tif"},
                    std::vector<std::string>{"render", "box", "--time-s", "1", "--out", "x.exr",
                                             "--png", "x.jpg"},
                    std::vector<std::string>{"solve", "box", "--time-s", "1", "--out", "x.png"},
                    std::vector<std::string>{"solve", "box", "--time-s", "1", "--out", "x.exr",
                                             "--png", "x.exr"},
                    std::vector<std::string>{"view", "box", "--screenshot", "x.exr"}));

/// A file of another kind than the command reads.
class CliWrongKind : public testing::Test {
 protected:
  CliWrongKind() {
    write_text(folder_.file("scene.toml"),
               "epoch_utc = 2014-06-21T06:00:00Z\n[[object]]\ngltf = \"share:scenes/box.glb\"\n");
    write_text(folder_.file("daemon.toml"),
               "scenario = \"airfield\"\n[pacing]\nmode = \"host-step\"\n");
  }
  void expect(const std::vector<std::string>& arguments, int exit_code,
              const std::vector<std::string>& texts) {
    const ProcessResult result = run_emit(arguments);
    EXPECT_EQ(result.exit_code, exit_code) << result.err;
    for (const std::string& text : texts) {
      EXPECT_NE(result.err.find(text), std::string::npos) << text << "\n" << result.err;
    }
    EXPECT_EQ(result.err.find("json.exception"), std::string::npos) << result.err;
    EXPECT_EQ(result.err.find('\n'), result.err.size() - 1) << result.err;
  }
  const TemporaryFolder folder_;
};

TEST_F(CliWrongKind, a_scenario_as_configuration_is_told_how_it_is_served) {
  const std::string file = folder_.file("scene.toml");
  expect({"serve", "--config", file, "--check"}, 78,
         {"this is a scenario", "--set scenario=" + file, "key 'scenario'"});
}

TEST_F(CliWrongKind, a_configuration_as_scenario_is_told_how_it_is_run) {
  const std::string file = folder_.file("daemon.toml");
  expect({"render", file, "--time-s", "1", "--out", folder_.file("x.exr")}, 78,
         {"configuration of the daemon", "emitd --config " + file, "'airfield'"});
  expect({"serve", "--config", file, "--set", "scenario=" + file, "--check"}, 78,
         {"configuration of the daemon"});
}

TEST_F(CliWrongKind, inspect_says_what_a_file_is_and_which_command_reads_it) {
  expect({"inspect", folder_.file("scene.toml")}, 1, {"it is a scenario", "emit render"});
  expect({"inspect", folder_.file("daemon.toml")}, 1, {"configuration of the daemon", "emitd"});
  write_text(folder_.file("x.exr"), "v/1");
  expect({"inspect", folder_.file("x.exr")}, 1, {"emit compare"});
  write_text(folder_.file("x.mcap"), "MCAP");
  expect({"inspect", folder_.file("x.mcap")}, 1, {"emit send"});
  write_text(folder_.file("x.gltf"), "# a text");
  expect({"inspect", folder_.file("x.gltf")}, 1, {"not a glTF file"});
  write_text(folder_.file("y.gltf"), "{\"asset\": [1,}");
  expect({"inspect", folder_.file("y.gltf")}, 1, {"not valid JSON", "line 1"});
}

TEST(CliUsage, a_word_that_nothing_is_like_gets_no_suggestion) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"xylophone"},
        std::vector<std::string>{"render", "box", "--xylophone"}}) {
    const ProcessResult result = run_emit(arguments);
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_NE(result.err.find("xylophone"), std::string::npos);
    EXPECT_EQ(result.err.find("did you mean"), std::string::npos) << result.err;
  }
}

TEST(CliUsage, the_value_of_an_option_is_no_option) {
  const ProcessResult result =
      run_emit({"render", "box", "--out", "--tim-s", "--time-s", "1", "--bnad", "x"});
  EXPECT_NE(result.err.find("no option '--bnad', did you mean '--band'?"), std::string::npos)
      << result.err;
}

TEST(CliBadConfiguration, an_unknown_scenario_exits_with_78) {
  const ProcessResult result =
      run_emit({"render", "no-such-scenario", "--time-s", "0", "--out", "x.exr"});
  EXPECT_EQ(result.exit_code, 78) << result.err;
  EXPECT_NE(result.err.find("no-such-scenario"), std::string::npos);
}

TEST(CliBadConfiguration, an_unknown_key_exits_with_78_and_says_where) {
  const TemporaryFolder folder;
  write_text(folder.file("bad.toml"), "name = \"bad\"\nnot_a_key = 1\n");
  const ProcessResult result =
      run_emit({"render", folder.file("bad.toml"), "--time-s", "0", "--out", folder.file("x.exr")});
  EXPECT_EQ(result.exit_code, 78) << result.err;
  EXPECT_NE(result.err.find("bad.toml:2:"), std::string::npos) << result.err;
}

TEST(CliBadConfiguration, malformed_toml_exits_with_78) {
  const TemporaryFolder folder;
  write_text(folder.file("bad.toml"), "[place\nlat_deg = 1\n");
  const ProcessResult result =
      run_emit({"make-log", folder.file("bad.toml"), "--out", folder.file("x.mcap")});
  EXPECT_EQ(result.exit_code, 78) << result.err;
  EXPECT_NE(result.err.find("bad.toml:1:"), std::string::npos) << result.err;
}

TEST(CliBadConfiguration, an_unknown_override_exits_with_78) {
  const ProcessResult result =
      run_emit({"render", "box", "--time-s", "0", "--out", "x.exr", "--set", "thermal.stepz=9"});
  EXPECT_EQ(result.exit_code, 78) << result.err;
  EXPECT_NE(result.err.find("stepz"), std::string::npos);
}

/// Scenarios with a scene file that is no glTF, and with a file that does not exist.
class CliBadScenario : public testing::TestWithParam<std::vector<std::string>> {};

TEST_P(CliBadScenario, exits_with_78) {
  const TemporaryFolder folder;
  write_text(folder.file("broken.glb"), "no glTF");
  const auto run = [&](const std::string& scenario) {
    std::vector<std::string> arguments = GetParam();
    for (std::string& argument : arguments) {
      if (argument == "SCENARIO") argument = scenario;
      if (argument == "OUT") argument = folder.file("out");
    }
    if (scenario == "box") {
      arguments.emplace_back("--set");
      arguments.push_back("object[box].gltf=\"" + folder.file("broken.glb") + "\"");
    }
    return run_emit(arguments);
  };
  const ProcessResult broken = run("box");
  EXPECT_EQ(broken.exit_code, 78) << broken.err;
  EXPECT_NE(broken.err.find("broken.glb"), std::string::npos) << broken.err;
  const ProcessResult unknown = run("no-such-scenario");
  EXPECT_EQ(unknown.exit_code, 78) << unknown.err;
  EXPECT_NE(unknown.err.find("no-such-scenario"), std::string::npos) << unknown.err;
}
INSTANTIATE_TEST_SUITE_P(
    Commands, CliBadScenario,
    testing::Values(std::vector<std::string>{"render", "SCENARIO", "--time-s", "0", "--out", "OUT"},
                    std::vector<std::string>{"solve", "SCENARIO", "--time-s", "0", "--out", "OUT"},
                    std::vector<std::string>{"view", "SCENARIO"},
                    std::vector<std::string>{"bench", "turn", "--scene", "SCENARIO"},
                    std::vector<std::string>{"bench", "budget", "--scene", "SCENARIO"}));

TEST(CliFailure, a_file_that_no_scenario_names_exits_with_1) {
  const TemporaryFolder folder;
  write_text(folder.file("broken.glb"), "no glTF");
  EXPECT_EQ(run_emit({"inspect", folder.file("broken.glb")}).exit_code, 1);
}

TEST(CliFailure, a_refused_connection_exits_with_1) {
  const ProcessResult result = run_emit({"receive", "tcp://127.0.0.1:1", "--frames", "1"});
  EXPECT_EQ(result.exit_code, 1) << result.err;
}

TEST(CliFailure, a_missing_log_exits_with_1_and_is_named) {
  const ProcessResult result = run_emit({"send", "/no/such/log.mcap", "--to", "udp://127.0.0.1:9"});
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_NE(result.err.find("/no/such/log.mcap"), std::string::npos);
}

}  // namespace
}  // namespace emit::test
