// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <string_view>

#include "emit/protocol/codec.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/mcap_reader.hpp"
#include "emit/v1/control.pb.h"

namespace emit::protocol {

/// Decodes the messages of the two topics of emitd's logs, as an McapReader hands them out.
/// Thread: one owner.  Real time: not RT-safe.
class LogMessageDecoder {
 public:
  /// Switches off Protobuf's messages on standard error, see quiet_protobuf().
  LogMessageDecoder();

  /// Decodes the message that next() of the reader moved to. The result is empty for a message of
  /// another topic. Errors (parse) name file and offset: topic, encoding and message type do not
  /// agree, or the bytes are no such message.
  [[nodiscard]] physics::Result<std::optional<LogTopic>> decode(const McapReader& from);
  /// Return the message that decode() said it found.
  [[nodiscard]] const HostFrameData& host() const noexcept { return host_; }
  [[nodiscard]] const v1::JournalEntry& journal() const noexcept { return journal_; }

 private:
  [[nodiscard]] physics::Result<void> take_host(const McapReader& from);
  [[nodiscard]] physics::Result<void> take_journal(const McapReader& from);

  std::optional<HostFrameDecoder> decoder_;  ///< made for the first host frame: it is large
  HostFrameData host_;
  v1::JournalEntry journal_;
};

/// Returns the topic of a channel; empty for a channel of somebody else.
[[nodiscard]] std::optional<LogTopic> log_topic_of(const McapChannel& channel) noexcept;

}  // namespace emit::protocol
