// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "agents/sender/resend_window.hpp"
#include "agents/sender/sender_client.hpp"
#include "emit/protocol/fragment.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/protocol/parity.hpp"
#include "net/socket.hpp"

namespace emit::server {

/// A subscriber over TCP or UDP that gets one channel.
///
/// The receiver makes it with all memory. The sender borrows it and gives it back when it ends.
class SocketClient final : public SenderClient {
 public:
  struct Params {
    std::uint32_t connection = 0;
    const Channel* channel = nullptr;
    bool every_frame = false;
    std::uint32_t every_nth = 1;  ///< shows every n-th of the channel's frames
    bool udp = false;
    bool compression = false;         ///< tcp: waits for the encoded image
    TcpSocket* tcp_socket = nullptr;  ///< of the control connection; stays the receiver's
    UdpSocket udp_socket;             ///< connected to the client's port or group
    std::uint16_t stream_id = 0;
    std::uint32_t fragment_payload_bytes = 0;
    std::vector<std::byte> first_bytes;  ///< tcp: goes out before any frame
    protocol::FecParams fec = {};        ///< udp
    /// udp: frames that may be asked for again; 0: none
    std::uint32_t resend_frames = 0;
    double resend_max_frac = 0.0;  ///< of the bytes sent, that may be sent again
  };
  explicit SocketClient(Params params);

  void begin(const protocol::FrameHeader& header, const Image& image,
             std::int64_t now_ns) noexcept override;
  [[nodiscard]] Progress send(UdpBatch& batch, Context& context, Turn turn) noexcept override;
  /// Copies the image of the frame into this client's own memory.
  void spill() noexcept override;
  [[nodiscard]] bool may_ask_again() const noexcept override { return params_.resend_frames > 0; }
  [[nodiscard]] bool ask_again(const protocol::ResendRequest& request) noexcept override;
  void forget(std::uint64_t sequence) noexcept override;
  [[nodiscard]] std::optional<std::size_t> waits_for_encoding() const noexcept override {
    return waits_ ? std::optional(params_.channel->picture) : std::nullopt;
  }
  void take_encoded(std::span<const std::byte> bytes) noexcept override;
  [[nodiscard]] std::uint32_t connection() const noexcept override { return params_.connection; }
  [[nodiscard]] bool every_frame() const noexcept override { return params_.every_frame; }
  [[nodiscard]] bool wants(const protocol::FrameHeader& header,
                           ChannelSet channels) const noexcept override {
    // A frame that missed its number is shown under another one.
    return shows(channels) && (params_.every_nth == 1 || in_turn(header));
  }
  [[nodiscard]] bool misses(const protocol::FrameHeader& header,
                            ChannelSet channels) const noexcept override {
    return !shows(channels) && in_turn(header);
  }
  [[nodiscard]] int fd() const noexcept override {
    return params_.udp ? params_.udp_socket.fd() : params_.tcp_socket->fd();
  }

 private:
  [[nodiscard]] bool shows(ChannelSet channels) const noexcept {
    return (channels >> params_.channel->index & 1U) != 0;
  }
  [[nodiscard]] bool in_turn(const protocol::FrameHeader& header) const noexcept {
    return protocol::is_every_nth(header.frame_number,
                                  params_.every_nth * params_.channel->every_nth);
  }
  [[nodiscard]] Progress send_tcp(Context& context, Turn turn) noexcept;
  [[nodiscard]] Progress send_udp(UdpBatch& batch, Context& context, Turn turn) noexcept;
  void make_fragments(std::uint32_t frame_id) noexcept;
  void make_record() noexcept;

  Params params_;
  bool segmentation_ = false;
  std::size_t first_sent_ = 0;  // of params_.first_bytes
  std::uint64_t offset_ = 0;    // tcp: bytes of head and pixels sent
  std::uint32_t fragment_ = 0;  // udp: next fragment
  std::uint32_t frame_id_ = 0;
  std::array<std::byte, protocol::kRecordHeaderBytes + protocol::kFrameHeaderBytes> head_{};
  std::span<const std::byte> pixels_;  // as they go out
  bool waits_ = false;                 // until they are encoded
  protocol::FrameHeader out_;          // this client's, for its channel
  std::int64_t sim_time_ns_ = 0;
  std::optional<protocol::Fragmenter> fragments_;
  std::vector<std::byte> spill_;
  std::optional<protocol::ParityEncoder> parity_;
  std::uint32_t parity_sent_ = 0;  // datagrams of the frame on its way
  std::optional<ResendWindow> resend_;
};

}  // namespace emit::server
