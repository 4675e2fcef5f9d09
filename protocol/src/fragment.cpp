// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/fragment.hpp"

#include <algorithm>
#include <limits>

#include "emit/physics/check.hpp"
#include "wire_bytes.hpp"

namespace emit::protocol {
namespace {

constexpr std::array<std::byte, kFrameHeaderBytes> kZeroBytes{};
constexpr std::uint32_t kHeader = static_cast<std::uint32_t>(kFrameHeaderBytes);

/// Returns the part of `source` within [begin, end). `source` lies at `source_begin` of the byte
/// stream.
std::span<const std::byte> overlap(std::span<const std::byte> source, std::uint64_t source_begin,
                                   std::uint64_t begin, std::uint64_t end) noexcept {
  const std::uint64_t from = std::max(begin, source_begin);
  const std::uint64_t to = std::min(end, source_begin + source.size());
  if (from >= to) return {};
  return source.subspan(static_cast<std::size_t>(from - source_begin),
                        static_cast<std::size_t>(to - from));
}

}  // namespace

std::string_view to_string(FragmentStatus status) noexcept {
  switch (status) {
    case FragmentStatus::accepted:
      return "accepted";
    case FragmentStatus::short_input:
      return "short input";
    case FragmentStatus::wrong_magic:
      return "wrong magic";
    case FragmentStatus::wrong_version:
      return "wrong version";
    case FragmentStatus::bad_length:
      return "bad payload length";
    case FragmentStatus::bad_offset:
      return "bad byte offset";
    case FragmentStatus::oversize:
      return "frame size out of range";
    case FragmentStatus::duplicate:
      return "duplicate";
    case FragmentStatus::overlap:
      return "overlap";
    case FragmentStatus::inconsistent:
      return "contradicts its frame";
    case FragmentStatus::late:
      return "late";
    case FragmentStatus::no_buffer:
      return "no free buffer";
    case FragmentStatus::too_many_streams:
      return "too many streams";
    case FragmentStatus::bad_parity:
      return "parity of another geometry";
  }
  return "unknown";
}

void encode(const FragmentHeader& header, std::span<std::byte, kFragmentHeaderBytes> out) noexcept {
  wire::put(out, 0, kFragmentMagic);
  wire::put(out, 4, kFragmentVersion);
  wire::put(out, 5, header.flags);
  wire::put(out, 6, header.stream_id);
  wire::put(out, 8, header.frame_id);
  wire::put(out, 12, header.byte_offset);
  wire::put(out, 16, header.total_bytes);
  wire::put(out, 20, header.payload_bytes);
  wire::put(out, 22, header.row);
  wire::put(out, 24, header.sim_time_ns);
}

std::optional<std::uint16_t> stream_of_fragment(std::span<const std::byte> datagram) noexcept {
  if (datagram.size() < kFragmentHeaderBytes ||
      wire::get<std::uint32_t>(datagram, 0) != kFragmentMagic) {
    return std::nullopt;
  }
  return wire::get<std::uint16_t>(datagram, 6);
}

FragmentStatus decode_fragment_header(std::span<const std::byte> datagram,
                                      FragmentHeader& out) noexcept {
  const std::size_t header_bytes = std::min(datagram.size(), kFragmentHeaderBytes);
  return decode_fragment_header(datagram.first(header_bytes), datagram.size() - header_bytes, out);
}

FragmentStatus decode_fragment_header(std::span<const std::byte> header, std::size_t payload,
                                      FragmentHeader& out) noexcept {
  if (header.size() < kFragmentHeaderBytes) return FragmentStatus::short_input;
  if (wire::get<std::uint32_t>(header, 0) != kFragmentMagic) return FragmentStatus::wrong_magic;
  if (wire::get<std::uint8_t>(header, 4) != kFragmentVersion) {
    return FragmentStatus::wrong_version;
  }
  out.flags = wire::get<std::uint8_t>(header, 5);
  out.stream_id = wire::get<std::uint16_t>(header, 6);
  out.frame_id = wire::get<std::uint32_t>(header, 8);
  out.byte_offset = wire::get<std::uint32_t>(header, 12);
  out.total_bytes = wire::get<std::uint32_t>(header, 16);
  out.payload_bytes = wire::get<std::uint16_t>(header, 20);
  out.row = wire::get<std::uint16_t>(header, 22);
  out.sim_time_ns = wire::get<std::int64_t>(header, 24);

  if (payload < out.payload_bytes) return FragmentStatus::short_input;
  if (payload != out.payload_bytes || payload == 0 || payload % 4 != 0) {
    return FragmentStatus::bad_length;
  }
  // The smallest frame has both headers and one pixel.
  if (out.total_bytes < 2 * kHeader + 4 || out.total_bytes % 4 != 0) {
    return FragmentStatus::oversize;
  }
  if (out.byte_offset % 4 != 0 || out.byte_offset > out.total_bytes ||
      payload > out.total_bytes - out.byte_offset) {
    return FragmentStatus::bad_offset;
  }
  const bool first = out.byte_offset == 0;
  const bool last = out.byte_offset + payload == out.total_bytes;
  if (first != ((out.flags & kFragmentFirst) != 0) || last != ((out.flags & kFragmentLast) != 0)) {
    return FragmentStatus::inconsistent;
  }
  return FragmentStatus::accepted;
}

Fragmenter::Fragmenter(const Params& params,
                       std::span<const std::byte, kFrameHeaderBytes> frame_header,
                       std::span<const std::byte> pixels) noexcept
    : params_(params), frame_header_(frame_header), pixels_(pixels) {
  EMIT_CHECK_OP(pixels.size() % 4, ==, 0U);
  EMIT_CHECK_OP(pixels.size(), <=, kMaxFragmentedPixelBytes);
  payload_bytes_ = granted_fragment_payload_bytes(params.max_payload_bytes);
  const std::uint32_t body = kHeader + static_cast<std::uint32_t>(pixels.size());
  // Bytes used of the fragment in which the pixels end.
  const std::uint32_t used = body % payload_bytes_;
  // When used is 0, the second header starts a fragment of its own.
  padding_bytes_ = used + kHeader > payload_bytes_ ? payload_bytes_ - used : 0;
  total_bytes_ = body + padding_bytes_ + kHeader;
  fragment_count_ = (total_bytes_ - 1) / payload_bytes_ + 1;
}

std::span<const std::byte> Fragmenter::pixels_of(std::uint32_t index) const noexcept {
  const std::uint64_t begin = std::uint64_t{index} * payload_bytes_;
  if (begin < kHeader || begin + payload_bytes_ > kHeader + pixels_.size()) return {};
  return pixels_.subspan(static_cast<std::size_t>(begin - kHeader), payload_bytes_);
}

Fragmenter::Pieces Fragmenter::pieces(std::uint32_t index,
                                      std::span<std::byte, kFragmentHeaderBytes> header_memory,
                                      std::uint8_t more_flags) const noexcept {
  EMIT_DCHECK_OP(index, <, fragment_count_);
  const std::uint64_t begin = std::uint64_t{index} * payload_bytes_;
  const std::uint64_t end = std::min<std::uint64_t>(begin + payload_bytes_, total_bytes_);

  FragmentHeader header;
  header.flags = static_cast<std::uint8_t>((begin == 0 ? kFragmentFirst : 0) |
                                           (end == total_bytes_ ? kFragmentLast : 0) | more_flags);
  header.stream_id = params_.stream_id;
  header.frame_id = params_.frame_id;
  header.byte_offset = static_cast<std::uint32_t>(begin);
  header.total_bytes = total_bytes_;
  header.payload_bytes = static_cast<std::uint16_t>(end - begin);
  header.sim_time_ns = params_.sim_time_ns;
  const std::uint64_t pixel_begin = begin < kHeader ? 0 : begin - kHeader;
  if (params_.row_bytes != 0 && pixel_begin < pixels_.size()) {
    header.row = static_cast<std::uint16_t>(std::min<std::uint64_t>(
        pixel_begin / params_.row_bytes, std::numeric_limits<std::uint16_t>::max()));
  }
  encode(header, header_memory);

  Pieces result;
  auto add = [&result](std::span<const std::byte> piece) {
    if (piece.empty()) return;
    result.piece[result.count++] = piece;
    result.bytes += static_cast<std::uint32_t>(piece.size());
  };
  add(header_memory);
  add(overlap(frame_header_, 0, begin, end));
  add(overlap(pixels_, kHeader, begin, end));
  const std::uint64_t padding_begin = std::uint64_t{kHeader} + pixels_.size();
  add(overlap(std::span(kZeroBytes).first(padding_bytes_), padding_begin, begin, end));
  add(overlap(frame_header_, padding_begin + padding_bytes_, begin, end));
  return result;
}

}  // namespace emit::protocol
