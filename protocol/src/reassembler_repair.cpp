// SPDX-License-Identifier: Apache-2.0
#include <bit>

#include "reassembler_slot.hpp"

/// Part of the reassembler that handles missing fragments: error correction, and the ranges for
/// resend requests.
namespace emit::protocol {

FragmentStatus Reassembler::take_parity(const ParityHeader& header,
                                        std::span<const std::byte> payload) noexcept {
  auto status = FragmentStatus::accepted;
  Slot* slot =
      enter({header.stream_id, header.frame_id, header.total_bytes, header.sim_time_ns}, status);
  if (slot == nullptr) return status;
  if (slot->all_received()) return FragmentStatus::late;  // complete; it waits for an older frame
  const auto geometry = ParityGeometry::of(params_.fec, header.total_bytes,
                                           static_cast<std::uint32_t>(payload.size()));
  if (!slot->has_parity) {
    // The constructor allocated memory for every geometry that decode_parity_header() accepts.
    slot->has_parity = true;
    slot->geometry = geometry;
    std::ranges::fill(slot->parity_arrived, 0u);
  } else if (slot->geometry != geometry) {
    return FragmentStatus::bad_parity;
  }
  std::uint32_t& arrived = slot->parity_arrived[header.group];
  const std::uint32_t bit = std::uint32_t{1} << header.index;
  if ((arrived & bit) != 0) return FragmentStatus::duplicate;
  arrived |= bit;
  ++slot->arrivals;
  std::memcpy(slot->parity(header.group, header.index), payload.data(), payload.size());
  repair(*slot, header.group);
  return FragmentStatus::accepted;
}

/// Restores the group's missing fragments as soon as enough of the group has arrived.
void Reassembler::repair(Slot& slot, std::uint32_t group) noexcept {
  const ParityGeometry& geometry = slot.geometry;
  const std::uint32_t arrived = slot.parity_arrived[group];
  const std::uint32_t size = geometry.group_size(group);
  std::array<std::uint32_t, kMaxFecParity> missing{};
  std::uint32_t count = 0;
  for (std::uint32_t j = 0; j < size; ++j) {
    const std::uint32_t fragment = geometry.fragment(group, j);
    if (slot.has_fragment(fragment)) continue;
    if (count >= static_cast<std::uint32_t>(std::popcount(arrived))) return;
    missing[count++] = fragment;
  }
  if (count == 0) return;

  const std::size_t bytes = geometry.fragment_bytes;
  const std::uint32_t last = geometry.fragments - 1;
  // The last fragment may be shorter than the others, so it is decoded in scratch memory.
  std::byte* const scratch = scratch_.data();
  std::array<const std::byte*, kMaxFecData> data{};
  std::array<const std::byte*, kMaxFecParity> parity{};
  std::array<std::byte*, kMaxFecParity> out{};
  std::uint32_t outputs = 0;
  for (std::uint32_t j = 0; j < size; ++j) {
    const std::uint32_t fragment = geometry.fragment(group, j);
    std::byte* place = slot.bytes.get() + std::size_t{fragment} * bytes;
    const bool is_missing = outputs < count && missing[outputs] == fragment;
    if (fragment == last) {
      if (!is_missing) {
        std::memcpy(scratch, place, geometry.bytes_of(fragment));
        std::memset(scratch + geometry.bytes_of(fragment), 0, bytes - geometry.bytes_of(fragment));
      }
      place = scratch;
    }
    if (is_missing) {
      out[outputs++] = place;
    } else {
      data[j] = place;
    }
  }
  for (std::uint32_t p = 0; p < geometry.parity_fragments; ++p) {
    if ((arrived & (std::uint32_t{1} << p)) != 0) parity[p] = slot.parity(group, p);
  }
  if (!decoder_->decode(bytes, std::span(data).first(size),
                        std::span(parity).first(geometry.parity_fragments),
                        std::span(out).first(outputs))) {
    return;
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::size_t begin = std::size_t{missing[i]} * bytes;
    const std::size_t length = geometry.bytes_of(missing[i]);
    if (missing[i] == last) std::memcpy(slot.bytes.get() + begin, scratch, length);
    const std::size_t words = length / kWordBytes;
    // A part of the fragment may have arrived in fragments of another length.
    slot.received_words += words - bits::count_set(slot.received, begin / kWordBytes, words);
    bits::set_range(slot.received, begin / kWordBytes, words);
    if (begin < slot.summed_bytes) {
      slot.summed_bytes = 0;
      slot.crc32c = 0;
    }
  }
  slot.repaired += count;
  counters_.fragments_repaired += count;
  if (slot.all_received()) complete(slot);
}

std::uint32_t Reassembler::unrepaired_groups(const Slot& slot) const noexcept {
  if (!slot.has_parity) return 0;
  std::uint32_t groups = 0;
  for (std::uint32_t group = 0; group < slot.geometry.groups; ++group) {
    for (std::uint32_t j = 0; j < slot.geometry.group_size(group); ++j) {
      if (slot.has_fragment(slot.geometry.fragment(group, j))) continue;
      ++groups;
      break;
    }
  }
  return groups;
}

const Reassembler::Stream* Reassembler::known_stream(std::uint16_t stream_id) const noexcept {
  for (const Stream& stream : streams_) {
    if (stream.id == stream_id) return &stream;
  }
  return nullptr;
}

const Reassembler::Slot* Reassembler::find_open(const Stream& stream,
                                                std::uint32_t frame_id) const noexcept {
  for (const Slot& slot : slots_) {
    if (slot.state == Slot::State::open && slot.stream == &stream && slot.frame_id == frame_id) {
      return &slot;
    }
  }
  return nullptr;
}

std::size_t Reassembler::open_frames(std::uint16_t stream_id,
                                     std::span<OpenFrame> out) const noexcept {
  const Stream* stream = known_stream(stream_id);
  if (stream == nullptr) return 0;
  std::size_t count = 0;
  const Slot* newest = nullptr;
  for (const Slot& slot : slots_) {
    if (slot.state != Slot::State::open || slot.stream != stream) continue;
    if (newest == nullptr || frame_distance(slot.frame_id, newest->frame_id) > 0) newest = &slot;
  }
  for (const Slot& slot : slots_) {
    if (slot.state != Slot::State::open || slot.stream != stream || slot.all_received()) continue;
    if (count == out.size()) break;
    out[count++] = {slot.frame_id, slot.arrivals, slot.end_seen || &slot != newest};
  }
  std::ranges::sort(out.first(count), [](const OpenFrame& a, const OpenFrame& b) {
    return frame_distance(a.frame_id, b.frame_id) < 0;
  });
  return count;
}

std::size_t Reassembler::missing(std::uint16_t stream_id, std::uint32_t frame_id, bool tail,
                                 std::span<ByteRange> out) const noexcept {
  const Stream* stream = known_stream(stream_id);
  const Slot* slot = stream == nullptr ? nullptr : find_open(*stream, frame_id);
  if (slot == nullptr) return 0;
  const std::size_t words = slot->total_bytes / kWordBytes;
  const auto next = [&](std::size_t from, bool set) {
    while (from < words) {
      const std::uint64_t word = set ? slot->received[from / 64] : ~slot->received[from / 64];
      const std::uint64_t rest = word >> (from % 64);
      if (rest != 0)
        return std::min(words, from + static_cast<std::size_t>(std::countr_zero(rest)));
      from = (from / 64 + 1) * 64;
    }
    return words;
  };
  std::size_t count = 0;
  for (std::size_t at = next(0, false); at < words && count < out.size();) {
    const std::size_t end = next(at, true);
    if (end == words && !tail) break;
    out[count++] = {static_cast<std::uint32_t>(at * kWordBytes),
                    static_cast<std::uint32_t>((end - at) * kWordBytes)};
    at = next(end, false);
  }
  return count;
}

void Reassembler::give_up(std::uint16_t stream_id, std::uint32_t frame_id) noexcept {
  Stream* stream = nullptr;
  for (Stream& each : streams_) {
    if (each.id == stream_id) stream = &each;
  }
  if (stream == nullptr || find_open(*stream, frame_id) == nullptr) return;
  finish_older(*stream, frame_id + 1);
  finish_complete(*stream);
}

}  // namespace emit::protocol
