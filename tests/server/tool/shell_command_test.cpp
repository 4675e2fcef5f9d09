// SPDX-License-Identifier: Apache-2.0
// Completion scripts and manual pages, which are made from the tree of commands.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <sstream>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using Words = std::vector<std::string>;

bool installed(const std::string& program) {
  return run_process({"sh", "-c", "command -v " + program}).exit_code == 0;
}

std::set<std::string> lines_of(const std::string& text) {
  std::istringstream stream(text);
  std::set<std::string> out;
  for (std::string line; std::getline(stream, line);) out.insert(line);
  return out;
}

/// Commands as `emit --help`, or the help of a group, lists them.
Words commands_in_help(const Words& group = {}) {
  Words arguments = group;
  arguments.emplace_back("--help");
  std::istringstream help(run_emit(arguments).out);
  Words out;
  bool listed = false;
  for (std::string line; std::getline(help, line);) {
    if (line.starts_with("Subcommands:")) {
      listed = true;
    } else if (listed && line.starts_with("  ") && line[2] != ' ') {
      out.push_back(line.substr(2, line.find(' ', 2) - 2));
    }
  }
  return out;
}

class BashCompletion : public testing::Test {
 protected:
  void SetUp() override {
    const ProcessResult made = run_emit({"completion", "bash"});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    write_text(folder_.file("emit.bash"), made.out);
    write_text(folder_.file("here.toml"), "");
    std::filesystem::create_directory(folder_.file("sub"));
  }
  /// Candidates that bash offers behind `words`; the last of them is being typed.
  [[nodiscard]] std::set<std::string> candidates(const Words& words) const {
    std::string line;
    for (const std::string& word : words) line += " '" + word + "'";
    const ProcessResult result = run_process(
        {"bash", "--norc", "-c",
         "set -u; cd '" + folder_.path().string() + "'; source ./emit.bash; COMP_WORDS=(emit" +
             line + "); COMP_CWORD=" + std::to_string(words.size()) +
             "; _emit_complete; [[ ${#COMPREPLY[@]} -eq 0 ]] || "
             "printf '%s\\n' \"${COMPREPLY[@]}\""});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(result.err, "");
    return lines_of(result.out);
  }
  TemporaryFolder folder_;
};

TEST_F(BashCompletion, is_a_script_that_bash_takes) {
  const ProcessResult result = run_process({"bash", "-n", folder_.file("emit.bash")});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  const ProcessResult sourced = run_process(
      {"bash", "--norc", "-c", "source '" + folder_.file("emit.bash") + "'; complete -p emit"});
  EXPECT_EQ(sourced.out, "complete -F _emit_complete emit\n") << sourced.err;
}

TEST_F(BashCompletion, offers_every_command_and_every_suite) {
  const Words commands = commands_in_help();
  ASSERT_GT(commands.size(), 15U);
  EXPECT_EQ(candidates({""}), std::set<std::string>(commands.begin(), commands.end()));
  const Words suites = commands_in_help({"bench"});
  ASSERT_GT(suites.size(), 8U);
  EXPECT_EQ(candidates({"bench", ""}), std::set<std::string>(suites.begin(), suites.end()));
  EXPECT_EQ(candidates({"bench", "pap"}), std::set<std::string>{"paper"});
  EXPECT_EQ(candidates({"log", ""}), (std::set<std::string>{"info", "cut", "merge", "export"}));
  EXPECT_EQ(candidates({"log", "export", ""}), (std::set<std::string>{"csv", "exr", "foxglove"}));
}

TEST_F(BashCompletion, offers_the_options_of_the_command_in_the_line) {
  for (const Words& command :
       {Words{"render"}, Words{"serve"}, Words{"bench", "paper"}, Words{"log", "export", "csv"}}) {
    Words words = command;
    words.emplace_back("--");
    const std::set<std::string> offered = candidates(words);
    Words help = command;
    help.emplace_back("--help");
    const std::string text = run_emit(help).out;
    EXPECT_GE(offered.size(), 3U);
    for (const std::string& option : offered) {
      EXPECT_NE(text.find(option), std::string::npos) << option << "\n" << text;
    }
  }
  EXPECT_EQ(candidates({"render", "box", "--tim"}), (std::set<std::string>{"--time-s", "--times"}));
}

TEST_F(BashCompletion, offers_values_files_and_folders) {
  const std::set<std::string> channels{"temperature", "depth", "object", "coverage"};
  EXPECT_EQ(candidates({"render", "--channel", ""}), channels);
  EXPECT_EQ(candidates({"render", "--channel", "=", "te"}), std::set<std::string>{"temperature"});
  EXPECT_EQ(candidates({"render", "--channel", "="}), channels);
  EXPECT_EQ(candidates({"replay", "here.toml", "--scenario", "he"}),
            std::set<std::string>{"here.toml"});
  EXPECT_EQ(candidates({"render", "--out", "h"}), std::set<std::string>{"here.toml"});
  EXPECT_EQ(candidates({"receive", "--out", ""}), std::set<std::string>{"sub"});
  EXPECT_EQ(candidates({"completion", ""}), (std::set<std::string>{"bash", "fish", "zsh"}));
  EXPECT_TRUE(candidates({"render", "--time-s", ""}).empty()) << "a number has no candidates";
}

TEST_F(BashCompletion, offers_shipped_scenarios_where_one_is_asked_for) {
  const std::set<std::string> scenarios = candidates({"render", ""});
  EXPECT_TRUE(scenarios.contains("airfield"));
  EXPECT_TRUE(scenarios.contains("here.toml"));
  EXPECT_TRUE(candidates({"render", "--time-s", "5", "airf"}).contains("airfield"));
  EXPECT_EQ(candidates({"render", "--channel", "render", "airf"}),
            std::set<std::string>{"airfield"})
      << "the value of an option is no command";
}

TEST(ShellCompletion, zsh_and_fish_have_every_command_and_option_that_bash_has) {
  const std::string zsh = run_emit({"completion", "zsh"}).out;
  const std::string fish = run_emit({"completion", "fish"}).out;
  EXPECT_TRUE(zsh.starts_with("#compdef emit\n"));
  for (const std::string& command : commands_in_help()) {
    EXPECT_NE(zsh.find("\n_emit_" + command + "() {\n"), std::string::npos) << command;
    EXPECT_NE(fish.find("'__emit_at emit' -a " + command + " -d "), std::string::npos) << command;
  }
  EXPECT_NE(zsh.find("'*--channel=["), std::string::npos);
  EXPECT_NE(zsh.find(":(temperature depth object coverage)'"), std::string::npos);
  EXPECT_NE(
      fish.find("'__emit_at emit render' -l channel -r -f -a 'temperature depth object coverage'"),
      std::string::npos);
}

TEST(ShellCompletion, zsh_and_fish_take_their_scripts) {
  bool any = false;
  for (const char* shell : {"zsh", "fish"}) {
    if (!installed(shell)) continue;
    any = true;
    const TemporaryFolder folder;
    write_text(folder.file("script"), run_emit({"completion", shell}).out);
    const ProcessResult result = run_process({shell, "-n", folder.file("script")});
    EXPECT_EQ(result.exit_code, 0) << shell << ": " << result.err;
    EXPECT_EQ(result.err, "") << shell;
  }
  if (!any) GTEST_SKIP() << "neither zsh nor fish is installed";
}

TEST(ShellCompletion, fish_offers_commands_and_values) {
  if (!installed("fish")) GTEST_SKIP() << "fish is not installed";
  const TemporaryFolder folder;
  write_text(folder.file("script"), run_emit({"completion", "fish"}).out);
  const auto offered = [&](const std::string& line) {
    const ProcessResult result =
        run_process({"fish", "--no-config", "-c",
                     "source '" + folder.file("script") + "'; complete -C '" + line + "'"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.out;
  };
  EXPECT_NE(offered("emit re").find("render\t"), std::string::npos);
  EXPECT_NE(offered("emit bench pa").find("paper\t"), std::string::npos);
  EXPECT_EQ(offered("emit bench re").find("render"), std::string::npos);
  EXPECT_NE(offered("emit render --channel te").find("temperature"), std::string::npos);
}

class ManPages : public testing::Test {
 protected:
  void SetUp() override {
    const ProcessResult made = run_emit({"man", "--out", folder_.path().string()});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
      files_.insert(entry.path().filename().string());
    }
  }
  TemporaryFolder folder_;
  std::set<std::string> files_;
};

TEST_F(ManPages, there_is_one_for_every_command_and_for_the_daemon) {
  std::set<std::string> expected{"emit.1", "emitd.8"};
  for (const std::string& command : commands_in_help()) expected.insert("emit-" + command + ".1");
  for (const Words& group :
       {Words{"bench"}, Words{"log"}, Words{"log", "export"}, Words{"export"}, Words{"scene"}}) {
    std::string name = "emit-";
    for (const std::string& word : group) name += word + "-";
    for (const std::string& command : commands_in_help(group)) {
      expected.insert(name + command + ".1");
    }
  }
  EXPECT_EQ(files_, expected);
}

TEST_F(ManPages, have_the_sections_of_a_manual_page) {
  for (const std::string& file : files_) {
    const std::string page = read_text(folder_.file(file));
    EXPECT_NE(page.find("\n.TH \""), std::string::npos) << file;
    for (const char* section : {"\n.SH NAME\n", "\n.SH SYNOPSIS\n", "\n.SH OPTIONS\n",
                                "\n.SH NOTES\n", "\n.SH SEE ALSO\n"}) {
      EXPECT_NE(page.find(section), std::string::npos) << file << section;
    }
  }
}

TEST_F(ManPages, are_read_by_groff_without_a_warning) {
  if (!installed("groff")) GTEST_SKIP() << "groff is not installed";
  for (const std::string& file : files_) {
    const ProcessResult result =
        run_process({"groff", "-man", "-Tutf8", "-ww", "-z", folder_.file(file)});
    EXPECT_EQ(result.exit_code, 0) << file;
    EXPECT_EQ(result.err, "") << file;
  }
}

TEST_F(ManPages, say_what_the_help_says) {
  const std::string daemon = read_text(folder_.file("emitd.8"));
  EXPECT_NE(daemon.find("\\fB\\-\\-config\\fR \\fIFILE\\fR"), std::string::npos);
  EXPECT_NE(daemon.find("75 the device was lost"), std::string::npos);
  const std::string render = read_text(folder_.file("emit-render.1"));
  EXPECT_NE(render.find("One of: temperature, depth, object, coverage."), std::string::npos);
  EXPECT_NE(render.find("\\fB\\-\\-png\\-of\\fR"), std::string::npos);
  EXPECT_EQ(run_emit({"man", "render"}).out, render);
  EXPECT_EQ(run_emit({"man"}).out, read_text(folder_.file("emit.1")));
  EXPECT_EQ(run_emit({"man", "bench", "paper"}).out, read_text(folder_.file("emit-bench-paper.1")));
  EXPECT_EQ(run_emit({"man", "emitd"}).out, daemon);
}

TEST_F(ManPages, of_no_command_are_a_usage_error_with_a_suggestion) {
  const ProcessResult result = run_emit({"man", "rendre"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(result.out.empty());
  EXPECT_NE(result.err.find("did you mean 'emit-render'?"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace emit::test
