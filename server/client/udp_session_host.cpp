// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <poll.h>
#include <sys/random.h>

#include <algorithm>
#include <cerrno>
#include <deque>

#include "client/client_connection.hpp"
#include "emit/protocol/codec.hpp"
#include "emit/v1/status.pb.h"
#include "rt/error_text.hpp"

/// The host's end of authenticated datagrams (docs/wire.md, "Host sessions").
namespace emit::client {
namespace {

using physics::ErrorCode;
using physics::make_error;
using protocol::SessionKind;

/// Time between two questions whether the daemon still knows the session. A daemon that was started
/// anew does not, and drops datagrams until the host asks.
constexpr std::int64_t kAskNs = 1'000'000'000;
/// Time until the first question is repeated.
constexpr std::int64_t kRetryNs = 200'000'000;
constexpr std::size_t kMaxDatagramBytes = 65'507;
constexpr std::size_t kMaxStatuses = 256;

/// Draws a number that nobody can foresee. Errors: io (the kernel gives none).
physics::Result<void> draw(std::uint64_t& out) {
  // The kernel never returns fewer bytes for so short a request.
  if (::getrandom(&out, sizeof out, 0) == static_cast<ssize_t>(sizeof out)) return {};
  return make_error(ErrorCode::io,
                    fmt::format("no random number for the session: {}", server::error_text(errno)));
}

class SessionHost final : public HostClient {
 public:
  SessionHost(server::UdpSocket socket, const server::SocketAddress& peer,
              const protocol::SessionKey& key, std::optional<ClientConnection> control,
              protocol::SessionMac session_mac, protocol::SessionMac open_mac)
      : socket_(std::move(socket)),
        peer_(peer),
        control_(std::move(control)),
        session_mac_(std::move(session_mac)),
        open_mac_(std::move(open_mac)),
        shared_(protocol::make_shared_key(key, open_mac_)) {
    open_mac_.set_key(shared_.open_key);
  }

  physics::Result<void> open(std::int64_t end_ns) {
    if (auto drawn = draw(session_id_); !drawn) return drawn;
    while (!open_) {
      if (auto asked = ask(); !asked) return asked;
      const std::int64_t retry_ns = std::min(asked_ns_ + kRetryNs, end_ns);
      while (!open_ && wait_for(socket_.fd(), POLLIN, retry_ns)) {
        if (auto taken = take_all(); !taken) return taken;
      }
      if (!open_ && monotonic_now_ns() >= end_ns) {
        return make_error(ErrorCode::io,
                          fmt::format("udp {}: no answer to the key: not one that the daemon "
                                      "knows, or no daemon there",
                                      to_string(peer_)));
      }
    }
    return {};
  }

  physics::Result<void> send(const protocol::HostFrameData& frame,
                             std::int64_t timeout_ns) override {
    const std::int64_t end_ns = monotonic_now_ns() + timeout_ns;
    if (auto taken = take_all(); !taken) return taken;
    if (monotonic_now_ns() - asked_ns_ >= kAskNs) {
      if (auto asked = ask(); !asked) return asked;
    }
    const auto body = encoder_.encode(frame);
    if (body.size() > protocol::kMaxSessionPayloadBytes) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("host frame of {} bytes: at most {} fit with a MAC",
                                    body.size(), protocol::kMaxSessionPayloadBytes));
    }
    std::copy(body.begin(), body.end(), space_.begin() + protocol::kSessionHeaderBytes);
    return transmit(
        session_mac_.seal({SessionKind::host_frame, shared_.id, session_id_, ++counter_}, space_,
                          body.size()),
        end_ns);
  }
  physics::Result<void> command(protocol::CommandKind /*command*/,
                                std::int64_t /*timeout_ns*/) override {
    return make_error(ErrorCode::unsupported, "commands need a tcp:// connection");
  }
  physics::Result<std::optional<ServerStatus>> receive_status(std::int64_t timeout_ns) override {
    const std::int64_t end_ns = monotonic_now_ns() + timeout_ns;
    for (;;) {
      if (auto taken = take_all(); !taken) return tl::unexpected(std::move(taken.error()));
      if (!statuses_.empty()) {
        const ServerStatus first = std::move(statuses_.front());
        statuses_.pop_front();
        return std::optional<ServerStatus>(first);
      }
      if (!wait_for(socket_.fd(), POLLIN, end_ns)) return std::optional<ServerStatus>();
    }
  }
  const ServerInfo* server() const noexcept override {
    return control_ ? &control_->server() : nullptr;
  }

 private:
  physics::Result<void> ask() {
    asked_ns_ = monotonic_now_ns();
    if (control_ && wait_for(control_->fd(), POLLIN, asked_ns_)) {
      // Nothing is expected there but its end, and with it the key's.
      protocol::Record record;
      if (auto received = control_->receive(record, asked_ns_); !received) {
        return tl::unexpected(std::move(received.error()));
      }
    }
    if (auto drawn = draw(echo_); !drawn) return drawn;
    std::array<std::byte, protocol::kSessionHeaderBytes + protocol::kSessionTagBytes> bytes;
    return transmit(open_mac_.seal({SessionKind::open, shared_.id, session_id_, echo_}, bytes, 0),
                    asked_ns_);
  }

  physics::Result<void> transmit(std::span<const std::byte> datagram, std::int64_t end_ns) {
    bool retried = false;
    for (;;) {
      const server::IoResult sent = socket_.send(datagram);
      if (sent.status == server::IoStatus::done) return {};
      if (sent.error == ECONNREFUSED) {
        // The report of an earlier datagram. Nobody there now may mean a daemon that starts anew.
        if (std::exchange(retried, true)) return {};
        continue;
      }
      const bool full = sent.status == server::IoStatus::would_block;
      if (!full || !wait_for(socket_.fd(), POLLOUT, end_ns)) {
        return make_error(ErrorCode::io,
                          fmt::format("udp {}: {}", to_string(peer_),
                                      server::error_text(full ? EAGAIN : sent.error)));
      }
    }
  }

  physics::Result<void> take_all() {
    for (;;) {
      const server::IoResult got = socket_.receive(received_);
      if (got.status == server::IoStatus::would_block) return {};
      if (got.error == ECONNREFUSED) continue;
      if (got.status != server::IoStatus::done) {
        return make_error(ErrorCode::io, fmt::format("udp {}: {}", to_string(peer_),
                                                     server::error_text(got.error)));
      }
      if (auto taken = take(std::span(received_).first(got.bytes)); !taken) return taken;
    }
  }

  physics::Result<void> take(std::span<const std::byte> datagram) {
    const auto read = protocol::parse_session_datagram(datagram);
    if (!read || read->header.key_id != shared_.id || read->header.session_id != session_id_) {
      return {};
    }
    if (read->header.kind == SessionKind::challenge) {
      const auto challenge = protocol::parse_challenge(read->payload);
      if (challenge && read->header.counter == echo_ && open_mac_.verify(datagram)) {
        return take_challenge(*challenge);
      }
    } else if (read->header.kind == SessionKind::answer && open_ && session_mac_.verify(datagram) &&
               answers_.accept(read->header.counter)) {
      v1::Status status;
      if (status.ParseFromArray(read->payload.data(), static_cast<int>(read->payload.size())) &&
          statuses_.size() < kMaxStatuses) {
        statuses_.push_back(to_status(status));
      }
    }
    return {};
  }

  physics::Result<void> take_challenge(const protocol::Challenge& challenge) {
    if (open_ && (challenge.session_known || challenge.nonce == nonce_)) return {};
    if (open_) {  // a session's counters are never used twice
      if (auto drawn = draw(session_id_); !drawn) return drawn;
    }
    open_ = true;
    nonce_ = challenge.nonce;
    counter_ = 0;
    answers_ = {};
    session_mac_.set_key(protocol::session_key(shared_, session_id_, nonce_, session_mac_));
    return {};
  }

  server::UdpSocket socket_;
  server::SocketAddress peer_;
  std::optional<ClientConnection> control_;  // the key lives as long as it
  protocol::SessionMac session_mac_;
  protocol::SessionMac open_mac_;
  protocol::SharedKey shared_;
  std::uint64_t session_id_ = 0;
  std::uint64_t counter_ = 0;
  std::uint64_t echo_ = 0;
  protocol::SessionNonce nonce_{};
  bool open_ = false;
  std::int64_t asked_ns_ = 0;
  protocol::ReplayWindow answers_;
  std::deque<ServerStatus> statuses_;
  protocol::HostFrameEncoder encoder_;
  std::vector<std::byte> space_ = std::vector<std::byte>(kMaxDatagramBytes);
  std::vector<std::byte> received_ = std::vector<std::byte>(2048);
};

}  // namespace

physics::Result<std::unique_ptr<HostClient>> make_session_host(
    server::UdpSocket socket, const server::SocketAddress& peer, const protocol::SessionKey& key,
    std::optional<ClientConnection> control, std::int64_t timeout_ns) {
  auto session_mac = protocol::SessionMac::create();
  auto open_mac = protocol::SessionMac::create();
  if (!session_mac || !open_mac) {
    return tl::unexpected((session_mac ? open_mac : session_mac).error());
  }
  auto host = std::make_unique<SessionHost>(std::move(socket), peer, key, std::move(control),
                                            std::move(*session_mac), std::move(*open_mac));
  if (auto opened = host->open(monotonic_now_ns() + timeout_ns); !opened) {
    return tl::unexpected(std::move(opened.error()));
  }
  return host;
}

}  // namespace emit::client
