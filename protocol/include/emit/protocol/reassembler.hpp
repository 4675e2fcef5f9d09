// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "emit/protocol/fragment.hpp"
#include "emit/protocol/parity.hpp"

namespace emit::protocol {

/// Map of the pixels that have arrived: one bit per pixel, row-major. It points into the memory of
/// the reassembler and is valid as long as its frame.
class PixelValidity {
 public:
  PixelValidity() = default;
  PixelValidity(std::span<const std::uint64_t> words, std::size_t first_bit) noexcept
      : words_(words), first_bit_(first_bit) {}
  /// Returns true when the pixel has arrived.
  /// @pre index < width_px * height_px of the frame
  [[nodiscard]] bool pixel(std::size_t index) const noexcept;
  /// Returns true when every pixel of [begin, begin + count) has arrived, for example those of one
  /// row.
  /// @pre begin + count <= width_px * height_px of the frame
  [[nodiscard]] bool all(std::size_t begin, std::size_t count) const noexcept;

 private:
  std::span<const std::uint64_t> words_;
  std::size_t first_bit_ = 0;
};

/// Frame put together from fragments. It is valid until it is released.
struct ReceivedFrame {
  /// kFlagPartial: pixels are missing; kFlagLostBefore: frames_lost_before > 0.
  FrameHeader header;
  std::uint16_t stream_id = 0;
  std::uint32_t frame_id = 0;
  /// False when both copies of the header were lost. Size, format, band and channel are then those
  /// of the stream's previous frame, sim_time_ns is the one of the fragments, everything else is 0.
  bool header_known = false;
  bool complete = false;  ///< true when every pixel arrived
  /// True when the frame is complete and its payload CRC was checked and matches.
  bool crc_ok = false;
  std::uint64_t missing_px = 0;
  /// Number of frame ids between this frame and the one handed out before it.
  std::uint32_t frames_lost_before = 0;
  std::uint32_t repaired_fragments = 0;  ///< number of fragments that error correction restored
  /// Number of fragments that arrived because they were requested.
  std::uint32_t resent_fragments = 0;
  std::span<const float> pixels;  ///< pixels, aligned to 64 bytes; missing ones are 0
  PixelValidity validity;
};

/// Counters since construction. They are plain numbers for the owner's thread.
struct ReassemblerCounters {
  /// Number of fragments by FragmentStatus.
  std::array<std::uint64_t, kFragmentStatusCount> fragments{};
  std::uint64_t frames_complete = 0;
  std::uint64_t frames_partial = 0;  ///< frames handed out with missing pixels
  /// Frames dropped: no copy of the header arrived and no earlier frame gives the geometry, or the
  /// header contradicts the fragments.
  std::uint64_t frames_unusable = 0;
  std::uint64_t frames_lost = 0;  ///< number of frame ids of which no fragment arrived
  std::uint64_t missing_px = 0;
  std::uint64_t crc_mismatches = 0;
  std::uint64_t resyncs = 0;             ///< number of restarts of a stream's frame ids
  std::uint64_t fragments_repaired = 0;  ///< fragments that error correction restored
  std::uint64_t frames_repaired = 0;     ///< frames that are complete because of error correction
  /// Groups of frames handed out that lost more fragments than they had parity fragments.
  std::uint64_t groups_unrepairable = 0;
  std::uint64_t fragments_resent = 0;  ///< accepted fragments that had been requested
};

/// Range of bytes in a frame's byte stream.
struct ByteRange {
  std::uint32_t begin = 0;
  std::uint32_t bytes = 0;
  friend bool operator==(const ByteRange&, const ByteRange&) = default;
};

/// Puts frames together from fragments, which may be lost, doubled, reordered, interleaved or
/// corrupt.
///
/// Frames of one stream come out in the order of their frame ids. A frame leaves as complete when
/// its last byte arrives or error correction restores it. It leaves as partial when a newer frame
/// of its stream completes, when its buffer is needed, or on flush(). Nothing is trusted: every
/// offset and length is checked before a byte is copied.
/// Thread: one owner.  Real time: the constructor allocates, everything else is RT-safe.
/// @code
///   reassembler.push(datagram);
///   while (const ReceivedFrame* frame = reassembler.pop()) {
///     use(*frame);
///     reassembler.release(frame);
///   }
/// @endcode
class Reassembler {
 public:
  /// Limits and options. Values out of range are raised to the lowest valid one.
  struct Params {
    /// Largest number of pixel bytes of a frame that is accepted.
    std::uint32_t max_payload_bytes = 0;
    /// Number of frames held at once, in work or handed out; at least 2.
    std::uint32_t buffers = 4;
    /// Largest number of frames of a stream in work, at least 1. A further one pushes the oldest
    /// out.
    std::uint32_t max_open_per_stream = 2;
    std::uint32_t max_streams = 8;  ///< largest number of streams; at least 1
    bool check_crc = true;          ///< true: the payload CRC of complete frames is checked
    FecParams fec = {};  ///< parameters agreed with the sender; off refuses parity fragments
    /// True: a complete frame waits for older ones of its stream that may still be requested. It
    /// waits until they are complete, given up, or their buffers are needed.
    bool wait_for_missing = false;
  };
  explicit Reassembler(const Params& params);
  ~Reassembler();
  Reassembler(Reassembler&&) noexcept;
  Reassembler& operator=(Reassembler&&) noexcept;

  /// Takes one datagram and copies its payload.
  FragmentStatus push(std::span<const std::byte> datagram) noexcept;

  /// Place of the next payloads if fragments continue to arrive in order: the part of the newest
  /// frame behind what has arrived. A receiver may let the kernel write payloads there and then
  /// push them from there, which spares the copy. It is empty when fragments came out of order.
  struct Expected {
    /// Memory from the next payload to the end of the frame's byte stream.
    std::span<std::byte> rest;
    FragmentHeader next;  ///< stream, frame, offset and length of the next fragment
  };
  /// Returns the place of the next payloads.
  [[nodiscard]] Expected expected() noexcept;
  /// Takes a datagram whose header and payload lie apart. A payload that already lies in its place
  /// is not copied.
  FragmentStatus push(std::span<const std::byte> header,
                      std::span<const std::byte> payload) noexcept;

  /// Hands out the next finished frame, or nullptr. The caller holds it until release(); its buffer
  /// is not available to new frames until then.
  [[nodiscard]] const ReceivedFrame* pop() noexcept;
  /// Returns a frame to the reassembler.
  /// @pre `frame` came from pop() and was not released since
  void release(const ReceivedFrame* frame) noexcept;

  /// Finishes every frame in work as partial. Call it when the stream ended or fell silent.
  void flush() noexcept;

  /// State of a frame in work that is not complete.
  struct OpenFrame {
    std::uint32_t frame_id = 0;
    std::uint64_t arrivals = 0;  ///< number of fragments taken for the frame
    bool end_seen = false;  ///< true when its last byte has arrived, or a byte of a newer frame
  };
  /// Writes the incomplete frames of the stream that are in work, oldest first. Returns how many
  /// were written.
  [[nodiscard]] std::size_t open_frames(std::uint16_t stream_id,
                                        std::span<OpenFrame> out) const noexcept;
  /// Writes the missing ranges of such a frame, front to back. Returns how many were written.
  /// @param tail  false: only ranges in front of bytes that arrived, because the rest may be on its
  ///   way
  [[nodiscard]] std::size_t missing(std::uint16_t stream_id, std::uint32_t frame_id, bool tail,
                                    std::span<ByteRange> out) const noexcept;
  /// Finishes the frame as it is, after the older ones of its stream.
  void give_up(std::uint16_t stream_id, std::uint32_t frame_id) noexcept;

  [[nodiscard]] const ReassemblerCounters& counters() const noexcept { return counters_; }

 private:
  struct Slot;
  struct Stream;

  /// Fields that data fragments and parity fragments share.
  struct FrameKey {
    std::uint16_t stream_id = 0;
    std::uint32_t frame_id = 0;
    std::uint32_t total_bytes = 0;
    std::int64_t sim_time_ns = 0;
  };
  [[nodiscard]] FragmentStatus take(const FragmentHeader& header,
                                    std::span<const std::byte> payload) noexcept;
  [[nodiscard]] FragmentStatus take_parity(const ParityHeader& header,
                                           std::span<const std::byte> payload) noexcept;
  [[nodiscard]] Slot* enter(const FrameKey& key, FragmentStatus& status) noexcept;
  [[nodiscard]] Stream* stream_of(std::uint16_t stream_id) noexcept;
  [[nodiscard]] const Stream* known_stream(std::uint16_t stream_id) const noexcept;
  [[nodiscard]] Slot* open_slot(Stream& stream, const FrameKey& key,
                                FragmentStatus& status) noexcept;
  [[nodiscard]] const Slot* find_open(const Stream& stream, std::uint32_t frame_id) const noexcept;
  [[nodiscard]] Slot* oldest_open(const Stream* stream) noexcept;
  void repair(Slot& slot, std::uint32_t group) noexcept;
  [[nodiscard]] std::uint32_t unrepaired_groups(const Slot& slot) const noexcept;
  void complete(Slot& slot) noexcept;
  void finish(Slot& slot) noexcept;
  void finish_older(Stream& stream, std::uint32_t frame_id) noexcept;
  void finish_complete(Stream& stream) noexcept;
  [[nodiscard]] bool identify(Slot& slot, FrameHeader& header, bool& known) noexcept;

  Params params_;
  std::vector<Slot> slots_;
  std::vector<Stream> streams_;
  std::vector<Slot*> ready_;  // ring of finished frames, in the order of pop()
  std::size_t ready_begin_ = 0;
  std::size_t ready_count_ = 0;
  std::uint64_t arrivals_ = 0;
  Slot* newest_ = nullptr;  // slot of the fragment accepted last
  std::optional<GroupDecoder> decoder_;
  std::vector<std::byte> scratch_;  // last fragment of a frame, filled up with zeros
  ReassemblerCounters counters_;
};

}  // namespace emit::protocol
