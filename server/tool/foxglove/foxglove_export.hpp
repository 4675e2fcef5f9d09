// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "tool/foxglove/foxglove_file.hpp"

namespace emit::tool {

/// Which images of a log are exported.
struct FoxgloveImages {
  bool values = true;   ///< 32FC1, the pixels as they were sent
  bool preview = true;  ///< rgb8, in the colours of emitd's own pictures
};

struct FoxgloveOptions {
  std::optional<std::int64_t> from_ns{};  ///< first simulation time, ns; absent: the begin
  std::optional<std::int64_t> to_ns{};    ///< last simulation time, ns; absent: the end
  std::optional<std::uint64_t> run_id{};  ///< absent: the only run with frames in the range
  FoxgloveImages images{};
  std::string software{};  ///< name of the writing software, for the file's header
  /// Called with the share done, 0..1; false stops.
  std::function<bool(double done_frac)> progress{};
};

struct FoxgloveSummary {
  std::vector<FoxgloveTopic> topics;
  std::uint64_t run_id = 0;
  /// Instant of simulation time 0, POSIX ns UTC.
  std::int64_t epoch_utc_ns = 0;
  std::vector<std::string> notes;  ///< what is left out, and why
};

/// Writes one run of a log as messages that Foxglove knows by name (deploy/docs/foxglove.md). Of a
/// journal that is one run of the daemon, of a log with host frames one run of the host. Stamps are
/// simulation time on the scenario's epoch. The file takes its place when it is complete.
/// Errors: those of the readers; io; invalid_argument (no frame in the range, frames of several
/// runs, an instant before 1970, or the output is the input); unsupported (no message of emitd);
/// internal (`progress` asked to stop).
[[nodiscard]] physics::Result<FoxgloveSummary> export_foxglove(const std::filesystem::path& log,
                                                               const std::filesystem::path& out,
                                                               const FoxgloveOptions& options);

}  // namespace emit::tool
