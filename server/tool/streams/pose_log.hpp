// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <variant>

#include "emit/physics/error.hpp"
#include "emit/protocol/host_frame.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/pose_csv.hpp"
#include "emit/protocol/record/pose_pcap.hpp"

namespace emit::tool {

/// Returns true where the name says that a file holds poses as CSV.
[[nodiscard]] bool is_pose_csv(const std::filesystem::path& file);

/// Host frames of a log in file order. The file is CSV where the name ends in .csv, a network
/// capture where the file starts like one, else MCAP: a log of host frames, or a journal with those
/// that the daemon took. Thread: one owner.
class PoseLog {
 public:
  /// @param host_port  of captures: where the host sent its datagrams to.
  /// Errors: those of the open() of protocol::LogReader, PoseCsvReader and PosePcapReader.
  [[nodiscard]] static physics::Result<PoseLog> open(
      const std::filesystem::path& file, std::uint16_t host_port = protocol::kDefaultHostPort);

  /// Moves to the next host frame; false at the end. Errors: those of the reader; parse (a journal
  /// whose host frame is not valid).
  [[nodiscard]] physics::Result<bool> next();
  [[nodiscard]] const protocol::HostFrameData& host() const noexcept;
  /// Returns notes after the end: frames missing from a log that was cut off, packets of a capture
  /// that were ignored.
  [[nodiscard]] std::optional<std::string> notes() const;

 private:
  using Reader =
      std::variant<protocol::LogReader, protocol::PoseCsvReader, protocol::PosePcapReader>;
  explicit PoseLog(Reader reader)
      : reader_(std::move(reader)), of_journal_(std::make_unique<protocol::HostFrameData>()) {}
  Reader reader_;
  std::unique_ptr<protocol::HostFrameData> of_journal_;  ///< the latest of a journal
  bool in_journal_ = false;                              ///< the latest host frame is of_journal_
};

}  // namespace emit::tool
