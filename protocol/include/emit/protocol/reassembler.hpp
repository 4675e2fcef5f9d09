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

/// One bit per pixel, row-major: set = received.
class PixelValidity {
 public:
  PixelValidity() = default;
  PixelValidity(std::span<const std::uint64_t> words, std::size_t first_bit) noexcept
      : words_(words), first_bit_(first_bit) {}
  /// Precondition: index < width_px * height_px of the frame.
  [[nodiscard]] bool pixel(std::size_t index) const noexcept;
  /// True when every pixel of [begin, begin + count) arrived, for example of one row.
  [[nodiscard]] bool all(std::size_t begin, std::size_t count) const noexcept;

 private:
  std::span<const std::uint64_t> words_;
  std::size_t first_bit_ = 0;
};

/// A frame put together from fragments; valid until it is released.
struct ReceivedFrame {
  FrameHeader header;  ///< kFlagPartial: pixels are missing; kFlagLostBefore: frames_lost_before
  std::uint16_t stream_id = 0;
  std::uint32_t frame_id = 0;
  /// False: both copies of the header were lost. Size, format, band and channel are then those of
  /// the stream's previous frame, sim_time_ns is the fragments', everything else is 0.
  bool header_known = false;
  bool complete = false;  ///< every pixel arrived
  bool crc_ok = false;    ///< complete and the payload CRC matches (when it was checked)
  std::uint64_t missing_px = 0;
  std::uint32_t frames_lost_before = 0;  ///< frame ids between this and the one handed out before
  std::uint32_t repaired_fragments = 0;  ///< brought back by error correction
  std::uint32_t resent_fragments = 0;    ///< that came because they were asked for
  std::span<const float> pixels;         ///< missing ones are 0; aligned to 64 bytes
  PixelValidity validity;
};

/// Counts since construction; plain numbers for the owner's thread.
struct ReassemblerCounters {
  std::array<std::uint64_t, kFragmentStatusCount> fragments{};  ///< by FragmentStatus
  std::uint64_t frames_complete = 0;
  std::uint64_t frames_partial = 0;   ///< handed out with missing pixels
  std::uint64_t frames_unusable = 0;  ///< dropped: no header copy and no earlier frame to go by, or
                                      ///< a header that contradicts the fragments
  std::uint64_t frames_lost = 0;      ///< frame ids of which no fragment arrived
  std::uint64_t missing_px = 0;
  std::uint64_t crc_mismatches = 0;
  std::uint64_t resyncs = 0;              ///< a stream's frame ids started again
  std::uint64_t fragments_repaired = 0;   ///< brought back by error correction
  std::uint64_t frames_repaired = 0;      ///< complete because of that
  std::uint64_t groups_unrepairable = 0;  ///< of frames handed out: lost more than their parity
  std::uint64_t fragments_resent = 0;     ///< accepted ones that had been asked for
};

/// Bytes of a frame's byte stream.
struct ByteRange {
  std::uint32_t begin = 0;
  std::uint32_t bytes = 0;
  friend bool operator==(const ByteRange&, const ByteRange&) = default;
};

/// Puts frames together from fragments: lost, doubled, reordered, interleaved or corrupt ones.
///
/// Frames of one stream come out in order of frame id. A frame leaves as complete when its last
/// byte arrives or error correction brings it back, as partial when a newer frame of its stream
/// completes, when its buffer is needed, or on flush(). Trusts nothing: every offset and length is
/// checked before a byte is copied. Thread: one owner.  Real time: the constructor allocates,
/// everything else is RT-safe.
/// @code
///   reassembler.push(datagram);
///   while (const ReceivedFrame* frame = reassembler.pop()) {
///     use(*frame);
///     reassembler.release(frame);
///   }
/// @endcode
class Reassembler {
 public:
  struct Params {
    std::uint32_t max_payload_bytes = 0;    ///< largest frame accepted, pixels only
    std::uint32_t buffers = 4;              ///< frames held at once, in work and handed out; >= 2
    std::uint32_t max_open_per_stream = 2;  ///< newer frames push the oldest out beyond this; >= 1
    std::uint32_t max_streams = 8;
    bool check_crc = true;  ///< of complete frames
    FecParams fec = {};     ///< as agreed with the sender; off: parity fragments are refused
    /// A complete frame waits for older ones of its stream that may still be asked for: until they
    /// are complete, given up, or their buffers are needed.
    bool wait_for_missing = false;
  };
  explicit Reassembler(const Params& params);
  ~Reassembler();
  Reassembler(Reassembler&&) noexcept;
  Reassembler& operator=(Reassembler&&) noexcept;

  /// Takes one datagram; copies its payload.
  FragmentStatus push(std::span<const std::byte> datagram) noexcept;

  /// Where the next payloads belong if fragments go on coming in order: the part of the newest
  /// frame behind what has arrived. A receiver may have the kernel write payloads there at once and
  /// then push them from there, which spares the copy. Empty when fragments came out of order.
  struct Expected {
    std::span<std::byte> rest;  ///< to the end of the frame's byte stream
    FragmentHeader next;        ///< stream, frame, offset and length of the next fragment
  };
  [[nodiscard]] Expected expected() noexcept;
  /// Header and payload apart; a payload that lies where it belongs is not copied.
  FragmentStatus push(std::span<const std::byte> header,
                      std::span<const std::byte> payload) noexcept;

  /// Hands out the next finished frame or nullptr. Keep it until release(); buffers held are
  /// missing for new frames.
  [[nodiscard]] const ReceivedFrame* pop() noexcept;
  /// Precondition: `frame` came from pop() and was not released since.
  void release(const ReceivedFrame* frame) noexcept;

  /// Finishes every frame in work as partial: the stream ended or fell silent.
  void flush() noexcept;

  /// A frame of which something is missing.
  struct OpenFrame {
    std::uint32_t frame_id = 0;
    std::uint64_t arrivals = 0;  ///< goes up with everything that is taken for it
    bool end_seen = false;       ///< its last byte has arrived, or one of a newer frame
  };
  /// Frames of the stream in work and not complete, oldest first. Returns how many were written.
  [[nodiscard]] std::size_t open_frames(std::uint16_t stream_id,
                                        std::span<OpenFrame> out) const noexcept;
  /// What is missing of one of them, front to back; without `tail` only in front of what arrived:
  /// the rest may be on its way. Returns how many ranges were written.
  [[nodiscard]] std::size_t missing(std::uint16_t stream_id, std::uint32_t frame_id, bool tail,
                                    std::span<ByteRange> out) const noexcept;
  /// Hands the frame out as it is, and older ones before it.
  void give_up(std::uint16_t stream_id, std::uint32_t frame_id) noexcept;

  [[nodiscard]] const ReassemblerCounters& counters() const noexcept { return counters_; }

 private:
  struct Slot;
  struct Stream;

  /// What data and parity fragments alike say of their frame.
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
  std::vector<Slot*> ready_;  // ring of finished frames
  std::size_t ready_begin_ = 0;
  std::size_t ready_count_ = 0;
  std::uint64_t arrivals_ = 0;
  Slot* newest_ = nullptr;  // of the fragment accepted last
  std::optional<GroupDecoder> decoder_;
  std::vector<std::byte> scratch_;  // the last fragment of a frame, filled up with zeros
  ReassemblerCounters counters_;
};

}  // namespace emit::protocol
