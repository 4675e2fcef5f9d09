// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "agents/receiver/receiver_connection.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/version.hpp"
#include "emit/v1/control.pb.h"
#include "net/ip_address.hpp"
#include "rt/error_text.hpp"

namespace emit::server {

using protocol::kProtocolVersion;

void Receiver::take_record(Connection& connection, const protocol::Record& record,
                           std::int64_t now_ns) {
  switch (record.kind) {
    case protocol::RecordKind::host_frame:
      take_host_frame(connection, record.body, now_ns);
      return;
    case protocol::RecordKind::control: {
      const auto frame = protocol::host_frame_in_control_record(record.body);
      if (!frame.empty()) {
        take_host_frame(connection, frame, now_ns);
      } else {
        take_control(connection, record.body);
      }
      return;
    }
    case protocol::RecordKind::resend:
      take_resend(connection, record.body);
      return;
    case protocol::RecordKind::frame:
      refuse(connection, StatusCode::not_allowed, "frames go the other way");
      return;
  }
  // A kind of a newer version: skipped.
}

void Receiver::take_host_frame(Connection& connection, std::span<const std::byte> bytes,
                               std::int64_t now_ns) {
  if (connection.role != Role::host) {
    refuse(connection, StatusCode::not_allowed, "host frames need the role of a host");
    return;
  }
  if (draining_.load(std::memory_order_acquire)) {
    return;
  }
  if (!limits_.take_host_frame(connection.ip, connection.peer.port(),
                               context_.clock.monotonic_ns())) {
    context_.counters.add(Counter::host_frames_over_rate);
    refuse(connection, StatusCode::overloaded,
           "more host frames a second than access.max_host_frames_hz");
    return;
  }
  // parse() looked for room before it took the record.
  HostInput& input = context_.host_inputs.claim_reserved();
  const protocol::DecodeStatus decoded = protocol::decode_host_frame(bytes, decoder_, input.frame);
  if (decoded != protocol::DecodeStatus::ok) {
    refuse(connection, static_cast<StatusCode>(decoded),
           "host frame: " + std::string(protocol::to_string(decoded)), input.frame.frame_number);
    return;
  }
  input.kind = HostInput::Kind::frame;
  input.origin = {};
  input.origin.kind = Origin::Kind::tcp;
  input.origin.connection = connection.index;
  input.origin.generation = connection.generation;
  input.frame.received_ns = now_ns;
  context_.host_inputs.commit();
  context_.bells.conductor.ring();
}

void Receiver::take_control(Connection& connection, std::span<const std::byte> body) {
  if (!limits_.take_control_record(connection.ip, connection.peer.port(),
                                   context_.clock.monotonic_ns())) {
    context_.counters.add(Counter::control_over_rate);
    refuse(connection, StatusCode::overloaded,
           "more control records a second than access.max_control_records_hz");
    return;
  }
  v1::ControlRecord record;
  if (!protocol::parse_control_record(body, record)) {
    refuse(connection, StatusCode::malformed, "not a control record");
    if (!connection.welcomed) {
      connection.flush_close = true;
      flush(connection);
    }
    return;
  }
  if (record.has_hello()) {
    take_hello(connection, record);
    return;
  }
  if (!connection.welcomed) {
    refuse(connection, StatusCode::not_allowed, "hello comes first");
    connection.flush_close = true;
    flush(connection);
    return;
  }
  if (record.has_subscribe()) {
    take_subscribe(connection, record);
    return;
  }
  if (record.has_command()) {
    const auto kind = static_cast<int>(record.command().kind());
    if (connection.role != Role::host) {
      refuse(connection, StatusCode::not_allowed, "commands need the role of a host");
    } else if (kind < static_cast<int>(CommandKind::start) ||
               kind > static_cast<int>(CommandKind::reset)) {
      refuse(connection, StatusCode::malformed, "unknown command");
    } else if (!draining_.load(std::memory_order_acquire)) {
      HostInput& input = context_.host_inputs.claim_reserved();
      input.kind = HostInput::Kind::command;
      input.command = static_cast<CommandKind>(kind);
      input.origin = {};
      input.origin.kind = Origin::Kind::tcp;
      input.origin.connection = connection.index;
      input.origin.generation = connection.generation;
      context_.host_inputs.commit();
      context_.bells.conductor.ring();
    }
    return;
  }
  if (!record.has_status()) {
    refuse(connection, StatusCode::not_allowed, "this record goes the other way");
  }
}

namespace {

void fill(const Channel& channel, v1::ChannelInfo& out) {
  out.set_index(channel.index);
  out.set_name(channel.name);
  out.set_kind(std::string(to_string(channel.kind)));
  out.set_sensor(channel.sensor);
  out.set_band(channel.band);
  out.set_band_lo_um(channel.band_lo_um);
  out.set_band_hi_um(channel.band_hi_um);
  for (const scene::ResponseSample& sample : channel.response) {
    out.add_response_um(sample.wavelength_um);
    out.add_response_frac(sample.response_frac);
  }
  out.set_band_is_rectangle(channel.response.empty() && channel.band_hi_um > channel.band_lo_um);
  out.set_width_px(channel.width_px);
  out.set_height_px(channel.height_px);
  out.set_every_nth(channel.every_nth);
  out.set_window_x_px(channel.window_x_px);
  out.set_window_y_px(channel.window_y_px);
  out.set_sensor_width_px(channel.sensor_width_px);
  out.set_sensor_height_px(channel.sensor_height_px);
}

}  // namespace

void Receiver::fill_welcome(v1::Welcome& welcome) const {
  welcome.set_protocol_version(kProtocolVersion);
  welcome.set_software(identity_.software);
  welcome.set_scenario(identity_.scenario);
  welcome.set_pacing(identity_.pacing);
  welcome.set_run_id(context_.run_id.load(std::memory_order_relaxed));
  welcome.set_tai_offset_unset(context_.clock.tai_offset_unset());
  welcome.set_device(identity_.device);
  for (const Channel& channel : context_.channels) {
    fill(channel, *welcome.add_channels());
  }
}

std::vector<std::byte> Receiver::welcome() const {
  v1::Welcome message;
  fill_welcome(message);
  std::vector<std::byte> out(message.ByteSizeLong());
  message.SerializeToArray(out.data(), static_cast<int>(out.size()));
  return out;
}

void Receiver::take_hello(Connection& connection, const v1::ControlRecord& record) {
  const v1::Hello& hello = record.hello();
  const auto end = [&](StatusCode code, const std::string& text) {
    refuse(connection, code, text);
    connection.flush_close = true;
    flush(connection);
  };
  if (connection.welcomed) {
    refuse(connection, StatusCode::not_allowed, "hello comes once");
    return;
  }
  if (hello.protocol_version() != kProtocolVersion) {
    end(StatusCode::wrong_version, fmt::format("protocol version {}, this daemon speaks {}",
                                               hello.protocol_version(), kProtocolVersion));
    return;
  }
  switch (hello.role()) {
    case v1::Hello::ROLE_HOST:
      connection.role = Role::host;
      break;
    case v1::Hello::ROLE_CLIENT:
      connection.role = Role::client;
      break;
    case v1::Hello::ROLE_RECORDER:
      connection.role = Role::recorder;
      break;
    default:
      end(StatusCode::malformed, "hello without a role");
      return;
  }
  connection.welcomed = true;
  agree_on_key(connection);
  v1::ControlRecord answer;
  fill_welcome(*answer.mutable_welcome());
  queue(connection, answer);
  flush(connection);
  context_.receiver_events.push(EventKind::hello, connection.key(),
                                static_cast<std::uint64_t>(connection.role), hello.software());
  if (connection.role == Role::recorder && connection.open() && !connection.closing) {
    if (!connection.out.empty()) {
      close(connection, "does not take the welcome");
      return;
    }
    connection.lent = true;
    connection.write_lent = true;
    static_cast<void>(context_.to_recorder.push({ClientCommand::Kind::add, connection.key(),
                                                 connection.socket.fd(), connection.generation,
                                                 &connection.socket}));
    context_.bells.recorder.ring();
  }
}

void Receiver::take_subscribe(Connection& connection, const v1::ControlRecord& record) {
  const v1::Subscribe& subscribe = record.subscribe();
  if (connection.role != Role::client) {
    refuse(connection, StatusCode::not_allowed, "subscribe needs the role of a client");
    return;
  }
  if (connection.lent) {
    refuse(connection, StatusCode::not_allowed, "one subscription per connection");
    return;
  }
  const Channel* channel =
      find_channel(context_.channels, subscribe.channel_name(), subscribe.channel_kind(),
                   subscribe.sensor(), subscribe.band());
  if (channel == nullptr) {
    std::string known;
    for (const Channel& each : context_.channels) {
      known += fmt::format("{}{} ({}/{}/{})", known.empty() ? "" : ", ", each.name,
                           to_string(each.kind), each.sensor, each.band);
    }
    refuse(connection, StatusCode::unknown_channel,
           fmt::format("no channel name '{}' kind '{}' sensor '{}' band '{}'; there are {}",
                       subscribe.channel_name(), subscribe.channel_kind(), subscribe.sensor(),
                       subscribe.band(), known));
    return;
  }
  if (subscribe.every_nth() > protocol::kMaxEveryNth) {
    refuse(connection, StatusCode::malformed,
           fmt::format("every_nth {}, at most {}", subscribe.every_nth(), protocol::kMaxEveryNth));
    return;
  }
  SocketClient::Params params;
  params.connection = connection.key();
  params.channel = channel;
  params.every_frame = subscribe.every_frame();
  params.every_nth = std::max(subscribe.every_nth(), 1U);
  params.udp = subscribe.udp_port() != 0;
  params.stream_id = next_stream_id_++;
  if (params.udp) {
    auto socket = open_stream_socket(connection, subscribe.udp_port(), subscribe.multicast_group());
    if (!socket) {
      refuse(connection, StatusCode::not_allowed, socket.error().text);
      return;
    }
    params.udp_socket = std::move(*socket);
    params.fragment_payload_bytes = std::clamp(
        subscribe.fragment_payload_bytes() != 0 ? subscribe.fragment_payload_bytes()
                                                : config_.stream.udp_fragment_payload_bytes,
        protocol::kMinFragmentPayloadBytes, protocol::kMaxFragmentPayloadBytes);
    auto fec = error_correction_for(subscribe, *channel, params.fragment_payload_bytes);
    if (!fec) {
      refuse(connection, StatusCode::not_allowed, fec.error().text);
      return;
    }
    params.fec = *fec;
    // Of a group everybody would have to lose the same, and pixels of ig-clock are soon replaced.
    if (subscribe.resend() && subscribe.multicast_group().empty() &&
        config_.pacing.mode == config::PacingMode::host_step &&
        config_.stream.resend_max_frac > 0.0) {
      params.resend_frames = std::max(config_.stream.queue_frames, 1U);
      params.resend_max_frac = config_.stream.resend_max_frac;
    }
  } else {
    params.tcp_socket = &connection.socket;
    params.compression =
        config_.stream.compression && subscribe.compression() == v1::COMPRESSION_SHUFFLED_LZ4;
    connection.socket.set_send_buffer(config_.stream.tcp_send_buffer_bytes);
  }
  v1::ControlRecord answer;
  fill(*channel, *answer.mutable_subscribed()->mutable_channel());
  answer.mutable_subscribed()->set_stream_id(params.stream_id);
  answer.mutable_subscribed()->set_resend(params.resend_frames > 0);
  if (params.fec.on()) {
    v1::ErrorCorrection& granted = *answer.mutable_subscribed()->mutable_error_correction();
    granted.set_data_fragments(params.fec.data_fragments);
    granted.set_parity_fragments(params.fec.parity_fragments);
  }
  answer.mutable_subscribed()->set_compression(params.compression ? v1::COMPRESSION_SHUFFLED_LZ4
                                                                  : v1::COMPRESSION_NONE);
  answer.mutable_subscribed()->set_every_nth(params.every_nth * channel->every_nth);
  const bool udp = params.udp;
  if (!udp) {
    // From here on the sender writes: what is still queued goes first.
    params.first_bytes.assign(
        connection.out.begin() + static_cast<std::ptrdiff_t>(connection.out_sent),
        connection.out.end());
    protocol::append_control_record(answer, params.first_bytes);
  }
  // Before anything is said or marked: there may be no memory for it.
  auto client = std::make_unique<SocketClient>(std::move(params));
  if (udp) {
    queue(connection, answer);
    flush(connection);
    if (!connection.open() || connection.closing) {
      return;
    }
  } else {
    connection.out.clear();
    connection.out_sent = 0;
    connection.write_lent = true;
    connection.dirty = true;
  }
  connection.lent = true;
  connection.client = std::move(client);
  static_cast<void>(context_.to_sender.push(
      {ClientCommand::Kind::add, connection.key(), connection.client.get()}));
  context_.bells.sender.ring();
  context_.receiver_events.push(EventKind::subscribed, connection.key(), channel->index,
                                udp ? "udp" : "tcp");
}

physics::Result<protocol::FecParams> Receiver::error_correction_for(
    const v1::Subscribe& subscribe, const Channel& channel,
    std::uint32_t fragment_payload_bytes) const {
  using physics::ErrorCode;
  protocol::FecParams fec{config_.stream.fec_data_fragments, config_.stream.fec_parity_fragments};
  if (subscribe.has_error_correction()) {
    const v1::ErrorCorrection& wish = subscribe.error_correction();
    fec = {wish.data_fragments(), wish.parity_fragments()};
  }
  if (!fec.on()) {
    return protocol::FecParams{};
  }
  if (!fec.valid()) {
    return physics::make_error(
        ErrorCode::protocol,
        fmt::format(
            "error correction {}+{}: groups have 1 to {} data and up to {} parity fragments",
            fec.data_fragments, fec.parity_fragments, protocol::kMaxFecData,
            protocol::kMaxFecParity));
  }
  const double most = config_.stream.fec_max_parity_frac;
  if (static_cast<double>(fec.parity_fragments) > most * fec.data_fragments) {
    return physics::make_error(
        ErrorCode::protocol,
        fmt::format("error correction {}+{}: stream.fec_max_parity_frac allows {:g} parity "
                    "fragments per data fragment",
                    fec.data_fragments, fec.parity_fragments, most));
  }
  constexpr std::uint64_t kMostGroups = 65535;  // by the parity fragment's header
  const std::uint64_t bytes = std::uint64_t{channel.width_px} * channel.height_px * sizeof(float) +
                              3 * protocol::kFrameHeaderBytes;
  if (bytes / fragment_payload_bytes / fec.data_fragments >= kMostGroups) {
    return physics::make_error(ErrorCode::protocol,
                               fmt::format("error correction {}+{}: more than {} groups in a frame",
                                           fec.data_fragments, fec.parity_fragments, kMostGroups));
  }
  return fec;
}

/// Nothing here allocates while the request is sound: losses must not cost the host its turn.
void Receiver::take_resend(Connection& connection, std::span<const std::byte> body) {
  if (connection.role != Role::client || !connection.lent) {
    refuse(connection, StatusCode::not_allowed, "a resend request needs a subscription");
    return;
  }
  ResendCommand* command = context_.resends.claim();
  if (command == nullptr) {
    context_.counters.add(Counter::resends_refused);
    return;
  }
  command->connection = connection.key();
  if (!protocol::decode_resend(body, command->request)) {
    refuse(connection, StatusCode::malformed, "not a resend request");
    return;
  }
  context_.resends.commit();
  context_.bells.sender.ring();
}

physics::Result<UdpSocket> Receiver::open_stream_socket(const Connection& connection,
                                                        std::uint32_t port,
                                                        const std::string& group) const {
  using physics::ErrorCode;
  if (port > 65535) {
    return physics::make_error(ErrorCode::protocol,
                               fmt::format("udp port {} does not exist", port));
  }
  SocketAddress target = connection.peer;
  if (!group.empty()) {
    // Names are not looked up on a client's behalf.
    target = numeric_address(group, static_cast<std::uint16_t>(port));
    if (!target.is_multicast()) {
      // Otherwise anybody could have frames sent to anybody.
      return physics::make_error(ErrorCode::protocol, "'" + group + "' is not a multicast group");
    }
    if (!protocol::any_contains(config_.access.multicast_groups, ip_of(target))) {
      return physics::make_error(ErrorCode::protocol,
                                 "group " + group + " is not in access.multicast_groups");
    }
  }
  target.set_port(static_cast<std::uint16_t>(port));
  auto socket = UdpSocket::open(sockets_, target);
  if (!socket) {
    return socket;
  }
  socket->set_send_buffer(config_.stream.udp_send_buffer_bytes);
  if (!group.empty()) {
    socket->set_multicast_hops(static_cast<int>(config_.stream.multicast_ttl));
    // Out to where the client is, not to where the default route leads.
    const unsigned interface = interface_of(connection.socket.local_address());
    if (const int error = socket->set_multicast_interface(target, interface); error != 0) {
      return physics::make_error(ErrorCode::protocol,
                                 fmt::format("group {}: {}", group, error_text(error)));
    }
  }
  // From the address that the client knows: it takes frames from no other.
  const protocol::IpAddress own = ip_of(connection.socket.local_address());
  if (own.v4 == ip_of(target).v4) {
    SocketAddress from = connection.socket.local_address();
    if (from.storage.ss_family != target.storage.ss_family) {
      from = numeric_address(protocol::to_string(own), 0);
    }
    from.set_port(0);
    if (auto bound = socket->bind(from); !bound) {
      return tl::unexpected<physics::Error>(std::move(bound.error()));
    }
  }
  if (auto connected = socket->connect(target); !connected) {
    return tl::unexpected<physics::Error>(std::move(connected.error()));
  }
  return socket;
}

void Receiver::refuse(Connection& connection, StatusCode code, const std::string& text,
                      std::uint64_t host_frame_number) {
  const std::uint64_t count = context_.counters.add(counter_of(code));
  ++connection.misbehaved;
  connection.pace.refusal(context_.clock.monotonic_ns());
  context_.receiver_events.push(EventKind::refused, static_cast<std::uint64_t>(code), count, text);
  send_status(connection, code, text, host_frame_number, count);
}

void Receiver::send_status(Connection& connection, StatusCode code, const std::string& text,
                           std::uint64_t host_frame_number, std::uint64_t count) {
  if (connection.write_lent) {
    context_.counters.add(Counter::statuses_suppressed);
    return;
  }
  v1::ControlRecord answer;
  v1::Status& status = *answer.mutable_status();
  status.set_code(static_cast<v1::Status::Code>(code));
  status.set_text(text);
  status.set_host_frame_number(host_frame_number);
  status.set_count(count);
  queue(connection, answer);
  flush(connection);
}

void Receiver::queue(Connection& connection, const v1::ControlRecord& record) {
  protocol::append_control_record(record, connection.out);
  connection.dirty = true;
}

}  // namespace emit::server
