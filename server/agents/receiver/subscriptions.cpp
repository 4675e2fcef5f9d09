// SPDX-License-Identifier: Apache-2.0
#include "agents/receiver/subscriptions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "agents/receiver/channel_info.hpp"
#include "emit/protocol/fragment.hpp"
#include "emit/v1/control.pb.h"
#include "net/ip_address.hpp"
#include "rt/error_text.hpp"

namespace emit::server {

using physics::ErrorCode;

tl::expected<const Channel*, Subscriptions::Refusal> Subscriptions::channel_for(
    const v1::Subscribe& subscribe) const {
  const Channel* channel =
      find_channel(context_.channels, subscribe.channel_name(), subscribe.channel_kind(),
                   subscribe.sensor(), subscribe.band());
  if (channel != nullptr) {
    return channel;
  }
  std::string known;
  for (const Channel& each : context_.channels) {
    known += fmt::format("{}{} ({}/{}/{})", known.empty() ? "" : ", ", each.name,
                         to_string(each.kind), each.sensor, each.band);
  }
  return tl::unexpected(
      Refusal{StatusCode::unknown_channel,
              fmt::format("no channel name '{}' kind '{}' sensor '{}' band '{}'; there are {}",
                          subscribe.channel_name(), subscribe.channel_kind(), subscribe.sensor(),
                          subscribe.band(), known)});
}

tl::expected<SocketClient::Params, Subscriptions::Refusal> Subscriptions::grant(
    const Caller& caller, const v1::Subscribe& subscribe, v1::Subscribed& answer) {
  const auto channel = channel_for(subscribe);
  if (!channel) {
    return tl::unexpected(channel.error());
  }
  if (subscribe.every_nth() > protocol::kMaxEveryNth) {
    return tl::unexpected(Refusal{
        StatusCode::malformed,
        fmt::format("every_nth {}, at most {}", subscribe.every_nth(), protocol::kMaxEveryNth)});
  }
  SocketClient::Params params;
  params.connection = caller.key;
  params.channel = *channel;
  params.every_frame = subscribe.every_frame();
  params.every_nth = std::max(subscribe.every_nth(), 1U);
  params.udp = subscribe.udp_port() != 0;
  params.stream_id = next_stream_id_++;
  if (params.udp) {
    if (auto granted = grant_udp(caller, subscribe, params); !granted) {
      return tl::unexpected(Refusal{StatusCode::not_allowed, granted.error().text});
    }
  } else {
    params.tcp_socket = caller.socket;
    params.compression =
        config_.stream.compression && subscribe.compression() == v1::COMPRESSION_SHUFFLED_LZ4;
    caller.socket->set_send_buffer(config_.stream.tcp_send_buffer_bytes);
  }
  fill(**channel, *answer.mutable_channel());
  answer.set_stream_id(params.stream_id);
  answer.set_resend(params.resend_frames > 0);
  answer.set_fragment_payload_bytes(params.fragment_payload_bytes);
  if (params.fec.on()) {
    v1::ErrorCorrection& granted = *answer.mutable_error_correction();
    granted.set_data_fragments(params.fec.data_fragments);
    granted.set_parity_fragments(params.fec.parity_fragments);
  }
  answer.set_compression(params.compression ? v1::COMPRESSION_SHUFFLED_LZ4 : v1::COMPRESSION_NONE);
  answer.set_every_nth(params.every_nth * (*channel)->every_nth);
  return params;
}

physics::Result<void> Subscriptions::grant_udp(const Caller& caller, const v1::Subscribe& subscribe,
                                               SocketClient::Params& params) const {
  auto socket = open_stream_socket(caller, subscribe.udp_port(), subscribe.multicast_group());
  if (!socket) {
    return tl::unexpected<physics::Error>(std::move(socket.error()));
  }
  params.udp_socket = std::move(*socket);
  params.fragment_payload_bytes = protocol::granted_fragment_payload_bytes(
      subscribe.fragment_payload_bytes() != 0 ? subscribe.fragment_payload_bytes()
                                              : config_.stream.udp_fragment_payload_bytes);
  auto fec = error_correction_for(subscribe, *params.channel, params.fragment_payload_bytes);
  if (!fec) {
    return tl::unexpected<physics::Error>(std::move(fec.error()));
  }
  params.fec = *fec;
  // Resend is not granted to groups, whose members would all have to lose the same fragments. It is
  // not granted with ig-clock, whose images are soon replaced.
  if (subscribe.resend() && subscribe.multicast_group().empty() &&
      config_.pacing.mode == config::PacingMode::host_step &&
      config_.stream.resend_max_frac > 0.0) {
    params.resend_frames = std::max(config_.stream.queue_frames, 1U);
    params.resend_max_frac = config_.stream.resend_max_frac;
  }
  return {};
}

physics::Result<protocol::FecParams> Subscriptions::error_correction_for(
    const v1::Subscribe& subscribe, const Channel& channel,
    std::uint32_t fragment_payload_bytes) const {
  protocol::FecParams fec{config_.stream.fec_data_fragments, config_.stream.fec_parity_fragments};
  if (subscribe.has_error_correction()) {
    const v1::ErrorCorrection& wanted = subscribe.error_correction();
    fec = {wanted.data_fragments(), wanted.parity_fragments()};
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
  const double limit = config_.stream.fec_max_parity_frac;
  if (static_cast<double>(fec.parity_fragments) > limit * fec.data_fragments) {
    return physics::make_error(
        ErrorCode::protocol,
        fmt::format("error correction {}+{}: stream.fec_max_parity_frac allows {:g} parity "
                    "fragments per data fragment",
                    fec.data_fragments, fec.parity_fragments, limit));
  }
  constexpr std::uint64_t kMaxGroups = 65535;  // a limit of the parity fragment's header
  const std::uint64_t bytes = std::uint64_t{channel.width_px} * channel.height_px * sizeof(float) +
                              3 * protocol::kFrameHeaderBytes;
  if (bytes / fragment_payload_bytes / fec.data_fragments >= kMaxGroups) {
    return physics::make_error(ErrorCode::protocol,
                               fmt::format("error correction {}+{}: more than {} groups in a frame",
                                           fec.data_fragments, fec.parity_fragments, kMaxGroups));
  }
  return fec;
}

physics::Result<SocketAddress> Subscriptions::target_of(const Caller& caller, std::uint32_t port,
                                                        const std::string& group) const {
  if (port > 65535) {
    return physics::make_error(ErrorCode::protocol,
                               fmt::format("udp port {} does not exist", port));
  }
  SocketAddress target = caller.peer;
  if (!group.empty()) {
    // Names are not looked up on a client's behalf.
    target = numeric_address(group, static_cast<std::uint16_t>(port));
    if (!target.is_multicast()) {
      // Other addresses would let anybody have frames sent to anybody.
      return physics::make_error(ErrorCode::protocol, "'" + group + "' is not a multicast group");
    }
    if (!protocol::any_contains(config_.access.multicast_groups, ip_of(target))) {
      return physics::make_error(ErrorCode::protocol,
                                 "group " + group + " is not in access.multicast_groups");
    }
  }
  target.set_port(static_cast<std::uint16_t>(port));
  return target;
}

physics::Result<UdpSocket> Subscriptions::open_stream_socket(const Caller& caller,
                                                             std::uint32_t port,
                                                             const std::string& group) const {
  const auto target = target_of(caller, port, group);
  if (!target) {
    return tl::unexpected<physics::Error>(physics::Error(target.error()));
  }
  auto socket = UdpSocket::open(sockets_, *target);
  if (!socket) {
    return socket;
  }
  socket->set_send_buffer(config_.stream.udp_send_buffer_bytes);
  if (!group.empty()) {
    socket->set_multicast_hops(static_cast<int>(config_.stream.multicast_ttl));
    // Frames leave by the interface of the client, not by the default route.
    const unsigned interface = interface_of(caller.socket->local_address());
    if (const int error = socket->set_multicast_interface(*target, interface); error != 0) {
      return physics::make_error(ErrorCode::protocol,
                                 fmt::format("group {}: {}", group, error_text(error)));
    }
  }
  // Frames come from the address that the client knows, because it takes frames from no other.
  const protocol::IpAddress own = ip_of(caller.socket->local_address());
  if (own.v4 == ip_of(*target).v4) {
    SocketAddress from = caller.socket->local_address();
    if (from.storage.ss_family != target->storage.ss_family) {
      from = numeric_address(protocol::to_string(own), 0);
    }
    from.set_port(0);
    if (auto bound = socket->bind(from); !bound) {
      return tl::unexpected<physics::Error>(std::move(bound.error()));
    }
  }
  if (auto connected = socket->connect(*target); !connected) {
    return tl::unexpected<physics::Error>(std::move(connected.error()));
  }
  return socket;
}

}  // namespace emit::server
