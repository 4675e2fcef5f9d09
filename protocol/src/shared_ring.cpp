// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/shared_ring.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <new>

#include "emit/physics/check.hpp"

namespace emit::protocol {
namespace {

static_assert(std::endian::native == std::endian::little, "the ring holds native integers");

using physics::ErrorCode;
using physics::make_error;

constexpr std::uint64_t kPageBytes = 4096;
constexpr std::uint64_t kLineBytes = 64;

constexpr std::uint64_t align_up(std::uint64_t value, std::uint64_t to) noexcept {
  return (value + to - 1) / to * to;
}

/// Offsets and lengths of a ring, bytes.
struct Layout {
  std::uint64_t channels_offset = 0;
  std::uint64_t welcome_offset = 0;
  std::uint64_t slots_offset = 0;
  std::uint64_t first_plane_offset = 0;  // offset within a slot
  std::uint64_t slot_bytes = 0;
  std::uint64_t object_bytes = 0;
};

Layout layout_of(const RingParams& params) noexcept {
  const std::uint64_t channels = params.plane_of_channel.size();
  EMIT_CHECK_OP(params.slots, >=, kMinRingSlots);
  EMIT_CHECK_OP(params.slots, <=, kMaxRingSlots);
  EMIT_CHECK_OP(channels, >=, 1U);
  EMIT_CHECK_OP(channels, <=, kMaxRingChannels);
  for (const std::uint32_t plane : params.plane_of_channel) {
    EMIT_CHECK_OP(plane, <, params.plane_bytes.size());
  }
  Layout out;
  out.channels_offset = sizeof(RingHead);
  out.welcome_offset = out.channels_offset + channels * sizeof(RingChannelEntry);
  out.slots_offset = align_up(out.welcome_offset + params.welcome.size(), kPageBytes);
  // The pixels begin on a page of their own, because a mapping to a device or a pipe takes whole
  // pages.
  out.first_plane_offset =
      align_up(sizeof(RingSlotHead) + channels * kFrameHeaderBytes, kPageBytes);
  out.slot_bytes = out.first_plane_offset;
  for (const std::uint64_t bytes : params.plane_bytes) {
    out.slot_bytes += align_up(bytes, kPageBytes);
  }
  out.object_bytes = out.slots_offset + params.slots * out.slot_bytes;
  return out;
}

/// Returns true when the address is a multiple of kLineBytes.
bool is_aligned(const std::byte* memory) noexcept {
  return reinterpret_cast<std::uintptr_t>(memory) % kLineBytes == 0;
}

/// Returns true when [offset, offset + bytes) lies within [0, limit).
constexpr bool within(std::uint64_t offset, std::uint64_t bytes, std::uint64_t limit) noexcept {
  return offset <= limit && bytes <= limit - offset;
}

}  // namespace

std::uint64_t ring_bytes(const RingParams& params) noexcept {
  return layout_of(params).object_bytes;
}

RingWriter::RingWriter(std::span<std::byte> memory, const RingParams& params)
    : head_(nullptr), memory_(memory.data()) {
  const Layout layout = layout_of(params);
  EMIT_CHECK(is_aligned(memory.data()));
  EMIT_CHECK_OP(memory.size(), >=, layout.object_bytes);
  EMIT_DCHECK(std::ranges::all_of(memory, [](std::byte byte) { return byte == std::byte{0}; }));
  head_ = new (memory_) RingHead{};
  head_->magic = kRingMagic;
  head_->version = kRingVersion;
  head_->slot_count = params.slots;
  head_->channel_count = static_cast<std::uint32_t>(params.plane_of_channel.size());
  head_->object_bytes = layout.object_bytes;
  head_->slot_bytes = layout.slot_bytes;
  head_->slots_offset = layout.slots_offset;
  head_->channels_offset = layout.channels_offset;
  head_->welcome_offset = layout.welcome_offset;
  head_->welcome_bytes = params.welcome.size();
  head_->started_ns = params.started_ns;
  head_->state.store(static_cast<std::uint32_t>(RingState::running), std::memory_order_relaxed);

  std::uint64_t offset = layout.first_plane_offset;
  for (const std::uint64_t bytes : params.plane_bytes) {
    planes_.push_back({0, offset, bytes, 0});
    offset += align_up(bytes, kPageBytes);
  }
  for (std::size_t i = 0; i < params.plane_of_channel.size(); ++i) {
    RingChannelEntry entry = planes_[params.plane_of_channel[i]];
    entry.header_offset = sizeof(RingSlotHead) + i * kFrameHeaderBytes;
    channels_.push_back(entry);
  }
  std::memcpy(memory_ + layout.channels_offset, channels_.data(),
              channels_.size() * sizeof(RingChannelEntry));
  std::ranges::copy(params.welcome, memory_ + layout.welcome_offset);  // the welcome may be empty
  for (std::uint32_t i = 0; i < params.slots; ++i) {
    new (memory_ + layout.slots_offset + i * layout.slot_bytes) RingSlotHead{};
  }
}

std::byte* RingWriter::slot() noexcept {
  return memory_ + head_->slots_offset + publication_ % head_->slot_count * head_->slot_bytes;
}

void RingWriter::begin() noexcept {
  ++publication_;
  auto& sequence = std::launder(reinterpret_cast<RingSlotHead*>(slot()))->sequence;
  sequence.store(2 * publication_ - 1, std::memory_order_relaxed);
  // No byte of the new publication may be visible before the mark is.
  std::atomic_thread_fence(std::memory_order_release);
}

std::span<std::byte, kFrameHeaderBytes> RingWriter::header(std::size_t channel) noexcept {
  EMIT_CHECK_OP(channel, <, channels_.size());
  return std::span<std::byte, kFrameHeaderBytes>(slot() + channels_[channel].header_offset,
                                                 kFrameHeaderBytes);
}

std::span<std::byte> RingWriter::plane(std::size_t plane) noexcept {
  EMIT_CHECK_OP(plane, <, planes_.size());
  return {slot() + planes_[plane].pixels_offset,
          static_cast<std::size_t>(planes_[plane].pixel_bytes)};
}

void RingWriter::commit() noexcept {
  auto& sequence = std::launder(reinterpret_cast<RingSlotHead*>(slot()))->sequence;
  sequence.store(2 * publication_, std::memory_order_release);
  head_->newest.store(publication_, std::memory_order_release);
  head_->signal.fetch_add(1, std::memory_order_release);
}

void RingWriter::end() noexcept {
  head_->state.store(static_cast<std::uint32_t>(RingState::ended), std::memory_order_release);
  head_->signal.fetch_add(1, std::memory_order_release);
}

physics::Result<RingReader> RingReader::open(std::span<const std::byte> memory) {
  EMIT_CHECK(is_aligned(memory.data()));
  if (memory.size() < sizeof(RingHead)) {
    return make_error(ErrorCode::protocol, "too short for a ring of frames");
  }
  RingReader out;
  const auto* head = std::launder(reinterpret_cast<const RingHead*>(memory.data()));
  if (head->magic != kRingMagic) {
    return make_error(ErrorCode::protocol, "not a ring of frames");
  }
  if (head->version != kRingVersion) {
    return make_error(ErrorCode::protocol, fmt::format("ring version {}, this reader knows {}",
                                                       head->version, kRingVersion));
  }
  const std::uint64_t bytes = head->object_bytes;
  const std::uint64_t channel_count = head->channel_count;
  const std::uint64_t slots_offset = head->slots_offset;
  const std::uint64_t channels_offset = head->channels_offset;
  const std::uint64_t welcome_offset = head->welcome_offset;
  const std::uint64_t welcome_bytes = head->welcome_bytes;
  out.head_ = head;
  out.slot_count_ = head->slot_count;
  out.slot_bytes_ = head->slot_bytes;
  const bool sizes = bytes <= memory.size() && out.slot_count_ >= kMinRingSlots &&
                     out.slot_count_ <= kMaxRingSlots && channel_count >= 1 &&
                     channel_count <= kMaxRingChannels && slots_offset % kLineBytes == 0 &&
                     out.slot_bytes_ % kLineBytes == 0 && out.slot_bytes_ >= sizeof(RingSlotHead);
  if (!sizes || slots_offset > bytes ||
      out.slot_bytes_ > (bytes - slots_offset) / out.slot_count_ ||
      channels_offset % alignof(RingChannelEntry) != 0 ||
      !within(channels_offset, channel_count * sizeof(RingChannelEntry), bytes) ||
      !within(welcome_offset, welcome_bytes, bytes)) {
    return make_error(ErrorCode::protocol, "a ring of frames that contradicts itself");
  }
  out.slots_ = memory.data() + slots_offset;
  out.welcome_ = memory.subspan(static_cast<std::size_t>(welcome_offset),
                                static_cast<std::size_t>(welcome_bytes));
  out.channels_.resize(static_cast<std::size_t>(channel_count));
  std::memcpy(out.channels_.data(), memory.data() + channels_offset,
              out.channels_.size() * sizeof(RingChannelEntry));
  for (const RingChannelEntry& channel : out.channels_) {
    if (channel.header_offset < sizeof(RingSlotHead) || channel.pixels_offset % kLineBytes != 0 ||
        !within(channel.header_offset, kFrameHeaderBytes, out.slot_bytes_) ||
        !within(channel.pixels_offset, channel.pixel_bytes, out.slot_bytes_)) {
      return make_error(ErrorCode::protocol, "a ring of frames with a channel outside its slots");
    }
  }
  return out;
}

const std::byte* RingReader::slot(std::uint64_t publication) const noexcept {
  return slots_ + publication % slot_count_ * slot_bytes_;
}

std::optional<RingReader::View> RingReader::view(std::uint64_t publication,
                                                 std::size_t channel) const noexcept {
  EMIT_CHECK_OP(channel, <, channels_.size());
  const std::byte* const begin = slot(publication);
  const auto* head = std::launder(reinterpret_cast<const RingSlotHead*>(begin));
  if (publication == 0 || head->sequence.load(std::memory_order_acquire) != 2 * publication) {
    return std::nullopt;
  }
  const RingChannelEntry& entry = channels_[channel];
  return View{{begin + entry.header_offset, kFrameHeaderBytes},
              {begin + entry.pixels_offset, static_cast<std::size_t>(entry.pixel_bytes)}};
}

bool RingReader::intact(std::uint64_t publication) const noexcept {
  // Reads before this fence stay before the second look at the sequence.
  std::atomic_thread_fence(std::memory_order_acquire);
  const auto* head = std::launder(reinterpret_cast<const RingSlotHead*>(slot(publication)));
  return head->sequence.load(std::memory_order_relaxed) == 2 * publication;
}

bool is_shm_name(std::string_view text) noexcept {
  constexpr std::size_t kMaxCharacters = 64;
  const auto is_alphanumeric = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  };
  return !text.empty() && text.size() <= kMaxCharacters && is_alphanumeric(text.front()) &&
         std::all_of(text.begin(), text.end(), [&](char c) {
           return is_alphanumeric(c) || c == '_' || c == '-' || c == '.';
         });
}

}  // namespace emit::protocol
