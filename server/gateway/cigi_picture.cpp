// SPDX-License-Identifier: Apache-2.0
#include "gateway/cigi_picture.hpp"

#include <cmath>

#include "emit/protocol/cigi/ig_packets.hpp"

namespace emit::server {

namespace cigi = protocol::cigi;

PictureSettings picture_settings(const cigi::SensorControl& packet,
                                 const scene::DisplayOptions& display) noexcept {
  const double range_k = display.max_k - display.min_k;
  const double width_k = range_k * std::pow(10.0, 1.0 - 2.0 * double{packet.gain});
  // More brightness shows colder bodies in mid grey where hot is white, and hotter ones otherwise.
  const double brighter_k = (double{packet.level} - 0.5) * range_k;
  const double middle_k =
      0.5 * (display.min_k + display.max_k) + (packet.black_hot ? brighter_k : -brighter_k);
  PictureSettings out;
  out.on = packet.on;
  out.black_hot = packet.black_hot;
  out.automatic_gain = packet.automatic_gain;
  out.low_k = static_cast<float>(middle_k - 0.5 * width_k);
  out.high_k = static_cast<float>(middle_k + 0.5 * width_k);
  return out;
}

bool CigiPicture::take(const cigi::SensorControl& packet) noexcept {
  if (packet.view_id != view_) return false;
  sensor_ = packet;
  if (board_ != nullptr) board_->set(picture_settings(packet, display_));
  return true;
}

void CigiPicture::clear() noexcept {
  sensor_.reset();
  if (board_ != nullptr) board_->clear();
}

void CigiPicture::answer(cigi::Writer& writer, std::uint32_t ig_frame) const noexcept {
  if (!sensor_ || !sensor_->on || sensor_->track_mode == cigi::TrackMode::off) return;
  const auto fill = [&](auto response) {
    response.view_id = sensor_->view_id;
    response.sensor_id = sensor_->sensor_id;
    response.state = cigi::TrackState::searching;
    response.ig_frame = ig_frame;
    static_cast<void>(writer.add(response));  // it comes second, where there is room
  };
  if (sensor_->extended_response) {
    fill(cigi::SensorExtendedResponse{});
  } else {
    fill(cigi::SensorResponse{});
  }
}

}  // namespace emit::server
