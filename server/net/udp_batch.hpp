// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/socket.h>
#include <sys/uio.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "emit/protocol/fragment.hpp"

namespace emit::server {

/// Sends consecutive fragments of a frame from the caller's pixel memory: many per system call, by
/// generic segmentation offload where the kernel and the path's MTU allow it, else sendmmsg. Works
/// on the native descriptor of a UdpSocket: Asio knows neither control messages nor sendmmsg.
/// Thread: one owner; shared by all clients of it. Real time: RT-safe after construction.
class UdpBatch {
 public:
  UdpBatch();

  enum class Status : std::uint8_t { sent, would_block, no_buffers, no_segmentation, failed };
  struct Result {
    Status status = Status::sent;
    std::uint32_t fragments = 0;  ///< handed to the kernel
    std::uint64_t bytes = 0;
    int error = 0;  ///< errno of failed and no_segmentation
  };

  /// One call's worth of fragments from `first` on, over a connected socket.
  [[nodiscard]] Result send(int fd, const protocol::Fragmenter& fragments, std::uint32_t first,
                            bool segmentation) noexcept;
  /// One call's worth of these fragments of a frame, with `more_flags` in their headers.
  [[nodiscard]] Result send_some(int fd, const protocol::Fragmenter& fragments,
                                 std::span<const std::uint32_t> indices,
                                 std::uint8_t more_flags) noexcept;
  /// One call's worth of datagrams of `datagram_bytes` each that lie one behind the other.
  [[nodiscard]] Result send_datagrams(int fd, std::span<const std::byte> datagrams,
                                      std::uint32_t datagram_bytes, bool segmentation) noexcept;
  static constexpr std::size_t kMaxBatch = 64;  ///< limit of UDP_SEGMENT on older kernels

 private:
  static constexpr std::size_t kPieces = 5;

  [[nodiscard]] Result send_segmented(int fd, std::uint32_t count, std::size_t iov_count,
                                      std::uint64_t bytes, std::uint32_t segment_bytes) noexcept;
  [[nodiscard]] Result send_many(int fd, std::uint32_t count) noexcept;
  void add_message(std::uint32_t index, const protocol::Fragmenter::Pieces& pieces,
                   std::size_t& iov_count) noexcept;

  struct Memory {
    std::array<std::array<std::byte, protocol::kFragmentHeaderBytes>, kMaxBatch> headers;
    std::array<iovec, kMaxBatch * kPieces> iov;
    std::array<mmsghdr, kMaxBatch> messages;
    std::array<std::uint32_t, kMaxBatch> sizes;
  };
  std::unique_ptr<Memory> memory_;
};

/// True when the kernel knows UDP_SEGMENT.
[[nodiscard]] bool udp_segmentation_supported(int fd) noexcept;

}  // namespace emit::server
