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

/// Somebody who gets every publication: what it gets next and how far the one on its way has got.
///
/// Thread: its present owner's. Real time: RT-safe after construction.
class SenderClient {
 public:
  SenderClient() = default;
  SenderClient(const SenderClient&) = delete;
  SenderClient& operator=(const SenderClient&) = delete;
  virtual ~SenderClient() = default;

  enum class Progress : std::uint8_t { idle, more, blocked, retry_soon, finished, failed };

  /// Begins a publication; `header` is the common part. Precondition: !busy().
  virtual void begin(const protocol::FrameHeader& header, const Image& image,
                     std::int64_t now_ns) noexcept = 0;
  /// How much to move on: brief where others wait for their first byte.
  enum class Turn : std::uint8_t { brief, full };
  /// Moves a bounded amount on. `finished`: the last byte went; call complete().
  [[nodiscard]] virtual Progress send(UdpBatch& batch, Context& context, Turn turn) noexcept = 0;
  /// Picture that is to be encoded before send() has anything to do; none: it has.
  [[nodiscard]] virtual std::optional<std::size_t> waits_for_encoding() const noexcept {
    return std::nullopt;
  }
  /// Ends that: the encoded picture, which stays until the publication leaves the window, or
  /// nothing, where it did not become smaller. Precondition: waits_for_encoding().
  virtual void take_encoded(std::span<const std::byte> /*bytes*/) noexcept {}
  /// Makes what is left of the publication on its way independent of the source's memory, so that
  /// the source gets its slot back however slow the client is. Precondition: busy().
  virtual void spill() noexcept = 0;

  /// May ask for fragments again: the sender keeps publications as long as its window has room.
  [[nodiscard]] virtual bool may_ask_again() const noexcept { return false; }
  /// Takes a request on; what it may have goes out with the next send(). False: nothing of it.
  [[nodiscard]] virtual bool ask_again(const protocol::ResendRequest& /*request*/) noexcept {
    return false;
  }
  /// The publication leaves the window: its pixels are not to be touched any more.
  virtual void forget(std::uint64_t /*sequence*/) noexcept {}

  /// Key of the connection it belongs to.
  [[nodiscard]] virtual std::uint32_t connection() const noexcept = 0;
  /// Would rather be disconnected than skip a publication.
  [[nodiscard]] virtual bool every_frame() const noexcept { return false; }
  /// Whether a publication that `channels` show is to be sent.
  [[nodiscard]] virtual bool wants(const protocol::FrameHeader& /*header*/,
                                   ChannelSet /*channels*/) const noexcept {
    return true;
  }
  /// Whether one that is not wanted leaves a gap: it would have been, had it been ready for its
  /// channel.
  [[nodiscard]] virtual bool misses(const protocol::FrameHeader& /*header*/,
                                    ChannelSet /*channels*/) const noexcept {
    return false;
  }
  /// Turns writable when a blocked client can go on.
  [[nodiscard]] virtual int fd() const noexcept { return -1; }

  /// Accounts for the publication whose last byte left now.
  void complete(std::int64_t now_ns) noexcept;

  [[nodiscard]] bool busy() const noexcept { return busy_; }
  [[nodiscard]] bool spilled() const noexcept { return spilled_; }
  /// Of the publication begun last, as this client gets it.
  [[nodiscard]] const protocol::FrameHeader& header() const noexcept { return header_; }
  // Of the publication completed last; a frame without a host frame changes nothing.
  [[nodiscard]] std::int64_t delay_ns() const noexcept { return previous_delay_ns_; }
  [[nodiscard]] std::int64_t age_ns() const noexcept { return previous_age_ns_; }
  [[nodiscard]] std::int64_t jitter_ns() const noexcept {
    return static_cast<std::int64_t>(jitter_ns_);
  }
  /// |delay_ns() less the one before|; absent for the first, and without a host frame.
  [[nodiscard]] std::optional<std::int64_t> delay_change_ns() const noexcept {
    return delay_change_ns_;
  }
  /// Why send() failed; for the log.
  [[nodiscard]] int error() const noexcept { return error_; }

  // The sender's book-keeping.
  std::uint64_t next = 0;        ///< sequence of the next publication this client is to get
  std::uint64_t in_transit = 0;  ///< sequence of the one on its way, while busy
  bool gap = false;              ///< publications before `next` were skipped
  bool blocked = false;          ///< waits for its socket to take more
  bool registered = false;       ///< known to the sender's epoll descriptor
  bool closing = false;          ///< ends as soon as the sender sees it

 protected:
  /// Takes the common header over as this client's and marks it busy.
  void start(const protocol::FrameHeader& header, std::int64_t now_ns) noexcept;
  /// This client's header as it is for one channel.
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
