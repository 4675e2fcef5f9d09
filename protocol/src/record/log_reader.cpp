// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/check.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/mcap_reader.hpp"
#include "record/log_message.hpp"

namespace emit::protocol {

using physics::Result;

struct LogReader::Impl {
  explicit Impl(McapReader reader) : mcap(std::move(reader)) {}
  McapReader mcap;
  LogTopic topic = LogTopic::host;
  LogMessageDecoder message;
};

LogReader::LogReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LogReader::LogReader(LogReader&&) noexcept = default;
LogReader& LogReader::operator=(LogReader&&) noexcept = default;
LogReader::~LogReader() = default;

Result<LogReader> LogReader::open(const std::filesystem::path& path) {
  auto mcap = McapReader::open(path);
  if (!mcap) return tl::unexpected(mcap.error());
  return LogReader(std::make_unique<Impl>(std::move(*mcap)));
}

Result<bool> LogReader::next() {
  while (true) {
    auto found = impl_->mcap.next();
    if (!found || !*found) return found;
    const auto topic = impl_->message.decode(impl_->mcap);
    if (!topic) return tl::unexpected(topic.error());
    if (!*topic) continue;
    impl_->topic = **topic;
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
  return impl_->message.host();
}
const v1::JournalEntry& LogReader::journal() const noexcept {
  EMIT_CHECK(impl_->topic == LogTopic::journal);
  return impl_->message.journal();
}
const std::optional<std::string>& LogReader::truncation() const noexcept {
  return impl_->mcap.truncation();
}

}  // namespace emit::protocol
