// SPDX-License-Identifier: Apache-2.0
#include "agents/receiver/control_session.hpp"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "agents/receiver/channel_info.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/version.hpp"
#include "emit/v1/control.pb.h"
#include "net/tls_session.hpp"

namespace emit::server {

using protocol::kProtocolVersion;

void ControlSession::take(Connection& connection, const protocol::Record& record,
                          std::int64_t now_ns) {
  if (!connection.welcomed && record.kind != protocol::RecordKind::control) {
    refuse_first_record(connection);
    return;
  }
  switch (record.kind) {
    case protocol::RecordKind::host_frame:
      take_host_frame(connection, record.body, now_ns);
      return;
    case protocol::RecordKind::control: {
      const auto frame = protocol::host_frame_in_control_record(record.body);
      if (frame.empty()) {
        take_control(connection, record.body);
      } else if (connection.welcomed) {
        take_host_frame(connection, frame, now_ns);
      } else {
        refuse_first_record(connection);
      }
      return;
    }
    case protocol::RecordKind::resend:
      take_resend(connection, record.body);
      return;
    case protocol::RecordKind::frame:
      connections_.refuse(connection, StatusCode::not_allowed, "frames go the other way");
      return;
  }
  // A kind of a newer version is skipped.
}

void ControlSession::refuse_first_record(Connection& connection) {
  connections_.refuse_and_close(connection, StatusCode::not_allowed, "hello comes first");
}

void ControlSession::hand_over(const Connection& connection, HostInput& input,
                               HostInput::Kind kind) noexcept {
  input.kind = kind;
  input.origin = {};
  input.origin.kind = Origin::Kind::tcp;
  input.origin.connection = connection.index;
  input.origin.generation = connection.generation;
  context_.host_inputs.commit();
  context_.bells.conductor.ring();
}

void ControlSession::take_host_frame(Connection& connection, std::span<const std::byte> bytes,
                                     std::int64_t now_ns) {
  if (connection.role != Role::host) {
    connections_.refuse(connection, StatusCode::not_allowed, "host frames need the role of a host");
    return;
  }
  if (draining_) {
    return;
  }
  if (!admission_.limits().take_host_frame(connection.ip, connection.peer.port(),
                                           context_.clock.monotonic_ns())) {
    context_.counters.add(Counter::host_frames_over_rate);
    connections_.refuse(connection, StatusCode::overloaded,
                        "more host frames a second than access.max_host_frames_hz");
    return;
  }
  HostInput& input = context_.host_inputs.claim_reserved();
  const protocol::DecodeStatus decoded = protocol::decode_host_frame(bytes, decoder_, input.frame);
  if (decoded != protocol::DecodeStatus::ok) {
    std::array<char, protocol::kFaultTextBytes> text;
    std::array<char, protocol::kFaultTextBytes> place;
    connections_.refuse(
        connection, static_cast<StatusCode>(decoded),
        "host frame: " + std::string(protocol::fault_text(decoded, decoder_.fault(), text)),
        input.frame.frame_number, protocol::fault_place(decoded, decoder_.fault(), place));
    return;
  }
  input.frame.received_ns = now_ns;
  hand_over(connection, input, HostInput::Kind::frame);
}

void ControlSession::take_control(Connection& connection, std::span<const std::byte> body) {
  if (!admission_.limits().take_control_record(connection.ip, connection.peer.port(),
                                               context_.clock.monotonic_ns())) {
    context_.counters.add(Counter::control_over_rate);
    connections_.refuse(connection, StatusCode::overloaded,
                        "more control records a second than access.max_control_records_hz");
    return;
  }
  v1::ControlRecord record;
  if (!protocol::parse_control_record(body, record)) {
    if (connection.welcomed) {
      connections_.refuse(connection, StatusCode::malformed, "not a control record");
    } else {
      connections_.refuse_and_close(connection, StatusCode::malformed, "not a control record");
    }
  } else if (record.has_hello()) {
    take_hello(connection, record);
  } else if (!connection.welcomed) {
    refuse_first_record(connection);
  } else if (record.has_subscribe()) {
    take_subscribe(connection, record);
  } else if (record.has_command()) {
    take_command(connection, record);
  } else if (!record.has_status()) {
    connections_.refuse(connection, StatusCode::not_allowed, "this record goes the other way");
  }
}

void ControlSession::take_command(Connection& connection, const v1::ControlRecord& record) {
  const auto kind = static_cast<int>(record.command().kind());
  if (connection.role != Role::host) {
    connections_.refuse(connection, StatusCode::not_allowed, "commands need the role of a host");
  } else if (kind < static_cast<int>(CommandKind::start) ||
             kind > static_cast<int>(CommandKind::reset)) {
    connections_.refuse(connection, StatusCode::malformed, "unknown command");
  } else if (!draining_) {
    HostInput& input = context_.host_inputs.claim_reserved();
    input.command = static_cast<CommandKind>(kind);
    hand_over(connection, input, HostInput::Kind::command);
  }
}

void ControlSession::fill_welcome(v1::Welcome& welcome) const {
  welcome.set_protocol_version(kProtocolVersion);
  welcome.set_software(identity_.software);
  welcome.set_scenario(identity_.scenario);
  welcome.set_pacing(identity_.pacing);
  welcome.set_run_id(context_.run_id.load(std::memory_order_relaxed));
  welcome.set_tai_offset_unset(context_.clock.tai_offset_unset());
  welcome.set_device(identity_.device);
  welcome.set_sends_journal_end(true);
  for (const Channel& channel : context_.channels) {
    fill(channel, *welcome.add_channels());
  }
}

std::vector<std::byte> ControlSession::welcome() const {
  v1::Welcome message;
  fill_welcome(message);
  std::vector<std::byte> out(message.ByteSizeLong());
  message.SerializeToArray(out.data(), static_cast<int>(out.size()));
  return out;
}

void ControlSession::take_hello(Connection& connection, const v1::ControlRecord& record) {
  const v1::Hello& hello = record.hello();
  if (connection.welcomed) {
    connections_.refuse(connection, StatusCode::not_allowed, "hello comes once");
    return;
  }
  if (hello.protocol_version() != kProtocolVersion) {
    connections_.refuse_and_close(connection, StatusCode::wrong_version,
                                  fmt::format("protocol version {}, this daemon speaks {}",
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
      connections_.refuse_and_close(connection, StatusCode::malformed, "hello without a role");
      return;
  }
  connection.welcomed = true;
  agree_on_key(connection);
  v1::ControlRecord answer;
  fill_welcome(*answer.mutable_welcome());
  connections_.queue(connection, answer);
  connections_.flush(connection);
  context_.receiver_events.push(EventKind::hello, connection.key(),
                                static_cast<std::uint64_t>(connection.role), hello.software());
  if (connection.role == Role::recorder && connection.open() && !connection.closing) {
    lend_to_recorder(connection);
  }
}

void ControlSession::agree_on_key(Connection& connection) {
  protocol::SessionKey key;
  if (sessions_ != nullptr && connection.role == Role::host && connection.socket.tls() != nullptr &&
      connection.socket.tls()->export_key(key)) {
    sessions_->add_key(connection.key(), key);
    connection.agreed_key = true;
  }
}

void ControlSession::lend_to_recorder(Connection& connection) {
  if (!connection.out.empty()) {
    connections_.close(connection, "does not take the welcome");
    return;
  }
  connection.lent = true;
  connection.write_lent = true;
  static_cast<void>(
      context_.to_recorder.push({ClientCommand::Kind::add, connection.key(), connection.socket.fd(),
                                 connection.generation, &connection.socket}));
  context_.bells.recorder.ring();
}

void ControlSession::take_subscribe(Connection& connection, const v1::ControlRecord& record) {
  if (connection.role != Role::client) {
    connections_.refuse(connection, StatusCode::not_allowed,
                        "subscribe needs the role of a client");
    return;
  }
  if (connection.lent) {
    connections_.refuse(connection, StatusCode::not_allowed, "one subscription per connection");
    return;
  }
  v1::ControlRecord answer;
  auto granted = subscriptions_.grant({connection.key(), connection.peer, &connection.socket},
                                      record.subscribe(), *answer.mutable_subscribed());
  if (!granted) {
    connections_.refuse(connection, granted.error().code, granted.error().text);
    return;
  }
  SocketClient::Params& params = *granted;
  const bool udp = params.udp;
  const std::uint32_t channel = params.channel->index;
  if (!udp) {
    // The sender writes from here on. Answers that are still queued go first.
    params.first_bytes.assign(
        connection.out.begin() + static_cast<std::ptrdiff_t>(connection.out_sent),
        connection.out.end());
    protocol::append_control_record(answer, params.first_bytes);
  }
  // Make the client before anything is sent or marked: there may be no memory for it.
  auto client = std::make_unique<SocketClient>(std::move(params));
  if (udp) {
    connections_.queue(connection, answer);
    connections_.flush(connection);
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
  context_.receiver_events.push(EventKind::subscribed, connection.key(), channel,
                                udp ? "udp" : "tcp");
}

/// Nothing here allocates while the request is sound: losses must not cost the host its turn.
void ControlSession::take_resend(Connection& connection, std::span<const std::byte> body) {
  if (connection.role != Role::client || !connection.lent) {
    connections_.refuse(connection, StatusCode::not_allowed,
                        "a resend request needs a subscription");
    return;
  }
  ResendCommand* command = context_.resends.claim();
  if (command == nullptr) {
    context_.counters.add(Counter::resends_refused);
    return;
  }
  command->connection = connection.key();
  if (!protocol::decode_resend(body, command->request)) {
    connections_.refuse(connection, StatusCode::malformed, "not a resend request");
    return;
  }
  context_.resends.commit();
  context_.bells.sender.ring();
}

}  // namespace emit::server
