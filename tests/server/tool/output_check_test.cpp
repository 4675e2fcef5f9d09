// SPDX-License-Identifier: Apache-2.0
#include "tool/support/output_check.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <sstream>
#include <string>

namespace emit::tool {
namespace {

namespace fs = std::filesystem;

class OutputCheck : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "emit-output-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
    std::ofstream(folder_ / "old") << "kept";
  }
  void TearDown() override {
    ::chmod((folder_ / "closed").c_str(), 0700);
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  [[nodiscard]] std::size_t entries() const {
    std::size_t count = 0;
    for ([[maybe_unused]] const auto& entry : fs::recursive_directory_iterator(folder_)) ++count;
    return count;
  }
  /// The error says both.
  static void expect_error(const physics::Result<void>& checked, const fs::path& path,
                           const std::string& reason) {
    ASSERT_FALSE(checked.has_value()) << path;
    EXPECT_EQ(checked.error().code, physics::ErrorCode::io);
    EXPECT_NE(checked.error().text.find(path.string()), std::string::npos) << checked.error().text;
    EXPECT_NE(checked.error().text.find(reason), std::string::npos) << checked.error().text;
  }

  fs::path folder_;
};

TEST_F(OutputCheck, a_check_creates_and_changes_nothing) {
  EXPECT_TRUE(check_output_file(folder_ / "new").has_value());
  EXPECT_TRUE(check_output_file(folder_ / "old").has_value());
  EXPECT_TRUE(check_output_folder(folder_).has_value());
  EXPECT_TRUE(check_output_folder(folder_ / "a" / "b").has_value());
  EXPECT_TRUE(check_output_folder((folder_ / "a").string() + "/").has_value());
  EXPECT_TRUE(check_output_file("name-without-folder").has_value());
  EXPECT_TRUE(check_output_file("/dev/null").has_value());
  EXPECT_EQ(entries(), 1U);
  std::ostringstream text;
  text << std::ifstream(folder_ / "old").rdbuf();
  EXPECT_EQ(text.str(), "kept");
}

TEST_F(OutputCheck, what_cannot_be_written_is_named_with_the_reason) {
  expect_error(check_output_file(folder_ / "none" / "x.exr"), folder_ / "none" / "x.exr",
               "there is no folder");
  expect_error(check_output_file(folder_), folder_, "it is a folder");
  expect_error(check_output_file(folder_ / "old" / "x.exr"), folder_ / "old" / "x.exr",
               "is not a folder");
  expect_error(check_output_file((folder_ / "new").string() + "/"), folder_ / "new", "slash");
  expect_error(check_output_file(""), "", "empty");
  expect_error(check_output_folder(""), "", "empty");
  expect_error(check_output_folder(folder_ / "old"), folder_ / "old", "is not a folder");
  expect_error(check_output_folder(folder_ / "old" / "deep" / "er"), folder_ / "old" / "deep",
               "is not a folder");
}

TEST_F(OutputCheck, permissions_count) {
  ASSERT_EQ(::mkdir((folder_ / "closed").c_str(), 0555), 0);
  ASSERT_EQ(::chmod((folder_ / "old").c_str(), 0444), 0);
  ASSERT_EQ(::chmod(folder_.c_str(), 0755), 0);
  // Root may write everywhere, and other users may not.
  const bool root = ::geteuid() == 0;
  constexpr uid_t kNobody = 65534;
  if (root) {
    ASSERT_EQ(::seteuid(kNobody), 0);
  }
  expect_error(check_output_file(folder_ / "closed" / "x"), folder_ / "closed" / "x",
               "Permission denied");
  expect_error(check_output_folder(folder_ / "closed" / "x"), folder_ / "closed" / "x",
               "Permission denied");
  expect_error(check_output_file(folder_ / "old"), folder_ / "old", "Permission denied");
  if (root) {
    ASSERT_EQ(::seteuid(0), 0);
  }
}

}  // namespace
}  // namespace emit::tool
