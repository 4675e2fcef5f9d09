// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/mcap_writer.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <map>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "crc.hpp"
#include "mcap_format.hpp"
#include "spill_file.hpp"

namespace emit::protocol {
namespace {

using mcap::Opcode;
using mcap::Output;
using physics::Error;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

struct IndexEntry {
  std::uint64_t log_time_ns;
  std::uint64_t offset;  // offset within the chunk's records
};

}  // namespace

struct McapWriter::Impl {
  std::filesystem::path path;
  McapWriterOptions options;
  int fd = -1;
  std::uint64_t file_bytes = 0;
  bool closed = false;
  bool removable = false;  // this writer made or truncated it: nothing else is lost with it
  std::optional<Error> failure;
  std::error_code cause;  // the system's reason, where `failure` has one

  Output schemas;  // records as written, repeated in the summary
  Output channels;
  std::uint16_t schema_count = 0;
  std::uint16_t channel_count = 0;

  Output chunk;  // records of the chunk in work
  std::map<std::uint16_t, std::vector<IndexEntry>> chunk_index;
  std::uint64_t chunk_first_ns = 0;  // log time of the chunk's first message
  std::uint64_t chunk_start_ns = 0;
  std::uint64_t chunk_end_ns = 0;
  std::uint32_t chunk_count = 0;
  SpillFile chunk_indexes;  // chunk index records for the summary, written with their chunks

  std::uint64_t message_count = 0;
  std::uint64_t messages_in_file = 0;  // messages that the kernel has taken whole
  std::uint64_t start_ns = 0;
  std::uint64_t end_ns = 0;
  std::map<std::uint16_t, std::uint64_t> channel_messages;
  Output scratch;
  Output summary_scratch;

  Impl(std::filesystem::path file, McapWriterOptions settings)
      : path(std::move(file)), options(std::move(settings)) {}
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
  ~Impl() {
    if (failure && removable && messages_in_file == 0) remove_own_file();
    if (fd >= 0) ::close(fd);
  }

  /// Removes the file, unless somebody has put another one in its place.
  void remove_own_file() const noexcept {
    struct stat own {};
    struct stat there {};
    if (::fstat(fd, &own) == 0 && ::lstat(path.c_str(), &there) == 0 &&
        own.st_dev == there.st_dev && own.st_ino == there.st_ino) {
      ::unlink(path.c_str());
    }
  }

  Result<void> put(std::span<const std::byte> bytes) {
    while (!bytes.empty()) {
      const ssize_t written = ::write(fd, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) {
        const int error = written < 0 ? errno : EIO;
        cause = std::error_code(error, std::generic_category());
        failure =
            Error{ErrorCode::io, fmt::format("{}: offset {}: cannot write: {}", path.string(),
                                             file_bytes, std::generic_category().message(error))};
        return tl::unexpected(*failure);
      }
      file_bytes += static_cast<std::uint64_t>(written);
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    }
    return {};
  }

  Result<void> check_usable() const {
    if (failure) return tl::unexpected(*failure);
    if (closed) {
      return make_error(ErrorCode::invalid_argument, path.string() + ": the log is closed");
    }
    return {};
  }

  static void append_message(Output& out, std::uint16_t channel_id, std::uint32_t sequence,
                             std::uint64_t log_time_ns, std::uint64_t publish_time_ns,
                             std::span<const std::byte> data) {
    const auto record = out.begin_record(Opcode::message);
    out.number(channel_id);
    out.number(sequence);
    out.number(log_time_ns);
    out.number(publish_time_ns);
    out.raw(data);
    out.end_record(record);
  }

  Result<void> flush_chunk() {
    if (chunk.size() == 0) return {};
    const std::uint64_t chunk_at = file_bytes;
    const std::uint64_t data_bytes = chunk.size();

    scratch.clear();
    const auto record = scratch.begin_record(Opcode::chunk);
    scratch.number(chunk_start_ns);
    scratch.number(chunk_end_ns);
    scratch.number(std::uint64_t{chunk.size()});
    scratch.number(crc32(chunk.bytes()));
    scratch.string("");  // not compressed
    scratch.number(std::uint64_t{chunk.size()});
    scratch.raw(chunk.bytes());
    scratch.end_record(record);
    const std::uint64_t record_bytes = scratch.size();

    Output& index_record = summary_scratch;
    index_record.clear();
    const auto summary = index_record.begin_record(Opcode::chunk_index);
    index_record.number(chunk_start_ns);
    index_record.number(chunk_end_ns);
    index_record.number(chunk_at);
    index_record.number(record_bytes);
    const auto offsets = index_record.begin_block<std::uint32_t>();
    for (auto& [channel_id, entries] : chunk_index) {
      std::ranges::stable_sort(entries, {}, &IndexEntry::log_time_ns);
      index_record.number(channel_id);
      index_record.number(chunk_at + scratch.size());
      const auto index = scratch.begin_record(Opcode::message_index);
      scratch.number(channel_id);
      const auto array = scratch.begin_block<std::uint32_t>();
      for (const IndexEntry& entry : entries) {
        scratch.number(entry.log_time_ns);
        scratch.number(entry.offset);
      }
      scratch.end_block<std::uint32_t>(array);
      scratch.end_record(index);
    }
    index_record.end_block<std::uint32_t>(offsets);
    index_record.number(scratch.size() - record_bytes);
    index_record.string("");
    index_record.number(data_bytes);
    index_record.number(data_bytes);
    index_record.end_record(summary);
    chunk.clear();
    chunk_index.clear();
    const auto written = put(scratch.bytes());
    // A disk that fills up may take the chunk and not all of its index. A reader then has the
    // messages.
    if (file_bytes - chunk_at >= record_bytes) messages_in_file = message_count;
    if (!written) return written;
    ++chunk_count;
    auto kept = chunk_indexes.append(index_record.bytes());
    if (!kept) failure = kept.error();
    return kept;
  }

  void append_statistics(Output& out) const {
    const auto record = out.begin_record(Opcode::statistics);
    out.number(message_count);
    out.number(schema_count);
    out.number(std::uint32_t{channel_count});
    out.number(std::uint32_t{0});  // attachments
    out.number(std::uint32_t{0});  // metadata
    out.number(chunk_count);
    out.number(start_ns);
    out.number(end_ns);
    const auto map = out.begin_block<std::uint32_t>();
    for (const auto& [channel_id, count] : channel_messages) {
      out.number(channel_id);
      out.number(count);
    }
    out.end_block<std::uint32_t>(map);
    out.end_record(record);
  }

  /// Writes the end of the file: data end, summary, summary offsets and footer. The footer holds
  /// the CRC of the summary section.
  Result<void> write_end() {
    Output out;
    const auto data_end = out.begin_record(Opcode::data_end);
    out.number(std::uint32_t{0});  // no CRC here: the chunks carry theirs
    out.end_record(data_end);
    if (auto written = put(out.bytes()); !written) return written;
    out.clear();

    const std::uint64_t summary_at = file_bytes;
    struct Group {
      Opcode opcode;
      std::uint64_t begin;
      std::uint64_t bytes;
    };
    std::vector<Group> groups;
    auto group = [&](Opcode opcode, auto append) {
      const std::size_t begin = out.size();
      append();
      if (out.size() != begin) groups.push_back({opcode, file_bytes + begin, out.size() - begin});
    };
    group(Opcode::schema, [&] { out.raw(schemas.bytes()); });
    group(Opcode::channel, [&] { out.raw(channels.bytes()); });
    group(Opcode::statistics, [&] { append_statistics(out); });
    std::uint32_t crc = crc32(out.bytes());
    if (auto written = put(out.bytes()); !written) return written;
    out.clear();
    if (chunk_indexes.size() != 0) {
      groups.push_back({Opcode::chunk_index, file_bytes, chunk_indexes.size()});
      if (auto copied = copy_chunk_indexes(crc); !copied) return copied;
    }

    const std::uint64_t offsets_at = file_bytes;
    for (const Group& entry : groups) {
      const auto record = out.begin_record(Opcode::summary_offset);
      out.number(static_cast<std::uint8_t>(entry.opcode));
      out.number(entry.begin);
      out.number(entry.bytes);
      out.end_record(record);
    }
    // The footer's length is fixed, so that the CRC can cover its first fields.
    out.number(static_cast<std::uint8_t>(Opcode::footer));
    out.number(std::uint64_t{20});
    out.number(summary_at);
    out.number(offsets_at);
    out.number(crc32(out.bytes(), crc));
    out.raw(mcap::kMagic);
    return put(out.bytes());
  }

  Result<void> copy_chunk_indexes(std::uint32_t& crc) {
    std::vector<std::byte> block(SpillFile::kBlockBytes);
    for (std::uint64_t at = 0; at < chunk_indexes.size();) {
      const auto count = chunk_indexes.read(at, block);
      if (!count) {
        failure = count.error();
        return tl::unexpected(*failure);
      }
      const auto piece = std::span(block).first(*count);
      crc = crc32(piece, crc);
      if (auto written = put(piece); !written) return written;
      at += *count;
    }
    return {};
  }
};

McapWriter::McapWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
McapWriter::McapWriter(McapWriter&&) noexcept = default;
McapWriter& McapWriter::operator=(McapWriter&& other) noexcept {
  std::swap(impl_, other.impl_);  // the destructor of `other` closes the old file
  return *this;
}
McapWriter::~McapWriter() {
  if (impl_ && !impl_->closed && !impl_->failure) static_cast<void>(close());
}

Result<McapWriter> McapWriter::create(const std::filesystem::path& path,
                                      const McapWriterOptions& options, std::error_code* cause) {
  const auto note = [cause](const std::error_code& error) {
    if (cause != nullptr) *cause = error;
  };
  note({});
  auto impl = std::make_unique<Impl>(path, options);
  // Open the index first: a failure here leaves an older log unchanged.
  if (auto opened = impl->chunk_indexes.open(path); !opened) {
    note(impl->chunk_indexes.cause());
    return tl::unexpected(opened.error());
  }
  constexpr int kFlags = O_WRONLY | O_CREAT | O_CLOEXEC;
  impl->fd = ::open(path.c_str(), kFlags | O_EXCL, 0644);
  impl->removable = impl->fd >= 0;
  if (impl->fd < 0 && errno == EEXIST) impl->fd = ::open(path.c_str(), kFlags, 0644);
  if (impl->fd < 0) {
    const std::error_code error(errno, std::generic_category());
    note(error);
    return make_error(ErrorCode::io,
                      fmt::format("{}: cannot create: {}", path.string(), error.message()));
  }
  struct stat status {};
  const bool regular = ::fstat(impl->fd, &status) == 0 && S_ISREG(status.st_mode);
  // Refuse a second writer, because two writers would make one unreadable log. (Pipes and /dev/null
  // may have any number.).
  if (regular && ::flock(impl->fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    return make_error(ErrorCode::io, path.string() + ": another process writes it");
  }
  if (regular && status.st_size > 0) {
    if (::ftruncate(impl->fd, 0) != 0) {
      return make_error(ErrorCode::io, fmt::format("{}: cannot be written over: {}", path.string(),
                                                   std::generic_category().message(errno)));
    }
    impl->removable = true;
  }
  Output out;
  out.raw(mcap::kMagic);
  const auto record = out.begin_record(Opcode::header);
  out.string(options.profile);
  out.string(options.library);
  out.end_record(record);
  if (auto written = impl->put(out.bytes()); !written) {
    note(impl->cause);
    return tl::unexpected(written.error());
  }
  return McapWriter(std::move(impl));
}

Result<std::uint16_t> McapWriter::add_schema(std::string_view name, std::string_view encoding,
                                             std::string_view data) {
  if (auto usable = impl_->check_usable(); !usable) return tl::unexpected(usable.error());
  if (auto flushed = impl_->flush_chunk(); !flushed) return tl::unexpected(flushed.error());
  const auto id = ++impl_->schema_count;
  Output out;
  const auto record = out.begin_record(Opcode::schema);
  out.number(id);
  out.string(name);
  out.string(encoding);
  out.string(data);
  out.end_record(record);
  impl_->schemas.raw(out.bytes());
  if (auto written = impl_->put(out.bytes()); !written) return tl::unexpected(written.error());
  return id;
}

Result<std::uint16_t> McapWriter::add_channel(std::uint16_t schema_id, std::string_view topic,
                                              std::string_view message_encoding) {
  if (auto usable = impl_->check_usable(); !usable) return tl::unexpected(usable.error());
  if (schema_id > impl_->schema_count) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{}: no schema {}", impl_->path.string(), schema_id));
  }
  if (auto flushed = impl_->flush_chunk(); !flushed) return tl::unexpected(flushed.error());
  const auto id = ++impl_->channel_count;
  Output out;
  const auto record = out.begin_record(Opcode::channel);
  out.number(id);
  out.number(schema_id);
  out.string(topic);
  out.string(message_encoding);
  out.number(std::uint32_t{0});  // no metadata
  out.end_record(record);
  impl_->channels.raw(out.bytes());
  if (auto written = impl_->put(out.bytes()); !written) return tl::unexpected(written.error());
  return id;
}

Result<void> McapWriter::write(std::uint16_t channel_id, std::uint32_t sequence,
                               std::int64_t log_time_ns, std::int64_t publish_time_ns,
                               std::span<const std::byte> data) {
  Impl& self = *impl_;
  if (auto usable = self.check_usable(); !usable) return usable;
  if (channel_id == 0 || channel_id > self.channel_count) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{}: no channel {}", self.path.string(), channel_id));
  }
  if (log_time_ns < 0 || publish_time_ns < 0) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{}: channel {} message {}: negative time", self.path.string(),
                                  channel_id, sequence));
  }
  const auto log_ns = static_cast<std::uint64_t>(log_time_ns);
  const auto publish_ns = static_cast<std::uint64_t>(publish_time_ns);
  const bool first_ever = self.message_count++ == 0;
  self.start_ns = first_ever ? log_ns : std::min(self.start_ns, log_ns);
  self.end_ns = std::max(self.end_ns, log_ns);
  ++self.channel_messages[channel_id];

  if (self.options.chunk_bytes == 0) {
    self.scratch.clear();
    Impl::append_message(self.scratch, channel_id, sequence, log_ns, publish_ns, data);
    auto written = self.put(self.scratch.bytes());
    if (written) self.messages_in_file = self.message_count;
    return written;
  }
  if (self.chunk.size() == 0) {
    self.chunk_first_ns = self.chunk_start_ns = self.chunk_end_ns = log_ns;
  }
  self.chunk_index[channel_id].push_back({log_ns, self.chunk.size()});
  Impl::append_message(self.chunk, channel_id, sequence, log_ns, publish_ns, data);
  self.chunk_start_ns = std::min(self.chunk_start_ns, log_ns);
  self.chunk_end_ns = std::max(self.chunk_end_ns, log_ns);
  const bool full = self.chunk.size() >= self.options.chunk_bytes;
  const bool due =
      log_ns >= self.chunk_first_ns &&
      log_ns - self.chunk_first_ns >=
          static_cast<std::uint64_t>(std::max<std::int64_t>(self.options.flush_interval_ns, 0));
  if (full || due) return self.flush_chunk();
  return {};
}

std::error_code McapWriter::failure_cause() const noexcept {
  return impl_->cause;
}

std::uint64_t McapWriter::messages_in_file() const noexcept {
  return impl_->messages_in_file;
}

Result<void> McapWriter::flush() {
  if (auto usable = impl_->check_usable(); !usable) return usable;
  return impl_->flush_chunk();
}

Result<void> McapWriter::close() {
  if (impl_->closed) return {};
  if (auto usable = impl_->check_usable(); !usable) return usable;
  if (auto flushed = impl_->flush_chunk(); !flushed) return flushed;
  if (auto ended = impl_->write_end(); !ended) return ended;
  impl_->closed = true;
  const int failed = ::close(std::exchange(impl_->fd, -1));
  if (failed != 0) {
    impl_->failure = Error{ErrorCode::io, fmt::format("{}: cannot close: {}", impl_->path.string(),
                                                      std::generic_category().message(errno))};
    return tl::unexpected(*impl_->failure);
  }
  return {};
}

}  // namespace emit::protocol
