// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/reassembler.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "emit/physics/check.hpp"
#include "frame_header_parse.hpp"
#include "reassembler_slot.hpp"

namespace emit::protocol {
namespace {

static_assert(std::endian::native == std::endian::little, "pixels are handed out as they arrive");

/// Largest distance, in frames, of a reordered fragment. After kResyncCount fragments in a row from
/// farther behind, the sender is assumed to have started again.
constexpr std::int32_t kReorderWindow = 64;
constexpr std::uint32_t kResyncCount = 16;
/// Largest gap in frame ids that counts as a loss. A wider one means that the sender started again.
constexpr std::uint32_t kMaxCountedGap = 65536;

/// Allocates zeroed memory for a frame.
AlignedBytes allocate_aligned(std::size_t count) {
  void* memory = ::operator new[](count, std::align_val_t{kPixelAlignment});
  std::memset(memory, 0, count);  // this also touches the pages, before frames are due
  return AlignedBytes(static_cast<std::byte*>(memory));
}

/// Returns true when a frame with this many pixel bytes can have this total length. The zero bytes
/// between the pixels and the second header are fewer than a header.
bool fits(std::uint32_t total_bytes, std::uint64_t payload_bytes) noexcept {
  const std::uint64_t min_total_bytes = payload_bytes + 2 * kFrameHeaderBytes;
  return payload_bytes <= total_bytes && min_total_bytes <= total_bytes &&
         total_bytes - min_total_bytes < kFrameHeaderBytes;
}

}  // namespace

bool PixelValidity::pixel(std::size_t index) const noexcept {
  const std::size_t bit = first_bit_ + index;
  EMIT_DCHECK_OP(bit / 64, <, words_.size());
  return ((words_[bit / 64] >> (bit % 64)) & 1u) != 0;
}

bool PixelValidity::all(std::size_t begin, std::size_t count) const noexcept {
  return bits::count_set(words_, first_bit_ + begin, count) == count;
}

Reassembler::Reassembler(const Params& params) : params_(params) {
  params_.max_open_per_stream = std::max(params_.max_open_per_stream, 1u);
  params_.buffers = std::max({params_.buffers, 2u, params_.max_open_per_stream + 1});
  params_.max_streams = std::max(params_.max_streams, 1u);
  params_.max_payload_bytes &= ~std::uint32_t{3};
  if (!params_.fec.valid()) params_.fec = {};
  const std::size_t capacity = std::size_t{params_.max_payload_bytes} + 3 * kFrameHeaderBytes;
  slots_.resize(params_.buffers);
  for (Slot& slot : slots_) {
    slot.bytes = allocate_aligned(capacity);
    slot.received.resize(capacity / kWordBytes / 64 + 1);
  }
  if (params_.fec.on()) {
    for (Slot& slot : slots_) {
      const auto max_bytes = static_cast<std::uint32_t>(capacity);
      slot.parity_bytes.resize(max_parity_bytes(params_.fec, max_bytes));
      slot.parity_arrived.resize(max_parity_groups(params_.fec, max_bytes));
    }
    scratch_.resize(kMaxFragmentPayloadBytes);
    decoder_.emplace(params_.fec);
  }
  streams_.reserve(params_.max_streams);
  ready_.resize(params_.buffers);
}

Reassembler::~Reassembler() = default;
Reassembler::Reassembler(Reassembler&&) noexcept = default;
Reassembler& Reassembler::operator=(Reassembler&&) noexcept = default;

FragmentStatus Reassembler::push(std::span<const std::byte> datagram) noexcept {
  const std::size_t header_bytes = std::min(datagram.size(), kFragmentHeaderBytes);
  return push(datagram.first(header_bytes), datagram.subspan(header_bytes));
}

FragmentStatus Reassembler::push(std::span<const std::byte> header,
                                 std::span<const std::byte> payload) noexcept {
  FragmentStatus status;
  if (is_parity(header)) {
    ParityHeader fields;
    status = decode_parity_header(header, payload.size(), params_.fec, fields);
    if (status == FragmentStatus::accepted) status = take_parity(fields, payload);
  } else {
    FragmentHeader fields;
    status = decode_fragment_header(header, payload.size(), fields);
    if (status == FragmentStatus::accepted) status = take(fields, payload);
  }
  ++counters_.fragments[static_cast<std::size_t>(status)];
  return status;
}

Reassembler::Expected Reassembler::expected() noexcept {
  if (newest_ == nullptr || newest_->state != Slot::State::open ||
      newest_->received_words * kWordBytes != newest_->prefix_bytes || newest_->all_received()) {
    return {};
  }
  Expected out;
  out.rest = {newest_->bytes.get() + newest_->prefix_bytes,
              newest_->total_bytes - newest_->prefix_bytes};
  out.next.stream_id = newest_->stream->id;
  out.next.frame_id = newest_->frame_id;
  out.next.byte_offset = static_cast<std::uint32_t>(newest_->prefix_bytes);
  out.next.payload_bytes = newest_->payload_bytes;
  return out;
}

Reassembler::Slot* Reassembler::enter(const FrameKey& key, FragmentStatus& status) noexcept {
  // The padding is shorter than a header, so the three headers that the constructor added always
  // suffice.
  if (key.total_bytes - 2 * kFrameHeaderBytes >=
      std::uint64_t{params_.max_payload_bytes} + kFrameHeaderBytes) {
    status = FragmentStatus::oversize;
    return nullptr;
  }
  Stream* stream = stream_of(key.stream_id);
  if (stream == nullptr) {
    status = FragmentStatus::too_many_streams;
    return nullptr;
  }
  if (stream->has_finished && frame_distance(key.frame_id, stream->finished_id) <= 0) {
    if (frame_distance(key.frame_id, stream->finished_id) > -kReorderWindow ||
        ++stream->far_behind < kResyncCount) {
      status = FragmentStatus::late;
      return nullptr;
    }
    while (Slot* slot = oldest_open(stream)) finish(*slot);
    stream->has_finished = false;
    stream->has_delivered = false;
    ++counters_.resyncs;
  }
  stream->far_behind = 0;

  Slot* slot = open_slot(*stream, key, status);
  if (slot == nullptr) return nullptr;
  if (slot->total_bytes != key.total_bytes || slot->sim_time_ns != key.sim_time_ns) {
    status = FragmentStatus::inconsistent;
    return nullptr;
  }
  return slot;
}

FragmentStatus Reassembler::take(const FragmentHeader& header,
                                 std::span<const std::byte> payload) noexcept {
  auto status = FragmentStatus::accepted;
  Slot* slot =
      enter({header.stream_id, header.frame_id, header.total_bytes, header.sim_time_ns}, status);
  if (slot == nullptr) return status;

  const std::size_t first_word = header.byte_offset / kWordBytes;
  const std::size_t words = payload.size() / kWordBytes;
  // When every byte received so far came in order, the next one in order is new.
  const bool in_order = header.byte_offset == slot->prefix_bytes &&
                        slot->received_words * kWordBytes == slot->prefix_bytes;
  const std::size_t present = in_order ? 0 : bits::count_set(slot->received, first_word, words);
  if (present == words) return FragmentStatus::duplicate;
  if (present != 0) return FragmentStatus::overlap;
  newest_ = slot;
  std::byte* const place = slot->bytes.get() + header.byte_offset;
  if (payload.data() != place) {
    std::memcpy(place, payload.data(), payload.size());
  }
  if (header.byte_offset == slot->prefix_bytes) {
    slot->prefix_bytes += payload.size();
    slot->payload_bytes = header.payload_bytes;
  }
  if (params_.check_crc) slot->sum(header.byte_offset, payload);
  bits::set_range(slot->received, first_word, words);
  slot->received_words += words;
  ++slot->arrivals;
  slot->end_seen = slot->end_seen || (header.flags & kFragmentLast) != 0;
  if ((header.flags & kFragmentResent) != 0) {
    ++slot->resent;
    ++counters_.fragments_resent;
  }
  if (slot->all_received()) {
    complete(*slot);
  } else if (slot->has_parity) {
    repair(*slot, header.byte_offset / slot->geometry.fragment_bytes % slot->geometry.groups);
  }
  return FragmentStatus::accepted;
}

void Reassembler::complete(Slot& slot) noexcept {
  Stream& stream = *slot.stream;
  if (params_.wait_for_missing && oldest_open(&stream) != &slot) return;
  finish_older(stream, slot.frame_id);
  finish(slot);
  finish_complete(stream);
}

/// Finishes the complete frames that waited for the one that has left.
void Reassembler::finish_complete(Stream& stream) noexcept {
  for (Slot* slot = oldest_open(&stream); slot != nullptr && slot->all_received();
       slot = oldest_open(&stream)) {
    finish(*slot);
  }
}

Reassembler::Stream* Reassembler::stream_of(std::uint16_t stream_id) noexcept {
  for (Stream& stream : streams_) {
    if (stream.id == stream_id) return &stream;
  }
  if (streams_.size() == params_.max_streams) return nullptr;
  Stream& stream = streams_.emplace_back();  // stays within the reserved capacity
  stream.id = stream_id;
  return &stream;
}

Reassembler::Slot* Reassembler::open_slot(Stream& stream, const FrameKey& key,
                                          FragmentStatus& status) noexcept {
  std::uint32_t open = 0;
  Slot* vacant = nullptr;
  for (Slot& slot : slots_) {
    if (slot.state == Slot::State::free) vacant = &slot;
    if (slot.state != Slot::State::open || slot.stream != &stream) continue;
    if (slot.frame_id == key.frame_id) return &slot;
    ++open;
  }
  if (open >= params_.max_open_per_stream) {
    Slot* oldest = oldest_open(&stream);
    if (oldest == nullptr || frame_distance(key.frame_id, oldest->frame_id) < 0) {
      status = FragmentStatus::late;
      return nullptr;
    }
    finish(*oldest);
    // A frame that was dropped as unusable leaves its slot free.
    if (vacant == nullptr && oldest->state == Slot::State::free) vacant = oldest;
    finish_complete(stream);
  }
  if (stream.has_finished && frame_distance(key.frame_id, stream.finished_id) <= 0) {
    status = FragmentStatus::late;  // a newer, complete frame has just left
    return nullptr;
  }
  if (vacant == nullptr) {
    // The next fragments find room when the consumer has taken this frame.
    if (Slot* oldest = oldest_open(nullptr)) {
      Stream& its_stream = *oldest->stream;
      finish_older(its_stream, oldest->frame_id);
      finish(*oldest);
      finish_complete(its_stream);
    }
    status = FragmentStatus::no_buffer;
    return nullptr;
  }
  vacant->state = Slot::State::open;
  vacant->stream = &stream;
  vacant->frame_id = key.frame_id;
  vacant->total_bytes = key.total_bytes;
  vacant->sim_time_ns = key.sim_time_ns;
  vacant->received_words = 0;
  vacant->prefix_bytes = 0;
  vacant->summed_bytes = 0;
  vacant->crc32c = 0;
  vacant->end_seen = false;
  vacant->arrivals = 0;
  vacant->repaired = 0;
  vacant->resent = 0;
  vacant->has_parity = false;
  vacant->opened_at = ++arrivals_;
  std::ranges::fill(vacant->received, std::uint64_t{0});
  return vacant;
}

Reassembler::Slot* Reassembler::oldest_open(const Stream* stream) noexcept {
  Slot* oldest = nullptr;
  for (Slot& slot : slots_) {
    if (slot.state != Slot::State::open || (stream != nullptr && slot.stream != stream)) continue;
    const bool older = oldest == nullptr ||
                       (stream != nullptr ? frame_distance(slot.frame_id, oldest->frame_id) < 0
                                          : slot.opened_at < oldest->opened_at);
    if (older) oldest = &slot;
  }
  return oldest;
}

void Reassembler::finish_older(Stream& stream, std::uint32_t frame_id) noexcept {
  for (Slot* slot = oldest_open(&stream);
       slot != nullptr && frame_distance(slot->frame_id, frame_id) < 0;
       slot = oldest_open(&stream)) {
    finish(*slot);
  }
}

/// Determines the header of a frame from either of its two copies or from the stream's frame before
/// it. Returns false when the frame is not usable.
bool Reassembler::identify(Slot& slot, FrameHeader& header, bool& known) noexcept {
  Stream& stream = *slot.stream;
  const std::span<const std::byte> bytes{slot.bytes.get(), slot.total_bytes};
  const std::size_t total_words = slot.total_bytes / kWordBytes;
  const bool has_first = slot.has_words(0, kHeaderWords);
  const bool has_second = slot.has_words(total_words - kHeaderWords, kHeaderWords);
  known = has_first && parse_frame_header(bytes, header) == HeaderFault::none;
  known = known || (has_second &&
                    parse_frame_header(bytes.last(kFrameHeaderBytes), header) == HeaderFault::none);
  bool usable = false;
  if (known) {
    usable = fits(slot.total_bytes, header.payload_bytes) &&
             header.payload_bytes <= params_.max_payload_bytes &&
             header.sim_time_ns == slot.sim_time_ns;
    if (usable) {
      stream.has_geometry = true;
      stream.geometry = header;
    }
  } else if (!has_first && !has_second && stream.has_geometry) {
    usable = fits(slot.total_bytes, stream.geometry.payload_bytes);
    header = FrameHeader{};
    header.format = stream.geometry.format;
    header.quantity = stream.geometry.quantity;
    header.channel_kind = stream.geometry.channel_kind;
    header.channel_index = stream.geometry.channel_index;
    header.width_px = stream.geometry.width_px;
    header.height_px = stream.geometry.height_px;
    header.band_lo_um = stream.geometry.band_lo_um;
    header.band_hi_um = stream.geometry.band_hi_um;
    header.payload_bytes = stream.geometry.payload_bytes;
    header.sim_time_ns = slot.sim_time_ns;
  }
  return usable;
}

void Reassembler::finish(Slot& slot) noexcept {
  Stream& stream = *slot.stream;
  ReceivedFrame& frame = slot.frame;
  frame = ReceivedFrame{};
  frame.stream_id = stream.id;
  frame.frame_id = slot.frame_id;

  if (stream.has_finished) {
    const std::uint32_t gap = slot.frame_id - stream.finished_id - 1;
    if (gap <= kMaxCountedGap) {
      counters_.frames_lost += gap;
    } else {
      ++counters_.resyncs;
      stream.has_delivered = false;
    }
  }
  stream.has_finished = true;
  stream.finished_id = slot.frame_id;

  FrameHeader header;
  bool known = false;
  if (!identify(slot, header, known)) {
    ++counters_.frames_unusable;
    slot.state = Slot::State::free;
    return;
  }

  const auto pixel_bytes = static_cast<std::size_t>(header.payload_bytes);
  const std::size_t pixel_count = pixel_bytes / kWordBytes;
  frame.header = header;
  // Only a receiver may set these flags.
  frame.header.flags &= ~kReceiverFlags;
  frame.header_known = known;
  frame.repaired_fragments = slot.repaired;
  frame.resent_fragments = slot.resent;
  if (stream.has_delivered) frame.frames_lost_before = slot.frame_id - stream.delivered_id - 1;
  if (frame.frames_lost_before > 0) frame.header.flags |= kFlagLostBefore;
  stream.has_delivered = true;
  stream.delivered_id = slot.frame_id;
  if (!slot.all_received()) {
    frame.missing_px = pixel_count - bits::count_set(slot.received, kHeaderWords, pixel_count);
  }
  frame.complete = frame.missing_px == 0;
  std::byte* pixel_memory = slot.bytes.get() + kFrameHeaderBytes;
  if (frame.complete) {
    ++counters_.frames_complete;
    counters_.frames_repaired += slot.repaired != 0 ? 1 : 0;
    if (params_.check_crc && known) {
      frame.crc_ok = slot.finish_sum(pixel_bytes) == header.payload_crc32c;
      if (!frame.crc_ok) ++counters_.crc_mismatches;
    }
  } else {
    ++counters_.frames_partial;
    counters_.groups_unrepairable += unrepaired_groups(slot);
    counters_.missing_px += frame.missing_px;
    frame.header.flags |= kFlagPartial;
    // The buffer still holds an earlier frame. Clear the missing pixels, so that nothing of it
    // shows.
    bits::for_each_word(kHeaderWords, pixel_count, [&](std::size_t index, std::uint64_t mask) {
      std::uint64_t missing = ~slot.received[index] & mask;
      for (; missing != 0; missing &= missing - 1) {
        const auto bit = static_cast<std::size_t>(std::countr_zero(missing));
        std::memset(slot.bytes.get() + (index * 64 + bit) * kWordBytes, 0, kWordBytes);
      }
    });
  }
  frame.pixels = {reinterpret_cast<const float*>(pixel_memory), pixel_count};
  frame.validity = PixelValidity(slot.received, kHeaderWords);
  slot.state = Slot::State::ready;
  ready_[(ready_begin_ + ready_count_) % ready_.size()] = &slot;
  ++ready_count_;
}

const ReceivedFrame* Reassembler::pop() noexcept {
  if (ready_count_ == 0) return nullptr;
  Slot* slot = ready_[ready_begin_];
  ready_begin_ = (ready_begin_ + 1) % ready_.size();
  --ready_count_;
  slot->state = Slot::State::held;
  return &slot->frame;
}

void Reassembler::release(const ReceivedFrame* frame) noexcept {
  const auto held = std::ranges::find_if(slots_, [frame](const Slot& slot) {
    return &slot.frame == frame && slot.state == Slot::State::held;
  });
  EMIT_CHECK(held != slots_.end());
  held->state = Slot::State::free;
}

void Reassembler::flush() noexcept {
  while (Slot* slot = oldest_open(nullptr)) {
    finish_older(*slot->stream, slot->frame_id);
    finish(*slot);
  }
}

}  // namespace emit::protocol
