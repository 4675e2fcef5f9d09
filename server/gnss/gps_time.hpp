// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <string>

/// Time scales of GNSS. Thread: any. Real time: not RT-safe.
namespace emit::server {

/// An instant in GPS time, which began with UTC on 1980-01-06 and has no leap seconds.
struct GpsInstant {
  std::int64_t week = 0;        ///< counted from 1980-01-06, without the overflow at 1024
  double second_of_week = 0.0;  ///< [0, 604800)
  int leap_seconds = 0;         ///< GPS time less UTC
};

/// Returns the GPS instant of a POSIX time (ns since 1970-01-01 UTC, no leap seconds); nothing
/// before 1980-01-06. The leap seconds are those of IERS Bulletin C up to 2017-01-01, the latest
/// one; 18 s hold from then on.
[[nodiscard]] std::optional<GpsInstant> gps_instant(std::int64_t posix_utc_ns);

/// Returns a POSIX time as "2024-06-21 11:59:00.500 UTC", rounded down to milliseconds.
[[nodiscard]] std::string utc_text(std::int64_t posix_utc_ns);

}  // namespace emit::server
