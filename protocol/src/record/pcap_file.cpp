// SPDX-License-Identifier: Apache-2.0
#include "pcap_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace emit::protocol {
namespace {

using physics::Error;
using physics::ErrorCode;
using physics::Result;

// Magic numbers, read with the least significant byte first.
constexpr std::uint32_t kMicroseconds = 0xA1B2C3D4;
constexpr std::uint32_t kNanoseconds = 0xA1B23C4D;
constexpr std::uint32_t kPatched = 0xA1B2CD34;  // a variant with longer record headers
constexpr std::uint32_t kSectionBlock = 0x0A0D0D0A;
constexpr std::uint32_t kByteOrderMagic = 0x1A2B3C4D;

constexpr std::uint32_t kInterfaceBlock = 1;
constexpr std::uint32_t kObsoletePacketBlock = 2;
constexpr std::uint32_t kSimplePacketBlock = 3;
constexpr std::uint32_t kEnhancedPacketBlock = 6;

/// Largest packet, bytes. Capture tools write 256 KiB at most, so a larger one is damage.
constexpr std::uint32_t kMaxPacketBytes = 1u << 20;
constexpr std::uint32_t kMaxBlockBytes = 16u << 20;

constexpr std::uint32_t swapped(std::uint32_t v) noexcept {
  return v >> 24 | (v >> 8 & 0xFF00u) | (v << 8 & 0xFF0000u) | v << 24;
}

std::uint32_t first_word(std::span<const std::byte> bytes) noexcept {
  std::uint32_t out = 0;
  for (std::size_t i = 0; i < 4; ++i) out |= std::to_integer<std::uint32_t>(bytes[i]) << (8 * i);
  return out;
}

bool is_classic(std::uint32_t magic) noexcept {
  return magic == kMicroseconds || magic == kNanoseconds || magic == kPatched;
}

}  // namespace

std::uint16_t PcapFile::u16(std::size_t at) const noexcept {
  const auto a = std::to_integer<std::uint32_t>(view_[at]);
  const auto b = std::to_integer<std::uint32_t>(view_[at + 1]);
  return static_cast<std::uint16_t>(big_endian_ ? a << 8 | b : b << 8 | a);
}

std::uint32_t PcapFile::u32(std::size_t at) const noexcept {
  const std::uint32_t value = first_word(view_.subspan(at, 4));
  return big_endian_ ? swapped(value) : value;
}

std::uint64_t PcapFile::u64(std::size_t at) const noexcept {
  const std::uint64_t first = u32(at);
  const std::uint64_t second = u32(at + 4);
  return big_endian_ ? first << 32 | second : second << 32 | first;
}

tl::unexpected<Error> PcapFile::fail(ErrorCode code, std::string_view text) {
  failure_ = Error{code, fmt::format("{}: offset {}: {}", path_.string(), offset_, text)};
  return tl::unexpected(*failure_);
}

bool PcapFile::read(std::size_t bytes, std::vector<std::byte>& out, std::string_view what) {
  out.resize(bytes);
  file_.read(reinterpret_cast<char*>(out.data()), static_cast<std::streamsize>(bytes));
  const auto got = static_cast<std::size_t>(file_.gcount());
  next_offset_ += got;
  if (got == bytes) return true;
  ended_ = true;
  if (got > 0 || next_offset_ > offset_) {
    truncation_ = fmt::format("{}: offset {}: the file ends within {}, which is not used",
                              path_.string(), offset_, what);
  }
  return false;
}

bool PcapFile::is_capture(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<std::byte, 4> bytes{};
  file.read(reinterpret_cast<char*>(bytes.data()), bytes.size());
  if (file.gcount() != static_cast<std::streamsize>(bytes.size())) return false;
  const std::uint32_t magic = first_word(bytes);
  return magic == kSectionBlock || is_classic(magic) || is_classic(swapped(magic));
}

Result<PcapFile> PcapFile::open(const std::filesystem::path& path) {
  std::error_code code;
  if (!std::filesystem::exists(path, code)) {
    return physics::make_error(ErrorCode::not_found, path.string() + ": no such file");
  }
  PcapFile out;
  out.path_ = path;
  out.file_.open(path, std::ios::binary);
  if (!out.file_ || std::filesystem::is_directory(path, code)) {
    return physics::make_error(ErrorCode::io, path.string() + ": cannot open");
  }
  if (!is_capture(path)) {
    return physics::make_error(ErrorCode::parse, path.string() + ": no pcap or pcapng file");
  }
  std::vector<std::byte> magic;
  if (!out.read(4, magic, "the magic number")) return out.fail(ErrorCode::io, "cannot read");
  if (first_word(magic) == kSectionBlock) {
    // The section header is a block like any other. Read it again from its start.
    out.file_.seekg(0);
    out.next_offset_ = 0;
    out.next_generation_ = true;
    return out;
  }
  out.big_endian_ = !is_classic(first_word(magic));
  const std::uint32_t number = out.big_endian_ ? swapped(first_word(magic)) : first_word(magic);
  if (number == kPatched) {
    return out.fail(ErrorCode::unsupported, "a patched pcap format: convert it to pcapng");
  }
  out.nanoseconds_ = number == kNanoseconds;
  if (auto header = out.read_classic_header(); !header) return tl::unexpected(header.error());
  return out;
}

Result<void> PcapFile::read_classic_header() {
  if (!read(20, head_, "the file header")) {
    return fail(ErrorCode::parse, "the file ends within its header");
  }
  view_ = head_;
  if (u16(0) != 2) {
    return fail(ErrorCode::unsupported, fmt::format("pcap version {}.{}, not 2", u16(0), u16(2)));
  }
  // The upper bits hold the length of a check sequence behind Ethernet frames.
  link_type_ = u32(16) & 0xFFFFu;
  return {};
}

Result<bool> PcapFile::next() {
  if (failure_) return tl::unexpected(*failure_);
  if (ended_) return false;
  return next_generation_ ? next_block() : next_classic();
}

Result<bool> PcapFile::next_classic() {
  offset_ = next_offset_;
  if (!read(16, head_, "a packet header")) return false;
  view_ = head_;
  const std::uint32_t seconds = u32(0);
  const std::uint32_t fraction = u32(4);
  const std::uint32_t captured = u32(8);
  packet_.wire_bytes = u32(12);
  if (captured > kMaxPacketBytes) {
    return fail(ErrorCode::parse, fmt::format("a packet of {} bytes", captured));
  }
  if (fraction >= (nanoseconds_ ? 1'000'000'000u : 1'000'000u)) {
    return fail(ErrorCode::parse, fmt::format("a time stamp with the fraction {}", fraction));
  }
  if (!read(captured, body_, "a packet")) return false;
  ++packet_.number;
  packet_.link_type = link_type_;
  packet_.time_ns =
      std::int64_t{seconds} * 1'000'000'000 + std::int64_t{fraction} * (nanoseconds_ ? 1 : 1000);
  packet_.data = body_;
  return true;
}

Result<bool> PcapFile::next_block() {
  for (;;) {
    offset_ = next_offset_;
    if (!read(8, head_, "a block header")) return false;
    view_ = head_;
    const bool section = first_word(view_) == kSectionBlock;
    if (section) {
      // The byte order of a section is not known before the four bytes behind the length.
      std::vector<std::byte> order;
      if (!read(4, order, "a section header")) return false;
      const std::uint32_t magic = first_word(order);
      if (magic != kByteOrderMagic && swapped(magic) != kByteOrderMagic) {
        return fail(ErrorCode::parse, "a section header without its byte order");
      }
      big_endian_ = magic != kByteOrderMagic;
    }
    const std::uint32_t type = u32(0);
    const std::uint32_t length = u32(4);
    const std::uint32_t have = section ? 12 : 8;
    if (length < have + 4 || length % 4 != 0 || length > kMaxBlockBytes) {
      return fail(ErrorCode::parse, fmt::format("a block of {} bytes", length));
    }
    if (!read(length - have, body_, "a block")) return false;
    view_ = body_;
    const std::size_t content = length - have - 4;
    if (u32(content) != length) {
      return fail(ErrorCode::parse,
                  fmt::format("a block of {} bytes says {} at its end", length, u32(content)));
    }
    view_ = view_.first(content);
    Result<void> taken;
    if (section) {
      taken = take_section();
    } else if (type == kInterfaceBlock) {
      taken = take_interface();
    } else if (type == kEnhancedPacketBlock || type == kObsoletePacketBlock ||
               type == kSimplePacketBlock) {
      return take_packet_block(type);
    }
    if (!taken) return tl::unexpected(taken.error());
  }
}

Result<void> PcapFile::take_section() {
  interfaces_.clear();
  if (view_.size() < 12) return fail(ErrorCode::parse, "a section header of too few bytes");
  if (u16(0) != 1) {
    return fail(ErrorCode::unsupported, fmt::format("pcapng version {}.{}, not 1", u16(0), u16(2)));
  }
  return {};
}

Result<void> PcapFile::take_interface() {
  constexpr std::uint16_t kEnd = 0;
  constexpr std::uint16_t kResolution = 9;
  constexpr std::uint16_t kOffset = 14;
  if (view_.size() < 8) return fail(ErrorCode::parse, "an interface block of too few bytes");
  Interface interface;
  interface.link_type = u16(0);
  std::size_t at = 8;
  while (at + 4 <= view_.size()) {
    const std::uint16_t option = u16(at);
    const std::uint16_t length = u16(at + 2);
    at += 4;
    if (length > view_.size() - at) return fail(ErrorCode::parse, "an option beyond its block");
    if (option == kEnd) break;
    if (option == kResolution && length >= 1) {
      // The option gives ticks per second: a power of ten, or of two when the highest bit is set.
      const auto code = std::to_integer<std::uint32_t>(view_[at]);
      const std::uint32_t exponent = code & 0x7Fu;
      const bool binary = (code & 0x80u) != 0;
      if (exponent > (binary ? 62u : 18u)) {
        return fail(ErrorCode::unsupported, fmt::format("time stamp resolution {}", code));
      }
      interface.ticks_per_s = 1;
      for (std::uint32_t i = 0; i < exponent; ++i) interface.ticks_per_s *= binary ? 2 : 10;
    } else if (option == kOffset && length >= 8) {
      interface.offset_s = static_cast<std::int64_t>(u64(at));
    }
    at += (std::size_t{length} + 3) / 4 * 4;
  }
  interfaces_.push_back(interface);
  return {};
}

Result<void> PcapFile::set_time(const Interface& interface, std::uint64_t ticks) {
  // Largest time stamp, s. Nanoseconds beyond the year 2262 do not fit into 64 bits.
  constexpr std::uint64_t kMaxSeconds = 9'000'000'000;
  const std::uint64_t seconds = ticks / interface.ticks_per_s;
  const std::uint64_t rest = ticks % interface.ticks_per_s;
  constexpr auto kMaxOffset = static_cast<std::int64_t>(kMaxSeconds);
  if (seconds > kMaxSeconds || interface.offset_s > kMaxOffset ||
      interface.offset_s < -kMaxOffset) {
    return fail(ErrorCode::parse, "a time stamp out of range");
  }
  const double fraction = static_cast<double>(rest) / static_cast<double>(interface.ticks_per_s);
  // The result is exact where the resolution divides a nanosecond count, and else the nearest one.
  const std::uint64_t whole = interface.ticks_per_s <= 1'000'000'000
                                  ? rest * 1'000'000'000 / interface.ticks_per_s
                                  : static_cast<std::uint64_t>(fraction * 1e9);
  const std::int64_t total_s = static_cast<std::int64_t>(seconds) + interface.offset_s;
  if (total_s > kMaxOffset || total_s < -kMaxOffset) {
    return fail(ErrorCode::parse, "a time stamp out of range");
  }
  packet_.time_ns = total_s * 1'000'000'000 + static_cast<std::int64_t>(whole);
  return {};
}

Result<bool> PcapFile::take_packet_block(std::uint32_t type) {
  const bool simple = type == kSimplePacketBlock;
  const std::size_t head = simple ? 4 : 20;
  if (view_.size() < head) return fail(ErrorCode::parse, "a packet block of too few bytes");
  const std::uint32_t index = simple                         ? 0
                              : type == kObsoletePacketBlock ? std::uint32_t{u16(0)}
                                                             : u32(0);
  if (index >= interfaces_.size()) {
    return fail(ErrorCode::parse,
                fmt::format("a packet of interface {}, which is not described", index));
  }
  std::uint64_t captured = 0;
  if (simple) {
    packet_.wire_bytes = u32(0);
    captured = std::min<std::uint64_t>(packet_.wire_bytes, view_.size() - head);
    packet_.time_ns.reset();
  } else {
    const std::uint64_t ticks = std::uint64_t{u32(4)} << 32 | u32(8);
    captured = u32(12);
    packet_.wire_bytes = u32(16);
    if (auto time = set_time(interfaces_[index], ticks); !time) {
      return tl::unexpected(time.error());
    }
  }
  if (captured > view_.size() - head) {
    return fail(ErrorCode::parse,
                fmt::format("a packet of {} bytes in a block of {}", captured, view_.size()));
  }
  ++packet_.number;
  packet_.link_type = interfaces_[index].link_type;
  packet_.data = view_.subspan(head, static_cast<std::size_t>(captured));
  return true;
}

}  // namespace emit::protocol
