// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <variant>

#include "emit/physics/error.hpp"
#include "emit/protocol/host_frame.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/pose_csv.hpp"

namespace emit::cli {

/// Host frames of a log in file order: MCAP, or CSV where the name ends in .csv. One owner.
class PoseLog {
 public:
  /// Errors: those of protocol::LogReader::open and protocol::PoseCsvReader::open.
  [[nodiscard]] static physics::Result<PoseLog> open(const std::filesystem::path& file);

  /// Moves to the next host frame; false at the end. Errors: those of the reader.
  [[nodiscard]] physics::Result<bool> next();
  [[nodiscard]] const protocol::HostFrameData& host() const noexcept;
  /// What is missing at the end of a log that was cut off.
  [[nodiscard]] std::optional<std::string> truncation() const;

 private:
  using Reader = std::variant<protocol::LogReader, protocol::PoseCsvReader>;
  explicit PoseLog(Reader reader) : reader_(std::move(reader)) {}
  Reader reader_;
};

}  // namespace emit::cli
