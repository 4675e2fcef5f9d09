// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "agents/channel_table.hpp"
#include "agents/messages.hpp"
#include "agents/run_board.hpp"
#include "emit/protocol/resend.hpp"
#include "gateway/host_gateway.hpp"
#include "rt/byte_ring.hpp"
#include "rt/client_counts.hpp"
#include "rt/clock.hpp"
#include "rt/counters.hpp"
#include "rt/doorbell.hpp"
#include "rt/histogram.hpp"
#include "rt/motion_times.hpp"
#include "rt/picture_board.hpp"
#include "rt/prediction_error.hpp"
#include "rt/shortage.hpp"
#include "rt/spsc_ring.hpp"
#include "telemetry/event_log.hpp"
#include "telemetry/frame_trace.hpp"

namespace emit::server {

class SenderClient;
class RecorderPeer;
class TcpSocket;

/// Message of receiver to sender about a client.
struct ClientCommand {
  enum class Kind : std::uint8_t { add, remove };
  Kind kind = Kind::add;
  std::uint32_t connection = 0;
  SenderClient* client = nullptr;  ///< add: lent until it comes back with ClientReleased
};
/// Message of sender to receiver: the receiver owns the client's socket and memory again.
struct ClientReleased {
  std::uint32_t connection = 0;
  SenderClient* client = nullptr;
};
/// Message of receiver to sender: a client lacks parts of a frame.
struct ResendCommand {
  std::uint32_t connection = 0;
  protocol::ResendRequest request;
};
/// Message of receiver to recorder about a connection. It comes back like a client.
struct RecorderCommand {
  ClientCommand::Kind kind = ClientCommand::Kind::add;
  std::uint32_t connection = 0;
  int fd = -1;
  std::uint64_t handle = 0;     ///< generation of the connection
  TcpSocket* socket = nullptr;  ///< add: lent until it comes back with RecorderReleased
};
struct RecorderReleased {
  std::uint32_t connection = 0;
};

/// Doorbells of the agents. Each is rung after something was put on one of the agent's rings.
struct Doorbells {
  Doorbell conductor;
  Doorbell receiver;
  Doorbell render;
  Doorbell sender;
  Doorbell recorder;
  Doorbell motion;
  Doorbell gateway;
  Doorbell console;  ///< the thread of the console, which is no agent
};

/// Objects that more than one agent uses: rings, counters and what is fixed after start.
struct Context {
  Context(const Clock& injected_clock, std::size_t journal_bytes, std::size_t max_clients)
      : clock(injected_clock),
        journal(journal_bytes),
        to_sender(4 * max_clients),
        from_sender(4 * max_clients),
        to_recorder(4 * max_clients),
        from_recorder(4 * max_clients),
        client_places_(max_clients),
        clients_(std::make_unique<ClientCounts[]>(max_clients)) {}

  /// Counts of the connections, by place in the receiver's table. Thread: any.
  [[nodiscard]] std::span<ClientCounts> clients() const noexcept {
    return {clients_.get(), client_places_};
  }
  /// Returns the counts of a connection; null when it has no place in the table.
  [[nodiscard]] ClientCounts* counts_of(std::uint32_t connection) const noexcept {
    const std::uint32_t place = connection_place(connection);
    return place < client_places_ ? &clients_[place] : nullptr;
  }

  const Clock& clock;
  Counters counters;
  FrameTimes times;
  PredictionErrors prediction;
  MotionTimes motion_times;
  RunBoard run;
  AxesBoard axes;
  PictureBoard picture;  ///< what a host wants people to see; the console follows it
  FrameTrace trace;
  Doorbells bells;
  std::vector<Channel> channels;             ///< fixed before the agents run
  std::vector<Camera> cameras = {Camera{}};  ///< fixed likewise
  std::vector<Picture> pictures;  ///< fixed likewise; the render agent fills their copies
  /// Pictures shift: the motion agent hands measurements to the render agent too. Fixed likewise.
  bool shifts_pictures = false;
  std::atomic<std::uint64_t> run_id{0};
  std::atomic<bool> device_lost{false};  ///< set by render: no frame comes any more
  /// Monotonic instant at which the render agent began to submit a frame after a jump of simulation
  /// time; 0: it does not submit one. See warms_up_again().
  std::atomic<std::int64_t> jump_since_ns{0};
  std::atomic<std::uint64_t> frames_handed_over{0};   ///< put on `published` by the conductor
  std::atomic<std::uint64_t> journal_handed_over{0};  ///< lines put on `journal`
  /// Memory of the entries that are kept for recorders that connect later.
  std::atomic<std::uint64_t> journal_memory_bytes{0};

  SpscRing<HostInput> host_inputs{32};          // receiver -> conductor
  SpscRing<StatusReply> replies{256};           // conductor -> receiver
  SpscRing<RenderJob> jobs{16};                 // conductor -> render
  SpscRing<RenderDone> done{16};                // render -> conductor
  SpscRing<PublishFrame> published{16};         // conductor -> sender
  SpscRing<MotionInput> motion_inputs{64};      // conductor -> motion
  SpscRing<MotionReport> motion_reports{256};   // motion -> conductor
  SpscRing<HostInput> gateway_inputs{32};       // gateway -> conductor
  SpscRing<GatewayReport> gateway_reports{64};  // conductor -> gateway
  SpscRing<AxisFeedback> shift_feedback{1024};  // motion -> render, where pictures shift
  SpscRing<AxesTick> axes_ticks{256};           // motion -> console, while a page is open
  SpscRing<HostInput> console_inputs{8};        // console -> conductor
  SpscRing<StatusReply> console_replies{32};    // conductor -> console
  ByteRing journal;                             // conductor -> recorder
  SpscRing<ClientCommand> to_sender;            // receiver -> sender
  SpscRing<ClientReleased> from_sender;         // sender -> receiver
  SpscRing<ResendCommand> resends{64};          // receiver -> sender
  SpscRing<RecorderCommand> to_recorder;        // receiver -> recorder
  SpscRing<RecorderReleased> from_recorder;     // recorder -> receiver

  Shortage of_room;          ///< on `published`: the conductor waits for the sender
  Shortage of_slots;         ///< of the source: render waits for whoever releases one
  Shortage of_inputs;        ///< on `host_inputs`: the receiver waits for the conductor
  Shortage of_gateway_room;  ///< on `gateway_inputs`: the gateway waits for the conductor

  EventLog conductor_events{256, counters};
  EventLog receiver_events{256, counters};
  EventLog render_events{64, counters};
  EventLog sender_events{256, counters};
  EventLog recorder_events{64, counters};
  EventLog metrics_events{64, counters};
  EventLog console_events{64, counters};
  EventLog motion_events{64, counters};
  EventLog gateway_events{64, counters};

 private:
  std::size_t client_places_;
  std::unique_ptr<ClientCounts[]> clients_;
};

/// Returns the counter of a refusal; `ok` and `internal` share refused_internal.
[[nodiscard]] constexpr Counter counter_of(StatusCode code) noexcept {
  switch (code) {
    case StatusCode::wrong_version:
      return Counter::refused_wrong_version;
    case StatusCode::oversize:
      return Counter::refused_oversize;
    case StatusCode::malformed:
      return Counter::refused_malformed;
    case StatusCode::unknown_entity:
      return Counter::refused_unknown_entity;
    case StatusCode::invalid_pose:
      return Counter::refused_invalid_pose;
    case StatusCode::time_backwards:
      return Counter::refused_time_backwards;
    case StatusCode::duplicate_frame:
      return Counter::refused_duplicate_frame;
    case StatusCode::unknown_channel:
      return Counter::refused_unknown_channel;
    case StatusCode::not_allowed:
      return Counter::refused_not_allowed;
    case StatusCode::overloaded:
      return Counter::refused_overloaded;
    case StatusCode::invalid_environment:
      return Counter::refused_invalid_environment;
    case StatusCode::invalid_view:
      return Counter::refused_invalid_view;
    case StatusCode::invalid_part:
      return Counter::refused_invalid_part;
    case StatusCode::unknown_part:
      return Counter::refused_unknown_part;
    case StatusCode::ok:
    case StatusCode::internal:
      break;
  }
  return Counter::refused_internal;
}

}  // namespace emit::server
