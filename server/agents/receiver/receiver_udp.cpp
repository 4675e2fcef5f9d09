// SPDX-License-Identifier: Apache-2.0
#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cstring>
#include <ctime>

#include "agents/receiver/receiver_connection.hpp"
#include "emit/v1/status.pb.h"
#include "net/ip_address.hpp"

namespace emit::server {
namespace {

/// Answers over UDP per 100 ms: enough for every host, too few to be worth abusing.
constexpr std::uint32_t kStatusesPerWindow = 100;
constexpr std::int64_t kStatusWindowNs = 100'000'000;

}  // namespace

int Receiver::receive_datagrams(std::int64_t now_ns) noexcept {
  UdpMemory& memory = *udp_memory_;
  const std::size_t room = room_for_inputs();
  const bool reading = room > 0 && !draining_.load(std::memory_order_acquire);
  if (reading != udp_watched_) {
    epoll_event event{};
    event.events = reading ? std::uint32_t{EPOLLIN} : 0U;
    event.data.u64 = ~std::uint64_t{0} - 1;
    ::epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, udp_.fd(), &event);
    udp_watched_ = reading;
  }
  if (!reading) {
    return 0;
  }
  const std::size_t batch = std::min(room, UdpMemory::kBatch);
  for (std::size_t i = 0; i < batch; ++i) {
    memory.iov[i] = {memory.data.data() + i * UdpMemory::kDatagramBytes, UdpMemory::kDatagramBytes};
    msghdr& message = memory.messages[i].msg_hdr;
    message = {};
    message.msg_name = &memory.peers[i];
    message.msg_namelen = sizeof(memory.peers[i]);
    message.msg_iov = &memory.iov[i];
    message.msg_iovlen = 1;
    message.msg_control = memory.control[i].bytes.data();
    message.msg_controllen = UdpMemory::kControlBytes;
  }
  // Natively: Asio knows neither many messages per call nor control messages (time stamps, drops).
  const int count = ::recvmmsg(udp_.fd(), memory.messages.data(), static_cast<unsigned>(batch),
                               MSG_DONTWAIT, nullptr);
  for (int i = 0; i < count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    take_datagram(index, memory.messages[index].msg_len, now_ns);
  }
  return std::max(count, 0);
}

void Receiver::take_datagram(std::size_t index, std::size_t bytes, std::int64_t now_ns) noexcept {
  UdpMemory& memory = *udp_memory_;
  msghdr& message = memory.messages[index].msg_hdr;
  context_.counters.add(Counter::host_datagrams);
  std::int64_t received_ns = now_ns;
  for (cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr;
       header = CMSG_NXTHDR(&message, header)) {
    if (header->cmsg_level != SOL_SOCKET) {
      continue;
    }
    if (header->cmsg_type == SCM_TIMESTAMPNS) {
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(header), sizeof(stamp));
      received_ns = context_.clock.tai_from_kernel_stamp_ns(
          std::int64_t{stamp.tv_sec} * 1'000'000'000 + stamp.tv_nsec);
    } else if (header->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t drops = 0;
      std::memcpy(&drops, CMSG_DATA(header), sizeof(drops));
      context_.counters.add(Counter::host_os_drops, drops - os_drops_seen_);
      os_drops_seen_ = drops;
    }
  }

  const protocol::IpAddress peer = ip_of(memory.peers[index]);
  if (!may_connect(peer)) {
    turn_away(PeerRefusal::not_allowed, Counter::host_peers_refused, peer);
    return;
  }
  Origin origin;
  origin.kind = Origin::Kind::udp;
  origin.address_bytes = std::min<std::uint32_t>(message.msg_namelen,
                                                 static_cast<std::uint32_t>(origin.address.size()));
  std::memcpy(origin.address.data(), &memory.peers[index], origin.address_bytes);

  HostInput* input = context_.host_inputs.claim();
  if (input == nullptr) {
    return;  // room for the batch was looked up before it was read
  }
  std::span<const std::byte> datagram(memory.data.data() + index * UdpMemory::kDatagramBytes,
                                      bytes);
  if (sessions_) {
    const auto frame = authenticate(datagram, peer, origin);
    if (!frame) {
      return;
    }
    datagram = *frame;
  }
  const auto answer = [&](StatusCode code, std::uint64_t host_frame_number, std::uint64_t count,
                          const std::string& text) {
    // Two daemons must not answer each other's answers.
    if (protocol::looks_like_status(datagram)) {
      context_.counters.add(Counter::statuses_suppressed);
    } else {
      send_udp_status(origin, code, host_frame_number, count, text);
    }
  };
  if (!limits_.take_host_frame(peer, address_of(origin).port(), context_.clock.monotonic_ns())) {
    context_.counters.add(Counter::host_frames_over_rate);
    const std::uint64_t count = context_.counters.add(Counter::refused_overloaded);
    answer(StatusCode::overloaded, 0, count,
           "more host frames a second than access.max_host_frames_hz");
    return;
  }
  const protocol::DecodeStatus decoded =
      protocol::decode_host_frame(datagram, decoder_, input->frame);
  if (decoded != protocol::DecodeStatus::ok) {
    const auto code = static_cast<StatusCode>(decoded);
    const std::uint64_t count = context_.counters.add(counter_of(code));
    context_.receiver_events.push(EventKind::refused, static_cast<std::uint64_t>(code), count,
                                  protocol::to_string(decoded));
    answer(code, input->frame.frame_number, count, std::string(protocol::to_string(decoded)));
    return;
  }
  input->kind = HostInput::Kind::frame;
  input->origin = origin;
  input->frame.received_ns = received_ns;
  context_.host_inputs.commit();
  context_.bells.conductor.ring();
}

void Receiver::send_udp_status(const Origin& origin, StatusCode code,
                               std::uint64_t host_frame_number, std::uint64_t count,
                               const std::string& text) noexcept {
  const std::int64_t now_ns = context_.clock.monotonic_ns();
  if (now_ns - status_window_ns_ >= kStatusWindowNs) {
    status_window_ns_ = now_ns;
    statuses_in_window_ = 0;
  }
  if (++statuses_in_window_ > kStatusesPerWindow) {
    context_.counters.add(Counter::statuses_suppressed);
    return;
  }
  v1::Status status;
  status.set_code(static_cast<v1::Status::Code>(code));
  status.set_text(text);
  status.set_host_frame_number(host_frame_number);
  status.set_count(count);
  std::array<std::byte, HostSessions::kMaxAnswerBytes> own_space;
  const std::span<std::byte> space = sessions_ ? sessions_->answer_payload() : own_space;
  const auto length = status.ByteSizeLong();
  if (length > space.size() || !status.SerializeToArray(space.data(), static_cast<int>(length))) {
    return;
  }
  const std::span<const std::byte> bytes =
      sessions_ ? sessions_->answer(origin.connection, origin.generation, length)
                : std::span<const std::byte>(space.first(length));
  if (bytes.empty()) {
    context_.counters.add(Counter::statuses_suppressed);
    return;
  }
  const SocketAddress target = address_of(origin);
  if (udp_.send_to(bytes, target).status != IoStatus::done) {
    context_.counters.add(Counter::statuses_suppressed);
  }
}

}  // namespace emit::server
