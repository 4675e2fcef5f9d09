// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "agents/channel_table.hpp"
#include "app/scenario_identity.hpp"
#include "emit/config/daemon_config.hpp"

namespace emit::v1 {
class Recording;
}

namespace emit::server {

/// Room for channels and values in a RunStart, bytes. A control record holds 1 MiB.
inline constexpr std::size_t kMaxRecordedBytes = 512u << 10;
/// Longest value that is recorded as it is, bytes. A longer one is recorded as its hash.
inline constexpr std::size_t kMaxRecordedValueBytes = 200;

/// Returns the text that names this build of a program in journals: "PROGRAM VERSION (COMMIT)".
[[nodiscard]] std::string build_text(std::string_view program);

/// Describes the setup of a daemon for the journal: scenario and configuration key by key, the
/// files of the scene and the channels. Values and files beyond kMaxRecordedBytes are left out and
/// counted.
/// @param identity  of the scenario; null: canned frames
/// @param daemon    null: not a daemon but a replay
void fill(const ScenarioIdentity* identity, const config::DaemonConfig* daemon,
          const std::vector<Channel>& channels, v1::Recording& out);

/// Build, device and scenario of a run.
struct RunOrigin {
  std::string software;  ///< as build_text() writes it
  std::string device;
  std::string scenario_name;
  std::string scenario_sha256;
};

/// A difference between a recording and a replay.
struct SetupDifference {
  enum class Kind { version, commit, device, scenario, value, file, channel };
  Kind kind = Kind::version;
  std::string name;      ///< key of the value, name of the file or channel; else empty
  std::string recorded;  ///< empty: absent
  std::string here;      ///< empty: absent

  /// True where the replay cannot show what was recorded.
  [[nodiscard]] bool is_decisive() const noexcept;
  /// Sentence such as "thermal.steps: recorded 27, here 28".
  [[nodiscard]] std::string text() const;
};

/// Lists the differences between a recording and a replay of it: version and commit, device, hash
/// of the scenario; then values of the scenario, files and channels by name.
/// @param recording  null: the journal does not say it, so that only the origin is compared
[[nodiscard]] std::vector<SetupDifference> compare_setup(const RunOrigin& recorded,
                                                         const v1::Recording* recording,
                                                         const RunOrigin& here,
                                                         const v1::Recording& own);

}  // namespace emit::server
