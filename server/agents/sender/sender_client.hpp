// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <span>

#include "agents/context.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/resend.hpp"
#include "net/udp_batch.hpp"

namespace emit::server {

/// A receiver of frames: the frame that it gets next, and the progress of the one on its way.
///
/// Thread: its present owner's. Real time: RT-safe after construction.
class SenderClient {
 public:
  SenderClient() = default;
  SenderClient(const SenderClient&) = delete;
  SenderClient& operator=(const SenderClient&) = delete;
  virtual ~SenderClient() = default;

  enum class Progress : std::uint8_t { idle, more, blocked, retry_soon, finished, failed };

  /// Begins a frame; `header` is the part that all clients share.
  /// @pre !busy()
  virtual void begin(const protocol::FrameHeader& header, const Image& image,
                     std::int64_t now_ns) noexcept = 0;
  /// Amount of work in one turn: brief while other clients wait for their first byte.
  enum class Turn : std::uint8_t { brief, full };
  /// Sends a bounded amount. `finished` means that the last byte was sent: call complete().
  [[nodiscard]] virtual Progress send(UdpBatch& batch, Context& context, Turn turn) noexcept = 0;
  /// Returns the index of the image that must be encoded before send() has anything to do; none:
  /// send() has something to do.
  [[nodiscard]] virtual std::optional<std::size_t> waits_for_encoding() const noexcept {
    return std::nullopt;
  }
  /// Takes the encoded image, which stays until the frame leaves the window, or nothing where it
  /// did not become smaller.
  /// @pre waits_for_encoding()
  virtual void take_encoded(std::span<const std::byte> /*bytes*/) noexcept {}
  /// Copies the rest of the frame on its way, so that the source gets its slot back however slow
  /// the client is.
  /// @pre busy()
  virtual void spill() noexcept = 0;

  /// Returns whether the client may ask for fragments again. The sender then keeps frames as long
  /// as its window has room.
  [[nodiscard]] virtual bool may_ask_again() const noexcept { return false; }
  /// Takes a request for missing fragments; those that are granted are sent by the next send().
  /// Returns false when none is.
  [[nodiscard]] virtual bool ask_again(const protocol::ResendRequest& /*request*/) noexcept {
    return false;
  }
  /// Returns true for a receiver of every frame that it wants. False: it looks at a frame now and
  /// then, its frames are in no count and no time, and no other client's turn gets shorter for it.
  [[nodiscard]] virtual bool is_stream() const noexcept { return true; }
  /// Returns the counter of frames that it does not want.
  [[nodiscard]] virtual Counter counter_of_unwanted() const noexcept {
    return Counter::frames_left_out;
  }
  /// Takes notice of a published frame, wanted or not.
  virtual void see(const protocol::FrameHeader& /*header*/) noexcept {}
  /// Notes that the frame leaves the window: its pixels must not be touched any more.
  virtual void forget(std::uint64_t /*sequence*/) noexcept {}

  /// Returns the key of the client's connection.
  [[nodiscard]] virtual std::uint32_t connection() const noexcept = 0;
  /// Returns whether the client wants to be disconnected rather than skip a frame.
  [[nodiscard]] virtual bool every_frame() const noexcept { return false; }
  /// Returns whether a frame that `channels` show must be sent.
  [[nodiscard]] virtual bool wants(const protocol::FrameHeader& /*header*/,
                                   ChannelSet /*channels*/) const noexcept {
    return true;
  }
  /// Returns true when a frame that is not wanted leaves a gap, because it would be wanted if it
  /// had been ready for its channel.
  [[nodiscard]] virtual bool misses(const protocol::FrameHeader& /*header*/,
                                    ChannelSet /*channels*/) const noexcept {
    return false;
  }
  /// Returns the descriptor that turns writable when a blocked client can go on.
  [[nodiscard]] virtual int fd() const noexcept { return -1; }

  /// Records the times of the frame whose last byte left now.
  void complete(std::int64_t now_ns) noexcept;

  [[nodiscard]] bool busy() const noexcept { return busy_; }
  [[nodiscard]] bool spilled() const noexcept { return spilled_; }
  /// Returns the header of the frame begun last, as this client gets it.
  [[nodiscard]] const protocol::FrameHeader& header() const noexcept { return header_; }
  // The functions below describe the frame completed last. A frame without a host frame changes
  // nothing.
  [[nodiscard]] std::int64_t delay_ns() const noexcept { return previous_delay_ns_; }
  [[nodiscard]] std::int64_t age_ns() const noexcept { return previous_age_ns_; }
  [[nodiscard]] std::int64_t jitter_ns() const noexcept {
    return static_cast<std::int64_t>(jitter_ns_);
  }
  /// Returns |delay_ns() less the previous one|; absent for the first, and without a host frame.
  [[nodiscard]] std::optional<std::int64_t> delay_change_ns() const noexcept {
    return delay_change_ns_;
  }
  /// Returns the reason why send() failed, for the log.
  [[nodiscard]] int error() const noexcept { return error_; }

  // The sender keeps its records of the client in the members below.
  std::uint64_t next = 0;        ///< sequence of the next frame this client is to get
  std::uint64_t in_transit = 0;  ///< sequence of the one on its way, while busy
  bool gap = false;              ///< frames before `next` were skipped
  bool blocked = false;          ///< waits for its socket to take more
  bool registered = false;       ///< known to the sender's epoll descriptor
  bool closing = false;          ///< ends as soon as the sender sees it

 protected:
  /// Copies the common header to this client and marks it busy.
  void start(const protocol::FrameHeader& header, std::int64_t now_ns) noexcept;
  /// Returns this client's header for one channel.
  [[nodiscard]] protocol::FrameHeader header_for(const Channel& channel,
                                                 const Image& image) const noexcept;

  bool busy_ = false;
  bool spilled_ = false;
  int error_ = 0;

 private:
  protocol::FrameHeader header_;
  std::int64_t previous_age_ns_ = 0;
  std::int64_t previous_delay_ns_ = 0;
  std::uint64_t previous_frame_number_ = 0;
  bool have_delay_ = false;
  double jitter_ns_ = 0.0;  // smoothed: FrameHeader::previous_jitter_ns
  std::optional<std::int64_t> delay_change_ns_;
};

}  // namespace emit::server
