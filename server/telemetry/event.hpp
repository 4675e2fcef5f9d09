// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>

namespace emit::server {

/// Each member has the name that the log prints (`event=NAME`).
enum class EventKind : std::uint8_t {
  run_started,              ///< a = run id
  host_restarted,           ///< a = host's run id
  command,                  ///< a = CommandKind
  refused,                  ///< a = StatusCode, b = count
  connected,                ///< a = connection, text = peer
  disconnected,             ///< a = connection, text = why
  hello,                    ///< a = connection, b = role, text = software
  subscribed,               ///< a = connection, b = channel, text = transport
  client_failed,            ///< a = connection, b = errno
  disconnected_slow,        ///< a = connection
  no_segmentation_offload,  ///< a = connection, b = errno
  source_failed,            ///< text = why
  device_lost,              ///< text = why; the daemon ends
  journal_failed,           ///< text = why
  journal_overrun,          ///< a = first sequence lost
  slots_missed,             ///< a = how many
  weather_lost,             ///< a = sim time of the sample, ns
  poses_dropped,            ///< a = how many
  heat_limit,               ///< a = renderer::HeatLimit, text = what it means
  coarse,                   ///< a = renderer::CoarseReason, text = what it means
  warmed_up_again,          ///< a = time it took, ns, b = jump of simulation time, ns
  trigger_silent,           ///< a = number of the last one
  peer_refused,             ///< text = address, a = PeerRefusal
  secured,                  ///< a = connection, text = names in the peer's certificate
  host_session,             ///< text = address
  motion_changed,           ///< a = protocol::MotionState, b = protocol::MotionFaults
  axes_connected,           ///< text = address of the motion simulator's controller
  axes_lost,                ///< text = why
  axes_refused,             ///< a = axis, from 1 on, text = answer of the controller
  gateway_mode,             ///< a = protocol::cigi::IgMode
  gateway_time,             ///< a = simulation time that the host has set, ns
  gateway_refused,          ///< text = what, why
};

/// Why a peer is turned away before anything it says is looked at.
enum class PeerRefusal : std::uint8_t { not_allowed, handshake, mac, trigger_mac };

/// any agent -> housekeeping: what happened, as numbers; the text is put together there.
struct Event {
  EventKind kind = EventKind::run_started;
  std::uint64_t a = 0;
  std::uint64_t b = 0;
  std::array<char, 104> text{};
};

}  // namespace emit::server
