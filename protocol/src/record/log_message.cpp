// SPDX-License-Identifier: Apache-2.0
#include "record/log_message.hpp"

#include <fmt/format.h>

#include <limits>

#include "quiet_protobuf.hpp"

namespace emit::protocol {
namespace {

using physics::ErrorCode;
using physics::Result;

constexpr std::string_view kHostMessage = "emit.v1.HostFrame";
constexpr std::string_view kJournalMessage = "emit.v1.JournalEntry";

tl::unexpected<physics::Error> bad_message(const McapReader& from, std::string_view text) {
  return physics::make_error(
      ErrorCode::parse,
      fmt::format("{}: offset {}: {}", from.path().string(), from.message().file_offset, text));
}

/// Checks that topic, encoding and message type agree, before the bytes are decoded.
Result<void> check_channel(const McapReader& from, const McapChannel& channel,
                           std::string_view expected) {
  const McapSchema* schema = from.schema(channel.schema_id);
  if (channel.message_encoding != "protobuf" || schema == nullptr || schema->name != expected) {
    return bad_message(from, fmt::format("topic '{}' holds {} '{}', not protobuf '{}'",
                                         channel.topic, channel.message_encoding,
                                         schema != nullptr ? schema->name : "", expected));
  }
  return {};
}

}  // namespace

std::optional<LogTopic> log_topic_of(const McapChannel& channel) noexcept {
  if (channel.topic == kHostTopic) return LogTopic::host;
  if (channel.topic == kJournalTopic) return LogTopic::journal;
  return std::nullopt;
}

LogMessageDecoder::LogMessageDecoder() {
  quiet_protobuf();
}

Result<std::optional<LogTopic>> LogMessageDecoder::decode(const McapReader& from) {
  const McapChannel& channel = *from.channel(from.message().channel_id);
  const std::optional<LogTopic> topic = log_topic_of(channel);
  if (!topic) return topic;
  const bool is_host = *topic == LogTopic::host;
  auto taken = check_channel(from, channel, is_host ? kHostMessage : kJournalMessage);
  if (taken) taken = is_host ? take_host(from) : take_journal(from);
  if (!taken) return tl::unexpected(taken.error());
  return topic;
}

Result<void> LogMessageDecoder::take_host(const McapReader& from) {
  const McapMessage& message = from.message();
  if (!decoder_) decoder_.emplace();
  const DecodeStatus status = decode_host_frame(message.data, *decoder_, host_);
  if (status == DecodeStatus::ok) return {};
  return bad_message(from, fmt::format("host message {} (frame {}): {}", message.sequence,
                                       host_.frame_number, to_string(status)));
}

Result<void> LogMessageDecoder::take_journal(const McapReader& from) {
  const McapMessage& message = from.message();
  if (message.data.size() <= std::numeric_limits<int>::max() &&
      journal_.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
    return {};
  }
  return bad_message(from, fmt::format("journal message {}: not a JournalEntry", message.sequence));
}

}  // namespace emit::protocol
