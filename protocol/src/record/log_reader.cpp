// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <limits>

#include "emit/physics/check.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/mcap_reader.hpp"
#include "emit/v1/control.pb.h"
#include "quiet_protobuf.hpp"

namespace emit::protocol {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::string_view kHostMessage = "emit.v1.HostFrame";
constexpr std::string_view kJournalMessage = "emit.v1.JournalEntry";

}  // namespace

struct LogReader::Impl {
  Impl(std::filesystem::path file, McapReader reader)
      : path(std::move(file)), mcap(std::move(reader)) {}
  std::filesystem::path path;
  McapReader mcap;
  LogTopic topic = LogTopic::host;
  HostFrameDecoder decoder;
  HostFrameData host;
  v1::JournalEntry journal;

  tl::unexpected<physics::Error> fail(std::string_view text) const {
    return make_error(ErrorCode::parse, fmt::format("{}: offset {}: {}", path.string(),
                                                    mcap.message().file_offset, text));
  }

  /// Checks that topic, encoding and message type agree, before the bytes are decoded.
  Result<void> check_channel(const McapChannel& channel, std::string_view expected) const {
    const McapSchema* schema = mcap.schema(channel.schema_id);
    if (channel.message_encoding != "protobuf" || schema == nullptr || schema->name != expected) {
      return fail(fmt::format("topic '{}' holds {} '{}', not protobuf '{}'", channel.topic,
                              channel.message_encoding, schema != nullptr ? schema->name : "",
                              expected));
    }
    return {};
  }

  Result<void> take_host(const McapMessage& message) {
    const DecodeStatus status = decode_host_frame(message.data, decoder, host);
    if (status == DecodeStatus::ok) return {};
    return fail(fmt::format("host message {} (frame {}): {}", message.sequence, host.frame_number,
                            to_string(status)));
  }

  Result<void> take_journal(const McapMessage& message) {
    if (message.data.size() <= std::numeric_limits<int>::max() &&
        journal.ParseFromArray(message.data.data(), static_cast<int>(message.data.size()))) {
      return {};
    }
    return fail(fmt::format("journal message {}: not a JournalEntry", message.sequence));
  }
};

LogReader::LogReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LogReader::LogReader(LogReader&&) noexcept = default;
LogReader& LogReader::operator=(LogReader&&) noexcept = default;
LogReader::~LogReader() = default;

Result<LogReader> LogReader::open(const std::filesystem::path& path) {
  quiet_protobuf();
  auto mcap = McapReader::open(path);
  if (!mcap) return tl::unexpected(mcap.error());
  return LogReader(std::make_unique<Impl>(path, std::move(*mcap)));
}

Result<bool> LogReader::next() {
  while (true) {
    auto found = impl_->mcap.next();
    if (!found || !*found) return found;
    const McapMessage& message = impl_->mcap.message();
    const McapChannel& channel = *impl_->mcap.channel(message.channel_id);
    const bool is_host = channel.topic == kHostTopic;
    if (!is_host && channel.topic != kJournalTopic) continue;
    impl_->topic = is_host ? LogTopic::host : LogTopic::journal;
    auto taken = impl_->check_channel(channel, is_host ? kHostMessage : kJournalMessage);
    if (taken) taken = is_host ? impl_->take_host(message) : impl_->take_journal(message);
    if (!taken) return tl::unexpected(taken.error());
    return true;
  }
}

LogTopic LogReader::topic() const noexcept {
  return impl_->topic;
}
std::int64_t LogReader::log_time_ns() const noexcept {
  return static_cast<std::int64_t>(impl_->mcap.message().log_time_ns);
}
const HostFrameData& LogReader::host() const noexcept {
  EMIT_CHECK(impl_->topic == LogTopic::host);
  return impl_->host;
}
const v1::JournalEntry& LogReader::journal() const noexcept {
  EMIT_CHECK(impl_->topic == LogTopic::journal);
  return impl_->journal;
}
const std::optional<std::string>& LogReader::truncation() const noexcept {
  return impl_->mcap.truncation();
}

}  // namespace emit::protocol
