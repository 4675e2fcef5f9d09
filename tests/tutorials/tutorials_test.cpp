// SPDX-License-Identifier: Apache-2.0
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <regex>
#include <string>
#include <vector>

#include "support/daemon_process.hpp"
#include "tutorials/tutorial_page.hpp"

namespace emit::test {
namespace {

/// Runs a command in the folder. Its output is added to the file "log".
int run(const ScratchFolder& folder, const std::string& command) {
  return std::system(
      ("cd '" + folder.path().string() + "' && (" + command + ") >> log 2>&1").c_str());
}

/// Returns a TCP port that nobody uses at the moment.
std::string free_port() {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t bytes = sizeof(address);
  EXPECT_EQ(::bind(fd, reinterpret_cast<const sockaddr*>(&address), bytes), 0);
  EXPECT_EQ(::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &bytes), 0);
  ::close(fd);
  return std::to_string(ntohs(address.sin_port));
}

void replace_all(std::string& text, const std::string& from, const std::string& to) {
  for (std::size_t at = text.find(from); at != std::string::npos;
       at = text.find(from, at + to.size())) {
    text.replace(at, from.size(), to);
  }
}

/// Runs the shell snippets of a page as one script that ends at the first failure.
void run_shell_snippets(const std::string& page) {
  const ScratchFolder folder;
  std::string script = TutorialPage(page).snippets("sh");
  ASSERT_FALSE(script.empty());
  for (const char* port : {"127.0.0.1:7000", "127.0.0.1:7001", "127.0.0.1:7002"}) {
    replace_all(script, port, "127.0.0.1:" + free_port());
  }
  folder.write("script.sh",
               "set -euxo pipefail\nexport PATH='" EMIT_TEST_BIN_DIR "':\"$PATH\"\n" + script);
  EXPECT_EQ(run(folder, "bash script.sh"), 0) << folder.read("log");
}

TEST(Tutorials, OwnScene) {
  run_shell_snippets("own_scene.md");
}

TEST(Tutorials, Terrain) {
  const ScratchFolder folder;
  if (run(folder, "command -v gdalwarp gdal_translate") != 0) {
    GTEST_SKIP() << "GDAL's programs (Debian gdal-bin) are not installed";
  }
  run_shell_snippets("terrain.md");
}

TEST(Tutorials, Rig) {
  run_shell_snippets("rig.md");
}

TEST(Tutorials, Engage) {
  const ScratchFolder folder;
  if (run(folder, "/usr/bin/python3 -c 'import numpy, google.protobuf'") != 0) {
    GTEST_SKIP() << "python3-numpy or python3-protobuf is missing";
  }
  run_shell_snippets("engage.md");
}

/// Manual pages and completion scripts lie where man(1) and the shells look for them.
TEST(Installation, HasManualPagesAndCompletion) {
  const ScratchFolder folder;
  ASSERT_EQ(run(folder, std::string(EMIT_TEST_CMAKE) + " --install '" EMIT_TEST_BINARY_DIR
                                                       "' --component help --prefix prefix"),
            0)
      << folder.read("log");
  for (const char* file :
       {"share/man/man1/emit.1", "share/man/man1/emit-render.1",
        "share/man/man1/emit-bench-paper.1", "share/man/man8/emitd.8",
        "share/bash-completion/completions/emit", "share/fish/vendor_completions.d/emit.fish",
        "share/zsh/site-functions/_emit"}) {
    EXPECT_FALSE(folder.read(std::string("prefix/") + file).empty()) << file;
  }
  EXPECT_EQ(run(folder, "bash -n prefix/share/bash-completion/completions/emit"), 0)
      << folder.read("log");
  if (run(folder, "command -v man") == 0) {
    EXPECT_EQ(run(folder, "MANPATH=\"$PWD/prefix/share/man\" man -w emit-render emitd"), 0)
        << folder.read("log");
  }
}

/// Returns the targets of the relative links and images of a Markdown text, without `#section`.
std::vector<std::string> relative_links(const std::string& text) {
  static const std::regex link(R"(\]\(([^)\s#]+)(#[^)]*)?\)|\n\[[^\]]+\]: ([^\s#]+))");
  std::vector<std::string> links;
  for (std::sregex_iterator it(text.begin(), text.end(), link), end; it != end; ++it) {
    const std::string target = (*it)[1].matched ? (*it)[1].str() : (*it)[3].str();
    if (target.find("://") == std::string::npos) links.push_back(target);
  }
  return links;
}

/// Who reads an installed page follows its links, so that none may lead nowhere.
TEST(Installation, RelativeLinksOfEveryPageResolve) {
  namespace fs = std::filesystem;
  const ScratchFolder folder;
  ASSERT_EQ(run(folder, std::string(EMIT_TEST_CMAKE) + " --install '" EMIT_TEST_BINARY_DIR
                                                       "' --component doc --prefix prefix"),
            0)
      << folder.read("log");
  std::size_t pages = 0;
  std::size_t links = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder.path() / "prefix")) {
    if (entry.path().extension() != ".md") continue;
    ++pages;
    const std::string page = fs::relative(entry.path(), folder.path()).string();
    for (const std::string& link : relative_links(folder.read(page))) {
      ++links;
      EXPECT_TRUE(fs::exists(entry.path().parent_path() / link)) << page << ": " << link;
    }
  }
  EXPECT_GT(pages, 15U);
  EXPECT_GT(links, 60U);
}

/// Fixture with the client library as an integrator has it: installed, without the source tree.
class ClientTutorial : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(run(folder_, std::string(EMIT_TEST_CMAKE) + " --install '" EMIT_TEST_BINARY_DIR
                                                          "' --component client --prefix prefix"),
              0)
        << folder_.read("log");
    ASSERT_TRUE(daemon_.wait_ready()) << daemon_.err();
  }
  void expect_five_frames() {
    const std::string said = folder_.read("log");
    EXPECT_NE(said.find("frame 5: host frame 5, first pixel "), std::string::npos) << said;
  }

  const ScratchFolder folder_;
  const TutorialPage page_{"client.md"};
  DaemonProcess daemon_{
      folder_,
      {"--config", folder_.write("daemon.toml", canned_config(64, 48, "mode = \"host-step\""))}};
};

TEST_F(ClientTutorial, CppProjectBuildsAgainstTheInstalledPackageAndReceivesFrames) {
  folder_.write("CMakeLists.txt", page_.snippets("cmake"));
  folder_.write("main.cpp", page_.snippets("cpp"));
  ASSERT_EQ(run(folder_, std::string(EMIT_TEST_CMAKE) +
                             " -G Ninja -S . -B build -DCMAKE_PREFIX_PATH=\"$PWD/prefix\""
                             " -DCMAKE_CXX_COMPILER='" EMIT_TEST_CXX_COMPILER
                             "' -DCMAKE_CXX_FLAGS='" EMIT_TEST_CXX_FLAGS "' && " EMIT_TEST_CMAKE
                             " --build build"),
            0)
      << folder_.read("log");
  EXPECT_EQ(run(folder_, "build/my_client tcp://" + daemon_.control()), 0) << folder_.read("log");
  expect_five_frames();
}

TEST_F(ClientTutorial, PythonPackageReceivesFrames) {
  if (run(folder_, "/usr/bin/python3 -c 'import google.protobuf, numpy'") != 0) {
    GTEST_SKIP() << "python3-protobuf or python3-numpy is not installed";
  }
  folder_.write("client.py", page_.snippets("py"));
  EXPECT_EQ(
      run(folder_,
          "PYTHONPATH=\"$PWD/prefix/share/emit/python:$PYTHONPATH\" /usr/bin/python3 client.py "
          "tcp://" +
              daemon_.control()),
      0)
      << folder_.read("log");
  expect_five_frames();
}

TEST_F(ClientTutorial, PythonProgramWithoutThePackageReceivesFrames) {
  if (run(folder_, "/usr/bin/python3 -c 'import google.protobuf'") != 0) {
    GTEST_SKIP() << "python3-protobuf is not installed";
  }
  folder_.write("raw_client.py", page_.snippets("python"));
  ASSERT_EQ(run(folder_,
                "protoc --proto_path=prefix/share/emit/proto --python_out=. emit/v1/control.proto "
                "emit/v1/host.proto emit/v1/status.proto"),
            0)
      << folder_.read("log");
  EXPECT_EQ(run(folder_, "/usr/bin/python3 raw_client.py " + daemon_.control()), 0)
      << folder_.read("log");
  expect_five_frames();
}

}  // namespace
}  // namespace emit::test
