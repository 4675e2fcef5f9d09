// SPDX-License-Identifier: Apache-2.0
#include "client/client_connection.hpp"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <ctime>

#include "emit/protocol/convert.hpp"
#include "emit/protocol/shared_ring.hpp"
#include "emit/protocol/version.hpp"
#include "emit/v1/control.pb.h"
#include "rt/error_text.hpp"

namespace emit::client {

using physics::ErrorCode;
using physics::make_error;

std::int64_t monotonic_now_ns() noexcept {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return std::int64_t{t.tv_sec} * 1'000'000'000 + t.tv_nsec;
}

bool wait_for(int fd, short events, std::int64_t end_ns) noexcept {
  for (;;) {
    const std::int64_t left_ns = std::max<std::int64_t>(end_ns - monotonic_now_ns(), 0);
    pollfd wait{fd, events, 0};
    const timespec timeout{static_cast<time_t>(left_ns / 1'000'000'000),
                           static_cast<long>(left_ns % 1'000'000'000)};
    const int ready = ::ppoll(&wait, 1, &timeout, nullptr);
    if (ready > 0) {
      return true;
    }
    if (ready == 0 || errno != EINTR) {
      return false;
    }
  }
}

std::optional<physics::Band> ChannelDescription::spectral_band() const {
  physics::Band out{band_lo_um, band_hi_um,
                    response.value_or(std::vector<physics::ResponsePoint>())};
  if (!physics::validate(out)) {
    return std::nullopt;
  }
  return out;
}

std::optional<protocol::ImagePoint> ChannelDescription::sensor_point(
    const protocol::ImagePoint& frame_point) const noexcept {
  if ((output_steps & protocol::kOutputDistorted) != 0) {
    return std::nullopt;
  }
  const protocol::ImagePoint at =
      protocol::window_point(output_steps, {window_width_px, window_height_px}, frame_point);
  return protocol::ImagePoint{window_x_px + at.x_px, window_y_px + at.y_px};
}

ChannelDescription describe_channel(const v1::ChannelInfo& info) {
  ChannelDescription out{info.index(),      info.name(),     info.kind(),
                         info.sensor(),     info.band(),     info.band_lo_um(),
                         info.band_hi_um(), info.width_px(), info.height_px()};
  out.every_nth = std::max(info.every_nth(), 1U);
  out.look_ahead_frames = info.look_ahead_frames();
  out.window_x_px = info.window_x_px();
  out.window_y_px = info.window_y_px();
  out.sensor_width_px = info.sensor_width_px();
  out.sensor_height_px = info.sensor_height_px();
  out.window_width_px = info.window_width_px() > 0 ? info.window_width_px() : info.width_px();
  out.window_height_px = info.window_height_px() > 0 ? info.window_height_px() : info.height_px();
  out.output_steps = static_cast<std::uint16_t>(info.output_steps());
  if (info.quantity() != 0) out.quantity = static_cast<protocol::PixelQuantity>(info.quantity());
  if (info.band_is_rectangle()) {
    out.response.emplace();
  } else if (info.response_um_size() > 0 && info.response_um_size() == info.response_frac_size()) {
    out.response.emplace();
    for (int i = 0; i < info.response_um_size(); ++i) {
      out.response->push_back({info.response_um(i), info.response_frac(i)});
    }
  }
  return out;
}

std::string every_nth_error(std::uint32_t every_nth) {
  return fmt::format("every_nth is {}, must be 1 to {}", every_nth, protocol::kMaxEveryNth);
}

ServerStatus to_status(const v1::Status& status) {
  return {static_cast<std::uint32_t>(status.code()), status.text(), status.host_frame_number(),
          status.count()};
}

ServerInfo to_server_info(const v1::Welcome& welcome) {
  ServerInfo info;
  info.software = welcome.software();
  info.scenario = welcome.scenario();
  info.pacing = welcome.pacing();
  info.device = welcome.device();
  info.run_id = welcome.run_id();
  info.tai_offset_unset = welcome.tai_offset_unset();
  info.sends_journal_end = welcome.sends_journal_end();
  for (const v1::ChannelInfo& channel : welcome.channels()) {
    info.channels.push_back(describe_channel(channel));
  }
  return info;
}

physics::Result<Url> parse_frame_url(const std::string& text) {
  constexpr std::string_view kShm = "shm://";
  if (text.starts_with(kShm)) {
    Url url{Url::Scheme::shm, text.substr(kShm.size()), 0};
    if (!protocol::is_shm_name(url.host)) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("'{}': not shm://name, a name as stream.shm takes it", text));
    }
    return url;
  }
  auto url = parse_url(text);
  if (!url) {
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format("'{}': not tcp://host:port, udp://host:port or shm://name", text));
  }
  return url;
}

physics::Result<Url> parse_url(const std::string& text) {
  Url url;
  std::string rest;
  if (text.starts_with("tcp://")) {
    url.scheme = Url::Scheme::tcp;
  } else if (text.starts_with("udp://")) {
    url.scheme = Url::Scheme::udp;
  } else {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("'{}': not tcp://host:port or udp://host:port", text));
  }
  const auto where = server::parse_host_port(std::string_view(text).substr(6));
  if (!where || where->host.empty() || where->port == 0) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("'{}': not tcp://host:port or udp://host:port", text));
  }
  url.host = where->host;
  url.port = where->port;
  return url;
}

ClientConnection::ClientConnection(server::SocketContext context, server::TcpSocket socket,
                                   server::SocketAddress peer, const protocol::RecordLimits& limits)
    : context_(std::move(context)),
      socket_(std::move(socket)),
      peer_(peer),
      limits_(limits),
      parser_(limits) {}

namespace {

/// TLS over a connected socket, until both sides have proved themselves.
physics::Result<void> secure(server::TcpSocket& socket, const Security& security,
                             const std::string& name, const server::SocketAddress& peer,
                             std::int64_t end_ns) {
  auto context =
      server::TlsContext::client({security.tls_ca, security.tls_certificate, security.tls_key});
  if (!context) {
    return tl::unexpected<physics::Error>(std::move(context.error()));
  }
  if (auto started = socket.start_tls(*context, name); !started) {
    return started;
  }
  server::TlsSession& tls = *socket.tls();
  for (;;) {
    const server::IoResult result = tls.handshake();
    if (result.status == server::IoStatus::done) {
      return {};
    }
    if (result.status != server::IoStatus::would_block) {
      return make_error(ErrorCode::io, fmt::format("{}: TLS: {}", to_string(peer), tls.error()));
    }
    if (!wait_for(socket.fd(), tls.wants_write() ? POLLOUT : POLLIN, end_ns)) {
      return make_error(ErrorCode::io,
                        to_string(peer) + ": TLS: no answer to the handshake within the timeout");
    }
  }
}

}  // namespace

physics::Result<ClientConnection> ClientConnection::open(const Url& url, protocol::PeerRole role,
                                                         std::int64_t timeout_ns,
                                                         const Security& security) {
  const std::int64_t end_ns = monotonic_now_ns() + timeout_ns;
  const auto address = server::resolve({url.host, url.port}, server::Transport::tcp, false);
  if (!address) {
    return tl::unexpected<physics::Error>(physics::Error(address.error()));
  }
  server::SocketContext context;
  auto socket = server::TcpSocket::connect(context, *address, timeout_ns);
  if (!socket) {
    return tl::unexpected<physics::Error>(std::move(socket.error()));
  }
  if (security.tls()) {
    const std::string name = security.tls_name.empty() ? url.host : security.tls_name;
    if (auto secured = secure(*socket, security, name, *address, end_ns); !secured) {
      return tl::unexpected<physics::Error>(std::move(secured.error()));
    }
  }
  // Frames by UDP come from the address that the connection leads to.
  server::SocketAddress peer = socket->peer_address();
  if (peer.length == 0) {
    peer = *address;  // broken already, as will be seen
  }
  return greet(std::move(context), std::move(*socket), peer, role, end_ns);
}

physics::Result<ClientConnection> ClientConnection::greet(
    server::SocketContext context, server::TcpSocket socket, server::SocketAddress peer,
    protocol::PeerRole role, std::int64_t end_ns, const protocol::RecordLimits& limits) {
  ClientConnection connection(std::move(context), std::move(socket), peer, limits);
  v1::ControlRecord request;
  v1::Hello& hello = *request.mutable_hello();
  hello.set_protocol_version(protocol::kProtocolVersion);
  hello.set_software("emit client");
  hello.set_role(static_cast<v1::Hello::Role>(role));
  if (auto sent = connection.send(request, end_ns); !sent) {
    return tl::unexpected<physics::Error>(std::move(sent.error()));
  }
  protocol::Record record;
  auto received = connection.receive(record, end_ns);
  if (!received) {
    return tl::unexpected<physics::Error>(std::move(received.error()));
  }
  const std::string where = to_string(peer);
  if (!*received) {
    return make_error(ErrorCode::io, where + ": no welcome within the timeout");
  }
  v1::ControlRecord answer;
  if (record.kind != protocol::RecordKind::control ||
      !protocol::parse_control_record(record.body, answer)) {
    return make_error(ErrorCode::protocol, where + ": the first record is not a welcome");
  }
  if (answer.has_status()) {
    return make_error(ErrorCode::protocol,
                      fmt::format("{}: refused: {}", where, answer.status().text()));
  }
  if (!answer.has_welcome()) {
    return make_error(ErrorCode::protocol, where + ": the first record is not a welcome");
  }
  const v1::Welcome& welcome = answer.welcome();
  if (welcome.protocol_version() != protocol::kProtocolVersion) {
    return make_error(ErrorCode::protocol,
                      fmt::format("{}: speaks protocol version {}, this client {}", where,
                                  welcome.protocol_version(), protocol::kProtocolVersion));
  }
  connection.info_ = to_server_info(welcome);
  return connection;
}

void ClientConnection::allow_frames(std::uint32_t max_frame_bytes) {
  limits_.max_frame_bytes = max_frame_bytes;
  parser_ = protocol::RecordParser(limits_);
}

namespace {

/// Returns the number of bytes to read at a time where a record lacks `missing` bytes; 0 means that
/// no record is begun. The bytes behind a long record stay in the socket, so that frames come to
/// lie where they stay.
std::size_t piece_bytes(std::size_t missing) noexcept {
  // Not more than the cache holds: the parser sums pixels behind every piece.
  constexpr std::size_t kPieceBytes = 256u << 10;
  // A rest this small comes with the piece before it.
  constexpr std::size_t kCrumbBytes = 16u << 10;
  return missing == 0 || missing > kPieceBytes + kCrumbBytes ? kPieceBytes : missing;
}

}  // namespace

physics::Result<bool> ClientConnection::receive(protocol::Record& record, std::int64_t end_ns) {
  for (;;) {
    const protocol::ParseStatus status = parser_.next(record);
    if (status == protocol::ParseStatus::record) {
      wake_at(1);
      return true;
    }
    if (status != protocol::ParseStatus::need_more) {
      return make_error(ErrorCode::protocol,
                        fmt::format("{}: stream broken: {} ({})", to_string(peer_),
                                    protocol::to_string(status), parser_.offending_value()));
    }
    const std::span<std::byte> space = parser_.writable();
    const server::IoResult got = socket_.read_some(
        space.first(std::min(space.size(), piece_bytes(parser_.missing_bytes()))));
    switch (got.status) {
      case server::IoStatus::done:
        parser_.commit(got.bytes);
        break;
      case server::IoStatus::closed:
        closed_ = parser_.pending_bytes() == 0;
        return make_error(ErrorCode::io,
                          to_string(peer_) + (closed_ ? ": connection closed"
                                                      : ": connection closed within a record"));
      case server::IoStatus::failed:
        return make_error(ErrorCode::io,
                          fmt::format("{}: {}", to_string(peer_), server::error_text(got.error)));
      case server::IoStatus::busy:
      case server::IoStatus::would_block:
        // A record's rest wakes this thread in pieces, not with every segment: waking costs as much
        // as copying tens of kilobytes. Larger pieces would stop a sender with a small buffer.
        constexpr std::size_t kMaxWaiting = 128u << 10;
        wake_at(std::clamp<std::size_t>(parser_.missing_bytes(), 1, kMaxWaiting));
        if (!wait_for(socket_.fd(), POLLIN, end_ns)) {
          return false;
        }
        break;
    }
  }
}

/// Makes the socket readable once so much waits. Through TLS it would be bytes of another kind.
void ClientConnection::wake_at(std::size_t bytes) noexcept {
  if (bytes != low_water_bytes_ && socket_.tls() == nullptr) {
    low_water_bytes_ = bytes;
    socket_.set_receive_low_water(bytes);
  }
}

physics::Result<void> ClientConnection::send(std::span<const std::byte> bytes,
                                             std::int64_t end_ns) {
  while (!bytes.empty()) {
    const server::IoResult sent = socket_.write_some(bytes);
    if (sent.status == server::IoStatus::done) {
      bytes = bytes.subspan(sent.bytes);
    } else if (sent.status != server::IoStatus::would_block) {
      return make_error(ErrorCode::io,
                        fmt::format("{}: {}", to_string(peer_), server::error_text(sent.error)));
    } else if (!wait_for(socket_.fd(), POLLOUT, end_ns)) {
      return make_error(ErrorCode::io, to_string(peer_) + ": takes nothing within the timeout");
    }
  }
  return {};
}

physics::Result<void> ClientConnection::send(const v1::ControlRecord& record, std::int64_t end_ns) {
  out_.clear();
  protocol::append_control_record(record, out_);
  return send(out_, end_ns);
}

}  // namespace emit::client
