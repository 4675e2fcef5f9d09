// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>

#include "emit/protocol/cigi/host_packets.hpp"
#include "emit/protocol/cigi/writer.hpp"
#include "emit/scene/scene_desc.hpp"
#include "rt/picture_board.hpp"

namespace emit::server {

/// Returns the settings that Sensor Control asks for (docs/cigi.md). With half gain and half level
/// the limits are those of `display`. Gain, the contrast, divides their distance by 10^(2 g - 1);
/// level, the brightness, moves their middle from one end of `display` to the other. RT-safe.
[[nodiscard]] PictureSettings picture_settings(const protocol::cigi::SensorControl& packet,
                                               const scene::DisplayOptions& display) noexcept;

/// Sensor Control of a CIGI host: what people see of the sensor's image, and the answers of a
/// tracker that emitd does not have. Frames stay as they are. RT-safe.
class CigiPicture {
 public:
  /// @param view  number of the view that shows the sensor
  /// @param board  takes the settings; it outlives the object; null: nobody looks
  CigiPicture(std::uint16_t view, const scene::DisplayOptions& display,
              PictureBoard* board) noexcept
      : view_(view), display_(display), board_(board) {}

  /// Returns false for another view.
  bool take(const protocol::cigi::SensorControl& packet) noexcept;
  void clear() noexcept;
  /// Adds the answer of the tracker while one is asked for: it searches, because there is none.
  /// @param ig_frame  number of the Start Of Frame of the message
  void answer(protocol::cigi::Writer& writer, std::uint32_t ig_frame) const noexcept;

 private:
  std::uint16_t view_;
  scene::DisplayOptions display_;
  PictureBoard* board_;
  std::optional<protocol::cigi::SensorControl> sensor_;  ///< the newest of this run
};

}  // namespace emit::server
