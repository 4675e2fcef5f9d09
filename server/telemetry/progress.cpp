// SPDX-License-Identifier: Apache-2.0
#include "telemetry/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace emit::server {
namespace {

constexpr std::int64_t kReportEveryNs = 3'000'000'000;
/// Reports are apart by at least the elapsed time over this.
constexpr std::int64_t kReportsPerElapsed = 50;
constexpr std::int64_t kDrawEveryNs = 100'000'000;

const Clock& system_clock() {
  static const SystemClock clock;
  return clock;
}

Progress::Write standard_error() {
  if (::isatty(STDERR_FILENO) != 1) return {};
  return [](std::string_view text) {
    std::fwrite(text.data(), 1, text.size(), stderr);
    std::fflush(stderr);
  };
}

}  // namespace

ProgressMeter::Report ProgressMeter::report(double done_frac) const noexcept {
  const double done = std::isfinite(done_frac) ? std::clamp(done_frac, 0.0, 1.0) : 0.0;
  Report out;
  out.done_percent = static_cast<int>(100.0 * done);
  out.elapsed_s = 1e-9 * static_cast<double>(clock_->monotonic_ns() - start_ns_);
  if (done > 0.0) out.left_s = out.elapsed_s * (1.0 - done) / done;
  return out;
}

std::optional<ProgressMeter::Report> ProgressMeter::due(double done_frac) noexcept {
  const std::int64_t now_ns = clock_->monotonic_ns();
  const std::int64_t every_ns = std::max(kReportEveryNs, (now_ns - start_ns_) / kReportsPerElapsed);
  if (now_ns - reported_ns_ < every_ns) return std::nullopt;
  reported_ns_ = now_ns;
  return report(done_frac);
}

std::string duration_text(double seconds) {
  constexpr double kMinuteS = 60.0;
  constexpr double kHourS = 3600.0;
  if (seconds < 1.5 * kMinuteS) return fmt::format("{:.0f} s", seconds);
  if (seconds < 1.5 * kHourS) return fmt::format("{:.0f} min", seconds / kMinuteS);
  return fmt::format("{:.1f} h", seconds / kHourS);
}

std::string progress_text(std::string_view label, const ProgressMeter::Report& report) {
  return fmt::format(
      "{} {} %{}", label, report.done_percent,
      report.left_s ? fmt::format(", about {} left", duration_text(*report.left_s)) : "");
}

Progress::Progress(std::string label, std::uint64_t total)
    : Progress(std::move(label), total, system_clock(), standard_error()) {}

Progress::Progress(std::string label, std::uint64_t total, const Clock& clock, Write write)
    : label_(std::move(label)),
      total_(std::max<std::uint64_t>(total, 1)),
      clock_(&clock),
      write_(std::move(write)),
      meter_(clock) {}

Progress::~Progress() {
  finish();
}

void Progress::draw_bar(const ProgressMeter::Report& report) {
  constexpr std::size_t kWidth = 30;
  const std::size_t filled = kWidth * static_cast<std::size_t>(report.done_percent) / 100;
  write_(fmt::format(
      "\r{} [{}{}] {} %{}\x1b[K", label_, std::string(filled, '#'),
      std::string(kWidth - filled, '.'), report.done_percent,
      report.left_s ? fmt::format(", about {} left", duration_text(*report.left_s)) : ""));
}

void Progress::advance_to(std::uint64_t done) {
  if (finished_ || !write_) return;
  const std::int64_t now_ns = clock_->monotonic_ns();
  if (done < total_ && drawn_ns_ && now_ns - *drawn_ns_ < kDrawEveryNs) return;
  drawn_ns_ = now_ns;
  draw_bar(
      meter_.report(static_cast<double>(std::min(done, total_)) / static_cast<double>(total_)));
}

void Progress::clear() {
  if (drawn_ns_) write_("\r\x1b[K");
  drawn_ns_.reset();
}

void Progress::finish() {
  if (finished_) return;
  finished_ = true;
  clear();
}

}  // namespace emit::server
