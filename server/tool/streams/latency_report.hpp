// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <string>

#include "emit/protocol/frame_header.hpp"
#include "tool/support/json.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {

/// Splits the time between the sending of a pose and the first frame that shows it into stages, by
/// the header's instants. All clocks are TAI. Thread: one owner.
class LatencyReport {
 public:
  /// Adds a frame. `sent_ns` is the instant before the pose was given to the kernel. `last_byte_ns`
  /// is the instant when the frame was complete here.
  void add(const protocol::FrameHeader& header, std::int64_t sent_ns, std::int64_t last_byte_ns);

  [[nodiscard]] const Samples& total_us() const noexcept { return stages_[kTotal]; }
  /// Returns true when frames belong to slots (ig-clock, trigger). Only then is there a sampling
  /// stage.
  [[nodiscard]] bool slotted() const noexcept { return !stages_[kSampling].empty(); }
  [[nodiscard]] std::string table() const;
  /// Returns `p50_us,p99_us,p999_us,max_us` and mean of one stage.
  [[nodiscard]] static Json figures(const Samples& samples_us);
  /// Returns a list of objects: `stage` and its figures; the last is `total`.
  [[nodiscard]] Json stages_json() const;

 private:
  enum Stage : std::size_t {
    kInbound,
    kSampling,
    kWait,
    kRender,
    kReadback,
    kHandOver,
    kTransport,
    kTotal,
    kStages
  };
  static constexpr std::array<const char*, kStages> kKeys{
      "inbound", "sampling", "wait", "render", "readback", "hand_over", "transport", "total"};
  static constexpr std::array<const char*, kStages> kNames{"pose sent -> received by the kernel",
                                                           "pose received -> slot begins",
                                                           "slot or pose -> render start",
                                                           "render start -> render end",
                                                           "render end -> read back",
                                                           "read back -> send start",
                                                           "send start -> last byte",
                                                           "pose sent -> last byte"};

  std::array<Samples, kStages> stages_;
};

}  // namespace emit::tool
