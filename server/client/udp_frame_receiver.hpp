// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/socket.h>
#include <sys/uio.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "emit/client/client.hpp"
#include "emit/protocol/ip_address.hpp"
#include "emit/protocol/reassembler.hpp"
#include "net/socket.hpp"

namespace emit::client {

/// Fragments from a UDP socket into a reassembler; takes several datagrams per system call, joined
/// by the kernel (UDP_GRO) where it can. While fragments come in order, the kernel writes their
/// payloads straight to where the reassembler wants them; what turns out to be something else is
/// brought together and pushed in the ordinary way.
class UdpFrameReceiver {
 public:
  /// `peer`: the daemon's address of the control connection; of its family, datagrams from others
  /// are bad, whatever their port. `local`: this side's; a group is joined on its interface.
  /// Errors (io, invalid_argument).
  [[nodiscard]] static physics::Result<UdpFrameReceiver> open(const server::SocketContext& context,
                                                              const server::SocketAddress& peer,
                                                              const server::SocketAddress& local,
                                                              const SubscribeOptions& options);

  [[nodiscard]] int fd() const noexcept { return socket_.fd(); }
  [[nodiscard]] std::uint16_t port() const noexcept { return socket_.local_address().port(); }
  [[nodiscard]] std::uint64_t buffer_bytes() const noexcept { return buffer_bytes_; }
  /// Asks for room for `frames` frames of `frame_bytes`.
  void size_buffer(std::uint64_t frame_bytes);
  /// Fragments of other streams are foreign. Before the first take().
  void expect_stream(std::uint16_t stream_id) noexcept { stream_id_ = stream_id; }

  static constexpr unsigned kBatch = 16;  ///< messages
  static constexpr std::size_t kDatagramBytes = 65536;
  /// Largest number of bytes that one take() receives.
  static constexpr std::uint64_t kMaxTakenBytes = kBatch * kDatagramBytes;

  /// Takes what lies in the socket, at most one batch. Returns the datagrams taken.
  int take(protocol::Reassembler& reassembler, ReceiveCounters& counters);
  /// True when the last take() left nothing in the socket.
  [[nodiscard]] bool drained() const noexcept { return drained_; }
  /// Messages so far that were not received to their place, but brought there.
  [[nodiscard]] std::uint64_t misplaced() const noexcept { return misplaced_; }

 private:
  // Number of joined datagrams taken at a time. It is small, so that they are still in the cache
  // when they are put together.
  static constexpr unsigned kJoinedBatch = 4;
  static constexpr std::size_t kControlBytes = 64;
  static constexpr std::size_t kMaxSegments = 64;  // datagrams that the kernel joins

  /// One message of a batch: where the kernel was told to put it, and what came.
  struct Message {
    std::size_t planned = 0;  // datagrams whose payloads go to their place; 0: all to data()
    std::size_t bytes = 0;
    std::size_t segment_bytes = 0;
    std::array<std::array<std::byte, protocol::kFragmentHeaderBytes>, kMaxSegments> headers;
    std::array<iovec, 2 * kMaxSegments + 1> iov;
  };
  using Expected = protocol::Reassembler::Expected;

  UdpFrameReceiver(server::UdpSocket socket, const server::SocketAddress& peer);
  [[nodiscard]] std::byte* data(std::size_t index) noexcept {
    return data_.data() + index * kDatagramBytes;
  }
  std::size_t plan(std::size_t index, const Expected& expected, std::size_t from) noexcept;
  void read_control(std::size_t index, ReceiveCounters& counters) noexcept;
  [[nodiscard]] bool as_planned(const Message& message, const Expected& expected,
                                std::size_t from) const noexcept;
  void bring_together(std::size_t index) noexcept;
  [[nodiscard]] bool from_peer(std::size_t index) const noexcept;
  static void count(protocol::FragmentStatus status, ReceiveCounters& counters) noexcept;
  void push_planned(const Message& message, protocol::Reassembler& reassembler,
                    ReceiveCounters& counters);
  void push_data(std::size_t index, protocol::Reassembler& reassembler, ReceiveCounters& counters);

  server::UdpSocket socket_;
  protocol::IpAddress peer_;
  std::uint16_t stream_id_ = 0;
  bool drained_ = true;
  std::uint64_t misplaced_ = 0;
  std::size_t segments_ = 1;  // joined in the messages before
  std::uint64_t buffer_bytes_ = 0;
  std::uint32_t drops_seen_ = 0;
  std::vector<std::byte> data_;
  std::vector<std::byte> control_;
  std::vector<Message> messages_;
  std::vector<sockaddr_storage> sources_;
  std::vector<mmsghdr> headers_;
};

}  // namespace emit::client
