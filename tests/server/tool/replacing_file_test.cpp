// SPDX-License-Identifier: Apache-2.0
#include "tool/support/replacing_file.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>

#include "support/emit_process.hpp"

namespace emit::tool {
namespace {

namespace fs = std::filesystem;

class CliReplacingFile : public testing::Test {
 protected:
  void SetUp() override { std::ofstream(folder_ / "kept") << "old"; }
  static std::string read(const fs::path& file) {
    std::ifstream in(file);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  [[nodiscard]] auto files() const {
    return std::distance(fs::directory_iterator(folder_), fs::directory_iterator());
  }

  const test::TemporaryFolder own_;  // tests run beside each other
  const fs::path folder_ = own_.path();
};

TEST_F(CliReplacingFile, the_target_changes_at_the_end_alone) {
  auto file = ReplacingFile::create(folder_ / "kept");
  ASSERT_TRUE(file.has_value()) << file.error().text;
  ASSERT_TRUE(file->write("new"));
  EXPECT_EQ(read(folder_ / "kept"), "old");
  ASSERT_TRUE(file->commit());
  EXPECT_EQ(read(folder_ / "kept"), "new");
  EXPECT_EQ(files(), 1);
}

TEST_F(CliReplacingFile, what_is_not_committed_leaves_nothing) {
  {
    auto file = ReplacingFile::create(folder_ / "kept");
    ASSERT_TRUE(file && file->write("new"));
  }
  EXPECT_EQ(read(folder_ / "kept"), "old");
  EXPECT_EQ(files(), 1);
}

TEST_F(CliReplacingFile, a_link_stays_a_link) {
  fs::create_symlink("kept", folder_ / "link");
  auto file = ReplacingFile::create(folder_ / "link");
  ASSERT_TRUE(file && file->write("new") && file->commit());
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(read(folder_ / "kept"), "new");
}

TEST_F(CliReplacingFile, a_device_is_written_and_a_full_one_is_an_error) {
  auto null = ReplacingFile::create("/dev/null");
  ASSERT_TRUE(null && null->write("new") && null->commit());
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  if (!fs::exists("/dev/full")) return;
  auto full = ReplacingFile::create("/dev/full");
  ASSERT_TRUE(full && full->write("new"));
  const auto done = full->commit();
  ASSERT_FALSE(done.has_value());
  EXPECT_EQ(done.error().text, "/dev/full: cannot write: No space left on device");
}

TEST_F(CliReplacingFile, a_missing_folder_is_named) {
  const auto file = ReplacingFile::create(folder_ / "none" / "x");
  ASSERT_FALSE(file.has_value());
  EXPECT_NE(file.error().text.find("none/x: cannot write: No such file or directory"),
            std::string::npos);
}

}  // namespace
}  // namespace emit::tool
