// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/mcap_summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <system_error>
#include <vector>

#include "crc.hpp"
#include "mcap_format.hpp"

namespace emit::protocol {
namespace {

using mcap::Input;
using mcap::Opcode;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

// Length of the footer's fields: offsets of summary and summary offsets, and the CRC.
constexpr std::uint64_t kFooterFieldBytes = 20;
constexpr std::uint64_t kFooterBytes = mcap::kRecordPrefixBytes + kFooterFieldBytes;
constexpr std::uint64_t kCrcBytes = 4;
/// Largest record of a summary, bytes. A larger one is called damaged rather than read.
constexpr std::uint64_t kMaxSummaryRecordBytes = std::uint64_t{64} << 20;

/// Reads the records of one summary.
class SummaryReader {
 public:
  SummaryReader(const std::filesystem::path& path, std::ifstream file, std::uint64_t file_bytes)
      : path_(path), file_(std::move(file)), file_bytes_(file_bytes) {}

  McapSummary read() {
    if (!read_footer()) return std::move(out_);
    out_.state = McapSummary::State::complete;
    if (crc_is_right()) read_records();
    return std::move(out_);
  }

 private:
  bool read_at(std::uint64_t at, std::span<std::byte> into) {
    file_.clear();
    file_.seekg(static_cast<std::streamoff>(at));
    file_.read(reinterpret_cast<char*>(into.data()), static_cast<std::streamsize>(into.size()));
    return static_cast<std::size_t>(file_.gcount()) == into.size();
  }
  bool problem(McapSummary::State state, std::uint64_t at, std::string_view text) {
    out_.state = state;
    out_.problem = fmt::format("{}: offset {}: {}", path_.string(), at, text);
    return false;
  }
  bool damaged(std::uint64_t at, std::string_view text) {
    return problem(McapSummary::State::damaged, at, text);
  }

  bool read_footer() {
    std::array<std::byte, kFooterBytes + mcap::kMagic.size()> end{};
    if (file_bytes_ < mcap::kMagic.size() + end.size() || !read_at(file_bytes_ - end.size(), end) ||
        !std::ranges::equal(std::span(end).last(mcap::kMagic.size()), mcap::kMagic)) {
      return problem(McapSummary::State::none, file_bytes_, "the file ends without a footer");
    }
    footer_at_ = file_bytes_ - end.size();
    Input fields(end);
    const auto opcode = fields.number<std::uint8_t>();
    const auto length = fields.number<std::uint64_t>();
    if (opcode != static_cast<std::uint8_t>(Opcode::footer) || length != kFooterFieldBytes) {
      return damaged(footer_at_, "no footer in front of the end of the file");
    }
    summary_at_ = fields.number<std::uint64_t>();
    static_cast<void>(fields.number<std::uint64_t>());  // offset of the summary offsets
    crc_ = fields.number<std::uint32_t>();
    if (summary_at_ == 0) {
      return problem(McapSummary::State::none, footer_at_, "the file has no summary");
    }
    if (summary_at_ < mcap::kMagic.size() || summary_at_ > footer_at_) {
      return damaged(footer_at_,
                     fmt::format("the summary begins at {}, beyond the data", summary_at_));
    }
    return true;
  }

  bool crc_is_right() {
    if (crc_ == 0) return true;  // the writer computed none
    std::vector<std::byte> block(std::size_t{64} << 10);
    const std::uint64_t end = footer_at_ + kFooterBytes - kCrcBytes;
    std::uint32_t computed = 0;
    for (std::uint64_t at = summary_at_; at < end;) {
      const auto piece = std::span(block).first(
          static_cast<std::size_t>(std::min<std::uint64_t>(end - at, block.size())));
      if (!read_at(at, piece)) return damaged(at, "cannot read");
      computed = crc32(piece, computed);
      at += piece.size();
    }
    if (computed == crc_) return true;
    return damaged(summary_at_,
                   fmt::format("summary CRC {:#010x}, computed {:#010x}", crc_, computed));
  }

  void read_records() {
    std::vector<std::byte> record;
    for (std::uint64_t at = summary_at_; at < footer_at_;) {
      std::array<std::byte, mcap::kRecordPrefixBytes> prefix{};
      if (footer_at_ - at < prefix.size() || !read_at(at, prefix)) {
        damaged(at, "the summary ends within a record");
        return;
      }
      Input fields(prefix);
      const auto opcode = static_cast<Opcode>(fields.number<std::uint8_t>());
      const auto length = fields.number<std::uint64_t>();
      if (length > footer_at_ - at - prefix.size() || length > kMaxSummaryRecordBytes) {
        damaged(at, fmt::format("record of {} bytes in the summary", length));
        return;
      }
      record.resize(static_cast<std::size_t>(length));
      if (!read_at(at + prefix.size(), record) || !take(opcode, Input(record))) {
        damaged(at, "malformed record in the summary");
        return;
      }
      at += prefix.size() + length;
    }
  }

  /// Takes a record. Returns false when it is malformed.
  bool take(Opcode opcode, Input fields) {
    switch (opcode) {
      case Opcode::schema: {
        const auto id = fields.number<std::uint16_t>();
        McapSchema& schema = out_.schemas[id];
        schema.name = fields.string();
        schema.encoding = fields.string();
        schema.data = fields.string();
        break;
      }
      case Opcode::channel: {
        const auto id = fields.number<std::uint16_t>();
        McapChannel& channel = out_.channels[id];
        channel.schema_id = fields.number<std::uint16_t>();
        channel.topic = fields.string();
        channel.message_encoding = fields.string();
        break;
      }
      case Opcode::statistics:
        return take_statistics(fields);
      case Opcode::chunk_index: {
        for (int i = 0; i < 4; ++i) static_cast<void>(fields.number<std::uint64_t>());
        static_cast<void>(fields.raw(fields.number<std::uint32_t>()));  // message indexes
        static_cast<void>(fields.number<std::uint64_t>());
        const std::string compression = fields.string();
        if (fields.ok()) ++out_.chunks_of_compression[compression];
        break;
      }
      default:
        break;
    }
    return fields.ok();
  }

  bool take_statistics(Input& fields) {
    McapStatistics& statistics = out_.statistics.emplace();
    statistics.messages = fields.number<std::uint64_t>();
    static_cast<void>(fields.number<std::uint16_t>());                              // schemas
    for (int i = 0; i < 4; ++i) static_cast<void>(fields.number<std::uint32_t>());  // other counts
    statistics.first_ns = fields.number<std::uint64_t>();
    statistics.last_ns = fields.number<std::uint64_t>();
    Input counts(fields.raw(fields.number<std::uint32_t>()));
    while (counts.ok() && !counts.rest().empty()) {
      const auto id = counts.number<std::uint16_t>();
      statistics.messages_of_channel[id] = counts.number<std::uint64_t>();
    }
    return fields.ok() && counts.ok();
  }

  const std::filesystem::path& path_;
  std::ifstream file_;
  std::uint64_t file_bytes_;
  std::uint64_t footer_at_ = 0;
  std::uint64_t summary_at_ = 0;
  std::uint32_t crc_ = 0;
  McapSummary out_;
};

}  // namespace

Result<McapSummary> read_mcap_summary(const std::filesystem::path& path) {
  // The reader checks that the path is an MCAP file.
  auto reader = McapReader::open(path);
  if (!reader) return tl::unexpected(reader.error());
  std::ifstream file(path, std::ios::binary);
  if (!file) return make_error(ErrorCode::io, path.string() + ": cannot open");
  return SummaryReader(path, std::move(file), reader->facts().file_bytes).read();
}

}  // namespace emit::protocol
