// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/parity.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "erasure_code.hpp"
#include "wire_bytes.hpp"

namespace emit::protocol {

ParityGeometry ParityGeometry::of(const FecParams& params, std::uint32_t total_bytes,
                                  std::uint32_t fragment_bytes) noexcept {
  EMIT_CHECK(params.on() && params.valid());
  EMIT_CHECK_OP(fragment_bytes, >, 0U);
  EMIT_CHECK_OP(fragment_bytes, <=, total_bytes);
  ParityGeometry out;
  out.total_bytes = total_bytes;
  out.fragment_bytes = fragment_bytes;
  out.fragments = (total_bytes - 1) / fragment_bytes + 1;
  out.groups = (out.fragments - 1) / params.data_fragments + 1;
  out.parity_fragments = params.parity_fragments;
  return out;
}

std::size_t max_parity_groups(const FecParams& params, std::uint32_t max_total_bytes) noexcept {
  return ParityGeometry::of(params, std::max(max_total_bytes, kMinFragmentPayloadBytes),
                            kMinFragmentPayloadBytes)
      .groups;
}

std::size_t max_parity_bytes(const FecParams& params, std::uint32_t max_total_bytes) noexcept {
  EMIT_CHECK(params.on() && params.valid());
  // The bound is groups * fragment_bytes, with each division rounded up.
  const std::size_t max_fragment_bytes = std::min(max_total_bytes, kMaxFragmentPayloadBytes);
  return params.parity_fragments *
         (std::size_t{max_total_bytes} / params.data_fragments + 2 * max_fragment_bytes);
}

void encode(const ParityHeader& header, std::span<std::byte, kFragmentHeaderBytes> out) noexcept {
  wire::put(out, 0, kFragmentMagic);
  wire::put(out, 4, kParityVersion);
  wire::put(out, 5, static_cast<std::uint8_t>(kFragmentParity));
  wire::put(out, 6, header.stream_id);
  wire::put(out, 8, header.frame_id);
  wire::put(out, 12, header.group);
  wire::put(out, 14, header.index);
  wire::put(out, 15, header.parity_fragments);
  wire::put(out, 16, header.total_bytes);
  wire::put(out, 20, header.payload_bytes);
  wire::put(out, 22, header.groups);
  wire::put(out, 24, header.sim_time_ns);
}

bool is_parity(std::span<const std::byte> header) noexcept {
  return header.size() >= kFragmentHeaderBytes &&
         wire::get<std::uint32_t>(header, 0) == kFragmentMagic &&
         wire::get<std::uint8_t>(header, 4) == kParityVersion &&
         (wire::get<std::uint8_t>(header, 5) & kFragmentParity) != 0;
}

FragmentStatus decode_parity_header(std::span<const std::byte> header, std::size_t payload_bytes,
                                    const FecParams& agreed, ParityHeader& out) noexcept {
  EMIT_DCHECK(agreed.valid());
  if (header.size() < kFragmentHeaderBytes) return FragmentStatus::short_input;
  if (wire::get<std::uint32_t>(header, 0) != kFragmentMagic) return FragmentStatus::wrong_magic;
  if (!is_parity(header)) return FragmentStatus::wrong_version;
  out.stream_id = wire::get<std::uint16_t>(header, 6);
  out.frame_id = wire::get<std::uint32_t>(header, 8);
  out.group = wire::get<std::uint16_t>(header, 12);
  out.index = wire::get<std::uint8_t>(header, 14);
  out.parity_fragments = wire::get<std::uint8_t>(header, 15);
  out.total_bytes = wire::get<std::uint32_t>(header, 16);
  out.payload_bytes = wire::get<std::uint16_t>(header, 20);
  out.groups = wire::get<std::uint16_t>(header, 22);
  out.sim_time_ns = wire::get<std::int64_t>(header, 24);

  if (payload_bytes < out.payload_bytes) return FragmentStatus::short_input;
  if (payload_bytes != out.payload_bytes || payload_bytes % 4 != 0) {
    return FragmentStatus::bad_length;
  }
  if (out.total_bytes < 2 * kFrameHeaderBytes + 4 || out.total_bytes % 4 != 0) {
    return FragmentStatus::oversize;
  }
  if (!agreed.on() || payload_bytes < kMinFragmentPayloadBytes ||
      payload_bytes > std::min(out.total_bytes, kMaxFragmentPayloadBytes)) {
    return FragmentStatus::bad_parity;
  }
  const auto geometry =
      ParityGeometry::of(agreed, out.total_bytes, static_cast<std::uint32_t>(payload_bytes));
  if (out.parity_fragments != agreed.parity_fragments || out.groups != geometry.groups ||
      out.index >= agreed.parity_fragments || out.group >= geometry.groups) {
    return FragmentStatus::bad_parity;
  }
  return FragmentStatus::accepted;
}

// ParityEncoder

/// Tables and arrays of the encoder. Groups of a frame differ in size by at most one fragment, so
/// there are tables for two sizes.
struct ParityEncoder::Code {
  std::array<std::vector<std::uint8_t>, 2> tables;  // tables for the largest size, and for one less
  std::array<const std::byte*, kMaxFecData> in{};
  std::array<std::byte*, kMaxFecParity> out{};
};

ParityEncoder::ParityEncoder(const FecParams& params, const Fragmenter& like)
    : geometry_(ParityGeometry::of(params, like.total_bytes(), like.payload_bytes())),
      memory_(std::size_t{geometry_.parity_count()} * datagram_bytes()),
      // Three fragments do not consist of pixels alone: the first one and the last two.
      scratch_(std::size_t{3} * geometry_.fragment_bytes),
      code_(std::make_unique<Code>()) {
  const std::uint32_t largest = geometry_.group_size(0);
  for (std::uint32_t less = 0; less < 2; ++less) {
    const std::uint32_t size = std::max(largest, less + 1) - less;
    std::vector<std::uint8_t> coefficients;
    for (std::uint32_t p = 0; p < params.parity_fragments; ++p) {
      for (std::uint32_t j = 0; j < size; ++j) {
        coefficients.push_back(erasure::coefficient(p, j));
      }
    }
    code_->tables[less].resize(coefficients.size() * erasure::kTableBytes);
    erasure::expand(coefficients, params.parity_fragments, size, code_->tables[less]);
  }
}

ParityEncoder::~ParityEncoder() = default;
ParityEncoder::ParityEncoder(ParityEncoder&&) noexcept = default;
ParityEncoder& ParityEncoder::operator=(ParityEncoder&&) noexcept = default;

bool ParityEncoder::encode_some(const Fragmenter& fragments, std::size_t budget_bytes) noexcept {
  EMIT_CHECK_OP(fragments.total_bytes(), ==, geometry_.total_bytes);
  EMIT_CHECK_OP(fragments.payload_bytes(), ==, geometry_.fragment_bytes);
  std::size_t read_bytes = 0;
  while (encoded_groups_ < geometry_.groups) {
    encode_group(fragments, encoded_groups_);
    read_bytes += std::size_t{geometry_.group_size(encoded_groups_)} * geometry_.fragment_bytes;
    ++encoded_groups_;
    if (read_bytes >= budget_bytes) break;
  }
  return encoded_groups_ == geometry_.groups;
}

void ParityEncoder::encode_group(const Fragmenter& fragments, std::uint32_t group) noexcept {
  const std::uint32_t size = geometry_.group_size(group);
  const std::size_t bytes = geometry_.fragment_bytes;
  std::size_t scratch_used = 0;
  for (std::uint32_t j = 0; j < size; ++j) {
    const std::uint32_t index = geometry_.fragment(group, j);
    const auto pixels = fragments.pixels_of(index);
    if (!pixels.empty()) {
      code_->in[j] = pixels.data();
      continue;
    }
    std::array<std::byte, kFragmentHeaderBytes> unused;
    const auto pieces = fragments.pieces(index, unused);
    std::byte* const place = scratch_.data() + scratch_used;
    std::size_t at = 0;
    for (std::uint32_t piece = 1; piece < pieces.count; ++piece) {
      std::memcpy(place + at, pieces.piece[piece].data(), pieces.piece[piece].size());
      at += pieces.piece[piece].size();
    }
    std::memset(place + at, 0, bytes - at);
    code_->in[j] = place;
    scratch_used += bytes;
  }
  ParityHeader header;
  header.stream_id = fragments.params().stream_id;
  header.frame_id = fragments.params().frame_id;
  header.group = static_cast<std::uint16_t>(group);
  header.parity_fragments = static_cast<std::uint8_t>(geometry_.parity_fragments);
  header.total_bytes = geometry_.total_bytes;
  header.payload_bytes = static_cast<std::uint16_t>(bytes);
  header.groups = static_cast<std::uint16_t>(geometry_.groups);
  header.sim_time_ns = fragments.params().sim_time_ns;
  for (std::uint32_t p = 0; p < geometry_.parity_fragments; ++p) {
    const std::size_t at = (std::size_t{p} * geometry_.groups + group) * datagram_bytes();
    header.index = static_cast<std::uint8_t>(p);
    encode(header, std::span(memory_).subspan(at).first<kFragmentHeaderBytes>());
    code_->out[p] = memory_.data() + at + kFragmentHeaderBytes;
  }
  erasure::combine(bytes, code_->tables[size == geometry_.group_size(0) ? 0 : 1],
                   std::span(code_->in).first(size),
                   std::span(code_->out).first(geometry_.parity_fragments));
}

// GroupDecoder

/// Tables and arrays of the decoder.
struct GroupDecoder::Code {
  std::array<std::uint32_t, kMaxFecParity> missing{};
  std::array<std::uint32_t, kMaxFecParity> rows{};  // parity fragments that are used
  std::array<std::uint8_t, kMaxFecParity * kMaxFecParity> matrix{};
  std::array<std::uint8_t, kMaxFecParity * kMaxFecParity> inverse{};
  std::vector<std::uint8_t> coefficients;
  std::vector<std::uint8_t> tables;
  std::array<const std::byte*, kMaxFecData> in{};
};

GroupDecoder::GroupDecoder(const FecParams& params) : code_(std::make_unique<Code>()) {
  EMIT_CHECK(params.on() && params.valid());
  // A group has as many inputs as data fragments: the present ones, and parity in place of the
  // others.
  code_->coefficients.resize(std::size_t{params.parity_fragments} * params.data_fragments);
  code_->tables.resize(code_->coefficients.size() * erasure::kTableBytes);
}

GroupDecoder::~GroupDecoder() = default;
GroupDecoder::GroupDecoder(GroupDecoder&&) noexcept = default;
GroupDecoder& GroupDecoder::operator=(GroupDecoder&&) noexcept = default;

bool GroupDecoder::decode(std::size_t bytes, std::span<const std::byte* const> data,
                          std::span<const std::byte* const> parity,
                          std::span<std::byte* const> out) noexcept {
  Code& code = *code_;
  std::uint32_t missing = 0;
  for (std::uint32_t j = 0; j < data.size(); ++j) {
    if (data[j] != nullptr) continue;
    if (missing == out.size() || missing == kMaxFecParity) return false;
    code.missing[missing++] = j;
  }
  std::uint32_t rows = 0;
  for (std::uint32_t p = 0; p < parity.size() && rows < missing; ++p) {
    if (parity[p] != nullptr) code.rows[rows++] = p;
  }
  if (missing == 0 || missing != out.size() || rows < missing ||
      data.size() * missing > code.coefficients.size()) {
    return false;
  }
  for (std::uint32_t r = 0; r < rows; ++r) {
    for (std::uint32_t e = 0; e < missing; ++e) {
      code.matrix[r * missing + e] = erasure::coefficient(code.rows[r], code.missing[e]);
    }
  }
  if (!erasure::invert(std::span(code.matrix).first(std::size_t{missing} * missing), code.inverse,
                       missing)) {
    return false;
  }
  // Compute missing = inverse * (parity - contribution of the present fragments to it). Minus
  // equals plus in this field.
  std::uint32_t columns = 0;
  const auto inputs = static_cast<std::uint32_t>(data.size());
  for (std::uint32_t j = 0; j < inputs; ++j) {
    if (data[j] == nullptr) continue;
    code.in[columns] = data[j];
    for (std::uint32_t e = 0; e < missing; ++e) {
      std::uint8_t sum = 0;
      for (std::uint32_t r = 0; r < rows; ++r) {
        sum = static_cast<std::uint8_t>(sum ^
                                        erasure::multiply(code.inverse[e * missing + r],
                                                          erasure::coefficient(code.rows[r], j)));
      }
      code.coefficients[std::size_t{e} * inputs + columns] = sum;
    }
    ++columns;
  }
  for (std::uint32_t r = 0; r < rows; ++r, ++columns) {
    code.in[columns] = parity[code.rows[r]];
    for (std::uint32_t e = 0; e < missing; ++e) {
      code.coefficients[std::size_t{e} * inputs + columns] = code.inverse[e * missing + r];
    }
  }
  erasure::expand(code.coefficients, missing, inputs, code.tables);
  erasure::combine(bytes, code.tables, std::span(code.in).first(inputs), out);
  return true;
}

}  // namespace emit::protocol
