// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "emit/physics/check.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/limits.hpp"
#include "emit/protocol/frame_header.hpp"

/// Ring of frames in shared memory (docs/wire.md section 9). One daemon writes it; readers on the
/// same host map it read-only. A publication is the set of all channels' images of one frame; it
/// takes one slot. These classes make no system calls: the owner of the memory maps it, waits and
/// wakes.
namespace emit::protocol {

inline constexpr std::uint32_t kRingMagic = 0x534D4645;  ///< "EFMS" as bytes E F M S
inline constexpr std::uint16_t kRingVersion = 2;
inline constexpr std::uint32_t kMinRingSlots = physics::limits::kRingSlots.lo;
inline constexpr std::uint32_t kMaxRingSlots = physics::limits::kRingSlots.hi;
inline constexpr std::uint32_t kMaxRingChannels = 1024;

enum class RingState : std::uint32_t {
  running = 1,
  ended = 2,  ///< the daemon stopped in order: no more publications come
};

/// Head of the ring, at offset 0. Everything but the three atomics is fixed before readers see it.
struct RingHead {
  std::uint32_t magic;
  std::uint16_t version;
  std::uint16_t reserved_0;
  std::uint32_t slot_count;
  std::uint32_t channel_count;
  std::uint64_t object_bytes;
  std::uint64_t slot_bytes;  ///< distance from one slot to the next, bytes
  std::uint64_t slots_offset;
  std::uint64_t channels_offset;
  std::uint64_t welcome_offset;
  std::uint64_t welcome_bytes;
  /// Wall instant of the daemon's start, ns TAI. Another value means another run of the daemon.
  std::int64_t started_ns;
  std::uint64_t reserved_1[7];
  std::atomic<std::uint32_t> signal;  ///< futex: goes up with every publication and at the end
  std::atomic<std::uint32_t> state;   ///< RingState
  std::atomic<std::uint64_t> newest;  ///< number of the publication completed last; 0 = none yet
  std::uint64_t reserved_2[6];
};
static_assert(sizeof(RingHead) == 192 && offsetof(RingHead, object_bytes) == 16 &&
              offsetof(RingHead, started_ns) == 64 && offsetof(RingHead, signal) == 128 &&
              offsetof(RingHead, state) == 132 && offsetof(RingHead, newest) == 136);
static_assert(std::atomic<std::uint32_t>::is_always_lock_free &&
              std::atomic<std::uint64_t>::is_always_lock_free);

/// Place of a channel within every slot. Channels of one band and window share their pixels.
struct RingChannelEntry {
  std::uint64_t header_offset;
  std::uint64_t pixels_offset;
  std::uint64_t pixel_bytes;
  std::uint64_t reserved;
};
static_assert(sizeof(RingChannelEntry) == 32);

/// Head of a slot. The sequence is 2 p when the slot holds publication p, and 2 p - 1 while p is
/// being written.
struct RingSlotHead {
  std::atomic<std::uint64_t> sequence;
  std::uint64_t reserved[7];
};
static_assert(sizeof(RingSlotHead) == 64);

/// Layout of a ring.
struct RingParams {
  std::uint32_t slots = 8;                      ///< kMinRingSlots .. kMaxRingSlots
  std::vector<std::uint64_t> plane_bytes;       ///< pixel bytes of each distinct image
  std::vector<std::uint32_t> plane_of_channel;  ///< index into plane_bytes, for each channel
  std::span<const std::byte> welcome;           ///< encoded emit.v1.Welcome
  std::int64_t started_ns = 0;                  ///< wall instant of the daemon's start, ns TAI
};
/// Returns the length of a ring of these parameters, bytes.
/// @pre slots is in [kMinRingSlots, kMaxRingSlots], there are 1 to kMaxRingChannels channels, and
///   every entry of plane_of_channel is an index into plane_bytes
[[nodiscard]] std::uint64_t ring_bytes(const RingParams& params) noexcept;

/// Writer of the ring, in the daemon. Publications count from 1 and take the slots in turn.
/// Thread: one owner.  Real time: RT-safe after construction.
/// @code
///   writer.begin();
///   encode(header, writer.header(channel));
///   memcpy(writer.plane(0).data(), ...);   // in any number of pieces
///   writer.commit();                       // then wake the threads that wait on signal()
/// @endcode
class RingWriter {
 public:
  /// Lays the ring out in `memory`.
  /// @pre the parameters are valid for ring_bytes(); `memory` is zero, aligned to 64 bytes and at
  ///   least ring_bytes() long
  RingWriter(std::span<std::byte> memory, const RingParams& params);

  /// Takes the oldest slot for the next publication. Its readers notice from now on.
  void begin() noexcept;
  /// Returns the memory of a channel's frame header in the slot taken.
  /// @pre channel is an index into plane_of_channel
  [[nodiscard]] std::span<std::byte, kFrameHeaderBytes> header(std::size_t channel) noexcept;
  /// Returns the memory of an image's pixels in the slot taken.
  /// @pre plane is an index into plane_bytes
  [[nodiscard]] std::span<std::byte> plane(std::size_t plane) noexcept;
  /// Completes the publication and raises signal().
  void commit() noexcept;
  /// Marks the end of the ring and raises signal(). Nothing is published after it.
  void end() noexcept;

  /// Returns the futex that readers wait on.
  [[nodiscard]] std::atomic<std::uint32_t>& signal() noexcept { return head_->signal; }

 private:
  [[nodiscard]] std::byte* slot() noexcept;

  RingHead* head_;
  std::byte* memory_;
  std::vector<RingChannelEntry> channels_;
  std::vector<RingChannelEntry> planes_;  // header_offset unused
  // Number of the publication that is being written or was completed last.
  std::uint64_t publication_ = 0;
};

/// Reader of the ring. Nothing that it reads is trusted. It notices overwritten data by a second
/// look at the slot's sequence, behind the last byte that was used.
/// Thread: one owner.  Real time: RT-safe after opening.
/// @code
///   if (const auto view = reader.view(publication, channel)) {
///     use(view->header, view->pixels);
///     if (!reader.intact(publication)) forget_what_was_used();
///   }
/// @endcode
class RingReader {
 public:
  /// Opens a ring for reading.
  /// Errors (protocol): the memory is no ring, the version differs, or an offset lies outside
  /// `memory`.
  /// @pre `memory` is aligned to 64 bytes
  [[nodiscard]] static physics::Result<RingReader> open(std::span<const std::byte> memory);

  /// Header and pixels of one channel, in the shared memory.
  struct View {
    std::span<const std::byte> header;  ///< kFrameHeaderBytes long, not yet checked
    std::span<const std::byte> pixels;  ///< aligned to 64 bytes
  };
  /// Returns header and pixels of a channel. Returns nothing when the slot does not hold the
  /// publication, because it is not complete yet or was overwritten.
  /// @pre channel < channel_count()
  [[nodiscard]] std::optional<View> view(std::uint64_t publication,
                                         std::size_t channel) const noexcept;
  /// Returns false when the slot was taken for a newer publication since view(). The data read from
  /// it may then belong to two frames.
  [[nodiscard]] bool intact(std::uint64_t publication) const noexcept;

  /// Returns the number of the publication completed last; 0 = none yet.
  [[nodiscard]] std::uint64_t newest() const noexcept {
    return head_->newest.load(std::memory_order_acquire);
  }
  /// Returns true when the daemon stopped in order.
  [[nodiscard]] bool ended() const noexcept {
    return head_->state.load(std::memory_order_acquire) ==
           static_cast<std::uint32_t>(RingState::ended);
  }
  [[nodiscard]] const std::atomic<std::uint32_t>& signal() const noexcept { return head_->signal; }
  [[nodiscard]] std::uint32_t slot_count() const noexcept { return slot_count_; }
  [[nodiscard]] std::size_t channel_count() const noexcept { return channels_.size(); }
  /// Returns the length of a channel's pixels, bytes.
  /// @pre channel < channel_count()
  [[nodiscard]] std::uint64_t pixel_bytes(std::size_t channel) const noexcept {
    EMIT_CHECK_OP(channel, <, channels_.size());
    return channels_[channel].pixel_bytes;
  }
  /// Returns the wall instant of the daemon's start, ns TAI.
  [[nodiscard]] std::int64_t started_ns() const noexcept { return head_->started_ns; }
  /// Returns the encoded emit.v1.Welcome. Its contents are not checked.
  [[nodiscard]] std::span<const std::byte> welcome() const noexcept { return welcome_; }

 private:
  RingReader() = default;
  [[nodiscard]] const std::byte* slot(std::uint64_t publication) const noexcept;

  const RingHead* head_ = nullptr;
  const std::byte* slots_ = nullptr;
  // Copies of the checked values: the shared memory is not read a second time.
  std::uint32_t slot_count_ = 0;
  std::uint64_t slot_bytes_ = 0;
  std::vector<RingChannelEntry> channels_;
  std::span<const std::byte> welcome_;
};

/// Returns true for a valid name of a ring: 1 to 64 letters, digits, `_`, `-` and `.`, the first a
/// letter or digit. Such a name cannot form a path. RT-safe.
[[nodiscard]] bool is_shm_name(std::string_view text) noexcept;

}  // namespace emit::protocol
