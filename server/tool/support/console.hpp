// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

/// Terminal output that every subcommand uses. Single thread, setup only.
namespace emit::tool {

enum ExitCode : int {
  kExitOk = 0,
  kExitFailure = 1,
  kExitUsage = 2,
  kExitConfig = 78,  ///< EX_CONFIG of sysexits.h
};

/// Prints "emit: error: ..." to standard error and returns `code`.
int fail(int code, std::string_view text);
/// Prints an error. The exit code follows its kind: config is 78, everything else 1.
int fail(const physics::Error& error);
/// Prints an error in the arguments of a command: invalid_argument is 2, other kinds as in fail().
int fail_call(const physics::Error& error);
/// Prints an error found while reading a scenario or daemon configuration. The exit code is always
/// 78.
int fail_config(const physics::Error& error);
void warn(std::string_view text);
/// Returns the stream for a command's text for people: standard output, or standard error when
/// `--json -` takes standard output.
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
