// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/frame_recorder.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "emit/protocol/record/frame_log.hpp"
#include "emit/v1/control.pb.h"
#include "emit/v1/frame.pb.h"
#include "tool/support/frame_files.hpp"

namespace emit::tool {
namespace {

using physics::Result;

void fill_channel(const client::ChannelDescription& channel, v1::ChannelInfo& out) {
  out.set_index(channel.index);
  out.set_name(channel.name);
  out.set_kind(channel.kind);
  out.set_sensor(channel.sensor);
  out.set_band(channel.band);
  out.set_band_lo_um(channel.band_lo_um);
  out.set_band_hi_um(channel.band_hi_um);
  if (channel.response) {
    for (const physics::ResponsePoint& point : *channel.response) {
      out.add_response_um(point.wavelength_um);
      out.add_response_frac(point.response_frac);
    }
    out.set_band_is_rectangle(channel.response->empty() && channel.band_hi_um > channel.band_lo_um);
  }
  out.set_width_px(channel.width_px);
  out.set_height_px(channel.height_px);
  out.set_every_nth(channel.every_nth);
  out.set_look_ahead_frames(channel.look_ahead_frames);
  out.set_window_x_px(channel.window_x_px);
  out.set_window_y_px(channel.window_y_px);
  out.set_sensor_width_px(channel.sensor_width_px);
  out.set_sensor_height_px(channel.sensor_height_px);
}

}  // namespace

FrameRecorder::FrameRecorder(std::unique_ptr<client::FrameClient> client,
                             client::ChannelDescription channel)
    : client_(std::move(client)),
      channel_(std::move(channel)),
      encoder_(std::size_t{channel_.width_px} * channel_.height_px * sizeof(float)) {}

Result<FrameRecorder> FrameRecorder::connect(const std::string& url,
                                             const std::string& channel_name,
                                             const client::Security& security) {
  auto client = client::FrameClient::connect(url, client::kConnectTimeoutNs, security);
  if (!client) return tl::unexpected(client.error());
  client::SubscribeOptions options;
  options.channel_name = channel_name;
  options.every_frame = true;
  auto channel = (*client)->subscribe(options);
  if (!channel) return tl::unexpected(channel.error());
  return FrameRecorder(std::move(*client), std::move(*channel));
}

Result<bool> FrameRecorder::take(protocol::LogWriter& log, std::int64_t timeout_ns) {
  bool any = false;
  for (;;) {
    const auto frame = client_->receive(any ? 0 : timeout_ns);
    if (!frame) return tl::unexpected(frame.error());
    if (*frame == nullptr) return any;
    any = true;
    if (auto written = write(log, **frame); !written) return tl::unexpected(written.error());
  }
}

Result<void> FrameRecorder::write(protocol::LogWriter& log, const client::ReceivedFrame& frame) {
  const protocol::FrameHeader& header = frame.header;
  // The client counts a damaged frame, see lost().
  if ((header.flags & (protocol::kFlagPartial | protocol::kFlagCorrupt)) != 0) return {};
  v1::RecordedFrame message;
  message.set_run_id(header.run_id);
  message.set_frame_number(header.frame_number);
  message.set_sim_time_ns(header.sim_time_ns);
  message.set_flags(header.flags);
  fill_channel(channel_, *message.mutable_channel());
  message.set_width_px(header.width_px);
  message.set_height_px(header.height_px);
  message.set_unit(std::string(pixel_unit(header.quantity)));
  protocol::set_pixels(message, frame.pixels, encoder_);
  std::array<std::byte, protocol::kFrameHeaderBytes> bytes{};
  protocol::FrameHeader raw = header;
  raw.encoding = protocol::PixelEncoding::raw;
  raw.encoded_bytes = 0;
  protocol::encode(raw, bytes);
  message.set_header(bytes.data(), bytes.size());
  ++images_;
  raw_bytes_ += frame.pixels.size_bytes();
  stored_bytes_ += message.pixels().size();
  const Key key{header.run_id, header.frame_number};
  newest_image_ = key;
  compare(of_journal_, of_images_, key, message.crc32c());
  return log.write_frame(message, std::max<std::int64_t>(frame.last_byte_ns, 0));
}

void FrameRecorder::note(const v1::JournalEntry& entry) {
  if (entry.has_run_start()) run_id_ = entry.run_start().run_id();
  if (!entry.has_frame()) return;
  const v1::FrameDecision& frame = entry.frame();
  const Key key{run_id_, frame.frame_number()};
  if (protocol::is_every_nth(frame.frame_number(), std::max(channel_.every_nth, 1U))) {
    newest_in_journal_ = key;
  }
  // The journal has the checksum of one channel's image.
  if (frame.radiance_channel() != channel_.index) return;
  compare(of_images_, of_journal_, key, frame.radiance_crc32c());
}

void FrameRecorder::compare(std::map<Key, std::uint32_t>& with,
                            std::map<Key, std::uint32_t>& keep_in, const Key& key,
                            std::uint32_t crc) {
  const auto other = with.find(key);
  if (other != with.end()) {
    ++compared_;
    if (other->second != crc) ++differ_;
    with.erase(other);
    return;
  }
  keep_in[key] = crc;
  // Images that came before the journal, or entries from before the subscription, have no partner.
  constexpr std::size_t kMaxWaiting = 100'000;
  if (keep_in.size() > kMaxWaiting) keep_in.erase(keep_in.begin());
}

bool FrameRecorder::waits() const noexcept {
  if (!newest_in_journal_ || !newest_image_) return false;
  return newest_image_->first != newest_in_journal_->first ||
         newest_image_->second < newest_in_journal_->second;
}

std::uint64_t FrameRecorder::lost() const noexcept {
  const client::ReceiveCounters& counters = client_->counters();
  return counters.lost + counters.skipped + counters.partial + counters.crc_errors;
}

}  // namespace emit::tool
