// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "agents/context.hpp"
#include "agents/receiver/admission.hpp"
#include "agents/receiver/connection_table.hpp"
#include "agents/receiver/host_sessions.hpp"
#include "agents/receiver/subscriptions.hpp"
#include "emit/protocol/codec.hpp"
#include "emit/protocol/framing.hpp"

namespace emit::v1 {
class ControlRecord;
class Welcome;
}  // namespace emit::v1

namespace emit::server {

/// The conversation on control connections (protocol/docs/wire.md section 1): hello, subscriptions,
/// commands, host frames over TCP, requests for missing fragments. Host frames and commands go to
/// the conductor in order of arrival.
/// Thread: the receiver's. Real time: host frames and resend requests are RT-safe.
class ControlSession {
 public:
  /// Fields of Welcome beside channels and run id.
  struct Identity {
    std::string software;
    std::string scenario;
    std::string pacing;
    std::string device;
  };
  ControlSession(Context& context, const config::DaemonConfig& config, Admission& admission,
                 ConnectionTable& connections, const SocketContext& sockets)
      : context_(context),
        admission_(admission),
        connections_(connections),
        subscriptions_(context, config, sockets) {}

  void set_identity(Identity identity) { identity_ = std::move(identity); }
  /// Sets the sessions with which hosts over TLS agree on keys; null: bare datagrams are accepted.
  void set_host_sessions(HostSessions* sessions) noexcept { sessions_ = sessions; }
  /// Ignores host frames and commands from here on.
  void drain() noexcept { draining_ = true; }

  /// Returns the serialised emit.v1.Welcome that a client would get now.
  [[nodiscard]] std::vector<std::byte> welcome() const;
  /// Handles one record.
  /// @pre there is room for one input on the conductor's ring, if the role of the connection is
  /// host and drain() was not called
  /// @param now_ns  wall instant of arrival
  void take(Connection& connection, const protocol::Record& record, std::int64_t now_ns);

 private:
  using Role = Connection::Role;

  void take_host_frame(Connection& connection, std::span<const std::byte> bytes,
                       std::int64_t now_ns);
  void take_control(Connection& connection, std::span<const std::byte> body);
  void take_hello(Connection& connection, const v1::ControlRecord& record);
  void take_command(Connection& connection, const v1::ControlRecord& record);
  void take_subscribe(Connection& connection, const v1::ControlRecord& record);
  void take_resend(Connection& connection, std::span<const std::byte> body);
  void refuse_first_record(Connection& connection);
  void agree_on_key(Connection& connection);
  void lend_to_recorder(Connection& connection);
  void fill_welcome(v1::Welcome& welcome) const;
  /// Hands the input that was claimed on the ring to the conductor.
  void hand_over(const Connection& connection, HostInput& input, HostInput::Kind kind) noexcept;

  Context& context_;
  Admission& admission_;
  ConnectionTable& connections_;
  Subscriptions subscriptions_;
  HostSessions* sessions_ = nullptr;
  Identity identity_;
  protocol::HostFrameDecoder decoder_;
  bool draining_ = false;
};

}  // namespace emit::server
