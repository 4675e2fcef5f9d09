// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <string>

#include "emit/client/client.hpp"
#include "tool/support/json.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {

/// Statistics of the headers of one client's frames: stage times, total delays, flags. The header's
/// instants and this machine's are both TAI. Across machines the delays are only as exact as the
/// clocks agree. Thread: one owner.
class StreamReport {
 public:
  /// @param every_nth  every n-th frame was requested; the frames in between are no gap
  explicit StreamReport(std::uint32_t every_nth = 1);

  void add(const client::ReceivedFrame& frame);
  /// Begins a new connection. Numbers that are missing before its first frame are no gap, because
  /// the client was not connected.
  void begin_connection() noexcept {
    last_run_ = 0;
    last_byte_ns_ = 0;
  }
  /// Returns the number of daemon runs that frames came from.
  [[nodiscard]] std::uint64_t runs() const noexcept { return runs_; }

  [[nodiscard]] std::uint64_t frames() const noexcept { return frames_; }
  /// Bytes of pixels in all frames, and the bytes that were sent for them. Compression makes the
  /// second number smaller.
  [[nodiscard]] std::uint64_t pixel_bytes() const noexcept { return pixel_bytes_; }
  [[nodiscard]] std::uint64_t sent_pixel_bytes() const noexcept { return sent_pixel_bytes_; }
  [[nodiscard]] std::uint64_t flagged(protocol::FrameFlags flag) const;
  /// Returns the number of frames with more numbers missing before them than were lost on the way,
  /// and without the flag gap_before.
  [[nodiscard]] std::uint64_t unflagged_gaps() const noexcept { return unflagged_gaps_; }

  /// Time from the reception of the pose to the last byte of the frame here, ms. Frames without a
  /// pose are left out.
  [[nodiscard]] const Samples& pose_to_received_ms() const noexcept { return stages_[kTotal]; }
  /// Time from the first byte given to the kernel to the last byte here, ms.
  [[nodiscard]] const Samples& send_to_received_ms() const noexcept { return stages_[kTransport]; }
  /// Time from pixels in CPU memory to this client's turn, ms: the daemon's own share.
  [[nodiscard]] const Samples& ready_to_send_ms() const noexcept { return stages_[kHandOver]; }
  /// Time from pixels in CPU memory to the last byte here, ms: the share of the daemon and the
  /// wire.
  [[nodiscard]] const Samples& ready_to_received_ms() const noexcept { return ready_ms_; }

  /// Time from the last byte of one frame to the last byte of the next, ms.
  [[nodiscard]] const Samples& interval_ms() const noexcept { return interval_ms_; }

  /// Pointing errors of projected frames that carry no flag motion_fault, px.
  [[nodiscard]] const Samples& pointing_px() const noexcept { return pointing_px_; }
  /// Returns one line about the motion simulator; empty where none is driven.
  [[nodiscard]] std::string motion_line() const;

  /// Returns the table of stages: median, p99 and largest, ms.
  [[nodiscard]] std::string stage_table() const;
  [[nodiscard]] Json stages_json() const;
  [[nodiscard]] Json flags_json() const;
  [[nodiscard]] Json motion_json() const;

 private:
  enum Stage : std::size_t { kQueue, kRender, kReadback, kHandOver, kTransport, kTotal, kStages };
  static constexpr std::array<const char*, kStages> kNames{
      "pose received -> render start", "render start -> render end", "render end -> read back",
      "read back -> send start",       "send start -> received",     "pose received -> received"};
  static constexpr std::array<const char*, kStages> kKeys{
      "queue_ms", "render_ms", "readback_ms", "hand_over_ms", "transport_ms", "total_ms"};

  /// The number of samples is limited because a client may run for weeks.
  static constexpr std::size_t kMaxSamples = 1u << 18;

  std::array<Samples, kStages> stages_;
  Samples ready_ms_{kMaxSamples};
  Samples interval_ms_{kMaxSamples};
  Samples pointing_px_{kMaxSamples};
  double pointing_squares_px2_ = 0.0;
  std::uint64_t motion_frames_ = 0;  // with a motion simulator
  std::uint64_t shifted_frames_ = 0;
  float largest_shift_px_ = 0.0F;
  std::int64_t last_byte_ns_ = 0;  // of the frame before, on this connection
  std::array<std::uint64_t, 32> flag_counts_{};
  std::uint64_t frames_ = 0;
  std::uint64_t pixel_bytes_ = 0;
  std::uint64_t sent_pixel_bytes_ = 0;
  std::uint64_t unflagged_gaps_ = 0;
  std::uint32_t every_nth_;
  std::uint64_t runs_ = 0;
  std::uint64_t newest_run_ = 0;
  std::uint64_t last_run_ = 0;  // on this connection; 0: none yet
  std::uint64_t last_number_ = 0;
};

[[nodiscard]] Json latency_json(const Samples& samples_ms);
[[nodiscard]] std::string latency_line(const std::string& name, const Samples& samples_ms);
[[nodiscard]] Json counters_json(const client::ReceiveCounters& counters);
[[nodiscard]] std::string channel_text(const client::ChannelDescription& channel);

}  // namespace emit::tool
