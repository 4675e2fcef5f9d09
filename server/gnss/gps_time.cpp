// SPDX-License-Identifier: Apache-2.0
#include "gnss/gps_time.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>

namespace emit::server {
namespace {

using std::chrono::sys_days;
using namespace std::chrono_literals;

/// First days that begin after a leap second since the start of GPS time.
constexpr std::array<sys_days, 18> kLeapDays = {
    sys_days(1981y / 7 / 1), sys_days(1982y / 7 / 1), sys_days(1983y / 7 / 1),
    sys_days(1985y / 7 / 1), sys_days(1988y / 1 / 1), sys_days(1990y / 1 / 1),
    sys_days(1991y / 1 / 1), sys_days(1992y / 7 / 1), sys_days(1993y / 7 / 1),
    sys_days(1994y / 7 / 1), sys_days(1996y / 1 / 1), sys_days(1997y / 7 / 1),
    sys_days(1999y / 1 / 1), sys_days(2006y / 1 / 1), sys_days(2009y / 1 / 1),
    sys_days(2012y / 7 / 1), sys_days(2015y / 7 / 1), sys_days(2017y / 1 / 1)};

std::chrono::sys_time<std::chrono::nanoseconds> instant_of(std::int64_t posix_utc_ns) {
  return std::chrono::sys_time<std::chrono::nanoseconds>(std::chrono::nanoseconds(posix_utc_ns));
}

}  // namespace

std::optional<GpsInstant> gps_instant(std::int64_t posix_utc_ns) {
  const auto utc = instant_of(posix_utc_ns);
  const auto since = utc - sys_days(1980y / 1 / 6);
  if (since.count() < 0) return std::nullopt;
  const auto leaps = std::ranges::upper_bound(kLeapDays, utc) - kLeapDays.begin();
  const auto gps = since + std::chrono::seconds(leaps);
  const auto week = std::chrono::floor<std::chrono::weeks>(gps);
  return GpsInstant{week.count(), 1e-9 * static_cast<double>((gps - week).count()),
                    static_cast<int>(leaps)};
}

std::string utc_text(std::int64_t posix_utc_ns) {
  const auto utc = instant_of(posix_utc_ns);
  const auto day = std::chrono::floor<std::chrono::days>(utc);
  const std::chrono::year_month_day date(day);
  const std::chrono::hh_mm_ss time(std::chrono::floor<std::chrono::milliseconds>(utc - day));
  return fmt::format("{:04}-{:02}-{:02} {:02}:{:02}:{:02}.{:03} UTC", static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                     time.hours().count(), time.minutes().count(), time.seconds().count(),
                     time.subseconds().count());
}

}  // namespace emit::server
