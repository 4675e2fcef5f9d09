// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "emit/protocol/reassembler.hpp"
#include "io/client.hpp"
#include "io/socket.hpp"

namespace emit::server {

/// Fragments from a UDP socket into a reassembler; takes several datagrams per system call, joined
/// by the kernel (UDP_GRO) where it can.
class UdpFrameReceiver {
 public:
  /// `local`: this side's address of the control connection; a group is joined on its interface.
  /// Errors (io, invalid_argument).
  [[nodiscard]] static physics::Result<UdpFrameReceiver> open(const SocketContext& context,
                                                              const SocketAddress& peer,
                                                              const SocketAddress& local,
                                                              const SubscribeOptions& options);

  [[nodiscard]] int fd() const noexcept { return socket_.fd(); }
  [[nodiscard]] std::uint16_t port() const noexcept { return socket_.local_address().port(); }
  [[nodiscard]] std::uint64_t buffer_bytes() const noexcept { return buffer_bytes_; }
  /// Asks for room for `frames` frames of `frame_bytes`.
  void size_buffer(std::uint64_t frame_bytes);

  /// Takes what lies in the socket, at most one batch. Returns the datagrams taken.
  int take(protocol::Reassembler& reassembler, ReceiveCounters& counters);

 private:
  static constexpr std::size_t kBatch = 16;
  static constexpr std::size_t kDatagramBytes = 65536;
  static constexpr std::size_t kControlBytes = 64;

  explicit UdpFrameReceiver(UdpSocket socket);

  UdpSocket socket_;
  std::uint64_t buffer_bytes_ = 0;
  std::uint32_t drops_seen_ = 0;
  std::vector<std::byte> data_;
  std::vector<std::byte> control_;
};

}  // namespace emit::server
