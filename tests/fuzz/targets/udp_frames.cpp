// SPDX-License-Identifier: Apache-2.0
// Fuzz target: a client's receiver of frames by UDP, through a real socket. It covers payloads
// received to their place, datagrams that the kernel joins, and other senders. The receiver must
// hand out the same frames as a reassembler that gets the same datagrams one by one. The input is
// that of the target fragments with two more bits: 64 sends the datagram in one message with the
// one before, 128 sends it from another machine. Bit 16 has no meaning.
#include <netinet/udp.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <vector>

#include "client/udp_frame_receiver.hpp"
#include "emit/client/client.hpp"
#include "emit/protocol/reassembler.hpp"
#include "fuzz/frame_seal.hpp"
#include "fuzz/fuzz_input.hpp"
#include "net/socket.hpp"
#include "net/udp_batch.hpp"

namespace {

using namespace emit;

constexpr std::uint16_t kStream = 1;
constexpr std::size_t kMaxJoined = 64;
constexpr std::size_t kMaxJoinedBytes = 60'000;  // largest length of one message

/// Sockets and their buffers, used for all inputs.
struct Ends {
  server::SocketContext context;
  std::unique_ptr<client::UdpFrameReceiver> receiver;
  server::UdpSocket daemon;
  server::UdpSocket stranger;
  bool joins = false;

  Ends() {
    const auto here = server::numeric_address("127.0.0.1", 0);
    auto opened = client::UdpFrameReceiver::open(context, here, here, {});
    fuzz::require(opened.has_value(), "a port opens");
    receiver = std::make_unique<client::UdpFrameReceiver>(std::move(*opened));
    receiver->size_buffer(1u << 20);
    receiver->expect_stream(kStream);
    daemon = connected("127.0.0.1");
    stranger = connected("127.0.0.2");
    joins = server::udp_segmentation_supported(daemon.fd());
  }
  server::UdpSocket connected(const char* address) {
    auto socket = server::UdpSocket::open_bound(context, server::numeric_address(address, 0));
    fuzz::require(
        socket.has_value() &&
            socket->connect(server::numeric_address("127.0.0.1", receiver->port())).has_value(),
        "a sender opens");
    return std::move(*socket);
  }
};

void compare(protocol::Reassembler& received, protocol::Reassembler& reference) {
  for (;;) {
    const protocol::ReceivedFrame* frame = received.pop();
    const protocol::ReceivedFrame* expected = reference.pop();
    fuzz::require((frame == nullptr) == (expected == nullptr), "as many frames come out");
    if (frame == nullptr) return;
    fuzz::require(frame->header.frame_number == expected->header.frame_number &&
                      frame->header.flags == expected->header.flags &&
                      frame->complete == expected->complete && frame->crc_ok == expected->crc_ok &&
                      frame->missing_px == expected->missing_px &&
                      frame->frames_lost_before == expected->frames_lost_before,
                  "the same frame comes out");
    fuzz::require(frame->pixels.size() == expected->pixels.size() &&
                      std::memcmp(frame->pixels.data(), expected->pixels.data(),
                                  frame->pixels.size_bytes()) == 0,
                  "with the same pixels");
    received.release(frame);
    reference.release(expected);
  }
}

/// Datagrams that are sent as one message.
struct Message {
  std::vector<std::byte> bytes;
  std::vector<std::size_t> lengths;

  /// Returns true when a datagram of this length fits: all have one length but the last, which may
  /// be shorter.
  [[nodiscard]] bool takes(std::size_t length) const noexcept {
    return !lengths.empty() && length > 0 && lengths.back() == lengths.front() &&
           length <= lengths.front() && lengths.size() < kMaxJoined &&
           bytes.size() + length <= kMaxJoinedBytes;
  }
};

/// Sends a message with segmentation offload. A message that is not cut on the way arrives joined.
bool send_joined(int fd, Message& message) {
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof(std::uint16_t))> control{};
  iovec all{message.bytes.data(), message.bytes.size()};
  msghdr header{};
  header.msg_iov = &all;
  header.msg_iovlen = 1;
  if (message.lengths.size() > 1) {
    header.msg_control = control.data();
    header.msg_controllen = control.size();
    cmsghdr* segments = CMSG_FIRSTHDR(&header);
    segments->cmsg_level = SOL_UDP;
    segments->cmsg_type = UDP_SEGMENT;
    segments->cmsg_len = CMSG_LEN(sizeof(std::uint16_t));
    const auto bytes = static_cast<std::uint16_t>(message.lengths.front());
    std::memcpy(CMSG_DATA(segments), &bytes, sizeof bytes);
  }
  return ::sendmsg(fd, &header, MSG_NOSIGNAL) == static_cast<ssize_t>(message.bytes.size());
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Ends ends;
  protocol::Reassembler::Params params;
  params.max_payload_bytes = 4096;
  params.buffers = 3;
  params.max_streams = 2;
  params.fec = {3, 2};
  params.wait_for_missing = size > 0 && (data[0] & 32u) != 0;
  protocol::Reassembler received(params);
  protocol::Reassembler reference(params);
  client::ReceiveCounters counters;
  std::uint64_t foreign = 0;
  std::uint64_t sent = 0;
  // The loop takes all datagrams, because one may still be under way when sendmsg() has returned.
  const auto take = [&] {
    const auto taken = [&] {
      std::uint64_t sum = counters.foreign_datagrams;
      for (const std::uint64_t count : received.counters().fragments) sum += count;
      return sum;
    };
    constexpr int kLongMs = 10'000;
    pollfd wait{ends.receiver->fd(), POLLIN, 0};
    while (taken() < sent && (::poll(&wait, 1, kLongMs) == 1 || errno == EINTR)) {
      ends.receiver->take(received, counters);
    }
    fuzz::require(taken() == sent && counters.os_drops == 0, "nothing is lost on the way");
  };
  Message message;
  const auto send = [&] {
    if (message.lengths.empty()) return;
    fuzz::require(send_joined(ends.daemon.fd(), message), "it goes out");
    sent += message.lengths.size();
    std::span<const std::byte> rest(message.bytes);
    for (const std::size_t length : message.lengths) {
      const auto datagram = rest.first(length);
      rest = rest.subspan(length);
      const auto stream = protocol::stream_of_fragment(datagram);
      if (stream && *stream != kStream) {
        ++foreign;
      } else {
        static_cast<void>(reference.push(datagram));
      }
    }
    message = {};
  };

  fuzz::InputReader input(fuzz::as_bytes(data, size));
  std::size_t waiting = 0;
  while (!input.empty()) {
    const auto instructions = input.number<std::uint8_t>();
    const std::vector<std::byte> datagram = fuzz::read_datagram(input, instructions);
    if ((instructions & 128u) != 0) {
      send();
      if (datagram.size() <= kMaxJoinedBytes) {
        fuzz::require(ends.stranger.send(datagram).status == server::IoStatus::done,
                      "a stranger's goes out");
        ++sent;
        ++foreign;
      }
    } else if (datagram.size() <= kMaxJoinedBytes) {
      if ((instructions & 64u) == 0 || !ends.joins || !message.takes(datagram.size())) send();
      message.bytes.insert(message.bytes.end(), datagram.begin(), datagram.end());
      message.lengths.push_back(datagram.size());
    }
    // The socket's buffer holds less than a long input.
    waiting += datagram.size() + 1024;
    const bool full = waiting > (64u << 10);
    if (full || (instructions & 12u) != 0) {
      send();
      take();
      waiting = 0;
    }
    if ((instructions & 8u) != 0) {
      received.flush();
      reference.flush();
    }
    if ((instructions & 4u) != 0) compare(received, reference);
  }
  send();
  take();
  received.flush();
  reference.flush();
  compare(received, reference);
  fuzz::require(counters.foreign_datagrams == foreign, "strangers are counted");
  return 0;
}
