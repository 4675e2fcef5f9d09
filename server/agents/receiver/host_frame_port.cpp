// SPDX-License-Identifier: Apache-2.0
#include "agents/receiver/host_frame_port.hpp"

#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <ctime>
#include <vector>

#include "emit/v1/status.pb.h"
#include "net/ip_address.hpp"

namespace emit::server {
namespace {

/// Largest number of answers over UDP per 100 ms: enough for every host, too few to be abused.
constexpr std::uint32_t kStatusesPerWindow = 100;
constexpr std::int64_t kStatusWindowNs = 100'000'000;
constexpr std::uint64_t kReceiveBufferBytes = 4u << 20;

/// Returns the source address of a datagram.
SocketAddress address_of(const Origin& origin) noexcept {
  SocketAddress out;
  out.length = origin.address_bytes;
  std::memcpy(&out.storage, origin.address.data(), origin.address_bytes);
  return out;
}

}  // namespace

/// Memory of one batch of datagrams.
struct HostFramePort::Memory {
  static constexpr std::size_t kBatch = 16;
  static constexpr std::size_t kDatagramBytes = 65536;
  static constexpr std::size_t kControlBytes = 128;
  std::vector<std::byte> data = std::vector<std::byte>(kBatch * kDatagramBytes);
  struct alignas(cmsghdr) Control {
    std::array<std::byte, kControlBytes> bytes;
  };
  std::array<Control, kBatch> control{};
  std::array<sockaddr_storage, kBatch> peers{};
  std::array<iovec, kBatch> iov{};
  std::array<mmsghdr, kBatch> messages{};
};

HostFramePort::HostFramePort(Context& context, Admission& admission)
    : context_(context), admission_(admission), memory_(std::make_unique<Memory>()) {}

HostFramePort::~HostFramePort() = default;

physics::Result<void> HostFramePort::open(const SocketContext& sockets,
                                          const SocketAddress& address,
                                          const config::DaemonConfig& config) {
  if (config.authenticated_host()) {
    auto keys = load_host_keys(config);
    if (!keys) {
      return tl::unexpected<physics::Error>(std::move(keys.error()));
    }
    const std::size_t tls_keys = admission_.tls() != nullptr ? config.control.max_clients : 0;
    auto sessions = HostSessions::create(*keys, tls_keys);
    if (!sessions) {
      return tl::unexpected<physics::Error>(std::move(sessions.error()).with_context("host.udp"));
    }
    sessions_ = std::move(*sessions);
  }
  auto socket = UdpSocket::open_bound(sockets, address);
  if (!socket) {
    return tl::unexpected<physics::Error>(std::move(socket.error()).with_context("host.udp"));
  }
  socket_ = std::move(*socket);
  socket_.set_option(SOL_SOCKET, SO_TIMESTAMPNS, 1);
  socket_.set_option(SOL_SOCKET, SO_RXQ_OVFL, 1);
  socket_.set_receive_buffer(kReceiveBufferBytes);
  return {};
}

bool HostFramePort::watch(int epoll_fd, std::uint64_t key) noexcept {
  epoll_fd_ = epoll_fd;
  key_ = key;
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = key_;
  watched_ = ::epoll_ctl(epoll_fd_, EPOLL_CTL_ADD, socket_.fd(), &event) == 0;
  return watched_;
}

int HostFramePort::receive(std::size_t room, std::int64_t now_ns) noexcept {
  Memory& memory = *memory_;
  const bool reading = room > 0;
  if (reading != watched_) {
    epoll_event event{};
    event.events = reading ? std::uint32_t{EPOLLIN} : 0U;
    event.data.u64 = key_;
    ::epoll_ctl(epoll_fd_, EPOLL_CTL_MOD, socket_.fd(), &event);
    watched_ = reading;
  }
  if (!reading) {
    return 0;
  }
  const std::size_t batch = std::min(room, Memory::kBatch);
  for (std::size_t i = 0; i < batch; ++i) {
    memory.iov[i] = {memory.data.data() + i * Memory::kDatagramBytes, Memory::kDatagramBytes};
    msghdr& message = memory.messages[i].msg_hdr;
    message = {};
    message.msg_name = &memory.peers[i];
    message.msg_namelen = sizeof(memory.peers[i]);
    message.msg_iov = &memory.iov[i];
    message.msg_iovlen = 1;
    message.msg_control = memory.control[i].bytes.data();
    message.msg_controllen = Memory::kControlBytes;
  }
  // The system call is used directly, because Asio knows neither many messages per call nor control
  // messages (time stamps, drops).
  const int count = ::recvmmsg(socket_.fd(), memory.messages.data(), static_cast<unsigned>(batch),
                               MSG_DONTWAIT, nullptr);
  for (int i = 0; i < count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    take_datagram(index, memory.messages[index].msg_len, now_ns);
  }
  return std::max(count, 0);
}

std::int64_t HostFramePort::read_control_messages(std::size_t index, std::int64_t now_ns) noexcept {
  msghdr& message = memory_->messages[index].msg_hdr;
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
  return received_ns;
}

void HostFramePort::take_datagram(std::size_t index, std::size_t bytes,
                                  std::int64_t now_ns) noexcept {
  Memory& memory = *memory_;
  context_.counters.add(Counter::host_datagrams);
  const std::int64_t received_ns = read_control_messages(index, now_ns);
  const protocol::IpAddress peer = ip_of(memory.peers[index]);
  if (!admission_.may_connect(peer)) {
    admission_.turn_away(PeerRefusal::not_allowed, Counter::host_peers_refused, peer);
    return;
  }
  Origin origin;
  origin.kind = Origin::Kind::udp;
  origin.address_bytes = std::min<std::uint32_t>(memory.messages[index].msg_hdr.msg_namelen,
                                                 static_cast<std::uint32_t>(origin.address.size()));
  std::memcpy(origin.address.data(), &memory.peers[index], origin.address_bytes);

  HostInput* input = context_.host_inputs.claim();
  if (input == nullptr) {
    return;  // cannot happen: room for the batch was checked before it was read
  }
  std::span<const std::byte> datagram(memory.data.data() + index * Memory::kDatagramBytes, bytes);
  if (sessions_) {
    const auto frame = authenticate(datagram, peer, origin);
    if (!frame) {
      return;
    }
    datagram = *frame;
  }
  if (!admission_.limits().take_host_frame(peer, address_of(origin).port(),
                                           context_.clock.monotonic_ns())) {
    context_.counters.add(Counter::host_frames_over_rate);
    refuse(origin, datagram, StatusCode::overloaded, 0,
           "more host frames a second than access.max_host_frames_hz", {});
    return;
  }
  const protocol::DecodeStatus decoded =
      protocol::decode_host_frame(datagram, decoder_, input->frame);
  if (decoded != protocol::DecodeStatus::ok) {
    std::array<char, protocol::kFaultTextBytes> text;
    std::array<char, protocol::kFaultTextBytes> place;
    refuse(origin, datagram, static_cast<StatusCode>(decoded), input->frame.frame_number,
           protocol::fault_text(decoded, decoder_.fault(), text),
           protocol::fault_place(decoded, decoder_.fault(), place));
    return;
  }
  input->kind = HostInput::Kind::frame;
  input->origin = origin;
  input->frame.received_ns = received_ns;
  context_.host_inputs.commit();
  context_.bells.conductor.ring();
}

void HostFramePort::refuse(const Origin& origin, std::span<const std::byte> datagram,
                           StatusCode code, std::uint64_t host_frame_number, std::string_view text,
                           std::string_view event_text) {
  const std::uint64_t count = context_.counters.add(counter_of(code));
  if (!event_text.empty()) {
    context_.receiver_events.push(EventKind::refused, static_cast<std::uint64_t>(code), count,
                                  event_text);
  }
  // Two daemons must not answer each other's answers.
  if (protocol::looks_like_status(datagram)) {
    context_.counters.add(Counter::statuses_suppressed);
  } else {
    send_status(origin, code, host_frame_number, count, std::string(text));
  }
}

std::optional<std::span<const std::byte>> HostFramePort::authenticate(
    std::span<const std::byte> datagram, const protocol::IpAddress& peer, Origin& origin) {
  using Verdict = HostSessions::Verdict;
  const HostSessions::Taken taken = sessions_->take(datagram);
  switch (taken.verdict) {
    case Verdict::host_frame:
      if (taken.began) {
        context_.counters.add(Counter::host_sessions);
        context_.receiver_events.push(EventKind::host_session, 0, 0, to_string(peer));
      }
      origin.connection = taken.place;
      origin.generation = taken.generation;
      return taken.payload;
    case Verdict::open: {
      const SocketAddress target = address_of(origin);
      if (!admission_.limits().take_control_record(peer, target.port(),
                                                   context_.clock.monotonic_ns())) {
        context_.counters.add(Counter::control_over_rate);
      } else if (socket_.send_to(sessions_->challenge(taken.header), target).status !=
                 IoStatus::done) {
        context_.counters.add(Counter::statuses_suppressed);
      }
      return std::nullopt;
    }
    case Verdict::bare:
      admission_.turn_away(PeerRefusal::mac, Counter::host_unauthenticated, peer);
      return std::nullopt;
    case Verdict::unknown_key:
      admission_.turn_away(PeerRefusal::mac, Counter::host_unknown_key, peer);
      return std::nullopt;
    case Verdict::bad_mac:
      admission_.turn_away(PeerRefusal::mac, Counter::host_bad_mac, peer);
      return std::nullopt;
    case Verdict::replayed:
      context_.counters.add(Counter::host_replayed);
      return std::nullopt;
  }
  return std::nullopt;
}

void HostFramePort::send_status(const Origin& origin, StatusCode code,
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
  if (bytes.empty() || socket_.send_to(bytes, address_of(origin)).status != IoStatus::done) {
    context_.counters.add(Counter::statuses_suppressed);
  }
}

}  // namespace emit::server
