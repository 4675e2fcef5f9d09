// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/mcap_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <utility>
#include <vector>

#include "crc.hpp"
#include "mcap_format.hpp"

namespace emit::protocol {
namespace {

using mcap::Input;
using mcap::Opcode;
using physics::Error;
using physics::ErrorCode;
using physics::Result;

/// Largest record, bytes. A larger one is refused rather than read into memory.
constexpr std::uint64_t kMaxRecordBytes = std::uint64_t{1} << 30;

/// One record of the file or of a chunk.
struct RecordView {
  Opcode opcode{};
  std::span<const std::byte> content;
};

}  // namespace

struct McapReader::Impl {
  std::filesystem::path path;
  std::ifstream file;
  McapFacts facts;
  std::uint64_t offset = 0;  // offset of the next record in the file
  bool has_end_magic = false;
  bool ended = false;
  std::uint64_t message_count = 0;
  std::optional<Error> failure;
  std::optional<std::string> truncation;

  std::vector<std::byte> record;  // content of the record at record_offset
  std::uint64_t record_offset = 0;
  std::span<const std::byte> chunk_rest;
  std::map<std::uint16_t, McapSchema> schemas;
  std::map<std::uint16_t, McapChannel> channels;
  McapMessage message;

  tl::unexpected<Error> fail(ErrorCode code, std::uint64_t at, std::string_view text) {
    failure = Error{code, fmt::format("{}: offset {}: {}", path.string(), at, text)};
    return tl::unexpected(*failure);
  }

  bool read_at(std::uint64_t at, std::span<std::byte> out) {
    file.clear();
    file.seekg(static_cast<std::streamoff>(at));
    file.read(reinterpret_cast<char*>(out.data()), static_cast<std::streamsize>(out.size()));
    return static_cast<std::size_t>(file.gcount()) == out.size();
  }

  /// Ends the reading where the file ends although its writer had not finished it.
  void end_truncated(std::string_view what) {
    ended = true;
    truncation = fmt::format("{}: offset {}: {} after {} messages; the last {} bytes are not used",
                             path.string(), offset, what, message_count, facts.file_bytes - offset);
  }

  /// Reads the next record of the file. Returns no value at the end.
  Result<std::optional<RecordView>> next_record() {
    const std::uint64_t left = facts.file_bytes - offset;
    if (left < mcap::kRecordPrefixBytes) {
      end_truncated(left == 0 ? "the file ends without a footer" : "the file ends within a record");
      return std::nullopt;
    }
    std::array<std::byte, mcap::kRecordPrefixBytes> prefix{};
    if (!read_at(offset, prefix)) return fail(ErrorCode::io, offset, "cannot read");
    Input fields(prefix);
    const auto opcode = fields.number<std::uint8_t>();
    const auto length = fields.number<std::uint64_t>();
    if (opcode == 0) return fail(ErrorCode::parse, offset, "opcode 0 is not valid");
    if (length > left - mcap::kRecordPrefixBytes) {
      // A file that was closed ends with the magic bytes. In such a file the length is wrong, not
      // the end.
      if (has_end_magic) {
        return fail(ErrorCode::parse, offset,
                    fmt::format("record of {} bytes reaches beyond the end of the file", length));
      }
      end_truncated("the file ends within a record");
      return std::nullopt;
    }
    if (length > kMaxRecordBytes) {
      return fail(ErrorCode::unsupported, offset, fmt::format("record of {} bytes", length));
    }
    record.resize(static_cast<std::size_t>(length));
    if (!read_at(offset + mcap::kRecordPrefixBytes, record)) {
      return fail(ErrorCode::io, offset, "cannot read");
    }
    record_offset = offset;
    offset += mcap::kRecordPrefixBytes + length;
    return RecordView{static_cast<Opcode>(opcode), record};
  }

  /// Takes the next record off the chunk. The chunk is one record of the file, so a record that
  /// does not fit into it is wrong.
  Result<RecordView> next_in_chunk() {
    Input fields(chunk_rest);
    const auto opcode = fields.number<std::uint8_t>();
    const auto content = fields.raw(fields.number<std::uint64_t>());
    if (!fields.ok()) {
      return fail(ErrorCode::parse, record_offset, "record reaches beyond its chunk");
    }
    chunk_rest = fields.rest();
    return RecordView{static_cast<Opcode>(opcode), content};
  }

  Result<void> open_chunk(std::span<const std::byte> content) {
    Input fields(content);
    static_cast<void>(fields.number<std::uint64_t>());  // start time
    static_cast<void>(fields.number<std::uint64_t>());  // end time
    const auto uncompressed_bytes = fields.number<std::uint64_t>();
    const auto crc = fields.number<std::uint32_t>();
    const std::string compression = fields.string();
    const auto records = fields.raw(fields.number<std::uint64_t>());
    if (!fields.ok()) return fail(ErrorCode::parse, record_offset, "malformed chunk");
    if (!compression.empty()) {
      return fail(
          ErrorCode::unsupported, record_offset,
          fmt::format("chunk compressed with '{}'; only uncompressed ones are read", compression));
    }
    if (uncompressed_bytes != records.size()) {
      return fail(
          ErrorCode::parse, record_offset,
          fmt::format("chunk of {} bytes announces {}", records.size(), uncompressed_bytes));
    }
    if (const std::uint32_t computed = crc32(records); crc != 0 && crc != computed) {
      return fail(ErrorCode::parse, record_offset,
                  fmt::format("chunk CRC {:#010x}, computed {:#010x}", crc, computed));
    }
    chunk_rest = records;
    ++facts.chunks;
    return {};
  }

  /// Takes the header. Its strings are for people only, so that a damaged one is no error.
  void take_header(std::span<const std::byte> content) {
    Input fields(content);
    facts.profile = fields.string();
    facts.library = fields.string();
  }

  Result<void> take_schema(std::span<const std::byte> content) {
    Input fields(content);
    const auto id = fields.number<std::uint16_t>();
    McapSchema schema{fields.string(), fields.string(), fields.string()};
    if (!fields.ok() || id == 0) return fail(ErrorCode::parse, record_offset, "malformed schema");
    const auto [place, fresh] = schemas.try_emplace(id, schema);
    if (!fresh && (place->second.name != schema.name || place->second.data != schema.data)) {
      return fail(ErrorCode::parse, record_offset, fmt::format("schema {} changes", id));
    }
    return {};
  }

  Result<void> take_channel(std::span<const std::byte> content) {
    Input fields(content);
    const auto id = fields.number<std::uint16_t>();
    McapChannel channel;
    channel.schema_id = fields.number<std::uint16_t>();
    channel.topic = fields.string();
    channel.message_encoding = fields.string();
    if (!fields.ok()) return fail(ErrorCode::parse, record_offset, "malformed channel");
    const auto [place, fresh] = channels.try_emplace(id, channel);
    if (!fresh &&
        (place->second.topic != channel.topic || place->second.schema_id != channel.schema_id)) {
      return fail(ErrorCode::parse, record_offset, fmt::format("channel {} changes", id));
    }
    return {};
  }

  Result<void> take_message(std::span<const std::byte> content) {
    Input fields(content);
    message.channel_id = fields.number<std::uint16_t>();
    message.sequence = fields.number<std::uint32_t>();
    message.log_time_ns = fields.number<std::uint64_t>();
    message.publish_time_ns = fields.number<std::uint64_t>();
    if (!fields.ok()) return fail(ErrorCode::parse, record_offset, "malformed message");
    if (!channels.contains(message.channel_id)) {
      return fail(ErrorCode::parse, record_offset,
                  fmt::format("message of unknown channel {}", message.channel_id));
    }
    message.data = fields.rest();
    message.file_offset = record_offset;
    ++message_count;
    return {};
  }

  /// Processes a record. Returns true when `message` is the next message, and false when the record
  /// was something else.
  Result<bool> take(const RecordView& view, bool in_chunk) {
    Result<void> taken;
    switch (view.opcode) {
      case Opcode::message:
        taken = take_message(view.content);
        if (!taken) return tl::unexpected(taken.error());
        return true;
      case Opcode::schema:
        taken = take_schema(view.content);
        break;
      case Opcode::channel:
        taken = take_channel(view.content);
        break;
      case Opcode::header:
        take_header(view.content);
        break;
      case Opcode::attachment:
        ++facts.attachments;
        break;
      case Opcode::metadata:
        ++facts.metadata;
        break;
      case Opcode::chunk:
        if (in_chunk) return fail(ErrorCode::parse, record_offset, "chunk within a chunk");
        taken = open_chunk(view.content);
        break;
      case Opcode::data_end:
      case Opcode::footer:
        if (in_chunk) return fail(ErrorCode::parse, record_offset, "end of data within a chunk");
        return finish();
      default:
        break;  // index or a future opcode: skipped
    }
    if (!taken) return tl::unexpected(taken.error());
    return false;
  }

  /// Ends the data section. The rest of the file repeats it, so only the end magic is checked.
  Result<bool> finish() {
    ended = true;
    if (!has_end_magic) end_truncated("the file ends within its summary");
    return false;
  }
};

McapReader::McapReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
McapReader::McapReader(McapReader&&) noexcept = default;
McapReader& McapReader::operator=(McapReader&&) noexcept = default;
McapReader::~McapReader() = default;

Result<McapReader> McapReader::open(const std::filesystem::path& path) {
  auto impl = std::make_unique<Impl>();
  impl->path = path;
  std::error_code code;
  const auto status = std::filesystem::status(path, code);
  if (!std::filesystem::exists(status)) {
    return physics::make_error(ErrorCode::not_found, path.string() + ": no such file");
  }
  if (std::filesystem::is_directory(status)) {
    return physics::make_error(ErrorCode::io, path.string() + ": is a directory");
  }
  impl->file.open(path, std::ios::binary);
  impl->facts.file_bytes = std::filesystem::file_size(path, code);
  if (!impl->file || code) {
    return physics::make_error(ErrorCode::io, path.string() + ": cannot open");
  }
  std::array<std::byte, mcap::kMagic.size()> magic{};
  if (impl->facts.file_bytes < magic.size() || !impl->read_at(0, magic) || magic != mcap::kMagic) {
    return physics::make_error(ErrorCode::parse,
                               path.string() + ": offset 0: not an MCAP file (wrong magic)");
  }
  impl->offset = magic.size();
  if (impl->facts.file_bytes >= 2 * magic.size() &&
      impl->read_at(impl->facts.file_bytes - magic.size(), magic)) {
    impl->has_end_magic = magic == mcap::kMagic;
  }
  return McapReader(std::move(impl));
}

Result<bool> McapReader::next() {
  Impl& self = *impl_;
  if (self.failure) return tl::unexpected(*self.failure);
  while (!self.ended) {
    const bool in_chunk = !self.chunk_rest.empty();
    RecordView view;
    if (in_chunk) {
      auto record = self.next_in_chunk();
      if (!record) return tl::unexpected(record.error());
      view = *record;
    } else {
      auto record = self.next_record();
      if (!record) return tl::unexpected(record.error());
      if (!*record) return false;
      view = **record;
    }
    auto is_message = self.take(view, in_chunk);
    if (!is_message || *is_message) return is_message;
  }
  return false;
}

const McapMessage& McapReader::message() const noexcept {
  return impl_->message;
}

const McapChannel* McapReader::channel(std::uint16_t id) const noexcept {
  const auto found = impl_->channels.find(id);
  return found == impl_->channels.end() ? nullptr : &found->second;
}

const McapSchema* McapReader::schema(std::uint16_t id) const noexcept {
  const auto found = impl_->schemas.find(id);
  return found == impl_->schemas.end() ? nullptr : &found->second;
}

const std::map<std::uint16_t, McapChannel>& McapReader::channels() const noexcept {
  return impl_->channels;
}

const std::map<std::uint16_t, McapSchema>& McapReader::schemas() const noexcept {
  return impl_->schemas;
}

const McapFacts& McapReader::facts() const noexcept {
  return impl_->facts;
}

const std::filesystem::path& McapReader::path() const noexcept {
  return impl_->path;
}

const std::optional<std::string>& McapReader::truncation() const noexcept {
  return impl_->truncation;
}

}  // namespace emit::protocol
