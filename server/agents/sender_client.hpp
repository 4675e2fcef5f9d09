// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "app/context.hpp"
#include "emit/protocol/fragment.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/framing.hpp"
#include "io/socket.hpp"
#include "io/udp_batch.hpp"

namespace emit::server {

/// One subscriber: what it gets next and how far the frame on its way has got.
///
/// Made by the receiver with all memory, lent to the sender, given back when it ends.
/// Thread: its present owner's. Real time: RT-safe after construction.
class SenderClient {
 public:
  struct Params {
    std::uint32_t connection = 0;
    const Channel* channel = nullptr;
    bool every_frame = false;
    bool udp = false;
    TcpSocket* tcp_socket = nullptr;  ///< of the control connection; stays the receiver's
    UdpSocket udp_socket;             ///< connected to the client's port or group
    std::uint16_t stream_id = 0;
    std::uint32_t fragment_payload_bytes = 0;
    std::vector<std::byte> first_bytes;  ///< tcp: goes out before any frame
  };
  explicit SenderClient(Params params);

  enum class Progress : std::uint8_t { idle, more, blocked, retry_soon, finished, failed };

  /// Begins a frame; `header` is the common part. Precondition: !busy().
  void begin(const protocol::FrameHeader& header, std::span<const float> pixels,
             std::uint32_t crc32c, std::int64_t now_ns) noexcept;
  /// Hands a bounded amount to the kernel. `finished`: the frame's last byte went; call complete().
  [[nodiscard]] Progress send(UdpBatch& batch, Context& context) noexcept;
  /// Accounts for the frame whose last byte left now.
  void complete(std::int64_t now_ns) noexcept;
  /// Moves what is left of the frame on its way into this client's own memory, so that the source
  /// gets its slot back however slow the client is. Precondition: busy().
  void spill() noexcept;

  [[nodiscard]] bool busy() const noexcept { return busy_; }
  [[nodiscard]] bool spilled() const noexcept { return spilled_; }
  [[nodiscard]] int fd() const noexcept {
    return params_.udp ? params_.udp_socket.fd() : params_.tcp_socket->fd();
  }
  [[nodiscard]] const Params& params() const noexcept { return params_; }
  /// Of the frame begun last, as this client gets it.
  [[nodiscard]] const protocol::FrameHeader& header() const noexcept { return header_; }
  /// Why send() failed; for the log.
  [[nodiscard]] int error() const noexcept { return error_; }

  // The sender's book-keeping.
  std::uint64_t next = 0;        ///< sequence of the next publication this client is to get
  std::uint64_t in_transit = 0;  ///< sequence of the one on its way, while busy
  bool gap = false;              ///< publications before `next` were skipped
  bool blocked = false;          ///< waits for its socket to take more
  bool registered = false;       ///< known to the sender's epoll descriptor
  bool closing = false;          ///< ends as soon as the sender sees it

 private:
  [[nodiscard]] Progress send_tcp(Context& context) noexcept;
  [[nodiscard]] Progress send_udp(UdpBatch& batch, Context& context) noexcept;

  Params params_;
  bool busy_ = false;
  bool spilled_ = false;
  bool segmentation_ = false;
  int error_ = 0;
  std::size_t first_sent_ = 0;  // of params_.first_bytes
  std::uint64_t offset_ = 0;    // tcp: bytes of head and pixels sent
  std::uint32_t fragment_ = 0;  // udp: next fragment
  std::uint32_t frame_id_ = 0;
  std::array<std::byte, protocol::kRecordHeaderBytes + protocol::kFrameHeaderBytes> head_{};
  std::span<const std::byte> pixels_;
  std::optional<protocol::Fragmenter> fragments_;
  protocol::FrameHeader header_;
  std::int64_t previous_age_ns_ = 0;
  std::int64_t previous_delay_ns_ = 0;
  std::uint64_t previous_frame_number_ = 0;
  std::vector<std::byte> spill_;
};

}  // namespace emit::server
