// SPDX-License-Identifier: Apache-2.0
#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <string>

#include "emit/protocol/convert.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/mcap_writer.hpp"
#include "emit/protocol/record/message_schema.hpp"
#include "emit/v1/control.pb.h"
#include "emit/v1/frame.pb.h"
#include "emit/v1/host.pb.h"

namespace emit::protocol {
namespace {

using physics::Result;

Result<std::uint16_t> add_topic(McapWriter& mcap, const char* topic,
                                const google::protobuf::Descriptor& message) {
  auto schema = mcap.add_schema(message.full_name(), "protobuf", file_descriptor_set(message));
  if (!schema) return schema;
  return mcap.add_channel(*schema, topic, "protobuf");
}

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

}  // namespace

struct LogWriter::Impl {
  explicit Impl(McapWriter writer) : mcap(std::move(writer)) {}
  McapWriter mcap;
  std::uint16_t host_channel = 0;
  std::uint16_t journal_channel = 0;
  std::uint16_t frame_channel = 0;  // 0: the log has no such topic
  std::uint32_t host_sequence = 0;
  std::uint32_t journal_sequence = 0;
  std::uint32_t frame_sequence = 0;
  HostFrameEncoder encoder;
  std::string encoded;
};

LogWriter::LogWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
LogWriter::LogWriter(LogWriter&&) noexcept = default;
LogWriter& LogWriter::operator=(LogWriter&&) noexcept = default;
LogWriter::~LogWriter() = default;

Result<LogWriter> LogWriter::create(const std::filesystem::path& path,
                                    const LogWriterOptions& options, std::error_code* cause) {
  McapWriterOptions mcap_options;
  if (!options.software.empty()) mcap_options.library = options.software;
  mcap_options.chunk_bytes = options.chunk_bytes;
  mcap_options.flush_interval_ns = options.flush_interval_ns;
  auto mcap = McapWriter::create(path, mcap_options, cause);
  if (!mcap) return tl::unexpected(mcap.error());
  auto impl = std::make_unique<Impl>(std::move(*mcap));
  const auto failed = [&](const physics::Error& error) {
    if (cause != nullptr) *cause = impl->mcap.failure_cause();
    return tl::unexpected(error);
  };
  auto host = add_topic(impl->mcap, kHostTopic, *v1::HostFrame::descriptor());
  if (!host) return failed(host.error());
  auto journal = add_topic(impl->mcap, kJournalTopic, *v1::JournalEntry::descriptor());
  if (!journal) return failed(journal.error());
  impl->host_channel = *host;
  impl->journal_channel = *journal;
  if (options.frames) {
    auto frames = add_topic(impl->mcap, kFrameTopic, *v1::RecordedFrame::descriptor());
    if (!frames) return failed(frames.error());
    impl->frame_channel = *frames;
  }
  return LogWriter(std::move(impl));
}

Result<void> LogWriter::write_host(const HostFrameData& frame, std::int64_t log_time_ns) {
  // MCAP has no negative times. The message itself keeps the exact time.
  return impl_->mcap.write(impl_->host_channel, ++impl_->host_sequence, log_time_ns,
                           std::max<std::int64_t>(frame.sim_time_ns, 0),
                           impl_->encoder.encode(frame));
}

Result<void> LogWriter::write_host(const v1::HostFrame& frame, std::int64_t log_time_ns) {
  frame.SerializeToString(&impl_->encoded);
  return impl_->mcap.write(impl_->host_channel, ++impl_->host_sequence, log_time_ns,
                           std::max<std::int64_t>(frame.sim_time_ns(), 0),
                           bytes_of(impl_->encoded));
}

Result<void> LogWriter::write_journal(const v1::JournalEntry& entry) {
  entry.SerializeToString(&impl_->encoded);
  return write_journal(bytes_of(impl_->encoded), entry.wall_time_ns());
}

Result<void> LogWriter::write_journal(std::span<const std::byte> encoded_entry,
                                      std::int64_t log_time_ns) {
  return impl_->mcap.write(impl_->journal_channel, ++impl_->journal_sequence, log_time_ns,
                           log_time_ns, encoded_entry);
}

Result<void> LogWriter::write_frame(const v1::RecordedFrame& frame, std::int64_t log_time_ns) {
  frame.SerializeToString(&impl_->encoded);
  return impl_->mcap.write(impl_->frame_channel, ++impl_->frame_sequence, log_time_ns,
                           std::max<std::int64_t>(frame.sim_time_ns(), 0),
                           bytes_of(impl_->encoded));
}

std::uint64_t LogWriter::messages_in_file() const noexcept {
  return impl_->mcap.messages_in_file();
}

Result<void> LogWriter::flush() {
  return impl_->mcap.flush();
}

Result<void> LogWriter::close() {
  return impl_->mcap.close();
}

}  // namespace emit::protocol
