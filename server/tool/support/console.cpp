// SPDX-License-Identifier: Apache-2.0
#include "tool/support/console.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace emit::tool {

int fail(int code, std::string_view text) {
  fmt::print(stderr, "emit: error: {}\n", text);
  return code;
}

int fail(const physics::Error& error) {
  return fail(error.code == physics::ErrorCode::config ? kExitConfig : kExitFailure, error.text);
}

int fail_call(const physics::Error& error) {
  return error.code == physics::ErrorCode::invalid_argument ? fail(kExitUsage, error.text)
                                                            : fail(error);
}

int fail_config(const physics::Error& error) {
  return fail(kExitConfig, error.text);
}

void warn(std::string_view text) {
  fmt::print(stderr, "emit: warning: {}\n", text);
}

std::FILE* text_stream(const std::optional<std::filesystem::path>& json) {
  return json && *json == "-" ? stderr : stdout;
}

ProgressBar::ProgressBar(std::string label, std::uint64_t total)
    : label_(std::move(label)),
      total_(std::max<std::uint64_t>(total, 1)),
      shown_(isatty(STDERR_FILENO) == 1),
      start_(std::chrono::steady_clock::now()),
      last_draw_(start_ - std::chrono::seconds(1)) {}

ProgressBar::~ProgressBar() {
  finish();
}

void ProgressBar::advance_to(std::uint64_t done) {
  if (!shown_) return;
  const auto now = std::chrono::steady_clock::now();
  if (done < total_ && now - last_draw_ < std::chrono::milliseconds(100)) return;
  last_draw_ = now;
  constexpr std::uint64_t kWidth = 30;
  const std::uint64_t bounded = std::min(done, total_);
  const auto filled = static_cast<std::size_t>(kWidth * bounded / total_);
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  const double left_s =
      bounded > 0 ? elapsed_s * static_cast<double>(total_ - bounded) / static_cast<double>(bounded)
                  : 0.0;
  fmt::print(stderr, "\r{} [{}{}] {}/{} {:.0f} s left\x1b[K", label_, std::string(filled, '#'),
             std::string(kWidth - filled, '.'), bounded, total_, left_s);
  std::fflush(stderr);
}

void ProgressBar::finish() {
  if (!shown_) return;
  shown_ = false;
  fmt::print(stderr, "\r\x1b[K");
  std::fflush(stderr);
}

std::string TextTable::to_string() const {
  std::vector<std::size_t> widths;
  for (const auto& row : rows_) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string out;
  for (const auto& row : rows_) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (i == 0) {
        out += fmt::format("{:<{}}", row[i], widths[i]);
      } else {
        out += fmt::format("  {:>{}}", row[i], widths[i]);
      }
    }
    out += '\n';
  }
  return out;
}

}  // namespace emit::tool
