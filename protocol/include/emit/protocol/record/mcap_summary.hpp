// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "emit/physics/error.hpp"
#include "emit/protocol/record/mcap_reader.hpp"

namespace emit::protocol {

/// Statistics record of an MCAP file: number of messages and their log times, ns.
struct McapStatistics {
  std::uint64_t messages = 0;
  std::uint64_t first_ns = 0;
  std::uint64_t last_ns = 0;
  std::map<std::uint16_t, std::uint64_t> messages_of_channel;
};

/// Summary at the end of an MCAP file: what its writer wrote on close.
struct McapSummary {
  enum class State : std::uint8_t {
    complete,  ///< footer and summary are there, and the CRC of the summary is right or absent
    none,      ///< the file ends without a footer, as after a crash, or has no summary
    damaged,   ///< `problem` says what is wrong and where; the other members are not complete
  };
  State state = State::none;
  std::string problem{};  ///< file, offset and reason, unless the state is complete

  std::optional<McapStatistics> statistics;
  std::map<std::uint16_t, McapSchema> schemas;
  std::map<std::uint16_t, McapChannel> channels;
  /// Number of chunks in the index, by the name of their compression; "" is none.
  std::map<std::string, std::uint64_t> chunks_of_compression;
};

/// Reads the summary of a file and compares its CRC. It reads compressed files too, because a
/// summary is never compressed. Memory: the summary's schemas and channels, and one record.
/// Errors: not_found, io, parse (no MCAP file). A missing or damaged summary is a state.
/// Thread: any.  Real time: not RT-safe.
[[nodiscard]] physics::Result<McapSummary> read_mcap_summary(const std::filesystem::path& path);

}  // namespace emit::protocol
