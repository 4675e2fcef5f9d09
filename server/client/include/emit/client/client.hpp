// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/client/security.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"
#include "emit/protocol/control.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/host_frame.hpp"
#include "emit/protocol/output_geometry.hpp"
#include "emit/protocol/parity.hpp"
#include "emit/protocol/reassembler.hpp"

namespace emit::v1 {
class JournalEntry;
}

/// Client side of the wire protocol, for the tool, for tests and for integrators' programs.
/// Blocking with a timeout; one thread per object. Timeouts are in ns of the monotonic clock; 0
/// polls.
namespace emit::client {

inline constexpr std::int64_t kConnectTimeoutNs = 5'000'000'000;

/// scheme://host:port; schemes tcp and udp, IPv6 hosts in brackets. shm://name: frames only.
struct Url {
  enum class Scheme : std::uint8_t { tcp, udp, shm };
  Scheme scheme = Scheme::tcp;
  std::string host;  ///< shm: the name
  std::uint16_t port = 0;
};
/// tcp and udp. Errors (invalid_argument): anything else, naming the text.
[[nodiscard]] physics::Result<Url> parse_url(const std::string& text);
/// Parses the URL of a stream of frames: tcp, udp or shm. Errors (invalid_argument): anything else.
[[nodiscard]] physics::Result<Url> parse_frame_url(const std::string& text);

/// emit.v1.Status as plain data; `code` has the values of Status::Code (1 = OK).
struct ServerStatus {
  std::uint32_t code = 0;
  std::string text;
  std::uint64_t host_frame_number = 0;
  std::uint64_t count = 0;
  [[nodiscard]] bool ok() const noexcept { return code == 1; }
};

struct ChannelDescription {
  std::uint32_t index = 0;
  std::string name;
  std::string kind;  ///< "injection" or "projector"
  std::string sensor;
  std::string band;
  double band_lo_um = 0.0;
  double band_hi_um = 0.0;
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  /// Spectral response of the band; empty: a perfect rectangle; absent: the daemon does not say.
  std::optional<std::vector<physics::ResponsePoint>> response = std::nullopt;
  std::uint32_t every_nth = 1;          ///< shows frames 1, 1 + n, 1 + 2 n, ... of every run
  std::uint32_t look_ahead_frames = 0;  ///< shows the scene so many frames later, as predicted
  std::uint32_t window_x_px = 0;        ///< where its image lies in the sensor's
  std::uint32_t window_y_px = 0;
  std::uint32_t sensor_width_px = 0;  ///< 0: the daemon does not say
  std::uint32_t sensor_height_px = 0;
  std::uint32_t window_width_px = 0;  ///< size of that part of the sensor's image
  std::uint32_t window_height_px = 0;
  std::uint16_t output_steps = 0;  ///< protocol::OutputSteps: what is done to its pixels
  /// Quantity of its pixels; absent: the daemon does not say.
  std::optional<protocol::PixelQuantity> quantity = std::nullopt;

  /// Returns the place in the sensor's image that a place of a frame shows. Both count in px from
  /// the top left corner, and pixel (0, 0) has its centre at (0.5, 0.5). Absent where only the
  /// distortion map of the channel knows. A shift that emitd has applied (FrameHeader::
  /// applied_shift_*_px) is not part of it: subtract it from the result.
  [[nodiscard]] std::optional<protocol::ImagePoint> sensor_point(
      const protocol::ImagePoint& frame_point) const noexcept;
  /// Returns the band with which radiances are converted: a rectangle where the response is not
  /// known. Absent for a channel without a band, or with one that makes no sense.
  [[nodiscard]] std::optional<physics::Band> spectral_band() const;
};

/// Description of the daemon, received on connecting.
struct ServerInfo {
  std::string software;
  std::string scenario;
  std::string pacing;
  std::string device;
  std::uint64_t run_id = 0;
  bool tai_offset_unset = false;
  bool sends_journal_end = false;  ///< RecorderClient can tell an end in order from a broken one
  std::vector<ChannelDescription> channels;
};

/// Names a channel by any of the four; empty matches anything, the first match is taken.
struct SubscribeOptions {
  std::string channel_name;
  std::string channel_kind;
  std::string sensor;
  std::string band;
  /// No frame is skipped because this client is slow: where it falls behind, the daemon disconnects
  /// it (tcp, udp), or receive() fails (shm).
  bool every_frame = false;
  /// 1..kMaxEveryNth: frames 1, 1 + n, 1 + 2 n, ... of every run; what is left out is no gap. Of a
  /// channel that shows every m-th frame, n times m.
  std::uint32_t every_nth = 1;
  bool compression = false;                  ///< TCP: lossless, where the daemon grants it
  std::uint32_t fragment_payload_bytes = 0;  ///< UDP; 0 = daemon's choice
  std::string multicast_group;               ///< UDP; empty = unicast
  std::uint16_t udp_port = 0;                ///< UDP; 0 = any free port
  /// shm: pixels are not copied but stay where the daemon writes them: see FrameClient::intact().
  bool in_place = false;
  /// UDP: error correction; absent = daemon's choice, off() = none. FrameClient::terms() has what
  /// came of it.
  std::optional<protocol::FecParams> fec;
  /// UDP unicast, daemon in host-step: missing fragments are asked for again.
  bool resend = false;
  /// UDP: the port that the daemon sends to, where a relay on this host takes the datagrams first;
  /// 0 = this client's own.
  std::uint16_t announced_udp_port = 0;
};

/// Terms that the daemon granted a subscription.
struct StreamTerms {
  protocol::FecParams fec;
  bool resend = false;
  bool compression = false;
  std::uint32_t every_nth =
      1;  ///< of the daemon's frames: the requested step times the channel's own
  std::uint16_t udp_port = 0;  ///< where this client receives; 0: not over UDP
  /// UDP: payload of every fragment but the last, which need not be what was asked for; 0: TCP, or
  /// an older daemon.
  std::uint32_t fragment_payload_bytes = 0;
};

/// Pixels stay valid until the next receive().
struct ReceivedFrame {
  /// Set here: kFlagPartial when fragments are missing, kFlagCorrupt when none is but the checksum
  /// is wrong, kFlagLostBefore with frames_lost_before.
  protocol::FrameHeader header;
  std::span<const float> pixels;     ///< width_px * height_px; missing pixels are 0
  std::uint64_t missing_px = 0;      ///< of a partial frame
  protocol::PixelValidity validity;  ///< of a partial frame: which pixels arrived
  /// False: both headers of a partial frame were lost: only size, band and sim_time_ns are known.
  bool header_known = true;
  std::uint32_t repaired_fragments = 0;  ///< brought back by error correction
  std::uint32_t resent_fragments = 0;    ///< that this client asked for again
  /// UDP: sent between the frame handed out before and this one, and lost or unusable.
  std::uint32_t frames_lost_before = 0;
  std::uint64_t encoded_bytes = 0;  ///< of the pixels on their way; 0: raw
  std::int64_t first_byte_ns = 0;   ///< wall (TAI), when this client began to have it
  std::int64_t last_byte_ns = 0;
};

struct ReceiveCounters {
  std::uint64_t received = 0;  ///< complete frames
  std::uint64_t partial = 0;   ///< delivered with missing pixels
  std::uint64_t lost = 0;      ///< frames that did not come and were not announced as skipped
  std::uint64_t gaps = 0;      ///< announced skips (frames with kFlagGapBefore)
  std::uint64_t skipped = 0;   ///< frame numbers missing at announced skips, less what was lost
  std::uint64_t crc_errors = 0;
  std::uint64_t os_drops = 0;  ///< datagrams the kernel dropped for want of buffer space
  std::uint64_t bad_datagrams = 0;
  std::uint64_t foreign_datagrams = 0;  ///< of other streams, or not from the daemon's address
  std::uint64_t late = 0;               ///< frames with kFlagLate
  std::uint64_t repeated = 0;           ///< frames with kFlagRepeated
  std::uint64_t repaired = 0;           ///< fragments brought back by error correction
  std::uint64_t repaired_frames = 0;    ///< complete frames among whose fragments those were
  std::uint64_t unrepairable = 0;       ///< groups of fragments that lost more than their parity
  std::uint64_t resend_requests = 0;
  std::uint64_t resent = 0;  ///< fragments that came because they were asked for

  /// Adds the counts of a second connection that followed the first one.
  ReceiveCounters& operator+=(const ReceiveCounters& other) noexcept;
};

/// Receives frames. tcp://host:port: frames on the control connection; udp://host:port: control
/// over TCP to host:port, frames as UDP fragments; shm://name: from the memory of a daemon on this
/// host, which neither knows nor waits for its readers.
class FrameClient {
 public:
  /// Hello and Welcome. Errors: io (refused, timeout, TLS), protocol (version), config (files of
  /// `security`).
  [[nodiscard]] static physics::Result<std::unique_ptr<FrameClient>> connect(
      const std::string& url, std::int64_t timeout_ns = kConnectTimeoutNs,
      const Security& security = {});
  virtual ~FrameClient() = default;

  [[nodiscard]] virtual const ServerInfo& server() const noexcept = 0;
  /// Once. Errors: protocol with the daemon's status text (unknown channel, too many clients), or
  /// where a daemon does not know every_nth; invalid_argument (every_nth).
  [[nodiscard]] virtual physics::Result<ChannelDescription> subscribe(
      const SubscribeOptions& options) = 0;

  /// Returns what the daemon granted.
  /// @pre subscribe() succeeded
  [[nodiscard]] virtual const StreamTerms& terms() const noexcept = 0;

  /// Next frame in order; null when the timeout ran out first. Errors: io (connection closed),
  /// protocol (stream broken). After an error the client is of no further use.
  [[nodiscard]] virtual physics::Result<const ReceivedFrame*> receive(std::int64_t timeout_ns) = 0;
  /// Returns false when the daemon has overwritten a frame's pixels since receive(), so that
  /// results made of them are void. Only with SubscribeOptions::in_place; call it after the last
  /// use of the pixels. Without that option it is always true.
  [[nodiscard]] virtual bool intact() const noexcept = 0;

  [[nodiscard]] virtual const ReceiveCounters& counters() const noexcept = 0;
  /// Statuses the daemon sent in between, oldest first; clears the list.
  [[nodiscard]] virtual std::vector<ServerStatus> take_statuses() = 0;

  /// Bytes that the kernel granted for UDP, in the unit of net.core.rmem_max; 0 for TCP.
  [[nodiscard]] virtual std::uint64_t receive_buffer_bytes() const noexcept = 0;
  /// Empty when the buffer holds at least 4 frames; otherwise one line on how to raise the limit.
  [[nodiscard]] virtual std::string receive_buffer_advice() const = 0;
};

/// Sends poses. udp://host:port is the daemon's host port (datagrams, frames only);
/// tcp://host:port its control port (frames and commands).
class HostClient {
 public:
  [[nodiscard]] static physics::Result<std::unique_ptr<HostClient>> connect(
      const std::string& url, std::int64_t timeout_ns = kConnectTimeoutNs,
      const Security& security = {});
  virtual ~HostClient() = default;

  /// TCP: waits up to `timeout_ns` for room. UDP: one datagram. Errors: io, timeout included.
  [[nodiscard]] virtual physics::Result<void> send(const protocol::HostFrameData& frame,
                                                   std::int64_t timeout_ns = 5'000'000'000) = 0;
  /// TCP only. The answer comes through receive_status().
  [[nodiscard]] virtual physics::Result<void> command(protocol::CommandKind command,
                                                      std::int64_t timeout_ns = 5'000'000'000) = 0;
  /// Empty when the timeout ran out. Errors: io (connection closed), protocol.
  [[nodiscard]] virtual physics::Result<std::optional<ServerStatus>> receive_status(
      std::int64_t timeout_ns) = 0;
  /// TCP only: null over UDP.
  [[nodiscard]] virtual const ServerInfo* server() const noexcept = 0;
};

/// Entries of the run that a daemon no longer held when a recorder connected.
struct JournalGap {
  std::uint64_t first_sequence = 0;  ///< 0: nothing is missing
  std::uint64_t last_sequence = 0;
  [[nodiscard]] std::uint64_t entries() const noexcept {
    return first_sequence == 0 ? 0 : last_sequence - first_sequence + 1;
  }
};

/// Receives the journal over tcp://host:port, from the start of the current run as far as the
/// daemon still holds it.
class RecorderClient {
 public:
  [[nodiscard]] static physics::Result<std::unique_ptr<RecorderClient>> connect(
      const std::string& url, std::int64_t timeout_ns = kConnectTimeoutNs,
      const Security& security = {});
  virtual ~RecorderClient() = default;

  [[nodiscard]] virtual const ServerInfo& server() const noexcept = 0;
  /// False when the timeout ran out. Errors: io (connection closed; see closed()), protocol.
  [[nodiscard]] virtual physics::Result<bool> receive(v1::JournalEntry& entry,
                                                      std::int64_t timeout_ns) = 0;
  /// Returns true after the daemon closed the connection in order: everything came that it had.
  /// False after an error means that the connection broke: the daemon was killed, the network
  /// failed, or this recorder fell behind. A daemon of version 0.1 does not send the end of the
  /// journal (ServerInfo::sends_journal_end); any close between two records counts as in order
  /// then.
  [[nodiscard]] virtual bool closed() const noexcept = 0;
  /// Returns the entries of the run that came before the first one received and are lost. Valid
  /// once receive() has returned an entry.
  [[nodiscard]] virtual const JournalGap& gap() const noexcept = 0;
};

}  // namespace emit::client
