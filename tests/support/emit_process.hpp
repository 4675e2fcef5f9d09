// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

/// Runs the real `emit` of the build tree.
namespace emit::test {

struct ProcessResult {
  int exit_code = -1;  ///< 128 + signal when killed; -1: did not start or ran into the time limit
  std::string out;
  std::string err;
};

/// Runs the program with an empty standard input. The process is killed after `limit`.
[[nodiscard]] ProcessResult run_process(const std::vector<std::string>& arguments,
                                        std::chrono::seconds limit = std::chrono::seconds(120));
/// Runs `emit` with these arguments.
[[nodiscard]] ProcessResult run_emit(const std::vector<std::string>& arguments,
                                     std::chrono::seconds limit = std::chrono::seconds(120));

/// Folder of its own for each test, removed at the end.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

void write_text(const std::string& file, const std::string& text);
[[nodiscard]] std::string read_text(const std::string& file);

/// Returns the value after "key": in a JSON text, up to the next comma or end of line; "" when
/// there is none.
[[nodiscard]] std::string json_value(const std::string& json, const std::string& key);

}  // namespace emit::test
