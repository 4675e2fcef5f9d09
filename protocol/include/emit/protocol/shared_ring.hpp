// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/frame_header.hpp"

/// Ring of frames in memory that one daemon writes and readers on the same host map read-only
/// (docs/wire.md). No system calls: whoever made the memory maps it, waits and wakes.
namespace emit::protocol {

inline constexpr std::uint32_t kRingMagic = 0x534D4645;  ///< "EFMS" as bytes E F M S
inline constexpr std::uint16_t kRingVersion = 2;
inline constexpr std::uint32_t kMinRingSlots = 3;
inline constexpr std::uint32_t kMaxRingSlots = 1024;
inline constexpr std::uint32_t kMaxRingChannels = 1024;

enum class RingState : std::uint32_t {
  running = 1,
  ended = 2,  ///< the daemon stopped in order: nothing more comes
};

/// What the memory begins with. Everything but the three atomics is fixed before readers see it.
struct RingHead {
  std::uint32_t magic;
  std::uint16_t version;
  std::uint16_t reserved_0;
  std::uint32_t slot_count;
  std::uint32_t channel_count;
  std::uint64_t object_bytes;
  std::uint64_t slot_bytes;  ///< from one slot to the next
  std::uint64_t slots_offset;
  std::uint64_t channels_offset;
  std::uint64_t welcome_offset;
  std::uint64_t welcome_bytes;
  std::int64_t started_ns;  ///< wall instant: another one is another run of the daemon
  std::uint64_t reserved_1[7];
  std::atomic<std::uint32_t> signal;  ///< futex: goes up with every publication and at the end
  std::atomic<std::uint32_t> state;   ///< RingState
  std::atomic<std::uint64_t> newest;  ///< publication that was completed last; 0 = none yet
  std::uint64_t reserved_2[6];
};
static_assert(sizeof(RingHead) == 192 && offsetof(RingHead, object_bytes) == 16 &&
              offsetof(RingHead, started_ns) == 64 && offsetof(RingHead, signal) == 128 &&
              offsetof(RingHead, state) == 132 && offsetof(RingHead, newest) == 136);
static_assert(std::atomic<std::uint32_t>::is_always_lock_free &&
              std::atomic<std::uint64_t>::is_always_lock_free);

/// Where a channel lies in every slot. Channels of one band share their pixels.
struct RingChannelEntry {
  std::uint64_t header_offset;
  std::uint64_t pixels_offset;
  std::uint64_t pixel_bytes;
  std::uint64_t reserved;
};
static_assert(sizeof(RingChannelEntry) == 32);

/// What a slot begins with: 2 p when it holds publication p, 2 p - 1 while that is being written.
struct RingSlotHead {
  std::atomic<std::uint64_t> sequence;
  std::uint64_t reserved[7];
};
static_assert(sizeof(RingSlotHead) == 64);

struct RingParams {
  std::uint32_t slots = 8;                      ///< kMinRingSlots .. kMaxRingSlots
  std::vector<std::uint64_t> plane_bytes;       ///< pixels of each distinct image
  std::vector<std::uint32_t> plane_of_channel;  ///< by channel index
  std::span<const std::byte> welcome;           ///< emit.v1.Welcome
  std::int64_t started_ns = 0;
};
/// Bytes that a ring of these parameters takes. Precondition: the parameters make sense.
[[nodiscard]] std::uint64_t ring_bytes(const RingParams& params) noexcept;

/// The daemon's end. Publications count from 1 and take the slots in turn.
/// Thread: one owner.  Real time: RT-safe after construction.
/// @code
///   writer.begin();
///   encode(header, writer.header(channel));
///   memcpy(writer.plane(0).data(), ...);   // in as many pieces as one likes
///   writer.commit();                       // then wake who waits on signal()
/// @endcode
class RingWriter {
 public:
  /// Lays the ring out. Preconditions: `memory` is zero, aligned to 64 bytes and ring_bytes() long.
  RingWriter(std::span<std::byte> memory, const RingParams& params);

  /// Takes the oldest slot: from here on readers of it notice.
  void begin() noexcept;
  [[nodiscard]] std::span<std::byte, kFrameHeaderBytes> header(std::size_t channel) noexcept;
  [[nodiscard]] std::span<std::byte> plane(std::size_t plane) noexcept;
  void commit() noexcept;
  /// Nothing more comes.
  void end() noexcept;

  [[nodiscard]] std::atomic<std::uint32_t>& signal() noexcept { return head_->signal; }

 private:
  [[nodiscard]] std::byte* slot() noexcept;

  RingHead* head_;
  std::byte* memory_;
  std::vector<RingChannelEntry> channels_;
  std::vector<RingChannelEntry> planes_;  // header_offset unused
  std::uint64_t publication_ = 0;         // being written, or completed last
};

/// A reader's end. Nothing that it reads is trusted; what was overwritten is noticed, because the
/// slot's sequence is looked at again behind the last byte that was used.
/// Thread: one owner.  Real time: RT-safe after opening.
/// @code
///   if (const auto view = reader.view(publication, channel)) {
///     use(view->header, view->pixels);
///     if (!reader.intact(publication)) forget_what_was_used();
///   }
/// @endcode
class RingReader {
 public:
  /// Errors (protocol): not a ring, another version, offsets outside `memory`.
  /// Precondition: aligned to 64 bytes.
  [[nodiscard]] static physics::Result<RingReader> open(std::span<const std::byte> memory);

  struct View {
    std::span<const std::byte> header;  ///< kFrameHeaderBytes, not yet checked
    std::span<const std::byte> pixels;  ///< aligned to 64 bytes
  };
  /// Nothing when the publication is not there, not yet or no more. Precondition: channel <
  /// channel_count().
  [[nodiscard]] std::optional<View> view(std::uint64_t publication,
                                         std::size_t channel) const noexcept;
  /// False: since view() the slot was taken for a newer publication, so what was read from it may
  /// be of both.
  [[nodiscard]] bool intact(std::uint64_t publication) const noexcept;

  [[nodiscard]] std::uint64_t newest() const noexcept {
    return head_->newest.load(std::memory_order_acquire);
  }
  [[nodiscard]] bool ended() const noexcept {
    return head_->state.load(std::memory_order_acquire) ==
           static_cast<std::uint32_t>(RingState::ended);
  }
  [[nodiscard]] const std::atomic<std::uint32_t>& signal() const noexcept { return head_->signal; }
  [[nodiscard]] std::uint32_t slot_count() const noexcept { return slot_count_; }
  [[nodiscard]] std::size_t channel_count() const noexcept { return channels_.size(); }
  [[nodiscard]] std::uint64_t pixel_bytes(std::size_t channel) const noexcept {
    return channels_[channel].pixel_bytes;
  }
  [[nodiscard]] std::int64_t started_ns() const noexcept { return head_->started_ns; }
  [[nodiscard]] std::span<const std::byte> welcome() const noexcept { return welcome_; }

 private:
  RingReader() = default;
  [[nodiscard]] const std::byte* slot(std::uint64_t publication) const noexcept;

  const RingHead* head_ = nullptr;
  const std::byte* slots_ = nullptr;
  std::uint32_t slot_count_ = 0;  // as checked: the memory itself is not asked twice
  std::uint64_t slot_bytes_ = 0;
  std::vector<RingChannelEntry> channels_;
  std::span<const std::byte> welcome_;
};

/// 1 to 64 letters, digits, `_`, `-` and `.`, the first a letter or digit: no path can come of it.
[[nodiscard]] bool is_shm_name(std::string_view text) noexcept;

}  // namespace emit::protocol
