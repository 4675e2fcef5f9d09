// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

/// Output of every subcommand to the terminal. Single thread, setup only.
namespace emit::tool {

enum ExitCode : int {
  kExitOk = 0,
  kExitFailure = 1,
  kExitUsage = 2,
  kExitConfig = 78,  ///< EX_CONFIG of sysexits.h
};

/// Prints "emit: error: ..." to standard error; `code` goes back to the caller.
int fail(int code, std::string_view text);
/// Exit code by the kind of error: config is 78, everything else 1.
int fail(const physics::Error& error);
/// The same of something that judges what the command was called with: invalid_argument is 2.
int fail_call(const physics::Error& error);
/// Reports errors met while reading a scenario or daemon configuration: always 78.
int fail_config(const physics::Error& error);
void warn(std::string_view text);
/// Where a command's text for people goes: standard output, or standard error when `--json -` takes
/// standard output.
[[nodiscard]] std::FILE* text_stream(const std::optional<std::filesystem::path>& json);

/// Plain text table with right-aligned columns; the first column is left-aligned.
class TextTable {
 public:
  explicit TextTable(std::vector<std::string> header) { rows_.push_back(std::move(header)); }
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  [[nodiscard]] std::string to_string() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace emit::tool
